"""What a passive rod is: nodes, frames, radii and material at rest, checked when it is made."""

from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..contracts import Floats
from ..errors import OctoctrlError, brief, check_choice, check_count, check_number
from ..records import Record
from .layout import STRIDES

CIRCULAR_SHEAR = 27 / 28
"""Shear coefficient of a circular section (PyElastica's default; Tekinalp et al. 2024 use 4/3)."""

SUPPORTS = ("free", "clamped", "element")
SECTIONS = ("incompressible", "constant")
MOST_ELEMENTS = STRIDES[-1] - 3
ORTHONORMAL = 1e-6
"""Largest deviation of a given frame from an orthonormal one."""
ALIGNED = 0.5
"""Smallest cosine between an element's d3 and its edge at rest: a rod that is sheared more stops at once."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Rod(Record):
    """Geometry and material of a rod with n elements.

    Attributes
    ----------
    points : (n + 1, 3) float64, m
        Nodes at rest.
    frames : (n, 3, 3) float64
        Directors (rows d1, d2, d3) of the elements at rest.
    radius : (n,) float64, m
    density : float, kg/m^3
    youngs_modulus, shear_modulus : float, Pa
    shear_coefficient : float
    support : {"free", "clamped", "element"}
        ``clamped`` holds the base node and the frame at s = 0, with bending over the half element in between, which is second order in
        the element length; ``element`` holds node and frame of the whole first element, as PyElastica does, which is first order.
    section : {"incompressible", "constant"}
        Whether the section shrinks as the rod stretches, as PyElastica has it, or keeps its area. Only the latter conserves energy.
    damping : float, 1/s
        Rate at which velocities decay in the absence of forces, exact over a step and independent of it.

    Raises
    ------
    OctoctrlError
        If shapes do not fit, a constant is out of range, nodes coincide, or frames are no frames of this centreline.
    """

    points: Floats
    frames: Floats
    radius: Floats
    density: float
    youngs_modulus: float
    shear_modulus: float
    shear_coefficient: float = CIRCULAR_SHEAR
    support: str = field(default="free")
    section: str = field(default="incompressible")
    damping: float = 0.0

    def __post_init__(self) -> None:
        count = np.size(self.radius)
        check_count("elements", count, at_most=MOST_ELEMENTS)
        for name, shape in (("radius", (count,)), ("points", (count + 1, 3)), ("frames", (count, 3, 3))):
            object.__setattr__(self, name, finite_array(name, getattr(self, name), shape))
        for name, unit in (("density", "kg/m^3"), ("youngs_modulus", "Pa"), ("shear_modulus", "Pa"), ("shear_coefficient", "")):
            check_number(name, getattr(self, name), above=0.0, unit=unit)
        check_choice("support", self.support, SUPPORTS)
        check_choice("section", self.section, SECTIONS)
        check_number("damping", self.damping, at_least=0.0, unit="1/s")
        if self.radius.min() <= 0:
            raise OctoctrlError(f"radius of element {self.radius.argmin()} is {self.radius.min():g} m; it must be positive")
        check_frames("frames", self.frames)
        edges = np.diff(self.points, axis=0)
        length = np.linalg.norm(edges, axis=1)
        if length.min() <= 1e-9 * length.sum():
            k = int(length.argmin())
            raise OctoctrlError(f"nodes {k} and {k + 1} coincide; every element needs a length")
        aligned = np.einsum("kj,kj->k", self.frames[:, 2], edges) / length
        if aligned.min() < ALIGNED:
            k = int(aligned.argmin())
            columns = np.einsum("kj,kj->k", self.frames[:, :, 2], edges) / length
            advice = "; directors are rows, these look like columns: transpose them" if columns.min() > ALIGNED else ""
            raise OctoctrlError(
                f"frames: d3 of element {k} is {np.degrees(np.arccos(np.clip(aligned[k], -1, 1))):.0f} degrees off its edge; "
                f"at most 60 are allowed{advice}"
            )

    @classmethod
    def straight(
        cls,
        *,
        length: float,
        radius: ArrayLike,
        elements: int,
        direction: ArrayLike = (0.0, 1.0, 0.0),
        normal: ArrayLike = (0.0, 0.0, 1.0),
        **material: Any,
    ) -> Self:
        """A straight rod from the origin along `direction`, with d1 along `normal`.

        Parameters
        ----------
        length : float, m
        radius : float or (n,) array_like, m
        elements : int
        direction, normal : (3,) array_like
            Of any length; `normal` may be anything but parallel to `direction`.
        **material
            The other fields of `Rod`.

        Raises
        ------
        OctoctrlError
            If a value is out of range, or the directions do not make a frame.
        """
        check_number("length", length, above=0.0, unit="m")
        check_count("elements", elements, at_most=MOST_ELEMENTS)
        d3, across = unit_vector("direction", direction), unit_vector("normal", normal)
        d1 = across - (across @ d3) * d3
        if np.linalg.norm(d1) < 1e-6:
            raise OctoctrlError(
                f"normal {_short(normal)} is parallel to direction {_short(direction)}; give one that points across the rod"
            )
        d1 /= np.linalg.norm(d1)
        thick = np.asarray(radius, dtype=float)
        if thick.shape not in ((), (elements,)):
            raise OctoctrlError(f"radius: expected one number or {elements}, one for each element, found shape {thick.shape}")
        return cls(
            points=np.linspace(0, length, elements + 1)[:, None] * d3,
            frames=np.broadcast_to(np.array([d1, np.cross(d3, d1), d3]), (elements, 3, 3)).copy(),
            radius=np.broadcast_to(thick, (elements,)).copy(),
            **material,
        )


def finite_array(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """`value` as an array of floats of that shape.

    Raises
    ------
    OctoctrlError
        If it is not, or holds anything that is no finite number; the message calls it `name`.
    """
    try:
        found = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise OctoctrlError(f"{name}: expected numbers of shape {shape}, found {type(value).__name__} {brief(value)}") from None
    if found.shape != shape:
        raise OctoctrlError(f"{name}: expected shape {shape}, found {found.shape}")
    if not np.isfinite(found).all():
        place = [int(index) for index in np.argwhere(~np.isfinite(found))[0]]
        raise OctoctrlError(f"{name}{place if place else ''} is {found[tuple(place)]}; finite numbers are needed")
    return found


def unit_vector(name: str, value: ArrayLike) -> Floats:
    """`value` (3,) at length one; a zero vector, called `name`, is refused."""
    found = finite_array(name, value, (3,))
    size = np.linalg.norm(found)
    if size == 0:
        raise OctoctrlError(f"{name} is (0, 0, 0); give a vector that points somewhere")
    return found / size


def check_frames(name: str, frames: Floats) -> None:
    """Check that `frames` (..., 3, 3), called `name`, are right-handed and orthonormal.

    Raises
    ------
    OctoctrlError
        If one is not.
    """
    flat = frames.reshape(-1, 3, 3)
    off = np.abs(flat @ np.swapaxes(flat, 1, 2) - np.eye(3)).max(axis=(1, 2))
    handed = np.linalg.det(flat)
    wrong = np.flatnonzero((off > ORTHONORMAL) | (handed < 0))
    if wrong.size:
        k = int(wrong[0])
        what = f"is off an orthonormal frame by {off[k]:.2g}" if off[k] > ORTHONORMAL else "is left-handed"
        raise OctoctrlError(f"{name}: frame {k} {what}; rows d1, d2, d3 of length one with d3 = d1 x d2 are needed")


def _short(vector: ArrayLike) -> str:
    return "(" + ", ".join(f"{x:g}" for x in np.asarray(vector, dtype=float)) + ")"
