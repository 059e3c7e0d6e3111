"""Carry out a plan on the plant, with any controller, phase by phase; or go on with a run that was broken off."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from octoctrl.planners.contracts import Controller
from octoctrl.planners.following.controllers import controller
from octoctrl.planners.solving.grasping import is_simulated
from octoctrl.planners.solving.plan import Plan
from octoctrl.sim.contracts import Resumable
from octoctrl.sim.errors import OctoctrlError, check_kind, check_number
from octoctrl.sim.plants import PLANTS, make_plant, warmup
from octoctrl.sim.running.plant import Plant
from octoctrl.sim.running.sensors import Sensors
from octoctrl.sim.running.state_files import check_identity

from ..files.parts import Parts
from ..files.store import save
from ..progress import NullProgress, Progress
from .replanning import Replanner, Replanning
from .results import Execution, ExecutionStatus
from .run import GRACE, Run, Watch, name_of
from .run_parts import RunPart, RunStart

__all__ = ["GRACE", "PATIENCE", "PERIOD", "execute", "resume"]

PERIOD = 0.05
"""Time between corrections, s, of a plant that does not say its own."""

PATIENCE = 0.3
"""A phase whose goals are not met at its planned end is held for at most this share of its duration."""


def execute(
    plan: Plan,
    *,
    feedback: Any = None,
    plant: Any = None,
    period: float | None = None,
    patience: float | None = None,
    settle: float = 0.0,
    sensors: Sensors | None = None,
    allow_unsolved: bool = False,
    progress: Progress | None = None,
    path: str | Path | None = None,
    overwrite: bool = False,
    origin: Mapping[str, str] | None = None,
    watch: Watch | None = None,
    replan: Replanning | bool = False,
) -> Execution:
    """Carry out a plan.

    Parameters
    ----------
    plan : Plan
    feedback : {"tvlqr", "mpc", "grip", "open-loop"}, Controller or callable, optional
        The plan's own if omitted: a controller of `octoctrl.planners.following.controllers`, by name, or any object of its kind. A callable
        gets ``(time, observation)`` and returns the levels of the muscle groups: a dict of group to level, or an array (11,) or (11, n) in
        the order of `octoctrl.sim.body.arm.MUSCLE_GROUPS`. It replaces the plan's activation.
    plant : Plant or str, optional
        A plant, which is reset, or the name of one of `octoctrl.sim.plants.PLANTS` for the plan's arm and scene; the one that the plan
        was made for if omitted.
    period : float, optional, s
        Between corrections, shorter than the run; the plan's own if omitted, or else the usual one of the plant, or `PERIOD`.
    patience : float, optional
        The share of its duration for which a phase waits for its goals, as long as it does not get farther from them (see `GRACE`). If
        omitted, `PATIENCE`; nothing in open loop and for a callable.
    settle : float, s
        How long to go on after the last phase.
    sensors : Sensors, optional
        What is between the plant and the controller, which sees the arm as it is if omitted. Events are read on the plant.
    allow_unsolved : bool
        Whether a plan that does not meet its goals is run all the same.
    progress : Progress, optional
    path : str or Path, optional
        Where to keep the run. While it goes on it is there in parts, written about once per second: whatever kills it, `load` gives what
        was done, and `resume` goes on.
    overwrite : bool
        Whether a file that exists, or the parts of a run that was broken off, may be replaced.
    origin : mapping of str to str, optional
        For the header of the file; see `octoctrl.files.store.save`.
    watch : Watch, optional
        Who looks on and sets the pace, such as a live view, `octoctrl.View`.
    replan : Replanning or bool
        Whether is planned again from the present state where something calls for it, see `octoctrl.carrying.replanning.Replanning`; the
        plant stands still meanwhile, and `Execution.replans` tells. Needs feedback that has a name, and a plan that was not searched
        by simulating.

    Returns
    -------
    Execution
        Also when interrupted, unstable, or left by a controller that failed after the first period: with the recording up to the last
        good state, and a status that says so.

    Raises
    ------
    OctoctrlError
        If an argument is out of range or unknown, the plan is not solved, the plant is another arm than the plan's, or the path is no good.
    """
    check_kind("plan", plan, Plan, "what oc.plan gives, or oc.load of its file")
    if not plan.status.solved and not allow_unsolved:
        raise OctoctrlError(
            f"the plan of '{plan.task.name}' is not solved ({plan.status.name.lower()}); plan again, or pass allow_unsolved=True to run it "
            "all the same"
        )
    check_number("settle", settle, at_least=0.0, unit="s")
    if patience is not None:
        check_number("patience", patience, at_least=0.0)
    if period is not None:
        check_number("period", period, above=0.0, unit="s")
    chosen = controller(plan.feedback if feedback is None else feedback, plan)
    again = (Replanning() if replan is True else replan) or None
    replanner = None if again is None else _replanner(again, plan, _named(feedback, plan))
    if path is None:
        run = _run(plan, plant, chosen, progress, period, patience, settle, sensors, replanner)
        return run.to_the_end(progress or NullProgress(), watch=watch)
    with Parts(path, overwrite=overwrite) as parts:
        run = _run(plan, plant, chosen, progress, period, patience, settle, sensors, replanner)
        start = RunStart(
            plan=plan,
            plant=name_of(run.plant),
            feedback=chosen.name,
            controlled=_named(feedback, plan),
            identity=_identity(run.plant),
            period=run.period,
            patience=run.patience,
            settle=settle,
            sensors=run.eyes.sensors,
            time_step=run.plant.h,
            step_limit=run.plant.limit.mechanism,
            replan=again,
            origin=dict(origin or {}),
        )
        parts.append(start)
        return _kept(run, start, parts, progress, watch)


def resume(path: str | Path, *, feedback: Any = None, plant: Any = None, progress: Progress | None = None) -> Execution:
    """Go on with a run that was broken off or interrupted, with the bits that it would have had.

    Parameters
    ----------
    path : str or Path
        As `execute` was given it; the file is there at the end.
    feedback : Controller or callable, optional
        If it was an object: one made as that was, with `state` and `restore`. Of a callable it is taken that it remembers nothing.
    plant : Plant, optional
        If it was an object: one made as that was.
    progress : Progress, optional

    Returns
    -------
    Execution

    Raises
    ------
    OctoctrlError
        If there are no parts, another process writes them, or plant or feedback cannot go on.
    """
    with Parts(path, resume=True) as parts:
        start, *rest = parts.load()
        if not isinstance(start, RunStart) or not all(isinstance(part, RunPart) for part in rest):
            raise OctoctrlError(f"{parts.folder} holds no run, or is damaged")
        known = {"plant": start.plant in PLANTS, "feedback": bool(start.controlled)}
        for what, given in (("plant", plant), ("feedback", feedback)):
            if given is None and not known[what]:
                raise OctoctrlError(f"{path}: the run had a {what} of its own; give one that is made as that was, {what}=...")
        plan = start.plan
        chosen = controller(feedback or start.controlled, plan)
        replanner = None if start.replan is None else _replanner(start.replan, plan, start.controlled)
        run = _run(plan, plant or start.plant, chosen, progress, start.period, start.patience, start.settle, start.sensors, replanner)
        check_identity(path, start.identity, _identity(run.plant))
        for what, one, state in (("plant", run.plant, "plant"), ("feedback", chosen, "controller")):
            if rest and (not isinstance(one, Resumable) or getattr(rest[-1], state) is None):
                raise OctoctrlError(f"{path}: the {what} has no state() and restore(), so that the run cannot go on; run the plan anew")
        run.restore(rest)
        return _kept(run, start, parts, progress)


def _run(
    plan: Plan,
    plant: Any,
    chosen: Controller,
    progress: Progress | None,
    period: float | None,
    patience: float | None,
    settle: float,
    sensors: Sensors | None,
    replanner: Replanner | None = None,
) -> Run:
    """The run that is meant, not begun."""
    if plant is None or isinstance(plant, str):
        name = plan.plant if plant is None else plant
        warmup(name, progress)
        plant = make_plant(name, plan.arm, plan.scene)
    # Muscles may be other than planned, which is what feedback is for; another outline is another arm.
    if any(getattr(plant.arm, name) != getattr(plan.arm, name) for name in ("length", "base_radius", "taper")):
        plan.check_arm(plant.arm)
    period = next(item for item in (period, plan.period, getattr(plant, "period", PERIOD)) if item is not None)
    if abs(round(period / plant.sample_interval) * plant.sample_interval - period) > 1e-9:
        raise OctoctrlError(f"period={period:g} s: needs a multiple of the plant's sample interval {plant.sample_interval:g} s")
    total = plan.schedule.duration + settle
    if period >= total and chosen.name != "open-loop":
        raise OctoctrlError(
            f"period={period:g} s: feedback corrects once per period, and the run takes {total:g} s, so that it never would; give less, or "
            "feedback='open-loop'"
        )
    patience = getattr(chosen, "patience", PATIENCE) if patience is None else patience
    return Run(plan, plant, chosen, sensors or Sensors(), period=period, patience=patience, settle=settle, replanner=replanner)


def _replanner(settings: Replanning, plan: Plan, name: str) -> Replanner:
    """What plans again in place of a `plan`, and follows it with the controller of that `name`."""
    if is_simulated(plan.task):
        raise OctoctrlError(
            f"task '{plan.task.name}' is planned by simulating, from rest, and never in the middle of a run; leave replan out"
        )
    if not name:
        raise OctoctrlError("replan: a plan that is made in the middle of a run needs a controller of its own; give feedback by its name")
    return Replanner(settings, lambda plan: controller(name, plan))


def _kept(run: Run, start: RunStart, parts: Parts, progress: Progress | None, watch: Watch | None = None) -> Execution:
    """Carry it out; the file is there at the end. The parts of a run that was interrupted stay, to go on with."""
    execution = run.to_the_end(progress or NullProgress(), parts, watch)
    save(parts.path, execution, overwrite=True, origin=start.origin)
    if execution.status is not ExecutionStatus.INTERRUPTED:
        parts.finish()
    return execution


def _named(feedback: Any, plan: Plan) -> str:
    """The name by which the controller is made; empty for an object of the caller's."""
    asked = plan.feedback if feedback is None else feedback
    return asked if isinstance(asked, str) else ""


def _identity(plant: Any) -> dict[str, Any]:
    """What the plant must be that goes on with a run, as far as it says so."""
    if not isinstance(plant, Plant):
        return {"model": name_of(plant)}
    more = {"record_every": plant.record_every, "retrying": plant.automatic}
    return {**plant.identity(), **more, **{f"gain of {group}": gain for group, gain in plant.gains.items()}}
