"""Whether the arm bends towards its suckers."""

from dataclasses import dataclass
from math import cos, sin
from typing import ClassVar

from octoctrl.sim.errors import check_number

from ...contracts import Expression, Outputs
from ..registry import register_goal
from .measured import WindowedGoal, bending


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class SuckerSideGoal(WindowedGoal):
    """Where the suckers are in the bends of the window: 1 all inside, -1 all outside, 0 across or straight.

    With the suckers at the azimuth phi of the material plane, sum of w (k2 sin phi - k1 cos phi) over sum of w |k|.

    Attributes
    ----------
    azimuth : float, rad
        Of the sucker line, from d2 towards d1 (at rest from +x towards +z, as the longitudinal muscles are numbered: 45 deg from one to
        the next).
    """

    quantity: ClassVar[str] = "sucker_side"
    unit: ClassVar[str] = ""
    tolerance: float = 0.1
    azimuth: float = 0.0

    def __post_init__(self) -> None:
        WindowedGoal.__post_init__(self)
        check_number("azimuth", self.azimuth, unit="rad")
        for number in self.band:
            if abs(number) < float("inf"):
                check_number("goal sucker_side", number, at_least=-1.0, at_most=1.0)

    def read(self, outputs: Outputs) -> Expression:
        """Side, (T,)."""
        weights = self.weights(outputs)
        first, second, _ = outputs.curvatures
        inward = second * sin(self.azimuth) - first * cos(self.azimuth)
        return (inward @ weights) / (bending(outputs) @ weights)
