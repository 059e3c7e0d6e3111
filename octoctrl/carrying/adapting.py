"""Turns and shortening of a plan, chosen anew on the plant that carries it out: phase by phase, from where the phase before ended.

How many turns a level stores was measured on the bare arm. An arm that has wound round an object stores more of them or less, and the full
arm otherwise than the rod on which was searched; it also shortens otherwise, and turns what it holds as it does. So each phase whose turns
or shortening the search chose is simulated on the plant itself. Where its goals are missed, these numbers are changed one after the
other, each as long as the goals come nearer. Nothing else of the plan changes.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from octoctrl.planners.asking.primitives import Shorten
from octoctrl.planners.asking.task import Drive, Phase
from octoctrl.planners.asking.wrapping import StoreTwist, TwistCurve
from octoctrl.planners.contracts import Primitive
from octoctrl.planners.solving.cross_entropy import Candidate, survey
from octoctrl.planners.solving.scenarios import PLANNED
from octoctrl.sim.contracts import State

from ..progress import Progress
from .checking import Programme
from .trials import Begun, Stage, at_once

CHOSEN: Mapping[type, str] = {StoreTwist: "turns", Shorten: "level"}
"""Which number of a primitive depends on the plant."""

STEP, STEP_FROM_ZERO, STEPS = 0.1, 1 / 6, 3
"""How far a number is changed at once, as a share of what was searched, or where that is 0 of what it may be at most; and how often."""


def adapted(
    programmes: Sequence[Programme], curve: TwistCurve, plant: str, executor: Executor, progress: Progress
) -> tuple[list[Programme], list[str]]:
    """Programmes with the turns and the shortening that suit a `plant`, the one that comes nearest first, and what was tried.

    Parameters
    ----------
    programmes : sequence of Programme
        That differ in their last phases alone. Those after the first whose goals are met stay as they are.
    curve : TwistCurve
        Of the `plant`.
    plant : str
    executor : Executor
        On which trials are simulated.
    progress : Progress

    Raises
    ------
    PlantUnstableError
        If the plant diverges before there is anything to choose.
    """
    first, said = programmes[0], list[str]()
    if not any(map(_chosen, first.task.drives)):
        return list(programmes), []
    *before, last = at_once(first.task)
    state: State | None = None
    numbers, settled = first.numbers, tuple[Primitive, ...]()
    for phases in before:
        stage = _stage(first, phases, numbers, settled, state, plant, curve)
        best = _best(stage, executor, progress, said)
        numbers = numbers | dict(zip(stage.unknowns.names, map(float, best.x), strict=True))
        (ended,) = stage.ended(best.x)
        state, settled = ended.state or None, (*settled, *stage.primitives(best.x))
    early = {f"{drive.name}.{name}" for phases in before for phase in phases for drive in _of(first, phase) for name in drive.free}
    found: list[tuple[Candidate, Programme]] = []
    for programme in programmes:
        own = programme.numbers | {name: number for name, number in numbers.items() if name in early}
        stage = _stage(programme, last, own, settled, state, plant, curve)
        best = _best(stage, executor, progress, said)
        found.append((best, _with(programme, own | dict(zip(stage.unknowns.names, map(float, best.x), strict=True)))))
        if best.judgement.met:
            break
    order = sorted(found, key=lambda item: item[0].rank)
    return [*(programme for _, programme in order), *programmes[len(found) :]], said


def _of(programme: Programme, phase: Phase) -> list[Drive]:
    """Drives that begin with a `phase`."""
    return [drive for drive in programme.task.drives if drive.begins == phase.name]


def _stage(
    programme: Programme,
    phases: tuple[Phase, ...],
    numbers: Mapping[str, float],
    settled: tuple[Primitive, ...],
    state: State | None,
    plant: str,
    curve: TwistCurve,
) -> Stage:
    """Phases of a `programme` on the plant, after what is `settled`, as planned; free is what depends on the plant."""
    drives = tuple(_settled(drive, numbers) for phase in phases for drive in _of(programme, phase))
    return replace(
        programme.searched, phases=phases, drives=drives, begun=Begun(settled, (state,)), scenarios=(PLANNED,), plant=plant,
        curve=curve, neighbours=(),
    )  # fmt: skip


def _best(stage: Stage, executor: Executor, progress: Progress, said: list[str]) -> Candidate:
    """The numbers of a stage that its plant wants: those that were searched if they meet the goals; what was tried is `said`."""
    unknowns, tries = stage.unknowns, 1

    def tried(index: int, *values: float) -> Candidate:
        numbers = [unknowns.within(np.where(np.arange(len(best.x)) == index, value, best.x)) for value in values]
        return min(survey(stage, unknowns, numbers, executor).candidates, key=lambda item: item.rank, default=best)

    progress.start(f"phase '{stage.name}' on the plant '{stage.plant}'", None)
    try:
        best = Candidate(unknowns.mean, executor.submit(stage, unknowns.mean).result())
        for index, start in enumerate(unknowns.mean):
            if best.judgement.met:
                break
            step = STEP * abs(start) or STEP_FROM_ZERO * unknowns.high[index]
            latest, tries = tried(index, start + step, start - step), tries + 2
            for _ in range(STEPS):
                if not latest.rank < best.rank:
                    break
                ahead = 2 * latest.x[index] - best.x[index]
                best = latest
                latest, tries = tried(index, ahead), tries + 1
    finally:
        progress.stop()
    if unknowns.names:
        told = ", ".join(f"{name} {np.round(value, 3):g}" for name, value in zip(unknowns.names, best.x, strict=True))
        said.append(f"phase '{stage.name}' on the plant '{stage.plant}', {tries} trial{'s' if tries > 1 else ''}: {told}")
    return best


def _chosen(drive: Drive) -> bool:
    """Whether a search chose a number of a `drive` that depends on the plant."""
    return CHOSEN.get(type(drive.primitive)) in drive.free


def _settled(drive: Drive, numbers: Mapping[str, float]) -> Drive:
    """A `drive` with the `numbers` of a plan, of which that alone is free which depends on the plant."""
    given = {name: numbers[f"{drive.name}.{name}"] for name in drive.free}
    delay = given.pop("delay", drive.delay)
    primitive: Primitive = replace(drive.primitive, **given)  # type: ignore[type-var]
    return replace(drive, primitive=primitive, delay=delay, free=(CHOSEN[type(primitive)],) if _chosen(drive) else ())


def _with(programme: Programme, numbers: dict[str, float]) -> Programme:
    """A `programme` with other `numbers` of what depends on the plant."""

    def other(drive: Drive, item: Primitive) -> Primitive:
        name = CHOSEN[type(item)]
        return replace(item, **{name: numbers[f"{drive.name}.{name}"]})  # type: ignore[type-var]

    pairs = zip(programme.task.drives, programme.primitives, strict=True)
    return replace(programme, numbers=numbers, primitives=tuple(other(*pair) if _chosen(pair[0]) else pair[1] for pair in pairs))
