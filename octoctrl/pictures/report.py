"""A run as one page: the arm in space, planned against simulated, and the verdict, in a single file that opens anywhere without a network.

The page holds its own script and data (`octoctrl.pictures.packing`). One clock moves all of it: slider, traces, kymographs, numbers, arms.
The same run gives the same bytes.
"""

import html
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..carrying.results import Execution, Verdict
from ..files.writing import check_target, write_text
from ..judging.verification import verify
from .motion import Motion, motion_of
from .packing import Floats, pack
from .traces import still_picture, traces_picture

_PAGE = Path(__file__).parent / "page"
_SCRIPTS = ("numbers.js", "tubes.js", "viewer.js")
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"
_SIDES, _CUTS = 28, 4
"""Corners of a section of the skin, and cuts of each stretch between places."""
_CLIPPED = 0.99
"""Share of the values that a scale of colours covers: a whipping tip would wash out all else."""
_SHOWN = 0.62
"""Share of the run at which the page opens."""


@dataclass(frozen=True, slots=True)
class _Kymograph:
    title: str
    array: str
    field: str
    small: bool = False


def report(runs: Execution | Sequence[Execution], path: str | Path, *, overwrite: bool = False) -> Path:
    """Write runs as one self-contained page.

    Parameters
    ----------
    runs : Execution or sequence of Execution
        Several are put side by side, with one clock.
    path : str or Path
        Of the page (.html).
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path

    Raises
    ------
    OctoctrlError
        If the suffix is another one or the file exists.
    """
    path = check_target(path, overwrite=overwrite, suffixes=(".html",))
    chosen = [runs] if isinstance(runs, Execution) else list(runs)
    return write_text(path, page(chosen))


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
        contents, text = pack(arrays)
        heads.append(_head(run, motion, contents, arrays))
        sections.append(_section(number, run, motion, verdict, kymographs, several=len(runs) > 1))
        data.append(f'<script type="text/plain" id="data-{number}">{text}</script>')
    end = max(run["time"][-1] for run in heads)
    head = json.dumps({"runs": heads, "first": round(_SHOWN * end, 4)}, allow_nan=False).replace("</", "<\\/")
    title = " and ".join(dict.fromkeys(run.plan.task.name for run in runs))
    scripts = "".join(f"<script>{(_PAGE / name).read_text(encoding='utf-8')}</script>" for name in _SCRIPTS)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}"><title>{html.escape(title)}</title>'
        f'<link rel="icon" href="data:,"><style>{(_PAGE / "style.css").read_text(encoding="utf-8")}</style></head><body>'
        f"{_heading(runs, verdicts)}{''.join(sections)}"
        f'<script type="application/json" id="head">{head}</script>{"".join(data)}{scripts}</body></html>'
    )


def _arrays(motion: Motion) -> tuple[dict[str, Floats], list[_Kymograph]]:
    """Each number of the page once, in mm and 1/m, and which of them are drawn over time and arclength."""
    arrays = {
        "points": 1e3 * motion.points[:, None],
        "normals": motion.normals[:, None],
        "radius": 1e3 * motion.radius[:, None],
        "curvature": motion.curvature,
        "twist": motion.twist,
    }
    kymographs = [_Kymograph("curvature, simulated", "curvature", "curvature")]
    if motion.planned_points is not None and motion.planned_curvature is not None and motion.distance is not None:
        arrays |= {
            "planned": 1e3 * motion.planned_points[:, None],
            "planned curvature": motion.planned_curvature,
            "curvature difference": motion.curvature - motion.planned_curvature,
            "distance": 1e3 * motion.distance,
        }
        kymographs.append(_Kymograph("curvature, planned", "planned curvature", "curvature"))
        kymographs.append(_Kymograph("simulated minus planned", "curvature difference", "difference"))
    kymographs.append(_Kymograph("twist density", "twist", "twist density"))
    if motion.levels:
        arrays["activation"] = np.maximum.reduce(list(motion.levels.values()))
        arrays |= {f"level {group}": levels for group, levels in motion.levels.items()}
        kymographs += [_Kymograph(f"activation {group}", f"level {group}", "activation", small=True) for group in motion.levels]
    return arrays, kymographs


def _head(run: Execution, motion: Motion, contents: dict[str, dict[str, object]], arrays: dict[str, Floats]) -> dict:
    """What the page's script knows of a run besides its arrays."""
    bend, twist = (float(np.quantile(np.abs(arrays[name]), _CLIPPED)) for name in ("curvature", "twist"))
    fields = {
        "curvature": {"array": "curvature", "map": "viridis", "low": 0.0, "high": bend, "unit": "1/m"},
        "twist density": {"array": "twist", "map": "balance", "low": -twist, "high": twist, "unit": "rad/m"},
    }
    layers = [
        {"name": "arm", "points": "points", "normals": "normals", "radius": "radius", "sides": _SIDES, "cuts": _CUTS, "visible": True}
    ]
    kymographs = {}
    if "activation" in arrays:
        fields["activation"] = {"array": "activation", "map": "viridis", "low": 0.0, "high": float(arrays["activation"].max()), "unit": ""}
    if "planned" in arrays:
        fields["distance from the plan"] = {
            "array": "distance", "map": "viridis", "low": 0.0, "high": float(arrays["distance"].max()), "unit": "mm",
        }  # fmt: skip
        layers.append({"name": "planned", "points": "planned", "thickness": 0.8, "sides": 8, "cuts": _CUTS, "visible": True})
        kymographs["difference"] = {"map": "balance", "low": -bend / 2, "high": bend / 2, "unit": "1/m"}
    series = {"Lk": run.trace.lifted_link, "Wr": run.trace.lifted_writhe, "Tw": run.trace.twist}
    begins = [0.0, *(event.actual for event in run.events)]
    return {
        "time": _rounded(motion.time, 4),
        "arrays": contents,
        "fields": fields,
        "kymographs": kymographs,
        "layers": layers,
        "camera": _camera(motion),
        "series": {name: _rounded(np.interp(motion.time, run.trace.time, values), 4) for name, values in series.items()},
        "phases": [{"name": name, "begin": begin} for name, begin in zip(run.plan.phase_begins, begins, strict=False)],
    }


def _camera(motion: Motion) -> dict[str, list]:
    """Centre and size of what is in view over time (mm), following the arm without jerks."""
    from scipy.ndimage import gaussian_filter1d, maximum_filter1d

    points, count = 1e3 * motion.points, len(motion.time)
    middle = (points.min(axis=1) + points.max(axis=1)) / 2
    centre = gaussian_filter1d(middle, max(count / 18, 0.1), axis=0, mode="nearest")
    size = 2 * np.linalg.norm(points - centre[:, None], axis=2).max(axis=1) + 4e3 * motion.radius.max()
    size = gaussian_filter1d(maximum_filter1d(size, max(count // 9, 1)), max(count / 25, 0.1), mode="nearest")
    return {"centre": [_rounded(column, 2) for column in centre.T], "size": _rounded(size, 2)}


def _rounded(values: Floats, digits: int) -> list[float]:
    return [round(float(value), digits) for value in values]


# ---------------------------------------------------------------- what is read


def _heading(runs: Sequence[Execution], verdicts: Sequence[Verdict]) -> str:
    said = []
    for run, verdict in zip(runs, verdicts, strict=True):
        good = sum(check.passed for check in verdict.checks)
        said.append(
            f"<div><h1>{html.escape(run.plan.task.name)}</h1>"
            f'<span class="badge {"pass" if verdict.passed else "fail"}">{"passed" if verdict.passed else "failed"} '
            f'{good} of {len(verdict.checks)}</span><span class="made">{html.escape(_made(run))}</span></div>'
        )
    return (
        f'<header>{"".join(said)}<div class="clock"><button id="play" aria-pressed="false">Play</button>'
        '<input id="time" type="range" min="0" value="0" step="any" aria-label="time"><output id="now"></output>'
        '<select id="speed" aria-label="speed"><option value="0.25">0.25 &times;</option><option value="1" selected>1 &times;</option>'
        '<option value="4">4 &times;</option></select></div></header>'
    )


def _made(run: Execution) -> str:
    end = float(run.recording.time[-1])
    return f"{end:.2f} s of arm {run.plan.arm.name}, plant {run.plant}, feedback {run.feedback}. {run.status.value}"


def _section(number: int, run: Execution, motion: Motion, verdict: Verdict, kymographs: list[_Kymograph], *, several: bool) -> str:
    svg, left, width = traces_picture(run)
    fields = ["curvature", "twist density", *(["activation"] if motion.levels else [])]
    fields += ["distance from the plan"] if motion.planned_points is not None else []
    choices = "".join(f"<option>{name}</option>" for name in fields)
    layers = [("arm", "arm"), *([("planned", "planned")] if motion.planned_points is not None else [])]
    boxes = "".join(f'<label><input type="checkbox" data-layer="{name}" checked> {label}</label>' for name, label in layers)
    drawn = {small: "".join(_kymograph(item, run) for item in kymographs if item.small is small) for small in (False, True)}
    view = (
        f'<div class="view"><canvas class="arm" aria-label="the arm in space"></canvas><img alt="the arm at the ends of its phases" '
        f'src="{still_picture(run)}"><div class="tools colour"><select class="field" aria-label="colour">{choices}</select>'
        f'<span class="low"></span><span class="scale"></span><span class="high"></span></div>'
        f'<div class="tools layers">{boxes}</div></div><div class="reading" aria-live="off"></div>'
    )
    traces = f'<div class="panel">{svg}<i data-left="{left:.3f}" data-width="{width:.3f}"></i></div>'
    name = f"<h2>{html.escape(_made(run))}</h2>" if several else ""
    return (
        f'<section id="run-{number}">{name}<main><div>{view}{drawn[False]}{_events(run)}</div>'
        f'<div style="--left:{left:.3f}%;--width:{width:.3f}%">{traces}{drawn[True]}{_checks(verdict)}</div></main>'
        f"{_details(number, run)}</section>"
    )


def _kymograph(item: _Kymograph, run: Execution) -> str:
    return (
        f"<figure{' class=small' if item.small else ''}><figcaption>{html.escape(item.title)}</figcaption>"
        '<div class="ends"><span>tip</span><span>base</span></div>'
        f'<div class="panel" data-arm="yes"><canvas class="kymograph" data-array="{item.array}" data-field="{item.field}"></canvas>'
        '<i data-left="0" data-width="100"></i></div>'
        '<div class="range"><span class="top"></span><span class="bottom"></span></div></figure>'
    )


def _checks(verdict: Verdict) -> str:
    rows = []
    for check in verdict.checks:
        share = min(check.value / check.limit, 1.0) if check.limit > 0 else float(check.value > 0)
        numbers = "".join(f"<td>{_number(value)}</td>" for value in (check.value, check.limit, check.margin))
        name, ending = html.escape(check.name.replace("_", " ")), "pass" if check.passed else "FAIL"
        rows.append(
            f'<tr class="{ending.lower()}"><td>{name}</td>{numbers}<td>{check.unit}</td>'
            f'<td class="meter"><i style="width:{100 * share:.0f}%"></i></td><td>{ending}</td></tr>'
        )
    return (
        "<h2>Verdict, measured on the simulation</h2><table><tr><th>check</th><th>value</th><th>limit</th><th>margin</th><th></th><th></th>"
        f"<th></th></tr>{''.join(rows)}</table>"
    )


def _number(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else "never"


def _events(run: Execution) -> str:
    if not run.events:
        return ""
    rows = "".join(
        f'<tr class="{"pass" if event.met else "fail"}"><td>{html.escape(event.phase)}</td><td>{event.planned:.2f} s</td>'
        f"<td>{event.actual:.2f} s</td><td>{'met' if event.met else 'not met'}</td></tr>"
        for event in run.events
    )
    return f"<h2>Phases</h2><table><tr><th>phase</th><th>planned end</th><th>end</th><th>goals</th></tr>{rows}</table>"


def _details(number: int, run: Execution) -> str:
    plan, execution = html.escape(str(run.plan)), html.escape(str(run))
    return (
        f"<details><summary>Plan and run</summary><pre>{plan}\n\n{execution}</pre></details>"
        f'<details><summary>How to cite</summary><pre id="cite-{number}">{html.escape(CITATION)}</pre>'
        f'<button class="copy" data-from="cite-{number}">copy</button></details>'
    )


CITATION = """@software{octoctrl,
  author = {{The octoctrl developers}},
  title  = {octoctrl: planning muscle activations of a soft octopus arm in the language of topology},
  year   = {2026}
}
@article{tekinalp2024topology,
  author  = {Tekinalp, Arman and Naughton, Noel and Kim, Seung Hyun and others},
  title   = {Topology, dynamics, and control of a muscle-architected soft arm},
  journal = {Proceedings of the National Academy of Sciences},
  year    = {2024}
}"""
"""What a page asks its readers to cite, BibTeX."""
