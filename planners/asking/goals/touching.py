"""What goals about objects have in common: they are read on recordings alone, so that a plan for them is searched by simulating."""

from dataclasses import dataclass
from math import inf, isfinite
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from octoctrl.sim.errors import OctoctrlError, check_number

from ...contracts import Floats, Outputs
from .measured import ScalarGoal
from .recorded import RecordedOutputs

if TYPE_CHECKING:
    from octoctrl.sim.contact.hold import Hold
    from octoctrl.sim.scene.objects import RigidObject


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchingGoal(ScalarGoal):
    """A goal for one number that is read of an object of the scene; a subclass reads it in `measured`.

    Attributes
    ----------
    object : str
        Its name in the scene.
    """

    simulated: ClassVar[bool] = True
    steered: ClassVar[bool] = False  # the model, on which feedback is designed, knows nothing of it
    handled: ClassVar[bool] = True
    """Whether the object is what the arm is to hold or to move; otherwise it is only in the way."""
    of_planes: ClassVar[bool] = False
    """Whether the number can be read of a plane, which has neither an axis to be wound round nor an end."""
    enough: ClassVar[float] = 0.15
    """Price that needs no bettering."""
    limits: ClassVar[tuple[float, float]] = (-inf, inf)
    """What the number can be."""
    object: str

    def __post_init__(self) -> None:
        ScalarGoal.__post_init__(self)
        low, high = self.limits
        for number in (number for number in self.band if isfinite(low) and isfinite(number)):
            check_number(f"goal {self.quantity}", number, at_least=low, at_most=high, unit=self.unit)
        if self.object == getattr(self, "other", None):
            raise OctoctrlError(f"goal {self.quantity}: object and other are both '{self.object}'; name two objects")

    def __str__(self) -> str:
        return f"{ScalarGoal.__str__(self)} of '{self.object}'"

    def measured(self, hold: "Hold", outputs: RecordedOutputs) -> Floats:
        """The number, (T,), of how the object is held, and of what else the outputs say."""
        raise NotImplementedError

    def at_rest(self, item: "RigidObject") -> float | None:
        """The number while the object, `item`, stays where it begins; None if it is also a matter of where the arm is."""
        return None

    def read(self, outputs: Outputs) -> Floats:
        """The number, (T,), of the `outputs` of a recording.

        Raises
        ------
        OctoctrlError
            If they are those of the reduced model, which touches nothing.
        """
        recorded = on_recording(self, outputs)
        return self.measured(hold_in(recorded, self.object), recorded)

    def price(self, outputs: RecordedOutputs) -> float:
        """What a search is to lessen, over the instants of `outputs`: by default the logarithm of the largest miss in tolerances."""
        return log_share(self.residuals(outputs)[0], self.tolerance)


def log_share(miss: Floats, tolerance: float) -> float:
    """Price of a `miss` (T,): it still falls while it is far from the `tolerance`, and never grows beyond all bounds."""
    return float(np.log1p(np.abs(miss).max() / tolerance))


def on_recording(goal: object, outputs: Outputs) -> RecordedOutputs:
    """The `outputs` of a recording, for a `goal` that is read on nothing else.

    Raises
    ------
    OctoctrlError
        If they are no recording's.
    """
    if not isinstance(outputs, RecordedOutputs):
        raise OctoctrlError(
            f"goal {goal} is read on recordings only, for the reduced model touches nothing; plan it by oc.plan, which simulates"
        )
    return outputs


def hold_in(outputs: RecordedOutputs, name: str) -> "Hold":
    """How the object called `name` is held in the recording of `outputs`."""
    from octoctrl.sim.contact.hold import Hold

    if name not in outputs.holds:
        recording, arm = outputs.recording, outputs.arm
        outputs.holds[name] = Hold.of(recording, np.asarray(arm.section(recording.stations[1:-1]).outer_radius), name)
    found: Hold = outputs.holds[name]
    return found
