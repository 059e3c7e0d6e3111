"""By how much an object was turned."""

from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING, ClassVar

from ...contracts import Floats
from ..registry import register_goal
from .recorded import RecordedOutputs
from .touching import TouchingGoal

if TYPE_CHECKING:
    from octoctrl.sim.contact.hold import Hold
    from octoctrl.sim.scene.objects import RigidObject


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectTurnGoal(TouchingGoal):
    """Angle, rad, whatever its sense, by which an object's axis has turned from where it was at the begin, in the plane of its turning."""

    quantity: ClassVar[str] = "object_turn"
    unit: ClassVar[str] = "rad"
    limits: ClassVar[tuple[float, float]] = (0.0, pi)
    tolerance: float = 0.2

    def at_rest(self, item: "RigidObject") -> float:
        """Nothing, whatever the `item`."""
        return 0.0

    def measured(self, hold: "Hold", outputs: RecordedOutputs) -> Floats:
        """Angle of the `hold`, (T,); the `outputs` say no more of it."""
        return hold.spun
