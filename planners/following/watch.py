"""Which muscle groups do nothing: of the hypotheses "this one is dead" and "none is" the one that explains best what predictions get wrong.

What the predictions of the past periods got wrong is r = E theta + noise, with the errors theta of the groups' gains and of the drag, all
scaled so that the noise is white. Each hypothesis is a prior: theta is normal with the covariance K, and under the hypothesis that a
group is dead its own error is -1. The likelihood of r, theta integrated out, needs no more than A = sum E'E, b = sum E'r and c = sum r'r,

    2 log p = -c + b' (K^-1 + A)^-1 b - log det(1 + K A) + constant,

with b + A_g and c + 2 b_g + A_gg, g itself left out, for a dead group g. Old periods are forgotten: a group may also die on the way.

Where even the best hypothesis leaves more than noise, the model is wrong in other ways than by gains and drag, and what it leaves is the
noise of all: a dead group must explain what is seen, not only explain it less badly than its rivals. A group that has been seen to work
must give much more evidence against itself, since a model that is wrong in places is likelier than a muscle that dies.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..contracts import Floats

DOUBT, DRAG_DOUBT, KINSHIP = 0.25, 0.7, 0.9
"""Standard deviations of gain errors and drag error beforehand, and the correlation of gain errors of one kind of muscle."""

KEPT = 0.85
"""Weight of a period against the one after it."""

EVIDENCE, AFTER_WORK = 6.0, 18.0
"""Logarithm of the ratio of likelihoods from which a group is called dead, and the same once it has been seen to work."""


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
        prior = np.zeros((count, count))
        prior[:-1, :-1], prior[-1, -1] = DOUBT**2 * kin, DRAG_DOUBT**2
        # One row for each hypothesis: that none is dead, then that each group is, whose own error is not free.
        self._free = np.ones((count, count), dtype=bool)
        self._free[1:, :-1] &= ~np.eye(count - 1, dtype=bool)
        self._precision, self._spread = np.tile(np.eye(count), (count, 1, 1)), np.zeros(count)
        for row, free in enumerate(self._free):
            part = np.ix_(free, free)
            self._precision[row][part], self._spread[row] = np.linalg.inv(prior[part]), np.linalg.slogdet(prior[part])[1]
        self._matrix, self._pull, self._size, self._count = np.zeros((count, count)), np.zeros(count), 0.0, 0.0
        self.working: frozenset[str] = frozenset()
        """Groups that have been seen to work."""
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
        self._count = KEPT * self._count + len(surprise)
        evidence = self.evidence()
        self.working |= {group for group, against in evidence.items() if against < -AFTER_WORK}
        worst = max(evidence, key=lambda group: evidence[group], default="")
        if worst and worst not in self.dead and evidence[worst] > (AFTER_WORK if worst in self.working else EVIDENCE):
            self.dead = (*self.dead, worst)

    def evidence(self) -> dict[str, float]:
        """Logarithm of the likelihood that a group is dead over that none is, by group."""
        unexplained, likelihood = self._weighed(1.0)
        noise = unexplained.min() / max(self._count, 1.0)
        if noise > 1:
            _, likelihood = self._weighed(noise)
        return dict(zip(self.groups, (likelihood[1:] - likelihood[0]).tolist(), strict=True))

    def _weighed(self, noise: float) -> tuple[Floats, Floats]:
        """What each hypothesis leaves as a sum of squares, and the logarithm of its likelihood, in the variance `noise`."""
        free, groups = self._free, len(self.groups)
        pull, size = np.tile(self._pull, (len(free), 1)), np.full(len(free), self._size)
        pull[1:] += self._matrix[:groups]
        size[1:] += 2 * self._pull[:groups] + self._matrix.diagonal()[:groups]
        pull = np.where(free, pull, 0.0) / noise
        sharpened = self._precision + np.where(free[:, :, None] & free[:, None, :], self._matrix, 0.0) / noise
        unexplained = size / noise - (pull * np.linalg.solve(sharpened, pull[:, :, None])[:, :, 0]).sum(axis=1)
        return unexplained, -0.5 * (unexplained + np.linalg.slogdet(sharpened)[1] + self._spread)

    def state(self) -> dict[str, Any]:
        """All that it remembers."""
        return {
            "matrix": self._matrix.copy(),
            "pull": self._pull.copy(),
            "size": self._size,
            "count": self._count,
            "working": sorted(self.working),
            "dead": list(self.dead),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go to a `state` of a watch of the same groups."""
        self._matrix, self._pull = state["matrix"].copy(), state["pull"].copy()
        self._size, self._count = state["size"], state["count"]
        self.working, self.dead = frozenset(state["working"]), tuple(state["dead"])
