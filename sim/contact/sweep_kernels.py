"""One step's contact of an arm's points with bodies, and the list of points that come near: the same for every plant.

A plant says where its points are and how their surface moves, and takes what impulses do to it; which of them are looked at, whether they
meet, what they exchange and how anchors follow is here. Order in a step of the full arm: kick, `touch`, implicit muscles, `follow`, drift
(see `octoctrl.sim.contact.friction_kernels`); of one rod, whose muscles are far stiffer than its step: kick, implicit muscles, `touch`, the
muscles' answer to that, `follow`, drift (see `octoctrl.sim.rod.section_kernels`).
"""

from typing import Any, NamedTuple

import numpy as np

from ..compiler import borrowing_kernel
from .columns import Anchor, Body
from .friction_kernels import apart, stays_apart
from .friction_kernels import follow as follow_point
from .friction_kernels import touch as touch_point
from .near_kernels import due, look

STIFFNESS, NORMAL = int(Body.STIFFNESS), int(Anchor.NORMAL)


class Surface(NamedTuple):
    """What a plant knows of its points, as compiled functions; n is a normal from a body to the arm.

    Attributes
    ----------
    place : (buffer, points, p) -> x1, x2, x3, radius, square of the speed
    meet : (buffer, points, p, body) -> gap, n1, n2, n3, c1, c2, c3, arm
        Where the point is next to a body: the place c at which they meet, and its lever, `arm` times n, from the point.
    velocity : (buffer, points, p, l1, l2, l3) -> v1, v2, v3
        Of the surface at that lever.
    mobility : (buffer, points, p, arm, rate) -> normal, tangent
        Velocity there by a unit impulse along the normal and across it, 1/kg, `rate` that of steps, 1/s; 0 for a point that is held.
    push : (buffer, points, p, l1, l2, l3, rate, p1, p2, p3)
        Give the arm an impulse.
    """

    place: Any
    meet: Any
    velocity: Any
    mobility: Any
    push: Any


def contact_sweeps(surface: Surface) -> Any:
    """Compile the contact of a plant's surface with bodies.

    Returns
    -------
    watch, touch, follow : compiled functions
        ``watch(buffer, world, span)`` lists the points that may meet each body within a time (s); ``touch(buffer, world, h)`` exchanges
        impulses and returns whether there were any; ``follow`` with the same arguments moves anchors.
    """
    place, meet, velocity, mobility, push = surface

    @borrowing_kernel
    def watch(b: Any, world: Any, span: Any) -> None:
        if not due(world, span):
            return
        points, places, fastest = world.points, world.places, 0.0
        for p in range(len(points.length)):
            places[0, p], places[1, p], places[2, p], places[3, p], square = place(b, points, p)
            fastest = max(fastest, square)
        look(world, np.sqrt(fastest), span)

    @borrowing_kernel
    def touch(b: Any, world: Any, h: Any) -> bool:
        points, rate, pushed = world.points, 1.0 / h, False
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
                gap, n1, n2, n3, c1, c2, c3, arm = meet(b, points, p, body)
                l1, l2, l3 = arm * n1, arm * n2, arm * n3
                v1, v2, v3 = velocity(b, points, p, l1, l2, l3)
                if stays_apart(body, gap, n1, n2, n3, c1, c2, c3, v1, v2, v3, h):
                    slack[i] = gap
                    if anchors[p, NORMAL] > 0:
                        apart(anchors, p)
                    continue
                normal, tangent = mobility(b, points, p, arm, rate)
                if normal == 0.0:
                    continue
                meetings[i, 0], meetings[i, 1], meetings[i, 2] = n1, n2, n3
                meetings[i, 3], meetings[i, 4], meetings[i, 5], meetings[i, 6] = c1, c2, c3, arm
                stiffness = body[STIFFNESS] * points.length[p]
                p1, p2, p3 = touch_point(body, anchors, p, gap, n1, n2, n3, c1, c2, c3, v1, v2, v3, normal, tangent, stiffness, h)
                if p1 == 0.0 and p2 == 0.0 and p3 == 0.0:
                    continue
                push(b, points, p, l1, l2, l3, rate, p1, p2, p3)
                pushed = True
        return pushed

    @borrowing_kernel
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
                n1, n2, n3, arm = meetings[i, 0], meetings[i, 1], meetings[i, 2], meetings[i, 6]
                v1, v2, v3 = velocity(b, points, p, arm * n1, arm * n2, arm * n3)
                follow_point(body, anchors, p, n1, n2, n3, meetings[i, 3], meetings[i, 4], meetings[i, 5], v1, v2, v3, h)

    return watch, touch, follow
