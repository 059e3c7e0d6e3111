"""Position of the tip, m."""

from dataclasses import dataclass
from math import dist
from typing import ClassVar

from octoctrl.sim.errors import check_number

from ...contracts import Expression, Outputs, Reach
from ..registry import register_goal
from .measured import MeasuredGoal


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
    value: tuple[float, float, float]
    tolerance: float = 0.01

    def __post_init__(self) -> None:
        MeasuredGoal.__post_init__(self)
        for number in self.value:
            check_number("goal tip", number, unit="m")

    @property
    def target(self) -> str:
        """The point in words."""
        return f"({', '.join(f'{number:g}' for number in self.value)})"

    def residuals(self, outputs: Outputs) -> list[Expression]:
        """Tip minus point."""
        return [outputs.tip[:, axis] - number for axis, number in enumerate(self.value)]

    def beyond(self, reach: Reach) -> str:
        """The tip is no farther from the base than the arm is long."""
        if dist(self.value, (0.0, 0.0, 0.0)) - self.tolerance > reach.length[1]:
            return f"the arm is at most {reach.length[1] * 1e3:.0f} mm long"
        return ""

    def excludes(self, other: MeasuredGoal) -> bool:
        """Whether both name points that lie farther apart than the tolerances."""
        return isinstance(other, TipGoal) and dist(self.value, other.value) > self.tolerance + other.tolerance
