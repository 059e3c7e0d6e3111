"""Turns of the arm about an object, of those elements that lie on it: what a grasp is measured by."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ...contracts import Floats
from ..registry import register_goal
from .recorded import RecordedOutputs
from .touching import TouchingGoal, hold_in

if TYPE_CHECKING:
    from octoctrl.sim.contact.hold import Hold

MARGIN = 0.4
"""Turns beyond the goal for which a search still strives."""


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class CoveredWindingGoal(TouchingGoal):
    """Turns, whatever their sense, of the elements that lie on an object within its length."""

    quantity: ClassVar[str] = "covered_winding"
    unit: ClassVar[str] = "turns"
    enough: ClassVar[float] = 0.3
    tolerance: float = 0.05

    def measured(self, hold: "Hold", outputs: RecordedOutputs) -> Floats:
        """Covered winding of the `hold`, (T,); the `outputs` say no more of it."""
        return np.abs(hold.covered)

    def price(self, outputs: RecordedOutputs) -> float:
        """Turns that are missing on the object at the least instant, half of those near it, a tenth of all, and half of what drifts."""
        hold = hold_in(outputs, self.object)
        covered, near, all_ = (np.abs(turns) for turns in (hold.covered, hold.near, hold.winding))
        low, high = self.band
        if not np.isfinite(low):
            return float(max(covered.max() - high, 0.0) + 0.3 * max(near.max() - high, 0.0))
        wanted = low + MARGIN
        missing = max(wanted - covered.min(), 0.0) + 0.5 * max(wanted - near[-1], 0.0) + 0.1 * max(wanted - all_[-1], 0.0)
        return float(missing + 0.5 * np.ptp(hold.winding))
