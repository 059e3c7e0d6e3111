"""Kinematics of the reduced model: from section strains to frames, points and topology, and back.

Strains (k1, k2, k3, e) are continuous along the arm: values at the section centres, linear in between, constant outside. Between two
stations they are replaced by their mean, and the frame is turned by the exact exponential of it; d/ds d_j = k x d_j with k in the
material frame, so that the frame with columns d1, d2, d3 obeys R' = R [k]x. Arrays of frames hold d1, d2, d3 as rows, as the plant's do.

The arm starts at the origin with d1 = +z, d2 = +x, d3 = +y. The stations of a plant of n elements, which may differ in length, are the
base, the n element centres and the tip, so the curvature of the whole interval [0, L] is counted, half elements at the ends included.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from octoctrl.sim.body.arm import Arm

Floats = NDArray[np.float64]

BASE_FRAME = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rows d1, d2, d3 at the base."""


GRADING = 1.0
"""Sections are as long as the local radius to this power: curvature goes with its inverse, and so every section bends alike."""


def section_bounds(arm: Arm, sections: int) -> Floats:
    """Arclengths (S + 1,) that bound the sections, m."""
    return arm.partition(sections, GRADING)


def hat_values(stations: ArrayLike, bounds: Floats) -> Floats:
    """Value at the arclengths `stations` of every section's hat function, (m, S): 1 at its centre, 0 from the neighbours' on."""
    centres = (bounds[1:] + bounds[:-1]) / 2
    stations = np.asarray(stations, dtype=float)
    return np.stack([np.interp(stations, centres, unit) for unit in np.eye(len(centres))], axis=1)


def hat_means(edges: ArrayLike, bounds: Floats) -> Floats:
    """Mean of every section's hat function over the cells bounded by `edges` (m), (len(edges) - 1, S); rows sum to one.

    Parameters
    ----------
    edges : (m + 1,) array_like, m
    bounds : (S + 1,) float64, m
        Of the sections.
    """
    edges = np.asarray(edges, dtype=float)
    centres = (bounds[1:] + bounds[:-1]) / 2
    breaks = np.unique(np.concatenate([edges, centres[(centres > edges[0]) & (centres < edges[-1])]]))
    pieces = hat_values((breaks[1:] + breaks[:-1]) / 2, bounds) * np.diff(breaks)[:, None]
    integral = np.concatenate([np.zeros((1, len(centres))), np.cumsum(pieces, axis=0)])[np.searchsorted(breaks, edges)]
    return np.diff(integral, axis=0) / np.diff(edges)[:, None]


def element_stations(edges: ArrayLike) -> Floats:
    """Stations of a plant whose elements are bounded by `edges` (n + 1,), m: base, element centres, tip, (n + 2,), m."""
    edges = np.asarray(edges, dtype=float)
    return np.concatenate([edges[:1], (edges[1:] + edges[:-1]) / 2, edges[-1:]])


def element_lengths(stations: Floats) -> Floats:
    """Lengths of a plant's elements (n,), m, from its stations (n + 2,), m; inverse of `element_stations`."""
    edges = [stations[0]]
    for centre in stations[1:-1]:
        edges.append(2 * centre - edges[-1])
    return np.diff(edges)


def rotation_vectors(matrices: Floats) -> Floats:
    """Rotation vectors (..., 3), rad, of rotation matrices (..., 3, 3) that turn by less than half a turn."""
    skew = 0.5 * (matrices - np.swapaxes(matrices, -1, -2))
    axial = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
    angle = np.arctan2(np.linalg.norm(axial, axis=-1), 0.5 * (np.trace(matrices, axis1=-2, axis2=-1) - 1))
    return axial / np.sinc(angle / np.pi)[..., None]


def integrate_frames(strains: ArrayLike, stations: Floats, bounds: Floats) -> Floats:
    """Frames at the stations.

    Parameters
    ----------
    strains : (..., S, 4) float64
        Section strains, 1/m and stretch.
    stations : (m,) float64, m
        Increasing arclengths; the first has the base frame.
    bounds : (S + 1,) float64, m
        Of the sections.

    Returns
    -------
    (..., m, 3, 3) float64
        Rows d1, d2, d3.
    """
    from .output_kernels import frames_along

    strains = np.asarray(strains, dtype=float)
    means = hat_means(stations, bounds) * np.diff(stations)[:, None]
    frames = np.empty((*strains.shape[:-2], len(stations), 3, 3))
    frames[..., 0, :, :] = BASE_FRAME
    turns = (means @ strains[..., :3]).reshape(-1, len(means), 3)
    frames_along(turns, frames.reshape(len(turns), *frames.shape[-3:]))
    return frames


def element_points(strains: ArrayLike, frames: Floats, edges: ArrayLike, bounds: Floats) -> Floats:
    """Node positions (..., n + 1, 3), m, from strains and frames (..., n + 2, 3, 3) of an arm with the element `edges` (n + 1,), m."""
    edges = np.asarray(edges, dtype=float)
    stretch = hat_means(edges, bounds) @ np.asarray(strains)[..., 3:]
    steps = frames[..., 1:-1, 2, :] * stretch * np.diff(edges)[:, None]
    points = np.zeros((*steps.shape[:-2], len(edges), 3))
    np.cumsum(steps, axis=-2, out=points[..., 1:, :])
    return points


class StrainFit:
    """Least-squares map from measured frames and element stretches to section strains; built once for given stations.

    Not the local strains are fitted but what they add up to: the running sums of the rotation vectors between neighbouring stations,
    and of the stretch. So the sharp curvature of the thin tip does not outweigh the directions of the tangents.

    Parameters
    ----------
    stations : (m,) float64, m
        Base, element centres, tip.
    bounds : (S + 1,) float64, m
        Of the sections.
    """

    def __init__(self, stations: ArrayLike, bounds: Floats) -> None:
        stations = np.asarray(stations, dtype=float)
        widths, lengths = np.diff(stations), element_lengths(stations)
        self._lengths = lengths[:, None]
        self._rotation_map = np.linalg.pinv(np.cumsum(hat_means(stations, bounds) * widths[:, None], axis=0))
        edges = np.concatenate([[0.0], np.cumsum(lengths)])
        edges[-1] = stations[-1]
        self._stretch_map = np.linalg.pinv(np.cumsum(hat_means(edges, bounds) * self._lengths, axis=0))

    def __call__(self, frames: ArrayLike, stretch: ArrayLike) -> Floats:
        """Section strains (..., S, 4) of frames (..., m, 3, 3) and stretches (..., n)."""
        frames = np.asarray(frames, dtype=float)
        turns = rotation_vectors(frames[..., :-1, :, :] @ np.swapaxes(frames[..., 1:, :, :], -1, -2))
        curvatures = self._rotation_map @ np.cumsum(turns, axis=-2)
        stretches = self._stretch_map @ np.cumsum(np.asarray(stretch, dtype=float)[..., None] * self._lengths, axis=-2)
        return np.concatenate([curvatures, stretches], axis=-1)
