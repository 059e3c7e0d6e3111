"""Commands before anything moves in closed loop: what tasks there are, a plan, the reduced model of another arm."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from octoctrl.sim.errors import OctoctrlError

from .. import tasks as registry
from .codes import ExitCode, code_of_plan
from .options import AsJson, ModelFile, Overwrite, PlantName, Quiet, Settings, Task, TimeLimit, task_names
from .output import display, plan_content, print_json, report

if TYPE_CHECKING:
    from octoctrl.planners.solving.plan import Plan

    from ..files.configuration import Configuration
    from ..progress import Progress


def tasks(
    name: Annotated[str | None, typer.Argument(help="One task only.", autocompletion=task_names)] = None,
    show: Annotated[bool, typer.Option("--show", help="Print its task file, to be edited and fed back.")] = False,
    as_json: AsJson = False,
) -> ExitCode:
    """List the tasks that come with octoctrl, or print one as a file."""
    if show:
        from ..files.toml_writing import toml_of

        if name is None:
            raise OctoctrlError(f"--show needs the name of a task ({', '.join(registry.names())})")
        print(toml_of(registry.load(name)), end="")
        return ExitCode.WELL
    known = registry.descriptions()
    if name is not None:
        known = {name: registry.load(name).task.description}
    if as_json:
        print_json(known)
        return ExitCode.WELL
    width = max(map(len, known))
    for task, description in known.items():
        print(f" {task:{width}}   {description}")
    return ExitCode.WELL


def plan(
    task: Task,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PLAN.npz")],
    settings: Settings = None,
    time_limit: TimeLimit = None,
    plant: PlantName = None,
    model: ModelFile = None,
    force: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> ExitCode:
    """Plan a task on the reduced model."""
    from ..doctor import plan_header
    from ..files.writing import check_target

    configuration = configuration_of(task, settings, plant)
    check_target(output, overwrite=force)
    made = plan_into(output, configuration, time_limit, display(quiet), model)
    if not as_json:
        print(plan_header(configuration))
    report(made, plan_content(made), as_json)
    return code_of_plan(made)


def identify(
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="MODEL.json")] = None,
    task: Annotated[
        str, typer.Option("--task", metavar="FILE_OR_TASK", help="Where arm and scene are taken from.", autocompletion=task_names)
    ] = "coil",
    settings: Settings = None,
    plant: PlantName = None,
    laws: Annotated[
        str, typer.Option("--laws", metavar="NAME", help="known: the plant's muscle curves; generic: shapes fitted too.")
    ] = "known",
    force: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> ExitCode:
    """Fit the reduced model of an arm to a handful of runs of the plant."""
    from ..carrying.identifying import identification_text
    from ..carrying.identifying import identify as fit

    configuration = configuration_of(task, settings, plant)
    name = configuration.run.plant
    found = fit(configuration.arm, configuration.scene, plant=name, path=output, overwrite=force, laws=laws, progress=display(quiet))
    content = {
        "plant": name,
        "factors": {name: getattr(found.model.parameters, name) for name in found.names},
        "deviations": found.deviations,
    }
    report(identification_text(found), content | {"residual_rms": found.residual_rms, "statistics": found.statistics}, as_json)
    return ExitCode.WELL


def configuration_of(task: str, settings: list[str] | None, plant: str | None) -> "Configuration":
    """The configuration of a task; `--plant` counts more than its own `run.plant`."""
    configuration = registry.load(task, overrides=settings or ())
    return configuration if plant is None else replace(configuration, run=replace(configuration.run, plant=plant))


def origin_of(configuration: "Configuration") -> dict[str, str]:
    """What the header of a file says of where it came from."""
    from ..files.toml_writing import toml_of

    return {"configuration": toml_of(configuration)}


def plan_into(
    output: Path, configuration: "Configuration", time_limit: float | None, progress: "Progress", model: Path | None = None
) -> "Plan":
    """Make a plan and keep it in a file."""
    from ..carrying.planning import plan as make
    from ..files.store import save

    try:
        made = make(configuration, model=model, time_limit=time_limit, progress=progress)
    finally:
        progress.stop()
    save(output, made, overwrite=True, origin=origin_of(configuration))
    return made
