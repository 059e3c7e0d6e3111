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

from ..errors import OctoctrlError, check_number
from ..rotations import ribbon_frames
from . import topology_kernels as kernels
from .meter import Meter
from .trace import finite_array, frame_series, point_series, unit_pole

SECTION_SHAPES = {1: "straight", 2: "planar", 3: "helical"}
"""Names of the dimensions returned by `classify_sections`."""


def writhe(points, ray_length=1000.0):
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


def writhe_map(points, sections=None, ray_length=1000.0):
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
    curve, ray_length = _one_curve(points), _checked_ray(ray_length)
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


def writhe_density(points, ray_length=1000.0):
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


def link(points, normals, radius, ray_length=1000.0):
    """Link of a centreline and the curve beside it, by the double sum over all segment pairs: the referee of the other measures.

    Parameters
    ----------
    points : (n+1, 3) array_like
    normals : (n, 3) array_like
        Material direction of each segment, not parallel to it.
    radius : float or (n,) array_like
        Distance of the second curve, in the unit of the points; small against the gap between neighbouring loops.
    ray_length : float, lengths of the polyline
        Both curves continue along the first and last segment of the centreline; 0 for no rays.

    Returns
    -------
    float, turns
    """
    curve, directors = _ribbon(points, normals)
    radii = np.asarray(radius, dtype=float)
    if radii.shape not in ((), (curve.shape[0] - 1,)) or not np.isfinite(radii).all() or np.any(radii <= 0.0):
        raise OctoctrlError(f"radius has shape {radii.shape}; a positive number or one per segment ({curve.shape[0] - 1},) is needed")
    tangents = np.diff(curve, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    directors = directors - np.sum(directors * tangents, axis=1, keepdims=True) * tangents
    sizes = np.linalg.norm(directors, axis=1, keepdims=True)
    if np.any(sizes == 0.0):
        raise OctoctrlError(f"normal {int(np.argmin(sizes))} is parallel to its segment; give a direction across the arm")
    offsets = np.broadcast_to(radii, tangents.shape[:1])[:, None] * directors / sizes
    beside = curve + np.concatenate([offsets[:1], offsets])
    ray = _checked_ray(ray_length) * kernels.polyline_length(curve)
    first, second = np.empty((2, 3, curve.shape[0] + 2))
    count = kernels.extend(curve, tangents[0], tangents[-1], ray, first)
    kernels.extend(beside, tangents[0], tangents[-1], ray, second)
    return float(kernels.link_of_curves(first[:, :count], second[:, :count]))


def twist(points, normals):
    """Twist of a ribbon: the rotation of its normals about the centreline beyond parallel transport.

    Parameters
    ----------
    points : (n+1, 3) array_like
    normals : (n, 3) array_like
        Material direction of each segment.

    Returns
    -------
    float, turns
        From the first to the last segment: a straight arm with uniform twist gives (n-1)/n of it. Less than half a turn per node.
    """
    curve, directors = _ribbon(points, normals)
    steps = np.empty(curve.shape[0] - 2)
    kernels.transport_twist(curve, directors, steps)
    return float(steps.sum())


def frame_twist(frames):
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


def lifted_writhe(frames, pole=(0.0, 0.0, 1.0)):
    """Writhe of the ray-closed arm as area about a fixed pole: continuous through self-crossings.

    Parameters
    ----------
    frames : (m, 3, 3) or (T, m, 3, 3) array_like
    pole : (3,) array_like
        Axis of the expected coil; d3 must stay some degrees away from its opposite.

    Returns
    -------
    float or (T,) float64, turns
        Equal to the writhe modulo 2; a series is made continuous in time, starting from the value of its first entry.
    """
    series, single = frame_series(frames)
    values = _frame_measures(series, unit_pole(pole))[1]
    return float(values[0]) if single else values


def regional(frames, pole=(0.0, 0.0, 1.0)):
    """Twist and lifted writhe of each step of one arm.

    Parameters
    ----------
    frames : (m, 3, 3) array_like
    pole : (3,) array_like

    Returns
    -------
    twist, lifted_writhe : (m-1,) float64, turns
        Partial sums give those of a region; the sum of the second lacks the closure of the whole arm.
    """
    series, single = frame_series(frames)
    if not single:
        raise OctoctrlError(f"frames has shape {series.shape}; one arm (m, 3, 3) at a time is needed here")
    turned, lifted = np.empty((2, series.shape[1] - 1))
    kernels.frame_steps(series[0], np.array(unit_pole(pole)), turned, lifted)
    return turned, lifted


def measure(time, points, frames, convention=None):
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

    Returns
    -------
    TopologyTrace
        Writhe is the Gauss sum over the nodes, with rays along the first and last d3; twist and link are those of the frames alone,
        so that the residual compares two independent measurements. A residual beyond 0.02 turns means that the arm is under-resolved
        or touches itself.
    """
    meter = Meter(convention)
    meter.extend(time, points, frames)
    return meter.trace


def present(points, frames, pole=(0.0, 0.0, 1.0)):
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
    series = ribbon_frames(point_series(points)[0], frame_series(frames)[0])
    turned, lifted, _ = _frame_measures(series, unit_pole(pole))
    return float(turned[0]), float(lifted[0])


def sucker_orientation(frames, azimuth, least_bend=1e-6):
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


def classify_sections(frames, sections=8, least_angle=0.1):
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


def packet_position(frames, arclength, smoothing=0.02, window=(0.0, 1.0)):
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
    stations = np.asarray(arclength, dtype=float)
    if stations.shape != series.shape[1:2] or not np.isfinite(stations).all() or np.any(np.diff(stations) <= 0.0):
        raise OctoctrlError(f"arclength needs {series.shape[1]} increasing values, one per frame; found shape {stations.shape}")
    check_number("smoothing", smoothing, at_least=0.0, below=1.0, unit="arm lengths")
    length, steps = stations[-1] - stations[0], np.diff(stations)
    middle = 0.5 * (stations[1:] + stations[:-1])
    curvature = _bending(series)[2] / steps
    if smoothing > 0.0:
        weight = np.exp(-0.5 * ((middle[:, None] - middle[None, :]) / (smoothing * length)) ** 2) * steps
        curvature = curvature @ (weight / weight.sum(axis=1, keepdims=True)).T
    low, high = (stations[0] + float(edge) * length for edge in window)
    inside = np.flatnonzero((middle >= low) & (middle <= high))
    if inside.size == 0:
        raise OctoctrlError(f"window {tuple(window)} holds no station; it must cover part of 0…1 arm lengths")
    position, height = np.empty((2, series.shape[0]))
    kernels.parabola_peaks(middle, curvature, inside[0], inside[-1], position, height)
    position[height <= 1e-9 / length] = np.nan
    return (float(position[0]), float(height[0])) if single else (position, height)


def _frame_measures(series, pole):
    """Return twist, lifted writhe made continuous in time, and 1 + t_tip . t_base of a series of frames."""
    turned, lifted, opening = np.empty((3, series.shape[0]))
    kernels.frame_series(series, np.array(pole), turned, lifted, opening)
    kernels.unwrap_by_two(lifted, lifted[0], 0.0)
    return turned, lifted, opening


def _bending(series):
    """Return the first two components of the rotation vectors between frames, (T, m-1) each, and their size."""
    rotation = np.empty((series.shape[0], series.shape[1] - 1, 3))
    kernels.frame_rotations(series, rotation)
    return rotation[..., 0], rotation[..., 1], np.hypot(rotation[..., 0], rotation[..., 1])


def _end_directions(series):
    ends = np.stack([series[:, 1] - series[:, 0], series[:, -1] - series[:, -2]], axis=1)
    return ends / np.linalg.norm(ends, axis=2, keepdims=True)


def _section_starts(count, sections):
    if isinstance(sections, bool) or not isinstance(sections, int | np.integer) or not 1 <= sections <= count:
        raise OctoctrlError(f"sections={sections!r}; a whole number from 1 to {count} is needed")
    return (np.arange(sections) * count) // sections


def _checked_ray(ray_length):
    check_number("ray_length", ray_length, at_least=0.0, at_most=1e6, unit="arm lengths")
    return float(ray_length)


def _one_curve(points):
    series, single = point_series(points)
    if not single:
        raise OctoctrlError(f"points has shape {series.shape}; one curve (n+1, 3) at a time is needed here")
    return series[0]


def _ribbon(points, normals):
    curve, directors = _one_curve(points), finite_array("normals", normals)
    if directors.shape != (curve.shape[0] - 1, 3):
        raise OctoctrlError(f"normals has shape {directors.shape}; one per segment, ({curve.shape[0] - 1}, 3), is needed")
    return curve, directors
