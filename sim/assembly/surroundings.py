"""What of the full arm meets the objects of a scene."""

import numpy as np

from ..body.arm import Arm
from ..contact.surroundings import Surroundings
from ..contact.world import Nodes
from ..scene.scene import Scene
from .geometry import AssemblyGeometry


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
