"""Options and arguments that several commands take, with what a shell completes for them."""

from pathlib import Path
from typing import Annotated

import typer

from .. import tasks as registry


def plant_names() -> list[str]:
    """Names of the plants."""
    from octoctrl.sim.plants import PLANTS

    return list(PLANTS)


def task_names() -> list[str]:
    """Names of the tasks that come with octoctrl; a shell offers files where none of them fits."""
    return list(registry.names())


Task = Annotated[
    str, typer.Argument(metavar="FILE_OR_TASK", help="A task file, or the name of a task.", autocompletion=task_names, show_default=False)
]
RunFile = Annotated[Path, typer.Argument(metavar="RUN.npz", show_default=False)]
Overwrite = Annotated[bool, typer.Option("-f", "--force", help="Replace files that exist.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Show no progress.")]
Settings = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change the task: task.phases.store.duration=1.2")]
PlantName = Annotated[
    str | None,
    typer.Option(
        "--plant",
        metavar="NAME",
        autocompletion=plant_names,
        help="rod; assembly: the full arm of 197 rods; assembly-coarse: the same with coarse rings, three times as fast; either with "
        "-mixed: in mixed precision, twice as fast.",
    ),
]
Threads = Annotated[int, typer.Option("--threads", metavar="1|2", help="Threads for the full arm: 2 where two cores are free.")]
TimeLimit = Annotated[float | None, typer.Option("--time-limit", metavar="SECONDS", help="Wall-clock limit of planning.")]
ModelFile = Annotated[Path | None, typer.Option("--model", metavar="MODEL.json", help="Reduced model made by identify.")]
