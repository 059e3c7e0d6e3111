"""What a correction costs: processor time of a period of feedback, all that belongs to it, along shipped tasks on the rod."""

from collections.abc import Sequence
from time import thread_time

import numpy as np

from octoctrl.planners.contracts import ActivationSource, ClockReading, Controller, ControllerReport, Observation

from ..carrying.execution import controller, execute
from ..carrying.planning import plan
from ..tables import Table
from .planning import TIME_LIMIT

FEEDBACK = ("tvlqr", "mpc")
ASKED = 10.0, 25.0
"""What a step of predictive control may take, median and longest, ms."""


class Timed:
    """A controller whose periods are timed.

    Parameters
    ----------
    inner : Controller

    Attributes
    ----------
    seconds : list of float
        Processor time of each period; the first holds the design.
    """

    def __init__(self, inner: Controller) -> None:
        self.inner, self.name = inner, inner.name
        self.seconds: list[float] = []

    def levels(self, observation: Observation, reading: ClockReading) -> ActivationSource:
        """As the inner one has it of the `observation` at a `reading` of the clock."""
        begin = thread_time()
        found = self.inner.levels(observation, reading)
        self.seconds.append(thread_time() - begin)
        return found

    def report(self) -> ControllerReport:
        """The inner one's."""
        return self.inner.report()


def correcting(*, full: bool = False, names: Sequence[str] | None = None) -> Table:
    """Processor time of feedback.

    Parameters
    ----------
    full : bool
        More tasks.
    names : sequence of str, optional
        Tasks instead.

    Returns
    -------
    Table
    """
    rows: list[tuple[str | int | float | None, ...]] = []
    for name in names or (("coil", "tip", "lm-helix", "packet") if full else ("coil", "tip")):
        made = plan(name, time_limit=TIME_LIMIT)
        for feedback in FEEDBACK:
            timed = Timed(controller(feedback, made))
            told = execute(made, feedback=timed).report.controller
            design, periods = 1e3 * timed.seconds[0], 1e3 * np.array(timed.seconds[1:])
            fallbacks = told.fallbacks if feedback == "mpc" else None
            times = np.quantile(periods, (0.5, 0.9, 1.0))
            rows.append((name, feedback, len(periods), design, *map(float, times), fallbacks))
    return Table(
        name="correcting",
        title="What a correction costs",
        note=f"Processor time of a period of 50 ms on the rod; predictive control may take {ASKED[0]:g} ms in the median and {ASKED[1]:g} "
        "at most. Fallbacks: programmes that failed or came later than a period by the wall clock, where the regulator stepped in.",
        columns=("task", "feedback", "periods", "design and first [ms]", "median [ms]", "P90 [ms]", "max [ms]", "fallbacks"),
        formats=("", "", "d", ".0f", ".2f", ".2f", ".2f", "d"),
        rows=tuple(rows),
    )
