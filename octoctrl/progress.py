"""Live progress as an injected object: a bar on a terminal, or nothing."""

from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    import rich.progress


@runtime_checkable
class Progress(Protocol):
    """What long work asks of a progress display."""

    def start(self, label: str, total: float | None = None) -> None:
        """Begin a stretch of work called `label`; `total` in any unit, None if unknown."""
        ...

    def advance(self, done: float, note: str = "") -> None:
        """Say how much of the total is `done`, and in `note` anything worth a few words."""
        ...

    def stop(self) -> None:
        """End the stretch of work."""
        ...


class NullProgress:
    """A display that shows nothing."""

    def start(self, label: str, total: float | None = None) -> None:
        """Show nothing."""

    def advance(self, done: float, note: str = "") -> None:
        """Show nothing."""

    def stop(self) -> None:
        """Show nothing."""


class RichProgress:
    """A bar on standard error: label, share, what is going on, elapsed and remaining time.

    Nothing is shown where standard error is not a terminal; there each stretch of work is announced in one line.
    """

    def __init__(self) -> None:
        self._bar: rich.progress.Progress | None = None
        self._task: rich.progress.TaskID | None = None

    def start(self, label: str, total: float | None = None) -> None:
        """Show a bar for a stretch of work called `label`; `total` in any unit, None if unknown."""
        from rich import progress
        from rich.console import Console

        self.stop()
        console = Console(stderr=True)
        if not console.is_terminal:
            console.print(label, highlight=False)
            return
        columns: list[progress.ProgressColumn] = [progress.SpinnerColumn(), progress.TextColumn("{task.description}")]
        columns += [progress.BarColumn(), progress.TaskProgressColumn()] if total else []
        columns += [progress.TextColumn("{task.fields[note]}"), progress.TimeElapsedColumn()]
        columns += [progress.TimeRemainingColumn()] if total else []
        self._bar = progress.Progress(*columns, console=console, transient=True)
        self._task = self._bar.add_task(label, total=total, note="")
        self._bar.start()

    def advance(self, done: float, note: str = "") -> None:
        """Move the bar to `done`, in the unit of the total, with a `note` beside it."""
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=done, note=note)

    def stop(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
        self._bar = None
