"""Parts of the arm, in which the terms of a step work side by side: two ranges of its cross-sections.

Joints, rings and slabs lie in one cross-section. Only open rods reach from one to the next, by one element, so that a term that works on
a part reads no more than the next cross-section of the other. One thread takes all; two take a half each, in memory of its own, with the
first cross-section of the other half as a border beside it (`octoctrl.sim.assembly.halves`). Every number comes from the same operations in
the same order, so that both give the same bits: a loop works on all lanes, ghosts and border included, where nothing keeps it from them.
"""

from typing import Any, NamedTuple

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel

ONE = np.uint64(1)


class Part(NamedTuple):
    """A range of cross-sections, each from the first to before the last.

    Attributes
    ----------
    low, high : uint64
        Lanes, with ghosts and border.
    start, stop : uint64
        Lanes of the part itself, with ghosts.
    first, last : uint64
        Lanes of rings, and of elements of straight rods.
    node, behind : uint64
        Lanes of nodes of straight rods.
    helix_first, helix_last : uint64
        Elements of helices, which are as many lanes wide as a helix has nodes per ring.
    met, unmet : uint64
        Lanes of rings whose helix nodes are in the part; those of the first ring of the other part still are.
    before : uint64
        Cross-sections of the arm before the first lane.
    middle : uint64
        Lane where the second half of the arm begins.
    """

    low: np.uint64
    high: np.uint64
    start: np.uint64
    stop: np.uint64
    first: np.uint64
    last: np.uint64
    node: np.uint64
    behind: np.uint64
    helix_first: np.uint64
    helix_last: np.uint64
    met: np.uint64
    unmet: np.uint64
    before: np.uint64
    middle: np.uint64


def _part(grid: AssemblyGrid, lanes: int, before: int, start: int, stop: int) -> Part:
    low, high, wide = before + start, before + stop, grid.helix_nodes
    ends = [(max(low, 1) - before, min(high, grid.rings + more) - before) for more in (1, 2)]
    helix = max(wide * low, 1) - wide * before, min(wide * high, grid.helix_elements + 1) - wide * before
    met = start + 1, min(high, grid.rings) + 1 - before
    return Part(*(np.uint64(value) for value in (0, lanes, start, stop, *ends[0], *ends[1], *helix, *met, before, grid.middle - before)))


def whole(grid: AssemblyGrid) -> Part:
    """All cross-sections."""
    return _part(grid, grid.lanes, 0, 0, grid.lanes)


def halves(grid: AssemblyGrid) -> tuple[Part, Part]:
    """Those up to the middle, and the others, in lanes of `grid.half`: before the first of the others stands its border."""
    lanes, before = grid.half.lanes, grid.middle - 1
    return _part(grid, lanes, 0, 0, grid.middle), _part(grid, lanes, before, 1, min(lanes, grid.lanes - before))


def family_slots(grid: AssemblyGrid) -> dict[str, tuple[int, int, int]]:
    """First slot of each family of rods, their number, and how many a rod takes."""
    straight, wide = grid.straight_rods, grid.helix_nodes
    return {
        "cord": (0, 1, 1),
        "muscles": (1, grid.spokes, 1),
        "straight": (0, straight, 1),
        "helices": (straight, grid.helices * wide, wide),
        "rings": (1, grid.ring_nodes, 1),
        "spokes": (grid.first_spoke, grid.spokes, 1),
    }


def sweep(grid: AssemblyGrid, family: str, function: Any) -> Any:
    """Compile ``sweep(buffer, part, ...)``: a kernel of ``(buffer, first, last, ...)``, on a part of all slots of a family."""
    first, slots, wide = family_slots(grid)[family]
    begin, end, jump, width = (np.uint64(value) for value in (first * grid.lanes, (first + slots) * grid.lanes, wide * grid.lanes, wide))

    @kernel
    def swept(b: Any, part: Any, *rest: Any) -> None:
        for base in range(begin, end, jump):
            function(b, base + width * part.low, base + width * part.high, *rest)

    return swept


def sweep_open(grid: AssemblyGrid, function: Any) -> Any:
    """Compile the same on straight rods and helices."""
    straight, helices = (sweep(grid, family, function) for family in ("straight", "helices"))

    @kernel
    def swept(b: Any, part: Any, *rest: Any) -> None:
        straight(b, part, *rest)
        helices(b, part, *rest)

    return swept
