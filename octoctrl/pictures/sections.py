"""What is read on the page of a run: how it was made, panels, verdict, contact, phases, numbers, configuration, how to cite."""

import html
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene.scene import self_contact

from ..carrying.results import Execution, Verdict
from ..citation import CITATION
from ..files.configuration import Configuration, RunSettings
from ..files.store import versions
from ..files.toml_writing import toml_of
from ..judging.packet import PacketTrack, packets
from .contact import Grip, contact_picture, grips
from .kymograph import packet_picture
from .traces import still_picture, traces_picture


@dataclass(frozen=True, slots=True)
class Kymograph:
    """A field over time and arclength: its heading, its array, the field whose colours it takes, and whether it is drawn small."""

    title: str
    array: str
    field: str
    small: bool = False


def heading(runs: Sequence[Execution], verdicts: Sequence[Verdict]) -> str:
    """Names, endings and the clock, above the `runs` and their `verdicts`."""
    said = []
    for run, verdict in zip(runs, verdicts, strict=True):
        good, judged = verdict.count
        said.append(
            f"<div><h1>{html.escape(run.plan.task.name)}</h1>"
            f'<span class="badge {"pass" if verdict.passed else "fail"}">{"passed" if verdict.passed else "failed"}: '
            f'{good} of {judged} checks are met</span><span class="made">{html.escape(made(run))}</span></div>'
        )
    return (
        f'<header>{"".join(said)}<div class="clock"><button id="play" aria-pressed="false">Play</button>'
        '<input id="time" type="range" min="0" value="0" step="any" aria-label="time"><output id="now"></output>'
        '<select id="speed" aria-label="speed"><option value="0.25">0.25 &times;</option><option value="1" selected>1 &times;</option>'
        '<option value="4">4 &times;</option></select></div></header>'
    )


def made(run: Execution) -> str:
    """How a `run` was made and how it ended, in one line."""
    end = float(run.recording.time[-1])
    where = f"arm {run.plan.arm.name}, plant {run.plant}, {self_contact(run.plan.scene)}"
    return f"{end:.2f} s of {where}, feedback {run.feedback}. {run.status.value}"


def section(
    number: int,
    run: Execution,
    verdict: Verdict,
    fields: Sequence[str],
    layers: Sequence[tuple[str, bool]],
    kymographs: Sequence[Kymograph],
    *,
    several: bool,
) -> str:
    """All that is shown of one run.

    Parameters
    ----------
    number : int
        Of the run on the page.
    run : Execution
    verdict : Verdict
    fields : sequence of str
        By which the arm can be coloured.
    layers : sequence of (str, bool)
        What can be shown in space, and whether it is at first.
    kymographs : sequence of Kymograph
    several : bool
        Whether the page shows other runs too.

    Returns
    -------
    str
        HTML.
    """
    svg, left, width = traces_picture(run)
    choices = "".join(f"<option>{name}</option>" for name in fields)
    boxes = "".join(f'<label><input type="checkbox" data-layer="{name}"{" checked" * shown}> {name}</label>' for name, shown in layers)
    drawn = {small: "".join(_kymograph(item) for item in kymographs if item.small is small) for small in (False, True)}
    view = (
        f'<div class="view"><canvas class="arm" aria-label="the arm in space"></canvas><img alt="the arm at the ends of its phases" '
        f'src="{still_picture(run)}"><div class="tools colour"><select class="field" aria-label="colour">{choices}</select>'
        f'<span class="low"></span><span class="scale"></span><span class="high"></span></div>'
        f'<div class="tools layers">{boxes}</div></div><div class="reading" aria-live="off"></div>'
    )
    traces = _panel(svg, left, width)
    name = f"<h2>{html.escape(made(run))}</h2>" if several else ""
    held = grips(run)
    touching = _panel(contact_picture(run, held, left, width), left, width) if held else ""
    travelling = passing = ""
    if asking := {phase.name for phase in run.plan.task.phases for goal in phase.goals if goal.quantity == "packet"}:
        planned, simulated = packets(run)
        if planned is not None:
            travelling = _panel(packet_picture(planned, simulated, left, width), left, width)
            passing = _packet(run, asking, {"planned": planned, "simulated": simulated})
    return (
        f'<section id="run-{number}">{name}<main><div>{view}{drawn[False]}{_events(run)}{passing}'
        f"{_contact(run, held)}</div>"
        f'<div style="--left:{left:.3f}%;--width:{width:.3f}%">{traces}{travelling}{touching}{drawn[True]}'
        f"<h2>Verdict, measured on the simulation</h2>{checks_table(verdict)}</div></main>"
        f"{_details(number, run)}</section>"
    )


def _panel(svg: str, left: float, width: float) -> str:
    return f'<div class="panel">{svg}<i data-left="{left:.3f}" data-width="{width:.3f}"></i></div>'


def _kymograph(item: Kymograph) -> str:
    return (
        f"<figure{' class=small' if item.small else ''}><figcaption>{html.escape(item.title)}</figcaption>"
        '<div class="ends"><span>tip</span><span>base</span></div>'
        f'<div class="panel" data-arm="yes"><canvas class="kymograph" data-array="{item.array}" data-field="{item.field}"></canvas>'
        '<i data-left="0" data-width="100"></i></div>'
        '<div class="range"><span class="top"></span><span class="bottom"></span></div></figure>'
    )


def checks_table(verdict: Verdict) -> str:
    """The checks of a `verdict` with their margins, as a table (HTML)."""
    rows = []
    for check in verdict.checks:
        name = html.escape(check.name.replace("_", " "))
        if not check.judged:
            rows.append(f"<tr><td>{name}</td><td>{_number(check.value)}</td><td></td><td></td><td>{check.unit}</td><td></td><td></td></tr>")
            continue
        share = min(check.value / check.limit, 1.0) if check.limit > 0 else float(check.value > 0)
        numbers = "".join(f"<td>{_number(value)}</td>" for value in (check.value, check.limit, check.margin))
        ending = "pass" if check.passed else "FAIL"
        rows.append(
            f'<tr class="{ending.lower()}"><td>{name}</td>{numbers}<td>{check.unit}</td>'
            f'<td class="meter"><i style="width:{100 * share:.0f}%"></i></td><td>{ending}</td></tr>'
        )
    return f"<table><tr><th>check</th><th>value</th><th>limit</th><th>margin</th><th></th><th></th><th></th></tr>{''.join(rows)}</table>"


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


def _contact(run: Execution, held: list[Grip]) -> str:
    if not held:
        return ""
    rows = []
    for grip in held:
        first = grip.first_touch(run.recording.time)
        turns = "" if grip.covered is None else f"{grip.covered[np.abs(grip.covered).argmax()]:+.2f}"
        touched = f"{first:.2f} s" if np.isfinite(first) else "never"
        lengths = (f"{1e3 * grip.slip:.2g} mm", f"{1e3 * grip.deepest:.2g} mm")
        cells = (touched, f"{grip.normal_force.max():.3g} N", turns, *lengths)
        rows.append(f"<tr><td>{html.escape(grip.name)}</td>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>")
    return (
        "<h2>Contact</h2><table><tr><th>object</th><th>first touch</th><th>largest force</th><th>turns on it</th><th>longest slip</th>"
        f"<th>deepest overlap</th></tr>{''.join(rows)}</table>"
    )


def _packet(run: Execution, asking: set[str], tracks: dict[str, PacketTrack]) -> str:
    """Where the packet of bending was, and how fast, wide and strong, at the ends of the phases that ask for it: planned, simulated."""
    rows = []
    for event in run.events:
        for kind, track in tracks.items() if event.phase in asking else ():
            values = (1e3 * track.position, 1e2 * track.speed, 1e2 * track.pace, 1e3 * track.width, track.amplitude)
            cells = "".join(f"<td>{np.interp(event.actual, track.time, row):.3g}</td>" for row in values)
            rows.append(f"<tr><td>{html.escape(event.phase)}</td><td>{kind}</td>{cells}</tr>")
    return (
        "<h2>Packet of bending</h2><table><tr><th>at the end of</th><th></th><th>place [mm]</th><th>speed along the arm [cm/s]</th>"
        f"<th>in the laboratory [cm/s]</th><th>width [mm]</th><th>bending strain</th></tr>{''.join(rows)}</table>"
    )


def _numbers(run: Execution) -> str:
    """How plan and run were computed, and what is known of their errors."""
    plan, report = run.plan.report, run.report
    end = float(run.recording.time[-1])
    rows = [(f"planning: {stage}", f"{seconds:.2f} s") for stage, seconds in plan.stages.items()]
    rows += [("planning: starts, iterations", f"{plan.starts}, {plan.iterations}"), ("planning: optimiser", plan.optimiser)]
    rows += [("highest level is below 1 by", f"{plan.headroom:.2f}" if np.isfinite(plan.headroom) else "")]
    rows += [("at their bounds", ", ".join(plan.at_bounds)), ("beyond what the model was identified on", ", ".join(plan.extrapolates))]
    rows += [("step of the plant, and what limits it", f"{1e6 * report.time_step:.3g} µs, {report.step_limit}")]
    rows += [("simulation", f"{report.wall_time:.2f} s for {end:.2f} s of arm")]
    rows += [
        ("controller: design, largest correction", f"{report.controller.design_time:.2f} s, {report.controller.largest_correction:.3f}")
    ]
    rows += [
        (f"goal {item.goal} of {item.phase}, if the model is off by its usual errors", f"moves by {spread:.2f} tolerances")
        for item, spread in zip(plan.goals, plan.spread, strict=False)
    ]
    rows += [(f"estimated during the run: {name}", f"{value:+.1%}") for name, value in report.controller.estimated_errors.items()]
    rows += [("link against writhe + twist, two measurements", f"{np.abs(run.trace.residual).max():.4f} turns apart at most")]
    lines = "".join(f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>" for name, value in rows if value)
    return f"<details><summary>Solver, timing, estimated errors</summary><table>{lines}</table></details>"


def _configuration(run: Execution) -> str:
    """The task file that gives the run; empty where the task holds what no file can say."""
    plan = run.plan
    try:
        settings = RunSettings(feedback=plan.feedback, plant=plan.plant, period=plan.period)
        return toml_of(Configuration(task=plan.task, arm=plan.arm, scene=plan.scene, run=settings))
    except (OctoctrlError, TypeError):
        return ""


def _details(number: int, run: Execution) -> str:
    plan, execution = html.escape(str(run.plan)), html.escape(str(run))
    parts = [f"<details><summary>Plan and run</summary><pre>{plan}\n\n{execution}</pre></details>", _numbers(run)]
    made_with = "".join(f" {name} {version}" for name, version in versions().items())
    for name, said in (("configuration", _configuration(run)), ("citation", CITATION)):
        heading = {"configuration": "Task file", "citation": "How to cite"}[name]
        if said:
            parts.append(
                f'<details><summary>{heading}</summary><pre id="{name}-{number}">{html.escape(said)}</pre>'
                f'<button class="copy" data-from="{name}-{number}">copy</button></details>'
            )
    return f'{"".join(parts)}<p class="made">Page made with{html.escape(made_with)}.</p>'
