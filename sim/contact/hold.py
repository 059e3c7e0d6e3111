"""What a recording says of how an arm holds one object: read from the recording alone, in which every object is noted with its shape."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, pi, tau
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from ..errors import OctoctrlError
from ..scene.mesh import Mesh
from ..scene.objects import Box, Capsule, Cylinder, Plane, RigidObject, Sphere
from ..scene.shapes import SHAPES
from .columns import Note
from .measures import gaps, lying, turns
from .surroundings import PREFIX, Touch

Floats = NDArray[np.float64]

FADES = 0.01
"""Gap (m) over which an element's turn about the object counts by 1/e less in the `Hold.near` winding."""


CORE = 21
"""Points on an object's axis by which its distance from another is read."""


@dataclass(frozen=True, slots=True)
class Hold:
    """One object and an arm of n elements over T instants.

    Attributes
    ----------
    touch : Touch
        Pose and forces.
    gap : (T, n) float64, m
        Between the surface of each element and the object's, negative where they overlap.
    along : (T, n) float64, m
        Place of each element along the object's axis, from its centre.
    turned : (T, n) float64, turns
        That each element makes about the axis, positive in the sense of a right-handed turn.
    item : RigidObject
        The object itself.
    home : (3,) float64
        Its axis at the begin of all.
    middle : (T, n, 3) float64, m
        Of the elements.
    """

    touch: Touch
    gap: Floats
    along: Floats
    turned: Floats
    item: RigidObject
    home: Floats
    middle: Floats

    @classmethod
    def of(cls, recording: Any, radius: Floats, name: str) -> "Hold":
        """How the object called `name` was held.

        Parameters
        ----------
        recording : Recording
        radius : (n,) float64, m
            Of the arm's elements at rest.
        name : str

        Raises
        ------
        OctoctrlError
            If nothing of the object was recorded.
        """
        touch = Touch.of(recording.series, name)
        item = recorded_object(recording.series[PREFIX + name][0], name, recording.meshes)
        middle = (recording.points[:, 1:] + recording.points[:, :-1]) / 2
        along = np.einsum("tkc,tc->tk", middle - touch.position[:, None], touch.frame[:, 2])
        return cls(
            touch=touch,
            gap=gaps(middle, item, touch.position, touch.frame) - radius,
            along=along,
            turned=turns(recording.points, touch.position, touch.frame),
            item=item,
            home=recording.series[PREFIX + name][0, Note.HOME_AXIS : Note.HOME_AXIS + 3],
            middle=middle,
        )

    @property
    def winding(self) -> Floats:
        """Turns of the whole arm about the object's axis, (T,)."""
        return np.asarray(self.turned.sum(axis=1))

    @property
    def covered(self) -> Floats:
        """Turns of what lies on the object, within its length, (T,)."""
        return np.asarray((self.turned * lying(self.gap, self.along, self.item)).sum(axis=1))

    @property
    def near(self) -> Floats:
        """Turns of all elements, each the less the farther it is from the object, (T,): a slope towards it before anything touches."""
        return np.asarray((self.turned * np.exp(-np.maximum(self.gap, 0.0) / FADES)).sum(axis=1))

    @property
    def spun(self) -> Floats:
        """Angle (T,), rad, between the object's axis now and at the begin of all, from 0 to a half turn."""
        return np.asarray(np.arccos(np.clip(self.touch.frame[:, 2] @ self.home, -1.0, 1.0)))

    @property
    def core(self) -> Floats:
        """Points (T, K, 3) on the object's axis, m, from end to end; its centre if it has no length."""
        half = self.item.length / 2 if isinstance(self.item, Capsule | Cylinder) else 0.0
        if isinstance(self.item, Mesh):
            half = max(self.item.sizes[2] - self.girth, 0.0)
        along = np.linspace(-half, half, CORE)
        return np.asarray(self.touch.position[:, None] + along[:, None] * self.touch.frame[:, None, 2])

    @property
    def girth(self) -> float:
        """Radius of the circle that is as long as the way round the object, m."""
        return girth(self.item)

    @property
    def towards(self) -> Floats:
        """Unit vectors (T, n, 3) from the elements to the object's axis."""
        axis = self.touch.frame[:, 2]
        local = self.touch.position[:, None] - self.middle
        aside = local - np.einsum("tkc,tc->tk", local, axis)[:, :, None] * axis[:, None]
        return np.asarray(aside / np.maximum(np.linalg.norm(aside, axis=2, keepdims=True), 1e-12))

    def distance(self, points: Floats) -> Floats:
        """Signed distances (T, K) of `points` (T, K, 3), m, from the object's surface."""
        return gaps(points, self.item, self.touch.position, self.touch.frame)


def girth(item: RigidObject) -> float:
    """Radius of the circle that is as long as the way round an object, m; infinite for a plane."""
    if isinstance(item, Box):
        a, b, _ = item.size
        return (a + b) / pi
    if isinstance(item, Mesh):
        return float(ConvexHull(item.corners.reshape(-1, 3)[:, :2]).area) / tau  # in the plane its "area" is the way round
    return float(item.radius) if isinstance(item, Sphere | Capsule | Cylinder) else inf


def recorded_object(row: Floats, name: str, meshes: Mapping[str, Mesh] = MappingProxyType({})) -> RigidObject:
    """The object, `name`, whose shape and sizes a `row` of a recording holds, fixed where it was; one of its `meshes` as it began.

    Raises
    ------
    OctoctrlError
        If it is a mesh that is not among them.
    """
    kind = list(SHAPES.values())[int(row[Note.SHAPE])]
    first, second, third = (float(size) for size in row[Note.SIZE : Note.SIZE + 3])
    x, y, z = (float(value) for value in row[Note.POSITION : Note.POSITION + 3])
    a, b, c = (float(value) for value in row[Note.FRAME + 6 : Note.FRAME + 9])
    placed: dict[str, Any] = {"name": name, "position": (x, y, z), "axis": (a, b, c)}
    if kind is Sphere:
        return Sphere(radius=first, **placed)
    if kind is Box:
        return Box(size=(2 * first, 2 * second, 2 * third), **placed)
    if kind is Plane:
        return Plane(**placed)
    if kind is Mesh:
        if name not in meshes:
            known = ", ".join(meshes) or "none"
            raise OctoctrlError(
                f"object '{name}' is a mesh, of which the recording holds no surface (it holds: {known}); run the plan again"
            )
        return meshes[name]  # its shape is what is asked for, and too much to be checked again at every reading
    return (Capsule if kind is Capsule else Cylinder)(radius=first, length=2 * second, **placed)
