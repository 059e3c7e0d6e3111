"""Pictures: the arm in space, planned against simulated link, writhe and twist, activations over time."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError, check_choice, check_number, check_numbers
from octoctrl.sim.running.recording import Recording

from ..carrying.results import Execution
from ..files.writing import check_target, write_figure
from ..judging.comparison import Comparison, compare, planned_points, rms

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

COLOURS = {"link": "#009E73", "writhe": "#0072B2", "twist": "#D55E00"}
"""From the palette of Okabe and Ito, which colour-blind readers can tell apart."""
PLANNED, FAINT, TEXT = "#000000", "0.80", "0.25"
LEAST_RANGE = 0.02
"""Of turns that a trace is drawn over at least."""
_GROUP_COLOURS = {"R-OM": "#D55E00", "L-OM": "#E69F00", "TM": "#009E73"}
_FORMATS = (".png", ".pdf", ".svg")
PANELS = {"arm": 2.7, "link": 1.0, "writhe": 1.0, "twist": 1.0, "activation": 0.68}
"""What a picture shows, from top to bottom, with the share of its height; activations take more for more drives."""
OVER_TIME = ("link", "writhe", "twist", "activation")
_HEADROOM = 0.3
"""Height of the legend, over that of the traces beneath it."""

_SKIN, _SHADE, _OUTLINE = np.array([0.66, 0.83, 0.94]), np.array([0.32, 0.55, 0.74]), (0.10, 0.22, 0.33)
_LINES = ((1.0, (0.84, 0.37, 0.0)), (-1.0, (0.97, 0.93, 0.80)))
"""Colours of the lines along LM3 (d1) and LM7 (-d1)."""
_STATIONS, _GROUP, _GAP, _BESIDE = 320, 8, 30.0, 20.0
"""Discs with which an arm is drawn, how many neighbours share an outline, the gap between arms, mm, and how much of an object beside one is
shown, mm."""


def plot(
    execution: Execution,
    path: str | Path | None = None,
    *,
    panels: Sequence[str] | str | None = None,
    ax: "Axes | Sequence[Axes] | None" = None,
    size: tuple[float, float] | None = None,
    overwrite: bool = False,
    overlap: bool = False,
    snapshots: int = 6,
) -> "Figure":
    """Draw snapshots of the arm, planned (dashed) against simulated (solid) topology, and the activations.

    Parameters
    ----------
    execution : Execution
    path : str or Path, optional
        Where to write the picture (.png, .pdf or .svg).
    panels : sequence of str, or str, optional
        Of `PANELS`, from top to bottom; all of them if omitted.
    ax : Axes or sequence of Axes, optional
        One for each panel, to be drawn into; a new figure if omitted.
    size : (float, float), inch, optional
        Width and height of a new figure.
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
        If the format or a panel is unknown, the file exists, or there is not one of `ax` for each panel.
    """
    if path is not None:
        path = check_target(path, overwrite=overwrite, suffixes=_FORMATS)
    if size is not None:
        check_numbers("size", tuple(size), 2, "(3.5, 2.5), inches")
        for length in size:
            check_number("size", length, at_least=0.5, at_most=100.0, unit="inches")
    names = (panels,) if isinstance(panels, str) else tuple(panels or PANELS)
    for name in names:
        check_choice("panel", name, tuple(PANELS))
    comparison = compare(execution, overlap=overlap)
    figure, places = _axes(names, ax, size, len(execution.plan.schedule.primitives))
    for name, axes in zip(names, places, strict=True):
        if name == "arm":
            draw_snapshots(axes, execution, snapshots)
    over_time = [(name, axes) for name, axes in zip(names, places, strict=True) if name != "arm"]
    if over_time:
        draw_over_time([axes for _, axes in over_time], execution, comparison, [name for name, _ in over_time])
        figure.align_ylabels([axes for name, axes in over_time if name != "activation"])
    if path is not None:
        write_figure(path, figure, dpi=160)
    return figure


def _axes(names: Sequence[str], ax: Any, size: tuple[float, float] | None, drives: int) -> "tuple[Figure, list[Axes]]":
    """The figure, and one of its axes for each panel."""
    if ax is not None:
        given = list(np.atleast_1d(np.asarray(ax, dtype=object)).ravel())
        if len(given) != len(names):
            raise OctoctrlError(
                f"ax holds {len(given)} axes for {len(names)} panels; name the panels, for example panels=('writhe', 'twist')"
            )
        return given[0].figure, given
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    heights = [0.34 * max(drives, 2) if name == "activation" else PANELS[name] for name in names]
    figure = Figure(figsize=size or (8.6, 1.35 * sum(heights) + 0.55), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(figure.subplots(len(names), 1, height_ratios=heights, squeeze=False)[:, 0])


def draw_over_time(panels: "Sequence[Axes]", execution: Execution, comparison: Comparison, names: Sequence[str] = OVER_TIME) -> None:
    """Draw traces and activations into panels that share one time axis, and mark the phases.

    Parameters
    ----------
    panels : sequence of matplotlib.axes.Axes
        From top to bottom.
    execution : Execution
    comparison : Comparison
        Of the execution.
    names : sequence of str
        What each panel shows, of `OVER_TIME`.
    """
    traces = [axes for name, axes in zip(names, panels, strict=True) if name != "activation"]
    for name, axes in zip(names, panels, strict=True):
        if name == "activation":
            _draw_activations(axes, execution)
        else:
            _draw_trace(axes, comparison, name)
        _mark_phases(axes, execution, names=axes is panels[0])
        axes.set_xlim(0.0, comparison.time[-1])
        axes.tick_params(labelsize=8, labelbottom=axes is panels[-1])
        axes.spines[["top", "right"]].set_visible(False)
    if traces:
        _draw_legend(traces[0])
    panels[-1].set_xlabel("time [s]", fontsize=9)


def _draw_trace(axes: "Axes", comparison: Comparison, name: str) -> None:
    planned, simulated, time = comparison.planned, comparison.simulated, comparison.time
    smooth = name if name == "twist" else f"lifted_{name}"
    measured, expected = getattr(simulated, smooth), getattr(planned, smooth)
    if smooth != name and np.any(simulated.crossings != simulated.crossings[0]):
        raw = np.array(getattr(simulated, name))
        raw[1:][np.abs(np.diff(raw)) > 1.0] = np.nan
        axes.plot(time, raw, color="0.62", lw=1.2, ls=":", zorder=1, label="simulated, with its jumps by 2 at self-crossings")
    axes.plot(time, measured, color=COLOURS[name], lw=2.6, alpha=0.9, solid_capstyle="round", zorder=2, label="simulated")
    axes.plot(time, expected, color=PLANNED, lw=1.1, ls=(0, (4, 2.5)), zorder=3, label="planned")
    axes.axhline(0.0, color=FAINT, lw=0.6, zorder=0)
    axes.set_ylabel(f"{smooth.replace('_', ' ')}\n[turns]", fontsize=9)
    axes.margins(y=0.09)
    low, high = axes.get_ylim()
    if high - low < LEAST_RANGE:  # rounding is not to look like motion
        axes.set_ylim((low + high - LEAST_RANGE) / 2, (low + high + LEAST_RANGE) / 2)
    error = f"rms error\n{rms(measured - expected):.3f} turns"
    axes.text(1.008, 0.5, error, transform=axes.transAxes, va="center", fontsize=7.5, color=TEXT)


def _draw_legend(axes: "Axes") -> None:
    """Above all lines, for which the panel is made higher."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + _HEADROOM * (high - low))
    handles, labels = axes.get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda k: ("jumps" in labels[k], labels[k] == "planned"))
    axes.legend(
        [handles[k] for k in order], [labels[k] for k in order], fontsize=7.5, frameon=False, loc="upper left", ncols=3, handlelength=2.6,
        borderaxespad=0.1, borderpad=0.2,
    )  # fmt: skip


def _draw_activations(axes: "Axes", execution: Execution) -> None:
    """One row per drive, in the order of the plan: the planned level filled, the applied one as a line."""
    recording, schedule = execution.recording, execution.plan.schedule
    names = [drive.name for drive in execution.plan.task.drives]
    rows = list(schedule.primitives)
    labels = names if len(names) == len(rows) else [type(primitive).__name__ for primitive in rows]
    edges, said = execution.plan.arm.edges, []
    for row, primitive in enumerate(rows):
        alone = Activation(templates=primitive.templates(), on_saturation="clip")
        groups, index = alone.groups, [MUSCLE_GROUPS.index(group) for group in alone.groups]
        # A drive at level zero uses no muscle.
        applied = recording.levels[:, index].max(axis=(1, 2), initial=0.0)
        planned = alone.levels(execution.clock, edges).max(axis=(1, 2))
        base, height = -row, 0.82 / max(planned.max(), applied.max(), 1e-9)
        colour = _GROUP_COLOURS.get(next(iter(groups), ""), COLOURS["writhe"])
        axes.fill_between(recording.time, base, base + height * planned, color=colour, alpha=0.3, lw=0)
        axes.plot(recording.time, base + height * applied, color=colour, lw=1.5)
        what = "+".join(dict.fromkeys("LM" if group in LONGITUDINAL_GROUPS else group for group in groups)) or "no muscle"
        said.append(f"{labels[row].replace('_', ' ')}\n{what}, peak {applied.max():.2f}")
    axes.set_yticks([0.35 - row for row in range(len(labels))], said, fontsize=7.5, parse_math=False)
    axes.tick_params(axis="y", length=0)
    axes.set_title("activation: planned (filled), applied (line)", loc="left", fontsize=8, color=TEXT, pad=3)
    axes.spines["left"].set_visible(False)


def _mark_phases(axes: "Axes", execution: Execution, names: bool) -> None:
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
            axes.text(
                (start + stop) / 2, 1.02, name, transform=axes.get_xaxis_transform(), ha="center", va="bottom", fontsize=9, parse_math=False
            )
        if name not in ends:  # the run was cut short here
            break


# ---------------------------------------------------------------- the arm in space


def _snapshot_times(execution: Execution, count: int) -> list[tuple[float, str]]:
    """Instants and their names: rest, and the ends of the phases."""
    last = float(execution.recording.time[-1])
    ends = [(event.actual, f"after {event.phase}") for event in execution.events if event.actual < last - 1e-9]
    named = execution.events[-1].phase if execution.events and execution.events[-1].actual >= last - 1e-9 else ""
    times = [(float(execution.recording.time[0]), "at rest"), *ends, (last, f"after {named}" if named else "last")]
    return times[::-1][:count][::-1]


def draw_snapshots(axes: "Axes", execution: Execution, count: int) -> None:
    """Draw the last `count` ends of phases side by side in one scale, seen obliquely along the pole, into `axes`.

    Lines along LM3 (orange) and LM7 (white) show the twist; the planned centreline of the `execution` is dashed. Objects are seen through.
    """
    from .outlines import draw_objects, outlines

    instants = _snapshot_times(execution, count)
    recording, arm = execution.recording, execution.plan.arm
    camera = arm_camera(execution.plan.task.convention.pole)
    when = np.interp([time for time, _ in instants], recording.time, execution.clock)
    planned = planned_points(execution.plan, when)
    place, floor, top = 0.0, np.inf, -np.inf
    for number, (time, name) in enumerate(instants):
        index = int(np.argmin(np.abs(recording.time - time)))
        shape = arm_shape(recording, index, arm)
        flat = shape.points @ camera.T
        width = np.r_[flat[:, 0] - shape.radii, flat[:, 0] + shape.radii]
        around = outlines(execution, index, camera)
        height = np.r_[flat[:, 1] - shape.radii, flat[:, 1] + shape.radii]
        if around:  # as much of what stands beside the arm as shows where it is
            beside = np.concatenate(around)
            width = np.r_[width, beside[:, 0].clip(width.min() - _BESIDE, width.max() + _BESIDE)]
            height = np.r_[height, beside[:, 1].clip(height.min() - _BESIDE, height.max() + _BESIDE)]
        low, wide = width.min(), max(np.ptp(width), 38.0)
        shift = np.array([place - low + (wide - np.ptp(width)) / 2, 0.0, 0.0])
        draw_objects(axes, around, shift[:2], (place - 0.3 * _GAP, place + wide + 0.3 * _GAP))
        draw_arm(axes, shape, camera, shift)
        if planned is not None:
            guide = 1e3 * planned[number] @ camera.T + shift
            axes.plot(guide[:, 0], guide[:, 1], color=PLANNED, lw=1.0, ls=(0, (4, 2.5)), zorder=5)
        floor, top = min(floor, height.min()), max(top, height.max())
        axes.annotate(
            f"{name}\n{time:.2f} s",
            (place + wide / 2, 0.0),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="top",
            fontsize=8,
            parse_math=False,
        )
        place += wide + _GAP
    axes.plot([place - _GAP - 50, place - _GAP], [top + 6.0] * 2, color=TEXT, lw=1.6)
    axes.text(place - _GAP - 25, top + 9.0, "50 mm", ha="center", va="bottom", fontsize=7.5, color=TEXT)
    axes.set_xlim(-4.0, place - _GAP + 4.0)
    axes.set_ylim(floor - 6.0, top + 22.0)
    axes.set_aspect("equal")
    axes.set_axis_off()


def arm_camera(pole: Sequence[float]) -> Floats:
    """Rows: right, up and towards the viewer. The arm's rest axis +y points up, the `pole` towards the viewer and to one side."""
    up, axis = np.array(pole), np.array([0.0, 1.0, 0.0])
    if abs(up @ axis) > 0.9:
        up = np.array([0.0, 0.0, 1.0])
    view = up + 0.45 * np.cross(axis, up) + 0.30 * axis
    view /= np.linalg.norm(view)
    right = np.cross(axis, view)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(view, right), view])


class ArmShape(NamedTuple):
    """Points (m, 3) and radii (m,) in mm, and outward normals (m, 3) of the line along LM3."""

    points: Floats
    radii: Floats
    normals: Floats


def arm_shape(recording: Recording, index: int, arm: Arm) -> ArmShape:
    """The `arm` at instant number `index` of a `recording`."""
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
    return ArmShape(points, 1e3 * np.asarray(arm.section(fine).outer_radius), normals)


def draw_arm(axes: "Axes", shape: ArmShape, camera: Floats, shift: Floats) -> None:
    """Draw the `shape` of an arm into `axes`, seen by a `camera` and moved by a `shift` (3,), mm.

    Discs from far to near, in each short stretch first the outline, then the skin; last what is seen of the lines.
    """
    from matplotlib.collections import EllipseCollection

    flat = shape.points @ camera.T
    normals = shape.normals @ camera.T
    near = (flat[:, 2] - flat[:, 2].min()) / max(np.ptp(flat[:, 2]), 40.0)
    centres: list[Floats] = []
    sizes: list[float] = []
    colours: list[tuple[float, ...]] = []

    def disc(centre: Floats, radius: float, colour: tuple[float, ...]) -> None:
        centres.append(centre[:2] + shift[:2])
        sizes.append(2 * radius)
        colours.append(colour)

    stretches = [np.arange(begin, min(begin + _GROUP, _STATIONS)) for begin in range(0, _STATIONS, _GROUP)]
    for stretch in sorted(stretches, key=lambda inside: flat[inside, 2].mean()):
        for k in stretch:
            disc(flat[k], shape.radii[k] + 0.7, _OUTLINE)
        for k in np.arange(max(stretch[0] - 3, 0), min(stretch[-1] + 4, _STATIONS)):
            disc(flat[k], shape.radii[k], tuple(_SHADE + near[k] * (_SKIN - _SHADE)))
    for sign, colour in _LINES:
        line = flat + sign * shape.radii[:, None] * normals
        for k in np.flatnonzero(_seen(line, sign * normals[:, 2], flat, shape.radii)):
            disc(line[k], 0.10 * shape.radii[k] + 0.35, colour)
    axes.add_collection(
        EllipseCollection(sizes, sizes, np.zeros(len(sizes)), units="xy", offsets=centres, offset_transform=axes.transData,
        facecolors=colours, edgecolors="none", zorder=2, rasterized=True)
    )  # fmt: skip


def _seen(line: Floats, facing: Floats, centres: Floats, radii: Floats) -> NDArray[np.bool_]:
    """Which points of a line on the skin face the viewer and lie in front of all balls (centres, radii) of the arm."""
    apart = np.linalg.norm(line[:, None, :2] - centres[None, :, :2], axis=2)
    front = centres[None, :, 2] + np.sqrt(np.maximum(radii**2 - apart**2, 0.0))
    hidden = (apart < radii) & (front > line[:, None, 2] + 0.12 * radii[:, None])
    return (facing > 0.0) & ~hidden.any(axis=1)
