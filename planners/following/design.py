"""Design of the feedback along a plan: prices, linear models of its periods, gains.

Around the planned motion q_k, u_k the reduced model reads, with x = q - q_k and v the corrections (one per channel, see `channels`),

    x_{k+1} = A_k x_k + B_k v_k + E_k theta + c_k,      E_k = [dq_{k+1}/d(gains), dq_{k+1}/d(drag), 1 - A_k]

theta: relative errors of the groups' gains and of the water's drag, and errors of the shape itself towards which the arm creeps, for eight
sections cannot have the edges of the muscles' windows. c_k is zero while the plan's clock runs. While it stands, q_k and the planned
levels stay, and c_k is by how much the model moves on from q_k under them. The regulator minimises the sum of y' Q y + x' S x + v' R v with
the error y = C_k x_k of what is held (see `held`). While the clock stands that is an infinite sum, discounted because what is released at
the end of a plan cannot be held; its cost is also the terminal cost of the plan.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from octoctrl.sim.body.arm import MUSCLE_GROUPS

from ..contracts import Floats
from ..model.reduced import ReducedModel, ReducedMotion
from ..solving.plan import Plan
from .channels import Channels
from .held import Held
from .pace import Paced

CORRECTION, REST_SHARE = 1 / 3, 0.05
"""Share of a channel's planned level by which a correction costs as much as an error of `held`; and the share of that which a channel at
rest has, of its highest level. A resting muscle can only pull, so that what should correct both ways would curl the arm."""

LEAST_LEVEL = 1e-3
"""Highest planned level of a channel that hardly takes part; keeps its corrections finite."""

SHAPE_ERROR = 0.1
"""Error of all strains, as bending strain or stretch, that costs as much."""

SHAPE_NOISE, MOTION_NOISE = 0.003, 0.3
"""Prediction error of one period that is put down to chance: as bending strain or stretch, and as a share of the planned change, which
the model without inertia foresees a little early."""

DISCOUNT = 0.96
"""Weight of a period's price against that of the one before while the clock stands."""

CLOCK_STEP = 0.01
"""By how much the clock of what travels is moved, both ways, to see what that does, s."""

ITERATIONS, CONVERGED = 400, 1e-9
"""Of the standing clock's recursion: how many at most, and the relative change at which it ends."""


class Linear(NamedTuple):
    """One period: A, B, E, c, C, the weights of its rows, and the prices Q' (of x) and R (of v); n strains, m channels, R rows held.

    `timing` (n,) is what a clock does that is a second ahead.
    """

    transition: Floats
    influence: Floats
    disturbance: Floats
    drift: Floats
    slopes: Floats
    weights: Floats
    aims: Floats
    price: Floats
    effort: Floats
    timing: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Period:
    """What the regulator needs of one period, n strains, m channels, R rows held.

    Attributes
    ----------
    linear : Linear
    strains : (n,) float64
        Planned shape at its begin.
    step : float, s
        How long it is.
    activation : (groups, S) float64
        Planned levels of all muscle groups at its end, as they are felt.
    rates : (groups, S) float64
        By how much these levels grow with the clock of what travels, 1/s.
    shares : (m, S) float64
        Where corrections reach.
    levels : (m,) float64
        Planned levels of the channels, the largest of any section.
    held : (R,) float64
        Planned values of what is held at its begin; twist and lifted writhe first, turns.
    noise : (n,) float64
        Standard deviation of the prediction error.
    cost : (n, n) float64
        P of the instant at its end, discounted.
    gain, inverse : (m, n), (m, m) float64
        Of v = -K x, and (R + B' P B)^-1.
    """

    linear: Linear
    strains: Floats
    step: float
    activation: Floats
    rates: Floats
    shares: Floats
    levels: Floats
    held: Floats
    noise: Floats
    cost: Floats
    gain: Floats
    inverse: Floats

    def closed(self) -> Floats:
        """The transition with feedback, A - B K."""
        return self.linear.transition - self.linear.influence @ self.gain


class Prediction(NamedTuple):
    """The end of a period from a begin that need not be planned: strains (n,), derivatives by those at its begin (n, n) and by errors of
    gains and drag (n, m + 1), standard deviations (n,) of what is put down to chance.
    """

    strains: Floats
    transition: Floats
    effect: Floats
    noise: Floats


class Course:
    """A plan as the regulator sees it: its periods, and what holds while its clock stands.

    Parameters
    ----------
    plan : Plan
    model : ReducedModel
    period : float, s
        Between corrections.

    Attributes
    ----------
    period : float, s
    since : float, s
        Where on the plan's clock the first begins.
    steps : (N,) float64, s
        Lengths of the periods, of which the last ends with the plan.
    channels : Channels
        Where feedback may change which muscle groups.
    held : Held
        What it holds.
    periods : tuple of Period
        Those of the running clock.
    final : Period
        That of the clock that stands at the plan's end, without its drift.
    """

    def __init__(self, plan: Plan, model: ReducedModel, period: float = 0.05) -> None:
        self.period, self._model = period, model
        self._activation = plan.schedule.activation()
        self.channels = Channels(self._activation, model.gains)
        self.held = Held(plan.task, (*plan.phase_begins.values(), plan.schedule.duration), model)
        self._columns = [MUSCLE_GROUPS.index(group) for group in self.channels.groups]
        self._scale = strain_scale(model)
        self.since, left = plan.since, plan.schedule.duration - plan.since
        count = int(np.ceil(left / period - 1e-6))
        # The plan ends within the last period, which is so much shorter.
        self._times = plan.since + np.minimum(period * np.arange(count + 1), left)
        self.steps = np.diff(self._times)
        levels = model.levels(self._activation, self._times[1:])
        self._motion = model.simulate(levels, self.steps, start=self._begin(plan))
        rates = self._rates(self._times[1:])
        shares = self.channels.shares(self._times[1:] - model.lag, model.edges)
        self._highest = np.maximum(self.channels.planned(levels, shares).max(axis=0), LEAST_LEVEL)
        self._standing: tuple[float, Period] | None = None
        final = self.standing(plan.schedule.duration)
        # What the arm does after the plan is no reason to leave it before.
        self.final = replace(final, linear=final.linear._replace(drift=np.zeros_like(final.strains)))
        linear, planned, held = self._linear(self._motion, levels, rates, self.steps, shares, self._times[:-1])
        cost, periods = self.final.cost / DISCOUNT, []
        for k in range(count - 1, -1, -1):
            gain, inverse, before = _regulator(linear[k], cost)
            change = self._motion.strains[k + 1] - self._motion.strains[k]
            periods.append(
                Period(
                    linear=linear[k], strains=self._motion.strains[k].ravel(), step=self.steps[k], activation=levels[k],
                    rates=rates[k], shares=shares[k], levels=planned[k], held=held[k], noise=self._noise(change), cost=cost, gain=gain,
                    inverse=inverse,
                )
            )  # fmt: skip
            cost = before
        self.periods = tuple(periods[::-1])

    @staticmethod
    def _begin(plan: Plan) -> Floats | None:
        """Where the plan begins; one that carries no shapes begins at rest."""
        return plan.strains[np.searchsorted(plan.time, plan.since)] if len(plan.strains) else None

    def standing(self, clock: float) -> Period:
        """What holds while the clock stands at `clock`, s, and when it is beyond the plan's end."""
        if self._standing is not None and self._standing[0] == clock:
            return self._standing[1]
        model, index = self._model, int(np.abs(self._times - clock).argmin())
        # Levels that stay need no allowance for the lag with which the arm answers.
        felt = np.array([clock + model.lag])
        levels, rates = model.levels(self._activation, felt), self._rates(felt)
        shares = self.channels.shares(np.array([clock]), model.edges)
        start = self._motion.strains[index]
        steps = np.array([self.period])
        motion = model.simulate(levels, steps, start=start)
        change = motion.strains[1] - start
        (linear,), (planned,), (held,) = self._linear(motion, levels, rates, steps, shares, np.array([clock]))
        linear = linear._replace(drift=change.ravel())
        cost = linear.price
        for _ in range(ITERATIONS):
            gain, inverse, before = _regulator(linear, DISCOUNT * cost)
            settled = np.abs(before - cost).max() < CONVERGED * np.abs(before).max()
            cost = before
            if settled:
                break
        gain, inverse, _ = _regulator(linear, DISCOUNT * cost)
        found = Period(
            linear=linear, strains=start.ravel(), step=self.period, activation=levels[0], rates=rates[0],
            shares=shares[0], levels=planned, held=held, noise=self._noise(change), cost=DISCOUNT * cost, gain=gain, inverse=inverse,
        )  # fmt: skip
        self._standing = clock, found
        return found

    def _linear(
        self, motion: ReducedMotion, levels: Floats, rates: Floats, steps: Floats, shares: Floats, begins: Floats
    ) -> tuple[list[Linear], Floats, Floats]:
        """Linear models of the steps of a motion, planned levels (N, m), and what is held (N, R) at the steps' begins."""
        transition, influence, drag = self._model.linearise(motion, levels, steps)
        gains = np.einsum("tngs,tgs->tng", influence[:, :, self._columns], levels[:, self._columns])
        timing = np.einsum("tngs,tgs->tn", influence, rates)
        influence, planned = self.channels.influence(influence, shares), self.channels.planned(levels, shares)
        disturbance = np.concatenate([gains, drag[:, :, None], (np.eye(len(self._scale)) - transition) * self._scale], axis=2)
        values, slopes, weights, aims = self.held.along(begins, motion.strains[:-1], SHAPE_NOISE * self._scale)
        price = np.swapaxes(slopes, 1, 2) @ (weights[:, :, None] * slopes) + np.diag(1 / (SHAPE_ERROR * self._scale) ** 2)
        effort = 1 / (CORRECTION * (REST_SHARE * self._highest + planned)) ** 2
        still = np.zeros(len(self._scale))
        linear = [
            Linear(
                transition[k], influence[k], disturbance[k], still, slopes[k], weights[k], aims[k], price[k], np.diag(effort[k]), timing[k]
            )
            for k in range(len(levels))
        ]
        return linear, planned, values

    def _rates(self, felt: Floats) -> Floats:
        """By how much levels felt at the times `felt` (T,) grow with the clock of what travels, (T, groups, S), 1/s."""
        if not any(template.travels for template in self._activation.templates):
            return np.zeros((len(felt), len(MUSCLE_GROUPS), self._model.sections))
        moved = (Paced(self._activation, self.channels, (0.0, 0.0), (step, step)) for step in (CLOCK_STEP, -CLOCK_STEP))
        after, before = (self._model.levels(paced, felt) for paced in moved)
        return np.asarray((after - before) / (2 * CLOCK_STEP))

    def predicted(self, period: Period, correction: Floats, start: Floats, ahead: float = 0.0) -> Prediction:
        """What the model says of a period with a `correction` (m,) and a clock `ahead`, s, that begins with the strains `start` (n,)."""
        planned = np.clip(period.activation + ahead * period.rates, 0.0, 1.0)
        levels, steps = self.channels.corrected(planned, period.shares, correction)[None], np.array([period.step])
        motion = self._model.simulate(levels, steps, start=start.reshape(self._model.sections, 4))
        (transition,), (influence,), _ = self._model.linearise(motion, levels, steps)
        gains = np.einsum("ngs,gs->ng", influence[:, self._columns], levels[0, self._columns])
        # What drag does is told by the planned motion: that of an estimate is full of its noise.
        drag = period.linear.disturbance[:, len(self._columns), None]
        end = motion.strains[1].ravel()
        return Prediction(end, transition, np.concatenate([gains, drag], axis=1), self._noise(end - start))

    def _noise(self, change: Floats) -> Floats:
        return np.hypot(SHAPE_NOISE * self._scale, MOTION_NOISE * change.ravel())


def _regulator(linear: Linear, cost: Floats) -> tuple[Floats, Floats, Floats]:
    """K, (R + B' P B)^-1 for the cost P at a period's end, and the cost at its begin."""
    a, b = linear.transition, linear.influence
    inverse = np.asarray(np.linalg.inv(linear.effort + b.T @ cost @ b), dtype=np.float64)
    gain = inverse @ b.T @ cost @ a
    before = linear.price + a.T @ cost @ (a - b @ gain)
    return gain, inverse, (before + before.T) / 2


def strain_scale(model: ReducedModel) -> Floats:
    """Strains (4 S,) that a fibre at the longitudinal muscles' distance feels as one."""
    offset = model.arm.section((model.edges[1:] + model.edges[:-1]) / 2).muscle_offset
    scale = np.ones((model.sections, 4))
    scale[:, :3] = 1 / offset[:, None]
    return scale.ravel()
