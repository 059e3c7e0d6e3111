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

Contact reads the velocities that this step leaves, and what its impulses add to them goes through the same systems once more. With the
velocities before it, whose rough part is far too large, what contact holds would depend on the arm's forces by a matrix that is not
symmetric; then elasticity feeds a flutter, and no grasp is ever at rest.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..body.layout import MuscleLayout
from ..compiler import kernel
from ..contracts import Floats
from ..physics.fibre_kernels import LawConstants, hill_secant, isometric_stress, passive_stress
from .layout import offsets

ONE = np.uint64(1)
MAJORANT = 1.0
"""Factor on the diagonal viscosity bounds. At one the step is stable: the fibres couple two blocks, stretch and spin, so that the sum of
the blocks is at least half of the whole. What the bound exceeds the true viscosity by delays the viscous stress by about one step."""
DISSIPATION = 0.1
"""Share of the implicit elastic term that also brakes the old stretch rate. Without it an arm whose passive fibres are pulled over their
slack within few steps, such as one let go at 1.3 times its length, keeps trembling at the step's scale; tips of the usual programmes move
by less than 0.02 % of the length through it."""


def fibre_kernels(stride: int) -> tuple[Callable[..., Any], ...]:
    """Compile the active part of each kind of fibre for buffers of the given stride; `section_kernels` has the passive part.

    Parameters
    ----------
    stride : int

    Returns
    -------
    longitudinal, oblique, transverse : compiled functions
        They add to TENSION, MOMENT1..3 and the STIFF rows, each for one muscle group: ``(buffer, n, sine, cosine, law)``,
        ``(buffer, n, winding, law)`` and ``(buffer, n, law)``. Activation is read from the LEVEL row.
    """
    o = offsets(stride)
    LEVEL, STRETCH, RATE, RADIUS, SHRINK, TENSION = (o[k] for k in ("LEVEL", "STRETCH", "RATE", "RADIUS", "SHRINK", "TENSION"))
    MEAN1, MEAN2, MEAN3 = (o[f"MEAN{i}"] for i in (1, 2, 3))
    MEANRATE1, MEANRATE2, MEANRATE3 = (o[f"MEANRATE{i}"] for i in (1, 2, 3))
    MOMENT1, MOMENT2, MOMENT3 = (o[f"MOMENT{i}"] for i in (1, 2, 3))
    STIFF, STIFF_TURN = o["STIFF"], o["STIFF_TURN"]
    OFFSET, HELIX, LONGITUDINAL_AREA, RING_AREA = (o[k] for k in ("OFFSET", "HELIX", "LONGITUDINAL_AREA", "RING_AREA"))
    OBLIQUE_AREA, OBLIQUE_REST = o["OBLIQUE_AREA"], o["OBLIQUE_REST"]

    @kernel
    def longitudinal(b: Floats, n: np.uint64, sine: float, cosine: float, law: LawConstants) -> None:
        for k in range(ONE, n + ONE):
            rho = b[OFFSET + k] * b[RADIUS + k]
            r1, r2 = rho * sine, rho * cosine
            bend, y = b[MEAN1 + k] * r2 - b[MEAN2 + k] * r1, b[MEAN3 + k] * rho
            x = b[STRETCH + k] + bend
            square = x * x + y * y
            inverse = 1 / np.sqrt(square)
            x0 = x + b[SHRINK + k] * (x * bend + y * y)
            rate = inverse * (x0 * b[RATE + k] + x * (b[MEANRATE1 + k] * r2 - b[MEANRATE2 + k] * r1) + y * rho * b[MEANRATE3 + k])
            isometric = b[LEVEL + k] * isometric_stress(law, square * inverse)
            viscosity = isometric * hill_secant(law, rate)
            area = b[LONGITUDINAL_AREA + k] * inverse
            tension, stiff = area * (isometric + viscosity * rate) * inverse, area * viscosity
            b[TENSION + k] += tension * x0
            b[MOMENT1 + k] += tension * x * r2
            b[MOMENT2 + k] -= tension * x * r1
            b[MOMENT3 + k] += tension * y * rho
            x0 *= inverse
            b[STIFF + k] += stiff * x0 * x0
            b[STIFF_TURN + k] += stiff * rho * rho

    @kernel
    def oblique(b: Floats, n: np.uint64, winding: float, law: LawConstants) -> None:
        for k in range(ONE, n + ONE):
            rho = b[HELIX + k] * b[RADIUS + k]
            e, rest = b[STRETCH + k], b[OBLIQUE_REST + k]
            turn = rho * (winding + b[MEAN3 + k])
            square = e * e + turn * turn
            inverse = 1 / np.sqrt(square)
            l0 = (e + turn * turn * b[SHRINK + k]) * inverse
            l3 = turn * rho * inverse
            unrest = 1 / rest
            rate = (l0 * b[RATE + k] + l3 * b[MEANRATE3 + k]) * unrest
            isometric = b[LEVEL + k] * isometric_stress(law, square * inverse * unrest)
            viscosity = isometric * hill_secant(law, rate)
            area = b[OBLIQUE_AREA + k] * inverse
            tension, stiff = area * rest * (isometric + viscosity * rate), area * viscosity
            b[TENSION + k] += tension * l0
            b[MOMENT3 + k] += tension * l3
            b[STIFF + k] += stiff * l0 * l0
            b[STIFF_TURN + k] += stiff * l3 * l3

    @kernel
    def transverse(b: Floats, n: np.uint64, law: LawConstants) -> None:
        for k in range(ONE, n + ONE):
            lam = b[RADIUS + k]
            slope = lam * b[SHRINK + k]
            rate = slope * b[RATE + k]
            isometric = b[LEVEL + k] * isometric_stress(law, lam)
            viscosity = isometric * hill_secant(law, rate)
            area = b[RING_AREA + k] * b[SHRINK + k]
            b[TENSION + k] += area * (isometric + viscosity * rate)
            b[STIFF + k] += area * viscosity * slope

    return longitudinal, oblique, transverse


def _around(places: tuple[tuple[float, float], ...]) -> Callable[..., Any]:
    """Compile the sum over longitudinal fibres at the `places` (sine, cosine), unrolled: one kernel per fibre, each calling the next.

    ``(e, y, r1, r2, shrink, law)`` gives tension over length per area, its products with x, with x along d1 and along d2, and the bounds of
    the squares of dl/dk and dl/de.
    """
    if not places:
        return _no_fibre
    before, (sine, cosine) = _around(places[:-1]), places[-1]

    @kernel(inline="always")
    def sums(e: float, y: float, r1: float, r2: float, shrink: float, law: LawConstants) -> tuple[float, float, float, float, float, float]:
        pull, along, bend1, bend2, turn, stiff = before(e, y, r1, r2, shrink, law)
        bend = cosine * r1 - sine * r2
        x = e + bend
        square = x * x + y * y
        inverse = 1 / np.sqrt(square)
        x0 = (x + shrink * (x * bend + y * y)) * inverse
        tension = passive_stress(law, square * inverse) * inverse * inverse
        push = tension * x
        return pull + tension, along + push, bend1 + cosine * push, bend2 + sine * push, turn + inverse, stiff + x0 * x0 * inverse

    return sums


@kernel(inline="always")
def _no_fibre(
    e: float, y: float, r1: float, r2: float, shrink: float, law: LawConstants
) -> tuple[float, float, float, float, float, float]:
    return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


def _coils(hands: tuple[int, ...]) -> Callable[..., Any]:
    """Compile the sum over the oblique families of the given `hands`, in the same way.

    ``(e, shrink, rho, twist, winding, rest, law)`` gives the work on stretch and on twist per area, and the bounds of both squares.
    """
    if not hands:
        return _no_coil
    before, hand = _coils(hands[:-1]), float(hands[-1])

    @kernel(inline="always")
    def sums(
        e: float, shrink: float, rho: float, twist: float, winding: float, rest: float, law: LawConstants
    ) -> tuple[float, float, float, float]:
        tension, moment, stiff, stiff_turn = before(e, shrink, rho, twist, winding, rest, law)
        turn = rho * (hand * winding + twist)
        square = e * e + turn * turn
        inverse = 1 / np.sqrt(square)
        l0, l3 = (e + turn * turn * shrink) * inverse, turn * rho * inverse
        pull = rest * inverse * passive_stress(law, square * inverse / rest)
        return tension + pull * l0, moment + pull * l3, stiff + inverse * l0 * l0, stiff_turn + inverse * l3 * l3

    return sums


@kernel(inline="always")
def _no_coil(
    e: float, shrink: float, rho: float, twist: float, winding: float, rest: float, law: LawConstants
) -> tuple[float, float, float, float]:
    return 0.0, 0.0, 0.0, 0.0


def section_kernels(stride: int, layout: MuscleLayout) -> tuple[Callable[..., Any], ...]:
    """Compile what surrounds the active fibres: section strains before, moments, forces and the implicit correction after.

    Parameters
    ----------
    stride : int
    layout : MuscleLayout

    Returns
    -------
    measure, straight, wound, apply, remember, brake, relax, keep, answer : compiled functions
        `measure` gives section strains; `straight` starts the sums with the passive stress of nerve cord and longitudinal fibres, `wound`
        adds that of oblique fibres and rings; `apply` hands tension and moments to the rod; `remember` keeps the old spins, `brake`
        prepares the two tridiagonal systems, `relax` solves them and corrects the velocities. `keep` keeps these velocities, and `answer`
        corrects in the same way what has been added to them since. `elastic` is the time (s) by which the elastic tangent is multiplied to
        join the viscosity.
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
    STRETCH, RATE, RADIUS, SHRINK, TENSION = (o[k] for k in ("STRETCH", "RATE", "RADIUS", "SHRINK", "TENSION"))
    LENGTH, JOINT_LENGTH, INVERSE_JOINT = (o[k] for k in ("LENGTH", "JOINT_LENGTH", "INVERSE_JOINT"))
    OFFSET, HELIX, LONGITUDINAL_AREA, RING_AREA = (o[k] for k in ("OFFSET", "HELIX", "LONGITUDINAL_AREA", "RING_AREA"))
    OBLIQUE_AREA, OBLIQUE_REST = o["OBLIQUE_AREA"], o["OBLIQUE_REST"]
    CORD_AREA, NODE_MOBILITY, MOBILITY1 = o["CORD_AREA"], o["NODE_MOBILITY"], o["MOBILITY1"]
    DIAGONAL, DIAGONAL_TURN, COUPLING = o["DIAGONAL"], o["DIAGONAL_TURN"], o["COUPLING"]
    IMPULSE, IMPULSE1, IMPULSE2, IMPULSE3 = (o[k] for k in ("IMPULSE", "IMPULSE1", "IMPULSE2", "IMPULSE3"))

    @kernel
    def measure(b: Floats, n: np.uint64, nu: float) -> None:
        # Beyond its centre the last element is straight. What its fibres see must be what their moment works on, half of the last joint:
        # were it the whole, their viscosity would feed a flutter of the tip.
        q = n + ONE
        b[K1 + q], b[K2 + q], b[K3 + q] = 0.0, 0.0, 0.0
        b[KRATE1 + q], b[KRATE2 + q], b[KRATE3 + q] = 0.0, 0.0, 0.0
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
            log = 2 * z * (1 + y * (1 / 3 + y * (1 / 5 + y * (1 / 7 + y * (1 / 9 + y * (1 / 11 + y * (1 / 13)))))))
            x = -nu * log
            b[RADIUS + k] = 1 + x * (1 + x * (1 / 2 + x * (1 / 6 + x * (1 / 24 + x * (1 / 120 + x * (1 / 720 + x * (1 / 5040)))))))
            b[SHRINK + k] = -nu / e

    around, coils = _around(tuple(group.place for group in layout.longitudinal)), _coils(tuple(group.hand for group in layout.oblique))

    @kernel
    def straight(b: Floats, n: np.uint64, law: LawConstants, elastic: float) -> None:
        # Nerve cord and longitudinal fibres without activation: they start the sums.
        for k in range(ONE, n + ONE):
            e, shrink = b[STRETCH + k], b[SHRINK + k]
            rho = b[OFFSET + k] * b[RADIUS + k]
            r1, r2, y = b[MEAN1 + k] * rho, b[MEAN2 + k] * rho, b[MEAN3 + k] * rho
            pull, along, bend1, bend2, turn, stiff = around(e, y, r1, r2, shrink, law)
            area = b[LONGITUDINAL_AREA + k]
            moment1, moment2, moment3 = area * rho * bend1, -area * rho * bend2, area * rho * y * pull
            b[MOMENT1 + k], b[MOMENT2 + k], b[MOMENT3 + k] = moment1, moment2, moment3
            work = b[MEAN1 + k] * moment1 + b[MEAN2 + k] * moment2 + b[MEAN3 + k] * moment3
            cord = b[CORD_AREA + k] / e
            b[TENSION + k] = area * along + shrink * work + cord * passive_stress(law, e)
            b[STIFF + k] = elastic * law.tangent * (area * stiff + cord)
            b[STIFF_TURN + k] = elastic * law.tangent * area * rho * rho * turn

    @kernel
    def wound(b: Floats, n: np.uint64, winding: float, law: LawConstants, transverse: LawConstants, elastic: float) -> None:
        # The oblique families and the rings, without activation.
        for k in range(ONE, n + ONE):
            lam, e, shrink = b[RADIUS + k], b[STRETCH + k], b[SHRINK + k]
            tension, moment, stiff, stiff_turn = coils(e, shrink, b[HELIX + k] * lam, b[MEAN3 + k], winding, b[OBLIQUE_REST + k], law)
            area = b[OBLIQUE_AREA + k]
            ring = b[RING_AREA + k] * shrink
            b[TENSION + k] += area * tension + ring * passive_stress(transverse, lam)
            b[MOMENT3 + k] += area * moment
            b[STIFF + k] += elastic * (law.tangent * area * stiff + transverse.tangent * ring * lam * shrink)
            b[STIFF_TURN + k] += elastic * law.tangent * area * stiff_turn
            b[TENSION + k] += DISSIPATION * b[STIFF + k] * b[RATE + k]

    @kernel
    def apply(b: Floats, n: np.uint64) -> None:
        for k in range(ONE, n + ONE):
            p, q = k - ONE, k + ONE
            b[N1 + k] += b[TENSION + k] * b[T1 + k]
            b[N2 + k] += b[TENSION + k] * b[T2 + k]
            b[N3 + k] += b[TENSION + k] * b[T3 + k]
            here, before = 0.5 * b[LENGTH + k] * b[INVERSE_JOINT + k], 0.5 * b[LENGTH + p] * b[INVERSE_JOINT + k]
            # Fibres see the mean curvature of an element's two joints; its zigzag, which they miss, is braked with their own viscosity,
            # each element's alike on both of its joints: weights by joint would not be symmetric and feed what they should brake.
            inner, outer = 0.5 * here * b[STIFF_TURN + k], 0.5 * before * b[STIFF_TURN + p]
            zigzag1 = inner * (b[KRATE1 + k] - b[KRATE1 + q]) + outer * (b[KRATE1 + k] - b[KRATE1 + p])
            zigzag2 = inner * (b[KRATE2 + k] - b[KRATE2 + q]) + outer * (b[KRATE2 + k] - b[KRATE2 + p])
            zigzag3 = inner * (b[KRATE3 + k] - b[KRATE3 + q]) + outer * (b[KRATE3 + k] - b[KRATE3 + p])
            b[M1 + k] += here * b[MOMENT1 + k] + before * b[MOMENT1 + p] + zigzag1
            b[M2 + k] += here * b[MOMENT2 + k] + before * b[MOMENT2 + p] + zigzag2
            b[M3 + k] += here * b[MOMENT3 + k] + before * b[MOMENT3 + p] + zigzag3

    @kernel
    def remember(b: Floats, n: np.uint64) -> None:
        for k in range(ONE, n + ONE):
            b[OLD1 + k], b[OLD2 + k], b[OLD3 + k] = b[W1 + k], b[W2 + k], b[W3 + k]

    @kernel
    def changes(b: Floats, n: np.uint64) -> None:
        # Of the spins since `remember`, in the laboratory frame.
        for k in range(ONE, n + ONE):
            w1, w2, w3 = b[W1 + k] - b[OLD1 + k], b[W2 + k] - b[OLD2 + k], b[W3 + k] - b[OLD3 + k]
            b[SPIN1 + k] = b[Q11 + k] * w1 + b[Q21 + k] * w2 + b[Q31 + k] * w3
            b[SPIN2 + k] = b[Q12 + k] * w1 + b[Q22 + k] * w2 + b[Q32 + k] * w3
            b[SPIN3 + k] = b[Q13 + k] * w1 + b[Q23 + k] * w2 + b[Q33 + k] * w3

    @kernel(inline="always")
    def closing(b: Floats, k: np.uint64) -> float:
        # Rate of an element's length.
        q = k + ONE
        return b[T1 + k] * (b[V1 + q] - b[V1 + k]) + b[T2 + k] * (b[V2 + q] - b[V2 + k]) + b[T3 + k] * (b[V3 + q] - b[V3 + k])

    @kernel
    def brake(b: Floats, n: np.uint64) -> None:
        changes(b, n)
        for k in range(ONE, n + ONE):
            b[YIELD + k] = b[STRETCH + k] * b[MOBILITY1 + k]
        for k in range(ONE, n + ONE):
            p, q = k - ONE, k + ONE
            length = b[LENGTH + k]
            b[DIAGONAL + k] = length / (MAJORANT * b[STIFF + k]) + b[NODE_MOBILITY + k] + b[NODE_MOBILITY + q]
            b[COUPLING + k] = -b[NODE_MOBILITY + q] * (b[T1 + k] * b[T1 + q] + b[T2 + k] * b[T2 + q] + b[T3 + k] * b[T3 + q])
            b[IMPULSE + k] = closing(b, k) - b[RATE + k] * length
            joint = b[JOINT_LENGTH + k]
            turn = 0.5 * MAJORANT * (length * b[STIFF_TURN + k] + b[LENGTH + p] * b[STIFF_TURN + p])
            b[DIAGONAL_TURN + k] = joint * joint / turn + b[YIELD + k] + b[YIELD + p]
            b[IMPULSE1 + k] = b[SPIN1 + k] - b[SPIN1 + p]
            b[IMPULSE2 + k] = b[SPIN2 + k] - b[SPIN2 + p]
            b[IMPULSE3 + k] = b[SPIN3 + k] - b[SPIN3 + p]

    @kernel
    def correct(b: Floats, n: np.uint64) -> None:
        # Back through the two systems, and to the velocities.
        f, f1, f2, f3 = b[IMPULSE + n], b[IMPULSE1 + n], b[IMPULSE2 + n], b[IMPULSE3 + n]
        j = n - ONE
        while j >= ONE:
            turn = b[DIAGONAL_TURN + j] * b[YIELD + j]
            f = b[IMPULSE + j] - b[DIAGONAL + j] * b[COUPLING + j] * f
            f1, f2, f3 = b[IMPULSE1 + j] + turn * f1, b[IMPULSE2 + j] + turn * f2, b[IMPULSE3 + j] + turn * f3
            b[IMPULSE + j], b[IMPULSE1 + j], b[IMPULSE2 + j], b[IMPULSE3 + j] = f, f1, f2, f3
            j -= ONE
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

    @kernel
    def relax(b: Floats, n: np.uint64) -> None:
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
        correct(b, n)

    @kernel
    def keep(b: Floats, n: np.uint64) -> None:
        remember(b, n)
        for k in range(ONE, n + ONE):
            b[IMPULSE + k] = closing(b, k)

    @kernel
    def answer(b: Floats, n: np.uint64) -> None:
        # `relax` has left the scales of its elimination where the diagonals were.
        changes(b, n)
        f, f1, f2, f3 = 0.0, 0.0, 0.0, 0.0
        for k in range(ONE, n + ONE):
            p, scale, turn_scale = k - ONE, b[DIAGONAL + k], b[DIAGONAL_TURN + k]
            f = scale * (closing(b, k) - b[IMPULSE + k] - b[COUPLING + p] * f)
            f1 = turn_scale * (b[SPIN1 + k] - b[SPIN1 + p] + b[YIELD + p] * f1)
            f2 = turn_scale * (b[SPIN2 + k] - b[SPIN2 + p] + b[YIELD + p] * f2)
            f3 = turn_scale * (b[SPIN3 + k] - b[SPIN3 + p] + b[YIELD + p] * f3)
            b[IMPULSE + k], b[IMPULSE1 + k], b[IMPULSE2 + k], b[IMPULSE3 + k] = f, f1, f2, f3
        correct(b, n)

    return measure, straight, wound, apply, remember, brake, relax, keep, answer
