"""Tasks that nobody has seen: random goals of every kind, from one seed.

Old kinds ask for twist and writhe wherever they come to lie, so that some are beyond the arm. New kinds are read off a random programme of
the reduced model, so that they can be met, or placed where nothing can reach.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from octoctrl.planners.asking.primitives import Bend, BendWave, Shorten, Twist
from octoctrl.planners.asking.registry import goal
from octoctrl.planners.asking.task import Drive, Phase, Task
from octoctrl.planners.contracts import Floats
from octoctrl.planners.model.reduced import ReducedModel
from octoctrl.planners.solving.problem import Problem

from .. import tasks

Kind = Callable[[np.random.Generator, ReducedModel], Task]


def twist_only(draw: np.random.Generator, model: ReducedModel) -> Task:
    """Two phases, each with a twist of its own; both hands may act in each; `draw` decides, whatever the `model`."""
    phases = tuple(
        Phase(
            name=name, duration=float(draw.uniform(0.8, 2.0)), goals=(goal("twist", value=float(draw.uniform(-1.5, 1.5)), tolerance=0.1),)
        )
        for name in ("first", "second")
    )
    drives = tuple(
        Drive(name=f"{hand} {phase.name}", primitive=Twist(hand=hand, level=0.1), begins=phase.name, free=("level", "rise"))
        for phase in phases
        for hand in ("R-OM", "L-OM")
    )
    return Task(name="twist", phases=phases, drives=drives)


def writhe_and_twist(draw: np.random.Generator, model: ReducedModel) -> Task:
    """One hand first, one bend, the other hand last, in one or two phases; `draw` decides, whatever the `model`."""
    count, sign = int(draw.integers(1, 3)), float(draw.choice([-1, 1]))
    names = ("wind", "turn")[:count]
    last = (
        goal("lifted_writhe", value=sign * float(draw.uniform(0.3, 2.5)), tolerance=0.15),
        goal("twist", value=float(draw.uniform(-1.0, 1.0)), tolerance=0.1),
    )
    early = (goal("twist", value=sign * float(draw.uniform(0.2, 1.3)), tolerance=0.1),)
    phases = tuple(Phase(name=name, duration=1.8, goals=last if name == names[-1] else early) for name in names)
    first, second = ("L-OM", "R-OM") if sign > 0 else ("R-OM", "L-OM")
    drives = (
        Drive(name="store", primitive=Twist(hand=first, level=0.2), begins=names[0], free=("level", "rise")),
        Drive(name="bend", primitive=Bend(side="LM1", level=0.2), begins=names[-1], free=("level", "rise")),
        Drive(name="back", primitive=Twist(hand=second, level=0.1), begins=names[-1], free=("level", "rise")),
    )
    return Task(name="writhe and twist", phases=phases, drives=drives)


def coil_variant(draw: np.random.Generator, model: ReducedModel) -> Task:
    """The coil with goals moved by up to a quarter, as `draw` decides, whatever the `model`."""
    coil = tasks.load("coil").task
    phases = tuple(
        replace(
            phase,
            goals=tuple(replace(item, value=item.value * float(draw.uniform(0.75, 1.25))) for item in phase.goals),  # type: ignore[type-var, attr-defined]
        )
        for phase in coil.phases
    )
    return replace(coil, phases=phases)


OLD_KINDS: tuple[Kind, ...] = (twist_only, writhe_and_twist, writhe_and_twist, coil_variant)
"""In the shares in which they are drawn."""

WHOLE = (0.0, 0.1978)
BENT, SHORT = ("level", "rise"), ("level",)


def place(draw: np.random.Generator, model: ReducedModel) -> Task:
    """The tip at a point where a random programme (of `draw`) of the `model` leads, in one of six tasks half an arm's length too far."""
    task = Task(
        name="place",
        phases=(Phase(name="reach", duration=2.5, longest=4.0, goals=(goal("tip", value=(0.05, 0.1, 0.0), tolerance=0.01),)),),
        drives=(
            Drive(name="lean", primitive=Bend(side="LM1", level=0.1, window=(0.0, 0.08)), begins="reach", free=BENT),
            Drive(name="lift", primitive=Bend(side="LM3", level=0.1, window=(0.08, WHOLE[1])), begins="reach", free=BENT),
            Drive(name="shorten", primitive=Shorten(level=0.05), begins="reach", free=SHORT),
        ),
    )
    strains = _reached(task, model, draw)
    value = model.points(strains)[-1]
    if draw.integers(6) == 0:
        value = value * (1.5 * model.arm.length / max(float(np.linalg.norm(value)), 1e-3))
    return _asking(task, goal("tip", value=tuple(map(float, value)), tolerance=0.01))


def sides_and_writhe(draw: np.random.Generator, model: ReducedModel) -> Task:
    """Suckers inside the bends, or outside, and writhe, as a random programme (of `draw`) of the `model` has them."""
    inward = draw.random() < 0.5
    task = _bent("sides", draw, "LM1" if inward else "LM5")
    strains = _reached(task, model, draw)
    recording, trace = model.recording([0.0], strains[None]), model.trace([0.0], strains[None], task.convention)
    writhe = float(model.outputs(strains[None], task.convention.pole)[0][0, 1])
    # By how much it misses an end of its range says where it lies.
    end = {"at_least": 1.0} if inward else {"at_most": -1.0}
    missed = float(goal("sucker_side", azimuth=0.0, **end).miss(recording, trace, model.arm)[0])
    towards = {"at_least": 0.95 - missed} if inward else {"at_most": missed - 0.95}
    return _asking(task, goal("lifted_writhe", value=writhe, tolerance=0.15), goal("sucker_side", azimuth=0.0, **towards))


def regions(draw: np.random.Generator, model: ReducedModel) -> Task:
    """Twist of the lower half of the arm in a band, with the mean curvature, as a random programme (of `draw`) of the `model` has them."""
    task = _bent("regions", draw, "LM1")
    strains, half = _reached(task, model, draw), 0.5 * model.arm.length
    recording = model.recording([0.0], strains[None])
    trace = model.trace([0.0], strains[None], task.convention)
    twist = float(goal("twist", value=0.0, window=(0.0, half)).miss(recording, trace, model.arm)[0])
    sign = float(np.sign(model.outputs(strains[None], task.convention.pole)[0][0, 0])) or 1.0
    bend = float(goal("curvature", value=0.0).miss(recording, trace, model.arm)[0])
    band = goal("twist", window=(0.0, half), between=(sign * twist - 0.05, sign * twist + 0.05), tolerance=0.05)
    return _asking(task, band, goal("curvature", value=bend, tolerance=2.0))


NEW_KINDS: tuple[Kind, ...] = (place, sides_and_writhe, regions)
"""Goals of place, side, region and band."""


def held_place(draw: np.random.Generator, model: ReducedModel) -> Task:
    """The tip at a point where a random programme (of `draw`) of the `model` leads, held there for half a second.

    Three bends, for the three coordinates of a point, and phases long enough for the arm to come to rest in the water: what is missed of a
    quick motion no feedback mends in time.
    """
    upper = (0.08, WHOLE[1])
    task = Task(
        name="held place",
        phases=(
            Phase(name="reach", duration=2.0, shortest=1.5, longest=4.0),
            Phase(
                name="hold", duration=1.5, shortest=1.2, longest=3.0, goals=(goal("tip", value=(0.05, 0.1, 0.0), tolerance=0.01, hold=0.5),)
            ),
        ),
        drives=tuple(
            Drive(name=f"{name}{phase}", primitive=Bend(side=bent, level=0.1, window=window), begins=begins, free=BENT)
            for phase, begins in (("", "reach"), (" on", "hold"))
            for name, bent, window in (("lean", "LM1", (0.0, 0.08)), ("lift", "LM3", upper), ("curl", "LM1", upper))
        ),
    )
    value = model.points(_reached(task, model, draw, low=0.0, high=0.3))[-1]
    asked = goal("tip", value=tuple(map(float, value)), tolerance=0.01, hold=0.5)
    return replace(task, phases=(task.phases[0], replace(task.phases[1], goals=(asked,))))


def side(draw: np.random.Generator, model: ReducedModel) -> Task:
    """Suckers' side in the lower half of the arm, and its bend, by two muscles, for the arm of a `model`; `draw` decides."""
    half = (0.0, 0.5 * model.arm.length)
    angle, bend = float(draw.uniform(-0.9, 0.9)), float(draw.uniform(8.0, 16.0))
    task = Task(
        name="side",
        phases=(
            Phase(
                name="turn",
                duration=2.0,
                goals=(
                    goal("sucker_side", azimuth=0.0, window=half, value=angle, tolerance=0.1),
                    goal("curvature", window=half, value=bend, tolerance=2.0),
                ),
            ),
        ),
        drives=tuple(
            Drive(name=name, primitive=Bend(side=muscle, level=0.1, window=half), begins="turn", free=BENT)
            for name, muscle in (("along", "LM1" if angle > 0 else "LM5"), ("across", "LM3" if draw.random() < 0.5 else "LM7"))
        ),
    )
    return task


def packet(draw: np.random.Generator, model: ReducedModel) -> Task:
    """The task `packet` with a bending strain of 0.3, at two places and as fast as `draw` decides, whatever the `model`."""
    speed, first, apart = float(draw.uniform(0.06, 0.14)), float(draw.uniform(0.06, 0.08)), float(draw.uniform(0.04, 0.06))
    task = tasks.load("packet").task
    long = 0.05 / speed
    durations = (long, (first - 0.02) / speed, apart / speed)
    goals = ((), (first,), (first + apart,))
    phases = tuple(
        replace(
            phase,
            duration=duration,
            shortest=0.7 * duration,
            longest=1.4 * duration,
            goals=tuple(goal("packet", value=place, tolerance=0.008) for place in places),
        )
        for phase, duration, places in zip(task.phases, durations, goals, strict=True)
    )
    drive = replace(task.drives[0], primitive=BendWave(level=0.6, speed=speed, width=5e-3, window=WHOLE), free=("speed",))
    return replace(task, phases=phases, drives=(drive,))


def _bent(name: str, draw: np.random.Generator, side: str) -> Task:
    hand = "R-OM" if draw.random() < 0.5 else "L-OM"
    return Task(
        name=name,
        phases=(Phase(name="turn", duration=2.0, goals=(goal("twist", value=0.0),)),),
        drives=(
            Drive(name="store", primitive=Twist(hand=hand, level=0.1), begins="turn", free=BENT),
            Drive(name="bend", primitive=Bend(side=side, level=0.1), begins="turn", free=BENT),
        ),
    )


def _reached(task: Task, model: ReducedModel, draw: np.random.Generator, low: float = 0.1, high: float = 0.6) -> Floats:
    """Strains (S, 4) after the first phase of a random programme of a task's drives, far from a U-turn; its numbers from `low` to `high`
    of their ranges.
    """
    problem = Problem(task, model)
    while True:
        share = draw.uniform(low, high, size=len(problem.names))
        x = problem.box.lower + share * (problem.box.upper - problem.box.lower)
        count = int(np.ceil(x[0] / 0.05))
        levels = model.levels(problem.schedule(x)[1].activation(), x[0] / count * np.arange(1, count + 1))
        strains = model.simulate(levels, np.full(count, x[0] / count)).strains
        if model.outputs(strains)[0][:, -1].min() > 0.6:
            return strains[-1]


def _asking(task: Task, *goals: Any) -> Task:
    return replace(task, phases=(replace(task.phases[0], goals=goals),))
