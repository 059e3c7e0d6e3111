"""What the command line tells the program that called it."""

from enum import IntEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from octoctrl.planners.solving.plan import Plan

    from ..carrying.results import Execution, Verdict


class ExitCode(IntEnum):
    """Exit codes of every command."""

    WELL = 0
    VERDICT_FAILED = 1
    BAD_INPUT = 2
    NO_PLAN = 3
    UNSTABLE = 4
    CONTROLLER_FAILED = 5
    FAULT = 70
    """A mistake of ours; 70 as in sysexits.h."""
    INTERRUPTED = 130


def code_of_plan(plan: "Plan") -> ExitCode:
    """Whether the plan meets its goals."""
    return ExitCode.WELL if plan.status.solved else ExitCode.NO_PLAN


def code_of_run(execution: "Execution") -> ExitCode:
    """How the run ended."""
    name = execution.status.name
    return ExitCode.WELL if name == "FINISHED" else ExitCode[name]


def code_of_verdict(verdict: "Verdict") -> ExitCode:
    """Whether all checks passed."""
    return ExitCode.WELL if verdict.passed else ExitCode.VERDICT_FAILED
