"""The elastic rod against closed forms: standing waves of stretch and of twist, and the circle into which a couple bends a rod."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..tables import Table, fastest

if TYPE_CHECKING:
    from octoctrl.sim.rod.elastic import RodSimulation

Case = tuple["RodSimulation", Callable[[], Any], float]
"""A rod, what gives its error, and the duration, s."""

LENGTH, RADIUS, DENSITY, YOUNG, SHEAR = 0.2, 0.006, 1050.0, 1e5, 4e4
PERIODS = 3
AMPLITUDE = 1e-4
"""Of the waves, m/s and rad/s: small, for the closed forms are linear."""
BEND = 2.0
"""Angle through which the couple bends the rod, rad."""


def _simulation(elements: int, share: float, damping: float = 0.0) -> "RodSimulation":
    from octoctrl.sim.rod.elastic import RodSimulation
    from octoctrl.sim.rod.rod import Rod

    sim = RodSimulation(
        Rod.straight(
            length=LENGTH, radius=RADIUS, elements=elements, density=DENSITY, youngs_modulus=YOUNG, shear_modulus=SHEAR, support="clamped",
            section="constant", damping=damping,
        )
    )  # fmt: skip
    sim.dt *= share
    return sim


def stretch_wave(elements: int, share: float) -> Case:
    """Lowest standing wave of stretch of a clamped rod, after whole periods, against v = A sin(pi s / 2 L).

    Parameters
    ----------
    elements : int
    share : float
        Of the step of ``dt="auto"``.

    Returns
    -------
    RodSimulation, callable, float
        The rod, what returns its error over the amplitude, and the duration, s.
    """
    sim = _simulation(elements, share)
    shape = AMPLITUDE * np.sin(np.pi * np.linspace(0, 1, elements + 1) / 2)
    sim.velocities = shape[:, None] * [0.0, 1.0, 0.0]
    return sim, lambda: np.abs(sim.velocities[:, 1] - shape).max() / AMPLITUDE, PERIODS * 4 * LENGTH / np.sqrt(YOUNG / DENSITY)


def twist_wave(elements: int, share: float) -> Case:
    """Lowest standing wave of twist, as `stretch_wave`.

    Parameters
    ----------
    elements : int
    share : float
    """
    sim = _simulation(elements, share)
    shape = AMPLITUDE * np.sin(np.pi * (np.arange(elements) + 0.5) / (2 * elements))
    sim.spins = shape[:, None] * [0.0, 0.0, 1.0]
    return sim, lambda: np.abs(sim.spins[:, 2] - shape).max() / AMPLITUDE, PERIODS * 4 * LENGTH / np.sqrt(SHEAR / DENSITY)


def circle(elements: int, share: float) -> Case:
    """Arc of a circle into which a tip couple B k bends a clamped rod (Euler), after the motion has died away; error of the tip over L.

    Parameters
    ----------
    elements : int
    share : float
    """
    sim = _simulation(elements, share, damping=5.0)
    curvature = BEND / LENGTH
    sim.load(tip_couple=(0.0, 0.0, YOUNG * np.pi / 4 * RADIUS**4 * curvature))
    expected = np.array([-(1 - np.cos(BEND)), np.sin(BEND), 0.0]) / curvature
    return sim, lambda: np.linalg.norm(sim.points[-1] - expected) / LENGTH, 8.0


CASES = {"stretch wave": stretch_wave, "twist wave": twist_wave, "circle under a couple": circle}


def closed_forms(*, full: bool = False) -> Table:
    """Errors against closed forms over elements and step; with `full` of finer rods."""
    rows = []
    for case, made in CASES.items():
        for elements in (10, 20, 40, 80, 160) if full else (10, 20, 40, 80):
            for share in (1.0, 0.5):
                sim, error, duration = made(elements, share)
                spent, wall = fastest(partial(sim.advance, duration), 1)
                found = 100 * float(error())
                again = fastest(partial(sim.advance, duration), 3)
                spent, wall = min(spent, again[0]), min(wall, again[1])
                rows.append((case, elements, 1e3 * sim.dt, 1e3 * spent / duration, 1e3 * wall / duration, found))
    return Table(
        name="closed-forms", title="Elastic rod: time against the error to closed forms", rows=tuple(rows),
        columns=("case", "elements", "step, ms", "CPU ms / s", "wall ms / s", "error, %"), formats=("", "d", ".3f", ".2f", ".2f", ".4f"),
        note=f"Waves: after {PERIODS} periods, of their amplitude. Circle: distance of the tip over the length.",
        curve=("error, %", "CPU ms / s", "case"),
    )  # fmt: skip
