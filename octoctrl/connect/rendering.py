"""A picture of an arm as an array, without any package for pictures: discs along the axis, from the side and from the front."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.contracts import Floats

SIZE = 256
"""Pixels of each of the two views."""

VIEWS = ((0, 1, 2), (2, 1, 0))
"""Axes to the right, up, and towards the eye."""

WATER, ARM, GOAL = (236, 242, 248), (196, 112, 86), (70, 130, 180)
FINER = 6
"""Discs for each element."""


def drawn(points: Floats, radii: Floats, length: float, balls: Iterable[tuple[Floats, float]] = ()) -> NDArray[np.uint8]:
    """Draw an arm.

    Parameters
    ----------
    points : (n + 1, 3) float64, m
    radii : (n,) float64, m
        Of the elements.
    length : float, m
        Of the arm, which sets the scale.
    balls : iterable of ((3,) float64, float)
        Place and radius, m, of what else there is.

    Returns
    -------
    (256, 512, 3) uint8
        From +z at the left, from +x at the right; the base is in the middle of the lower quarter.
    """
    along = np.linspace(0, len(radii), FINER * len(radii) + 1)
    fine = np.stack([np.interp(along, np.arange(len(points)), points[:, axis]) for axis in range(3)], axis=1)
    thick = np.interp(along - 0.5, np.arange(len(radii)), radii)
    discs = [(place, radius, GOAL) for place, radius in balls] + [(place, radius, ARM) for place, radius in zip(fine, thick, strict=True)]
    return np.concatenate([_view(discs, axes, SIZE / (2.4 * length)) for axes in VIEWS], axis=1)


def _view(discs: list[tuple[Floats, float, Any]], axes: tuple[int, int, int], scale: float) -> NDArray[np.uint8]:
    picture = np.full((SIZE, SIZE, 3), WATER, dtype=np.uint8)
    across, up, towards = axes
    for place, radius, colour in sorted(discs, key=lambda disc: float(disc[0][towards])):
        column, row, reach = SIZE / 2 + scale * place[across], 0.75 * SIZE - scale * place[up], max(scale * radius, 1.0)
        left, top = max(int(column - reach), 0), max(int(row - reach), 0)
        right, bottom = min(int(column + reach) + 2, SIZE), min(int(row + reach) + 2, SIZE)
        if right <= left or bottom <= top:
            continue
        y, x = np.ogrid[top:bottom, left:right]
        share = ((x - column) ** 2 + (y - row) ** 2) / reach**2
        inside = share <= 1.0
        # Lighter in the middle: discs look like a round arm.
        shade = (0.65 + 0.35 * np.sqrt(1.0 - share[inside]))[:, None]
        picture[top:bottom, left:right][inside] = (np.array(colour) * shade).astype(np.uint8)
    return picture
