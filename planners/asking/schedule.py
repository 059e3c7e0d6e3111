"""Primitives and their composition: what the planner schedules.

A primitive is a named motion with a few numbers. It turns into activation templates for the plant and, through the same formulas, into
inputs of the reduced model. Users add their own by writing a frozen dataclass with two methods, `templates()` and `bounds()`.
"""

from dataclasses import dataclass, fields
from math import inf
from typing import Protocol, runtime_checkable

from octoctrl.sim.activation import Activation, Plateau, Template, Wave
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS
from octoctrl.sim.errors import OctoctrlError, check_choice, suggest

SIDES = {"LM1": ("LM1", "LM2", "LM8"), "LM3": ("LM2", "LM3", "LM4"), "LM5": ("LM4", "LM5", "LM6"), "LM7": ("LM6", "LM7", "LM8")}
"""The three longitudinal muscles that bend the arm towards the side of the middle one."""


LEVEL_BOUNDS, RAMP_BOUNDS, SPEED_BOUNDS = (0.02, 0.75), (0.1, 4.0), (0.01, 0.4)
"""Range in which the planner may choose a level, the duration of a ramp (s) and the speed of a front (m/s)."""


@runtime_checkable
class Primitive(Protocol):
    """What the planner and the plant ask of a primitive."""

    def templates(self) -> tuple[Template, ...]:
        """Activation templates; fields may be CasADi expressions."""
        ...

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Allowed range of each number that the planner may choose."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class _Ramped:
    """Numbers of every primitive that switches muscles on and off with ramps; a subclass names the muscles in `groups`."""

    level: float = 0.3
    onset: float = 0.0
    rise: float = 0.5
    offset: float = inf
    fall: float = 0.5
    window: tuple[float, float] = (0.0, inf)

    def __post_init__(self):
        self.templates()

    @property
    def groups(self):
        """Muscle groups that it contracts."""
        raise NotImplementedError

    def templates(self):
        """One plateau on the muscles."""
        numbers = {name: getattr(self, name) for name in ("level", "onset", "rise", "offset", "fall", "window")}
        return (Plateau(groups=self.groups, **numbers),)

    def bounds(self):
        """Levels keep a quarter of the activation as headroom for feedback."""
        return {"level": LEVEL_BOUNDS, "rise": RAMP_BOUNDS, "fall": RAMP_BOUNDS}


@dataclass(frozen=True, slots=True, kw_only=True)
class Twist(_Ramped):
    """Contract one oblique family: stores twist, R-OM negative and L-OM positive."""

    hand: str

    @property
    def groups(self):
        """The family."""
        check_choice("hand", self.hand, ("R-OM", "L-OM"))
        return (self.hand,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bend(_Ramped):
    """Contract three neighbouring longitudinal muscles along a window at once: curls towards their side."""

    side: str = "LM1"
    rise: float = 1.0
    fall: float = 1.0

    @property
    def groups(self):
        """The three muscles of the side."""
        check_choice("side", self.side, tuple(SIDES))
        return SIDES[self.side]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shorten(_Ramped):
    """Contract all longitudinal muscles along a window."""

    level: float = 0.2

    @property
    def groups(self):
        """All eight muscles."""
        return LONGITUDINAL_GROUPS


@dataclass(frozen=True, slots=True, kw_only=True)
class Elongate(_Ramped):
    """Contract the transverse muscle along a window: the section narrows and the arm lengthens."""

    level: float = 0.2

    @property
    def groups(self):
        """The transverse muscle."""
        return ("TM",)


@dataclass(frozen=True, slots=True, kw_only=True)
class BendWave:
    """Send a bend along the arm: a front on three neighbouring longitudinal muscles, followed by a second front that relaxes them."""

    side: str = "LM1"
    level: float = 0.3
    speed: float = 0.1
    width: float = 2e-3
    onset: float = 0.0
    offset: float = inf
    end_level: float = 0.0
    window: tuple[float, float] = (0.0, inf)

    def __post_init__(self):
        self.templates()

    def templates(self):
        """One wave on the three muscles of the side."""
        check_choice("side", self.side, tuple(SIDES))
        names = ("level", "speed", "width", "onset", "offset", "end_level", "window")
        return (Wave(groups=SIDES[self.side], **{name: getattr(self, name) for name in names}),)

    def bounds(self):
        """Levels keep a quarter of the activation as headroom for feedback."""
        return {"level": LEVEL_BOUNDS, "speed": SPEED_BOUNDS}


PRIMITIVES = {kind.__name__: kind for kind in (Bend, BendWave, Elongate, Shorten, Twist)}
"""The primitives that can be named in a task file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """An ordered composition of primitives.

    Attributes
    ----------
    primitives : tuple of Primitive
    duration : float, s
    composition : {"override", "max", "add"}
        How activations that meet in one place combine; see `octoctrl.sim.activation.Activation`.
    """

    primitives: tuple[Primitive, ...]
    duration: float
    composition: str = "override"

    def __post_init__(self):
        if not self.primitives:
            raise OctoctrlError(
                f"no primitives given; pass at least one or leave it out for the task's default ({', '.join(sorted(PRIMITIVES))})"
            )

    def activation(self):
        """The activation of the whole schedule."""
        templates = tuple(template for primitive in self.primitives for template in primitive.templates())
        return Activation(templates=templates, composition=self.composition)


def primitive(kind, **numbers):
    """Make a primitive by name.

    Raises
    ------
    OctoctrlError
        If the name or a keyword is unknown; the message suggests the nearest.
    """
    if kind not in PRIMITIVES:
        raise OctoctrlError(f"unknown primitive '{kind}'{suggest(kind, PRIMITIVES)} ({', '.join(PRIMITIVES)})")
    known = [item.name for item in fields(PRIMITIVES[kind])]
    for key in numbers:
        if key not in known:
            raise OctoctrlError(f"{kind} has no '{key}'{suggest(key, known)} ({', '.join(known)})")
    return PRIMITIVES[kind](**numbers)
