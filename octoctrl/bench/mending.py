"""What feedback mends of a held tip, of the side on which the suckers are, and of the place of a packet: on rods as planned, and on others.

Tasks and rods are drawn from one seed: tissue within 30 %, every muscle by itself within 20 %, water up to twice as heavy.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from octoctrl.planners.contracts import Floats
from octoctrl.planners.fitting.identified import IdentifiedModel, load_identified
from octoctrl.planners.solving import planner
from octoctrl.planners.solving.plan import Plan
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.plants import make_plant
from octoctrl.sim.running.plant import Plant
from octoctrl.sim.scene.scene import Scene

from ..carrying.execution import execute
from ..judging.verification import verify
from ..tables import Table
from .goals import Kind, held_place, packet, side
from .planning import CONTROLLERS, TIME_LIMIT

COUNT, FULL_COUNT = 3, 12
"""Tasks of each kind."""

RODS = 3
"""Rods that are not as planned, for each task."""


class Mended(NamedTuple):
    """A kind of task, the quantity whose goals are looked at, the unit in which that is told, how many of that make one of
    the quantity, what is allowed, and the sections of the reduced model.
    """

    kind: Kind
    quantity: str
    unit: str
    scale: float
    allowed: float
    sections: int = 8


KINDS = (
    Mended(held_place, "tip", "% of the arm", 100 / Arm.octopus().length, 6.0),
    Mended(side, "sucker_side", "", 1.0, 0.1),
    Mended(packet, "packet", "mm", 1e3, 15.0, 16),
)


def mending(*, full: bool = False, count: int | None = None, seed: int = 7) -> Table:
    """Misses without and with feedback.

    Parameters
    ----------
    full : bool
        `FULL_COUNT` tasks of each kind.
    count : int, optional
        How many instead.
    seed : int

    Returns
    -------
    Table
    """
    number = (FULL_COUNT if full else COUNT) if count is None else count
    identified, rows = load_identified(Arm.octopus(), Scene.free()), list[tuple[str | int | float, ...]]()
    refused = 0
    for index, what in enumerate(KINDS):
        draw = np.random.default_rng([seed, index])
        plans, in_vain = _plans(what.kind, number, draw, identified.divided(what.sections))
        refused += in_vain
        plants: list[list[Plant | None]] = [[_other(made.arm, draw) for _ in range(RODS)] for made in plans]
        as_planned: list[list[Plant | None]] = [[None]] * number
        for label, rods in (("as planned", as_planned), ("not as planned", plants)):
            found = {
                feedback: what.scale
                * np.concatenate(
                    [_misses(made, what.quantity, feedback, plant) for made, some in zip(plans, rods, strict=True) for plant in some]
                )
                for feedback in CONTROLLERS
            }
            unaided = _rms(found["open-loop"])
            rows += [
                (
                    what.quantity.replace("_", " "),
                    what.unit,
                    label,
                    feedback,
                    len(misses),
                    _rms(misses),
                    float(misses.max()),
                    _rms(misses) / unaided,
                    what.allowed,
                    int((misses <= what.allowed).sum()),
                )
                for feedback, misses in found.items()
            ]
    return Table(
        name="mending",
        title="What feedback mends",
        note=f"{number} random tasks of each kind on the rod, seed {seed}, and {RODS} rods that are not as planned for each (E, G +- 30 %, "
        f"every muscle by itself +- 20 %, drag x 1 to 2); {refused} more tasks were refused by the planner. Misses of the goals, of a "
        "tip the worst while it is held.",
        columns=("goal", "unit", "rod", "feedback", "goals", "rms", "largest", "of open loop", "allowed", "within"),
        formats=("", "", "", "", "d", ".3f", ".3f", ".0%", "g", "d"),
        rows=tuple(rows),
    )


def _plans(kind: Kind, number: int, draw: np.random.Generator, identified: IdentifiedModel) -> tuple[list[Plan], int]:
    """As many solved plans of random tasks, and how many tasks were refused meanwhile."""
    plans, refused = list[Plan](), 0
    while len(plans) < number:
        made = planner.plan(kind(draw, identified.model), identified, time_limit=TIME_LIMIT)
        if made.status.solved:
            plans.append(made)
        else:
            refused += 1
    return plans, refused


def _other(arm: Arm, draw: np.random.Generator) -> Plant:
    """A rod that is not as planned."""
    tissue, drag = draw.uniform(0.7, 1.3), draw.uniform(1.0, 2.0)
    # Gains only weaken: what they are shares of is the strongest muscle.
    strongest = 1.2
    gains = {group: float(draw.uniform(0.8, 1.2) / strongest) for group in MUSCLE_GROUPS if group != "TM"}
    laws = {name: getattr(arm, name) for name in ("oblique", "longitudinal")}
    stronger = {name: replace(law, maximum_stress=strongest * law.maximum_stress) for name, law in laws.items()}
    made = replace(arm, youngs_modulus=tissue * arm.youngs_modulus, shear_modulus=tissue * arm.shear_modulus, **stronger)
    return make_plant("rod", made, Scene.free(factor=drag), gains=gains)


def _misses(made: Plan, quantity: str, feedback: str, plant: Plant | None) -> Floats:
    """By how much each goal for a quantity is missed."""
    checks = verify(execute(made, feedback=feedback, plant=plant)).checks
    return np.array([check.value for check in checks if check.name.partition(".")[2] == quantity])


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
