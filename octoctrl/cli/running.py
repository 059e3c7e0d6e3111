"""Commands that move the arm: a plan carried out, and everything in one go."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from octoctrl.sim.errors import OctoctrlError

from ..progress import NullProgress, Progress
from .codes import ExitCode, code_of_plan, code_of_run, code_of_verdict
from .options import AsJson, Overwrite, PlantName, Quiet, Settings, Threads, TimeLimit, task_names
from .output import display, plan_content, report, run_content, say, verdict_content
from .planning import configuration_of, origin_of, plan_into

if TYPE_CHECKING:
    from octoctrl.planners.solving.plan import Plan

    from ..carrying.results import Execution
    from ..carrying.run import Watch


def run(
    plan_file: Annotated[Path | None, typer.Argument(metavar="PLAN.npz", show_default=False)] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="RUN.npz")] = None,
    broken_off: Annotated[Path | None, typer.Option("--resume", metavar="RUN.npz", help="Go on with a run that was broken off.")] = None,
    open_loop: Annotated[bool, typer.Option("--open-loop", help="Play the planned activations without feedback.")] = False,
    feedback: Annotated[str | None, typer.Option("--feedback", metavar="NAME", help="tvlqr, mpc, grip or open-loop.")] = None,
    plant: PlantName = None,
    threads: Threads = 1,
    anyway: Annotated[bool, typer.Option("--anyway", help="Run a plan that does not meet its goals.")] = False,
    view: Annotated[bool, typer.Option("--view", help="Watch it live in a browser, set the pace, plan again.")] = False,
    port: Annotated[int, typer.Option("--port", help="Of the live view; 0 takes a free one.")] = 8080,
    force: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> ExitCode:
    """Carry out a plan on the plant that it was made for, or another one; a run that is killed can be gone on with."""
    from octoctrl.planners.following.controllers import check_feedback
    from octoctrl.sim.plants import check_plant

    from ..files.parts import check_parts
    from ..files.store import load, read_header

    if broken_off is not None:
        return _resumed(broken_off, [plan_file, output, feedback, plant, threads > 1, open_loop, anyway, force], as_json, quiet)
    if plan_file is None or output is None:
        raise OctoctrlError("give a plan and where to write: octoctrl run plan.npz -o run.npz; or what to go on with: --resume run.npz")
    if open_loop and feedback not in (None, "open-loop"):
        raise OctoctrlError(f"--open-loop and --feedback {feedback} contradict each other; give one of them")
    loaded, origin = load(plan_file, expect="Plan"), read_header(plan_file)["origin"]
    feedback = "open-loop" if open_loop else feedback or loaded.feedback
    check_feedback(feedback)
    check_plant(plant or loaded.plant)
    check_parts(output, overwrite=force)
    if code_of_plan(loaded) and not anyway:
        raise OctoctrlError(f"{plan_file} does not meet its goals ({loaded.status.name.lower()}); give --anyway to run it all the same")
    if view:
        execution = _watched(output, loaded, feedback, plant or loaded.plant, threads, force, origin, port)
    else:
        execution = run_into(output, loaded, feedback, plant or loaded.plant, threads, force, origin, display(quiet))
    report(execution, run_content(execution), as_json)
    return code_of_run(execution)


def _watched(
    output: Path, plan: "Plan", feedback: str, plant: str, threads: int, force: bool, origin: dict[str, str], port: int
) -> "Execution":
    """Carry out a plan in a live view, and the plans that are made there after it, each from rest; the last run stays in the file."""
    from ..pictures.live import View

    live = View(port=port)
    say(f"open {live.url}")
    following: Plan | None = plan
    try:
        while following is not None:
            execution = run_into(output, following, feedback, plant, threads, force, origin, NullProgress(), watch=live)
            force = True
            say(f"wrote {output}; change goals and plan again in the browser, or end with Ctrl-C")
            following = live.next_plan()
    finally:
        live.close()
    return execution


def _resumed(path: Path, others: list[Any], as_json: bool, quiet: bool) -> ExitCode:
    """Go on with a run as it was begun."""
    from ..carrying.execution import resume

    if any(others):
        raise OctoctrlError("--resume goes on with a run as it was begun; give the run and nothing else")
    progress = display(quiet)
    try:
        execution = resume(path, progress=progress)
    finally:
        progress.stop()
    _say_where(execution, path)
    report(execution, run_content(execution), as_json)
    return code_of_run(execution)


def demo(
    task: Annotated[str, typer.Argument(metavar="TASK", help="Name of a task, or a task file.", autocompletion=task_names)] = "coil",
    folder: Annotated[Path | None, typer.Option("-o", "--output", metavar="FOLDER", help="Default: demo-TASK, renewed each time.")] = None,
    settings: Settings = None,
    time_limit: TimeLimit = None,
    plant: PlantName = None,
    threads: Threads = 1,
    force: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> ExitCode:
    """Plan a task, carry it out in closed loop, verify it, draw planned against simulated, and write it all as a page."""
    from ..files.writing import check_target, make_folder

    configuration = configuration_of(task, settings, plant)
    if folder is None:
        ending = "" if configuration.run.plant == "rod" else f"-{configuration.run.plant}"
        folder, force = Path(f"demo-{Path(task).stem}{ending}"), True
    make_folder(folder)
    plan_file, run_file, picture, page = (folder / name for name in ("plan.npz", "run.npz", "traces.png", "report.html"))
    for path in (plan_file, run_file):
        check_target(path, overwrite=force)
    check_target(picture, overwrite=force, suffixes=(".png",))
    check_target(page, overwrite=force, suffixes=(".html",))
    progress = display(quiet)
    made = plan_into(plan_file, configuration, time_limit, progress)
    if not as_json:
        print(f"{made}\n")
    if code := code_of_plan(made):
        return code
    settled = configuration.run
    execution = run_into(run_file, made, settled.feedback, settled.plant, threads, force, origin_of(configuration), progress)
    if not as_json:
        print(f"{execution}\n")
    if code := code_of_run(execution):
        return code
    from ..judging.verification import verify
    from ..pictures.plots import plot
    from ..pictures.report import report as write

    verdict = verify(execution)
    report(verdict, {"plan": plan_content(made), "run": run_content(execution), "verdict": verdict_content(verdict)}, as_json)
    plot(execution, picture, overwrite=True)
    write(execution, page, overwrite=True)
    say(f"wrote {plan_file}, {run_file} and {picture}; open {page} in a browser")
    return code_of_verdict(verdict)


def run_into(
    output: Path,
    plan: "Plan",
    feedback: str,
    plant: str,
    threads: int,
    force: bool,
    origin: dict[str, str],
    progress: Progress,
    watch: "Watch | None" = None,
) -> "Execution":
    """Carry out a plan, which may miss its goals, and keep the run in a file, also while it goes on."""
    from octoctrl.sim import plants

    from ..carrying.execution import execute
    from ..doctor import header

    try:
        more = {} if threads == 1 else {"threads": threads}
        made = plants.make_plant(plant, plan.arm, plan.scene, **more)
        plants.warmup(plant, progress)
        if not isinstance(progress, NullProgress):
            say(header(made, plan.schedule.activation().groups))
        execution = execute(
            plan,
            feedback=feedback,
            plant=made,
            allow_unsolved=True,
            progress=progress,
            path=output,
            overwrite=force,
            origin=origin,
            watch=watch,
        )
    finally:
        progress.stop()
    _say_where(execution, output)
    return execution


def _say_where(execution: "Execution", path: Path) -> None:
    if code_of_run(execution) is ExitCode.INTERRUPTED:
        say(f"stopped at {execution.recording.time[-1]:.2f} s, and {path} holds that; go on with: octoctrl run --resume {path}")
