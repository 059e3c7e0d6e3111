"""The full arm in one thread and in two, in turns in one run: wall and processor time, memory, and whether bits are equal.

Run with ``python benchmarks/threads.py [PLANT ...] [--rounds 20] [--piece 0.1]`` (a minute for each plant, more if it has to be compiled);
PLANT is any of the full arms. Each round moves every arm on by a piece of time (s); the best of the rounds counts, because on a shared
machine the others measure the neighbours. Two threads need two cores that are free.
"""

import argparse
import resource
import time

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.assembly.meeting_kernels import cores
from octoctrl.sim.plants import make_plant
from octoctrl.sim.templates import Plateau
from octoctrl.tables import machine

MOVING = Activation(templates=(Plateau(groups=("R-OM", "LM1", "TM"), level=0.3, rise=0.05),))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("plants", nargs="*", default=["assembly-mixed", "assembly-coarse-mixed"])
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--piece", type=float, default=0.1)
    options = parser.parse_args()
    print(", ".join(f"{name} {value}" for name, value in machine().items()), f"{cores()} cores", sep=", ")
    print(f"{'plant':24}{'threads':>8}{'step, µs':>10}{'processor s per s':>19}{'wall s per s':>14}{'to one thread':>15}")
    for name in options.plants:
        arms = {threads: make_plant(name, threads=threads) for threads in (1, 2)}
        spent, passed, equal = {1: [], 2: []}, {1: [], 2: []}, True
        for _ in range(options.rounds + 1):  # of which the first compiles
            tips = []
            for threads, plant in arms.items():
                processor, wall = time.process_time(), time.perf_counter()
                tips.append(plant.advance(MOVING, options.piece).points[-1, -1])
                passed[threads].append((time.perf_counter() - wall) / options.piece)
                spent[threads].append((time.process_time() - processor) / options.piece)
            equal &= np.array_equal(*tips)
        for threads, plant in arms.items():
            ratio = min(passed[threads][1:]) / min(passed[1][1:])
            costs = f"{min(spent[threads][1:]):19.2f}{min(passed[threads][1:]):14.2f}{ratio:15.2f}"
            print(f"{name:24}{threads:8d}{1e6 * plant.h:10.1f}{costs}", flush=True)
        print(f"  the same bits: {'yes' if equal else 'NO'}")
    print(f"at most {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB of memory, with all arms and their compilers")


if __name__ == "__main__":
    main()
