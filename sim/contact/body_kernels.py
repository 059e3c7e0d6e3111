"""Rigid bodies: they drift through the water with the arm, are kicked by their springs, and keep their angular momentum in the laboratory.

Momentum rather than spin is the state, so that a free rotation keeps it exactly; the frame turns by the spin that it has half-way
(a midpoint rule on the rotation group, second order: Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, VII.5).
"""

from typing import Any

import numpy as np

from ..compiler import borrowing_kernel
from ..contracts import Floats
from .columns import Body

POSITION, FRAME, VELOCITY, MOMENTUM, SPIN = (int(c) for c in (Body.POSITION, Body.FRAME, Body.VELOCITY, Body.MOMENTUM, Body.SPIN))
INVERSE_MASS, INVERSE_INERTIA, DAMPING = (int(c) for c in (Body.INVERSE_MASS, Body.INVERSE_INERTIA, Body.DAMPING))
SPRING, HOME, HOME_AXIS, PUSH, MOVING = (int(c) for c in (Body.SPRING, Body.HOME, Body.HOME_AXIS, Body.PUSH, Body.MOVING))


@borrowing_kernel
def turned(body: Floats, l1: float, l2: float, l3: float) -> tuple[float, ...]:
    """Spin that an angular momentum gives the body."""
    a = (l1 * body[FRAME] + l2 * body[FRAME + 1] + l3 * body[FRAME + 2]) * body[INVERSE_INERTIA]
    b = (l1 * body[FRAME + 3] + l2 * body[FRAME + 4] + l3 * body[FRAME + 5]) * body[INVERSE_INERTIA + 1]
    c = (l1 * body[FRAME + 6] + l2 * body[FRAME + 7] + l3 * body[FRAME + 8]) * body[INVERSE_INERTIA + 2]
    return (
        body[FRAME] * a + body[FRAME + 3] * b + body[FRAME + 6] * c,
        body[FRAME + 1] * a + body[FRAME + 4] * b + body[FRAME + 7] * c,
        body[FRAME + 2] * a + body[FRAME + 5] * b + body[FRAME + 8] * c,
    )


@borrowing_kernel
def spin_of(body: Floats) -> Any:
    """Spin of a body: its own, or the one it is given."""
    if body[INVERSE_MASS] > 0:
        return turned(body, body[MOMENTUM], body[MOMENTUM + 1], body[MOMENTUM + 2])
    return body[SPIN], body[SPIN + 1], body[SPIN + 2]


@borrowing_kernel
def rotate(body: Floats, u1: float, u2: float, u3: float) -> None:
    """Turn the frame by the rotation vector u, in the laboratory frame."""
    square = u1 * u1 + u2 * u2 + u3 * u3
    sine = 1 - square * (1 / 6 - square * (1 / 120 - square * (1 / 5040 - square / 362880)))
    cosine = 0.5 - square * (1 / 24 - square * (1 / 720 - square * (1 / 40320 - square / 3628800)))
    for row in range(3):
        k = FRAME + 3 * row
        d1, d2, d3 = body[k], body[k + 1], body[k + 2]
        c1, c2, c3 = u2 * d3 - u3 * d2, u3 * d1 - u1 * d3, u1 * d2 - u2 * d1
        body[k] = d1 + sine * c1 + cosine * (u2 * c3 - u3 * c2)
        body[k + 1] = d2 + sine * c2 + cosine * (u3 * c1 - u1 * c3)
        body[k + 2] = d3 + sine * c3 + cosine * (u1 * c2 - u2 * c1)


@borrowing_kernel
def any_moves(bodies: Floats) -> bool:
    """Whether any body can go anywhere."""
    for j in range(bodies.shape[0]):
        if bodies[j, MOVING] > 0:
            return True
    return False


@borrowing_kernel
def drift_bodies(bodies: Floats, h: float) -> None:
    """Move and turn all bodies for a time h, while water takes their velocity and angular momentum: exactly, whatever the step."""
    for j in range(bodies.shape[0]):
        if bodies[j, MOVING] == 0.0:
            continue
        body = bodies[j]
        span = slowed(body[DAMPING], h)
        for i in range(3):
            body[POSITION + i] += span * body[VELOCITY + i]
            body[VELOCITY + i] -= body[DAMPING] * span * body[VELOCITY + i]
        w1, w2, w3 = spin_of(body)
        if w1 == 0.0 and w2 == 0.0 and w3 == 0.0:
            continue
        span = slowed(body[DAMPING + 1], h)
        if body[INVERSE_MASS] > 0:
            # The spin half-way: of the same momentum in the frame as it will be then, found in two rounds.
            a1, a2, a3 = w1, w2, w3
            for _ in range(2):
                rotate(body, 0.5 * span * a1, 0.5 * span * a2, 0.5 * span * a3)
                m1, m2, m3 = spin_of(body)
                rotate(body, -0.5 * span * a1, -0.5 * span * a2, -0.5 * span * a3)
                a1, a2, a3 = m1, m2, m3
            w1, w2, w3 = a1, a2, a3
        rotate(body, span * w1, span * w2, span * w3)
        for i in range(3):
            body[MOMENTUM + i] -= body[DAMPING + 1] * span * body[MOMENTUM + i]


@borrowing_kernel
def slowed(rate: float, h: float) -> float:
    """Time in which a body goes as far as in the time h if water takes its velocity at a `rate`."""
    return -np.expm1(-rate * h) / rate if rate > 0 else h


@borrowing_kernel
def straighten(body: Floats) -> None:
    """Make a frame orthonormal again, to first order of what rounding and series have left: once a sample."""
    for _ in range(2):
        for row in range(3):
            k = FRAME + 3 * row
            p, q = FRAME + 3 * ((row + 1) % 3), FRAME + 3 * ((row + 2) % 3)
            # Half-way between a director and the cross product of the other two.
            c1 = body[p + 1] * body[q + 2] - body[p + 2] * body[q + 1]
            c2 = body[p + 2] * body[q] - body[p] * body[q + 2]
            c3 = body[p] * body[q + 1] - body[p + 1] * body[q]
            m1, m2, m3 = body[k] + c1, body[k + 1] + c2, body[k + 2] + c3
            size = np.sqrt(m1 * m1 + m2 * m2 + m3 * m3)
            body[k], body[k + 1], body[k + 2] = m1 / size, m2 / size, m3 / size


@borrowing_kernel
def kick_bodies(bodies: Floats, h: float) -> None:
    """Springs and pushes over one step; springs swing as they should by what `bodies.swung` adds to masses."""
    for j in range(bodies.shape[0]):
        mobility = bodies[j, INVERSE_MASS]
        if mobility == 0.0:
            continue
        body = bodies[j]
        for i in range(3):
            body[VELOCITY + i] += h * mobility * (body[PUSH + i] + body[SPRING] * (body[HOME + i] - body[POSITION + i]))
        a1, a2, a3 = body[FRAME + 6], body[FRAME + 7], body[FRAME + 8]
        b1, b2, b3 = body[HOME_AXIS], body[HOME_AXIS + 1], body[HOME_AXIS + 2]
        pull = h * body[SPRING + 1]
        body[MOMENTUM] += pull * (a2 * b3 - a3 * b2)
        body[MOMENTUM + 1] += pull * (a3 * b1 - a1 * b3)
        body[MOMENTUM + 2] += pull * (a1 * b2 - a2 * b1)
