"""Bodies touching bodies: the points of the smaller one against the distance from the other, by the law that holds for the arm.

Stiffness and friction are those of the larger body. All points of a pair see the velocities from before any of their impulses, and share
the mass of the bodies between them (mass splitting: Tonge et al. 2012, ACM Trans. Graph. 31:105): one after the other they would rock a
body that lies on many of them.
"""

from typing import Any

from ..compiler import borrowing_kernel
from .body_kernels import spin_of
from .columns import Anchor, Body
from .friction_kernels import impulse, mobility_along, move_anchor, push, relative
from .shape_kernels import distance

POSITION, FRAME, VELOCITY, MOMENTUM = (int(c) for c in (Body.POSITION, Body.FRAME, Body.VELOCITY, Body.MOMENTUM))
INVERSE_MASS, INVERSE_INERTIA, STIFFNESS = (int(c) for c in (Body.INVERSE_MASS, Body.INVERSE_INERTIA, Body.STIFFNESS))
NORMAL = int(Anchor.NORMAL)
NEAR = 0.5e-3
"""Gap (m) up to which the law is asked; above it nothing acts unless a force did in the step before."""


@borrowing_kernel
def point_on(body: Any, marker: Any) -> Any:
    """Where a body's point is."""
    m1, m2, m3 = marker[0], marker[1], marker[2]
    return (
        body[POSITION] + m1 * body[FRAME] + m2 * body[FRAME + 3] + m3 * body[FRAME + 6],
        body[POSITION + 1] + m1 * body[FRAME + 1] + m2 * body[FRAME + 4] + m3 * body[FRAME + 7],
        body[POSITION + 2] + m1 * body[FRAME + 2] + m2 * body[FRAME + 5] + m3 * body[FRAME + 8],
    )


@borrowing_kernel
def meeting(body: Any, other: Any, marker: Any) -> Any:
    """Gap, normal, and where the two meet, from the centre of the `body` whose point it is."""
    x1, x2, x3 = point_on(body, marker)
    gap, n1, n2, n3 = distance(other, x1, x2, x3)
    gap -= marker[3]
    out = marker[3] + 0.5 * gap
    return gap, n1, n2, n3, x1 - out * n1 - body[POSITION], x2 - out * n2 - body[POSITION + 1], x3 - out * n3 - body[POSITION + 2]


@borrowing_kernel
def velocity_at(body: Any, b1: float, b2: float, b3: float) -> Any:
    """Velocity of a body at the lever b from its centre."""
    w1, w2, w3 = spin_of(body)
    return (
        body[VELOCITY] + w2 * b3 - w3 * b2,
        body[VELOCITY + 1] + w3 * b1 - w1 * b3,
        body[VELOCITY + 2] + w1 * b2 - w2 * b1,
    )


@borrowing_kernel
def approach(body: Any, other: Any, b1: float, b2: float, b3: float) -> Any:
    """Lever from the centre of the other, and velocity past it, of the place at the lever b of the `body`."""
    a1, a2, a3 = (
        b1 + body[POSITION] - other[POSITION],
        b2 + body[POSITION + 1] - other[POSITION + 1],
        b3 + body[POSITION + 2] - other[POSITION + 2],
    )
    v1, v2, v3 = velocity_at(body, b1, b2, b3)
    v1, v2, v3 = relative(other, a1, a2, a3, v1, v2, v3)
    return a1, a2, a3, v1, v2, v3


@borrowing_kernel
def crowd_of(body: Any, other: Any, anchors: Any, pairs: Any, first: int, last: int, h: float) -> float:
    """How many points of a pair touch, or would by the end of the step: they share the bodies between them."""
    count = 0.0
    for q in range(first, last):
        gap, n1, n2, n3, b1, b2, b3 = meeting(body, other, pairs.markers[q])
        if gap > NEAR and anchors[q - first, NORMAL] == 0.0:
            continue
        _, _, _, v1, v2, v3 = approach(body, other, b1, b2, b3)
        if anchors[q - first, NORMAL] > 0 or gap + h * min(v1 * n1 + v2 * n2 + v3 * n3, 0.0) < 0:
            count += 1.0
    return max(count, 1.0)


@borrowing_kernel
def meet(world: Any, h: float) -> None:
    """Exchange impulses between all bodies that touch, and move their anchors."""
    bodies, pairs = world.bodies, world.pairs
    for k in range(pairs.pairs.shape[0]):
        if pairs.near[k] == 0:
            continue
        i = pairs.pairs[k, 0]
        body, other, anchors, first, last = bodies[i], bodies[pairs.pairs[k, 1]], pairs.anchors[k], pairs.first[i], pairs.first[i + 1]
        crowd = crowd_of(body, other, anchors, pairs, first, last, h)
        stoutest = max(body[INVERSE_INERTIA], body[INVERSE_INERTIA + 1], body[INVERSE_INERTIA + 2])
        s1, s2, s3, t1, t2, t3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for q in range(first, last):
            marker, p = pairs.markers[q], q - first
            gap, n1, n2, n3, b1, b2, b3 = meeting(body, other, marker)
            if gap > NEAR and anchors[p, NORMAL] == 0.0:
                continue
            mobility = body[INVERSE_MASS]
            along = mobility_along(body, b1, b2, b3, n1, n2, n3)
            # Across, no less than it can be in any direction.
            across = mobility + (b1 * b1 + b2 * b2 + b3 * b3) * stoutest if mobility > 0 else 0.0
            a1, a2, a3, v1, v2, v3 = approach(body, other, b1, b2, b3)
            stiffness = other[STIFFNESS] * marker[4]
            _, p1, p2, p3 = impulse(
                other, anchors, p, gap, n1, n2, n3, a1, a2, a3, v1, v2, v3, along, across, crowd, stiffness, h
            )  # fmt: skip
            s1, s2, s3 = s1 + p1, s2 + p2, s3 + p3
            t1, t2, t3 = t1 + b2 * p3 - b3 * p2, t2 + b3 * p1 - b1 * p3, t3 + b1 * p2 - b2 * p1
        d1, d2, d3 = body[POSITION] - other[POSITION], body[POSITION + 1] - other[POSITION + 1], body[POSITION + 2] - other[POSITION + 2]
        push(body, s1, s2, s3, t1, t2, t3)
        push(other, -s1, -s2, -s3, -t1 - (d2 * s3 - d3 * s2), -t2 - (d3 * s1 - d1 * s3), -t3 - (d1 * s2 - d2 * s1))
    for k in range(pairs.pairs.shape[0]):
        if pairs.near[k] == 0:
            continue
        i = pairs.pairs[k, 0]
        body, other, anchors, first = bodies[i], bodies[pairs.pairs[k, 1]], pairs.anchors[k], pairs.first[i]
        for q in range(first, pairs.first[i + 1]):
            p = q - first
            if anchors[p, NORMAL] == 0.0:
                continue
            _, n1, n2, n3, b1, b2, b3 = meeting(body, other, pairs.markers[q])
            v1, v2, v3 = velocity_at(body, b1, b2, b3)
            c1, c2, c3 = b1 + body[POSITION], b2 + body[POSITION + 1], b3 + body[POSITION + 2]
            move_anchor(other, anchors, p, n1, n2, n3, c1, c2, c3, v1, v2, v3, h)
