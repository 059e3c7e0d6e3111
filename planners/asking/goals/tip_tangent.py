"""Orientation of the tip."""

from dataclasses import dataclass
from math import dist, hypot
from typing import ClassVar

from octoctrl.sim.errors import OctoctrlError, check_number

from ...contracts import Expression, Outputs
from ..registry import register_goal
from .measured import MeasuredGoal, three_numbers


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class TipTangentGoal(MeasuredGoal):
    """A direction in which the tip points.

    Attributes
    ----------
    direction : (float, float, float)
        Of any length but zero; kept as a unit vector.
    tolerance : float, rad
        Distance of the unit vectors: 2 sin(angle / 2), which is the angle to 1 % up to half a radian.
    """

    quantity: ClassVar[str] = "tip_tangent"
    unit: ClassVar[str] = "rad"
    direction: tuple[float, float, float]
    tolerance: float = 0.2

    def __post_init__(self) -> None:
        MeasuredGoal.__post_init__(self)
        object.__setattr__(self, "direction", three_numbers("goal tip_tangent: direction", self.direction))
        for number in self.direction:
            check_number("goal tip_tangent", number)
        size = hypot(*self.direction)
        if size == 0.0:
            raise OctoctrlError("goal tip_tangent: direction is (0, 0, 0); three numbers are needed, not all zero, for example (0, 1, 0)")
        first, second, third = (number / size for number in self.direction)
        object.__setattr__(self, "direction", (first, second, third))

    @property
    def target(self) -> str:
        """The direction in words."""
        return f"({', '.join(f'{number:.3g}' for number in self.direction)})"

    def residuals(self, outputs: Outputs) -> list[Expression]:
        """Tangent minus direction."""
        return [outputs.tip_tangent[:, axis] - number for axis, number in enumerate(self.direction)]

    def excludes(self, other: MeasuredGoal) -> bool:
        """Whether both name directions that lie farther apart than the tolerances."""
        return isinstance(other, TipTangentGoal) and dist(self.direction, other.direction) > self.tolerance + other.tolerance
