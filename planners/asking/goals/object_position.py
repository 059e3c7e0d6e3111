"""Where an object is, along a direction."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from octoctrl.sim.errors import OctoctrlError

from ...contracts import Floats
from ..registry import register_goal
from .measured import three_numbers
from .recorded import RecordedOutputs
from .touching import TouchingGoal

if TYPE_CHECKING:
    from octoctrl.sim.contact.hold import Hold
    from octoctrl.sim.scene.objects import RigidObject


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectPositionGoal(TouchingGoal):
    """Coordinate of an object's centre along a direction from the arm's base, m.

    Attributes
    ----------
    direction : (float, float, float)
        Of any length but zero.
    """

    quantity: ClassVar[str] = "object_position"
    unit: ClassVar[str] = "m"
    of_planes: ClassVar[bool] = True
    direction: tuple[float, float, float] = (1.0, 0.0, 0.0)
    tolerance: float = 5e-3

    def __post_init__(self) -> None:
        TouchingGoal.__post_init__(self)
        object.__setattr__(self, "direction", three_numbers("goal object_position: direction", self.direction))
        if not any(self.direction):
            raise OctoctrlError("goal object_position: direction is (0, 0, 0); three numbers are needed, not all zero")

    def __str__(self) -> str:
        return f"{TouchingGoal.__str__(self)} along ({', '.join(f'{part:g}' for part in self.direction)})"

    def at_rest(self, item: "RigidObject") -> float:
        """Coordinate of the `item` at the begin."""
        return float(np.asarray(item.position) @ self._unit)

    def measured(self, hold: "Hold", outputs: RecordedOutputs) -> Floats:
        """Coordinate of the object of the `hold`, (T,); the `outputs` say no more of it."""
        return np.asarray(hold.touch.position @ self._unit)

    @property
    def _unit(self) -> Floats:
        return np.array(self.direction) / np.linalg.norm(self.direction)
