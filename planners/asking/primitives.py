"""Primitives: named motions with a few numbers, which the planner schedules.

A primitive turns into activation templates for the plant and, through the same formulas, into inputs of the reduced model. Users add
their own by writing a frozen dataclass with the methods of `octoctrl.planners.contracts.Primitive` and registering it.
"""

from dataclasses import dataclass, fields, replace
from math import inf
from typing import Any, ClassVar

from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS
from octoctrl.sim.errors import check_choice
from octoctrl.sim.templates import Plateau, Pulse, Template, Wave

from ..contracts import Expression
from .registry import register_primitive
from .shares import Length, Share, unresolved


def neighbours(side: str) -> tuple[str, ...]:
    """The longitudinal muscle `side` and the two beside it, in the order of `LONGITUDINAL_GROUPS`: together they bend towards it."""
    check_choice("side", side, LONGITUDINAL_GROUPS)
    index, count = LONGITUDINAL_GROUPS.index(side), len(LONGITUDINAL_GROUPS)
    return tuple(LONGITUDINAL_GROUPS[other] for other in sorted((index + shift) % count for shift in (-1, 0, 1)))


LEVEL_BOUNDS, RAMP_BOUNDS, SPEED_BOUNDS = (0.0, 0.75), (0.1, 4.0), (0.01, 0.5)
"""Range in which the planner may choose a level, the duration of a ramp (s) and the speed of a front (m/s)."""


def _settle(primitive: "_Ramped | _Fronts | CarriedBend") -> None:
    """Check the numbers; those that are shares of the arm, as soon as it is known. A window may come as a list and is kept as a tuple."""
    if isinstance(primitive.window, list):
        object.__setattr__(primitive, "window", tuple(primitive.window))
    if unresolved(primitive):
        numbers: dict[str, Any] = {item.name: 0.01 for item in fields(primitive) if isinstance(getattr(primitive, item.name), Share)}
        replace(primitive, **(numbers | {"window": (0.0, 1.0)}))
    else:
        primitive.templates()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Ramped:
    """Numbers of every primitive that switches muscles on and off with ramps; a subclass names the muscles in `groups`."""

    level: float = 0.3
    onset: float = 0.0
    rise: float = 0.5
    offset: float = inf
    fall: float = 0.5
    window: tuple[Length, Length] = (0.0, inf)

    def __post_init__(self) -> None:
        _settle(self)

    @property
    def groups(self) -> tuple[str, ...]:
        """Muscle groups that it contracts."""
        raise NotImplementedError

    def templates(self) -> tuple[Template, ...]:
        """One plateau on the muscles."""
        numbers = {name: getattr(self, name) for name in ("level", "onset", "rise", "offset", "fall", "window")}
        return (Plateau(groups=self.groups, **numbers),)

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Levels keep a quarter of the activation as headroom for feedback."""
        return {"level": LEVEL_BOUNDS, "rise": RAMP_BOUNDS, "fall": RAMP_BOUNDS}

    def effort(self, seconds: Expression) -> Expression:
        """Squared level times the `seconds` for which it is on."""
        return self.level**2 * seconds


@register_primitive
@dataclass(frozen=True, slots=True, kw_only=True)
class Twist(_Ramped):
    """Contract one oblique family: stores twist, R-OM negative and L-OM positive."""

    hand: str

    @property
    def groups(self) -> tuple[str, ...]:
        """The family."""
        check_choice("hand", self.hand, ("R-OM", "L-OM"))
        return (self.hand,)


@register_primitive
@dataclass(frozen=True, slots=True, kw_only=True)
class Bend(_Ramped):
    """Contract three neighbouring longitudinal muscles along a window at once: curls towards the side of the middle one."""

    side: str = "LM1"
    rise: float = 1.0
    fall: float = 1.0

    @property
    def groups(self) -> tuple[str, ...]:
        """The three muscles of the side."""
        return neighbours(self.side)


@register_primitive
@dataclass(frozen=True, slots=True, kw_only=True)
class Shorten(_Ramped):
    """Contract all longitudinal muscles along a window."""

    chosen_anew: ClassVar[str] = "level"
    """What a search chose of it is chosen anew on the plant that the plan is for: another plant shortens otherwise."""
    level: float = 0.2

    @property
    def groups(self) -> tuple[str, ...]:
        """All eight muscles."""
        return LONGITUDINAL_GROUPS


@register_primitive
@dataclass(frozen=True, slots=True, kw_only=True)
class Elongate(_Ramped):
    """Contract the transverse muscle along a window: the section narrows and the arm lengthens."""

    level: float = 0.2

    @property
    def groups(self) -> tuple[str, ...]:
        """The transverse muscle."""
        return ("TM",)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fronts:
    """Numbers of every primitive that sends a front along the arm, which a second one follows; a subclass names the muscles in `groups`."""

    level: float = 0.3
    speed: float = 0.1
    width: float = 2e-3
    onset: float = 0.0
    offset: float = inf
    end_level: float = 0.0
    window: tuple[Length, Length] = (0.0, inf)

    def __post_init__(self) -> None:
        _settle(self)

    @property
    def groups(self) -> tuple[str, ...]:
        """Muscle groups that it contracts."""
        raise NotImplementedError

    def templates(self) -> tuple[Template, ...]:
        """One wave on the muscles."""
        names = ("level", "speed", "width", "onset", "offset", "end_level", "window")
        return (Wave(groups=self.groups, **{name: getattr(self, name) for name in names}),)

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Levels keep a quarter of the activation as headroom for feedback."""
        return {"level": LEVEL_BOUNDS, "speed": SPEED_BOUNDS}

    def effort(self, seconds: Expression) -> Expression:
        """Squared level times the `seconds` for which it is on."""
        return self.level**2 * seconds


@register_primitive
@dataclass(frozen=True, slots=True, kw_only=True)
class BendWave(_Fronts):
    """Send a bend along the arm: a front on three neighbouring longitudinal muscles, followed by a second front that relaxes them."""

    side: str = "LM1"

    @property
    def groups(self) -> tuple[str, ...]:
        """The three muscles of the side."""
        return neighbours(self.side)


@register_primitive
@dataclass(frozen=True, slots=True, kw_only=True)
class TwistWave(_Fronts):
    """Send twist along the arm: a front on one oblique family, followed by a second front that relaxes it."""

    hand: str

    @property
    def groups(self) -> tuple[str, ...]:
        """The family."""
        check_choice("hand", self.hand, ("R-OM", "L-OM"))
        return (self.hand,)


@register_primitive
@dataclass(frozen=True, slots=True, kw_only=True)
class CarriedBend:
    """Bend a stretch near the window's begin, hold it, and carry the bend to the window's end: reaching.

    Three neighbouring longitudinal muscles are active along `stretch`, which sets out when the drive ends and travels as fast as `speed` in
    the middle of its way, gently at both ends; the share `shrinks_to` of it arrives.
    """

    side: str = "LM1"
    level: float = 0.2
    stretch: Length = 0.04
    speed: float = 0.3
    width: float = 5e-3
    onset: float = 0.0
    rise: float = 0.6
    offset: float = inf
    window: tuple[Length, Length] = (0.02, 0.2)
    shrinks_to: float = 1.0

    def __post_init__(self) -> None:
        _settle(self)

    def templates(self) -> tuple[Template, ...]:
        """One pulse on the three muscles."""
        names = ("level", "stretch", "speed", "width", "onset", "rise", "offset", "window", "shrinks_to")
        return (Pulse(groups=neighbours(self.side), **{name: getattr(self, name) for name in names}),)

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Levels keep a quarter of the activation as headroom for feedback."""
        return {"level": LEVEL_BOUNDS, "speed": SPEED_BOUNDS, "rise": RAMP_BOUNDS}

    def effort(self, seconds: Expression) -> Expression:
        """Squared level times the `seconds` for which it is on."""
        return self.level**2 * seconds
