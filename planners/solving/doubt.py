"""How sure a plan is before it meets the plant: what small errors of the model would do to its goals, and where it asks for trust.

The model never is the plant. Four errors of usual size are tried: oblique and longitudinal muscles stronger by a twentieth, water
heavier by a fifth, activation later by 15 ms. The root of the sum of squares of what they change is the spread of a goal.

How large miss and spread may be is what random goals say that were carried out on the rod (`octoctrl bench plans`, which goes on saying
it): of 165 solved plans (100 goals of old and of new kinds each, seed 11) 134 stayed below `TRUSTED` and away from a U-turn. All of them
met their goals in open loop and 133 with feedback; of the 31 others 23 and 26.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..asking.schedule import Schedule
from .problem import Problem, Reading

Floats = NDArray[np.float64]

STRONGER, HEAVIER, LATER = 1.05, 1.2, 0.015
"""The errors that are tried."""

STEP = 0.1
"""Step of the reduced model for differences between plans, s."""

TRUSTED, NARROW, FAST = 0.9, 0.3, 4.0
"""Miss and spread together, in tolerances, beyond which a goal is in doubt; u below which the path is; rate of a level, 1/s, beyond which
the model is."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """What speaks against a plan that meets its goals on the model.

    Attributes
    ----------
    spread : (goals,) float64
        In tolerances.
    reasons : tuple of str
        Empty if nothing does.
    """

    spread: Floats
    reasons: tuple[str, ...]


def doubt(problem: Problem, x: Floats, reading: Reading, schedule: Schedule) -> Doubt:
    """Try the errors on a plan.

    Parameters
    ----------
    problem : Problem
    x : (n,) float64
    reading : Reading
        On fine steps.
    schedule : Schedule
        Of `x`.

    Returns
    -------
    Doubt
    """
    factors, grid = problem.model.parameters, problem.grid(x, STEP)
    others = [
        replace(factors, oblique_stress=STRONGER * factors.oblique_stress),
        replace(factors, longitudinal_stress=STRONGER * factors.longitudinal_stress),
        replace(factors, **{name: HEAVIER * getattr(factors, name) for name in ("linear_drag", "quadratic_drag", "rotational_drag")}),
    ]
    changed = [problem.on(replace(problem.model, parameters=other)) for other in others] + [problem.on(problem.model, LATER)]
    expected = problem.read(x, grid).misses
    squares = np.zeros(len(expected))
    for other in changed:
        squares = squares + np.square(other.read(x, grid).misses - expected)
    spread, place = np.zeros(len(problem.aims)), 0
    for index, (aim, instants) in enumerate(zip(problem.aims, grid.instants, strict=True)):
        size = aim.rows.count * len(instants)
        spread[index] = np.sqrt(np.sum(np.reshape(squares[place : place + size], (len(instants), -1)), axis=1).max())
        place += size
    reasons = []
    worst = int(np.argmax(reading.shares + spread)) if len(spread) else 0
    if len(spread) and reading.shares[worst] + spread[worst] > TRUSTED:
        aim = problem.aims[worst]
        phase = problem.task.phases[aim.phase].name
        reasons.append(f"small errors of the model move {aim.goal} of phase '{phase}' by {spread[worst]:.1f} tolerances")
    if reading.opening < NARROW:
        reasons.append(f"the tip comes near a U-turn (1 + tip . base = {reading.opening:.2f})")
    rate = max((np.pi / 2 * part.level / ramp for part in schedule.activation().templates for ramp in _ramps(part)), default=0.0)
    if rate > FAST:
        reasons.append(f"a level changes by {rate:.1f} per second, faster than models are identified on")
    return Doubt(spread, tuple(reasons))


def _ramps(template: object) -> list[float]:
    return [getattr(template, name) for name in ("rise", "fall") if hasattr(template, name)]
