"""Texts and pictures on disk, written as `octoctrl.sim.writing` writes all files: whole or not at all."""

from pathlib import Path
from typing import TYPE_CHECKING

from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.writing import check_target, written_aside

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["check_target", "make_folder", "write_figure", "write_text", "written_aside"]


def make_folder(path: Path) -> Path:
    """Make a folder unless it exists.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Path
        The same.

    Raises
    ------
    OctoctrlError
        If it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OctoctrlError(f"folder {path} cannot be made: {error.strerror}; give another one") from None
    return path


def write_text(path: Path, text: str) -> Path:
    """Write a text file (UTF-8) aside and move it to `path`, which is returned."""
    with written_aside(path) as part:
        part.write_text(text, encoding="utf-8")
    return path


def write_figure(path: Path, figure: "Figure", *, dpi: float) -> Path:
    """Write a picture of `figure` aside, with `dpi` dots per inch, and move it to `path`, which is returned.

    Letters stay letters of a TrueType font in PDF: journals refuse the drawn ones that Matplotlib would put there.
    """
    from matplotlib import rc_context

    with written_aside(path) as part, rc_context({"pdf.fonttype": 42, "ps.fonttype": 42}):
        figure.savefig(part, dpi=dpi)
    return path
