"""A centreline measured in an animal or a robot: points over time, perhaps with markers on the skin, and frames along it.

Nothing twists a line. Without markers the frames are carried along it by parallel transport from the base, so that they have no twist of
their own; with markers d1 points towards them.

References
----------
Bishop 1975, Am. Math. Mon. 82:246 (frames without twist).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..annotations import settle
from ..errors import OctoctrlError
from ..records import Record
from .inputs import BACKWARD, Floats, numbers, point_series

LEAST_POINTS = 4
FINE = 120
"""Elements to which a measured line is interpolated, at least: chords of a few points cut corners, which costs writhe."""
ALONG = 0.95
"""Share of a marker's distance from the line that may lie along the line; beyond it the marker says nothing of the direction across."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Centreline(Record):
    """Measured points of an arm, n of them from base to tip, at T instants.

    Attributes
    ----------
    name : str
    time : (T,) float64, s
        Increasing.
    points : (T, n, 3) float64, m
    markers : (T, n, 3) float64, m, optional
        A second line on the skin: one marker beside each point.

    Raises
    ------
    OctoctrlError
        If a shape is wrong, a number not finite, time does not increase, points coincide, or a marker lies on the line.
    """

    name: str = "centreline"
    time: Floats
    points: Floats
    markers: Floats | None = None

    def __post_init__(self) -> None:
        settle(self)
        object.__setattr__(self, "points", numbers("points", self.points))
        series, _ = point_series(self.points)
        time = np.atleast_1d(numbers("time", self.time))
        if self.points.ndim != 3 or series.shape[1] < LEAST_POINTS:
            raise OctoctrlError(
                f"points has shape {self.points.shape}; (T, n, 3) with at least {LEAST_POINTS} points along the arm is needed"
            )
        if time.shape != series.shape[:1] or np.any(np.diff(time) <= 0):
            raise OctoctrlError(
                f"time has shape {time.shape} for {len(series)} instants, or does not increase; one later value per instant is needed"
            )
        if self.markers is not None and (found := numbers("markers", self.markers).shape) != series.shape:
            raise OctoctrlError(f"markers has shape {found}, points {series.shape}; one marker beside each point is needed")

    @property
    def length(self) -> Floats:
        """Length (T,), m, along the points."""
        found: Floats = np.linalg.norm(np.diff(self.points, axis=1), axis=2).sum(axis=1)
        return found

    def ribbon(self, elements: int | None = None) -> tuple[Floats, Floats]:
        """Fine points and frames, as `octoctrl.sim.topology.measures.measure` takes them.

        Parameters
        ----------
        elements : int, optional
            Of the fine line; at least 8 for each measured point if omitted.

        Returns
        -------
        points : (T, elements + 1, 3) float64, m
            On a cubic spline through the measured ones.
        frames : (T, elements + 2, 3, 3) float64
            Rows d1, d2, d3 at base, element centres, tip. d1 points to the markers; without them it is carried from the base without
            twist, where it is carried on in time.
        """
        from scipy.interpolate import CubicSpline

        count = self.points.shape[1]
        elements = max(FINE, 8 * (count - 1)) if elements is None else elements
        places = np.linspace(0.0, 1.0, elements + 1)
        chords = np.linalg.norm(np.diff(self.points, axis=1), axis=2)
        known = np.concatenate([np.zeros((len(chords), 1)), chords.cumsum(axis=1)], axis=1)
        known /= known[:, -1:]
        points = np.stack([CubicSpline(at, line)(places) for at, line in zip(known, self.points, strict=True)])
        edges = np.diff(points, axis=1)
        tangents = edges / np.linalg.norm(edges, axis=2, keepdims=True)
        normals = transported(tangents, _base_normals(tangents[:, 0]))
        if self.markers is not None:
            centres = (places[1:] + places[:-1]) / 2
            angle = np.stack(
                [CubicSpline(at, turn)(centres) for at, turn in zip(known, self._azimuth(known, centres, tangents, normals), strict=True)]
            )
            normals = np.cos(angle)[..., None] * normals + np.sin(angle)[..., None] * np.cross(tangents, normals)
        frames = np.stack([normals, np.cross(tangents, normals), tangents], axis=2)
        return points, frames[:, [0, *range(elements), elements - 1]]

    def _azimuth(self, known: Floats, centres: Floats, tangents: Floats, normals: Floats) -> Floats:
        """Angle (T, n) of the markers from the frames without twist, about the tangent, unwrapped from base to tip."""
        assert self.markers is not None
        angles = np.empty(self.points.shape[:2])
        for instant, places in enumerate(known):
            index = np.clip(np.searchsorted(centres, places), 0, len(centres) - 1)
            aside = self.markers[instant] - self.points[instant]
            along, first = tangents[instant, index], normals[instant, index]
            distance = np.linalg.norm(aside, axis=1)
            if np.any(distance <= 1e-12) or np.any(np.abs(np.sum(aside * along, axis=1)) > ALONG * distance):
                bad = int(np.argmax(np.abs(np.sum(aside * along, axis=1)) - ALONG * distance))
                raise OctoctrlError(
                    f"marker {bad} of instant {instant} lies on the centreline or ahead of it; it must lie beside it, on the skin"
                )
            angles[instant] = np.unwrap(np.arctan2(np.sum(aside * np.cross(along, first), axis=1), np.sum(aside * first, axis=1)))
        return angles


def transported(tangents: ArrayLike, first: ArrayLike) -> Floats:
    """Unit normals carried along lines without twist.

    Parameters
    ----------
    tangents : (T, n, 3) array_like
        Unit vectors of the segments.
    first : (T, 3) array_like
        Normal of the first segment.

    Returns
    -------
    (T, n, 3) float64

    Raises
    ------
    OctoctrlError
        If two segments fold back on each other.
    """
    along = np.asarray(tangents, dtype=float)
    normals = np.empty_like(along)
    normals[:, 0] = np.asarray(first, dtype=float)
    for k in range(1, along.shape[1]):
        normals[:, k] = _carried(normals[:, k - 1], along[:, k - 1], along[:, k], f"segments {k - 1} and {k}")
    return normals


def _carried(normal: NDArray[np.float64], before: Floats, after: Floats, what: str) -> Floats:
    """Normals (T, 3) turned by the smallest rotation that takes tangents `before` to `after`."""
    cosine = np.sum(before * after, axis=1, keepdims=True)
    if cosine.min() < BACKWARD:
        raise OctoctrlError(f"{what} of the fine line fold back on each other; measure more points where the arm bends sharply")
    axis = np.cross(before, after)
    turned = normal + np.cross(axis, normal) + np.cross(axis, np.cross(axis, normal)) / (1 + cosine)
    turned -= np.sum(turned * after, axis=1, keepdims=True) * after
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def _base_normals(tangents: Floats) -> Floats:
    """A normal (T, 3) of the base at every instant, carried on in time; at first as near to +z as can be, or to +x."""
    aside = np.array([0.0, 0.0, 1.0]) if abs(tangents[0, 2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    normals = np.empty_like(tangents)
    normal = aside - (aside @ tangents[0]) * tangents[0]
    normals[0] = normal / np.linalg.norm(normal)
    for k in range(1, len(tangents)):
        if tangents[k] @ tangents[k - 1] < BACKWARD:
            raise OctoctrlError(f"the base turns round between instants {k - 1} and {k}; record more often")
        normals[k : k + 1] = _carried(normals[k - 1 : k], tangents[k - 1 : k], tangents[k : k + 1], "base tangents")
    return normals
