"""What running a plan gives: an execution, and the verdict on it."""

from dataclasses import dataclass, field
from enum import Enum, StrEnum
from math import isfinite

from octoctrl.planners.solving.plan import Plan
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.records import Record
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.topology.trace import TopologyTrace

from ..tables import number, table


class ExecutionStatus(Enum):
    """How an execution ended; the value is a sentence that says what to do next."""

    FINISHED = "Finished: all phases were carried out; verify it."
    INTERRUPTED = "Interrupted: the recording holds everything up to the last chunk; run again to finish."
    UNSTABLE = "Unstable: the plant diverged; the recording holds the motion up to the last good state, the note says where and why."


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Execution(Record):
    """A plan carried out on the plant.

    Attributes
    ----------
    plan : Plan
    recording : Recording
    trace : TopologyTrace
        Measured on the plant's centreline.
    planned : TopologyTrace
        The plan's trace at the recorded times (held at its end after the plan is over).
    feedback : str
        ``"open-loop"``, ``"tvlqr"`` or the name of the callable.
    plant : str
        Name of the plant: ``"rod"``, ``"assembly"`` or what a plant of one's own is called.
    events : tuple of Event
    status : ExecutionStatus
    statistics : dict
        Wall time, simulated seconds per second, time step and its binding limit, largest feedback correction and the like.
    """

    plan: Plan
    recording: Recording
    trace: TopologyTrace
    planned: TopologyTrace
    feedback: str
    plant: str = "rod"
    events: tuple[Event, ...] = ()
    status: ExecutionStatus = ExecutionStatus.FINISHED
    statistics: dict = field(default_factory=dict)

    def __str__(self):
        return execution_text(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One line of a verdict: a measured value against its limit.

    Attributes
    ----------
    name : str
    value, limit : float
        In `unit`; a value that is not a number passes no limit.
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


def execution_text(run):
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
    rate = run.statistics.get("wall_time")
    speed = f"   simulated in {rate:.1f} s" if isinstance(rate, int | float) else ""
    plant = run.plant if run.plant == run.plan.plant else f"{run.plant} (planned for {run.plan.plant})"
    lines = [f"run of '{run.plan.task.name}'   {end:.2f} s on arm {run.plan.arm.name}   plant {plant}   feedback {run.feedback}{speed}"]
    rows = [(event.phase, f"{event.planned:.2f} s", f"{event.actual:.2f} s", "met" if event.met else "not met") for event in run.events]
    lines += table(("phase", "planned end", "actual end", "goals"), rows) if rows else []
    last = f"twist {trace.twist[-1]:+.2f}   lifted writhe {trace.lifted_writhe[-1]:+.2f}   lifted link {trace.lifted_link[-1]:+.2f}"
    lines.append(
        f" at the end: {last}   net self-crossings {int(trace.net_crossings()[-1]):+d}   peak activation {recording.levels.max():.2f}"
    )
    lines.append(f" {run.status.value}" + (f" ({recording.note})" if recording.note else ""))
    return "\n".join(lines)


def verdict_text(verdict):
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
        numbers = [f"{number(value)}{unit}" if isfinite(value) else "never" for value in (check.value, check.limit)]
        rows.append((check.name, *numbers, number(check.margin) if isfinite(check.margin) else "", "pass" if check.passed else "FAIL"))
    good = sum(check.passed for check in verdict.checks)
    return "\n".join([*table(("check", "value", "limit", "margin", ""), rows), f" VERDICT {verdict.status} ({good}/{len(verdict.checks)})"])
