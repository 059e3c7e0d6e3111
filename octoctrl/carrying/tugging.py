"""A tug at what an arm holds: from a copy of its state the object is moved by force, and the arm's answer is measured.

By displacement, not by force: a free object that is pulled harder than friction holds flies off.
"""

from dataclasses import dataclass, replace

import numpy as np

from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.planners.asking.goals.touching import hold_in
from octoctrl.sim.contact.columns import Body
from octoctrl.sim.contracts import ActivationSource, Floats
from octoctrl.sim.plants import Plant, make_plant
from octoctrl.sim.scene.objects import Fixed

ALONG, ACROSS = 0.01, 0.02
"""How far it is tugged along the object's axis, and across it away from the arm's base, m."""

SECONDS, AT_THE_END = 1.0, 0.1
"""How long it is tugged, and over which time before the end the force is read, s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tug:
    """What a tug met.

    Attributes
    ----------
    distance : float, m
    force : float, N
        Of the arm against the tug, at its end.
    normal_force : float, N
    slip : float, m
        Longest path that a point slid meanwhile.
    covered : float, turns
        Covered winding afterwards.
    """

    distance: float
    force: float
    normal_force: float
    slip: float
    covered: float

    def __str__(self) -> str:
        return (
            f"{1e3 * self.distance:.0f} mm met {1e3 * self.force:.1f} mN of {1e3 * self.normal_force:.1f} mN normal force, slid "
            f"{1e3 * self.slip:.1f} mm, and left {self.covered:.2f} turns"
        )


def tug(held: Plant, source: ActivationSource, name: str, direction: Floats, distance: float, *, model: str) -> Tug:
    """Tug at an object that a plant holds now; the plant itself stays as it is.

    Parameters
    ----------
    held : Plant
    source : ActivationSource
        What its muscles go on to do.
    name : str
        Of the object.
    direction : (3,) float64
        Of any length.
    distance : float, m
        Within `SECONDS`.
    model : str
        Name of the plant in `octoctrl.sim.plants.PLANTS`.

    Returns
    -------
    Tug

    Raises
    ------
    PlantUnstableError
        If the plant diverges.
    """
    index = [item.name for item in held.scene.objects].index(name)
    # What is moved here belongs to nobody's mass: the scene says fixed, so that it is not let go again.
    objects = tuple(
        replace(item, support=Fixed(), mass=None, density=None, pushes=()) if item.name == name else item for item in held.scene.objects
    )
    moved = make_plant(model, held.arm, replace(held.scene, objects=objects), record_every=held.record_every)
    state = {key: np.array(value) for key, value in held.state().items()}
    body, unit = state["bodies"][index], np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    for column, width in (
        (Body.MOMENTUM, 3),
        (Body.SPIN, 3),
        (Body.INVERSE_MASS, 1),
        (Body.INVERSE_INERTIA, 3),
        (Body.DAMPING, 2),
        (Body.SPRING, 2),
    ):
        body[column : column + width] = 0.0
    body[Body.VELOCITY : Body.VELOCITY + 3], body[Body.MOVING] = unit * distance / SECONDS, 1.0
    state["between"] = moved.state()["between"]  # what is moved by a tug meets no other body
    slid = float(body[Body.SLIPPED])
    moved.restore(state)
    recording = moved.advance(source, SECONDS)
    hold = hold_in(RecordedOutputs(recording, None, held.arm), name)
    late = recording.time >= recording.time[-1] - AT_THE_END
    return Tug(
        distance=distance,
        force=float(-(hold.touch.force[late] @ unit).mean()),
        normal_force=float(hold.touch.normal_force[late].mean()),
        slip=max(float(hold.touch.slip[-1]) - slid, 0.0),
        covered=abs(float(hold.covered[-1])),
    )


def tugs(held: Plant, source: ActivationSource, name: str, *, model: str) -> dict[str, Tug]:
    """Tug at an object along its axis and across it, away from the arm's base, each from a copy of the state.

    Parameters
    ----------
    held : Plant
    source : ActivationSource
    name : str
    model : str
        As `tug` takes them.

    Returns
    -------
    dict of str to Tug
        ``"along"`` and ``"across"``.
    """
    index = [item.name for item in held.scene.objects].index(name)
    axis = held.state()["bodies"][index][Body.FRAME + 6 : Body.FRAME + 9]
    away = np.array([0.0, 1.0, 0.0]) - axis[1] * axis
    if np.linalg.norm(away) < 0.3:  # along the arm: then to a side
        away = np.cross(axis, [1.0, 0.0, 0.0])
    directions = {"along": (np.copysign(1.0, axis[1]) * axis, ALONG), "across": (away, ACROSS)}
    return {word: tug(held, source, name, direction, distance, model=model) for word, (direction, distance) in directions.items()}
