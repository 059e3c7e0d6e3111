"""What the command line says. Results go to standard output, as text or as JSON; progress and complaints go to standard error."""

import json
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from ..progress import NullProgress, Progress, RichProgress

if TYPE_CHECKING:
    from octoctrl.planners.solving.plan import Plan

    from ..carrying.results import Execution, Verdict


def say(text: str) -> None:
    """Say something that is no result; what steers a terminal, such as a name out of a stranger's file, is left out."""
    print("".join(letter if letter.isprintable() or letter == "\n" else "?" for letter in text), file=sys.stderr)


def report(item: object, content: Any, as_json: bool) -> None:
    """Print a result: `item` for people, or `content` as JSON."""
    if as_json:
        print_json(content)
    else:
        print(item)


def print_json(content: Any) -> None:
    """Print plain data; numbers that are infinite or undefined become null."""
    from ..tables import plain

    print(json.dumps(plain(content), indent=2))


def display(quiet: bool) -> Progress:
    """Live progress, or none."""
    return NullProgress() if quiet else RichProgress()


def plan_content(plan: "Plan") -> dict[str, Any]:
    """What a program wants to know of a plan."""
    goals = [
        {"phase": item.phase, "quantity": item.goal.quantity, "goal": str(item.goal), "miss": item.miss}
        | {"tolerance": item.goal.tolerance, "unit": item.goal.unit}
        for item in plan.report.goals
    ]
    return {
        "status": plan.status.name.lower(),
        "message": plan.status.value,
        "plant": plan.plant,
        "duration": plan.schedule.duration,
        "phase_begins": plan.phase_begins,
        "report": asdict(plan.report) | {"goals": goals},
    }


def run_content(execution: "Execution") -> dict[str, Any]:
    """What a program wants to know of a run."""
    return {
        "status": execution.status.name.lower(),
        "message": execution.status.value,
        "feedback": execution.feedback,
        "plant": execution.plant,
        "duration": float(execution.recording.time[-1]),
        "events": [{"phase": e.phase, "planned": e.planned, "actual": e.actual, "met": e.met} for e in execution.events],
        "report": asdict(execution.report) | {"waited": execution.waited, "cause": execution.cause},
    }


def verdict_content(verdict: "Verdict") -> dict[str, Any]:
    """What a program wants to know of a verdict."""
    checks = [
        {"name": c.name, "value": c.value, "limit": c.limit, "margin": c.margin, "unit": c.unit, "pass": c.passed} for c in verdict.checks
    ]
    return {"status": verdict.status, "checks": checks}
