"""Frames of the tip in compiled code: a plant's axis has frames at its element centres only."""

import math

import numpy as np

from ..compiler import kernel
from ..contracts import Floats
from ..topology.topology_kernels import frame_rotations


@kernel
def turn_on(frames: Floats, share: float) -> None:
    """Fill the last of each series of frames (T, m, 3, 3): the one before it, turned on by a `share` of what that turned from its own."""
    last = np.empty((1, 1, 3))
    for k in range(frames.shape[0]):
        m = frames.shape[1]
        frame_rotations(frames[k : k + 1, m - 3 : m - 1], last)
        u1, u2, u3 = share * last[0, 0, 0], share * last[0, 0, 1], share * last[0, 0, 2]
        square = u1 * u1 + u2 * u2 + u3 * u3
        angle = math.sqrt(square)
        sine = math.sin(angle) / angle if angle > 1e-4 else 1 - square / 6
        half = 0.5 * (math.sin(0.5 * angle) / (0.5 * angle)) ** 2 if angle > 1e-4 else 0.5 - square / 24
        for c in range(3):
            d1, d2, d3 = frames[k, m - 2, 0, c], frames[k, m - 2, 1, c], frames[k, m - 2, 2, c]
            # exp(-[u]) Q: minus u x Q, plus half of u x (u x Q).
            f1, f2, f3 = u2 * d3 - u3 * d2, u3 * d1 - u1 * d3, u1 * d2 - u2 * d1
            frames[k, m - 1, 0, c] = d1 - sine * f1 + half * (u2 * f3 - u3 * f2)
            frames[k, m - 1, 1, c] = d2 - sine * f2 + half * (u3 * f1 - u1 * f3)
            frames[k, m - 1, 2, c] = d3 - sine * f3 + half * (u1 * f2 - u2 * f1)
