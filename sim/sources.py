"""Sources of activation that are not composed of templates: what a plant asks for levels."""

from dataclasses import dataclass

import numpy as np

from .activation import raised_cosine
from .body.arm import MUSCLE_GROUPS
from .errors import check_number


@dataclass(frozen=True, slots=True, kw_only=True)
class Strike:
    """Activation of a strike: all rings at once, steeply; takes the place of an `Activation`.

    Attributes
    ----------
    rise : float, s
        Time to full activation.
    steepness : float
        Power of the raised cosine.

    Raises
    ------
    OctoctrlError
        If either is not positive.
    """

    rise: float = 0.038
    steepness: float = 15.0

    def __post_init__(self):
        check_number("rise", self.rise, above=0.0, unit="s")
        check_number("steepness", self.steepness, above=0.0)

    def levels(self, times, edges):
        """Levels (T, groups, n) of the muscle groups at `times`, s, in the cells between `edges`, m."""
        levels = np.zeros((len(times), len(MUSCLE_GROUPS), len(edges) - 1))
        ramp = raised_cosine(np, np.asarray(times, dtype=float), 0.0, self.rise)
        levels[:, MUSCLE_GROUPS.index("TM")] = ramp[:, None] ** self.steepness
        return levels
