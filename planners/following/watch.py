"""Which muscle groups do nothing: of the hypotheses "this one is dead" and "none is" the one that explains best what predictions get wrong.

What the predictions of the past periods got wrong is r = E theta + noise, with the errors theta of the groups' gains and of the drag, all
scaled so that the noise is white. Each hypothesis is a prior: theta is normal with the covariance K, and under the hypothesis that a
group is dead its own error is -1. The likelihood of r, theta integrated out, needs no more than A = sum E'E, b = sum E'r and c = sum r'r,

    2 log p = -c + b' (K^-1 + A)^-1 b - log det(1 + K A) + constant,

with b + A_g and c + 2 b_g + A_gg, g itself left out, for a dead group g. Old periods are forgotten: a group may also die on the way.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..contracts import Floats

DOUBT, DRAG_DOUBT, KINSHIP = 0.25, 0.7, 0.9
"""Standard deviations of gain errors and drag error beforehand, and the correlation of gain errors of one kind of muscle."""

KEPT = 0.85
"""Weight of a period against the one after it."""

EVIDENCE = 6.0
"""Logarithm of the ratio of likelihoods from which a group is called dead."""


class GroupWatch:
    """Evidence against muscle groups.

    Parameters
    ----------
    groups : tuple of str
        In the order of the errors, which those of the drag follow.
    """

    def __init__(self, groups: tuple[str, ...]) -> None:
        self.groups, count = groups, len(groups) + 1
        kinds = np.array([group.strip("0123456789") for group in groups])
        kin = np.where(kinds[:, None] == kinds, KINSHIP, 0.0)
        np.fill_diagonal(kin, 1.0)
        self._prior = np.zeros((count, count))
        self._prior[:-1, :-1], self._prior[-1, -1] = DOUBT**2 * kin, DRAG_DOUBT**2
        self._matrix, self._pull, self._size = np.zeros((count, count)), np.zeros(count), 0.0
        self.dead: tuple[str, ...] = ()
        """In the order in which they were found."""

    def add(self, effect: Floats, surprise: Floats) -> None:
        """Take up one prediction.

        Parameters
        ----------
        effect : (n, m + 1) float64
            What the errors would do, in standard deviations of the noise.
        surprise : (n,) float64
            What it got wrong, likewise.
        """
        self._matrix = KEPT * self._matrix + effect.T @ effect
        self._pull = KEPT * self._pull + effect.T @ surprise
        self._size = KEPT * self._size + float(surprise @ surprise)
        evidence = self.evidence()
        worst = max(evidence, key=lambda group: evidence[group], default="")
        if worst and evidence[worst] > EVIDENCE and worst not in self.dead:
            self.dead = (*self.dead, worst)

    def evidence(self) -> dict[str, float]:
        """Logarithm of the likelihood that a group is dead over that none is, by group."""
        alive, found = self._likelihood(self._pull, self._size, list(range(len(self._pull)))), {}
        for index, group in enumerate(self.groups):
            others = [other for other in range(len(self._pull)) if other != index]
            size = self._size + 2 * self._pull[index] + self._matrix[index, index]
            found[group] = self._likelihood(self._pull + self._matrix[:, index], size, others) - alive
        return found

    def _likelihood(self, pull: Floats, size: float, free: list[int]) -> float:
        matrix, prior, part = self._matrix[np.ix_(free, free)], self._prior[np.ix_(free, free)], pull[free]
        explained = part @ np.linalg.solve(np.linalg.inv(prior) + matrix, part)
        return float(-0.5 * (size - explained) - 0.5 * np.linalg.slogdet(np.eye(len(free)) + prior @ matrix)[1])

    def state(self) -> dict[str, Any]:
        """All that it remembers."""
        return {"matrix": self._matrix.copy(), "pull": self._pull.copy(), "size": self._size, "dead": list(self.dead)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go to a `state` of a watch of the same groups."""
        self._matrix, self._pull, self._size = state["matrix"].copy(), state["pull"].copy(), state["size"]
        self.dead = tuple(state["dead"])
