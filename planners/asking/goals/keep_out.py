"""A body that the arm keeps clear of: sphere, capsule or half-space."""

from dataclasses import dataclass
from functools import reduce
from math import dist, hypot
from typing import Any, ClassVar

from octoctrl.sim.errors import OctoctrlError, check_number

from ...contracts import Expression, Outputs, When
from ..registry import register_goal, register_part
from .measured import MeasuredGoal, nodes, three_numbers

Vector = tuple[float, float, float]
Points = tuple[Expression, Expression, Expression]


def _settle(zone: Any, name: str, unit: str = "m") -> None:
    vector = three_numbers(f"{type(zone).__name__}: {name}", getattr(zone, name))
    for number in vector:
        check_number(name, number, unit=unit)
    object.__setattr__(zone, name, vector)


@register_part
@dataclass(frozen=True, slots=True, kw_only=True)
class SphereZone:
    """A ball.

    Attributes
    ----------
    centre : (float, float, float), m
    radius : float, m
    """

    centre: Vector
    radius: float

    def __post_init__(self) -> None:
        _settle(self, "centre")
        check_number("radius", self.radius, above=0.0, unit="m")

    def distance(self, math: Any, points: Points) -> Expression:
        """Distance of points from the surface, negative inside; with the module `math`."""
        return _size(math, [axis - number for axis, number in zip(points, self.centre, strict=True)]) - self.radius


@register_part
@dataclass(frozen=True, slots=True, kw_only=True)
class CapsuleZone:
    """A rod with round ends.

    Attributes
    ----------
    start, stop : (float, float, float), m
        Ends of its axis.
    radius : float, m
    """

    start: Vector
    stop: Vector
    radius: float

    def __post_init__(self) -> None:
        _settle(self, "start")
        _settle(self, "stop")
        check_number("radius", self.radius, above=0.0, unit="m")
        if dist(self.start, self.stop) == 0.0:
            raise OctoctrlError(f"capsule: start and stop are both {self.start}; give two points, or a SphereZone")

    def distance(self, math: Any, points: Points) -> Expression:
        """Distance of points from the surface, negative inside; with the module `math`."""
        axis = [stop - start for start, stop in zip(self.start, self.stop, strict=True)]
        offset = [place - start for place, start in zip(points, self.start, strict=True)]
        along = sum(part * number for part, number in zip(offset, axis, strict=True)) / sum(number**2 for number in axis)
        share = math.fmin(math.fmax(along, 0.0), 1.0)
        return _size(math, [part - share * number for part, number in zip(offset, axis, strict=True)]) - self.radius


@register_part
@dataclass(frozen=True, slots=True, kw_only=True)
class HalfSpaceZone:
    """All that lies behind a plane.

    Attributes
    ----------
    point : (float, float, float), m
        On the plane.
    normal : (float, float, float)
        Away from it, of any length but zero; kept as a unit vector.
    """

    point: Vector
    normal: Vector

    def __post_init__(self) -> None:
        _settle(self, "point")
        _settle(self, "normal", unit="")
        size = hypot(*self.normal)
        if size == 0.0:
            raise OctoctrlError("half-space: normal is (0, 0, 0); three numbers are needed, not all zero")
        object.__setattr__(self, "normal", tuple(number / size for number in self.normal))

    def distance(self, math: Any, points: Points) -> Expression:
        """Distance of points from the plane, negative behind it."""
        parts = zip(points, self.point, self.normal, strict=True)
        return sum((axis - place) * number for axis, place, number in parts)


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class KeepOutGoal(MeasuredGoal):
    """The surface of the arm stays at least `margin` away from a body, throughout its phase unless said otherwise.

    The arm is taken with its radius at rest, at its nodes.

    Attributes
    ----------
    shape : SphereZone, CapsuleZone or HalfSpaceZone
    margin : float, m
    tolerance : float, m
        By how much the margin may be entered; less than the margin, or the arm may touch.
    """

    quantity: ClassVar[str] = "keep_out"
    unit: ClassVar[str] = "m"
    shape: SphereZone | CapsuleZone | HalfSpaceZone
    margin: float = 0.006
    tolerance: float = 0.003
    when: When = When.THROUGHOUT

    def __post_init__(self) -> None:
        MeasuredGoal.__post_init__(self)
        check_number("margin", self.margin, at_least=0.0, unit="m")

    @property
    def target(self) -> str:
        """The body in words."""
        return f"of a {type(self.shape).__name__} by {1e3 * self.margin:g} mm"

    def clearance(self, outputs: Outputs) -> Expression:
        """Distance of the nearest part of the arm's surface from the body, (T,), m."""
        edges = nodes(outputs.stations)
        gaps = self.shape.distance(outputs.math, outputs.points) - outputs.arm.section(edges).outer_radius[None]
        return reduce(outputs.math.fmin, (gaps[:, node] for node in range(len(edges))))

    def residuals(self, outputs: Outputs) -> list[Expression]:
        """By how much the margin is entered."""
        return [outputs.math.fmax(self.margin - self.clearance(outputs), 0.0)]


def _size(math: Any, parts: list[Expression]) -> Expression:
    return math.sqrt(sum(part**2 for part in parts) + 1e-18)
