"""Outputs of the reduced model with exact gradients, compiled: one sweep along the arm and one back.

The formulas are those of `outputs`: twist, writhe from the area that the tangent sweeps, length, tip position, tip tangent, and 1 + t_tip .
t_base, which vanishes at a U-turn of the tip, where the branch of the writhe is lost. The gradients by the strains follow from

    d t_j / d kappa_i = (w_i R_i M_i)' (. x t_j),  j beyond i,          d Omega(p, a, b) = 2 d atan2(N, D)

with the frame R_i in the middle of the station interval i of width w_i and the mean rotation M_i in it.
"""

from math import pi

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.compiler import borrowing_kernel, kernel

Floats = NDArray[np.float64]

OUTPUTS = (
    "twist", "lifted_writhe", "lifted_link", "length", "tip1", "tip2", "tip3", "tangent1", "tangent2", "tangent3", "uturn",
)  # fmt: skip
"""Order of the outputs: turns; m; direction of the tip; 1 + cosine of the angle between tip and base."""

TWIST, WRITHE, LINK, LENGTH, TIP, TANGENT, UTURN = 0, 1, 2, 3, 4, 7, 10
CARRIED = 8
"""Outputs whose gradients are summed up from the tip: writhe, tip (3), tangent (3), U-turn."""


@borrowing_kernel
def turned(cosine: float, sine: float, n: float, d: float) -> tuple[float, float, float]:
    """Cosine and sine of an angle after another, atan2(n, d), is added, and by how many whole turns that passes half a turn.

    A sum of angles so needs one arc tangent at its end.
    """
    by = 1 / np.sqrt(n * n + d * d)
    n, d = by * n, by * d
    real, imaginary = cosine * d - sine * n, sine * d + cosine * n
    passed = 0.0
    if n > 0.0 and sine >= 0.0 and imaginary < 0.0:
        passed = 1.0
    elif n < 0.0 and sine < 0.0 and imaginary > 0.0:
        passed = -1.0
    return real, imaginary, passed


@borrowing_kernel
def triangle(p: Floats, a: Floats, b: Floats, by_a: Floats, by_b: Floats) -> tuple[float, float]:
    """Sine and cosine, times one factor, of half the signed area of a spherical triangle; adds the area's gradients by `a` and `b`."""
    n = p[0] * (a[1] * b[2] - a[2] * b[1]) + p[1] * (a[2] * b[0] - a[0] * b[2]) + p[2] * (a[0] * b[1] - a[1] * b[0])
    d = 1 + p[0] * a[0] + p[1] * a[1] + p[2] * a[2] + a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + b[0] * p[0] + b[1] * p[1] + b[2] * p[2]
    size = n * n + d * d
    f, g = 2 * d / size, -2 * n / size
    by_a[0] += f * (b[1] * p[2] - b[2] * p[1]) + g * (p[0] + b[0])
    by_a[1] += f * (b[2] * p[0] - b[0] * p[2]) + g * (p[1] + b[1])
    by_a[2] += f * (b[0] * p[1] - b[1] * p[0]) + g * (p[2] + b[2])
    by_b[0] += f * (p[1] * a[2] - p[2] * a[1]) + g * (p[0] + a[0])
    by_b[1] += f * (p[2] * a[0] - p[0] * a[2]) + g * (p[1] + a[1])
    by_b[2] += f * (p[0] * a[1] - p[1] * a[0]) + g * (p[2] + a[2])
    return n, d


@kernel
def sweep_out(
    q: Floats, pole: Floats, hats: Floats, widths: Floats, stretch_hats: Floats, lengths: Floats, tangents: Floats, pulls: Floats,
    turning: Floats, spins: Floats, extents: Floats, values: Floats,
) -> None:  # fmt: skip
    """Outputs of the strains `q` (S, 4) into `values`, and in the buffers what `sweep_back` needs.

    `tangents` (m + 1, 3) at the stations, `pulls` (m + 1, 3) of the area on them, `turning` (m, 3, 3) of everything beyond an interval by
    its curvatures, `spins` (m, 3) of the frame's own rotation by them, `extents` (n,) of the elements.
    """
    count = len(widths)
    r = np.zeros((3, 3))
    r[2, 0] = r[0, 1] = r[1, 2] = 1.0
    tangents[0] = r[:, 2]
    pulls[:] = 0.0
    twist, turns = 0.0, 0.0
    real, imaginary = 1.0, 0.0  # of half of what the area and the frame's own rotation add up to
    for i in range(count):
        k1, k2, k3 = 0.0, 0.0, 0.0
        for s in range(q.shape[0]):
            hat = hats[i, s]
            if hat != 0.0:
                k1 += hat * q[s, 0]
                k2 += hat * q[s, 1]
                k3 += hat * q[s, 2]
        w = widths[i]
        square = k1 * k1 + k2 * k2 + k3 * k3
        size = np.sqrt(square + 1e-14)
        angle = 0.5 * w * size
        half, sine = np.sin(0.5 * angle), 2 * np.sin(0.5 * angle) * np.cos(0.5 * angle)
        cosine = 1 - 2 * half * half
        first, second = sine / size, 2 * half * half / (size * size)
        e00, e11, e22 = 1 + second * (k1 * k1 - square), 1 + second * (k2 * k2 - square), 1 + second * (k3 * k3 - square)
        e01, e10 = second * k1 * k2 - first * k3, second * k1 * k2 + first * k3
        e02, e20 = second * k1 * k3 + first * k2, second * k1 * k3 - first * k2
        e12, e21 = second * k2 * k3 - first * k1, second * k2 * k3 + first * k1
        ratio, u1, u2, u3 = sine / angle, k1 / size, k2 / size, k3 / size
        for c in range(3):
            f0, f1, f2 = r[c, 0], r[c, 1], r[c, 2]
            m0, m1, m2 = f0 * e00 + f1 * e10 + f2 * e20, f0 * e01 + f1 * e11 + f2 * e21, f0 * e02 + f1 * e12 + f2 * e22
            rest = (1 - ratio) * (m0 * u1 + m1 * u2 + m2 * u3)
            turning[i, c, 0], turning[i, c, 1], turning[i, c, 2] = (
                w * (ratio * m0 + rest * u1),
                w * (ratio * m1 + rest * u2),
                w * (ratio * m2 + rest * u3),
            )
            r[c, 0], r[c, 1], r[c, 2] = m0 * e00 + m1 * e10 + m2 * e20, m0 * e01 + m1 * e11 + m2 * e21, m0 * e02 + m1 * e12 + m2 * e22
            tangents[i + 1, c] = r[c, 2]
        y = u3 * sine
        real, imaginary, passed = turned(real, imaginary, y, cosine)
        turns += passed
        twist += k3 * w
        for c in range(3):
            u = u1 if c == 0 else u2 if c == 1 else u3
            by_y = (sine / size if c == 2 else 0.0) - u3 * u * sine / size + 0.5 * w * u3 * u * cosine
            spins[i, c] = 2 * (cosine * by_y + 0.5 * w * y * u * sine) / (y * y + cosine * cosine)
        n, d = triangle(pole, tangents[i], tangents[i + 1], pulls[i], pulls[i + 1])
        real, imaginary, passed = turned(real, imaginary, n, d)
        turns += passed
    n, d = triangle(pole, tangents[count], tangents[0], pulls[count], pulls[0])
    real, imaginary, passed = turned(real, imaginary, n, d)
    turns += passed
    values[TWIST], values[LINK] = twist / (2 * pi), np.arctan2(imaginary, real) / pi + 2 * turns
    values[WRITHE] = values[LINK] - values[TWIST]
    values[LENGTH:UTURN] = 0.0
    values[UTURN] = 1.0
    for i in range(len(lengths)):
        e = 0.0
        for s in range(q.shape[0]):
            e += stretch_hats[i, s] * q[s, 3]
        extents[i] = e * lengths[i]
        values[LENGTH] += extents[i]
        for c in range(3):
            values[TIP + c] += extents[i] * tangents[i + 1, c]
    for c in range(3):
        values[TANGENT + c] = tangents[count, c]
        values[UTURN] += tangents[count, c] * tangents[0, c]


@borrowing_kernel
def add_cross(row: Floats, t: Floats, g: Floats, weight: float) -> None:
    """Add weight t x g to `row`."""
    row[0] += weight * (t[1] * g[2] - t[2] * g[1])
    row[1] += weight * (t[2] * g[0] - t[0] * g[2])
    row[2] += weight * (t[0] * g[1] - t[1] * g[0])


@borrowing_kernel
def sweep_back(
    hats: Floats, widths: Floats, stretch_hats: Floats, lengths: Floats, tangents: Floats, pulls: Floats, turning: Floats, spins: Floats,
    extents: Floats, units: Floats, carried: Floats, gradients: Floats,
) -> None:  # fmt: skip
    """Gradients (11, S, 4) of the outputs after `sweep_out`; `units` is the identity (3, 3), `carried` (8, 3) a buffer."""
    gradients[:] = 0.0
    carried[:] = 0.0
    count, elements, sections = len(widths), len(lengths), hats.shape[1]
    for c in range(3):
        add_cross(carried[4 + c], tangents[count], units[c], 1.0)
    add_cross(carried[7], tangents[count], tangents[0], 1.0)
    for i in range(count - 1, -1, -1):
        add_cross(carried[0], tangents[i + 1], pulls[i + 1], 1.0)
        if i < elements:
            for c in range(3):
                add_cross(carried[1 + c], tangents[i + 1], units[c], extents[i])
        for s in range(sections):
            hat = hats[i, s]
            if hat == 0.0:
                continue
            for k in range(3):
                x, y, z = turning[i, 0, k], turning[i, 1, k], turning[i, 2, k]
                link = (x * carried[0, 0] + y * carried[0, 1] + z * carried[0, 2] + spins[i, k]) / (2 * pi)
                twist = widths[i] / (2 * pi) if k == 2 else 0.0
                gradients[TWIST, s, k] += hat * twist
                gradients[LINK, s, k] += hat * link
                gradients[WRITHE, s, k] += hat * (link - twist)
                for c in range(1, CARRIED):
                    gradients[LENGTH + c, s, k] += hat * (x * carried[c, 0] + y * carried[c, 1] + z * carried[c, 2])
    for i in range(elements):
        for s in range(sections):
            part = stretch_hats[i, s] * lengths[i]
            gradients[LENGTH, s, 3] += part
            for c in range(3):
                gradients[TIP + c, s, 3] += part * tangents[i + 1, c]


@borrowing_kernel
def frames_along(turns: Floats, frames: Floats) -> None:
    """Frames (T, m, 3, 3), rows d1, d2, d3, of T instants from those of the first station and the rotation vectors (T, m - 1, 3), rad, in
    the frame, between stations.
    """
    for t in range(len(turns)):
        for i in range(turns.shape[1]):
            x, y, z = turns[t, i, 0], turns[t, i, 1], turns[t, i, 2]
            angle = np.sqrt(x * x + y * y + z * z + 1e-30)
            half = np.sin(0.5 * angle)
            first, second = 2 * half * np.cos(0.5 * angle) / angle, 2 * half * half / (angle * angle)
            before, after = frames[t, i], frames[t, i + 1]
            for c in range(3):
                a, b, d = before[0, c], before[1, c], before[2, c]
                # u x d_k summed along the rows: what the transpose of exp([u]x) does to the three of them.
                along = second * (x * a + y * b + z * d)
                kept = 1 - second * (x * x + y * y + z * z)
                after[0, c] = kept * a + along * x + first * (z * b - y * d)
                after[1, c] = kept * b + along * y + first * (x * d - z * a)
                after[2, c] = kept * d + along * z + first * (y * a - x * b)


@kernel
def outputs_along(
    strains: Floats, pole: Floats, hats: Floats, widths: Floats, stretch_hats: Floats, lengths: Floats, units: Floats, values: Floats,
    gradients: Floats,
) -> None:  # fmt: skip
    """Outputs (T, 11) of T instants, and their gradients (T, 11, S, 4) where `gradients` has as many instants."""
    count, elements = len(widths), len(lengths)
    tangents, pulls, extents = np.empty((count + 1, 3)), np.empty((count + 1, 3)), np.empty(elements)
    turning, spins, carried = np.empty((count, 3, 3)), np.empty((count, 3)), np.empty((CARRIED, 3))
    for t in range(len(strains)):
        sweep_out(strains[t], pole, hats, widths, stretch_hats, lengths, tangents, pulls, turning, spins, extents, values[t])
        if len(gradients) == len(strains):
            sweep_back(hats, widths, stretch_hats, lengths, tangents, pulls, turning, spins, extents, units, carried, gradients[t])
