"""The fully implicit step of the reduced model, its sensitivities and its linearisation, compiled.

A step of length h from the strains q finds the motion m with

    R(m; q, u, h) = sum_j J_j(q)' h F_j(J_j(q) m / h) + C(q, u, m / h) m + h f(q + m, u) = 0

by Newton's method with the exact, symmetric tangent T = dR/dm. The rate m / h belongs to the step itself: there is no rate among the
states. At fixed m the derivatives of R by q, u and h along any direction are the imaginary parts of R at complex arguments, and

    dm = -T^-1 (R_q dq + R_u du + R_h dh)

are those of the motion. First order in h, stable at every h that was tried (0.01 to 0.5 s).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.compiler import kernel

from .drag_kernels import Elements, Shape, drag_impulse, drag_tangent, set_shape, shape_buffers
from .fibre_kernels import TINY, Fibres, section_residual, section_tangent

Floats = NDArray[np.float64]
Numbers = NDArray[np.generic]

CHANGE = 0.15
"""Largest change of a strain, as a fibre feels it, in one iteration."""

CONVERGED, ITERATIONS = 1e-6, 60
"""Change of a strain at which the iteration ends; it converges quadratically, so that the error is of the order of its square."""


class StepModel(NamedTuple):
    """All constants of a step: `places` (S, 12) rows of section constants, `fibres`, `elements`, `scale` (S, 4) of the strains."""

    places: Floats
    fibres: Fibres
    elements: Elements
    scale: Floats


class Buffers(NamedTuple):
    """Room for one step; one set per call."""

    shape: Shape
    shifted_shape: Shape
    jacobian: Floats
    wrench: Floats
    tangent: Floats
    block: Floats
    residual: Floats
    column: Floats
    gradient: Floats
    ahead: Floats
    levels: Floats
    section: Floats
    shifted_strains: Numbers
    shifted_motion: Numbers
    shifted_residual: Numbers
    shifted_gradient: Numbers
    shifted_ahead: Numbers
    shifted_levels: Numbers
    shifted_section: Numbers
    right: Floats


def buffers(sections: int, elements: int, groups: int, columns: int) -> Buffers:
    """Fresh buffers for `columns` directions."""
    size = 4 * sections
    return Buffers(
        shape_buffers(elements), shape_buffers(elements, complex), np.zeros((9, size)), np.zeros((6, size)), np.zeros((size, size)),
        np.zeros((4, 4)), np.zeros((sections, 4)), np.zeros((size, 1)), np.zeros(4), np.zeros(4), np.zeros(groups), np.zeros(4),
        np.zeros((sections, 4), complex), np.zeros((sections, 4), complex), np.zeros((sections, 4), complex), np.zeros(4, complex),
        np.zeros(4, complex), np.zeros(groups, complex), np.zeros(4, complex), np.zeros((size, columns)),
    )  # fmt: skip


@kernel
def factorise(matrix: Floats) -> None:
    """L D L' of a symmetric positive definite matrix, in place: D on the diagonal, L below."""
    size = matrix.shape[0]
    for j in range(size):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k] * matrix[k, k]
        matrix[j, j] = pivot
        for i in range(j + 1, size):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k] * matrix[k, k]
            matrix[i, j] = value / pivot


@kernel
def substitute(factor: Floats, right: Floats) -> None:
    """Solve for the columns of `right` (n, p), in place, with what `factorise` left."""
    size, columns = right.shape
    for i in range(size):
        for k in range(i):
            value = factor[i, k]
            for c in range(columns):
                right[i, c] -= value * right[k, c]
    for i in range(size - 1, -1, -1):
        for c in range(columns):
            right[i, c] /= factor[i, i]
        for k in range(i + 1, size):
            value = factor[k, i]
            for c in range(columns):
                right[i, c] -= value * right[k, c]


@kernel
def residual_and_tangent(q: Floats, motion: Floats, levels: Floats, h: float, model: Any, room: Any) -> None:
    """R and dR/dm of a step whose shape stands in the buffers already."""
    drag_impulse(motion, h, model.elements, room.shape, room.residual)
    drag_tangent(h, model.elements, room.shape, room.jacobian, room.wrench, room.tangent)
    for n in range(q.shape[0]):
        room.levels[:] = levels[:, n]
        section_residual(q[n], motion[n], room.levels, h, model.places[n], model.fibres, room.gradient, room.ahead, room.section)
        section_tangent(q[n], motion[n], room.levels, h, model.places[n], model.fibres, room.gradient, room.ahead, room.block)
        for k in range(4):
            room.residual[n, k] += room.section[k]
            for j in range(4):
                room.tangent[4 * n + k, 4 * n + j] += room.block[k, j]


@kernel
def solve_step(q: Floats, motion: Floats, levels: Floats, h: float, model: Any, room: Any) -> bool:
    """Improve `motion` until the residual vanishes; whether it did."""
    set_shape(q, model.elements, room.shape)
    before, damping = np.inf, 1.0
    for _ in range(ITERATIONS):
        residual_and_tangent(q, motion, levels, h, model, room)
        for n in range(q.shape[0]):
            for k in range(4):
                room.column[4 * n + k, 0] = -room.residual[n, k]
        factorise(room.tangent)
        substitute(room.tangent, room.column)
        largest = 0.0
        for n in range(q.shape[0]):
            for k in range(4):
                largest = max(largest, abs(room.column[4 * n + k, 0]) / model.scale[n, k])
        if not np.isfinite(largest):
            return False
        # The laws have kinks, and from one side of a kink to the other and back Newton's method would go for ever.
        if 0.7 * before < largest < CHANGE:
            damping = max(0.5 * damping, 0.35)
        elif largest < CONVERGED:
            damping = 1.0
        else:
            damping = min(2 * damping, 1.0)
        before = largest
        share = damping * min(1.0, CHANGE / max(largest, CONVERGED))
        for n in range(q.shape[0]):
            for k in range(4):
                motion[n, k] += share * room.column[4 * n + k, 0]
        if largest < CONVERGED:
            return True
    return False


@kernel
def begin_motion(motion: Floats, h: float, before: float) -> None:
    """First guess of a step's motion: the last one at the same rate."""
    for n in range(motion.shape[0]):
        for k in range(4):
            motion[n, k] *= h / before


@kernel
def roll_out(start: Floats, levels: Floats, steps: Floats, model: Any, room: Any, motion: Floats, strains: Floats) -> Any:
    """Simulate N steps from `start` into `strains` (N + 1, S, 4); how many steps were solved. `motion` (S, 4): zero, or the step before."""
    strains[0] = start
    for t in range(len(steps)):
        if t:
            begin_motion(motion, steps[t], steps[t - 1])
        if not solve_step(strains[t], motion, levels[t], steps[t], model, room):
            return t
        for n in range(start.shape[0]):
            for k in range(4):
                strains[t + 1, n, k] = strains[t, n, k] + motion[n, k]
    return len(steps)


@kernel
def residual_along(
    q: Floats, strain_slopes: Floats, motion: Floats, levels: Floats, level_slopes: Floats, h: float, step_slope: Floats, model: Any,
    room: Any, out: Floats,
) -> None:  # fmt: skip
    """Derivative of R at fixed motion along one direction (4 S; groups, S; number), negative, into the column `out` (4 S)."""
    step = h + 1j * TINY * step_slope
    for n in range(q.shape[0]):
        for k in range(4):
            room.shifted_strains[n, k] = q[n, k] + 1j * TINY * strain_slopes[4 * n + k]
            room.shifted_motion[n, k] = motion[n, k]
    set_shape(room.shifted_strains, model.elements, room.shifted_shape)
    drag_impulse(room.shifted_motion, step, model.elements, room.shifted_shape, room.shifted_residual)
    for n in range(q.shape[0]):
        for group in range(levels.shape[0]):
            room.shifted_levels[group] = levels[group, n] + 1j * TINY * level_slopes[group, n]
        section_residual(
            room.shifted_strains[n], room.shifted_motion[n], room.shifted_levels, step, model.places[n], model.fibres,
            room.shifted_gradient, room.shifted_ahead, room.shifted_section,
        )  # fmt: skip
        for k in range(4):
            out[4 * n + k] = -(room.shifted_residual[n, k].imag + room.shifted_section[k].imag) / TINY


@kernel
def stands_still(strain_slopes: Floats, level_slopes: Floats, step_slope: Floats) -> bool:
    """Whether nothing depends on an unknown yet: those of later phases need no work before."""
    if step_slope != 0.0:
        return False
    for value in strain_slopes:
        if value != 0.0:
            return False
    for row in level_slopes:
        for value in row:
            if value != 0.0:
                return False
    return True


@kernel
def roll_out_slopes(
    start: Floats, levels: Floats, level_slopes: Floats, steps: Floats, step_slopes: Floats, model: Any, room: Any, motion: Floats,
    strains: Floats, slopes: Floats,
) -> Any:  # fmt: skip
    """As `roll_out`, with derivatives: `level_slopes` (N, groups, S, p), `step_slopes` (N, p) -> `slopes` (N + 1, 4 S, p)."""
    strains[0] = start
    slopes[0] = 0.0
    for t in range(len(steps)):
        if t:
            begin_motion(motion, steps[t], steps[t - 1])
        if not solve_step(strains[t], motion, levels[t], steps[t], model, room):
            return t
        # The last iteration's tangent is that of the motion before it.
        residual_and_tangent(strains[t], motion, levels[t], steps[t], model, room)
        factorise(room.tangent)
        for d in range(slopes.shape[2]):
            if stands_still(slopes[t, :, d], level_slopes[t, :, :, d], step_slopes[t, d]):
                room.right[:, d] = 0.0
                continue
            residual_along(
                strains[t], slopes[t, :, d], motion, levels[t], level_slopes[t, :, :, d], steps[t], step_slopes[t, d], model, room,
                room.right[:, d],
            )  # fmt: skip
        substitute(room.tangent, room.right)
        for i in range(slopes.shape[1]):
            for d in range(slopes.shape[2]):
                slopes[t + 1, i, d] = slopes[t, i, d] + room.right[i, d]
        for n in range(start.shape[0]):
            for k in range(4):
                strains[t + 1, n, k] = strains[t, n, k] + motion[n, k]
    return len(steps)


@kernel
def linearise_steps(
    strains: Floats, levels: Floats, steps: Floats, model: Any, room: Any, motion: Floats, unit: Floats, none: Floats, transition: Floats,
    influence: Floats, drag: Floats,
) -> None:  # fmt: skip
    """Linear model of every step of a motion (N + 1, S, 4) that `roll_out` made.

    `transition` (N, 4 S, 4 S) by the strains, `influence` (N, 4 S, groups, S) by the levels, `drag` (N, 4 S) by a common relative error of
    all drag. `motion` (S, 4), `unit` (4 S) and `none` (groups, S) are buffers, the last two zero; `room` has 4 S + groups S + 1 columns.
    """
    sections, groups = strains.shape[1], levels.shape[1]
    size = 4 * sections
    for t in range(len(steps)):
        motion[:] = strains[t + 1] - strains[t]
        set_shape(strains[t], model.elements, room.shape)
        residual_and_tangent(strains[t], motion, levels[t], steps[t], model, room)
        factorise(room.tangent)
        room.right[:] = 0.0
        for d in range(size):
            unit[d] = 1.0
            residual_along(strains[t], unit, motion, levels[t], none, steps[t], 0.0, model, room, room.right[:, d])
            unit[d] = 0.0
        for n in range(sections):
            room.shifted_strains[n] = strains[t, n]
            room.shifted_motion[n] = motion[n]
            for group in range(groups):
                room.shifted_levels[:] = levels[t, :, n]
                room.shifted_levels[group] += 1j * TINY
                section_residual(
                    room.shifted_strains[n], room.shifted_motion[n], room.shifted_levels, steps[t] + 0j, model.places[n], model.fibres,
                    room.shifted_gradient, room.shifted_ahead, room.shifted_section,
                )  # fmt: skip
                for k in range(4):
                    room.right[4 * n + k, size + group * sections + n] = -room.shifted_section[k].imag / TINY
        drag_impulse(motion, steps[t], model.elements, room.shape, room.residual)
        for n in range(sections):
            for k in range(4):
                room.right[4 * n + k, size + groups * sections] = -room.residual[n, k]
        substitute(room.tangent, room.right)
        for i in range(size):
            for d in range(size):
                transition[t, i, d] = room.right[i, d]
            transition[t, i, i] += 1.0
            for group in range(groups):
                for n in range(sections):
                    influence[t, i, group, n] = room.right[i, size + group * sections + n]
            drag[t, i] = room.right[i, size + groups * sections]
