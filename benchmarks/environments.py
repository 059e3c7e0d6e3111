"""Random episodes in every environment: does one fail, and how many steps are there to a second of processor time?

    python benchmarks/environments.py [Coil Grasp ...] [--episodes 1000] [--softrobot]

Beside it stands the compiled step alone, in the same run, and with ``--softrobot`` gym-softrobot, if it is installed.
"""

import argparse
import sys
from time import perf_counter, process_time

import numpy as np

from octoctrl.connect.environments import ENVIRONMENTS
from octoctrl.connect.vector import ThreadedEnv
from octoctrl.sim.plants import make_plant


def kernel_rate(seconds=1.0):
    """Compiled calls of 0.05 s of arm to a second of processor time, under levels that are there already."""
    plant = make_plant("rod")
    levels = {"arm": np.full((plant.clock.samples(0.05) + 1, 11, plant.elements), 0.1)}
    plant.core.move(0, levels, plant.clock)
    begin, count = process_time(), 0
    while process_time() - begin < seconds:
        plant.core.move(0, levels, plant.clock)
        count += 1
    return count / (process_time() - begin)


def episodes(kind, count):
    """Steps, unstable episodes, successes, and steps to a second of processor time, all in random episodes."""
    env, steps, unstable, reached = kind(), 0, 0, 0
    env.action_space.seed(0)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    begin = process_time()
    for seed in range(count):
        env.reset(seed=seed)
        over = False
        while not over:
            seen, reward, ended, cut, info = env.step(env.action_space.sample())
            assert env.observation_space.contains(seen) and np.isfinite(reward)
            over, steps, unstable, reached = ended or cut, steps + 1, unstable + info["unstable"], reached + info["is_success"]
    return steps, unstable, reached, steps / (process_time() - begin)


def softrobot_rate(seconds=5.0):
    """Steps of `SoftArmTracking-v0`, 10 ms each, to a second of processor time."""
    import gym_softrobot  # noqa: F401
    import gymnasium

    env = gymnasium.make("SoftArmTracking-v0")
    env.reset(seed=0)
    env.step(env.action_space.sample())
    begin, count = process_time(), 0
    while process_time() - begin < seconds:
        *_, ended, cut, _ = env.step(env.action_space.sample())
        count += 1
        if ended or cut:
            env.reset()
    return count / (process_time() - begin)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    known = {kind.__name__: kind for kind in ENVIRONMENTS}
    parser.add_argument("environments", nargs="*", choices=known, help="all if none is named")
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--softrobot", action="store_true")
    options = parser.parse_args()
    for kind in [known[name] for name in options.environments] or ENVIRONMENTS:
        before = kernel_rate()
        steps, unstable, reached, rate = episodes(kind, options.episodes)
        alone = (before + kernel_rate()) / 2
        said = f"{options.episodes} episodes, {steps} steps, {unstable} unstable, {reached} reached"
        print(f"{kind.__name__}: {said}; {rate:.0f} steps/s, {rate / alone:.2f} of the compiled step's {alone:.0f}/s", flush=True)
    many = ThreadedEnv(ENVIRONMENTS[0], 8, threads=2)
    many.reset(seed=0)
    begin, count = perf_counter(), 0
    while perf_counter() - begin < 5:
        many.step(many.action_space.sample())
        count += 8
    print(f"8 on 2 threads: {count / (perf_counter() - begin):.0f} steps to a second of wall time")
    if options.softrobot:
        print(f"gym-softrobot: {softrobot_rate():.0f} steps of 10 ms to a second of processor time")


if __name__ == "__main__":
    sys.exit(main())
