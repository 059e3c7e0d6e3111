"""Pictures: planned against simulated link, writhe and twist, activations over time, the arm in space."""

import numpy as np

from octoctrl.sim.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS

from .comparison import compare, planned_points
from .store import check_target

COLOURS = {"link": "#000000", "writhe": "#0072B2", "twist": "#D55E00"}
"""From the palette of Okabe and Ito, which colour-blind readers can tell apart."""
_GROUP_COLOURS = {"R-OM": "#D55E00", "L-OM": "#E69F00", "TM": "#009E73"}
_FORMATS = (".png", ".pdf", ".svg")


def plot(execution, path=None, *, overwrite=False, overlap=False, snapshots=5):
    """Draw planned (dashed) against simulated (solid) topology, the activations and snapshots of the arm.

    Parameters
    ----------
    execution : Execution
    path : str or Path, optional
        Where to write the picture (.png, .pdf or .svg).
    overwrite : bool
        Whether an existing file may be replaced.
    overlap : bool
        Whether a run that was cut short is drawn; see `compare`.
    snapshots : int
        Number of shapes, at most one for each phase's end and one for the begin.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    OctoctrlError
        If the format is unknown or the file exists.
    """
    if path is not None:
        path = check_target(path, overwrite=overwrite, suffixes=_FORMATS)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    comparison = compare(execution, overlap=overlap)
    figure = Figure(figsize=(8.0, 10.2), layout="constrained")
    FigureCanvasAgg(figure)
    upper, lower = figure.subfigures(2, 1, height_ratios=(3.6, 1.0))
    panels = upper.subplots(4, 1, sharex=True, height_ratios=(1, 1, 1, 0.9))
    _draw_traces(panels[:3], comparison)
    _draw_activations(panels[3], execution)
    for axes in panels:
        _mark_phases(axes, execution, names=axes is panels[0])
    panels[3].set_xlim(0.0, comparison.time[-1])
    panels[3].set_xlabel("time [s]")
    _draw_snapshots(lower, execution, _snapshot_times(execution, snapshots))
    if path is not None:
        figure.savefig(path, dpi=160)
    return figure


def _draw_traces(panels, comparison):
    planned, simulated, time = comparison.planned, comparison.simulated, comparison.time
    for axes, name, label in zip(panels, ("link", "writhe", "twist"), ("link Lk", "writhe Wr", "twist Tw"), strict=True):
        smooth = name if name == "twist" else f"lifted_{name}"
        error = np.sqrt(np.mean((getattr(simulated, smooth) - getattr(planned, smooth)) ** 2))
        axes.plot(time, getattr(simulated, smooth), color=COLOURS[name], lw=1.8, label="simulated")
        axes.plot(time, getattr(planned, smooth), color=COLOURS[name], lw=1.4, ls=(0, (4, 2)), alpha=0.75, label="planned")
        if name != "twist":
            raw = np.array(getattr(simulated, name))
            raw[1:][np.abs(np.diff(raw)) > 1.0] = np.nan
            axes.plot(time, raw, color="0.6", lw=1.0, zorder=0, label="simulated, with the jumps at self-crossings")
        axes.axhline(0.0, color="0.85", lw=0.6, zorder=-1)
        axes.set_ylabel(f"{label} [turns]")
        axes.text(0.995, 0.5, f"rms error\n{error:.3f} turns", transform=axes.transAxes, ha="right", va="center", fontsize=7, color="0.35")
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
    panels[1].legend(fontsize=7, frameon=False, loc="best")


def _draw_activations(axes, execution):
    """One row per drive with the planned level as height, in the order of the plan; grey above it what was applied."""
    recording, schedule = execution.recording, execution.plan.schedule
    names = [drive.name for drive in execution.plan.task.drives]
    activation_rows = list(schedule.primitives)
    labels = names if len(names) == len(activation_rows) else [type(primitive).__name__ for primitive in activation_rows]
    edges, said = np.array([0.0, execution.plan.arm.length]), []
    for row, primitive in enumerate(activation_rows):
        groups = tuple(dict.fromkeys(group for template in primitive.templates() for group in template.groups))
        index = [MUSCLE_GROUPS.index(group) for group in groups]
        applied = recording.levels[:, index].max(axis=(1, 2))
        planned = np.zeros(recording.time.size)
        for template in primitive.templates():
            value = np.asarray(template.values(np, recording.time, edges[0], edges[1]), dtype=float)
            planned = np.maximum(planned, value)
        base, colour = -row, _GROUP_COLOURS.get(groups[0], "#0072B2")
        axes.fill_between(
            recording.time, base, base + 0.85 * planned / max(planned.max(), applied.max(), 1e-9), color=colour, alpha=0.35, lw=0
        )
        axes.plot(recording.time, base + 0.85 * applied / max(planned.max(), applied.max(), 1e-9), color=colour, lw=1.3)
        what = "LM" if set(groups) <= set(LONGITUDINAL_GROUPS) else "/".join(groups)
        said.append(f"{labels[row]}\n{what}, peak {applied.max():.2f}")
    axes.set_yticks([0.3 - row for row in range(len(labels))], said, fontsize=7)
    axes.tick_params(axis="y", length=0)
    axes.tick_params(axis="x", labelsize=8)
    axes.set_title("activation: planned (filled), applied (line)", loc="left", fontsize=9)
    axes.spines[["top", "right", "left"]].set_visible(False)


def _mark_phases(axes, execution, names):
    begins = {name: float(begin) for name, begin in execution.plan.phase_begins.items()}
    ends = {event.phase: event.actual for event in execution.events}
    order, last = list(begins), float(execution.recording.time[-1])
    for index, name in enumerate(order):
        start = ends.get(order[index - 1], begins[name]) if index else 0.0
        stop = min(ends.get(name, last), last)
        if start >= last:
            break
        if index:
            axes.axvline(start, color="0.75", lw=0.8, ls=":", zorder=-1)
        if names:
            axes.text((start + stop) / 2, 1.03, name, transform=axes.get_xaxis_transform(), ha="center", fontsize=8, color="0.3")


def _snapshot_times(execution, count):
    last = float(execution.recording.time[-1])
    ends = [event.actual for event in execution.events if event.actual < last - 1e-9]
    times = [*ends, last]
    return times[::-1][:count][::-1]


def _draw_snapshots(figure, execution, times):
    recording = execution.recording
    planned = planned_points(execution.plan, np.array(times))
    shapes = [recording.points[int(np.argmin(np.abs(recording.time - time)))] for time in times]
    figure.suptitle("the arm: simulated (blue), planned (dashed)", fontsize=9)
    panels = figure.subplots(1, len(times), subplot_kw={"projection": "3d"})
    for column, axes in enumerate(np.atleast_1d(panels)):
        x, y, z = shapes[column].T * 1e3
        for index, width in enumerate(np.linspace(4.5, 1.0, len(x) - 1)):
            axes.plot(x[index : index + 2], z[index : index + 2], y[index : index + 2], color="#0072B2", lw=width, solid_capstyle="round")
        if planned is not None:
            axes.plot(*(planned[column].T * 1e3)[[0, 2, 1]], color="#000000", lw=0.8, ls=(0, (4, 2)), zorder=10)
        low, high = (np.array([getattr(values, side)() for values in (x, z, y)]) for side in ("min", "max"))
        middle, half = (low + high) / 2, 1.15 * max((high - low).max() / 2, 15.0)
        for number, set_limits in enumerate((axes.set_xlim, axes.set_ylim, axes.set_zlim)):
            set_limits(middle[number] - half, middle[number] + half)
        floor = middle[2] - half
        axes.plot([middle[0] - 10, middle[0] + 10], [middle[1]] * 2, [floor] * 2, color="0.3", lw=1.5)
        axes.text(middle[0], middle[1], floor - 0.12 * half, "20 mm", fontsize=6, color="0.3", ha="center", va="top")
        axes.set_box_aspect((1, 1, 1), zoom=1.3)
        axes.set_axis_off()
        axes.set_title(f"{times[column]:.2f} s", fontsize=8)
