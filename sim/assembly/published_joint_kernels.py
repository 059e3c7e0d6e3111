"""The published connections of rings with muscles and with each other, and the intramuscular pressure made of their forces.

    ring to muscle spring of the muscle's outer surface to the ring's inner surface, orientation lock, contact with the ring nodes
                   from spoke to spoke
    ring to ring   spring to the place that the ring's own plane and the muscles' taper assign to the next ring's node
    pressure       what of the squeeze on an element cancels, (|sum of normal forces| - |sum of force vectors|) / (2 pi r l),
                   pushes along the muscle on its section

Laws of Tekinalp et al. (2024, SI), for comparison: they have no potential, see `octoctrl.sim.assembly.joint_kernels`.

Even rings (the squid's): where a muscle overlaps a ring, both are pushed apart along their joint by a force k |s| d, with s the relative
overlap in the ring's plane and d the vector between the joint's two ends. The muscle feels its own, the ring at every muscle the mean over
all, along its own outward direction, so that it stays round.
"""

from math import cos, sin
from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from .family_kernels import family_offsets
from .spoke_kernels import spoke_offsets

ONE = np.uint64(1)
RESULTS = ("F1", "F2", "F3", "T1", "T2", "T3", "SUM", "G1", "G2", "G3")


def published_ring_joints(grid: AssemblyGrid, inclination: float) -> Any:
    """Compile the joints of the rings; `inclination` of the longitudinal muscles in rad.

    Returns
    -------
    ring_muscle, ring_ring : compiled functions
        Of the buffer alone; they fill the result rows of the spokes, after `octoctrl.sim.assembly.side_kernels`.
    """
    s = spoke_offsets(grid)
    begin, end = np.uint64(grid.first_spoke * grid.lanes), np.uint64((grid.first_spoke + grid.spokes) * grid.lanes)
    quarter, half = np.uint64(grid.spokes // 4 * grid.lanes), np.uint64(grid.spokes // 2 * grid.lanes)
    lean_cosine, lean_sine = cos(inclination), sin(inclination)
    S1, S2, S3, M1, M2, M3, D1, D2, D3, O1, O2, O3, P1, P2, P3 = (s[f"{f}{i}"] for f in "SMDOP" for i in (1, 2, 3))
    R_SPRING, R_TORQUE, R_CONTACT, R_NEXT, R_EFFECTIVE, RADIUS, RING_RADIUS = (
        s[k] for k in ("R_SPRING", "R_TORQUE", "R_CONTACT", "R_NEXT", "R_EFFECTIVE", "RADIUS", "RING_RADIUS")
    )
    F1, F2, F3, T1, T2, T3, SUM, G1, G2, G3 = (s[name] for name in RESULTS)
    F1_R, F2_R, F3_R, T1_R, T2_R, T3_R, F1_X, F2_X, F3_X = (s[k] for k in "F1_R F2_R F3_R T1_R T2_R T3_R F1_X F2_X F3_X".split())

    @kernel
    def ring_muscle(b: Any) -> None:
        for k in range(begin, end):
            s1, s2, s3 = b[S1 + k], b[S2 + k], b[S3 + k]
            o1, o2, o3 = s1 - b[S1 + k + half], s2 - b[S2 + k + half], s3 - b[S3 + k + half]
            inverse = 1 / np.sqrt(o1 * o1 + o2 * o2 + o3 * o3)
            o1, o2, o3 = o1 * inverse, o2 * inverse, o3 * inverse
            h1, h2, h3 = (
                b[S1 + k + quarter] - b[S1 + k - quarter],
                b[S2 + k + quarter] - b[S2 + k - quarter],
                b[S3 + k + quarter] - b[S3 + k - quarter],
            )
            inverse = 1 / np.sqrt(h1 * h1 + h2 * h2 + h3 * h3)
            h1, h2, h3 = h1 * inverse, h2 * inverse, h3 * inverse
            p1, p2, p3 = h2 * o3 - h3 * o2, h3 * o1 - h1 * o3, h1 * o2 - h2 * o1
            b[O1 + k], b[O2 + k], b[O3 + k], b[P1 + k], b[P2 + k], b[P3 + k] = o1, o2, o3, p1, p2, p3
            thick, radius, spring, lock = b[RING_RADIUS + k], b[RADIUS + k], b[R_SPRING + k], b[R_TORQUE + k]
            reach = thick + radius
            c1, c2, c3 = b[M1 + k] - s1, b[M2 + k] - s2, b[M3 + k] - s3
            f1, f2, f3 = spring * (c1 + reach * o1), spring * (c2 + reach * o2), spring * (c3 + reach * o3)
            # Bookkeeping of the part of the spring that lies in the ring's plane, where the muscle presses on the ring.
            axial = c1 * p1 + c2 * p2 + c3 * p3
            square = c1 * c1 + c2 * c2 + c3 * c3
            pressing = 1.0 if square - axial * axial < reach * reach else 0.0
            along = f1 * p1 + f2 * p2 + f3 * p3
            g1, g2, g3 = pressing * (f1 - along * p1), pressing * (f2 - along * p2), pressing * (f3 - along * p3)
            total = -(g1 * o1 + g2 * o2 + g3 * o3)
            # Contact with the spoke's own node.
            distance = np.sqrt(square)
            overlap = max(reach - distance, 0.0)
            push = b[R_CONTACT + k] * overlap * np.sqrt(overlap / (1 + b[R_EFFECTIVE + k] * overlap))
            unit = push / distance
            b[F1_R + k], b[F2_R + k], b[F3_R + k] = f1 - unit * c1, f2 - unit * c2, f3 - unit * c3
            b[F1 + k] += unit * c1 - f1
            b[F2 + k] += unit * c2 - f2
            b[F3 + k] += unit * c3 - f3
            b[SUM + k] += total - push
            b[G1 + k] += unit * c1 - g1
            b[G2 + k] += unit * c2 - g2
            b[G3 + k] += unit * c3 - g3
            # Orientation lock: hinge about the ring's tangent, and the muscle's far end at its place in the ring's frame.
            d1, d2, d3 = b[D1 + k], b[D2 + k], b[D3 + k]
            length = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
            skew = d1 * h1 + d2 * h2 + d3 * h3
            long1, lean = 0.5 * length * lean_cosine, reach + 0.5 * length * lean_sine
            x1 = long1 * p1 - lean * o1 - c1 - 0.5 * d1 - skew * h1
            x2 = long1 * p2 - lean * o2 - c2 - 0.5 * d2 - skew * h2
            x3 = long1 * p3 - lean * o3 - c3 - 0.5 * d3 - skew * h3
            turn = 0.5 * lock
            t1, t2, t3 = turn * (d2 * x3 - d3 * x2), turn * (d3 * x1 - d1 * x3), turn * (d1 * x2 - d2 * x1)
            b[T1_R + k], b[T2_R + k], b[T3_R + k] = -t1, -t2, -t3
            b[T1 + k] += t1
            b[T2 + k] += t2
            b[T3 + k] += t3

    @kernel
    def ring_ring(b: Any) -> None:
        for k in range(begin, end - ONE):
            n = k + ONE
            o1, o2, o3, p1, p2, p3 = b[O1 + k], b[O2 + k], b[O3 + k], b[P1 + k], b[P2 + k], b[P3 + k]
            d1, d2, d3 = b[M1 + n] - b[M1 + k], b[M2 + n] - b[M2 + k], b[M3 + n] - b[M3 + k]
            ahead = abs(d1 * p1 + d2 * p2 + d3 * p3)
            inward = -(d1 * o1 + d2 * o2 + d3 * o3) + abs(b[RADIUS + k] - b[RADIUS + n]) + abs(b[RING_RADIUS + k] - b[RING_RADIUS + n])
            spring = b[R_NEXT + k]
            b[F1_X + k] = spring * (b[S1 + k] + ahead * p1 - inward * o1 - b[S1 + n])
            b[F2_X + k] = spring * (b[S2 + k] + ahead * p2 - inward * o2 - b[S2 + n])
            b[F3_X + k] = spring * (b[S3 + k] + ahead * p3 - inward * o3 - b[S3 + n])

    return ring_muscle, ring_ring


def squeeze_kernels(grid: AssemblyGrid) -> Any:
    """Compile ``squeeze(buffer)``, the pressure's load on the muscles' axes by the collected books, and ``hand_on(buffer)``."""
    o, g, s = family_offsets(grid, False), family_offsets(grid, True), spoke_offsets(grid)
    L, last, straight = np.uint64(grid.lanes), np.uint64(grid.rings + 1), np.uint64(grid.straight_rods)
    spokes, pitch, slot = grid.spokes, grid.spoke_pitch, grid.first_spoke
    first = np.uint64(slot * grid.lanes)
    D1, D2, D3, N1, N2, N3, LRADIUS, STRETCH, LENGTH = (o[k] for k in ("T1", "T2", "T3", "N1", "N2", "N3", "RADIUS", "STRETCH", "LENGTH"))
    SUM, G1, G2, G3 = (s[k] for k in ("SUM", "G1", "G2", "G3"))
    F1_R, F2_R, F3_R, T1_R, T2_R, T3_R, F1_X, F2_X, F3_X = (s[k] for k in "F1_R F2_R F3_R T1_R T2_R T3_R F1_X F2_X F3_X".split())
    RF1, RF2, RF3, RC1, RC2, RC3 = (g[k] for k in ("F1", "F2", "F3", "C1", "C2", "C3"))

    @kernel
    def squeeze(b: Any) -> None:
        for k in range(L * straight):
            n = k + first - L
            radius, length = b[LRADIUS + k], b[STRETCH + k] * b[LENGTH + k]
            kept = abs(b[SUM + n]) - np.sqrt(b[G1 + n] ** 2 + b[G2 + n] ** 2 + b[G3 + n] ** 2)
            push = 0.5 * radius / length * kept
            b[N1 + k] -= push * b[D1 + k]
            b[N2 + k] -= push * b[D2 + k]
            b[N3 + k] -= push * b[D3 + k]

    @kernel
    def hand_on(b: Any) -> None:
        for m in range(spokes):
            ring, spoke = np.uint64(pitch * m + 1) * L, np.uint64(m + slot) * L
            for i in range(ONE, last):
                r, k = ring + i, spoke + i
                b[RF1 + r] += b[F1_R + k] - b[F1_X + k] + b[F1_X + k - ONE]
                b[RF2 + r] += b[F2_R + k] - b[F2_X + k] + b[F2_X + k - ONE]
                b[RF3 + r] += b[F3_R + k] - b[F3_X + k] + b[F3_X + k - ONE]
                b[RC1 + r], b[RC2 + r], b[RC3 + r] = b[T1_R + k], b[T2_R + k], b[T3_R + k]

    return squeeze, hand_on


def even_repulsion(grid: AssemblyGrid) -> Any:
    """Compile ``repel(buffer)``, which adds to the forces and the bookkeeping of the spokes; between `ring_muscle` and `ring_ring`."""
    s, spokes = spoke_offsets(grid), grid.spokes
    width, start = np.uint64(grid.lanes), np.uint64(grid.first_spoke * grid.lanes)
    stop, last = start + np.uint64(spokes) * width, np.uint64(grid.rings + 1)
    S1, S2, S3, M1, M2, M3, O1, O2, O3, P1, P2, P3 = (s[f"{f}{i}"] for f in "SMOP" for i in (1, 2, 3))
    RING_RADIUS, RADIUS, REPULSION = s["RING_RADIUS"], s["RADIUS"], s["R_REPULSION"]
    F1, F2, F3, G1, G2, G3, SUM = (s[k] for k in ("F1", "F2", "F3", "G1", "G2", "G3", "SUM"))
    # The row of the forces on the next ring is not filled yet: it holds what each muscle pushes with.
    F1_R, F2_R, F3_R, PUSH = (s[k] for k in ("F1_R", "F2_R", "F3_R", "F1_X"))

    @kernel
    def repel(b: Any) -> None:
        for k in range(start, stop):
            o1, o2, o3, p1, p2, p3 = b[O1 + k], b[O2 + k], b[O3 + k], b[P1 + k], b[P2 + k], b[P3 + k]
            c1, c2, c3 = b[M1 + k] - b[S1 + k], b[M2 + k] - b[S2 + k], b[M3 + k] - b[S3 + k]
            reach = b[RING_RADIUS + k] + b[RADIUS + k]
            axial = c1 * p1 + c2 * p2 + c3 * p3
            v1, v2, v3 = c1 - axial * p1, c2 - axial * p2, c3 - axial * p3
            overlap = max(1 - np.sqrt(v1 * v1 + v2 * v2 + v3 * v3) / (reach + 1e-300), 0.0)
            stiff = b[REPULSION + k] * overlap
            f1, f2, f3 = stiff * (c1 + reach * o1), stiff * (c2 + reach * o2), stiff * (c3 + reach * o3)
            along = f1 * p1 + f2 * p2 + f3 * p3
            f1, f2, f3 = f1 - along * p1, f2 - along * p2, f3 - along * p3
            outward = f1 * o1 + f2 * o2 + f3 * o3
            b[PUSH + k] = outward
            b[F1 + k] -= f1
            b[F2 + k] -= f2
            b[F3 + k] -= f3
            b[G1 + k] -= f1
            b[G2 + k] -= f2
            b[G3 + k] -= f3
            b[SUM + k] -= outward
        for i in range(ONE, last):
            mean = 0.0
            for k in range(start + i, stop, width):
                mean += b[PUSH + k]
            mean /= spokes
            for k in range(start + i, stop, width):
                b[F1_R + k] += mean * b[O1 + k]
                b[F2_R + k] += mean * b[O2 + k]
                b[F3_R + k] += mean * b[O3 + k]

    return repel
