"""What of the full arm meets the objects of a scene, and what of it meets itself."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..body.arm import Arm
from ..contact.folds import Folds
from ..contact.surroundings import Surroundings
from ..contact.world import Nodes
from ..contracts import Floats
from ..scene.scene import Scene
from .geometry import AssemblyGeometry


class Sections(NamedTuple):
    """Sections of the arm at its N + 1 nodes, each a ball.

    Attributes
    ----------
    place : (N + 1,) uint64
        Of the cord's node in a row of the open rods; those of the longitudinal muscles follow in the next slots.
    radius : (N + 1,) float64, m
        At rest.
    length : (N + 1,) float64, m
        Of the arm that a section stands for.
    spread : (N + 1,) float64, m
        Root of the sum of the squared distances of the muscles from the cord at rest.
    """

    place: NDArray[np.uint64]
    radius: Floats
    length: Floats
    spread: Floats


def outer_nodes(geometry: AssemblyGeometry) -> Nodes:
    """The nodes of the helices, the outermost rods."""
    grid, radius = geometry.grid, geometry.oblique.radius
    rods, count = geometry.oblique.points.shape[:2]
    start = (grid.straight_rods + grid.helix_nodes * np.arange(rods)) * grid.lanes
    around = np.concatenate([radius[:, :1], (radius[:, 1:] + radius[:, :-1]) / 2, radius[:, -1:]], axis=1)
    return Nodes(
        place=(start[:, None] + 1 + np.arange(count)).ravel().astype(np.uint64),
        radius=around.ravel(),
        length=np.full(rods * count, geometry.spacing / grid.helix_nodes),
    )


def surroundings_of(arm: Arm, scene: Scene, geometry: AssemblyGeometry) -> Surroundings | None:
    """The objects of a scene around an arm at rest; None without any.

    Raises
    ------
    OctoctrlError
        If one overlaps the arm.
    """
    if not scene.objects:
        return None
    density = 0.0 if scene.water is None else scene.water.density
    thickness = float(arm.section(0.0).outer_radius)
    found = Surroundings(scene.objects, outer_nodes(geometry), thickness=thickness, water_density=density)
    found.check(geometry.oblique.points.reshape(-1, 3))
    return found


def folds_of(arm: Arm, scene: Scene, geometry: AssemblyGeometry) -> Folds | None:
    """What of the arm may touch itself; None where that is not asked for."""
    if not scene.self_contact:
        return None
    points = geometry.straight.points
    along = np.linspace(0.0, arm.length, points.shape[1])
    sections = Sections(
        place=(1 + np.arange(points.shape[1])).astype(np.uint64),
        radius=np.asarray(arm.section(along).outer_radius),
        length=np.full(len(along), geometry.spacing),
        spread=np.sqrt(((points[1:] - points[0]) ** 2).sum(axis=(0, 2))),
    )
    return Folds.of(sections, along)
