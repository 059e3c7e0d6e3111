"""The command for many runs: a sweep on this machine, a share of one in a job array, and the shares put together."""

from pathlib import Path
from typing import Annotated

import typer

from octoctrl.sim.errors import OctoctrlError

from .codes import ExitCode
from .options import AsJson, Quiet
from .output import display, print_json, say


def sweep(
    sweep_file: Annotated[Path, typer.Argument(metavar="SWEEP.toml", show_default=False)],
    jobs: Annotated[int, typer.Option("-j", "--jobs", help="Processes.")] = 1,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="ROWS.jsonl", help="Default: beside the sweep file.")] = None,
    share: Annotated[str, typer.Option("--share", metavar="I/N", help="Do one of N shares, for a job array.")] = "1/1",
    gather: Annotated[bool, typer.Option("--gather", help="Put the rows of all shares together, and run nothing.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> ExitCode:
    """Run a task or a plan many times with changed numbers; what was killed goes on where it was."""
    from ..connect.sweep import gathered
    from ..connect.sweep import sweep as run

    if gather:
        rows = gathered(sweep_file, output)
    else:
        try:
            rows = run(sweep_file, jobs=jobs, output=output, share=_share(share), progress=display(quiet))
        except KeyboardInterrupt as interrupt:
            for sentence in interrupt.args:
                say(sentence)
            return ExitCode.INTERRUPTED
    target = (output or sweep_file.with_suffix(".jsonl")).with_suffix(".csv")
    if as_json:
        print_json(rows)
        return ExitCode.WELL
    counts: dict[str, int] = {}
    for row in rows:
        said = " ".join(str(row[name]) for name in ("status", "verdict") if row.get(name))
        counts[said] = counts.get(said, 0) + 1
    print(f" {len(rows)} runs: " + ", ".join(f"{count} {said}" for said, count in sorted(counts.items())))
    if share == "1/1" or gather:
        say(f"wrote {target}")
    return ExitCode.WELL


def _share(text: str) -> tuple[int, int]:
    number, stroke, shares = text.partition("/")
    if not stroke or not number.isdecimal() or not shares.isdecimal():
        raise OctoctrlError(f"--share {text}: expected I/N, such as 3/30")
    return int(number), int(shares)
