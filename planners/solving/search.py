"""From a task's own numbers, or from nothing better than chance, to unknowns that meet every goal.

First the task's own numbers. If a fit from there does not meet the goals, random programmes are simulated, coarsely and without slopes,
and ranked by how far they are off; of the best that lie apart slopes tell what one step would better, and by that they are fitted in turn.
What is near by chance is often a dead end: of an arm that does not bend nothing says that bending would give it writhe. Careful fits, which
change little at once, and bold ones take turns, for each finds what the other misses. Several fits that end at one miss prove nothing, so
that the search goes on until its work is used up. What is found on coarse steps is finished on fine ones: coarse steps flatter.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from .least_squares import LARGEST, bounded_step, fit
from .problem import GUARD_SCALE, Problem, Reading

Floats = NDArray[np.float64]

COARSE, RANKING, MIDDLE, FINE = 0.15, 0.2, 0.05, 0.02
"""Steps of the reduced model, s: of a fit, of ranking, and of finishing in two stages."""

ENOUGH = 1 / 3
"""Share of its tolerance that a goal may use on the model; the rest is left to the plant."""

BATCHES = ((30, 10, 4), (120, 30, 20))
"""Random programmes, of how many of them slopes are asked, and how many are fitted at most: first a few, for most searches end there."""

APART = 0.25
"""How far apart programmes lie in the unit box."""

CAREFUL = 1.0
"""Largest change of an unknown in one iteration of a careful fit, in units of its scale."""

LINEAR, DAMPED = 2.0, 1e-2
"""How far slopes are trusted that tell what a programme promises, in units of the scale, and the damping of that step."""

WORK = 12000.0
"""Steps of the model, with slopes counted by what they cost, after which no new start is made: some two seconds."""

CLOSE, EVEN, TURNS = 0.9, 3, 3
"""Largest miss beyond which, up to `NEARLY`, misses are evened out; the power of rows whose sum of squares does that; how often."""

GAIN, NEARLY = 0.9, 1.3
"""A fit that leaves more than this share of the largest miss will not be bettered by the next; what is nearly met is tried further."""

CAPPED = 30.0
"""Rows are not ranked beyond this many tolerances."""

Stop = Callable[[], bool]


@dataclass(frozen=True, slots=True)
class Found:
    """The best that a search has seen.

    Attributes
    ----------
    x : (n,) float64
    reading : Reading
        On fine steps.
    starts : int
        Programmes from which it was tried.
    iterations : int
    """

    x: Floats
    reading: Reading
    starts: int
    iterations: int

    @property
    def solved(self) -> bool:
        """Whether every goal is met, and the path keeps away from a U-turn."""
        return self.reading.worst <= 1


class Search:
    """The search on one problem; deterministic, unless it is stopped.

    Parameters
    ----------
    problem : Problem
    stop : callable
        Whether time is up.
    tell : callable
        Told the number of the start and the smallest miss so far.
    work : float
        Steps of the model, with slopes counted by what they cost, after which no new start is made.
    draw : int
        Seed of the random programmes.
    """

    def __init__(
        self,
        problem: Problem,
        stop: Stop,
        tell: Callable[[int, float], None] = lambda _start, _miss: None,
        *,
        work: float = WORK,
        draw: int = 0,
    ) -> None:
        self.problem, self.stop, self.tell, self.work, self.draw = problem, stop, tell, work, draw
        problem.work = 0.0
        self.best: tuple[float, Floats] | None = None
        self.found: Found | None = None
        self.starts = self.iterations = 0

    def read(self, x: Floats, step: float = FINE) -> Reading:
        """What unknowns lead to, on steps of at most `step`."""
        return self.problem.read(x, self.problem.grid(x, step))

    def over(self) -> bool:
        """Whether time is up, or the work is used up by half as much again."""
        return self.stop() or self.problem.work > 1.5 * self.work

    def fitted(
        self, x: Floats, step: float, iterations: int, offset: Floats | float = 0.0, largest: float = LARGEST, power: int = 1
    ) -> Floats:
        """Unknowns after a fit on steps of `step`, whose number stays what it is at its begin; `offset` is added to the misses, `largest`
        is the largest change in one iteration, and an odd `power` of the rows is fitted.
        """
        problem, grid = self.problem, self.problem.grid(x, step)

        def read(tried: Floats, slopes: bool) -> Reading:
            reading = problem.read(tried, grid, slopes)
            return replace(reading, misses=reading.misses + offset)

        def values(tried: Floats) -> Floats:
            return read(tried, False).rows ** power

        def slopes(tried: Floats) -> tuple[Floats, Floats]:
            reading = read(tried, True)
            return reading.rows**power, power * reading.rows[:, None] ** (power - 1) * reading.slopes

        ended = fit(values, slopes, x, problem.box, iterations=iterations, largest=largest, stop=self.over)
        self.iterations += ended.iterations
        return ended.x

    def added(self, x: Floats, fine: Reading, step: float = COARSE) -> Floats:
        """What `fine` steps add to the misses on steps of `step`."""
        grid = self.problem.grid(x, step)
        return self.problem.offset((grid, self.problem.read(x, grid)), (self.problem.grid(x, FINE), fine))

    def finished(self, x: Floats) -> tuple[Floats, Reading]:
        """Unknowns that also hold on fine steps, as far as a few short fits can bring them there.

        First on coarse steps, to whose misses that is added which fine ones have shown on top; where that does not settle, on finer steps.
        """
        best = x, self.read(x)
        for step, iterations in ((COARSE, 5), (COARSE, 5), (COARSE, 5), (MIDDLE, 6)):
            if best[1].worst < ENOUGH or best[1].worst > 8 or self.over():
                break
            x = self.fitted(best[0], step, iterations, self.added(*best, step))
            reading, before = self.read(x), best[1].worst
            if reading.worst < before:
                best = x, reading
            if reading.worst > GAIN * before and (before < 1 or step == MIDDLE or before > NEARLY):
                break
        return best

    def keep(self, x: Floats, reading: Reading) -> None:
        """Remember unknowns if they are the best on fine steps."""
        if self.found is None or reading.worst < self.found.reading.worst:
            self.found = Found(x, reading, self.starts, self.iterations)

    def attempt(self, start: Floats, largest: float = LARGEST) -> bool:
        """Fit from one programme; whether the goals are met now."""
        self.starts += 1
        x = self.fitted(start, COARSE, 15, largest=largest)
        worst = self.read(x, COARSE).worst
        if self.best is None or worst < self.best[0]:
            self.best = worst, x
        if worst < 0.5 or (self.found is None and worst < 1.5):
            self.keep(*self.finished(x))
        self.tell(self.starts, min(self.best[0], np.inf if self.found is None else self.found.reading.worst))
        return self.found is not None and self.found.solved

    def run(self, first: Floats) -> Found:
        """Search from `first`, then from the best of random programmes.

        Parameters
        ----------
        first : (n,) float64

        Returns
        -------
        Found
        """
        if not (self.attempt(first) or self.attempt(first, CAREFUL)):
            for index, start in enumerate(self.programmes()):
                if self.stop() or self.problem.work > self.work or self.attempt(start, LARGEST if index % 2 else CAREFUL):
                    break
        assert self.best is not None
        if self.found is None or not self.found.solved:
            self.keep(*self.finished(self.best[1]))
        assert self.found is not None
        if CLOSE < self.found.reading.worst < NEARLY:
            self.keep(*self.evened(self.found.x, self.found.reading))
        return Found(self.found.x, self.found.reading, self.starts, self.iterations)

    def evened(self, x: Floats, reading: Reading) -> tuple[Floats, Reading]:
        """Unknowns with a smaller largest miss at the expense of others: least squares would rather miss one goal than all a little."""
        for _ in range(TURNS):
            tried = self.fitted(x, COARSE, 8, self.added(x, reading), CAREFUL, EVEN)
            again = self.read(tried)
            if again.worst >= reading.worst or self.stop():
                break
            x, reading = tried, again
        return x, reading

    def programmes(self) -> Iterator[Floats]:
        """Random programmes that lie apart, of each batch the most promising first."""
        samples = self._samples()
        for count, promising, starts in BATCHES:
            near = [x for x in self.ranked(islice(samples, count))[:promising] if not self.stop()]
            yield from sorted(near, key=self.promised)[:starts]

    def promised(self, x: Floats) -> float:
        """Size of the rows after one bounded step from unknowns, if they were linear, none counted beyond `CAPPED`."""
        problem, grid = self.problem, self.problem.grid(x, COARSE)
        reading, box = problem.read(x, grid, True), problem.box
        matrix, low, high = reading.slopes * box.scale, (box.lower - x) / box.scale, (box.upper - x) / box.scale
        damping = DAMPED * max(float(np.sum(matrix * matrix)) / len(x), 1e-12)
        step = bounded_step(matrix, reading.rows, damping, np.maximum(low, -LINEAR), np.minimum(high, LINEAR))
        return float(np.linalg.norm(np.clip(reading.rows + matrix @ step, -CAPPED, CAPPED)))

    def ranked(self, samples: Iterable[Floats]) -> list[Floats]:
        """Those of several programmes that lie apart, the most promising first, as far as there is time to simulate them."""
        rated = []
        for x in samples:
            if self.stop():
                break
            reading = self.read(x, RANKING)
            narrow = np.maximum(reading.guard - reading.openings, 0.0).sum() / GUARD_SCALE
            rated.append((float(np.linalg.norm(np.minimum(reading.shares, CAPPED)) + min(narrow, 5.0)), x))
        box, chosen = self.problem.box, list[Floats]()
        width = np.where(box.upper > box.lower, box.upper - box.lower, 1.0)
        for _, x in sorted(rated, key=lambda item: item[0]):
            if all(np.linalg.norm((x - other) / width) > APART for other in chosen):
                chosen.append(x)
        return chosen

    def _samples(self) -> Iterator[Floats]:
        draw, box = np.random.default_rng(self.draw), self.problem.box
        while True:
            x = self.problem.start.copy()
            for index, (name, low, high) in enumerate(zip(self.problem.names, box.lower, box.upper, strict=True)):
                if high <= low:
                    continue
                if name.endswith(".level"):
                    x[index] = low + (high - low) * draw.random() ** 1.5  # rather weak than strong
                elif low > 0:
                    x[index] = np.exp(draw.uniform(np.log(low), np.log(high)))
                else:
                    x[index] = draw.uniform(low, high)
            yield x
