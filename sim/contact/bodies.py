"""From objects of a scene to the rows that the kernels work on, and what is recorded of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene.mesh import Mesh
from ..scene.objects import RigidObject, frame_of
from ..scene.supports import Fixed, Free, Moved, Springs
from .baking import baked_row
from .columns import Body, Note

Floats = NDArray[np.float64]


def rows_of(objects: Sequence[RigidObject], *, water_density: float = 0.0, step: float = 0.0) -> Floats:
    """Rows of all objects at the begin.

    Parameters
    ----------
    objects : sequence of RigidObject
    water_density : float, kg/m^3
        Of the water that moving objects drag along; 0 in a vacuum.
    step : float, s
        See `release`.

    Returns
    -------
    (M, Body.WIDTH + G) float64
        What follows `Body.WIDTH` is there if one is a mesh: the distances of each, see `Grid`.
    """
    grids = {index: baked_row(item)[Body.WIDTH :] for index, item in enumerate(objects) if isinstance(item, Mesh)}
    rows = np.zeros((len(objects), Body.WIDTH + max(map(len, grids.values()), default=0)))
    for index, grid in grids.items():
        rows[index, Body.WIDTH : Body.WIDTH + len(grid)] = grid
    for row, item in zip(rows, objects, strict=True):
        row[Body.SHAPE] = item.kind
        row[Body.SIZE : Body.SIZE + len(item.sizes)] = item.sizes
        row[Body.POSITION : Body.POSITION + 3] = row[Body.HOME : Body.HOME + 3] = item.position
        frame = frame_of(item)
        row[Body.FRAME : Body.FRAME + 9] = frame.ravel()
        row[Body.HOME_AXIS : Body.HOME_AXIS + 3] = frame[2]
        row[Body.STATIC], row[Body.KINETIC] = item.friction
        row[Body.STIFFNESS], row[Body.BOUND] = item.stiffness, item.bound
        support = item.support
        row[Body.MOVING] = not isinstance(support, Fixed)
        if isinstance(support, Moved):
            row[Body.VELOCITY : Body.VELOCITY + 3] = support.velocity
            row[Body.SPIN : Body.SPIN + 3] = support.spin
        if isinstance(support, Springs):
            row[Body.SPRING : Body.SPRING + 2] = support.stiffness, support.turning
        if isinstance(support, Free | Springs):
            row[Body.DAMPING : Body.DAMPING + 2] = support.damping
            if not (isinstance(support, Free) and support.since > 0):
                release(row, item, water_density, step)
    return rows


def still_row(item: RigidObject) -> Floats:
    """Row of an object that lies at the origin along the axes, to be read only: its shape alone counts, and that of a mesh is kept."""
    if isinstance(item, Mesh):
        return baked_row(item)
    (row,) = rows_of([item])
    row[Body.POSITION : Body.POSITION + 3], row[Body.FRAME : Body.FRAME + 9] = 0.0, np.eye(3).ravel()
    return np.asarray(row)


def release(row: Floats, item: RigidObject, water_density: float = 0.0, step: float = 0.0) -> None:
    """Give a body its mass: from now on it moves as it is pushed.

    Parameters
    ----------
    row : (Body.WIDTH,) float64
    item : RigidObject
    water_density : float, kg/m^3
    step : float, s
        For which springs make it heavier, see `swung`.
    """
    assert item.weight is not None
    # Water that moves along adds to the mass; about its own axis a smooth body turns without it.
    water = water_density * item.volume if item.water_mass else 0.0
    across, (held, turned) = item.weight + water, row[Body.SPRING : Body.SPRING + 2]
    inertia = np.array(item.gyration) * [across, across, item.weight]
    row[Body.INVERSE_MASS] = 1 / swung(across, held, step)
    row[Body.INVERSE_INERTIA : Body.INVERSE_INERTIA + 3] = 1 / swung(inertia, turned * np.array([1.0, 1.0, 0.0]), step)


def swung(mass: Any, spring: Any, step: float) -> Any:
    """The mass that a spring swings in steps as it swings `mass` without: at w = sqrt(spring / mass), while step w < 2, and stable beyond.

    By turns, drift and kick swing a mass M at 2 asin(step / 2 sqrt(spring / M)) / step, which is w for M = mass (x / sin x)^2 with
    x = step w / 2. Contact sees that mass as well, so that the body comes to rest where forces balance.

    Parameters
    ----------
    mass, spring : float or array
        Or moments of inertia and what turns them back.
    step : float, s
    """
    x = 0.5 * step * np.sqrt(spring / mass)
    return mass / np.sinc(np.minimum(x, 1.0) / np.pi) ** 2 * np.maximum(x, 1.0) ** 2


def kinetic_energy(row: Floats) -> float:
    """Kinetic energy of a body that moves freely, J."""
    if row[Body.INVERSE_MASS] == 0:
        return 0.0
    along = row[Body.FRAME : Body.FRAME + 9].reshape(3, 3) @ row[Body.MOMENTUM : Body.MOMENTUM + 3]
    velocity = row[Body.VELOCITY : Body.VELOCITY + 3]
    return float(0.5 * velocity @ velocity / row[Body.INVERSE_MASS] + 0.5 * along**2 @ row[Body.INVERSE_INERTIA : Body.INVERSE_INERTIA + 3])


def notes_of(bodies: Floats) -> Floats:
    """Notes (M, Note.WIDTH) of the rows of bodies (M, Body.WIDTH) that nothing touches."""
    notes = np.zeros((len(bodies), Note.WIDTH))
    notes[:, : Note.FORCE], notes[:, Note.SLIPPED] = bodies[:, Body.POSITION : Body.MOMENTUM], bodies[:, Body.SLIPPED]
    notes[:, Note.SHAPE : Note.SHAPE + 4] = bodies[:, Body.SHAPE : Body.SHAPE + 4]
    notes[:, Note.HOME_AXIS : Note.HOME_AXIS + 3] = bodies[:, Body.HOME_AXIS : Body.HOME_AXIS + 3]
    return notes
