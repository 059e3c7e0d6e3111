"""A solid within a closed surface of triangles, such as a scanned stone or a part that was drawn."""

from dataclasses import dataclass, fields
from functools import lru_cache
from hashlib import sha256
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import OctoctrlError, brief, check_count, check_kind
from .objects import RigidObject
from .supports import Vector
from .triangles import check_closed, enclosed

Floats = NDArray[np.float64]

MOST, EMPTY, SKEW = 20_000, 1e-9, 1e-3
"""Rows of a mesh at most; volume over the cube of its longest side below which it is none; products of inertia over moments that do not
matter."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Mesh(RigidObject):
    """A solid within a closed surface of triangles, whose distances are kept on a grid: edges are as round as a cell is wide.

    Attributes
    ----------
    vertices : tuple of (float, float, float), m
        Corners, from any origin: the solid's centre of mass comes to `position`, and its z axis along `axis`.
    triangles : tuple of (int, int, int)
        Numbers of their corners, all of them clockwise, or all anticlockwise, as seen from outside.
    principal : bool
        Whether it is turned so that its z axis is that of the least moment of inertia, in the direction in which it is longest, and x that
        of the largest. One that can move must lie so, turned or as it is.
    cells : int
        Of the grid, along the longest side; what is thinner than one gets lost.
    """

    vertices: tuple[Vector, ...]
    triangles: tuple[tuple[int, int, int], ...]
    principal: bool = False
    cells: int = 48
    kind: ClassVar[int] = 5

    def __post_init__(self) -> None:
        check_kind("principal", self.principal, bool)
        name = f"object '{self.name}'"
        object.__setattr__(self, "vertices", _rows(f"{name}: vertices", self.vertices, float))
        object.__setattr__(self, "triangles", _rows(f"{name}: triangles", self.triangles, int))
        check_count(f"{name}: cells", self.cells, at_least=8, at_most=128)
        numbers = np.array(self.triangles, dtype=np.int64)
        if numbers.min() < 0 or numbers.max() >= len(self.vertices):
            raise OctoctrlError(
                f"{name}: triangles count their corners from {numbers.min()} to {numbers.max()}; there are {len(self.vertices)}, from 0 on"
            )
        check_closed(numbers, name)
        if not self.volume > 0:
            raise OctoctrlError(f"{name}: its surface encloses nothing; give a solid")
        RigidObject.__post_init__(self)
        products = self._solid.skew
        if self.movable and products > SKEW:
            raise OctoctrlError(
                f"{name} can move, and its products of inertia are {100 * products:.2g} % of its moments; "
                "its axes must be principal ones: set principal = true"
            )

    def __repr__(self) -> str:
        """All that is told in a line, and a digest of the surface, which tells it from others."""
        told = ", ".join(f"{item.name}={getattr(self, item.name)!r}" for item in fields(self) if item.name not in ("vertices", "triangles"))
        digest = sha256(self.corners.tobytes()).hexdigest()[:12]
        return f"Mesh({told}, surface=<{len(self.triangles)} triangles, {digest}>)"

    @property
    def _solid(self) -> "_Solid":
        return _solid_of(Same(self.vertices, self.triangles), self.principal)

    @property
    def corners(self) -> Floats:
        """Corners (K, 3, 3) of the triangles from the centre of mass, along d1, d2, d3, m; anticlockwise from outside."""
        return self._solid.corners

    @property
    def sizes(self) -> tuple[float, ...]:
        """Farthest from the centre along d1, d2, d3."""
        a, b, c = np.abs(self.corners).max(axis=(0, 1))
        return float(a), float(b), float(c)

    @property
    def volume(self) -> float:
        """Volume, m^3."""
        return self._solid.volume

    @property
    def gyration(self) -> Vector:
        """Of the solid body, m^2."""
        return self._solid.gyration

    @property
    def bound(self) -> float:
        """Distance of the farthest corner, m."""
        return float(np.linalg.norm(self.corners, axis=2).max())

    @property
    def bend(self) -> float:
        """As of a box, a twentieth of its thinnest side, m."""
        return float(np.ptp(self.corners, axis=(0, 1)).min()) / 20


class Same:
    """A key of a cache, which holds its parts and is equal to another of the very same ones: to hash a surface takes milliseconds."""

    __slots__ = ("parts",)

    def __init__(self, *parts: Any) -> None:
        self.parts = parts

    def __hash__(self) -> int:
        return hash(tuple(map(id, self.parts)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and tuple(map(id, self.parts)) == tuple(map(id, other.parts))


class _Solid(NamedTuple):
    """Volume, gyration about the axes, the largest product of inertia over the largest moment, and `Mesh.corners`."""

    volume: float
    gyration: Vector
    skew: float
    corners: Floats


@lru_cache(maxsize=64)
def _solid_of(surface: Same, principal: bool) -> _Solid:
    return _solid(*surface.parts, principal)


@lru_cache(maxsize=64)
def _solid(vertices: tuple[Vector, ...], triangles: tuple[tuple[int, int, int], ...], principal: bool) -> _Solid:
    corners = np.array(vertices)[np.array(triangles)]
    corners -= corners.mean(axis=(0, 1))  # of what is far from the origin little would be left but rounding
    volume = np.linalg.det(corners).sum() / 6
    if volume < 0:
        corners = corners[:, ::-1]
    if abs(volume) < EMPTY * np.ptp(corners, axis=(0, 1)).max() ** 3:
        return _Solid(0.0, (0.0, 0.0, 0.0), 0.0, corners)
    solid = enclosed(corners)
    corners, moments = corners - solid.centre, solid.gyration
    if principal:
        axes = np.linalg.eigh(moments)[1][:, ::-1].T
        axes[0] *= np.linalg.det(axes)
        corners, moments = corners @ axes.T, axes @ moments @ axes.T
    a, b, c = (float(value) for value in np.diag(moments))
    corners = np.ascontiguousarray(corners)
    corners.flags.writeable = False
    return _Solid(solid.volume, (a, b, c), float(np.abs(moments - np.diag([a, b, c])).max()) / max(a, b, c), corners)


def _rows(what: str, values: Any, kind: type) -> tuple[Any, ...]:
    """Rows of three numbers as tuples.

    Raises
    ------
    OctoctrlError
        If they are something else, or none, or too many.
    """
    words = "three finite numbers, m" if kind is float else "three whole numbers"
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise OctoctrlError(f"{what} is {brief(values)}; give rows of {words}") from None
    if found.ndim != 2 or found.shape[1] != 3 or not np.isfinite(found).all() or (kind is int and (found != np.round(found)).any()):
        raise OctoctrlError(f"{what} has the shape {found.shape} or a number that does not fit; give rows of {words}")
    if not 4 <= len(found) <= MOST:
        raise OctoctrlError(f"{what} has {len(found)} rows; from 4 to {MOST} are allowed: make the surface coarser")
    return tuple(tuple(map(kind, row)) for row in found.tolist())
