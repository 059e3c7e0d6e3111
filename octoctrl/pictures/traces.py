"""The pictures inside a page: traces as SVG whose time axis the page's clock can follow, and a still picture of the arm."""

import base64
import io
from typing import TYPE_CHECKING

from ..carrying.results import Execution
from ..judging.comparison import compare
from . import plots
from .inline import inline_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEFT, RIGHT = 0.13, 0.89
"""Where the time axis begins and ends, in shares of the picture's width."""


def traces_picture(run: Execution) -> tuple[str, float, float]:
    """Planned against simulated link, writhe and twist, and the activations.

    Parameters
    ----------
    run : Execution

    Returns
    -------
    svg : str
        Text stays text; the same run gives the same bytes.
    left, width : float
        Where the time axis begins and how long it is, in percent of the picture's width.
    """
    comparison = compare(run, overlap=True)
    drives = max(len(run.plan.schedule.primitives), 2)

    def draw(figure: "Figure") -> None:
        panels = figure.subplots(4, 1, height_ratios=(1, 1, 1, 0.34 * drives))
        figure.subplots_adjust(left=LEFT, right=RIGHT, top=0.95, bottom=0.08, hspace=0.25)
        plots.draw_over_time(panels, run, comparison)

    return inline_svg(5.2 + 0.34 * drives, draw), 100 * LEFT, 100 * (RIGHT - LEFT)


def still_picture(run: Execution) -> str:
    """The arm at the ends of its phases, as the address of an image inside the page: for browsers that draw nothing in space.

    Parameters
    ----------
    run : Execution

    Returns
    -------
    str
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    plots.draw_snapshots(figure.subplots(), run, count=6)
    written = io.BytesIO()
    figure.savefig(written, format="png", dpi=80, metadata={"Software": None})
    return "data:image/png;base64," + base64.b64encode(written.getvalue()).decode()
