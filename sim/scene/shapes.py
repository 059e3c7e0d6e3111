"""All shapes that an object may have."""

from ..errors import OctoctrlError, brief
from .mesh import Mesh
from .objects import Box, Capsule, Cylinder, Plane, RigidObject, Sphere, several

SHAPES: dict[str, type[RigidObject]] = {kind.__name__.lower(): kind for kind in (Sphere, Capsule, Cylinder, Box, Plane, Mesh)}
"""Shapes by the name that a task file gives them."""


def checked_objects(objects: object) -> tuple[RigidObject, ...]:
    """Check the objects of a scene.

    Raises
    ------
    OctoctrlError
        If one is no object, or two have one name.
    """
    found = several(objects)
    for item in found:
        if not isinstance(item, RigidObject):
            raise OctoctrlError(
                f"{brief(repr(item))} is no object that an arm can touch; use one of {', '.join(k.__name__ for k in SHAPES.values())}"
            )
    names = [item.name for item in found]
    for name in names:
        if names.count(name) > 1:
            raise OctoctrlError(f"two objects are called '{name}'; give each a name of its own")
    return found
