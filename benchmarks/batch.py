"""Throughput of a batch of rod arms against threads, and whether every arm moves as it would alone.

Run with ``python benchmarks/batch.py [--arms 64] [--threads 1 2] [--json FILE]`` (about half a minute). Each round moves all arms, with
activations and outlines of their own, once with every number of threads; the best of the rounds counts, because on a shared machine the
others measure the neighbours.
"""

import argparse
import json
import os
import resource
import time
from pathlib import Path

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.plants import Plant, warmup
from octoctrl.sim.running.batch import simulate_batch
from octoctrl.sim.templates import Plateau


def arms(count, seed=0):
    """Arms and activations: all groups, levels up to 0.5, rises of 0.2 to 1 s."""
    generator = np.random.default_rng(seed)
    plants = [Plant(Arm.octopus(taper=generator.uniform(6, 14), youngs_modulus=generator.uniform(8e3, 12e3))) for _ in range(count)]
    activations = [
        Activation(
            templates=tuple(
                Plateau(groups=(group,), level=generator.uniform(0, 0.5), rise=generator.uniform(0.2, 1.0)) for group in MUSCLE_GROUPS
            )
        )
        for _ in range(count)
    ]
    return plants, activations


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--arms", type=int, default=64)
    parser.add_argument("--threads", type=int, nargs="+", default=sorted({1, os.cpu_count()}))
    parser.add_argument("--duration", type=float, default=1.0, help="seconds of motion of each arm")
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    warmup()
    plants, activations = arms(options.arms)
    alone = [plant.advance(activation, options.duration) for plant, activation in zip(plants, activations, strict=True)]
    best, spent, equal = dict.fromkeys(options.threads, 0.0), dict.fromkeys(options.threads, np.inf), True
    for _ in range(options.rounds):
        for threads in options.threads:
            for plant in plants:
                plant.reset()
            begin = time.process_time()
            result = simulate_batch(plants, activations, options.duration, threads=threads)
            spent[threads] = min(spent[threads], (time.process_time() - begin) / result.arm_seconds)
            best[threads] = max(best[threads], result.throughput)
            result.raise_if_failed()
            equal &= all(np.array_equal(one.points, other.points) for one, other in zip(alone, result.recordings, strict=True))
    one = best[options.threads[0]]
    print(f"{options.arms} arms, all {len(MUSCLE_GROUPS)} groups active, {options.duration:g} s each, {os.cpu_count()} cores")
    print(f"{'threads':>8} {'arm-seconds per second':>24} {'ratio':>7} {'CPU ms per arm-second':>23}")
    for threads in options.threads:
        print(f"{threads:8d} {best[threads]:24.0f} {best[threads] / one:7.2f} {1e3 * spent[threads]:23.2f}")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"every arm as it moves alone, bit by bit: {'yes' if equal else 'NO'}; at most {memory:.0f} MB of memory")
    if options.json:
        options.json.write_text(json.dumps({"arms": options.arms, "throughput": best, "cpu_per_arm_second": spent, "equal": bool(equal)}))


if __name__ == "__main__":
    main()
