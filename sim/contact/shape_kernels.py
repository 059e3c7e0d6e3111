"""Signed distance of a point from a body, and the direction in which it grows: negative inside, zero on the surface.

``distance(body, x1, x2, x3) -> gap, n1, n2, n3`` with the unit normal from the body to the point, all in the laboratory frame. Exact
outside; inside exact too, but for a box and a cylinder along their edges, where the nearest face counts; of a
mesh as fine as its grid. Closed forms as in Quilez
(2008-, "distance functions"); a capsule is the set of points nearer than its radius to a segment.
"""

import numpy as np

from ..compiler import borrowing_kernel
from ..contracts import Floats
from .baked_kernels import baked
from .columns import Body, Shape

SPHERE, CAPSULE, CYLINDER, BOX, PLANE = (float(kind) for kind in (Shape.SPHERE, Shape.CAPSULE, Shape.CYLINDER, Shape.BOX, Shape.PLANE))
SHAPE, SIZE, POSITION, FRAME = (int(column) for column in (Body.SHAPE, Body.SIZE, Body.POSITION, Body.FRAME))
TINY = 1e-300


@borrowing_kernel
def distance(body: Floats, x1: float, x2: float, x3: float) -> tuple[float, ...]:
    """Gap and normal of the point x."""
    y1, y2, y3 = x1 - body[POSITION], x2 - body[POSITION + 1], x3 - body[POSITION + 2]
    a = y1 * body[FRAME] + y2 * body[FRAME + 1] + y3 * body[FRAME + 2]
    b = y1 * body[FRAME + 3] + y2 * body[FRAME + 4] + y3 * body[FRAME + 5]
    c = y1 * body[FRAME + 6] + y2 * body[FRAME + 7] + y3 * body[FRAME + 8]
    shape = body[SHAPE]
    if shape == SPHERE:
        gap, n1, n2, n3 = ball(a, b, c, body[SIZE])
    elif shape == CAPSULE:
        half = body[SIZE + 1]
        gap, n1, n2, n3 = ball(a, b, c - min(max(c, -half), half), body[SIZE])
    elif shape == CYLINDER:
        gap, n1, n2, n3 = cylinder(a, b, c, body[SIZE], body[SIZE + 1])
    elif shape == BOX:
        gap, n1, n2, n3 = box(a, b, c, body[SIZE], body[SIZE + 1], body[SIZE + 2])
    elif shape == PLANE:
        gap, n1, n2, n3 = c, 0.0, 0.0, 1.0
    else:
        gap, n1, n2, n3 = baked(body, a, b, c)
    return (
        gap,
        body[FRAME] * n1 + body[FRAME + 3] * n2 + body[FRAME + 6] * n3,
        body[FRAME + 1] * n1 + body[FRAME + 4] * n2 + body[FRAME + 7] * n3,
        body[FRAME + 2] * n1 + body[FRAME + 5] * n2 + body[FRAME + 8] * n3,
    )


@borrowing_kernel
def ball(a: float, b: float, c: float, radius: float) -> tuple[float, ...]:
    """Of a ball around the origin."""
    length = np.sqrt(a * a + b * b + c * c)
    if length < TINY:  # in the very middle every direction is as good
        return -radius, 1.0, 0.0, 0.0
    inverse = 1.0 / length
    return length - radius, a * inverse, b * inverse, c * inverse


@borrowing_kernel
def cylinder(a: float, b: float, c: float, radius: float, half: float) -> tuple[float, ...]:
    """Of a cylinder along the third axis."""
    rho = np.sqrt(a * a + b * b)
    u, v, up = rho - radius, abs(c) - half, 1.0 if c > 0 else -1.0
    o1, o2 = (a / rho, b / rho) if rho > TINY else (1.0, 0.0)
    if u > 0 and v > 0:  # nearest to the rim
        gap = np.sqrt(u * u + v * v)
        return gap, u * o1 / gap, u * o2 / gap, v * up / gap
    if u > v:
        return u, o1, o2, 0.0
    return v, 0.0, 0.0, up


@borrowing_kernel
def box(a: float, b: float, c: float, half1: float, half2: float, half3: float) -> tuple[float, ...]:
    """Of a box along the axes."""
    u, v, w = abs(a) - half1, abs(b) - half2, abs(c) - half3
    s1, s2, s3 = 1.0 if a > 0 else -1.0, 1.0 if b > 0 else -1.0, 1.0 if c > 0 else -1.0
    e1, e2, e3 = max(u, 0.0), max(v, 0.0), max(w, 0.0)
    gap = np.sqrt(e1 * e1 + e2 * e2 + e3 * e3)
    if gap > 0:
        return gap, s1 * e1 / gap, s2 * e2 / gap, s3 * e3 / gap
    if u > v and u > w:
        return u, s1, 0.0, 0.0
    if v > w:
        return v, 0.0, s2, 0.0
    return w, 0.0, 0.0, s3
