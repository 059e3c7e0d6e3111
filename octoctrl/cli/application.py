"""The command line: its commands by family, and what becomes of everything that can go wrong.

Exit codes: 0 well, 1 verdict failed, 2 bad input, 3 no plan, 4 plant unstable, 5 controller failed, 70 a fault of octoctrl, 130
interrupted.
"""

import contextlib
import os
import re
import signal
import sys
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Annotated, Any

import typer

from octoctrl import __version__
from octoctrl.sim.errors import OctoctrlError, OctoctrlWarning, PlantUnstableError

from . import installation, judging, measured, measuring, planning, running, sweeping
from .codes import ExitCode
from .output import say

FAMILIES: dict[str, tuple[Callable[..., ExitCode], ...]] = {
    "Plan": (planning.tasks, planning.plan, planning.identify),
    "Run": (running.run, running.demo, sweeping.sweep),
    "Judge": (judging.verify, judging.compare, judging.report, judging.export),
    "Arms that were measured": (measured.topology, measured.fibres),
    "Measure": (measuring.bench, measuring.stability),
    "Installation": (installation.doctor, installation.warmup, installation.cite),
}
"""Every command, by the heading of the help under which it stands; its function's name is the command's."""

app = typer.Typer(
    help="Plan the muscle activations of a soft arm in the language of topology, and verify them on a Cosserat simulator.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
for _family, _commands in FAMILIES.items():
    for _command in _commands:
        app.command(rich_help_panel=_family)(_command)


@app.callback(invoke_without_command=True, epilog="Every command takes --debug, which shows where an error came from.")
def _front(version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False) -> None:
    if version:
        print(f"octoctrl {__version__}")
        raise typer.Exit


def main(argv: list[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : list of str, optional
        Arguments; those of the process if omitted.

    Returns
    -------
    int
        Exit code, see `octoctrl.cli.codes.ExitCode`.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in arguments
    _treat_termination_as_interrupt()
    try:
        with _told():
            code = app(args=[word for word in arguments if word != "--debug"], prog_name="octoctrl", standalone_mode=False)
        sys.stdout.flush()
        if code == ExitCode.INTERRUPTED:
            say("interrupted")
        return int(code) if isinstance(code, int) else ExitCode.WELL
    except KeyboardInterrupt:
        say("interrupted")
        return ExitCode.INTERRUPTED
    except SystemExit:  # a shell has been offered words, or who reads the output has seen enough
        return ExitCode.WELL
    except BrokenPipeError:
        _give_up_output()
        return ExitCode.WELL
    except Exception as error:
        if debug:
            traceback.print_exc()
        code, text = _complaint(error)
        say(f"octoctrl: {text}")
        return code


@contextlib.contextmanager
def _told() -> Iterator[None]:
    """Say each warning in a sentence while a command runs; of those that differ by numbers alone the first, and in the end how many."""
    first, counts = dict[str, str](), Counter[str]()
    usual = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *rest: Any, **more: Any) -> None:
        if not issubclass(category, OctoctrlWarning):
            usual(message, category, *rest, **more)
            return
        kind = re.sub(r"[-+.\d]+", "0", str(message))
        counts[kind] += 1
        if kind not in first:
            first[kind] = str(message)
            say(f"octoctrl: {message}")

    with warnings.catch_warnings():
        # Numbers that overflow or are none are told as results; what NumPy has to say about them is no sentence for a user.
        warnings.filterwarnings("ignore", category=RuntimeWarning)
        warnings.filterwarnings("always", category=OctoctrlWarning)
        warnings.showwarning = show
        try:
            yield
        finally:
            for kind, count in counts.items():
                if count > 1:
                    say(f"octoctrl: so it was {count} times, with numbers of its own each: {first[kind]}")


_CLICK = {"ClickException": ExitCode.BAD_INPUT, "Abort": ExitCode.INTERRUPTED}
"""Depending on its version, typer brings these classes along or takes them from click."""


def _complaint(error: Exception) -> tuple[ExitCode, str]:
    """Exit code of an error, and the sentence that says it."""
    if isinstance(error, OctoctrlError):
        return ExitCode.BAD_INPUT, " ".join(str(error).split())
    if isinstance(error, PlantUnstableError):
        return ExitCode.UNSTABLE, str(error)
    if isinstance(error, OSError):
        _give_up_output()
        return ExitCode.BAD_INPUT, f"{error.filename or 'the output'} cannot be read or written: {error.strerror or error}"
    for kind in type(error).__mro__:
        if kind.__name__ in _CLICK:
            return _CLICK[kind.__name__], error.format_message() if hasattr(error, "format_message") else str(error)
    said = " ".join(str(error).split())
    return (
        ExitCode.FAULT,
        f"a fault of octoctrl, {type(error).__name__}: {said}; the same command with --debug shows where, please report it",
    )


def _give_up_output() -> None:
    """What is still to be printed goes nowhere, so that the end of the program does not try it again."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _treat_termination_as_interrupt() -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    try:
        signal.signal(signal.SIGTERM, interrupt)
    except ValueError:  # not the main thread: whoever owns the process decides
        return
