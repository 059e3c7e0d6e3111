"""What is kept of the bodies at the end of a sample, and whether the step could follow what they touched."""

from ..compiler import borrowing_kernel
from ..scene.objects import FIRM
from .body_kernels import straighten
from .columns import Body, Note
from .near_kernels import SINKS
from .world import World

MOVING, POSITION, IMPULSE, NORMAL, DEEPEST, LOADED, SLIPPED = (
    int(c) for c in (Body.MOVING, Body.POSITION, Body.IMPULSE, Body.NORMAL, Body.DEEPEST, Body.LOADED, Body.SLIPPED)
)
FORCE, NOTED_NORMAL, NOTED_DEEPEST, NOTED_LOADED, NOTED_SLIPPED = (
    int(c) for c in (Note.FORCE, Note.NORMAL, Note.DEEPEST, Note.LOADED, Note.SLIPPED)
)
SUNK, STIFFNESS, WIDTH = int(Body.SUNK), int(Body.STIFFNESS), int(Note.WIDTH)
PLACED = int(Body.MOMENTUM - Body.POSITION)
"""Columns of position, frame and velocity, side by side in a body's row and in a note."""


@borrowing_kernel
def note(world: World, sample: int, h: float, steps: int) -> None:
    """Copy the bodies, with means over the sample in place of sums, and clear the sums; not those that have not moved or been touched."""
    bodies, notes, noted = world.bodies, world.notes, world.noted
    world.seen[SINKS] = False
    for j in range(bodies.shape[0]):
        if sample < noted[j]:
            if bodies[j, MOVING] == 0 and bodies[j, LOADED] == 0:
                continue
            noted[j] = sample
        if bodies[j, MOVING] > 0:
            straighten(bodies[j])
        row = notes[sample + 1, j]
        for i in range(PLACED):
            row[i] = bodies[j, POSITION + i]
        for i in range(PLACED, WIDTH):
            row[i] = notes[0, j, i]
        if bodies[j, LOADED] > 0:
            for i in range(7):
                row[FORCE + i] = bodies[j, IMPULSE + i] / (h * steps)
            row[NOTED_DEEPEST] = bodies[j, DEEPEST]
            row[NOTED_LOADED] = bodies[j, LOADED] / steps
            for i in range(IMPULSE, LOADED + 1):
                bodies[j, i] = 0.0
            softness = max(1.0, FIRM / bodies[j, STIFFNESS])
            world.seen[SINKS] = world.seen[SINKS] or bodies[j, SUNK] > softness * world.bearable
            bodies[j, SUNK] = 0.0
        row[NOTED_SLIPPED] = bodies[j, SLIPPED]
