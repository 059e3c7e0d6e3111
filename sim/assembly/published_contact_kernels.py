"""Contact with capsules as published, for comparison: an explicit force on elements of the helices, friction regularised by a velocity.

Tekinalp et al. (2024), as released: the element k reaches from its centre over one length (half a length further than it should) and
meets the axis of the capsule where the two segments are closest, at a distance d. With the gap g = d - R - r, the normal n from the element
to the axis, and v = v_body - v_element (the body's rotation is left out), the body receives

    N n - min(2 c |v_t|, mu N) v_t / |v_t|,      N = -k g - nu v.n,      where g < 0

with the lever to its axis; the element's two nodes share the opposite. k is the object's stiffness times the length of arm for which a node
stands.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import borrowing_kernel
from ..contact.columns import Body
from ..contact.near_kernels import due, look
from .family_kernels import family_offsets

ONE = np.uint64(1)
RATE, GRIP = 1e-3, 100.0
"""nu and c, kg/s."""
TINY = 1e-300

RADIUS, HALF, POSITION, VELOCITY, MOMENTUM = (int(Body.SIZE), int(Body.SIZE) + 1, *map(int, (Body.POSITION, Body.VELOCITY, Body.MOMENTUM)))
AXIS = int(Body.FRAME) + 6
INVERSE_MASS, KINETIC, STIFFNESS, IMPULSE, COUPLE = map(int, (Body.INVERSE_MASS, Body.KINETIC, Body.STIFFNESS, Body.IMPULSE, Body.COUPLE))
SUM, DEEPEST, LOADED = map(int, (Body.NORMAL, Body.DEEPEST, Body.LOADED))


@borrowing_kernel
def closest(r1: float, r2: float, r3: float, e1: float, e2: float, e3: float, a1: float, a2: float, a3: float) -> tuple[float, float]:
    """Shares (u, t) where the segments P + u e and S + t a, r = P - S, are closest (Ericson 2005, Real-Time Collision Detection, 5.1)."""
    aa, ee = e1 * e1 + e2 * e2 + e3 * e3, a1 * a1 + a2 * a2 + a3 * a3
    f, c, b = a1 * r1 + a2 * r2 + a3 * r3, e1 * r1 + e2 * r2 + e3 * r3, e1 * a1 + e2 * a2 + e3 * a3
    across = aa * ee - b * b
    u = min(max((b * f - c * ee) / across, 0.0), 1.0) if across > 1e-30 else 0.0
    t = (b * u + f) / ee
    if t < 0.0:
        return min(max(-c / aa, 0.0), 1.0), 0.0
    if t > 1.0:
        return min(max((b - c) / aa, 0.0), 1.0), 1.0
    return u, t


def published_contact_kernels(grid: AssemblyGrid) -> Any:
    """Compile the published contact of an assembly with capsules.

    Returns
    -------
    watch, press : compiled functions
        ``watch(buffer, world, span)`` lists the elements that may meet each body within a time (s), by their second node;
        ``press(buffer, world, h)`` adds forces to the helices and impulses to the bodies.
    """
    o = family_offsets(grid, False)
    X1, X2, X3, V1, V2, V3, F1, F2, F3 = (o[f"{field}{i}"] for field in "XVF" for i in (1, 2, 3))
    SECTION, nodes = o["RADIUS"], grid.helix_elements + 1

    @borrowing_kernel
    def watch(b: Any, world: Any, span: Any) -> None:
        if not due(world, span):
            return
        points, places, fastest = world.points, world.places, 0.0
        for p in range(len(points.place)):
            k = points.place[p]
            fastest = max(fastest, b[V1 + k] ** 2 + b[V2 + k] ** 2 + b[V3 + k] ** 2)
            places[0, p], places[1, p], places[2, p] = b[X1 + k], b[X2 + k], b[X3 + k]
            # The segment reaches half an element to either side of the node.
            before = k - ONE if p % nodes > 0 else k
            d1, d2, d3 = b[X1 + k] - b[X1 + before], b[X2 + k] - b[X2 + before], b[X3 + k] - b[X3 + before]
            places[3, p] = points.radius[p] + 0.5 * np.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
        look(world, np.sqrt(fastest), span)

    @borrowing_kernel
    def press(b: Any, world: Any, h: Any) -> None:
        points = world.points
        for j in range(world.bodies.shape[0]):
            body, near = world.bodies[j], world.near[j]
            length, mobility = 2 * body[HALF], body[INVERSE_MASS]
            a1, a2, a3 = length * body[AXIS], length * body[AXIS + 1], length * body[AXIS + 2]
            low1, low2, low3 = body[POSITION] - 0.5 * a1, body[POSITION + 1] - 0.5 * a2, body[POSITION + 2] - 0.5 * a3
            for i in range(world.counts[j]):
                p = near[i]
                if p % nodes == 0:
                    continue
                q = points.place[p]
                k = q - ONE
                e1, e2, e3 = b[X1 + q] - b[X1 + k], b[X2 + q] - b[X2 + k], b[X3 + q] - b[X3 + k]
                m1, m2, m3 = b[X1 + k] + 0.5 * e1, b[X2 + k] + 0.5 * e2, b[X3 + k] + 0.5 * e3
                u, t = closest(m1 - low1, m2 - low2, m3 - low3, e1, e2, e3, a1, a2, a3)
                x1, x2, x3 = low1 + t * a1, low2 + t * a2, low3 + t * a3
                n1, n2, n3 = x1 - (m1 + u * e1), x2 - (m2 + u * e2), x3 - (m3 + u * e3)
                distance = np.sqrt(n1 * n1 + n2 * n2 + n3 * n3)
                gap = distance - body[RADIUS] - b[SECTION + k]
                if not gap < 0:
                    continue
                n1, n2, n3 = n1 / distance, n2 / distance, n3 / distance
                v1 = body[VELOCITY] - 0.5 * (b[V1 + k] + b[V1 + q])
                v2 = body[VELOCITY + 1] - 0.5 * (b[V2 + k] + b[V2 + q])
                v3 = body[VELOCITY + 2] - 0.5 * (b[V3 + k] + b[V3 + q])
                speed = v1 * n1 + v2 * n2 + v3 * n3
                v1, v2, v3 = v1 - speed * n1, v2 - speed * n2, v3 - speed * n3
                past = np.sqrt(v1 * v1 + v2 * v2 + v3 * v3)
                normal = -body[STIFFNESS] * points.length[p] * gap - RATE * speed
                drag = min(2 * GRIP * past, body[KINETIC] * abs(normal)) / (past + TINY)
                f1, f2, f3 = normal * n1 - drag * v1, normal * n2 - drag * v2, normal * n3 - drag * v3
                for node in (k, q):
                    b[F1 + node] -= 0.5 * f1
                    b[F2 + node] -= 0.5 * f2
                    b[F3 + node] -= 0.5 * f3
                l1, l2, l3 = x1 - body[POSITION], x2 - body[POSITION + 1], x3 - body[POSITION + 2]
                l1, l2, l3 = l2 * f3 - l3 * f2, l3 * f1 - l1 * f3, l1 * f2 - l2 * f1
                if mobility > 0:
                    body[VELOCITY] += h * mobility * f1
                    body[VELOCITY + 1] += h * mobility * f2
                    body[VELOCITY + 2] += h * mobility * f3
                    body[MOMENTUM] += h * l1
                    body[MOMENTUM + 1] += h * l2
                    body[MOMENTUM + 2] += h * l3
                body[IMPULSE] += h * f1
                body[IMPULSE + 1] += h * f2
                body[IMPULSE + 2] += h * f3
                body[COUPLE] += h * l1
                body[COUPLE + 1] += h * l2
                body[COUPLE + 2] += h * l3
                body[SUM] += h * normal
                body[DEEPEST] = max(body[DEEPEST], -gap)
                body[LOADED] += 1.0

    return watch, press
