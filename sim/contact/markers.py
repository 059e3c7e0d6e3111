"""With which points a body touches other bodies: balls where it is round, corners, rims and a net of its faces where it is not."""

from collections.abc import Sequence
from itertools import combinations
from math import ceil, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.mesh import Mesh
from ..scene.objects import Box, Capsule, Cylinder, RigidObject, Sphere
from ..scene.triangles import spread_over
from .columns import Anchor

Floats = NDArray[np.float64]

AROUND = 24
"""Points round a cylinder: between two of them it is nearer to its axis by 1 % of its radius."""
FINEST = 48
"""Most points along an edge or an axis."""


class Pairs(NamedTuple):
    """Bodies that may touch each other, K pairs of them; Q points on all bodies.

    Attributes
    ----------
    markers : (Q, 5) float64
        Place in the body's own frame, radius, and length for which a point stands, m.
    first : (M + 1,) int64
        Number of each body's first point.
    pairs : (K, 2) int64
        The smaller body, whose points they are, and the one whose distance counts.
    near : (K,) int64
        Whether they may meet until one looks again.
    anchors : (K, points, Anchor.WIDTH) float64
    """

    markers: Floats
    first: NDArray[np.int64]
    pairs: NDArray[np.int64]
    near: NDArray[np.int64]
    anchors: Floats

    @classmethod
    def of(cls, objects: Sequence[RigidObject]) -> "Pairs":
        """All pairs of which one can be moved by what touches it."""
        pairs = [
            tuple(sorted(pair, key=lambda index: objects[index].bound))
            for pair in combinations(range(len(objects)), 2)
            if any(objects[index].movable for index in pair)
        ]
        used = {pair[0] for pair in pairs}
        markers = [markers_of(item) if index in used else np.empty((0, 5)) for index, item in enumerate(objects)]
        counts = [len(rows) for rows in markers]
        return cls(
            markers=np.concatenate([*markers, np.empty((0, 5))]),
            first=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
            pairs=np.array(pairs, dtype=np.int64).reshape(-1, 2),
            near=np.zeros(len(pairs), dtype=np.int64),
            anchors=np.zeros((len(pairs), max(counts, default=0), Anchor.WIDTH)),
        )


def markers_of(item: RigidObject) -> Floats:
    """Points (Q, 5) of a body, as in `Pairs.markers`.

    Parameters
    ----------
    item : RigidObject
        Of any shape but a plane.
    """
    if isinstance(item, Sphere):
        return np.array([[0.0, 0.0, 0.0, item.radius, 2 * item.radius]])
    if isinstance(item, Capsule):
        # Balls as near to one another as for an arm of this radius.
        along = _spread(item.length / 2, 0.28 * item.radius)
        rows = np.zeros((len(along), 5))
        rows[:, 2], rows[:, 3], rows[:, 4] = along, item.radius, item.length / len(along)
        return rows
    if isinstance(item, Cylinder):
        along, angle = _spread(item.length / 2, item.radius / 2), 2 * pi * np.arange(AROUND) / AROUND
        ring = item.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        places = [[*point, height] for height in along for point in ring] + [[0.0, 0.0, along[0]], [0.0, 0.0, along[-1]]]
        return _bare(places, item.length / len(along))
    if isinstance(item, Mesh):
        apart = 2 * max(item.sizes) / 8
        return _bare(spread_over(item.corners, apart), apart)
    assert isinstance(item, Box)
    grids = [_spread(edge / 2, max(item.size) / 8) for edge in item.size]
    net = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, 3)
    return _bare(net[(np.abs(net) >= np.array(item.sizes) * (1 - 1e-12)).any(axis=1)], max(item.size) / 8)


def _spread(half: float, apart: float) -> Floats:
    """Places from -half to half, no further apart than that."""
    return np.linspace(-half, half, min(FINEST, max(2, ceil(2 * half / apart) + 1)))


def _bare(places: Floats | list[list[float]], length: float) -> Floats:
    """Rows of points without a radius."""
    found = np.asarray(places, dtype=float)
    return np.concatenate([found, np.zeros((len(found), 1)), np.full((len(found), 1), length)], axis=1)
