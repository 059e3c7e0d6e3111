"""Rigid objects that an arm may touch: their shape, their mass and friction.

A shape is a class; how an object is held is an object of its own, see `octoctrl.sim.scene.supports`. Everything in SI units, frozen,
complete when constructed.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from math import inf, pi, sqrt
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..annotations import as_tuples, settle
from ..errors import OctoctrlError, brief, check_number
from .supports import Fixed, Free, Push, Springs, Support, Vector, check_pair, check_vector

Floats = NDArray[np.float64]

FIRM = 4e6
"""Usual stiffness of a contact, Pa: a held grasp sinks in by micrometres."""

BEARABLE = 0.01
"""Share of the arm's radius at the base by which a point may sink in. One that is deeper, though its force is that of less, came there
within a step: a finer one is tried."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidObject(ABC):
    """What all shapes share; use one of them.

    Attributes
    ----------
    name : str
    position : (float, float, float), m
        Of the centre.
    axis : (float, float, float)
        Direction of d3, of any length.
    support : Fixed, Moved, Free or Springs
    density : float, kg/m^3, or None
        Of an object that what touches it can move, and only of such a one, unless `mass` is given.
    mass : float, kg, or None
    pushes : tuple of Push
        Forces on an object that can move, besides those of the arm.
    water_mass : bool
        Whether a moving object drags along as much water as it displaces.
    friction : (float, float)
        Static and kinetic coefficient.
    stiffness : float, Pa
        Of the contact; times the length of arm that a point stands for it is N/m.

    Raises
    ------
    OctoctrlError
        If a number is out of range, or an object that can move has no mass, or one that cannot has one or is pushed.
    """

    name: str
    position: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)
    support: Support = field(default=Fixed())
    density: float | None = None
    mass: float | None = None
    water_mass: bool = True
    friction: tuple[float, float] = (0.1, 0.1)
    stiffness: float = FIRM
    pushes: tuple[Push, ...] = ()

    kind: ClassVar[int]

    def __post_init__(self) -> None:
        as_tuples(self)
        if not isinstance(self.name, str) or not self.name.strip() or not self.name.isprintable():
            raise OctoctrlError(f"an object's name is {brief(repr(self.name))}; a word is needed, such as 'post'")
        check_vector(f"object '{self.name}': position", self.position)
        check_vector(f"object '{self.name}': axis", self.axis)
        if not any(self.axis):
            raise OctoctrlError(f"object '{self.name}': axis is zero; give a direction, such as (0, 1, 0)")
        check_pair(f"object '{self.name}': friction", self.friction, "(0.1, 0.1), static and kinetic")
        for label, value in zip(("static", "kinetic"), self.friction, strict=True):
            check_number(f"object '{self.name}': {label} friction", value, at_least=0.0)
        if self.friction[1] > self.friction[0]:
            static, kinetic = self.friction
            raise OctoctrlError(
                f"object '{self.name}': kinetic friction {kinetic:g} is larger than static {static:g}; it is at most as large"
            )
        check_number(f"object '{self.name}': stiffness", self.stiffness, above=0.0, unit="Pa")
        for label, given in (("density", self.density), ("mass", self.mass)):
            if given is not None:
                check_number(f"object '{self.name}': {label}", given, above=0.0, unit="kg/m^3" if label == "density" else "kg")
        if not isinstance(self.support, Support):
            raise OctoctrlError(
                f"object '{self.name}': support is {brief(self.support)}; use Fixed(), Moved(...), Free(...) or Springs(...)"
            )
        for label in ("radius", "length"):
            if hasattr(self, label):
                check_number(f"object '{self.name}': {label}", getattr(self, label), above=0.0, unit="m")
        if self.mass is not None and self.density is not None:
            raise OctoctrlError(f"object '{self.name}' has a mass and a density; give one of them")
        if self.movable and self.weight is None:
            raise OctoctrlError(f"object '{self.name}' can move but has no mass; give mass or density")
        for label, given in (("mass", self.mass), ("density", self.density)):
            if given is not None and not self.movable:
                raise OctoctrlError(
                    f"object '{self.name}' has a {label} but nothing can move it; leave {label} out, or use support Free() or Springs()"
                )
        object.__setattr__(self, "pushes", several(self.pushes))
        settle(self)
        if self.pushes and not self.movable:
            raise OctoctrlError(f"object '{self.name}' is pushed but cannot move; use support Free() or Springs()")

    @property
    def movable(self) -> bool:
        """Whether what touches it moves it."""
        return isinstance(self.support, Free | Springs)

    @property
    def weight(self) -> float | None:
        """Mass, kg, as given or from the density; None if neither was given."""
        return self.mass if self.mass is not None else None if self.density is None else self.density * self.volume

    @property
    @abstractmethod
    def sizes(self) -> tuple[float, ...]:
        """Sizes in the order of the kernels, m."""
        ...

    @property
    @abstractmethod
    def volume(self) -> float:
        """Volume, m^3."""
        ...

    @property
    @abstractmethod
    def gyration(self) -> Vector:
        """Moments of inertia about d1, d2, d3 over the mass, m^2, of the solid body."""
        ...

    @property
    @abstractmethod
    def bound(self) -> float:
        """Radius of the ball around the centre that holds it, m."""
        ...

    @property
    def bend(self) -> float:
        """Smallest radius at which its surface bends, m: how near to one another the points that touch it must be."""
        return self.sizes[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sphere(RigidObject):
    """A ball of `radius` (m)."""

    radius: float
    kind: ClassVar[int] = 0

    @property
    def sizes(self) -> tuple[float, ...]:
        """Radius."""
        return (self.radius,)

    @property
    def volume(self) -> float:
        """Volume, m^3."""
        return 4 / 3 * pi * self.radius**3

    @property
    def gyration(self) -> Vector:
        """Of a solid ball, m^2."""
        return (0.4 * self.radius**2,) * 3

    @property
    def bound(self) -> float:
        """Its radius, m."""
        return self.radius


@dataclass(frozen=True, slots=True, kw_only=True)
class Capsule(RigidObject):
    """A rod with round ends: `radius` (m), and `length` (m) between the middles of its ends, along `axis`."""

    radius: float
    length: float
    kind: ClassVar[int] = 1

    @property
    def sizes(self) -> tuple[float, ...]:
        """Radius and half length."""
        return self.radius, self.length / 2

    @property
    def volume(self) -> float:
        """Volume, m^3, with its round ends."""
        return pi * self.radius**2 * (self.length + 4 / 3 * self.radius)

    @property
    def gyration(self) -> Vector:
        """Of the solid body, m^2: a cylinder and two half balls."""
        r, length = self.radius, self.length
        barrel, ends = length, 4 / 3 * r
        total = barrel + ends
        across = (barrel * (r * r / 4 + length**2 / 12) + ends * (0.4 * r * r + length**2 / 4 + 3 / 8 * length * r)) / total
        along = (barrel * r * r / 2 + ends * 0.4 * r * r) / total
        return across, across, along

    @property
    def bound(self) -> float:
        """Half length and radius, m."""
        return self.length / 2 + self.radius


@dataclass(frozen=True, slots=True, kw_only=True)
class Cylinder(RigidObject):
    """A rod with flat ends: `radius` and `length` (m) along `axis`."""

    radius: float
    length: float
    kind: ClassVar[int] = 2

    @property
    def sizes(self) -> tuple[float, ...]:
        """Radius and half length."""
        return self.radius, self.length / 2

    @property
    def volume(self) -> float:
        """Volume, m^3."""
        return pi * self.radius**2 * self.length

    @property
    def gyration(self) -> Vector:
        """Of the solid body, m^2."""
        across = self.radius**2 / 4 + self.length**2 / 12
        return across, across, self.radius**2 / 2

    @property
    def bound(self) -> float:
        """Half the diagonal, m."""
        return sqrt(self.radius**2 + self.length**2 / 4)


@dataclass(frozen=True, slots=True, kw_only=True)
class Box(RigidObject):
    """A block of three edge lengths (m), the third along `axis`."""

    size: Vector
    kind: ClassVar[int] = 3

    def __post_init__(self) -> None:
        as_tuples(self)
        check_vector(f"object '{self.name}': size", self.size)
        for edge in self.size:
            check_number(f"object '{self.name}': size", edge, above=0.0, unit="m")
        RigidObject.__post_init__(self)

    @property
    def sizes(self) -> tuple[float, ...]:
        """Half edges."""
        return tuple(edge / 2 for edge in self.size)

    @property
    def volume(self) -> float:
        """Volume, m^3."""
        a, b, c = self.size
        return a * b * c

    @property
    def gyration(self) -> Vector:
        """Of the solid body, m^2."""
        a, b, c = self.size
        return (b * b + c * c) / 12, (a * a + c * c) / 12, (a * a + b * b) / 12

    @property
    def bound(self) -> float:
        """Half the diagonal, m."""
        return sqrt(sum(edge * edge for edge in self.size)) / 2

    @property
    def bend(self) -> float:
        """Of its edges: the points are set as for a rod a tenth as thick as its shortest edge."""
        return min(self.size) / 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane(RigidObject):
    """All that lies behind a plane through `position`, whose outside is towards `axis`."""

    kind: ClassVar[int] = 4

    @property
    def sizes(self) -> tuple[float, ...]:
        """None."""
        return ()

    @property
    def volume(self) -> float:
        """Infinite."""
        return inf

    @property
    def gyration(self) -> Vector:
        """Infinite."""
        return inf, inf, inf

    @property
    def bound(self) -> float:
        """Infinite."""
        return inf

    @property
    def bend(self) -> float:
        """Infinite."""
        return inf

    def __post_init__(self) -> None:
        RigidObject.__post_init__(self)
        if self.movable:
            raise OctoctrlError(f"object '{self.name}': a plane cannot be moved by what touches it; use support Fixed() or Moved(...)")


def frame_of(item: RigidObject) -> Floats:
    """Directors (3, 3), rows d1, d2, d3, of an object at the begin; d1 is as near to +z as can be, or to +x."""
    d3 = np.asarray(item.axis, dtype=float) / np.abs(item.axis).max()  # whose squares are neither nothing nor beyond all numbers
    d3 /= np.linalg.norm(d3)
    aside = np.array([0.0, 0.0, 1.0]) if abs(d3[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    d1 = aside - (aside @ d3) * d3
    d1 /= np.linalg.norm(d1)
    return np.array([d1, np.cross(d3, d1), d3])


def several(value: Any) -> tuple[Any, ...]:
    """What was given as a tuple, also if it is one thing or nothing that can be gone through."""
    return tuple(value) if isinstance(value, tuple | list) else (value,)
