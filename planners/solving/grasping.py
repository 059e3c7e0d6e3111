"""How an arm may take hold of an object: whether it is long enough, and from which thirteen numbers a search begins.

The arm curls towards the object from a little before its nearest point on, may twist so that it passes beside it in a helix, and leans with
a part before the curl: away a little to make room for it, towards it to spend less on the way, or far to a side, so that it comes to lie
across an object that stands along it. What bends an arm shortens it, by up to a fifth; so transverse muscles lengthen it meanwhile. The
first numbers are means of what was found for posts of 10 to 23 mm. All angles are those of the arm at rest, which leaves its base along +y.
"""

from dataclasses import replace
from math import atan2, cos, pi, sin, tau

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene.objects import Capsule, Cylinder, Plane, RigidObject, frame_of
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.scene.supports import Fixed

from ..asking.goals.covered_winding import CoveredWindingGoal
from ..asking.goals.touching import TouchingGoal
from ..asking.primitives import Elongate
from ..asking.task import Drive, Task
from ..asking.wrapping import Curl, StoreTwist, Swing
from .plan import Plan

Floats = NDArray[np.float64]

ENOUGH_TURNS, ENOUGH_LENGTHENED = 1.25, 0.9
"""Turns for which the arm beyond an object must suffice, were it straight up to there: with less hardly any was held. The second where the
planner chooses the drives, for these lengthen the arm besides: so 1.02 turns were enough on the full arm."""

BEFORE = 0.022
"""How far before the nearest point the curl begins, m, on an arm of 0.2 m."""

LEVEL, PROFILE, SPEED, DELAY, LEAN, LENGTHEN = 0.65, 0.75, 0.045, 0.3, 0.03, 0.15
"""Of the curl, and levels of the swing and of what lengthens the arm, from which a search begins. A front that is slow lays the arm on the
object bit by bit, so that it matters little when the arm meets it; a level that is high at the begin and falls with the radius bends thick
and thin parts as tightly."""

ALONG = 0.5
"""Cosine of the angle between an object's axis and the arm from which on the object counts as standing along it."""

TOUCHES = 2e-3
"""Gap below which a planned arm counts as touching, m."""


def objects_held(task: Task) -> set[str]:
    """Names of the objects that the goals of a task ask the arm to handle."""
    return {goal.object for phase in task.phases for goal in phase.goals if isinstance(goal, TouchingGoal) and goal.handled}


def held_at_the_end(task: Task) -> set[str]:
    """Names of the objects that the last phase of a task asks to be held."""
    return {goal.object for goal in task.phases[-1].goals if isinstance(goal, CoveredWindingGoal) and goal.band[0] > 0}


def is_simulated(task: Task) -> bool:
    """Whether some goal of a task is read on recordings alone, so that the task is planned by simulating."""
    return any(getattr(goal, "simulated", False) for phase in task.phases for goal in phase.goals)


def check_objects(task: Task, scene: Scene) -> None:
    """Check that the scene has the objects that the goals of a task are about, of which that can be asked.

    Raises
    ------
    OctoctrlError
        If one is missing, is a plane that is to be wound round, or is fixed where it does not meet the goal.
    """
    known = {item.name: item for item in scene.objects}
    for goal in (goal for phase in task.phases for goal in phase.goals if isinstance(goal, TouchingGoal)):
        for name in (getattr(goal, role) for role in ("object", "other") if hasattr(goal, role)):
            if name not in known:
                raise OctoctrlError(
                    f"task '{task.name}': a goal is about object '{name}', which the scene does not have ({', '.join(known) or 'none'})"
                )
        item, (low, high) = known[goal.object], goal.band
        if isinstance(item, Plane) and not goal.of_planes:
            raise OctoctrlError(
                f"task '{task.name}': goal {goal}: the object is a plane, of which there is no such number; gap can be asked for"
            )
        number = goal.at_rest(item) if isinstance(item.support, Fixed) else None
        if number is not None and not low - goal.tolerance <= number <= high + goal.tolerance:
            raise OctoctrlError(
                f"task '{task.name}': goal {goal}: the object is fixed and stays at {number:.3g} {goal.unit}; "
                "give it a support that lets it move, such as Free()"
            )


def nearest(arm: Arm, item: RigidObject) -> tuple[float, float, float]:
    """Where an arm at rest is nearest to an object: arclength (m), gap (m), and the azimuth towards it (rad)."""
    from octoctrl.sim.contact.measures import gaps

    s = np.linspace(0.0, arm.length, 401)
    places = np.stack([np.zeros_like(s), s, np.zeros_like(s)], axis=1)
    gap = gaps(places[None], item, np.array([item.position]), frame_of(item)[None])[0] - np.asarray(arm.section(s).outer_radius)
    index = int(gap.argmin())
    towards = _closest(item, places[index]) - places[index]
    return float(s[index]), float(gap[index]), atan2(towards[2], towards[0])


def _closest(item: RigidObject, place: Floats) -> Floats:
    """The point of an object's axis that is nearest to a place; its centre if it has none."""
    centre = np.asarray(item.position, dtype=float)
    if not isinstance(item, Capsule | Cylinder):
        return centre
    axis = frame_of(item)[2]
    along = float(np.clip((place - centre) @ axis, -item.length / 2, item.length / 2))
    return np.asarray(centre + along * axis)


def too_short(task: Task, arm: Arm, scene: Scene) -> str:
    """Why the arm cannot wind round what it is to wind round, or nothing.

    What is left of the arm beyond the first point that can touch the object must go round it `ENOUGH_TURNS` times, or
    `ENOUGH_LENGTHENED`, its own radius included.
    """
    enough = ENOUGH_TURNS if task.choose is None else ENOUGH_LENGTHENED
    items = {item.name: item for item in scene.objects}
    for phase in task.phases:
        for goal in phase.goals:
            if not isinstance(goal, CoveredWindingGoal) or goal.band[0] <= 0:
                continue
            item = items[goal.object]
            place, turns = most_turns(arm, item)
            if turns < enough:
                return (
                    f"were it straight up to '{item.name}', which it would meet at {1e3 * place:.0f} mm, the arm would go round it "
                    f"{turns:.2f} times at most, and {enough} are needed to hold it; give a thinner object, or one nearer to the base"
                )
    return ""


def most_turns(arm: Arm, item: RigidObject) -> tuple[float, float]:
    """The least arclength (m) at which an arm can touch an object, and turns for which the rest of it suffices.

    It touches with the least of its length if it goes straight from its base to where the object is nearest to that, as wherever the
    object is nearest to the arm at rest it need not be; each element then turns by its length over its distance from the axis.
    """
    from octoctrl.sim.contact.hold import girth
    from octoctrl.sim.contact.measures import gaps

    s = np.linspace(0.0, arm.length, 401)
    radius = np.asarray(arm.section(s).outer_radius)
    away = gaps(np.zeros((1, 1, 3)), item, np.array([item.position]), frame_of(item)[None])[0, 0]
    first = int(np.argmax(s + radius >= away)) if s[-1] + radius[-1] >= away else len(s) - 1
    middle = (radius[first + 1 :] + radius[first:-1]) / 2
    return float(s[first]), float(np.sum(np.diff(s[first:]) / (tau * (girth(item) + middle))))


def grasp_drives(task: Task, arm: Arm, scene: Scene) -> Task:
    """A task with the drives of a grasp, from which a search begins.

    Parameters
    ----------
    task : Task
        Whose first goal of covered winding names the object; it leaves its drives to the planner.
    arm : Arm
    scene : Scene

    Raises
    ------
    OctoctrlError
        If no goal is of covered winding.
    """
    place, _, azimuth = nearest(arm, grasped(task, scene))
    first = task.phases[0].name
    scale = arm.length / 0.2
    curl = Curl(azimuth=azimuth, level=LEVEL, profile=PROFILE, start=max(place - BEFORE * scale, 0.0), speed=SPEED * scale)
    twist = StoreTwist(stop=0.09 * scale)
    lean = Swing(azimuth=(azimuth + pi) % tau, level=LEAN, stop=0.04 * scale)
    drives = (
        Drive(name="curl", primitive=curl, begins=first, free=("azimuth", "level", "profile", "start", "speed", "delay"), delay=DELAY),
        Drive(name="twist", primitive=twist, begins=first, free=("turns", "stop")),
        Drive(name="swing", primitive=lean, begins=first, free=("azimuth", "level", "start", "stop")),
        Drive(name="lengthen", primitive=Elongate(level=LENGTHEN, rise=1.0), begins=first, free=("level",)),
    )
    return replace(task, drives=drives, choose=None)


def grasp_region(task: Task, arm: Arm, scene: Scene) -> dict[str, tuple[float, float]]:
    """Where to look round for grasps before a search: lowest and highest of each free number of `grasp_drives`, by its name.

    The curl goes towards the object, from a little before the nearest point to a little beyond it. Beside an object that stands along the
    arm a part near the base leans towards it and to the side from which the object's axis leans away, so that the arm comes to lie across
    it, and the twist has the hand of the helix that is left; elsewhere leans go to all sides.
    """
    place, _, azimuth = nearest(arm, grasped(task, scene))
    scale, side = arm.length / 0.2, slant(arm, grasped(task, scene))

    def about(centre: float, low: float, high: float) -> tuple[float, float]:
        """A range that is mirrored where the object leans to the other side."""
        return (centre + low, centre + high) if side >= 0 else (centre - high, centre - low)

    region = {
        "curl.azimuth": about(azimuth, -0.9, 0.6 if side else 0.9),
        "curl.level": (0.4, 0.75),
        "curl.profile": (0.4, 1.5),
        "curl.start": (
            max(place - 0.035 * scale, 0.0),
            min(max(place + 0.01 * scale, 0.06 * scale) if side else place + 0.04 * scale, 0.8 * arm.length),
        ),
        "curl.speed": (0.03 * scale, 0.07 * scale),
        "curl.delay": (0.3, 1.0),
        "twist.turns": about(0.0, -0.1, 0.4) if side else (-0.3, 0.3),
        "twist.stop": (0.08 * scale, 0.14 * scale),
    }
    if side:
        lean = {
            "azimuth": about(azimuth, 0.0, 2.0),
            "level": (0.1, 0.3),
            "start": (0.0, 0.04 * scale),
            "stop": (0.03 * scale, 0.09 * scale),
        }
    else:
        lean = {"azimuth": (azimuth - pi, azimuth + pi), "level": (0.0, 0.35)}
        lean |= {"start": (0.0, 0.03 * scale), "stop": (0.03 * scale, 0.08 * scale)}
    region["lengthen.level"] = (0.0, 0.3)
    return region | {f"swing.{name}": ends for name, ends in lean.items()}


def slant(arm: Arm, item: RigidObject) -> int:
    """To which side an object that stands along the arm leans: 1, or -1 for its mirror image, 0 if it stands across.

    Sides are those of somebody who looks along the arm at rest from its base, the object above.
    """
    if not isinstance(item, Capsule | Cylinder):
        return 0
    axis, azimuth = frame_of(item)[2], nearest(arm, item)[2]
    if abs(axis[1]) < ALONG:
        return 0
    aside = axis[0] * sin(azimuth) - axis[2] * cos(azimuth)
    return 1 if aside * axis[1] >= 0 else -1


def grasped(task: Task, scene: Scene) -> RigidObject:
    """The object of a task's first goal of covered winding.

    Raises
    ------
    OctoctrlError
        If no goal is of covered winding.
    """
    wanted = [goal for phase in task.phases for goal in phase.goals if isinstance(goal, CoveredWindingGoal)]
    if not wanted:
        raise OctoctrlError(f"task '{task.name}': drives can be chosen for a grasp only, by a goal of covered_winding; give drives")
    return next(item for item in scene.objects if item.name == wanted[0].object)


def touch_time(plan: Plan) -> float:
    """When a plan's arm first comes as near as `TOUCHES` to an object that it is to handle, s; infinite if it never does."""
    from octoctrl.sim.contact.measures import gaps

    held = objects_held(plan.task)
    radius = np.asarray(plan.arm.section(plan.arm.edges).outer_radius)
    if not plan.strains.size:
        return float("inf")
    points, near = plan.model.points(plan.strains), np.zeros(len(plan.time), dtype=bool)
    for item in plan.scene.objects:
        if item.name in held:
            place = np.tile(np.asarray(item.position, dtype=float), (len(points), 1))
            frame = np.tile(frame_of(item), (len(points), 1, 1))
            near |= (gaps(points, item, place, frame) - radius).min(axis=1) < TOUCHES
    return float(plan.time[near.argmax()]) if near.any() else float("inf")
