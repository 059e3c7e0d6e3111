"""An arm that touches itself: which of its points may, and what is kept of it."""

from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contracts import Floats
from ..scene.objects import BEARABLE, FIRM

APART = 2.0
"""Points meet only if along the arm they are farther apart than so many times the sum of their radii: nearer ones are neighbours."""


class Folds(NamedTuple):
    """Pairs of points of an arm that may touch, P points, K pairs, room for T samples of notes.

    Attributes
    ----------
    points : tuple of arrays
        As the plant's surface reads them; `radius` (P,), m, and `length` (P,), m, of the arm that a point stands for, among them.
    stiffness : float, Pa
        Of the contact; times the length that a point stands for it is N/m.
    first : (P,) int64
        The first point that each one may meet of those that follow it; P if there is none.
    places : (4, P) float64, m
        Points and radii when it was last looked which are near.
    pairs : (K, 2) int64
        Pairs that are near, and how many they are: `found` (1,) int64.
    slack : (K,) float64, m
        What is left of their gaps at least, if they close at the speed `pace` (1,), m/s.
    bearable : float, m
        By how much points may overlap deeper than the spring between them explains.
    sums : (4,) float64
        Normal impulses (N s), deepest overlap (m), loaded pairs and deepest overlap less what its spring explains, since they were cleared.
    sunk : (1,) bool
        Whether a finer step would have followed the last sample better.
    notes : (T, 3) float64
        Sum of normal forces, N, mean of each sample; deepest overlap in it, m; mean number of loaded pairs.
    """

    points: Any
    stiffness: float
    first: NDArray[np.int64]
    places: Floats
    pairs: NDArray[np.int64]
    found: NDArray[np.int64]
    slack: Floats
    pace: Floats
    bearable: float
    sums: Floats
    sunk: NDArray[np.bool_]
    notes: Floats

    @classmethod
    def of(cls, points: Any, along: Floats) -> "Folds":
        """Of `points` at ascending rest arclengths `along` (P,), m."""
        count = len(along)
        meets = [
            next((q for q in range(p + 1, count) if along[q] - along[p] > APART * (points.radius[p] + points.radius[q])), count)
            for p in range(count)
        ]
        room = sum(count - q for q in meets)
        return cls(
            points=points,
            stiffness=FIRM,
            first=np.array(meets, dtype=np.int64),
            places=np.zeros((4, count)),
            pairs=np.zeros((room, 2), dtype=np.int64),
            found=np.zeros(1, dtype=np.int64),
            slack=np.zeros(room),
            pace=np.zeros(1),
            bearable=BEARABLE * float(points.radius.max()),
            sums=np.zeros(4),
            sunk=np.zeros(1, dtype=bool),
            notes=np.empty((0, 3)),
        )

    def with_room(self, samples: int, *, strict: bool = True) -> "Folds":
        """The same, with notes for so many samples; unless `strict`, points may overlap however deep."""
        return self._replace(notes=np.zeros((samples, 3)), bearable=self.bearable if strict else inf)
