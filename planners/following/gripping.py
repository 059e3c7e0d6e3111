"""Feedback for plans that touch: the plan as it is until the arm touches, and from then on the shape in which it held.

Before the touch nothing is corrected: the way to the object was searched in scenarios. After it the bends of the plan's own shape are held:
where a section is bent less than planned towards a side, the longitudinal muscles of that side are told more, and those of the other side
less, each section by itself.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS

from ..contracts import ActivationSource, ClockReading, ControllerReport, Observation
from ..model.kinematics import hat_means, section_bounds
from ..solving.grasping import touch_time
from ..solving.plan import Plan

Floats = NDArray[np.float64]

GAIN, MOST = 0.6, 0.25
"""Level for a bending strain of 1 that is missing, and largest correction."""


class Gripping:
    """Holds what a plan has grasped.

    Parameters
    ----------
    plan : Plan
    """

    name = "grip"
    patience = 0.0

    def __init__(self, plan: Plan) -> None:
        self._plan, self._activation, self._touch = plan, plan.schedule.activation(), touch_time(plan)
        self._bounds = section_bounds(plan.arm, plan.model.sections)
        self._radius = np.asarray(plan.arm.section((self._bounds[1:] + self._bounds[:-1]) / 2).muscle_offset)
        angle = 2 * np.pi * np.arange(len(LONGITUDINAL_GROUPS)) / len(LONGITUDINAL_GROUPS)
        self._sides = np.stack([-np.cos(angle), np.sin(angle)])
        self._before = np.zeros((len(LONGITUDINAL_GROUPS), plan.model.sections))
        self._largest = 0.0

    def levels(self, observation: Observation, reading: ClockReading) -> ActivationSource:
        """The plan's activation at the `reading`, corrected by what is missing of its shape in the `observation` once it touches."""
        before, after = self._before, np.zeros_like(self._before)
        if reading.begin >= self._touch:
            after = self.correction(self._plan.model.strains(observation), reading.begin)
        self._before, self._largest = after, max(self._largest, float(np.abs(after).max()))
        return _Sectioned(self._activation, reading, before, after, self._bounds)

    def correction(self, strains: Floats, clock: float) -> Floats:
        """Levels (8, S) that are added for measured section `strains` (S, 4) at a reading of the plan's `clock`, s."""
        plan = self._plan
        now = np.clip(clock, plan.time[0], plan.time[-1])
        flat = plan.strains.reshape(len(plan.time), -1)
        planned = np.array([np.interp(now, plan.time, column) for column in flat.T]).reshape(plan.strains.shape[1:])
        missing = (planned[:, :2] - strains[:, :2]) @ self._sides  # (S, 8), 1/m, towards each muscle
        return np.asarray(np.clip(GAIN * self._radius[:, None] * missing, -MOST, MOST).T)

    def state(self) -> dict[str, Any]:
        """What it remembers."""
        return {"before": self._before, "largest": self._largest}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go to a `state`."""
        self._before, self._largest = np.asarray(state["before"]), float(state["largest"])

    def report(self) -> ControllerReport:
        """How much was corrected at most."""
        return ControllerReport(largest_correction=self._largest)


class _Sectioned:
    """An activation and corrections (8, S) by muscle and section, linear in time over a period."""

    def __init__(self, activation: ActivationSource, reading: ClockReading, before: Floats, after: Floats, bounds: Floats) -> None:
        self._activation, self._reading, self._before, self._after, self._bounds = activation, reading, before, after, bounds

    def levels(self, times: Floats, edges: Floats) -> Floats:
        """Levels (T, groups, n), kept within [0, 1]."""
        reading = self._reading
        share = np.clip((np.asarray(times) - reading.now) / reading.period, 0.0, 1.0)
        levels = self._activation.levels(reading.begin + share * (reading.end - reading.begin), edges)
        spread = hat_means(np.asarray(edges), self._bounds)
        rows = [MUSCLE_GROUPS.index(name) for name in LONGITUDINAL_GROUPS]
        correction = self._before + share[:, None, None] * (self._after - self._before)
        levels[:, rows] += correction @ spread.T
        return np.asarray(np.clip(levels, 0.0, 1.0))
