"""Speed of the arm plant against real time, with the tip's error against a converged reference.

Run with ``python benchmarks/plant_speed.py`` (about half a minute). Each programme runs at the default resolution and at others; the
reference has 192 elements and a step of 30 us. Errors are distances of the tip over the arm's length: the largest over the run, and the
root mean square over time. Times are the best of three; compilation is not counted.
"""

import time
from itertools import product

import numpy as np

from octoctrl.sim.activation import Activation, Plateau
from octoctrl.sim.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS, Arm
from octoctrl.sim.plant import Plant, warmup

END = 0.1977777778


def programme(*drives):
    return Activation(templates=tuple(Plateau(groups=groups, level=level, **more) for groups, level, more in drives))


PROGRAMMES = {
    "none": (programme(), 2.0),
    "one: R-OM": (programme((("R-OM",), 0.3, {})), 2.0),
    "one: LM1": (programme((("LM1",), 0.3, {})), 4.0),
    "one: LM1 at 1": (programme((("LM1",), 1.0, {})), 4.0),
    "all, Fig 2c": (
        programme(
            ((*LONGITUDINAL_GROUPS, "TM"), 0.001, {"rise": 0.01}),
            (("R-OM",), 0.3, {"offset": 3.0, "window": (0.0, END)}),
            (("LM1", "LM2", "LM8"), 0.3, {"onset": 1.5, "rise": 4.0, "window": (0.0, END)}),
            (("L-OM",), 0.3, {"onset": 4.1, "rise": 1.0, "window": (0.0, END)}),
        ),
        7.0,
    ),
    "all at 0.3": (programme((MUSCLE_GROUPS, 0.3, {})), 2.0),
}
RESOLUTIONS = {
    "default": {},
    "dt / 2": {"dt": 2.1e-4},
    "n = 72": {"arm": Arm.octopus(elements=72)},
    "n = 96": {"arm": Arm.octopus(elements=96)},
}


def timed(activation, duration, **settings):
    best = np.inf
    for _ in range(3):
        plant = Plant(**settings)
        begin = time.perf_counter()
        recording = plant.advance(activation, duration)
        best = min(best, time.perf_counter() - begin)
    return plant, recording, best


def main():
    warmup()
    print(f"{'groups active':>14} {'resolution':>10} {'n':>4} {'step ms':>8} {'x real time':>12} {'tip error max':>14} {'rms':>8}")
    references = {}
    for (name, (activation, duration)), (label, settings) in product(PROGRAMMES.items(), RESOLUTIONS.items()):
        if name not in references:
            references[name] = Plant(Arm.octopus(elements=192), dt=3e-5).advance(activation, duration)
        plant, recording, spent = timed(activation, duration, **settings)
        distance = np.linalg.norm(recording.tip - references[name].tip, axis=1) / plant.arm.length
        print(
            f"{name:>14} {label:>10} {plant.elements:4d} {plant.h * 1e3:8.3f} {duration / spent:12.0f} "
            f"{distance.max():14.2%} {np.sqrt(np.mean(distance**2)):8.2%}"
        )


if __name__ == "__main__":
    main()
