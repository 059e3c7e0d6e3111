"""Commands for the installation: whether it is sound, and compiling ahead of time."""

from typing import Annotated

import typer

from octoctrl.sim.errors import OctoctrlError

from .codes import ExitCode
from .options import AsJson, PlantName, Quiet, Settings, task_names
from .output import display, print_json
from .planning import configuration_of


def doctor(
    task: Annotated[
        str | None,
        typer.Argument(metavar="[FILE_OR_TASK]", help="A task; the installation alone if omitted.", autocompletion=task_names),
    ] = None,
    settings: Settings = None,
    plant: PlantName = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Check the installation, and say what a task needs, what is left out for it, and how long it will run."""
    from .. import doctor as diagnosis

    if task is None and (settings or plant):
        raise OctoctrlError("--set and --plant are of a task; name one, for example: octoctrl doctor coil --plant assembly")
    findings = diagnosis.installation()
    needs = None if task is None else diagnosis.needs(configuration_of(task, settings, plant))
    if as_json:
        print_json({"installation": findings.content()} | ({} if needs is None else {"task": needs.content()}))
    else:
        print(findings, *([] if needs is None else [needs]), sep="\n\n")
    return ExitCode.WELL if findings.sound else ExitCode.BAD_INPUT


def warmup(plant: PlantName = None, quiet: Quiet = False) -> ExitCode:
    """Compile the plant and the planner once, so that later commands start at once."""
    from octoctrl.planners.model.reduced import ReducedModel
    from octoctrl.sim import plants
    from octoctrl.sim.body.arm import Arm

    name, progress = plant or "rod", display(quiet)
    plants.warmup(name, progress)
    progress.start("preparing the planner")
    try:
        ReducedModel(arm=Arm.octopus()).prepare()
    finally:
        progress.stop()
    print(f" the planner and the plant are compiled: {plants.PLANTS[name].text}")
    return ExitCode.WELL


def cite() -> ExitCode:
    """Print what to cite, in BibTeX."""
    from ..citation import CITATION

    print(CITATION)
    return ExitCode.WELL
