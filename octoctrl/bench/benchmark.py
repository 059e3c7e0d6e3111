"""Benchmarks that anyone can repeat: tables of run time against error, of step limits, of what is skipped, and of start-up.

Times are processor times, each the fastest of several runs of the same short stretch: on a shared machine the others measure the
neighbours. Failures (refused, stopped) stay in the tables.
"""

import json
import time
from dataclasses import dataclass
from importlib import import_module

import numpy as np

from octoctrl.sim.errors import OctoctrlError, check_choice

from ..files.writing import write_figure, write_text
from ..tables import machine, plain, table

PARTS = {
    "rod": ("octoctrl.bench.precision", "rod_precision"),
    "assembly": ("octoctrl.bench.precision", "assembly_precision"),
    "reduced": ("octoctrl.bench.precision", "reduced_precision"),
    "closed-forms": ("octoctrl.bench.closed_forms", "closed_forms"),
    "scaling": ("octoctrl.bench.speed", "scaling"),
    "skips": ("octoctrl.bench.speed", "skips"),
    "steps": ("octoctrl.bench.steps", "steps"),
    "startup": ("octoctrl.bench.startup", "startup"),
    "stability": ("octoctrl.laboratory.benchmark", "stability"),
}
"""Module and function of each part."""

QUICK = ("rod", "reduced", "closed-forms", "scaling", "skips", "steps", "startup")
"""What runs when no part is named: all but the assembly, whose compilation takes a minute."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Results of one part.

    Attributes
    ----------
    name, title, note : str
        `note` says what was measured and how.
    columns : tuple of str
        Headings with units.
    formats : tuple of str
        Format specifications of the columns' numbers.
    rows : tuple of tuple
        Numbers, texts and None.
    curve : tuple of (str, str, str), optional
        Headings of error, time and case, for a plot.
    """

    name: str
    title: str
    note: str
    columns: tuple[str, ...]
    formats: tuple[str, ...]
    rows: tuple[tuple, ...]
    curve: tuple[str, str, str] | None = None

    def cells(self):
        """Rows as texts, a tuple for each."""
        return [
            tuple(
                "" if value is None else value if isinstance(value, str) else format(value, form)
                for value, form in zip(row, self.formats, strict=True)
            )
            for row in self.rows
        ]

    def __str__(self):
        return "\n".join([f"{self.title}", *table(self.columns, self.cells()), f" {self.note}"])

    def markdown(self):
        """The table for a page of documentation, as str."""
        lines = [" | ".join(self.columns), " | ".join("---" for _ in self.columns), *(" | ".join(row) for row in self.cells())]
        return "\n".join([f"## {self.title}", "", *(f"| {line} |" for line in lines), "", self.note])

    def content(self):
        """The table as plain data, a dict."""
        return {"title": self.title, "note": self.note, "rows": [dict(zip(self.columns, plain(row), strict=True)) for row in self.rows]}


def run(parts=(), *, full=False, progress=None):
    """Run parts of the benchmark.

    Parameters
    ----------
    parts : iterable of str
        Of `PARTS`; `QUICK` if empty, all of them with `full`.
    full : bool
        More cases.
    progress : Progress, optional

    Returns
    -------
    list of Table

    Raises
    ------
    OctoctrlError
        If a part is unknown.
    """
    chosen = tuple(parts) or (tuple(PARTS) if full else QUICK)
    for name in chosen:
        check_choice("part", name, tuple(PARTS))
    found = []
    for done, name in enumerate(chosen):
        if progress is not None:
            progress.start(f"benchmark {name} ({done + 1} of {len(chosen)})")
        module, function = PARTS[name]
        found.append(getattr(import_module(module), function)(full=full))
    if progress is not None:
        progress.stop()
    return found


def page_text(tables, command):
    """Results as one page of documentation.

    Parameters
    ----------
    tables : list of Table
    command : str
        What makes the page anew.

    Returns
    -------
    str
    """
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


def write(tables, command, *, output=None, picture=None, page=None):
    """Write results to files.

    Parameters
    ----------
    tables : list of Table
    command : str
        What made them.
    output, picture, page : Path, optional
        JSON, plot and page of documentation.
    """
    if output is not None:
        content = {"command": command, "machine": machine(), "tables": {item.name: item.content() for item in tables}}
        write_text(output, json.dumps(content, indent=2))
    if page is not None:
        write_text(page, page_text(tables, command))
    if picture is not None:
        draw(tables, picture)


def draw(tables, path):
    """Plot run time against error.

    Parameters
    ----------
    tables : list of Table
        Those without such a curve are left out.
    path : Path
        Of the picture.

    Raises
    ------
    OctoctrlError
        If no table has a curve.
    """
    from matplotlib.figure import Figure

    drawn = [item for item in tables if item.curve]
    if not drawn:
        raise OctoctrlError("nothing to plot; run one of the parts rod, assembly, reduced, closed-forms")
    figure = Figure(figsize=(5.2 * len(drawn), 4.2), layout="constrained")
    for axes, item in zip(np.atleast_1d(figure.subplots(1, len(drawn))), drawn, strict=True):
        error, cost, case = (item.columns.index(name) for name in item.curve)
        for label in dict.fromkeys(row[case] for row in item.rows):
            points = [(row[error], row[cost]) for row in item.rows if row[case] == label and row[error] and row[cost]]
            axes.loglog(*zip(*sorted(points), strict=True), "o-", label=label) if points else None
        axes.set(xlabel=item.curve[0], ylabel=item.curve[1], title=item.title)
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize="small")
    write_figure(path, figure, dpi=150)


def timed_motion(plant, activation, duration, times, piece=1.0):
    """Move a plant and measure how long that takes.

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
    float, s
        Processor time.
    float, s
        Wall time.
    """
    from octoctrl.sim.running.recording import Recording

    count = max(1, round(duration / piece))
    spent = np.full((count, 2), np.inf)
    for _ in range(times):
        plant.reset()
        pieces = []
        for index in range(count):
            begin = time.process_time(), time.perf_counter()
            pieces.append(plant.advance(activation, duration / count))
            spent[index] = np.minimum(spent[index], (time.process_time() - begin[0], time.perf_counter() - begin[1]))
    return Recording.joined(pieces), *(float(total) for total in spent.sum(axis=0))
