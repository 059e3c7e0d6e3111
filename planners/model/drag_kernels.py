"""Water drag of the reduced model for the compiled step: shape, force of a motion, tangent; formulas and sources stand in `drag`.

A motion m of the strains within a step h moves node j by J_j m, and the water's impulse on it is h F(J_j m / h), F(v) = c v + d |v_n| v_n
across the tangent, with a rotational drag beside it. Twists and wrenches are those of the point at the base: a twist is the spin and the
velocity of what would be there, a wrench the torque about it and the force. Both then add up along the arm as they are (Featherstone 2008).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.compiler import kernel

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
    `velocity` and `spin` (M, 3), `jacobian` (9, 4 S): velocity of the point at the base, spin, velocity of the node, `wrench` (6, 4 S).
    """

    turning: Floats
    moving: Floats
    points: Floats
    tangents: Floats
    middles: Floats
    frame: Floats
    velocity: Floats
    spin: Floats
    jacobian: Floats
    wrench: Floats


def shape_buffers(elements: int, sections: int) -> Shape:
    """Empty buffers for `elements` elements."""
    each = ((3, 3), (3, 4), (3,), (3,), (3, 3))
    sizes = (*((elements, *size) for size in each), (3, 3), (elements, 3), (elements, 3), (9, 4 * sections), (6, 4 * sections))
    return Shape(*map(np.zeros, sizes))


@kernel
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


@kernel
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


@kernel
def drag_tangent(h: float, elements: Any, shape: Any, tangent: Floats) -> None:
    """Derivative (4 S, 4 S) of `drag_impulse` by the motion, after a call of it."""
    size, jacobian, wrench = tangent.shape[0], shape.jacobian, shape.wrench
    tangent[:] = 0.0
    jacobian[:] = 0.0
    for i in range(len(elements.first)):
        a = elements.first[i]
        for side in range(2):
            w = elements.weights[i, side]
            for k in range(4):
                c = 4 * (a + side) + k
                for r in range(3):
                    jacobian[r, c] += w * shape.moving[i, r, k]
                    if k < 3:
                        jacobian[3 + r, c] += w * shape.turning[i, r, k]
        top = min(4 * (a + 2), size)
        x, y, z = shape.points[i, 0], shape.points[i, 1], shape.points[i, 2]
        tx, ty, tz = shape.tangents[i, 0], shape.tangents[i, 1], shape.tangents[i, 2]
        v0, v1, v2 = shape.velocity[i, 0], shape.velocity[i, 1], shape.velocity[i, 2]
        along = v0 * tx + v1 * ty + v2 * tz
        n0, n1, n2 = (v0 - along * tx) / h, (v1 - along * ty) / h, (v2 - along * tz) / h
        speed = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2 + SLOWEST * SLOWEST)
        normal, steep = elements.quadratic[i] * speed, elements.quadratic[i] / speed
        isotropic, turned = elements.linear[i] + normal, 0.5 * elements.rotational[i]
        for c in range(top):
            w0, w1, w2 = jacobian[3, c], jacobian[4, c], jacobian[5, c]
            j0, j1, j2 = jacobian[0, c] + w1 * z - w2 * y, jacobian[1, c] + w2 * x - w0 * z, jacobian[2, c] + w0 * y - w1 * x
            jacobian[6, c], jacobian[7, c], jacobian[8, c] = j0, j1, j2
            lost, gained = normal * (j0 * tx + j1 * ty + j2 * tz), steep * (j0 * n0 + j1 * n1 + j2 * n2)
            wrench[0, c] = isotropic * j0 - lost * tx + gained * n0
            wrench[1, c] = isotropic * j1 - lost * ty + gained * n1
            wrench[2, c] = isotropic * j2 - lost * tz + gained * n2
            about = w0 * tx + w1 * ty + w2 * tz
            wrench[3, c], wrench[4, c], wrench[5, c] = turned * (w0 + about * tx), turned * (w1 + about * ty), turned * (w2 + about * tz)
        for c in range(top):
            j0, j1, j2 = jacobian[6, c], jacobian[7, c], jacobian[8, c]
            w0, w1, w2 = jacobian[3, c], jacobian[4, c], jacobian[5, c]
            for d in range(c + 1):
                tangent[c, d] += (
                    j0 * wrench[0, d] + j1 * wrench[1, d] + j2 * wrench[2, d] + w0 * wrench[3, d] + w1 * wrench[4, d] + w2 * wrench[5, d]
                )
    for c in range(size):
        for d in range(c):
            tangent[d, c] = tangent[c, d]
