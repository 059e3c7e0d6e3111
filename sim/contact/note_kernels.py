"""What is kept of the bodies at the end of a sample."""

from ..compiler import kernel
from .body_kernels import straighten
from .columns import Anchor, Body
from .world import World

IMPULSE, LOADED, DEEPEST, NORMAL, SLIP = int(Body.IMPULSE), int(Body.LOADED), int(Body.DEEPEST), int(Anchor.NORMAL), int(Anchor.SLIP)


@kernel
def note(world: World, sample: int) -> None:
    """Copy the bodies, and forces and slip of the points; clear what was summed over the sample."""
    straighten(world.bodies)
    for j in range(world.bodies.shape[0]):
        body = world.bodies[j]
        for i in range(body.shape[0]):
            world.notes[sample, j, i] = body[i]
        for i in range(IMPULSE, LOADED + 1):
            body[i] = 0.0
        for p in range(world.anchors.shape[1]):
            world.loads[sample, j, p, 0] = world.anchors[j, p, NORMAL]
            world.loads[sample, j, p, 1] = world.anchors[j, p, SLIP]
