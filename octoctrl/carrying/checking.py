"""What was found by searching, checked: carried out once on the plant that is asked for, from rest and as planned.

The next candidate follows where one misses. What a plan is called is decided by the verdict's own checks on that run, and by whether the
goals are met from rest in every scenario of the search.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np

from octoctrl.planners.asking.task import Task
from octoctrl.planners.asking.wrapping import Swing, TwistCurve, carried_out
from octoctrl.planners.contracts import Floats, Primitive
from octoctrl.planners.model.reduced import ReducedModel
from octoctrl.planners.solving.grasping import held_at_the_end
from octoctrl.planners.solving.plan import GoalReport, Plan, PlanReport, PlanStatus
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.running.observation import Observation
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.topology.trace import TopologyTrace

from ..progress import Progress
from .holding import LINK_RESIDUAL, holding_checks
from .results import Check
from .trials import Ended, Stage, plant_for, schedule_of
from .tugging import tugs
from .worth import misses, since, trace_of

KEPT, EVERY = 2, 5
"""Samples between recorded instants of a check, and instants between those whose strains a plan keeps."""


@dataclass(frozen=True, slots=True)
class Programme:
    """A task with drives, numbers for all of them, and its `searched` form: all phases at once, from rest, in every scenario.

    What the plant that carries it out `carried` is there if it was carried out already, phase by phase.
    """

    task: Task
    numbers: dict[str, float]
    primitives: tuple[Primitive, ...]
    searched: Stage
    carried: Ended | None = None

    def scenarios(self, executor: Executor) -> list[float]:
        """The worst goal of all phases, in tolerances, by scenario: each is run from rest, side by side on the `executor`."""
        nothing = np.zeros(0)
        running = [executor.submit(self.searched.ended_in, number, nothing) for number in range(len(self.searched.scenarios))]
        return [max(future.result().misses, default=0.0) for future in running]


@dataclass(frozen=True, slots=True)
class Findings:
    """Programmes to be checked, the most promising first, what was tried, and the price of the worst phase."""

    programmes: list[Programme]
    tried: tuple[str, ...]
    count: int
    price: float


def begins_of(task: Task) -> dict[str, float]:
    """When each phase of a `task` begins, s, if all last what they say."""
    times = accumulate((phase.duration for phase in task.phases), initial=0.0)
    return {phase.name: round(time, 9) for phase, time in zip(task.phases, times, strict=False)}


def by_scenario(what: str, shares: Sequence[float]) -> str:
    """A sentence on `what` ended with these `shares` of tolerances, one for each scenario."""
    return f"{what}: worst goal in tolerances, by scenario: " + ", ".join(f"{share:.2f}" for share in shares)


def checked(found: Findings, model: ReducedModel, curve: TwistCurve, plant: str, executor: Executor, progress: Progress) -> Plan:
    """The first programme of what was `found` that passes the verdict on the plant and in all scenarios, or the nearest, as a plan.

    One that passes on the plant and is lost in a scenario is fragile; then only those that no scenario loses are still tried on the plant.

    Parameters
    ----------
    found : Findings
    model : ReducedModel
        By which the plan's shapes are kept.
    curve : TwistCurve
        Of the `plant`.
    plant : str
    executor : Executor
        On which scenarios are run.
    progress : Progress
    """
    best: _Carried | None = None
    shares: list[float] = []
    said = list(found.tried)
    for number, programme in enumerate(found.programmes):
        what = f"candidate {number + 1} on the plant '{plant}'"
        fragile = best is not None and best.passed
        progress.start(f"checking {what}", None)
        try:
            latest = programme.scenarios(executor) if fragile else []
            if max(latest, default=0.0) > 1:
                said.append(by_scenario(f"candidate {number + 1} on the plant '{programme.searched.plant}'", latest))
                continue
            carried = _carried_out(programme, curve, model, plant)
            if carried.passed:
                latest = latest or programme.scenarios(executor)
            tugged = _tugged(carried.plan, plant) if carried.passed else []
        except PlantUnstableError as error:
            said.append(f"{what}: {error}")
            continue
        finally:
            progress.stop()
        said += [f"{what}: {carried}", *tugged]
        if best is None or carried.passed or (not fragile and carried.worst < best.worst):
            best, shares = carried, latest
        if carried.passed and max(latest) <= 1:
            break
    if best is None:
        programme = found.programmes[0]
        return _empty(programme.task, model, PlanStatus.MISSED, f"every candidate made the plant '{plant}' diverge", plant, tuple(said))
    status, reason = PlanStatus.MISSED, "; ".join(best.missed)
    if best.passed:
        searched_on, lost = best.programme.searched.plant, sum(share > 1 for share in shares)
        status = PlanStatus.FRAGILE if lost else PlanStatus.HELD
        reason = f"lost in {lost} of {len(shares)} scenarios on the plant '{searched_on}'" if lost else ""
        said.append(by_scenario(f"the plan on the plant '{searched_on}', from rest", shares))
    report = replace(best.plan.report, tried=tuple(said), starts=found.count, price=found.price, reason=reason)
    return replace(best.plan, status=status, report=report)


@dataclass(frozen=True, slots=True)
class _Carried:
    """A programme as the plant carried it out, and what the verdict checks and tells of that run besides the goals."""

    programme: Programme
    plan: Plan
    checks: tuple[Check, ...]

    @property
    def worst(self) -> float:
        """The largest share of a tolerance or a limit that is used up."""
        return max([*(goal.share for goal in self.plan.report.goals), *(check.value / check.limit for check in self.checks)], default=0.0)

    @property
    def passed(self) -> bool:
        """Whether the verdict on this run is a pass."""
        return not self.missed

    @property
    def missed(self) -> list[str]:
        """What is not as it should be, and by how much."""
        goals = [item for item in self.plan.report.goals if item.share > 1]
        return [
            *(f"phase '{item.phase}': {item.goal} is missed by {item.miss:.3g} {item.goal.unit}".rstrip() for item in goals),
            *(f"{item.name} is {item.value:.3g} {item.unit}, the limit {item.limit:.3g}" for item in self.checks if not item.passed),
        ]

    def __str__(self) -> str:
        failed = ", ".join(check.name for check in self.checks if not check.passed)
        worst = max((goal.share for goal in self.plan.report.goals), default=0.0)
        return f"worst goal {worst:.2f} tolerances" + (f"; beyond its limit: {failed}" if failed else "")


def _carried_out(programme: Programme, curve: TwistCurve, model: ReducedModel, plant: str) -> _Carried:
    """What the plant does under a programme, from rest and as planned, its twist by the plant's own `curve`."""
    task, begins = programme.task, begins_of(programme.task)
    duration = sum(phase.duration for phase in task.phases)
    schedule = schedule_of(tuple(carried_out(item, curve) for item in programme.primitives), duration)
    moved = plant_for(plant, model.arm, model.scene, KEPT)
    if programme.carried is None:
        moved.reset()
        recording = moved.advance(schedule.activation(), duration)
    else:
        moved.restore(programme.carried.state)
        recording = programme.carried.recording
    goals: list[GoalReport] = []
    for phase in task.phases:
        begin = begins[phase.name]
        part = since(recording, begin).until(begin + phase.duration)
        shares = misses(phase, part, model.arm, task)
        goals += [
            GoalReport(phase=phase.name, goal=goal, miss=share * goal.tolerance) for goal, share in zip(phase.goals, shares, strict=True)
        ]
    trace = trace_of(recording, task)
    checks = [
        *holding_checks(task, model.arm, recording, trace),
        Check(name="link_residual", value=float(np.abs(trace.residual).max()), limit=LINK_RESIDUAL, unit="turns"),
    ]
    kept = np.unique([*range(0, len(recording.time), EVERY), len(recording.time) - 1])
    made = Plan(
        task=task,
        model=model,
        schedule=schedule,
        phase_begins=begins,
        time=recording.time[kept],
        strains=strains_of(model, recording, kept, moved.edges),
        trace=trace.at(recording.time[kept]),
        status=PlanStatus.MISSED,  # until it is judged
        plant=plant,
        feedback="open-loop",
        report=PlanReport(
            numbers=programme.numbers,
            goals=tuple(goals),
            headroom=1.0 - float(recording.levels.max()),
            measured={check.name: check.value for check in checks},
        ),
    )
    return _Carried(programme, made, tuple(checks))


def _tugged(made: Plan, plant: str) -> list[str]:
    """What tugs at the held objects met, at the end of a run on a plant that is where the plan ends."""
    moved = plant_for(plant, made.arm, made.scene, KEPT)
    said = []
    for name in sorted(held_at_the_end(made.task)):
        try:
            found = tugs(moved, made.schedule.activation(), name, model=plant)
        except PlantUnstableError as error:  # the plan has been carried out before it
            said.append(f"tug at '{name}': {error}")
            continue
        said += [f"tug at '{name}' {word} {'its axis' if word == 'along' else 'it'}: {tug}" for word, tug in found.items()]
    return said


def strains_of(model: ReducedModel, recording: Recording, kept: Floats, edges: Floats) -> Floats:
    """Section strains (T, S, 4) by the `model` of a `recording` at the instants `kept`, whose elements lie between `edges`."""
    return np.array(
        [
            model.strains(
                Observation(
                    time=float(recording.time[index]), points=recording.points[index], frames=recording.frames[index],
                    stations=recording.stations, edges=edges, stretch=recording.stretch[index],
                    velocities=np.zeros_like(recording.points[index]), spins=np.zeros((len(edges) - 1, 3)),
                )
            )
            for index in kept
        ]
    )  # fmt: skip


def refused(task: Task, model: ReducedModel, reason: str, plant: str) -> Plan:
    """A plan of a `task` for a `plant` that moves nothing, for a known `reason`; the `model` is at rest."""
    return _empty(task, model, PlanStatus.REFUSED, reason, plant, ())


def _empty(task: Task, model: ReducedModel, status: PlanStatus, reason: str, plant: str, tried: tuple[str, ...]) -> Plan:
    """A plan that moves nothing, and says why."""
    duration = sum(phase.duration for phase in task.phases)
    zeros = np.zeros(2)
    time = np.array([0.0, duration])
    return Plan(
        task=task, model=model, schedule=schedule_of((Swing(level=0.0, stop=model.arm.length),), duration), phase_begins=begins_of(task),
        time=time, strains=np.stack([model.rest, model.rest]),
        trace=TopologyTrace.from_lifted(time=time, lifted_writhe=zeros, twist=zeros, convention=task.convention),
        status=status, plant=plant, feedback="open-loop", report=PlanReport(reason=reason, tried=tried),
    )  # fmt: skip
