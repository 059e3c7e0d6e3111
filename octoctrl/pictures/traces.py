"""The pictures inside a page: traces as SVG whose time axis the page's clock can follow, and a still picture of the arm."""

import base64
import io

from ..carrying.results import Execution
from ..judging.comparison import compare
from . import plots


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
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    comparison = compare(run, overlap=True)
    drives = max(len(run.plan.schedule.primitives), 2)
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "octoctrl", "font.family": "sans-serif"}):
        figure = Figure(figsize=(8.6, 5.2 + 0.34 * drives))
        FigureCanvasSVG(figure)
        panels = figure.subplots(4, 1, height_ratios=(1, 1, 1, 0.34 * drives))
        figure.subplots_adjust(left=0.13, right=0.89, top=0.95, bottom=0.08, hspace=0.25)
        plots.draw_over_time(panels, run, comparison)
        written = io.StringIO()
        figure.savefig(written, format="svg", metadata={"Date": None})
        box = panels[0].get_position()
    svg = written.getvalue()
    return svg[svg.index("<svg") :], 100 * float(box.x0), 100 * float(box.width)


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
