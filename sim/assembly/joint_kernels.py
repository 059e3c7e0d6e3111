"""Connections at the longitudinal muscles: cord, neighbours, rings, and the intramuscular pressure that they make.

All connections of a cross-section are computed lane by lane (one lane per ring and longitudinal element) from copies of the nodes in
the spokes' buffer, so that every loop runs over consecutive numbers; results go to rows of their own and are summed afterwards.

    side by side   spring between material points on the two surfaces (force at its lever arm), contact in the power 3/2
    ring to muscle spring of the muscle's outer surface to the ring's inner surface, orientation lock, contact with the ring nodes
                   from spoke to spoke
    ring to ring   spring to the place that the ring's own plane and the muscles' taper assign to the next ring's node
    pressure       what of the squeeze on an element cancels, (|sum of normal forces| - |sum of force vectors|) / (2 pi r l),
                   pushes along the muscle on its section

Laws of Tekinalp et al. (2024, SI); contacts are softened for the step, f = k p^1.5 / sqrt(1 + s^2) with
s = 3/4 h^2 k p^0.5 (1/m_1 + 1/m_2), so that no stiffness exceeds a third of what the step can carry, while the error is of order h^4.
"""

from math import cos, pi, sin

import numpy as np

from ..compiler import kernel
from .family_kernels import family_offsets
from .layout import AssemblyRow, SpokeRow, stride_of

ONE = np.uint64(1)


def spoke_offsets(grid):
    """Unsigned offsets of the spokes' rows in the one buffer."""
    start = len(AssemblyRow) * (stride_of(grid.open_slots, grid.lanes) + stride_of(grid.ring_slots, grid.lanes))
    stride = stride_of(grid.spoke_slots, grid.lanes)
    return {row.name: np.uint64(start + row * stride) for row in SpokeRow}


def gather_kernel(grid):
    """Compile the copying of what the spokes need, with the directions of the cord's connections."""
    o, g, s = family_offsets(grid, False), family_offsets(grid, True), spoke_offsets(grid)
    width = np.uint64(grid.lanes)
    slots, first, spokes, pitch, ring_nodes = grid.spoke_slots, grid.first_spoke, grid.spokes, grid.spoke_pitch, grid.ring_nodes
    behind = first + spokes
    ring_from = tuple(g[name] for name in ("X1", "X2", "X3", "RADIUS"))
    ring_to = tuple(s[name] for name in ("S1", "S2", "S3", "RING_RADIUS"))
    names = ("Q11", "Q12", "Q13", "Q21", "Q22", "Q23", "Q31", "Q32", "Q33", "RADIUS")
    rod_from, rod_to = tuple(o[name] for name in names), tuple(s[name] for name in names)
    X, D, M, A = (tuple(table[f"{f}{i}"] for i in (1, 2, 3)) for table, f in ((o, "X"), (s, "D"), (s, "M"), (s, "A")))
    STRETCH, UNROOT, RADIUS, CORD_RADIUS, CORD_UNROOT = o["STRETCH"], s["UNROOT"], o["RADIUS"], s["CORD_RADIUS"], s["CORD_UNROOT"]
    U = tuple(s[f"U{i}"] for i in (1, 2, 3))
    CU1, CU2, CU3 = (s[f"CU1{i}"] for i in (1, 2, 3))
    Q = tuple(tuple(o[f"Q{j}{i}"] for j in (1, 2, 3)) for i in (1, 2, 3))

    @kernel
    def copy(b, source, target):
        for i in range(width):
            b[target + i] = b[source + i]

    @kernel
    def gather(b):
        for slot in range(slots):
            node = np.uint64((pitch * (slot - first)) % ring_nodes + 1)
            for row in range(4):
                copy(b, ring_from[row] + node * width, ring_to[row] + np.uint64(slot) * width)
        for slot in range(first, behind + 1):
            rod, here = np.uint64((slot - first) % spokes + 1) * width, np.uint64(slot) * width
            for row in range(10):
                copy(b, rod_from[row] + rod, rod_to[row] + here)
            for row in range(3):
                for i in range(width):
                    start, end = b[X[row] + rod + i], b[X[row] + rod + i + ONE]
                    b[D[row] + here + i] = end - start
                    b[M[row] + here + i] = 0.5 * (end + start)
            for i in range(width):
                b[UNROOT + here + i] = 1 / np.sqrt(b[STRETCH + rod + i])
        for slot in range(first, behind):
            here = np.uint64(slot) * width
            for row in range(3):
                for i in range(width):
                    b[A[row] + here + i] = 0.5 * (b[X[row] + i] + b[X[row] + i + ONE])
                q1, q2, q3 = Q[row]
                for i in range(width):
                    b[U[row] + here + i] = b[q1 + i] * b[CU1 + here + i] + b[q2 + i] * b[CU2 + here + i] + b[q3 + i] * b[CU3 + here + i]
            copy(b, RADIUS, CORD_RADIUS + here)
            for i in range(width):
                b[CORD_UNROOT + here + i] = 1 / np.sqrt(b[STRETCH + i])

    return gather


def joint_kernels(grid, inclination):
    """Compile the connections of the spokes.

    Parameters
    ----------
    grid : AssemblyGrid
    inclination : float, rad
        Of the longitudinal muscles.

    Returns
    -------
    cord, neighbours, ring_muscle, ring_ring : compiled functions
        Of the buffer alone; they fill the result rows of the spokes.
    """
    s = spoke_offsets(grid)
    L = np.uint64(grid.lanes)
    begin, end = np.uint64(grid.first_spoke * grid.lanes), np.uint64((grid.first_spoke + grid.spokes) * grid.lanes)
    quarter, half = np.uint64(grid.spokes // 4 * grid.lanes), np.uint64(grid.spokes // 2 * grid.lanes)
    lean_cosine, lean_sine = cos(inclination), sin(inclination)
    S1, S2, S3, M1, M2, M3, D1, D2, D3, A1, A2, A3, U1, U2, U3 = (s[f"{f}{i}"] for f in "SMDAU" for i in (1, 2, 3))
    Q11, Q12, Q13, Q21, Q22, Q23, Q31, Q32, Q33 = (s[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    RADIUS, UNROOT, CORD_RADIUS, CORD_UNROOT, RING_RADIUS = (
        s[k] for k in ("RADIUS", "UNROOT", "CORD_RADIUS", "CORD_UNROOT", "RING_RADIUS")
    )
    CU21, CU22, CU23, C_GAP, C_SPRING, C_CONTACT = (s[k] for k in ("CU21", "CU22", "CU23", "C_GAP", "C_SPRING", "C_CONTACT"))
    NU11, NU12, NU13, NU21, NU22, NU23 = (s[f"NU{i}{j}"] for i in (1, 2) for j in (1, 2, 3))
    N_GAP, N_SPRING, N_CONTACT = (s[k] for k in ("N_GAP", "N_SPRING", "N_CONTACT"))
    R_SPRING, R_TORQUE, R_CONTACT, R_NEXT, R_EFFECTIVE = (s[k] for k in ("R_SPRING", "R_TORQUE", "R_CONTACT", "R_NEXT", "R_EFFECTIVE"))

    def results(suffix):
        return tuple(s[f"{name}{suffix}"] for name in ("F1", "F2", "F3", "T1", "T2", "T3", "SUM", "G1", "G2", "G3"))

    F1, F2, F3, T1, T2, T3, SUM, G1, G2, G3 = results("")
    F1_N, F2_N, F3_N, T1_N, T2_N, T3_N, SUM_N, G1_N, G2_N, G3_N = results("_N")
    F1_C, F2_C, F3_C, T1_C, T2_C, T3_C, SUM_C, G1_C, G2_C, G3_C = results("_C")
    F1_R, F2_R, F3_R, T1_R, T2_R, T3_R, F1_X, F2_X, F3_X, O1, O2, O3, P1, P2, P3 = (
        s[k] for k in "F1_R F2_R F3_R T1_R T2_R T3_R F1_X F2_X F3_X O1 O2 O3 P1 P2 P3".split()
    )

    @kernel(inline="always")
    def side_by_side(c1, c2, c3, u1, u2, u3, v1, v2, v3, radius1, radius2, share1, share2, spring, contact):
        # c: from centre to centre; u, v: directions of the connection in the lab frame. Force on the first, its torques, bookkeeping.
        reach1, reach2 = radius1 + share1, radius2 + share2
        p1, p2, p3, q1, q2, q3 = reach1 * u1, reach1 * u2, reach1 * u3, reach2 * v1, reach2 * v2, reach2 * v3
        f1, f2, f3 = spring * (c1 + q1 - p1), spring * (c2 + q2 - p2), spring * (c3 + q3 - p3)
        a1, a2, a3 = p2 * f3 - p3 * f2, p3 * f1 - p1 * f3, p1 * f2 - p2 * f1
        b1, b2, b3 = q3 * f2 - q2 * f3, q1 * f3 - q3 * f1, q2 * f1 - q1 * f2
        distance = np.sqrt(c1 * c1 + c2 * c2 + c3 * c3)
        overlap = max(reach1 + reach2 - distance, 0.0)
        push = contact * overlap * np.sqrt(overlap) / distance
        f1, f2, f3 = f1 - push * c1, f2 - push * c2, f3 - push * c3
        touching = 1.0 if overlap > 0.0 else 0.0
        normal1 = touching * (f1 * u1 + f2 * u2 + f3 * u3)
        normal2 = -touching * (f1 * v1 + f2 * v2 + f3 * v3)
        return f1, f2, f3, a1, a2, a3, b1, b2, b3, normal1, normal2

    @kernel
    def cord(b):
        for k in range(begin, end):
            w1, w2, w3 = b[CU21 + k], b[CU22 + k], b[CU23 + k]
            v1 = b[Q11 + k] * w1 + b[Q21 + k] * w2 + b[Q31 + k] * w3
            v2 = b[Q12 + k] * w1 + b[Q22 + k] * w2 + b[Q32 + k] * w3
            v3 = b[Q13 + k] * w1 + b[Q23 + k] * w2 + b[Q33 + k] * w3
            u1, u2, u3 = b[U1 + k], b[U2 + k], b[U3 + k]
            gap = 0.5 * b[C_GAP + k]
            f1, f2, f3, a1, a2, a3, b1, b2, b3, normal1, normal2 = side_by_side(
                b[M1 + k] - b[A1 + k], b[M2 + k] - b[A2 + k], b[M3 + k] - b[A3 + k], u1, u2, u3, v1, v2, v3,
                b[CORD_RADIUS + k], b[RADIUS + k], gap * b[CORD_UNROOT + k], gap * b[UNROOT + k], b[C_SPRING + k], b[C_CONTACT + k],
            )  # fmt: skip
            b[F1_C + k], b[F2_C + k], b[F3_C + k] = f1, f2, f3
            b[T1_C + k], b[T2_C + k], b[T3_C + k] = a1, a2, a3
            b[SUM_C + k], b[G1_C + k], b[G2_C + k], b[G3_C + k] = normal1, normal1 * u1, normal1 * u2, normal1 * u3
            b[F1 + k], b[F2 + k], b[F3 + k] = -f1, -f2, -f3
            b[T1 + k], b[T2 + k], b[T3 + k] = b1, b2, b3
            b[SUM + k], b[G1 + k], b[G2 + k], b[G3 + k] = normal2, normal2 * v1, normal2 * v2, normal2 * v3

    @kernel
    def neighbours(b):
        for k in range(begin, end):
            n = k + L
            w1, w2, w3 = b[NU11 + k], b[NU12 + k], b[NU13 + k]
            u1 = b[Q11 + k] * w1 + b[Q21 + k] * w2 + b[Q31 + k] * w3
            u2 = b[Q12 + k] * w1 + b[Q22 + k] * w2 + b[Q32 + k] * w3
            u3 = b[Q13 + k] * w1 + b[Q23 + k] * w2 + b[Q33 + k] * w3
            w1, w2, w3 = b[NU21 + k], b[NU22 + k], b[NU23 + k]
            v1 = b[Q11 + n] * w1 + b[Q21 + n] * w2 + b[Q31 + n] * w3
            v2 = b[Q12 + n] * w1 + b[Q22 + n] * w2 + b[Q32 + n] * w3
            v3 = b[Q13 + n] * w1 + b[Q23 + n] * w2 + b[Q33 + n] * w3
            gap = 0.5 * b[N_GAP + k]
            f1, f2, f3, a1, a2, a3, b1, b2, b3, normal1, normal2 = side_by_side(
                b[M1 + n] - b[M1 + k], b[M2 + n] - b[M2 + k], b[M3 + n] - b[M3 + k], u1, u2, u3, v1, v2, v3,
                b[RADIUS + k], b[RADIUS + n], gap * b[UNROOT + k], gap * b[UNROOT + n], b[N_SPRING + k], b[N_CONTACT + k],
            )  # fmt: skip
            b[F1 + k] += f1
            b[F2 + k] += f2
            b[F3 + k] += f3
            b[T1 + k] += a1
            b[T2 + k] += a2
            b[T3 + k] += a3
            b[SUM + k] += normal1
            b[G1 + k] += normal1 * u1
            b[G2 + k] += normal1 * u2
            b[G3 + k] += normal1 * u3
            b[F1_N + n], b[F2_N + n], b[F3_N + n] = -f1, -f2, -f3
            b[T1_N + n], b[T2_N + n], b[T3_N + n] = b1, b2, b3
            b[SUM_N + n], b[G1_N + n], b[G2_N + n], b[G3_N + n] = normal2, normal2 * v1, normal2 * v2, normal2 * v3

    @kernel
    def ring_muscle(b):
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
    def ring_ring(b):
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

    return cord, neighbours, ring_muscle, ring_ring


def scatter_kernels(grid):
    """Compile the sums of the spokes' results on the rods, and the contact of muscles with ring nodes beside the spokes.

    Returns
    -------
    beside, scatter : compiled functions
        ``beside(buffer)`` adds contacts, ``scatter(buffer, water)`` sums all up; `water` is (normal, tangential) drag, kg/m^3.
    """
    o, g, s = family_offsets(grid, False), family_offsets(grid, True), spoke_offsets(grid)
    L, last = np.uint64(grid.lanes), np.uint64(grid.rings + 1)
    spokes, pitch, ring_nodes, slot = grid.spokes, grid.spoke_pitch, grid.ring_nodes, grid.first_spoke
    first, seam = np.uint64(slot * grid.lanes), np.uint64((slot + spokes) * grid.lanes)
    straight = np.uint64(grid.straight_rods)
    X1, X2, X3, THICK = (g[k] for k in ("X1", "X2", "X3", "RADIUS"))
    RF1, RF2, RF3, RC1, RC2, RC3 = (g[k] for k in ("F1", "F2", "F3", "C1", "C2", "C3"))
    V1, V2, V3, D1, D2, D3, N1, N2, N3 = (o[f"{f}{i}"] for f in "VTN" for i in (1, 2, 3))
    LF1, LF2, LF3, LC1, LC2, LC3, LRADIUS, STRETCH, LENGTH = (
        o[k] for k in ("F1", "F2", "F3", "C1", "C2", "C3", "RADIUS", "STRETCH", "LENGTH")
    )
    E1, E2, E3 = o["SCALE"], o["IMPULSE"], o["CORRECTION"]
    M1, M2, M3, RADIUS, R_CONTACT, R_EFFECTIVE = (s[k] for k in ("M1", "M2", "M3", "RADIUS", "R_CONTACT", "R_EFFECTIVE"))
    names = ("F1", "F2", "F3", "T1", "T2", "T3", "SUM", "G1", "G2", "G3")
    F1, F2, F3, T1, T2, T3, SUM, G1, G2, G3 = (s[k] for k in names)
    own, other, of_cord = (tuple(s[f"{k}{suffix}"] for k in names) for suffix in ("", "_N", "_C"))
    F1_R, F2_R, F3_R, T1_R, T2_R, T3_R, F1_X, F2_X, F3_X = (s[k] for k in "F1_R F2_R F3_R T1_R T2_R T3_R F1_X F2_X F3_X".split())

    @kernel
    def touching(b, muscle, ring):
        count = 0
        for i in range(ONE, last):
            d1, d2, d3 = b[X1 + ring + i] - b[M1 + muscle + i], b[X2 + ring + i] - b[M2 + muscle + i], b[X3 + ring + i] - b[M3 + muscle + i]
            reach = b[THICK + ring + i] + b[RADIUS + muscle + i]
            count += d1 * d1 + d2 * d2 + d3 * d3 < reach * reach
        return count

    @kernel
    def beside(b):
        for m in range(spokes):
            muscle = np.uint64(m + slot) * L
            for away in range(1 - pitch, pitch):
                ring = np.uint64((pitch * m + away) % ring_nodes + 1) * L
                if away == 0 or touching(b, muscle, ring) == 0:
                    continue
                for i in range(ONE, last):
                    k, r = muscle + i, ring + i
                    d1, d2, d3 = b[X1 + r] - b[M1 + k], b[X2 + r] - b[M2 + k], b[X3 + r] - b[M3 + k]
                    distance = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
                    overlap = b[THICK + r] + b[RADIUS + k] - distance
                    if overlap > 0:
                        push = b[R_CONTACT + k] * overlap * np.sqrt(overlap / (1 + b[R_EFFECTIVE + k] * overlap))
                        d1, d2, d3 = d1 * push / distance, d2 * push / distance, d3 * push / distance
                        b[RF1 + r] += d1
                        b[RF2 + r] += d2
                        b[RF3 + r] += d3
                        b[F1 + k] -= d1
                        b[F2 + k] -= d2
                        b[F3 + k] -= d3
                        b[SUM + k] -= push
                        b[G1 + k] -= d1
                        b[G2 + k] -= d2
                        b[G3 + k] -= d3

    @kernel
    def scatter(b, normal_drag, tangent_drag):
        # Results on the neighbours of the last muscle belong to the first; those on the cord are summed into the slot before.
        for row in range(10):
            for i in range(L):
                b[own[row] + first + i] += b[other[row] + seam + i]
            for k in range(first + L, seam):
                b[own[row] + k] += b[other[row] + k]
            for i in range(L):
                total = 0.0
                for m in range(np.uint64(spokes)):
                    total += b[of_cord[row] + first + m * L + i]
                b[own[row] + first - L + i] = total
        for k in range(L * straight):
            n = k + first - L
            radius, length = b[LRADIUS + k], b[STRETCH + k] * b[LENGTH + k]
            squeeze = abs(b[SUM + n]) - np.sqrt(b[G1 + n] ** 2 + b[G2 + n] ** 2 + b[G3 + n] ** 2)
            push = 0.5 * radius / length * squeeze
            t1, t2, t3 = b[D1 + k], b[D2 + k], b[D3 + k]
            b[N1 + k] -= push * t1
            b[N2 + k] -= push * t2
            b[N3 + k] -= push * t3
            wet = 1.0 if k >= L else 0.0
            v1, v2, v3 = 0.5 * (b[V1 + k] + b[V1 + k + ONE]), 0.5 * (b[V2 + k] + b[V2 + k + ONE]), 0.5 * (b[V3 + k] + b[V3 + k + ONE])
            along = v1 * t1 + v2 * t2 + v3 * t3
            h1, h2, h3 = v1 - along * t1, v2 - along * t2, v3 - along * t3
            across = wet * normal_drag * radius * length * np.sqrt(h1 * h1 + h2 * h2 + h3 * h3)
            slide = wet * pi * tangent_drag * radius * length * abs(along) * along
            b[E1 + k] = 0.5 * (b[F1 + n] - across * h1 - slide * t1)
            b[E2 + k] = 0.5 * (b[F2 + n] - across * h2 - slide * t2)
            b[E3 + k] = 0.5 * (b[F3 + n] - across * h3 - slide * t3)
            b[LC1 + k], b[LC2 + k], b[LC3 + k] = b[T1 + n], b[T2 + n], b[T3 + n]
        for rod in range(straight):
            base = rod * L
            b[E1 + base], b[E2 + base], b[E3 + base] = 0.0, 0.0, 0.0
            n = base + last
            b[E1 + n], b[E2 + n], b[E3 + n] = 0.0, 0.0, 0.0
            for k in range(base + ONE, n + ONE):
                b[LF1 + k], b[LF2 + k], b[LF3 + k] = b[E1 + k] + b[E1 + k - ONE], b[E2 + k] + b[E2 + k - ONE], b[E3 + k] + b[E3 + k - ONE]
        for m in range(spokes):
            ring, spoke = np.uint64(pitch * m + 1) * L, np.uint64(m + slot) * L
            for i in range(ONE, last):
                r, k = ring + i, spoke + i
                b[RF1 + r] += b[F1_R + k] - b[F1_X + k] + b[F1_X + k - ONE]
                b[RF2 + r] += b[F2_R + k] - b[F2_X + k] + b[F2_X + k - ONE]
                b[RF3 + r] += b[F3_R + k] - b[F3_X + k] + b[F3_X + k - ONE]
                b[RC1 + r], b[RC2 + r], b[RC3 + r] = b[T1_R + k], b[T2_R + k], b[T3_R + k]

    return beside, scatter
