"""Length of the arm, m."""

from dataclasses import dataclass
from typing import ClassVar

from ...contracts import Expression, Outputs, Reach
from ..registry import register_goal
from .measured import ScalarGoal


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class LengthGoal(ScalarGoal):
    """Length of the centreline."""

    quantity: ClassVar[str] = "length"
    unit: ClassVar[str] = "m"
    tolerance: float = 0.005

    def read(self, outputs: Outputs) -> Expression:
        """Length, (T,), m."""
        return outputs.length

    def beyond(self, reach: Reach) -> str:
        """Longitudinal and transverse muscles set the limits."""
        (low, high), (shortest, longest) = self.band, reach.length
        if low > longest or high < shortest:
            return f"the arm is between {shortest * 1e3:.0f} and {longest * 1e3:.0f} mm long"
        return ""
