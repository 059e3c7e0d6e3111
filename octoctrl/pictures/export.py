"""A run for other programs: tables (.csv), a moving mesh (.glb), films (.gif, .webp, .mp4)."""

import csv
import io
from pathlib import Path

import numpy as np

from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.errors import check_choice, check_kind, check_number

from ..carrying.results import Execution
from ..files.writing import check_target, write_text, written_aside
from .film import PER_SECOND, film
from .gltf import glb
from .motion import outer_radius, rest_arclength

SUFFIXES = (".csv", ".glb", *PER_SECOND)
TABLES = ("shape", "traces")
"""What a .csv file may hold."""


def export(run: Execution, path: str | Path, *, table: str = "shape", speed: float = 1.0, overwrite: bool = False) -> Path:
    """Write a run in a format of other programs, by the suffix of the path.

    Parameters
    ----------
    run : Execution
    path : str or Path
        ``.csv``, ``.glb``, ``.gif``, ``.webp`` or ``.mp4``.
    table : {"shape", "traces"}
        Of a .csv file: the centreline and a line on the skin, which `octoctrl.read_centreline` reads; or planned and simulated topology and
        the largest level of each muscle group over time.
    speed : float
        Of a film over that of the arm.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path

    Raises
    ------
    OctoctrlError
        If the suffix or the table is unknown, the file exists, or a film needs what is not installed.
    """
    check_kind("run", run, Execution, "what oc.execute gives, or oc.load of its file")
    path = check_target(path, overwrite=overwrite, suffixes=SUFFIXES)
    check_choice("table", table, TABLES)
    check_number("speed", speed, at_least=0.01, at_most=100.0)
    if path.suffix == ".csv":
        return write_text(path, shape_table(run) if table == "shape" else traces_table(run))
    if path.suffix == ".glb":
        content = glb(run)
        with written_aside(path) as part:
            part.write_bytes(content)
        return path
    return film(run, path, speed=speed)


def shape_table(run: Execution) -> str:
    """The nodes of a `run`, and beside each the place on the skin towards LM3, as CSV with the columns that measured arms have."""
    recording = run.recording
    places = rest_arclength(recording)
    directors = np.stack([[np.interp(places, recording.stations, column) for column in frames.T] for frames in recording.frames[:, :, 0]])
    directors = np.moveaxis(directors, 1, 2)
    directors /= np.linalg.norm(directors, axis=2, keepdims=True)
    skin = recording.points + outer_radius(run.plan.arm, places)[:, None] * directors
    written = io.StringIO()
    rows = csv.writer(written, lineterminator="\n")
    rows.writerow(["time [s]", "point", "x [m]", "y [m]", "z [m]", "line"])
    for instant, time in enumerate(recording.time):
        for line, points in (("axis", recording.points[instant]), ("skin", skin[instant])):
            rows.writerows([f"{time:.9g}", number, *(f"{value:.9g}" for value in place), line] for number, place in enumerate(points))
    return written.getvalue()


def traces_table(run: Execution) -> str:
    """Planned and simulated link, writhe and twist of a `run`, turns, and the largest level of each group over time, as CSV."""
    names = ("lifted_link", "lifted_writhe", "twist", "link", "writhe", "crossings", "residual")
    columns = {"time [s]": run.recording.time, "clock [s]": run.clock}
    columns |= {f"{name} [turns]": np.asarray(getattr(run.trace, name), dtype=float) for name in names}
    columns |= {f"planned {name} [turns]": np.asarray(getattr(run.planned, name), dtype=float) for name in names[:3]}
    columns |= {group: run.recording.levels[:, index].max(axis=1) for index, group in enumerate(MUSCLE_GROUPS)}
    written = io.StringIO()
    rows = csv.writer(written, lineterminator="\n")
    rows.writerow(columns)
    rows.writerows([f"{value:.9g}" for value in row] for row in np.column_stack(list(columns.values())))
    return written.getvalue()
