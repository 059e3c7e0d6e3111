"""One rod in place of 197: how far the rod plant and the coarse arm are from the full arm, and what other lumped constants make of it.

Run with ``python benchmarks/rod_against_assembly.py`` (five minutes of processor time, ten with ``fit``). All plants carry out
closed-form programmes of every primitive, each muscle group coming up within `RISE` to one of `LEVELS`. Errors are differences to the full
arm, root mean square over the programme: twist and lifted writhe (modulo 2) in turns, length and tip in per cent of the arm's length.
Writhe counts only while neither arm is near a U-turn of its tip, where chance decides its branch. With ``fit`` behind the command the
constants of `LumpedSection` are fitted anew to the full arm; with ``coarse`` the coarse arm stands in for it, in a third of the time.
"""

import sys
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

import octoctrl as oc
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, LumpedSection
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.plants import warmup
from octoctrl.sim.templates import Plateau
from octoctrl.sim.topology.measures import measure

ARM = oc.Arm.octopus()
PUBLISHED = oc.Arm.octopus(lumped=LumpedSection.published())

PRIMITIVES = {
    "LM 8, 1, 2": ("LM8", "LM1", "LM2"),
    "all LM": LONGITUDINAL_GROUPS,
    "R-OM": ("R-OM",),
    "L-OM": ("L-OM",),
    "both OM": ("R-OM", "L-OM"),
    "TM": ("TM",),
}
LEVELS, RISE, DURATION, INTERVAL = (0.1, 0.3, 0.6), 0.4, 0.8, 0.05

OPENING = 0.15
"""Least 1 + tip . base at which writhe is compared."""

CONSTANTS = {
    "hoop_ratio": (0.3, 0.5), "oblique_passive": (0.1, 5.0), "ring_torsion": (0.001, 10.0), "longitudinal_stress": (0.3, 2.0),
    "oblique_stress": (0.3, 2.0),
}  # fmt: skip
"""What is fitted, and within which bounds; the straight rods twist as they are (`torsion` 1)."""

TWIST, LENGTH, TIP = 0.1, 0.01, 0.04
"""Errors that weigh alike in the fit: turns, and shares of the arm's length."""


def carried_out(plant, arm=ARM):
    """A recording of each programme, as far as it came."""
    runs = {}
    for name, groups in PRIMITIVES.items():
        for level in LEVELS:
            activation = Activation(templates=(Plateau(groups=groups, level=level, rise=RISE),))
            try:
                runs[name, level] = oc.make_plant(plant, arm).advance(activation, DURATION)
            except PlantUnstableError as error:
                print(f"  {plant}, {name} {level}: {error}")
                runs[name, level] = error.recording
    return runs


def seen(run, times):
    """Trace, opening of the tip against the base, length and tip (in arm lengths) at `times`."""
    trace = measure(run.time, run.points, run.frames).at(times)
    tip = np.stack([np.interp(times, run.time, column) for column in run.tip.T], axis=1) / ARM.length
    opening = np.interp(times, run.time, 1 + np.sum(run.frames[:, -1, 2] * run.frames[:, 0, 2], axis=1))
    return trace, opening, np.interp(times, run.time, run.length) / ARM.length, tip


def rms(values):
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


def errors(run, wanted):
    """Root mean square errors of twist, writhe, length and tip."""
    times = np.arange(INTERVAL, min(run.time[-1], wanted.time[-1]) + 1e-9, INTERVAL)
    (mine, open1, length1, tip1), (other, open2, length2, tip2) = seen(run, times), seen(wanted, times)
    writhe = (mine.lifted_writhe - other.lifted_writhe)[np.minimum(open1, open2) > OPENING]
    apart = np.linalg.norm(tip1 - tip2, axis=1)
    return np.array([rms(mine.twist - other.twist), rms(writhe - 2 * np.round(writhe / 2)), 100 * rms(length1 - length2), 100 * rms(apart)])


def table(columns, wanted):
    """Print errors of every programme; `columns` are labels and runs."""
    print(f"\n{'errors: twist, writhe, length %, tip %':26}" + "".join(f"{label:>34}" for label in columns))
    rows = {key: [errors(runs[key], wanted[key]) for runs in columns.values()] for key in wanted}
    rows["mean", ""] = list(np.mean(list(rows.values()), axis=0))
    for (name, level), found in rows.items():
        print(f"  {name:14} {level!s:9}" + "".join("     " + " ".join(f"{value:6.3f}" for value in row) for row in found))


def fit(wanted):
    """Constants with which the rod follows the `wanted` recordings best."""
    start = LumpedSection()
    scale = np.array([getattr(start, name) for name in CONSTANTS])

    def weighed(run):
        trace, _, length, tip = seen(run, np.arange(INTERVAL, DURATION + 1e-9, INTERVAL))
        return np.concatenate([trace.twist / TWIST, length / LENGTH, tip.ravel() / TIP])

    target = {key: weighed(run) for key, run in wanted.items()}

    def residual(factors):
        lumped = replace(start, **dict(zip(CONSTANTS, (factors * scale).tolist(), strict=True)))
        return np.concatenate([weighed(run) - target[key] for key, run in carried_out("rod", replace(ARM, lumped=lumped)).items()])

    bounds = np.array(list(CONSTANTS.values())).T / scale
    found = least_squares(residual, np.ones(len(scale)), bounds=bounds, diff_step=1e-2, loss="soft_l1", max_nfev=10)
    return replace(start, **dict(zip(CONSTANTS, (found.x * scale).tolist(), strict=True)))


def main():
    full = "assembly-coarse" if "coarse" in sys.argv[1:] else "assembly"
    warmup(full)
    wanted = carried_out(full)
    columns = {"rod, LumpedSection.published()": carried_out("rod", PUBLISHED), "rod": carried_out("rod")}
    if full == "assembly":
        columns["coarse full arm"] = carried_out("assembly-coarse")
    if "fit" in sys.argv[1:]:
        lumped = fit(wanted)
        print(lumped)
        columns["rod, fitted now"] = carried_out("rod", replace(ARM, lumped=lumped))
    table(columns, wanted)


if __name__ == "__main__":
    main()
