"""What the traits of an anatomy compile beside the laws of the octopus arm.

Sliding base (squid tentacle of Tekinalp et al. 2024, SI): the first nodes of muscles and helices only stay in their plane.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from .family_kernels import family_offsets

ONE = np.uint64(1)


def sliding_base(grid: AssemblyGrid) -> Any:
    """Compile ``slide(buffer, part)``: take the first nodes of muscles and helices their velocity along the arm."""
    V2 = family_offsets(grid, False)["V2"]
    muscles = tuple(rod * grid.lanes + 1 for rod in range(1, grid.straight_rods))
    helices = tuple((grid.straight_rods + grid.helix_nodes * j) * grid.lanes + 1 for j in range(grid.helices))
    nodes = tuple(np.uint64(place) for place in muscles + helices)

    @kernel
    def slide(b: Any, part: Any) -> None:
        if part.before == 0:
            for node in nodes:
                b[V2 + node] = 0.0

    return slide
