"""A task: phases that end at topological events, and the primitives that may bring them about.

Time is written as phases with free durations. A drive is a primitive whose onset and offset are tied to the begin of phases, and whose
numbers the planner may choose; a goal is a value that a topological quantity has when its phase ends.
"""

from dataclasses import dataclass, field

from octoctrl.sim.errors import OctoctrlError, check_choice, check_number, suggest
from octoctrl.sim.topology.trace import TopologyConvention

from .schedule import PRIMITIVES, primitive

QUANTITIES = ("twist", "lifted_writhe", "lifted_link", "length")


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A value at the end of a phase: turns for twist, lifted writhe and lifted link; metres for length.

    Attributes
    ----------
    quantity : {"twist", "lifted_writhe", "lifted_link", "length"}
    value : float
    tolerance : float
        What still counts as reached, in planning and in the verdict.
    """

    quantity: str
    value: float
    tolerance: float = 0.05

    def __post_init__(self):
        check_choice("quantity", self.quantity, QUANTITIES)
        check_number(f"goal {self.quantity}", self.value)
        check_number("tolerance", self.tolerance, above=0.0)


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
    """

    name: str
    duration: float
    shortest: float = 0.3
    longest: float = 4.0
    goals: tuple[Goal, ...] = ()

    def __post_init__(self):
        check_number(f"phase '{self.name}': shortest", self.shortest, above=0.0, unit="s")
        check_number(f"phase '{self.name}': longest", self.longest, at_least=self.shortest, unit="s")
        check_number(f"phase '{self.name}': duration", self.duration, at_least=self.shortest, at_most=self.longest, unit="s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """A primitive tied to phases.

    Attributes
    ----------
    name : str
    primitive : str
        Name of the primitive, of `octoctrl.planners.asking.schedule.PRIMITIVES`.
    begins : str
        Phase with whose begin it sets in.
    ends : str
        Phase with whose begin it relaxes; empty for never.
    settings : dict
        Numbers and names of the primitive; the first guess of those that are free.
    free : tuple of str
        Numbers that the planner chooses, within the primitive's bounds.
    """

    name: str
    primitive: str
    begins: str
    ends: str = ""
    settings: dict = field(default_factory=dict)
    free: tuple[str, ...] = ("level",)

    def __post_init__(self):
        bounds = primitive(self.primitive, **self.settings).bounds()
        for number in self.free:
            if number not in bounds:
                known = ", ".join(bounds)
                raise OctoctrlError(f"drive '{self.name}': '{number}' cannot be free{suggest(number, bounds)} ({known})")
        for timing in ("onset", "offset"):
            if timing in self.settings:
                raise OctoctrlError(f"drive '{self.name}': {timing} follows from the phases; use begins and ends")

    def bounds(self):
        """Range of each free number."""
        bounds = primitive(self.primitive, **self.settings).bounds()
        return {number: bounds[number] for number in self.free}

    def at(self, begins, numbers):
        """The primitive for given phase begins (dict of name to time, s) and free numbers (dict)."""
        timing = {"onset": begins[self.begins]}
        if self.ends:
            timing["offset"] = begins[self.ends]
        return PRIMITIVES[self.primitive](**(self.settings | timing | numbers))


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What the arm should do.

    Attributes
    ----------
    name, description : str
    phases : tuple of Phase
    drives : tuple of Drive
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
    """

    name: str
    description: str = ""
    phases: tuple[Phase, ...]
    drives: tuple[Drive, ...]
    convention: TopologyConvention = field(default=TopologyConvention())
    sucker_azimuth: float = 0.0
    nominal_weight: float = 1.0
    time_weight: float = 0.1
    effort_weight: float = 0.3
    smoothness_weight: float = 0.1

    def __post_init__(self):
        names = [phase.name for phase in self.phases]
        if not names:
            raise OctoctrlError(f"task '{self.name}' has no phases; give at least one")
        if not self.drives:
            raise OctoctrlError(f"task '{self.name}': no primitives given; give at least one drive ({', '.join(PRIMITIVES)})")
        for drive in self.drives:
            for phase in (drive.begins, *((drive.ends,) if drive.ends else ())):
                if phase not in names:
                    raise OctoctrlError(f"drive '{drive.name}': unknown phase '{phase}'{suggest(phase, names)} ({', '.join(names)})")
        check_number("nominal_weight", self.nominal_weight, above=0.0)
        for name in ("time_weight", "effort_weight", "smoothness_weight"):
            check_number(name, getattr(self, name), at_least=0.0)
