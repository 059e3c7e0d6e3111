"""How an arm holds an object: how often it winds round it, how much of that touches, and how firmly.

Winding alone flatters: a curl in free water beside a post counts as well. What is covered counts only where the arm lies on the object.
"""

from math import tau

import numpy as np
from numpy.typing import NDArray

from ..compiler import kernel
from ..scene.objects import Capsule, Cylinder, RigidObject
from .bodies import rows_of
from .columns import Body
from .shape_kernels import distance

Floats = NDArray[np.float64]

POSITION, FRAME = int(Body.POSITION), int(Body.FRAME)
COVERED = 2e-3
"""Gap (m) up to which an element counts as lying on the object."""


def winding(points: Floats, position: Floats, frame: Floats) -> Floats:
    """Turns of a centreline about an object's axis, seen against that axis.

    Parameters
    ----------
    points : (T, n + 1, 3) float64, m
    position : (T, 3) float64, m
        Of the object.
    frame : (T, 3, 3) float64
        Its directors, rows; d3 is the axis.

    Returns
    -------
    (T,) float64, turns
        Positive for the sense of a right-handed turn about d3.
    """
    return turns(points, position, frame).sum(axis=1)


def covered_winding(points: Floats, radius: Floats, item: RigidObject, position: Floats, frame: Floats) -> Floats:
    """Turns of those elements that lie on the object, within its length.

    Parameters
    ----------
    points : (T, n + 1, 3) float64, m
    radius : (n,) float64, m
        Of the arm's elements.
    item : RigidObject
    position : (T, 3) float64, m
    frame : (T, 3, 3) float64

    Returns
    -------
    (T,) float64, turns
    """
    middle = (points[:, 1:] + points[:, :-1]) / 2
    on = gaps(middle, item, position, frame) - radius < COVERED
    if isinstance(item, Capsule | Cylinder):
        along = np.einsum("tkc,tc->tk", middle - position[:, None], frame[:, 2])
        on &= np.abs(along) <= item.length / 2
    return np.asarray((turns(points, position, frame) * on).sum(axis=1))


def gaps(points: Floats, item: RigidObject, position: Floats, frame: Floats) -> Floats:
    """Signed distances (T, n) of points (T, n, 3), m, from an object that moves as `position` (T, 3) and `frame` (T, 3, 3) say."""
    row = rows_of([item])[0]
    found = np.empty(points.shape[:2])
    _measure(np.ascontiguousarray(points), row, np.ascontiguousarray(position), np.ascontiguousarray(frame), found)
    return found


def turns(points: Floats, position: Floats, frame: Floats) -> Floats:
    """Turns (T, n) that each element makes about the axis."""
    local = np.einsum("tkc,tic->tki", points - position[:, None], frame[:, :2])
    angle = np.arctan2(local[..., 1], local[..., 0])
    return (np.diff(angle, axis=1) + tau / 2) % tau / tau - 0.5


@kernel
def _measure(points: Floats, row: Floats, position: Floats, frame: Floats, found: Floats) -> None:
    for t in range(points.shape[0]):
        for i in range(3):
            row[POSITION + i] = position[t, i]
            for j in range(3):
                row[FRAME + 3 * i + j] = frame[t, i, j]
        for k in range(points.shape[1]):
            found[t, k] = distance(row, points[t, k, 0], points[t, k, 1], points[t, k, 2])[0]
