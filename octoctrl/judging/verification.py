"""The verdict: what was planned against what the plant did, check by check.

Nothing here is predicted: every value is measured on the plant's recording, by the formula that also made the planned trace.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields
from math import inf

import numpy as np

from octoctrl.planners.asking.task import miss_in_phase
from octoctrl.planners.solving.grasping import is_simulated
from octoctrl.sim.errors import check_kind, check_number

from ..carrying.holding import LINK_RESIDUAL, holding_checks
from ..carrying.results import Check, Execution, ExecutionStatus, Verdict
from .comparison import level_delays, planned_points, rms


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of a verdict, each a number from 0 on; the tolerances of the goals are the task's.

    Attributes
    ----------
    writhe_rms, writhe_max : float, turns
        Error of lifted writhe against the plan, over the run.
    twist_rms : float, turns
        Error of twist against the plan, over the run.
    level_time : float, s
        Difference of the times at which plan and plant pass from one phase's level to the next.
    crossings : int
        Difference of the net number of self-crossings.
    link_residual : float, turns
        Link minus (writhe + twist): two independent measurements of one thing.
    activation : float
        Largest level.
    tip_rms : float, arm lengths
        Distance of the tip from the planned one.
    volume, slab_volume : float
        Largest change of the volume of the whole arm, and of any slab between two rings, as a share of that at rest; of plants that record
        it.
    """

    writhe_rms: float = 0.05
    writhe_max: float = 0.15
    twist_rms: float = 0.05
    level_time: float = 0.3
    crossings: int = 0
    link_residual: float = LINK_RESIDUAL
    activation: float = 1.0
    tip_rms: float = 0.08
    volume: float = 0.03
    slab_volume: float = 0.05

    def __post_init__(self) -> None:
        for item in fields(self):
            check_number(f"limit {item.name}", getattr(self, item.name), at_least=0.0)


def verify(execution: Execution, *, limits: Limits | None = None, strict: bool = False) -> Verdict:
    """Check an execution against its plan and its task.

    Parameters
    ----------
    execution : Execution
    limits : Limits, optional
    strict : bool
        Whether a failed check raises.

    Returns
    -------
    Verdict
        That the run came to its end, then the goals, the errors of the traces, and the health of the simulation. Of a task about what the
        arm touches, how it is held in place of the errors of the traces: there the plan is a simulation itself.

    Raises
    ------
    VerificationFailedError
        If `strict` and a check failed.
    """
    check_kind("execution", execution, Execution, "what oc.execute gives, or oc.load of its file")
    limits = Limits() if limits is None else limits
    check_kind("limits", limits, Limits)
    measured, planned = execution.trace, execution.planned
    writhe = measured.lifted_writhe - planned.lifted_writhe
    twist = measured.twist - planned.twist
    crossings = abs(int(measured.net_crossings()[-1]) - int(planned.net_crossings()[-1]))
    unfinished = len(execution.plan.task.phases) - len(execution.events)
    checks = [
        _check("unfinished_phases", unfinished, 0),
        _check("stopped", execution.status is not ExecutionStatus.FINISHED, 0),
        *_goal_checks(execution),
    ]
    health = [
        _check("link_residual", np.abs(measured.residual).max(), limits.link_residual, "turns"),
        _check("activation", execution.recording.levels.max(), limits.activation),
    ]
    if is_simulated(execution.plan.task):
        checks += [*holding_checks(execution.plan.task, execution.plan.arm, execution.recording, measured), *health]
        return _judged(checks, strict)
    checks += [
        _check("writhe_rms", rms(writhe), limits.writhe_rms, "turns"),
        _check("writhe_max", np.abs(writhe).max(), limits.writhe_max, "turns"),
        _check("twist_rms", rms(twist), limits.twist_rms, "turns"),
        _check("crossings", crossings, limits.crossings),
        _check("level_time", max(level_delays(execution).values(), default=0.0), limits.level_time, "s"),
        *health,
    ]
    points = planned_points(execution.plan, execution.clock)
    if points is not None:
        distance = np.linalg.norm(execution.recording.tip - points[:, -1], axis=1) / execution.plan.arm.length
        checks.append(_check("tip_rms", rms(distance), limits.tip_rms, "lengths"))
    for name in ("volume", "slab_volume"):
        if name in execution.recording.series:
            checks.append(_check(name, np.abs(execution.recording.series[name] - 1).max(), getattr(limits, name)))
    return _judged(checks, strict)


def _judged(checks: list[Check], strict: bool) -> Verdict:
    verdict = Verdict(checks=tuple(checks))
    return verdict.raise_if_failed() if strict else verdict


def _goal_checks(execution: Execution) -> Iterator[Check]:
    plan, recording = execution.plan, execution.recording
    ends = {event.phase: event.actual for event in execution.events}
    begin = 0.0
    for phase in plan.task.phases:
        end = ends.get(phase.name, inf)
        seen: Counter[str] = Counter()
        for goal in phase.goals:
            seen[goal.quantity] += 1
            name = f"{phase.name}.{goal.quantity}" + (f"[{seen[goal.quantity]}]" if seen[goal.quantity] > 1 else "")
            miss = inf
            if end < inf:
                miss = miss_in_phase(goal, recording.time, goal.miss(recording, execution.trace, plan.arm), begin, end)
            yield _check(name, miss, goal.tolerance, goal.unit)
        begin = end


def _check(name: str, value: float, limit: float, unit: str = "") -> Check:
    return Check(name=name, value=float(value), limit=float(limit), unit=unit)
