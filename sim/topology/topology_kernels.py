"""Kernels of link, writhe and twist: loops over segment pairs and over frames.

    node   x_0      x_1      x_2            x_n        points (n+1, 3), any length unit
            o--------o--------o--- ... ------o
    segment     0        1                n-1          normals (n, 3)

    ray  <==o== arm ==o==>                             with rays: n+2 segments, the rays are segments 0 and n+1

Frames are (m, 3, 3) with rows d1, d2, d3 (they take laboratory components to material components); d3 points along the arm.
All results are in turns. No kernel raises; work arrays are allocated once per call, never inside a loop.

The solid angle of a pair of segments is that of the planar parallelogram of their differences (Klenin & Langowski 2000,
Biopolymers 54:307, method 1a), split into two triangles (Van Oosterom & Strackee 1983, IEEE Trans. Biomed. Eng. 30:125, eq. 8). Both
triangles share one scalar triple product v = r13 . (r12 x r34), so that half the solid angle is the argument of the complex number
(e1 + iv)(e2 + iv). The arguments of a block of pairs are added by multiplying these numbers and counting how often the
product passes the negative real axis; one arctangent per block remains.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..compiler import kernel

Floats = NDArray[np.float64]

BLOCK = 64
"""Factors per arctangent: each has modulus above 0.7, hence a product never gets near underflow."""


@kernel
def _distances(x: Floats, y: Floats, z: Floats, px: float, py: float, pz: float, out: Floats) -> None:
    """Write the distances from (px, py, pz) to the nodes into `out` (nodes,)."""
    for j in range(x.size):
        dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
        out[j] = math.sqrt(dx * dx + dy * dy + dz * dz)


@kernel
def _pair_factors(
    x: Floats,
    y: Floats,
    z: Floats,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    near: Floats,
    far: Floats,
    real: Floats,
    imaginary: Floats,
    volume: Floats,
) -> None:
    """Write (e1 + iv)(e2 + iv), scaled, of segment (a -> b) against every segment of a polyline.

    `near` and `far` (nodes,) hold the distances of the nodes to a and to b; `real`, `imaginary` and `volume` (segments,) are written.
    One sum per loop: the compiler turns each into vector instructions.
    """
    tx, ty, tz = bx - ax, by - ay, bz - az
    count = real.size
    for j in range(count):
        px, py, pz = x[j] - ax, y[j] - ay, z[j] - az
        sx, sy, sz = x[j + 1] - x[j], y[j + 1] - y[j], z[j + 1] - z[j]
        volume[j] = px * (ty * sz - tz * sy) + py * (tz * sx - tx * sz) + pz * (tx * sy - ty * sx)
    for j in range(count):
        px, py, pz = x[j] - ax, y[j] - ay, z[j] - az
        qx, qy, qz = x[j + 1] - ax, y[j + 1] - ay, z[j + 1] - az
        rx, ry, rz = x[j + 1] - bx, y[j + 1] - by, z[j + 1] - bz
        real[j] = (
            (near[j] * near[j + 1] + px * qx + py * qy + pz * qz) * far[j + 1]
            + (qx * rx + qy * ry + qz * rz) * near[j]
            + (px * rx + py * ry + pz * rz) * near[j + 1]
        )
    for j in range(count):
        px, py, pz = x[j] - ax, y[j] - ay, z[j] - az
        rx, ry, rz = x[j + 1] - bx, y[j + 1] - by, z[j + 1] - bz
        sx, sy, sz = x[j] - bx, y[j] - by, z[j] - bz
        imaginary[j] = (
            (near[j] * far[j + 1] + px * rx + py * ry + pz * rz) * far[j]
            + (rx * sx + ry * sy + rz * sz) * near[j]
            + (px * sx + py * sy + pz * sz) * far[j + 1]
        )
    for j in range(count):
        v, e1, e2 = volume[j], real[j], imaginary[j]
        product_real, product_imaginary = e1 * e2 - v * v, v * (e1 + e2)
        size = abs(product_real) + abs(product_imaginary)
        seen = size > 0.0 and v != 0.0  # coplanar segments see each other edge-on
        real[j] = product_real / size if seen else 1.0
        imaginary[j] = product_imaginary / size if seen else 0.0


@kernel
def _summed_argument(real: Floats, imaginary: Floats) -> float:
    """Return the sum of the arguments of complex numbers of modulus 0.7 to 1, each argument in (-pi, pi)."""
    total = 0.0
    windings = 0
    for start in range(0, real.size, BLOCK):
        block_real, block_imaginary = real[start : start + BLOCK], imaginary[start : start + BLOCK]
        a, b = 1.0, 0.0
        for j in range(block_real.size):
            c, s = block_real[j], block_imaginary[j]
            turned = a * s + b * c + 0.0  # never a negative zero
            a = a * c - b * s
            windings += (b >= 0.0) & (s >= 0.0) & (turned < 0.0)
            windings -= (b < 0.0) & (s < 0.0) & (turned >= 0.0)
            b = turned
        total += math.atan2(b, a)
    return total + 2.0 * math.pi * windings


@kernel
def extend(points: Floats, first_direction: Floats, last_direction: Floats, ray: float, nodes: Floats) -> int:
    """Write coordinates of a polyline with its two end rays into `nodes` (3, n+3), or (3, n+1) if `ray` is 0; return the count.

    `ray` is a length in the unit of the points; the directions (3,) point along the curve at its first and last point.
    """
    count = points.shape[0]
    shift = 1 if ray > 0.0 else 0
    for c in range(3):
        for i in range(count):
            nodes[c, i + shift] = points[i, c]
        if shift == 1:
            nodes[c, 0] = points[0, c] - ray * first_direction[c]
            nodes[c, count + 1] = points[count - 1, c] + ray * last_direction[c]
    return count + 2 * shift


@kernel
def polyline_length(points: Floats) -> float:
    """Return the length of a polyline (n+1, 3)."""
    length = 0.0
    for i in range(points.shape[0] - 1):
        dx, dy, dz = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1], points[i + 1, 2] - points[i, 2]
        length += math.sqrt(dx * dx + dy * dy + dz * dz)
    return length


@kernel
def _is_loop(nodes: Floats, count: int) -> int:
    """Return 1 if the last node lies exactly on the first, else 0."""
    return int(nodes[0, 0] == nodes[0, count - 1] and nodes[1, 0] == nodes[1, count - 1] and nodes[2, 0] == nodes[2, count - 1])


@kernel(nogil=True)
def writhe_series(points: Floats, directions: Floats, ray_length: float, out: Floats) -> None:
    """Write the Gauss writhe of every polyline of a series.

    Parameters
    ----------
    points : (T, n+1, 3) float64
        Nodes; a polyline whose last node equals its first is a closed curve when `ray_length` is 0.
    directions : (T, 2, 3) float64
        Unit tangents at the first and last node, both along the curve; the rays leave against the one and along the other.
    ray_length : float
        In lengths of the polyline; 0 for no rays.
    out : (T,) float64, turns
    """
    most = points.shape[1] + 2
    nodes = np.empty((3, most))
    near, far = np.empty(most), np.empty(most)
    real, imaginary, volume = np.empty(most), np.empty(most), np.empty(most)
    for frame in range(points.shape[0]):
        ray = ray_length * polyline_length(points[frame])
        count = extend(points[frame], directions[frame, 0], directions[frame, 1], ray, nodes)
        x, y, z = nodes[0, :count], nodes[1, :count], nodes[2, :count]
        looped = _is_loop(nodes, count)
        _distances(x, y, z, x[0], y[0], z[0], near)
        total = 0.0
        for i in range(count - 3):
            first, last = i + 2, count - (looped if i == 0 else 0)
            xs, ys, zs = x[first:last], y[first:last], z[first:last]
            _distances(x[first:], y[first:], z[first:], x[i + 1], y[i + 1], z[i + 1], far[first:])
            _pair_factors(
                xs, ys, zs, x[i], y[i], z[i], x[i + 1], y[i + 1], z[i + 1], near[first:last], far[first:last],
                real[first : last - 1], imaginary[first : last - 1], volume[first : last - 1],
            )  # fmt: skip
            total += _summed_argument(real[first : last - 1], imaginary[first : last - 1])
            near, far = far, near
        out[frame] = -total / math.pi


@kernel
def pair_matrix(nodes: Floats, count: int, out: Floats) -> None:
    """Write half the writhe of every pair of segments into either place of `out` (segments, segments); its sum is the writhe.

    `nodes` (3, count) as left by `extend`.
    """
    x, y, z = nodes[0], nodes[1], nodes[2]
    near, far = np.empty(count), np.empty(count)
    real, imaginary, volume = np.empty(count), np.empty(count), np.empty(count)
    out[:] = 0.0
    looped = _is_loop(nodes, count)
    for i in range(count - 3):
        first, last = i + 2, count - (looped if i == 0 else 0)
        xs, ys, zs = x[first:last], y[first:last], z[first:last]
        _distances(xs, ys, zs, x[i], y[i], z[i], near[first:last])
        _distances(xs, ys, zs, x[i + 1], y[i + 1], z[i + 1], far[first:last])
        _pair_factors(
            xs, ys, zs, x[i], y[i], z[i], x[i + 1], y[i + 1], z[i + 1], near[first:last], far[first:last],
            real[first : last - 1], imaginary[first : last - 1], volume[first : last - 1],
        )  # fmt: skip
        for j in range(first, last - 1):
            share = -math.atan2(imaginary[j], real[j]) / (2.0 * math.pi)
            out[i, j] = share
            out[j, i] = share


@kernel
def link_of_curves(first: Floats, second: Floats) -> float:
    """Return the Gauss linking integral of two polylines (3, nodes of the first) and (3, nodes of the second) in turns."""
    x, y, z = second[0], second[1], second[2]
    ax, ay, az = first[0], first[1], first[2]
    near, far = np.empty(x.size), np.empty(x.size)
    real, imaginary, volume = np.empty(x.size - 1), np.empty(x.size - 1), np.empty(x.size - 1)
    _distances(x, y, z, ax[0], ay[0], az[0], near)
    total = 0.0
    for i in range(ax.size - 1):
        _distances(x, y, z, ax[i + 1], ay[i + 1], az[i + 1], far)
        _pair_factors(x, y, z, ax[i], ay[i], az[i], ax[i + 1], ay[i + 1], az[i + 1], near, far, real, imaginary, volume)
        total += _summed_argument(real, imaginary)
        near, far = far, near
    return -total / (2.0 * math.pi)


@kernel
def transport_twist(points: Floats, normals: Floats, out: Floats) -> None:
    """Write the twist at each interior node into `out` (n-1,), in turns within (-1/2, 1/2].

    The normal of segment k is carried over the node by the smallest rotation that takes tangent k to tangent k+1
    (Bergou et al. 2008, ACM Trans. Graph. 27:63, sec. 4.2.2), then the right-handed angle about tangent k+1 to the normal there is read.
    Normals (n, 3) need not be perpendicular or of unit length.
    """
    for k in range(points.shape[0] - 2):
        ax, ay, az = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1], points[k + 1, 2] - points[k, 2]
        bx, by, bz = points[k + 2, 0] - points[k + 1, 0], points[k + 2, 1] - points[k + 1, 1], points[k + 2, 2] - points[k + 1, 2]
        size = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
        ax, ay, az = ax * size, ay * size, az * size
        size = 1.0 / math.sqrt(bx * bx + by * by + bz * bz)
        bx, by, bz = bx * size, by * size, bz * size
        ux, uy, uz = normals[k, 0], normals[k, 1], normals[k, 2]
        part = ux * ax + uy * ay + uz * az
        ux, uy, uz = ux - part * ax, uy - part * ay, uz - part * az
        part = (ux * bx + uy * by + uz * bz) / (1.0 + ax * bx + ay * by + az * bz)
        ux, uy, uz = ux - part * (ax + bx), uy - part * (ay + by), uz - part * (az + bz)
        vx, vy, vz = normals[k + 1, 0], normals[k + 1, 1], normals[k + 1, 2]  # u is across b: what of v lies along b does not count
        along = bx * (uy * vz - uz * vy) + by * (uz * vx - ux * vz) + bz * (ux * vy - uy * vx)
        out[k] = math.atan2(along, ux * vx + uy * vy + uz * vz) / (2.0 * math.pi)


@kernel
def _rotation_quaternion(a: Floats, b: Floats) -> tuple[float, float, float, float]:
    """Return the quaternion (scalar part >= 0) of a b^T, the rotation of frame b relative to frame a in material components."""
    m00 = a[0, 0] * b[0, 0] + a[0, 1] * b[0, 1] + a[0, 2] * b[0, 2]
    m01 = a[0, 0] * b[1, 0] + a[0, 1] * b[1, 1] + a[0, 2] * b[1, 2]
    m02 = a[0, 0] * b[2, 0] + a[0, 1] * b[2, 1] + a[0, 2] * b[2, 2]
    m10 = a[1, 0] * b[0, 0] + a[1, 1] * b[0, 1] + a[1, 2] * b[0, 2]
    m11 = a[1, 0] * b[1, 0] + a[1, 1] * b[1, 1] + a[1, 2] * b[1, 2]
    m12 = a[1, 0] * b[2, 0] + a[1, 1] * b[2, 1] + a[1, 2] * b[2, 2]
    m20 = a[2, 0] * b[0, 0] + a[2, 1] * b[0, 1] + a[2, 2] * b[0, 2]
    m21 = a[2, 0] * b[1, 0] + a[2, 1] * b[1, 1] + a[2, 2] * b[1, 2]
    m22 = a[2, 0] * b[2, 0] + a[2, 1] * b[2, 1] + a[2, 2] * b[2, 2]
    trace = m00 + m11 + m22
    # four times the squared components; dividing by the largest keeps every angle accurate (Shepperd 1978, J. Guid. Control 1:223)
    if trace >= max(m00, m11, m22):
        q0, q1, q2, q3 = 1.0 + trace, m21 - m12, m02 - m20, m10 - m01
    elif m00 >= m11 and m00 >= m22:
        q0, q1, q2, q3 = m21 - m12, 1.0 + m00 - m11 - m22, m01 + m10, m02 + m20
    elif m11 >= m22:
        q0, q1, q2, q3 = m02 - m20, m01 + m10, 1.0 - m00 + m11 - m22, m12 + m21
    else:
        q0, q1, q2, q3 = m10 - m01, m02 + m20, m12 + m21, 1.0 - m00 - m11 + m22
    size = 1.0 / math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    if q0 < 0.0:
        size = -size
    return q0 * size, q1 * size, q2 * size, q3 * size


@kernel
def frame_rotations(frames: Floats, out: Floats) -> None:
    """Write the rotation vectors (T, m-1, 3), rad, between successive frames (T, m, 3, 3) in material components."""
    for k in range(frames.shape[0]):
        for i in range(frames.shape[1] - 1):
            q0, q1, q2, q3 = _rotation_quaternion(frames[k, i], frames[k, i + 1])
            sine = math.sqrt(q1 * q1 + q2 * q2 + q3 * q3)
            factor = 2.0 * math.atan2(sine, q0) / sine if sine > 1e-9 else 2.0
            out[k, i, 0], out[k, i, 1], out[k, i, 2] = factor * q1, factor * q2, factor * q3


@kernel
def pole_area(pole: Floats, a: Floats, b: Floats) -> float:
    """Return the signed area of the spherical triangle (pole, a, b), rad, in (-2 pi, 2 pi]."""
    ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    ap = a[0] * pole[0] + a[1] * pole[1] + a[2] * pole[2]
    bp = b[0] * pole[0] + b[1] * pole[1] + b[2] * pole[2]
    volume = pole[0] * (a[1] * b[2] - a[2] * b[1]) + pole[1] * (a[2] * b[0] - a[0] * b[2]) + pole[2] * (a[0] * b[1] - a[1] * b[0])
    return 2.0 * math.atan2(volume, 1.0 + ab + ap + bp)


@kernel
def frame_steps(frames: Floats, pole: Floats, twist: Floats, lifted: Floats) -> float:
    """Write twist and lifted writhe of each step between frames, (m-1,) each; return the closure area in turns.

    Twist is exact for constant strain between frames. The link of a step is its pole area plus the rotation about d3 left after the
    smallest rotation of d3, 2 atan2(q3, q0); the writhe of a step is link minus twist (Fuller 1978, PNAS 75:3557,
    eqs. 3-5; Starostin 2005, in Physical and Numerical Models in Knot Theory, ch. 26, for the open curve).
    """
    for i in range(frames.shape[0] - 1):
        q0, q1, q2, q3 = _rotation_quaternion(frames[i], frames[i + 1])
        sine = math.sqrt(q1 * q1 + q2 * q2 + q3 * q3)
        turned = 2.0 * math.atan2(sine, q0) * q3 / sine if sine > 1e-9 else 2.0 * q3
        area = pole_area(pole, frames[i, 2], frames[i + 1, 2])
        twist[i] = turned / (2.0 * math.pi)
        lifted[i] = (area + 2.0 * math.atan2(q3, q0) - turned) / (2.0 * math.pi)
    return pole_area(pole, frames[frames.shape[0] - 1, 2], frames[0, 2]) / (2.0 * math.pi)


@kernel(nogil=True)
def frame_series(frames: Floats, pole: Floats, twist: Floats, lifted: Floats, opening: Floats) -> None:
    """Write twist, lifted writhe (not unwrapped in time) and 1 + t_tip . t_base of each of a series of frames (T, m, 3, 3)."""
    steps = frames.shape[1] - 1
    step_twist, step_lifted = np.empty(steps), np.empty(steps)
    for k in range(frames.shape[0]):
        closure = frame_steps(frames[k], pole, step_twist, step_lifted)
        twist[k] = np.sum(step_twist)
        lifted[k] = np.sum(step_lifted) + closure
        base, tip = frames[k, 0, 2], frames[k, steps, 2]
        opening[k] = 1.0 + base[0] * tip[0] + base[1] * tip[1] + base[2] * tip[2]


@kernel(nogil=True)
def present(points: Floats, frames: Floats, pole: Floats) -> tuple[float, float]:
    """Return twist and lifted writhe of one instant with frames (n + 2, 3, 3) at base, element centres and tip of the points (n + 1, 3).

    The frames of the elements are first turned to the edges, as `octoctrl.sim.rotations.ribbon_frames` does.
    """
    ribbon, steps = frames.copy(), frames.shape[0] - 1
    for k in range(points.shape[0] - 1):
        e1, e2, e3 = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1], points[k + 1, 2] - points[k, 2]
        size = math.sqrt(e1 * e1 + e2 * e2 + e3 * e3)
        e1, e2, e3 = e1 / size, e2 / size, e3 / size
        d = frames[k + 1]
        a1, a2, a3 = d[2, 1] * e3 - d[2, 2] * e2, d[2, 2] * e1 - d[2, 0] * e3, d[2, 0] * e2 - d[2, 1] * e1
        divisor = 1 + d[2, 0] * e1 + d[2, 1] * e2 + d[2, 2] * e3
        for i in range(3):
            f1, f2, f3 = a2 * d[i, 2] - a3 * d[i, 1], a3 * d[i, 0] - a1 * d[i, 2], a1 * d[i, 1] - a2 * d[i, 0]
            ribbon[k + 1, i, 0] += f1 + (a2 * f3 - a3 * f2) / divisor
            ribbon[k + 1, i, 1] += f2 + (a3 * f1 - a1 * f3) / divisor
            ribbon[k + 1, i, 2] += f3 + (a1 * f2 - a2 * f1) / divisor
    step_twist, step_lifted = np.empty(steps), np.empty(steps)
    closure = frame_steps(ribbon, pole, step_twist, step_lifted)
    return np.sum(step_twist), np.sum(step_lifted) + closure


@kernel
def unwrap_by_two(values: Floats, before: float, shift: float) -> float:
    """Remove jumps by multiples of 2 from a series in place, which continues from `before`, `shift` having been added so far.

    Returns the new shift, so that a series in pieces gives the same bits as the whole.
    """
    for k in range(values.shape[0]):
        raw = values[k] + shift
        correction = -2.0 * np.round((raw - before) / 2.0)
        shift += correction
        values[k] = before = raw + correction
    return shift


@kernel
def parabola_peaks(places: Floats, values: Floats, low: int, high: int, position: Floats, height: Floats) -> None:
    """Write the vertex of the parabola through the greatest of values[:, low..high] and its two neighbours, for each row (T,).

    A greatest value at either end of `places` (stations,) is its own vertex.
    """
    for k in range(values.shape[0]):
        peak = low
        for i in range(low + 1, high + 1):
            if values[k, i] > values[k, peak]:
                peak = i
        position[k], height[k] = places[peak], values[k, peak]
        if peak == 0 or peak == places.size - 1:
            continue
        before, after = places[peak] - places[peak - 1], places[peak + 1] - places[peak]
        rise, fall = (values[k, peak] - values[k, peak - 1]) / before, (values[k, peak] - values[k, peak + 1]) / after
        second = -(rise + fall) / (before + after)
        if rise < 0.0 or fall < 0.0 or second == 0.0:  # the window cut a slope
            continue
        slope = (rise * after - fall * before) / (before + after)
        shift = -0.5 * slope / second
        position[k] += shift
        height[k] += shift * (slope + shift * second)
