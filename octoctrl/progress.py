"""Live progress as an injected object, with one that does nothing."""

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
