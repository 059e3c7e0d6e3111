"""One run, period by period: the plant's time goes on, the plan's clock may wait, and parts of it are kept while it goes on."""

import traceback
from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from octoctrl.planners.asking.task import miss_in_phase
from octoctrl.planners.contracts import ClockReading, Controller, Observation
from octoctrl.planners.solving.plan import Plan
from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.contracts import Resumable
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.running.recording import Recording, StrandMotion
from octoctrl.sim.running.sensors import Sensors
from octoctrl.sim.topology.meter import Meter

from ..files.parts import Parts
from ..progress import Progress
from .replanning import Replanner
from .results import Event, Execution, ExecutionReport, ExecutionStatus, Replan
from .run_parts import RunPart

GRACE = 2
"""Periods before which a phase that waits is not yet expected to be nearer to its goals than at its planned end: corrections are led in
over one, and the arm's inertia takes its time."""

KEPT_EVERY, WRITING = 1.0, 9
"""Wall time (s) between two parts, and how many times as long as it took to write one."""


def _at_rest(observation: Observation) -> Recording:
    """The first instant as a recording, for a run that is cut short before it moves."""
    return Recording(
        time=np.array([observation.time]), points=observation.points[None], frames=observation.frames[None], stations=observation.stations,
        stretch=observation.stretch[None], levels=np.zeros((1, len(MUSCLE_GROUPS), len(observation.stretch))),
    )  # fmt: skip


class _ControllerFailedError(Exception):
    """The controller, or the activation that it gave, raised the cause of this."""


class Watch(Protocol):
    """Who looks on while a run goes on, such as `octoctrl.pictures.live.View`."""

    def begin(self, plan: Plan, plant: Any) -> None:
        """A `plan` is about to be carried out on a `plant`."""
        ...

    def see(self, plant: Any, clock: float) -> None:
        """A period of the `plant` is over, at the plan's `clock` (s); may wait, and end the run by a KeyboardInterrupt."""
        ...


class Run:
    """A plan that is carried out on a plant by a controller, which sees what the sensors show.

    Parameters
    ----------
    plan : Plan
    plant : PlantLike
    controller : Controller
    sensors : Sensors
    period, patience, settle : float
        As `octoctrl.carrying.execution.execute` takes them.
    replanner : Replanner, optional
        What plans again where something calls for it.
    """

    def __init__(
        self,
        plan: Plan,
        plant: Any,
        controller: Controller,
        sensors: Sensors,
        *,
        period: float,
        patience: float,
        settle: float,
        replanner: Replanner | None = None,
    ) -> None:
        self.replanner, self._first = replanner, plan
        self.plan, self.plant, self.controller, self.eyes = plan, plant, controller, sensors.start()
        self.period, self.patience, self.settle = period, patience, settle
        self.events: list[Event] = []
        self.pieces: list[Recording] = []
        self.strands: list[StrandMotion] = []
        self.meter = Meter(plan.task.convention)
        self.marks = [(0.0, 0.0)]  # the plant's time and the clock; pairs, because an interrupt may come between any two steps
        self.ahead, self.waited, self.missed = tuple(plan.phase_begins), 0.0, 0.0
        self.wall_time, self._written = 0.0, (0, 0, 1)  # and how many pieces, strands and marks are in parts
        self.ends = phase_ends(plan)

    def to_the_end(self, progress: Progress, parts: Parts | None = None, watch: Watch | None = None) -> Execution:
        """Go on until the plan is over or something stops it, telling `progress` and who keeps `watch`, and keep `parts` meanwhile."""
        begin, before, due = perf_counter(), self.wall_time, 0.0
        plant = self.plant
        status, note, cause = ExecutionStatus.FINISHED, "", ""
        if not self.pieces:
            self.eyes.see(plant.reset())
            self._keep_strands()
        observation, clock = self.eyes.shown, self.marks[-1][1]
        progress.start("running the plant", self.plan.schedule.duration + self.settle)
        if watch is not None:
            watch.begin(self.plan, plant)
        try:
            while (hold := self._waits(clock)) or clock < self.plan.schedule.duration + self.settle - 1e-9:
                step = self.period if hold else self._period(clock)
                reading = ClockReading(plant.time, clock, clock if hold else clock + step, step)
                piece = self._advance(observation, reading)
                self._keep(piece)
                self._keep_strands()
                clock, observation = reading.end, self.eyes.see(plant.observe())
                self.marks.append((plant.time, clock))
                if not piece.complete:
                    raise KeyboardInterrupt
                if self.replanner is not None:
                    reason = self.replanner.reason(self.plan, clock, self.meter.trace, self.controller.report())
                    self._plan_again(clock, reason)
                if watch is not None:
                    watch.see(plant, clock)
                progress.advance(clock, self.ahead[0] if self.ahead else "settling")
                now = perf_counter()
                self.wall_time = before + now - begin
                if parts is not None and now > due:
                    self._write(parts)
                    after = perf_counter()
                    due = after + max(KEPT_EVERY, WRITING * (after - now))
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
        self.wall_time = before + perf_counter() - begin
        return self._result(status, note, cause)

    def restore(self, parts: Sequence[RunPart]) -> None:
        """Go to where the last of some `parts` ended, whose plant, controller and sensors are as these were made."""
        if not parts:
            return
        last = parts[-1]
        if self.replanner is not None:
            self.replanner.done, self.replanner.dead = list(last.replans), dict(last.dead)
            if last.plan is not None:
                self._follow(last.plan)
        states: tuple[tuple[Any, Any], ...] = ((self.plant, last.plant), (self.controller, last.controller), (self.eyes, last.sensors))
        for one, state in states:
            one.restore(state)
        self.pieces = [Recording.joined([part.recording for part in parts])]
        self.strands = [part.strands for part in parts if part.strands is not None]
        self.meter.extend(self.pieces[0].time, self.pieces[0].points, self.pieces[0].frames)
        self.marks += [mark for part in parts for mark in part.marks]
        self.events, self.ahead, self.waited, self.missed = list(last.events), last.ahead, last.waited, last.missed
        self.wall_time, self._written = last.wall_time, (1, len(self.strands), len(self.marks))

    def _write(self, parts: Parts) -> None:
        pieces, strands, marks = self._written
        parts.append(
            RunPart(
                recording=Recording.joined(self.pieces[pieces:]),
                strands=StrandMotion.joined(self.strands[strands:]),
                marks=tuple(self.marks[marks:]),
                events=tuple(self.events),
                ahead=self.ahead,
                waited=self.waited,
                missed=self.missed,
                plant=_state(self.plant),
                controller=_state(self.controller),
                sensors=self.eyes.state(),
                wall_time=self.wall_time,
                report=self.controller.report(),
                plan=None if self.plan is self._first else self.plan,
                replans=self._replans,
                dead={} if self.replanner is None else self.replanner.dead,
            )
        )
        self._written = len(self.pieces), len(self.strands), len(self.marks)

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
            self.strands.append(
                StrandMotion(
                    time=np.array([self.plant.time]),
                    points={name: points[None].astype(np.float32) for name, (points, _) in found.items()},
                    radius={name: radius.astype(np.float32) for name, (_, radius) in found.items()},
                )
            )

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
        if miss > 1 and self.replanner is not None and self.replanner.settings.missed_goal:
            if self._plan_again(clock, f"phase '{name}' misses its goals by {miss:.1f} tolerances"):
                return False
        self.events.append(Event(phase=name, planned=float(self.ends[name]), actual=self.plant.time, met=miss <= 1))
        self.ahead, self.waited = self.ahead[1:], 0.0
        return False

    def _plan_again(self, clock: float, reason: str) -> bool:
        """Plan again from the present if there is a `reason`; whether there is a new plan to follow."""
        if not reason or self.replanner is None:
            return False
        found = self.replanner.plan(self.plan, self.ahead, self.eyes.shown, self.meter.trace, clock, reason)
        if found is None:
            return False
        self._follow(found)
        return True

    def _follow(self, plan: Plan) -> None:
        assert self.replanner is not None
        self.plan, self.controller, self.waited = plan, self.replanner.make(plan), 0.0
        self.ends = phase_ends(plan)

    @property
    def _replans(self) -> tuple[Replan, ...]:
        return () if self.replanner is None else tuple(self.replanner.done)

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

    def _result(self, status: ExecutionStatus, note: str, cause: str = "") -> Execution:
        if not self.pieces:
            self._keep(_at_rest(self.plant.observe()))
        recording = Recording.joined(self.pieces)
        recording = replace(recording, complete=status is ExecutionStatus.FINISHED, note=note)
        if len(self.meter.trace.time) != len(recording.time):  # an interrupt came between keeping and measuring
            self.meter = Meter(self.plan.task.convention)
            self.meter.extend(recording.time, recording.points, recording.frames)
        report = self.controller.report()
        if self.replanner is not None:
            report = replace(report, dead_groups={**self.replanner.dead, **report.dead_groups})
        return Execution(
            plan=self.plan,
            recording=recording,
            trace=self.meter.trace,
            clock=np.interp(recording.time, *np.array(self.marks).T),
            feedback=self.controller.name,
            report=ExecutionReport(
                wall_time=self.wall_time, time_step=self.plant.h, step_limit=self.plant.limit.mechanism, controller=report
            ),
            plant=name_of(self.plant),
            events=tuple(self.events),
            status=status,
            cause=cause,
            replans=self._replans,
            strands=StrandMotion.joined(self.strands),
        )


def phase_ends(plan: Plan) -> dict[str, float]:
    """When the phases of a `plan` end, s, by name."""
    return dict(zip(plan.phase_begins, [*list(plan.phase_begins.values())[1:], plan.schedule.duration], strict=True))


def name_of(plant: Any) -> str:
    """The name of a `plant`, also of one of the caller's own."""
    return getattr(plant, "model", type(plant).__name__)


def _state(one: object) -> Mapping[str, Any] | None:
    return one.state() if isinstance(one, Resumable) else None
