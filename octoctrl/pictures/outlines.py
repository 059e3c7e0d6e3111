"""The objects of a scene in pictures on paper and in films: their outlines, seen through, so that nothing of the arm is hidden."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.scene.objects import Plane

from ..carrying.results import Execution
from .solids import mesh, pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

FILL, EDGE = "0.55", "0.35"


def outlines(run: Execution, index: int, camera: Floats) -> list[Floats]:
    """Convex outlines (K, 2), mm, of all objects but planes, as a `camera` sees them at instant number `index` of a `run`."""
    from scipy.spatial import ConvexHull

    found = []
    for item in run.plan.scene.objects:
        if isinstance(item, Plane):
            continue
        (place,), (frame,) = pose(run.recording, item, np.array([index]))
        flat = (1e3 * (place + mesh(item, run.plan.arm.length)[0] @ frame) @ camera.T)[:, :2]
        found.append(flat[ConvexHull(flat).vertices])
    return found


def draw_objects(axes: "Axes", seen: list[Floats], shift: Floats, sides: tuple[float, float] | None = None) -> None:
    """Draw outlines into `axes`.

    Parameters
    ----------
    axes : Axes
    seen : list of (K, 2) float64, mm
        As `outlines` gives them.
    shift : (2,) float64, mm
    sides : (float, float), mm, optional
        Between which the picture of this instant stands; what reaches beyond is cut off.
    """
    from matplotlib.patches import Polygon, Rectangle

    for outline in seen:
        corners = outline + shift
        for patch in (
            Polygon(corners, facecolor=FILL, alpha=0.25, lw=0, zorder=1),
            Polygon(corners, fill=False, ec=EDGE, lw=0.7, zorder=3),
        ):
            axes.add_patch(patch)
            if sides is not None:
                patch.set_clip_path(Rectangle((sides[0], -1e6), sides[1] - sides[0], 2e6, transform=axes.transData))
