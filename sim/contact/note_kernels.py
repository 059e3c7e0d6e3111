"""What is kept of the bodies at the end of a sample."""

from ..compiler import kernel
from .body_kernels import straighten
from .columns import Body
from .world import World

IMPULSE, NORMAL, LOADED = int(Body.IMPULSE), int(Body.NORMAL), int(Body.LOADED)


@kernel
def note(world: World, sample: int, h: float, steps: int) -> None:
    """Copy the bodies, with means over the sample in place of sums, and clear the sums."""
    straighten(world.bodies)
    for j in range(world.bodies.shape[0]):
        for i in range(world.bodies.shape[1]):
            world.notes[sample, j, i] = world.bodies[j, i]
        for i in range(IMPULSE, NORMAL + 1):
            world.notes[sample, j, i] /= h * steps
        world.notes[sample, j, LOADED] /= steps
        for i in range(IMPULSE, LOADED + 1):
            world.bodies[j, i] = 0.0
