"""A run as a binary glTF 2.0 file (.glb): a skinned tube that moves, for Blender, browsers and slides.

One mesh, one joint for each place along the arm; a joint's translation, rotation and scale over time carry the ring of vertices around it.
Everything by hand, since it is little: a JSON header and one buffer. Lengths are metres; glTF's +y, which is up, is the arm's axis at rest.
"""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..carrying.results import Execution
from .motion import Floats, Motion, motion_of
from .solids import tube_triangles

SIDES, INSTANTS, PLACES = 16, 150, 61
_SKIN, _FIRST, _SECOND = (168, 200, 225, 255), (214, 94, 0, 255), (247, 237, 204, 255)
"""Colours of the skin and of the stripes along LM3 and LM7."""
_FLOAT, _SHORT, _BYTE = 5126, 5123, 5121
_VERTICES, _CORNERS = 34962, 34963
_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def glb(run: Execution, *, instants: int = INSTANTS) -> bytes:
    """Write a run as a binary glTF file.

    Parameters
    ----------
    run : Execution
    instants : int
        Key frames, at most.

    Returns
    -------
    bytes
    """
    motion = motion_of(run, instants=instants, places=PLACES)
    frames = frames_of(motion)
    buffer = _Buffer()
    primitive = _tube(buffer, motion, frames)
    count = len(motion.points[0])
    nodes: list[dict[str, Any]] = [
        {"name": f"place {k}", "translation": place.tolist(), "rotation": turn.tolist()}
        for k, (place, turn) in enumerate(zip(motion.points[0], quaternions(frames[:1])[0], strict=True))
    ]
    nodes += [{"name": "arm", "mesh": 0, "skin": 0}, {"name": run.plan.task.name, "children": list(range(count))}]
    bind = np.linalg.inv(_transforms(motion.points[0], frames[0], np.ones(count))).swapaxes(1, 2).reshape(count, 16)
    content = {
        "asset": {"version": "2.0", "generator": "octoctrl"},
        "scene": 0,
        "scenes": [{"nodes": [count + 1, count]}],
        "nodes": nodes,
        "skins": [{"joints": list(range(count)), "inverseBindMatrices": buffer.add(bind, _FLOAT), "skeleton": count + 1}],
        "meshes": [{"name": "arm", "primitives": [primitive]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.6}, "doubleSided": True}],
        "animations": [_animation(buffer, motion, frames, run.plan.task.name)],
    }
    content |= {"buffers": [{"byteLength": len(buffer.bytes)}], "bufferViews": buffer.views, "accessors": buffer.accessors}
    head = json.dumps(content, separators=(",", ":")).encode()
    head += b" " * (-len(head) % 4)
    body = bytes(buffer.bytes) + b"\0" * (-len(buffer.bytes) % 4)
    chunks = struct.pack("<I4s", len(head), b"JSON") + head + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def frames_of(motion: Motion) -> Floats:
    """Rotation matrices (F, M, 3, 3) of the places of a `motion`; columns: towards LM3, across, along the arm."""
    along = np.gradient(motion.points, axis=1)
    along -= np.sum(along * motion.normals, axis=2, keepdims=True) * motion.normals
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    return np.stack([motion.normals, np.cross(along, motion.normals), along], axis=3)


def quaternions(frames: Floats) -> NDArray[np.float32]:
    """Quaternions (F, M, 4), x y z w, of rotation matrices `frames` (F, M, 3, 3), each on the same side as the one before in time."""
    from scipy.spatial.transform import Rotation

    found = Rotation.from_matrix(frames.reshape(-1, 3, 3)).as_quat().reshape(*frames.shape[:2], 4)
    turned = np.sum(found[1:] * found[:-1], axis=2, keepdims=True) < 0
    found[1:] *= np.where(np.cumsum(turned, axis=0) % 2 == 1, -1.0, 1.0)
    return found.astype(np.float32)


class _Buffer:
    """The one binary buffer of a file, with what stands where."""

    def __init__(self) -> None:
        self.bytes = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, array: NDArray[Any], kind: int, *, target: int | None = None, bounds: bool = False, share: bool = False) -> int:
        """Append an array (rows, numbers) and return the number of its accessor; `share`: its bytes are shares of 255."""
        data = np.ascontiguousarray(array, dtype={_FLOAT: "<f4", _SHORT: "<u2", _BYTE: "u1"}[kind])
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": data.nbytes}
        self.views.append(view | ({"target": target} if target else {}))
        self.bytes += data.tobytes()
        flat = data.reshape(len(data), -1)
        entry: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": kind,
            "count": len(data),
            "type": _TYPES[flat.shape[1]],
        }
        if bounds:
            entry |= {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        self.accessors.append(entry | ({"normalized": True} if share else {}))
        return len(self.accessors) - 1


def _tube(buffer: _Buffer, motion: Motion, frames: Floats) -> dict[str, Any]:
    """The mesh as the arm stands at first: a ring of vertices for each place, all of which follow its joint."""
    count = motion.points.shape[1]
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    normals = np.cos(angle)[:, None] * frames[0, :, None, :, 0] + np.sin(angle)[:, None] * frames[0, :, None, :, 1]
    places = motion.points[0, :, None] + motion.radius[0, :, None, None] * normals
    colours = np.full((count, SIDES, 4), _SKIN)
    colours[:, 0], colours[:, SIDES // 2] = _FIRST, _SECOND
    joints, weights = np.zeros((count * SIDES, 4)), np.zeros((count * SIDES, 4))
    joints[:, 0], weights[:, 0] = np.repeat(np.arange(count), SIDES), 1.0
    attributes = {
        "POSITION": buffer.add(places.reshape(-1, 3), _FLOAT, target=_VERTICES, bounds=True),
        "NORMAL": buffer.add(normals.reshape(-1, 3), _FLOAT, target=_VERTICES),
        "COLOR_0": buffer.add(colours.reshape(-1, 4), _BYTE, target=_VERTICES, share=True),
        "JOINTS_0": buffer.add(joints, _BYTE, target=_VERTICES),
        "WEIGHTS_0": buffer.add(weights, _FLOAT, target=_VERTICES),
    }
    corners = tube_triangles(count, SIDES).reshape(-1, 1)
    return {"attributes": attributes, "indices": buffer.add(corners, _SHORT, target=_CORNERS), "material": 0}


def _animation(buffer: _Buffer, motion: Motion, frames: Floats, name: str) -> dict[str, Any]:
    clock = buffer.add(motion.time[:, None] - motion.time[0], _FLOAT, bounds=True)
    turns, wide = quaternions(frames), motion.radius / motion.radius[0]
    scales = np.stack([wide, wide, np.ones_like(wide)], axis=2)
    samplers: list[dict[str, Any]] = []
    channels = []
    for place in range(motion.points.shape[1]):
        for path, values in (("translation", motion.points), ("rotation", turns), ("scale", scales)):
            samplers.append({"input": clock, "output": buffer.add(values[:, place], _FLOAT), "interpolation": "LINEAR"})
            channels.append({"sampler": len(samplers) - 1, "target": {"node": place, "path": path}})
    return {"name": name, "samplers": samplers, "channels": channels}


def _transforms(points: Floats, frames: Floats, wide: Floats) -> Floats:
    """Matrices (M, 4, 4) of joints."""
    found = np.zeros((len(points), 4, 4))
    found[:, :3, :3] = frames * np.stack([wide, wide, np.ones_like(wide)], axis=1)[:, None]
    found[:, :3, 3], found[:, 3, 3] = points, 1.0
    return found
