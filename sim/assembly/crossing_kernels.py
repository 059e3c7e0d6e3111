"""Connections of rings and oblique helices: a spring from surface to surface at each crossing, and contact with the nodes around it.

The nodes h of a helix and q of a ring that meet are joined along the ring's outward direction o, with reach the sum of both radii; h pushes
on q, and the helix nodes on either side of h on the two ring nodes on the same side of q (Hertz contact, power 3/2, softened for the step).
Which helix node is on which side depends on the hand and stands in the tables of indices, as does everything else that is irregular: the
arithmetic itself runs over consecutive numbers. Constants of Tekinalp et al. (2024, SI). The joint is the gradient of

    U = 1/2 k |x_q - x_h + reach o|^2

with radii at rest, so that the spring also turns o, by forces on q and on the opposite node. The published law leaves that out and takes
the present radii.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from .family_kernels import family_offsets
from .layout import CrossingRow, SpokeRow, stride_of
from .spoke_kernels import spoke_offsets

ONE = np.uint64(1)
RING_PLACES, HELIX_PLACES = "ABSDEO", "PHN"


def crossing_offsets(grid: AssemblyGrid) -> Any:
    """Unsigned offsets of the crossings' rows in the one buffer."""
    start = int(spoke_offsets(grid)["S1"]) + len(SpokeRow) * stride_of(grid.spoke_slots, grid.lanes)
    stride = stride_of(grid.helices, grid.lanes)
    return {row.name: np.uint64(start + row * stride) for row in CrossingRow}


def transfer_kernels(grid: AssemblyGrid) -> Any:
    """Compile what moves numbers between rods and crossings.

    Returns
    -------
    bring, give, give_some : compiled functions
        ``bring(buffer, k, source, x1, x2, x3, target)`` copies a vector to place k of three rows from `target` on, ``fetch_radius(buffer,
        index, radius, target)`` one number for all, ``give(buffer, helix, end, first, last, index, source, f1, f2, f3)`` adds three rows to
        forces, of the crossings of some helices with some rings, and ``give_some(buffer, push, ...)`` does so where the row `push` is not
        zero.
    """
    L, last, helices, row = np.uint64(grid.lanes), np.uint64(grid.rings + 1), grid.helices, np.uint64(stride_of(grid.helices, grid.lanes))

    @kernel
    def bring(b: Any, k: Any, source: Any, x1: Any, x2: Any, x3: Any, target: Any) -> None:
        b[target + k] = b[x1 + source]
        b[target + row + k] = b[x2 + source]
        b[target + row + row + k] = b[x3 + source]

    @kernel
    def fetch_radius(b: Any, index: Any, radius: Any, target: Any) -> None:
        for j in range(helices):
            for i in range(ONE, last):
                k = np.uint64(j) * L + i
                b[target + k] = b[radius + index[k]]

    @kernel
    def give(b: Any, helix: Any, end: Any, first: Any, last: Any, index: Any, source: Any, f1: Any, f2: Any, f3: Any) -> None:
        for j in range(helix, end):
            for i in range(first, last):
                k = np.uint64(j) * L + i
                target = index[k]
                b[f1 + target] += b[source + k]
                b[f2 + target] += b[source + row + k]
                b[f3 + target] += b[source + row + row + k]

    @kernel
    def give_some(
        b: Any, push: Any, helix: Any, end: Any, first: Any, last: Any, index: Any, source: Any, f1: Any, f2: Any, f3: Any
    ) -> None:
        for j in range(helix, end):
            for i in range(first, last):
                k = np.uint64(j) * L + i
                if b[push + k] != 0.0:
                    target = index[k]
                    b[f1 + target] += b[source + k]
                    b[f2 + target] += b[source + row + k]
                    b[f3 + target] += b[source + row + row + k]

    return bring, fetch_radius, give, give_some


def crossing_kernels(grid: AssemblyGrid, published: bool = False) -> Any:
    """Compile gathering, forces and handing on of the crossings, by the `published` law or with a potential.

    Returns
    -------
    gather, connect, give_rings, give_helices : compiled functions
        ``gather(buffer, part, ring_index, helix_index)`` with (6, helices * lanes) and (3, helices * lanes) uint64 indices within a row of
        the places `RING_PLACES` and `HELIX_PLACES`; ``connect(buffer, part)``; ``give_rings(buffer, part, ring_index)`` and, when all parts
        have been connected, ``give_helices(buffer, part, helix_index)`` hand on the forces.
    """
    o, g, c = family_offsets(grid, False), family_offsets(grid, True), crossing_offsets(grid)
    L, helices = np.uint64(grid.lanes), grid.helices
    X1, X2, X3, RADIUS = (g[k] for k in ("X1", "X2", "X3", "RADIUS"))
    HX1, HX2, HX3, HRADIUS = (o[k] for k in ("X1", "X2", "X3", "RADIUS"))
    ring_rows = tuple(c[f"{place}1"] for place in RING_PLACES)
    ring_radius = tuple(c[f"{place}_RADIUS"] for place in RING_PLACES if place != "O")
    helix_rows = tuple(c[f"{place}1"] for place in HELIX_PLACES)
    helix_radius = tuple(c[f"{place}_RADIUS"] for place in HELIX_PLACES)
    bring, fetch_radius, give, give_some = transfer_kernels(grid)

    @kernel
    def gather(b: Any, part: Any, ring_index: Any, helix_index: Any) -> None:
        for j in range(helices):
            for i in range(part.first, part.last):
                k = np.uint64(j) * L + i
                for place in range(6):
                    bring(b, k, ring_index[place, k], X1, X2, X3, ring_rows[place])
                for place in range(3):
                    bring(b, k, helix_index[place, k], HX1, HX2, HX3, helix_rows[place])
        if published:
            for place in range(5):
                fetch_radius(b, ring_index[place], RADIUS, ring_radius[place])
            for place in range(3):
                fetch_radius(b, helix_index[place], HRADIUS, helix_radius[place])

    position = {place: tuple(c[f"{place}{i}"] for i in (1, 2, 3)) for place in RING_PLACES + HELIX_PLACES}
    force = {place: tuple(c[f"F{place}{i}"] for i in (1, 2, 3)) for place in "ABSDEOPHN"}
    A1, A2, A3 = position["A"]
    B1, B2, B3 = position["B"]
    S1, S2, S3 = position["S"]
    D1, D2, D3 = position["D"]
    E1, E2, E3 = position["E"]
    O1, O2, O3 = position["O"]
    P1, P2, P3 = position["P"]
    H1, H2, H3 = position["H"]
    N1, N2, N3 = position["N"]
    FA1, FA2, FA3 = force["A"]
    FB1, FB2, FB3 = force["B"]
    FS1, FS2, FS3 = force["S"]
    FD1, FD2, FD3 = force["D"]
    FE1, FE2, FE3 = force["E"]
    FO1, FO2, FO3 = force["O"]
    FP1, FP2, FP3 = force["P"]
    FH1, FH2, FH3 = force["H"]
    FN1, FN2, FN3 = force["N"]
    A_RADIUS, B_RADIUS, S_RADIUS, D_RADIUS, E_RADIUS, P_RADIUS, H_RADIUS, N_RADIUS = (c[f"{place}_RADIUS"] for place in "ABSDEPHN")
    SPRING, CONTACT, P_CONTACT, N_CONTACT, EFFECTIVE = (c[k] for k in ("SPRING", "CONTACT", "P_CONTACT", "N_CONTACT", "EFFECTIVE"))
    P_PUSH, N_PUSH = c["P_PUSH"], c["N_PUSH"]

    @kernel(inline="always")
    def push(d1: Any, d2: Any, d3: Any, reach: Any, stiffness: Any, effective: Any) -> Any:
        # Contact force over distance, from the overlap at the distance vector d.
        distance = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
        overlap = max(reach - distance, 0.0)
        return stiffness * overlap * np.sqrt(overlap / np.sqrt(1.0 + (effective * overlap) ** 2)) / distance

    @kernel
    def connect(b: Any, part: Any) -> None:
        for j in range(helices):
            start = np.uint64(j) * L
            for k in range(start + part.low, start + part.high):
                s1, s2, s3 = b[S1 + k], b[S2 + k], b[S3 + k]
                h1, h2, h3 = b[H1 + k], b[H2 + k], b[H3 + k]
                o1, o2, o3 = s1 - b[O1 + k], s2 - b[O2 + k], s3 - b[O3 + k]
                d1, d2, d3 = s1 - h1, s2 - h2, s3 - h3
                reach, effective = b[S_RADIUS + k] + b[H_RADIUS + k], b[EFFECTIVE + k]
                square = o1 * o1 + o2 * o2 + o3 * o3
                lever = reach / np.sqrt(square)
                spring, unit = b[SPRING + k], push(d1, d2, d3, reach, b[CONTACT + k], effective)
                f1 = spring * (d1 + lever * o1) - unit * d1
                f2 = spring * (d2 + lever * o2) - unit * d2
                f3 = spring * (d3 + lever * o3) - unit * d3
                b[FH1 + k], b[FH2 + k], b[FH3 + k] = f1, f2, f3
                if not published:
                    # Of the spring's stretch only what stands across o turns it.
                    across = spring * lever
                    along = (d1 * o1 + d2 * o2 + d3 * o3) / square
                    g1, g2, g3 = across * (d1 - along * o1), across * (d2 - along * o2), across * (d3 - along * o3)
                    b[FO1 + k], b[FO2 + k], b[FO3 + k] = g1, g2, g3
                    f1, f2, f3 = f1 + g1, f2 + g2, f3 + g3
                b[FS1 + k], b[FS2 + k], b[FS3 + k] = -f1, -f2, -f3
                p1, p2, p3, radius, stiffness = b[P1 + k], b[P2 + k], b[P3 + k], b[P_RADIUS + k], b[P_CONTACT + k]
                d1, d2, d3 = b[D1 + k] - p1, b[D2 + k] - p2, b[D3 + k] - p3
                unit = push(d1, d2, d3, b[D_RADIUS + k] + radius, stiffness, effective)
                f1, f2, f3 = unit * d1, unit * d2, unit * d3
                b[FD1 + k], b[FD2 + k], b[FD3 + k] = f1, f2, f3
                d1, d2, d3 = b[E1 + k] - p1, b[E2 + k] - p2, b[E3 + k] - p3
                other = push(d1, d2, d3, b[E_RADIUS + k] + radius, stiffness, effective)
                b[P_PUSH + k], unit = unit + other, other
                d1, d2, d3 = unit * d1, unit * d2, unit * d3
                b[FE1 + k], b[FE2 + k], b[FE3 + k] = d1, d2, d3
                b[FP1 + k], b[FP2 + k], b[FP3 + k] = -f1 - d1, -f2 - d2, -f3 - d3
                p1, p2, p3, radius, stiffness = b[N1 + k], b[N2 + k], b[N3 + k], b[N_RADIUS + k], b[N_CONTACT + k]
                d1, d2, d3 = b[B1 + k] - p1, b[B2 + k] - p2, b[B3 + k] - p3
                unit = push(d1, d2, d3, b[B_RADIUS + k] + radius, stiffness, effective)
                f1, f2, f3 = unit * d1, unit * d2, unit * d3
                b[FB1 + k], b[FB2 + k], b[FB3 + k] = f1, f2, f3
                d1, d2, d3 = b[A1 + k] - p1, b[A2 + k] - p2, b[A3 + k] - p3
                other = push(d1, d2, d3, b[A_RADIUS + k] + radius, stiffness, effective)
                b[N_PUSH + k], unit = unit + other, other
                d1, d2, d3 = unit * d1, unit * d2, unit * d3
                b[FA1 + k], b[FA2 + k], b[FA3 + k] = d1, d2, d3
                b[FN1 + k], b[FN2 + k], b[FN3 + k] = -f1 - d1, -f2 - d2, -f3 - d3

    ring_forces = tuple(force[place][0] for place in "ABSDE")
    helix_forces = tuple(force[place][0] for place in "PHN")
    RF1, RF2, RF3, HF1, HF2, HF3 = (table[f"F{i}"] for table in (g, o) for i in (1, 2, 3))

    left = helices // 2

    @kernel
    def give_rings(b: Any, part: Any, ring_index: Any) -> None:
        # The joint acts on S, O and H everywhere, contacts on the others where they overlap.
        first, last = part.first, part.last
        give_some(b, N_PUSH, 0, helices, first, last, ring_index[0], ring_forces[0], RF1, RF2, RF3)
        give_some(b, N_PUSH, 0, helices, first, last, ring_index[1], ring_forces[1], RF1, RF2, RF3)
        give(b, 0, helices, first, last, ring_index[2], ring_forces[2], RF1, RF2, RF3)
        give_some(b, P_PUSH, 0, helices, first, last, ring_index[3], ring_forces[3], RF1, RF2, RF3)
        give_some(b, P_PUSH, 0, helices, first, last, ring_index[4], ring_forces[4], RF1, RF2, RF3)
        if not published:
            give(b, 0, helices, first, last, ring_index[5], FO1, RF1, RF2, RF3)

    @kernel
    def give_helices(b: Any, part: Any, helix_index: Any) -> None:
        # P is the next helix node on the left-handed helices, and the one before on the others.
        give_some(b, P_PUSH, 0, left, part.first, part.last, helix_index[0], helix_forces[0], HF1, HF2, HF3)
        give_some(b, P_PUSH, left, helices, part.met, part.unmet, helix_index[0], helix_forces[0], HF1, HF2, HF3)
        give(b, 0, helices, part.met, part.unmet, helix_index[1], helix_forces[1], HF1, HF2, HF3)
        give_some(b, N_PUSH, 0, left, part.met, part.unmet, helix_index[2], helix_forces[2], HF1, HF2, HF3)
        give_some(b, N_PUSH, left, helices, part.first, part.last, helix_index[2], helix_forces[2], HF1, HF2, HF3)

    return gather, connect, give_rings, give_helices
