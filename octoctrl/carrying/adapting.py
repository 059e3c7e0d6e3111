"""Turns that a plan stores, chosen anew on the plant that carries it out: phase by phase, from where the phase before ended.

How many turns a level stores was measured on the bare arm. An arm that has wound round an object stores more of them or less, and the full
arm otherwise than the rod on which was searched. So each phase whose turns the search chose is simulated on the plant itself with some
turns more and some less; those that bring its goals nearest stay. Nothing else of the plan changes.
"""

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from octoctrl.planners.asking.task import Drive
from octoctrl.planners.asking.wrapping import StoreTwist, TwistCurve
from octoctrl.planners.contracts import Primitive
from octoctrl.planners.solving.cross_entropy import Candidate, survey
from octoctrl.planners.solving.scenarios import PLANNED
from octoctrl.sim.contracts import State

from ..progress import Progress
from .checking import Programme
from .trials import Stage, at_once

SHARES = (1.0, 0.9, 1.1, 0.8, 1.2, 0.7)
"""Of the turns that were searched: what is tried, the first where it is good enough alone."""


def adapted(programme: Programme, curve: TwistCurve, plant: str, executor: Executor, progress: Progress) -> tuple[Programme, list[str]]:
    """A `programme` with the turns that suit a `plant`, and what was tried.

    Parameters
    ----------
    programme : Programme
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
    task, numbers, said = programme.task, dict(programme.numbers), []
    if not any(_chosen(drive) for drive in task.drives):
        return programme, []
    drives = tuple(_settled(drive, numbers) for drive in task.drives)
    whole = replace(task, drives=drives)
    state: State | None = None
    stage = replace(programme.searched, task=whole, scenarios=(PLANNED,), states=(state,), settled=(), plant=plant, curve=curve)
    for phases in at_once(task):
        own = tuple(drive for phase in phases for drive in drives if drive.begins == phase.name)
        stage = replace(stage, phases=phases, drives=own, states=(state,))
        x = stage.unknowns.mean
        if stage.unknowns.names:
            best, tried = _best(stage, executor, progress)
            x, found = best.x, dict(zip(stage.unknowns.names, map(float, best.x), strict=True))
            numbers |= found
            counted = f"{tried} trial{'s' if tried > 1 else ''}"
            said.append(f"phase '{stage.name}' on the plant '{plant}', {counted}: {', '.join(map(_told, found.items()))}")
        (ended,) = stage.ended(x)
        state, stage = ended.state or None, replace(stage, settled=(*stage.settled, *stage.primitives(x)))
    primitives = tuple(
        replace(item, turns=numbers[f"{drive.name}.turns"]) if _chosen(drive) else item  # type: ignore[type-var]
        for drive, item in zip(task.drives, programme.primitives, strict=True)
    )
    return replace(programme, numbers=numbers, primitives=primitives), said


def _best(stage: Stage, executor: Executor, progress: Progress) -> tuple[Candidate, int]:
    """The best of a stage's turns, and how many were tried."""
    unknowns = stage.unknowns
    first = Candidate(unknowns.mean, executor.submit(stage, unknowns.mean).result())
    if first.price <= stage.enough:
        return first, 1
    tried = [unknowns.within(share * unknowns.mean) for share in SHARES[1:]]
    progress.start(f"choosing turns for phase '{stage.name}' on the plant '{stage.plant}'", float(len(tried)))
    try:
        found = survey(stage, unknowns, tried, executor, progress=progress)
    finally:
        progress.stop()
    candidates = [first, *found.candidates]
    return min(candidates, key=lambda item: (not item.judgement.met, item.price)), len(candidates)


def _chosen(drive: Drive) -> bool:
    """Whether a search chose the turns of a `drive`."""
    return isinstance(drive.primitive, StoreTwist) and "turns" in drive.free


def _settled(drive: Drive, numbers: Mapping[str, float]) -> Drive:
    """A `drive` with the `numbers` of a plan, of which its turns alone are free."""
    given = {name: numbers[f"{drive.name}.{name}"] for name in drive.free}
    delay = given.pop("delay", drive.delay)
    primitive: Primitive = replace(drive.primitive, **given)  # type: ignore[type-var]
    return replace(drive, primitive=primitive, delay=delay, free=("turns",) if _chosen(drive) else ())


def _told(item: tuple[str, float]) -> str:
    name, value = item
    return f"{name} {np.round(value, 3):g}"
