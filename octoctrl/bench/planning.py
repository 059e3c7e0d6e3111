"""Planning on goals that nobody has seen, following the shipped tasks on plants that are not as planned: how often, how well, how fast."""

from collections import Counter
from dataclasses import replace
from time import process_time
from typing import Any, NamedTuple

import numpy as np

from octoctrl.planners.asking.task import Task
from octoctrl.planners.fitting.identified import IdentifiedModel, load_identified
from octoctrl.planners.solving import planner
from octoctrl.planners.solving.plan import Plan, PlanStatus
from octoctrl.planners.solving.problem import Problem
from octoctrl.planners.solving.search import Search
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.plants import make_plant
from octoctrl.sim.running.sensors import Sensors
from octoctrl.sim.scene.scene import Scene

from .. import tasks
from ..carrying.execution import execute
from ..carrying.planning import plan
from ..judging.verification import verify
from ..tables import Table
from .goals import NEW_KINDS, OLD_KINDS, Kind

TIME_LIMIT = 600.0
"""Wall-clock limit, s: what other work on the machine does to it shall not decide."""

COUNT, FULL_COUNT = 24, 200
"""Tasks of the old kinds, and as many of the new ones."""

AGAINST = (PlanStatus.OTHER_DRIVES, PlanStatus.UTURN, PlanStatus.NOT_FOUND)
"""Refusals by search, which prove nothing."""

SEARCHES = 4
"""Searches from other random programmes that a refusal has to withstand."""

FOLLOWED = ("twist", "coil", "coil-outward", "tip", "lm-helix", "packet", "corkscrew", "copy", "reach")
CONTROLLERS = ("open-loop", "tvlqr", "mpc")
AGAIN = "tvlqr, planning again"
"""Feedback that also plans again from the present state."""
DEAD = ("LM2", "R-OM")
"""Muscle groups that do nothing, one by one."""


def _ready() -> IdentifiedModel:
    """The built-in model of the rod, with compiled code loaded before anything is timed."""
    identified = load_identified(Arm.octopus(), Scene.free())
    planner.plan(tasks.load("coil").task, identified, time_limit=TIME_LIMIT)
    return identified


def _drawn(kinds: tuple[Kind, ...], count: int, seed: int, identified: IdentifiedModel) -> list[tuple[str, Task]]:
    draw = np.random.default_rng(seed)
    return [(kinds[index % len(kinds)].__name__, kinds[index % len(kinds)](draw, identified.model)) for index in range(count)]


def _unit(identified: IdentifiedModel) -> float:
    """Processor time of one step of the reduced model, s: what makes machines comparable."""
    levels = np.full((400, 11, identified.model.sections), 0.1)
    begin = process_time()
    identified.model.simulate(levels, np.full(400, 0.02))
    return (process_time() - begin) / 400


def goals_met(made: Plan, feedback: str, **settings: Any) -> tuple[bool, dict[str, float]]:
    """Whether all goals are met on the rod.

    Parameters
    ----------
    made : Plan
    feedback : str
        Name of a controller, or `AGAIN`.
    **settings
        Of `execute`.

    Returns
    -------
    bool
    dict of str to float
        Values of the verdict's checks by name, and the worst goal in tolerances as ``"worst"``.
    """
    again = feedback == AGAIN
    run = execute(made, feedback="tvlqr" if again else feedback, replan=again, **settings)
    checks = verify(run).checks
    goals = [check for check in checks if "." in check.name]
    values = {check.name: check.value for check in checks}
    values["worst"] = max((check.value / check.limit for check in goals), default=0.0)
    values["fallbacks"] = float(run.report.controller.fallbacks)
    values["replans"], values["followed"] = float(len(run.replans)), float(sum(item.status.solved for item in run.replans))
    return all(check.passed for check in goals), values


def withstands(made: Plan) -> bool:
    """Whether a refused plan's goals are missed, too, by searches from other random programmes, with its drives and away from a U-turn.

    Parameters
    ----------
    made : Plan

    Returns
    -------
    bool
    """
    problem = Problem(made.task, made.model)
    return not any(Search(problem, lambda: False, draw=draw).run(problem.start).solved for draw in range(1, SEARCHES + 1))


def plans(*, full: bool = False, count: int | None = None, seed: int = 7) -> Table:
    """Statuses, honesty and times of plans.

    Parameters
    ----------
    full : bool
        `FULL_COUNT` tasks of old and new kinds each.
    count : int, optional
        How many instead.
    seed : int

    Returns
    -------
    Table
    """
    identified, rows = _ready(), []
    number = _number(full, count)
    unit = _unit(identified)
    for kinds, label in ((OLD_KINDS, "old kinds"), (NEW_KINDS, "new kinds")):
        seen: dict[str, list[_Tried]] = {}
        for kind, task in _drawn(kinds, number, seed, identified):
            begin = process_time()
            made = planner.plan(task, identified, time_limit=TIME_LIMIT)
            found = _Tried.of(made, process_time() - begin)
            for name in (kind, label):
                seen.setdefault(name, []).append(found)
        rows += [_summary(name, group) for name, group in seen.items()]
    return Table(
        name="plans",
        title="Plans of random goals",
        note=f"{number} tasks of each, seed {seed}; a step of the reduced model takes {1e3 * unit:.3f} ms here. Right: neither "
        "called solved with a goal that the model misses at 10 ms (false), nor refused and then met by one of "
        f"{SEARCHES} searches from other programmes (missed). Met: all goals on the rod, in open loop and with feedback, of the plans "
        "that are solved for sure and of those in doubt.",
        columns=(
            "goals", "tasks", "solved", "in doubt", "other drives", "U-turn", "not found", "unreachable", "false", "missed", "right [%]",
            "P50 [s]", "P90 [s]", "max [s]", "sure, met open", "with feedback", "in doubt, met open", "with feedback ",
        ),
        formats=("", *["d"] * 9, ".1f", *[".2f"] * 3, *[""] * 4),
        rows=tuple(rows),
    )  # fmt: skip


def _number(full: bool, count: int | None) -> int:
    """How many tasks are drawn."""
    return (FULL_COUNT if full else COUNT) if count is None else count


class _Tried(NamedTuple):
    """A plan, the processor time that it took, whether it is refused though it can be met, and where it is met on the rod."""

    made: Plan
    seconds: float
    missed: bool
    met: tuple[bool, ...]

    @classmethod
    def of(cls, made: Plan, seconds: float) -> "_Tried":
        """Carry it out where it is solved, try it again where it is refused.

        Parameters
        ----------
        made : Plan
        seconds : float
            That planning took.

        Returns
        -------
        _Tried
        """
        met = tuple(goals_met(made, feedback)[0] for feedback in ("open-loop", "tvlqr")) if made.status.solved else ()
        return cls(made, seconds, made.status in AGAINST and not withstands(made), met)


def _summary(name: str, group: list[_Tried]) -> tuple[Any, ...]:
    status = Counter(item.made.status for item in group)
    solved = [item for item in group if item.made.status.solved]
    false = sum(item.made.report.worst is not None and item.made.report.worst.share > 1 for item in solved)
    missed = sum(item.missed for item in group)
    times = np.quantile([item.seconds for item in group], [0.5, 0.9, 1.0])
    met: list[str | None] = []
    for kind in (PlanStatus.SOLVED, PlanStatus.DOUBTFUL):
        of_kind = [item.met for item in solved if item.made.status is kind]
        met += [f"{sum(column)} of {len(of_kind)}" for column in zip(*of_kind, strict=True)] if of_kind else [None, None]
    counts = (PlanStatus.DOUBTFUL, *AGAINST, PlanStatus.UNREACHABLE)
    right = 100 * (1 - (false + missed) / len(group))
    return (name, len(group), len(solved), *(status[item] for item in counts), false, missed, right, *map(float, times), *met)


def choice(*, full: bool = False, count: int | None = None, seed: int = 7) -> Table:
    """Goals of the old kinds with drives given, and with none.

    Parameters
    ----------
    full : bool
        `FULL_COUNT` tasks.
    count : int, optional
        How many instead.
    seed : int

    Returns
    -------
    Table
    """
    identified = _ready()
    number = _number(full, count)
    seen: dict[str, list[tuple[Plan, Plan, float]]] = {}
    named = [*_drawn(OLD_KINDS, number, seed, identified), ("coil", tasks.load("coil").task)]
    for kind, task in named:
        given = planner.plan(task, identified, time_limit=TIME_LIMIT)
        begin = process_time()
        chosen = planner.plan(replace(task, drives="choose"), identified, time_limit=TIME_LIMIT)  # type: ignore[arg-type]
        found = given, chosen, process_time() - begin
        for name in (kind, "all"):
            seen.setdefault(name, []).append(found)
    rows = []
    for name, group in seen.items():
        solved = [(chosen, seconds) for given, chosen, seconds in group if given.status.solved]
        both = sum(chosen.status.solved for chosen, _ in solved)
        times = np.quantile([seconds for *_, seconds in group], [0.5, 0.9, 1.0])
        drives = [len(chosen.task.drives) for _, chosen, _ in group if chosen.status.solved]
        more = sum(chosen.status.solved and not given.status.solved for given, chosen, _ in group)
        rows.append((name, len(group), len(solved), both, more, float(np.mean(drives)) if drives else None, *map(float, times)))
    return Table(
        name="choice",
        title="Drives chosen by the planner",
        note=f"{number} tasks of the old kinds, seed {seed}, and the coil; a step of the reduced model takes "
        f"{1e3 * _unit(identified):.3f} ms here.",
        columns=("goals", "tasks", "solved with given drives", "of these with chosen", "others with chosen", "drives", "P50 [s]", "P90 [s]",
                 "max [s]"),
        formats=("", "d", "d", "d", "d", ".1f", ".2f", ".2f", ".2f"),
        rows=tuple(rows),
    )  # fmt: skip


def _mismatches(count: int, seed: int) -> list[dict[str, Any]]:
    """Plants that are not as planned: tissue within 30 %, muscles within 20 %, water up to twice as heavy."""
    draw = np.random.default_rng(seed)
    return [
        dict(zip(("tissue", "oblique", "longitudinal", "drag"), draw.uniform((0.7, 0.8, 0.8, 1.0), (1.3, 1.2, 1.2, 2.0)), strict=True))
        for _ in range(count)
    ]  # fmt: skip


def _other(arm: Arm, tissue: float, oblique: float, longitudinal: float, drag: float) -> Any:
    laws = {name: replace(getattr(arm, name), maximum_stress=factor * getattr(arm, name).maximum_stress)
            for name, factor in (("oblique", oblique), ("longitudinal", longitudinal))}  # fmt: skip
    made = replace(arm, youngs_modulus=tissue * arm.youngs_modulus, shear_modulus=tissue * arm.shear_modulus, **laws)
    return make_plant("rod", made, Scene.free(factor=drag))


def following(*, full: bool = False, count: int | None = None, seed: int = 7) -> Table:
    """The shipped tasks under every controller, on the plant as planned and as it is not.

    Parameters
    ----------
    full : bool
        32 plants that are not as planned.
    count : int, optional
        How many such plants instead.
    seed : int

    Returns
    -------
    Table
    """
    number = (32 if full else 6) if count is None else count
    rows: list[tuple[Any, ...]] = []
    made = {name: plan(name, time_limit=TIME_LIMIT) for name in FOLLOWED}
    seeing = {"as planned": None, "delay and noise": Sensors(delay=0.05, position_noise=5e-4, angle_noise=np.radians(1.0), seed=seed)}
    for name, found in made.items():
        for label, sensors in seeing.items():
            rows += [_followed(f"{name}, rod", label, found, feedback, sensors=sensors) for feedback in CONTROLLERS]
    coil = made["coil"]
    for group in DEAD:
        rows += [
            _followed("coil, rod", f"{group} dead", coil, feedback, plant=make_plant("rod", coil.arm, coil.scene, gains={group: 0.0}))
            for feedback in ("open-loop", "tvlqr", AGAIN)
        ]
    plants = _mismatches(number, seed)
    for feedback in (*CONTROLLERS, AGAIN):
        outcomes = []
        for index, changes in enumerate(plants):
            found = made[FOLLOWED[index % len(FOLLOWED)]]
            outcomes.append(goals_met(found, feedback, plant=_other(found.arm, **changes)))
        rows.append(_outcome("all, rod", "not as planned", feedback, outcomes))
    return Table(
        name="following",
        title="Following plans",
        note=f"{number} plants that are not as planned (E, G +- 30 %, muscles +- 20 %, drag x 1 to 2), seed {seed}, the tasks in turn. "
        "Delay and noise: 50 ms, 0.5 mm, 1 degree. Worst goal in tolerances, errors of the traces in turns, each the largest of the runs. "
        "Planned again: how often, and how often with a plan that met its goals on the model.",
        columns=("task", "plant", "feedback", "runs", "goals met", "worst goal", "writhe rms", "twist rms", "fallbacks", "planned again"),
        formats=("", "", "", "d", "d", ".2f", ".3f", ".3f", "d", ""),
        rows=tuple(rows),
    )


def _followed(task: str, label: str, found: Plan, feedback: str, **settings: Any) -> tuple[Any, ...]:
    return _outcome(task, label, feedback, [goals_met(found, feedback, **settings)])


def _outcome(task: str, label: str, feedback: str, outcomes: list[tuple[bool, dict[str, float]]]) -> tuple[Any, ...]:
    worst = [max(values[name] for _, values in outcomes) for name in ("worst", "writhe_rms", "twist_rms")]
    return (
        task,
        label,
        feedback,
        len(outcomes),
        sum(met for met, _ in outcomes),
        *worst,
        int(sum(values["fallbacks"] for _, values in outcomes)),
        f"{sum(values['replans'] for _, values in outcomes):.0f}, {sum(values['followed'] for _, values in outcomes):.0f}",
    )
