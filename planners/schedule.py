"""Primitives and their composition: what the planner schedules.

A primitive is a named motion with a few numbers. It turns into activation templates for the plant and, through the same formulas, into
inputs of the reduced model. Users add their own by writing a frozen dataclass with two methods, `templates()` and `bounds()`.
"""

from dataclasses import dataclass, fields
from math import inf
from typing import ClassVar, Protocol, runtime_checkable

from octoctrl.sim.activation import Activation, Plateau, Template, Wave
from octoctrl.sim.arm import LONGITUDINAL_GROUPS
from octoctrl.sim.errors import OctoctrlError, check_choice, suggest

SIDES = {"LM1": ("LM1", "LM2", "LM8"), "LM3": ("LM2", "LM3", "LM4"), "LM5": ("LM4", "LM5", "LM6"), "LM7": ("LM6", "LM7", "LM8")}
"""The three longitudinal muscles that bend the arm towards the side of the middle one."""


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
class Twist:
    """Contract one oblique family: stores twist, R-OM negative and L-OM positive."""

    hand: str
    level: float = 0.3
    onset: float = 0.0
    rise: float = 0.5
    offset: float = inf
    fall: float = 0.5
    window: tuple[float, float] = (0.0, inf)

    def __post_init__(self):
        check_choice("hand", self.hand, ("R-OM", "L-OM"))
        self.templates()

    def templates(self):
        """One plateau on the family."""
        return (_plateau(self, (self.hand,)),)

    def bounds(self):
        """Levels keep a quarter of the activation as headroom for feedback."""
        return dict(_PLATEAU_BOUNDS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bend:
    """Contract three neighbouring longitudinal muscles along a window at once: curls towards their side."""

    side: str = "LM1"
    level: float = 0.3
    onset: float = 0.0
    rise: float = 1.0
    offset: float = inf
    fall: float = 1.0
    window: tuple[float, float] = (0.0, inf)

    def __post_init__(self):
        check_choice("side", self.side, tuple(SIDES))
        self.templates()

    def templates(self):
        """One plateau on the three muscles."""
        return (_plateau(self, SIDES[self.side]),)

    def bounds(self):
        """Levels keep a quarter of the activation as headroom for feedback."""
        return dict(_PLATEAU_BOUNDS)


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
        check_choice("side", self.side, tuple(SIDES))
        self.templates()

    def templates(self):
        """One wave on the three muscles."""
        return (_wave(self, SIDES[self.side]),)

    def bounds(self):
        """Levels keep a quarter of the activation as headroom for feedback."""
        return dict(_WAVE_BOUNDS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shorten:
    """Contract all longitudinal muscles along a window."""

    level: float = 0.2
    onset: float = 0.0
    rise: float = 0.5
    offset: float = inf
    fall: float = 0.5
    window: tuple[float, float] = (0.0, inf)

    def __post_init__(self):
        self.templates()

    def templates(self):
        """One plateau on the eight muscles."""
        return (_plateau(self, LONGITUDINAL_GROUPS),)

    def bounds(self):
        """Levels keep a quarter of the activation as headroom for feedback."""
        return dict(_PLATEAU_BOUNDS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Elongate:
    """Contract the transverse muscle along a window: the section narrows and the arm lengthens."""

    level: float = 0.2
    onset: float = 0.0
    rise: float = 0.5
    offset: float = inf
    fall: float = 0.5
    window: tuple[float, float] = (0.0, inf)

    def __post_init__(self):
        self.templates()

    def templates(self):
        """One plateau on the transverse muscle."""
        return (_plateau(self, ("TM",)),)

    def bounds(self):
        """Levels keep a quarter of the activation as headroom for feedback."""
        return dict(_PLATEAU_BOUNDS)


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

    KNOWN: ClassVar[dict] = PRIMITIVES

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


_PLATEAU_BOUNDS = {"level": (0.02, 0.75), "rise": (0.1, 4.0), "fall": (0.1, 4.0)}
_WAVE_BOUNDS = {"level": (0.02, 0.75), "speed": (0.01, 0.4)}


def _plateau(primitive, groups):
    return Plateau(
        groups=groups,
        level=primitive.level,
        onset=primitive.onset,
        rise=primitive.rise,
        offset=primitive.offset,
        fall=primitive.fall,
        window=primitive.window,
    )


def _wave(primitive, groups):
    return Wave(
        groups=groups,
        level=primitive.level,
        speed=primitive.speed,
        width=primitive.width,
        onset=primitive.onset,
        offset=primitive.offset,
        end_level=primitive.end_level,
        window=primitive.window,
    )
