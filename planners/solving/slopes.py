"""Arrays that carry their derivatives, for the activation of a schedule whose numbers the planner chooses.

The formulas of `octoctrl.sim.templates` take the module they calculate with. Given numbers of this kind, and `SlopesMath`, they yield
levels and their derivatives by the unknowns in one pass, exactly, without building anything: forward differentiation (Wengert 1964). A
primitive of one's own joins in as long as it calculates with + - * / and powers.
"""

from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Number = Union["Slopes", float, Floats]


class Slopes:
    """Values, of any shape, and their derivatives by p unknowns, of that shape and one axis more.

    Parameters
    ----------
    value : array_like
    slope : array_like
        Its last axis is that of the unknowns; the others need only broadcast to those of the values.
    """

    __slots__ = ("slope", "value")
    __array_ufunc__ = None  # NumPy leaves mixed operations to this class

    def __init__(self, value: ArrayLike, slope: ArrayLike) -> None:
        self.value, self.slope = np.asarray(value, dtype=float), np.asarray(slope, dtype=float)

    def is_symbolic(self) -> bool:
        """What templates ask before they check a number; the planner's own bounds hold for these."""
        return False

    def _chained(self, value: Floats, rate: Floats | float) -> "Slopes":
        return Slopes(value, np.asarray(rate)[..., None] * self.slope)

    def __neg__(self) -> "Slopes":
        return Slopes(-self.value, -self.slope)

    def __add__(self, other: Number) -> "Slopes":
        if isinstance(other, Slopes):
            return Slopes(self.value + other.value, self.slope + other.slope)
        return Slopes(self.value + other, self.slope)

    __radd__ = __add__

    def __sub__(self, other: Number) -> "Slopes":
        return self + -other

    def __rsub__(self, other: Number) -> "Slopes":
        return -self + other

    def __mul__(self, other: Number) -> "Slopes":
        if isinstance(other, Slopes):
            slope = self.value[..., None] * other.slope + other.value[..., None] * self.slope
            return Slopes(self.value * other.value, slope)
        return self._chained(self.value * other, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> "Slopes":
        return self * other**-1 if isinstance(other, Slopes) else self * (1 / np.asarray(other))

    def __rtruediv__(self, other: Number) -> "Slopes":
        return self**-1 * other

    def __pow__(self, power: float) -> "Slopes":
        return self._chained(self.value**power, power * self.value ** (power - 1))


class SlopesMath:
    """The functions that templates use, on `Slopes`, in the place of `numpy` or `casadi`."""

    @staticmethod
    def fmax(a: Any, b: Any) -> Any:
        """The larger one."""
        return _chosen(a, b, True)

    @staticmethod
    def fmin(a: Any, b: Any) -> Any:
        """The smaller one."""
        return _chosen(a, b, False)

    @staticmethod
    def fabs(x: Any) -> Any:
        """The size."""
        return x._chained(np.abs(x.value), np.sign(x.value)) if isinstance(x, Slopes) else np.abs(x)

    @staticmethod
    def cos(x: Any) -> Any:
        """Cosine."""
        return x._chained(np.cos(x.value), -np.sin(x.value)) if isinstance(x, Slopes) else np.cos(x)

    @staticmethod
    def sin(x: Any) -> Any:
        """Sine."""
        return x._chained(np.sin(x.value), np.cos(x.value)) if isinstance(x, Slopes) else np.sin(x)

    @staticmethod
    def exp(x: Any) -> Any:
        """Exponential."""
        return x._chained(np.exp(x.value), np.exp(x.value)) if isinstance(x, Slopes) else np.exp(x)

    @staticmethod
    def log1p(x: Any) -> Any:
        """Logarithm of 1 + x."""
        return x._chained(np.log1p(x.value), 1 / (1 + x.value)) if isinstance(x, Slopes) else np.log1p(x)


def _chosen(a: Any, b: Any, larger: bool) -> Any:
    if not isinstance(a, Slopes) and not isinstance(b, Slopes):
        return (np.fmax if larger else np.fmin)(a, b)
    first, second = (part.value if isinstance(part, Slopes) else np.asarray(part, dtype=float) for part in (a, b))
    take = first >= second if larger else first <= second
    rise, other = (part.slope if isinstance(part, Slopes) else 0.0 for part in (a, b))
    return Slopes(np.where(take, first, second), np.where(take[..., None], rise, other))
