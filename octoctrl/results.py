"""What running a plan gives: an execution, and the verdict on it."""

from dataclasses import dataclass, field
from enum import Enum

from octoctrl.planners.plan import Plan
from octoctrl.sim.recording import Recording
from octoctrl.sim.trace import TopologyTrace


class ExecutionStatus(Enum):
    """How an execution ended; the value is a sentence that says what to do next."""

    FINISHED = "Finished: all phases were carried out; verify it."
    INTERRUPTED = "Interrupted: the recording holds everything up to the last chunk; run again to finish."
    UNSTABLE = "Unstable: the plant diverged; the recording holds the motion up to the last good state, the note says where and why."


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
class Execution:
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
        from .console import execution_text

        return execution_text(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One line of a verdict: a measured value against its limit."""

    name: str
    value: float
    limit: float
    passed: bool
    unit: str = ""

    @property
    def margin(self):
        """Distance to the limit in the value's unit; negative when the check failed."""
        return self.limit - self.value


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Checks measured on the plant.

    Attributes
    ----------
    checks : tuple of Check
    """

    checks: tuple[Check, ...]

    def __str__(self):
        from .console import verdict_text

        return verdict_text(self)

    @property
    def passed(self):
        """Whether every check passed."""
        return all(check.passed for check in self.checks)

    @property
    def status(self):
        """``"pass"`` or ``"fail"``."""
        return "pass" if self.passed else "fail"

    def raise_if_failed(self):
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
