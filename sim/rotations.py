"""Rotations of material frames as arrays (NumPy).

A frame is a (3, 3) matrix whose rows are the directors d1, d2, d3; it maps lab components to material ones. A rotation vector u takes a
frame Q to ``exp(-[u]) Q``: its components are material, and a positive u3 is a right-handed turn about d3.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def rotation_matrix(vector: ArrayLike) -> Floats:
    """Matrix exp(-[u]) of rotation vectors (..., 3), as (..., 3, 3)."""
    vector = np.asarray(vector, dtype=float)
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    cross = np.zeros((*vector.shape[:-1], 3, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = -vector[..., 2], vector[..., 1], -vector[..., 0]
    cross -= np.swapaxes(cross, -1, -2)
    sine, half = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi))
    return np.eye(3) - sine * cross + 0.5 * half**2 * (cross @ cross)


def rotation_vector(matrix: ArrayLike) -> Floats:
    """Rotation vectors (..., 3) of matrices exp(-[u]) (..., 3, 3), for angles below pi."""
    matrix = np.asarray(matrix, dtype=float)
    axial = 0.5 * np.stack(
        [
            matrix[..., 1, 2] - matrix[..., 2, 1],
            matrix[..., 2, 0] - matrix[..., 0, 2],
            matrix[..., 0, 1] - matrix[..., 1, 0],
        ],
        axis=-1,
    )
    sine = np.linalg.norm(axial, axis=-1)
    cosine = 0.5 * (np.trace(matrix, axis1=-2, axis2=-1) - 1)
    angle = np.arctan2(sine, cosine)
    return axial / np.sinc(angle / np.pi)[..., None]


def orthonormalised(frames: ArrayLike) -> Floats:
    """Frames (..., 3, 3) that are orthonormal to the square of what `frames` lack of it: a step of Newton's method for the polar factor.

    References
    ----------
    Bjorck and Bowie (1971), *An iterative algorithm for computing the best estimate of an orthogonal matrix*.
    """
    frames = np.asarray(frames, dtype=float)
    return frames + 0.5 * (np.eye(3) - frames @ np.swapaxes(frames, -1, -2)) @ frames


def ribbon_frames(points: ArrayLike, frames: ArrayLike) -> Floats:
    """Frames of the ribbon along the centreline.

    A sheared rod's d3 is not the tangent of its centreline; link, writhe and twist are those of the centreline and a ribbon on it. The
    frames of the elements are turned by the smallest rotation that takes d3 to the edge between the nodes.

    Parameters
    ----------
    points : (..., n + 1, 3) array_like
    frames : (..., m, 3, 3) array_like
        With m = n + 2 at base, element centres and tip; for any other m nothing is known of the edges and the frames are returned as
        they are.

    Returns
    -------
    (..., m, 3, 3) float64
    """
    frames, edges = np.asarray(frames, dtype=float), np.diff(np.asarray(points, dtype=float), axis=-2)
    if frames.shape[-3] != edges.shape[-2] + 2:
        return frames
    inner = frames[..., 1:-1, :, :]
    tangents = edges / np.linalg.norm(edges, axis=-1, keepdims=True)
    across, along = inner[..., :2, :], inner[..., 2, :]
    # The rotation that takes a to b takes what is at right angles to a to v - (b . v) (a + b) / (1 + a . b).
    share = np.einsum("...ki,...i->...k", across, tangents) / (1 + np.einsum("...i,...i->...", along, tangents))[..., None]
    ribbon = frames.copy()
    ribbon[..., 1:-1, :2, :] -= share[..., None] * (along + tangents)[..., None, :]
    ribbon[..., 1:-1, 2, :] = tangents
    return ribbon
