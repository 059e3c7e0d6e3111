"""A measured arm as a picture: its shapes, link, writhe and twist with what noise does to them, and the dimension of its stretches."""

from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from octoctrl.sim.topology.measured import QUANTITIES, MeasuredTopology

from ..files.writing import check_target, write_figure
from .motion import Floats
from .plots import COLOURS, FAINT, TEXT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SECTION_COLOURS = {1: "#BBBBBB", 2: "#56B4E9", 3: "#D55E00"}
"""Straight, bent in a plane, helical."""
SHAPES = 4


def plot_measured(
    measured: MeasuredTopology, path: str | Path | None = None, *, size: tuple[float, float] = (8.6, 5.2), overwrite: bool = False
) -> "Figure":
    """Draw a measured arm at four instants, its topology over time, and its sections by their dimension.

    Parameters
    ----------
    measured : MeasuredTopology
    path : str or Path, optional
        Where to write the picture (.png, .pdf or .svg).
    size : (float, float), inch
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    OctoctrlError
        If the format is unknown or the file exists.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if path is not None:
        path = check_target(path, overwrite=overwrite, suffixes=(".png", ".pdf", ".svg"))
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    if len(measured.trace.time) > 1:
        grid = figure.add_gridspec(4, 2, width_ratios=(1, 1.5), height_ratios=(1, 1, 1, 0.9))
        panels = [figure.add_subplot(grid[row, 1]) for row in range(4)]
        _draw_traces(panels[:3], measured)
        _draw_sections(panels[3], measured)
        _draw_shapes(figure.add_subplot(grid[:, 0]), measured)
        figure.align_ylabels(panels)
    else:
        _draw_shapes(figure.subplots(), measured)
    if path is not None:
        write_figure(path, figure, dpi=160)
    return figure


def _draw_traces(panels: "list[Axes]", measured: MeasuredTopology) -> None:
    trace = measured.trace
    for axes, name in zip(panels, QUANTITIES, strict=True):
        values, colour = getattr(trace, name), COLOURS[name.removeprefix("lifted_")]
        if measured.spread:
            wide = 2 * measured.spread[name]
            axes.fill_between(trace.time, values - wide, values + wide, color=colour, alpha=0.2, lw=0)
        axes.plot(trace.time, values, color=colour, lw=1.8)
        axes.axhline(0.0, color=FAINT, lw=0.6, zorder=0)
        axes.set_ylabel(f"{name.replace('_', ' ')}\n[turns]", fontsize=8)
        axes.tick_params(labelsize=8, labelbottom=False)
        axes.set_xlim(trace.time[0], trace.time[-1])
        axes.spines[["top", "right"]].set_visible(False)
    if measured.spread:
        panels[0].set_title("band: two standard deviations of what noise adds", loc="left", fontsize=8, color=TEXT)


def _draw_sections(axes: "Axes", measured: MeasuredTopology) -> None:
    from matplotlib.colors import ListedColormap

    time, sections = measured.trace.time, measured.sections
    edges = np.concatenate([time[:1], (time[1:] + time[:-1]) / 2, time[-1:]])
    colours = ListedColormap([SECTION_COLOURS[k] for k in (1, 2, 3)])
    axes.pcolormesh(edges, np.linspace(0, 1, sections.shape[1] + 1), sections.T, cmap=colours, vmin=0.5, vmax=3.5, rasterized=True)
    for name, number, place in (("straight", 1, 0.0), ("planar", 2, 0.25), ("helical", 3, 0.5)):
        axes.text(place, 1.04, f"■ {name}", color=SECTION_COLOURS[number], transform=axes.transAxes, fontsize=8, va="bottom")
    axes.set_yticks([0, 1], ["base", "tip"], fontsize=8)
    axes.set_xlabel("time [s]", fontsize=9)
    axes.tick_params(labelsize=8)


def _view(points: Floats) -> Floats:
    """Rows right and up of a view in which shapes (T, n, 3) are seen at their widest and a little from the side and from above."""
    spread = np.linalg.svd((points - points.mean(axis=(0, 1))).reshape(-1, 3), full_matrices=False)[2]
    up = (points[:, -1] - points[:, 0]).mean(axis=0)
    up = up / np.linalg.norm(up) if np.linalg.norm(up) > 1e-9 else spread[0]
    up = up if up[np.abs(up).argmax()] > 0 else -up  # what hangs down hangs down in the picture
    through = spread[2] - (spread[2] @ up) * up
    if np.linalg.norm(through) < 0.1:
        through = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    through /= np.linalg.norm(through)
    ahead = through + 0.4 * np.cross(up, through) + 0.35 * up
    right = np.cross(up, ahead)
    right /= np.linalg.norm(right)
    above = np.cross(ahead, right)
    return np.array([right, above / np.linalg.norm(above)])


def _draw_shapes(axes: "Axes", measured: MeasuredTopology) -> None:
    """Side by side in one scale, each stretch in the colour of its dimension."""
    line, trace = measured.centreline, measured.trace
    view = _view(line.points)
    chosen = np.unique(np.round(np.linspace(0, len(trace.time) - 1, SHAPES)).astype(int))
    flat = [1e3 * line.points[index] @ view.T for index in chosen]
    wide = max(float(np.ptp(shape[:, 0])) for shape in flat) + 0.12 * 1e3 * float(line.length.max())
    high = max(float(np.ptp(shape[:, 1])) for shape in flat) + 0.12 * 1e3 * float(line.length.max())
    for number, (index, shape) in enumerate(zip(chosen, flat, strict=True)):
        row, column = divmod(number, 2)
        shape = shape - (shape.max(axis=0) + shape.min(axis=0)) / 2 + [column * wide, -row * high]
        stretches = measured.sections.shape[1]
        bounds = np.round(np.linspace(0, len(shape) - 1, stretches + 1)).astype(int)
        for stretch, (low, top) in enumerate(pairwise(bounds)):
            colour = SECTION_COLOURS[int(measured.sections[index, stretch])]
            axes.plot(*shape[low : top + 1].T, color=colour, lw=3.0, solid_capstyle="round")
        axes.plot(*shape[0], "s", color=TEXT, ms=5)
        axes.text(column * wide, -row * high - 0.5 * high, f"{trace.time[index]:.3g} s", ha="center", va="top", fontsize=8)
    axes.set_aspect("equal")
    axes.set_axis_off()
