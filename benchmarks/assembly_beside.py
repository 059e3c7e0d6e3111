"""Processor time and memory of the full arms, each in a process of its own and in turns, beside those of another checkout.

Run with ``python benchmarks/assembly_beside.py [FOLDER] [--rounds 12] [--piece 0.1]`` (two minutes, more where code has to be compiled).
FOLDER is another checkout, such as an older commit (``git worktree add FOLDER COMMIT``), whose arms stand above ours: times are ratios to
the first line. Each round moves every arm on by a piece of time (s) with R-OM at 0.2; the best counts, because on a shared machine the
others measure the neighbours. Memory is the most that a process has taken that finds its compiled code on disk.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

WORKER = """
import resource, sys, time
from octoctrl.sim.activation import Activation
from octoctrl.sim.templates import Plateau
try:
    from octoctrl.sim.plants import make_plant
except ImportError:  # where it stood once
    from octoctrl.plants import make_plant
plant = make_plant(sys.argv[1])
moving = Activation(templates=(Plateau(groups=("R-OM",), level=0.2, rise=0.05),))
plant.advance(moving, 0.01)
for line in sys.stdin:
    piece, begin = float(line), time.process_time()
    plant.advance(moving, piece)
    spent = (time.process_time() - begin) / piece
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print("step", 1e6 * plant.h, spent, memory, flush=True)
"""
HERE = Path(__file__).parent.parent
OURS = ("assembly", "assembly-mixed", "assembly-coarse", "assembly-coarse-mixed")
THEIRS = ("assembly", "assembly-coarse")


def started(folder, plant):
    """A process that holds a plant of the checkout in `folder` and moves it on when it is told a time (s)."""
    command, path = [sys.executable, "-c", WORKER, plant], os.environ | {"PYTHONPATH": str(folder)}
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=folder, env=path, text=True)


def moved(process, piece):
    """Step (us), processor seconds per simulated second, and greatest memory so far (MB), after `piece` seconds of motion."""
    process.stdin.write(f"{piece}\n")
    process.stdin.flush()
    for line in process.stdout:
        if line.startswith("step "):
            return [float(word) for word in line.split()[1:]]
    raise SystemExit("a plant has ended early; its error stands above")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--rounds", type=int, default=12)
    parser.add_argument("--piece", type=float, default=0.1)
    options = parser.parse_args()
    theirs = [] if options.folder is None else [(options.folder.resolve(), plant) for plant in THEIRS]
    arms = [*theirs, *((HERE, plant) for plant in OURS)]
    for folder, plant in arms:  # compiles, and leaves
        moved(first := started(folder, plant), 0.01)
        first.communicate()
    processes, found = [started(*arm) for arm in arms], [[] for _ in arms]
    for _ in range(options.rounds):
        for process, seen in zip(processes, found, strict=True):
            seen.append(moved(process, options.piece))
    for process in processes:
        process.communicate()
    print(f"{'':40}{'step, us':>9}{'processor s per s':>19}{'to the first':>14}{'memory, MB':>12}")
    least = min(spent for _, spent, _ in found[0])
    for (folder, plant), seen in zip(arms, found, strict=True):
        step, _, memory = seen[-1]
        best, name = min(spent for _, spent, _ in seen), plant if folder == HERE else f"{plant} of {folder.name}"
        print(f"{name:40}{step:9.1f}{best:19.2f}{best / least:14.2f}{memory:12.0f}")


if __name__ == "__main__":
    main()
