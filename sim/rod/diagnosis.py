"""Why a run of the rod stopped: a second look at every step of the last samples.

An unstable step throws the motion to and fro from one step to the next; a motion that truly runs into a guard, such as a tip that curls
tighter than its elements can resolve, arrives there smoothly. The two want different remedies.
"""

from itertools import pairwise

import numpy as np

from ..contracts import Floats
from ..findings import Finding, Stop

TRAIL = 12
"""Steps before the stop that are looked at, if there are so many."""
FEWEST = 5
"""Steps from which on a verdict is possible."""
ALTERNATING = 0.3
"""Share of the motion that turns back in every step above which the step is called unstable: 1 for a zigzag, 0.3 to 1 for steps of 1.6 and
more times the limit, 0 to 0.17 for motions that run into a guard (a thousand random arms of the stability laboratory)."""


def explained(time: float, element: int, finding: Finding, unstable: bool | None) -> Stop:
    """The stop of a run of one rod, with what to do about it."""
    if unstable:
        cause = "most likely a sudden load or activation - smooth it (ramp >= 20 ms) or halve dt"
    else:
        known = unstable is False or finding.remedy.endswith("halve dt")
        cause = finding.remedy + ("" if known else ", or halve dt")
    return Stop(time=time, rod="arm", element=element, finding=finding, unstable=unstable, cause=cause)


def substeps(levels: Floats, steps: int) -> Floats:
    """Levels (samples + 1, ...), linear in between, at each of the `steps` of every sample (samples * steps + 1, ...)."""
    share = np.arange(steps).reshape(-1, *(1,) * (levels.ndim - 1)) / steps
    inner = [(1 - share) * before + share * after for before, after in pairwise(levels)]
    return np.concatenate([*inner, levels[-1:]])


def alternation(motion: Floats) -> float | None:
    """Which share of a motion (steps, ...) turns back in every step: 1 for a zigzag, 0 for uniform motion; None if it is too short."""
    if len(motion) < FEWEST:
        return None
    change = np.diff(motion[-TRAIL:], axis=0)
    turned, moved = np.linalg.norm(np.diff(change, axis=0)), np.linalg.norm(change[1:]) + np.linalg.norm(change[:-1])
    return float(turned / moved) if moved > 0 else 0.0
