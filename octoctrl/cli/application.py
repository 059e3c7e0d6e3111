"""The command line. Results go to standard output, progress and complaints to standard error.

Exit codes: 0 well, 1 verdict failed, 2 bad input, 3 no plan, 4 plant unstable, 130 interrupted.
"""

import json
import signal
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import typer

from octoctrl import __version__
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError

from .. import tasks as registry
from ..progress import NullProgress

OK, VERDICT_FAILED, BAD_INPUT, NO_PLAN, UNSTABLE, INTERRUPTED = 0, 1, 2, 3, 4, 130

app = typer.Typer(
    help="Plan the muscle activations of a soft arm in the language of topology, and verify them on a Cosserat simulator.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)

Overwrite = Annotated[bool, typer.Option("-f", "--force", help="Replace files that exist.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Show no progress.")]
Settings = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change the task: task.phases.store.duration=1.2")]
PlantName = Annotated[
    str | None,
    typer.Option(
        "--plant",
        metavar="NAME",
        help="rod; assembly: the full arm of 197 rods; assembly-coarse: the same with coarse rings, three times as fast.",
    ),
]
TimeLimit = Annotated[float | None, typer.Option("--time-limit", metavar="SECONDS", help="Wall-clock limit of planning.")]


def main(argv=None):
    """Run the command line.

    Parameters
    ----------
    argv : list of str, optional
        Arguments; those of the process if omitted.

    Returns
    -------
    int
        Exit code.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in arguments
    _treat_termination_as_interrupt()
    try:
        code = app(args=[word for word in arguments if word != "--debug"], prog_name="octoctrl", standalone_mode=False)
        if code == INTERRUPTED:
            _say("interrupted")
        return code if isinstance(code, int) else OK
    except Exception as error:
        code = _exit_code(error)
        if debug or code is None:
            raise
        _complain(error)
        return code
    except KeyboardInterrupt:
        _say("interrupted")
        return INTERRUPTED


@app.callback(invoke_without_command=True, epilog="Every command takes --debug, which shows where an error came from.")
def _front(version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False):
    if version:
        print(f"octoctrl {__version__}")
        raise typer.Exit


@app.command()
def tasks(
    name: Annotated[str | None, typer.Argument(help="One task only.")] = None,
    show: Annotated[bool, typer.Option("--show", help="Print its task file, to be edited and fed back.")] = False,
    as_json: AsJson = False,
):
    """List the tasks that come with octoctrl, or print one as a file."""
    if show:
        from ..files.configuration import toml_of

        if name is None:
            raise OctoctrlError(f"--show needs the name of a task ({', '.join(registry.names())})")
        print(toml_of(registry.load(name)), end="")
        return
    known = registry.descriptions()
    if name is not None:
        known = {name: registry.load(name).task.description}
    if as_json:
        _print_json(known)
        return
    width = max(map(len, known))
    for task, description in known.items():
        print(f" {task:{width}}   {description}")


@app.command()
def plan(
    task: Annotated[str, typer.Argument(metavar="FILE_OR_TASK", help="A task file, or the name of a task.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PLAN.npz")],
    settings: Settings = None,
    time_limit: TimeLimit = None,
    plant: PlantName = None,
    model: Annotated[Path | None, typer.Option("--model", metavar="MODEL.json", help="Reduced model made by identify.")] = None,
    force: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
):
    """Plan a task on the reduced model."""
    from ..doctor import plan_header
    from ..files.store import check_target

    configuration = _configuration(task, settings, plant)
    check_target(output, overwrite=force)
    made = _plan(configuration, output, time_limit, _display(quiet), model)
    if not as_json:
        print(plan_header(configuration))
    _report(made, _plan_json(made), as_json)
    return _plan_code(made)


@app.command()
def run(
    plan_file: Annotated[Path, typer.Argument(metavar="PLAN.npz")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="RUN.npz")],
    open_loop: Annotated[bool, typer.Option("--open-loop", help="Play the planned activations without feedback.")] = False,
    feedback: Annotated[str | None, typer.Option("--feedback", metavar="NAME", help="tvlqr, or open-loop.")] = None,
    plant: PlantName = None,
    force: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
):
    """Carry out a plan on the plant that it was made for, or another one; the file is kept up to date while the run goes on."""
    from octoctrl.sim.plants import check_plant

    from ..files.configuration import check_feedback, parse
    from ..files.store import check_target, load, read_header

    if open_loop and feedback not in (None, "open-loop"):
        raise OctoctrlError(f"--open-loop and --feedback {feedback} contradict each other; give one of them")
    loaded, origin = load(plan_file, expect="Plan"), read_header(plan_file)["origin"]
    if feedback is None:
        written = origin.get("configuration")
        feedback = "open-loop" if open_loop else parse(written).run.feedback if written else "tvlqr"
    check_feedback(feedback)
    check_plant(plant or loaded.plant)
    check_target(output, overwrite=force)
    if _plan_code(loaded):
        _say(f"the plan does not meet its goals: {loaded.status.value}")
    execution = _run(loaded, feedback, plant, output, force, origin, _display(quiet))
    _report(execution, _run_json(execution), as_json)
    return _run_code(execution, output)


@app.command()
def verify(run_file: Annotated[Path, typer.Argument(metavar="RUN.npz")], as_json: AsJson = False):
    """Check a run against its plan and its task."""
    from ..files.store import load
    from ..judging.verification import verify as check

    verdict = check(load(run_file, expect="Execution"))
    _report(verdict, _verdict_json(verdict), as_json)
    return OK if verdict.passed else VERDICT_FAILED


@app.command()
def compare(
    run_file: Annotated[Path, typer.Argument(metavar="RUN.npz")],
    picture: Annotated[Path | None, typer.Option("--plot", metavar="PICTURE", help="Draw the traces: .png, .pdf or .svg.")] = None,
    overlap: Annotated[bool, typer.Option("--overlap", help="Compare a run that was cut short as far as it goes.")] = False,
    force: Overwrite = False,
    as_json: AsJson = False,
):
    """Compare planned and simulated link, writhe and twist."""
    from ..files.store import load
    from ..judging.comparison import compare as align

    execution = load(run_file, expect="Execution")
    comparison = align(execution, overlap=overlap)
    if picture is not None:
        from ..pictures.plots import plot

        plot(execution, picture, overwrite=force, overlap=overlap)
        _say(f"wrote {picture}")
    _report(comparison, {"errors": comparison.summary(), "level_times": comparison.delays}, as_json)


@app.command()
def identify(
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="MODEL.json")] = None,
    task: Annotated[str, typer.Option("--task", metavar="FILE_OR_TASK", help="Where arm and scene are taken from.")] = "coil",
    settings: Settings = None,
    plant: PlantName = None,
    force: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
):
    """Fit the reduced model of an arm to a handful of runs of the plant."""
    from ..carrying.identifying import identification_text
    from ..carrying.identifying import identify as fit

    configuration = _configuration(task, settings, plant)
    name = configuration.run.plant
    found = fit(configuration.arm, configuration.scene, plant=name, path=output, overwrite=force, progress=_display(quiet))
    content = {
        "plant": name,
        "factors": {name: getattr(found.model.parameters, name) for name in found.names},
        "deviations": found.deviations,
    }
    _report(identification_text(found), content | {"residual_rms": found.residual_rms, "statistics": found.statistics}, as_json)


@app.command()
def warmup(plant: PlantName = None, quiet: Quiet = False):
    """Compile the plant once, so that later runs start at once."""
    from octoctrl.sim import plants

    name = plant or "rod"
    plants.warmup(name, _display(quiet))
    print(f" the plant is compiled: {plants.PLANTS[name]}")


@app.command()
def bench(
    parts: Annotated[list[str] | None, typer.Argument(metavar="[PART]...", help="rod, assembly, reduced, closed-forms, ...")] = None,
    full: Annotated[bool, typer.Option("--full", help="More cases; without PARTs, all of them (many minutes).")] = False,
    output: Annotated[Path | None, typer.Option("--json", metavar="FILE.json", help="Write the numbers.")] = None,
    picture: Annotated[Path | None, typer.Option("--plot", metavar="PICTURE", help="Draw time against error: .png, .pdf or .svg.")] = None,
    page: Annotated[Path | None, typer.Option("--page", metavar="FILE.md", help="Write the tables as a page.")] = None,
    force: Overwrite = False,
    quiet: Quiet = False,
):
    """Measure run time against error, scaling, step limits, what is skipped, and start-up (two minutes without --full)."""
    from ..bench import benchmark as benchmarking
    from ..files.store import check_target

    for path, suffixes in ((output, (".json",)), (picture, (".png", ".pdf", ".svg")), (page, (".md",))):
        if path is not None:
            check_target(path, overwrite=force, suffixes=suffixes)
    display = _display(quiet)
    try:
        tables = benchmarking.run(parts or (), full=full, progress=display)
    finally:
        display.stop()
    print(*tables, sep="\n\n")
    command = " ".join(["octoctrl bench", *(parts or ()), *(["--full"] if full else []), *(["--page", str(page)] if page else [])])
    benchmarking.write(tables, command, output=output, picture=picture, page=page)


@app.command()
def stability(
    runs: Annotated[int, typer.Option("-n", "--runs", help="How many, or a few more.")] = 6000,
    plant: Annotated[str, typer.Option("--plant", help="rod or assembly.")] = "rod",
    seed: Annotated[int, typer.Option("--seed")] = 0,
    outcomes: Annotated[Path | None, typer.Option("-o", "--output", metavar="FILE.jsonl", help="Where outcomes are kept.")] = None,
    repeat: Annotated[str | None, typer.Option("--repeat", metavar="KIND:NUMBER", help="One run only, and what it is.")] = None,
    page: Annotated[
        Path | None, typer.Option("--page", metavar="FILE.md", help="Write a page of all outcomes kept here, and its picture.")
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
):
    """Random arms, activations and steps: accurate, refused, or stopped with the reason? Goes on where it was interrupted."""
    from ..laboratory import page as laboratory_page
    from ..laboratory import studies as laboratory

    if repeat is not None:
        trial, outcome = laboratory.repeat(repeat, seed)
        _report(f"{trial}\n\n{outcome}", asdict(outcome), as_json)
        return VERDICT_FAILED if outcome.undetected else OK
    target, display = outcomes or Path(f"stability-{plant}-{seed}.jsonl"), _display(quiet)
    found = laboratory.study(target, runs, plant=plant, seed=seed, progress=display)
    if page is not None:
        laboratory_page.write(page, target, display)
    _report(laboratory_page.text(found), laboratory.content(found), as_json)
    return VERDICT_FAILED if any(outcome.undetected for outcome in found) else OK


@app.command()
def doctor(
    task: Annotated[str | None, typer.Argument(metavar="[FILE_OR_TASK]", help="A task; the installation alone if omitted.")] = None,
    settings: Settings = None,
    plant: PlantName = None,
    as_json: AsJson = False,
):
    """Check the installation, and say what a task needs, what is left out for it, and how long it will run."""
    from .. import doctor as diagnosis

    findings = diagnosis.installation()
    needs = None if task is None else diagnosis.needs(_configuration(task, settings, plant))
    if as_json:
        _print_json({"installation": findings.content()} | ({} if needs is None else {"task": needs.content()}))
    else:
        print(findings, *([] if needs is None else [needs]), sep="\n\n")
    return OK if findings.sound else BAD_INPUT


@app.command()
def demo(
    task: Annotated[str, typer.Argument(metavar="TASK", help="Name of a task, or a task file.")] = "coil",
    folder: Annotated[Path | None, typer.Option("-o", "--output", metavar="FOLDER", help="Default: demo-TASK, renewed each time.")] = None,
    settings: Settings = None,
    time_limit: TimeLimit = None,
    plant: PlantName = None,
    force: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
):
    """Plan a task, carry it out in closed loop, verify it, and draw planned against simulated."""
    from ..files.store import check_target

    configuration = _configuration(task, settings, plant)
    if folder is None:
        ending = "" if configuration.run.plant == "rod" else f"-{configuration.run.plant}"
        folder, force = Path(f"demo-{Path(task).stem}{ending}"), True
    folder.mkdir(parents=True, exist_ok=True)
    plan_file, run_file, picture = folder / "plan.npz", folder / "run.npz", folder / "traces.png"
    for path in (plan_file, run_file):
        check_target(path, overwrite=force)
    check_target(picture, overwrite=force, suffixes=(".png",))
    display = _display(quiet)
    made = _plan(configuration, plan_file, time_limit, display)
    if not as_json:
        print(f"{made}\n")
    if _plan_code(made):
        return _plan_code(made)
    execution = _run(made, configuration.run.feedback, configuration.run.plant, run_file, force, _origin(configuration), display)
    if not as_json:
        print(f"{execution}\n")
    if _run_code(execution, run_file):
        return _run_code(execution, run_file)
    from ..judging.verification import verify as check
    from ..pictures.plots import plot

    verdict = check(execution)
    plot(execution, picture, overwrite=True)
    _report(verdict, {"plan": _plan_json(made), "run": _run_json(execution), "verdict": _verdict_json(verdict)}, as_json)
    _say(f"wrote {plan_file}, {run_file} and {picture}")
    return OK if verdict.passed else VERDICT_FAILED


# ---------------------------------------------------------------- the work


def _configuration(task, settings, plant):
    """The configuration of a task; `--plant` counts more than its own `run.plant`."""
    configuration = registry.load(task, overrides=settings or ())
    return configuration if plant is None else replace(configuration, run=replace(configuration.run, plant=plant))


def _plan(configuration, output, time_limit, display, model=None):
    from ..carrying.planning import plan as make
    from ..files.store import save

    try:
        made = make(configuration, model=model, time_limit=time_limit, progress=display)
    finally:
        display.stop()
    save(output, made, overwrite=True, origin=_origin(configuration))
    return made


def _run(loaded, feedback, plant, output, force, origin, display):
    from octoctrl.sim import plants

    from ..carrying.execution import execute
    from ..doctor import header
    from ..files.store import RunWriter

    writer = RunWriter(output, overwrite=force, origin=origin)
    try:
        plants.warmup(plant or loaded.plant, display)
        made = plants.make_plant(plant or loaded.plant, loaded.arm, loaded.scene)
        if not isinstance(display, NullProgress):
            _say(header(made, loaded.schedule.activation().groups))
        execution = execute(loaded, feedback=feedback, plant=made, progress=display, checkpoint=writer)
    finally:
        display.stop()
    writer.close(execution)
    return execution


def _origin(configuration):
    from ..files.configuration import toml_of

    return {"configuration": toml_of(configuration)}


# ---------------------------------------------------------------- saying it


def _plan_json(made):
    return {
        "status": made.status.name.lower(),
        "message": made.status.value,
        "plant": made.plant,
        "duration": made.schedule.duration,
        "phase_begins": made.phase_begins,
        "report": asdict(made.report),
    }


def _run_json(execution):
    return {
        "status": execution.status.name.lower(),
        "message": execution.status.value,
        "feedback": execution.feedback,
        "plant": execution.plant,
        "duration": float(execution.recording.time[-1]),
        "events": [{"phase": e.phase, "planned": e.planned, "actual": e.actual, "met": e.met} for e in execution.events],
        "statistics": execution.statistics,
    }


def _verdict_json(verdict):
    checks = [
        {"name": c.name, "value": c.value, "limit": c.limit, "margin": c.margin, "unit": c.unit, "pass": c.passed} for c in verdict.checks
    ]
    return {"status": verdict.status, "checks": checks}


def _plan_code(made):
    return OK if made.status.name == "SOLVED" else NO_PLAN


def _run_code(execution, output):
    code = {"FINISHED": OK, "INTERRUPTED": INTERRUPTED, "UNSTABLE": UNSTABLE}[execution.status.name]
    if code == INTERRUPTED:
        _say(f"stopped at {execution.recording.time[-1]:.2f} s; {output} holds everything up to there")
    return code


def _report(item, content, as_json):
    if as_json:
        _print_json(content)
    else:
        print(item)


def _print_json(content):
    from ..tables import plain

    print(json.dumps(plain(content), indent=2))


def _say(text):
    print(text, file=sys.stderr)


def _display(quiet):
    if quiet:
        return NullProgress()
    from ..progress import RichProgress

    return RichProgress()


def _complain(error):
    text = error.format_message() if hasattr(error, "format_message") else str(error)
    _say(f"octoctrl: {text}")


def _exit_code(error):
    """Exit code of an error that is the user's business; None for a fault of ours, which shows its traceback."""
    if isinstance(error, OctoctrlError):
        return BAD_INPUT
    if isinstance(error, PlantUnstableError):
        return UNSTABLE
    # Depending on its version, typer brings these classes along or takes them from click.
    return {"ClickException": BAD_INPUT, "Abort": INTERRUPTED}.get(
        next((c.__name__ for c in type(error).__mro__ if c.__name__ in _CLICK), "")
    )


_CLICK = ("ClickException", "Abort")


def _treat_termination_as_interrupt():
    def interrupt(*_):
        raise KeyboardInterrupt

    try:
        signal.signal(signal.SIGTERM, interrupt)
    except ValueError:  # not the main thread: whoever owns the process decides
        return
