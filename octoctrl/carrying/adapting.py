"""Turns and shortening of a plan, chosen anew on the plant that carries it out: phase by phase, from where the phase before ended.

How many turns a level stores was measured on the bare arm. An arm that has wound round an object stores more of them or less, and the full
arm otherwise than the rod on which was searched; it also shortens otherwise, and turns what it holds as it does. So each phase is simulated
on the plant itself, and where its goals are missed, numbers of it that the search chose are changed one after the other: by a step, and
then to where a straight line through what was seen meets the goal. Nothing else of the plan changes. What the best of these trials recorded
is, piece by piece, the run from rest: nobody need carry it out again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from octoctrl.planners.asking.task import Drive, Phase
from octoctrl.planners.asking.wrapping import TwistCurve
from octoctrl.planners.contracts import Floats, Primitive
from octoctrl.planners.solving.scenarios import PLANNED
from octoctrl.sim.running.recording import Recording

from ..progress import Progress
from .checking import KEPT, Programme
from .trials import Begun, Ended, Stage, at_once, from_rest

STEP, STEP_FROM_ZERO, FARTHEST_STEP, LINES = 0.1, 1 / 6, 2, 3
"""How far a number is changed at first, as a share of what was searched, or where that is 0 of what it may be at most; how many such steps
away from the best of two a line through them is believed at most, for muscles saturate, and how many lines are drawn."""

IDLE = 0.02
"""Share of a miss that a step must change, or the number has nothing to do with it."""


@dataclass(frozen=True, slots=True)
class _Trial:
    """Numbers (n,) of one phase, and what they came to."""

    x: Floats
    ended: Ended

    @property
    def worst(self) -> float:
        """The goal that is missed most, in tolerances."""
        return max(self.ended.misses, default=0.0)

    @property
    def met(self) -> bool:
        """Whether all goals are."""
        return self.worst <= 1


@dataclass(frozen=True, slots=True)
class _Line:
    """A programme as far as it has come on the plant."""

    numbers: Mapping[str, float]
    begun: Begun
    trials: tuple[_Trial, ...] = ()

    @property
    def worst(self) -> float:
        """The goal that is missed most, in tolerances."""
        return max((trial.worst for trial in self.trials), default=0.0)

    @property
    def ended(self) -> Ended | None:
        """All phases as one run; None if the plant diverged."""
        pieces = [trial.ended for trial in self.trials]
        if not np.isfinite(self.worst):
            return None
        misses = tuple(miss for piece in pieces for miss in piece.misses)
        return Ended(Recording.joined([piece.recording for piece in pieces]), misses, pieces[-1].state)


def adapted(programmes: Sequence[Programme], curve: TwistCurve, plant: str, progress: Progress) -> tuple[list[Programme], list[str]]:
    """Programmes with the turns and the shortening that suit a `plant`, the one that comes nearest first, and what was tried.

    Parameters
    ----------
    programmes : sequence of Programme
        That differ in their last phases alone. Those after the first whose goals are met stay as they are.
    curve : TwistCurve
        Of the `plant`.
    plant : str
    progress : Progress
    """
    first, said = programmes[0], list[str]()
    if not any(map(_chosen, first.task.drives)):
        return list(programmes), []
    *before, last = at_once(first.task)
    shared = _Line(first.numbers, from_rest(1))
    for phases in before:
        shared = _through(first, phases, shared, curve, plant, progress, said)
    early = {f"{drive.name}.{name}" for phases in before for phase in phases for drive in _of(first, phase) for name in drive.free}
    found: list[tuple[float, Programme]] = []
    for programme in programmes:
        own = programme.numbers | {name: number for name, number in shared.numbers.items() if name in early}
        line = _through(programme, last, replace(shared, numbers=own), curve, plant, progress, said)
        found.append((line.worst, replace(_with(programme, line.numbers), carried=line.ended)))
        if line.worst <= 1:
            break
    order = sorted(found, key=lambda item: item[0])
    return [*(programme for _, programme in order), *programmes[len(found) :]], said


def _of(programme: Programme, phase: Phase) -> list[Drive]:
    """Drives that begin with a `phase`."""
    return [drive for drive in programme.task.drives if drive.begins == phase.name]


def _through(
    programme: Programme, phases: Sequence[Phase], line: _Line, curve: TwistCurve, plant: str, progress: Progress, said: list[str]
) -> _Line:
    """A `line` of a `programme` that goes on through some `phases`; what was tried is `said`."""
    for phase in phases:
        drives = tuple(_settled(drive, line.numbers) for drive in _of(programme, phase))
        stage = replace(
            programme.searched, phases=(phase,), drives=drives, begun=line.begun, scenarios=(PLANNED,), plant=plant, curve=curve,
            neighbours=(), record_every=KEPT,
        )  # fmt: skip
        best = _best(stage, progress, said)
        numbers = dict(line.numbers) | dict(zip(stage.unknowns.names, map(float, best.x), strict=True))
        begun = Begun((*line.begun.settled, *stage.primitives(best.x)), (best.ended.state or None,))
        line = _Line(numbers, begun, (*line.trials, best))
    return line


def _best(stage: Stage, progress: Progress, said: list[str]) -> _Trial:
    """The numbers of a phase that its plant wants: those that were searched if they meet the goals; what was tried is `said`."""
    unknowns, trials = stage.unknowns, list[_Trial]()

    def tried(x: Floats) -> _Trial:
        trials.append(_Trial(x, stage.ended_in(0, x)))
        return trials[-1]

    progress.start(f"phase '{stage.name}' on the plant '{stage.plant}'", None)
    try:
        best = tried(unknowns.mean)
        for index, start in enumerate(unknowns.mean):
            if best.met or not np.isfinite(best.worst):
                break
            step = np.zeros(len(unknowns.mean))
            step[index] = STEP * abs(start) or STEP_FROM_ZERO * unknowns.high[index]
            best, other = _sorted(best, tried(unknowns.within(best.x + step)))
            crossed = False
            for _ in range(LINES):
                ahead = _ahead(best, other, index, float(step[index]), crossed)
                if best.met or ahead is None:
                    break
                x = best.x.copy()
                x[index] = ahead
                latest = tried(unknowns.within(x))
                crossed = latest.worst > best.worst  # it went too far, and the goal lies between them
                best, other = _sorted(best, latest)
    finally:
        progress.stop()
    if unknowns.names:
        told = ", ".join(f"{name} {np.round(value, 3):g}" for name, value in zip(unknowns.names, best.x, strict=True))
        said.append(f"phase '{stage.name}' on the plant '{stage.plant}', {len(trials)} trial{'s' if len(trials) > 1 else ''}: {told}")
    return best


def _sorted(one: _Trial, other: _Trial) -> tuple[_Trial, _Trial]:
    """The better of two trials, and the other."""
    return (other, one) if other.worst < one.worst else (one, other)


def _ahead(near: _Trial, far: _Trial, index: int, step: float, crossed: bool) -> float | None:
    """Where number `index` meets the goal that the better of two trials misses most, by a straight line; None if it does nothing to that.

    What is missed has no sign: both are taken to lie on one side of the goal, unless the line is known to have `crossed` it.
    """
    goal = int(np.argmax(near.ended.misses))
    missed, beside, way = near.ended.misses[goal], far.ended.misses[goal], float(far.x[index] - near.x[index])
    if way == 0 or not np.isfinite(beside) or abs(beside - missed) < IDLE * missed:
        return None
    found = way * missed / (missed + beside if crossed else missed - beside)
    return float(near.x[index] + np.clip(found, -FARTHEST_STEP * step, FARTHEST_STEP * step))


def _by_plant(primitive: Primitive) -> str:
    """Which number of a `primitive` depends on the plant, if one does."""
    name: str = getattr(primitive, "chosen_anew", "")
    return name


def _chosen(drive: Drive) -> bool:
    """Whether a search chose a number of a `drive` that depends on the plant."""
    return _by_plant(drive.primitive) in drive.free


def _settled(drive: Drive, numbers: Mapping[str, float]) -> Drive:
    """A `drive` with the `numbers` of a plan, of which that alone is free which depends on the plant."""
    given = {name: numbers[f"{drive.name}.{name}"] for name in drive.free}
    delay = given.pop("delay", drive.delay)
    primitive: Primitive = replace(drive.primitive, **given)  # type: ignore[type-var]
    return replace(drive, primitive=primitive, delay=delay, free=(_by_plant(primitive),) if _chosen(drive) else ())


def _with(programme: Programme, numbers: Mapping[str, float]) -> Programme:
    """A `programme` with other `numbers` of what depends on the plant."""

    def other(drive: Drive, item: Primitive) -> Primitive:
        name = _by_plant(item)
        return replace(item, **{name: numbers[f"{drive.name}.{name}"]})  # type: ignore[type-var]

    pairs = zip(programme.task.drives, programme.primitives, strict=True)
    primitives = tuple(other(*pair) if _chosen(pair[0]) else pair[1] for pair in pairs)
    return replace(programme, numbers=dict(numbers), primitives=primitives)
