"""From a task to a plan with an honest status: reach, search, optimisation, check, doubt, in this order and within one time limit.

The search finds a point that meets the goals; CasADi's optimiser makes it cheap; phases end on the plant's samples; what results is
simulated once more at 10 ms and measured by the formula that measures the plant. Only that decides what the plan is called.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from time import perf_counter, process_time
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.errors import check_number
from octoctrl.sim.topology.measures import measure
from octoctrl.sim.topology.trace import TopologyTrace

from ..asking.choice import Choice
from ..asking.schedule import Schedule
from ..asking.task import Task, miss_in_phase
from ..fitting.identified import IdentifiedModel
from .choosing import Sequence, channels, choose
from .doubt import doubt
from .interrupts import interrupts_kept
from .optimiser import objective, optimise
from .plan import Alternative, GoalReport, Plan, PlanReport, PlanStatus
from .present import Present, lifted_by
from .problem import Problem
from .reachability import unreachable
from .search import COARSE, ENOUGH, Found, Search

Floats = NDArray[np.float64]

CHECK = 0.01
"""Step of the simulation that decides, s."""

RELAXED, NEAR = 0.25, 3.5
"""Smaller u that is aimed at when a search has come within so many tolerances."""

WARM, NEARBY = 3, 0.6
"""Iterations of the fit from a plan's numbers, and the largest miss in tolerances on fine steps with which that is enough."""

SEVERAL, OTHER_WORK, OTHER_GUESSES = 2, 7000.0, 60
"""Sequences of drives that are looked for where they are chosen; work and guesses spent on others where the given ones do not do."""

SEARCH_SHARE = 0.7
"""Share of the time limit after which the search ends, so that what it has found can still be finished."""


class Tell(Protocol):
    """What planning asks of a progress display."""

    def start(self, label: str, total: float | None = None) -> None:
        """Begin a stretch of work."""
        ...

    def advance(self, done: float, note: str = "") -> None:
        """Say how far it is."""
        ...

    def stop(self) -> None:
        """End it."""
        ...


@dataclass(slots=True)
class Clock:
    """Wall clock with a limit, and processor time of the stages."""

    limit: float
    begin: float = field(default_factory=perf_counter)
    stages: dict[str, float] = field(default_factory=dict)
    last: float = field(default_factory=process_time)

    @property
    def spent(self) -> float:
        """Wall time so far, s."""
        return perf_counter() - self.begin

    def after(self, share: float) -> bool:
        """Whether a share of the limit has passed."""
        return self.spent > share * self.limit

    def lap(self, stage: str) -> None:
        """Book the processor time since the last lap."""
        now = process_time()
        self.stages[stage], self.last = now - self.last, now


def plan(
    task: Task,
    identified: IdentifiedModel,
    *,
    time_limit: float = 30.0,
    guess: Plan | None = None,
    start: Mapping[str, float] | None = None,
    present: Present | None = None,
    progress: Tell | None = None,
) -> Plan:
    """Plan a task.

    Parameters
    ----------
    task : Task
    identified : IdentifiedModel
        Reduced model of the arm, with its region of validity.
    time_limit : float, s
        Wall-clock limit of everything but compiling, which happens once after an installation.
    guess : Plan, optional
        A solved plan of a similar task to start from; a plan that is not solved is ignored, because it would lead astray.
    start : dict of str to float, optional
        First guess of single unknowns, by name (see `PlanReport.numbers`), in place of the task's own numbers.
    present : Present, optional
        Where the arm is; at rest if omitted.
    progress : Progress, optional

    Returns
    -------
    Plan
        Always a plan; its status says whether it meets the goals.

    Raises
    ------
    OctoctrlError
        If the limit is not positive.
    KeyboardInterrupt
        As a user's interrupt arrives; there is no plan then.
    """
    check_number("time_limit", time_limit, above=0.0, unit="s")
    task = task.on(identified.model.arm)
    reason = unreachable(task, identified.reach)
    if reason:
        return _refused(task, identified, reason, Clock(time_limit))
    if progress is not None:
        progress.start("preparing the planner (compiled the first time)")
    try:
        identified.model.prepare()
    finally:
        if progress is not None:
            progress.stop()
    clock = Clock(time_limit)
    if progress is not None:
        progress.start("planning")
    try:
        with interrupts_kept():
            return _planned(task, identified, clock, guess, start or {}, present, progress)
    finally:
        if progress is not None:
            progress.stop()


def _planned(
    task: Task,
    identified: IdentifiedModel,
    clock: Clock,
    guess: Plan | None,
    start: Mapping[str, float],
    present: Present | None,
    progress: Tell | None,
) -> Plan:
    known: Mapping[str, float] = guess.report.numbers if guess is not None and guess.status.solved else {}

    def told(count: int, miss: float) -> None:
        if progress is not None:
            progress.advance(count, f"start {count}, largest miss {miss:.2g} tolerances")

    def late() -> bool:
        return clock.after(SEARCH_SHARE)

    others: tuple[Alternative, ...] = ()
    if task.choose is not None and known:
        assert guess is not None
        task = replace(task, drives=guess.task.drives, choose=None)
    if task.choose is not None:
        sequences, search = choose(task, task.choose, identified.model, late, present=present, several=SEVERAL, tell=told)
        clock.lap("choice")
        if not sequences:
            assert search.found is not None
            report = PlanReport(starts=search.starts, iterations=search.iterations)
            return _unsolved(search, search.found, identified, report, clock)
        task, known, others = sequences[0].task, sequences[0].numbers, tuple(map(_alternative, sequences))
    problem = Problem(task, identified.model, present)
    search = Search(problem, late, told)
    first = problem.vector(dict(known) | dict(start))
    # The optimiser itself goes the little way from a plan of a similar task.
    found = (_nearby(search, first) if known or start else None) or search.run(first)
    if not found.solved and found.reading.worst < NEAR and problem.guarded and not clock.after(SEARCH_SHARE):
        found = _relaxed(search, found)
    clock.lap("search")
    report = PlanReport(starts=found.starts, iterations=found.iterations, alternatives=others)
    if not found.solved:
        return _unsolved(search, found, identified, report, clock, asked=None if others else task)
    price = objective(problem, identified.validity.level_rate)
    best, report = _optimised(problem, found, price, report, clock, progress)
    clock.lap("optimise")
    return _finished(problem, best, PlanStatus.SOLVED, identified, report, clock)


def _nearby(search: Search, x: Floats) -> Found | None:
    """A plan's own numbers, if they come so near to the goals that the optimiser needs no search, after one fit on coarse steps."""
    x = search.fitted(x, COARSE, WARM)
    reading = search.read(x)
    return None if reading.worst > NEARBY else Found(x, reading, 1, search.iterations)


def _alternative(sequence: Sequence) -> Alternative:
    """What is told of a sequence of drives."""
    task, now, begins = sequence.task, 0.0, dict[str, float]()
    for phase in task.phases:
        begins[phase.name] = now
        now += phase.duration
    effort = sum(drive.primitive.effort(now - begins[drive.begins]) for drive in task.drives)
    names = tuple(drive.name for drive in task.drives)
    return Alternative(drives=names, duration=now, effort=float(effort), worst=sequence.worst, opening=sequence.opening)


def _relaxed(search: Search, found: Found) -> Found:
    """Another try from where a search ended, closer to a U-turn."""
    closer = Search(search.problem.with_guard(RELAXED), search.stop)
    closer.starts, closer.iterations = found.starts, found.iterations
    closer.keep(*closer.finished(closer.fitted(found.x, COARSE, 10)))
    assert closer.found is not None
    return closer.found if closer.found.reading.worst < found.reading.worst else found


def _optimised(
    problem: Problem, found: Found, price: ca.Function, report: PlanReport, clock: Clock, progress: Tell | None
) -> tuple[Found, PlanReport]:
    """The cheapest point that holds on fine steps with phases on samples: the optimiser's, or the one from which it began."""

    def told(count: int) -> None:
        if progress is not None:
            progress.advance(count, f"optimising, iteration {count}")

    ended = optimise(problem, found.x, found.reading, price, lambda: clock.after(1.0), told)
    first, chosen = float(price(found.x)), None
    if float(price(ended.x)) < first:
        held = ended.reading.worst <= max(ENOUGH, found.reading.worst)
        best = replace(found, x=ended.x, reading=ended.reading) if held else _on_samples(problem, ended.x, clock)
        if best.reading.worst <= max(ENOUGH, found.reading.worst) and float(price(best.x)) < first:
            chosen = best
    good = chosen is not None
    if chosen is None:
        chosen = _on_samples(problem, found.x, clock)
    return chosen, replace(
        report,
        iterations=report.iterations + ended.iterations,
        optimiser=ended.word,
        optimised=good,
        first_price=first,
        price=float(price(chosen.x)),
        first_duration=float(found.x[: len(problem.task.phases)].sum()),
    )


def _on_samples(problem: Problem, x: Floats, clock: Clock) -> Found:
    """Unknowns whose phases end on samples of the plant, fitted once more if that has moved a goal."""
    count = len(problem.task.phases)
    durations = problem.on_samples(x[:count])
    search = Search(problem.with_durations(durations), lambda: clock.after(1.0))
    x = np.concatenate([durations, x[count:]])
    search.keep(*search.finished(x))
    assert search.found is not None
    return search.found


def _unsolved(
    search: Search, found: Found, identified: IdentifiedModel, report: PlanReport, clock: Clock, asked: Task | None = None
) -> Plan:
    """The plan that comes nearest, why it is not good enough, and whether other drives than those `asked` for would do."""
    status = PlanStatus.TIME_LIMIT if clock.after(SEARCH_SHARE) else PlanStatus.NOT_FOUND
    problem = search.problem
    if status is PlanStatus.NOT_FOUND and problem.guarded:
        free = Search(problem.with_guard(0.0), search.stop)
        free.keep(*free.finished(free.fitted(found.x, COARSE, 10)))
        if free.found is not None and free.found.solved:
            found, status = free.found, PlanStatus.UTURN
    if status is not PlanStatus.TIME_LIMIT and asked is not None:
        sequences, _ = choose(
            asked,
            Choice().on(identified.model.arm),
            identified.model,
            search.stop,
            present=problem.present,
            work=OTHER_WORK,
            count=OTHER_GUESSES,
        )
        clock.lap("choice")
        if sequences:
            status, report = PlanStatus.OTHER_DRIVES, replace(report, alternatives=tuple(map(_alternative, sequences)))
    return _finished(problem, found, status, identified, report, clock)


def _finished(problem: Problem, found: Found, status: PlanStatus, identified: IdentifiedModel, report: PlanReport, clock: Clock) -> Plan:
    """The plan of unknowns: simulated once more with a fine step, and every goal measured on that."""
    task, model, x = problem.task, problem.model, found.x
    begins, schedule = problem.schedule(x)
    edges = [*begins.values(), schedule.duration]
    pieces = [np.linspace(a, b, max(2, int(np.ceil((b - a) / CHECK - 1e-9)) + 1))[1:] for a, b in pairwise(edges)]
    present = problem.present
    time = np.concatenate([[present.clock], *pieces])
    levels = model.levels(schedule.activation(), time[1:])
    motion = model.simulate(levels, np.diff(time), start=present.strains, begin=present.clock)
    recording = model.recording(motion.time, motion.strains)
    trace = measure(recording.time, recording.points, recording.frames, task.convention)
    trace = lifted_by(trace, present.branch(trace.lifted_writhe[0]))
    goals = tuple(
        GoalReport(phase=phase.name, goal=goal, miss=miss_in_phase(goal, time, goal.miss(recording, trace, model.arm), begin, end))
        for phase, (begin, end) in zip(task.phases, pairwise(edges), strict=True)
        for goal in phase.goals
    )
    report = replace(report, numbers=dict(zip(problem.names, x.tolist(), strict=True)), goals=goals, opening=found.reading.opening)
    worst, reason = report.worst, ""
    if status is PlanStatus.SOLVED and worst is not None and worst.share > 1:
        status = PlanStatus.NOT_FOUND
    if status is PlanStatus.SOLVED:
        doubts = doubt(problem, x, found.reading, schedule)
        report = replace(report, spread=tuple(doubts.spread.tolist()))
        if doubts.reasons:
            status, reason = PlanStatus.DOUBTFUL, "; ".join(doubts.reasons)
    elif status is PlanStatus.OTHER_DRIVES:
        reason = str(report.alternatives[0])
    elif worst is not None and worst.share > 1:
        searches = f"{report.starts} {'search' if report.starts == 1 else 'searches'}"
        missed = f"phase '{worst.phase}' misses {worst.goal} by {worst.miss:.3g} {worst.goal.unit}".rstrip()
        reason = f"{searches} came no nearer than this: {missed}"
    elif status is PlanStatus.NOT_FOUND:
        reason = f"every goal is met, but the tip comes too near a U-turn (1 + tip . base = {found.reading.opening:.2f})"
    clock.lap("check")
    report = replace(
        report,
        reason=reason,
        headroom=float(1 - levels.max()),
        extrapolates=identified.validity.outside(model.arm, motion.strains, levels),
        at_bounds=_at_bounds(problem, x),
        stages=clock.stages,
        wall_time=clock.spent,
    )
    return Plan(
        task=task, model=model, schedule=schedule, phase_begins=begins, time=motion.time, strains=motion.strains, trace=trace,
        status=status, plant=identified.plant, identified=identified, since=present.clock, report=report,
    )  # fmt: skip


def _at_bounds(problem: Problem, x: Floats) -> tuple[str, ...]:
    """Unknowns that could not go further, and where they stand."""
    box = problem.box
    told = []
    for name, value, low, high in zip(problem.names, x, box.lower, box.upper, strict=True):
        if low < high and (value - low < 1e-6 or high - value < 1e-6):
            told.append(f"{name} {value:.3g}")
    return tuple(told)


def _refused(task: Task, identified: IdentifiedModel, reason: str, clock: Clock) -> Plan:
    """The plan that says why there is none."""
    if task.choose is not None:
        task = channels(task, task.choose)
    model, begins, now = identified.model, {}, 0.0
    for phase in task.phases:
        begins[phase.name] = now
        now += phase.duration
    primitives = tuple(drive.at(begins, {}) for drive in task.drives)
    time, zeros = np.array([0.0, now]), np.zeros(2)
    schedule = Schedule(primitives=primitives, duration=now, composition="handover")
    trace = TopologyTrace.from_lifted(time=time, lifted_writhe=zeros, twist=zeros, convention=task.convention)
    return Plan(
        task=task, model=model, schedule=schedule, phase_begins=begins, time=time, strains=np.stack([model.rest, model.rest]), trace=trace,
        status=PlanStatus.UNREACHABLE, plant=identified.plant, identified=identified,
        report=PlanReport(reason=reason, wall_time=clock.spent),
    )  # fmt: skip
