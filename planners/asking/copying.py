"""A task that copies a motion which was measured: phases whose ends are instants of it, each with its shape as a goal."""

from collections.abc import Sequence

import numpy as np

from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import OctoctrlError, check_number
from octoctrl.sim.topology.centreline import Centreline
from octoctrl.sim.topology.trace import TopologyConvention

from ..contracts import Floats
from .goals.shape import ShapeGoal
from .task import BASE_TANGENT, Drive, Phase, Task

LEAST = 0.2
"""Shortest time between two instants that are copied, s."""
LENGTH, ASIDE, LEANING = 0.25, 0.1, 0.7
"""At the first instant: how much longer or shorter than the arm the line may be, and how far from the origin its base, as shares of the
arm's length; and the least cosine between its first stretch and the direction in which the arm leaves its base."""


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
    phases = copied_phases(centreline, times=times, points=points, tolerance=tolerance)
    return Task(name=name, phases=phases, drives=tuple(drives), convention=convention or TopologyConvention())


def copied_phases(centreline: Centreline, *, times: Sequence[float], points: int = 8, tolerance: float = 0.01) -> tuple[Phase, ...]:
    """The phases of `copied`, called ``"1"``, ``"2"`` and so on."""
    check_number("points", points, at_least=1)
    ends, lasts = np.asarray(times, dtype=float), float(centreline.time[-1] - centreline.time[0])
    if not len(ends) or np.diff(ends, prepend=0.0).min() < LEAST or ends[-1] > lasts + 1e-9:
        raise OctoctrlError(
            f"times {list(times)}: instants within the {lasts:g} s of the centreline are needed, at least {LEAST:g} s apart"
        )
    return tuple(
        Phase(
            name=str(index + 1), duration=float(end - begin), shortest=float(end - begin), longest=float(end - begin),
            goals=(ShapeGoal(value=tuple(map(tuple, _shape(centreline, end, points).tolist())), tolerance=tolerance),),
        )
        for index, (begin, end) in enumerate(zip([0.0, *ends[:-1]], ends, strict=True))
    )  # fmt: skip


def check_like(centreline: Centreline, arm: Arm) -> None:
    """Check that a centreline could be that of an arm which stands at the origin.

    Parameters
    ----------
    centreline : Centreline
    arm : Arm

    Raises
    ------
    OctoctrlError
        If it is much longer or shorter than the arm at its first instant, or its base stands elsewhere or points elsewhere.
    """
    length, base = float(centreline.length[0]), centreline.points[0, 0]
    if abs(length / arm.length - 1) > LENGTH:
        raise OctoctrlError(
            f"the centreline is {1e3 * length:.3g} mm long at first, the arm {1e3 * arm.length:.3g} mm; scale the positions, or give "
            "arm.length what was measured"
        )
    first = centreline.points[0, 1] - base
    if np.linalg.norm(base) > ASIDE * arm.length or first @ BASE_TANGENT < LEANING * np.linalg.norm(first):
        stands = ", ".join(f"{1e3 * number:.3g}" for number in base)
        leaves = ", ".join(f"{number:.2g}" for number in first / np.linalg.norm(first))
        raise OctoctrlError(
            f"the centreline begins at ({stands}) mm in the direction ({leaves}); the arm's base is at the origin and leaves it along +y: "
            "shift and turn the positions"
        )


def _shape(centreline: Centreline, time: float, points: int) -> Floats:
    """Points (K, 3) at equal shares of the length, some time after the first instant."""
    flat = centreline.points.reshape(len(centreline.time), -1)
    line = np.array([np.interp(centreline.time[0] + time, centreline.time, column) for column in flat.T]).reshape(-1, 3)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    wanted = along[-1] * np.arange(1, points + 1) / points
    return np.stack([np.interp(wanted, along, axis) for axis in line.T], axis=1)
