"""Twist of the arm, turns."""

from dataclasses import dataclass
from typing import ClassVar

from ...contracts import Expression, Outputs, Reach
from ..registry import register_goal
from .measured import ScalarGoal


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class TwistGoal(ScalarGoal):
    """Rotation of the frames about the arm: negative where R-OM has stored it."""

    quantity: ClassVar[str] = "twist"
    unit: ClassVar[str] = "turns"
    tolerance: float = 0.05

    def read(self, outputs: Outputs) -> Expression:
        """Twist, (T,), turns."""
        return outputs.twist

    def beyond(self, reach: Reach) -> str:
        """A hand stores at most so much."""
        low, high = self.band
        if low - self.tolerance > reach.twist["L-OM"]:
            return f"L-OM stores at most {reach.twist['L-OM']:.2f} turns of twist"
        if high + self.tolerance < reach.twist["R-OM"]:
            return f"R-OM stores at most {-reach.twist['R-OM']:.2f} turns of twist"
        return ""
