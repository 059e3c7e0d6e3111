"""The full arm touching bodies: the nodes of its outermost rods, the helices, are balls that exchange impulses with them.

Only forces act, no couples: a thin rod that spins about its own axis would be a roller bearing. The body's lever reaches to the node, so
that angular momentum is kept. Order in a step: kick, `touch`, implicit muscles and volume, `follow`, drift, see
`octoctrl.sim.contact.friction_kernels`. Whatever the precision of the arm, bodies and distances are of double.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from ..contact.columns import Anchor, Body
from ..contact.friction_kernels import apart, stays_apart
from ..contact.friction_kernels import follow as follow_point
from ..contact.friction_kernels import touch as touch_point
from ..contact.near_kernels import look
from ..contact.shape_kernels import distance
from .family_kernels import family_offsets

STIFFNESS, NORMAL = int(Body.STIFFNESS), int(Anchor.NORMAL)
LOOK = 10
"""Steps after which one looks again which nodes are near."""


def contact_kernels(grid: AssemblyGrid) -> Any:
    """Compile the contact of an assembly with bodies.

    Returns
    -------
    watch, touch, follow : compiled functions
        ``watch(buffer, world, span)`` lists the nodes that may meet each body within a time (s); ``touch(buffer, world, h)`` exchanges
        impulses; ``follow`` with the same arguments moves anchors.
    """
    o, single = family_offsets(grid, False), grid.single
    X1, X2, X3, V1, V2, V3, LOW1, LOW2, LOW3 = (o[f"{field}{i}"] for field in ("X", "V", "LOW") for i in (1, 2, 3))
    MOBILITY = o["NODE_MOBILITY"]

    @kernel(_nrt=False)
    def place(b: Any, k: Any) -> Any:
        x1, x2, x3 = np.float64(b[X1 + k]), np.float64(b[X2 + k]), np.float64(b[X3 + k])
        if single:
            x1, x2, x3 = x1 + b[LOW1 + k], x2 + b[LOW2 + k], x3 + b[LOW3 + k]
        return x1, x2, x3

    @kernel(_nrt=False)
    def velocity(b: Any, k: Any) -> Any:
        return np.float64(b[V1 + k]), np.float64(b[V2 + k]), np.float64(b[V3 + k])

    @kernel(_nrt=False)
    def watch(b: Any, world: Any, span: Any) -> None:
        points, places, fastest = world.points, world.places, 0.0
        for p in range(len(points.place)):
            k = points.place[p]
            v1, v2, v3 = velocity(b, k)
            fastest = max(fastest, v1 * v1 + v2 * v2 + v3 * v3)
            places[0, p], places[1, p], places[2, p] = place(b, k)
            places[3, p] = points.radius[p]
        look(world, np.sqrt(fastest), span)

    @kernel(_nrt=False)
    def touch(b: Any, world: Any, h: Any) -> None:
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
                k = points.place[p]
                x1, x2, x3 = place(b, k)
                gap, n1, n2, n3 = distance(body, x1, x2, x3)
                gap -= points.radius[p]
                v1, v2, v3 = velocity(b, k)
                if stays_apart(body, gap, n1, n2, n3, x1, x2, x3, v1, v2, v3, h):
                    slack[i] = gap
                    if anchors[p, NORMAL] > 0:
                        apart(anchors, p)
                    continue
                mobility = np.float64(b[MOBILITY + k]) * rate
                if mobility == 0.0:  # held
                    continue
                meetings[i, 0], meetings[i, 1], meetings[i, 2] = n1, n2, n3
                stiffness = body[STIFFNESS] * points.length[p]
                p1, p2, p3 = touch_point(
                    body, anchors, p, gap, n1, n2, n3, x1, x2, x3, v1, v2, v3, mobility, mobility, stiffness, h
                )  # fmt: skip
                b[V1 + k] += mobility * p1
                b[V2 + k] += mobility * p2
                b[V3 + k] += mobility * p3

    @kernel(_nrt=False)
    def follow(b: Any, world: Any, h: Any) -> None:
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
                k = points.place[p]
                x1, x2, x3 = place(b, k)
                v1, v2, v3 = velocity(b, k)
                follow_point(body, anchors, p, meetings[i, 0], meetings[i, 1], meetings[i, 2], x1, x2, x3, v1, v2, v3, h)

    return watch, touch, follow
