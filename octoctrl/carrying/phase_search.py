"""The search of one phase by simulation: surveys where there is a region to look round, rounds from several starts, and more from the best.

Where trials may be quick, the first rounds are rough ones, at less than half the time; what they promise is judged anew by usual trials.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from octoctrl.planners.contracts import Floats
from octoctrl.planners.solving.cross_entropy import GOOD_ENOUGH, Candidate, Searched, Unknowns, search
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.scene.scene import Scene

from ..progress import Progress
from .trials import Stage

POPULATION, ROUNDS, STARTS, FIRST_ROUNDS = 14, 12, 2, 4
"""Trials of a round, rounds of a phase at most; how often it begins anew, and after how many rounds of each of these the best goes on
alone. A search that has lost its way does not find it again; another one may."""

SURVEYS, SURVEYED, SURVEY_ROUNDS, KEPT, NEAR_ENOUGH, PROMISING = 2, 40, 3, 8, 0.6, 0.75
"""Surveys of a phase at most; how many programmes a round of one tries, rounds, how many of the best it goes on from, price at which it
ends, and price up to which it promises that other scenarios can be met: else another survey takes the place of one start."""

FAR, NARROW = 1.0, 0.5
"""How far apart the searches that follow a survey begin, in its spreads, and how far they look at first, over the usual."""

SETTLING, ALONE, FAIR = 1, 8, 0.65
"""Where nothing that rough trials found is good enough: rounds of others if something costs no more than what is fair as planned, and if
nothing does rounds of rough trials as planned alone: such grasps were held on the full arm, though other scenarios lose them."""

CANDIDATES, APART = 3, 0.6
"""Candidates that are checked on the plant, and how far apart they lie, in first spreads."""


@dataclass(slots=True)
class Work:
    """What a search by simulation needs besides the task.

    Attributes
    ----------
    arm : Arm
    scene : Scene
    executor : Executor
    progress : Progress
    limit : float, s
        Wall clock.
    seed : int
    population, rounds : int
        Trials of a round, and rounds of a phase at most.
    spread : float
        How far it looks at first, over the usual.
    errors : dict of str to float
        Of the scenarios, see `octoctrl.planners.solving.scenarios.four`.
    """

    arm: Arm
    scene: Scene
    executor: Executor
    progress: Progress
    limit: float
    seed: int
    population: int = POPULATION
    rounds: int = ROUNDS
    spread: float = 1.0
    errors: Mapping[str, float] = field(default_factory=dict)
    begin: float = field(default_factory=perf_counter)

    def over(self) -> bool:
        """Whether the time is up."""
        return perf_counter() - self.begin > self.limit


def search_phase(stage: Stage, work: Work, index: int, region: Mapping[str, tuple[float, float]]) -> tuple[list[Candidate], list[str], int]:
    """Search a phase. Where trials may be quick, the first rounds are rough ones, and what they find is settled by others.

    Parameters
    ----------
    stage : Stage
        Phase, drives and scenarios.
    work : Work
    index : int
        Number of the phase, by which its draws differ from those of others.
    region : mapping of str to (float, float)
        Ranges of the unknowns in which to look round before, the stage's own numbers among them; empty where there is none.

    Returns
    -------
    best : list of Candidate
        That lie apart, the best first.
    said : list of str
        What was tried.
    count : int
        Trials.
    """
    name, own, seed, tried = stage.name, stage.unknowns.mean, 1000 * index, replace(stage, rough=stage.quick)
    if not stage.unknowns.names:
        return [Candidate(own, stage(own))], [], 1
    judged = work.executor.submit(stage, own).result()
    if judged.met or judged.price <= stage.enough:
        return [Candidate(own, judged)], [f"phase '{name}': the task's own numbers, price {judged.price:.3f}, were good enough"], 1
    alone: list[Searched] = []
    seen, found, settled = _begun(tried, work, seed, region)
    best = _apart([*found, *seen]) or [Candidate(own, judged)]
    if best[0].price > stage.hopeless:  # nothing came near, and more of the same will not
        best = best[:1]
    elif tried.rough:
        _settle(stage, work, seed + STARTS, found, settled)
        alone = _alone(stage, work, seed + STARTS, (*seen, *found), settled)
        only = _apart(alone[-1:])[: 1 if settled else CANDIDATES]
        best = [*_apart(settled)[: CANDIDATES - len(only)], *only] or best
    elif found:
        _gone_on(stage, work, seed + STARTS, found)
        best = _apart(found)
    said = [f"phase '{name}', survey with {item}" for item in seen] + [f"phase '{name}', {item}" for item in (*found, *settled)]
    said += [f"phase '{name}', as planned alone, {item}" for item in alone]
    count = 1 + sum(len(item.candidates) for item in (*seen, *found, *settled, *alone))
    return best, said or [f"phase '{name}' was not searched"], count


def _begun(
    stage: Stage, work: Work, seed: int, region: Mapping[str, tuple[float, float]]
) -> tuple[list[Searched], list[Searched], list[Searched]]:
    """Surveys, some rounds from each start, and what of them was judged anew, until something is good enough.

    It starts from the task's own numbers or, where there is a `region` to look round, from the best two of a survey; where that promises
    little, from the best of two.
    """
    seen, found, settled, unknowns = list[Searched](), list[Searched](), list[Searched](), stage.unknowns
    starts = [unknowns] * STARTS
    while region and len(seen) < SURVEYS and not work.over() and not _promising(seen):
        seen.append(_surveyed(stage, work, region, seed + STARTS + 1 + len(seen)))
        best = sorted((item for result in seen for item in result.apart(STARTS, FAR)), key=lambda item: item.rank)
        starts = [replace(unknowns, mean=item.x, spread=NARROW * unknowns.spread) for item in best[: 1 + STARTS - len(seen)]]
    for number, start in enumerate(starts):
        if work.over() or _good(settled if stage.rough else found):
            break
        found.append(_rounds(stage, work, start, min(FIRST_ROUNDS, work.rounds), seed + number))
        if stage.rough and _good(found[-1:]):
            settled.append(_judged_anew(replace(stage, rough=False), work, seed + STARTS, found[-1:]))
    return seen, [result for result in found if result.candidates], [result for result in settled if result.candidates]


def _promising(seen: Sequence[Searched]) -> bool:
    """Whether something meets the goals nearly, as planned."""
    return any(result.candidates and result.best.price <= PROMISING for result in seen)


def _gone_on(stage: Stage, work: Work, seed: int, found: Sequence[Searched]) -> None:
    """The rounds that are left, after that of what was `found` which found the best, unless that is good enough."""
    left, best = work.rounds - STARTS * FIRST_ROUNDS, _best(found)
    if left > 0 and best.ended != GOOD_ENOUGH and not work.over():
        _rounds(stage, work, stage.unknowns, left, seed, after=best)


def _judged_anew(stage: Stage, work: Work, seed: int, found: Sequence[Searched]) -> Searched:
    """The best of what rough trials `found`, judged by others."""
    first, spread = [item.x for item in _apart(found)], _best(found).spread
    again = Searched(unknowns=stage.unknowns, seed=work.seed + seed, mean=first[0], spread=spread)
    _rounds(stage, work, stage.unknowns, 1, seed, after=again, first=first)
    if again.candidates:
        again.mean, again.spread = again.best.x, spread
    return again


def _settle(stage: Stage, work: Work, seed: int, found: Sequence[Searched], settled: list[Searched]) -> None:
    """Judge anew what was `found` and not good enough for that, and go on from the best that is `settled`, if it holds as planned alone."""
    left = [result for result in found if not _good([result])]
    if left and not _good(settled) and not work.over():
        settled.append(_judged_anew(stage, work, seed, left))
    if _fair(settled) and not _good(settled) and not work.over():
        _rounds(stage, work, stage.unknowns, min(SETTLING, work.rounds), seed, after=_best(settled))


def _alone(stage: Stage, work: Work, seed: int, found: Sequence[Searched], settled: Sequence[Searched]) -> list[Searched]:
    """Where nothing `settled` is fair as planned: rounds for that scenario alone, from what was `found` for it, and a last one."""
    if _good(settled) or _fair(settled) or work.over():
        return []
    best = min((item for result in found for item in result.candidates), key=_as_planned)
    start = replace(stage.unknowns, mean=best.x, spread=NARROW * stage.unknowns.spread)
    rough = _rounds(replace(stage.as_planned(), rough=True), work, start, min(ALONE, work.rounds), seed + 1)
    return [rough, _judged_anew(stage.as_planned(), work, seed + 2, [rough])] if rough.candidates else []


def _as_planned(item: Candidate) -> float:
    """Price of a candidate in the first scenario."""
    return float(item.judgement.notes[0])


def _fair(settled: Sequence[Searched]) -> bool:
    """Whether something is fair as planned, whatever other scenarios make of it."""
    return any(_as_planned(item) <= FAIR for result in settled for item in result.candidates)


def _good(found: Sequence[Searched]) -> bool:
    """Whether something is good enough."""
    return any(result.ended == GOOD_ENOUGH for result in found)


def _best(found: Sequence[Searched]) -> Searched:
    """The search that came nearest."""
    return min(found, key=lambda result: result.best.rank)


def _apart(found: Sequence[Searched]) -> list[Candidate]:
    """The best candidates of all searches that lie apart in theirs."""
    return sorted((item for result in found for item in result.apart(CANDIDATES, APART)), key=lambda item: item.rank)[:CANDIDATES]


def _surveyed(stage: Stage, work: Work, region: Mapping[str, tuple[float, float]], seed: int) -> Searched:
    """What is found in a region, as planned alone: own numbers and programmes drawn evenly from it, then others near the best of them."""
    low, high = np.array([region[name] for name in stage.unknowns.names]).T
    first = np.random.default_rng(work.seed + seed).uniform(low, high, size=(SURVEYED - 1, len(low)))
    unknowns = replace(stage.unknowns, spread=(high - low) / 3)
    work.progress.start(f"looking round for phase '{stage.name}'", float(SURVEYED * SURVEY_ROUNDS))
    try:
        found = search(
            stage.as_planned(), unknowns, work.executor, seed=work.seed + seed, population=SURVEYED, rounds=SURVEY_ROUNDS, elite=KEPT,
            enough=NEAR_ENOUGH, first=list(first), stop=work.over, progress=work.progress,
        )  # fmt: skip
    finally:
        work.progress.stop()
    return _heeded(found, work)


def _rounds(
    stage: Stage, work: Work, start: Unknowns, rounds: int, seed: int, *, after: Searched | None = None, first: Sequence[Floats] = ()
) -> Searched:
    """Some rounds of a stage, from a `start` or `after` others; all that the only round tries may be given, the mean first."""
    population = max(len(first), 2) if first else work.population
    work.progress.start(f"searching phase '{stage.name}'", float(population * rounds + (len(after.candidates) if after else 0)))
    try:
        result = search(
            stage, start, work.executor, seed=work.seed + seed, population=population, rounds=rounds, enough=stage.enough,
            first=first[1:], after=after, stop=work.over, progress=work.progress,
        )  # fmt: skip
    finally:
        work.progress.stop()
    return _heeded(result, work)


def _heeded(found: Searched, work: Work) -> Searched:
    """What was found; if it was interrupted, nothing more is searched."""
    if found.ended == "interrupted":
        work.limit = 0.0
    return found
