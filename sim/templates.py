"""Templates of activation a(t, s) in [0, 1], in seconds and metres of arclength: windows with ramps, travelling fronts, a travelling bend.

A template gives *cell averages*: the mean of its value over each cell of a partition of the arm. So a window's edge or a front that
falls inside a cell acts with exactly the share of the cell that it covers, and the plant (some 60 cells) and the reduced model (8 cells)
see the same activation. The formulas take the module they calculate with (`numpy`, or `casadi` when the planner differentiates them).
"""

from dataclasses import dataclass, fields
from math import inf
from typing import Any, ClassVar

import numpy as np

from .annotations import settle
from .body.layout import OCTOPUS_MUSCLES
from .errors import OctoctrlError, check_number, check_window

WRITE_THRESHOLD = 2e-3
"""Values of a wave below this are not written when templates override each other (Tekinalp et al. 2024, released programmes)."""
STEEPEST = 3.0
"""To so many times its size a wave's level may grow along the arm."""
PEAK = 15 / 8
"""Greatest speed on a way of least jerk, over the mean."""
SAME_INSTANT = 1e-9
"""Times that differ by no more are the same, s: a sum of intervals is never quite what it should be."""
OUT_OF_SIGHT = 3.0
"""Widths before a place from which a front covers nothing of what lies beyond it."""


def raised_cosine(math: Any, time: Any, onset: Any, duration: Any) -> Any:
    """Smooth step from 0 to 1 between `onset` and `onset + duration`."""
    progress = math.fmin(math.fmax((time - onset) / duration, 0.0), 1.0)
    return 0.5 * (1 - math.cos(np.pi * progress))


def plateau(math: Any, time: Any, onset: Any, rise: Any, offset: Any, fall: Any) -> Any:
    """Raised-cosine rise from `onset`, 1 in between, raised-cosine fall from `offset`."""
    up = raised_cosine(math, time, onset, rise)
    return up if _never(offset) else up * (1 - raised_cosine(math, time, offset, fall))


def least_jerk(math: Any, time: Any, onset: Any, duration: Any) -> Any:
    """Way from 0 to 1 between `onset` and `onset + duration` with the least jerk; the greatest speed is `PEAK` times the mean."""
    progress = math.fmin(math.fmax((time - onset) / duration, 0.0), 1.0)
    return progress**3 * (10 - 15 * progress + 6 * progress**2)


def front_coverage(math: Any, position: Any, width: Any, lower: Any, upper: Any) -> Any:
    """Mean over the cell [lower, upper] of the front (1 + tanh((position - s) / width)) / 2."""
    behind = _log_cosh(math, (position - lower) / width) - _log_cosh(math, (position - upper) / width)
    return 0.5 + 0.5 * width * behind / (upper - lower)


def window_coverage(lower: Any, upper: Any, window: tuple[float, float]) -> Any:
    """Share of each cell [lower, upper] that lies inside `window`."""
    inside = np.minimum(upper, window[1]) - np.maximum(lower, window[0])
    return np.maximum(inside, 0.0) / (upper - lower)


def _log_cosh(math: Any, x: Any) -> Any:
    size = math.fabs(x)
    return size + math.log1p(math.exp(-2 * size)) - np.log(2.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plateau:
    """A window of the arm switched on and off with raised-cosine ramps.

    Attributes
    ----------
    groups : tuple of str
        Names of muscle groups.
    level : float
        Activation on the plateau.
    onset, offset : float, s
        Begin of the rise and of the fall.
    rise, fall : float, s
        Durations of the ramps.
    window : (float, float), m
        Arclengths between which it acts.
    """

    travels: ClassVar[bool] = False
    """Whether its place moves."""
    groups: tuple[str, ...]
    level: float
    onset: float = 0.0
    rise: float = 0.5
    offset: float = inf
    fall: float = 0.5
    window: tuple[float, float] = (0.0, inf)

    def __post_init__(self) -> None:
        _check_template(self)
        if _is_number(self.rise):
            check_number("rise", self.rise, above=0.0, unit="s")
        if _is_number(self.fall):
            check_number("fall", self.fall, above=0.0, unit="s")

    def shape(self, math: Any, time: Any, lower: Any, upper: Any) -> Any:
        """Mean over the cells [lower, upper] at `time` (arrays that broadcast) of what its level is to be multiplied by."""
        return plateau(math, time, self.onset, self.rise, self.offset, self.fall)

    def values(self, math: Any, time: Any, lower: Any, upper: Any, shape: Any = None) -> Any:
        """Mean activation of the cells [lower, upper] at `time`; its `shape`, where that is known already."""
        return self.level * (self.shape(math, time, lower, upper) if shape is None else shape)

    def weight(self, math: Any, time: Any, lower: Any, upper: Any, shape: Any = None) -> Any:
        """How much of what lies beneath it takes over when activations are handed over, from 0 to 1."""
        return self.shape(math, time, lower, upper) if shape is None else shape

    def coverage(self, lower: Any, upper: Any) -> Any:
        """Share of each cell in which the template acts."""
        return window_coverage(lower, upper, self.window)

    @property
    def whereabouts(self) -> object:
        """What decides `place`: templates that agree in it act in one place."""
        return self.window

    def place(self, math: Any, time: Any, lower: Any, upper: Any) -> Any:
        """Share of each cell in which a change of the level acts at `time`: the window, also before the rise and after the fall."""
        return self.coverage(lower, upper)

    def wrote(self, math: Any, value: Any) -> Any:
        """Where the template overrides what was composed before it."""
        return value > 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Wave:
    """A front that travels from the window's begin towards the tip, and a second one that follows it.

    Attributes
    ----------
    groups : tuple of str
        Names of muscle groups.
    level : float
        Activation behind the first front.
    speed : float, m/s
    width : float, m
        The front rises as (1 + tanh(distance / width)) / 2.
    onset, offset : float, s
        When the first and the second front leave the window's begin.
    end_level : float
        Activation behind the second front.
    window : (float, float), m
    profile : float
        Exponent by which the level follows the radius of a tapering arm from the window's begin on: 0 leaves it the same all along, whose
        curvature grows as the radius shrinks, 1 evens the curvature; negative ones let it grow, to three times its size at most.
    apex : float, m
        Arclength at which the arm would end if it tapered to nothing.
    since : float, s
        Until then it does nothing: a front reaches ahead by its width.
    """

    travels: ClassVar[bool] = True
    groups: tuple[str, ...]
    level: float
    speed: float
    width: float
    onset: float = 0.0
    offset: float = inf
    end_level: float = 0.0
    window: tuple[float, float] = (0.0, inf)
    profile: float = 0.0
    apex: float = inf
    since: float = 0.0

    def __post_init__(self) -> None:
        _check_template(self)
        if _is_number(self.speed):
            check_number("speed", self.speed, above=0.0, unit="m/s")
        if _is_number(self.width):
            check_number("width", self.width, above=0.0, unit="m")
        if _is_number(self.end_level):
            check_number("end_level", self.end_level, at_least=0.0, at_most=1.0)
        if _is_number(self.profile):
            check_number("profile", self.profile, at_least=-2.0, at_most=4.0)
        if _is_number(self.apex) and not _never(self.apex):
            check_number("apex", self.apex, above=self.window[0], unit="m", advice="inf is an arm that does not taper")

    def shape(self, math: Any, time: Any, lower: Any, upper: Any) -> Any:
        """Mean over the cells [lower, upper] at `time` (arrays that broadcast) of its two fronts, 0 for a second one that never comes."""
        start = self.window[0]
        first = front_coverage(math, start + self.speed * (time - self.onset), self.width, lower, upper)
        begun = time > self.since + SAME_INSTANT if self.since else 1.0
        if _never(self.offset):
            return begun * first, 0.0
        return begun * first, begun * front_coverage(math, start + self.speed * (time - self.offset), self.width, lower, upper)

    def values(self, math: Any, time: Any, lower: Any, upper: Any, shape: Any = None) -> Any:
        """Mean activation of the cells [lower, upper] at `time`; its `shape`, where that is known already."""
        first, second = self.shape(math, time, lower, upper) if shape is None else shape
        value = self.level * first
        if not _never(self.offset):
            value = value - (self.level - self.end_level) * second
        return value if _never(self.apex) else value * self._slope(math, lower, upper)

    def _slope(self, math: Any, lower: Any, upper: Any) -> Any:
        """The level in the middle of each cell over that at the window's begin."""
        radius = (self.apex - (lower + upper) / 2) / (self.apex - self.window[0])
        return math.fmin(math.fmax(radius, 1e-9) ** self.profile, STEEPEST)

    def weight(self, math: Any, time: Any, lower: Any, upper: Any, shape: Any = None) -> Any:
        """How much of what lies beneath it takes over when activations are handed over, from 0 to 1.

        A second front that relaxes the muscles gives back what lies beneath; one that leaves a level holds on to it.
        """
        first, second = self.shape(math, time, lower, upper) if shape is None else shape
        return first if _never(self.offset) or not _relaxes(self.end_level) else first - second

    def coverage(self, lower: Any, upper: Any) -> Any:
        """Share of each cell in which the template acts."""
        return window_coverage(lower, upper, self.window)

    @property
    def whereabouts(self) -> object:
        """What decides `place`: templates that agree in it act in one place."""
        return self.window, self.speed, self.width, self.onset, self.offset, self.end_level, self.profile, self.apex

    def place(self, math: Any, time: Any, lower: Any, upper: Any) -> Any:
        """Share of each cell in which a change of the level acts at `time`: what the fronts enclose then."""
        return self.coverage(lower, upper) * self.weight(math, time, lower, upper)

    def wrote(self, math: Any, value: Any) -> Any:
        """Where the template overrides what was composed before it."""
        return value > WRITE_THRESHOLD


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulse:
    """A stretch of the arm that is switched on, stands, and then travels to the window's end.

    It sets out and arrives gently, as the bend of a reaching octopus does: its way over time has the least jerk, and its speed is a bell.

    Attributes
    ----------
    groups : tuple of str
        Names of muscle groups.
    level : float
        Activation on the stretch.
    stretch : float, m
        How long it is where it stands; three widths longer as it travels, for its rear comes from before the window.
    speed : float, m/s
        The greatest, of its middle, halfway.
    width : float, m
        Either end rises as (1 + tanh(distance / width)) / 2.
    onset : float, s
        Begin of the rise.
    rise : float, s
    offset : float, s
        When it sets out.
    window : (float, float), m
        Where its rear stands, and where it arrives.
    shrinks_to : float
        Share of the stretch that arrives. A bend of one level turns a tapering arm by one angle all along if it shortens as the radius.

    References
    ----------
    Gutfreund et al. 1996, J. Neurosci. 16:7297 (speed of the bend); Flash and Hogan 1985, J. Neurosci. 5:1688 (least jerk).
    """

    travels: ClassVar[bool] = True
    groups: tuple[str, ...]
    level: float
    stretch: float
    speed: float
    width: float
    window: tuple[float, float]
    onset: float = 0.0
    rise: float = 0.5
    offset: float = inf
    shrinks_to: float = 1.0

    def __post_init__(self) -> None:
        _check_template(self)
        if self.window[1] == inf:
            raise OctoctrlError(f"Pulse: window {tuple(self.window)} m has no end; give the arclength at which the stretch arrives")
        for name, unit in (("stretch", "m"), ("speed", "m/s"), ("width", "m"), ("rise", "s"), ("shrinks_to", "")):
            if _is_number(getattr(self, name)):
                check_number(name, getattr(self, name), above=0.0, unit=unit)

    def shape(self, math: Any, time: Any, lower: Any, upper: Any) -> Any:
        """Mean over the cells [lower, upper] at `time` (arrays that broadcast) of what its level is to be multiplied by."""
        return raised_cosine(math, time, self.onset, self.rise) * self._stretch(math, time, lower, upper)

    def values(self, math: Any, time: Any, lower: Any, upper: Any, shape: Any = None) -> Any:
        """Mean activation of the cells [lower, upper] at `time`; its `shape`, where that is known already."""
        return self.level * (self.shape(math, time, lower, upper) if shape is None else shape)

    def weight(self, math: Any, time: Any, lower: Any, upper: Any, shape: Any = None) -> Any:
        """How much of what lies beneath it takes over when activations are handed over, from 0 to 1."""
        return self.shape(math, time, lower, upper) if shape is None else shape

    def _stretch(self, math: Any, time: Any, lower: Any, upper: Any) -> Any:
        """Share of each cell between the two ends; the rear one comes from just before the window, where it does not show."""
        before = OUT_OF_SIGHT * self.width
        way = self.window[1] - self.window[0] + before
        shorter = (1 - self.shrinks_to) * self.stretch
        gone = 0.0 if _never(self.offset) else least_jerk(math, time, self.offset, PEAK * (way - shorter / 2) / self.speed)
        rear = self.window[0] - before + gone * way
        front = rear + before + self.stretch - gone * shorter
        return front_coverage(math, front, self.width, lower, upper) - front_coverage(math, rear, self.width, lower, upper)

    def coverage(self, lower: Any, upper: Any) -> Any:
        """Share of each cell in which the template acts."""
        return window_coverage(lower, upper, self.window)

    @property
    def whereabouts(self) -> object:
        """What decides `place`: templates that agree in it act in one place."""
        return self.window, self.stretch, self.shrinks_to, self.speed, self.width, self.offset

    def place(self, math: Any, time: Any, lower: Any, upper: Any) -> Any:
        """Share of each cell in which a change of the level acts at `time`: the stretch where it is then."""
        return self.coverage(lower, upper) * self._stretch(math, time, lower, upper)

    def wrote(self, math: Any, value: Any) -> Any:
        """Where the template overrides what was composed before it."""
        return value > WRITE_THRESHOLD


Template = Plateau | Wave | Pulse


def timing(template: Template) -> tuple[Any, ...]:
    """What decides a template's `shape`: all but its muscles and levels. Templates that agree in it share it."""
    names = (item.name for item in fields(template) if item.name not in ("groups", "level", "end_level"))
    return type(template), *(getattr(template, name) for name in names)


def _check_template(template: "Template") -> None:
    settle(template)
    if not template.groups:
        raise OctoctrlError(f"{type(template).__name__}: no muscle groups given ({', '.join(OCTOPUS_MUSCLES.names)})")
    if _is_number(template.level):
        check_number("level", template.level, at_least=0.0, at_most=1.0)
    if _is_number(template.onset):
        check_number("onset", template.onset, unit="s")
    if _is_number(template.offset) and not _never(template.offset):
        check_number("offset", template.offset, unit="s", advice="inf is never")
    check_window(type(template).__name__, template.window)


def _relaxes(end_level: object) -> bool:
    return isinstance(end_level, int | float) and end_level == 0.0


def _never(offset: object) -> bool:
    return isinstance(offset, float) and offset == inf


def _is_number(value: object) -> bool:
    # What the planner chooses is a CasADi expression or a number with slopes; its bounds are the planner's business.
    return not hasattr(value, "is_symbolic")
