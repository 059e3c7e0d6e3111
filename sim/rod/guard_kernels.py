"""What ends a sample: is the motion still one that the model describes, and the arrays that are recorded of it."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..compiler import kernel
from ..contracts import Floats
from .layout import offsets

ONE = np.uint64(1)
FINE, STRETCHED, BENT, NOT_A_NUMBER, SHEARED, SPUN, SUNK = 0, 1, 2, 3, 5, 6, 7
"""What ended a sample: nothing, an element outside the allowed stretch, a joint bent too far, a value that is no number, a section that
has fallen over, a frame that is no longer orthonormal (4 is speed, which the assembly watches), and, found by the stepping and not by the
guard, a point that has sunk deeper into an object than its contact explains."""

STRETCH_LIMITS = (0.2, 3.0)
JOINT_LIMIT = 1.5
"""Largest angle between neighbouring elements, rad, that the logarithm's series resolves."""
SHEAR_LIMIT = 0.5
"""Smallest cosine between an element's d3 and its tangent. Arms that move sensibly stay above 0.65; below it a section folds over and can
stay so, for shear is linear: an element that is turned inside out would be a second state of rest."""
ORTHONORMAL_LIMIT = 5e-11
"""The series of a step's rotation leaves this error when an element turns by a radian in one step."""


def guard_kernel(stride: int) -> Callable[..., Any]:
    """Compile ``guard(buffer, n)`` -> finding, element."""
    o = offsets(stride)
    X1, X2, X3, STRETCH, JOINT_LENGTH = (o[k] for k in ("X1", "X2", "X3", "STRETCH", "JOINT_LENGTH"))
    Q11, Q12, Q13, Q31, Q32, Q33 = (o[k] for k in ("Q11", "Q12", "Q13", "Q31", "Q32", "Q33"))
    T1, T2, T3, K1, K2, K3, BEND1 = (o[k] for k in ("T1", "T2", "T3", "K1", "K2", "K3", "BEND1"))

    @kernel
    def bent(b: Floats, k: np.uint64) -> bool:
        # A joint that carries nothing, at a free end, may be anyhow.
        angle = JOINT_LIMIT / b[JOINT_LENGTH + k]
        return b[BEND1 + k] > 0 and not b[K1 + k] ** 2 + b[K2 + k] ** 2 + b[K3 + k] ** 2 < angle * angle

    @kernel
    def guard(b: Floats, n: np.uint64) -> tuple[int, Any]:
        for k in range(ONE, n + ONE):
            if not (np.isfinite(b[X1 + k + ONE]) and np.isfinite(b[X2 + k + ONE]) and np.isfinite(b[X3 + k + ONE])):
                return NOT_A_NUMBER, k
            if not STRETCH_LIMITS[0] < b[STRETCH + k] < STRETCH_LIMITS[1]:
                return STRETCHED, k
            if not b[T1 + k] * b[Q31 + k] + b[T2 + k] * b[Q32 + k] + b[T3 + k] * b[Q33 + k] > SHEAR_LIMIT:
                return SHEARED, k
            axis = b[Q31 + k] ** 2 + b[Q32 + k] ** 2 + b[Q33 + k] ** 2 - 1
            side = b[Q11 + k] ** 2 + b[Q12 + k] ** 2 + b[Q13 + k] ** 2 - 1
            if not abs(axis) + abs(side) < ORTHONORMAL_LIMIT:
                return SPUN, k
            if bent(b, k):
                return BENT, k
        return (BENT, n) if bent(b, n + ONE) else (FINE, ONE)

    return guard


def record_kernel(stride: int) -> Callable[..., Any]:
    """Compile ``record(buffer, n, points, directors, stretch)``, which fills the three arrays of one instant."""
    o = offsets(stride)
    X1, X2, X3, LENGTH = (o[k] for k in ("X1", "X2", "X3", "LENGTH"))
    Q = tuple(o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))

    @kernel
    def record(b: Floats, n: np.uint64, points: Floats, directors: Floats, stretch: Floats) -> None:
        for k in range(ONE, n + ONE + ONE):
            points[k - ONE, 0], points[k - ONE, 1], points[k - ONE, 2] = b[X1 + k], b[X2 + k], b[X3 + k]
        for k in range(ONE, n + ONE):
            for i in range(9):
                directors[k - ONE, i // 3, i % 3] = b[Q[i] + k]
            d1, d2, d3 = b[X1 + k + ONE] - b[X1 + k], b[X2 + k + ONE] - b[X2 + k], b[X3 + k + ONE] - b[X3 + k]
            stretch[k - ONE] = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3) / b[LENGTH + k]

    return record
