"""Fibre tracts from imaging: TrackVis (.trk) and MRtrix (.tck) files, read with nibabel."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.archives import check_source
from octoctrl.sim.body.fibres import FibreWinding, winding_of
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.writing import check_suffix

from ..extras import extra

MILLIMETRE = 1e-3
"""Unit of both formats, in metres."""


def read_fibres(path: str | Path, axis: NDArray[np.float64] | None = None) -> FibreWinding:
    """Read the fibres of an arm, and how they wind about its axis.

    Parameters
    ----------
    path : str or Path
        A ``.trk`` or ``.tck`` file; both are in mm.
    axis : (n, 3) float64, m, optional
        The arm's axis from base to tip, in the file's frame; the middle of the fibres if omitted.

    Returns
    -------
    FibreWinding

    Raises
    ------
    OctoctrlError
        If nibabel is not installed, the file is missing or damaged, or what `winding_of` refuses.
    """
    path = check_suffix(path, (".trk", ".tck"))
    streamlines = extra("fibres", "nibabel.streamlines")
    check_source(path)
    try:
        lines = [MILLIMETRE * np.asarray(line, dtype=float) for line in streamlines.load(str(path)).streamlines]
    except Exception as error:  # nibabel lets through whatever a damaged file runs into
        raise OctoctrlError(f"{path} is no {path.suffix} file, or is damaged: {' '.join(str(error).split())[:120]}") from None
    whole = [line for line in lines if len(line) >= 3]
    try:
        return winding_of(whole, axis)
    except OctoctrlError as error:
        raise OctoctrlError(f"{path}: {error}") from None
