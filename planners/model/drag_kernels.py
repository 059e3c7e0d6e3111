"""Water drag of the reduced model for the compiled step: shape, force of a motion, tangent; formulas and sources stand in `drag`.

A motion m of the strains within a step h moves node j by J_j m, and the water's impulse on it is h F(J_j m / h), F(v) = c v + d |v_n| v_n
across the tangent, with a rotational drag beside it. Twists and wrenches are those of the point at the base: a twist is the spin and the
velocity of what would be there, a wrench the torque about it and the force. Both then add up along the arm as they are (Featherstone 2008).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.compiler import borrowing_kernel

Floats = NDArray[np.float64]

SLOWEST = 1e-3
"""Speed, m/s, below which quadratic drag goes over into linear drag."""


class Elements(NamedTuple):
    """The fine elements between which drag is lumped, M of them.

    `first` (M,) and `weights` (M, 2): hat functions of the sections first and first + 1; `widths` (M,), m; `linear`, `quadratic`,
    `rotational` (M,): drag of the far ends, N s/m, N s^2/m^2, N m s.
    """

    first: NDArray[np.int64]
    weights: Floats
    widths: Floats
    linear: Floats
    quadratic: Floats
    rotational: Floats


class Shape(NamedTuple):
    """Twists per strain rate and far ends of the elements, M of them; buffers.

    `turning` (M, 3, 3), `moving` (M, 3, 4), `points` (M, 3), `tangents` (M, 3), `middles` (M, 3, 3): frames half way, `frame` (3, 3),
    `velocity` and `spin` (M, 3). Of the tangent: `twists` (6, 8) of an element by the strains of its two sections, torque and force
    at the base by its spin and velocity: `resistance` (6, 6) of all that hangs on the element, `hung` (6, 4 S): sums of it by strains.
    """

    turning: Floats
    moving: Floats
    points: Floats
    tangents: Floats
    middles: Floats
    frame: Floats
    velocity: Floats
    spin: Floats
    twists: Floats
    resistance: Floats
    hung: Floats


def shape_buffers(elements: int, sections: int) -> Shape:
    """Empty buffers for `elements` elements."""
    each = ((3, 3), (3, 4), (3,), (3,), (3, 3))
    sizes = (*((elements, *size) for size in each), (3, 3), (elements, 3), (elements, 3), (6, 8), (6, 6), (6, 4 * sections))
    return Shape(*map(np.zeros, sizes))


@borrowing_kernel
def set_shape(q: Floats, elements: Any, shape: Any) -> None:
    """Shape at the strains `q` (S, 4)."""
    frame, points = shape.frame, shape.points
    frame[:] = 0
    frame[2, 0] = frame[0, 1] = frame[1, 2] = 1  # columns d1 = z, d2 = x, d3 = y
    px, py, pz = 0.0, 0.0, 0.0
    for i in range(len(elements.first)):
        a, w0, w1, width = elements.first[i], elements.weights[i, 0], elements.weights[i, 1], elements.widths[i]
        k1, k2 = w0 * q[a, 0] + w1 * q[a + 1, 0], w0 * q[a, 1] + w1 * q[a + 1, 1]
        k3, e = w0 * q[a, 2] + w1 * q[a + 1, 2], w0 * q[a, 3] + w1 * q[a + 1, 3]
        square = k1 * k1 + k2 * k2 + k3 * k3
        size = np.sqrt(square + 1e-12)
        angle = 0.5 * width * size
        sine, half = np.sin(angle), np.sin(0.5 * angle) / size
        first, second = sine / size, 2 * half * half
        # Rotation by half the element: I + first [k]x + second [k]x^2.
        e00, e11, e22 = 1 + second * (k1 * k1 - square), 1 + second * (k2 * k2 - square), 1 + second * (k3 * k3 - square)
        e01, e10 = second * k1 * k2 - first * k3, second * k1 * k2 + first * k3
        e02, e20 = second * k1 * k3 + first * k2, second * k1 * k3 - first * k2
        e12, e21 = second * k2 * k3 - first * k1, second * k2 * k3 + first * k1
        ratio, u1, u2, u3 = sine / angle, k1 / size, k2 / size, k3 / size
        sagitta = e * width * width * width
        for r in range(3):
            f0, f1, f2 = frame[r, 0], frame[r, 1], frame[r, 2]
            m0, m1, m2 = f0 * e00 + f1 * e10 + f2 * e20, f0 * e01 + f1 * e11 + f2 * e21, f0 * e02 + f1 * e12 + f2 * e22
            shape.middles[i, r, 0], shape.middles[i, r, 1], shape.middles[i, r, 2] = m0, m1, m2
            rest = (1 - ratio) * (m0 * u1 + m1 * u2 + m2 * u3)
            shape.turning[i, r, 0] = width * (ratio * m0 + rest * u1)
            shape.turning[i, r, 1] = width * (ratio * m1 + rest * u2)
            shape.turning[i, r, 2] = width * (ratio * m2 + rest * u3)
            along = m0 * k1 + m1 * k2 + m2 * k3
            shape.moving[i, r, 0] = sagitta * (-k3 * m0 - m2 * k1) / 12
            shape.moving[i, r, 1] = sagitta * (-k3 * m1 - m2 * k2) / 12
            shape.moving[i, r, 2] = sagitta * (2 * along - 2 * k3 * m2) / 12
            frame[r, 0], frame[r, 1], frame[r, 2] = (
                m0 * e00 + m1 * e10 + m2 * e20,
                m0 * e01 + m1 * e11 + m2 * e21,
                m0 * e02 + m1 * e12 + m2 * e22,
            )
        cx, cy, cz = shape.turning[i, 0, 2], shape.turning[i, 1, 2], shape.turning[i, 2, 2]  # the chord, over the stretch
        shape.moving[i, 0, 3], shape.moving[i, 1, 3], shape.moving[i, 2, 3] = cx, cy, cz
        mx, my, mz = px + 0.5 * e * cx, py + 0.5 * e * cy, pz + 0.5 * e * cz
        for k in range(3):
            t0, t1, t2 = shape.turning[i, 0, k], shape.turning[i, 1, k], shape.turning[i, 2, k]
            shape.moving[i, 0, k] += my * t2 - mz * t1
            shape.moving[i, 1, k] += mz * t0 - mx * t2
            shape.moving[i, 2, k] += mx * t1 - my * t0
        px, py, pz = px + e * cx, py + e * cy, pz + e * cz
        points[i, 0], points[i, 1], points[i, 2] = px, py, pz
        for r in range(3):
            shape.tangents[i, r] = frame[r, 2]


@borrowing_kernel
def drag_impulse(motion: Floats, h: float, elements: Any, shape: Any, out: Floats) -> None:
    """Impulse (S, 4) of the water against a motion of the strains (S, 4) within `h`; leaves what each node moves by in `shape`."""
    s0, s1, s2, a0, a1, a2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(elements.first)):
        a = elements.first[i]
        for k in range(4):
            r = elements.weights[i, 0] * motion[a, k] + elements.weights[i, 1] * motion[a + 1, k]
            if k < 3:
                s0 += shape.turning[i, 0, k] * r
                s1 += shape.turning[i, 1, k] * r
                s2 += shape.turning[i, 2, k] * r
            a0 += shape.moving[i, 0, k] * r
            a1 += shape.moving[i, 1, k] * r
            a2 += shape.moving[i, 2, k] * r
        x, y, z = shape.points[i, 0], shape.points[i, 1], shape.points[i, 2]
        shape.velocity[i, 0], shape.velocity[i, 1], shape.velocity[i, 2] = a0 + s1 * z - s2 * y, a1 + s2 * x - s0 * z, a2 + s0 * y - s1 * x
        shape.spin[i, 0], shape.spin[i, 1], shape.spin[i, 2] = s0, s1, s2
    out[:] = 0.0
    f0, f1, f2, t0, t1, t2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(elements.first) - 1, -1, -1):
        a = elements.first[i]
        tx, ty, tz = shape.tangents[i, 0], shape.tangents[i, 1], shape.tangents[i, 2]
        v0, v1, v2 = shape.velocity[i, 0], shape.velocity[i, 1], shape.velocity[i, 2]
        along = v0 * tx + v1 * ty + v2 * tz
        n0, n1, n2 = v0 - along * tx, v1 - along * ty, v2 - along * tz
        normal = elements.quadratic[i] * np.sqrt((n0 * n0 + n1 * n1 + n2 * n2) / (h * h) + SLOWEST * SLOWEST)
        linear = elements.linear[i]
        p0, p1, p2 = linear * v0 + normal * n0, linear * v1 + normal * n1, linear * v2 + normal * n2
        x, y, z = shape.points[i, 0], shape.points[i, 1], shape.points[i, 2]
        turned = 0.5 * elements.rotational[i]
        w0, w1, w2 = shape.spin[i, 0], shape.spin[i, 1], shape.spin[i, 2]
        about = w0 * tx + w1 * ty + w2 * tz
        t0 += turned * (w0 + about * tx) + y * p2 - z * p1
        t1 += turned * (w1 + about * ty) + z * p0 - x * p2
        t2 += turned * (w2 + about * tz) + x * p1 - y * p0
        f0 += p0
        f1 += p1
        f2 += p2
        for k in range(4):
            work = shape.moving[i, 0, k] * f0 + shape.moving[i, 1, k] * f1 + shape.moving[i, 2, k] * f2
            if k < 3:
                work += shape.turning[i, 0, k] * t0 + shape.turning[i, 1, k] * t1 + shape.turning[i, 2, k] * t2
            out[a, k] += elements.weights[i, 0] * work
            out[a + 1, k] += elements.weights[i, 1] * work


@borrowing_kernel
def add_resistance(i: int, h: float, elements: Any, shape: Any) -> None:
    """Add what the far end of element `i` does to `shape.resistance`, after `drag_impulse`.

    A twist (s, v) of the base moves the node at p by v - P s, P = [p]x; with F' = A there and B about the tangent, it meets the torque
    (B - PAP) s + PA v and the force A v - AP s. Only what stands in or above the diagonal is kept.
    """
    out, x, y, z = shape.resistance, shape.points[i, 0], shape.points[i, 1], shape.points[i, 2]
    tx, ty, tz = shape.tangents[i, 0], shape.tangents[i, 1], shape.tangents[i, 2]
    v0, v1, v2, by = shape.velocity[i, 0], shape.velocity[i, 1], shape.velocity[i, 2], 1 / h
    along = v0 * tx + v1 * ty + v2 * tz
    n0, n1, n2 = (v0 - along * tx) * by, (v1 - along * ty) * by, (v2 - along * tz) * by
    speed = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2 + SLOWEST * SLOWEST)
    normal, steep, turned = elements.quadratic[i] * speed, elements.quadratic[i] / speed, 0.5 * elements.rotational[i]
    isotropic = elements.linear[i] + normal
    a00, a11 = isotropic - normal * tx * tx + steep * n0 * n0, isotropic - normal * ty * ty + steep * n1 * n1
    a22, a01 = isotropic - normal * tz * tz + steep * n2 * n2, steep * n0 * n1 - normal * tx * ty
    a02, a12 = steep * n0 * n2 - normal * tx * tz, steep * n1 * n2 - normal * ty * tz
    m00, m10, m20 = y * a02 - z * a01, z * a00 - x * a02, x * a01 - y * a00
    m01, m11, m21 = y * a12 - z * a11, z * a01 - x * a12, x * a11 - y * a01
    m02, m12, m22 = y * a22 - z * a12, z * a02 - x * a22, x * a12 - y * a02
    out[3, 3] += a00
    out[3, 4] += a01
    out[3, 5] += a02
    out[4, 4] += a11
    out[4, 5] += a12
    out[5, 5] += a22
    out[0, 3] += m00
    out[0, 4] += m01
    out[0, 5] += m02
    out[1, 3] += m10
    out[1, 4] += m11
    out[1, 5] += m12
    out[2, 3] += m20
    out[2, 4] += m21
    out[2, 5] += m22
    out[0, 0] += turned * (1 + tx * tx) + y * m02 - z * m01
    out[0, 1] += turned * tx * ty + z * m00 - x * m02
    out[0, 2] += turned * tx * tz + x * m01 - y * m00
    out[1, 1] += turned * (1 + ty * ty) + z * m10 - x * m12
    out[1, 2] += turned * ty * tz + x * m11 - y * m10
    out[2, 2] += turned * (1 + tz * tz) + x * m21 - y * m20


@borrowing_kernel
def drag_tangent(h: float, elements: Any, shape: Any, tangent: Floats) -> None:
    """Derivative (4 S, 4 S) of `drag_impulse` by the motion, after a call of it.

    From the tip on: with the resistance H of all that hangs on an element of twists S, its own strains and those of an element e nearer to
    the base share S_e' H S. The sums of H S over what hangs on an element stand in `shape.hung`, so that one pass along them serves all
    (composite rigid bodies, Featherstone 2008).
    """
    size, resistance, hung, twists = tangent.shape[0], shape.resistance, shape.hung, shape.twists
    tangent[:] = 0.0
    resistance[:] = 0.0
    hung[:] = 0.0
    for i in range(len(elements.first) - 1, -1, -1):
        begin, w0, w1 = 4 * elements.first[i], elements.weights[i, 0], elements.weights[i, 1]
        add_resistance(i, h, elements, shape)
        for r in range(3):
            for k in range(4):
                spin, velocity = shape.turning[i, r, k] if k < 3 else 0.0, shape.moving[i, r, k]  # a stretch turns nothing
                twists[r, k], twists[3 + r, k] = w0 * spin, w0 * velocity
                twists[r, 4 + k], twists[3 + r, 4 + k] = w1 * spin, w1 * velocity
        for r in range(6):
            for d in range(r):
                resistance[r, d] = resistance[d, r]
        for side in range(2):
            for r in range(6):
                h0, h1, h2 = resistance[r, 0], resistance[r, 1], resistance[r, 2]
                h3, h4, h5 = resistance[r, 3], resistance[r, 4], resistance[r, 5]
                for k in range(8):
                    # Half of it before and half after, for the transpose is added below.
                    hung[r, begin + k] += 0.5 * (
                        h0 * twists[0, k] + h1 * twists[1, k] + h2 * twists[2, k]
                        + h3 * twists[3, k] + h4 * twists[4, k] + h5 * twists[5, k]
                    )  # fmt: skip
            for k in range(8 * (1 - side)):
                t0, t1, t2, t3, t4, t5 = twists[0, k], twists[1, k], twists[2, k], twists[3, k], twists[4, k], twists[5, k]
                row = tangent[begin + k]
                for d in range(size):
                    row[d] += t0 * hung[0, d] + t1 * hung[1, d] + t2 * hung[2, d] + t3 * hung[3, d] + t4 * hung[4, d] + t5 * hung[5, d]
    for c in range(size):
        for d in range(c):
            tangent[c, d] = tangent[d, c] = tangent[c, d] + tangent[d, c]
        tangent[c, c] *= 2.0
