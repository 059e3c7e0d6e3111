"""Fibres traced in an arm, for example by diffusion imaging: how steeply they wind, which way, how far out, and their muscle layout.

Each fibre is read in the frame without twist along the arm's axis: its azimuth against arclength gives turns per length, with the radius
the angle to the axis. The angle of one fibre changes along a taper; its pitch need not.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import OctoctrlError
from ..records import Record
from .arm import Arm
from .layout import MuscleLayout

Floats = NDArray[np.float64]

LONGITUDINAL_BELOW, TRANSVERSE_ABOVE = np.radians(15.0), np.radians(82.0)
"""Angles to the axis that part the families; the octopus's oblique fibres wind at 43 to 74 degrees."""
STATIONS = 200
OUTERMOST = 0.95
"""Share of the fibres' points within the radius that counts as the arm's."""


class FibreKind(StrEnum):
    """Family of a fibre."""

    LONGITUDINAL = "longitudinal"
    RIGHT = "right-handed oblique"
    LEFT = "left-handed oblique"
    TRANSVERSE = "transverse"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class FibreWinding(Record):
    """How F fibres run in an arm.

    Attributes
    ----------
    length, base_radius, taper : float, m, m, 1
        Of the arm, as far as the fibres reach.
    turns : (F,) float64, 1/m
        Turns about the axis per length of it; positive winds like a right-handed screw.
    angle : (F,) float64, rad
        To the axis, at the fibre's mean radius.
    radius_share : (F,) float64
        Median distance from the axis over the arm's radius there.
    azimuth : (F,) float64, rad
        Mean, from the axis' normal towards its binormal; of longitudinal fibres.
    kinds : tuple of FibreKind
    """

    length: float
    base_radius: float
    taper: float
    turns: Floats
    angle: Floats
    radius_share: Floats
    azimuth: Floats
    kinds: tuple[FibreKind, ...]

    def of(self, kind: FibreKind) -> NDArray[np.int_]:
        """Indices of the fibres of a `kind`."""
        return np.flatnonzero([found is kind for found in self.kinds])

    @property
    def pitch(self) -> float:
        """Median axial length of one turn of the oblique fibres, m; not a number if there are none."""
        oblique = np.concatenate([self.of(FibreKind.RIGHT), self.of(FibreKind.LEFT)])
        return float(1 / np.median(np.abs(self.turns[oblique]))) if oblique.size else float("nan")

    @property
    def muscles(self) -> int:
        """Longitudinal muscles: bundles of fibres that wider gaps of azimuth part."""
        azimuth = np.sort(self.azimuth[self.of(FibreKind.LONGITUDINAL)] % (2 * np.pi))
        if azimuth.size < 2:
            return int(azimuth.size)
        gaps = np.diff(np.append(azimuth, azimuth[0] + 2 * np.pi))
        return int(np.sum(gaps > gaps.max() / 2))

    @property
    def layout(self) -> MuscleLayout:
        """Muscle groups of an arm with such fibres: so many longitudinal muscles, evenly spaced, and both oblique families or none.

        Raises
        ------
        OctoctrlError
            If there are fewer than three longitudinal muscles.
        """
        return MuscleLayout.evenly(self.muscles, oblique=np.isfinite(self.pitch))

    def arm(self, like: Arm | None = None) -> Arm:
        """An arm of this outline whose oblique fibres have this pitch; all else is that of `like`, the octopus arm if omitted."""
        like = Arm.octopus() if like is None else like
        pitch = self.pitch if np.isfinite(self.pitch) else like.oblique_pitch
        share = self.length / like.length
        return replace(
            like,
            name="from-fibres",
            length=self.length,
            base_radius=self.base_radius,
            taper=self.taper,
            oblique_pitch=pitch,
            ring_radius=like.ring_radius * share,
            oblique_radius=like.oblique_radius * self.base_radius / like.base_radius,
        )

    def __str__(self) -> str:
        lines = [
            f"{len(self.kinds)} fibres in an arm of {1e3 * self.length:.0f} mm, radius {1e3 * self.base_radius:.1f} mm at the base, "
            f"taper {self.taper:.1f}; {self.muscles} longitudinal muscles; pitch of the oblique fibres {1e3 * self.pitch:.1f} mm",
            f" {'family':24}{'fibres':>8}{'angle to the axis':>22}{'radius share':>14}",
        ]
        for kind in FibreKind:
            index = self.of(kind)
            if index.size:
                low, high = np.degrees(np.abs(self.angle[index])).min(), np.degrees(np.abs(self.angle[index])).max()
                lines.append(
                    f" {kind.value:24}{index.size:>8}{f'{low:.0f} to {high:.0f} deg':>22}{np.median(self.radius_share[index]):>14.2f}"
                )
        return "\n".join(lines)


def winding_of(fibres: Sequence[Floats], axis: Floats | None = None) -> FibreWinding:
    """Read how fibres wind about the axis of an arm.

    Parameters
    ----------
    fibres : sequence of (k, 3) float64, m
        Points along each fibre, at least three.
    axis : (n, 3) float64, m, optional
        Points of the arm's axis from base to tip; if omitted, the middle of the fibres, slice by slice along their longest extent, the
        thicker end as the base.

    Returns
    -------
    FibreWinding

    Raises
    ------
    OctoctrlError
        If there are no fibres, one is too short, a number is not finite, or the axis is no line.
    """
    lines = [np.asarray(fibre, dtype=float) for fibre in fibres]
    if not lines:
        raise OctoctrlError("there are no fibres; give at least one")
    for number, line in enumerate(lines):
        if line.ndim != 2 or line.shape[1] != 3 or len(line) < 3 or not np.isfinite(line).all():
            raise OctoctrlError(
                f"fibre {number} has shape {line.shape} or a number that is not finite; (k, 3) with 3 points or more is needed"
            )
    arclength, points, normals, binormals = _axis(np.concatenate(lines) if axis is None else None, axis)
    places = [_places(line, arclength, points, normals, binormals) for line in lines]
    along, distance = (np.concatenate([place[k] for place in places]) for k in (0, 2))
    radius = _outline(along, distance, arclength[-1])
    turns, angle, share, azimuth, kinds = [], [], [], [], []
    for s, turn, r in places:
        order = np.unwrap(turn)
        run, round_about = np.ptp(s), np.ptp(order)
        slope = float(np.polyfit(s, order, 1)[0]) if run > 0 else 0.0
        tilt = np.arctan2(round_about * np.median(r), run)
        kind = FibreKind.RIGHT if slope > 0 else FibreKind.LEFT
        if tilt < LONGITUDINAL_BELOW:
            kind = FibreKind.LONGITUDINAL
        elif tilt > TRANSVERSE_ABOVE:
            kind = FibreKind.TRANSVERSE
        turns.append(slope / (2 * np.pi))
        angle.append(np.sign(slope) * tilt)
        share.append(float(np.median(r / np.polyval(radius, s))))
        azimuth.append(float(np.angle(np.exp(1j * turn).mean())))
        kinds.append(kind)
    base, tip = np.polyval(radius, [0.0, arclength[-1]])
    return FibreWinding(
        length=float(arclength[-1]),
        base_radius=float(base),
        taper=float(np.clip(base / max(tip, base / 50), 1.0, 50.0)),
        turns=np.array(turns),
        angle=np.array(angle),
        radius_share=np.array(share),
        azimuth=np.array(azimuth),
        kinds=tuple(kinds),
    )


def _axis(cloud: Floats | None, axis: Floats | None) -> tuple[Floats, Floats, Floats, Floats]:
    """Arclength (K,), points, normals and binormals (K, 3) of a smooth axis, carried along it without twist."""
    from scipy.interpolate import CubicSpline

    if axis is None:
        assert cloud is not None
        middle = cloud.mean(axis=0)
        along = (cloud - middle) @ np.linalg.svd(cloud - middle, full_matrices=False)[2][0]
        edges = np.linspace(along.min(), along.max(), 25)
        inside = np.clip(np.searchsorted(edges, along) - 1, 0, 23)
        slices = [cloud[inside == k] for k in range(24) if np.any(inside == k)]
        known = np.array([(part.min(axis=0) + part.max(axis=0)) / 2 for part in slices])
        wide = [np.linalg.norm(part - centre, axis=1).mean() for part, centre in zip(slices, known, strict=True)]
        if np.polyfit(np.arange(len(wide)), wide, 1)[0] > 0:
            known = known[::-1]
    else:
        known = np.asarray(axis, dtype=float)
    steps = np.linalg.norm(np.diff(known, axis=0), axis=1) if known.ndim == 2 and known.shape[-1] == 3 else np.zeros(1)
    if len(steps) < 3 or not np.all(steps > 0):
        raise OctoctrlError("the axis is no line of at least 4 points that differ; give the arm's axis from base to tip")
    place = np.concatenate([[0.0], steps.cumsum()])
    spline = CubicSpline(place, known)
    arclength = np.linspace(0.0, place[-1], STATIONS)
    points, tangents = spline(arclength), spline(arclength, 1)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    aside = np.array([0.0, 0.0, 1.0]) if abs(tangents[0, 2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    normals = np.empty_like(points)
    normal = aside
    for k, tangent in enumerate(tangents):
        normal = normal - (normal @ tangent) * tangent
        normal /= np.linalg.norm(normal)
        normals[k] = normal
    return arclength, points, normals, np.cross(tangents, normals)


def _places(line: Floats, arclength: Floats, points: Floats, normals: Floats, binormals: Floats) -> tuple[Floats, Floats, Floats]:
    """Arclength, azimuth and distance from the axis (k,) of the points of a fibre."""
    from scipy.spatial import cKDTree

    nearest = cKDTree(points).query(line)[1]
    aside = line - points[nearest]
    tangents = np.cross(normals[nearest], binormals[nearest])
    x, y = np.sum(aside * normals[nearest], axis=1), np.sum(aside * binormals[nearest], axis=1)
    return arclength[nearest] + np.sum(aside * tangents, axis=1), np.arctan2(y, x), np.hypot(x, y)


def _outline(along: Floats, distance: Floats, length: float) -> Floats:
    """Straight line of the arm's radius over arclength, as `numpy.polyval` takes it: through the outermost points of ten stretches."""
    edges = np.linspace(0.0, length, 11)
    middle, outer = [], []
    for low, high in pairwise(edges):
        inside = distance[(along >= low) & (along <= high)]
        if inside.size:
            middle.append((low + high) / 2)
            outer.append(np.quantile(inside, OUTERMOST))
    if len(middle) < 2:
        return np.array([0.0, max(float(distance.max()), 1e-9)])
    line = np.polyfit(middle, outer, 1)
    ends = np.maximum(np.polyval(line, [0.0, length]), 1e-3 * max(outer))
    return np.array([(ends[1] - ends[0]) / length, ends[0]])
