"""Carry out a plan on the plant, open loop or with feedback, phase by phase."""

from dataclasses import fields, replace
from time import perf_counter

import numpy as np

from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError, suggest
from octoctrl.sim.plants import make_plant, warmup
from octoctrl.sim.running.recording import Recording

from ..progress import NullProgress
from .results import Event, Execution, ExecutionStatus

FEEDBACKS = ("open-loop", "tvlqr")

PERIOD, PERIODS = 0.05, {"assembly": 0.025, "assembly-coarse": 0.025}
"""Time between corrections, s: the full arm, which its reduced model describes less well, is corrected more often."""

PATIENCE = 0.3
"""A phase whose goals are not met at its planned end is held for at most this share of its duration."""


def execute(plan, *, feedback="tvlqr", plant=None, period=None, patience=None, settle=0.0, progress=None, checkpoint=None):
    """Carry out a plan.

    Parameters
    ----------
    plan : Plan
    feedback : {"tvlqr", "open-loop"} or callable
        A callable gets ``(time, observation)`` and returns the levels of the muscle groups: a dict of group to level, or an array (11,)
        or (11, n) in the order of `octoctrl.sim.body.arm.MUSCLE_GROUPS`. It replaces the plan's activation.
    plant : Plant or {"rod", "assembly", "assembly-coarse"}, optional
        A plant, which is reset, or the name of one for the plan's arm and scene; the one that the plan was made for if omitted.
    period : float, optional, s
        Between corrections; `PERIOD`, or that of the plant in `PERIODS`, if omitted.
    patience : float, optional
        With feedback, the share of its duration for which a phase waits for its goals; `PATIENCE` if omitted.
    settle : float, s
        How long to go on after the last phase.
    progress : Progress, optional
    checkpoint : callable, optional
        Called with the partial `Execution` after each chunk, about once per second of wall time.

    Returns
    -------
    Execution
        Also when interrupted or unstable: with the recording up to the last good state, and a status that says so.

    Raises
    ------
    OctoctrlError
        If the feedback or the plant's name is unknown, or the plant is another arm than the plan's.
    """
    if plant is None or isinstance(plant, str):
        name = plan.plant if plant is None else plant
        warmup(name, progress)
        plant = make_plant(name, plan.arm, plan.scene)
    # Muscles may be other than planned, which is what feedback is for; another outline is another arm.
    if any(getattr(plant.arm, name) != getattr(plan.arm, name) for name in ("length", "base_radius", "taper")):
        plan.check_arm(plant.arm)
    if period is None:
        period = PERIODS.get(_name(plant), PERIOD)
    run = _Run(plan, plant, _controller(plan, feedback, period), period, settle)
    run.patience = (PATIENCE if patience is None else patience) if feedback == "tvlqr" else 0.0
    return run.to_the_end(progress or NullProgress(), checkpoint)


def _controller(plan, feedback, period):
    if callable(feedback):
        return _Custom(feedback)
    if feedback not in FEEDBACKS:
        raise OctoctrlError(f"unknown feedback '{feedback}'{suggest(str(feedback), FEEDBACKS)} ({', '.join(FEEDBACKS)}, or a callable)")
    if feedback == "open-loop":
        return _OpenLoop(plan)
    return _Feedback(plan, period)


class _Levels:
    """The plan's activation on the phase clock plus a correction that is linear in time over one period."""

    def __init__(self, activation, real, clock, groups=(), before=0.0, after=0.0, period=1.0):
        self.activation, self.real, self.clock = activation, real, clock
        self.groups, self.before, self.after, self.period = groups, before, after, period

    def levels(self, times, edges):
        """Levels (T, 11, n) at the plant's times."""
        share = (times - self.real) / self.period
        # While a phase waits, the clock stands: `clock` holds the clock's reading at the period's begin and end.
        levels = self.activation.levels(self.clock[0] + share * (self.clock[1] - self.clock[0]), edges)
        if self.groups:
            correction = self.before + np.clip(share, 0.0, 1.0)[:, None] * (self.after - self.before)
            levels[:, [MUSCLE_GROUPS.index(group) for group in self.groups]] += correction[:, :, None]
            np.clip(levels, 0.0, 1.0, out=levels)
        return levels


class _OpenLoop:
    name = "open-loop"

    def __init__(self, plan):
        self.activation = plan.schedule.activation()

    def levels(self, observation, real, clock, period):
        return _Levels(self.activation, real, clock, period=period)

    def statistics(self):
        return {}


class _Feedback:
    name = "tvlqr"

    def __init__(self, plan, period):
        from octoctrl.planners.following.tracking import Tracker, design

        begin = perf_counter()
        self.activation = plan.schedule.activation()
        self.model, self.period, self.pole = plan.model, period, plan.task.convention.pole
        self.tracker = Tracker(design(plan, self.model, period))
        self.groups = self.tracker.design.groups
        self.correction = np.zeros(len(self.groups))
        self.largest, self.fit = 0.0, None
        self.design_time = perf_counter() - begin

    def levels(self, observation, real, clock, period):
        from octoctrl.sim.topology.measures import present

        if self.fit is None:
            self.fit = self.model.strain_fit(observation.stations)
        before = self.correction
        strains = self.fit(observation.frames, observation.stretch)
        topology = present(observation.points, observation.frames, self.pole)
        self.correction = self.tracker.correct(round(clock[0] / self.period), strains, topology)
        self.largest = max(self.largest, float(np.abs(self.correction).max()))
        return _Levels(self.activation, real, clock, self.groups, before, self.correction, period)

    def statistics(self):
        errors = dict(zip((*self.groups, "drag"), self.tracker.errors.round(3).tolist(), strict=True))
        return {"largest_correction": self.largest, "estimated_errors": errors, "design_time": self.design_time}


class _Custom:
    def __init__(self, function):
        self.function = function
        self.name = getattr(function, "__name__", type(function).__name__)

    def levels(self, observation, real, clock, period):
        answer = self.function(real, observation)
        if isinstance(answer, dict):
            unknown = next((group for group in answer if group not in MUSCLE_GROUPS), None)
            if unknown is not None:
                raise OctoctrlError(
                    f"feedback returned a level for '{unknown}'{suggest(unknown, MUSCLE_GROUPS)} ({', '.join(MUSCLE_GROUPS)})"
                )
            answer = [answer.get(group, 0.0) for group in MUSCLE_GROUPS]
        count, elements = len(MUSCLE_GROUPS), len(observation.stretch)
        try:
            levels = np.asarray(answer, dtype=float)
        except (TypeError, ValueError):
            raise OctoctrlError(
                f"feedback returned {type(answer).__name__} {answer!r}; (11,), (11, n) or a dict of group to level is needed"
            ) from None
        if levels.shape not in ((count,), (count, 1), (count, elements)):
            raise OctoctrlError(
                f"feedback returned levels of shape {levels.shape}; (11,), (11, n) or a dict of group to level is needed, n = {elements}"
            )
        return _Constant(np.broadcast_to(levels.reshape(count, -1), (count, elements)))

    def statistics(self):
        return {}


class _Constant:
    def __init__(self, held):
        self.held = held

    def levels(self, times, edges):
        return np.repeat(self.held[None], len(times), axis=0)


def _name(plant):
    return getattr(plant, "model", type(plant).__name__)


def _at_rest(observation):
    """The first instant as a recording, for a run that is cut short before it moves."""
    return Recording(
        time=np.array([observation.time]), points=observation.points[None], frames=observation.frames[None], stations=observation.stations,
        stretch=observation.stretch[None], levels=np.zeros((1, len(MUSCLE_GROUPS), len(observation.stretch))),
    )  # fmt: skip


def _planned(trace, clock, time):
    """The plan's trace at readings of the phase clock, which may stand, as a trace over the plant's time."""
    readings, place = np.unique(np.clip(clock, 0.0, trace.time[-1]), return_inverse=True)
    found = trace.at(readings)
    series = {item.name: getattr(found, item.name)[place] for item in fields(found) if item.name not in ("time", "convention")}
    return replace(found, time=time, **series)


class _Run:
    """One execution, period by period: real time goes on, the phase clock may wait."""

    def __init__(self, plan, plant, controller, period, settle):
        self.plan, self.plant, self.controller, self.period, self.settle = plan, plant, controller, period, settle
        self.patience = 0.0
        self.events, self.pieces = [], []
        self.instants, self.readings = [0.0], [0.0]
        self.ahead, self.waited = tuple(plan.phase_begins), 0.0
        self.ends = dict(zip(self.ahead, [*list(plan.phase_begins.values())[1:], plan.schedule.duration], strict=True))

    def to_the_end(self, progress, checkpoint):
        begin, due = perf_counter(), 0.0
        plan, plant = self.plan, self.plant
        status, note = ExecutionStatus.FINISHED, ""
        observation, clock, end = plant.reset(), 0.0, plan.schedule.duration + self.settle
        progress.start("running the plant", end)
        try:
            while (hold := self._waits(clock)) or clock < end - 1e-9:
                step = self.period if hold else self._period(clock)
                reading = (clock, clock if hold else clock + step)
                levels = self.controller.levels(observation, plant.time, reading, step)
                piece = plant.advance(levels, step)
                self.pieces.append(piece)
                clock, observation = reading[1], plant.observe()
                self.instants.append(plant.time)
                self.readings.append(clock)
                if not piece.complete:
                    raise KeyboardInterrupt
                progress.advance(clock, self.ahead[0] if self.ahead else "settling")
                if checkpoint is not None and (now := perf_counter()) > due:
                    checkpoint(self._result(ExecutionStatus.INTERRUPTED, "still running", now - begin))
                    # A long recording takes its time to be measured: a tenth of the run's at most.
                    after = perf_counter()
                    due = after + max(1.0, 9 * (after - now))
        except KeyboardInterrupt:
            status, note = ExecutionStatus.INTERRUPTED, f"interrupted at t={plant.time:.2f} s"
        except PlantUnstableError as error:
            status, note = ExecutionStatus.UNSTABLE, str(error)
            if error.recording is not None and len(error.recording.time):
                self.pieces.append(error.recording)
        finally:
            progress.stop()
        return self._result(status, note, perf_counter() - begin)

    def _waits(self, clock):
        """Whether the clock stands because the phase that should end now has not met its goals; a phase that ends leaves its event."""
        if not self.ahead or clock < self.ends[self.ahead[0]] - 1e-9:
            return False
        name = self.ahead[0]
        met = self._met(name)
        if not met and self.waited < self.patience * (self.ends[name] - self.plan.phase_begins[name]) - 1e-9:
            self.waited += self.period
            return True
        self.events.append(Event(phase=name, planned=float(self.ends[name]), actual=self.plant.time, met=met))
        self.ahead, self.waited = self.ahead[1:], 0.0
        return False

    def _period(self, clock):
        """To the next multiple of the period on the clock, or the end; whole samples."""
        sample = self.plant.sample_interval
        end = min((np.floor(clock / self.period + 1e-6) + 1) * self.period, self.plan.schedule.duration + self.settle)
        return max(round((end - clock) / sample), 1) * sample

    def _met(self, phase):
        """Whether the goals of a phase hold on the plant now."""
        from octoctrl.sim.topology.measures import measure

        goals = next(item.goals for item in self.plan.task.phases if item.name == phase)
        if not goals:
            return True
        ends = Recording.joined(self.pieces)
        trace = measure(ends.time, ends.points, ends.frames, self.plan.task.convention)
        values = {"twist": trace.twist[-1], "lifted_writhe": trace.lifted_writhe[-1], "length": ends.length[-1]}
        values["lifted_link"] = values["twist"] + values["lifted_writhe"]
        return all(abs(values[goal.quantity] - goal.value) <= goal.tolerance for goal in goals)

    def _result(self, status, note, wall_time):
        from octoctrl.sim.topology.measures import measure

        recording = Recording.joined(self.pieces or [_at_rest(self.plant.observe())])
        recording = replace(recording, complete=status is ExecutionStatus.FINISHED, note=note)
        clock = np.interp(recording.time, self.instants, self.readings)
        convention = self.plan.task.convention
        trace = measure(recording.time, recording.points, recording.frames, convention)
        simulated = float(recording.time[-1])
        return Execution(
            plan=self.plan, recording=recording, trace=trace, planned=_planned(self.plan.trace, clock, recording.time),
            feedback=self.controller.name, plant=_name(self.plant), events=tuple(self.events), status=status,
            statistics={
                "wall_time": wall_time,
                "speed": simulated / wall_time if wall_time > 0 else 0.0,
                "time_step": self.plant.h,
                "step_limit": self.plant.limit.mechanism,
                "largest_level": float(recording.levels.max()),
                "waited": float(recording.time[-1] - clock[-1]),
                **self.controller.statistics(),
            },
        )  # fmt: skip
