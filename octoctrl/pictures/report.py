"""A run as one page: the arm in space, planned against simulated, and the verdict, in a single file that opens anywhere without a network.

The page holds its own script and data (`octoctrl.pictures.packing`). One clock moves all of it: slider, traces, kymographs, numbers, arms.
The same run gives the same bytes.
"""

import html
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np

from octoctrl.sim.errors import OctoctrlError, check_kind

from ..carrying.results import Execution
from ..files.writing import check_target, write_text
from ..judging.verification import verify
from .motion import Motion, motion_of
from .notebook import Page
from .packing import Floats, pack
from .sections import Kymograph, heading, section
from .solids import pose, solids
from .strands import strand_layers

_PAGE = Path(__file__).parent / "page"
_SCRIPTS = ("numbers.js", "solids.js", "tubes.js", "viewer.js")
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"
_SIDES, _CUTS = 28, 4
"""Corners of a section of the skin, and cuts of each stretch between places."""
_CLIPPED = 0.99
"""Share of the values that a scale of colours covers: a whipping tip would wash out all else."""
_SHOWN = 0.62
"""Share of the run at which the page opens."""


@overload
def report(runs: Execution | Sequence[Execution], path: None = None) -> Page: ...


@overload
def report(runs: Execution | Sequence[Execution], path: str | Path, *, overwrite: bool = False) -> Path: ...


def report(runs: Execution | Sequence[Execution], path: str | Path | None = None, *, overwrite: bool = False) -> Page | Path:
    """Write runs as one self-contained page.

    Parameters
    ----------
    runs : Execution or sequence of Execution
        Several are put side by side, with one clock.
    path : str or Path, optional
        Of the page (.html).
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path, or Page
        The page itself, which a notebook shows, if no path is given.

    Raises
    ------
    OctoctrlError
        If the suffix is another one, the file exists, or there is no run.
    """
    chosen: list[Any] = list(runs) if isinstance(runs, list | tuple) else [runs]
    for run in chosen:
        check_kind("run", run, Execution, "what oc.execute gives, or oc.load of its file")
    if not chosen:
        raise OctoctrlError("a report needs at least one run; the list is empty")
    if path is None:
        return Page(page(chosen))
    return write_text(check_target(path, overwrite=overwrite, suffixes=(".html",)), page(chosen))


def page(runs: Sequence[Execution]) -> str:
    """Write runs as the text of a page (HTML).

    Parameters
    ----------
    runs : sequence of Execution

    Returns
    -------
    str
    """
    heads, sections, data = [], [], []
    verdicts = [verify(run) for run in runs]
    for number, (run, verdict) in enumerate(zip(runs, verdicts, strict=True)):
        motion = motion_of(run)
        arrays, kymographs = _arrays(motion)
        inside, layers, meshes = _scene(run, motion)
        contents, text = pack(arrays | inside)
        heads.append({**_head(run, motion, arrays), "arrays": contents, "layers": layers, "solids": meshes})
        shown = [(layer["name"], layer["visible"]) for layer in layers] + ([("objects", True)] if meshes else [])
        sections.append(section(number, run, verdict, list(heads[-1]["fields"]), shown, kymographs, several=len(runs) > 1))
        data.append(f'<script type="text/plain" id="data-{number}">{text}</script>')
    end = max(run["time"][-1] for run in heads)
    head = json.dumps({"runs": heads, "first": round(_SHOWN * end, 4)}, allow_nan=False).replace("</", "<\\/")
    title = " and ".join(dict.fromkeys(run.plan.task.name for run in runs))
    scripts = "".join(f"<script>{(_PAGE / name).read_text(encoding='utf-8')}</script>" for name in _SCRIPTS)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}"><title>{html.escape(title)}</title>'
        f'<link rel="icon" href="data:,"><style>{(_PAGE / "style.css").read_text(encoding="utf-8")}</style></head><body>'
        f"{heading(runs, verdicts)}{''.join(sections)}"
        f'<script type="application/json" id="head">{head}</script>{"".join(data)}{scripts}</body></html>'
    )


def _arrays(motion: Motion) -> tuple[dict[str, Floats], list[Kymograph]]:
    """Each number of the page once, in mm and 1/m, and which of them are drawn over time and arclength."""
    arrays = {
        "points": 1e3 * motion.points[:, None],
        "normals": motion.normals[:, None],
        "radius": 1e3 * motion.radius[:, None],
        "curvature": motion.curvature,
        "twist": motion.twist,
    }
    kymographs = [Kymograph("curvature, simulated", "curvature", "curvature")]
    if motion.planned_points is not None and motion.planned_curvature is not None and motion.distance is not None:
        arrays |= {
            "planned": 1e3 * motion.planned_points[:, None],
            "planned curvature": motion.planned_curvature,
            "curvature difference": motion.curvature - motion.planned_curvature,
            "distance": 1e3 * motion.distance,
        }
        kymographs.append(Kymograph("curvature, planned", "planned curvature", "curvature"))
        kymographs.append(Kymograph("simulated minus planned", "curvature difference", "difference"))
    kymographs.append(Kymograph("twist density", "twist", "twist density"))
    if motion.levels:
        arrays["activation"] = np.maximum.reduce(list(motion.levels.values()))
        arrays |= {f"level {group}": levels for group, levels in motion.levels.items()}
        kymographs += [Kymograph(f"activation {group}", f"level {group}", "activation", small=True) for group in motion.levels]
    return arrays, kymographs


def _scene(run: Execution, motion: Motion) -> tuple[dict[str, Floats], list[dict[str, Any]], list[dict[str, Any]]]:
    """What stands in space besides the arm's own arrays: rods and objects with theirs, all layers, and the meshes of the objects."""
    skin = {"points": "points", "normals": "normals", "radius": "radius", "sides": _SIDES, "cuts": _CUTS}
    layers = [{"name": "arm", "visible": run.strands is None, **skin}]
    if motion.planned_points is not None:
        layers.append({"name": "planned", "points": "planned", "thickness": 0.8, "sides": 8, "cuts": _CUTS, "visible": True})
    arrays, meshes = solids(run, motion.chosen)
    if run.strands is not None:
        more, rods = strand_layers(run.strands, motion.time)
        arrays, layers = arrays | more, layers + rods
    return arrays, layers, meshes


def _head(run: Execution, motion: Motion, arrays: dict[str, Floats]) -> dict[str, Any]:
    """What the page's script knows of a run besides its arrays and what stands in space."""
    bend, twist = (float(np.quantile(np.abs(arrays[name]), _CLIPPED)) for name in ("curvature", "twist"))
    fields = {
        "curvature": {"array": "curvature", "map": "viridis", "low": 0.0, "high": bend, "unit": "1/m"},
        "twist density": {"array": "twist", "map": "balance", "low": -twist, "high": twist, "unit": "rad/m"},
    }
    kymographs = {}
    if "activation" in arrays:
        fields["activation"] = {"array": "activation", "map": "viridis", "low": 0.0, "high": float(arrays["activation"].max()), "unit": ""}
    if "planned" in arrays:
        fields["distance from the plan"] = {
            "array": "distance", "map": "viridis", "low": 0.0, "high": float(arrays["distance"].max()), "unit": "mm",
        }  # fmt: skip
        kymographs["difference"] = {"map": "balance", "low": -bend / 2, "high": bend / 2, "unit": "1/m"}
    series = {"Lk": run.trace.lifted_link, "Wr": run.trace.lifted_writhe, "Tw": run.trace.twist}
    begins = [0.0, *(event.actual for event in run.events)]
    return {
        "time": _rounded(motion.time, 4),
        "fields": fields,
        "kymographs": kymographs,
        "camera": _camera(run, motion),
        "series": {name: _rounded(np.interp(motion.time, run.trace.time, values), 4) for name, values in series.items()},
        "phases": [{"name": name, "begin": begin} for name, begin in zip(run.plan.phase_begins, begins, strict=False)],
    }


def _camera(run: Execution, motion: Motion) -> dict[str, list[Any]]:
    """Centre and size of what is in view over time (mm), following the arm, and the objects that are smaller than it, without jerks."""
    from scipy.ndimage import gaussian_filter1d, maximum_filter1d

    points, count = 1e3 * motion.points, len(motion.time)
    small = [item for item in run.plan.scene.objects if item.bound < run.plan.arm.length / 2]
    ends = [1e3 * (pose(run.recording, item, motion.chosen)[0] + sign * item.bound) for item in small for sign in (-1, 1)]
    points = np.concatenate([points, *(place[:, None] for place in ends)], axis=1)
    middle = (points.min(axis=1) + points.max(axis=1)) / 2
    centre = gaussian_filter1d(middle, max(count / 18, 0.1), axis=0, mode="nearest")
    size = 2 * np.linalg.norm(points - centre[:, None], axis=2).max(axis=1) + 4e3 * motion.radius.max()
    size = gaussian_filter1d(maximum_filter1d(size, max(count // 9, 1)), max(count / 25, 0.1), mode="nearest")
    return {"centre": [_rounded(column, 2) for column in centre.T], "size": _rounded(size, 2)}


def _rounded(values: Floats, digits: int) -> list[float]:
    return [round(float(value), digits) for value in values]
