"""A task as rows of one vector of unknowns: what the goals miss on the reduced model, in tolerances, with exact derivatives.

Unknowns: the durations of the phases, then the free numbers of the drives, in order. Rows, each at the steps at which it has to hold:

    goals   residual / tolerance
    guard   max(guard - u, 0) / GUARD_SCALE,    u = 1 + t_tip . t_base, up to the last goal that reads writhe or link

Where u vanishes the tip turns opposite to the base and the branch of the lifted writhe is a matter of chance: a plan through there would be
a gamble. Writhe and link are unwrapped along the steps from rest, as the plant's are along its recording.
"""

from collections.abc import Hashable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple, cast

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError

from ..asking.schedule import Schedule
from ..asking.task import Task
from ..contracts import Goal, Primitive, When
from ..model.output_kernels import LINK, UTURN, WRITHE
from ..model.readings import Rows, residual_function
from ..model.reduced import ReducedModel
from ..model.stepping import output_tables, outputs, simulate, slopes_of
from .interrupts import heed
from .least_squares import Box
from .present import Present
from .slopes import Slopes, SlopesMath

Floats = NDArray[np.float64]

FEWEST_STEPS = 4
"""Fewest steps of a phase."""

LEVEL_SCALE, TIME_SCALE = 0.1, 0.5
"""A change that counts as large: of a level, and of a time or speed relative to the task's own."""

SAMPLE = 0.01
"""Multiple of the time at which planned phases end, s: the plant knows its shape then."""

GUARD, GUARD_SCALE, PASSED = 0.35, 0.1, 0.2
"""Smallest u that is aimed at, how much less counts as a whole miss, and the smallest with which a plan passes."""

SLOPE_WORK = 0.15
"""What the derivative by one unknown adds to the work of a step."""

KINDRED = 3.0
"""Largest difference of unknowns, in units of their scale, up to which a motion is a good guess of another."""

LOST = 50.0
"""What every row says where the model has no solution."""


class Grid(NamedTuple):
    """Steps per phase, and for each goal the steps at whose end it has to hold."""

    steps: tuple[int, ...]
    instants: tuple[range, ...]


class Motion(NamedTuple):
    """What unknowns made the model do: strains (N + 1, S, 4) and, if they were asked for, slopes (N + 1, 4 S, p) by the free unknowns."""

    x: Floats
    grid: Grid
    strains: Floats
    slopes: Floats | None = None

    def near(self, x: Floats, free: NDArray[np.int64]) -> Floats:
        """What other unknowns would do, to first order."""
        if self.slopes is None:
            return self.strains
        return self.strains + (self.slopes @ (x - self.x)[free]).reshape(self.strains.shape)


@dataclass(frozen=True, slots=True)
class Reading:
    """What unknowns lead to on the reduced model.

    Attributes
    ----------
    misses : (R,) float64
        Residuals of the goals in tolerances, goal by goal, instant by instant.
    openings : (K,) float64
        u at every guarded step.
    shares : (goals,) float64
        Largest miss of each goal in tolerances.
    guard : float
        Smallest u that is aimed at.
    miss_slopes, opening_slopes : (R, n) and (K, n) float64, or None
    """

    misses: Floats
    openings: Floats
    shares: Floats
    guard: float
    miss_slopes: Floats | None = None
    opening_slopes: Floats | None = None

    @property
    def rows(self) -> Floats:
        """Misses, and what is missing of the guard where something is, (R + ...,)."""
        low = self.openings < self.guard
        return np.concatenate([self.misses, (self.guard - self.openings[low]) / GUARD_SCALE])

    @property
    def slopes(self) -> Floats:
        """Derivatives of `rows`."""
        assert self.miss_slopes is not None and self.opening_slopes is not None
        return np.concatenate([self.miss_slopes, -self.opening_slopes[self.openings < self.guard] / GUARD_SCALE])

    @property
    def opening(self) -> float:
        """Smallest u while the guard stands; 2 without one."""
        return float(self.openings.min(initial=2.0))

    @property
    def worst(self) -> float:
        """The largest share; more than 1, too, where the path comes near a U-turn."""
        worst = float(self.shares.max(initial=0.0))
        return worst if self.opening >= PASSED else max(worst, 1.5 + 10 * (PASSED - self.opening))


@dataclass(frozen=True, slots=True)
class Aim:
    """A goal with its phase, and how its rows follow from outputs and strains of one instant."""

    phase: int
    goal: Goal
    rows: Rows
    branch: bool
    """Whether it reads what is lost in a U-turn."""


@lru_cache(maxsize=256)
def _rows_of(goal: Any, arm: Arm, sections: int) -> tuple[ca.Function, bool]:
    function = residual_function([goal], arm, sections)
    reads = function.jac_sparsity(0, 0).get_col()
    return function, bool({WRITHE, LINK} & set(reads))


class Problem:
    """A task on a model, as functions of the unknowns.

    Parameters
    ----------
    task : Task
    model : ReducedModel
    present : Present, optional
        Where it begins; at rest if omitted.
    """

    def __init__(self, task: Task, model: ReducedModel, present: Present | None = None) -> None:
        self.present = Present.at_rest(model) if present is None else present
        self.task, self.model, self.delay, self.work, self.guard = task, model, 0.0, 0.0, GUARD
        self.names = [f"{phase.name}.duration" for phase in task.phases]
        lower, upper = [phase.shortest for phase in task.phases], [phase.longest for phase in task.phases]
        start = [phase.duration for phase in task.phases]
        for drive in task.drives:
            for number, (low, high) in drive.bounds().items():
                self.names.append(f"{drive.name}.{number}")
                lower.append(low)
                upper.append(high)
                start.append(drive.number(number))
        levels = np.array([name.endswith(".level") for name in self.names])
        self.start = np.array(start, dtype=float)
        self.box = Box(np.array(lower), np.array(upper), np.where(levels, LEVEL_SCALE, TIME_SCALE * np.maximum(np.abs(self.start), 1e-3)))
        self.aims = []
        for index, phase in enumerate(task.phases):
            for goal in phase.goals:
                function, branch = _rows_of(cast(Hashable, goal), model.arm, model.sections)
                self.aims.append(Aim(index, goal, Rows(function), branch))
        self.guarded = max((aim.phase + 1 for aim in self.aims if aim.branch), default=0)
        self.pole = np.array(task.convention.pole, dtype=float)
        self.last: Motion | None = None
        self.sloped: Motion | None = None

    def on_samples(self, durations: Floats) -> Floats:
        """Durations of the phases, s, near these, with which every phase ends on a sample as far as its bounds have one."""
        low, high = self.box.lower[: len(durations)], self.box.upper[: len(durations)]
        near = np.diff(np.round(np.cumsum(durations) / SAMPLE) * SAMPLE, prepend=0.0)
        within = np.clip(near, np.ceil(low / SAMPLE - 1e-9) * SAMPLE, np.floor(high / SAMPLE + 1e-9) * SAMPLE)
        return np.where((within >= low - 1e-9) & (within <= high + 1e-9), within, durations)

    def with_durations(self, durations: Floats) -> "Problem":
        """The same problem with phases of fixed durations, s."""
        fixed, lower, upper = self._copy(), self.box.lower.copy(), self.box.upper.copy()
        lower[: len(durations)] = upper[: len(durations)] = durations
        fixed.box = Box(lower, upper, self.box.scale)
        return fixed

    def with_guard(self, guard: float) -> "Problem":
        """The same problem that aims at another smallest u, or at none if that is 0."""
        other = self._copy()
        other.guard, other.guarded = guard, self.guarded if guard > 0 else 0
        return other

    def on(self, model: ReducedModel, delay: float = 0.0) -> "Problem":
        """The same problem on another model, to which activation comes later by `delay`, s."""
        other = self._copy()
        other.model, other.delay = model, delay
        return other

    def _copy(self) -> "Problem":
        other = copy(self)
        # What the last unknowns did is near to what they do there, but not the same.
        other.last, other.sloped = None if self.last is None else self.last._replace(x=np.full_like(self.last.x, np.nan)), None
        return other

    def vector(self, numbers: Mapping[str, float]) -> Floats:
        """Unknowns with some of their numbers given by name, the task's own otherwise, within the bounds."""
        given = [numbers.get(name, value) for name, value in zip(self.names, self.start, strict=True)]
        return np.clip(given, self.box.lower, self.box.upper)

    def grid(self, x: Floats, step: float) -> Grid:
        """Steps per phase, none of them longer than `step`, s, and the instants of the goals."""
        steps = tuple(max(FEWEST_STEPS, int(np.ceil(duration / step - 1e-9))) for duration in x[: len(self.task.phases)])
        ends, instants = np.cumsum(steps), []
        for aim in self.aims:
            end, count, hold = int(ends[aim.phase]), steps[aim.phase], aim.goal.hold / x[aim.phase]
            held = count if aim.goal.when is When.THROUGHOUT else min(count, int(np.ceil(count * hold - 1e-9)))
            instants.append(range(end - held, end + 1))
        return Grid(steps, tuple(instants))

    def primitives(self, values: Sequence[Any]) -> tuple[dict[str, Any], list[Primitive]]:
        """Phase begins and primitives for numbers, symbols or numbers with slopes, in the order of the names."""
        left = list(values)
        begins: dict[str, Any] = {}
        now = self.present.clock + 0.0 * left[0]
        for phase in self.task.phases:
            begins[phase.name] = now
            now = now + left.pop(0)
        return begins, [drive.at(begins, {number: left.pop(0) for number in drive.bounds()}) for drive in self.task.drives]

    def schedule(self, x: Floats) -> tuple[dict[str, float], Schedule]:
        """Phase begins, s, and the schedule of the unknowns."""
        begins, primitives = self.primitives([float(value) for value in x])
        duration = self.present.clock + float(x[: len(self.task.phases)].sum())
        return begins, Schedule(primitives=(*self.present.before, *primitives), duration=duration, composition="handover")

    def read(self, x: Floats, grid: Grid, slopes: bool = False) -> Reading:
        """What the unknowns lead to.

        Parameters
        ----------
        x : (n,) float64
        grid : Grid
        slopes : bool
            Whether derivatives are made too, which costs some five times as much.
        """
        heed()
        model, free = self.model, np.flatnonzero(self.box.upper > self.box.lower)
        lengths = np.repeat(x[: len(grid.steps)] / grid.steps, grid.steps)
        self.work += len(lengths) * SLOPE_WORK * len(free) * slopes
        none = np.empty((0, 0))
        levels, level_slopes, step_slopes = self._inputs(x, grid, free) if slopes else (self._levels(x, lengths), none, none)
        strains = self._moved(x, grid, levels, lengths, free)
        if not np.isfinite(strains).all():
            self.last = None
            return self._lost(grid, len(x) if slopes else 0)
        by_number = np.empty((0, 0, 0))
        if slopes:
            by_number = slopes_of(model.step_model, strains, levels, level_slopes, lengths, step_slopes)
            self.sloped = Motion(x.copy(), grid, strains, by_number)
        values, gradients = outputs(output_tables(model.arm, model.sections), strains, self.pole, slopes)
        turned = 2 * np.cumsum(np.round(np.diff(values[:, WRITHE], prepend=values[0, WRITHE]) / 2))
        values[:, [WRITHE, LINK]] += self.present.branch(values[0, WRITHE]) - turned[:, None]
        misses, shares, by_unknown = [np.empty(0)], [], [np.empty((0, len(free)))]
        for aim, instants in zip(self.aims, grid.instants, strict=True):
            there = slice(instants.start, instants.stop)
            residuals, by_outputs, by_strains = aim.rows(values[there], strains[there])
            residuals /= aim.goal.tolerance
            misses.append(residuals.ravel())
            shares.append(float(np.linalg.norm(residuals, axis=1).max()))
            if slopes:
                total = by_outputs @ gradients[there].reshape(len(instants), values.shape[1], -1) + by_strains
                by_unknown.append((total @ by_number[there]).reshape(residuals.size, -1) / aim.goal.tolerance)
        until = sum(grid.steps[: self.guarded]) + 1 if self.guarded else 0
        reading = Reading(np.concatenate(misses), values[:until, UTURN].copy(), np.array(shares), self.guard)
        if not slopes:
            return reading
        narrowing = np.einsum("tk,tkp->tp", gradients[:until, UTURN].reshape(until, 4 * model.sections), by_number[:until])
        every = [np.zeros((len(part), len(x))) for part in (reading.misses, reading.openings)]
        every[0][:, free], every[1][:, free] = np.concatenate(by_unknown), narrowing
        return replace(reading, miss_slopes=every[0], opening_slopes=every[1])

    def _levels(self, x: Floats, lengths: Floats) -> Floats:
        return self.model.levels(self.schedule(x)[1].activation(), self.present.clock + np.cumsum(lengths) - self.delay)

    def _moved(self, x: Floats, grid: Grid, levels: Floats, lengths: Floats, free: NDArray[np.int64]) -> Floats:
        """Strains (N + 1, S, 4); what was simulated last on this grid is not simulated again, and what is near it is quicker."""
        seen = [motion for motion in (self.sloped, self.last) if motion is not None and motion.grid == grid]
        for motion in seen:
            if np.array_equal(motion.x, x):
                return motion.strains
        # Unknowns that are not known (see `_copy`) are those of the same programme.
        near = seen[0].near(x, free) if seen and not (np.abs(x - seen[0].x) > KINDRED * self.box.scale).any() else None
        self.work += len(lengths)
        strains = simulate(self.model.step_model, self.present.strains, levels, lengths, near)
        self.last = Motion(x.copy(), grid, strains)
        return strains

    def offset(self, coarse: tuple[Grid, Reading], fine: tuple[Grid, Reading]) -> Floats:
        """What fine steps add to the misses on coarse ones, where a goal has to hold at one instant; elsewhere 0, for they do not match."""
        added, place, other = np.zeros(len(coarse[1].misses)), 0, 0
        for aim, few, many in zip(self.aims, coarse[0].instants, fine[0].instants, strict=True):
            size = aim.rows.count
            if len(few) == len(many) == 1:
                added[place : place + size] = fine[1].misses[other : other + size] - coarse[1].misses[place : place + size]
            place, other = place + size * len(few), other + size * len(many)
        return added

    def _inputs(self, x: Floats, grid: Grid, free: NDArray[np.int64]) -> tuple[Floats, Floats, Floats]:
        """Levels (N, groups, S) with derivatives (N, groups, S, p), and derivatives (N, p) of the step lengths, by the free unknowns."""
        unit = np.eye(len(x))[:, free]
        numbers = [Slopes(value, row) for value, row in zip(x, unit, strict=True)]
        _, primitives = self.primitives(numbers)
        try:
            activation = Schedule(primitives=(*self.present.before, *primitives), duration=1.0, composition="handover").activation()
        except TypeError as error:
            raise OctoctrlError(
                f"templates of a primitive whose numbers the planner chooses may use + - * / and powers alone: {error}"
            ) from error
        step_slopes = np.concatenate([np.tile(unit[phase] / steps, (steps, 1)) for phase, steps in enumerate(grid.steps)])
        times = np.cumsum(np.repeat(x[: len(grid.steps)] / grid.steps, grid.steps)) + self.present.clock - self.model.lag - self.delay
        time = Slopes(times[:, None], np.cumsum(step_slopes, axis=0)[:, None, :])
        edges, shape = self.model.edges, (len(times), len(MUSCLE_GROUPS), self.model.sections)
        levels, slopes, known = np.zeros(shape), np.zeros((*shape, len(free))), dict[Any, Any]()
        for group in activation.groups:
            found, column = activation.compose(SlopesMath, group, time, edges[:-1], edges[1:], known), MUSCLE_GROUPS.index(group)
            gain = self.model.gains.get(group, 1.0)
            levels[:, column], slopes[:, column] = gain * found.value, gain * found.slope
        return levels, slopes, step_slopes

    def _lost(self, grid: Grid, unknowns: int) -> Reading:
        """The reading where the model has no solution."""
        count = sum(len(instants) * aim.rows.count for aim, instants in zip(self.aims, grid.instants, strict=True))
        openings = np.full(sum(grid.steps[: self.guarded]) + 1 if self.guarded else 0, 2.0)
        reading = Reading(np.full(count, LOST), openings, np.full(len(self.aims), LOST), self.guard)
        return replace(reading, miss_slopes=np.zeros((count, unknowns)), opening_slopes=np.zeros((len(openings), unknowns)))
