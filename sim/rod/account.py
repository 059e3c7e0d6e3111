"""Energies of the arm as one rod, and the power of its muscles and of the water, at one instant, in plain NumPy."""

from collections.abc import Iterator
from math import tau
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..body.muscles import MuscleLaw
from ..contracts import Floats
from ..rotations import rotation_vector
from .buffer import node_masses, rod_energy
from .layout import Row

if TYPE_CHECKING:
    from .core import RodCore

DRIFT = 1e-7
"""Time over which the rates of the fibres are taken, s."""


class Fibre(NamedTuple):
    """A fibre through all n elements: the `part` that it belongs to, its muscle `group` (none for the cord), law, factors on its passive
    and active stress, rest area, m^2, stretch, and rest length over that of the arm, each (n,).
    """

    part: str
    group: int | None
    law: MuscleLaw
    embedded: float
    strength: float
    area: Floats
    stretch: Floats
    rest: Floats


def energies(core: "RodCore") -> dict[str, float]:
    """Energies by part, J: kinetic, shear with bending and twist of the straight rods, passive stretch of the fibres by kind."""
    own = rod_energy(core.rows, core.elements, core.node_mass, constant_section=False)
    found = {"kinetic": own["kinetic"], "shear_bending_twist": own["elastic"]}
    lengths = core.rows[Row.LENGTH, 1 : core.elements + 1]
    for fibre in _fibres(core, 0.0):
        stored = fibre.embedded * np.sum(fibre.area * fibre.rest * lengths * fibre.law.passive_energy(fibre.stretch))
        found[fibre.part] = found.get(fibre.part, 0.0) + float(stored)
    return found


def powers(core: "RodCore", levels: Floats) -> dict[str, float]:
    """Power of the muscles at `levels` (groups, n) and of the water, W."""
    lengths, muscles = core.rows[Row.LENGTH, 1 : core.elements + 1], 0.0
    for fibre, before, after in zip(_fibres(core, 0.0), _fibres(core, -DRIFT), _fibres(core, DRIFT), strict=True):
        if fibre.group is not None:
            rate = (after.stretch - before.stretch) / (2 * DRIFT)
            law, s = fibre.law, fibre.stretch
            stress = (
                fibre.strength
                * levels[fibre.group]
                * law.maximum_stress
                * law.active_factor(s)
                * law.velocity_factor(-rate / law.maximum_rate)
            )
            muscles -= float(np.sum(fibre.area * stress / s * fibre.rest * lengths * rate))
    return {"muscles": muscles, "water": _water(core)}


def _fibres(core: "RodCore", ahead: float) -> Iterator[Fibre]:
    """The fibres as they would be `ahead` (s) of now, if all went on with its velocity."""
    arm, rows, n = core.arm, core.rows, core.elements
    inside = slice(1, n + 1)
    points = rows[Row.X1 : Row.X3 + 1, 1 : n + 2] + ahead * rows[Row.V1 : Row.V3 + 1, 1 : n + 2]
    frames = rows[Row.Q11 : Row.Q33 + 1, : n + 1].T.reshape(-1, 3, 3)
    spin = rows[Row.W1 : Row.W3 + 1, inside].T
    frames = np.concatenate([frames[:1], frames[1:] - ahead * np.cross(spin[:, :, None], frames[1:], axis=1)])
    curvature = np.zeros((n + 1, 3))
    curvature[:n] = rotation_vector(frames[1:] @ np.swapaxes(frames[:-1], 1, 2)) / rows[Row.JOINT_LENGTH, 1 : n + 1, None]
    # Fibres of an element see the mean of its two joints; beyond the centre of the last one the arm is straight.
    k1, k2, k3 = (curvature[1:] + curvature[:-1]).T / 2
    e = np.linalg.norm(np.diff(points, axis=1), axis=0) / rows[Row.LENGTH, inside]
    lam, one = e**-arm.lumped.hoop_ratio, np.ones(n)
    yield Fibre("passive_cord", None, arm.longitudinal, 1.0, 1.0, rows[Row.CORD_AREA, inside], e, one)
    rho = rows[Row.OFFSET, inside] * lam
    for group in arm.layout.longitudinal:
        sine, cosine = group.place
        stretch = np.hypot(e + rho * (k1 * cosine - k2 * sine), rho * k3)
        index = arm.layout.index(group.name)
        yield Fibre(
            "passive_longitudinal",
            index,
            arm.longitudinal,
            1.0,
            arm.lumped.longitudinal_stress,
            rows[Row.LONGITUDINAL_AREA, inside],
            stretch,
            one,
        )
    rest = rows[Row.OBLIQUE_REST, inside]
    for group in arm.layout.oblique:
        around = rows[Row.HELIX, inside] * lam * (group.hand * tau / arm.oblique_pitch + k3)
        area, index, lumped = rows[Row.OBLIQUE_AREA, inside], arm.layout.index(group.name), arm.lumped
        stretch = np.hypot(e, around) / rest
        yield Fibre("passive_oblique", index, arm.oblique, lumped.oblique_passive, lumped.oblique_stress, area, stretch, rest)
    index = arm.layout.index(arm.layout.transverse.name)
    yield Fibre("passive_transverse", index, arm.transverse, 1.0, 1.0, rows[Row.RING_AREA, inside], lam, one)


def _water(core: "RodCore") -> float:
    """Power of linear drag, of spin drag, and of the quadratic drag across and along the mean tangent of a node's elements."""
    water, rows, n = core.scene.water, core.rows, core.elements
    if water is None:
        return 0.0
    velocity, spin = rows[Row.V1 : Row.V3 + 1, 1 : n + 2].T, rows[Row.W1 : Row.W3 + 1, 1 : n + 1].T
    section, lengths = core.arm.section((core.arm.edges[1:] + core.arm.edges[:-1]) / 2), rows[Row.LENGTH, 1 : n + 1]
    rates = water.factor * np.array([0.0, 0.0, water.ring_rate, water.oblique_rate])
    edges = np.diff(rows[Row.X1 : Row.X3 + 1, 1 : n + 2].T, axis=0)
    stretch = np.linalg.norm(edges, axis=1)
    tangents = edges / stretch[:, None]
    lost = np.sum(node_masses(rates @ np.array(section.masses) * lengths) * np.sum(velocity**2, axis=1))
    turning = rates @ np.array(section.polar_inertias) * lengths
    lost += np.sum(turning * np.sum(spin**2, axis=1) * lengths / stretch)
    mean = np.zeros((n + 1, 3))
    mean[:-1] += tangents
    mean[1:] += tangents
    mean /= np.linalg.norm(mean, axis=1)[:, None]
    along = np.sum(velocity * mean, axis=1)
    across = np.linalg.norm(velocity - along[:, None] * mean, axis=1)
    lost += np.sum(rows[Row.DRAG_NORMAL, 1 : n + 2] * across**3 + rows[Row.DRAG_TANGENT, 1 : n + 2] * np.abs(along) ** 3)
    return -float(lost)
