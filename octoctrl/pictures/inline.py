"""Pictures that stand in a page as SVG."""

import io
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 8.6
"""Of a picture in a page, inches."""


def inline_svg(height: float, draw: "Callable[[Figure], None]") -> str:
    """Draw a picture for a page.

    Parameters
    ----------
    height : float, inches
    draw : callable
        Draws into the figure that it is given.

    Returns
    -------
    str
        SVG, with text as text; the same picture gives the same bytes.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    written = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "octoctrl", "font.family": "sans-serif"}):
        figure = Figure(figsize=(WIDTH, height))
        FigureCanvasSVG(figure)
        draw(figure)
        figure.savefig(written, format="svg", metadata={"Date": None})
    svg = written.getvalue()
    return svg[svg.index("<svg") :]
