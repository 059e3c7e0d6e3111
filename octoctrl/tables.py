"""Tables of text, numbers as JSON knows them, and what machine a figure belongs to."""

import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import metadata
from math import isfinite
from typing import Any

import numpy as np


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Align columns of text, `headings` and `rows`, in lines: the first to the left, the others to the right."""
    widths = [max(len(row[column]) for row in [headings, *rows]) for column in range(len(headings))]
    lines = []
    for row in [headings, *rows]:
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        lines.append((" " + "   ".join(cells)).rstrip())
    return lines


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Results in rows: as text, as Markdown, as plain data.

    Attributes
    ----------
    name, title, note : str
        `note` says what was measured and how.
    columns, formats : tuple of str
        Headings with units, and format specifications of the columns' numbers.
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
    rows: tuple[tuple[Any, ...], ...]
    curve: tuple[str, str, str] | None = None

    def cells(self) -> list[tuple[str, ...]]:
        """Rows as texts, a tuple for each."""
        return [
            tuple(
                "" if value is None else value if isinstance(value, str) else format(value, form)
                for value, form in zip(row, self.formats, strict=True)
            )
            for row in self.rows
        ]

    def __str__(self) -> str:
        return "\n".join([f"{self.title}", *table(self.columns, self.cells()), f" {self.note}"])

    def markdown(self) -> str:
        """The table for a page of documentation."""
        lines = [" | ".join(self.columns), " | ".join("---" for _ in self.columns), *(" | ".join(row) for row in self.cells())]
        return "\n".join([f"## {self.title}", "", *(f"| {line} |" for line in lines), "", self.note])

    def content(self) -> dict[str, Any]:
        """The table as plain data."""
        return {"title": self.title, "note": self.note, "rows": [dict(zip(self.columns, plain(row), strict=True)) for row in self.rows]}


def plain(value: Any) -> Any:
    """Turn numbers of NumPy, infinities and tuples in `value` into what JSON knows; infinite and undefined numbers become None."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float) and not isfinite(value):
        return None
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, tuple | list):
        return [plain(inner) for inner in value]
    return value if isinstance(value, int | float | str | bool | None) else str(value)


def number(value: float) -> str:
    """Write `value` with at most four significant digits, whole numbers as such."""
    return f"{value:.0f}" if value == round(value) and abs(value) < 1e6 else f"{value:.4f}" if abs(value) >= 1e-3 else f"{value:.1e}"


def machine() -> dict[str, str]:
    """The machine and the versions that the figures belong to."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            processor = next(line.partition(":")[2].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        processor = platform.processor() or platform.machine()
    versions = {name: metadata.version(name) for name in ("numpy", "numba", "casadi", "scipy")}
    return {
        "processor": processor,
        "cores": str(os.cpu_count()),
        "system": platform.system(),
        "Python": platform.python_version(),
        **versions,
    }


def fastest(work: Callable[[], object], times: int) -> tuple[float, float]:
    """Processor and wall time of the fastest of so many `times` of `work`, both in s."""
    spent = np.full(2, np.inf)
    for _ in range(times):
        begin = time.process_time(), time.perf_counter()
        work()
        spent = np.minimum(spent, (time.process_time() - begin[0], time.perf_counter() - begin[1]))
    return float(spent[0]), float(spent[1])
