"""A run as fields over time and arclength: where the arm is, how it is curved and twisted, what is active, how far it is from the plan.

The planned and the simulated arm are read by the same formulas on the same places, so that a difference is a difference of shapes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.records import Record
from octoctrl.sim.running.recording import Recording

from ..carrying.results import Execution
from ..judging.comparison import planned_points

Floats = NDArray[np.float64]

PLACES, INSTANTS = 61, 150
"""Places along the arm and instants of a run at which a page shows it."""
RESTING = 1e-3
"""Largest level of a muscle group that counts as not taking part."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Motion(Record):
    """A run at F instants and M places that are evenly spaced in rest arclength.

    Attributes
    ----------
    time : (F,) float64, s
    chosen : (F,) int
        Their indices among the recorded instants.
    points, normals : (F, M, 3) float64
        Centreline (m), and unit vectors from it towards LM3.
    radius : (F, M) float64, m
        Of the skin: that at rest, thinner where the arm is stretched, so that it keeps its volume.
    curvature, twist : (F, M) float64, 1/m, rad/m
    planned_points : (F, M, 3) float64, m
    planned_curvature : (F, M) float64, 1/m
    distance : (F, M) float64, m
        From the planned place.
    levels : dict of str to (F, M) float64
        Activation of the muscle groups that take part.
    """

    time: Floats
    chosen: NDArray[np.int_]
    points: Floats
    normals: Floats
    radius: Floats
    curvature: Floats
    twist: Floats
    planned_points: Floats | None
    planned_curvature: Floats | None
    distance: Floats | None
    levels: dict[str, Floats]


def motion_of(run: Execution, *, instants: int = INSTANTS, places: int = PLACES) -> Motion:
    """Read a run at evenly spaced instants and places.

    Parameters
    ----------
    run : Execution
    instants : int
        At most; fewer if fewer were recorded.
    places : int

    Returns
    -------
    Motion
    """
    recording, arm = run.recording, run.plan.arm
    chosen = np.unique(np.round(np.linspace(0, len(recording.time) - 1, min(instants, len(recording.time)))).astype(int))
    time, arclength = recording.time[chosen], np.linspace(0.0, arm.length, places)
    nodes = rest_arclength(recording)
    points = _along(nodes, recording.points[chosen], arclength)
    centres = (nodes[1:] + nodes[:-1]) / 2
    stretch = _between(centres, recording.stretch[chosen], arclength)
    levels = _between(centres, np.moveaxis(recording.levels[chosen], 1, 2), arclength)
    drawn = [index for index in range(len(MUSCLE_GROUPS)) if recording.levels[:, index].max() > RESTING]
    width = outer_radius(arm, arclength)
    planned = planned_points(run.plan, run.clock[chosen])
    ghost = None if planned is None else _along(arm.edges, planned, arclength)
    return Motion(
        time=time,
        chosen=chosen,
        points=points,
        normals=_normals(recording, chosen, points, arclength),
        radius=width / np.sqrt(stretch),
        curvature=curvature(points, arclength, width),
        twist=twist_density(recording, chosen, arclength),
        planned_points=ghost,
        planned_curvature=None if ghost is None else curvature(ghost, arclength, width),
        distance=None if ghost is None else np.linalg.norm(points - ghost, axis=2),
        levels={MUSCLE_GROUPS[index]: levels[..., index] for index in drawn},
    )


def rest_arclength(recording: Recording) -> Floats:
    """Rest arclength (m) of the nodes (n + 1,) of a recording."""
    lengths = np.linalg.norm(np.diff(recording.points[0], axis=0), axis=1) / recording.stretch[0]
    return np.concatenate([[0.0], np.cumsum(lengths)])


def outer_radius(arm: Arm, arclength: Floats) -> Floats:
    """Radius (m) of the arm at rest at `arclength` (m)."""
    return np.asarray(arm.section(np.clip(arclength, 0.0, arm.length)).outer_radius, dtype=float)


def curvature(points: Floats, arclength: Floats, radius: Floats) -> Floats:
    """Curvature of centrelines, from second differences over the local radius.

    Parameters
    ----------
    points : (F, M, 3) float64, m
    arclength : (M,) float64, m
    radius : (M,) float64, m
        Over which a curvature is felt: a centreline of many thin rods has wiggles shorter than that.

    Returns
    -------
    (F, M) float64, 1/m
        Constant within a radius of either end.
    """
    reach = np.maximum(radius, arclength[1] - arclength[0])
    middle = np.clip(arclength, reach, arclength[-1] - reach)
    before, here, after = (_along(arclength, points, middle + shift * reach) for shift in (-1, 0, 1))
    left, right = here - before, after - here
    lengths = np.linalg.norm(left, axis=2), np.linalg.norm(right, axis=2)
    turn = left / lengths[0][..., None] - right / lengths[1][..., None]
    return 2 * np.linalg.norm(turn, axis=2) / (lengths[0] + lengths[1])


def twist_density(recording: Recording, chosen: NDArray[np.int_], arclength: Floats) -> Floats:
    """Material twist per rest length of a recording, rad/m: the rotation about d3 from each frame to the next.

    Parameters
    ----------
    recording : Recording
    chosen : (F,) int
        Instants.
    arclength : (M,) float64, m
        Places.

    Returns
    -------
    (F, M) float64, rad/m
    """
    frames, stations = recording.frames[chosen, 1:-1], recording.stations[1:-1]
    first, second = frames[:, :-1], frames[:, 1:]
    dot = np.einsum("fkic,fkjc->fkij", second[:, :, :2], first[:, :, :2])
    angle = np.arctan2(dot[..., 0, 1] - dot[..., 1, 0], dot[..., 0, 0] + dot[..., 1, 1])
    return _between((stations[1:] + stations[:-1]) / 2, angle / np.diff(stations), arclength)


def _along(places: Floats, values: Floats, wanted: Floats) -> Floats:
    """Smooth interpolation of `values` (F, K, 3) from `places` (K,) to `wanted` (M,)."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(places, values, axis=1)(wanted))


def _between(places: Floats, values: Floats, wanted: Floats) -> Floats:
    """Linear interpolation of `values` (F, K, ...) from `places` (K,) to `wanted` (M,), constant beyond the ends."""
    right = np.clip(np.searchsorted(places, wanted), 1, len(places) - 1)
    share = np.clip((wanted - places[right - 1]) / (places[right] - places[right - 1]), 0.0, 1.0)
    share = share.reshape(-1, *(1,) * (values.ndim - 2))
    return (1 - share) * values[:, right - 1] + share * values[:, right]


def _normals(recording: Recording, chosen: NDArray[np.int_], points: Floats, arclength: Floats) -> Floats:
    """Unit vectors (F, M, 3) towards LM3, which lies towards d1, made perpendicular to the centreline."""
    along = np.gradient(points, axis=1)
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    normals = _between(recording.stations, recording.frames[chosen, :, 0], arclength)
    normals = normals - np.sum(normals * along, axis=2, keepdims=True) * along
    return normals / np.linalg.norm(normals, axis=2, keepdims=True)
