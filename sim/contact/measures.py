"""How an arm holds an object: how often it winds round it, how much of that touches, and how firmly.

Winding alone flatters: a curl in free water beside a post counts as well. What is covered counts only where the arm lies on the object.
"""

from math import tau

import numpy as np
from numpy.typing import NDArray

from ..compiler import kernel
from ..scene.objects import Capsule, Cylinder, RigidObject
from .bodies import still_row
from .shape_kernels import distance

Floats = NDArray[np.float64]

COVERED = 2e-3
"""Gap (m) up to which the arm counts as lying on the object."""


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
    """Turns of what lies on the object, within its length.

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
    along = np.einsum("tkc,tc->tk", middle - position[:, None], frame[:, 2])
    share = lying(gaps(middle, item, position, frame) - radius, along, item)
    return np.asarray((turns(points, position, frame) * share).sum(axis=1))


def lying(gap: Floats, along: Floats, item: RigidObject) -> Floats:
    """Share (T, n) of each element that lies on an object, within its length, between 0 and 1.

    What is in and what is out is told from the middles of the elements, and taken to change linearly from one to the next: were elements
    counted as a whole, covered winding would jump by as much as a long one turns.

    Parameters
    ----------
    gap : (T, n) float64, m
        Between the surface of each element's middle and the object's.
    along : (T, n) float64, m
        Place of the middle along the object's axis, from its centre.
    item : RigidObject
    """
    out = gap - COVERED
    if isinstance(item, Capsule | Cylinder):
        out = np.maximum(out, np.abs(along) - item.length / 2)
    ends = np.pad((out[:, 1:] + out[:, :-1]) / 2, ((0, 0), (1, 1)))
    ends[:, 0], ends[:, -1] = out[:, 0], out[:, -1]
    return (_below(ends[:, :-1], out) + _below(out, ends[:, 1:])) / 2


def _below(begin: Floats, end: Floats) -> Floats:
    """Share of the way from one number to the other that is below nought."""
    low, width = np.minimum(begin, end), np.abs(end - begin)
    return np.clip(-low / np.maximum(width, 1e-12), 0.0, 1.0)


def gaps(points: Floats, item: RigidObject, position: Floats, frame: Floats) -> Floats:
    """Signed distances (T, n) of points (T, n, 3), m, from an object that moves as `position` (T, 3) and `frame` (T, 3, 3) say."""
    found = np.empty(points.shape[:2])
    _measure(np.ascontiguousarray(points), still_row(item), np.ascontiguousarray(position), np.ascontiguousarray(frame), found)
    return found


def turns(points: Floats, position: Floats, frame: Floats) -> Floats:
    """Turns (T, n) that each element makes about the axis."""
    local = np.einsum("tkc,tic->tki", points - position[:, None], frame[:, :2])
    angle = np.arctan2(local[..., 1], local[..., 0])
    return (np.diff(angle, axis=1) + tau / 2) % tau / tau - 0.5


@kernel
def _measure(points: Floats, row: Floats, position: Floats, frame: Floats, found: Floats) -> None:
    for t in range(points.shape[0]):
        for k in range(points.shape[1]):
            y1, y2, y3 = points[t, k, 0] - position[t, 0], points[t, k, 1] - position[t, 1], points[t, k, 2] - position[t, 2]
            a = y1 * frame[t, 0, 0] + y2 * frame[t, 0, 1] + y3 * frame[t, 0, 2]
            b = y1 * frame[t, 1, 0] + y2 * frame[t, 1, 1] + y3 * frame[t, 1, 2]
            c = y1 * frame[t, 2, 0] + y2 * frame[t, 2, 1] + y3 * frame[t, 2, 2]
            found[t, k] = distance(row, a, b, c)[0]
