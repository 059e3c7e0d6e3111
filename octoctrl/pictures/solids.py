"""The objects of a scene as a page shows them: a mesh for each shape, and its pose over time, as it was recorded."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.contact.surroundings import PREFIX, Touch
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.scene.mesh import Mesh
from octoctrl.sim.scene.objects import Box, Capsule, Cylinder, Plane, RigidObject, Sphere, frame_of

from ..carrying.results import Execution

Floats = NDArray[np.float64]

AROUND, ALONG = 40, 12
"""Corners of a round section, and steps from the equator of a ball to its pole."""
PATCH = 0.6
"""Half the width of what is shown of a plane, in arm lengths."""


def mesh(item: RigidObject, length: float) -> tuple[Floats, Floats, NDArray[np.int_]]:
    """Surface of an object in its own frame.

    Parameters
    ----------
    item : RigidObject
    length : float, m
        Of the arm, by which a plane is cut off.

    Returns
    -------
    vertices : (V, 3) float64, m
        Along d1, d2, d3.
    normals : (V, 3) float64
    triangles : (K, 3) int
    """
    if isinstance(item, Box):
        return _box(np.asarray(item.size) / 2)
    if isinstance(item, Mesh):
        return _faces(item.corners)
    if isinstance(item, Plane):
        half = PATCH * length
        corners = half * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        return corners, np.tile([0.0, 0.0, 1.0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]])
    return _turned(*_profile(item))


def pose(recording: Recording, item: RigidObject, chosen: NDArray[np.int_]) -> tuple[Floats, Floats]:
    """Place (F, 3), m, and directors (F, 3, 3), rows, of an `item` at `chosen` instants of a `recording`; else as it begins."""
    if PREFIX + item.name not in recording.series:
        return np.tile(np.asarray(item.position, dtype=float), (len(chosen), 1)), np.tile(frame_of(item), (len(chosen), 1, 1))
    touch = Touch.of(recording.series, item.name)
    return touch.position[chosen], touch.frame[chosen]


def solids(run: Execution, chosen: NDArray[np.int_]) -> tuple[dict[str, Floats], list[dict[str, Any]]]:
    """Arrays of poses (mm), and the meshes that move with them.

    Parameters
    ----------
    run : Execution
    chosen : (F,) int
        Instants of the page.

    Returns
    -------
    arrays : dict of str to (F, 3) or (F, 9) float64
    meshes : list of dict
    """
    arrays: dict[str, Floats] = {}
    meshes = []
    for number, item in enumerate(run.plan.scene.objects):
        place, frame = pose(run.recording, item, chosen)
        arrays |= {f"object {number} place": 1e3 * place, f"object {number} frame": frame.reshape(len(chosen), 9)}
        vertices, normals, triangles = mesh(item, run.plan.arm.length)
        meshes.append(
            {
                "place": f"object {number} place",
                "frame": f"object {number} frame",
                "vertices": [round(float(value), 3) for value in 1e3 * vertices.ravel()],
                "normals": [round(float(value), 3) for value in normals.ravel()],
                "triangles": triangles.ravel().tolist(),
            }
        )
    return arrays, meshes


def tube_triangles(rings: int, sides: int) -> NDArray[np.int_]:
    """Triangles (K, 3) of a tube: `rings` of as many corners as it has `sides`, in order; open at both ends, outside anticlockwise."""
    low, side = sides * np.arange(rings - 1)[:, None], np.arange(sides)
    a, b = low + side, low + (side + 1) % sides
    return np.concatenate([np.stack([a, b, a + sides], axis=2), np.stack([b, b + sides, a + sides], axis=2)]).reshape(-1, 3)


def _faces(corners: Floats) -> tuple[Floats, Floats, NDArray[np.int_]]:
    """Each triangle of `corners` (K, 3, 3) by itself, so that it is flat."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return corners.reshape(-1, 3), np.repeat(normals, 3, axis=0), np.arange(3 * len(corners)).reshape(-1, 3)


def _profile(item: RigidObject) -> tuple[Floats, Floats]:
    """Outline (P, 2) of a body of revolution from end to end, as (distance from the axis, height), and its normals (P, 2)."""
    quarter = np.linspace(0.0, np.pi / 2, ALONG + 1)
    up = np.stack([np.cos(quarter), np.sin(quarter)], axis=1)
    down = (up * [1, -1])[::-1]
    if isinstance(item, Sphere):
        normals = np.concatenate([down, up[1:]])
        return item.radius * normals, normals
    if isinstance(item, Capsule):
        shift = np.array([0.0, item.length / 2])
        return np.concatenate([item.radius * down - shift, item.radius * up + shift]), np.concatenate([down, up])
    if isinstance(item, Cylinder):
        r, half = item.radius, item.length / 2
        outline = np.array([[0.0, -half], [r, -half], [r, -half], [r, half], [r, half], [0.0, half]])
        return outline, np.array([[0.0, -1], [0, -1], [1, 0], [1, 0], [0, 1], [0, 1]])
    raise TypeError(f"no picture of a {type(item).__name__}")


def _turned(outline: Floats, normals: Floats) -> tuple[Floats, Floats, NDArray[np.int_]]:
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def turn(profile: Floats) -> Floats:
        flat = profile[:, None, :1] * ring
        return np.concatenate([flat, np.broadcast_to(profile[:, None, 1:], (*flat.shape[:2], 1))], axis=2).reshape(-1, 3)

    return turn(outline), turn(normals), tube_triangles(len(outline), AROUND)


def _box(half: Floats) -> tuple[Floats, Floats, NDArray[np.int_]]:
    corners = np.array([[-1.0, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
    vertices: list[Floats] = []
    normals: list[Floats] = []
    triangles: list[list[int]] = []
    for axis in range(3):
        for sign in (1, -1):
            order = np.roll(np.arange(3), axis + 1)
            face = np.empty((4, 3))
            face[:, order] = corners[:, [0, 1, 2]] * [1, 1, sign]
            first = 4 * len(vertices)
            vertices.append(face * half)
            normals.append(np.tile(np.sign(face.sum(axis=0)), (4, 1)))
            turn = [[0, 1, 2], [0, 2, 3]]
            triangles += [[first + k for k in (corner if sign > 0 else corner[::-1])] for corner in turn]
    return np.concatenate(vertices), np.concatenate(normals), np.array(triangles)
