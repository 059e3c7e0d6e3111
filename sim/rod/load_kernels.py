"""Loads from outside on a rod in compiled code, from what `octoctrl.sim.scene.loads.sampled_loads` gives."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..compiler import kernel
from ..contracts import Floats
from ..scene.loads import FAR, FORCE, NEAR, TORQUE, TWIST
from .layout import offsets

ONE = np.uint64(1)


def load_kernel(stride: int) -> Callable[..., Any]:
    """Compile what writes loads into the buffer.

    Parameters
    ----------
    stride : int
        Of the buffer.

    Returns
    -------
    compiled function
        ``load(buffer, n, before, after, share)`` sets forces on nodes and couples on elements, both in the lab frame, from the samples
        (2 or 5, 3, n + 1) before and after, of which the latter counts by `share`; what follows an element turns with its frame of now.
        Returns whether the next step needs it anew.
    """
    o = offsets(stride)
    F, C = tuple(o[f"FORCE{i}"] for i in (1, 2, 3)), tuple(o[f"COUPLE{i}"] for i in (1, 2, 3))
    Q = tuple(o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))

    @kernel
    def load(b: Floats, n: np.uint64, before: Floats, after: Floats, share: float) -> bool:
        for c in range(3):
            for k in range(ONE, n + ONE + ONE):
                b[F[c] + k] = (1 - share) * before[FORCE, c, k - ONE] + share * after[FORCE, c, k - ONE]
                b[C[c] + k] = (1 - share) * before[TORQUE, c, k - ONE] + share * after[TORQUE, c, k - ONE]
        if before.shape[0] <= NEAR:
            for c in range(3):
                for k in range(ONE, n + ONE + ONE):
                    if before[FORCE, c, k - ONE] != after[FORCE, c, k - ONE] or before[TORQUE, c, k - ONE] != after[TORQUE, c, k - ONE]:
                        return True
            return False
        for d in range(3):
            for k in range(ONE, n + ONE):
                near = (1 - share) * before[NEAR, d, k - ONE] + share * after[NEAR, d, k - ONE]
                far = (1 - share) * before[FAR, d, k - ONE] + share * after[FAR, d, k - ONE]
                turn = (1 - share) * before[TWIST, d, k - ONE] + share * after[TWIST, d, k - ONE]
                for c in range(3):
                    director = b[Q[3 * d + c] + k]
                    b[F[c] + k] += near * director
                    b[F[c] + k + ONE] += far * director
                    b[C[c] + k] += turn * director
        return True

    return load
