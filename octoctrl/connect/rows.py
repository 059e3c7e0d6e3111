"""Rows of a sweep as a file that grows by lines of JSON: a line that a kill has torn is run again, what is known is not."""

import csv
import io
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from octoctrl.sim.errors import OctoctrlError

from ..files.parts import hold
from ..files.writing import check_target, write_text

FIRST = ("index", "status", "verdict")
"""Columns of the table that come first, and `LAST` those that come last; between them, in order of appearance, all others."""
LAST = ("note", "hash", "seconds", "key")


def read_rows(path: Path) -> dict[str, dict[str, Any]]:
    """The whole rows in a file at `path` by their keys, none if there is no file."""
    rows = {}
    for line in path.read_bytes().splitlines() if path.is_file() else ():
        try:
            row = json.loads(line)
            rows[str(row["key"])] = {**row, "index": int(row["index"])}
        except (ValueError, TypeError, KeyError, RecursionError):
            continue
    return rows


class Rows:
    """A file of rows, held by this process until it is closed.

    Parameters
    ----------
    path : Path

    Raises
    ------
    OctoctrlError
        If it cannot be written, another process holds it, or it holds something else.
    """

    def __init__(self, path: Path) -> None:
        self.path = check_target(path, overwrite=True, suffixes=(".jsonl",))
        if self.path.exists() and not read_rows(self.path) and not _torn(self.path.read_bytes()):
            raise OctoctrlError(f"{self.path} holds something else than rows of a sweep; give another path")
        self._handle = hold(self.path, self.path)
        self.known = read_rows(self.path)
        content = self.path.read_bytes()
        os.truncate(self.path, content.rfind(b"\n") + 1)

    def __enter__(self) -> "Rows":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        os.close(self._handle)

    def add(self, row: Mapping[str, Any]) -> None:
        """Append a `row`; it is with the operating system when this returns."""
        self.known[row["key"]] = dict(row)
        with open(self.path, "ab", buffering=0) as file:
            file.write(json.dumps(row, allow_nan=False).encode() + b"\n")


def _torn(content: bytes) -> bool:
    """Whether this is nothing, or the begin of a first row."""
    return not content.strip() or (content.startswith(b"{") and b"}" not in content)


def check_table(path: Path) -> Path:
    """Check that a table at `path`, which is returned, may be replaced.

    Raises
    ------
    OctoctrlError
        If there is another file there.
    """
    if path.is_file() and path.read_bytes().strip() and not path.read_bytes().startswith(FIRST[0].encode()):
        raise OctoctrlError(f"{path} exists and is no table of a sweep; give another path for the rows, beside which the table goes")
    return path


def write_table(path: Path, rows: Iterable[Mapping[str, Any]]) -> Path:
    """Write `rows` by index as a CSV table at `path`, which is returned."""
    ordered = sorted(rows, key=lambda row: int(row["index"]))
    between = dict.fromkeys(name for row in ordered for name in row if name not in (*FIRST, *LAST))
    names = [name for name in (*FIRST, *between, *LAST) if any(name in row for row in ordered)]
    text = io.StringIO()
    table = csv.DictWriter(text, names, lineterminator="\n")
    table.writeheader()
    table.writerows({name: "" if value is None else value for name, value in row.items()} for row in ordered)
    return write_text(check_table(path), text.getvalue())


def gather(folder: Path, stem: str) -> dict[str, dict[str, Any]]:
    """The rows of all shares of a sweep called `stem`, and its own, in a `folder`.

    Raises
    ------
    OctoctrlError
        If there are none.
    """
    found = [folder / f"{stem}.jsonl", *sorted(folder.glob(f"{stem}.*-of-*.jsonl"))]
    rows = {key: row for path in found for key, row in read_rows(path).items()}
    if not rows:
        raise OctoctrlError(f"there are no rows of '{stem}' in {folder}; run it with --share first")
    return rows
