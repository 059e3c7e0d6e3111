"""Distance between two objects, of which one is carried."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ...contracts import Floats
from ..registry import register_goal
from .recorded import RecordedOutputs
from .touching import TouchingGoal, hold_in

if TYPE_CHECKING:
    from octoctrl.sim.contact.hold import Hold


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectClearanceGoal(TouchingGoal):
    """Smallest distance between the surface of an object with an axis and another one's, m; negative where they overlap.

    Attributes
    ----------
    other : str
        Name of the other object.
    """

    quantity: ClassVar[str] = "object_clearance"
    unit: ClassVar[str] = "m"
    other: str
    tolerance: float = 1e-3

    def measured(self, hold: "Hold", outputs: RecordedOutputs) -> Floats:
        """Distance between the object of the `hold` and the other one of the `outputs`, (T,)."""
        other = hold_in(outputs, self.other)
        return np.asarray(other.distance(hold.core).min(axis=1) - hold.girth)
