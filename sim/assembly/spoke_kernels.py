"""What the connections at the longitudinal muscles (the spokes) have in common in all laws: copies, contacts beside the spokes, sums.

All connections of a cross-section are computed lane by lane (one lane per ring and longitudinal element) from copies of the nodes in
the spokes' buffer, so that every loop runs over consecutive numbers; results go to rows of their own and are summed afterwards.

Contacts are softened for the usual step h, f = k p^1.5 / (1 + s^4)^1/4 with s = 3/2 h^2 k p^0.5 (1/m_1 + 1/m_2), so that no stiffness
exceeds a sixth of what it can carry. Contacts of helices have half that s, and up to a third: softer ones would let a twist pass a percent
late. A shorter step finds the same law: it is part of the model, or the motion would not converge in the step.
"""

from math import pi
from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from .family_kernels import family_offsets, rings_begin
from .layout import AssemblyRow, SpokeRow, stride_of
from .parts import sweep

ONE = np.uint64(1)


def spoke_offsets(grid: AssemblyGrid) -> dict[str, np.uint64]:
    """Unsigned offsets of the spokes' rows in the one buffer."""
    start = rings_begin(grid) + len(AssemblyRow) * stride_of(grid.ring_slots, grid.lanes) + 16 - grid.lanes % 16
    stride = stride_of(grid.spoke_slots, grid.lanes)
    return {row.name: np.uint64(start + row * stride) for row in SpokeRow}


def gather_kernel(grid: AssemblyGrid, published: bool) -> Any:
    """Compile ``gather(buffer, part)``: copy what the spokes need, with radii and the directions of the cord's connections.

    The published laws take the rings' present radii, all others those at rest, which are parameters.
    """
    o, g, s = family_offsets(grid, False), family_offsets(grid, True), spoke_offsets(grid)
    width = np.uint64(grid.lanes)
    slots, first, spokes, pitch, ring_nodes = grid.spoke_slots, grid.first_spoke, grid.spokes, grid.spoke_pitch, grid.ring_nodes
    behind = first + spokes
    ring_from = tuple(g[name] for name in ("X1", "X2", "X3", "RADIUS"))
    ring_to = tuple(s[name] for name in ("S1", "S2", "S3", "RING_RADIUS"))
    names = ("Q11", "Q12", "Q13", "Q21", "Q22", "Q23", "Q31", "Q32", "Q33")
    rod_from, rod_to = tuple(o[name] for name in names), tuple(s[name] for name in names)
    X, D, M, A = (tuple(table[f"{f}{i}"] for i in (1, 2, 3)) for table, f in ((o, "X"), (s, "D"), (s, "M"), (s, "A")))
    STRETCH, REST_RADIUS, PRESENT = (o[k] for k in ("STRETCH", "REST_RADIUS", "RADIUS"))
    UNROOT, RADIUS, CORD_RADIUS, CORD_UNROOT = (s[k] for k in ("UNROOT", "RADIUS", "CORD_RADIUS", "CORD_UNROOT"))
    U = tuple(s[f"U{i}"] for i in (1, 2, 3))
    CU1, CU2, CU3 = (s[f"CU1{i}"] for i in (1, 2, 3))
    Q = tuple(tuple(o[f"Q{j}{i}"] for j in (1, 2, 3)) for i in (1, 2, 3))

    @kernel
    def copy(b: Any, part: Any, source: Any, target: Any) -> None:
        for i in range(part.low, part.high):
            b[target + i] = b[source + i]

    @kernel
    def thickness(b: Any, part: Any, rod: Any, radius: Any, unroot: Any) -> None:
        # An element keeps its volume.
        for i in range(part.low, part.high):
            thinner = 1.0 / np.sqrt(b[STRETCH + rod + i])
            b[unroot + i] = thinner
            b[radius + i] = b[PRESENT + rod + i] if published else b[REST_RADIUS + rod + i] * thinner

    @kernel
    def gather(b: Any, part: Any) -> None:
        for slot in range(slots):
            node = np.uint64((pitch * (slot - first)) % ring_nodes + 1)
            for row in range(4 if published else 3):
                copy(b, part, ring_from[row] + node * width, ring_to[row] + np.uint64(slot) * width)
        for slot in range(first, behind + 1):
            rod, here = np.uint64((slot - first) % spokes + 1) * width, np.uint64(slot) * width
            for row in range(9):
                copy(b, part, rod_from[row] + rod, rod_to[row] + here)
            for row in range(3):
                for i in range(part.low, part.high):
                    start, end = b[X[row] + rod + i], b[X[row] + rod + i + ONE]
                    b[D[row] + here + i] = end - start
                    b[M[row] + here + i] = 0.5 * (end + start)
            thickness(b, part, rod, RADIUS + here, UNROOT + here)
        for slot in range(first, behind):
            here = np.uint64(slot) * width
            for row in range(3):
                for i in range(part.low, part.high):
                    b[A[row] + here + i] = 0.5 * (b[X[row] + i] + b[X[row] + i + ONE])
                q1, q2, q3 = Q[row]
                for i in range(part.low, part.high):
                    b[U[row] + here + i] = b[q1 + i] * b[CU1 + here + i] + b[q2 + i] * b[CU2 + here + i] + b[q3 + i] * b[CU3 + here + i]
            thickness(b, part, np.uint64(0), CORD_RADIUS + here, CORD_UNROOT + here)

    return gather


def beside_kernel(grid: AssemblyGrid, published: bool) -> Any:
    """Compile ``beside(buffer, part)``: contact of muscles with the ring nodes between the spokes.

    The published law takes the ring's present radius and keeps books of the forces; the other one loads the muscle's axis.
    """
    g, s = family_offsets(grid, True), spoke_offsets(grid)
    L = np.uint64(grid.lanes)
    spokes, pitch, ring_nodes, slot = grid.spokes, grid.spoke_pitch, grid.ring_nodes, grid.first_spoke
    X1, X2, X3, RF1, RF2, RF3, THICK = (g[k] for k in ("X1", "X2", "X3", "F1", "F2", "F3", "RADIUS" if published else "REST_RADIUS"))
    M1, M2, M3, RADIUS, R_CONTACT, R_EFFECTIVE = (s[k] for k in ("M1", "M2", "M3", "RADIUS", "R_CONTACT", "R_EFFECTIVE"))
    F1, F2, F3, SUM, G1, G2, G3 = (s[k] for k in ("F1", "F2", "F3", "SUM", "G1", "G2", "G3"))

    @kernel
    def touching(b: Any, part: Any, muscle: Any, ring: Any) -> Any:
        count = 0
        for i in range(part.first, part.last):
            d1, d2, d3 = b[X1 + ring + i] - b[M1 + muscle + i], b[X2 + ring + i] - b[M2 + muscle + i], b[X3 + ring + i] - b[M3 + muscle + i]
            reach = b[THICK + ring + i] + b[RADIUS + muscle + i]
            count += d1 * d1 + d2 * d2 + d3 * d3 < reach * reach
        return count

    @kernel
    def beside(b: Any, part: Any) -> None:
        for m in range(spokes):
            muscle = np.uint64(m + slot) * L
            for away in range(1 - pitch, pitch):
                ring = np.uint64((pitch * m + away) % ring_nodes + 1) * L
                if away == 0 or touching(b, part, muscle, ring) == 0:
                    continue
                for i in range(part.first, part.last):
                    k, r = muscle + i, ring + i
                    d1, d2, d3 = b[X1 + r] - b[M1 + k], b[X2 + r] - b[M2 + k], b[X3 + r] - b[M3 + k]
                    distance = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
                    overlap = b[THICK + r] + b[RADIUS + k] - distance
                    if overlap > 0:
                        push = b[R_CONTACT + k] * overlap * np.sqrt(overlap / np.sqrt(1.0 + (b[R_EFFECTIVE + k] * overlap) ** 2))
                        d1, d2, d3 = d1 * push / distance, d2 * push / distance, d3 * push / distance
                        b[RF1 + r] += d1
                        b[RF2 + r] += d2
                        b[RF3 + r] += d3
                        b[F1 + k] -= d1
                        b[F2 + k] -= d2
                        b[F3 + k] -= d3
                        if published:
                            b[SUM + k] -= push
                            b[G1 + k] -= d1
                            b[G2 + k] -= d2
                            b[G3 + k] -= d3
                        else:
                            b[SUM + k] -= push * b[RADIUS + k]

    return beside


def collect_kernel(grid: AssemblyGrid, results: tuple[str, ...]) -> Any:
    """Compile ``collect(buffer, part)``, which sums rows of `results` over the partners of a muscle, and of the cord into the slot before.

    Results on the neighbour of the last muscle belong to the first.
    """
    s = spoke_offsets(grid)
    L, spokes, slot = np.uint64(grid.lanes), grid.spokes, grid.first_spoke
    first, seam = np.uint64(slot * grid.lanes), np.uint64((slot + spokes) * grid.lanes)
    own, other, of_cord = (tuple(s[f"{k}{suffix}"] for k in results) for suffix in ("", "_N", "_C"))
    rows = len(results)

    @kernel
    def collect(b: Any, part: Any) -> None:
        for row in range(rows):
            for i in range(part.low, part.high):
                b[own[row] + first + i] += b[other[row] + seam + i]
            for base in range(first + L, seam, L):
                for k in range(base + part.low, base + part.high):
                    b[own[row] + k] += b[other[row] + k]
            for i in range(part.low, part.high):
                total = 0.0
                for m in range(np.uint64(spokes)):
                    total += b[of_cord[row] + first + m * L + i]
                b[own[row] + first - L + i] = total

    return collect


def share_kernels(grid: AssemblyGrid) -> Any:
    """Compile what hands forces on elements of cord and muscles, and the water's, half to either node.

    Returns
    -------
    halve, add_up : compiled functions
        ``halve(buffer, part, normal, tangential)``, with the drags in kg/m^3 (the cord is dry), and, when all parts have halved,
        ``add_up(buffer, part)``.
    """
    o, s = family_offsets(grid, False), spoke_offsets(grid)
    L, end = np.uint64(grid.lanes), np.uint64(grid.straight_rods * grid.lanes)
    spoke, zero = np.uint64(grid.first_spoke * grid.lanes), np.uint64(0)
    V1, V2, V3, D1, D2, D3 = (o[f"{f}{i}"] for f in "VT" for i in (1, 2, 3))
    LF1, LF2, LF3, LC1, LC2, LC3, STRETCH, LENGTH = (o[k] for k in ("F1", "F2", "F3", "C1", "C2", "C3", "STRETCH", "LENGTH"))
    E1, E2, E3 = o["SCALE"], o["IMPULSE"], o["CORRECTION"]
    F1, F2, F3, T1, T2, T3, RADIUS = (s[k] for k in ("F1", "F2", "F3", "T1", "T2", "T3", "RADIUS"))

    @kernel
    def halve(b: Any, first: Any, last: Any, normal_drag: Any, tangent_drag: Any) -> None:
        for k in range(first, last):
            n = k + spoke - L
            radius, length = b[RADIUS + n], b[STRETCH + k] * b[LENGTH + k]
            t1, t2, t3 = b[D1 + k], b[D2 + k], b[D3 + k]
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

    @kernel
    def add_up(b: Any, part: Any) -> None:
        for base in range(zero, end, L):
            if part.before == zero:
                b[E1 + base], b[E2 + base], b[E3 + base] = 0.0, 0.0, 0.0
            if part.behind > part.last:
                n = base + part.last
                b[E1 + n], b[E2 + n], b[E3 + n] = 0.0, 0.0, 0.0
            for k in range(base + part.node, base + part.behind):
                b[LF1 + k], b[LF2 + k], b[LF3 + k] = b[E1 + k] + b[E1 + k - ONE], b[E2 + k] + b[E2 + k - ONE], b[E3 + k] + b[E3 + k - ONE]

    return sweep(grid, "straight", halve), add_up
