"""Lifted writhe of the arm, turns."""

from dataclasses import dataclass
from typing import ClassVar

from ...contracts import Expression, Outputs, Reach
from ..registry import register_goal
from .measured import ScalarGoal


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class LiftedWritheGoal(ScalarGoal):
    """Coiling of the centreline, without the jumps at self-crossings; measured from the task's pole."""

    quantity: ClassVar[str] = "lifted_writhe"
    unit: ClassVar[str] = "turns"
    tolerance: float = 0.05

    def read(self, outputs: Outputs) -> Expression:
        """Lifted writhe, (T,), turns."""
        return outputs.lifted_writhe

    def beyond(self, reach: Reach) -> str:
        """Bend and twist together give at most so much."""
        low, high = self.band
        if max(low, -high) - self.tolerance > reach.writhe:
            return f"bend and twist give at most {reach.writhe:.2f} turns of writhe"
        return ""
