"""kill -9 at random moments of runs: does every file open, and does the run that goes on end with the bits of the unbroken one?

    python benchmarks/kills.py PLAN.npz [--plant NAME] [--kills 20] [--each 3]

Each run is killed and gone on with a few times, then left to end; its arrays are compared with those of a run that nobody kills.
"""

import argparse
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import octoctrl as oc
from octoctrl.files.parts import folder_of, parts_in

PROGRAM = """
import sys
from octoctrl.carrying import run
from octoctrl.cli.application import main
run.KEPT_EVERY = run.WRITING = 0.0  # a part after each period
sys.exit(main())
"""


def start(folder, *arguments):
    return subprocess.Popen([sys.executable, "-c", PROGRAM, "run", *arguments, "-q"], cwd=folder, stdout=subprocess.DEVNULL)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("plan", type=Path)
    parser.add_argument("--plant", default="rod")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--each", type=int, default=3, help="kills of one run")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    chance, killed, opened, runs, equal = random.Random(options.seed), 0, 0, 0, 0
    plan = str(options.plan.resolve())
    with tempfile.TemporaryDirectory() as folder:
        begin = (plan, "--plant", options.plant, "--anyway", "-o", "run.npz", "-f")
        assert start(folder, *begin).wait() == 0
        whole, path = oc.load(f"{folder}/run.npz"), Path(folder) / "run.npz"
        periods = round(whole.recording.time[-1] / (whole.plan.period or 0.05))
        while killed < options.kills:
            path.unlink(missing_ok=True)
            arguments = begin
            for _ in range(min(options.each, options.kills - killed)):
                known = len(parts_in(folder_of(path))) if arguments is not begin else 0
                process, wanted = start(folder, *arguments), known + chance.randint(2, max(periods // (options.each + 1), 3))
                while process.poll() is None and len(parts_in(folder_of(path))) < wanted:
                    time.sleep(0.001)
                time.sleep(chance.uniform(0.0, 0.03))
                process.kill()
                killed += process.wait() == -9
                found = oc.load(path).recording
                opened += np.array_equal(found.points, whole.recording.points[: len(found.time)])
                arguments = ("--resume", "run.npz") if folder_of(path).exists() else begin
            if arguments is not begin:
                assert start(folder, *arguments).wait() == 0
            ended, runs = oc.load(path), runs + 1
            equal += ended.recording == whole.recording and ended.trace == whole.trace and ended.events == whole.events
    print(f"{options.plant}: {killed} kills, {opened} files opened with the right bits; {runs} runs, {equal} ended with the unbroken bits")
    return 0 if killed == opened and runs == equal else 1


if __name__ == "__main__":
    sys.exit(main())
