"""How an object is held, and what pushes it besides the arm."""

from dataclasses import dataclass
from math import inf

from ..annotations import as_tuples
from ..errors import check_number, check_numbers

Vector = tuple[float, float, float]


def check_vector(name: str, value: object) -> None:
    """Check three finite numbers.

    Raises
    ------
    OctoctrlError
        If `value` is anything else.
    """
    check_numbers(name, value, 3, "(0, 0.04, 0)")


def check_pair(name: str, value: object, example: str) -> None:
    """Check two finite numbers; `example` shows what they may be.

    Raises
    ------
    OctoctrlError
        If `value` is anything else.
    """
    check_numbers(name, value, 2, example)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fixed:
    """Does not move."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved:
    """Goes its own way, whatever touches it.

    Attributes
    ----------
    velocity : (float, float, float), m/s
    spin : (float, float, float), rad/s
    """

    velocity: Vector = (0.0, 0.0, 0.0)
    spin: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        as_tuples(self)
        for name in ("velocity", "spin"):
            check_vector(name, getattr(self, name))


@dataclass(frozen=True, slots=True, kw_only=True)
class Free:
    """Moves as it is pushed.

    Attributes
    ----------
    since : float, s
        Until then it is fixed.
    damping : (float, float), 1/s
        Rates at which the water takes its velocity and its angular momentum.
    """

    since: float = 0.0
    damping: tuple[float, float] = (50.0, 5.0)

    def __post_init__(self) -> None:
        as_tuples(self)
        check_number("free: since", self.since, at_least=0.0, unit="s")
        check_pair("free: damping", self.damping, "(50, 5)")
        for rate in self.damping:
            check_number("free: damping", rate, at_least=0.0, unit="1/s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Springs:
    """Held in place and direction by springs.

    Attributes
    ----------
    stiffness : float, N/m
    turning : float, N m
        Against turning its axis away.
    damping : (float, float), 1/s
    """

    stiffness: float = 100.0
    turning: float = 0.16
    damping: tuple[float, float] = (50.0, 5.0)

    def __post_init__(self) -> None:
        as_tuples(self)
        check_number("springs: stiffness", self.stiffness, above=0.0, unit="N/m")
        check_number("springs: turning", self.turning, at_least=0.0, unit="N m")
        check_pair("springs: damping", self.damping, "(50, 5)")
        for rate in self.damping:
            check_number("springs: damping", rate, at_least=0.0, unit="1/s")


Support = Fixed | Moved | Free | Springs


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """A force through the centre of an object that can move.

    Attributes
    ----------
    force : (float, float, float), N
        In the laboratory.
    since, until : float, s
        When it begins and ends, to the next sample of the plant.
    """

    force: Vector
    since: float = 0.0
    until: float = inf

    def __post_init__(self) -> None:
        as_tuples(self)
        check_vector("push: force", self.force)
        check_number("push: since", self.since, at_least=0.0, unit="s")
        if not (isinstance(self.until, float) and self.until == inf):
            check_number("push: until", self.until, above=self.since, unit="s")
