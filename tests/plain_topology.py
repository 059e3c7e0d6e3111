"""Topology of raw recordings read by other formulas than the library's: plain NumPy and SciPy, nothing of ours.

Writhe by Klenin and Langowski's four arcsines (2000, method 1a) over all pairs of segments; twist by SciPy's rotation vectors; link as the
turning of d1 about the tangent against a reference carried there from the pole; areas by the excess of a spherical triangle's angles.
"""

import numpy as np
from scipy.spatial.transform import Rotation

POLE = np.array([0.0, 0.0, 1.0])


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def cosine(a, b):
    return np.clip(np.einsum("...i,...i", a, b), -1.0, 1.0)


def with_rays(points, first, last, lengths=1000.0):
    far = lengths * np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    return np.concatenate([[points[0] - far * first], points, [points[-1] + far * last]])


def gauss_pairs(a0, a1, b0, b1):
    """Signed solid angle over 4 pi of segments a against segments b, all (pairs, 3)."""
    r13, r14, r23, r24 = b0 - a0, b1 - a0, b0 - a1, b1 - a1
    with np.errstate(invalid="ignore"):  # of segments in one line, which see nothing of each other
        sides = [unit(np.cross(*pair)) for pair in ((r13, r14), (r14, r24), (r24, r23), (r23, r13))]
    angle = sum(np.arcsin(cosine(sides[k], sides[(k + 1) % 4])) for k in range(4))
    sign = np.sign(np.einsum("...i,...i", np.cross(b1 - b0, a1 - a0), r13))
    return np.where(sign == 0.0, 0.0, np.nan_to_num(angle) * sign) / (4 * np.pi)


def writhe(points):
    """Of one curve (n + 1, 3) as it is."""
    i, j = np.triu_indices(len(points) - 1, 2)
    return 2 * gauss_pairs(points[i], points[i + 1], points[j], points[j + 1]).sum()


def link(first, second):
    """Of two curves as they are."""
    i, j = (index.ravel() for index in np.indices((len(first) - 1, len(second) - 1)))
    return gauss_pairs(first[i], first[i + 1], second[j], second[j + 1]).sum()


def reference(pole, tangents):
    """Two directions across each tangent (m, 3): those across the pole, carried to it by the smallest rotation."""
    across = unit(np.cross(pole, [0.3, 0.5, -0.7]))
    first = smallest_rotation(np.broadcast_to(pole, tangents.shape), tangents).apply(across)
    return first, np.cross(tangents, first)


def triangle_area(a, b, c):
    """Signed area of a spherical triangle by its angles (Girard); positive when a, b, c turn right-handed about the outward normal."""

    def angle(at, one, other):
        return np.arccos(cosine(unit(np.cross(at, one)), unit(np.cross(at, other))))

    if np.linalg.norm(b - c) < 1e-12:
        return 0.0
    excess = angle(a, b, c) + angle(b, c, a) + angle(c, a, b) - np.pi
    return excess * np.sign(np.dot(a, np.cross(b, c)))


def smallest_rotation(a, b):
    """Rotations that take the directions a to b (m, 3)."""
    axis, angle = np.cross(a, b), np.arccos(cosine(a, b))
    size = np.linalg.norm(axis, axis=-1)
    return Rotation.from_rotvec(axis * np.divide(angle, size, out=np.zeros_like(size), where=size > 0)[..., None])


def onto_edges(points, frames):
    """Frames of the elements turned by the smallest rotation that takes d3 to the edge; base and tip as they are."""
    turned = frames.copy()
    rotation = smallest_rotation(frames[1:-1, 2], unit(np.diff(points, axis=0)))
    for row in range(3):
        turned[1:-1, row] = rotation.apply(frames[1:-1, row])
    return turned


def frame_numbers(frames, pole=POLE):
    """Twist and lifted writhe (modulo 2) of frames (m, 3, 3)."""
    turns = Rotation.from_matrix(frames[1:] @ frames[:-1].swapaxes(-1, -2)).as_rotvec()
    twist = -turns[:, 2].sum() / (2 * np.pi)
    first, second = reference(pole, frames[:, 2])
    phase = np.arctan2(np.einsum("ij,ij->i", frames[:, 0], second), np.einsum("ij,ij->i", frames[:, 0], first))
    steps = np.diff(phase)
    linked = (steps - 2 * np.pi * np.round(steps / (2 * np.pi))).sum() + triangle_area(pole, frames[-1, 2], frames[0, 2])
    return twist, linked / (2 * np.pi) - twist


def read(recording, pole=POLE):
    """Twist, writhe, lifted writhe, crossings and residual (T,) of a recording, as a dict."""
    rows = []
    for points, frames in zip(recording.points, recording.frames, strict=True):
        closed = with_rays(points, frames[0, 2], frames[-1, 2])
        rows.append((*frame_numbers(onto_edges(points, frames), pole), writhe(closed)))
    twist, lifted, gauss = np.array(rows).T
    lifted = np.unwrap(lifted, period=2.0)
    crossings = np.round((lifted - gauss) / 2)
    return {
        "time": recording.time,
        "twist": twist,
        "lifted_writhe": lifted,
        "lifted_link": lifted + twist,
        "writhe": gauss,
        "crossings": crossings,
        "residual": lifted - 2 * crossings - gauss,
        "length": np.linalg.norm(np.diff(recording.points, axis=1), axis=2).sum(axis=1),
    }
