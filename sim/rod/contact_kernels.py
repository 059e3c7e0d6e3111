"""A rod touching bodies: material points along it, each a ball of the rod's present radius.

Point p sits in element k at the share xi of its length. An impulse on its surface goes to the element's two nodes by (1 - xi, xi) and
turns the element by its lever from the centreline. Order in a step: kick, `touch`, implicit muscles, `follow`, drift
(see `octoctrl.sim.contact.friction_kernels`).
"""

from typing import Any

import numpy as np

from ..compiler import kernel
from ..contact.columns import Anchor, Body
from ..contact.friction_kernels import apart, stays_apart
from ..contact.friction_kernels import follow as follow_point
from ..contact.friction_kernels import touch as touch_point
from ..contact.near_kernels import look
from ..contact.shape_kernels import distance
from .layout import offsets

ONE = np.uint64(1)
STIFFNESS, NORMAL = int(Body.STIFFNESS), int(Anchor.NORMAL)


def rod_contact_kernels(stride: int, constant_section: bool = False) -> Any:
    """Compile the contact of a rod with bodies for buffers of the given stride.

    Parameters
    ----------
    stride : int
    constant_section : bool
        Whether the radius stays that at rest when the rod is stretched.

    Returns
    -------
    watch, touch, follow : compiled functions
        ``watch(buffer, world, span)`` lists the points that may meet each body within a time (s);
        ``touch(buffer, world, h)`` exchanges impulses; ``follow`` with the same arguments moves anchors.
    """
    o = offsets(stride)
    X = (o["X1"], o["X2"], o["X3"])
    V1, V2, V3, W1, W2, W3 = (o[name] for name in ("V1", "V2", "V3", "W1", "W2", "W3"))
    X1, X2, X3 = X
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    MOBILITY, MOBILITY1, MOBILITY2, MOBILITY3 = (o[name] for name in ("NODE_MOBILITY", "MOBILITY1", "MOBILITY2", "MOBILITY3"))
    STRETCH = o["STRETCH"]

    @kernel(_nrt=False)
    def place(b, k, xi):
        q = k + ONE
        return (
            b[X1 + k] + xi * (b[X1 + q] - b[X1 + k]),
            b[X2 + k] + xi * (b[X2 + q] - b[X2 + k]),
            b[X3 + k] + xi * (b[X3 + q] - b[X3 + k]),
        )

    @kernel(_nrt=False)
    def present_radius(b, points, p, k):
        return points.radius[p] if constant_section else points.radius[p] / np.sqrt(b[STRETCH + k])

    @kernel(_nrt=False)
    def lever(b, points, p, k, body):
        """Gap, normal, and place and lever of the middle of the overlap."""
        x1, x2, x3 = place(b, k, points.share[p])
        gap, n1, n2, n3 = distance(body, x1, x2, x3)
        radius = present_radius(b, points, p, k)
        gap -= radius
        arm = -(radius + 0.5 * gap)
        return gap, n1, n2, n3, x1 + arm * n1, x2 + arm * n2, x3 + arm * n3, arm

    @kernel(_nrt=False)
    def surface_velocity(b, k, xi, l1, l2, l3):
        q = k + ONE
        a1, a2, a3 = b[W1 + k], b[W2 + k], b[W3 + k]
        w1 = b[Q11 + k] * a1 + b[Q21 + k] * a2 + b[Q31 + k] * a3
        w2 = b[Q12 + k] * a1 + b[Q22 + k] * a2 + b[Q32 + k] * a3
        w3 = b[Q13 + k] * a1 + b[Q23 + k] * a2 + b[Q33 + k] * a3
        return (
            (1 - xi) * b[V1 + k] + xi * b[V1 + q] + w2 * l3 - w3 * l2,
            (1 - xi) * b[V2 + k] + xi * b[V2 + q] + w3 * l1 - w1 * l3,
            (1 - xi) * b[V3 + k] + xi * b[V3 + q] + w1 * l2 - w2 * l1,
        )

    @kernel(_nrt=False)
    def watch(b, world, span):
        points, places, fastest = world.points, world.places, 0.0
        for p in range(len(points.element)):
            k = points.element[p]
            fastest = max(fastest, b[V1 + k] ** 2 + b[V2 + k] ** 2 + b[V3 + k] ** 2)
            places[0, p], places[1, p], places[2, p] = place(b, k, points.share[p])
            places[3, p] = present_radius(b, points, p, k)
        look(world, np.sqrt(fastest), span)

    @kernel(_nrt=False)
    def touch(b, world, h):
        points, rate = world.points, 1.0 / h
        for j in range(world.bodies.shape[0]):
            count = world.counts[j]
            if count == 0:
                continue
            body, anchors, near, meetings = world.bodies[j], world.anchors[j], world.near[j], world.meetings[j]
            slack, closing = world.slack[j], h * world.paces[j]
            for i in range(count):
                slack[i] -= closing
                if slack[i] > 0:
                    continue
                p = near[i]
                k, xi = points.element[p], points.share[p]
                q = k + ONE
                gap, n1, n2, n3, c1, c2, c3, arm = lever(b, points, p, k, body)
                l1, l2, l3 = arm * n1, arm * n2, arm * n3
                v1, v2, v3 = surface_velocity(b, k, xi, l1, l2, l3)
                if stays_apart(body, gap, n1, n2, n3, c1, c2, c3, v1, v2, v3, h):
                    slack[i] = gap
                    if anchors[p, NORMAL] > 0:
                        apart(anchors, p)
                    continue
                normal = ((1 - xi) * (1 - xi) * b[MOBILITY + k] + xi * xi * b[MOBILITY + q]) * rate
                if normal == 0.0:  # between held nodes
                    continue
                meetings[i, 0], meetings[i, 1], meetings[i, 2] = n1, n2, n3
                meetings[i, 3], meetings[i, 4], meetings[i, 5], meetings[i, 6] = c1, c2, c3, arm
                turn = (1.0 if constant_section else b[STRETCH + k]) * rate
                tangent = normal + arm * arm * turn * max(b[MOBILITY1 + k], b[MOBILITY2 + k], b[MOBILITY3 + k])
                stiffness = body[STIFFNESS] * points.length[p]
                p1, p2, p3 = touch_point(body, anchors, p, gap, n1, n2, n3, c1, c2, c3, v1, v2, v3, normal, tangent, stiffness, h)
                if p1 == 0.0 and p2 == 0.0 and p3 == 0.0:
                    continue
                here, there = (1 - xi) * b[MOBILITY + k] * rate, xi * b[MOBILITY + q] * rate
                b[V1 + k] += here * p1
                b[V2 + k] += here * p2
                b[V3 + k] += here * p3
                b[V1 + q] += there * p1
                b[V2 + q] += there * p2
                b[V3 + q] += there * p3
                t1, t2, t3 = l2 * p3 - l3 * p2, l3 * p1 - l1 * p3, l1 * p2 - l2 * p1
                b[W1 + k] += turn * b[MOBILITY1 + k] * (b[Q11 + k] * t1 + b[Q12 + k] * t2 + b[Q13 + k] * t3)
                b[W2 + k] += turn * b[MOBILITY2 + k] * (b[Q21 + k] * t1 + b[Q22 + k] * t2 + b[Q23 + k] * t3)
                b[W3 + k] += turn * b[MOBILITY3 + k] * (b[Q31 + k] * t1 + b[Q32 + k] * t2 + b[Q33 + k] * t3)

    @kernel(_nrt=False)
    def follow(b, world, h):
        points = world.points
        for j in range(world.bodies.shape[0]):
            count = world.counts[j]
            if count == 0:
                continue
            body, anchors, near, meetings = world.bodies[j], world.anchors[j], world.near[j], world.meetings[j]
            for i in range(count):
                p = near[i]
                if anchors[p, NORMAL] == 0.0:
                    continue
                n1, n2, n3, arm = meetings[i, 0], meetings[i, 1], meetings[i, 2], meetings[i, 6]
                v1, v2, v3 = surface_velocity(b, points.element[p], points.share[p], arm * n1, arm * n2, arm * n3)
                follow_point(body, anchors, p, n1, n2, n3, meetings[i, 3], meetings[i, 4], meetings[i, 5], v1, v2, v3, h)

    return watch, touch, follow
