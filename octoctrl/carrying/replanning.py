"""Planning again in the middle of a run: what calls for it, what is left of the task, and the plan that goes on where the old one ended.

The plan's clock goes on. What the muscles were told before the new plan stays told, and falls off under it: drives that still act are taken
up again by drives of their own, from the level that they have.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from octoctrl.planners.asking.choice import Choice
from octoctrl.planners.asking.task import Drive, Task
from octoctrl.planners.contracts import Controller, ControllerReport, Observation
from octoctrl.planners.fitting.identified import IdentifiedModel, unidentified
from octoctrl.planners.solving.plan import Plan
from octoctrl.planners.solving.present import Present
from octoctrl.sim.errors import OctoctrlError, check_number
from octoctrl.sim.topology.trace import TopologyTrace

from .results import Replan

RELAXES = 1.0
"""Time in which what the muscles were told before falls off, s."""

REPEATED = 3
"""Periods in a row for which an error must be there before it counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Replanning:
    """What makes a run plan again.

    Attributes
    ----------
    dead_group : bool
        When feedback names a muscle group that does nothing; the new plan does without it.
    missed_goal : bool
        When a phase has ended without its goals, waiting included: it is tried once more.
    error : float, turns
        When lifted writhe or twist are off the plan by more, for longer than feedback needs.
    most : int
        How often at most.
    time_limit : float, s
        Wall clock of each planning, for which the plant stands still.

    Raises
    ------
    OctoctrlError
        If a number is out of range.
    """

    dead_group: bool = True
    missed_goal: bool = True
    error: float = 0.3
    most: int = 3
    time_limit: float = 30.0

    def __post_init__(self) -> None:
        for name in ("error", "time_limit"):
            check_number(name, getattr(self, name), above=0.0)
        check_number("most", self.most, at_least=0)


class Replanner:
    """Watches a run, and plans again.

    Parameters
    ----------
    settings : Replanning
    make : callable
        From a plan to the controller that follows it.

    Attributes
    ----------
    done : list of Replan
    dead : dict of str to float
        Muscle groups that do nothing, and when that was known, s.
    """

    def __init__(self, settings: Replanning, make: Callable[[Plan], Controller]) -> None:
        self.settings, self.make = settings, make
        self.done, self.dead, self._off = list[Replan](), dict[str, float](), 0

    def reason(self, plan: Plan, clock: float, trace: TopologyTrace, report: ControllerReport) -> str:
        """Why to plan again at the `clock` (s) of a `plan`, by the measured `trace` and the controller's `report`; mostly empty."""
        settings, now = self.settings, float(np.clip(clock, 0.0, plan.trace.time[-1]))
        off = {
            name: float(getattr(trace, name)[-1] - np.interp(now, plan.trace.time, getattr(plan.trace, name)))
            for name in ("lifted_writhe", "twist")
        }
        worst = max(off, key=lambda name: abs(off[name]))
        self._off = self._off + 1 if abs(off[worst]) > settings.error else 0
        fresh = {group: when for group, when in report.dead_groups.items() if group not in self.dead}
        self.dead |= fresh
        if fresh and settings.dead_group:
            return f"{' and '.join(fresh)} {'does' if len(fresh) == 1 else 'do'} nothing"
        if self._off >= REPEATED:
            return f"{worst.replace('_', ' ')} is {abs(off[worst]):.2f} turns off the plan"
        return ""

    def plan(
        self, old: Plan, ahead: Sequence[str], observation: Observation, trace: TopologyTrace, clock: float, reason: str
    ) -> Plan | None:
        """A plan that goes on from what is seen, or None if there is none, or there have been enough of them.

        Parameters
        ----------
        old : Plan
        ahead : sequence of str
            Phases that have not ended.
        observation : Observation
        trace : TopologyTrace
            Measured.
        clock : float, s
        reason : str

        Returns
        -------
        Plan or None
        """
        if len(self.done) >= self.settings.most or not ahead:
            return None
        self._off = 0
        found = planned_again(old, clock, ahead, observation, float(trace.lifted_writhe[-1]), tuple(self.dead), self.settings.time_limit)
        self.done.append(Replan(time=float(trace.time[-1]), clock=clock, reason=reason, status=found.status))
        return found if found.status.solved else None


def planned_again(plan: Plan, clock: float, ahead: Sequence[str], observation: Observation, lifted_writhe: float, dead: Sequence[str],
                  time_limit: float) -> Plan:  # fmt: skip
    """A plan for what is left of a plan's task, from what is seen.

    Parameters
    ----------
    plan : Plan
    clock : float, s
        Its reading.
    ahead : sequence of str
        Phases that have not ended; the first begins anew.
    observation : Observation
    lifted_writhe : float, turns
        Of the arm now.
    dead : sequence of str
        Muscle groups that do nothing.
    time_limit : float, s

    Returns
    -------
    Plan
        Of the whole task, with the old plan's motion up to now; solved or not.

    Raises
    ------
    OctoctrlError
        If the plan's drives are not told by its task, as of one made by hand.
    """
    from octoctrl.planners.solving import planner

    if len(plan.task.drives) != len(plan.schedule.primitives):
        raise OctoctrlError(f"the plan of '{plan.task.name}' has primitives that its task does not name; it cannot be planned again")
    model = replace(plan.model, gains={**plan.model.gains, **dict.fromkeys(dead, 0.0)})
    task, before, begun = _left(plan, clock, ahead)
    present = Present(strains=model.strains(observation), lifted_writhe=lifted_writhe, before=before, clock=clock)
    identified = _identified(plan, model)
    # What is left of the present phase, and of drives that have begun, stands in the task already.
    planned = {name: number for name, number in plan.report.numbers.items() if name != f"{ahead[0]}.duration"}
    found = planner.plan(task, identified, start=planned, present=present, time_limit=time_limit)
    if not found.status.solved and dead and task.drives:
        found = planner.plan(replace(task, drives=(), choose=Choice()), identified, present=present, time_limit=time_limit)
    return _joined(plan, found, begun, ahead)


def _identified(plan: Plan, model: Any) -> IdentifiedModel:
    return unidentified(model, plan.plant) if plan.identified is None else replace(plan.identified, model=model)


def _left(plan: Plan, clock: float, ahead: Sequence[str]) -> tuple[Task, tuple[Any, ...], tuple[Drive, ...]]:
    """What is left of a plan's task, what the muscles were told before, and the drives that told them."""
    phases = [phase for phase in plan.task.phases if phase.name in ahead]
    edges = [*plan.phase_begins.values(), plan.schedule.duration]
    ends = dict(zip(plan.phase_begins, edges[1:], strict=True))
    left = ends[phases[0].name] - clock
    phases[0] = replace(phases[0], duration=float(np.clip(left if left > phases[0].shortest else phases[0].duration,
                                                          phases[0].shortest, phases[0].longest)))  # fmt: skip
    before, begun, drives = list[Any](), list[Drive](), list[Drive]()
    primitives: Sequence[Any] = plan.schedule.primitives  # with an onset and mostly an offset, which the contract leaves open
    for drive, primitive in zip(plan.task.drives, primitives, strict=True):
        if drive.begins in ahead[1:]:
            drives.append(drive)
            continue
        if primitive.onset >= clock:  # put off, and not begun yet
            drives.append(replace(drive, begins=ahead[0], delay=primitive.onset - clock))
            continue
        begun.append(drive)
        if not hasattr(primitive, "rise"):  # a wave that is on its way runs on
            before.append(primitive)
            continue
        before.append(replace(primitive, offset=min(primitive.offset, clock), fall=primitive.fall if primitive.offset < clock else RELAXES))
        if primitive.offset > clock:
            again: Any = replace(primitive, onset=0.0, offset=np.inf)
            name = f"{drive.name.partition(' from ')[0]} from {clock:.2f} s"
            drives.append(replace(drive, name=name, primitive=again, begins=ahead[0], ends=drive.ends if drive.ends in ahead[1:] else "",
                                  delay=0.0, free=tuple(dict.fromkeys(number for number in drive.free if number != "delay"))))  # fmt: skip
    # Where all drives are waves that run on by themselves, others may do what these have not.
    choose = plan.task.choose if drives else Choice()
    return replace(plan.task, phases=tuple(phases), drives=tuple(drives), choose=choose), tuple(before), tuple(begun)


def _joined(old: Plan, new: Plan, begun: Sequence[Drive], ahead: Sequence[str]) -> Plan:
    """One plan on one clock: the old one's motion, then the new one's."""
    kept = old.time < new.since - 1e-9
    series: Mapping[str, Any] = {
        item.name: np.concatenate([getattr(old.trace, item.name)[kept], getattr(new.trace, item.name)])
        for item in fields(TopologyTrace)
        if item.name != "convention"
    }
    fresh = {phase.name: phase for phase in new.task.phases}
    phases = tuple(fresh.get(phase.name, phase) for phase in old.task.phases)
    return replace(
        new,
        task=replace(new.task, phases=phases, drives=(*begun, *new.task.drives), choose=None),
        phase_begins={name: new.phase_begins[name] if name in ahead[1:] else begin for name, begin in old.phase_begins.items()},
        time=np.concatenate([old.time[kept], new.time]),
        strains=np.concatenate([old.strains[kept], new.strains]),
        trace=replace(new.trace, **series),
        plant=old.plant,
        feedback=old.feedback,
        period=old.period,
    )
