"""A task: phases that end at topological events, and the primitives that may bring them about.

Time is written as phases with free durations. A drive is a primitive whose onset and offset are tied to the begin of phases, and whose
numbers the planner may choose; a goal says what has to hold at the end of its phase, or throughout.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
from math import isfinite
from typing import Any

import numpy as np

from octoctrl.sim.annotations import settle
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import OctoctrlError, brief, check_number, check_numbers, suggest
from octoctrl.sim.templates import Template
from octoctrl.sim.topology.trace import TopologyConvention

from ..contracts import Floats, Goal, Primitive, When
from .choice import Choice
from .goals.measured import MeasuredGoal
from .registry import primitive_kinds
from .schedule import check_primitive
from .shares import resolved, unresolved

BASE_TANGENT = (0.0, 1.0, 0.0)
"""Direction in which the arm leaves its base."""

DELAY_BOUNDS = 0.0, 2.0
"""Range of the time by which a drive may set in later than its phase begins, s."""

CHOOSE = "choose"
"""In the place of drives: the planner chooses them."""

_RANGES = '{"level": (0, 0.6)}'

LEAST_OPENING = 1e-3
"""Smallest 1 + pole . base tangent: opposite to each other, they leave the lifted writhe undefined from the start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """A stretch of time that ends when its goals are met.

    Attributes
    ----------
    name : str
    duration : float, s
        First guess.
    shortest, longest : float, s
    goals : tuple of Goal
    with_next : bool
        Whether a search by simulating looks for its numbers together with those of the next phase, and judges both by the goals of both:
        where what is done here shows its worth only there.

    Raises
    ------
    OctoctrlError
        If a time is out of range, or no shape could meet two of the goals at once.
    """

    name: str
    duration: float
    shortest: float = 0.3
    longest: float = 4.0
    goals: tuple[Goal, ...] = ()
    with_next: bool = False

    def __post_init__(self) -> None:
        _check_name("phase", self.name)
        object.__setattr__(self, "goals", _several(f"phase '{self.name}': goals", self.goals))
        check_number(f"phase '{self.name}': shortest", self.shortest, above=0.0, unit="s")
        check_number(f"phase '{self.name}': longest", self.longest, at_least=self.shortest, unit="s")
        check_number(f"phase '{self.name}': duration", self.duration, at_least=self.shortest, at_most=self.longest, unit="s")
        for goal in self.goals:
            missing = [name for name in ("quantity", "when", "tolerance", "unit", "miss", "residuals", "beyond") if not hasattr(goal, name)]
            if missing:
                raise OctoctrlError(f"phase '{self.name}': {goal!r} is no goal, it has no {' and no '.join(missing)}")
            if getattr(goal, "hold", 0.0) > self.longest:
                raise OctoctrlError(
                    f"phase '{self.name}' lasts {self.longest:g} s at most and is asked to hold {goal}; "
                    "hold it for less or allow a longer phase"
                )
        settle(self)
        for first, second in combinations(self.goals, 2):
            if isinstance(first, MeasuredGoal) and isinstance(second, MeasuredGoal) and first.excludes(second):
                raise OctoctrlError(f"phase '{self.name}' asks for {first} and for {second}; no shape has both, give one of them")


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """A primitive tied to phases.

    Attributes
    ----------
    name : str
    primitive : Primitive
        Its numbers are the first guess of those that are free; onset and offset follow from the phases.
    begins : str
        Phase with whose begin it sets in.
    delay : float, s
        How much later than that; `free` may name it.
    ends : str
        Phase with whose begin it relaxes; empty for never.
    free : tuple of str
        Numbers that the planner chooses, within the primitive's bounds.

    Raises
    ------
    OctoctrlError
        If a number cannot be free, is named twice, or lies outside its bounds.
    """

    name: str
    primitive: Primitive
    begins: str
    ends: str = ""
    free: tuple[str, ...] = ("level",)
    delay: float = 0.0

    def __post_init__(self) -> None:
        _check_name("drive", self.name)
        check_primitive(f"drive '{self.name}'", self.primitive)
        self._check_what_it_gives()
        object.__setattr__(self, "free", _several(f"drive '{self.name}': free", self.free))
        settle(self)
        check_number(f"drive '{self.name}': delay", self.delay, at_least=DELAY_BOUNDS[0], at_most=DELAY_BOUNDS[1], unit="s")
        bounds = self.primitive.bounds() | {"delay": DELAY_BOUNDS}
        for number in self.free:
            if number not in bounds:
                known = ", ".join(bounds)
                raise OctoctrlError(f"drive '{self.name}': '{number}' cannot be free{suggest(number, bounds)} ({known})")
            if self.free.count(number) > 1:
                raise OctoctrlError(f"drive '{self.name}': '{number}' is named twice in free; name it once")
            low, high = bounds[number]
            check_number(
                f"drive '{self.name}': {number}", self.number(number), at_least=low, at_most=high,
                advice="the planner chooses within these bounds; take it out of free to fix it",
            )  # fmt: skip
        for timing in ("onset", "offset"):
            if isfinite(getattr(self.primitive, timing, 0.0)) and getattr(self.primitive, timing, 0.0) != 0.0:
                raise OctoctrlError(f"drive '{self.name}': {timing} follows from the phases; use begins and ends")

    def _check_what_it_gives(self) -> None:
        owner = f"drive '{self.name}': {type(self.primitive).__name__}"
        bounds, templates = self.primitive.bounds(), () if unresolved(self.primitive) else self.primitive.templates()
        if not isinstance(bounds, Mapping):
            raise OctoctrlError(f"{owner} gives the bounds {brief(repr(bounds))}; ranges by name are needed, such as {_RANGES}")
        for name, ends in bounds.items():
            check_numbers(f"{owner}: range of {name}", ends, 2, "(0, 0.6)")
        if not isinstance(templates, tuple | list) or not all(isinstance(item, Template) for item in templates):
            raise OctoctrlError(f"{owner} gives the templates {brief(repr(templates))}; several of Plateau, Wave and Pulse are needed")

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Range of each free number."""
        bounds = self.primitive.bounds() | {"delay": DELAY_BOUNDS}
        return {number: bounds[number] for number in self.free}

    def number(self, name: str) -> float:
        """The first guess of a free number."""
        return float(self.delay if name == "delay" else getattr(self.primitive, name))

    def at(self, begins: Mapping[str, Any], numbers: Mapping[str, Any]) -> Primitive:
        """The primitive for given phase begins (dict of name to time, s) and free numbers (dict)."""
        given = dict(numbers)
        timing = {"onset": begins[self.begins] + given.pop("delay", self.delay)} | ({"offset": begins[self.ends]} if self.ends else {})
        made: Primitive = replace(self.primitive, **(timing | given))  # type: ignore[type-var]
        return made


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What the arm should do.

    Attributes
    ----------
    name, description : str
    phases : tuple of Phase
    drives : tuple of Drive
        Or the word "choose", which leaves them to the planner.
    choose : Choice, optional
        From what it may choose; its plan names the drives that it took.
    convention : TopologyConvention
        How writhe is measured: the pole is the axis of the coil that is expected.
    sucker_azimuth : float, rad
        Azimuth of the sucker line, for orientation.
    nominal_weight : float
        Price of leaving the task's own durations, levels and ramps; it makes the plan unique.
    time_weight : float, 1/s
        Price of a second.
    effort_weight : float, 1/s
        Price of a drive's squared level, per second that it is on.
    smoothness_weight : float, s
        Price of the squared rate of change of a level, per second of ramp.

    Raises
    ------
    OctoctrlError
        If names are doubled or unknown, a drive ends before it begins, or the pole is opposite to the arm's base.
    """

    name: str
    description: str = ""
    phases: tuple[Phase, ...]
    drives: tuple[Drive, ...] = ()
    choose: Choice | None = None
    convention: TopologyConvention = field(default=TopologyConvention())
    sucker_azimuth: float = 0.0
    nominal_weight: float = 1.0
    time_weight: float = 0.1
    effort_weight: float = 0.3
    smoothness_weight: float = 0.1

    def __post_init__(self) -> None:
        if isinstance(self.drives, str) and self.drives == CHOOSE:
            object.__setattr__(self, "drives", ())
            object.__setattr__(self, "choose", self.choose or Choice())
        for name in ("phases", "drives"):
            object.__setattr__(self, name, _several(f"task '{self.name}': {name}", getattr(self, name)))
        settle(self)
        names = [phase.name for phase in self.phases]
        if not names:
            raise OctoctrlError(f"task '{self.name}' has no phases; give at least one")
        if self.drives and self.choose is not None:
            raise OctoctrlError(f"task '{self.name}' has drives, and choose as well; give one of them")
        if not self.drives and self.choose is None:
            known = ", ".join(primitive_kinds())
            raise OctoctrlError(f"task '{self.name}': no primitives given; give at least one drive ({known}), or drives = \"{CHOOSE}\"")
        _check_doubled("phases", names)
        if self.phases[-1].with_next:
            raise OctoctrlError(f"phase '{names[-1]}' is the last and is to be searched with the next; leave its with_next out")
        _check_doubled("drives", [drive.name for drive in self.drives])
        for drive in self.drives:
            for phase in (drive.begins, *((drive.ends,) if drive.ends else ())):
                if phase not in names:
                    raise OctoctrlError(f"drive '{drive.name}': unknown phase '{phase}'{suggest(phase, names)} ({', '.join(names)})")
            if drive.ends and names.index(drive.ends) <= names.index(drive.begins):
                later = names[names.index(drive.begins) + 1 :]
                allowed = f"a later phase ({', '.join(later)}), or nothing" if later else "nothing, for it begins with the last phase"
                raise OctoctrlError(
                    f"drive '{drive.name}' begins with '{drive.begins}' and ends with '{drive.ends}'; ends must be {allowed}"
                )
        opening = 1 + float(np.dot(self.convention.pole, BASE_TANGENT))
        if opening < LEAST_OPENING:
            raise OctoctrlError(
                f"task '{self.name}': pole {self.convention.pole} is opposite to the arm's base {BASE_TANGENT}, where lifted writhe has "
                "no value; give the axis of the expected coil, for example (0, 0, 1)"
            )
        check_number("sucker_azimuth", self.sucker_azimuth, unit="rad")
        check_number("nominal_weight", self.nominal_weight, above=0.0)
        for name in ("time_weight", "effort_weight", "smoothness_weight"):
            check_number(name, getattr(self, name), at_least=0.0)

    def on(self, arm: Arm) -> "Task":
        """The task for an arm: shares of the arm become lengths, and every window must begin on it.

        Parameters
        ----------
        arm : Arm

        Returns
        -------
        Task

        Raises
        ------
        OctoctrlError
            If a window lies beyond the arm.
        """
        for drive in self.drives:
            try:
                resolved(drive, arm.length)
            except OctoctrlError as error:
                raise OctoctrlError(f"drive '{drive.name}' on an arm of {arm.length:g} m: {error}") from None
        task = resolved(self, arm.length)
        windows = [(f"drive '{drive.name}'", template.window) for drive in task.drives for template in drive.primitive.templates()]
        windows += [
            (f"phase '{phase.name}', {goal}", goal.window) for phase in task.phases for goal in phase.goals if hasattr(goal, "window")
        ]
        for owner, window in windows:
            if window[0] >= arm.length:
                raise OctoctrlError(
                    f"{owner}: the window begins at {window[0]:g} m, beyond the arm of {arm.length:g} m; give arclengths on the arm, "
                    "or shares of it such as '40 %'"
                )
        return task


def miss_in_phase(goal: Goal, time: Floats, misses: Floats, begin: float, end: float) -> float:
    """The largest miss of a goal while it has to hold.

    Parameters
    ----------
    goal : Goal
    time : (T,) float64, s
    misses : (T,) float64
        Of `Goal.miss`.
    begin, end : float, s
        Of its phase; in between, misses are interpolated linearly.

    Returns
    -------
    float
        In the goal's unit; within its `tolerance` if the goal is met.
    """
    first = begin if goal.when is When.THROUGHOUT else max(end - goal.hold, begin)
    inside = misses[(time > first) & (time < end)]
    return float(np.concatenate([np.interp([first, end], time, misses), inside]).max())


def _several(what: str, items: object) -> tuple[Any, ...]:
    """A list or tuple as a tuple, so that tasks can be compared and hashed."""
    if not isinstance(items, list | tuple):
        raise OctoctrlError(f"{what} is {items!r}; several are needed, in brackets: ({items!r},) for one")
    return tuple(items)


def _check_name(what: str, name: object) -> None:
    if not isinstance(name, str) or not name:
        raise OctoctrlError(f"a {what} is called {name!r}; a name is needed")


def _check_doubled(what: str, names: list[str]) -> None:
    doubled = [name for index, name in enumerate(names) if name in names[:index]]
    if doubled:
        raise OctoctrlError(f"two {what} are called '{doubled[0]}'; give each a name of its own ({', '.join(names)})")
