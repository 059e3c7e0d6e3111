"""Where and when which muscles were active, of a run beside another, with what came of it: the same plan on two plants, or two plans."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from octoctrl.planners.asking.goals.covered_winding import CoveredWindingGoal
from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.planners.asking.goals.touching import hold_in
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS
from octoctrl.sim.errors import OctoctrlError

from ..carrying.results import Execution
from ..files.writing import check_target, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

FINE = 200
"""Pixels along the arm."""
_COLOURS = {"twist": "#D55E00", "lifted writhe": "#0072B2", "covered winding": "#009E73"}
_STYLES = ("-", "--", ":")


def activation_maps(executions: Execution | Sequence[Execution], path: str | Path, *, overwrite: bool = False) -> "Figure":
    """Draw the activations of runs over time and arclength, and beneath them twist, lifted writhe and covered winding of all.

    Parameters
    ----------
    executions : Execution or sequence of up to 3 Execution
        Such as a plan on the plant on which it was searched, and on the one that it is for.
    path : str or Path
        Of the picture: .png, .pdf or .svg.
    overwrite : bool

    Returns
    -------
    Figure

    Raises
    ------
    OctoctrlError
        If there are none or more than three, or the path is no good.
    """
    from matplotlib.figure import Figure

    runs = [executions] if isinstance(executions, Execution) else list(executions)
    if not 1 <= len(runs) <= len(_STYLES):
        raise OctoctrlError(f"{len(runs)} runs are to be drawn beside each other; give one to {len(_STYLES)}")
    path = check_target(path, overwrite=overwrite, suffixes=(".png", ".pdf", ".svg"))
    figure = Figure(figsize=(4.2 * len(runs) + 0.6, 6.4), layout="constrained")
    grid = figure.add_gridspec(3, len(runs), height_ratios=(1.0, 0.6, 1.0))
    for column, run in enumerate(runs):
        upper, lower = figure.add_subplot(grid[0, column]), figure.add_subplot(grid[1, column])
        _bend_map(upper, run)
        _twist_map(lower, run)
        upper.set_title(f"'{run.plan.task.name}' on the plant '{run.plant}'", fontsize=9)
        if column == 0:
            for axes, word in ((upper, "longitudinal"), (lower, "oblique")):
                axes.set_ylabel(f"{word}\narclength [mm]", fontsize=8)
    traces = figure.add_subplot(grid[2, :])
    for run, style in zip(runs, _STYLES, strict=False):
        for name, values in _traces(run).items():
            traces.plot(run.recording.time, values, style, color=_COLOURS[name.split(" of ")[0]], lw=1.4, label=f"{name}, {run.plant}")
    _phases(traces, runs[0])
    traces.set_xlabel("time [s]", fontsize=8)
    traces.set_ylabel("turns", fontsize=8)
    figure.legend(fontsize=7, frameon=False, ncols=len(runs), loc="outside lower center")
    traces.tick_params(labelsize=7)
    write_figure(path, figure, dpi=110)
    return figure


def bend_colours(run: Execution) -> Floats:
    """Colours (FINE, T, 3) of how the longitudinal muscles bend a run's arm: the hue says whereto, the depth how strongly."""
    from matplotlib.colors import hsv_to_rgb

    levels = _fine(run)[:, [MUSCLE_GROUPS.index(name) for name in LONGITUDINAL_GROUPS]]
    azimuths = 2j * np.pi * np.arange(len(LONGITUDINAL_GROUPS)) / len(LONGITUDINAL_GROUPS)
    side = np.einsum("tgs,g->ts", levels, np.exp(azimuths)).T
    strength = np.clip(np.abs(side) / max(float(np.abs(side).max()), 1e-9), 0.0, 1.0)
    return np.asarray(hsv_to_rgb(np.stack([np.angle(side) / (2 * np.pi) % 1.0, strength**0.5, np.ones_like(strength)], axis=-1)))


def _bend_map(axes: "Axes", run: Execution) -> None:
    axes.imshow(bend_colours(run), origin="lower", aspect="auto", extent=_extent(run), interpolation="nearest")
    _phases(axes, run)


def _twist_map(axes: "Axes", run: Execution) -> None:
    """Left-handed red, right-handed blue."""
    levels = _fine(run)
    signed = (levels[:, MUSCLE_GROUPS.index("L-OM")] - levels[:, MUSCLE_GROUPS.index("R-OM")]).T
    most = max(float(np.abs(signed).max()), 1e-9)
    axes.imshow(signed, origin="lower", aspect="auto", extent=_extent(run), cmap="RdBu_r", vmin=-most, vmax=most, interpolation="nearest")
    _phases(axes, run)


def _fine(run: Execution) -> Floats:
    """Levels (T, groups, FINE), evenly along the arm."""
    edges, places = run.recording.stations[1:-1], (np.arange(FINE) + 0.5) / FINE * run.plan.arm.length
    nearest = np.abs(edges[None] - places[:, None]).argmin(axis=1)
    return np.asarray(run.recording.levels[:, :, nearest])


def _extent(run: Execution) -> tuple[float, float, float, float]:
    return 0.0, float(run.recording.time[-1]), 0.0, 1e3 * run.plan.arm.length


def _phases(axes: "Axes", run: Execution) -> None:
    for name, begin in run.plan.phase_begins.items():
        axes.axvline(begin, color="0.6", lw=0.6, ls=":")
        axes.annotate(
            name,
            (begin, 1.0),
            xycoords=("data", "axes fraction"),
            fontsize=6,
            color="0.3",
            va="top",
            xytext=(2, -2),
            textcoords="offset points",
        )
    axes.tick_params(labelsize=7)


def _traces(run: Execution) -> dict[str, Floats]:
    found = {"twist": run.trace.twist, "lifted writhe": run.trace.lifted_writhe}
    outputs = RecordedOutputs(run.recording, run.trace, run.plan.arm)
    goals = [goal for phase in run.plan.task.phases for goal in phase.goals if isinstance(goal, CoveredWindingGoal)]
    for name in sorted({goal.object for goal in goals}):
        found[f"covered winding of {name}"] = np.abs(hold_in(outputs, name).covered)
    return found
