"""Bounded nonlinear least squares: Levenberg-Marquardt with exact slopes in a box.

References
----------
Levenberg (1944), Marquardt (1963); bounds by an active set on each linear problem (Stark & Parker 1995).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Values = Callable[[Floats], Floats]
Slopes = Callable[[Floats], tuple[Floats, Floats]]

LARGEST = 3.0
"""Largest change of an unknown in one iteration, in units of its scale, if nothing else is said."""

SMALLEST = 1e-5
"""Change of all unknowns below which there is nothing left to do."""

STALL, STALLED = 0.02, 4
"""Relative decrease of the sum of squares below which an iteration counts as idle, and how many of these in a row end it."""


@dataclass(frozen=True, slots=True)
class Box:
    """Unknowns: lower and upper bounds, and a change that counts as large, (n,) each."""

    lower: Floats
    upper: Floats
    scale: Floats


@dataclass(frozen=True, slots=True)
class Fit:
    """Where a fit ended: the unknowns, the rows there, and how many iterations it took."""

    x: Floats
    rows: Floats
    iterations: int

    @property
    def worst(self) -> float:
        """Largest size of a row; infinite if a row is not a number."""
        return float(np.abs(self.rows).max(initial=0.0)) if np.isfinite(self.rows).all() else np.inf


def bounded_step(matrix: Floats, rows: Floats, damping: float, low: Floats, high: Floats) -> Floats:
    """Minimise |matrix x + rows|^2 + damping |x|^2 in a box that holds 0.

    Active set: solve for the unknowns that no wall holds and go there as far as the box allows; at the first wall on the way, hold that one
    too; at the end of the way, let go of the wall that the slope leads away from most. No move makes the sum larger.

    Parameters
    ----------
    matrix : (m, n) float64
    rows : (m,) float64
    damping : float
    low, high : (n,) float64
        Around 0.

    Returns
    -------
    (n,) float64
    """
    count = matrix.shape[1]
    normal, pull = matrix.T @ matrix + damping * np.eye(count), -matrix.T @ rows
    step, held = np.zeros(count), np.zeros(count, dtype=bool)
    for _ in range(10 * count):
        slope, free, move = normal @ step - pull, ~held, np.zeros(count)
        move[free] = np.linalg.solve(normal[np.ix_(free, free)], -slope[free])
        room = np.full(count, np.inf)
        room[move > 0] = ((high - step)[move > 0]) / move[move > 0]
        room[move < 0] = ((low - step)[move < 0]) / move[move < 0]
        first = int(np.argmin(room))
        if room[first] < 1.0:
            step = np.clip(step + room[first] * move, low, high)
            step[first], held[first] = (high if move[first] > 0 else low)[first], True
            continue
        step = np.clip(step + move, low, high)
        slope = normal @ step - pull
        inwards = np.where(held & (step <= low), -slope, np.where(held & (step >= high), slope, -np.inf))
        inwards[low >= high] = -np.inf
        if inwards.max(initial=-np.inf) <= 1e-12 * np.abs(pull).max(initial=0.0):
            break
        held[int(np.argmax(inwards))] = False
    return step


def fit(
    values: Values,
    slopes: Slopes,
    start: Floats,
    box: Box,
    *,
    enough: float = 0.1,
    iterations: int = 15,
    largest: float = LARGEST,
    stop: Callable[[], bool] = lambda: False,
) -> Fit:
    """Bring rows towards zero.

    Parameters
    ----------
    values : callable
        Unknowns -> rows (m,), scaled so that 1 is a miss that just counts. Their number may change from point to point, for rows that are
        zero may be left out.
    slopes : callable
        Unknowns -> rows (m,) and their derivatives (m, n).
    start : (n,) float64
    box : Box
    enough : float
        Ends when no row is larger.
    iterations : int
    largest : float
        Change of an unknown in one iteration, in units of its scale.
    stop : callable
        Asked before each iteration whether time is up.

    Returns
    -------
    Fit
    """
    x, damping, idle = np.clip(start, box.lower, box.upper), 1e-3, 0
    rows, jacobian = slopes(x)
    cost = _cost(rows)
    for done in range(iterations):
        if np.abs(rows).max(initial=0.0) < enough or stop() or not np.isfinite(cost):
            return Fit(x, rows, done)
        matrix = jacobian * box.scale
        unit = max(float(np.sum(matrix * matrix)) / len(x), 1e-12)
        accepted = False
        for _ in range(5):
            step = bounded_step(matrix, rows, damping * unit, (box.lower - x) / box.scale, (box.upper - x) / box.scale)
            size = np.abs(step).max(initial=0.0)
            if size < SMALLEST:
                return Fit(x, rows, done)
            step *= min(1.0, largest / size)
            tried = np.clip(x + box.scale * step, box.lower, box.upper)
            found = _cost(values(tried))
            promised = cost - _cost(rows + matrix @ step)
            if found < cost - 1e-4 * max(promised, 0.0):
                accepted = True
                damping = max(damping / 5 if cost - found > 0.5 * promised else 2 * damping, 1e-7)
                break
            damping = max(10 * damping, 1e-3)
        if not accepted:
            return Fit(x, rows, done)
        idle = idle + 1 if cost - found < STALL * cost else 0
        x = tried
        rows, jacobian = slopes(x)
        cost = _cost(rows)
        if idle >= STALLED:
            return Fit(x, rows, done + 1)
    return Fit(x, rows, iterations)


def _cost(rows: Floats) -> float:
    cost = 0.5 * float(rows @ rows)
    return cost if np.isfinite(cost) else np.inf
