"""Bending over time and arclength, planned beside simulated, with the way of the packet: for bends that travel."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from octoctrl.sim.errors import OctoctrlError

from ..carrying.results import Execution
from ..files.writing import check_target, write_figure
from ..judging.packet import PacketTrack, packets
from .inline import inline_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANELS = ("planned", "simulated", "simulated - planned")
SHOWN = 0.5
"""Share of its greatest amplitude below which a packet is too faint for its way to be drawn."""
_CLIPPED = 0.995
_WAY = {"planned": ("white", "--"), "simulated": ("#D55E00", "-")}


def kymograph(run: Execution, path: str | Path | None = None, *, overwrite: bool = False) -> "Figure":
    """Draw the bending strain over time and arclength: planned, simulated, and their difference, with the way of the packet.

    Parameters
    ----------
    run : Execution
    path : str or Path, optional
        Of the picture: .png, .pdf or .svg.
    overwrite : bool

    Returns
    -------
    Figure

    Raises
    ------
    OctoctrlError
        If the plan carries no shape, or the path is no good.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if path is not None:
        path = check_target(path, overwrite=overwrite, suffixes=(".png", ".pdf", ".svg"))
    planned, simulated = packets(run)
    if planned is None:
        raise OctoctrlError(f"the plan of '{run.plan.task.name}' carries no shape to compare with; plan on the reduced model")
    figure = Figure(figsize=(11.0, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = list(figure.subplots(1, len(PANELS), sharey=True))
    draw_kymographs(panels, planned, simulated)
    for axes in panels:
        axes.set_xlabel("time [s]", fontsize=8)
        _mark(axes, run)
    if path is not None:
        write_figure(path, figure, dpi=130)
    return figure


def packet_picture(planned: PacketTrack, simulated: PacketTrack, left: float, width: float) -> str:
    """The same for a page: one above the other, on the time axis of its other pictures.

    Parameters
    ----------
    planned, simulated : PacketTrack
        At the same instants.
    left, width : float
        Where the time axis begins and how long it is, in percent of the picture's width.

    Returns
    -------
    str
        SVG, with text as text; the same run gives the same bytes.
    """

    def draw(figure: "Figure") -> None:
        panels = list(figure.subplots(len(PANELS), 1, sharex=True))
        figure.subplots_adjust(left=left / 100, right=(left + width) / 100, top=0.95, bottom=0.09, hspace=0.28)
        draw_kymographs(panels, planned, simulated, beside=True)
        panels[-1].set_xlabel("time [s]", fontsize=9)

    return inline_svg(5.4, draw)


def draw_kymographs(panels: "Sequence[Axes]", planned: PacketTrack, simulated: PacketTrack, *, beside: bool = False) -> None:
    """Draw planned, simulated and difference into three panels.

    Parameters
    ----------
    panels : sequence of matplotlib.axes.Axes
    planned, simulated : PacketTrack
        At the same instants.
    beside : bool
        Whether the scales of colours stand in the margin instead of taking of the panels' width.
    """
    high = float(np.quantile(np.concatenate([planned.strain, simulated.strain]), _CLIPPED))
    fields = (planned.strain, simulated.strain, simulated.strain - planned.strain)
    for axes, name, field in zip(panels, PANELS, fields, strict=True):
        colours = (
            {"cmap": "RdBu_r", "vmin": -high / 2, "vmax": high / 2}
            if field is fields[-1]
            else {"cmap": "viridis", "vmin": 0.0, "vmax": high}
        )
        image = axes.pcolormesh(
            simulated.time,
            1e3 * simulated.places,
            field.T,
            shading="nearest",
            rasterized=True,
            **colours,  # type: ignore[arg-type]
        )
        axes.set_xlim(simulated.time[0], simulated.time[-1])
        axes.set_title(f"bending strain, {name}", fontsize=9, loc="left")
        axes.set_ylabel("arclength [mm]", fontsize=8)
        axes.tick_params(labelsize=7)
        room: dict[str, Any] = {"cax": axes.inset_axes((1.015, 0.0, 0.015, 1.0))} if beside else {"ax": axes}
        axes.figure.colorbar(image, **room).ax.tick_params(labelsize=6)
        for track, (kind, (colour, style)) in zip((planned, simulated), _WAY.items(), strict=True):
            if kind != name and field is not fields[-1]:
                continue
            strong = track.amplitude > SHOWN * track.amplitude.max()
            seen = "black" if field is fields[-1] and kind == "planned" else colour
            axes.plot(track.time, 1e3 * np.where(strong, track.position, np.nan), style, color=seen, lw=1.4, label=f"packet, {kind}")
    panels[-1].legend(fontsize=6.5, frameon=False, loc="upper left")


def _mark(axes: "Axes", run: Execution) -> None:
    """The actual ends of the phases."""
    for event in run.events[:-1]:
        axes.axvline(event.actual, color="0.6", lw=0.6, ls=":")
