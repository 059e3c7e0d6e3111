"""What ends the row of a body that is a mesh: its distances on a grid."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..scene.mesh import Mesh, Same
from .baked_kernels import bake
from .columns import Body, Grid

Floats = NDArray[np.float64]

LEAST_ROOM, ROOM = 3, 1 / 8
"""Between the surface and the grid's end: cells at least, and share of the longest side."""


def baked_row(item: Mesh) -> Floats:
    """Row of a mesh that lies at the origin along the axes, as far as distances ask for it: to be read only, for it is kept."""
    return _baked(Same(item.corners), item.cells)


@lru_cache(maxsize=16)
def _baked(surface: Same, cells: int) -> Floats:
    (corners,) = surface.parts
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    spacing = float((high - low).max()) / cells
    counts = np.ceil((high - low) / spacing).astype(int) + 2 * max(LEAST_ROOM, round(ROOM * cells)) + 1
    origin = (low + high) / 2 - spacing * (counts - 1) / 2
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    values = np.zeros(counts)
    bake(corners.copy(), np.column_stack([middle, radius]), origin, spacing, np.empty(len(corners), dtype=np.int64), values)
    found = np.concatenate([np.zeros(Body.WIDTH), [spacing], counts, origin, values.ravel()])
    assert found.size == Body.WIDTH + Grid.VALUES + values.size
    found[Body.SHAPE], found[Body.SIZE : Body.SIZE + 3] = Mesh.kind, np.abs(corners).max(axis=(0, 1))
    found[Body.FRAME : Body.FRAME + 9] = np.eye(3).ravel()
    return found
