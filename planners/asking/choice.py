"""Leaving the sequence to the planner: which muscles it may use, where a task does not name its drives."""

from dataclasses import dataclass

from octoctrl.sim.annotations import settle
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, Arm
from octoctrl.sim.errors import check_choice, check_number, check_window

from .shares import Length, Share, resolved, unresolved


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What the planner may choose a task's drives from.

    Every channel, that is a hand of the oblique muscles, a side to bend to, or the length, may take a new level in every phase; what turns
    out to change nothing is left out again.

    Attributes
    ----------
    sides : tuple of str
        Muscles LM1 to LM8 towards which the arm may bend. If empty, the one that coils about the task's pole, and all four quarters where a
        goal asks for a place or a side.
    most : int
        Largest number of drives.
    window : (float or Share, float or Share), m
        Stretch of the arm on which they act.
    """

    sides: tuple[str, ...] = ()
    most: int = 10
    window: tuple[Length, Length] = (0.0, Share(percent=98.9))

    def __post_init__(self) -> None:
        settle(self)
        if not unresolved(self.window):
            check_window("choose", self.window)
        for side in self.sides:
            check_choice("side", side, LONGITUDINAL_GROUPS)
        check_number("most", self.most, at_least=1)

    def on(self, arm: Arm) -> "Choice":
        """The choice for an `arm`: shares of it become lengths."""
        return resolved(self, arm.length)
