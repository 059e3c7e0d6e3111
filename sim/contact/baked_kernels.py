"""Signed distance from a closed surface of triangles: kept on a grid, and read between its points.

Inside is where the surface is seen all around: its triangles' solid angles (Van Oosterom & Strackee 1983, IEEE Trans. Biomed. Eng. 30:125)
sum to a whole sphere. The grid ends a body's row, so that nothing else need know of it; between its points the distance is trilinear.
"""

import numpy as np
from numpy.typing import NDArray

from ..compiler import kernel
from ..contracts import Floats
from .columns import Body, Grid

Indices = NDArray[np.int64]

SPACING, COUNT, ORIGIN, VALUES = (int(Body.WIDTH) + int(column) for column in (Grid.SPACING, Grid.COUNT, Grid.ORIGIN, Grid.VALUES))
WALKS = 3
"""How often the nearest point is looked for from where the way to the last one enters the grid."""
BLOCK = 6
"""Points of a grid along each edge of a block."""
TINY = 1e-300


@kernel(_nrt=False)
def from_triangle(t: Floats, x1: float, x2: float, x3: float) -> float:
    """Squared distance of the point x from a triangle with corners `t` (3, 3): Ericson (2005), Real-Time Collision Detection, 5.1.5."""
    a1, a2, a3 = x1 - t[0, 0], x2 - t[0, 1], x3 - t[0, 2]
    u1, u2, u3 = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    v1, v2, v3 = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    uu, uv, vv = u1 * u1 + u2 * u2 + u3 * u3, u1 * v1 + u2 * v2 + u3 * v3, v1 * v1 + v2 * v2 + v3 * v3
    d1, d2 = u1 * a1 + u2 * a2 + u3 * a3, v1 * a1 + v2 * a2 + v3 * a3
    d3, d4, d5, d6 = d1 - uu, d2 - uv, d1 - uv, d2 - vv
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0 and d2 <= 0:
        p, q = 0.0, 0.0
    elif d3 >= 0 and d4 <= d3:
        p, q = 1.0, 0.0
    elif d6 >= 0 and d5 <= d6:
        p, q = 0.0, 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        p, q = d1 / (d1 - d3), 0.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        p, q = 0.0, d2 / (d2 - d6)
    elif va <= 0 and d4 >= d3 and d5 >= d6:
        q = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        p = 1 - q
    else:
        p, q = vb / (va + vb + vc), vc / (va + vb + vc)
    y1, y2, y3 = a1 - p * u1 - q * v1, a2 - p * u2 - q * v2, a3 - p * u3 - q * v3
    return y1 * y1 + y2 * y2 + y3 * y3


@kernel(_nrt=False)
def seen_around(corners: Floats, x1: float, x2: float, x3: float) -> float:
    """Share of all directions in which one sees the inside of the surface with `corners` (K, 3, 3): one inside, none outside."""
    total = 0.0
    for k in range(len(corners)):
        a1, a2, a3 = corners[k, 0, 0] - x1, corners[k, 0, 1] - x2, corners[k, 0, 2] - x3
        b1, b2, b3 = corners[k, 1, 0] - x1, corners[k, 1, 1] - x2, corners[k, 1, 2] - x3
        c1, c2, c3 = corners[k, 2, 0] - x1, corners[k, 2, 1] - x2, corners[k, 2, 2] - x3
        a, b, c = np.sqrt(a1 * a1 + a2 * a2 + a3 * a3), np.sqrt(b1 * b1 + b2 * b2 + b3 * b3), np.sqrt(c1 * c1 + c2 * c2 + c3 * c3)
        box = a1 * (b2 * c3 - b3 * c2) + a2 * (b3 * c1 - b1 * c3) + a3 * (b1 * c2 - b2 * c1)
        ab, bc, ca = a1 * b1 + a2 * b2 + a3 * b3, b1 * c1 + b2 * c2 + b3 * c3, c1 * a1 + c2 * a2 + c3 * a3
        total += np.arctan2(box, a * b * c + ab * c + bc * a + ca * b)
    return total / (2 * np.pi)


@kernel(_nrt=False)
def bake(corners: Floats, balls: Floats, origin: Floats, spacing: float, chosen: Indices, values: Floats) -> None:
    """Fill `values` (n1, n2, n3) with the signed distances of a grid's points from triangles.

    Block by block those are `chosen`, (K,), whose `balls` (K, 4), middle and radius, may be the nearest to a point of the block. A point
    whose neighbour is farther from the surface than from it is on the same side.
    """
    n1, n2, n3 = values.shape
    half = 0.5 * BLOCK * spacing * np.sqrt(3.0)
    for i0 in range(0, n1, BLOCK):
        for j0 in range(0, n2, BLOCK):
            for m0 in range(0, n3, BLOCK):
                x1, x2, x3 = (
                    origin[0] + (i0 + 0.5 * BLOCK) * spacing,
                    origin[1] + (j0 + 0.5 * BLOCK) * spacing,
                    origin[2] + (m0 + 0.5 * BLOCK) * spacing,
                )
                count = nearest_balls(balls, x1, x2, x3, half, chosen)
                for i in range(i0, min(i0 + BLOCK, n1)):
                    for j in range(j0, min(j0 + BLOCK, n2)):
                        for m in range(m0, min(m0 + BLOCK, n3)):
                            y1, y2, y3 = origin[0] + i * spacing, origin[1] + j * spacing, origin[2] + m * spacing
                            least = np.inf
                            for k in range(count):
                                least = min(least, from_triangle(corners[chosen[k]], y1, y2, y3))
                            side = side_of_neighbour(values, i, j, m, 1.001 * spacing)
                            if side == 0:
                                side = -1.0 if seen_around(corners, y1, y2, y3) > 0.5 else 1.0
                            values[i, j, m] = side * np.sqrt(least)


@kernel(_nrt=False)
def nearest_balls(balls: Floats, x1: float, x2: float, x3: float, half: float, chosen: Indices) -> int:
    """Which `balls` hold the point that is nearest to one that lies at most `half` from x: their numbers are `chosen`; how many."""
    least, count = np.inf, 0
    for k in range(len(balls)):
        away = np.sqrt((x1 - balls[k, 0]) ** 2 + (x2 - balls[k, 1]) ** 2 + (x3 - balls[k, 2]) ** 2)
        least = min(least, away + balls[k, 3])
    for k in range(len(balls)):
        away = np.sqrt((x1 - balls[k, 0]) ** 2 + (x2 - balls[k, 1]) ** 2 + (x3 - balls[k, 2]) ** 2)
        if away - balls[k, 3] <= least + 2 * half:
            chosen[count] = k
            count += 1
    return count


@kernel(_nrt=False)
def side_of_neighbour(values: Floats, i: int, j: int, m: int, apart: float) -> float:
    """Side of a point that follows from a point before it along one of the axes, `apart` from it; 0 if from none."""
    if m > 0 and abs(values[i, j, m - 1]) > apart:
        return 1.0 if values[i, j, m - 1] > 0 else -1.0
    if j > 0 and abs(values[i, j - 1, m]) > apart:
        return 1.0 if values[i, j - 1, m] > 0 else -1.0
    if i > 0 and abs(values[i - 1, j, m]) > apart:
        return 1.0 if values[i - 1, j, m] > 0 else -1.0
    return 0.0


@kernel(_nrt=False)
def between(body: Floats, u: float, v: float, w: float) -> tuple[float, ...]:
    """Distance at the place u, v, w of a grid, in cells from its origin, and how it grows along each."""
    n1, n2, n3 = int(body[COUNT]), int(body[COUNT + 1]), int(body[COUNT + 2])
    i, j, m = min(int(u), n1 - 2), min(int(v), n2 - 2), min(int(w), n3 - 2)
    p, q, r = u - i, v - j, w - m
    k = VALUES + (i * n2 + j) * n3 + m
    below, beside, aslant = n2 * n3, n3, n2 * n3 + n3
    # Along the third axis, then the second, then the first.
    g00, g01 = body[k + 1] - body[k], body[k + beside + 1] - body[k + beside]
    g10, g11 = body[k + below + 1] - body[k + below], body[k + aslant + 1] - body[k + aslant]
    a00, a01 = body[k] + r * g00, body[k + beside] + r * g01
    a10, a11 = body[k + below] + r * g10, body[k + aslant] + r * g11
    b0, b1 = a00 + q * (a01 - a00), a10 + q * (a11 - a10)
    c0, c1 = g00 + q * (g01 - g00), g10 + q * (g11 - g10)
    d0, d1 = a01 - a00, a11 - a10
    return b0 + p * (b1 - b0), b1 - b0, d0 + p * (d1 - d0), c0 + p * (c1 - c0)


@kernel(_nrt=False)
def read(body: Floats, a: float, b: float, c: float) -> tuple[float, ...]:
    """Distance and outward direction at the point (a, b, c) of the grid."""
    spacing = body[SPACING]
    gap, n1, n2, n3 = between(body, (a - body[ORIGIN]) / spacing, (b - body[ORIGIN + 1]) / spacing, (c - body[ORIGIN + 2]) / spacing)
    length = np.sqrt(n1 * n1 + n2 * n2 + n3 * n3)
    if length < TINY:  # as far from one side as from the other
        return gap, 0.0, 0.0, 1.0
    return gap, n1 / length, n2 / length, n3 / length


@kernel(_nrt=False)
def entry(body: Floats, a: float, b: float, c: float, p1: float, p2: float, p3: float) -> tuple[float, ...]:
    """Where the way from the point (a, b, c) to p, which lies in the grid, enters it."""
    share = 0.0
    for axis in range(3):
        low = body[ORIGIN + axis]
        high = low + body[SPACING] * (body[COUNT + axis] - 1)
        x, p = (a, p1) if axis == 0 else (b, p2) if axis == 1 else (c, p3)
        if x < low:
            share = max(share, (low - x) / max(p - x, TINY))
        elif x > high:
            share = max(share, (x - high) / max(x - p, TINY))
    share = min(share, 1.0)
    return a + share * (p1 - a), b + share * (p2 - b), c + share * (p3 - c)


@kernel(_nrt=False)
def baked(body: Floats, a: float, b: float, c: float) -> tuple[float, ...]:
    """Gap and normal of the point (a, b, c) in the body's own frame.

    From outside the grid the nearest point is the one that is nearest, too, to where the way to it enters the grid.
    """
    far1 = body[ORIGIN] + body[SPACING] * (body[COUNT] - 1)
    far2 = body[ORIGIN + 1] + body[SPACING] * (body[COUNT + 1] - 1)
    far3 = body[ORIGIN + 2] + body[SPACING] * (body[COUNT + 2] - 1)
    q1, q2, q3 = min(max(a, body[ORIGIN]), far1), min(max(b, body[ORIGIN + 1]), far2), min(max(c, body[ORIGIN + 2]), far3)
    gap, n1, n2, n3 = read(body, q1, q2, q3)
    if q1 == a and q2 == b and q3 == c:
        return gap, n1, n2, n3
    p1, p2, p3 = q1 - gap * n1, q2 - gap * n2, q3 - gap * n3
    for _ in range(WALKS):
        q1, q2, q3 = entry(body, a, b, c, p1, p2, p3)
        gap, n1, n2, n3 = read(body, q1, q2, q3)
        p1, p2, p3 = q1 - gap * n1, q2 - gap * n2, q3 - gap * n3
    y1, y2, y3 = a - p1, b - p2, c - p3
    away = np.sqrt(y1 * y1 + y2 * y2 + y3 * y3)
    return away, y1 / away, y2 / away, y3 / away
