"""Damping at a physical rate that is exact over a step, whatever the step."""

import numpy as np
from numpy.typing import ArrayLike

from ..contracts import Floats


def phi1(x: ArrayLike) -> Floats:
    """(exp(x) - 1) / x, 1 at zero."""
    x = np.asarray(x, dtype=float)
    return np.where(x == 0, 1.0, np.expm1(x) / np.where(x == 0, 1.0, x))


def damped(rate: ArrayLike, h: float) -> tuple[Floats, Floats]:
    """What a step `h` (s) leaves of a velocity that decays at `rate` (1/s), and the seconds for which a force acts on it.

    v' = -g v + a has v(h) = exp(-g h) v + h phi1(-g h) a: the force keeps its full effect (applied after the kick, damping would weaken
    it and make the scheme first order).
    """
    rate = np.asarray(rate, dtype=float)
    return np.exp(-rate * h), h * phi1(-rate * h)
