"""Benchmarks that anyone can repeat: tables of run time against error, of step limits, of what is skipped, and of start-up.

Times are processor times, each the fastest of several runs of the same short stretch: on a shared machine the others measure the
neighbours. Failures (refused, stopped) stay in the tables.
"""

import json
import time
from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.errors import OctoctrlError, check_choice, check_count
from octoctrl.sim.plants import check_plant
from octoctrl.sim.running.recording import Recording

from ..files.writing import write_figure, write_text
from ..progress import Progress
from ..tables import Table, machine

PARTS = {
    "rod": ("octoctrl.bench.precision", "rod_precision"),
    "assembly": ("octoctrl.bench.precision", "assembly_precision"),
    "mixed": ("octoctrl.bench.mixed", "mixed_precision"),
    "reduced": ("octoctrl.bench.precision", "reduced_precision"),
    "closed-forms": ("octoctrl.bench.closed_forms", "closed_forms"),
    "scaling": ("octoctrl.bench.speed", "scaling"),
    "skips": ("octoctrl.bench.speed", "skips"),
    "steps": ("octoctrl.bench.steps", "steps"),
    "startup": ("octoctrl.bench.startup", "startup"),
    "plans": ("octoctrl.bench.planning", "plans"),
    "choice": ("octoctrl.bench.planning", "choice"),
    "following": ("octoctrl.bench.planning", "following"),
    "mending": ("octoctrl.bench.mending", "mending"),
    "correcting": ("octoctrl.bench.correcting", "correcting"),
    "tracking": ("octoctrl.bench.tracking", "tracking"),
}
"""Module and function of each part."""

DRAWN = ("plans", "choice", "following", "mending")
"""Parts on random goals and plants, whose number and seed can be told."""
MOVED = ("tracking",)
"""Parts whose plants can be told."""
TOGETHER = "tasks"
"""What the parts on tasks are called together, `DRAWN` and `MOVED`."""

QUICK = ("rod", "reduced", "closed-forms", "scaling", "skips", "steps", "startup")
"""What runs when no part is named: all but the full arm, whose compilation takes a minute."""


def run(
    parts: Iterable[str] = (),
    *,
    full: bool = False,
    count: int | None = None,
    seed: int | None = None,
    plants: Sequence[str] = (),
    progress: Progress | None = None,
) -> list[Table]:
    """Run parts of the benchmark.

    Parameters
    ----------
    parts : iterable of str
        Of `PARTS`, or `TOGETHER` for those on tasks; `QUICK` if empty, all of them with `full`.
    full : bool
        More cases.
    count, seed : int, optional
        How many random goals and plants, and which; of the parts `DRAWN`.
    plants : sequence of str
        Names of plants; of the parts `MOVED`.
    progress : Progress, optional

    Returns
    -------
    list of Table

    Raises
    ------
    OctoctrlError
        If a part is unknown, or a setting is of none of them.
    """
    asked = tuple(parts) or (tuple(PARTS) if full else QUICK)
    for name in asked:
        check_choice("part", name, (*PARTS, TOGETHER))
    chosen = tuple(part for name in asked for part in ((*DRAWN, *MOVED) if name == TOGETHER else (name,)))
    for setting, value, of in (("count", count, DRAWN), ("seed", seed, DRAWN), ("plants", plants or None, MOVED)):
        if value is not None and not set(of) & set(chosen):
            raise OctoctrlError(f"{setting} is for {', '.join(of)} alone, not for {', '.join(chosen)}; leave it out")
    if count is not None:
        check_count("count", count)
    if seed is not None:
        check_count("seed", seed, at_least=0)
    for name in plants:
        check_plant(name)
    size = {name: value for name, value in (("count", count), ("seed", seed)) if value is not None}
    given = dict.fromkeys(DRAWN, size) | dict.fromkeys(MOVED, {"plants": tuple(plants)} if plants else {})
    found = []
    for done, name in enumerate(chosen):
        if progress is not None:
            progress.start(f"benchmark {name} ({done + 1} of {len(chosen)})")
        module, function = PARTS[name]
        found.append(getattr(import_module(module), function)(full=full, **given.get(name, {})))
    if progress is not None:
        progress.stop()
    return found


def page_text(tables: Sequence[Table], command: str) -> str:
    """Results, `tables`, as one page of documentation that `command` makes anew."""
    found = machine()
    described = f"{found.pop('processor')}, {found.pop('cores')} cores, {found.pop('system')}, "
    described += ", ".join(f"{name} {version}" for name, version in found.items())
    head = [
        "# Benchmarks",
        f"Made by `{command}` on: {described}.",
        "Times are processor times, each the fastest of several runs of the same stretch; compilation is not counted unless said. On a "
        "busy machine they vary by some ten percent, ratios less, errors not at all.",
    ]
    return "\n\n".join([*head, *(item.markdown() for item in tables)]) + "\n"


def write(
    tables: Sequence[Table], command: str, *, output: Path | None = None, picture: Path | None = None, page: Path | None = None
) -> None:
    """Write results, `tables`, that `command` made: as JSON (`output`), as a plot (`picture`) and as a `page` of documentation."""
    if output is not None:
        content = {"command": command, "machine": machine(), "tables": {item.name: item.content() for item in tables}}
        write_text(output, json.dumps(content, indent=2))
    if page is not None:
        write_text(page, page_text(tables, command))
    if picture is not None:
        draw(tables, picture)


def draw(tables: Sequence[Table], path: Path) -> None:
    """Plot run time against error.

    Parameters
    ----------
    tables : sequence of Table
        Those without such a curve are left out.
    path : Path
        Of the picture.

    Raises
    ------
    OctoctrlError
        If no table has a curve.
    """
    from matplotlib.figure import Figure

    drawn = [(item, item.curve) for item in tables if item.curve]
    if not drawn:
        raise OctoctrlError("nothing to plot; run one of the parts rod, assembly, reduced, closed-forms")
    figure = Figure(figsize=(5.2 * len(drawn), 4.2), layout="constrained")
    for axes, (item, curve) in zip(np.atleast_1d(figure.subplots(1, len(drawn))), drawn, strict=True):
        error, cost, case = (item.columns.index(name) for name in curve)
        for label in dict.fromkeys(row[case] for row in item.rows):
            points = [(row[error], row[cost]) for row in item.rows if row[case] == label and row[error] and row[cost]]
            axes.loglog(*zip(*sorted(points), strict=True), "o-", label=label) if points else None
        axes.set(xlabel=curve[0], ylabel=curve[1], title=item.title)
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize="small")
    write_figure(path, figure, dpi=150)


def timed_motion(plant: Any, activation: Activation, duration: float, times: int, piece: float = 1.0) -> tuple[Recording, float, float]:
    """Move a plant by `activation` for `duration` (s) and measure how long that takes.

    Parameters
    ----------
    plant : Plant
    activation : Activation
    duration : float, s
    times : int
        How often it moves; every piece counts at its fastest.
    piece : float, s
        Length of the pieces.

    Returns
    -------
    recording : Recording
    float, float
        Processor time and wall time, s.
    """
    count = max(1, round(duration / piece))
    spent = np.full((count, 2), np.inf)
    for _ in range(times):
        plant.reset()
        pieces = []
        for index in range(count):
            begin = time.process_time(), time.perf_counter()
            pieces.append(plant.advance(activation, duration / count))
            spent[index] = np.minimum(spent[index], (time.process_time() - begin[0], time.perf_counter() - begin[1]))
    cpu, wall = spent.sum(axis=0)
    return Recording.joined(pieces), float(cpu), float(wall)
