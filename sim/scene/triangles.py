"""Closed surfaces of triangles: whether they are closed, what they enclose, and points spread over them.

A solid is summed from the tetrahedra that its triangles make with the origin, each with its sign: volume, centre, second moments (Tonon
2004, J. Math. Stat. 1:8; the moments of a simplex with one corner at the origin are V/20 (sum of v v^T + (sum of v)(sum of v)^T)).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import OctoctrlError

Floats = NDArray[np.float64]
Triangles = NDArray[np.int64]


class Solid(NamedTuple):
    """What a closed surface encloses.

    Attributes
    ----------
    volume : float, m^3
    centre : (3,) float64, m
        Of mass.
    gyration : (3, 3) float64, m^2
        Tensor of inertia about the centre over the mass.
    """

    volume: float
    centre: Floats
    gyration: Floats


def enclosed(corners: Floats) -> Solid:
    """What the triangles with `corners` (K, 3, 3), m, enclose; the volume is negative where they are the inside out."""
    volumes = np.linalg.det(corners) / 6
    volume = float(volumes.sum())
    sums = corners.sum(axis=1)
    centre = (volumes[:, None] * sums).sum(axis=0) / (4 * volume)
    outer = np.einsum("kci,kcj->kij", corners, corners) + np.einsum("ki,kj->kij", sums, sums)
    moments = np.einsum("k,kij->ij", volumes, outer) / (20 * volume) - np.outer(centre, centre)
    return Solid(volume, centre, np.trace(moments) * np.eye(3) - moments)


def check_closed(triangles: Triangles, what: str) -> None:
    """Check that each edge of `triangles` (K, 3) is one of two of them, which go along it in opposite ways.

    Raises
    ------
    OctoctrlError
        If they do not; `what` they are of begins the message.
    """
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    order = np.sort(edges, axis=1)
    _, place, count = np.unique(order, axis=0, return_inverse=True, return_counts=True)
    way = np.bincount(place.ravel(), weights=np.where(edges[:, 0] < edges[:, 1], 1.0, -1.0))
    wrong = (count != 2) | (way != 0)
    if wrong.any():
        a, b = order[np.flatnonzero(wrong[place.ravel()])[0]]
        raise OctoctrlError(
            f"{what}: its surface is not closed: of {len(count)} edges {int(wrong.sum())} do not lie between two triangles that go along "
            f"them in opposite ways, the first between the corners {a} and {b}; mend it in the program that made it"
        )


def spread_over(corners: Floats, apart: float) -> Floats:
    """Points (Q, 3) of the surface with `corners` (K, 3, 3), m: the outermost in each cube of an edge of `apart`, m."""
    while len(corners) and np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() > apart:
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
        corners = np.concatenate([np.stack(part, axis=1) for part in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])
    points = np.unique(corners.reshape(-1, 3), axis=0)
    points = points[np.argsort(-np.linalg.norm(points, axis=1), kind="stable")]
    _, first = np.unique(np.floor(points / apart), axis=0, return_index=True)
    return points[np.sort(first)]
