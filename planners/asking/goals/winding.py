"""Turns of the whole arm about an object, touching or not: what says that it was let go."""

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
class WindingGoal(TouchingGoal):
    """Turns, whatever their sense, of the whole arm about an object's axis."""

    quantity: ClassVar[str] = "winding"
    unit: ClassVar[str] = "turns"
    tolerance: float = 0.05

    def measured(self, hold: "Hold", outputs: RecordedOutputs) -> Floats:
        """Winding of the `hold`, (T,); the `outputs` say no more of it."""
        return np.abs(hold.winding)
