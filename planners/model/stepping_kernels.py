"""The fully implicit step of the reduced model, its sensitivities and its linearisation, compiled.

A step of length h from the strains q finds the motion m with

    R(m; q, u, h) = sum_j J_j(q)' h F_j(J_j(q) m / h) + C(q, u, m / h) m + h f(q + m, u) = 0

by Newton's method with the exact, symmetric tangent T = dR/dm. The rate m / h belongs to the step itself: there is no rate among the
states. The derivatives of R at fixed m by q, u and h are in closed form (`fibre_kernels`, `drag_slope_kernels`), and

    dm = -T^-1 (R_q dq + R_u du + R_h dh)

are those of the motion. First order in h, stable at every h that was tried (0.01 to 0.5 s).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.compiler import borrowing_kernel

from .drag_kernels import Elements, Shape, drag_impulse, drag_tangent, set_shape, shape_buffers
from .drag_slope_kernels import ShapeSlopes, impulse_along, set_shape_slopes, shape_slope_buffers
from .fibre_kernels import FibreRoom, Fibres, fibre_room, section_impulse, section_slopes, set_fibres

Floats = NDArray[np.float64]

CHANGE = 0.15
"""Largest change of a strain, as a fibre feels it, in one iteration."""

CONVERGED, ITERATIONS = 1e-6, 60
"""Change of a strain at which the iteration ends; it converges quadratically, so that the error is of the order of its square."""

SHORT = 0.06
"""Step, s, up to which a motion goes on as it changed in the last two; over longer ones it goes on as in the last."""


class StepModel(NamedTuple):
    """All constants of a step: `fibres`, `elements`, `scale` (S, 4) of the strains."""

    fibres: Fibres
    elements: Elements
    scale: Floats


class Buffers(NamedTuple):
    """Room for one step; one set per call."""

    shape: Shape
    shape_slopes: ShapeSlopes
    fibres: FibreRoom
    tangent: Floats
    block: Floats
    residual: Floats
    column: Floats
    section: Floats
    by_strains: Floats
    by_levels: Floats
    by_step: Floats
    along: Floats
    right: Floats


def buffers(model: StepModel, groups: int, columns: int) -> Buffers:
    """Fresh buffers for `columns` directions."""
    elements, (sections, fibres) = len(model.elements.first), model.fibres.area.shape
    size = 4 * sections
    return Buffers(
        shape_buffers(elements, sections), shape_slope_buffers(elements), fibre_room(sections, fibres), np.zeros((size, size)),
        np.zeros((4, 4)), np.zeros((sections, 4)), np.zeros(size), np.zeros(4), np.zeros((sections, 4, 5)),
        np.zeros((sections, 4, groups)), np.zeros((sections, 4)), np.zeros(size), np.zeros((size, columns)),
    )  # fmt: skip


@borrowing_kernel
def factorise(matrix: Floats) -> None:
    """U' D U of a symmetric positive definite matrix, in place of its upper half: D^-1 on the diagonal, above it U with 1 on its own."""
    for k in range(matrix.shape[0]):
        inverse, pivot = 1 / matrix[k, k], matrix[k, k + 1 :]
        for i in range(len(pivot)):
            share, row, rest = inverse * pivot[i], matrix[k + 1 + i, k + 1 + i :], pivot[i:]
            for j in range(len(row)):
                row[j] -= share * rest[j]
        for j in range(len(pivot)):
            pivot[j] *= inverse
        matrix[k, k] = inverse


@borrowing_kernel
def substitute(factor: Floats, right: Floats) -> None:
    """Solve for the columns of `right` (n, p), in place, with what `factorise` left."""
    size, columns = right.shape
    for k in range(size):
        known = right[k]
        for i in range(k + 1, size):
            value, row = factor[k, i], right[i]
            for c in range(columns):
                row[c] -= value * known[c]
    for i in range(size - 1, -1, -1):
        row = right[i]
        for c in range(columns):
            row[c] *= factor[i, i]
        for k in range(i + 1, size):
            value, known = factor[i, k], right[k]
            for c in range(columns):
                row[c] -= value * known[c]


@borrowing_kernel
def substitute_one(factor: Floats, right: Floats) -> None:
    """As `substitute`, for one column (n,)."""
    size = len(right)
    for k in range(size):
        known, row, below = right[k], factor[k, k + 1 :], right[k + 1 :]
        for i in range(len(row)):
            below[i] -= known * row[i]
    for i in range(size - 1, -1, -1):
        value = right[i] * factor[i, i]
        for k in range(i + 1, size):
            value -= factor[i, k] * right[k]
        right[i] = value


@borrowing_kernel
def residual_and_tangent(q: Floats, motion: Floats, h: float, model: Any, room: Any) -> None:
    """R and dR/dm of a step whose shape and resisting fibres stand in the buffers already."""
    drag_impulse(motion, h, model.elements, room.shape, room.residual)
    drag_tangent(h, model.elements, room.shape, room.tangent)
    for n in range(q.shape[0]):
        section_impulse(q[n], motion[n], h, n, model.fibres, room.fibres, room.section, room.block)
        for k in range(4):
            room.residual[n, k] += room.section[k]
            for j in range(4):
                room.tangent[4 * n + k, 4 * n + j] += room.block[k, j]


@borrowing_kernel
def set_slopes(q: Floats, motion: Floats, h: float, model: Any, room: Any) -> None:
    """Factors of dR/dm, and all that `residual_along` needs, at a solved step whose shape and fibres stand in the buffers already."""
    residual_and_tangent(q, motion, h, model, room)
    factorise(room.tangent)
    set_shape_slopes(q, motion, h, model.elements, room.shape, room.shape_slopes)
    for n in range(q.shape[0]):
        section_slopes(q[n], motion[n], h, n, model.fibres, room.fibres, room.by_strains[n], room.by_levels[n], room.by_step[n])


@borrowing_kernel
def solve_step(q: Floats, motion: Floats, levels: Floats, h: float, model: Any, room: Any) -> bool:
    """Improve `motion` until the residual vanishes; whether it did."""
    set_shape(q, model.elements, room.shape)
    set_fibres(q, levels, model.fibres, room.fibres)
    before, damping = np.inf, 1.0
    for _ in range(ITERATIONS):
        residual_and_tangent(q, motion, h, model, room)
        for n in range(q.shape[0]):
            for k in range(4):
                room.column[4 * n + k] = -room.residual[n, k]
        factorise(room.tangent)
        substitute_one(room.tangent, room.column)
        largest = 0.0
        for n in range(q.shape[0]):
            for k in range(4):
                largest = max(largest, abs(room.column[4 * n + k]) / model.scale[n, k])
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
                motion[n, k] += share * room.column[4 * n + k]
        if largest < CONVERGED:
            return True
    return False


@borrowing_kernel
def begin_motion(motion: Floats, steps: Floats, strains: Floats, t: int) -> None:
    """First guess of the motion in step t, 1 or later, from the one before: its rate, and where steps are short the change of that too."""
    ratio = steps[t] / steps[t - 1]
    smooth = t > 1 and steps[t] <= SHORT
    for n in range(motion.shape[0]):
        for k in range(4):
            last = motion[n, k]
            earlier = (strains[t - 1, n, k] - strains[t - 2, n, k]) * steps[t - 1] / steps[t - 2] if smooth else last
            motion[n, k] = ratio * (last + (last - earlier))


@borrowing_kernel
def set_motion(before: Floats, after: Floats, motion: Floats) -> None:
    """The motion from some strains to others."""
    for n in range(motion.shape[0]):
        for k in range(4):
            motion[n, k] = after[n, k] - before[n, k]


@borrowing_kernel
def roll_out(start: Floats, levels: Floats, steps: Floats, model: Any, room: Any, near: Floats, motion: Floats, strains: Floats) -> Any:
    """Simulate N steps from `start` into `strains` (N + 1, S, 4); how many steps were solved.

    `near` (N + 1, S, 4): a similar motion, from which the iterations begin, or nothing (0, S, 4). `motion` (S, 4): zeros, a buffer.
    """
    for n in range(start.shape[0]):
        for k in range(4):
            strains[0, n, k] = start[n, k]
    for t in range(len(steps)):
        if len(near):
            set_motion(strains[t], near[t + 1], motion)
        elif t:
            begin_motion(motion, steps, strains, t)
        solved = solve_step(strains[t], motion, levels[t], steps[t], model, room)
        if len(near) and not solved:
            motion[:] = 0.0
            solved = solve_step(strains[t], motion, levels[t], steps[t], model, room)
        if not solved:
            return t
        for n in range(start.shape[0]):
            for k in range(4):
                strains[t + 1, n, k] = strains[t, n, k] + motion[n, k]
    return len(steps)


@borrowing_kernel
def residual_along(strain_slopes: Floats, level_slopes: Floats, h: float, step_slope: float, model: Any, room: Any, out: Floats) -> None:
    """Derivative of R at fixed motion along one direction (4 S; groups, S; number), negative, into the column `out` (4 S); after
    `set_slopes`.
    """
    impulse_along(strain_slopes, step_slope, h, model.elements, room.shape, room.shape_slopes, room.along)
    for n in range(len(room.by_step)):
        for k in range(4):
            value = room.along[4 * n + k] + room.by_step[n, k] * step_slope
            for j in range(4):
                value += room.by_strains[n, k, j] * strain_slopes[4 * n + j]
            for group in range(level_slopes.shape[0]):
                value += room.by_levels[n, k, group] * level_slopes[group, n]
            out[4 * n + k] = -value


@borrowing_kernel
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


@borrowing_kernel
def roll_out_slopes(
    strains: Floats, levels: Floats, level_slopes: Floats, steps: Floats, step_slopes: Floats, model: Any, room: Any, motion: Floats,
    slopes: Floats,
) -> None:  # fmt: skip
    """Derivatives `slopes` (N + 1, 4 S, p) of a motion (N + 1, S, 4) that `roll_out` made, from those of the levels (N, groups, S, p) and
    of the steps (N, p); `motion` (S, 4) is a buffer.
    """
    slopes[0] = 0.0
    for t in range(len(steps)):
        set_motion(strains[t], strains[t + 1], motion)
        set_shape(strains[t], model.elements, room.shape)
        set_fibres(strains[t], levels[t], model.fibres, room.fibres)
        set_slopes(strains[t], motion, steps[t], model, room)
        for d in range(slopes.shape[2]):
            if stands_still(slopes[t, :, d], level_slopes[t, :, :, d], step_slopes[t, d]):
                room.right[:, d] = 0.0
                continue
            residual_along(slopes[t, :, d], level_slopes[t, :, :, d], steps[t], step_slopes[t, d], model, room, room.right[:, d])
        substitute(room.tangent, room.right)
        for i in range(slopes.shape[1]):
            for d in range(slopes.shape[2]):
                slopes[t + 1, i, d] = slopes[t, i, d] + room.right[i, d]


@borrowing_kernel
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
        set_motion(strains[t], strains[t + 1], motion)
        set_shape(strains[t], model.elements, room.shape)
        set_fibres(strains[t], levels[t], model.fibres, room.fibres)
        set_slopes(strains[t], motion, steps[t], model, room)
        room.right[:] = 0.0
        for d in range(size):
            unit[d] = 1.0
            residual_along(unit, none, steps[t], 0.0, model, room, room.right[:, d])
            unit[d] = 0.0
        for n in range(sections):
            for group in range(groups):
                for k in range(4):
                    room.right[4 * n + k, size + group * sections + n] = -room.by_levels[n, k, group]
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
