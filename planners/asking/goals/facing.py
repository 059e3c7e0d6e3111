"""Whether the suckers face an object."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from octoctrl.sim.errors import check_number

from ...contracts import Floats
from ..registry import register_goal
from .recorded import RecordedOutputs
from .touching import TouchingGoal

if TYPE_CHECKING:
    from octoctrl.sim.contact.hold import Hold

NEAR = 0.01
"""Length of arm to either side of the nearest element that counts, m."""


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class FacingGoal(TouchingGoal):
    """Cosine of the angle between the suckers' side and the direction to an object's axis: mean of the arm near to it.

    Attributes
    ----------
    azimuth : float, rad
        Of the suckers.
    """

    quantity: ClassVar[str] = "facing"
    unit: ClassVar[str] = ""
    of_planes: ClassVar[bool] = True
    limits: ClassVar[tuple[float, float]] = (-1.0, 1.0)
    azimuth: float = 0.0
    tolerance: float = 0.1

    def __post_init__(self) -> None:
        TouchingGoal.__post_init__(self)
        check_number("azimuth", self.azimuth, unit="rad")

    def measured(self, hold: "Hold", outputs: RecordedOutputs) -> Floats:
        """The cosine for the `hold`, (T,), with frames and stations of the `outputs`."""
        recording = outputs.recording
        frames, stations = recording.frames[:, 1:-1], recording.stations[1:-1]
        side = np.sin(self.azimuth) * frames[:, :, 0] + np.cos(self.azimuth) * frames[:, :, 1]
        cosine = np.einsum("tkc,tkc->tk", side, hold.towards)
        near = np.abs(stations[None] - stations[hold.gap.argmin(axis=1)][:, None]) <= NEAR
        return np.asarray((cosine * near).sum(axis=1) / near.sum(axis=1))
