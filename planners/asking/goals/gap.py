"""Distance between the arm's surface and an object's: what brings the arm near before it grasps."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ...contracts import Floats
from ..registry import register_goal
from .recorded import RecordedOutputs
from .touching import TouchingGoal

if TYPE_CHECKING:
    from octoctrl.sim.contact.hold import Hold


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class GapGoal(TouchingGoal):
    """Smallest distance of the arm's surface from an object's, m; negative where they overlap."""

    quantity: ClassVar[str] = "gap"
    unit: ClassVar[str] = "m"
    of_planes: ClassVar[bool] = True
    tolerance: float = 2e-3

    def measured(self, hold: "Hold", outputs: RecordedOutputs) -> Floats:
        """Gap of the `hold`, (T,); the `outputs` say no more of it."""
        return np.asarray(hold.gap.min(axis=1))
