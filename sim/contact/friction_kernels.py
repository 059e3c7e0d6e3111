"""What one point of an arm and one body do to each other in a step: an implicit impulse along the normal, anchored Coulomb friction across.

With the gap g at mid-step, normal n from body to arm, relative velocity v of the surfaces after the kick, mobilities w of the pair:

    a = h (h k + c),   p = max(0, (-h k g - a v_n) / (1 + a w_n))            critical damping c = 2 zeta sqrt(k / w_n) where they overlap
    b = h (h k_t + 2 zeta sqrt(k_t / w_t)),   q = -(h k_t s + b v_t) / (1 + b w_t)          s: stretch of the anchor's spring
    |q| > mu p:   it slides, q <- mu_k p q / |q|, and the spring keeps the stretch that this force needs

Backward Euler for the spring and its damper, so there is no limit on the step; the return to the friction cone is that of plasticity
(Simo & Laursen 1992, Computers & Structures 42:97). Impulses act on arm and body at once, point by point in a fixed order. The anchor
follows the velocity that the surfaces have at the end of the step, when the implicit muscles have had their say (`follow`): with the
one from before the arm would tremble in its grasp for ever.

`anchors` are those of all points with one body, (P, Anchor.WIDTH), and `point` the one that touches.
"""

import numpy as np

from ..compiler import borrowing_kernel
from ..contracts import Floats
from .body_kernels import spin_of, turned
from .columns import Anchor, Body

POSITION, VELOCITY, MOMENTUM, INVERSE_MASS = (int(c) for c in (Body.POSITION, Body.VELOCITY, Body.MOMENTUM, Body.INVERSE_MASS))
STATIC, KINETIC, IMPULSE, COUPLE, MOVING = (int(c) for c in (Body.STATIC, Body.KINETIC, Body.IMPULSE, Body.COUPLE, Body.MOVING))
SUM, DEEPEST, LOADED, SLIPPED, SUNK = (int(c) for c in (Body.NORMAL, Body.DEEPEST, Body.LOADED, Body.SLIPPED, Body.SUNK))
STRETCH, SLIDING, SLIP, NORMAL = (int(c) for c in (Anchor.STRETCH, Anchor.SLIDING, Anchor.SLIP, Anchor.NORMAL))

TANGENTIAL = 0.5
"""Stiffness of the anchor over that of the contact."""
ZETA = 1.0
"""Damping over the critical one: no rebound, and anchors do not ring."""
TINY = 1e-300


@borrowing_kernel
def apart(anchors: Floats, p: int) -> None:
    """Forget a touch, but for the path slid."""
    for i in range(6):
        if i != SLIP:
            anchors[p, i] = 0.0


@borrowing_kernel
def relative(body: Floats, b1: float, b2: float, b3: float, v1: float, v2: float, v3: float) -> tuple[float, ...]:
    """Velocity of the arm's surface less that of the body at the lever b from its centre."""
    if body[MOVING] == 0.0:
        return v1, v2, v3
    w1, w2, w3 = spin_of(body)
    return (
        v1 - body[VELOCITY] - (w2 * b3 - w3 * b2),
        v2 - body[VELOCITY + 1] - (w3 * b1 - w1 * b3),
        v3 - body[VELOCITY + 2] - (w1 * b2 - w2 * b1),
    )


@borrowing_kernel
def mobility_along(body: Floats, b1: float, b2: float, b3: float, e1: float, e2: float, e3: float) -> float:
    """Velocity of the body's point at lever b along e after a unit impulse along e."""
    if body[INVERSE_MASS] == 0.0:
        return 0.0
    l1, l2, l3 = b2 * e3 - b3 * e2, b3 * e1 - b1 * e3, b1 * e2 - b2 * e1
    w1, w2, w3 = turned(body, l1, l2, l3)
    return body[INVERSE_MASS] + l1 * w1 + l2 * w2 + l3 * w3


@borrowing_kernel
def stays_apart(
    body: Floats, gap: float, n1: float, n2: float, n3: float, c1: float, c2: float, c3: float, v1: float, v2: float, v3: float, h: float
) -> bool:
    """Whether there is a gap that the velocities do not close within the step: then no impulse follows."""
    if gap < 0:
        return False
    v1, v2, v3 = relative(body, c1 - body[POSITION], c2 - body[POSITION + 1], c3 - body[POSITION + 2], v1, v2, v3)
    return gap + h * (v1 * n1 + v2 * n2 + v3 * n3) >= 0


@borrowing_kernel
def normal_impulse(gap: float, speed: float, mobility: float, stiffness: float, h: float) -> float:
    """Impulse along the normal between surfaces at a `gap` that part with a `speed`, by the `mobility` of the pair; none if negative."""
    damping = 2 * ZETA * np.sqrt(stiffness / mobility) if gap < 0 else 0.0
    a = h * (h * stiffness + damping)
    return (-h * stiffness * gap - a * speed) / (1 + a * mobility)


@borrowing_kernel
def impulse(
    body: Floats, anchors: Floats, point: int, gap: float, n1: float, n2: float, n3: float, b1: float, b2: float, b3: float, v1: float,
    v2: float, v3: float, arm_normal: float, arm_tangent: float, crowd: float, stiffness: float, h: float,
) -> tuple[float, ...]:  # fmt: skip
    """Normal impulse and its sum with friction, at the lever b of the body, past which the other surface moves with v.

    A `crowd` of points whose impulses do not see one another is as light as a single one of them times their number.
    """
    normal_speed = v1 * n1 + v2 * n2 + v3 * n3
    w = crowd * (arm_normal + mobility_along(body, b1, b2, b3, n1, n2, n3))
    p = normal_impulse(gap, normal_speed, w, stiffness, h)
    if not p > 0:
        apart(anchors, point)
        return 0.0, 0.0, 0.0, 0.0
    t1, t2, t3 = v1 - normal_speed * n1, v2 - normal_speed * n2, v3 - normal_speed * n3
    s1, s2, s3 = anchors[point, STRETCH], anchors[point, STRETCH + 1], anchors[point, STRETCH + 2]
    out = s1 * n1 + s2 * n2 + s3 * n3
    s1, s2, s3 = s1 - out * n1, s2 - out * n2, s3 - out * n3
    tangential = TANGENTIAL * stiffness
    w = arm_tangent
    if body[INVERSE_MASS] > 0:
        e1, e2, e3 = s1 + h * t1, s2 + h * t2, s3 + h * t3
        size = np.sqrt(e1 * e1 + e2 * e2 + e3 * e3) + TINY
        w += mobility_along(body, b1, b2, b3, e1 / size, e2 / size, e3 / size)
    w *= crowd
    b = h * (h * tangential + 2 * ZETA * np.sqrt(tangential / w))
    share = 1 / (1 + b * w)
    q1 = -(h * tangential * s1 + b * t1) * share
    q2 = -(h * tangential * s2 + b * t2) * share
    q3 = -(h * tangential * s3 + b * t3) * share
    square, limit = q1 * q1 + q2 * q2 + q3 * q3, p * (body[KINETIC] if anchors[point, SLIDING] > 0 else body[STATIC])
    if square > limit * limit:
        shorter, give = body[KINETIC] * p / np.sqrt(square), -1 / (h * tangential)
        q1, q2, q3 = shorter * q1, shorter * q2, shorter * q3
        s1, s2, s3 = give * q1, give * q2, give * q3
        anchors[point, SLIDING] = 1.0
    else:
        anchors[point, SLIDING] = 0.0
    anchors[point, STRETCH], anchors[point, STRETCH + 1], anchors[point, STRETCH + 2] = s1, s2, s3
    anchors[point, NORMAL] = p / h
    return p, p * n1 + q1, p * n2 + q2, p * n3 + q3


@borrowing_kernel
def push(body: Floats, p1: float, p2: float, p3: float, l1: float, l2: float, l3: float) -> None:
    """Give a body the impulse p and the angular momentum l about its centre."""
    mobility = body[INVERSE_MASS]
    if mobility > 0:
        body[VELOCITY] += mobility * p1
        body[VELOCITY + 1] += mobility * p2
        body[VELOCITY + 2] += mobility * p3
        body[MOMENTUM] += l1
        body[MOMENTUM + 1] += l2
        body[MOMENTUM + 2] += l3


@borrowing_kernel
def touch(
    body: Floats, anchors: Floats, point: int, gap: float, n1: float, n2: float, n3: float, c1: float, c2: float, c3: float, v1: float,
    v2: float, v3: float, arm_normal: float, arm_tangent: float, stiffness: float, h: float,
) -> tuple[float, ...]:  # fmt: skip
    """Impulse on the arm at the place c, where its surface moves with v; the body receives the opposite, and keeps account of it."""
    b1, b2, b3 = c1 - body[POSITION], c2 - body[POSITION + 1], c3 - body[POSITION + 2]
    v1, v2, v3 = relative(body, b1, b2, b3, v1, v2, v3)
    p, p1, p2, p3 = impulse(
        body, anchors, point, gap, n1, n2, n3, b1, b2, b3, v1, v2, v3, arm_normal, arm_tangent, 1.0, stiffness, h
    )  # fmt: skip
    if p > 0:
        l1, l2, l3 = b2 * p3 - b3 * p2, b3 * p1 - b1 * p3, b1 * p2 - b2 * p1
        push(body, -p1, -p2, -p3, -l1, -l2, -l3)
        body[IMPULSE] -= p1
        body[IMPULSE + 1] -= p2
        body[IMPULSE + 2] -= p3
        body[COUPLE] -= l1
        body[COUPLE + 1] -= l2
        body[COUPLE + 2] -= l3
        body[SUM] += p
        body[DEEPEST] = max(body[DEEPEST], -gap)
        body[SUNK] = max(body[SUNK], -gap - p / (h * stiffness))
        body[LOADED] += 1.0
    return p1, p2, p3


@borrowing_kernel
def follow(
    body: Floats, anchors: Floats, point: int, n1: float, n2: float, n3: float, c1: float, c2: float, c3: float, v1: float, v2: float,
    v3: float, h: float,
) -> None:  # fmt: skip
    """Move the anchor of a point of the arm; the body's row keeps the longest path slid."""
    move_anchor(body, anchors, point, n1, n2, n3, c1, c2, c3, v1, v2, v3, h)
    body[SLIPPED] = max(body[SLIPPED], anchors[point, SLIP])


@borrowing_kernel
def move_anchor(
    body: Floats, anchors: Floats, point: int, n1: float, n2: float, n3: float, c1: float, c2: float, c3: float, v1: float, v2: float,
    v3: float, h: float,
) -> None:  # fmt: skip
    """At the end of the step an anchor that holds is stretched by the motion that really takes place; one that slides counts its path."""
    v1, v2, v3 = relative(body, c1 - body[POSITION], c2 - body[POSITION + 1], c3 - body[POSITION + 2], v1, v2, v3)
    normal_speed = v1 * n1 + v2 * n2 + v3 * n3
    t1, t2, t3 = v1 - normal_speed * n1, v2 - normal_speed * n2, v3 - normal_speed * n3
    if anchors[point, SLIDING] > 0:
        anchors[point, SLIP] += h * np.sqrt(t1 * t1 + t2 * t2 + t3 * t3)
    else:
        anchors[point, STRETCH] += h * t1
        anchors[point, STRETCH + 1] += h * t2
        anchors[point, STRETCH + 2] += h * t3
