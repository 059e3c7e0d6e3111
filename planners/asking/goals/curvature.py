"""Mean curvature of the arm or of a window of it, 1/m."""

from dataclasses import dataclass
from typing import ClassVar

from ...contracts import Expression, Outputs
from ..registry import register_goal
from .measured import WindowedGoal, bending


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class CurvatureGoal(WindowedGoal):
    """Mean size of the curvature along the window: sum of w |k| over sum of w, w being lengths."""

    quantity: ClassVar[str] = "curvature"
    unit: ClassVar[str] = "1/m"
    tolerance: float = 2.0

    def read(self, outputs: Outputs) -> Expression:
        """Mean curvature, (T,), 1/m."""
        weights = self.weights(outputs)
        return bending(outputs) @ (weights / weights.sum())
