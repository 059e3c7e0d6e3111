"""What is kept of the bodies at the end of a sample, and whether the step could follow what they touched."""

from ..compiler import kernel
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
SHAPE, HOME_AXIS, NOTED_SHAPE, NOTED_AXIS = int(Body.SHAPE), int(Body.HOME_AXIS), int(Note.SHAPE), int(Note.HOME_AXIS)
SUNK, STIFFNESS = int(Body.SUNK), int(Body.STIFFNESS)
PLACED = int(Body.MOMENTUM - Body.POSITION)
"""Columns of position, frame and velocity, side by side in a body's row and in a note."""


@kernel(_nrt=False)
def note(world: World, sample: int, h: float, steps: int) -> None:
    """Copy the bodies, with means over the sample in place of sums, and clear the sums."""
    bodies, notes = world.bodies, world.notes
    world.seen[SINKS] = False
    for j in range(bodies.shape[0]):
        if bodies[j, MOVING] > 0:
            straighten(bodies[j])
        for i in range(PLACED):
            notes[sample, j, i] = bodies[j, POSITION + i]
        for i in range(4):
            notes[sample, j, NOTED_SHAPE + i] = bodies[j, SHAPE + i]
        for i in range(3):
            notes[sample, j, NOTED_AXIS + i] = bodies[j, HOME_AXIS + i]
        if bodies[j, LOADED] > 0:
            for i in range(7):
                notes[sample, j, FORCE + i] = bodies[j, IMPULSE + i] / (h * steps)
            notes[sample, j, NOTED_DEEPEST] = bodies[j, DEEPEST]
            notes[sample, j, NOTED_LOADED] = bodies[j, LOADED] / steps
            for i in range(IMPULSE, LOADED + 1):
                bodies[j, i] = 0.0
            softness = max(1.0, FIRM / bodies[j, STIFFNESS])
            world.seen[SINKS] = world.seen[SINKS] or bodies[j, SUNK] > softness * world.bearable
            bodies[j, SUNK] = 0.0
        notes[sample, j, NOTED_SLIPPED] = bodies[j, SLIPPED]
