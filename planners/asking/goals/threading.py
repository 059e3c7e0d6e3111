"""How often the arm passes between two objects: what says that it is through a crevice."""

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
class ThreadingGoal(TouchingGoal):
    """Passes of the centreline between an object and another one, both with parallel axes, less those beside them.

    Counted where it crosses the plane of both axes.

    Attributes
    ----------
    other : str
        Name of the other object.
    """

    quantity: ClassVar[str] = "threading"
    unit: ClassVar[str] = ""
    handled: ClassVar[bool] = False
    other: str
    tolerance: float = 0.5

    def measured(self, hold: "Hold", outputs: RecordedOutputs) -> Floats:
        """Passes between the object of the `hold` and the other one of the `outputs`, (T,)."""
        first, second = hold.touch.position, hold_in(outputs, self.other).touch.position
        axis, points = hold.touch.frame[:, 2], outputs.recording.points
        across = second - first
        across = across - np.einsum("tc,tc->t", across, axis)[:, None] * axis
        normal = np.cross(axis, across)
        local = points - first[:, None]
        height = np.einsum("tkc,tc->tk", local, normal)
        share = np.einsum("tkc,tc->tk", local, across) / np.einsum("tc,tc->t", across, across)[:, None]
        crosses = height[:, 1:] * height[:, :-1] < 0
        middle = (share[:, 1:] + share[:, :-1]) / 2
        between = (middle > 0) & (middle < 1)
        return np.asarray((crosses & between).sum(axis=1) - (crosses & ~between).sum(axis=1), dtype=float)
