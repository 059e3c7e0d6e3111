"""Live progress as an injected object: a bar on a terminal, or nothing."""

from typing import Protocol, runtime_checkable


@runtime_checkable
class Progress(Protocol):
    """What long work asks of a progress display."""

    def start(self, label, total=None):
        """Begin a stretch of work called `label`; `total` in any unit, None if unknown."""
        ...

    def advance(self, done, note=""):
        """Say how much of the total is `done`, and in `note` anything worth a few words."""
        ...

    def stop(self):
        """End the stretch of work."""
        ...


class NullProgress:
    """A display that shows nothing."""

    def start(self, label, total=None):
        """Show nothing."""

    def advance(self, done, note=""):
        """Show nothing."""

    def stop(self):
        """Show nothing."""


class RichProgress:
    """A bar on standard error: label, share, what is going on, elapsed and remaining time.

    Nothing is shown where standard error is not a terminal; there each stretch of work is announced in one line.
    """

    def __init__(self):
        self._bar = self._task = None

    def start(self, label, total=None):
        """Show a bar for a stretch of work.

        Parameters
        ----------
        label : str
        total : float, optional
            Any unit.
        """
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        self.stop()
        console = Console(stderr=True)
        if not console.is_terminal:
            console.print(label, highlight=False)
            return
        columns = [SpinnerColumn(), TextColumn("{task.description}")]
        columns += [BarColumn(), TaskProgressColumn()] if total else []
        columns += [TextColumn("{task.fields[note]}"), TimeElapsedColumn(), *([TimeRemainingColumn()] if total else [])]
        self._bar = Progress(*columns, console=console, transient=True)
        self._task = self._bar.add_task(label, total=total, note="")
        self._bar.start()

    def advance(self, done, note=""):
        """Move the bar.

        Parameters
        ----------
        done : float
            In the unit of the total.
        note : str
        """
        if self._bar is not None:
            self._bar.update(self._task, completed=done, note=note)

    def stop(self):
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
        self._bar = None
