"""Pictures: the arm in space, planned against simulated link, writhe and twist, activations over time."""

from typing import NamedTuple

import numpy as np

from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS

from ..files.writing import check_target, written_aside
from ..judging.comparison import compare, planned_points, rms

COLOURS = {"link": "#009E73", "writhe": "#0072B2", "twist": "#D55E00"}
"""From the palette of Okabe and Ito, which colour-blind readers can tell apart."""
PLANNED, FAINT, TEXT = "#000000", "0.80", "0.25"
_GROUP_COLOURS = {"R-OM": "#D55E00", "L-OM": "#E69F00", "TM": "#009E73"}
_FORMATS = (".png", ".pdf", ".svg")

_SKIN, _SHADE, _OUTLINE = np.array([0.66, 0.83, 0.94]), np.array([0.32, 0.55, 0.74]), (0.10, 0.22, 0.33)
_LINES = ((1.0, (0.84, 0.37, 0.0)), (-1.0, (0.97, 0.93, 0.80)))
"""Colours of the lines along LM3 (d1) and LM7 (-d1)."""
_STATIONS, _GROUP, _GAP = 320, 8, 30.0
"""Discs with which an arm is drawn, how many neighbours share an outline, and the gap between arms, mm."""


def plot(execution, path=None, *, overwrite=False, overlap=False, snapshots=6):
    """Draw snapshots of the arm, planned (dashed) against simulated (solid) topology, and the activations.

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
    drives = len(execution.plan.schedule.primitives)
    figure = Figure(figsize=(8.6, 9.0), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(5, 1, height_ratios=(2.7, 1, 1, 1, 0.34 * max(drives, 2)))
    draw_snapshots(panels[0], execution, snapshots)
    draw_panels(panels[1:], execution, comparison)
    figure.align_ylabels(panels[1:4])
    if path is not None:
        with written_aside(path) as part:
            figure.savefig(part, dpi=160)
    return figure


def draw_panels(panels, execution, comparison):
    """Draw link, writhe, twist and activations into four panels (axes) with one time axis, and mark the phases.

    Parameters
    ----------
    panels : sequence of matplotlib.axes.Axes
        Four, from top to bottom.
    execution : Execution
    comparison : Comparison
        Of the execution.
    """
    _draw_traces(panels[:3], comparison)
    _draw_activations(panels[3], execution)
    for axes in panels:
        _mark_phases(axes, execution, names=axes is panels[0])
        axes.set_xlim(0.0, comparison.time[-1])
        axes.tick_params(labelsize=8, labelbottom=axes is panels[3])
        axes.spines[["top", "right"]].set_visible(False)
    panels[3].set_xlabel("time [s]", fontsize=9)


def _draw_traces(panels, comparison):
    planned, simulated, time = comparison.planned, comparison.simulated, comparison.time
    for axes, name, label in zip(panels, ("link", "writhe", "twist"), ("link Lk", "writhe Wr", "twist Tw"), strict=True):
        smooth = name if name == "twist" else f"lifted_{name}"
        measured, expected = getattr(simulated, smooth), getattr(planned, smooth)
        if name != "twist" and np.any(simulated.crossings != simulated.crossings[0]):
            raw = np.array(getattr(simulated, name))
            raw[1:][np.abs(np.diff(raw)) > 1.0] = np.nan
            axes.plot(time, raw, color="0.62", lw=1.2, ls=":", zorder=1, label="simulated, with its jumps by 2 at self-crossings")
        axes.plot(time, measured, color=COLOURS[name], lw=2.6, alpha=0.9, solid_capstyle="round", zorder=2, label="simulated")
        axes.plot(time, expected, color=PLANNED, lw=1.1, ls=(0, (4, 2.5)), zorder=3, label="planned")
        axes.axhline(0.0, color=FAINT, lw=0.6, zorder=0)
        axes.set_ylabel(f"{label}\n[turns]", fontsize=9)
        axes.margins(y=0.09)
        error = f"rms error\n{rms(measured - expected):.3f} turns"
        axes.text(1.008, 0.5, error, transform=axes.transAxes, va="center", fontsize=7.5, color=TEXT)
    handles, labels = panels[0].get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda k: ("jumps" in labels[k], labels[k] == "planned"))
    panels[0].legend(
        [handles[k] for k in order], [labels[k] for k in order], fontsize=7.5, frameon=False, loc="best", ncols=3, handlelength=2.6,
        borderaxespad=0.2,
    )  # fmt: skip


def _draw_activations(axes, execution):
    """One row per drive, in the order of the plan: the planned level filled, the applied one as a line."""
    recording, schedule = execution.recording, execution.plan.schedule
    names = [drive.name for drive in execution.plan.task.drives]
    rows = list(schedule.primitives)
    labels = names if len(names) == len(rows) else [type(primitive).__name__ for primitive in rows]
    edges, said = execution.plan.arm.edges, []
    for row, primitive in enumerate(rows):
        groups = tuple(dict.fromkeys(group for template in primitive.templates() for group in template.groups))
        index = [MUSCLE_GROUPS.index(group) for group in groups]
        applied = recording.levels[:, index].max(axis=(1, 2))
        planned = np.zeros(recording.time.size)
        for template in primitive.templates():
            value = np.asarray(template.values(np, execution.clock[:, None], edges[:-1], edges[1:]), dtype=float)
            planned = np.maximum(planned, np.broadcast_to(value, (recording.time.size, edges.size - 1)).max(axis=1))
        base, height = -row, 0.82 / max(planned.max(), applied.max(), 1e-9)
        colour = _GROUP_COLOURS.get(groups[0], COLOURS["writhe"])
        axes.fill_between(recording.time, base, base + height * planned, color=colour, alpha=0.3, lw=0)
        axes.plot(recording.time, base + height * applied, color=colour, lw=1.5)
        what = "+".join(dict.fromkeys("LM" if group in LONGITUDINAL_GROUPS else group for group in groups))
        said.append(f"{labels[row].replace('_', ' ')}\n{what}, peak {applied.max():.2f}")
    axes.set_yticks([0.35 - row for row in range(len(labels))], said, fontsize=7.5)
    axes.tick_params(axis="y", length=0)
    axes.set_title("activation: planned (filled), applied (line)", loc="left", fontsize=8, color=TEXT, pad=3)
    axes.spines["left"].set_visible(False)


def _mark_phases(axes, execution, names):
    begins = {name: float(begin) for name, begin in execution.plan.phase_begins.items()}
    ends = {event.phase: event.actual for event in execution.events}
    order, last = list(begins), float(execution.recording.time[-1])
    for index, name in enumerate(order):
        start = ends.get(order[index - 1], begins[name]) if index else 0.0
        stop = min(ends.get(name, last), last)
        if start >= last:
            break
        if index % 2:
            axes.axvspan(start, stop, color="0.96", lw=0, zorder=-2)
        if names:
            axes.text((start + stop) / 2, 1.02, name, transform=axes.get_xaxis_transform(), ha="center", va="bottom", fontsize=9)
        if name not in ends:  # the run was cut short here
            break


# ---------------------------------------------------------------- the arm in space


def _snapshot_times(execution, count):
    """Instants and their names: rest, and the ends of the phases."""
    last = float(execution.recording.time[-1])
    ends = [(event.actual, f"after {event.phase}") for event in execution.events if event.actual < last - 1e-9]
    named = execution.events[-1].phase if execution.events and execution.events[-1].actual >= last - 1e-9 else ""
    times = [(float(execution.recording.time[0]), "at rest"), *ends, (last, f"after {named}" if named else "last")]
    return times[::-1][:count][::-1]


def draw_snapshots(axes, execution, count):
    """Draw the last `count` ends of phases side by side in one scale, seen obliquely along the pole, into `axes`.

    Lines along LM3 (orange) and LM7 (white) show the twist; the planned centreline of the `execution` is dashed.
    """
    instants = _snapshot_times(execution, count)
    recording, arm = execution.recording, execution.plan.arm
    camera = _camera(execution.plan.task.convention.pole)
    when = np.interp([time for time, _ in instants], recording.time, execution.clock)
    planned = planned_points(execution.plan, when)
    place, floor, top = 0.0, np.inf, -np.inf
    for number, (time, name) in enumerate(instants):
        index = int(np.argmin(np.abs(recording.time - time)))
        shape = _shape(recording, index, arm)
        flat = shape.points @ camera.T
        width = np.r_[flat[:, 0] - shape.radii, flat[:, 0] + shape.radii]
        low, wide = width.min(), max(np.ptp(width), 38.0)
        shift = np.array([place - low + (wide - np.ptp(width)) / 2, 0.0, 0.0])
        _draw_arm(axes, shape, camera, shift)
        if planned is not None:
            guide = 1e3 * planned[number] @ camera.T + shift
            axes.plot(guide[:, 0], guide[:, 1], color=PLANNED, lw=1.0, ls=(0, (4, 2.5)), zorder=5)
        floor, top = min(floor, (flat[:, 1] - shape.radii).min()), max(top, (flat[:, 1] + shape.radii).max())
        axes.annotate(
            f"{name}\n{time:.2f} s", (place + wide / 2, 0.0), xycoords=("data", "axes fraction"), ha="center", va="top", fontsize=8
        )
        place += wide + _GAP
    axes.plot([place - _GAP - 50, place - _GAP], [top] * 2, color=TEXT, lw=1.6)
    axes.text(place - _GAP - 25, top - 3, "50 mm", ha="center", va="top", fontsize=7.5, color=TEXT)
    axes.set_xlim(-4.0, place - _GAP + 4.0)
    axes.set_ylim(floor - 6.0, top + 3.0)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _camera(pole):
    """Rows: right, up and towards the viewer. The arm's rest axis +y points up, the pole towards the viewer and to one side."""
    pole, axis = np.array(pole), np.array([0.0, 1.0, 0.0])
    if abs(pole @ axis) > 0.9:
        pole = np.array([0.0, 0.0, 1.0])
    view = pole + 0.45 * np.cross(axis, pole) + 0.30 * axis
    view /= np.linalg.norm(view)
    right = np.cross(axis, view)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(view, right), view])


class _Shape(NamedTuple):
    """Points (m, 3) and radii (m,) in mm, and outward normals (m, 3) of the line along LM3."""

    points: np.ndarray
    radii: np.ndarray
    normals: np.ndarray


def _shape(recording, index, arm):
    from scipy.interpolate import CubicSpline

    lengths = np.linalg.norm(np.diff(recording.points[index], axis=0), axis=1) / recording.stretch[index]
    nodes = np.concatenate([[0.0], np.cumsum(lengths)])
    fine = np.linspace(0.0, nodes[-1], _STATIONS)
    points = 1e3 * CubicSpline(nodes, recording.points[index])(fine)
    along = np.gradient(points, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # LM3 lies towards d1; interpolated between stations, made perpendicular to the centreline again.
    normals = np.stack([np.interp(fine, recording.stations, column) for column in recording.frames[index, :, 0].T], axis=1)
    normals -= np.sum(normals * along, axis=1, keepdims=True) * along
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return _Shape(points, 1e3 * np.asarray(arm.section(fine).outer_radius), normals)


def _draw_arm(axes, shape, camera, shift):
    """Discs from far to near, in each short stretch first the outline, then the skin; last what is seen of the lines."""
    from matplotlib.collections import EllipseCollection

    flat = shape.points @ camera.T
    normals = shape.normals @ camera.T
    near = (flat[:, 2] - flat[:, 2].min()) / max(np.ptp(flat[:, 2]), 40.0)
    centres, sizes, colours = [], [], []

    def disc(centre, radius, colour):
        centres.append(centre[:2] + shift[:2])
        sizes.append(2 * radius)
        colours.append(colour)

    stretches = [np.arange(begin, min(begin + _GROUP, _STATIONS)) for begin in range(0, _STATIONS, _GROUP)]
    for stretch in sorted(stretches, key=lambda inside: flat[inside, 2].mean()):
        for k in stretch:
            disc(flat[k], shape.radii[k] + 0.7, _OUTLINE)
        for k in range(max(stretch[0] - 3, 0), min(stretch[-1] + 4, _STATIONS)):
            disc(flat[k], shape.radii[k], tuple(_SHADE + near[k] * (_SKIN - _SHADE)))
    for sign, colour in _LINES:
        line = flat + sign * shape.radii[:, None] * normals
        for k in np.flatnonzero(_seen(line, sign * normals[:, 2], flat, shape.radii)):
            disc(line[k], 0.10 * shape.radii[k] + 0.35, colour)
    axes.add_collection(
        EllipseCollection(sizes, sizes, np.zeros(len(sizes)), units="xy", offsets=centres, offset_transform=axes.transData,
        facecolors=colours, edgecolors="none", zorder=2, rasterized=True)
    )  # fmt: skip


def _seen(line, facing, centres, radii):
    """Which points of a line on the skin face the viewer and lie in front of all balls (centres, radii) of the arm."""
    apart = np.linalg.norm(line[:, None, :2] - centres[None, :, :2], axis=2)
    front = centres[None, :, 2] + np.sqrt(np.maximum(radii**2 - apart**2, 0.0))
    hidden = (apart < radii) & (front > line[:, None, 2] + 0.12 * radii[:, None])
    return (facing > 0.0) & ~hidden.any(axis=1)
