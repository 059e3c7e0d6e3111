"""What a verdict says of objects: how deep the arm sank into each and, of those that a task is to handle, how they were held."""

from collections.abc import Iterator
from math import inf

import numpy as np

from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.planners.asking.goals.touching import hold_in
from octoctrl.planners.asking.task import Task
from octoctrl.planners.solving.grasping import held_at_the_end, objects_held
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.scene.objects import BEARABLE
from octoctrl.sim.topology.trace import TopologyTrace

from .results import Check

LATE = 0.5
"""Time before the end over which the winding may drift, s."""

DRIFT = 0.1
"""Largest drift, turns; the deepest overlap allowed is what a plant bears."""

LINK_RESIDUAL = 0.02
"""Largest link minus (writhe + twist), turns."""


def holding_checks(task: Task, arm: Arm, recording: Recording, trace: TopologyTrace) -> Iterator[Check]:
    """Check the objects on the `recording` of an `arm`, with its `trace`, above all those that the goals of a `task` ask to handle.

    Yields
    ------
    Check
        Depth of each and, where the task ends in a hold of it, drift with limits; of what is handled covered winding, winding, normal
        force, loaded points and slip at the end, as they are, and the size of the cord's writhe. Writhe jumps by two between runs that look
        alike: nothing is judged by it.
    """
    from octoctrl.sim.topology.measures import writhe

    from .worth import touches

    outputs = RecordedOutputs(recording, trace, arm)
    late = recording.time >= recording.time[-1] - LATE
    yield Check(name="cord.writhe", value=abs(float(writhe(recording.points[-1]))), limit=inf, unit="turns")
    limit, named = BEARABLE * float(np.asarray(arm.section(0.0).outer_radius)), objects_held(task)
    for name, touch in sorted(touches(recording).items()):
        yield Check(name=f"{name}.depth", value=float(touch.deepest.max()), limit=limit, unit="m")
        if name not in named:
            continue
        hold = hold_in(outputs, name)
        if name in held_at_the_end(task):
            yield Check(name=f"{name}.drift", value=float(np.ptp(hold.winding[late])), limit=DRIFT, unit="turns")
            yield Check(name=f"{name}.covered_winding", value=abs(float(hold.covered[-1])), limit=inf, unit="turns")
        yield Check(name=f"{name}.winding", value=abs(float(hold.winding[-1])), limit=inf, unit="turns")
        yield Check(name=f"{name}.normal_force", value=float(touch.normal_force[-1]), limit=inf, unit="N")
        yield Check(name=f"{name}.loaded_points", value=float(touch.loaded[-1]), limit=inf)
        yield Check(name=f"{name}.slip", value=float(touch.slip.max()), limit=inf, unit="m")
