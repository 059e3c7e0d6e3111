"""Elastic Cosserat rod: strains, internal forces and the position-Verlet step, fused over one buffer.

Discretisation: Gazzola et al. (2018, R. Soc. Open Sci. 5:171628, eqs 2.17-2.24); material frames on elements, curvature on joints,

    e = l / L,  sigma = e Q t - d3,  kappa = log(Q_j Q_{j-1}^T) / D
    m dv/dt = delta(Q^T n / e) + f
    J dw/dt = e [ delta(M) + mean(kappa x M D) + (Q t x n) L + (J w / e) x w + J w e' / e^2 + Q c ],     M = B (kappa - kappa0) / E^3

One step is drift, kick, drift. Damping at a physical rate g (1/s) is exact over the step: v becomes exp(-g h) v + phi1(g h) h a, so the
force keeps its full effect (applied after the kick, damping would weaken it and make the scheme first order).

No trigonometric function is called, see `octoctrl.sim.physics.rotation_kernels`.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..compiler import kernel
from ..contracts import Floats
from ..physics.drag_kernels import braked
from ..physics.rotation_kernels import joint_curvature, orthonormal, rotation, turned
from .layout import offsets

ONE = np.uint64(1)


def rod_kernels(stride: int, constant_section: bool = False) -> tuple[Callable[..., Any], ...]:
    """Compile the kernels of an elastic rod for buffers of the given stride.

    Parameters
    ----------
    stride : int
        Of `octoctrl.sim.rod.layout.STRIDES`.
    constant_section : bool
        Whether area, stiffness and rotary inertia keep their values at rest (all powers of e and E become 1) and moments act through the
        exact adjoint of the rotation vector. Such a rod conserves energy and angular momentum; in the published form of the equations,
        with a section that shrinks as it stretches, there is no potential.

    Returns
    -------
    drift, strain, curvature, curvature_rate, moment, transport, kick, water : compiled functions
        Of ``(buffer, n, ...)`` with ``n`` elements as uint64: `drift` moves nodes and directors, `strain` and the curvatures measure,
        `moment` and `transport` give the internal torques, `water` and `kick` change the velocities.
    """
    o = offsets(stride)
    X1, X2, X3, V1, V2, V3 = (o[name] for name in ("X1", "X2", "X3", "V1", "V2", "V3"))
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    W1, W2, W3, T1, T2, T3, N1, N2, N3 = (o[f"{field}{i}"] for field in "WTN" for i in (1, 2, 3))
    K1, K2, K3, M1, M2, M3, A1, A2, A3 = (o[f"{field}{i}"] for field in "KMA" for i in (1, 2, 3))
    KRATE1, KRATE2, KRATE3, REST1, REST2, REST3 = (o[f"{field}{i}"] for field in ("KRATE", "REST") for i in (1, 2, 3))
    LENGTH, SHEAR, AXIAL, STRETCH, RATE = (o[name] for name in ("LENGTH", "SHEAR", "AXIAL", "STRETCH", "RATE"))
    INVERSE_LENGTH, INVERSE_JOINT = o["INVERSE_LENGTH"], o["INVERSE_JOINT"]
    INERTIA1, INERTIA2, INERTIA3 = (o[f"INERTIA{i}"] for i in (1, 2, 3))
    JOINT_LENGTH, BEND1, BEND2, TWIST = (o[name] for name in ("JOINT_LENGTH", "BEND1", "BEND2", "TWIST"))
    TORQUE1, TORQUE2, TORQUE3 = (o[f"TORQUE{i}"] for i in (1, 2, 3))
    FORCE1, FORCE2, FORCE3, COUPLE1, COUPLE2, COUPLE3 = (o[f"{field}{i}"] for field in ("FORCE", "COUPLE") for i in (1, 2, 3))
    NODE_DECAY, NODE_MOBILITY, BEND_DECAY, TWIST_DECAY = (o[k] for k in ("NODE_DECAY", "NODE_MOBILITY", "BEND_DECAY", "TWIST_DECAY"))
    MOBILITY1, MOBILITY2, MOBILITY3 = (o[f"MOBILITY{i}"] for i in (1, 2, 3))
    DRAG_NORMAL, DRAG_TANGENT = o["DRAG_NORMAL"], o["DRAG_TANGENT"]

    @kernel
    def drift(b: Floats, n: np.uint64, h: float) -> None:
        for k in range(ONE, n + ONE + ONE):
            b[X1 + k] += h * b[V1 + k]
            b[X2 + k] += h * b[V2 + k]
            b[X3 + k] += h * b[V3 + k]
        for k in range(ONE, n + ONE):
            w1, w2, w3 = b[W1 + k], b[W2 + k], b[W3 + k]
            i1, i2, i3 = b[INERTIA1 + k], b[INERTIA2 + k], b[INERTIA3 + k]
            p1, p2, p3 = i1 * w1, i2 * w2, i3 * w3
            if constant_section:
                # Turn with the spin of the middle of the interval, so that the free rotation is second order.
                half = 0.5 * h
                w1, w2, w3 = (
                    w1 + half * (p2 * w3 - p3 * w2) / i1,
                    w2 + half * (p3 * w1 - p1 * w3) / i2,
                    w3 + half * (p1 * w2 - p2 * w1) / i3,
                )
            u1, u2, u3 = h * w1, h * w2, h * w3
            r = rotation(u1, u2, u3)
            if constant_section:
                # Angular momentum stays where it is while the frame turns.
                p1, p2, p3 = turned(r, p1, p2, p3)
                b[W1 + k], b[W2 + k], b[W3 + k] = p1 / i1, p2 / i2, p3 / i3
            b[Q11 + k], b[Q21 + k], b[Q31 + k] = turned(r, b[Q11 + k], b[Q21 + k], b[Q31 + k])
            b[Q12 + k], b[Q22 + k], b[Q32 + k] = turned(r, b[Q12 + k], b[Q22 + k], b[Q32 + k])
            b[Q13 + k], b[Q23 + k], b[Q33 + k] = turned(r, b[Q13 + k], b[Q23 + k], b[Q33 + k])

    @kernel
    def strain(b: Floats, n: np.uint64) -> None:
        for k in range(ONE, n + ONE):
            d1, d2, d3 = b[X1 + k + ONE] - b[X1 + k], b[X2 + k + ONE] - b[X2 + k], b[X3 + k + ONE] - b[X3 + k]
            length = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
            inverse = 1 / length
            t1, t2, t3 = d1 * inverse, d2 * inverse, d3 * inverse
            stretch = length * b[INVERSE_LENGTH + k]
            unstretch = 1.0 if constant_section else 1 / stretch
            u1, u2, u3 = b[V1 + k + ONE] - b[V1 + k], b[V2 + k + ONE] - b[V2 + k], b[V3 + k + ONE] - b[V3 + k]
            rate = (t1 * u1 + t2 * u2 + t3 * u3) * b[INVERSE_LENGTH + k]
            m1 = b[Q11 + k] * t1 + b[Q12 + k] * t2 + b[Q13 + k] * t3
            m2 = b[Q21 + k] * t1 + b[Q22 + k] * t2 + b[Q23 + k] * t3
            m3 = b[Q31 + k] * t1 + b[Q32 + k] * t2 + b[Q33 + k] * t3
            n1, n2, n3 = b[SHEAR + k] * stretch * m1, b[SHEAR + k] * stretch * m2, b[AXIAL + k] * (stretch * m3 - 1)
            b[STRETCH + k], b[RATE + k] = stretch, rate
            b[T1 + k], b[T2 + k], b[T3 + k] = t1, t2, t3
            b[N1 + k] = (b[Q11 + k] * n1 + b[Q21 + k] * n2 + b[Q31 + k] * n3) * unstretch
            b[N2 + k] = (b[Q12 + k] * n1 + b[Q22 + k] * n2 + b[Q32 + k] * n3) * unstretch
            b[N3 + k] = (b[Q13 + k] * n1 + b[Q23 + k] * n2 + b[Q33 + k] * n3) * unstretch
            w1, w2, w3 = b[W1 + k], b[W2 + k], b[W3 + k]
            share = 0.0 if constant_section else unstretch
            j1, j2, j3 = b[INERTIA1 + k] * w1 * share, b[INERTIA2 + k] * w2 * share, b[INERTIA3 + k] * w3 * share
            swelling = rate * share
            # Where the update multiplies all torque by e (J shrinks with the section), the lever is the rest length; else the present one.
            lever = b[LENGTH + k] * (stretch if constant_section else 1.0)
            b[TORQUE1 + k] = (m2 * n3 - m3 * n2) * lever + j2 * w3 - j3 * w2 + j1 * swelling
            b[TORQUE2 + k] = (m3 * n1 - m1 * n3) * lever + j3 * w1 - j1 * w3 + j2 * swelling
            b[TORQUE3 + k] = (m1 * n2 - m2 * n1) * lever + j1 * w2 - j2 * w1 + j3 * swelling

    @kernel
    def curvature(b: Floats, n: np.uint64) -> None:
        for k in range(ONE, n + ONE):
            p = k - ONE
            b[K1 + k], b[K2 + k], b[K3 + k] = joint_curvature(
                b[Q11 + p], b[Q12 + p], b[Q13 + p], b[Q21 + p], b[Q22 + p], b[Q23 + p], b[Q31 + p], b[Q32 + p], b[Q33 + p],
                b[Q11 + k], b[Q12 + k], b[Q13 + k], b[Q21 + k], b[Q22 + k], b[Q23 + k], b[Q31 + k], b[Q32 + k], b[Q33 + k],
                b[INVERSE_JOINT + k],
            )  # fmt: skip

    @kernel
    def curvature_rate(b: Floats, n: np.uint64) -> None:
        # kappa' = (w_k - w_{k-1}) / D + kappa x w: the second term is the turning of the frame in which kappa is written.
        for k in range(ONE, n + ONE):
            p = k - ONE
            inverse = b[INVERSE_JOINT + k]
            k1, k2, k3 = b[K1 + k], b[K2 + k], b[K3 + k]
            w1, w2, w3 = 0.5 * (b[W1 + k] + b[W1 + p]), 0.5 * (b[W2 + k] + b[W2 + p]), 0.5 * (b[W3 + k] + b[W3 + p])
            b[KRATE1 + k] = (b[W1 + k] - b[W1 + p]) * inverse + k2 * w3 - k3 * w2
            b[KRATE2 + k] = (b[W2 + k] - b[W2 + p]) * inverse + k3 * w1 - k1 * w3
            b[KRATE3 + k] = (b[W3 + k] - b[W3 + p]) * inverse + k1 * w2 - k2 * w1

    @kernel
    def moment(b: Floats, n: np.uint64) -> None:
        for k in range(ONE, n + ONE):
            p = k - ONE
            swell = 0.5 * (b[STRETCH + k] * b[LENGTH + k] + b[STRETCH + p] * b[LENGTH + p]) * b[INVERSE_JOINT + k]
            soften = 1.0 if constant_section else 1 / (swell * swell * swell)
            k1, k2, k3 = b[K1 + k], b[K2 + k], b[K3 + k]
            m1 = b[BEND1 + k] * (k1 - b[REST1 + k]) * soften
            m2 = b[BEND2 + k] * (k2 - b[REST2 + k]) * soften
            m3 = b[TWIST + k] * (k3 - b[REST3 + k]) * soften
            b[M1 + k], b[M2 + k], b[M3 + k] = m1, m2, m3

    @kernel
    def transport(b: Floats, n: np.uint64) -> None:
        for k in range(ONE, n + ONE):
            half = 0.5 * b[JOINT_LENGTH + k]
            k1, k2, k3 = b[K1 + k] * half, b[K2 + k] * half, b[K3 + k] * half
            m1, m2, m3 = b[M1 + k], b[M2 + k], b[M3 + k]
            a1, a2, a3 = k2 * m3 - k3 * m2, k3 * m1 - k1 * m3, k1 * m2 - k2 * m1
            b[A1 + k], b[A2 + k], b[A3 + k] = a1, a2, a3
            if constant_section:
                # The exact adjoint of the rotation vector's rate: the published form stops at the first order of the joint's angle.
                square = 4 * (k1 * k1 + k2 * k2 + k3 * k3)
                second = 4 * (1 / 12 + square * (1 / 720 + square * (1 / 30240 + square * (1 / 1209600))))
                b[M1 + k] = m1 + second * (k2 * a3 - k3 * a2)
                b[M2 + k] = m2 + second * (k3 * a1 - k1 * a3)
                b[M3 + k] = m3 + second * (k1 * a2 - k2 * a1)

    @kernel
    def kick(b: Floats, n: np.uint64) -> None:
        for k in range(ONE, n + ONE + ONE):
            p = k - ONE
            decay, mobility = b[NODE_DECAY + k], b[NODE_MOBILITY + k]
            b[V1 + k] = decay * b[V1 + k] + mobility * (b[N1 + k] - b[N1 + p] + b[FORCE1 + k])
            b[V2 + k] = decay * b[V2 + k] + mobility * (b[N2 + k] - b[N2 + p] + b[FORCE2 + k])
            b[V3 + k] = decay * b[V3 + k] + mobility * (b[N3 + k] - b[N3 + p] + b[FORCE3 + k])
        for k in range(ONE, n + ONE):
            q = k + ONE
            stretch = 1.0 if constant_section else b[STRETCH + k]
            bend_decay = b[BEND_DECAY + k]
            torque1 = b[M1 + q] - b[M1 + k] + b[A1 + q] + b[A1 + k] + b[TORQUE1 + k]
            torque2 = b[M2 + q] - b[M2 + k] + b[A2 + q] + b[A2 + k] + b[TORQUE2 + k]
            torque3 = b[M3 + q] - b[M3 + k] + b[A3 + q] + b[A3 + k] + b[TORQUE3 + k]
            c1, c2, c3 = b[COUPLE1 + k], b[COUPLE2 + k], b[COUPLE3 + k]
            torque1 += b[Q11 + k] * c1 + b[Q12 + k] * c2 + b[Q13 + k] * c3
            torque2 += b[Q21 + k] * c1 + b[Q22 + k] * c2 + b[Q23 + k] * c3
            torque3 += b[Q31 + k] * c1 + b[Q32 + k] * c2 + b[Q33 + k] * c3
            b[W1 + k] = bend_decay * b[W1 + k] + b[MOBILITY1 + k] * stretch * torque1
            b[W2 + k] = bend_decay * b[W2 + k] + b[MOBILITY2 + k] * stretch * torque2
            b[W3 + k] = b[TWIST_DECAY + k] * b[W3 + k] + b[MOBILITY3 + k] * stretch * torque3

    @kernel
    def water(b: Floats, n: np.uint64) -> None:
        # At the mean tangent of the two elements of a node.
        for k in range(ONE, n + ONE + ONE):
            p = k - ONE
            t1, t2, t3 = b[T1 + k] + b[T1 + p], b[T2 + k] + b[T2 + p], b[T3 + k] + b[T3 + p]
            b[V1 + k], b[V2 + k], b[V3 + k] = braked(
                b[V1 + k], b[V2 + k], b[V3 + k], t1, t2, t3, b[DRAG_NORMAL + k], b[DRAG_TANGENT + k], b[NODE_MOBILITY + k],
            )  # fmt: skip

    return drift, strain, curvature, curvature_rate, moment, transport, kick, water


def frame_kernel(stride: int) -> Callable[..., Any]:
    """Compile ``straighten(buffer, n)``, which takes every element's frame to the nearest orthonormal one."""
    o = offsets(stride)
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))

    @kernel
    def straighten(b: Floats, n: np.uint64) -> None:
        for k in range(ONE, n + ONE):
            (
                b[Q11 + k], b[Q12 + k], b[Q13 + k], b[Q21 + k], b[Q22 + k], b[Q23 + k], b[Q31 + k], b[Q32 + k], b[Q33 + k],
            ) = orthonormal(
                b[Q11 + k], b[Q12 + k], b[Q13 + k], b[Q21 + k], b[Q22 + k], b[Q23 + k], b[Q31 + k], b[Q32 + k], b[Q33 + k],
            )  # fmt: skip

    return straighten
