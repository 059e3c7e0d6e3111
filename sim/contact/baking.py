"""What of a mesh ends its body's row: its distances on a grid."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..scene.mesh import Mesh
from .baked_kernels import bake
from .columns import Grid

Floats = NDArray[np.float64]

LEAST_ROOM, ROOM = 3, 1 / 8
"""Between the surface and the grid's end: cells at least, and share of the longest side."""


def baked_row(item: Mesh) -> Floats:
    """Distances of a mesh as columns that follow `Body.WIDTH`, see `Grid`; to be read only."""
    return _baked(item.corners.tobytes(), item.cells)


@lru_cache(maxsize=16)
def _baked(surface: bytes, cells: int) -> Floats:
    corners = np.frombuffer(surface).reshape(-1, 3, 3)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    spacing = float((high - low).max()) / cells
    counts = np.ceil((high - low) / spacing).astype(int) + 2 * max(LEAST_ROOM, round(ROOM * cells)) + 1
    origin = (low + high) / 2 - spacing * (counts - 1) / 2
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    values = np.zeros(counts)
    bake(corners.copy(), np.column_stack([middle, radius]), origin, spacing, np.empty(len(corners), dtype=np.int64), values)
    found = np.concatenate([[spacing], counts, origin, values.ravel()])
    assert found.size == Grid.VALUES + values.size
    found.flags.writeable = False
    return found
