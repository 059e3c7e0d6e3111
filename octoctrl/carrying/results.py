"""What running a plan gives: an execution, and the verdict on it."""

import importlib
from dataclasses import dataclass, field, fields, replace
from enum import Enum, StrEnum
from math import inf, isfinite
from typing import TYPE_CHECKING

import numpy as np

from octoctrl.planners.contracts import ControllerReport, Floats
from octoctrl.planners.solving.plan import Plan, PlanStatus
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.records import Record, check_shapes
from octoctrl.sim.running.recording import Recording, StrandMotion
from octoctrl.sim.scene.scene import self_contact
from octoctrl.sim.topology.trace import TopologyTrace

from ..tables import number, table

if TYPE_CHECKING:
    import xarray


class ExecutionStatus(Enum):
    """How an execution ended; the value is a sentence that says what to do next."""

    FINISHED = "Finished: all phases were carried out; verify it."
    INTERRUPTED = "Interrupted: the recording holds everything up to the last chunk; go on with it, or run again."
    UNSTABLE = "Unstable: the plant diverged; the recording holds the motion up to the last good state, the note says where and why."
    CONTROLLER_FAILED = "Controller failed: the recording holds everything up to the period in which it did; mend what the cause names."


class VerdictStatus(StrEnum):
    """What a verdict comes to."""

    PASS = "pass"
    FAIL = "fail"


class VerificationFailedError(RuntimeError):
    """A verdict was asked to be strict and a check did not pass."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """End of a phase: planned and actual time (s), and whether its goals had been met."""

    phase: str
    planned: float
    actual: float
    met: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Replan:
    """That was planned again in the middle of a run: when (s), at which reading of the clock (s), why, and how that ended.

    A plan that is not solved is not followed: the run goes on with the one before.
    """

    time: float
    clock: float
    reason: str
    status: PlanStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class ExecutionReport:
    """How an execution was computed.

    Attributes
    ----------
    wall_time : float, s
    time_step : float, s
        Of the plant.
    step_limit : str
        What would grow if the step were larger.
    controller : ControllerReport
    """

    wall_time: float
    time_step: float
    step_limit: str
    controller: ControllerReport = field(default_factory=ControllerReport)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Execution(Record):
    """A plan carried out on the plant.

    Attributes
    ----------
    plan : Plan
    recording : Recording
    trace : TopologyTrace
        Measured on the plant's centreline.
    clock : (T,) float64, s
        Reading of the plan's clock at the recorded times: it stands while a phase waits, and goes on when the plan is over.
    feedback : str
        Name of the controller.
    report : ExecutionReport
    plant : str
        Name of the plant: ``"rod"``, ``"assembly"`` or what a plant of one's own is called.
    events : tuple of Event
    status : ExecutionStatus
    cause : str
        Where a controller of one's own failed, as Python tells it; empty otherwise.
    replans : tuple of Replan
        How often was planned again, and why; `plan` is the last one that was followed.
    strands : StrandMotion, optional
        The rods of which the arm consists, at the ends of the periods; none where it is one rod.
    """

    plan: Plan
    recording: Recording
    trace: TopologyTrace
    clock: Floats
    feedback: str
    report: ExecutionReport
    plant: str = "rod"
    events: tuple[Event, ...] = ()
    status: ExecutionStatus = ExecutionStatus.FINISHED
    cause: str = ""
    replans: tuple[Replan, ...] = ()
    strands: StrandMotion | None = None

    def __post_init__(self) -> None:
        kept = self.recording.time
        check_shapes("run", {"clock": (self.clock, (len(kept),)), "trace": (self.trace.time, (len(kept),))})
        if not len(kept):
            raise OctoctrlError("run: nothing was recorded")

    def __str__(self) -> str:
        return execution_text(self)

    def _repr_html_(self) -> str:
        """Verdict and traces, for a notebook: the room of pictures, which stands above this one, is looked up when it is asked for."""
        shown: str = importlib.import_module("octoctrl.pictures.notebook").summary(self)
        return shown

    def to_xarray(self) -> "xarray.Dataset":
        """Recorded, measured and planned arrays with names, units and coordinates; needs the extra ``io``."""
        from ..files.netcdf import dataset

        return dataset(self)

    @property
    def planned(self) -> TopologyTrace:
        """The plan's trace at the clock's readings, over the recorded times; held at its end after the plan is over."""
        trace = self.plan.trace
        readings, place = np.unique(np.clip(self.clock, 0.0, trace.time[-1]), return_inverse=True)
        found = trace.at(readings)
        series = {item.name: getattr(found, item.name)[place] for item in fields(found) if item.name not in ("time", "convention")}
        return replace(found, time=self.recording.time, **series)

    @property
    def waited(self) -> float:
        """For how long phases waited for their goals, s."""
        return float(self.recording.time[-1] - self.clock[-1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One line of a verdict: a measured value against its limit.

    Attributes
    ----------
    name : str
    value, limit : float
        In `unit`; a value that is not a number passes no limit. What has an infinite limit is told, not judged.
    unit : str
    """

    name: str
    value: float
    limit: float
    unit: str = ""

    @property
    def passed(self) -> bool:
        """Whether the value is at most the limit."""
        return bool(self.value <= self.limit)

    @property
    def margin(self) -> float:
        """Distance to the limit in the value's unit; negative when the check failed."""
        return self.limit - self.value

    @property
    def judged(self) -> bool:
        """Whether there is a limit."""
        return self.limit < inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Checks measured on the plant.

    Attributes
    ----------
    checks : tuple of Check
        At least one: what was not measured is not passed.
    """

    checks: tuple[Check, ...]

    def __post_init__(self) -> None:
        if not self.checks:
            raise OctoctrlError("a verdict without checks says nothing; give at least one")

    def __str__(self) -> str:
        return verdict_text(self)

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(check.passed for check in self.checks)

    @property
    def status(self) -> VerdictStatus:
        """Pass or fail, as a word."""
        return VerdictStatus.PASS if self.passed else VerdictStatus.FAIL

    @property
    def count(self) -> tuple[int, int]:
        """How many checks passed, of how many: what has no limit is only told."""
        judged = [check.passed for check in self.checks if check.judged]
        return sum(judged), len(judged)

    def raise_if_failed(self) -> "Verdict":
        """Return the verdict if it passed.

        Raises
        ------
        VerificationFailedError
            Otherwise, naming the checks that failed.
        """
        failed = [f"{check.name} {check.value:.3g} > {check.limit:.3g}" for check in self.checks if not check.passed]
        if failed:
            raise VerificationFailedError("verification failed: " + ", ".join(failed))
        return self


def execution_text(run: Execution) -> str:
    """Say in a few lines how a plan was carried out.

    Parameters
    ----------
    run : Execution

    Returns
    -------
    str
    """
    recording, trace = run.recording, run.trace
    end = float(recording.time[-1])
    plant = run.plant if run.plant == run.plan.plant else f"{run.plant} (planned for {run.plan.plant})"
    what = f"run of '{run.plan.task.name}'   {end:.2f} s on arm {run.plan.arm.name}   plant {plant}   {self_contact(run.plan.scene)}"
    lines = [f"{what}   feedback {run.feedback}   simulated in {run.report.wall_time:.1f} s"]
    rows = [(event.phase, f"{event.planned:.2f} s", f"{event.actual:.2f} s", "met" if event.met else "not met") for event in run.events]
    lines += table(("phase", "planned end", "actual end", "goals"), rows) if rows else []
    last = f"twist {trace.twist[-1]:+.2f}   lifted writhe {trace.lifted_writhe[-1]:+.2f}   lifted link {trace.lifted_link[-1]:+.2f}"
    lines.append(
        f" at the end: {last}   net self-crossings {int(trace.net_crossings()[-1]):+d}   peak activation {recording.levels.max():.2f}"
    )
    if margins := run.report.controller.margins:
        lines.append(
            f" feedback withstands, by its linear model: gains x {1 / margins['gain']:.2f} to {margins['gain']:.2f}, phase "
            f"{np.degrees(margins['phase']):.0f} deg, {1e3 * margins['delay']:.0f} ms of delay; level 0.1 of disturbance moves twist and "
            f"writhe by {0.1 * margins['induced gain']:.2f} turns at most (rms over the plan)"
        )
    for group, when in run.report.controller.dead_groups.items():
        lines.append(f" {group} does nothing: it was activated and the arm did not answer; found at {when:.2f} s")
    for again in run.replans:
        lines.append(f" planned again at {again.time:.2f} s, for {again.reason}: {again.status.name.lower().replace('_', ' ')}")
    if recording.finer:
        lines.append(f" {recording.finer} samples were done at a half or a quarter of the step: at the whole they would have stopped")
    lines.append(f" {run.status.value}" + (f" ({recording.note})" if recording.note else ""))
    return "\n".join(lines)


def verdict_text(verdict: Verdict) -> str:
    """Write a verdict as a table.

    Parameters
    ----------
    verdict : Verdict

    Returns
    -------
    str
    """
    rows = []
    for check in verdict.checks:
        unit = f" {check.unit}" if check.unit else ""
        value, limit = (f"{number(item)}{unit}" if isfinite(item) else "never" for item in (check.value, check.limit))
        margin, said = number(check.margin) if isfinite(check.margin) else "", "pass" if check.passed else "FAIL"
        rows.append((check.name, value, limit, margin, said) if check.judged else (check.name, value, "", "", ""))
    good, judged = verdict.count
    return "\n".join([*table(("check", "value", "limit", "margin", ""), rows), f" VERDICT {verdict.status} ({good}/{judged})"])
