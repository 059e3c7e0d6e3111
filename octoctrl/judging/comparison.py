"""Planned against simulated: aligned traces, errors, and where the planned arm is."""

from dataclasses import dataclass
from math import inf, isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from octoctrl.planners.solving.plan import Plan
from octoctrl.sim.errors import OctoctrlError, check_kind
from octoctrl.sim.records import Record
from octoctrl.sim.topology.trace import TopologyTrace

from ..carrying.results import Execution, ExecutionStatus
from ..tables import table

Floats = NDArray[np.float64]

QUANTITIES = ("lifted_link", "lifted_writhe", "twist")
"""What is compared: the smooth quantities, in turns."""

LEAST_STEP = 0.2
"""Change of a quantity over a phase, turns, from which on its passing is an event that is timed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Comparison(Record):
    """A plan and its execution, at the same times.

    Attributes
    ----------
    execution : Execution
    time : (T,) float64, s
    planned, simulated : TopologyTrace
    errors : dict of str to (T,) float64, turns
        Simulated minus planned, of each of `QUANTITIES`.
    tip_distance : (T,) float64, m
        Between the planned and the simulated tip; empty if the plan carries no shape.
    delays : dict of str to float, s
        See `level_delays`.
    """

    execution: Execution
    time: Floats
    planned: TopologyTrace
    simulated: TopologyTrace
    errors: dict[str, Floats]
    tip_distance: Floats
    delays: dict[str, float]

    def summary(self) -> dict[str, float]:
        """Errors as numbers.

        Returns
        -------
        dict of str to float
            Root mean square and maximum of each quantity (turns), of the tip (m), and the largest delay (s).
        """
        numbers = {}
        for quantity, error in self.errors.items():
            numbers[f"{quantity}_rms"], numbers[f"{quantity}_max"] = rms(error), float(np.abs(error).max())
        if self.tip_distance.size:
            numbers["tip_rms"], numbers["tip_max"] = rms(self.tip_distance), float(self.tip_distance.max())
        numbers["level_time"] = max(self.delays.values(), default=0.0)
        return numbers

    def __str__(self) -> str:
        return comparison_text(self)


def compare(execution: Execution, *, overlap: bool = False) -> Comparison:
    """Put planned and simulated traces side by side.

    Parameters
    ----------
    execution : Execution
    overlap : bool
        Whether a run that was cut short is compared over the time that both cover.

    Returns
    -------
    Comparison

    Raises
    ------
    OctoctrlError
        If the run was cut short and `overlap` is false.
    """
    check_kind("execution", execution, Execution, "what oc.execute gives, or oc.load of its file")
    duration, end = execution.plan.schedule.duration, float(execution.recording.time[-1])
    if execution.status is not ExecutionStatus.FINISHED and not overlap:
        raise OctoctrlError(
            f"planned trace covers 0–{duration:.1f} s, simulated 0–{end:.1f} s (run stopped early: {execution.status.name.lower()}); "  # noqa: RUF001
            f"comparing 0–{min(duration, end):.1f} s needs overlap=True"  # noqa: RUF001
        )
    points = planned_points(execution.plan, execution.clock)
    distance = np.empty(0) if points is None else np.linalg.norm(execution.recording.tip - points[:, -1], axis=1)
    return Comparison(
        execution=execution,
        time=execution.trace.time,
        planned=execution.planned,
        simulated=execution.trace,
        errors={name: getattr(execution.trace, name) - getattr(execution.planned, name) for name in QUANTITIES},
        tip_distance=distance,
        delays=level_delays(execution),
    )


def level_delays(execution: Execution) -> dict[str, float]:
    """By how much the plant passes levels earlier or later than the plan, on the plan's clock.

    A level lies midway between the planned values at a phase's begin and end, where those differ by at least 0.2 turns.

    Parameters
    ----------
    execution : Execution

    Returns
    -------
    dict of str to float, s
        By ``"phase.quantity"``; infinite where the plant never passes.
    """
    plan, delays = execution.plan, dict[str, float]()
    begins = [*plan.phase_begins.values(), plan.schedule.duration]
    for quantity in ("lifted_writhe", "twist"):
        values = np.interp(begins, plan.trace.time, getattr(plan.trace, quantity))
        for index, phase in enumerate(plan.phase_begins):
            before, after = values[index], values[index + 1]
            if abs(after - before) < LEAST_STEP or begins[index] >= execution.clock[-1]:
                continue
            level, upward = (before + after) / 2, after > before
            wanted = _passages(plan.trace, quantity, level, upward)
            wanted = wanted[wanted >= begins[index]]  # the first lies in the phase, at whose end the level is passed
            # Phases that wait are not late: what counts is the clock's reading.
            found = np.interp(_passages(execution.trace, quantity, level, upward), execution.recording.time, execution.clock)
            delays[f"{phase}.{quantity}"] = float(np.abs(found - wanted[0]).min()) if found.size and wanted.size else inf
    return delays


def planned_points(plan: Plan, times: Floats) -> Floats | None:
    """Where the plan has the arm.

    Parameters
    ----------
    plan : Plan
    times : (T,) float64, s
        On the plan's clock. The shape is held at its end after the plan is over.

    Returns
    -------
    (T, n + 1, 3) float64, m, or None if the plan carries no shape
    """
    strains = planned_strains(plan, times)
    return None if strains is None else plan.model.points(strains)


def planned_strains(plan: Plan, times: Floats) -> Floats | None:
    """The strains (T, S, 4) of a `plan` at `times`, as `planned_points` takes them; None if it carries no shape."""
    if not plan.strains.size:
        return None
    when = np.clip(times, plan.time[0], plan.time[-1])
    flat = plan.strains.reshape(len(plan.time), -1)
    return np.stack([np.interp(when, plan.time, column) for column in flat.T], axis=1).reshape(len(when), *plan.strains.shape[1:])


def rms(values: ArrayLike) -> float:
    """Root mean square of `values`."""
    return float(np.sqrt(np.mean(np.square(values))))


def _passages(trace: TopologyTrace, quantity: str, level: float, upward: bool) -> Floats:
    """Times at which a quantity passes `level` in one direction, interpolated linearly."""
    values = (getattr(trace, quantity) - level) * (1 if upward else -1)
    index = np.flatnonzero((values[:-1] < 0) & (values[1:] >= 0))
    return trace.time[index] - values[index] * (trace.time[index + 1] - trace.time[index]) / (values[index + 1] - values[index])


def comparison_text(comparison: Comparison) -> str:
    """Write the errors of a run against its plan, a `comparison`, as a table."""
    numbers = comparison.summary()
    rows = [
        (name.replace("_", " "), f"{numbers[f'{name}_rms']:.4f} turns", f"{numbers[f'{name}_max']:.4f} turns") for name in comparison.errors
    ]
    if "tip_rms" in numbers:
        rows.append(("tip", f"{1e3 * numbers['tip_rms']:.2f} mm", f"{1e3 * numbers['tip_max']:.2f} mm"))
    lines = table(("simulated - planned", "rms", "max"), rows)
    if comparison.delays:
        delays = [(key, f"{delay:.2f} s" if isfinite(delay) else "never") for key, delay in comparison.delays.items()]
        lines += ["", *table(("level passed", "time error"), delays)]
    return "\n".join(lines)
