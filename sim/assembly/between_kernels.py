"""Crossings of oblique helices with coarse rings, whose nodes they do not meet.

The point of the ring that a helix node h crosses lies between two nodes and, at rest, on the circle through all nodes. It is a fixed linear
combination of these two nodes and of the two on the opposite side,

    s = (a + o) / 2 + c (a - o) / 2,     a = (1 - t) x_left + t x_right,     o the same on the opposite side,

with t the share of the chord and c the circle's radius over the chord's; the force on it is handed to the four nodes with the same weights,
so that force and moment stay, and so is what turns the outward direction. Spring and contact are those of
`octoctrl.sim.assembly.crossing_kernels`; contacts of the helix nodes in the middle between two rings, which a coarse ring has no nodes for,
are left out.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from .crossing_kernels import crossing_offsets, transfer_kernels
from .family_kernels import family_offsets
from .layout import stride_of

ONE = np.uint64(1)
RING_PLACES = "ABDE"
"""Left and right node of a ring, and their opposites."""


def between_kernels(grid: AssemblyGrid) -> Any:
    """Compile gathering, forces and handing on of the crossings of coarse rings.

    Returns
    -------
    gather, connect, give_rings, give_helices : compiled functions
        As those of `octoctrl.sim.assembly.crossing_kernels.crossing_kernels`, with the places `RING_PLACES` and the helix node.
    """
    o, g, c = family_offsets(grid, False), family_offsets(grid, True), crossing_offsets(grid)
    L, helices = np.uint64(grid.lanes), grid.helices
    row = np.uint64(stride_of(helices, grid.lanes))
    X1, X2, X3, HX1, HX2, HX3 = (table[f"X{i}"] for table in (g, o) for i in (1, 2, 3))
    RF1, RF2, RF3, HF1, HF2, HF3 = (table[f"F{i}"] for table in (g, o) for i in (1, 2, 3))
    S_RADIUS, H_RADIUS = c["S_RADIUS"], c["H_RADIUS"]
    A, B, D, E = (c[f"{place}1"] for place in RING_PLACES)
    H, FA, FB, FD, FE, FH = (c[name] for name in ("H1", "FA1", "FB1", "FD1", "FE1", "FH1"))
    SPRING, CONTACT, EFFECTIVE, SHARE, ARC = (c[k] for k in ("SPRING", "CONTACT", "EFFECTIVE", "SHARE", "ARC"))
    places, results = (A, B, D, E), (FA, FB, FD, FE)
    bring, _, give, _ = transfer_kernels(grid)

    @kernel
    def gather(b: Any, part: Any, ring_index: Any, helix_index: Any) -> None:
        for j in range(helices):
            for i in range(part.first, part.last):
                k = np.uint64(j) * L + i
                for place in range(4):
                    bring(b, k, ring_index[place, k], X1, X2, X3, places[place])
                bring(b, k, helix_index[0, k], HX1, HX2, HX3, H)

    @kernel
    def connect(b: Any, part: Any) -> None:
        for j in range(helices):
            start = np.uint64(j) * L
            for k in range(start + part.low, start + part.high):
                share, arc = b[SHARE + k], b[ARC + k]
                rest = 1.0 - share
                near1, far1 = rest * b[A + k] + share * b[B + k], rest * b[D + k] + share * b[E + k]
                near2 = rest * b[A + row + k] + share * b[B + row + k]
                far2 = rest * b[D + row + k] + share * b[E + row + k]
                near3 = rest * b[A + row + row + k] + share * b[B + row + row + k]
                far3 = rest * b[D + row + row + k] + share * b[E + row + row + k]
                o1, o2, o3 = arc * (near1 - far1), arc * (near2 - far2), arc * (near3 - far3)
                d1 = 0.5 * (near1 + far1 + o1) - b[H + k]
                d2 = 0.5 * (near2 + far2 + o2) - b[H + row + k]
                d3 = 0.5 * (near3 + far3 + o3) - b[H + row + row + k]
                reach, square = b[S_RADIUS + k] + b[H_RADIUS + k], o1 * o1 + o2 * o2 + o3 * o3
                lever = reach / np.sqrt(square)
                distance = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
                overlap = max(reach - distance, 0.0)
                unit = b[CONTACT + k] * overlap * np.sqrt(overlap / np.sqrt(1.0 + (b[EFFECTIVE + k] * overlap) ** 2)) / distance
                spring = b[SPRING + k]
                f1 = spring * (d1 + lever * o1) - unit * d1
                f2 = spring * (d2 + lever * o2) - unit * d2
                f3 = spring * (d3 + lever * o3) - unit * d3
                b[FH + k], b[FH + row + k], b[FH + row + row + k] = f1, f2, f3
                # Here o is arc (near - far) and s is (near + far + o) / 2: forces on near and far.
                turn, along = spring * lever * arc, (d1 * o1 + d2 * o2 + d3 * o3) / square
                g1, g2, g3 = turn * (d1 - along * o1), turn * (d2 - along * o2), turn * (d3 - along * o3)
                own, other = 0.5 * (1.0 + arc), 0.5 * (1.0 - arc)
                n1, n2, n3 = own * f1 + g1, own * f2 + g2, own * f3 + g3
                b[FA + k], b[FA + row + k], b[FA + row + row + k] = -rest * n1, -rest * n2, -rest * n3
                b[FB + k], b[FB + row + k], b[FB + row + row + k] = -share * n1, -share * n2, -share * n3
                n1, n2, n3 = other * f1 - g1, other * f2 - g2, other * f3 - g3
                b[FD + k], b[FD + row + k], b[FD + row + row + k] = -rest * n1, -rest * n2, -rest * n3
                b[FE + k], b[FE + row + k], b[FE + row + row + k] = -share * n1, -share * n2, -share * n3

    @kernel
    def give_rings(b: Any, part: Any, ring_index: Any) -> None:
        for place in range(4):
            give(b, 0, helices, part.first, part.last, ring_index[place], results[place], RF1, RF2, RF3)

    @kernel
    def give_helices(b: Any, part: Any, helix_index: Any) -> None:
        give(b, 0, helices, part.met, part.unmet, helix_index[0], FH, HF1, HF2, HF3)

    return gather, connect, give_rings, give_helices
