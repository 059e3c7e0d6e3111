"""A meter of topology for a motion that grows by pieces: every instant is measured once.

Writhe is unwrapped in time from the last instant of the piece before, so that pieces give the same bits as the whole at once.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..errors import OctoctrlError
from ..rotations import ribbon_frames
from . import topology_kernels as kernels
from .inputs import arm_pole, check_frames_follow, frame_series, numbers, point_series
from .trace import UTURN_LIMIT, TopologyConvention, TopologyTrace


class Meter:
    """Measures link, writhe and twist of a growing motion.

    Parameters
    ----------
    convention : TopologyConvention, optional
        If omitted, the default one, with a pole that suits the first instant as in `octoctrl.sim.topology.measures.lifted_writhe`.

    Raises
    ------
    OctoctrlError
        If it is something else.
    """

    def __init__(self, convention: TopologyConvention | None = None) -> None:
        if convention is not None and not isinstance(convention, TopologyConvention):
            raise OctoctrlError(f"convention: expected a TopologyConvention, found {type(convention).__name__}")
        self._asked = None if convention is None else convention.pole
        self._convention = TopologyConvention() if convention is None else convention
        self._rows = np.empty((5, 0))  # time, Gauss writhe, twist, lifted writhe, 1 + t_tip . t_base
        self._shift = 0.0

    def extend(self, time: ArrayLike, points: ArrayLike, frames: ArrayLike) -> None:
        """Measure a further piece; instants that are not later than the last one measured are left out.

        Parameters
        ----------
        time : (T,) array_like, s
        points : (T, n + 1, 3) array_like, m
        frames : (T, m, 3, 3) array_like
            As `octoctrl.sim.topology.measures.measure` takes them.

        Raises
        ------
        OctoctrlError
            If an array has the wrong shape or is degenerate, the numbers of samples differ, or d3 does not follow the points.
        """
        instants = np.atleast_1d(numbers("time", time))
        if instants.ndim != 1:
            raise OctoctrlError(f"time has shape {instants.shape}; one value per time is needed")
        known = int(np.searchsorted(instants, self._rows[0, -1] + 1e-12, side="right")) if self._rows.shape[1] else 0
        if known == instants.size:
            return
        if known:
            instants, points, frames = (np.asarray(series)[known:] for series in (instants, points, frames))
        curves, series = point_series(points)[0], frame_series(frames)[0]
        if not (instants.size == len(curves) == len(series)):
            raise OctoctrlError(f"time has {instants.size} samples, points {len(curves)}, frames {len(series)}; they must agree")
        check_frames_follow(curves, series)
        if not self._rows.shape[1]:
            pole = arm_pole(series[0], self._asked)
            self._convention = self._convention if self._asked else replace(self._convention, pole=pole)
        rows = np.empty((5, instants.size))
        rows[0] = instants
        _, gauss, turned, lifted, opening = rows
        kernels.writhe_series(curves, np.ascontiguousarray(series[:, [0, -1], 2, :]), self._convention.ray_length, gauss)
        kernels.frame_series(ribbon_frames(curves, series), np.array(self._convention.pole), turned, lifted, opening)
        before = self._rows[3, -1] if self._rows.shape[1] else lifted[0]
        self._shift = kernels.unwrap_by_two(lifted, before, self._shift)
        self._rows = np.concatenate([self._rows, rows], axis=1)

    @property
    def trace(self) -> TopologyTrace:
        """All that was measured so far."""
        time, gauss, turned, lifted, opening = self._rows
        crossings = np.round((lifted - gauss) / 2.0).astype(np.int64)
        framed_link = lifted + turned - 2.0 * crossings
        return TopologyTrace(
            time=time,
            link=framed_link,
            writhe=gauss,
            twist=turned,
            lifted_writhe=lifted,
            crossings=crossings,
            uturn=opening < UTURN_LIMIT,
            residual=framed_link - (gauss + turned),
            convention=self._convention,
        )
