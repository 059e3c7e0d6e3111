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
from dataclasses import dataclass, field, replace
from time import perf_counter, process_time

import numpy as np

from octoctrl.planners.asking.task import Drive, Phase, Task
from octoctrl.planners.asking.wrapping import TwistCurve
from octoctrl.planners.contracts import Floats, Primitive
from octoctrl.planners.model.reduced import ReducedModel
from octoctrl.planners.solving.cross_entropy import GOOD_ENOUGH, Candidate, Searched, Unknowns, search
from octoctrl.planners.solving.free_shapes import free_points, last_free, turns_near
from octoctrl.planners.solving.grasping import check_objects, grasp_drives, grasp_region, grasped, objects_held, too_short
from octoctrl.planners.solving.plan import Plan
from octoctrl.planners.solving.scenarios import Scenario, four
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.contracts import State
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.plants import check_plant
from octoctrl.sim.scene.scene import Scene

from ..progress import NullProgress, Progress
from .adapting import adapted
from .calibrating import twist_curve
from .checking import Findings, Programme, begins_of, by_scenario, checked, refused
from .trials import HOPELESS, Stage, at_once, plant_for, schedule_of

SEARCHED_ON = "rod"
"""The plant on which is searched."""

POPULATION, ROUNDS, STARTS, FIRST_ROUNDS = 14, 12, 2, 4
"""Trials of a round, rounds of a phase at most; how often it begins anew, and after how many rounds of each of these the best goes on
alone. A search that has lost its way does not find it again; another one may."""

SURVEYS, DRAWN, SURVEYED, SURVEY_ROUNDS, KEPT, NEAR_ENOUGH = 2, 600, 40, 4, 8, 0.45
"""Surveys of a phase at most, the second where the first leads nowhere; programmes that are drawn for one, how many a round of it tries,
rounds, how many of the best it goes on from, and price at which it ends."""

FAR, NARROW = 1.0, 0.5
"""How far apart the searches that follow a survey begin, in its spreads, and how far they look at first, over the usual."""

SETTLING, FAIR = 2, 0.65
"""Rounds of trials that are not rough at most, where nothing that rough ones found is good enough, and price below which that costs more
time than it is worth: such grasps were held on the full arm, though a scenario may lose them."""

LOOKS = 14
"""Instants at which the way of a programme is looked at in free water."""

NEIGHBOURS = 2
"""Of a trial of one phase of several, that must meet the goals too: run from rest, a phase begins from nearly the same state only."""

CANDIDATES, APART = 3, 0.6
"""Candidates that are checked on the plant, and how far apart they lie, in first spreads."""


@dataclass(slots=True)
class Work:
    """What a search by simulation needs besides the task.

    Attributes
    ----------
    arm : Arm
    scene : Scene
    executor : Executor
    progress : Progress
    limit : float, s
        Wall clock.
    seed : int
    population, rounds : int
        Trials of a round, and rounds of a phase at most.
    spread : float
        How far it looks at first, over the usual.
    errors : dict of str to float
        Of the scenarios, see `octoctrl.planners.solving.scenarios.four`.
    """

    arm: Arm
    scene: Scene
    executor: Executor
    progress: Progress
    limit: float
    seed: int
    population: int = POPULATION
    rounds: int = ROUNDS
    spread: float = 1.0
    errors: Mapping[str, float] = field(default_factory=dict)
    begin: float = field(default_factory=perf_counter)

    def over(self) -> bool:
        """Whether the time is up."""
        return perf_counter() - self.begin > self.limit


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
        Its phases last as long as they say. Of drives that set in with a phase, the free numbers are searched with the goals of that
        phase; a task that leaves its drives to the planner gets those of a grasp.
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
        If a goal names an object that the scene does not have, or the plant is unknown.
    """
    arm, scene, display = model.arm, model.scene, progress or NullProgress()
    task = task.on(arm)
    check_plant(plant)
    check_objects(task, scene)
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
    states: tuple[State | None, ...] = (None,) * len(scenarios)
    settled: tuple[Primitive, ...] = ()
    numbers: dict[str, float] = {}
    tried: list[str] = []
    count, worst = 0, 0.0
    last: list[Candidate] = []
    region: Mapping[str, tuple[float, float]] = {}
    if task.choose is not None:
        region = grasp_region(task, work.arm, work.scene)
        task = grasp_drives(task, work.arm, work.scene).on(work.arm)
    together = at_once(task)
    for index, phases in enumerate(together):
        stage = _stage(task, phases, settled, work, scenarios, states, curve, alone=len(together) == 1)
        last, said, tries = _search_phase(stage, work, index, {} if index else region)
        tried += said
        count += tries
        best = last[0]
        worst = max(worst, best.price)
        if index < len(together) - 1:
            settled += stage.primitives(best.x)
            numbers |= dict(zip(stage.unknowns.names, map(float, best.x), strict=True))
            ended = stage.ended(best.x)
            tried.append(by_scenario(f"phase '{stage.name}'", [max(item.misses, default=0.0) for item in ended]))
            states = tuple(item.state or None for item in ended)
    programmes = []
    for item in last:
        found = dict(zip(stage.unknowns.names, map(float, item.x), strict=True))
        primitives = _in_order(stage.task, (*settled, *stage.primitives(item.x)))
        programmes.append(Programme(stage.task, numbers | found, primitives, stage.run_through(primitives)))
    return Findings(_safest_first(programmes, work.executor), tuple(tried), count, worst)


def _safest_first(programmes: Sequence[Programme], executor: Executor) -> list[Programme]:
    """Those of some `programmes` that fewer scenarios lose before others, for what a scenario loses the plant may lose as well.

    They come by their price; beyond the first that no scenario loses nobody looks.
    """
    lost: list[int] = []
    for programme in programmes:
        lost.append(sum(share > 1 for share in programme.scenarios(executor)))
        if not lost[-1]:
            break
    seen = sorted(range(len(lost)), key=lost.__getitem__)
    return [*(programmes[number] for number in seen), *programmes[len(lost) :]]


def _on_the_plant(found: Findings, curve: TwistCurve, plant: str, work: Work) -> Findings:
    """What was `found`, with the turns and the shortening that suit a `plant` whose `curve` is given."""
    try:
        programmes, said = adapted(found.programmes, curve, plant, work.executor, work.progress)
    except PlantUnstableError as error:
        return replace(found, tried=(*found.tried, f"nothing was chosen on the plant '{plant}': {error}"))
    return replace(found, programmes=programmes, tried=(*found.tried, *said))


def _in_order(task: Task, primitives: Sequence[Primitive]) -> tuple[Primitive, ...]:
    """Primitives that were settled phase by phase, in the order of the task's drives."""
    order = [drive for phase in task.phases for drive in task.drives if drive.begins == phase.name]
    by_name = {drive.name: primitive for drive, primitive in zip(order, primitives, strict=True)}
    return tuple(by_name[drive.name] for drive in task.drives)


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
    settled: tuple[Primitive, ...],
    work: Work,
    scenarios: tuple[Scenario, ...],
    states: tuple[State | None, ...],
    curve: TwistCurve,
    alone: bool = False,
) -> Stage:
    # Phase by phase, for that is the order in which their primitives are known again.
    drives: tuple[Drive, ...] = tuple(drive for phase in phases for drive in task.drives if drive.begins == phase.name)
    goals = sum(len(phase.goals) for phase in phases)
    return Stage(
        task=task, phases=phases, begins=begins_of(task), drives=drives, settled=settled, arm=work.arm, scene=work.scene,
        held=frozenset(objects_held(task)), scenarios=scenarios, states=states, plant=SEARCHED_ON, curve=curve,
        spread=work.spread, hopeless=HOPELESS * (1 + 0.5 * max(goals - 1, 0)), quick=alone, neighbours=0 if alone else NEIGHBOURS,
    )  # fmt: skip


def _surveyed(stage: Stage, work: Work, region: Mapping[str, tuple[float, float]], seed: int) -> Searched:
    """What is found in a region, as planned alone: of many programmes those that would go round the object in free water, then others near
    the best of them.

    A programme that would have to pass through the object on its way counts by where it would be held up.
    """
    low, high = np.array([region[name] for name in stage.unknowns.names]).T
    drawn = np.random.default_rng(work.seed + seed).uniform(low, high, size=(DRAWN, len(low)))
    end, edges = stage.begins[stage.phases[-1].name] + stage.phases[-1].duration, work.arm.edges
    times, item = np.linspace(0.0, end, LOOKS), grasped(stage.task, work.scene)
    levels = np.array([schedule_of(stage.primitives(x), end).activation().levels(times, edges) for x in drawn])
    points = free_points(levels.reshape(-1, *levels.shape[2:]), work.arm, stage.curve).reshape(DRAWN, LOOKS, -1, 3)
    near = turns_near(points[np.arange(DRAWN), last_free(points, item)], work.arm, item)
    first = drawn[np.argsort(-near, kind="stable")[:SURVEYED]]
    unknowns = replace(stage.unknowns, mean=first[0], spread=(high - low) / 3)
    work.progress.start(f"looking round for phase '{stage.name}'", float(SURVEYED * SURVEY_ROUNDS))
    try:
        found = search(
            stage.as_planned(), unknowns, work.executor, seed=work.seed + seed, population=SURVEYED, rounds=SURVEY_ROUNDS, elite=KEPT,
            enough=NEAR_ENOUGH, first=list(first[1:]), stop=work.over, progress=work.progress,
        )  # fmt: skip
    finally:
        work.progress.stop()
    return _heeded(found, work)


def _rounds(
    stage: Stage, work: Work, start: Unknowns, rounds: int, seed: int, *, after: Searched | None = None, first: Sequence[Floats] = ()
) -> Searched:
    """Some rounds of a stage, from a `start` or `after` others; all that the only round tries may be given, the mean first."""
    population = max(len(first), 2) if first else work.population
    work.progress.start(f"searching phase '{stage.name}'", float(population * rounds + (len(after.candidates) if after else 0)))
    try:
        result = search(
            stage, start, work.executor, seed=work.seed + seed, population=population, rounds=rounds, enough=stage.enough,
            first=first[1:], after=after, stop=work.over, progress=work.progress,
        )  # fmt: skip
    finally:
        work.progress.stop()
    return _heeded(result, work)


def _heeded(found: Searched, work: Work) -> Searched:
    """What was found; if it was interrupted, nothing more is searched."""
    if found.ended == "interrupted":
        work.limit = 0.0
    return found


def _search_phase(
    stage: Stage, work: Work, index: int, region: Mapping[str, tuple[float, float]]
) -> tuple[list[Candidate], list[str], int]:
    """Search a phase; the best candidates that lie apart, what was tried, and how many trials.

    Where trials may be quick, the first rounds are rough ones, and what they find is settled by others.
    """
    name, own, seed, tried = stage.name, stage.unknowns.mean, 1000 * index, replace(stage, rough=stage.quick)
    if not stage.unknowns.names:
        return [Candidate(own, stage(own))], [], 1
    judged = work.executor.submit(stage, own).result()
    if judged.met or judged.price <= stage.enough:
        return [Candidate(own, judged)], [f"phase '{name}': the task's own numbers, price {judged.price:.3f}, were good enough"], 1
    seen, found, settled = _begun(tried, work, seed, region if judged.price > stage.hopeless else {})
    best = _apart(found) or [Candidate(own, judged)]
    if best[0].price > stage.hopeless:  # nothing came near, and more of the same will not
        best = best[:1]
    elif tried.rough:
        _settle(stage, work, seed + STARTS, found, settled)
        best = _apart(settled) or best
    elif found:
        _gone_on(stage, work, seed + STARTS, found)
        best = _apart(found)
    said = [f"phase '{name}', survey with {item}" for item in seen] + [f"phase '{name}', {item}" for item in (*found, *settled)]
    count = 1 + sum(len(item.candidates) for item in (*seen, *found, *settled))
    return best, said or [f"phase '{name}' was not searched"], count


def _begun(
    stage: Stage, work: Work, seed: int, region: Mapping[str, tuple[float, float]]
) -> tuple[list[Searched], list[Searched], list[Searched]]:
    """Surveys, some rounds from each start, and what of them was judged anew, until something is good enough.

    It starts from the task's own numbers or, where there is a `region` to look round, from the best of a survey; if that leads nowhere,
    from the best of another one.
    """
    seen, found, settled, unknowns = list[Searched](), list[Searched](), list[Searched](), stage.unknowns
    starts = [unknowns] * STARTS
    for look in range(SURVEYS if region else 1):
        first = seed + look * (STARTS + 2)
        if region:
            seen.append(_surveyed(stage, work, region, first + STARTS + 1))
            near = seen[-1].candidates and seen[-1].best.price <= stage.hopeless
            best = seen[-1].apart(STARTS if near else 1, FAR)
            starts = [replace(unknowns, mean=item.x, spread=NARROW * unknowns.spread) for item in best]
        for number, start in enumerate(starts):
            if work.over() or _good(settled if stage.rough else found):
                break
            found.append(_rounds(stage, work, start, min(FIRST_ROUNDS, work.rounds), first + number))
            if stage.rough and _good(found[-1:]):
                settled.append(_judged_anew(replace(stage, rough=False), work, first + STARTS, found[-1:]))
        if work.over() or any(result.candidates and result.best.price <= stage.hopeless for result in found):
            break
    return seen, [result for result in found if result.candidates], [result for result in settled if result.candidates]


def _gone_on(stage: Stage, work: Work, seed: int, found: Sequence[Searched]) -> None:
    """The rounds that are left, after that of what was `found` which found the best, unless that is good enough."""
    left, best = work.rounds - STARTS * FIRST_ROUNDS, _best(found)
    if left > 0 and best.ended != GOOD_ENOUGH and not work.over():
        _rounds(stage, work, stage.unknowns, left, seed, after=best)


def _judged_anew(stage: Stage, work: Work, seed: int, found: Sequence[Searched]) -> Searched:
    """The best of what rough trials `found`, judged by others."""
    first, spread = [item.x for item in _apart(found)], _best(found).spread
    again = Searched(unknowns=stage.unknowns, seed=work.seed + seed, mean=first[0], spread=spread)
    _rounds(stage, work, stage.unknowns, 1, seed, after=again, first=first)
    if again.candidates:
        again.mean, again.spread = again.best.x, spread
    return again


def _settle(stage: Stage, work: Work, seed: int, found: Sequence[Searched], settled: list[Searched]) -> None:
    """Judge anew what was `found` and not good enough for that, and go on from the best of all, if nothing that is `settled` is fair."""
    left = [result for result in found if not _good([result])]
    if left and not _good(settled) and not work.over():
        settled.append(_judged_anew(stage, work, seed, left))
    fair = _good(settled) or any(item.best.price <= FAIR for item in settled if item.candidates)
    if settled and settled[-1].candidates and not fair and not work.over():
        _rounds(stage, work, stage.unknowns, min(SETTLING, work.rounds), seed, after=_best(settled))


def _good(found: Sequence[Searched]) -> bool:
    """Whether something is good enough."""
    return any(result.ended == GOOD_ENOUGH for result in found)


def _best(found: Sequence[Searched]) -> Searched:
    """The search that came nearest."""
    return min(found, key=lambda result: _rank(result.best))


def _apart(found: Sequence[Searched]) -> list[Candidate]:
    """The best candidates of all searches that lie apart in theirs."""
    return sorted((item for result in found for item in result.apart(CANDIDATES, APART)), key=_rank)[:CANDIDATES]


def _rank(item: Candidate) -> tuple[bool, float]:
    """What goes first: that which meets all goals, then by price."""
    return not item.judgement.met, item.price
