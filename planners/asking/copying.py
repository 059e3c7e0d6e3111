"""A task that copies a motion which was measured: phases whose ends are instants of it, each with its shape as a goal."""

from collections.abc import Sequence

import numpy as np

from octoctrl.sim.errors import OctoctrlError, check_number
from octoctrl.sim.topology.centreline import Centreline
from octoctrl.sim.topology.trace import TopologyConvention

from ..contracts import Floats
from .goals.shape import ShapeGoal
from .task import Drive, Phase, Task

LEAST = 0.2
"""Shortest time between two instants that are copied, s."""


def copied(
    centreline: Centreline,
    drives: Sequence[Drive],
    *,
    times: Sequence[float],
    points: int = 8,
    tolerance: float = 0.01,
    convention: TopologyConvention | None = None,
    name: str = "copy",
) -> Task:
    """A task whose phases end with the shapes of a centreline.

    Parameters
    ----------
    centreline : Centreline
        Of an arm whose base is at the origin and leaves it along +y; frames are not needed.
    drives : sequence of Drive
        What may bring it about; they begin and end with phases called ``"1"``, ``"2"`` and so on.
    times : sequence of float, s
        Ends of the phases, from the centreline's first instant on.
    points : int
        Along the arm.
    tolerance : float, m
        Root mean square of the distances that still counts as reached.
    convention : TopologyConvention, optional
    name : str

    Returns
    -------
    Task

    Raises
    ------
    OctoctrlError
        If the times do not increase by at least `LEAST`, or lie outside the centreline.
    """
    check_number("points", points, at_least=1)
    ends, lasts = np.asarray(times, dtype=float), float(centreline.time[-1] - centreline.time[0])
    if not len(ends) or np.diff(ends, prepend=0.0).min() < LEAST or ends[-1] > lasts + 1e-9:
        raise OctoctrlError(
            f"times {list(times)}: instants within the {lasts:g} s of the centreline are needed, at least {LEAST:g} s apart"
        )
    phases = tuple(
        Phase(
            name=str(index + 1), duration=float(end - begin), shortest=float(end - begin), longest=float(end - begin),
            goals=(ShapeGoal(value=tuple(map(tuple, _shape(centreline, end, points).tolist())), tolerance=tolerance),),
        )
        for index, (begin, end) in enumerate(zip([0.0, *ends[:-1]], ends, strict=True))
    )  # fmt: skip
    return Task(name=name, phases=phases, drives=tuple(drives), convention=convention or TopologyConvention())


def _shape(centreline: Centreline, time: float, points: int) -> Floats:
    """Points (K, 3) at equal shares of the length, some time after the first instant."""
    flat = centreline.points.reshape(len(centreline.time), -1)
    line = np.array([np.interp(centreline.time[0] + time, centreline.time, column) for column in flat.T]).reshape(-1, 3)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    wanted = along[-1] * np.arange(1, points + 1) / points
    return np.stack([np.interp(wanted, along, axis) for axis in line.T], axis=1)
