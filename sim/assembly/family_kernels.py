"""Rods of the assembly: strains, muscle stress, internal forces, kick and implicit axial step, for open rods and for all rings at once.

Discretisation of Gazzola et al. (2018, R. Soc. Open Sci. 5:171628) as in `octoctrl.sim.rod.elastic_kernels`, but the axial force is the
muscle's and acts along the tangent t, with the stretch e = l / L; the director only carries shear:

    N = Q^T (S e t_1, S e t_2, 0) / e + A (sigma(e, e', a) + eta e') t / e,      torque (Q t x n) L with n = S e (t_1, t_2, 0)

with eta the viscosity of passive tissue. Along the director instead, an active rod would buckle in shear as soon as its stress exceeds
(4/3) G. The force-velocity law is linearly implicit: with Hill's secant c at the old rate the stress at the new rate is
isometric + c e'_new, so that it cannot change sign, and with a quarter of the step times the passive tangent the same system damps no
motion but removes the axial limit of the step. Viscosity is taken in the same way. Unknown are the increments of tension phi:

    (1 / G_k + w_k + w_{k+1}) phi_k - w_{k+1} t_k.t_{k+1} phi_{k+1} - w_k t_k.t_{k-1} phi_{k-1} = t_k.(dv_{k+1} - dv_k)

with G = A (c + eta + h K / 4) / (e L), the row VISCOSITY, and w the mobility of a node over one step: tridiagonal for an open rod, cyclic
for a ring (Sherman & Morrison 1950, Ann. Math. Stat. 21:124). The neighbour of an element stands `step` numbers away in its row: 1 for
open rods, the number of lanes for rings.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from ..physics.fibre_kernels import hill_secant, isometric_stress, passive_stress, passive_tangent
from ..physics.rotation_kernels import joint_curvature, orthonormal, small_rotation, turned
from .layout import AssemblyRow, stride_of

ONE = np.uint64(1)
NOTHING = 1e-30
"""Viscosity (kg/s) of what is no element."""


def family_offsets(grid: AssemblyGrid, rings: bool) -> Any:
    """Unsigned offsets of the rows of the open rods or of the rings in the one buffer."""
    open_stride = stride_of(grid.open_slots, grid.lanes)
    start, stride = (rings_begin(grid), stride_of(grid.ring_slots, grid.lanes)) if rings else (0, open_stride)
    return {row.name: np.uint64(start + row * stride) for row in AssemblyRow}


def rings_begin(grid: AssemblyGrid) -> Any:
    """Where the rings' rows begin: so that their first node, which stands behind a slot, begins with a cache line in either precision."""
    return len(AssemblyRow) * stride_of(grid.open_slots, grid.lanes) + grid.lanes % 16


def position_kernels(grid: AssemblyGrid, rings: bool) -> Any:
    """Compile what needs positions to their last digit.

    In single precision a position is a sum X + LOW of two numbers: a step would else be lost in the rounding of the whole.

    Returns
    -------
    apart, advance : compiled functions
        ``apart(buffer, q, k)`` gives the vector from node k to node q, ``advance(buffer, k, h)`` moves a node on with its velocity.
    """
    o, single = family_offsets(grid, rings), grid.single
    X1, X2, X3, V1, V2, V3, LOW1, LOW2, LOW3 = (o[f"{name}{i}"] for name in ("X", "V", "LOW") for i in (1, 2, 3))

    @kernel
    def apart(b: Any, q: Any, k: Any) -> Any:
        d1, d2, d3 = b[X1 + q] - b[X1 + k], b[X2 + q] - b[X2 + k], b[X3 + q] - b[X3 + k]
        if single:
            d1, d2, d3 = d1 + (b[LOW1 + q] - b[LOW1 + k]), d2 + (b[LOW2 + q] - b[LOW2 + k]), d3 + (b[LOW3 + q] - b[LOW3 + k])
        return d1, d2, d3

    @kernel
    def advance(b: Any, k: Any, h: Any) -> None:
        if single:
            x1, x2, x3 = b[X1 + k], b[X2 + k], b[X3 + k]
            y1, y2, y3 = h * b[V1 + k] + b[LOW1 + k], h * b[V2 + k] + b[LOW2 + k], h * b[V3 + k] + b[LOW3 + k]
            z1, z2, z3 = x1 + y1, x2 + y2, x3 + y3
            b[X1 + k], b[X2 + k], b[X3 + k] = z1, z2, z3
            b[LOW1 + k], b[LOW2 + k], b[LOW3 + k] = y1 - (z1 - x1), y2 - (z2 - x2), y3 - (z3 - x3)
        else:
            b[X1 + k] += h * b[V1 + k]
            b[X2 + k] += h * b[V2 + k]
            b[X3 + k] += h * b[V3 + k]

    return apart, advance


def family_kernels(grid: AssemblyGrid, rings: bool, graded: bool = False, plain: bool = False) -> Any:
    """Compile the kernels of one family of rods.

    Parameters
    ----------
    grid : AssemblyGrid
    rings : bool
        Whether the family is the rings, or the open rods.
    graded : bool
        Whether its elements differ in strength and pace (rows of that name).
    plain : bool
        Whether no connection turns its elements (rows C are not read), and what damping leaves of a node's velocity is kept by the kick, in
        the rows MMINUS, which have served the spin by then.

    Returns
    -------
    dict of str to compiled function
        ``drift, straighten, strain, bend, kick, spin, axial, elongate, correct`` take ``(buffer, first, last, ...)``, indices within a
        row; ``straighten`` makes frames orthonormal again, of which rounding in single precision takes 6e-4 in a second; ``elongate`` sets
        the rates to those of the velocities now.
    """
    o = family_offsets(grid, rings)
    step = np.uint64(grid.lanes if rings else 1)
    apart, advance = position_kernels(grid, rings)
    V1, V2, V3 = (o[name] for name in ("V1", "V2", "V3"))
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    W1, W2, W3, T1, T2, T3, N1, N2, N3 = (o[f"{field}{i}"] for field in "WTN" for i in (1, 2, 3))
    F1, F2, F3, C1, C2, C3 = (o[f"{field}{i}"] for field in "FC" for i in (1, 2, 3))
    TORQUE1, TORQUE2, TORQUE3, REST1, REST2, REST3 = (o[f"{field}{i}"] for field in ("TORQUE", "REST") for i in (1, 2, 3))
    P1, P2, P3, R1, R2, R3 = (o[f"{field}{i}"] for field in ("MPLUS", "MMINUS") for i in (1, 2, 3))
    LENGTH, INVERSE_LENGTH, SHEAR, AREA, STRETCH, RATE = (o[k] for k in "LENGTH INVERSE_LENGTH SHEAR AREA STRETCH RATE".split())
    JOINT_LENGTH, INVERSE_JOINT, BEND, TWIST = (o[k] for k in ("JOINT_LENGTH", "INVERSE_JOINT", "BEND", "TWIST"))
    LEVEL_BEFORE, LEVEL_AFTER = o["LEVEL_BEFORE"], o["LEVEL_AFTER"]
    STRENGTH, PACE = o["STRENGTH"], o["PACE"]
    NODE_DECAY, NODE_MOBILITY, BEND_DECAY, TWIST_DECAY = (o[k] for k in ("NODE_DECAY", "NODE_MOBILITY", "BEND_DECAY", "TWIST_DECAY"))
    BEND_MOBILITY, TWIST_MOBILITY, BEND_INERTIA, TWIST_INERTIA = (
        o[k] for k in ("BEND_MOBILITY", "TWIST_MOBILITY", "BEND_INERTIA", "TWIST_INERTIA")
    )
    VISCOSITY, SCALE, IMPULSE, CORRECTION = (o[k] for k in ("VISCOSITY", "SCALE", "IMPULSE", "CORRECTION"))

    @kernel
    def drift(b: Any, first: Any, last: Any, h: Any) -> None:
        for k in range(first, last):
            advance(b, k, h)
            u1, u2, u3 = h * b[W1 + k], h * b[W2 + k], h * b[W3 + k]
            r = small_rotation(u1, u2, u3)
            b[Q11 + k], b[Q21 + k], b[Q31 + k] = turned(r, b[Q11 + k], b[Q21 + k], b[Q31 + k])
            b[Q12 + k], b[Q22 + k], b[Q32 + k] = turned(r, b[Q12 + k], b[Q22 + k], b[Q32 + k])
            b[Q13 + k], b[Q23 + k], b[Q33 + k] = turned(r, b[Q13 + k], b[Q23 + k], b[Q33 + k])

    @kernel
    def straighten(b: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            frame = orthonormal(
                b[Q11 + k], b[Q12 + k], b[Q13 + k], b[Q21 + k], b[Q22 + k], b[Q23 + k], b[Q31 + k], b[Q32 + k], b[Q33 + k]
            )  # fmt: skip
            b[Q11 + k], b[Q12 + k], b[Q13 + k], b[Q21 + k], b[Q22 + k], b[Q23 + k], b[Q31 + k], b[Q32 + k], b[Q33 + k] = frame

    @kernel
    def strain(b: Any, first: Any, last: Any, share: Any, elastic: Any, law: Any) -> None:
        for k in range(first, last):
            q = k + step
            d1, d2, d3 = apart(b, q, k)
            length = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
            inverse = 1.0 / length
            t1, t2, t3 = d1 * inverse, d2 * inverse, d3 * inverse
            rest, per_rest = b[LENGTH + k], b[INVERSE_LENGTH + k]
            stretch, unstretch = length * per_rest, rest * inverse
            u1, u2, u3 = b[V1 + q] - b[V1 + k], b[V2 + q] - b[V2 + k], b[V3 + q] - b[V3 + k]
            rate = (t1 * u1 + t2 * u2 + t3 * u3) * per_rest
            level = b[LEVEL_BEFORE + k] + share * (b[LEVEL_AFTER + k] - b[LEVEL_BEFORE + k])
            strength, pace = (b[STRENGTH + k], b[PACE + k]) if graded else (1.0, 1.0)
            isometric = strength * level * isometric_stress(law, stretch)
            viscosity = law.viscosity + pace * isometric * hill_secant(law, pace * rate)
            stress = (strength if stretch > 1.0 else 1.0) * passive_stress(law, stretch) + isometric + viscosity * rate
            area = b[AREA + k]
            b[VISCOSITY + k] = area * (viscosity + elastic * passive_tangent(law, stretch)) * inverse
            m1 = b[Q11 + k] * t1 + b[Q12 + k] * t2 + b[Q13 + k] * t3
            m2 = b[Q21 + k] * t1 + b[Q22 + k] * t2 + b[Q23 + k] * t3
            m3 = b[Q31 + k] * t1 + b[Q32 + k] * t2 + b[Q33 + k] * t3
            s1, s2 = b[SHEAR + k] * m1, b[SHEAR + k] * m2
            tension = area * stress * unstretch
            b[STRETCH + k], b[RATE + k] = stretch, rate
            b[T1 + k], b[T2 + k], b[T3 + k] = t1, t2, t3
            b[N1 + k] = b[Q11 + k] * s1 + b[Q21 + k] * s2 + tension * t1
            b[N2 + k] = b[Q12 + k] * s1 + b[Q22 + k] * s2 + tension * t2
            b[N3 + k] = b[Q13 + k] * s1 + b[Q23 + k] * s2 + tension * t3
            w1, w2, w3 = b[W1 + k], b[W2 + k], b[W3 + k]
            bending, twisting = b[BEND_INERTIA + k] * unstretch, b[TWIST_INERTIA + k] * unstretch
            # The gyroscopic torque, of which a round section has none about its axis.
            swelling, gyro = rate * unstretch, (bending - twisting) * w3
            b[TORQUE1 + k] = -m3 * s2 * length + gyro * w2 + bending * swelling * w1
            b[TORQUE2 + k] = m3 * s1 * length - gyro * w1 + bending * swelling * w2
            b[TORQUE3 + k] = (m1 * s2 - m2 * s1) * length + twisting * swelling * w3

    @kernel
    def bend(b: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            p = k - step
            joint, inverse = b[JOINT_LENGTH + k], b[INVERSE_JOINT + k]
            k1, k2, k3 = joint_curvature(
                b[Q11 + p], b[Q12 + p], b[Q13 + p], b[Q21 + p], b[Q22 + p], b[Q23 + p], b[Q31 + p], b[Q32 + p], b[Q33 + p],
                b[Q11 + k], b[Q12 + k], b[Q13 + k], b[Q21 + k], b[Q22 + k], b[Q23 + k], b[Q31 + k], b[Q32 + k], b[Q33 + k],
                inverse,
            )  # fmt: skip
            swell = 0.5 * (b[STRETCH + k] * b[LENGTH + k] + b[STRETCH + p] * b[LENGTH + p]) * inverse
            soften = 1.0 / (swell * swell * swell)
            bending, twisting = b[BEND + k] * soften, b[TWIST + k] * soften
            m1, m2, m3 = bending * (k1 - b[REST1 + k]), bending * (k2 - b[REST2 + k]), twisting * (k3 - b[REST3 + k])
            half = 0.5 * joint
            k1, k2, k3 = k1 * half, k2 * half, k3 * half
            a1, a2, a3 = k2 * m3 - k3 * m2, k3 * m1 - k1 * m3, k1 * m2 - k2 * m1
            b[P1 + k], b[P2 + k], b[P3 + k] = m1 + a1, m2 + a2, m3 + a3
            b[R1 + k], b[R2 + k], b[R3 + k] = m1 - a1, m2 - a2, m3 - a3

    @kernel
    def kick(b: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            p = k - step
            decay, mobility = b[NODE_DECAY + k], b[NODE_MOBILITY + k]
            v1, v2, v3 = decay * b[V1 + k], decay * b[V2 + k], decay * b[V3 + k]
            if plain:
                b[R1 + k], b[R2 + k], b[R3 + k] = v1, v2, v3
            b[V1 + k] = v1 + mobility * (b[N1 + k] - b[N1 + p] + b[F1 + k])
            b[V2 + k] = v2 + mobility * (b[N2 + k] - b[N2 + p] + b[F2 + k])
            b[V3 + k] = v3 + mobility * (b[N3 + k] - b[N3 + p] + b[F3 + k])

    @kernel
    def spin(b: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            q = k + step
            bend_decay, bend_mobility = b[BEND_DECAY + k], b[BEND_MOBILITY + k] * b[STRETCH + k]
            torque1 = b[P1 + q] - b[R1 + k] + b[TORQUE1 + k]
            torque2 = b[P2 + q] - b[R2 + k] + b[TORQUE2 + k]
            torque3 = b[P3 + q] - b[R3 + k] + b[TORQUE3 + k]
            if not plain:
                c1, c2, c3 = b[C1 + k], b[C2 + k], b[C3 + k]
                torque1 = torque1 + b[Q11 + k] * c1 + b[Q12 + k] * c2 + b[Q13 + k] * c3
                torque2 = torque2 + b[Q21 + k] * c1 + b[Q22 + k] * c2 + b[Q23 + k] * c3
                torque3 = torque3 + b[Q31 + k] * c1 + b[Q32 + k] * c2 + b[Q33 + k] * c3
            b[W1 + k] = bend_decay * b[W1 + k] + bend_mobility * torque1
            b[W2 + k] = bend_decay * b[W2 + k] + bend_mobility * torque2
            b[W3 + k] = b[TWIST_DECAY + k] * b[W3 + k] + b[TWIST_MOBILITY + k] * b[STRETCH + k] * torque3

    @kernel
    def axial(b: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            q = k + step
            t1, t2, t3 = b[T1 + k], b[T2 + k], b[T3 + k]
            along = t1 * (b[V1 + q] - b[V1 + k]) + t2 * (b[V2 + q] - b[V2 + k]) + t3 * (b[V3 + q] - b[V3 + k])
            b[SCALE + k] = 1.0 / (b[VISCOSITY + k] + NOTHING) + b[NODE_MOBILITY + k] + b[NODE_MOBILITY + q]
            b[CORRECTION + k] = -b[NODE_MOBILITY + q] * (t1 * b[T1 + q] + t2 * b[T2 + q] + t3 * b[T3 + q])
            b[IMPULSE + k] = along - b[RATE + k] * b[LENGTH + k]

    @kernel
    def elongate(b: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            q = k + step
            d1, d2, d3 = b[V1 + q] - b[V1 + k], b[V2 + q] - b[V2 + k], b[V3 + q] - b[V3 + k]
            b[RATE + k] = (b[T1 + k] * d1 + b[T2 + k] * d2 + b[T3 + k] * d3) * b[INVERSE_LENGTH + k]

    @kernel
    def correct(b: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            p = k - step
            mobility, here, before = b[NODE_MOBILITY + k], b[IMPULSE + k], b[IMPULSE + p]
            b[V1 + k] += mobility * (here * b[T1 + k] - before * b[T1 + p])
            b[V2 + k] += mobility * (here * b[T2 + k] - before * b[T2 + p])
            b[V3 + k] += mobility * (here * b[T3 + k] - before * b[T3 + p])

    return {
        "drift": drift,
        "straighten": straighten,
        "strain": strain,
        "bend": bend,
        "kick": kick,
        "spin": spin,
        "axial": axial,
        "elongate": elongate,
        "correct": correct,
    }


def ring_solver(grid: AssemblyGrid) -> Any:
    """Compile the cyclic solver of the rings of a part, and the copies of their seam; all take ``(buffer, part)``."""
    o, lanes, nodes = family_offsets(grid, True), grid.lanes, grid.ring_nodes
    SCALE, IMPULSE, CORRECTION, CYCLE = o["SCALE"], o["IMPULSE"], o["CORRECTION"], o["RATE"]
    seam_before = tuple(o[name] for name in ("STRETCH", "T1", "T2", "T3", "N1", "N2", "N3"))
    width, end = np.uint64(lanes), np.uint64(nodes * lanes)

    @kernel
    def solve(b: Any, part: Any) -> None:
        # RATE is not needed any more and holds the second right-hand side.
        for i in range(part.low, part.high):
            k, last = width + i, end + i
            corner, head = b[CORRECTION + last], b[SCALE + k]
            scale = 1.0 / (2.0 * head)
            b[SCALE + last] += corner * corner / head
            b[SCALE + k], b[IMPULSE + k], b[CYCLE + k] = scale, scale * b[IMPULSE + k], -0.5
        for node in range(np.uint64(2), np.uint64(nodes + 1)):
            base = node * width
            for i in range(part.low, part.high):
                k = base + i
                p = k - width
                coupling = b[CORRECTION + p]
                scale = 1.0 / (b[SCALE + k] - coupling * coupling * b[SCALE + p])
                b[SCALE + k] = scale
                b[IMPULSE + k] = scale * (b[IMPULSE + k] - coupling * b[IMPULSE + p])
                b[CYCLE + k] = -scale * coupling * b[CYCLE + p]
        for i in range(part.low, part.high):
            b[CYCLE + end + i] += b[SCALE + end + i] * b[CORRECTION + end + i]
        place = np.uint64(nodes - 1)
        while place >= ONE:
            base = place * width
            for i in range(part.low, part.high):
                k = base + i
                q = k + width
                back = b[SCALE + k] * b[CORRECTION + k]
                b[IMPULSE + k] -= back * b[IMPULSE + q]
                b[CYCLE + k] -= back * b[CYCLE + q]
            place -= ONE
        for i in range(part.low, part.high):
            k, last = width + i, end + i
            # u = (-d, 0, ..., c), v = (1, 0, ..., -c / d) with d the first diagonal, which the first pivot still holds.
            ratio = -2.0 * b[CORRECTION + last] * b[SCALE + k]
            top = b[IMPULSE + k] + ratio * b[IMPULSE + last]
            b[SCALE + i] = top / (1.0 + b[CYCLE + k] + ratio * b[CYCLE + last])
        for node in range(ONE, np.uint64(nodes + 1)):
            base = node * width
            for i in range(part.low, part.high):
                b[IMPULSE + base + i] -= b[SCALE + i] * b[CYCLE + base + i]
        for i in range(part.low, part.high):
            b[IMPULSE + i] = b[IMPULSE + end + i]

    low = ("LOW1", "LOW2", "LOW3") if grid.single else ()
    first_rows = tuple(o[name] for name in ("X1", "X2", "X3", "V1", "V2", "V3", *low))
    turn_rows = tuple(o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    after_rows = tuple(o[name] for name in ("T1", "T2", "T3", "MPLUS1", "MPLUS2", "MPLUS3"))
    speed_rows = tuple(o[name] for name in ("V1", "V2", "V3"))
    seam = np.uint64(nodes * lanes)

    @kernel
    def close_state(b: Any, part: Any) -> None:
        for row in first_rows:
            for i in range(part.low, part.high):
                b[row + seam + width + i] = b[row + width + i]
        for row in turn_rows:
            for i in range(part.low, part.high):
                b[row + i] = b[row + seam + i]

    @kernel
    def close_strain(b: Any, part: Any) -> None:
        for row in seam_before:
            for i in range(part.low, part.high):
                b[row + i] = b[row + seam + i]

    @kernel
    def close_moment(b: Any, part: Any) -> None:
        for row in after_rows:
            for i in range(part.low, part.high):
                b[row + seam + width + i] = b[row + width + i]

    @kernel
    def close_speed(b: Any, part: Any) -> None:
        for row in speed_rows:
            for i in range(part.low, part.high):
                b[row + seam + width + i] = b[row + width + i]

    return solve, close_state, close_strain, close_moment, close_speed


def ring_spin_brake(grid: AssemblyGrid) -> Any:
    """Compile ``brake(buffer, part, share)``: take away a share of each ring element's spin relative to the mean spin of its ring.

    The orientation lock of ring and muscle turns ring elements with a couple that does not know their frame, which feeds a flutter of
    single elements. Damping against the ring's own mean, not the laboratory, leaves the twisting of the arm as it is.
    """
    o, lanes, nodes = family_offsets(grid, True), grid.lanes, grid.ring_nodes
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    W1, W2, W3, MEAN1, MEAN2, MEAN3 = (o[k] for k in ("W1", "W2", "W3", "SCALE", "IMPULSE", "CORRECTION"))
    width, last, each = np.uint64(lanes), np.uint64(nodes + 1), 1 / nodes

    @kernel
    def brake(b: Any, part: Any, share: Any) -> None:
        for i in range(part.low, part.high):
            b[MEAN1 + i], b[MEAN2 + i], b[MEAN3 + i] = 0.0, 0.0, 0.0
        for node in range(ONE, last):
            base = node * width
            for i in range(part.low, part.high):
                k = base + i
                w1, w2, w3 = each * b[W1 + k], each * b[W2 + k], each * b[W3 + k]
                b[MEAN1 + i] += b[Q11 + k] * w1 + b[Q21 + k] * w2 + b[Q31 + k] * w3
                b[MEAN2 + i] += b[Q12 + k] * w1 + b[Q22 + k] * w2 + b[Q32 + k] * w3
                b[MEAN3 + i] += b[Q13 + k] * w1 + b[Q23 + k] * w2 + b[Q33 + k] * w3
        for node in range(ONE, last):
            base = node * width
            for i in range(part.low, part.high):
                k = base + i
                m1, m2, m3 = b[MEAN1 + i], b[MEAN2 + i], b[MEAN3 + i]
                b[W1 + k] -= share * (b[W1 + k] - b[Q11 + k] * m1 - b[Q12 + k] * m2 - b[Q13 + k] * m3)
                b[W2 + k] -= share * (b[W2 + k] - b[Q21 + k] * m1 - b[Q22 + k] * m2 - b[Q23 + k] * m3)
                b[W3 + k] -= share * (b[W3 + k] - b[Q31 + k] * m1 - b[Q32 + k] * m2 - b[Q33 + k] * m3)

    return brake


def cord_brake(grid: AssemblyGrid) -> Any:
    """Compile ``brake(buffer, part, share)``: take away a share of each cord node's velocity relative to the muscles around it.

    Impulses are equal and opposite, so momentum stays. The cord has no water around it and nothing else that dissipates, and the pressure,
    which follows its axis, feeds a flutter of the buckled cord.
    """
    o = family_offsets(grid, False)
    MOBILITY, velocities = o["NODE_MOBILITY"], tuple(o[f"V{i}"] for i in (1, 2, 3))
    width, stop = np.uint64(grid.lanes), np.uint64(grid.straight_rods * grid.lanes)
    each = 1 / grid.spokes

    @kernel
    def brake(b: Any, part: Any, share: Any) -> None:
        # The first node is held, or slides in its plane as those of the muscles do.
        for row in velocities:
            for k in range(part.node + ONE if part.before == 0 else part.node, part.behind):
                mean = 0.0
                for rod in range(width, stop, width):
                    mean += b[row + rod + k]
                impulse = share * (b[row + k] - each * mean) / (b[MOBILITY + k] + each * b[MOBILITY + width + k])
                b[row + k] -= b[MOBILITY + k] * impulse
                gain = each * b[MOBILITY + width + k] * impulse
                for rod in range(width, stop, width):
                    b[row + rod + k] += gain

    return brake
