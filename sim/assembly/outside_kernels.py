"""Loads from outside on the full arm in compiled code: forces on the cord and the muscles of a section, by their shares of it."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from ..scene.loads import FAR, FORCE, NEAR
from .family_kernels import family_offsets

ONE = np.uint64(1)


def outside_kernels(grid: AssemblyGrid) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Compile what finds the forces of loads, and what adds them to all others.

    Parameters
    ----------
    grid : AssemblyGrid

    Returns
    -------
    find : compiled function
        ``find(buffer, part, outside, shares, before, after, share)`` fills `outside` (3, straight rods * lanes) with forces on nodes, from
        the sampled loads (2 or 5, 3, n + 1) before and after, of which the latter counts by `share`; forces that follow the arm turn with
        the frames of the cord; `shares` (straight rods, n + 1) says what each rod carries.
    add : compiled function
        ``add(buffer, part, outside)``.
    """
    o = family_offsets(grid, False)
    F, Q = tuple(o[f"F{i}"] for i in (1, 2, 3)), tuple(o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    rods, lanes = grid.straight_rods, np.uint64(grid.lanes)

    @kernel
    def find(b: Any, part: Any, outside: Any, shares: Any, before: Any, after: Any, share: Any) -> None:
        follows = before.shape[0] > NEAR
        for c in range(3):
            for k in range(part.node, part.behind):
                node = k + part.before - ONE  # of the whole arm
                force = (1 - share) * before[FORCE, c, node] + share * after[FORCE, c, node]
                if follows:
                    for d in range(3):
                        if k < part.last or part.behind == part.last:
                            near = (1 - share) * before[NEAR, d, node] + share * after[NEAR, d, node]
                            force += near * b[Q[3 * d + c] + k]
                        if node > 0:
                            far = (1 - share) * before[FAR, d, node - ONE] + share * after[FAR, d, node - ONE]
                            force += far * b[Q[3 * d + c] + k - ONE]
                for rod in range(rods):
                    outside[c, np.uint64(rod) * lanes + k] = shares[rod, node] * force

    @kernel
    def add(b: Any, part: Any, outside: Any) -> None:
        for c in range(3):
            for rod in range(rods):
                for k in range(np.uint64(rod) * lanes + part.node, np.uint64(rod) * lanes + part.behind):
                    b[F[c] + k] += outside[c, k]

    return find, add
