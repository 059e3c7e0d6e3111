"""Search by trial: cross-entropy over a box of numbers, for whatever can only be judged by simulating it.

Each round draws a population about a mean, judges it over an executor, and goes on from the best few: the mean becomes theirs, the spread
partly theirs and partly what it was (de Boer et al. 2005, Ann. Oper. Res. 134:19, with smoothed spread). The numbers that are drawn depend
on the seed alone, not on who judges them, or when. Whoever judges is told the price beyond which a trial would not have been
among the best of the round before, and may then leave off. A search goes downhill from where it begins.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter, process_time
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.errors import OctoctrlError, check_count

Floats = NDArray[np.float64]

OF_ELITE, OF_OLD, LEAST = 0.7, 0.15, 0.02
"""The spread becomes so much of the elite's and so much of what it was, and is at least this share of the first."""


GOOD_ENOUGH = "good enough"
"""Why a search ended that needs no bettering."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknowns:
    """What is searched.

    Attributes
    ----------
    names : tuple of str
    mean, spread : (n,) float64
        Where the search begins, and how far from there it looks at first, one standard deviation.
    low, high : (n,) float64
    """

    names: tuple[str, ...]
    mean: Floats
    spread: Floats
    low: Floats
    high: Floats

    def __post_init__(self) -> None:
        for name in ("mean", "spread", "low", "high"):
            found = np.asarray(getattr(self, name), dtype=float)
            if found.shape != (len(self.names),):
                raise OctoctrlError(f"unknowns: {name} has shape {found.shape}; one number for each of the {len(self.names)} is needed")
            object.__setattr__(self, name, found)
        for index, name in enumerate(self.names):
            if not self.low[index] <= self.high[index]:
                raise OctoctrlError(f"unknown '{name}': {self.low[index]:g} to {self.high[index]:g} is no range; the lower comes first")

    def within(self, x: Floats) -> Floats:
        """Numbers clipped to their ranges."""
        return np.clip(x, self.low, self.high)


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """What a trial came to.

    Attributes
    ----------
    price : float
        What is to be lessened.
    simulated : float, s
        Time of the plant that it took.
    runs : int
    met : bool
        Whether all that is asked for is met: it goes before what is not, whatever its price, and ends the search.
    notes : object
        Whatever the judge wants to be told again of what was found.
    """

    price: float
    simulated: float = 0.0
    runs: int = 1
    met: bool = False
    notes: Any = None


@dataclass(frozen=True, slots=True)
class Candidate:
    """Numbers (n,) that were tried, and what they came to."""

    x: Floats
    judgement: Judgement

    @property
    def price(self) -> float:
        """What it costs."""
        return self.judgement.price

    @property
    def rank(self) -> tuple[bool, float]:
        """The less, the better: what meets all goals goes first, then by price."""
        return not self.judgement.met, self.price


@dataclass(slots=True, kw_only=True)
class Searched:
    """What a search tried and found.

    Attributes
    ----------
    unknowns : Unknowns
    seed : int
    candidates : list of Candidate
        All that were tried, the best first.
    rounds : list of (float, float)
        Price of the best so far, and mean price of the elite, after each round.
    runs : int
    simulated : float, s
        Time of the plant.
    processor : float, s
        Processor time of this process.
    wall : float, s
    ended : str
        Why it ended, as a part of a sentence.
    mean, spread : (n,) float64
        About which the next round would draw, and how far.
    worth : float
        Price of the worst of the last elite.
    """

    unknowns: Unknowns
    seed: int
    candidates: list[Candidate] = field(default_factory=list)
    rounds: list[tuple[float, float]] = field(default_factory=list)
    runs: int = 0
    simulated: float = 0.0
    processor: float = 0.0
    wall: float = 0.0
    ended: str = "all rounds were done"
    mean: Floats = field(default_factory=lambda: np.zeros(0))
    spread: Floats = field(default_factory=lambda: np.zeros(0))
    worth: float = np.inf

    @property
    def best(self) -> Candidate:
        """The cheapest."""
        if not self.candidates:
            raise OctoctrlError(f"the search was over before anything was judged ({self.ended}); give it more time")
        return self.candidates[0]

    def apart(self, count: int, distance: float) -> list[Candidate]:
        """The best candidates that lie apart.

        Parameters
        ----------
        count : int
            How many at most.
        distance : float
            In first spreads, root of the sum of squares.
        """
        chosen: list[Candidate] = []
        for candidate in self.candidates:
            if len(chosen) == count:
                break
            scale = np.where(self.unknowns.spread > 0, self.unknowns.spread, 1.0)
            if all(np.linalg.norm((candidate.x - other.x) / scale) > distance for other in chosen):
                chosen.append(candidate)
        return chosen

    def __str__(self) -> str:
        found = f"best price {self.best.price:.3f}" if self.candidates else "nothing judged"
        among = f" in {len(self.rounds)} rounds" if self.rounds else ""
        return (
            f"seed {self.seed}: {len(self.candidates)} candidates{among}, {self.runs} runs of {self.simulated:.0f} s "
            f"in all, {self.processor:.1f} s of processor; {found}; {self.ended}"
        )


class Tell(Protocol):
    """Whoever shows how far it is."""

    def advance(self, done: float, note: str = "") -> None:
        """So many candidates are done."""
        ...


def search(
    judge: Callable[[Floats, float], Judgement],
    unknowns: Unknowns,
    executor: Executor,
    *,
    seed: int = 0,
    population: int = 18,
    rounds: int = 5,
    elite: int = 5,
    enough: float = -np.inf,
    first: Sequence[Floats] = (),
    after: Searched | None = None,
    stop: Callable[[], bool] = lambda: False,
    progress: Tell | None = None,
) -> Searched:
    """Look for numbers of a low price.

    Parameters
    ----------
    judge : callable
        From numbers (n,) and a price to a `Judgement`, which need not be exact where it is above that price; it must be fit for the
        executor, such as to be sent to another process.
    unknowns : Unknowns
    executor : Executor
        Of `concurrent.futures` or anything like it; what is found does not depend on it.
    seed : int
    population, rounds, elite : int
    enough : float
        Price at which it ends after the present round.
    first : sequence of (n,) float64
        Tried in the first round beside the mean.
    after : Searched, optional
        A search of the same unknowns that this one goes on with; what it found is kept, and it is added to.
    stop : callable
        Whether time is up.
    progress : Tell, optional

    Returns
    -------
    Searched
        Also when it is interrupted, by the user or by the time: with what was judged until then.

    Raises
    ------
    OctoctrlError
        If a count is out of range.
    """
    check_count("population", population, at_least=2)
    check_count("rounds", rounds, at_least=1)
    check_count("elite", elite, at_least=1)
    draw = np.random.default_rng(seed)
    found = after or Searched(unknowns=unknowns, seed=seed, mean=unknowns.within(unknowns.mean), spread=unknowns.spread.copy())
    found.ended, seen = "all rounds were done", len(found.rounds)
    with _counted(found):
        for number in range(seen, seen + rounds):
            mean, spread = found.mean, found.spread
            drawn = unknowns.within(mean + spread * draw.normal(size=(population, len(mean))))
            given = [mean, *map(unknowns.within, first)][:population] if number == 0 else []
            tried = [*given, *drawn[len(given) :]]
            if not _judged(judge, found.worth, tried, executor, found, stop, progress):
                break
            # The best of all rounds competes with this round's: what was once good is not forgotten.
            own = {id(x) for x in tried}
            latest = [item for item in found.candidates if id(item.x) in own][: elite - 1]
            chosen = [found.best, *(item for item in latest if item is not found.best)]
            members, found.worth = np.array([item.x for item in chosen]), max(item.price for item in chosen)
            found.rounds.append((found.best.price, float(np.mean([item.price for item in chosen]))))
            found.mean = members.mean(axis=0)
            found.spread = np.maximum(OF_ELITE * members.std(axis=0) + OF_OLD * spread, LEAST * unknowns.spread)
            if found.best.judgement.met or found.best.price <= enough:
                found.ended = GOOD_ENOUGH
                break
    return found


@contextmanager
def _counted(found: Searched) -> Iterator[None]:
    """Count the time of what is `found`; an interrupt by the user ends it with what was judged until then."""
    processor, began = process_time(), perf_counter()
    try:
        yield
    except KeyboardInterrupt:
        found.ended = "interrupted"
    found.processor += process_time() - processor
    found.wall += perf_counter() - began


def _judged(
    judge: Callable[[Floats, float], Judgement],
    worth: float,
    tried: list[Floats],
    executor: Executor,
    found: Searched,
    stop: Callable[[], bool],
    progress: Tell | None,
) -> bool:
    """Judge a round and enter it among what was found, in order; whether there was time for all of it."""
    running: list[Future[Judgement]] = []
    try:
        for x in tried:
            running.append(executor.submit(judge, x, worth))
        for x, future in zip(tried, running, strict=True):
            if stop():
                found.ended = "the time was up"
                return False
            judgement = future.result()
            found.candidates.append(Candidate(x, judgement))
            found.runs += judgement.runs
            found.simulated += judgement.simulated
            if progress is not None:
                lowest = min(item.price for item in found.candidates)
                progress.advance(len(found.candidates), f"price {lowest:.2f}")
    finally:
        for future in running:
            future.cancel()
        found.candidates.sort(key=lambda item: item.rank)
    return True
