"""Measured centrelines from CSV: one row for each point at each instant.

    time [s],point,x [mm],y [mm],z [mm],line
    0.00,0,0.1,0.0,-0.2,axis
    0.00,1,0.3,9.8,-0.1,axis

The columns `time`, `point`, `x`, `y`, `z` are needed; `point` counts from the base. `line` is there where a second line of markers on the
skin was measured: ``axis`` or ``skin``. Units stand in the headings, or are given. Separators are commas, semicolons or tabs.
"""

import csv
import re
from collections.abc import Iterator
from math import isfinite
from pathlib import Path

import numpy as np

from octoctrl.sim.archives import check_source
from octoctrl.sim.errors import OctoctrlError, brief, suggest
from octoctrl.sim.topology.centreline import Centreline

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}
TIMES = {"s": 1.0, "ms": 1e-3, "min": 60.0}
COLUMNS = ("time", "point", "x", "y", "z")
LINES = ("axis", "skin")
LARGEST = 200_000_000
"""Bytes of a file that is read at all."""


def read_centreline(path: str | Path, *, unit: str | None = None) -> Centreline:
    """Read a measured centreline, and the markers on the skin if there are any.

    Parameters
    ----------
    path : str or Path
        A CSV file with columns ``time``, ``point``, ``x``, ``y``, ``z`` and, if markers were measured, ``line`` (``axis`` or ``skin``).
    unit : {"m", "cm", "mm", "um"}, optional
        Of the lengths; the headings say it if omitted, for example ``x [mm]``. Times are seconds unless the heading says otherwise.

    Returns
    -------
    Centreline

    Raises
    ------
    OctoctrlError
        With the line of the file: if it cannot be read, a column or the unit is missing, a value is not a finite number, a point is doubled
        or missing, or what `Centreline` refuses.
    """
    path = Path(path)
    if unit is not None and unit not in LENGTHS:
        raise OctoctrlError(f"unknown unit '{unit}'{suggest(unit, LENGTHS)} ({', '.join(LENGTHS)})")
    rows = _rows(path)
    header = next(rows, None)
    if header is None:
        raise OctoctrlError(f"{path} is empty; a heading with {', '.join(COLUMNS)} and a row for each point are needed")
    places, scales = _columns(path, header[1], unit)
    found: dict[str, dict[float, dict[int, tuple[float, float, float]]]] = {name: {} for name in LINES}
    for number, row in rows:
        time, point, x, y, z = (_number(path, number, row, places[name], name) for name in COLUMNS)
        line = row[places["line"]].strip() if "line" in places and places["line"] < len(row) else "axis"
        if line not in found:
            raise OctoctrlError(f"{path}:{number}: line is '{brief(line)}'{suggest(line, LINES)}; 'axis' or 'skin' is needed")
        if point != int(point) or point < 0:
            raise OctoctrlError(f"{path}:{number}: point is {point:g}; points count 0, 1, 2, ... from the base")
        instant = found[line].setdefault(time * scales["time"], {})
        if int(point) in instant:
            raise OctoctrlError(f"{path}:{number}: point {point:g} of {line} at time {time:g} is there already; one row each is needed")
        instant[int(point)] = (x * scales["x"], y * scales["y"], z * scales["z"])
    if not found["axis"]:
        raise OctoctrlError(f"{path} holds no point of the centreline; a row for each point at each instant is needed")
    times, points = _series(path, "axis", found["axis"])
    markers = None
    if found["skin"]:
        when, markers = _series(path, "skin", found["skin"])
        if when.shape != times.shape or np.any(when != times) or markers.shape != points.shape:
            raise OctoctrlError(
                f"{path}: the skin has {len(when)} instants of {markers.shape[1]} markers, the axis {len(times)} of {points.shape[1]} "
                "points; one marker beside each point at each instant is needed"
            )
    try:
        return Centreline(name=path.stem, time=times, points=points, markers=markers)
    except OctoctrlError as error:
        raise OctoctrlError(f"{path}: {error}") from None


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Rows of a CSV file with their numbers, empty ones and those that begin with # left out."""
    check_source(path)
    try:
        if path.stat().st_size > LARGEST:
            raise OctoctrlError(f"{path} has {path.stat().st_size / 1e6:.0f} MB, {LARGEST / 1e6:.0f} are read at most; keep fewer instants")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise OctoctrlError(f"{path} cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise OctoctrlError(f"{path} is no text in UTF-8; export it again as CSV in UTF-8") from None
    lines = text.splitlines()
    first = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    separator = max(",;\t", key=first.count)
    try:
        for number, row in enumerate(csv.reader(lines, delimiter=separator), start=1):
            if row and any(cell.strip() for cell in row) and not row[0].startswith("#"):
                yield number, row
    except csv.Error as error:
        raise OctoctrlError(f"{path} is no table: {error}; export it again as CSV") from None


def _columns(path: Path, header: list[str], unit: str | None) -> tuple[dict[str, int], dict[str, float]]:
    """Place of each column, and the factors to SI of those that have a unit."""
    places, scales = {}, {}
    for place, cell in enumerate(header):
        match = re.fullmatch(r"\s*(\w+)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*", cell)
        name = match[1].lower() if match else ""
        if not match or name not in (*COLUMNS, "line"):
            continue
        if name in places:
            raise OctoctrlError(f"{path} has two columns called '{name}'; leave one out")
        places[name] = place
        if name in ("x", "y", "z", "time"):
            known, given = (TIMES, "s") if name == "time" else (LENGTHS, unit)
            said = match[2] or given
            if said is None:
                raise OctoctrlError(
                    f"{path} does not say its unit of length; write it into the headings, as in 'x [mm]', or give unit='mm'"
                )
            if said not in known:
                raise OctoctrlError(f"{path}: unknown unit '{brief(said)}' of {name}{suggest(said, known)} ({', '.join(known)})")
            scales[name] = known[said]
    missing = [name for name in COLUMNS if name not in places]
    if missing:
        there = ", ".join(cell.strip()[:40] for cell in header[:8])
        raise OctoctrlError(f"{path} has no column {', '.join(missing)} (found: {there}); {', '.join(COLUMNS)} are needed")
    return places, scales


def _number(path: Path, number: int, row: list[str], place: int, name: str) -> float:
    cell = row[place].strip() if place < len(row) else ""
    try:
        value = float(cell)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise OctoctrlError(
            f"{path}:{number}: {name} is '{brief(cell)}'; a finite number is needed (leave out instants that are not whole)"
        )
    return value


def _series(path: Path, line: str, instants: dict[float, dict[int, tuple[float, float, float]]]) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,), s, and places (T, n, 3), m; every instant must have the points 0 to n - 1."""
    times = sorted(instants)
    count = max(len(points) for points in instants.values())
    for time in times:
        missing = sorted(set(range(count)) - set(instants[time]))
        if missing or len(instants[time]) != count:
            raise OctoctrlError(
                f"{path}: the {line} at time {time:g} s has {len(instants[time])} points, other instants {count}"
                f"{f'; point {missing[0]} is missing' if missing else ''}: every instant needs the points 0 to {count - 1}"
            )
    return np.array(times), np.array([[instants[time][index] for index in range(count)] for time in times])
