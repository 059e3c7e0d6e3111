"""The built-in feedback as a controller: the regulator of `tracking` on the phase clock."""

from collections.abc import Mapping
from time import process_time
from typing import Any

import numpy as np

from octoctrl.sim.sources import Corrected

from ..contracts import ActivationSource, ClockReading, ControllerReport, Observation
from ..solving.plan import Plan
from .design import Course
from .margins import margins
from .observer import Observer
from .pace import Pace, Paced
from .tracking import Tracker


class TVLQR:
    """Corrects the levels of the groups that the plan uses, where it uses them, once per period.

    It is designed for the period with which it is first asked, and begins anew when time does, so that one object serves several runs.

    Parameters
    ----------
    plan : Plan
    """

    name = "tvlqr"

    def __init__(self, plan: Plan) -> None:
        self.plan, self._model = plan, plan.model
        self._activation = plan.schedule.activation()
        self._course: Course | None = None
        self._margins: dict[str, float] | None = None
        self._design_time, self._now = 0.0, np.inf

    def tracker(self, course: Course) -> Tracker:
        """What turns what is seen into corrections along a `course`."""
        return Tracker(course)

    def _start(self, period: float) -> None:
        if self._course is None or abs(self._course.period - period) > 1e-9:
            begin = process_time()
            self._course, self._margins = Course(self.plan, self._model, period), None
            self._design_time = process_time() - begin
        self._tracker = self.tracker(self._course)
        self._observer = Observer(self._model, self.plan.task.convention.pole)
        self._correction, self._largest = np.zeros(len(self._course.channels)), 0.0
        self._pace = Pace(self.plan)
        self._dead: dict[str, float] = {}

    def levels(self, observation: Observation, reading: ClockReading) -> ActivationSource:
        """The plan's activation at the `reading` of its clock, corrected for what the `observation` shows."""
        if reading.now <= self._now:
            self._start(reading.period)
        assert self._course is not None  # made at the begin of the run
        self._now, before = reading.now, self._correction
        index = round((reading.begin - self._course.since) / self._course.period) if reading.end > reading.begin else None
        age = max(round((reading.now - observation.time) / self._course.period), 0)
        ahead = self._pace.ahead, self._pace.decide(observation, reading)
        self._correction = self._tracker.correct(index, self._observer.see(observation), clock=reading.begin, age=age, ahead=ahead[1])
        self._largest = max(self._largest, float(np.abs(self._correction).max()))
        for group in self._tracker.watch.dead:
            self._dead.setdefault(group, reading.now)
        clock = reading.begin, reading.end
        paced = Paced(self._activation, self._course.channels, clock, ahead)
        return Corrected(
            activation=paced, begin=reading.now, period=reading.period, clock=clock,
            groups=tuple(channel.group for channel in self._course.channels.each), before=before, after=self._correction,
            places=paced,
        )  # fmt: skip

    def state(self) -> dict[str, Any]:
        """What it remembers of the run so far, without its design, which is made again from the plan."""
        if self._course is None:
            return {}
        return {
            "period": self._course.period,
            "now": self._now,
            "correction": self._correction.copy(),
            "largest": self._largest,
            "design_time": self._design_time,
            "dead": dict(self._dead),
            "tracker": self._tracker.state(),
            "observer": self._observer.state(),
            "pace": self._pace.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go to a `state` of a controller of the same plan."""
        if not state:
            self._now = np.inf
            return
        self._start(state["period"])
        self._now, self._correction, self._largest = state["now"], state["correction"].copy(), state["largest"]
        self._design_time, self._dead = state["design_time"], dict(state["dead"])
        self._tracker.restore(state["tracker"])
        self._observer.restore(state["observer"])
        self._pace.restore(state["pace"])

    def report(self) -> ControllerReport:
        """Largest correction, the errors of gains and drag that it believes in, and the groups that it takes for dead."""
        if self._course is None:
            return ControllerReport()
        errors = {name: round(error, 3) for name, error in self._tracker.believed().items()}
        return ControllerReport(
            largest_correction=self._largest, estimated_errors=errors, dead_groups=dict(self._dead), design_time=self._design_time,
            margins=self._course_margins(),
        )  # fmt: skip

    def _course_margins(self) -> dict[str, float]:
        """Made once per design, when they are first asked for."""
        assert self._course is not None
        if self._margins is None:
            self._margins = margins(self._course)
        return dict(self._margins)
