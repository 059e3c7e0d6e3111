"""Lifted link of the arm, turns."""

from dataclasses import dataclass
from typing import ClassVar

from ...contracts import Expression, Outputs
from ..registry import register_goal
from .measured import ScalarGoal


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class LiftedLinkGoal(ScalarGoal):
    """Lifted writhe plus twist: what a tip that does not turn keeps."""

    quantity: ClassVar[str] = "lifted_link"
    unit: ClassVar[str] = "turns"
    tolerance: float = 0.05

    def read(self, outputs: Outputs) -> Expression:
        """Lifted link, (T,), turns."""
        return outputs.lifted_link
