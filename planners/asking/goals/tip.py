"""Position of the tip, m."""

from dataclasses import dataclass
from math import dist
from typing import ClassVar

from octoctrl.sim.errors import check_number

from ...contracts import Expression, Outputs, Reach
from ..registry import register_goal
from ..shares import Length, Share, unresolved
from .measured import MeasuredGoal, three_numbers


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class TipGoal(MeasuredGoal):
    """A point that the tip reaches; the arm's base is at the origin and leaves it along +y.

    Attributes
    ----------
    value : (float, float, float), m
    """

    quantity: ClassVar[str] = "tip"
    unit: ClassVar[str] = "m"
    value: tuple[Length, Length, Length]
    tolerance: float = 0.01

    def __post_init__(self) -> None:
        MeasuredGoal.__post_init__(self)
        object.__setattr__(self, "value", three_numbers("goal tip: value", self.value))
        for number in () if unresolved(self.value) else self.value:
            check_number("goal tip", number, unit="m")

    @property
    def target(self) -> str:
        """The point in words."""
        return f"({', '.join(str(number) if isinstance(number, Share) else f'{number:g}' for number in self.value)})"

    @property
    def point(self) -> tuple[float, float, float]:
        """The point, m."""
        x, y, z = map(float, self.value)
        return x, y, z

    def residuals(self, outputs: Outputs) -> list[Expression]:
        """Tip minus point."""
        return [outputs.tip[:, axis] - number for axis, number in enumerate(self.point)]

    def beyond(self, reach: Reach) -> str:
        """The tip is no farther from the base than the arm is long."""
        if dist(self.point, (0.0, 0.0, 0.0)) - self.tolerance > reach.length[1]:
            return f"the arm is at most {reach.length[1] * 1e3:.0f} mm long"
        return ""

    def excludes(self, other: MeasuredGoal) -> bool:
        """Whether both name points that lie farther apart than the tolerances."""
        if not isinstance(other, TipGoal) or unresolved((self, other)):
            return False
        return dist(self.point, other.point) > self.tolerance + other.tolerance
