"""What the guards of the plants find, and the stop that follows: one list and one object for every plant, batch and laboratory."""

from dataclasses import dataclass
from enum import IntEnum


class Finding(IntEnum):
    """What is wrong with an element; the numbers are those that compiled code returns."""

    FINE = 0
    STRETCHED = 1
    BENT = 2
    NOT_A_NUMBER = 3
    FAST = 4
    SHEARED = 5
    SPUN = 6
    SUNK = 7
    ASTRAY = 8

    @property
    def ends(self) -> bool:
        """Whether the motion cannot go on; otherwise it has, and a finer step would follow it better."""
        return self not in (Finding.FINE, Finding.SUNK)

    @property
    def predicate(self) -> str:
        """What is wrong, as a predicate of the element."""
        return _PREDICATES[self]

    @property
    def remedy(self) -> str:
        """What it comes from and what to do, if the motion ran into it smoothly."""
        return _REMEDIES[self]


_PREDICATES = {
    Finding.FINE: "is well",
    Finding.STRETCHED: "is stretched beyond 0.2…3 times its length",
    Finding.BENT: "is bent by more than 1.5 rad against its neighbour",
    Finding.NOT_A_NUMBER: "has a position that is not a number",
    Finding.FAST: "moves faster than 10 m/s",
    Finding.SHEARED: "is sheared by more than 60 degrees",
    Finding.SPUN: "turns by a radian within one step",
    Finding.SUNK: "sinks deeper into an object than its contact explains",
    Finding.ASTRAY: "goes faster than 10 m/s, or where no number says",
}

_REMEDIES = {
    Finding.FINE: "nothing needs to be done",
    Finding.STRETCHED: "it is pulled or pushed beyond what muscle laws describe - lower the levels",
    Finding.BENT: "it curls tighter than its elements resolve - use more elements, or lower the levels",
    Finding.NOT_A_NUMBER: "the motion is no longer a number - lower the levels",
    Finding.FAST: "most likely a sudden activation - smooth it (ramp >= 20 ms) or halve dt",
    Finding.SHEARED: "its section folds over - lower the levels, or use fewer, longer elements",
    Finding.SPUN: "the step cannot follow - halve dt",
    Finding.SUNK: "the step cannot follow - halve dt",
    Finding.ASTRAY: "it could pass through the arm within a step - look at its velocity, its mass and what pushes it",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """Where, when and why a motion was stopped.

    Attributes
    ----------
    time : float, s
    rod : str
        ``"arm"`` if there is only one; the object, if that has gone astray.
    element : int
    finding : Finding
    unstable : bool or None
        Whether the motion was thrown to and fro from step to step, so that the step is to blame; None if that cannot be told.
    cause : str
        What it most likely comes from and what to do, as the last part of a sentence.
    """

    time: float
    rod: str
    element: int
    finding: Finding
    unstable: bool | None
    cause: str

    @classmethod
    def astray(cls, time: float, what: str) -> "Stop":
        """The stop at a `time`, s, where an object goes astray; `what` names it."""
        return cls(time=time, rod=what, element=0, finding=Finding.ASTRAY, unstable=None, cause=Finding.ASTRAY.remedy)

    @property
    def mechanism(self) -> str:
        """What is wrong, as a predicate of the element."""
        return self.finding.predicate + (", thrown to and fro from step to step" if self.unstable else "")

    @property
    def place(self) -> str:
        """Element and rod, or the object."""
        if self.finding is Finding.ASTRAY:
            return self.rod
        return f"element {self.element}" if self.rod == "arm" else f"element {self.element} of {self.rod}"

    def message(self, step: float, limit: str) -> str:
        """One sentence with the remedy, for a run at `step` (s), with what is known of its `limit`."""
        said = f"at t={self.time:.4g} s: {self.place} {self.mechanism}"
        if not self.unstable:
            return f"stopped {said}; {self.cause}"
        return f"unstable {said} (dt={step:.2g} s, {limit}); {self.cause}"
