"""How often the arm beyond an object would go round it: what has to be left for the grasp when the arm comes near."""

from dataclasses import dataclass
from math import tau
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
class FreeTurnsGoal(TouchingGoal):
    """Turns for which the rest of the arm suffices, from the element nearest to a round object on, its mean radius included."""

    quantity: ClassVar[str] = "free_turns"
    unit: ClassVar[str] = "turns"
    tolerance: float = 0.1

    def measured(self, hold: "Hold", outputs: RecordedOutputs) -> Floats:
        """Turns by the nearest element of the `hold`, (T,), with the arm of the `outputs`."""
        stations = outputs.recording.stations[1:-1]
        radius = np.asarray(outputs.arm.section(stations).outer_radius)
        beyond = np.cumsum(radius[::-1])[::-1] / np.arange(len(radius), 0, -1)
        nearest = hold.gap.argmin(axis=1)
        return np.asarray((outputs.arm.length - stations[nearest]) / (tau * (hold.girth + beyond[nearest])))
