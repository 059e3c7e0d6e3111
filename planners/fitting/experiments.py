"""Programmes that a plant runs through so that the reduced model can be fitted to what it does."""

from itertools import pairwise

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, Arm
from octoctrl.sim.templates import Plateau

RAMP = 1.7
"""Stretches the ramps of the experiments: faster ones would teach the model to make up for inertia, which it does not have."""


def experiments(arm: Arm) -> tuple[tuple[str, Activation, float], ...]:
    """Activations for identification, of one rod and of the full arm.

    Parameters
    ----------
    arm : Arm

    Returns
    -------
    tuple of (str, Activation, float)
        Name, activation and duration (s) of each run, 31 s in all, with levels up to 0.75 of every group. The published
        coil-and-telescope programme is not among them: it stays held out.
    """
    half, everywhere = arm.length / 2, " ".join(LONGITUDINAL_GROUPS)
    outer = (half, np.inf)
    runs: tuple[tuple[str, float, tuple[Plateau, ...]], ...] = (
        ("oblique step and release", 2.5, (_on("R-OM", 0.3, 0.0, 0.3, 1.3),)),
        ("oblique stairs", 2.5, (_on("L-OM", 0.15, 0.0, 0.3), _on("L-OM", 0.35, 1.2, 0.3))),
        ("both oblique families", 2.5, (_on("L-OM", 0.75, 0.0, 0.3, 1.6), _on("R-OM", 0.75, 0.8, 0.4))),
        ("bend and release", 3.0, (_on("LM8 LM1 LM2", 0.3, 0.0, 0.5, 1.6),)),
        ("strong bend", 2.0, (_on("LM4 LM5 LM6", 0.6, 0.0, 0.8),)),
        ("twist, bend, untwist", 3.0, (_on("L-OM", 0.25, 0.0, 0.4, 1.8), _on("LM4 LM5 LM6", 0.3, 0.7, 1.0))),
        (
            "twist, bend, twist back",
            4.5,
            (_on("R-OM", 0.18, 0.0, 0.4, 2.2), _on("LM3 LM4 LM5", 0.4, 0.9, 1.6), _on("L-OM", 0.3, 2.8, 0.5)),
        ),
        ("bend, then twist", 2.5, (_on("LM8 LM1 LM2", 0.2, 0.0, 0.4), _on("L-OM", 0.25, 1.2, 0.4))),
        ("shorten, then elongate", 2.0, (_on(everywhere, 0.2, 0.0, 0.3, 0.9), _on("TM", 0.6, 1.0, 0.3))),
        ("shorten and elongate strongly", 2.5, (_on(everywhere, 0.75, 0.0, 0.4, 1.1), _on("TM", 0.75, 1.3, 0.3))),
        ("half bend, half twist", 1.5, (_on("LM6 LM7 LM8", 0.3, 0.0, 0.4, window=(0.0, half)), _on("R-OM", 0.2, 0.1, 0.4, window=outer))),
        ("random levels", 3.0, _random_levels(3.0)),
    )
    return tuple((name, Activation(templates=templates, composition="max"), duration) for name, duration, templates in runs)


def _on(
    groups: str, level: float, onset: float, rise: float, offset: float = np.inf, window: tuple[float, float] = (0.0, np.inf)
) -> Plateau:
    return Plateau(groups=tuple(groups.split()), level=level, onset=onset, rise=RAMP * rise, offset=offset, fall=RAMP * 0.4, window=window)


def _random_levels(duration: float, dwell: float = 0.6) -> tuple[Plateau, ...]:
    """Levels of a twisting and a bending group that change every `dwell` seconds; the same ones every time."""
    draw = np.random.default_rng(2024)
    sides = tuple(" ".join((first, second)) for first, second in pairwise((*LONGITUDINAL_GROUPS, "LM1")))
    templates = []
    for onset in np.arange(0.0, duration - dwell / 2, dwell):
        for choice in (sides, ("R-OM", "L-OM")):
            groups = choice[draw.integers(len(choice))]
            templates.append(_on(groups, round(float(draw.uniform(0.05, 0.3)), 3), float(onset), 0.25, float(onset) + dwell))
    return tuple(templates)
