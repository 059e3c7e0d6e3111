"""The time loop: many steps, activation, guard and recording inside one compiled call.

A call covers whole *samples*; at the end of each, positions and velocities belong to the same instant, the motion is checked and, if
asked, recorded. Inside a sample the two half drifts that meet between steps are merged into one. Cutting a run into calls at samples
does not change a single bit, so that a saved state continues exactly.
"""

from typing import NamedTuple

import numpy as np

from ..body.layout import Family
from ..compiler import kernel
from ..physics.fibre_kernels import LawConstants
from .elastic_kernels import frame_kernel, rod_kernels
from .layout import offsets
from .section_kernels import fibre_kernels, section_kernels

ONE = np.uint64(1)
FINE, STRETCHED, BENT, NOT_A_NUMBER, SHEARED, SPUN = 0, 1, 2, 3, 5, 6
"""What the guard found: nothing, an element outside the allowed stretch, a joint bent too far, a value that is no number, a section that
has fallen over, a frame that is no longer orthonormal (4 is speed, which the assembly watches)."""

STRETCH_LIMITS = (0.2, 3.0)
JOINT_LIMIT = 1.5
"""Largest angle between neighbouring elements, rad, that the logarithm's series resolves."""
SHEAR_LIMIT = 0.5
"""Smallest cosine between an element's d3 and its tangent. Arms that move sensibly stay above 0.65; below it a section folds over and can
stay so, for shear is linear: an element that is turned inside out would be a second state of rest."""
ORTHONORMAL_LIMIT = 5e-11
"""The series of a step's rotation leaves this error when an element turns by a radian in one step."""


class MuscleScalars(NamedTuple):
    """Scalars of a muscular rod for the compiled loop."""

    hoop_ratio: float
    winding: float
    elastic: float
    longitudinal: LawConstants
    oblique: LawConstants
    transverse: LawConstants
    wet: bool


def _closing_kernel(stride):
    """Compile what ends a sample: ``(buffer, n, points, directors, stretch)`` are checked, recorded if fine -> finding, element."""
    o = offsets(stride)
    X1, X2, X3, STRETCH, LENGTH, JOINT_LENGTH = (o[k] for k in ("X1", "X2", "X3", "STRETCH", "LENGTH", "JOINT_LENGTH"))
    Q = tuple(o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    K1, K2, K3, BEND1 = o["K1"], o["K2"], o["K3"], o["BEND1"]
    T, Q3 = (o["T1"], o["T2"], o["T3"]), Q[6:]
    straighten = frame_kernel(stride)

    @kernel
    def guard(b, n):
        for k in range(ONE, n + ONE):
            if not (np.isfinite(b[X1 + k + ONE]) and np.isfinite(b[X2 + k + ONE]) and np.isfinite(b[X3 + k + ONE])):
                return NOT_A_NUMBER, k
            if not STRETCH_LIMITS[0] < b[STRETCH + k] < STRETCH_LIMITS[1]:
                return STRETCHED, k
            if not b[T[0] + k] * b[Q3[0] + k] + b[T[1] + k] * b[Q3[1] + k] + b[T[2] + k] * b[Q3[2] + k] > SHEAR_LIMIT:
                return SHEARED, k
            axis = b[Q3[0] + k] ** 2 + b[Q3[1] + k] ** 2 + b[Q3[2] + k] ** 2 - 1
            side = b[Q[0] + k] ** 2 + b[Q[1] + k] ** 2 + b[Q[2] + k] ** 2 - 1
            if not abs(axis) + abs(side) < ORTHONORMAL_LIMIT:
                return SPUN, k
            angle = JOINT_LIMIT / b[JOINT_LENGTH + k]
            # The first joint of a rod that is not clamped carries nothing.
            if b[BEND1 + k] > 0 and not b[K1 + k] ** 2 + b[K2 + k] ** 2 + b[K3 + k] ** 2 < angle * angle:
                return BENT, k
        return FINE, ONE

    @kernel
    def close(b, n, points, directors, stretch):
        finding, element = guard(b, n)
        if finding != FINE:
            return finding, element
        straighten(b, n)
        for k in range(ONE, n + ONE + ONE):
            points[k - ONE, 0], points[k - ONE, 1], points[k - ONE, 2] = b[X1 + k], b[X2 + k], b[X3 + k]
        for k in range(ONE, n + ONE):
            for i in range(9):
                directors[k - ONE, i // 3, i % 3] = b[Q[i] + k]
            d1, d2, d3 = b[X1 + k + ONE] - b[X1 + k], b[X2 + k + ONE] - b[X2 + k], b[X3 + k + ONE] - b[X3 + k]
            stretch[k - ONE] = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3) / b[LENGTH + k]
        return finding, element

    return close


def elastic_stepper(stride, constant_section):
    """Compile the loop of an elastic rod.

    Parameters
    ----------
    stride : int
        Of the buffer.
    constant_section : bool
        See `octoctrl.sim.rod.elastic_kernels.rod_kernels`.

    Returns
    -------
    advance : compiled function
        ``advance(buffer, n, h, steps, points, directors, stretch)`` takes `steps` steps of `h` for each of the samples, whose count
        is the length of `points`, and fills the three arrays. Returns ``(samples done, finding, element)``.
    """
    drift, strain, curvature, _, moment, transport, kick, _ = rod_kernels(stride, constant_section)
    close = _closing_kernel(stride)

    @kernel
    def advance(b, n, h, steps, points, directors, stretch):
        for sample in range(points.shape[0]):
            drift(b, n, 0.5 * h)
            for step in range(steps):
                strain(b, n)
                curvature(b, n)
                moment(b, n)
                transport(b, n)
                kick(b, n)
                drift(b, n, h if step + 1 < steps else 0.5 * h)
            finding, element = close(b, n, points[sample], directors[sample], stretch[sample])
            if finding != FINE:
                return sample, finding, element
        return points.shape[0], FINE, ONE

    return advance


def muscular_stepper(stride, layout):
    """Compile the loop of a rod with muscle fibres.

    Parameters
    ----------
    stride : int
        Of the buffer.
    layout : MuscleLayout

    Returns
    -------
    advance : compiled function
        ``advance(buffer, n, h, steps, levels, active, scalars, points, directors, stretch)``: as for the elastic rod, with
        `levels` (samples + 1, groups, n), linear in time between samples, and `active` (samples, groups) bool, which groups differ from
        zero in each (others are left out, which changes no bit).
    """
    drift, strain, curvature, curvature_rate, moment, transport, kick, water = rod_kernels(stride)
    measure, straight, wound, apply, remember, brake, relax = section_kernels(stride, layout)
    longitudinal, oblique, transverse = fibre_kernels(stride)
    close = _closing_kernel(stride)
    LEVEL = offsets(stride)["LEVEL"]
    families, places = layout.families, layout.places
    groups, along, across = len(layout), int(Family.LONGITUDINAL), int(Family.TRANSVERSE)

    @kernel
    def set_level(b, n, before, after, share):
        for k in range(ONE, n + ONE):
            b[LEVEL + k] = (1 - share) * before[k - ONE] + share * after[k - ONE]

    @kernel
    def advance(b, n, h, steps, levels, active, scalars, points, directors, stretch):
        nu, elastic = scalars.hoop_ratio, scalars.elastic
        for sample in range(points.shape[0]):
            drift(b, n, 0.5 * h)
            before, after = levels[sample], levels[sample + 1]
            for step in range(steps):
                share = (step + 0.5) / steps
                strain(b, n)
                curvature(b, n)
                curvature_rate(b, n)
                moment(b, n)
                measure(b, n, nu)
                straight(b, n, scalars.longitudinal, elastic)
                wound(b, n, scalars.winding, scalars.oblique, scalars.transverse, elastic)
                for group in range(groups):
                    if active[sample, group]:
                        set_level(b, n, before[group], after[group], share)
                        if families[group] == along:
                            longitudinal(b, n, places[group, 0], places[group, 1], scalars.longitudinal)
                        elif families[group] == across:
                            transverse(b, n, scalars.transverse)
                        else:
                            oblique(b, n, places[group, 0] * scalars.winding, scalars.oblique)
                apply(b, n)
                transport(b, n)
                if scalars.wet:
                    water(b, n)
                remember(b, n)
                kick(b, n)
                brake(b, n)
                relax(b, n)
                drift(b, n, h if step + 1 < steps else 0.5 * h)
            finding, element = close(b, n, points[sample], directors[sample], stretch[sample])
            if finding != FINE:
                return sample, finding, element
        return points.shape[0], FINE, ONE

    return advance
