"""Drives for a task that names none: every channel may take a new level in every phase; what changes nothing is left out again.

A channel is a hand of the oblique muscles, a side to bend to, or the length. A drive takes over from the one before it on its muscles, so
that every order of primitives is a special case of one problem with more unknowns, and nothing is enumerated. Topology shapes the
first guesses only: twist is mostly stored by the hand of its own sign or of the writhe that it will turn into, and bending sets in with
one of the phases and grows. Guesses are simulated and ranked, the best are fitted, and of what meets the goals drives are dropped, those
first that change their muscle least, as long as the goals stay met.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..asking.choice import Choice
from ..asking.primitives import Bend, BendWave, Elongate, Shorten, Twist
from ..asking.task import Drive, Task
from ..contracts import Goal, Primitive
from ..model.reduced import ReducedModel
from .present import Present
from .problem import Problem, Reading
from .search import COARSE, ENOUGH, Search, Stop

Floats = NDArray[np.float64]

GUESSES, STARTS = 100, 10
"""How many guesses are simulated, and how many are fitted at most."""

WORK = 30000.0
"""Steps of the model, with slopes counted by what they cost, after which no new start is made."""

FIT, AGAIN, NEAR = 10, 5, 4.0
"""Iterations from a guess, and of a fit from there; the largest miss on fine steps, in tolerances, from which it is tried."""

SLIGHT = 0.05
"""Change of a muscle's level below which drives are dropped together rather than one by one."""

KEPT = 0.9
"""Largest miss in tolerances with which drives may be dropped."""

REFUSALS = 4
"""How many drives in a row may turn out to be needed before pruning ends."""

PLACES = ("tip", "tip_tangent", "sucker_side", "keep_out", "packet")
"""Goals that may want any side, and any length."""


class Sequence(NamedTuple):
    """Drives that meet a task's goals: the task with them, whose numbers are the guess, and how well they do.

    The misses are in tolerances, the opening is the smallest 1 + tip . base.
    """

    task: Task
    numbers: dict[str, float]
    worst: float
    opening: float


def channels(task: Task, choice: Choice) -> Task:
    """The task with a drive of every channel in every phase.

    Parameters
    ----------
    task : Task
    choice : Choice
        Of a task on its arm, so that its window is in metres.

    Returns
    -------
    Task
    """
    quantities = {goal.quantity for phase in task.phases for goal in phase.goals}
    window, places = choice.window, bool(quantities & set(PLACES))
    across = abs(task.convention.pole[0]) > abs(task.convention.pole[2])
    sides = choice.sides or (("LM1", "LM3", "LM5", "LM7") if places else ("LM3",) if across else ("LM1",))
    made: dict[str, Primitive] = {hand: Twist(hand=hand, level=0.0, rise=0.5, window=window) for hand in ("R-OM", "L-OM")}
    made |= {side: Bend(side=side, level=0.0, window=window) for side in sides}
    if places or "length" in quantities:
        made |= {"shorten": Shorten(level=0.0, window=window), "elongate": Elongate(level=0.0, window=window)}
    if "packet" in quantities:
        made |= {f"wave {side}": BendWave(side=side, level=0.0, window=window) for side in sides}
    drives = [
        Drive(name=f"{name} from {phase.name}", primitive=primitive, begins=phase.name, free=(*_free(primitive), "delay"))
        for phase in task.phases
        for name, primitive in made.items()
    ]
    return replace(task, drives=tuple(drives), choose=None)


def _free(primitive: Primitive) -> tuple[str, ...]:
    """Its level, and how fast that comes."""
    return ("level", "speed") if isinstance(primitive, BendWave) else ("level", "rise")


def guesses(problem: Problem, draw: np.random.Generator, count: int) -> list[Floats]:
    """Unknowns of random programmes for a task of `channels`.

    Parameters
    ----------
    problem : Problem
    draw : numpy.random.Generator
    count : int

    Returns
    -------
    list of (n,) float64
    """
    task, order = problem.task, [phase.name for phase in problem.task.phases]
    twists = {phase.name: np.sign(_target(goal)) for phase in task.phases for goal in phase.goals if goal.quantity == "twist"}
    writhes = [np.sign(_target(goal)) for phase in task.phases for goal in phase.goals if goal.quantity in ("lifted_writhe", "lifted_link")]
    coil, coiled = (writhes[-1] if writhes else 0.0), bool(writhes)
    found = []
    for _ in range(count):
        numbers = {}
        for phase in task.phases:
            low, high = max(phase.shortest, 0.5 * phase.duration), min(phase.longest, 2 * phase.duration)
            numbers[f"{phase.name}.duration"] = np.exp(draw.uniform(np.log(low), np.log(high)))
        bends = {drive.primitive.side for drive in task.drives if isinstance(drive.primitive, Bend)}
        first = {side: int(draw.integers(len(order) + (not coiled))) for side in sorted(bends)}
        bent = dict.fromkeys(bends, 0.0)
        for drive in task.drives:
            primitive, late = drive.primitive, 0.0
            if isinstance(primitive, Twist):
                hand, wanted = (-1 if primitive.hand == "R-OM" else 1), draw.choice([-1, 0, 1])
                if coil and draw.random() < 0.7:
                    wanted = coil
                if drive.begins in twists and draw.random() < 0.6:
                    wanted = twists[drive.begins]
                level = 0.02 + 0.5 * draw.random() ** 1.5 if hand == wanted else 0.01
            elif isinstance(primitive, Bend):
                begun = order.index(drive.begins) >= first[primitive.side]
                if begun:
                    bent[primitive.side] = max(bent[primitive.side], 0.03 + 0.5 * draw.random() ** 1.5)
                level = bent[primitive.side] if begun else 0.0
            else:
                level = 0.3 * draw.random() ** 2
            if draw.random() < 0.5:
                late = 0.8 * draw.random() * numbers[f"{drive.begins}.duration"]
            numbers[f"{drive.name}.level"], numbers[f"{drive.name}.delay"] = level, late
            if "rise" in drive.free:
                numbers[f"{drive.name}.rise"] = np.exp(draw.uniform(np.log(0.15), np.log(2.5)))
            else:
                numbers[f"{drive.name}.speed"] = np.exp(draw.uniform(np.log(0.03), np.log(0.4)))
        found.append(problem.vector(numbers))
    return found


def _target(goal: Goal) -> float:
    """The value that a goal aims at, or the middle of its band."""
    for name in ("value", "at_least", "at_most"):
        value = getattr(goal, name, None)
        if isinstance(value, float | int):
            return float(value)
    band = getattr(goal, "between", None)
    return float(np.mean(band)) if band is not None else 0.0


def choose(
    task: Task,
    choice: Choice,
    model: ReducedModel,
    stop: Stop,
    *,
    present: Present | None = None,
    work: float = WORK,
    several: int = 1,
    count: int = GUESSES,
    tell: Callable[[int, float], None] = lambda _start, _miss: None,
) -> tuple[list[Sequence], Search]:
    """Drives that meet the goals of a task.

    Parameters
    ----------
    task : Task
        On the model's arm.
    choice : Choice
    model : ReducedModel
    stop : callable
        Whether time is up.
    present : Present, optional
        Where it begins; at rest if omitted.
    work : float
        Steps of the model after which no new start is made.
    several : int
        How many different sequences are looked for, as long as the work is not used up.
    count : int
        Guesses that are simulated.
    tell : callable
        Told the number of the start and the smallest miss so far.

    Returns
    -------
    list of Sequence
        The cheapest by number of drives first; none if nothing was found.
    Search
        What it has seen; its `found` is the best point with all drives.
    """
    problem = Problem(channels(task, choice), model, present)
    search = Search(problem, stop, tell, work=work)
    made: list[Sequence] = []
    for start in search.ranked(guesses(problem, np.random.default_rng(0), count))[:STARTS]:
        if stop() or problem.work > (work / 2 if made else work) or len(made) >= several:
            break
        search.starts += 1
        x, reading = _held(search, start, FIT, 0.0, 3)
        search.keep(x, reading)
        if reading.worst <= 1:
            sequence = _pruned(search, x, reading)
            names = {drive.name for drive in sequence.task.drives}
            if len(names) <= choice.most and all(names != {drive.name for drive in other.task.drives} for other in made):
                made.append(sequence)
        assert search.found is not None
        tell(search.starts, search.found.reading.worst)
    return sorted(made, key=lambda sequence: len(sequence.task.drives)), search


def _held(search: Search, start: Floats, iterations: int, offset: Floats | float, rounds: int) -> tuple[Floats, Reading]:
    """A fit on coarse steps, followed by at most so many with what fine ones add where that is little."""
    x = search.fitted(start, COARSE, iterations, offset)
    reading = search.read(x)
    for _ in range(rounds):
        if reading.worst <= ENOUGH or reading.worst > NEAR or search.over():
            break
        tried = search.fitted(x, COARSE, AGAIN, search.added(x, reading))
        again = search.read(tried)
        if again.worst >= reading.worst:
            break
        x, reading = tried, again
    return x, reading


def _pruned(search: Search, x: Floats, reading: Reading) -> Sequence:
    """What is left when all drives are dropped that the goals do not need."""
    needed: set[str] = set()
    problem, stop = search.problem, search.stop
    task, names = problem.task, problem.names
    offset = search.added(x, reading)
    size = max(1, sum(change < SLIGHT for change in _changes(task, names, x).values()))
    while len(task.drives) > 1 and len(needed) < REFUSALS and not stop():
        changes = {name: change for name, change in _changes(task, names, x).items() if name not in needed}
        dropped = sorted(changes, key=lambda name: changes[name])[: min(size, len(task.drives) - 1)]
        if not dropped:
            break
        fewer = tuple(drive for drive in task.drives if drive.name not in dropped)
        smaller = Problem(replace(task, drives=fewer), problem.model, problem.present)
        closer = Search(smaller, stop)
        tried, held = _held(closer, smaller.vector(dict(zip(names, x, strict=True))), AGAIN, offset, 0 if len(dropped) > 1 else 1)
        problem.work += smaller.work
        if held.worst <= KEPT:
            task, names, x, reading = smaller.task, smaller.names, tried, held
            offset = closer.added(x, reading)
        elif size == 1:
            needed.add(dropped[0])
        else:
            size //= 2
    return _settled(task, names, x, reading)


def _changes(task: Task, names: list[str], x: Floats) -> dict[str, float]:
    """By how much each drive changes the level of its muscles from what the drive before it left."""
    numbers, before, found = dict(zip(names, x, strict=True)), dict[tuple[str, ...], float](), {}
    for drive in task.drives:
        channel = tuple(group for template in drive.primitive.templates() for group in template.groups)
        level = float(numbers[f"{drive.name}.level"])
        # A wave passes; it leaves nothing for the next to take over.
        found[drive.name] = level if isinstance(drive.primitive, BendWave) else abs(level - before.get(channel, 0.0))
        before[channel] = level
    return found


def _settled(task: Task, names: list[str], x: Floats, reading: Reading) -> Sequence:
    """The task with the numbers that were found as its own."""
    numbers = {name: float(value) for name, value in zip(names, x, strict=True)}
    phases = tuple(replace(phase, duration=numbers[f"{phase.name}.duration"]) for phase in task.phases)
    drives = []
    for drive in task.drives:
        mine = {number: numbers[f"{drive.name}.{number}"] for number in drive.free}
        delay = mine.pop("delay")
        drives.append(replace(drive, primitive=replace(drive.primitive, **mine), delay=delay))  # type: ignore[type-var]
    return Sequence(replace(task, phases=phases, drives=tuple(drives)), numbers, reading.worst, reading.opening)
