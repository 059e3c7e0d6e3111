"""The regulator at work: what the arm does now, as far as can be told, what is wrong with the model, and what to correct.

An estimate of the shape is carried from the last measurement through all periods since, with their corrections: a known delay of the
measurement costs no more than what cannot be foreseen. A Kalman filter weighs the prediction against the measurement by the noise that
the observer finds in it, and another estimates theta, a slow random walk, from what it gets wrong. The regulator prices in advance (affine
Riccati recursion) its estimate of theta, the drift of a standing clock, and the part of the measured error of what is held that the linear
model does not explain, which makes it free of offset.

All of that is linear along the plan, estimate and regulator alike: what the linear form gets wrong counts as an error that the regulator
knows, or it would not be free of offset. Whether a muscle is dead is asked of the model itself, at the estimated shape: a plan that a dead
muscle has spoiled may be far.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..contracts import Floats
from .design import DISCOUNT, Course, Period
from .observer import Sight
from .watch import GroupWatch

GAIN_DOUBT, DRAG_DOUBT, SHAPE_DOUBT, DRIFT = 0.2, 0.7, 0.02, 0.05
"""Standard deviations beforehand of gain errors, drag error and errors of the shape (as bending strain or stretch), and the share of them
by which they may change per period."""

BELIEVABLE = -0.8, 3.0
"""Range of the errors that are believed."""

BIAS_SHARE = 0.3
"""Share of a newly measured, unexplained error of what is held that is believed."""

KINSHIP = 0.95
"""Correlation of the gain errors of muscles of one kind, which one motion can hardly tell apart."""


class _Passed(NamedTuple):
    """A period that has begun: which it is on the plan's clock, where that stood, what holds in it, its correction, and its pace."""

    begun: int | None
    clock: float
    period: Period
    correction: Floats
    ahead: float

    def moved(self, x: Floats) -> Floats:
        """Where it leads from the state `x` without errors of the model."""
        linear = self.period.linear
        return linear.transition @ x + linear.influence @ self.correction + self.ahead * linear.timing + linear.drift


class Tracker:
    """Takes measured strains, gives corrections of the levels.

    Parameters
    ----------
    course : Course
    adapt : bool
        Whether errors of the model are estimated; without it this is the plain TVLQR.
    """

    def __init__(self, course: Course, adapt: bool = True) -> None:
        self.course, self.adapt = course, adapt
        kinds = np.array([group.strip("0123456789") for group in course.channels.groups])
        kin = np.where(kinds[:, None] == kinds, KINSHIP, 0.0)
        np.fill_diagonal(kin, 1.0)
        self._gains = len(kinds)
        self.errors = np.zeros(len(kinds) + 1 + len(course.final.strains))
        self.covariance = np.diag([0.0] * len(kinds) + [DRAG_DOUBT**2] + [SHAPE_DOUBT**2] * len(course.final.strains))
        self.covariance[: self._gains, : self._gains] = GAIN_DOUBT**2 * kin
        self.drift = DRIFT**2 * self.covariance
        self.bias = np.zeros(len(course.final.held))
        self._estimate, self._doubt = np.zeros_like(course.final.strains), np.diag(course.final.noise**2)
        self._shape, self._measured = course.final.strains, False
        self.watch = GroupWatch(course.channels.groups)
        self._meant = np.zeros_like(course.final.strains)
        """What of the state is meant: what a clock that is ahead does."""
        self._past: list[_Passed] = []
        """Periods that began since the last measurement, with their corrections."""

    def correct(self, index: int | None, sight: Sight, *, clock: float = 0.0, age: int = 0, ahead: float = 0.0) -> Floats:
        """Corrections of the levels for one period.

        Parameters
        ----------
        index : int or None
            Of the period on the plan's clock; none if the clock stands or is beyond the plan's end.
        sight : Sight
            What was measured.
        clock : float, s
            Where the clock stands.
        age : int
            How many periods ago it was measured.
        ahead : float, s
            By how much the clock of what travels is ahead.

        Returns
        -------
        (m,) float64
        """
        course = self.course
        if index is not None and index >= len(course.periods):
            index = None
        period = self._period(index, clock)
        known = len(self._past) - age
        if known > 0 or not self._measured:
            known = max(known, 0)
            self._measure(known, self._past[known].period if known < len(self._past) else period, sight)
            self._past = self._past[known:]
        x = self._estimate
        for passed in self._past:
            x = passed.moved(x) + self._effect(passed) @ self.errors
        correction = self.decided(index, period, x - self._meant)
        # A level cannot leave [0, 1]; what the plant will really get is what the next prediction must assume.
        correction = np.clip(period.levels + correction, 0.0, 1.0) - period.levels
        self._meant = period.linear.transition @ self._meant + ahead * period.linear.timing
        self._past.append(_Passed(index, clock, period, correction, ahead))
        return correction

    def decided(self, index: int | None, period: Period, x: Floats) -> Floats:
        """The regulator's correction (m,) of the present `period` in the state `x` (n,), as if levels had no bounds."""
        planned = period.linear
        push = planned.disturbance @ self.errors + planned.drift
        ahead = DISCOUNT * self._ahead_standing(period) if index is None else self._ahead(index)
        wanted: Floats = -period.gain @ x - period.inverse @ planned.influence.T @ (period.cost @ push + ahead)
        return wanted

    def believed(self) -> dict[str, float]:
        """Errors of the groups' gains and of the drag, by name."""
        return dict(zip((*self.course.channels.groups, "drag"), self.errors[: self._gains + 1].tolist(), strict=True))

    def state(self) -> dict[str, Any]:
        """Estimates, and the periods that began since the last measurement."""
        return {
            "errors": self.errors.copy(),
            "covariance": self.covariance.copy(),
            "bias": self.bias.copy(),
            "estimate": self._estimate.copy(),
            "doubt": self._doubt.copy(),
            "shape": self._shape.copy(),
            "measured": self._measured,
            "meant": self._meant.copy(),
            "past": [(passed.begun, passed.clock, passed.correction, passed.ahead) for passed in self._past],
            "watch": self.watch.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go to a `state` of a tracker of the same course."""
        self.errors, self.covariance, self.bias, self._estimate, self._doubt, self._shape = (
            state[name].copy() for name in ("errors", "covariance", "bias", "estimate", "doubt", "shape")
        )
        self._measured = state["measured"]
        self.watch.restore(state["watch"])
        self._meant = state["meant"].copy()
        self._past = [_Passed(index, clock, self._period(index, clock), *rest) for index, clock, *rest in state["past"]]

    def _period(self, index: int | None, clock: float) -> Period:
        return self.course.standing(clock) if index is None else self.course.periods[index]

    def _measure(self, known: int, then: Period, sight: Sight) -> None:
        """Take up what was measured after the first `known` periods of the past, at the begin of the period `then`."""
        x = sight.strains.ravel() - then.strains
        # What the errors do to the prediction is linear in them: effect @ errors.
        found, doubt, effect = self._estimate, self._doubt, np.zeros((len(x), len(self.errors)))
        for passed in self._past[:known]:
            transition = passed.period.linear.transition
            found = passed.moved(found)
            doubt = transition @ doubt @ transition.T + np.diag(passed.period.noise**2)
            effect = transition @ effect + self._effect(passed)
        total = doubt + sight.noise
        if self.adapt:
            if self._measured:
                self._watch(self._past[:known], sight)
                self._learn(effect, x - found, np.sqrt(np.diag(total)))
            expected = then.held + then.linear.slopes @ x
            unexplained = self.course.held.seen(sight.outputs, sight.strains, expected) - expected
            self.bias += np.where(then.linear.weights > 0, BIAS_SHARE, 0.0) * (unexplained - self.bias)
        found = found + effect @ self.errors
        share = np.linalg.solve(total, doubt).T
        self._estimate, self._doubt, self._measured = found + share @ (x - found), doubt - share @ doubt, True
        self._shape = then.strains + self._estimate

    def _watch(self, past: Sequence[_Passed], sight: Sight) -> None:
        """Tell the watch what the model itself, from the shape that was estimated last, has made of periods, and what was measured."""
        found, doubt, effect = self._shape, self._doubt, np.zeros((len(self._shape), self._gains + 1))
        for passed in past:
            there = self.course.predicted(passed.period, passed.correction, found, passed.ahead)
            found, effect = there.strains, there.transition @ effect + there.effect
            doubt = there.transition @ doubt @ there.transition.T + np.diag(there.noise**2)
        if np.isfinite(found).all():  # else the model has no answer to learn from
            noise = np.sqrt(np.diag(doubt + sight.noise))
            self.watch.add(effect / noise[:, None], (sight.strains.ravel() - found) / noise)

    def _learn(self, effect: Floats, surprise: Floats, noise: Floats) -> None:
        """Kalman filter on the errors, from the prediction of the periods that have just passed."""
        scaled, innovation = effect / noise[:, None], surprise / noise
        self.covariance = self.covariance + self.drift
        self.covariance = np.linalg.inv(np.linalg.inv(self.covariance) + scaled.T @ scaled)
        self.errors += self.covariance @ scaled.T @ (innovation - scaled @ self.errors)
        # Muscles do not push, and water does not drive: what asks for that is put down to other things.
        self.errors = np.clip(self.errors, *BELIEVABLE)

    def _pull(self, period: Period) -> Floats:
        return period.linear.slopes.T @ (period.linear.weights * (self.bias + period.linear.aims))

    def _effect(self, passed: _Passed) -> Floats:
        """Derivative of the shape at a period's end by the errors: a wrong gain acts on the whole level, correction included."""
        linear = passed.period.linear
        effect = linear.disturbance.copy()
        effect[:, : self._gains] += (linear.influence * passed.correction) @ self.course.channels.members
        return effect

    def _ahead_standing(self, period: Period) -> Floats:
        """Gradient of the cost to come, at the begin of any period of a standing clock, by errors, drift and bias."""
        closed, push = period.closed(), period.linear.disturbance @ self.errors + period.linear.drift
        here = self._pull(period) + closed.T @ period.cost @ push
        return np.asarray(np.linalg.solve(np.eye(len(push)) - DISCOUNT * closed.T, here), dtype=np.float64)

    def _ahead(self, index: int) -> Floats:
        """The same at the end of the period `index` of the running clock."""
        ahead = self._ahead_standing(self.course.final)
        for later in self.course.periods[:index:-1]:
            push = later.linear.disturbance @ self.errors + later.linear.drift
            ahead = self._pull(later) + later.closed().T @ (later.cost @ push + ahead)
        return ahead
