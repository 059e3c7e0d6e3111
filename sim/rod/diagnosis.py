"""Why a run of the rod stopped: a second look at every step of the last samples.

An unstable step throws the motion to and fro from one step to the next; a motion that truly runs into a guard, such as a tip that curls
tighter than its elements can resolve, arrives there smoothly. The two want different remedies.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .elastic import FINDINGS

TRAIL = 12
"""Steps before the stop that are looked at, if there are so many."""
FEWEST = 5
"""Steps from which on a verdict is possible."""
ALTERNATING = 0.3
"""Share of the motion that turns back in every step above which the step is called unstable: 1 for a zigzag, 0.3 to 1 for steps of 1.6 and
more times the limit, 0 to 0.17 for motions that run into a guard (a thousand random arms of the stability laboratory)."""

REMEDIES = {
    1: "it is pulled or pushed beyond what muscle laws describe - lower the levels",
    2: "it curls tighter than its elements resolve - use more elements, or lower the levels",
    3: "the motion is no longer a number - lower the levels",
    6: "the step cannot follow - halve dt",
    5: "its section folds over - lower the levels, or use fewer, longer elements",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """Where, when and why a motion was stopped.

    Attributes
    ----------
    time : float, s
    element : int
    finding : int
        Key of `octoctrl.sim.rod.elastic.FINDINGS`.
    unstable : bool or None
        Whether the motion alternated from step to step; None if there were too few steps to tell.
    """

    time: float
    element: int
    finding: int
    unstable: bool | None

    @property
    def mechanism(self):
        """What is wrong, as a predicate of the element."""
        return FINDINGS[self.finding] + (", thrown to and fro from step to step" if self.unstable else "")

    def message(self, dt, limit):
        """One sentence with the remedy, for a run at the step `dt` (s) with the predicted `limit`, a `StepLimit`."""
        where = f"at t={self.time:.4g} s: element {self.element} {self.mechanism}"
        if not self.unstable:
            return f"stopped {where}; {REMEDIES[self.finding]}{'' if self.unstable is False else ', or halve dt'}"
        return (
            f"unstable {where} (dt={dt:.2g} s, predicted limit {limit.step:.2g} s from {limit.mechanism}); "
            "most likely a sudden load or activation - smooth it (ramp >= 20 ms) or halve dt"
        )


def substeps(levels, steps):
    """Levels (samples + 1, ...), linear in between, at each of the `steps` of every sample (samples * steps + 1, ...)."""
    share = np.arange(steps).reshape(-1, *(1,) * (levels.ndim - 1)) / steps
    inner = [(1 - share) * before + share * after for before, after in pairwise(levels)]
    return np.concatenate([*inner, levels[-1:]])


def alternation(motion):
    """Which share of a motion (steps, ...) turns back in every step: 1 for a zigzag, 0 for uniform motion; None if it is too short."""
    if len(motion) < FEWEST:
        return None
    change = np.diff(motion[-TRAIL:], axis=0)
    turned, moved = np.linalg.norm(np.diff(change, axis=0)), np.linalg.norm(change[1:]) + np.linalg.norm(change[:-1])
    return float(turned / moved) if moved > 0 else 0.0
