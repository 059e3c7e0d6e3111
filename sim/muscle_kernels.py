"""Muscle fibres at their off-axis places on the cross-section of one rod, and the implicit step of their viscosity.

A fibre's length per rest length of the arm is a function of the section's strains (stretch e, curvatures k1, k2, twist k3); its tension
does virtual work on them (reduction of Tekinalp et al. 2024 to one rod). With the radius factor lam = e^-nu of the section:

    longitudinal at (r1, r2) = rho lam (sin phi, cos phi):  l^2 = (e + k1 r2 - k2 r1)^2 + (rho lam k3)^2
    oblique of hand h = +1 (right), -1 (left):              l^2 = e^2 + (rho lam)^2 (h q0 + k3)^2
    transverse: l = lam                                      nerve cord (passive): l = e
    T = A sigma(s) / s,   s = l / l_rest,   generalised force T dl/d(e, k)

The force-velocity law acts as a viscosity c = T_v / l' with Hill's secant, tens of times stiffer than anything elastic. It is integrated
linearly implicitly: with the exact old rates on the right-hand side, and a diagonal bound of the viscosity (plus an elastic tangent) on
the increments of stretch rate, curvature rate and twist rate, which leaves three scalar tridiagonal systems. The secant at the old rate
keeps the sign of the driving force, so that it cannot chatter; treated explicitly the law would need steps of nanoseconds.
"""

from typing import NamedTuple

import numpy as np

from .compiler import kernel
from .rod_layout import offsets

ONE = np.uint64(1)
MAJORANT = 1.0
"""Factor on the diagonal viscosity bounds. At one the step is stable: the fibres couple two blocks, stretch and spin, so that the sum of
the blocks is at least half of the whole. What the bound exceeds the true viscosity by delays the viscous stress by about one step."""


class LawConstants(NamedTuple):
    """Scalars of one muscle law for the compiled code; see `octoctrl.sim.muscles.MuscleLaw`."""

    stress: float
    compression: float
    slack: float
    rate: float
    concentric: float
    eccentric_gain: float
    eccentric: float
    low: float
    high: float
    high_slope: float
    tangent: float
    active: tuple
    passive: tuple


def law_constants(law, passive_factor=1.0):
    """Constants of a `MuscleLaw`, with a factor on its passive stress."""
    scale = law.maximum_stress * law.passive_scale * passive_factor
    stretches = np.linspace(1.0, 1.4, 81)
    return LawConstants(
        stress=law.maximum_stress,
        compression=law.compression_modulus * passive_factor,
        slack=law.slack,
        rate=1 / law.maximum_rate,
        concentric=1 / law.curvature,
        eccentric_gain=(law.eccentric_plateau - 1) * (1 + law.eccentric_slope / law.curvature),
        eccentric=law.eccentric_slope / law.curvature,
        low=law.range[0],
        high=law.range[1],
        high_slope=scale * float(np.polyval(np.polyder(law.passive), law.range[1])),
        tangent=float(scale * np.polyval(np.polyder(law.passive), stretches).max()),
        active=tuple(float(c) for c in law.active),
        passive=tuple(float(scale * c) for c in law.passive),
    )


@kernel
def _horner(c, x):
    total = c[0] * x + c[1]
    total = total * x + c[2]
    total = total * x + c[3]
    total = total * x + c[4]
    total = total * x + c[5]
    total = total * x + c[6]
    total = total * x + c[7]
    return total * x + c[8]


@kernel
def passive_stress(law, s):
    """Passive stress; twin of `MuscleLaw.passive_stress`."""
    inside = min(max(s, 1.0), law.high)
    curve = max(_horner(law.passive, inside) + law.high_slope * max(s - law.high, 0.0), 0.0)
    tension = curve if s > 1.0 + law.slack else 0.0
    return tension + law.compression * min(s - 1.0 + law.slack, 0.0)


@kernel
def isometric_stress(law, s):
    """Active stress per activation at rest; twin of `MuscleLaw.active_factor`."""
    return law.stress * max(_horner(law.active, min(max(s, law.low), law.high)), 0.0)


@kernel
def hill_secant(law, rate):
    """(f_v - 1) / rate >= 0 at a stretch rate, s: what the isometric stress is multiplied with to give a viscosity."""
    w = -rate * law.rate
    shortening = (1.0 + law.concentric) / max(1.0 + law.concentric * w, (1.0 + law.concentric) * w)
    lengthening = law.eccentric_gain / (1.0 - law.eccentric * w)
    return law.rate * (shortening if w > 0.0 else lengthening)


def fibre_kernels(stride, active):
    """Compile the fibre loops for buffers of the given stride.

    Parameters
    ----------
    stride : int
    active : bool
        False leaves the active law out: for groups that a scene never activates.

    Returns
    -------
    longitudinal, oblique, transverse : compiled functions
        They add to TENSION, MOMENT1..3 and the STIFF rows, the first two with ``(buffer, n, ..., law, elastic)``; activation is read
        from the LEVEL row, and `elastic` is the time (s) by which the elastic tangent is multiplied to join the viscosity.
    """
    o = offsets(stride)
    LEVEL, STRETCH, RATE, RADIUS, TENSION = (o[k] for k in ("LEVEL", "STRETCH", "RATE", "RADIUS", "TENSION"))
    MEAN1, MEAN2, MEAN3 = (o[f"MEAN{i}"] for i in (1, 2, 3))
    MEANRATE1, MEANRATE2, MEANRATE3 = (o[f"MEANRATE{i}"] for i in (1, 2, 3))
    MOMENT1, MOMENT2, MOMENT3 = (o[f"MOMENT{i}"] for i in (1, 2, 3))
    STIFF, STIFF_TURN = o["STIFF"], o["STIFF_TURN"]
    OFFSET, HELIX, LONGITUDINAL_AREA, RING_AREA = (o[k] for k in ("OFFSET", "HELIX", "LONGITUDINAL_AREA", "RING_AREA"))
    OBLIQUE_AREA, OBLIQUE_REST = o["OBLIQUE_AREA"], o["OBLIQUE_REST"]

    @kernel
    def pull(law, s, rate, level):
        # Stress, and the viscosity that belongs to it (Pa s).
        stress = passive_stress(law, s)
        if active:
            isometric = level * isometric_stress(law, s)
            viscosity = isometric * hill_secant(law, rate)
            return stress + isometric + viscosity * rate, viscosity
        return stress, 0.0

    @kernel
    def longitudinal(b, n, sine, cosine, nu, law, elastic):
        for k in range(ONE, n + ONE):
            lam = b[RADIUS + k]
            rho = b[OFFSET + k] * lam
            r1, r2 = rho * sine, rho * cosine
            e = b[STRETCH + k]
            shrink = -nu / e
            bend = b[MEAN1 + k] * r2 - b[MEAN2 + k] * r1
            x, y = e + bend, b[MEAN3 + k] * rho
            inverse = 1 / np.sqrt(x * x + y * y)
            x, y = x * inverse, y * inverse
            l0 = x * (1 + shrink * bend) + y * shrink * b[MEAN3 + k] * rho
            l1, l2, l3 = x * r2, -x * r1, y * rho
            rate = l0 * b[RATE + k] + l1 * b[MEANRATE1 + k] + l2 * b[MEANRATE2 + k] + l3 * b[MEANRATE3 + k]
            stress, viscosity = pull(law, 1 / inverse, rate, b[LEVEL + k])
            area = b[LONGITUDINAL_AREA + k] * inverse
            tension = area * stress
            stiff = area * (viscosity + elastic * law.tangent)
            b[TENSION + k] += tension * l0
            b[MOMENT1 + k] += tension * l1
            b[MOMENT2 + k] += tension * l2
            b[MOMENT3 + k] += tension * l3
            b[STIFF + k] += stiff * l0 * l0
            b[STIFF_TURN + k] += stiff * (l1 * l1 + l2 * l2 + l3 * l3)

    @kernel
    def oblique(b, n, winding, nu, law, elastic):
        for k in range(ONE, n + ONE):
            rho = b[HELIX + k] * b[RADIUS + k]
            e = b[STRETCH + k]
            turn = rho * (winding + b[MEAN3 + k])
            inverse = 1 / np.sqrt(e * e + turn * turn)
            l0 = (e - turn * turn * nu / e) * inverse
            l3 = turn * rho * inverse
            unrest = 1 / b[OBLIQUE_REST + k]
            rate = (l0 * b[RATE + k] + l3 * b[MEANRATE3 + k]) * unrest
            stress, viscosity = pull(law, unrest / inverse, rate, b[LEVEL + k])
            area = b[OBLIQUE_AREA + k] * inverse / unrest
            tension = area * stress
            stiff = area * unrest * (viscosity + elastic * law.tangent)
            b[TENSION + k] += tension * l0
            b[MOMENT3 + k] += tension * l3
            b[STIFF + k] += stiff * l0 * l0
            b[STIFF_TURN + k] += stiff * l3 * l3

    @kernel
    def transverse(b, n, nu, law, elastic):
        for k in range(ONE, n + ONE):
            lam = b[RADIUS + k]
            slope = -nu * lam / b[STRETCH + k]
            stress, viscosity = pull(law, lam, slope * b[RATE + k], b[LEVEL + k])
            area = b[RING_AREA + k] / lam
            b[TENSION + k] += area * stress * slope
            b[STIFF + k] += area * (viscosity + elastic * law.tangent) * slope * slope

    return longitudinal, oblique, transverse


def section_kernels(stride):
    """Compile what surrounds the fibres: section strains before, moments, forces and the implicit correction after.

    Returns
    -------
    measure, apply, remember, brake, relax : compiled functions
        `measure` gives section strains and starts the sums with the passive nerve cord; `apply` hands tension and moments to the rod;
        `remember` keeps the old spins, `brake` prepares the two tridiagonal systems, `relax` solves them and corrects the velocities.
    """
    o = offsets(stride)
    T1, T2, T3, N1, N2, N3, V1, V2, V3, W1, W2, W3 = (o[f"{field}{i}"] for field in "TNVW" for i in (1, 2, 3))
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    K1, K2, K3, M1, M2, M3 = (o[f"{field}{i}"] for field in "KM" for i in (1, 2, 3))
    KRATE1, KRATE2, KRATE3, OLD1, OLD2, OLD3 = (o[f"{field}{i}"] for field in ("KRATE", "OLD") for i in (1, 2, 3))
    SPIN1, SPIN2, SPIN3, YIELD = o["SPIN1"], o["SPIN2"], o["SPIN3"], o["YIELD"]
    MEAN1, MEAN2, MEAN3 = (o[f"MEAN{i}"] for i in (1, 2, 3))
    MEANRATE1, MEANRATE2, MEANRATE3 = (o[f"MEANRATE{i}"] for i in (1, 2, 3))
    MOMENT1, MOMENT2, MOMENT3 = (o[f"MOMENT{i}"] for i in (1, 2, 3))
    STIFF, STIFF_TURN = o["STIFF"], o["STIFF_TURN"]
    STRETCH, RATE, RADIUS, TENSION, LENGTH, JOINT_LENGTH = (
        o[k] for k in ("STRETCH", "RATE", "RADIUS", "TENSION", "LENGTH", "JOINT_LENGTH")
    )
    CORD_AREA, NODE_MOBILITY, MOBILITY1 = o["CORD_AREA"], o["NODE_MOBILITY"], o["MOBILITY1"]
    DIAGONAL, DIAGONAL_TURN, COUPLING = o["DIAGONAL"], o["DIAGONAL_TURN"], o["COUPLING"]
    IMPULSE, IMPULSE1, IMPULSE2, IMPULSE3 = (o[k] for k in ("IMPULSE", "IMPULSE1", "IMPULSE2", "IMPULSE3"))

    @kernel
    def measure(b, n, nu, law, elastic):
        # The tip's joint has no curvature of its own: the last element takes that of its inner end.
        q = n + ONE
        b[K1 + q], b[K2 + q], b[K3 + q] = b[K1 + n], b[K2 + n], b[K3 + n]
        b[KRATE1 + q], b[KRATE2 + q], b[KRATE3 + q] = b[KRATE1 + n], b[KRATE2 + n], b[KRATE3 + n]
        q = ONE - ONE
        b[KRATE1 + q], b[KRATE2 + q], b[KRATE3 + q] = b[KRATE1 + ONE], b[KRATE2 + ONE], b[KRATE3 + ONE]
        for k in range(ONE, n + ONE):
            q = k + ONE
            b[MEAN1 + k], b[MEANRATE1 + k] = 0.5 * (b[K1 + k] + b[K1 + q]), 0.5 * (b[KRATE1 + k] + b[KRATE1 + q])
            b[MEAN2 + k], b[MEANRATE2 + k] = 0.5 * (b[K2 + k] + b[K2 + q]), 0.5 * (b[KRATE2 + k] + b[KRATE2 + q])
            b[MEAN3 + k], b[MEANRATE3 + k] = 0.5 * (b[K3 + k] + b[K3 + q]), 0.5 * (b[KRATE3 + k] + b[KRATE3 + q])
            e = b[STRETCH + k]
            # e^-nu from the series of log e in (e - 1)/(e + 1) and of exp: 1e-8 between stretches of 0.5 and 2, without a library call.
            z = (e - 1) / (e + 1)
            y = z * z
            log = 2 * z * (1 + y * (1 / 3 + y * (1 / 5 + y * (1 / 7 + y * (1 / 9 + y * (1 / 11 + y / 13))))))
            x = -nu * log
            b[RADIUS + k] = 1 + x * (1 + x * (1 / 2 + x * (1 / 6 + x * (1 / 24 + x * (1 / 120 + x * (1 / 720 + x / 5040))))))
            area = b[CORD_AREA + k] / e
            b[TENSION + k] = area * passive_stress(law, e)
            b[STIFF + k] = area * elastic * law.tangent
            b[MOMENT1 + k] = 0.0
            b[MOMENT2 + k] = 0.0
            b[MOMENT3 + k] = 0.0
            b[STIFF_TURN + k] = 0.0

    @kernel
    def apply(b, n):
        for k in range(ONE, n + ONE):
            p, q = k - ONE, k + ONE
            b[N1 + k] += b[TENSION + k] * b[T1 + k]
            b[N2 + k] += b[TENSION + k] * b[T2 + k]
            b[N3 + k] += b[TENSION + k] * b[T3 + k]
            here, before = 0.5 * b[LENGTH + k] / b[JOINT_LENGTH + k], 0.5 * b[LENGTH + p] / b[JOINT_LENGTH + k]
            # Fibres see the mean curvature of an element's two joints; its zigzag, which they miss, is braked with their own viscosity.
            brake = 0.25 * (here * b[STIFF_TURN + k] + before * b[STIFF_TURN + p])
            zigzag1 = brake * (2 * b[KRATE1 + k] - b[KRATE1 + p] - b[KRATE1 + q])
            zigzag2 = brake * (2 * b[KRATE2 + k] - b[KRATE2 + p] - b[KRATE2 + q])
            zigzag3 = brake * (2 * b[KRATE3 + k] - b[KRATE3 + p] - b[KRATE3 + q])
            b[M1 + k] += here * b[MOMENT1 + k] + before * b[MOMENT1 + p] + zigzag1
            b[M2 + k] += here * b[MOMENT2 + k] + before * b[MOMENT2 + p] + zigzag2
            b[M3 + k] += here * b[MOMENT3 + k] + before * b[MOMENT3 + p] + zigzag3

    @kernel
    def remember(b, n):
        for k in range(ONE, n + ONE):
            b[OLD1 + k], b[OLD2 + k], b[OLD3 + k] = b[W1 + k], b[W2 + k], b[W3 + k]

    @kernel
    def brake(b, n):
        for k in range(ONE, n + ONE):
            b[YIELD + k] = b[STRETCH + k] * b[MOBILITY1 + k]
            w1, w2, w3 = b[W1 + k] - b[OLD1 + k], b[W2 + k] - b[OLD2 + k], b[W3 + k] - b[OLD3 + k]
            b[SPIN1 + k] = b[Q11 + k] * w1 + b[Q21 + k] * w2 + b[Q31 + k] * w3
            b[SPIN2 + k] = b[Q12 + k] * w1 + b[Q22 + k] * w2 + b[Q32 + k] * w3
            b[SPIN3 + k] = b[Q13 + k] * w1 + b[Q23 + k] * w2 + b[Q33 + k] * w3
        for k in range(ONE, n + ONE):
            p, q = k - ONE, k + ONE
            length = b[LENGTH + k]
            b[DIAGONAL + k] = length / (MAJORANT * b[STIFF + k]) + b[NODE_MOBILITY + k] + b[NODE_MOBILITY + q]
            b[COUPLING + k] = -b[NODE_MOBILITY + q] * (b[T1 + k] * b[T1 + q] + b[T2 + k] * b[T2 + q] + b[T3 + k] * b[T3 + q])
            along = (
                b[T1 + k] * (b[V1 + q] - b[V1 + k]) + b[T2 + k] * (b[V2 + q] - b[V2 + k]) + b[T3 + k] * (b[V3 + q] - b[V3 + k])
            )  # fmt: skip
            b[IMPULSE + k] = along - b[RATE + k] * length
            joint = b[JOINT_LENGTH + k]
            turn = 0.5 * MAJORANT * (length * b[STIFF_TURN + k] + b[LENGTH + p] * b[STIFF_TURN + p])
            b[DIAGONAL_TURN + k] = joint * joint / turn + b[YIELD + k] + b[YIELD + p]
            b[IMPULSE1 + k] = b[SPIN1 + k] - b[SPIN1 + p]
            b[IMPULSE2 + k] = b[SPIN2 + k] - b[SPIN2 + p]
            b[IMPULSE3 + k] = b[SPIN3 + k] - b[SPIN3 + p]

    @kernel
    def relax(b, n):
        # Symmetric tridiagonal systems; the off-diagonals to the next unknown are COUPLING, and -YIELD of the element between two joints.
        scale, turn_scale, f, f1, f2, f3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(ONE, n + ONE):
            p = k - ONE
            coupling, turn = b[COUPLING + p], -b[YIELD + p]
            scale = 1 / (b[DIAGONAL + k] - coupling * coupling * scale)
            turn_scale = 1 / (b[DIAGONAL_TURN + k] - turn * turn * turn_scale)
            f = scale * (b[IMPULSE + k] - coupling * f)
            f1 = turn_scale * (b[IMPULSE1 + k] - turn * f1)
            f2 = turn_scale * (b[IMPULSE2 + k] - turn * f2)
            f3 = turn_scale * (b[IMPULSE3 + k] - turn * f3)
            b[DIAGONAL + k], b[DIAGONAL_TURN + k] = scale, turn_scale
            b[IMPULSE + k], b[IMPULSE1 + k], b[IMPULSE2 + k], b[IMPULSE3 + k] = f, f1, f2, f3
        k = n - ONE
        while k >= ONE:
            turn = b[DIAGONAL_TURN + k] * b[YIELD + k]
            f = b[IMPULSE + k] - b[DIAGONAL + k] * b[COUPLING + k] * f
            f1, f2, f3 = b[IMPULSE1 + k] + turn * f1, b[IMPULSE2 + k] + turn * f2, b[IMPULSE3 + k] + turn * f3
            b[IMPULSE + k], b[IMPULSE1 + k], b[IMPULSE2 + k], b[IMPULSE3 + k] = f, f1, f2, f3
            k -= ONE
        for k in range(ONE, n + ONE + ONE):
            p = k - ONE
            mobility, here, before = b[NODE_MOBILITY + k], b[IMPULSE + k], b[IMPULSE + p]
            b[V1 + k] += mobility * (here * b[T1 + k] - before * b[T1 + p])
            b[V2 + k] += mobility * (here * b[T2 + k] - before * b[T2 + p])
            b[V3 + k] += mobility * (here * b[T3 + k] - before * b[T3 + p])
        for k in range(ONE, n + ONE):
            q = k + ONE
            s1 = b[YIELD + k] * (b[IMPULSE1 + q] - b[IMPULSE1 + k])
            s2 = b[YIELD + k] * (b[IMPULSE2 + q] - b[IMPULSE2 + k])
            s3 = b[YIELD + k] * (b[IMPULSE3 + q] - b[IMPULSE3 + k])
            b[W1 + k] += b[Q11 + k] * s1 + b[Q12 + k] * s2 + b[Q13 + k] * s3
            b[W2 + k] += b[Q21 + k] * s1 + b[Q22 + k] * s2 + b[Q23 + k] * s3
            b[W3 + k] += b[Q31 + k] * s1 + b[Q32 + k] * s2 + b[Q33 + k] * s3

    return measure, apply, remember, brake, relax
