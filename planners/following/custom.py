"""A function of one's own as a controller: it takes the place of the plan's activation."""

from collections.abc import Callable, Mapping
from typing import Any

from octoctrl.sim.sources import Held

from ..contracts import ActivationSource, ClockReading, ControllerReport, Observation


class Custom:
    """Asks a function once per period; its levels hold until the next call.

    Parameters
    ----------
    function : callable
        Gets ``(time, observation)`` and returns the levels of the muscle groups: a dict of group to level, or an array (11,) or (11, n) in
        the order of `octoctrl.sim.body.arm.MUSCLE_GROUPS`.
    """

    patience = 0.0

    def __init__(self, function: Callable[[float, Observation], Any]) -> None:
        self.name = str(getattr(function, "__name__", type(function).__name__))
        self._function = function

    def levels(self, observation: Observation, reading: ClockReading) -> ActivationSource:
        """The function's answer to the `observation` at the `reading`, held.

        Raises
        ------
        OctoctrlError
            If the answer is none of these, or a level is not in [0, 1].
        """
        return Held.of(self._function(reading.now, observation), observation.edges, who="feedback")

    def state(self) -> dict[str, Any]:
        """A function that remembers something cannot say so: it is taken to remember nothing."""
        return {}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Nothing of a `state` has to be gone to."""

    def report(self) -> ControllerReport:
        """Whatever the function knows, it keeps to itself."""
        return ControllerReport()
