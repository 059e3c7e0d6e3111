"""Tasks that copy a measured motion: the table `[task.copy]` of a task file stands for its phases."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from octoctrl.planners.asking.copying import copied_phases
from octoctrl.planners.asking.task import Phase
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.topology.centreline import Centreline

from .centreline import read_centreline
from .conversion import build
from .toml_source import Source

KEY = ("task", "copy")


@dataclass(frozen=True, slots=True, kw_only=True)
class Copy:
    """What is copied.

    Attributes
    ----------
    file : str
        Table of the centreline, as `octoctrl.read_centreline` reads it, beside the task file.
    times : tuple of float, s
        Ends of the phases, which are called ``"1"``, ``"2"`` and so on.
    points : int
        Along the arm, whose distances count.
    tolerance : float, m
        Root mean square of the distances that still counts as reached.
    """

    unit: ClassVar[str] = "m"
    file: str
    times: tuple[float, ...]
    points: int = 8
    tolerance: float = 0.01

    def phases(self, centreline: Centreline) -> tuple[Phase, ...]:
        """A phase for each stretch of a `centreline`, whose goal is the shape at its end."""
        return copied_phases(centreline, times=self.times, points=self.points, tolerance=self.tolerance)


def copied_centreline(data: dict[str, Any], source: Source, folder: Path) -> Centreline | None:
    """Put phases into the place of a table `[task.copy]`.

    Parameters
    ----------
    data : dict
        Of the task file; changed.
    source : Source
        For messages.
    folder : Path
        Of the task file.

    Returns
    -------
    Centreline or None
        What is copied; None if the file has no such table.

    Raises
    ------
    OctoctrlError
        If the centreline cannot be read, or the table says something wrong.
    """
    task = data.get("task")
    if not isinstance(task, Mapping) or "copy" not in task:
        return None
    copy: Copy = build(Copy, task["copy"], source, KEY)
    if "phases" in task:
        raise OctoctrlError(f"{source.where((*KEY[:1], 'phases'))}: phases follow from task.copy; leave one of them out")
    try:
        centreline = read_centreline(folder / copy.file)
    except OctoctrlError as error:
        raise OctoctrlError(f"{source.where((*KEY, 'file'))}: {error}") from None
    try:
        phases = copy.phases(centreline)
    except OctoctrlError as error:
        raise OctoctrlError(f"{source.where(source.culprit(KEY, str(error)))}: {error}") from None
    data["task"] = {key: value for key, value in task.items() if key != "copy"} | {"phases": list(phases)}
    return centreline
