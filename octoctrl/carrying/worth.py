"""What a recording is worth: by how many tolerances it misses the goals of a phase, and what that costs in a search.

A miss says whether a goal is met, at the instants at which it has to hold. A price leads a search there: it looks at what came before the
end as well, a goal may say its own, which has a slope where the miss has none, and what sinks into an object too deep costs besides.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.planners.asking.goals.touching import log_share
from octoctrl.planners.asking.task import Phase, Task, miss_in_phase
from octoctrl.planners.contracts import When
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.contact.surroundings import PREFIX, Touch
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.topology.meter import Meter
from octoctrl.sim.topology.trace import TopologyTrace

LOOKED_AT = 0.4
"""Time before the end of a phase that a search looks at at least, s, so that what is still moving shows."""

DEEP, DEEP_PRICE = 1e-3, 1e3
"""Depth of contact from which on it costs, m, and what each metre more does: real ones are ten times smaller."""

ENOUGH = 0.15
"""Price of a goal that needs no bettering, unless it says one."""


def misses(phase: Phase, recording: Recording, arm: Arm, task: Task) -> tuple[float, ...]:
    """By how many tolerances each goal of a `phase` of a `task` is missed on the `recording` of it, with this `arm`."""
    begin, end = float(recording.time[0]), float(recording.time[-1])
    trace = trace_of(recording, task) if any(not getattr(goal, "simulated", False) for goal in phase.goals) else None
    found = []
    for goal in phase.goals:
        missed = goal.miss(recording, trace, arm)  # type: ignore[arg-type]  # none where nobody reads it
        found.append(miss_in_phase(goal, recording.time, missed, begin, end) / goal.tolerance)
    return tuple(found)


def price_of(parts: Iterable[tuple[Phase, Recording]], arm: Arm, task: Task) -> float:
    """What the goals of some phases of a `task` cost, and what sinks in too deep.

    Parameters
    ----------
    parts : iterable of (Phase, Recording)
        Each phase, and what is of it.
    arm : Arm
    task : Task
    """
    price, depth = 0.0, 0.0
    for phase, part in parts:
        windows: dict[float, RecordedOutputs] = {}
        for goal in phase.goals:
            begin = 0.0 if goal.when is When.THROUGHOUT else float(part.time[-1]) - max(goal.hold, LOOKED_AT)
            if begin not in windows:
                windows[begin] = RecordedOutputs(since(part, begin), None, arm)
            price += _price(goal, windows[begin], task)
        depth = max([depth, *(float(touch.deepest.max()) for touch in touches(part).values())])
    return price + DEEP_PRICE * max(depth - DEEP, 0.0)


def _price(goal: Any, outputs: RecordedOutputs, task: Task) -> float:
    """What a `goal` of a `task` costs on the `outputs` of the instants that are looked at.

    Its own price, or the logarithm of its largest miss in tolerances.
    """
    own: Callable[[RecordedOutputs], float] | None = getattr(goal, "price", None)
    if own is not None:
        return own(outputs)
    return log_share(goal.miss(outputs.recording, trace_of(outputs.recording, task), outputs.arm), goal.tolerance)


def enough_of(phases: Iterable[Phase]) -> float:
    """Price of the goals of some `phases` that needs no bettering."""
    return sum(float(getattr(goal, "enough", ENOUGH)) for phase in phases for goal in phase.goals)


def touches(recording: Recording) -> dict[str, Touch]:
    """All objects of a `recording`, by name."""
    names = [name.removeprefix(PREFIX) for name in recording.series if name.startswith(PREFIX)]
    return {name: Touch.of(recording.series, name) for name in names}


def since(recording: Recording, time: float) -> Recording:
    """What of a `recording` is from a `time` on, s."""
    keep = recording.time >= time - 1e-9
    names = ("time", "points", "frames", "stretch", "levels")
    series = {name: values[keep] for name, values in recording.series.items()}
    return replace(recording, **{name: getattr(recording, name)[keep] for name in names}, series=series)


def trace_of(recording: Recording, task: Task) -> TopologyTrace:
    """Link, writhe and twist on a `recording`, as the `task` measures them."""
    meter = Meter(task.convention)
    meter.extend(recording.time, recording.points, recording.frames)
    return meter.trace
