"""No feedback: the plan's activation as it was planned."""

from collections.abc import Mapping
from typing import Any

from octoctrl.sim.sources import Corrected

from ..contracts import ActivationSource, ClockReading, ControllerReport, Observation
from ..solving.plan import Plan


class OpenLoop:
    """Plays the plan's activation.

    Parameters
    ----------
    plan : Plan
    """

    name = "open-loop"
    patience = 0.0

    def __init__(self, plan: Plan) -> None:
        self._activation = plan.schedule.activation()

    def levels(self, observation: Observation, reading: ClockReading) -> ActivationSource:
        """The plan's activation at the `reading` of its clock, whatever the `observation`."""
        return Corrected(activation=self._activation, begin=reading.now, period=reading.period, clock=(reading.begin, reading.end))

    def state(self) -> dict[str, Any]:
        """It remembers nothing."""
        return {}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Nothing of a `state` has to be gone to."""

    def report(self) -> ControllerReport:
        """Nothing was corrected."""
        return ControllerReport()
