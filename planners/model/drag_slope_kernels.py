"""How the water's impulse on a motion that stays changes with the shape that moves, compiled.

Along a direction of the strains, everything beyond an element is displaced like a rigid body, by a twist of the base that adds up along the
arm: of the element's twists S per strain rate,

    dS = [xi, S] + dS/dk dk,

xi the displacement of what comes before it, and the second part its own, in closed form (Rodrigues). Wrenches follow likewise.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.compiler import borrowing_kernel

from .drag_kernels import SLOWEST

Floats = NDArray[np.float64]


class ShapeSlopes(NamedTuple):
    """Buffers of M elements.

    `own` (M, 4, 4, 6): derivatives of the element's twist per rate of strain k (second axis) by its strain j (first axis); `ends`
    (M, 3, 4): displacement of what is at the base and moves with the far end, by the element's strains; `moves` (M, 6): twist of the
    element in the motion, `by_own` (M, 6, 4): its derivative by the element's strains; `drag` (M, 10): of the far ends, velocity across the
    tangent, force, drag across, its slope over h^2, speed along the tangent, spin about it; `work` (M, 4, 4): derivative of the work of
    what hangs on the element by its own strains, `hanging` (M, 6): wrench on all that; `displaced` and `pushed` (M, 6): twists xi and
    changes of wrenches along one direction.
    """

    own: Floats
    ends: Floats
    moves: Floats
    by_own: Floats
    drag: Floats
    work: Floats
    hanging: Floats
    displaced: Floats
    pushed: Floats


def shape_slope_buffers(elements: int) -> ShapeSlopes:
    """Empty buffers."""
    sizes = ((4, 4, 6), (3, 4), (6,), (6, 4), (10,), (4, 4), (6,), (6,), (6,))
    return ShapeSlopes(*(np.zeros((elements, *size)) for size in sizes))


@borrowing_kernel
def cross(a: Floats, b: Floats) -> tuple[float, float, float]:
    """Vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@borrowing_kernel
def element_slopes(k1: float, k2: float, k3: float, e: float, i: int, width: float, shape: Any, room: Any) -> None:
    """Derivatives of the twists of one element by its own strains, with all before it held; after `set_shape`."""
    m, own, ends = shape.middles[i], room.own[i], room.ends[i]
    k, size = (k1, k2, k3), np.sqrt(k1 * k1 + k2 * k2 + k3 * k3 + 1e-12)
    angle = 0.5 * width * size
    ratio = np.sin(angle) / angle
    curl, rest, slope = (1 - np.cos(angle)) / angle, 1 - ratio, 0.5 * width * (np.cos(angle) - ratio) / angle
    u = (k1 / size, k2 / size, k3 / size)
    square = u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    axis = (m[0, 0] * u[0] + m[0, 1] * u[1] + m[0, 2] * u[2], m[1, 0] * u[0] + m[1, 1] * u[1] + m[1, 2] * u[2],
            m[2, 0] * u[0] + m[2, 1] * u[1] + m[2, 2] * u[2])  # fmt: skip
    bow = e * width * width * width / 12
    chord = shape.turning[i, :, 2]
    p = shape.points[i]
    half = (p[0] - 0.5 * e * chord[0], p[1] - 0.5 * e * chord[1], p[2] - 0.5 * e * chord[2])
    for j in range(3):
        # Turn of the frame half way.
        mj = m[:, j]
        c0, c1, c2 = cross(axis, mj)
        h = (
            0.5 * width * (mj[0] - curl * c0 + rest * (axis[0] * u[j] - mj[0] * square)),
            0.5 * width * (mj[1] - curl * c1 + rest * (axis[1] * u[j] - mj[1] * square)),
            0.5 * width * (mj[2] - curl * c2 + rest * (axis[2] * u[j] - mj[2] * square)),
        )
        for c in range(3):
            t = shape.turning[i, :, c]
            turned = cross(h, t)
            for r in range(3):
                part = slope * u[j] * (m[r, c] - axis[r] * u[c]) + rest / size * (m[r, j] - axis[r] * u[j]) * u[c]
                part += rest / size * axis[r] * ((1.0 if j == c else 0.0) - u[c] * u[j])
                own[j, c, r] = turned[r] + width * part
        d = own[j, 2, :3]  # of the chord over the stretch
        for c in range(3):
            t = shape.turning[i, :, c]
            if c < 2:
                b = (
                    bow * (-k[2] * m[0, c] - k[c] * m[0, 2]),
                    bow * (-k[2] * m[1, c] - k[c] * m[1, 2]),
                    bow * (-k[2] * m[2, c] - k[c] * m[2, 2]),
                )
            else:
                b = (
                    2 * bow * (k[0] * m[0, 0] + k[1] * m[0, 1]), 2 * bow * (k[0] * m[1, 0] + k[1] * m[1, 1]),
                    2 * bow * (k[0] * m[2, 0] + k[1] * m[2, 1]),
                )  # fmt: skip
            bent, held, moved = cross(h, b), cross(half, own[j, c, :3]), cross(d, t)
            for r in range(3):
                change = 0.0
                if c < 2:
                    if j == c:
                        change = -m[r, 2]
                    elif j == 2:
                        change = -m[r, c]
                elif j < 2:
                    change = 2 * m[r, j]
                own[j, c, 3 + r] = bent[r] + bow * change + held[r] + 0.5 * e * moved[r]
                if j == 0:  # by the stretch, once
                    lifted = cross(chord, t)
                    own[3, c, 3 + r] = b[r] / e + 0.5 * lifted[r]
                    own[3, c, r] = 0.0
        for r in range(3):
            own[j, 3, r], own[j, 3, 3 + r] = 0.0, d[r]
        out = cross(p, shape.turning[i, :, j])
        for r in range(3):
            ends[r, j] = e * d[r] + out[r]
    for r in range(6):
        own[3, 3, r] = 0.0
    for r in range(3):
        ends[r, 3] = chord[r]


@borrowing_kernel
def set_shape_slopes(q: Floats, motion: Floats, h: float, elements: Any, shape: Any, room: Any) -> None:
    """All that `impulse_along` needs of a motion (S, 4) from the strains `q` within `h`; after `set_shape` and `drag_impulse`."""
    last = len(elements.first) - 1
    for i in range(last + 1):
        a, w0, w1 = elements.first[i], elements.weights[i, 0], elements.weights[i, 1]
        element_slopes(
            w0 * q[a, 0] + w1 * q[a + 1, 0], w0 * q[a, 1] + w1 * q[a + 1, 1], w0 * q[a, 2] + w1 * q[a + 1, 2],
            w0 * q[a, 3] + w1 * q[a + 1, 3], i, elements.widths[i], shape, room,
        )  # fmt: skip
        room.moves[i] = 0.0
        room.by_own[i] = 0.0
        for k in range(4):
            rate = w0 * motion[a, k] + w1 * motion[a + 1, k]
            for r in range(3):
                room.moves[i, 3 + r] += shape.moving[i, r, k] * rate
                if k < 3:
                    room.moves[i, r] += shape.turning[i, r, k] * rate
            for j in range(4):
                for r in range(6):
                    room.by_own[i, r, j] += room.own[i, j, k, r] * rate
    torque, force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(last, -1, -1):
        v, t, w, x, drag = shape.velocity[i], shape.tangents[i], shape.spin[i], shape.points[i], room.drag[i]
        along, about = v[0] * t[0] + v[1] * t[1] + v[2] * t[2], w[0] * t[0] + w[1] * t[1] + w[2] * t[2]
        n = (v[0] - along * t[0], v[1] - along * t[1], v[2] - along * t[2])
        speed = np.sqrt((n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / (h * h) + SLOWEST * SLOWEST)
        normal, linear, turned = elements.quadratic[i] * speed, elements.linear[i], 0.5 * elements.rotational[i]
        p = (linear * v[0] + normal * n[0], linear * v[1] + normal * n[1], linear * v[2] + normal * n[2])
        lever = cross(x, p)
        force = (force[0] + p[0], force[1] + p[1], force[2] + p[2])
        torque = (
            torque[0] + turned * (w[0] + about * t[0]) + lever[0],
            torque[1] + turned * (w[1] + about * t[1]) + lever[1],
            torque[2] + turned * (w[2] + about * t[2]) + lever[2],
        )
        for r in range(3):
            drag[r], drag[3 + r] = n[r], p[r]
            room.hanging[i, r], room.hanging[i, 3 + r] = torque[r], force[r]
        drag[6], drag[7], drag[8], drag[9] = normal, elements.quadratic[i] / (speed * h * h), along, about
        for k in range(4):
            for j in range(4):
                d = room.own[i, j, k]
                room.work[i, k, j] = (
                    d[0] * torque[0] + d[1] * torque[1] + d[2] * torque[2] + d[3] * force[0] + d[4] * force[1] + d[5] * force[2]
                )


@borrowing_kernel
def impulse_along(slopes: Floats, step_slope: float, h: float, elements: Any, shape: Any, room: Any, out: Floats) -> None:
    """Derivative (4 S,) of `drag_impulse` at a fixed motion along a direction (4 S,) of the strains and of the step."""
    zero = 0.0
    g0, g1, g2, l0, l1, l2 = zero, zero, zero, zero, zero, zero  # displacement of what comes before: turn, shift
    s0, s1, s2, a0, a1, a2 = zero, zero, zero, zero, zero, zero  # change of the twist of the motion
    for i in range(len(elements.first)):
        c, w0, w1 = 4 * elements.first[i], elements.weights[i, 0], elements.weights[i, 1]
        d0, d1 = w0 * slopes[c] + w1 * slopes[c + 4], w0 * slopes[c + 1] + w1 * slopes[c + 5]
        d2, d3 = w0 * slopes[c + 2] + w1 * slopes[c + 6], w0 * slopes[c + 3] + w1 * slopes[c + 7]
        xi, v, own = room.displaced[i], room.moves[i], room.by_own[i]
        xi[0], xi[1], xi[2], xi[3], xi[4], xi[5] = g0, g1, g2, l0, l1, l2
        s0 += g1 * v[2] - g2 * v[1] + own[0, 0] * d0 + own[0, 1] * d1 + own[0, 2] * d2 + own[0, 3] * d3
        s1 += g2 * v[0] - g0 * v[2] + own[1, 0] * d0 + own[1, 1] * d1 + own[1, 2] * d2 + own[1, 3] * d3
        s2 += g0 * v[1] - g1 * v[0] + own[2, 0] * d0 + own[2, 1] * d1 + own[2, 2] * d2 + own[2, 3] * d3
        a0 += g1 * v[5] - g2 * v[4] + l1 * v[2] - l2 * v[1] + own[3, 0] * d0 + own[3, 1] * d1 + own[3, 2] * d2 + own[3, 3] * d3
        a1 += g2 * v[3] - g0 * v[5] + l2 * v[0] - l0 * v[2] + own[4, 0] * d0 + own[4, 1] * d1 + own[4, 2] * d2 + own[4, 3] * d3
        a2 += g0 * v[4] - g1 * v[3] + l0 * v[1] - l1 * v[0] + own[5, 0] * d0 + own[5, 1] * d1 + own[5, 2] * d2 + own[5, 3] * d3
        t, end = shape.turning[i], room.ends[i]
        g0 += t[0, 0] * d0 + t[0, 1] * d1 + t[0, 2] * d2
        g1 += t[1, 0] * d0 + t[1, 1] * d1 + t[1, 2] * d2
        g2 += t[2, 0] * d0 + t[2, 1] * d1 + t[2, 2] * d2
        l0 += end[0, 0] * d0 + end[0, 1] * d1 + end[0, 2] * d2 + end[0, 3] * d3
        l1 += end[1, 0] * d0 + end[1, 1] * d1 + end[1, 2] * d2 + end[1, 3] * d3
        l2 += end[2, 0] * d0 + end[2, 1] * d1 + end[2, 2] * d2 + end[2, 3] * d3
        x, y, z = shape.points[i, 0], shape.points[i, 1], shape.points[i, 2]
        x0, x1, x2 = l0 + g1 * z - g2 * y, l1 + g2 * x - g0 * z, l2 + g0 * y - g1 * x
        w = shape.spin[i]
        v0 = a0 + s1 * z - s2 * y + w[1] * x2 - w[2] * x1
        v1 = a1 + s2 * x - s0 * z + w[2] * x0 - w[0] * x2
        v2 = a2 + s0 * y - s1 * x + w[0] * x1 - w[1] * x0
        b0, b1, b2 = shape.tangents[i, 0], shape.tangents[i, 1], shape.tangents[i, 2]
        t0, t1, t2 = g1 * b2 - g2 * b1, g2 * b0 - g0 * b2, g0 * b1 - g1 * b0
        u, drag = shape.velocity[i], room.drag[i]
        along = v0 * b0 + v1 * b1 + v2 * b2 + u[0] * t0 + u[1] * t1 + u[2] * t2
        n0, n1, n2 = v0 - along * b0 - drag[8] * t0, v1 - along * b1 - drag[8] * t1, v2 - along * b2 - drag[8] * t2
        square = drag[0] * drag[0] + drag[1] * drag[1] + drag[2] * drag[2]
        faster = drag[7] * (drag[0] * n0 + drag[1] * n1 + drag[2] * n2 - square * step_slope / h)
        linear, normal, turned = elements.linear[i], drag[6], 0.5 * elements.rotational[i]
        p0 = linear * v0 + normal * n0 + faster * drag[0]
        p1 = linear * v1 + normal * n1 + faster * drag[1]
        p2 = linear * v2 + normal * n2 + faster * drag[2]
        about = s0 * b0 + s1 * b1 + s2 * b2 + w[0] * t0 + w[1] * t1 + w[2] * t2
        q0, q1, q2, pushed = drag[3], drag[4], drag[5], room.pushed[i]
        pushed[0] = turned * (s0 + about * b0 + drag[9] * t0) + y * p2 - z * p1 + x1 * q2 - x2 * q1
        pushed[1] = turned * (s1 + about * b1 + drag[9] * t1) + z * p0 - x * p2 + x2 * q0 - x0 * q2
        pushed[2] = turned * (s2 + about * b2 + drag[9] * t2) + x * p1 - y * p0 + x0 * q1 - x1 * q0
        pushed[3], pushed[4], pushed[5] = p0, p1, p2
    out[:] = 0.0
    t0, t1, t2, f0, f1, f2 = zero, zero, zero, zero, zero, zero
    for i in range(len(elements.first) - 1, -1, -1):
        c, w0, w1 = 4 * elements.first[i], elements.weights[i, 0], elements.weights[i, 1]
        pushed, g, whole = room.pushed[i], room.displaced[i], room.hanging[i]
        t0, t1, t2, f0, f1, f2 = (
            t0 + pushed[0], t1 + pushed[1], t2 + pushed[2], f0 + pushed[3], f1 + pushed[4], f2 + pushed[5]
        )  # fmt: skip
        m0, m1, m2, q0, q1, q2 = whole[0], whole[1], whole[2], whole[3], whole[4], whole[5]
        # The element's own twists are displaced, too; the same as if the wrench were displaced backwards.
        r0 = t0 + m1 * g[2] - m2 * g[1] + q1 * g[5] - q2 * g[4]
        r1 = t1 + m2 * g[0] - m0 * g[2] + q2 * g[3] - q0 * g[5]
        r2 = t2 + m0 * g[1] - m1 * g[0] + q0 * g[4] - q1 * g[3]
        h0, h1, h2 = f0 + q1 * g[2] - q2 * g[1], f1 + q2 * g[0] - q0 * g[2], f2 + q0 * g[1] - q1 * g[0]
        d0, d1 = w0 * slopes[c] + w1 * slopes[c + 4], w0 * slopes[c + 1] + w1 * slopes[c + 5]
        d2, d3 = w0 * slopes[c + 2] + w1 * slopes[c + 6], w0 * slopes[c + 3] + w1 * slopes[c + 7]
        for k in range(4):
            done = room.work[i, k, 0] * d0 + room.work[i, k, 1] * d1 + room.work[i, k, 2] * d2 + room.work[i, k, 3] * d3
            done += shape.moving[i, 0, k] * h0 + shape.moving[i, 1, k] * h1 + shape.moving[i, 2, k] * h2
            if k < 3:
                done += shape.turning[i, 0, k] * r0 + shape.turning[i, 1, k] * r1 + shape.turning[i, 2, k] * r2
            out[c + k] += w0 * done
            out[c + 4 + k] += w1 * done
