"""Twist of the arm or of a window of it, turns."""

from dataclasses import dataclass
from math import inf, tau
from typing import ClassVar

from ...contracts import Expression, Outputs, Reach
from ..registry import register_goal
from .measured import WindowedGoal


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class TwistGoal(WindowedGoal):
    """Rotation of the frames about the arm: negative where R-OM has stored it.

    In a window: the integral of the material curvature k3 over 2 pi.
    """

    quantity: ClassVar[str] = "twist"
    unit: ClassVar[str] = "turns"
    tolerance: float = 0.05

    def read(self, outputs: Outputs) -> Expression:
        """Twist, (T,), turns."""
        if self.window == (0.0, inf):
            return outputs.twist
        return outputs.curvatures[2] @ (self.weights(outputs) / tau)

    def beyond(self, reach: Reach) -> str:
        """A hand stores at most so much."""
        low, high = self.band
        if low - self.tolerance > reach.twist["L-OM"]:
            return f"L-OM stores at most {reach.twist['L-OM']:.2f} turns of twist"
        if high + self.tolerance < reach.twist["R-OM"]:
            return f"R-OM stores at most {-reach.twist['R-OM']:.2f} turns of twist"
        return ""
