"""Model predictive control along a plan: the regulator's problem with what the regulator does not know, the bounds and the U-turn.

Over the next N periods of the plan's linear models (see `design`) it minimises what the regulator minimises, with the regulator's cost
to go at the end,

    sum_j  x_j' Q x_j + 2 b' x_j + v_j' R v_j   +   x_N' P x_N + 2 g' x_N
    x_{j+1} = A_j x_j + B_j v_j + E_j theta + c_j
    0 <= u_j + v_j <= 1 now, 1 - HEADROOM later;     u-turn_j + (d u-turn / d x)_j x_j >= floor_j - s,   s >= 0

as a quadratic programme in the corrections v and the slack s, solved through CasADi's `conic`. Where no constraint is active its answer is
the regulator's, v = -K x - ...; where the solver fails or is late, the regulator's answer is taken, clipped, and counted.
"""

from collections.abc import Mapping
from dataclasses import replace
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from ..contracts import ControllerReport, Floats
from ..model.output_kernels import UTURN
from ..solving.plan import Plan
from .design import DISCOUNT, Course, Period
from .tracking import Tracker
from .tvlqr import TVLQR

HORIZON, LARGEST = 20, 100
"""Periods that are looked ahead at most, and corrections of all of them together: with more a programme takes longer than a period."""

HEADROOM = 0.05
"""Share of the activation that is planned to be left for later corrections; the present period may use all of it."""

OPENING, SLACK_PRICE = 0.3, 1e5
"""Smallest 1 + tip . base that is aimed at, unless the plan itself comes nearer to a U-turn, and the price of falling short of it by 1, in
what a level's correction of 0.1 costs at most."""

SOLVER = "daqp"
"""CasADi's name of the solver: of 100 corrections and one slack it takes a third of osqp's time and a sixth of qrqp's."""

OPTIONS = {"error_on_fail": False, "print_time": False}


class PredictiveTracker(Tracker):
    """The tracker whose corrections come from a quadratic programme; what it estimates is the same.

    Parameters
    ----------
    course : Course
    plan : Plan
    horizon : int, optional
        Periods that are looked ahead; as many as make `LARGEST` corrections if omitted, and at most `HORIZON`.
    limit : float, s, optional
        Wall-clock limit of a programme, whose answer is not used if it comes later; the period if omitted.

    Attributes
    ----------
    fallbacks : int
        Periods whose correction is the regulator's.
    seconds : list of float
        Wall time of each programme, made and solved.
    """

    def __init__(self, course: Course, plan: Plan, *, horizon: int | None = None, limit: float | None = None) -> None:
        super().__init__(course)
        usual = min(HORIZON, max(LARGEST // len(course.channels), 1))
        self.horizon, self.limit = usual if horizon is None else horizon, course.period if limit is None else limit
        self.fallbacks, self.seconds = 0, list[float]()
        self._model, self._pole = plan.model, plan.task.convention.pole
        horizon = self.horizon
        size = horizon * len(course.channels) + 1
        self._solve = ca.conic("mpc", SOLVER, {"h": ca.Sparsity.dense(size, size), "a": ca.Sparsity.dense(horizon, size)}, OPTIONS)
        self._openings = self._read([period.strains for period in course.periods])

    def _read(self, strains: list[Floats]) -> tuple[Floats, Floats]:
        """1 + tip . base of planned shapes, and its derivatives (N, n)."""
        values, slopes = self._model.outputs(np.reshape(strains, (len(strains), self._model.sections, 4)), self._pole)
        return values[:, UTURN], slopes[:, UTURN].reshape(len(strains), -1)

    def decided(self, index: int | None, period: Period, x: Floats) -> Floats:
        """Correction of the present `period` in the state `x`, from the programme, or from the regulator where that has none in time."""
        begin = perf_counter()
        found = self._solution(index, period, x)
        spent = perf_counter() - begin
        self.seconds.append(spent)
        if found is None or spent > self.limit:
            self.fallbacks += 1
            return super().decided(index, period, x)
        return found

    def state(self) -> dict[str, Any]:
        """As the tracker's, with what the programmes took."""
        return super().state() | {"fallbacks": self.fallbacks, "seconds": list(self.seconds)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go to a `state` of a tracker of the same course."""
        super().restore(state)
        self.fallbacks, self.seconds = state["fallbacks"], list(state["seconds"])

    def _ahead_of(self, index: int | None, period: Period) -> tuple[list[tuple[Period, float]], float, Floats]:
        """Periods of the horizon with the weights of their prices, the weight at its end, and the gradient of the cost to go there."""
        course, standing = self.course, index is None
        stages, weight = list[tuple[Period, float]](), 1.0
        for step in range(self.horizon):
            at = None if index is None else index + step
            running = at is not None and at < len(course.periods)
            here = period if standing else course.periods[at] if running and at is not None else course.final
            stages.append((here, weight))
            weight *= 1.0 if running else DISCOUNT
        last = None if index is None else index + self.horizon - 1
        if last is not None and last < len(course.periods):
            return stages, weight, self._ahead(last)
        return stages, weight, self._ahead_standing(period if standing else course.final)

    def _solution(self, index: int | None, period: Period, x: Floats) -> Floats | None:
        groups = len(self.course.channels)
        size, stages = self.horizon * groups, self._ahead_of(index, period)
        horizon, weight, ahead = stages
        hessian, gradient = np.zeros((size + 1, size + 1)), np.zeros(size + 1)
        rows, floors = np.zeros((self.horizon, size + 1)), np.full(self.horizon, -np.inf)
        by, free = np.zeros((len(x), size)), x.copy()  # x_j = by v + free
        low, high = np.zeros(size + 1), np.full(size + 1, np.inf)
        rows[:, size] = 1.0
        for step, (stage, share) in enumerate(horizon):
            linear, here = stage.linear, slice(step * groups, (step + 1) * groups)
            if step:
                self._priced(hessian, gradient, by, free, step * groups, share * linear.price, share * self._pull(stage))
                opening, slope = self._opening(index, step, stage)
                rows[step - 1, : step * groups] = slope @ by[:, : step * groups]
                floors[step - 1] = min(OPENING, opening) - opening - slope @ free
            hessian[here, here] += share * linear.effort
            low[here] = np.minimum(-stage.levels, 0.0)
            high[here] = np.maximum((1.0 if step == 0 else 1.0 - HEADROOM) - stage.levels, 0.0)
            free = linear.transition @ free + linear.disturbance @ self.errors + linear.drift
            by[:, : step * groups] = linear.transition @ by[:, : step * groups]
            by[:, here] = linear.influence
        last, share = horizon[-1]
        # The cost of a period is that at its end; of a standing clock it is discounted already.
        self._priced(hessian, gradient, by, free, size, share * last.cost, weight * ahead)
        scale = hessian.diagonal().max()
        hessian[size, size], gradient[size] = 1e-6 * scale, SLACK_PRICE
        found = self._solve(h=hessian / scale, g=gradient / scale, a=rows, lba=floors, uba=np.inf, lbx=low, ubx=high)
        answer = np.asarray(found["x"]).ravel()[:groups]
        return answer if self._solve.stats()["success"] and np.isfinite(answer).all() else None

    @staticmethod
    def _priced(hessian: Floats, gradient: Floats, by: Floats, free: Floats, count: int, price: Floats, pull: Floats) -> None:
        """Add the price of a state, of which only the first `count` corrections are the cause."""
        part = by[:, :count]
        priced = price @ part
        hessian[:count, :count] += part.T @ priced
        gradient[:count] += priced.T @ free + part.T @ pull

    def _opening(self, index: int | None, step: int, stage: Period) -> tuple[float, Floats]:
        if index is not None and index + step < len(self.course.periods):
            return self._openings[0][index + step], self._openings[1][index + step]
        values, slopes = self._read([stage.strains])
        return values[0], slopes[0]


class MPC(TVLQR):
    """Model predictive control of the groups that the plan uses, once per period.

    Parameters
    ----------
    plan : Plan
    """

    name = "mpc"

    def tracker(self, course: Course) -> Tracker:
        """What turns what is seen into corrections along a `course`."""
        return PredictiveTracker(course, self.plan)

    def report(self) -> ControllerReport:
        """As the regulator's, with the number of periods in which that had to step in, and what a programme took."""
        told, tracker = super().report(), getattr(self, "_tracker", None)
        if not isinstance(tracker, PredictiveTracker) or not tracker.seconds:
            return told
        return replace(
            told, fallbacks=tracker.fallbacks, step_time=float(np.median(tracker.seconds)), longest_step=float(np.max(tracker.seconds))
        )
