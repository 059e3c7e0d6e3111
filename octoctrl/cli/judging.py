"""Commands that look at a run: the verdict, planned against simulated, and the page that shows all of it."""

from pathlib import Path
from typing import Annotated

import typer

from .codes import ExitCode, code_of_verdict
from .options import AsJson, Overwrite, RunFile
from .output import report as print_result
from .output import say, verdict_content


def verify(run_file: RunFile, as_json: AsJson = False) -> ExitCode:
    """Check a run against its plan and its task."""
    from ..files.store import load
    from ..judging.verification import verify as check

    verdict = check(load(run_file, expect="Execution"))
    print_result(verdict, verdict_content(verdict), as_json)
    return code_of_verdict(verdict)


def compare(
    run_file: RunFile,
    picture: Annotated[Path | None, typer.Option("--plot", metavar="PICTURE", help="Draw the traces: .png, .pdf or .svg.")] = None,
    kymograph: Annotated[
        Path | None, typer.Option("--kymograph", metavar="PICTURE", help="Draw bending over time and arclength: .png, .pdf or .svg.")
    ] = None,
    overlap: Annotated[bool, typer.Option("--overlap", help="Compare a run that was cut short as far as it goes.")] = False,
    force: Overwrite = False,
    as_json: AsJson = False,
) -> ExitCode:
    """Compare planned and simulated link, writhe and twist."""
    from ..files.store import load
    from ..judging.comparison import compare as align

    execution = load(run_file, expect="Execution")
    comparison = align(execution, overlap=overlap)
    if picture is not None:
        from ..pictures.plots import plot

        plot(execution, picture, overwrite=force, overlap=overlap)
        say(f"wrote {picture}")
    if kymograph is not None:
        from ..pictures.kymograph import kymograph as draw

        draw(execution, kymograph, overwrite=force)
        say(f"wrote {kymograph}")
    print_result(comparison, {"errors": comparison.summary(), "level_times": comparison.delays}, as_json)
    return ExitCode.WELL


def report(
    run_files: Annotated[list[Path], typer.Argument(metavar="RUN.npz...", help="Several are put side by side, with one clock.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PAGE.html")],
    force: Overwrite = False,
) -> ExitCode:
    """Write runs as one page that opens in any browser, without a network: the arm in space, traces, kymographs, verdict."""
    from ..files.store import load
    from ..files.writing import check_target
    from ..pictures.report import report as write

    check_target(output, overwrite=force, suffixes=(".html",))
    write([load(path, expect="Execution") for path in run_files], output, overwrite=force)
    say(f"wrote {output}")
    return ExitCode.WELL


def export(
    run_file: RunFile,
    output: Annotated[Path, typer.Argument(metavar="FILE", help=".csv, .glb, .gif, .webp or .mp4.", show_default=False)],
    table: Annotated[str, typer.Option("--table", metavar="NAME", help="Of a .csv: shape, or traces.")] = "shape",
    speed: Annotated[float, typer.Option("--speed", help="Of a film over that of the arm.")] = 1.0,
    force: Overwrite = False,
) -> ExitCode:
    """Write a run for other programs: a table, a moving mesh, a film."""
    from ..files.store import load
    from ..files.writing import check_target
    from ..pictures.export import SUFFIXES
    from ..pictures.export import export as write

    check_target(output, overwrite=force, suffixes=SUFFIXES)
    write(load(run_file, expect="Execution"), output, table=table, speed=speed, overwrite=force)
    say(f"wrote {output}")
    return ExitCode.WELL
