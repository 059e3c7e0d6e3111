"""Carry out a plan on the plant, with any controller, phase by phase: the plant's time goes on, the plan's clock may wait."""

import traceback
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from octoctrl.planners.asking.task import miss_in_phase
from octoctrl.planners.contracts import ClockReading, Controller, Observation
from octoctrl.planners.following.controllers import controller
from octoctrl.planners.solving.plan import Plan
from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError, check_number
from octoctrl.sim.plants import make_plant, warmup
from octoctrl.sim.running.recording import Recording, StrandMotion
from octoctrl.sim.running.sensors import Sensors
from octoctrl.sim.topology.meter import Meter

from ..progress import NullProgress, Progress
from .results import Event, Execution, ExecutionReport, ExecutionStatus

PERIOD = 0.05
"""Time between corrections, s, of a plant that does not say its own."""

PATIENCE = 0.3
"""A phase whose goals are not met at its planned end is held for at most this share of its duration."""

GRACE = 2
"""Periods before which a phase that waits is not yet expected to be nearer to its goals than at its planned end: corrections are led in
over one, and the arm's inertia takes its time."""


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
    checkpoint: Callable[[Execution], Any] | None = None,
) -> Execution:
    """Carry out a plan.

    Parameters
    ----------
    plan : Plan
    feedback : {"tvlqr", "open-loop"}, Controller or callable, optional
        The plan's own if omitted: a controller of `octoctrl.planners.following.controllers`, by name, or any object of its kind. A callable
        gets ``(time, observation)`` and returns the levels of the muscle groups: a dict of group to level, or an array (11,) or (11, n) in
        the order of `octoctrl.sim.body.arm.MUSCLE_GROUPS`. It replaces the plan's activation.
    plant : Plant or {"rod", "assembly", "assembly-coarse"}, optional
        A plant, which is reset, or the name of one for the plan's arm and scene; the one that the plan was made for if omitted.
    period : float, optional, s
        Between corrections; the plan's own if omitted, or else the usual one of the plant, or `PERIOD`.
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
    checkpoint : callable, optional
        Called with the partial `Execution` after each chunk, about once per second of wall time.

    Returns
    -------
    Execution
        Also when interrupted, unstable, or left by a controller that failed after the first period: with the recording up to the last
        good state, and a status that says so.

    Raises
    ------
    OctoctrlError
        If an argument is out of range or unknown, the plan is not solved, or the plant is another arm than the plan's.
    """
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
    patience = getattr(chosen, "patience", PATIENCE) if patience is None else patience
    run = _Run(plan, plant, chosen, sensors or Sensors(), period=period, patience=patience, settle=settle)
    return run.to_the_end(progress or NullProgress(), checkpoint)


def _name(plant: Any) -> str:
    return getattr(plant, "model", type(plant).__name__)


def _at_rest(observation: Observation) -> Recording:
    """The first instant as a recording, for a run that is cut short before it moves."""
    return Recording(
        time=np.array([observation.time]), points=observation.points[None], frames=observation.frames[None], stations=observation.stations,
        stretch=observation.stretch[None], levels=np.zeros((1, len(MUSCLE_GROUPS), len(observation.stretch))),
    )  # fmt: skip


def _strand_motion(kept: list[tuple[float, dict[str, Any]]]) -> StrandMotion | None:
    """Of pairs of time and what `octoctrl.sim.running.plant.Plant.strands` gave then; None of none."""
    if not kept:
        return None
    return StrandMotion(
        time=np.array([time for time, _ in kept]),
        points={name: np.stack([rods[name][0] for _, rods in kept]).astype(np.float32) for name in kept[0][1]},
        radius={name: radius.astype(np.float32) for name, (_, radius) in kept[0][1].items()},
    )


class _ControllerFailedError(Exception):
    """The controller, or the activation that it gave, raised the cause of this."""


class _Run:
    """One execution, period by period: the plant's time goes on, the plan's clock may wait."""

    def __init__(
        self, plan: Plan, plant: Any, controller: Controller, sensors: Sensors, *, period: float, patience: float, settle: float
    ) -> None:
        self.plan, self.plant, self.controller, self.eyes = plan, plant, controller, sensors.start()
        self.period, self.patience, self.settle = period, patience, settle
        self.events: list[Event] = []
        self.pieces: list[Recording] = []
        self.strands: list[tuple[float, dict[str, Any]]] = []
        self.meter = Meter(plan.task.convention)
        self.marks = [(0.0, 0.0)]  # the plant's time and the clock; pairs, because an interrupt may come between any two steps
        self.ahead, self.waited, self.missed = tuple(plan.phase_begins), 0.0, 0.0
        self.ends = dict(zip(self.ahead, [*list(plan.phase_begins.values())[1:], plan.schedule.duration], strict=True))

    def to_the_end(self, progress: Progress, checkpoint: Callable[[Execution], Any] | None) -> Execution:
        begin, due = perf_counter(), 0.0
        plan, plant = self.plan, self.plant
        status, note, cause = ExecutionStatus.FINISHED, "", ""
        observation, clock, end = self.eyes.see(plant.reset()), 0.0, plan.schedule.duration + self.settle
        self._keep_strands()
        progress.start("running the plant", end)
        try:
            while (hold := self._waits(clock)) or clock < end - 1e-9:
                step = self.period if hold else self._period(clock)
                reading = ClockReading(plant.time, clock, clock if hold else clock + step, step)
                piece = self._advance(observation, reading)
                self._keep(piece)
                self._keep_strands()
                clock, observation = reading.end, self.eyes.see(plant.observe())
                self.marks.append((plant.time, clock))
                if not piece.complete:
                    raise KeyboardInterrupt
                progress.advance(clock, self.ahead[0] if self.ahead else "settling")
                if checkpoint is not None and (now := perf_counter()) > due:
                    checkpoint(self._result(ExecutionStatus.INTERRUPTED, "still running", now - begin))
                    # A long recording takes its time to be written: a tenth of the run's at most.
                    after = perf_counter()
                    due = after + max(1.0, 9 * (after - now))
        except KeyboardInterrupt:
            status, note = ExecutionStatus.INTERRUPTED, f"interrupted at t={plant.time:.2f} s"
        except PlantUnstableError as error:
            status, note = ExecutionStatus.UNSTABLE, str(error)
            if error.recording is not None and len(error.recording.time):
                self._keep(error.recording)
        except _ControllerFailedError as failure:
            fault = failure.__cause__ or failure
            if not self.pieces:
                raise fault from None
            status, cause = ExecutionStatus.CONTROLLER_FAILED, "".join(traceback.format_exception(fault))
            note = f"controller '{self.controller.name}' failed at t={plant.time:.2f} s: {type(fault).__name__}: {fault}"
        finally:
            progress.stop()
        return self._result(status, note, perf_counter() - begin, cause)

    def _advance(self, observation: Observation, reading: ClockReading) -> Recording:
        try:
            return self.plant.advance(self.controller.levels(observation, reading), reading.period)
        except PlantUnstableError:
            raise
        except Exception as error:
            raise _ControllerFailedError from error

    def _keep(self, piece: Recording) -> None:
        self.pieces.append(piece)
        self.meter.extend(piece.time, piece.points, piece.frames)

    def _keep_strands(self) -> None:
        """A plant of one's own need not have any."""
        found: dict[str, Any] = getattr(self.plant, "strands", dict)()
        if found:
            self.strands.append((self.plant.time, found))

    def _waits(self, clock: float) -> bool:
        """Whether the clock stands because the phase that should end now has not met its goals; a phase that ends leaves its event."""
        if not self.ahead or clock < self.ends[self.ahead[0]] - 1e-9:
            return False
        name = self.ahead[0]
        miss = self._miss(name)
        if not self.waited:
            self.missed = miss
        longest = self.patience * (self.ends[name] - self.plan.phase_begins[name])
        hopeful = miss <= self.missed or self.waited < (GRACE - 0.5) * self.period
        if miss > 1 and hopeful and self.waited < longest - 1e-9:
            self.waited += self.period
            return True
        self.events.append(Event(phase=name, planned=float(self.ends[name]), actual=self.plant.time, met=miss <= 1))
        self.ahead, self.waited = self.ahead[1:], 0.0
        return False

    def _period(self, clock: float) -> float:
        """To the next multiple of the period on the clock, or the end; whole samples."""
        sample = self.plant.sample_interval
        end = min((np.floor(clock / self.period + 1e-6) + 1) * self.period, self.plan.schedule.duration + self.settle)
        return float(max(round((end - clock) / sample), 1) * sample)

    def _miss(self, phase: str) -> float:
        """By how many tolerances the goals of a phase are missed on the plant now, at most."""
        goals = next(item.goals for item in self.plan.task.phases if item.name == phase)
        recording, trace, arm = Recording.joined(self.pieces), self.meter.trace, self.plan.arm
        begin, now = self.events[-1].actual if self.events else 0.0, recording.time[-1]
        shares = (miss_in_phase(goal, recording.time, goal.miss(recording, trace, arm), begin, now) / goal.tolerance for goal in goals)
        return max(shares, default=0.0)

    def _result(self, status: ExecutionStatus, note: str, wall_time: float, cause: str = "") -> Execution:
        if not self.pieces:
            self._keep(_at_rest(self.plant.observe()))
        recording = Recording.joined(self.pieces)
        recording = replace(recording, complete=status is ExecutionStatus.FINISHED, note=note)
        if len(self.meter.trace.time) != len(recording.time):  # an interrupt came between keeping and measuring
            self.meter = Meter(self.plan.task.convention)
            self.meter.extend(recording.time, recording.points, recording.frames)
        return Execution(
            plan=self.plan,
            recording=recording,
            trace=self.meter.trace,
            clock=np.interp(recording.time, *np.array(self.marks).T),
            feedback=self.controller.name,
            report=ExecutionReport(
                wall_time=wall_time, time_step=self.plant.h, step_limit=self.plant.limit.mechanism, controller=self.controller.report()
            ),
            plant=_name(self.plant),
            events=tuple(self.events),
            status=status,
            cause=cause,
            strands=_strand_motion(self.strands),
        )
