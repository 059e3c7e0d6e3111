"""Primitives that wind an arm round things: bends towards any azimuth, and twist in turns.

A bend towards an azimuth shares its level among the longitudinal muscles by the cosine of the angle between them. Twist is asked for in
turns, because levels belong to a plant and turns to a plan: a `TwistCurve`, measured on the plant, makes levels of them.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from math import cos, inf, tau
from typing import Any, ClassVar

import numpy as np

from octoctrl.sim.annotations import settle
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS
from octoctrl.sim.errors import OctoctrlError, check_number, check_numbers
from octoctrl.sim.templates import Plateau, Template, Wave

from ..contracts import Expression
from .primitives import RAMP_BOUNDS
from .registry import register_part, register_primitive
from .shares import Length, Share, unresolved

AZIMUTHS, LEVELS, SPEEDS, PROFILES = (-2 * tau, 2 * tau), (0.0, 0.8), (0.02, 0.35), (-0.5, 2.0)
"""Ranges in which a search may choose."""

LEAST_TURNS = 0.02
"""Turns below which no twist is asked for: what the weakest levels give would be more."""

TAPERS_OUT = Share(percent=1200 / 11)
"""Where an arm that is twelve times as thick at its base as at its tip would end, if it tapered to nothing."""


LEAST_WINDOW = 2e-3
"""Length of arm on which a primitive acts at least, m, where a search chooses both ends."""


NEARLY_ALL = Share(percent=98.35)
"""Up to where a curl goes: the last elements are too thin to be told anything."""


def window(start: Any, stop: Any) -> tuple[float, float]:
    """The part of an arm from `start` to `stop`, m, or a little of it before `stop` if they come too near each other."""
    return min(start, stop - LEAST_WINDOW), stop


def shared_level(azimuth: float, level: float) -> dict[str, float]:
    """Levels by longitudinal muscle that bend towards an `azimuth`, rad, from that of LM1 towards LM3, at most `level`."""
    count = len(LONGITUDINAL_GROUPS)
    shares = {name: level * cos(tau * index / count - azimuth) for index, name in enumerate(LONGITUDINAL_GROUPS)}
    return {name: share for name, share in shares.items() if share > 1e-9}


def _settle(primitive: Any) -> None:
    """Check the numbers of a primitive, one by one as they are given, and together as soon as the arm is known."""
    settle(primitive)
    for item in fields(primitive):
        value = getattr(primitive, item.name)
        endless = item.name in ("offset", "lasts", "apex") and isinstance(value, float) and value == inf
        if item.name != "curve" and not isinstance(value, Share) and not endless:
            check_number(item.name, value)
    if not unresolved(primitive):
        primitive.templates()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Bending:
    """Numbers of what bends towards an azimuth; a subclass shares its level among the muscles of that side in `templates`."""

    azimuth: float = 0.0
    level: float = 0.25

    def __post_init__(self) -> None:
        _settle(self)

    def templates(self) -> tuple[Template, ...]:
        """What each muscle of the side does."""
        raise NotImplementedError

    def effort(self, seconds: Expression) -> Expression:
        """Squared level times the `seconds` for which it is on."""
        return self.level**2 * seconds


@register_primitive
@dataclass(frozen=True, slots=True, kw_only=True)
class Curl(_Bending):
    """A bend that spreads from `start` towards the tip at a `speed` and stays, or is followed by a second front.

    Attributes
    ----------
    azimuth : float, rad
        Side towards which it bends.
    level : float
        At the start.
    profile : float
        Exponent by which the level follows the arm's radius; see `octoctrl.sim.templates.Wave`.
    start, stop : float, m
        Arclengths between which it acts.
    speed : float, m/s
    onset : float, s
    lasts : float, s
        How long after the first front a second one follows that takes the level away; never if infinite.
    offset : float, s
        When a second front leaves the start, in place of that.
    width : float, m
        Of the fronts.
    apex : float, m
        Arclength at which the arm would end if it tapered to nothing.
    since : float, s
        Until then it does nothing, though its front reaches ahead by the width.
    """

    spreads: ClassVar[dict[str, float]] = {"azimuth": 0.4, "level": 0.12, "profile": 0.35, "start": 0.015, "speed": 0.015}
    """How far a search looks at first, as one standard deviation of each number."""
    profile: float = 0.4
    start: Length = 0.0
    stop: Length = NEARLY_ALL
    speed: float = 0.08
    onset: float = 0.0
    lasts: float = inf
    offset: float = inf
    width: float = 3e-3
    apex: Length = TAPERS_OUT
    since: float = 0.0

    def templates(self) -> tuple[Template, ...]:
        """A wave on each muscle of the side."""
        numbers = {name: getattr(self, name) for name in ("speed", "width", "onset", "profile", "apex", "since")}
        ends = min(self.offset, self.onset + self.lasts)
        return tuple(
            Wave(groups=(name,), level=level, offset=ends, window=window(self.start, self.stop), **numbers)
            for name, level in shared_level(self.azimuth, self.level).items()
        )

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Ranges in which a search may choose; the arm is taken to be half a metre long at most."""
        ends = {"start": (0.0, 0.5), "stop": (0.01, 0.5)}
        return {"azimuth": AZIMUTHS, "level": LEVELS, "profile": PROFILES, "speed": SPEEDS, "lasts": (0.1, 2.0), **ends}

    def carried_out(self, curve: "TwistCurve", since: float) -> "Curl":
        """The same, idle until `since`, s; its level is one for all plants, whatever their `curve`."""
        return replace(self, since=max(self.since, since))


@register_primitive
@dataclass(frozen=True, slots=True, kw_only=True)
class Swing(_Bending):
    """A bend of the part between `start` and `stop` at once.

    Attributes
    ----------
    azimuth : float, rad
    level : float
    start, stop : float, m
    onset, rise, offset, fall : float, s
    """

    spreads: ClassVar[dict[str, float]] = {"azimuth": 1.2, "level": 0.06}
    level: float = 0.1
    start: Length = 0.0
    stop: Length = 0.04
    onset: float = 0.0
    rise: float = 0.5
    offset: float = inf
    fall: float = 0.5

    def templates(self) -> tuple[Template, ...]:
        """A plateau on each muscle of the side."""
        numbers = {name: getattr(self, name) for name in ("onset", "rise", "offset", "fall")}
        return tuple(
            Plateau(groups=(name,), level=level, window=window(self.start, self.stop), **numbers)
            for name, level in shared_level(self.azimuth, self.level).items()
        )

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Ranges in which a search may choose."""
        return {"azimuth": AZIMUTHS, "level": LEVELS, "start": (0.0, 0.5), "stop": (0.01, 0.5), "rise": RAMP_BOUNDS}


@register_part
@dataclass(frozen=True, slots=True, kw_only=True)
class TwistCurve:
    """What an oblique family's level stores, measured on a plant.

    Attributes
    ----------
    levels : tuple of float
        Ascending, the first 0.
    turns : tuple of float, turns/m
        Stored per length of the window, by either hand.
    """

    levels: tuple[float, ...]
    turns: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("levels", "turns"):
            count = len(self.levels) if isinstance(self.levels, tuple) else 2
            check_numbers(f"twist curve: {name}", getattr(self, name), max(count, 2), "(0, 0.1)")
        if (np.diff(self.levels) <= 0).any() or (np.diff(self.turns) <= 0).any():
            raise OctoctrlError(f"twist curve: levels {self.levels} and turns {self.turns} must both rise, two of each at least")

    def level(self, turns: float) -> float:
        """Level that stores so many `turns` per metre; the largest where none does."""
        return float(np.interp(abs(turns), self.turns, self.levels))

    def length(self, turns: float) -> float:
        """Least length of arm that stores so many `turns`, m."""
        return abs(turns) / self.turns[-1]


@register_primitive
@dataclass(frozen=True, slots=True, kw_only=True)
class StoreTwist:
    """Store twist in a part of the arm, in turns; positive is left-handed, L-OM.

    Attributes
    ----------
    turns : float, turns
    start, stop : float, m
        The part begins nearer to the base than it should where the plant's muscles cannot store so many turns in it.
    onset, rise, offset, fall : float, s
    curve : TwistCurve, optional
        Of the plant that it is carried out on; the planner fills it in.
    """

    spreads: ClassVar[dict[str, float]] = {"turns": 0.12}
    chosen_anew: ClassVar[str] = "turns"
    """What a search chose of it is chosen anew on the plant that the plan is for: round an object an arm stores other turns."""
    turns: float = 0.0
    start: Length = 0.0
    stop: Length = 0.09
    onset: float = 0.0
    rise: float = 0.5
    offset: float = inf
    fall: float = 0.5
    curve: TwistCurve | None = None

    def __post_init__(self) -> None:
        _settle(self)

    @property
    def level(self) -> float:
        """Level of the oblique family."""
        if abs(self.turns) < LEAST_TURNS:
            return 0.0
        if self.curve is None:
            raise OctoctrlError(
                "twist is asked for in turns, and what level gives them on this plant was not measured; plan the task again"
            )
        start, stop = self.part()
        return self.curve.level(self.turns / (stop - start))

    def part(self) -> tuple[float, float]:
        """Between which arclengths the twist is stored, m."""
        start, stop = window(float(self.start), float(self.stop))
        return start if self.curve is None else max(min(start, stop - self.curve.length(self.turns)), 0.0), stop

    def templates(self) -> tuple[Template, ...]:
        """A plateau on one hand."""
        level = self.level if self.curve is not None else 0.0
        numbers = {name: getattr(self, name) for name in ("onset", "rise", "offset", "fall")}
        return (Plateau(groups=("L-OM" if self.turns > 0 else "R-OM",), level=level, window=self.part(), **numbers),)

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Ranges in which a search may choose."""
        return {"turns": (-0.9, 0.9), "start": (0.0, 0.5), "stop": (0.01, 0.5), "rise": RAMP_BOUNDS}

    def carried_out(self, curve: TwistCurve, since: float) -> "StoreTwist":
        """The same for the plant of this `curve`; it is idle until its onset, which is not before `since`, s."""
        return replace(self, curve=curve)

    def effort(self, seconds: Expression) -> Expression:
        """Squared level times the `seconds` for which it is on."""
        return self.level**2 * seconds


def carried_out(primitive: Any, curve: TwistCurve, since: float = 0.0) -> Any:
    """A primitive as the plant of this `curve` carries it out, idle until `since`, s; as it is where it has no `carried_out` of its own."""
    own: Callable[[TwistCurve, float], Any] | None = getattr(primitive, "carried_out", None)
    return primitive if own is None else own(curve, since)
