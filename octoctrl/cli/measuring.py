"""Commands that measure octoctrl itself: benchmarks, and the stability laboratory."""

from pathlib import Path
from typing import Annotated

import typer

from .codes import ExitCode
from .options import AsJson, Overwrite, Quiet
from .output import display, report


def bench_parts() -> list[str]:
    """Names of the parts of the benchmark."""
    from ..bench.benchmark import PARTS, TOGETHER

    return [*PARTS, TOGETHER]


def bench(
    parts: Annotated[
        list[str] | None, typer.Argument(metavar="[PART]...", help="rod, assembly, reduced, tasks, ...", autocompletion=bench_parts)
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="More cases; without PARTs, all of them (many minutes).")] = False,
    count: Annotated[int | None, typer.Option("--count", metavar="N", help="Random goals and plants, of tasks.")] = None,
    seed: Annotated[int | None, typer.Option("--seed", metavar="N", help="Which of them.")] = None,
    plants: Annotated[
        list[str] | None, typer.Option("--plant", metavar="NAME", help="Where tasks are carried out, of tracking; once or more.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--json", metavar="FILE.json", help="Write the numbers.")] = None,
    picture: Annotated[Path | None, typer.Option("--plot", metavar="PICTURE", help="Draw time against error: .png, .pdf or .svg.")] = None,
    page: Annotated[Path | None, typer.Option("--page", metavar="FILE.md", help="Write the tables as a page.")] = None,
    force: Overwrite = False,
    quiet: Quiet = False,
) -> ExitCode:
    """Measure run time against error, scaling, step limits, what is skipped, and start-up (two minutes without --full)."""
    from ..bench import benchmark as benchmarking
    from ..files.writing import check_target

    for path, suffixes in ((output, (".json",)), (picture, (".png", ".pdf", ".svg")), (page, (".md",))):
        if path is not None:
            check_target(path, overwrite=force, suffixes=suffixes)
    progress = display(quiet)
    try:
        tables = benchmarking.run(parts or (), full=full, count=count, seed=seed, plants=plants or (), progress=progress)
    finally:
        progress.stop()
    print(*tables, sep="\n\n")
    sizes = [word for name, value in (("--count", count), ("--seed", seed)) if value is not None for word in (name, str(value))]
    sizes += [word for name in plants or () for word in ("--plant", name)]
    command = " ".join(["octoctrl bench", *(parts or ()), *(["--full"] if full else []), *sizes, *(["--page", str(page)] if page else [])])
    benchmarking.write(tables, command, output=output, picture=picture, page=page)
    return ExitCode.WELL


def stability(
    runs: Annotated[int, typer.Option("-n", "--runs", help="How many, or a few more.")] = 6000,
    plant: Annotated[str, typer.Option("--plant", help="rod, assembly or another full arm.")] = "rod",
    seed: Annotated[int, typer.Option("--seed")] = 0,
    outcomes: Annotated[Path | None, typer.Option("-o", "--output", metavar="FILE.jsonl", help="Where outcomes are kept.")] = None,
    repeat: Annotated[str | None, typer.Option("--repeat", metavar="KIND:NUMBER", help="One run only, and what it is.")] = None,
    page: Annotated[
        Path | None, typer.Option("--page", metavar="FILE.md", help="Write a page of all outcomes kept here, and its picture.")
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> ExitCode:
    """Random arms, activations and steps: accurate, refused, or stopped with the reason? Goes on where it was interrupted."""
    from ..files.writing import check_target
    from ..laboratory import page as laboratory_page
    from ..laboratory import studies as laboratory

    if repeat is not None:
        trial, outcome = laboratory.repeat(repeat, seed, plant)
        report(f"{trial}\n\n{outcome}", laboratory.written(outcome), as_json)
        return ExitCode.VERDICT_FAILED if outcome.undetected else ExitCode.WELL
    target, progress = outcomes or Path(f"stability-{plant}-{seed}.jsonl"), display(quiet)
    if page is not None:
        check_target(page, overwrite=True, suffixes=(".md",))
    found = laboratory.study(target, runs, plant=plant, seed=seed, progress=progress)
    if page is not None:
        laboratory_page.write(page, target, progress)
    report(laboratory_page.text(found), laboratory.content(found), as_json)
    return ExitCode.VERDICT_FAILED if any(outcome.undetected for outcome in found) else ExitCode.WELL
