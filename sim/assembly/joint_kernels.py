"""Connections of rings with muscles and with each other, as gradients of energies.

With q the ring node at a muscle, o the unit vector to it from the opposite node, h the unit vector between the nodes a quarter turn ahead
and behind, c from q to the centre of the muscle's element and w along it, from node to node:

    ring to muscle  U = 1/2 k |c + reach o|^2 + contact,     reach = ring's rest radius + r / sqrt(e)
    orientation     U = 3/8 K (w.h)^2 + 1/8 K (w.o + lean)^2,     lean what w inclines towards the axis at rest
    ring to ring    U = 1/2 k (s.(h_i + h_i+1) / 2)^2,     s from q of one ring to q of the next

Springs, contacts and constants are those of Tekinalp et al. (2024, SI), whose laws differ from these by turning no ring and by aiming at
places, so that they make and swallow energy. As each force here is the gradient of an energy that depends on nothing but differences, in
all its arguments, momentum and angular momentum stay, and what is put into a joint comes back. A ring neighbour is held against sliding
round the axis only: in the other directions muscles and rings are joined already.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from .family_kernels import family_offsets
from .parts import sweep
from .spoke_kernels import spoke_offsets

ONE = np.uint64(1)
RESULTS = ("F1", "F2", "F3", "T1", "T2", "T3", "SUM")
HINGE_SHARE, LEAN_SHARE = 0.75, 0.25
"""Shares of the published lock's stiffness that its linear part has in the two directions."""


def ring_joints(grid: AssemblyGrid) -> Any:
    """Compile the joints of the rings.

    Returns
    -------
    ring_muscle, ring_ring : compiled functions
        Of the buffer and a part, in this order, after `octoctrl.sim.assembly.side_kernels`; they fill the result rows of the spokes.
        Between the two all parts meet.
    """
    s = spoke_offsets(grid)
    quarter, half = np.uint64(grid.spokes // 4 * grid.lanes), np.uint64(grid.spokes // 2 * grid.lanes)
    S1, S2, S3, M1, M2, M3, D1, D2, D3, H1, H2, H3 = (s[f"{f}{i}"] for f in "SMDH" for i in (1, 2, 3))
    R_SPRING, R_TORQUE, R_LEAN, R_CONTACT, R_NEXT, R_EFFECTIVE, RADIUS, RING_RADIUS = (
        s[k] for k in ("R_SPRING", "R_TORQUE", "R_LEAN", "R_CONTACT", "R_NEXT", "R_EFFECTIVE", "RADIUS", "RING_RADIUS")
    )
    F1, F2, F3, SUM, F1_R, F2_R, F3_R, ACROSS = (s[k] for k in "F1 F2 F3 SUM F1_R F2_R F3_R ACROSS".split())
    EDGE1, EDGE2, EDGE3, FAR1, FAR2, FAR3, SIDE1, SIDE2, SIDE3 = (s[f"{f}{i}"] for f in ("EDGE", "FAR", "SIDE") for i in (1, 2, 3))

    @kernel
    def ring_muscle(b: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            s1, s2, s3 = b[S1 + k], b[S2 + k], b[S3 + k]
            o1, o2, o3 = s1 - b[S1 + k + half], s2 - b[S2 + k + half], s3 - b[S3 + k + half]
            wide = 1.0 / np.sqrt(o1 * o1 + o2 * o2 + o3 * o3)
            o1, o2, o3 = o1 * wide, o2 * wide, o3 * wide
            h1 = b[S1 + k + quarter] - b[S1 + k - quarter]
            h2 = b[S2 + k + quarter] - b[S2 + k - quarter]
            h3 = b[S3 + k + quarter] - b[S3 + k - quarter]
            across = 1.0 / np.sqrt(h1 * h1 + h2 * h2 + h3 * h3)
            h1, h2, h3 = h1 * across, h2 * across, h3 * across
            b[H1 + k], b[H2 + k], b[H3 + k], b[ACROSS + k] = h1, h2, h3, across
            radius, spring, lock = b[RADIUS + k], b[R_SPRING + k], b[R_TORQUE + k]
            reach = b[RING_RADIUS + k] + radius
            c1, c2, c3 = b[M1 + k] - s1, b[M2 + k] - s2, b[M3 + k] - s3
            f1, f2, f3 = spring * (c1 + reach * o1), spring * (c2 + reach * o2), spring * (c3 + reach * o3)
            along = f1 * o1 + f2 * o2 + f3 * o3
            distance = np.sqrt(c1 * c1 + c2 * c2 + c3 * c3)
            overlap = max(reach - distance, 0.0)
            push = b[R_CONTACT + k] * overlap * np.sqrt(overlap / np.sqrt(1.0 + (b[R_EFFECTIVE + k] * overlap) ** 2))
            unit = push / distance
            # The lock pulls the edge w towards its direction in the ring, and turns the ring's own directions the other way.
            d1, d2, d3 = b[D1 + k], b[D2 + k], b[D3 + k]
            skew, tilt = d1 * h1 + d2 * h2 + d3 * h3, d1 * o1 + d2 * o2 + d3 * o3
            y, z = HINGE_SHARE * lock * skew, LEAN_SHARE * lock * (tilt + b[R_LEAN + k])
            b[EDGE1 + k], b[EDGE2 + k], b[EDGE3 + k] = y * h1 + z * o1, y * h2 + z * o2, y * h3 + z * o3
            y *= across
            b[SIDE1 + k], b[SIDE2 + k], b[SIDE3 + k] = y * (d1 - skew * h1), y * (d2 - skew * h2), y * (d3 - skew * h3)
            # Spring and lock both turn o: forces on its two ends, gradient of the unit vector.
            g1 = wide * (reach * (f1 - along * o1) + z * (d1 - tilt * o1))
            g2 = wide * (reach * (f2 - along * o2) + z * (d2 - tilt * o2))
            g3 = wide * (reach * (f3 - along * o3) + z * (d3 - tilt * o3))
            b[FAR1 + k], b[FAR2 + k], b[FAR3 + k] = g1, g2, g3
            f1, f2, f3 = f1 - unit * c1, f2 - unit * c2, f3 - unit * c3
            b[F1_R + k], b[F2_R + k], b[F3_R + k] = f1 - g1, f2 - g2, f3 - g3
            b[F1 + k] -= f1
            b[F2 + k] -= f2
            b[F3 + k] -= f3
            b[SUM + k] -= (along + push) * radius

    @kernel(inline="always")
    def slip(b: Any, k: Any, n: Any) -> Any:
        # Of ring n against ring k: half of the mean direction's half, what either of the two directions is turned with.
        d1, d2, d3 = b[S1 + n] - b[S1 + k], b[S2 + n] - b[S2 + k], b[S3 + n] - b[S3 + k]
        slipped = d1 * (b[H1 + k] + b[H1 + n]) + d2 * (b[H2 + k] + b[H2 + n]) + d3 * (b[H3 + k] + b[H3 + n])
        return 0.25 * b[R_NEXT + k] * slipped

    @kernel
    def ring_ring(b: Any, first: Any, last: Any) -> None:
        for k in range(first, last):
            n, p = k + ONE, k - ONE
            h1, h2, h3, across = b[H1 + k], b[H2 + k], b[H3 + k], b[ACROSS + k]
            s1, s2, s3, y, z = b[S1 + k], b[S2 + k], b[S3 + k], slip(b, k, n), slip(b, p, k)
            e1 = y * (b[S1 + n] - s1) + z * (s1 - b[S1 + p])
            e2 = y * (b[S2 + n] - s2) + z * (s2 - b[S2 + p])
            e3 = y * (b[S3 + n] - s3) + z * (s3 - b[S3 + p])
            along = e1 * h1 + e2 * h2 + e3 * h3
            b[SIDE1 + k] += across * (e1 - along * h1)
            b[SIDE2 + k] += across * (e2 - along * h2)
            b[SIDE3 + k] += across * (e3 - along * h3)
            b[F1_R + k] += y * (h1 + b[H1 + n]) - z * (h1 + b[H1 + p])
            b[F2_R + k] += y * (h2 + b[H2 + n]) - z * (h2 + b[H2 + p])
            b[F3_R + k] += y * (h3 + b[H3 + n]) - z * (h3 + b[H3 + p])

    return sweep(grid, "spokes", ring_muscle), sweep(grid, "spokes", ring_ring)


def load_kernels(grid: AssemblyGrid) -> Any:
    """Compile what hands the collected results of the spokes to the rods.

    Returns
    -------
    load : compiled function
        ``load(buffer, part)``: tension (reach / 2 l) S and the locks' vectors, on the axes of cord and muscles.
    hand_on : compiled function
        ``hand_on(buffer, part)``: forces on the ring nodes at the spokes.
    """
    o, g, s = family_offsets(grid, False), family_offsets(grid, True), spoke_offsets(grid)
    L = np.uint64(grid.lanes)
    spokes, pitch, slot = grid.spokes, grid.spoke_pitch, grid.first_spoke
    quarter, first = spokes // 4, np.uint64(slot * grid.lanes)
    T1, T2, T3, N1, N2, N3, STRETCH, LENGTH = (o[k] for k in ("T1", "T2", "T3", "N1", "N2", "N3", "STRETCH", "LENGTH"))
    RF1, RF2, RF3, SUM, F1_R, F2_R, F3_R = (
        table[k] for table, names in ((g, "F1 F2 F3"), (s, "SUM F1_R F2_R F3_R")) for k in names.split()
    )
    EDGE1, EDGE2, EDGE3, FAR1, FAR2, FAR3, SIDE1, SIDE2, SIDE3 = (s[f"{f}{i}"] for f in ("EDGE", "FAR", "SIDE") for i in (1, 2, 3))

    @kernel
    def tense(b: Any, begin: Any, end: Any) -> None:
        for k in range(begin, end):
            n = k + first - L
            pull = 0.5 * b[SUM + n] / (b[STRETCH + k] * b[LENGTH + k])
            b[N1 + k] += pull * b[T1 + k] + b[EDGE1 + n]
            b[N2 + k] += pull * b[T2 + k] + b[EDGE2 + n]
            b[N3 + k] += pull * b[T3 + k] + b[EDGE3 + n]

    pull_on = sweep(grid, "straight", tense)

    @kernel
    def load(b: Any, part: Any) -> None:
        for n in range(first - L + part.low, first - L + part.high):
            b[EDGE1 + n], b[EDGE2 + n], b[EDGE3 + n] = 0.0, 0.0, 0.0
        pull_on(b, part)

    @kernel
    def hand_on(b: Any, part: Any) -> None:
        for m in range(spokes):
            ring, k0 = np.uint64(pitch * m + 1) * L, np.uint64(m + slot) * L
            opposite = np.uint64((m + spokes // 2) % spokes + slot) * L
            ahead, behind = np.uint64((m + quarter) % spokes + slot) * L, np.uint64((m + spokes - quarter) % spokes + slot) * L
            for i in range(part.low, part.high):
                r, k, f, a, p = ring + i, k0 + i, opposite + i, ahead + i, behind + i
                # This node stands a quarter turn ahead of the spoke behind, and behind the one ahead.
                b[RF1 + r] += b[F1_R + k] + b[FAR1 + f] - b[SIDE1 + p] + b[SIDE1 + a]
                b[RF2 + r] += b[F2_R + k] + b[FAR2 + f] - b[SIDE2 + p] + b[SIDE2 + a]
                b[RF3 + r] += b[F3_R + k] + b[FAR3 + f] - b[SIDE3 + p] + b[SIDE3 + a]

    return load, hand_on
