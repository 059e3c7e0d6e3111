"""What the measures are given, checked: arrays, curves, ribbons, frames and poles, each complaint in one sentence.

Only NumPy here, as traces need it. Curves may have any unit of length: limits are relative to the curve.
"""

import sys
import warnings

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import OctoctrlError, OctoctrlWarning

Floats = NDArray[np.float64]
Direction = tuple[float, float, float]

SPAN = (1e-30, 1e30)
"""Extent of a curve, in its unit: products of six lengths, with rays of 1e6, stay within what a float64 holds."""

LEAST_SEGMENT = 1e-12
"""Share of the curve's extent below which the direction of a segment is rounding."""

AXES: tuple[Direction, ...] = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, -1.0, 0.0), (-1.0, 0.0, 0.0))
"""Poles to choose from; the first is the usual one."""
AWAY = 5.0
"""Degrees: each tangent that passes the opposite of the pole on the other side changes lifted writhe by 2. In a series that is seen as a
jump and taken out; at its first instant, nearer than this, noise would decide."""

HALF_TURN = 1e-10
"""Square of the angle, rad, that is left to half a turn, at which the direction of a turn is rounding."""

BACKWARD = -0.99
"""Cosine between two directions from which on they count as opposite: no smallest rotation takes one to the other."""


def numbers(name: str, values: object) -> Floats:
    """Return `values` as a contiguous float64 array, all finite, or say what is wrong with it."""
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        raise OctoctrlError(f"{name}: expected an array of numbers, found rows of different lengths") from None
    if array.dtype.kind not in "biuf":
        raise OctoctrlError(f"{name}: expected an array of numbers, found {type(values).__name__} of {array.dtype}")
    array = np.ascontiguousarray(array, dtype=np.float64).reshape(array.shape)
    if not np.isfinite(array).all():
        place = tuple(np.argwhere(~np.isfinite(array))[0].tolist())
        raise OctoctrlError(f"{name} is {array[place]} at {place}; finite numbers are needed")
    return array


def unit_pole(pole: object) -> Direction:
    """Return a direction as a tuple of three floats of unit length.

    Raises
    ------
    OctoctrlError
        If `pole` is not three finite numbers of which one is not zero.
    """
    try:
        vector = numbers("pole", pole)
    except OctoctrlError:
        vector = np.empty(0)
    if vector.shape != (3,) or not vector.any():
        raise OctoctrlError(f"pole is {pole!r}; three finite numbers are needed, not all zero, for example (0, 0, 1)")
    largest = np.abs(vector).max()
    if not 1e-100 < largest < 1e100:  # its square is no float64
        vector = vector / largest
    x, y, z = (vector / np.linalg.norm(vector)).tolist()
    return x, y, z


def point_series(points: ArrayLike) -> tuple[Floats, bool]:
    """Return nodes as (T, n+1, 3), and whether they came as one curve (n+1, 3)."""
    array = numbers("points", points)
    if array.ndim not in (2, 3) or array.shape[-1] != 3 or array.shape[-2] < 2 or array.shape[0] < 1:
        raise OctoctrlError(f"points has shape {array.shape}; (n+1, 3) or (T, n+1, 3) with at least 2 nodes is needed")
    series = array[None] if array.ndim == 2 else array
    steps = np.abs(np.diff(series, axis=1)).max(axis=2)
    extent = (series.max(axis=1) - series.min(axis=1)).max(axis=1)
    repeated = np.argwhere(steps <= LEAST_SEGMENT * extent[:, None])
    if repeated.size:
        frame, node = repeated[0]
        raise OctoctrlError(f"nodes {node} and {node + 1} of frame {frame} coincide; every segment needs a length")
    odd = np.argwhere((extent < SPAN[0]) | (np.abs(series).max(axis=(1, 2)) > SPAN[1]))
    if odd.size:
        frame = int(odd[0, 0])
        raise OctoctrlError(
            f"points of frame {frame} span {extent[frame]:.1e}, {SPAN[0]:.0e}…{SPAN[1]:.0e} is allowed; choose another unit of length"
        )
    return series, array.ndim == 2


def one_curve(points: ArrayLike) -> Floats:
    """Return the nodes (n+1, 3) of what must be one curve."""
    series, single = point_series(points)
    if not single:
        raise OctoctrlError(f"points has shape {series.shape}; one curve (n+1, 3) at a time is needed here")
    return series[0]


def ribbon(points: ArrayLike, normals: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return the nodes (n+1, 3), tangents (n, 3) and unit normals across them (n, 3) of one ribbon."""
    curve, directors = one_curve(points), numbers("normals", normals)
    if directors.shape != (curve.shape[0] - 1, 3):
        raise OctoctrlError(f"normals has shape {directors.shape}; one per segment, ({curve.shape[0] - 1}, 3), is needed")
    tangents = np.diff(curve, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    largest = np.abs(directors).max(axis=1, keepdims=True)
    directors = directors / np.where(largest == 0.0, 1.0, largest)
    across = directors - np.sum(directors * tangents, axis=1, keepdims=True) * tangents
    sizes = np.linalg.norm(across, axis=1, keepdims=True)
    if np.any(sizes < 1e-9):
        raise OctoctrlError(f"normal {int(np.argmin(sizes))} is zero or parallel to its segment; give a direction across the arm")
    return curve, tangents, across / sizes


def frame_series(frames: ArrayLike) -> tuple[Floats, bool]:
    """Return frames as (T, m, 3, 3), and whether they came as one arm (m, 3, 3)."""
    array = numbers("frames", frames)
    if array.ndim not in (3, 4) or array.shape[-2:] != (3, 3) or array.shape[-3] < 2 or array.shape[0] < 1:
        raise OctoctrlError(f"frames has shape {array.shape}; (m, 3, 3) or (T, m, 3, 3) with at least 2 stations is needed")
    series = array[None] if array.ndim == 3 else array
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers that are no directions at all
        error = np.abs(series @ series.swapaxes(-1, -2) - np.eye(3)).max()
    if not error <= 1e-4:
        raise OctoctrlError(f"frames are off orthonormal by {error:.1e}; rows must be unit vectors at right angles to 1e-4")
    (a1, a2, a3), (b1, b2, b3), (c1, c2, c3) = (series[..., i, :].transpose(2, 0, 1) for i in range(3))
    if ((a2 * b3 - a3 * b2) * c1 + (a3 * b1 - a1 * b3) * c2 + (a1 * b2 - a2 * b1) * c3).min() < 0.0:
        raise OctoctrlError("frames are left-handed; d3 must be d1 x d2")
    halves = np.argwhere(np.einsum("tmij,tmij->tm", series[:, 1:], series[:, :-1]) < HALF_TURN - 1.0)
    if halves.size:
        frame, station = halves[0]
        raise OctoctrlError(
            f"frames {station} and {station + 1} of instant {frame} differ by half a turn; more stations are needed between"
        )
    return series, array.ndim == 3


def check_frames_follow(curves: Floats, series: Floats) -> None:
    """Check that the third rows of frames (T, m, 3, 3) point along the curves (T, n+1, 3) to which they belong.

    Raises
    ------
    OctoctrlError
        If they do not: the frames hold the directors as columns, as those of PyElastica do, or belong to something else.
    """
    edges = np.diff(curves, axis=1)
    edges /= np.linalg.norm(edges, axis=2, keepdims=True)
    surplus = series.shape[1] - edges.shape[1]
    inner = surplus == 2  # base, element centres, tip
    beside, along = (series[:, 1:-1] if inner else series, edges) if surplus in (0, 2) else (series[:, [0, -1]], edges[:, [0, -1]])
    rows = np.einsum("tmi,tmi->tm", beside[:, :, 2, :], along)
    columns = np.einsum("tmi,tmi->tm", beside[:, :, :, 2], along)
    swapped = rows.mean() < 0.98 and columns.mean() > 0.99  # shear turns d3 from the edge, but not on average by ten degrees
    if swapped or rows.mean() < 0.5:
        advice = "they are columns; swap the last two axes" if swapped else "rows d1, d2, d3 with d3 along the arm are needed"
        raise OctoctrlError(f"the third rows of frames do not follow the points (mean cosine {rows.mean():.2f}): {advice}")
    if inner and rows.min() < BACKWARD:
        frame, segment = np.unravel_index(np.argmin(rows), rows.shape)
        raise OctoctrlError(f"d3 of frame {frame} points back along segment {segment} (cosine {rows.min():.3f}); it must point to the tip")


def arm_pole(frames: Floats, pole: ArrayLike | None) -> Direction:
    """Return the pole from which an arm (m, 3, 3) is seen: the one that was asked for, or the usual one, or the axis that suits it better.

    If its tangents come too near to the opposite of the pole, a warning says so: one that was asked for is kept, the usual one gives way
    to the axis from whose opposite they stay farthest.
    """
    chosen = AXES[0] if pole is None else unit_pole(pole)
    found = _clearance(frames, chosen)
    if found > AWAY:
        return chosen
    told = f"the arm starts within {found:.1f} degrees of the opposite of the pole {_text(chosen)}"
    if pole is None:
        chosen = max(AXES, key=lambda axis: round(_clearance(frames, axis)))
        told += f": the pole {_text(chosen)} is taken instead; give one to choose another"
    else:
        told += ": lifted writhe and crossings are uncertain by whole turns; choose another pole"
    warnings.warn(told, OctoctrlWarning, stacklevel=_depth())
    return chosen


def _clearance(frames: Floats, pole: Direction) -> float:
    """Return the least angle, degrees, between the tangents and the opposite of the pole."""
    nearest = float((frames[:, 2, :] @ np.array(pole)).min())
    return float(np.degrees(np.arccos(np.clip(-nearest, -1.0, 1.0))))


def _depth() -> int:
    """Return how many calls up the one is that asked for a measure."""
    frame, depth = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_globals["__name__"].startswith(__package__):
        frame, depth = frame.f_back, depth + 1
    return depth


def _text(direction: Direction) -> str:
    return f"({', '.join(f'{part:g}' for part in direction)})"
