"""Plan by simulating: phase by phase on the rod with all that it touches, then checked on the plant that is asked for.

Where contact decides, no reduced model knows better than the simulation of one rod, which takes a tenth of a second for a grasp. Each phase
is searched from the states in which the phase before ended, one for each scenario. What is found is carried out once on the plant itself,
from rest, as planned; the next candidate follows where one misses. What the plan is called is decided by the verdict's own checks on that
run, and by whether all goals are met in every scenario of the search.
"""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from time import perf_counter, process_time

import numpy as np

from octoctrl.planners.asking.task import Phase, Task
from octoctrl.planners.asking.wrapping import TwistCurve
from octoctrl.planners.model.reduced import ReducedModel
from octoctrl.planners.solving.cross_entropy import Candidate
from octoctrl.planners.solving.grasping import grasp_drives, grasp_region, objects_held, too_short
from octoctrl.planners.solving.plan import Plan
from octoctrl.planners.solving.scenarios import Scenario, four
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import check_plant

from ..progress import NullProgress, Progress
from .adapting import adapted
from .calibrating import twist_curve
from .checking import Findings, Programme, begins_of, by_scenario, checked, refused
from .phase_search import POPULATION, ROUNDS, Work, search_phase
from .trials import HOPELESS, Begun, Stage, at_once, from_rest, plant_for

SEARCHED_ON = "rod"
"""The plant on which is searched."""

LOOK, BACK = 2, 2
"""Rounds of a phase from each start before the search goes back for another way through the phase before, and how often it does."""

NEIGHBOURS = 2
"""Of a trial of one phase of several, that must meet the goals too, each from where its like ended the phase before: what rubs is
chaotic, and what is held by chance falls for a thousandth of a level."""


def plan_by_search(
    task: Task,
    model: ReducedModel,
    *,
    plant: str = SEARCHED_ON,
    time_limit: float = 60.0,
    seed: int = 0,
    population: int = POPULATION,
    rounds: int = ROUNDS,
    spread: float = 1.0,
    errors: Mapping[str, float] | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Plan a task whose goals are measured on recordings.

    Parameters
    ----------
    task : Task
        Whose goals are about objects that the scene has. Its phases last as long as they say. Of drives that set in with a phase, the
        free numbers are searched with the goals of that phase; a task that leaves its drives to the planner gets those of a grasp.
    model : ReducedModel
        Of the arm in its scene: by it the plan's shapes are kept, nothing is planned on it.
    plant : str
        On which the plan is checked and carried out.
    time_limit : float, s
        Wall clock of the search; what was found until then is checked.
    seed : int
    population, rounds : int
        Trials of a round, and rounds of a phase at most.
    spread : float
        How far it looks at first from the task's own numbers, over the usual.
    errors : mapping of str to float, optional
        ``twist``, ``bend``, ``profile`` and ``oblique`` of the scenarios, see `octoctrl.planners.solving.scenarios.four`.
    executor : Executor, optional
        Of `concurrent.futures`, or anything like it; all cores of this machine if omitted. What is found does not depend on it.
    progress : Progress, optional

    Returns
    -------
    Plan
        Held, missed or refused; interrupted by the user: the best of what was tried.

    Raises
    ------
    OctoctrlError
        If the plant is unknown.
    """
    arm, scene, display = model.arm, model.scene, progress or NullProgress()
    task = task.on(arm)
    check_plant(plant)
    reason, begin, processor = too_short(task, arm, scene), perf_counter(), process_time()
    if reason:
        return refused(task, model, reason, plant)
    curve = twist_curve(arm, scene.water, SEARCHED_ON, progress=display)
    own = curve if plant == SEARCHED_ON else twist_curve(arm, scene.water, plant, progress=display)
    held: AbstractContextManager[Executor] = nullcontext(executor) if executor is not None else ThreadPoolExecutor(os.cpu_count())
    with held as workers:
        work = Work(arm, scene, workers, display, time_limit, seed, population, rounds, spread, errors or {})
        found = _searched(task, work, curve)
        searched = process_time() - processor
        if plant != SEARCHED_ON and not work.over():
            found = _on_the_plant(found, own, plant, work)
        made = checked(found, model, own, plant, workers, display)
    report = replace(
        made.report, stages={"search": searched, "check": process_time() - processor - searched}, wall_time=perf_counter() - begin
    )
    return replace(made, report=report)


def _searched(task: Task, work: Work, curve: TwistCurve) -> Findings:
    """Search phase by phase; of the last phase several candidates are kept."""
    scenarios = scenarios_of(task, work)
    region: Mapping[str, tuple[float, float]] = {}
    if task.choose is not None:
        region = grasp_region(task, work.arm, work.scene)
        task = grasp_drives(task, work.arm, work.scene).on(work.arm)
    task = _in_order(task)
    together = at_once(task)
    alone = len(together) == 1
    begun = [from_rest(len(scenarios))] * (1 if alone else 1 + NEIGHBOURS)
    tried, ways, count = list[str](), list[_Way](), 0

    def through(stage: Stage, index: int, attempt: int = 0, rounds: int = work.rounds) -> _Way:
        nonlocal count
        look = replace(work, rounds=min(rounds, work.rounds))
        found, said, tries = search_phase(stage, look, index + attempt * len(together), {} if index else region)
        work.limit = look.limit  # none is left after an interruption
        count += tries
        tried.extend(said)
        if index == len(together) - 1:
            return _Way(stage, found, [])
        ended, begun = stage.handed_on(found[0].x, work.executor)
        tried.append(by_scenario(f"phase '{stage.name}'", [max(item.misses, default=0.0) for item in ended]))
        return _Way(stage, found, begun)

    for index, phases in enumerate(together):
        if not ways:
            ways.append(through(_stage(task, phases, begun, work, scenarios, curve, alone), index))
            continue
        way, before = through(_stage(task, phases, ways[-1].begun, work, scenarios, curve), index, rounds=LOOK), ways[-1]
        for attempt in range(1, BACK + 1):
            if way.best.judgement.met or not before.best.judgement.met or work.over():
                break
            before = through(replace(before.stage, spent=(*before.stage.spent, before.best.x)), index - 1, attempt)
            again = through(replace(way.stage, begun=before.begun[0], neighbours=tuple(before.begun[1:])), index, attempt, LOOK)
            if again.best.rank < way.best.rank:
                ways[-1], way = before, again
        if not way.best.judgement.met and not work.over():
            way = min(way, through(way.stage, index, BACK + 1), key=lambda item: item.best.rank)
        ways.append(way)
    way = ways[-1]
    numbers = {name: number for way in ways[:-1] for name, number in way.numbers(way.best).items()}
    programmes = []
    for item in way.found:
        primitives = (*way.stage.begun.settled, *way.stage.primitives(item.x))
        programmes.append(Programme(task, numbers | way.numbers(item), primitives, way.stage.run_through(primitives)))
    worst = max(way.best.price for way in ways)
    return Findings(_safest_first(programmes, work.executor), tuple(tried), count, worst)


@dataclass(frozen=True, slots=True)
class _Way:
    """A way through a phase: what is searched there, what was found, the best first, and from where the next phase goes on."""

    stage: Stage
    found: list[Candidate]
    begun: list[Begun]

    @property
    def best(self) -> Candidate:
        """By which it goes on."""
        return self.found[0]

    def numbers(self, item: Candidate) -> dict[str, float]:
        """Those of a candidate, by name."""
        return dict(zip(self.stage.unknowns.names, map(float, item.x), strict=True))


def _safest_first(programmes: Sequence[Programme], executor: Executor) -> list[Programme]:
    """Those of some `programmes` that hold as planned, and that fewer scenarios lose, before others: what these lose the plant may lose.

    They come by their price; beyond the first that no scenario loses nobody looks.
    """
    lost: list[tuple[bool, int]] = []
    for programme in programmes:
        shares = programme.scenarios(executor)
        lost.append((shares[0] > 1, sum(share > 1 for share in shares)))
        if not lost[-1][1]:
            break
    seen = sorted(range(len(lost)), key=lost.__getitem__)
    return [*(programmes[number] for number in seen), *programmes[len(lost) :]]


def _on_the_plant(found: Findings, curve: TwistCurve, plant: str, work: Work) -> Findings:
    """What was `found`, with the turns and the shortening that suit a `plant` whose `curve` is given."""
    programmes, said = adapted(found.programmes, curve, plant, work.progress)
    return replace(found, programmes=programmes, tried=(*found.tried, *said))


def _in_order(task: Task) -> Task:
    """A `task` whose drives come as their phases do: added up in one order, phase by phase and from rest, they give the same bits."""
    return replace(task, drives=tuple(drive for phase in task.phases for drive in task.drives if drive.begins == phase.name))


def scenarios_of(task: Task, work: Work) -> tuple[Scenario, ...]:
    """Four for a `task`, by the `work`, in which no object overlaps the arm at rest: directions are drawn until none does."""
    draw, held = np.random.default_rng(work.seed), set(objects_held(task))
    for _ in range(50):
        found = four(draw, **work.errors)
        try:
            for scenario in found:
                plant_for(SEARCHED_ON, scenario.arm(work.arm), scenario.scene(work.scene, held))
            return found
        except OctoctrlError:
            continue
    plant_for(SEARCHED_ON, work.arm, work.scene)
    return tuple(replace(scenario, shift=(0.0, 0.0, 0.0)) for scenario in four(draw, **work.errors))


def _stage(
    task: Task,
    phases: tuple[Phase, ...],
    begun: Sequence[Begun],
    work: Work,
    scenarios: tuple[Scenario, ...],
    curve: TwistCurve,
    alone: bool = False,
) -> Stage:
    drives = tuple(drive for phase in phases for drive in task.drives if drive.begins == phase.name)
    goals = sum(len(phase.goals) for phase in phases)
    return Stage(
        task=task, phases=phases, begins=begins_of(task), drives=drives, begun=begun[0], arm=work.arm, scene=work.scene,
        held=frozenset(objects_held(task)), scenarios=scenarios, plant=SEARCHED_ON, curve=curve,
        spread=work.spread, hopeless=HOPELESS * (1 + 0.5 * max(goals - 1, 0)), quick=alone, neighbours=tuple(begun[1:]),
    )  # fmt: skip
