"""Link, writhe and twist of an arm, measured on its nodes and frames; sucker side, packet position and shape of sections.

Turns throughout; right-handed ribbon twist and right-handed helices are positive. Points are nodes (n+1, 3) in any length unit; frames
(m, 3, 3) have rows d1, d2, d3 (laboratory to material) with d3 along the arm, at any m >= 2 stations, usually base, element centres, tip.
A series has time as its leading axis. Input that is not finite, of the wrong shape or degenerate raises `OctoctrlError`.

For an open arm "writhe" means the curve continued by a straight ray at both ends along its end tangents. That writhe jumps by 2
whenever the curve passes through itself. *Lifted* writhe is measured as the spherical area between a fixed pole and the
tangent curve and has no such jumps: lifted writhe = writhe + 2 n with n the signed count of self-crossings.

References
----------
Calugareanu 1961, Czech. Math. J. 11:588; White 1969, Am. J. Math. 91:693; Fuller 1971, PNAS 68:815 (link = writhe + twist).
Fuller 1978, PNAS 75:3557, eqs. 3-5 (writhe as area, modulo 2). Klenin & Langowski 2000, Biopolymers 54:307 (polylines).
Charles, Gazzola & Mahadevan 2019, Phys. Rev. Lett. 123:208003 (end rays of an open filament).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import OctoctrlError, check_number
from ..rotations import ribbon_frames
from . import topology_kernels as kernels
from .inputs import Direction, Floats, arm_pole, check_frames_follow, frame_series, numbers, one_curve, point_series, ribbon, unit_pole
from .meter import Meter
from .trace import TopologyConvention, TopologyTrace

FOLD = 1e-12
"""1 + cosine between two tangents below which a segment folds back on the one before."""

SECTION_SHAPES = {1: "straight", 2: "planar", 3: "helical"}
"""Names of the dimensions returned by `classify_sections`."""


def writhe(points: ArrayLike, ray_length: float = 1000.0) -> float | Floats:
    """Gauss writhe of a polyline.

    Parameters
    ----------
    points : (n+1, 3) or (T, n+1, 3) array_like
    ray_length : float, lengths of the polyline
        Length of the rays that continue the first and last segment. 0: no rays; a polyline whose last point equals
        its first is then a closed curve.

    Returns
    -------
    float or (T,) float64, turns
    """
    series, single = point_series(points)
    values = np.empty(series.shape[0])
    kernels.writhe_series(series, _end_directions(series), _checked_ray(ray_length), values)
    return float(values[0]) if single else values


def writhe_map(points: ArrayLike, sections: int | None = None, ray_length: float = 1000.0) -> Floats:
    """Writhe of each pair of stretches of the arm.

    Parameters
    ----------
    points : (n+1, 3) array_like
    sections : int, optional
        Number of stretches of equal segment count (to one); one per segment when omitted.
    ray_length : float, lengths of the polyline
        As in `writhe`.

    Returns
    -------
    (sections, sections) or (sections + 2, sections + 2) float64, turns
        Symmetric (each pair stands there twice, by halves); its sum is the writhe. Rays have the first and last row and column.
    """
    curve, ray_length = one_curve(points), _checked_ray(ray_length)
    count, directions = curve.shape[0] - 1, _end_directions(curve[None])[0]
    nodes = np.empty((3, count + 3))
    used = kernels.extend(curve, directions[0], directions[1], ray_length * kernels.polyline_length(curve), nodes)
    pairs = np.empty((used - 1, used - 1))
    kernels.pair_matrix(nodes, used, pairs)
    if sections is None:
        return pairs
    inner = _section_starts(count, sections)
    starts = np.concatenate([[0], inner + 1, [count + 1]]) if used == count + 3 else inner
    return np.add.reduceat(np.add.reduceat(pairs, starts, axis=0), starts, axis=1)


def writhe_density(points: ArrayLike, ray_length: float = 1000.0) -> Floats:
    """Writhe of each segment: its share of the double sum.

    Parameters
    ----------
    points : (n+1, 3) array_like
    ray_length : float, lengths of the polyline
        As in `writhe`.

    Returns
    -------
    (n,) float64, turns
        Sums to the writhe. A pair of segments is shared half and half, a pair of segment and ray goes to the segment, the pair of
        rays to the first and last segment.
    """
    pairs = writhe_map(points, None, ray_length)
    if _checked_ray(ray_length) == 0.0:
        return pairs.sum(axis=1)
    density = pairs[1:-1, 1:-1].sum(axis=1) + 2.0 * (pairs[1:-1, 0] + pairs[1:-1, -1])
    density[[0, -1]] += pairs[0, -1]
    return density


def link(points: ArrayLike, normals: ArrayLike, radius: ArrayLike, ray_length: float = 1000.0) -> float:
    """Link of a centreline and the curve beside it, by the double sum over all segment pairs: the referee of the other measures.

    Parameters
    ----------
    points : (n+1, 3) array_like
    normals : (n, 3) array_like
        Material direction of each segment, not parallel to it.
    radius : float or (n,) array_like
        Distance of the second curve, in the unit of the points; small against the gap between neighbouring loops.
    ray_length : float, lengths of the polyline
        Both curves continue along the first and last segment of the centreline; 0 for no rays. A polyline whose last point equals its
        first is then a closed curve, and so is the curve beside it: link is a whole number.

    Returns
    -------
    float, turns
    """
    curve, tangents, directors = ribbon(points, normals)
    radii = numbers("radius", radius)
    if radii.shape not in ((), (curve.shape[0] - 1,)) or np.any(radii <= 0.0):
        raise OctoctrlError(f"radius is {radius!r}; a positive number or one per segment ({curve.shape[0] - 1},) is needed")
    ray = _checked_ray(ray_length) * kernels.polyline_length(curve)
    offsets = np.broadcast_to(radii, tangents.shape[:1])[:, None] * directors
    start = offsets[-1:] if ray == 0.0 and _is_closed(curve) else offsets[:1]
    beside = curve + np.concatenate([start, offsets])
    first, second = np.empty((2, 3, curve.shape[0] + 2))
    count = kernels.extend(curve, tangents[0], tangents[-1], ray, first)
    kernels.extend(beside, tangents[0], tangents[-1], ray, second)
    return float(kernels.link_of_curves(first[:, :count], second[:, :count]))


def twist(points: ArrayLike, normals: ArrayLike) -> float:
    """Twist of a ribbon: the rotation of its normals about the centreline beyond parallel transport.

    Parameters
    ----------
    points : (n+1, 3) array_like
    normals : (n, 3) array_like
        Material direction of each segment.

    Returns
    -------
    float, turns
        From the first to the last segment: a straight arm with uniform twist gives (n-1)/n of it. Less than half a turn per node. Of a
        polyline whose last point equals its first, the turn from the last segment to the first counts too.

    Raises
    ------
    OctoctrlError
        If two segments fold back on each other: nothing can be carried over their node.
    """
    curve, tangents, directors = ribbon(points, normals)
    if _is_closed(curve):
        curve, tangents, directors = (np.concatenate([a, a[k : k + 1]]) for a, k in ((curve, 1), (tangents, 0), (directors, 0)))
    bends = np.einsum("ij,ij->i", tangents[1:], tangents[:-1])
    if bends.min(initial=1.0) < FOLD - 1.0:
        node = int(np.argmin(bends))
        raise OctoctrlError(f"segments {node} and {node + 1} fold back on each other; twist over their node has no meaning")
    steps = np.empty(curve.shape[0] - 2)
    kernels.transport_twist(curve, directors, steps)
    return float(steps.sum())


def frame_twist(frames: ArrayLike) -> float | Floats:
    """Twist of a sequence of frames, exact where the strain between stations is constant.

    Parameters
    ----------
    frames : (m, 3, 3) or (T, m, 3, 3) array_like
        Less than half a turn between neighbours.

    Returns
    -------
    float or (T,) float64, turns
    """
    series, single = frame_series(frames)
    values = _frame_measures(series, (0.0, 0.0, 1.0))[0]
    return float(values[0]) if single else values


def lifted_writhe(frames: ArrayLike, pole: ArrayLike | None = None) -> float | Floats:
    """Writhe of the ray-closed arm as area about a fixed pole: continuous through self-crossings.

    Parameters
    ----------
    frames : (m, 3, 3) or (T, m, 3, 3) array_like
    pole : (3,) array_like, optional
        Axis of the expected coil; d3 must begin some degrees away from its opposite, or a warning says so. If omitted, (0, 0, 1), or, with
        a warning, the axis that suits the arm better.

    Returns
    -------
    float or (T,) float64, turns
        Equal to the writhe modulo 2; a series is made continuous in time, starting from the value of its first entry.
    """
    series, single = frame_series(frames)
    values = _frame_measures(series, arm_pole(series[0], pole))[1]
    return float(values[0]) if single else values


def regional(frames: ArrayLike, pole: ArrayLike | None = None) -> tuple[Floats, Floats]:
    """Twist and lifted writhe of each step of one arm.

    Parameters
    ----------
    frames : (m, 3, 3) array_like
    pole : (3,) array_like, optional
        As in `lifted_writhe`.

    Returns
    -------
    twist, lifted_writhe : (m-1,) float64, turns
        Partial sums give those of a region; the sum of the second lacks the closure of the whole arm.
    """
    series, single = frame_series(frames)
    if not single:
        raise OctoctrlError(f"frames has shape {series.shape}; one arm (m, 3, 3) at a time is needed here")
    turned, lifted = np.empty((2, series.shape[1] - 1))
    kernels.frame_steps(series[0], np.array(arm_pole(series[0], pole)), turned, lifted)
    return turned, lifted


def measure(time: ArrayLike, points: ArrayLike, frames: ArrayLike, convention: TopologyConvention | None = None) -> TopologyTrace:
    """Measure a recorded run.

    Parameters
    ----------
    time : (T,) array_like, s
        Increasing.
    points : (T, n+1, 3) array_like, m
    frames : (T, m, 3, 3) array_like
        Rows d1, d2, d3 at m stations from base to tip. With m = n + 2 (base, element centres, tip) those of the elements are first
        turned onto the edges between the nodes: a sheared rod's d3 is not its tangent, and link is that of the centreline's ribbon.
    convention : TopologyConvention, optional
        If omitted, the default one, with a pole that suits the arm as in `lifted_writhe`; the trace carries it.

    Returns
    -------
    TopologyTrace
        Writhe is the Gauss sum over the nodes, with rays along the first and last d3; twist and link are those of the frames alone,
        so that the residual compares two independent measurements. A residual beyond 0.02 turns means that the arm is under-resolved
        or touches itself.

    Raises
    ------
    OctoctrlError
        If an array has the wrong shape or is degenerate, time does not increase, or d3 does not follow the points.
    """
    meter = Meter(convention)
    meter.extend(time, points, frames)
    return meter.trace


def present(points: ArrayLike, frames: ArrayLike, pole: ArrayLike = (0.0, 0.0, 1.0)) -> tuple[float, float]:
    """Twist and lifted writhe of one instant, as `measure` finds them but for the branch of writhe.

    Parameters
    ----------
    points : (n+1, 3) array_like, m
    frames : (n+2, 3, 3) array_like
        At base, element centres and tip.
    pole : (3,) array_like

    Returns
    -------
    (float, float), turns
        Lifted writhe modulo 2.
    """
    curve, arm = one_curve(points)[None], frame_series(frames)[0]
    check_frames_follow(curve, arm)
    series = ribbon_frames(curve, arm)
    turned, lifted, _ = _frame_measures(series, unit_pole(pole))
    return float(turned[0]), float(lifted[0])


def present_of_frames(frames: ArrayLike, pole: ArrayLike = (0.0, 0.0, 1.0)) -> tuple[float, float]:
    """Twist and lifted writhe of one instant by the frames alone, for who watches an arm: noise of the nodes does not tilt them.

    Parameters
    ----------
    frames : (m, 3, 3) array_like
        At stations from base to tip.
    pole : (3,) array_like

    Returns
    -------
    (float, float), turns
        Lifted writhe modulo 2.
    """
    turned, lifted, _ = _frame_measures(frame_series(frames)[0], unit_pole(pole))
    return float(turned[0]), float(lifted[0])


def sucker_orientation(frames: ArrayLike, azimuth: float, least_bend: float = 1e-6) -> float | Floats:
    """Tell how far the arm bends toward its suckers: 1 with suckers inside every bend, -1 outside.

    Parameters
    ----------
    frames : (m, 3, 3) or (T, m, 3, 3) array_like
    azimuth : float, rad
        Of the sucker line in the material plane, from d2 toward d1 (at rest from +x toward +z, as the longitudinal muscles are numbered).
    least_bend : float, rad
        Steps that bend less say nothing and are left out.

    Returns
    -------
    float or (T,) float64
        Mean cosine of the angle between the sucker direction and the direction to the centre of curvature; nan for a straight arm.
    """
    check_number("azimuth", azimuth, unit="rad")
    check_number("least_bend", least_bend, at_least=0.0, unit="rad")
    series, single = frame_series(frames)
    first, second, bend = _bending(series)
    inward = second * np.sin(azimuth) - first * np.cos(azimuth)  # d3 turns by w x d3, in material components (w2, -w1, 0)
    counted = bend > least_bend
    cosine = np.divide(inward, bend, out=np.zeros_like(bend), where=counted)
    values = np.where(counted.any(axis=1), cosine.sum(axis=1) / np.maximum(counted.sum(axis=1), 1), np.nan)
    return float(values[0]) if single else values


def classify_sections(frames: ArrayLike, sections: int = 8, least_angle: float = 0.1) -> NDArray[np.int64]:
    """Tell which stretches of the arm are straight (1), bent in a plane (2) or helical (3).

    Parameters
    ----------
    frames : (m, 3, 3) or (T, m, 3, 3) array_like
    sections : int
        Number of stretches of equal station count (to one).
    least_angle : float, rad
        Root-mean-square angle by which tangents must leave a line to count as bent, and a plane to count as helical.

    Returns
    -------
    (sections,) or (T, sections) int64
        Dimension of each stretch; `SECTION_SHAPES` names it.
    """
    check_number("least_angle", least_angle, above=0.0, below=1.0, unit="rad")
    series, single = frame_series(frames)
    count = series.shape[1] - 1
    starts = np.append(_section_starts(count, sections), count)
    dimension = np.empty((series.shape[0], starts.size - 1), dtype=np.int64)
    for k in range(starts.size - 1):
        tangents = series[:, starts[k] : starts[k + 1] + 1, 2, :]
        # singular values: root-mean-square components of the tangents along three perpendicular directions
        spread = np.linalg.svd(tangents, compute_uv=False) / np.sqrt(tangents.shape[1])
        spread = np.pad(spread, ((0, 0), (0, 3 - spread.shape[1])))
        dimension[:, k] = 1 + (spread[:, 1] > np.sin(least_angle)) + (spread[:, 2] > np.sin(least_angle))
    return dimension[0] if single else dimension


def packet_position(
    frames: ArrayLike, arclength: ArrayLike, smoothing: float = 0.02, window: tuple[float, float] = (0.0, 1.0)
) -> tuple[float, float] | tuple[Floats, Floats]:
    """Find the packet of bending: where curvature is greatest.

    Parameters
    ----------
    frames : (m, 3, 3) or (T, m, 3, 3) array_like
    arclength : (m,) array_like, m
        Rest arclength of the stations, increasing.
    smoothing : float, arm lengths
        Standard deviation of the Gaussian weight with which curvature is smoothed along the arm; 0 for none.
    window : (float, float), arm lengths
        Part of the arm that is searched; leave the tip out if it curls by itself.

    Returns
    -------
    position : float or (T,) float64, m
        Arclength of the vertex of the parabola through the greatest smoothed curvature and its neighbours; nan for a straight arm.
    curvature : float or (T,) float64, 1/m
        Height of that vertex.
    """
    series, single = frame_series(frames)
    stations, edges = numbers("arclength", arclength), numbers("window", window)
    if stations.shape != series.shape[1:2] or np.any(np.diff(stations) <= 0.0):
        raise OctoctrlError(f"arclength needs {series.shape[1]} increasing values, one per frame; found shape {stations.shape}")
    check_number("smoothing", smoothing, at_least=0.0, below=1.0, unit="arm lengths")
    length, steps = stations[-1] - stations[0], np.diff(stations)
    middle = 0.5 * (stations[1:] + stations[:-1])
    curvature = _bending(series)[2] / steps
    if smoothing > 0.0:
        weight = np.exp(-0.5 * ((middle[:, None] - middle[None, :]) / (smoothing * length)) ** 2) * steps
        curvature = curvature @ (weight / weight.sum(axis=1, keepdims=True)).T
    if edges.shape != (2,):
        raise OctoctrlError(f"window is {window!r}; two numbers are needed, begin and end in arm lengths")
    low, high = stations[0] + edges * length
    inside = np.flatnonzero((middle >= low) & (middle <= high))
    if inside.size == 0:
        raise OctoctrlError(f"window {window!r} holds no station; it must cover part of 0…1 arm lengths")
    position, height = np.empty((2, series.shape[0]))
    kernels.parabola_peaks(middle, curvature, inside[0], inside[-1], position, height)
    position[height <= 1e-9 / length] = np.nan
    return (float(position[0]), float(height[0])) if single else (position, height)


def _frame_measures(series: Floats, pole: Direction) -> Floats:
    """Return twist, lifted writhe made continuous in time, and 1 + t_tip . t_base of a series of frames, (3, T)."""
    measured = np.empty((3, series.shape[0]))
    kernels.frame_series(series, np.array(pole), *measured)
    kernels.unwrap_by_two(measured[1], measured[1, 0], 0.0)
    return measured


def _bending(series: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the first two components of the rotation vectors between frames, (T, m-1) each, and their size."""
    rotation = np.empty((series.shape[0], series.shape[1] - 1, 3))
    kernels.frame_rotations(series, rotation)
    return rotation[..., 0], rotation[..., 1], np.hypot(rotation[..., 0], rotation[..., 1])


def _end_directions(series: Floats) -> Floats:
    ends: Floats = np.stack([series[:, 1] - series[:, 0], series[:, -1] - series[:, -2]], axis=1)
    return ends / np.linalg.norm(ends, axis=2, keepdims=True)


def _section_starts(count: int, sections: int) -> NDArray[np.int64]:
    if isinstance(sections, bool) or not isinstance(sections, int | np.integer) or not 1 <= sections <= count:
        raise OctoctrlError(f"sections={sections!r}; a whole number from 1 to {count} is needed")
    return (np.arange(sections, dtype=np.int64) * count) // sections


def _checked_ray(ray_length: float) -> float:
    check_number("ray_length", ray_length, at_least=0.0, at_most=1e6, unit="arm lengths")
    return float(ray_length)


def _is_closed(curve: Floats) -> bool:
    return bool(np.array_equal(curve[0], curve[-1]))
