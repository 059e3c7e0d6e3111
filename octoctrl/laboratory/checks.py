"""What no sensible motion does: checks of a run that no guard has stopped. Each gives a sentence, or None if all is well."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from octoctrl.judging.verification import Limits
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS, Arm
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.topology.measures import measure

Floats = NDArray[np.float64]

ORTHONORMAL = 1e-10
RESIDUAL = 0.25
"""Largest |Lk - (Wr + Tw)|, turns; coarse arms with strong curls have up to 0.1."""
GROWTH = 0.01
"""By how much more the energy of a passive arm may grow than at a quarter of the step, over what it began with. It may grow at all because
the published section, which shrinks as it stretches, has no exact potential."""
REST = 0.01
"""Mean speed over its largest value in the run below which an arm counts as at rest."""
SLOWING = 0.995
"""A slower second than the one before, by so much, is on the way to rest: large arms take minutes."""


def finite(recording: Recording) -> str | None:
    """Every number of the `recording` is a number."""
    for name in ("time", "points", "frames", "stretch", "levels"):
        if not np.isfinite(getattr(recording, name)).all():
            return f"{name} holds values that are not numbers"
    return None


def orthonormal(recording: Recording) -> str | None:
    """The frames of the `recording` stay orthonormal."""
    product = recording.frames @ np.swapaxes(recording.frames, -1, -2)
    worst = float(np.abs(product - np.eye(3)).max())
    return f"frames are orthonormal only to {worst:.1e}" if not worst < ORTHONORMAL else None


def held(recording: Recording) -> str | None:
    """In the `recording` the base stays where it is, and no node is farther from it than the arm is long."""
    if np.abs(recording.points[:, 0] - recording.points[0, 0]).max() > 0:
        return "the base has moved"
    reach = np.linalg.norm(recording.points - recording.points[:, :1], axis=2).max(axis=1)
    return "the tip is out of the arm's reach" if np.any(reach > recording.length * (1 + 1e-9)) else None


def linked(recording: Recording) -> str | None:
    """In the `recording` link is writhe plus twist, up to whole turns: a curve that just passes through itself may win or lose them."""
    residual = measure(recording.time, recording.points, recording.frames).residual
    worst = float(np.abs(residual - np.round(residual)).max())
    return f"link and writhe + twist differ by {worst:.2f} turns" if not worst < RESIDUAL else None


def voluminous(recording: Recording) -> str | None:
    """The volume that a `recording` holds, if its plant has one, is kept as far as a verdict wants it kept."""
    limits = Limits()
    for name, said, limit in (("volume", "the arm", limits.volume), ("slab_volume", "a slab", limits.slab_volume)):
        worst = float(np.abs(recording.series[name] - 1).max()) if name in recording.series else 0.0
        if not worst < limit:
            return f"the volume of {said} changes by {worst:.1%}"
    return None


def powered(recording: Recording, arm: Arm, node_mass: Floats) -> str | None:
    """The kinetic energy of an arm that started at rest stays below the work that its muscles can do.

    A muscle of volume V shortens from its largest to its smallest stretch at most once per rise of its activation, and gives no more than
    V a sigma_max times the integral of its force-length curve.

    Parameters
    ----------
    recording : Recording
    arm : Arm
    node_mass : (n + 1,) float64, kg
    """
    speed = np.diff(recording.points, axis=0) / np.diff(recording.time)[:, None, None]
    kinetic = 0.5 * float(np.max(np.sum(node_mass * np.sum(speed**2, axis=2), axis=1), initial=0.0))
    section = arm.section((arm.edges[1:] + arm.edges[:-1]) / 2)
    _, longitudinal, ring, oblique = section.areas
    laws = dict.fromkeys(LONGITUDINAL_GROUPS, (arm.longitudinal, longitudinal))
    laws |= dict.fromkeys(("R-OM", "L-OM"), (arm.oblique, oblique * section.oblique_stretch)) | {"TM": (arm.transverse, ring)}
    peak, available = np.asarray(recording.levels).max(axis=0), 0.0
    for group, (law, area) in laws.items():
        stretches = np.linspace(*law.range, 200)
        per_volume = law.maximum_stress * float(np.trapezoid(law.active_factor(stretches), stretches))
        available += per_volume * float(np.sum(peak[MUSCLE_GROUPS.index(group)] * area * np.diff(arm.edges)))
    return f"kinetic energy {kinetic:.2g} J exceeds the muscles' work {available:.2g} J" if kinetic > available + 1e-15 else None


def growth(energies: Floats) -> float:
    """Largest growth of the `energies` (T,) of a passive arm, over what it began with."""
    return float(np.max(energies - np.minimum.accumulate(energies)) / energies[0])


def settled(recording: Recording) -> str | None:
    """The `recording` under constant activation comes to rest, or is on the way: muscles with a constant pull give no more work."""
    speed = np.linalg.norm(np.diff(recording.points, axis=0), axis=2).mean(axis=1) / np.diff(recording.time)
    seconds = np.searchsorted(recording.time, recording.time[-1] - np.array([2.0, 1.0]))
    before, last = speed[seconds[0] : seconds[1]].mean(), speed[seconds[1] :].mean()
    if last < REST * speed.max() or last < SLOWING * before:
        return None
    return f"still moves at {last / speed.max():.1%} of its largest speed and does not slow down"


def passive_energy(plant: Any) -> float:
    """Kinetic, elastic and passive muscle energy of a rod plant now, J, see `octoctrl.sim.rod.account`.

    Parameters
    ----------
    plant : octoctrl.sim.running.plant.Plant

    Returns
    -------
    float
    """
    return sum(plant.core.energies().values())
