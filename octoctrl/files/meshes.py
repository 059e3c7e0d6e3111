"""Solids from files: STL, OBJ, PLY and the like, read with trimesh."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from octoctrl.sim.archives import check_source
from octoctrl.sim.errors import OctoctrlError, suggest
from octoctrl.sim.scene.mesh import Mesh
from octoctrl.sim.writing import check_suffix

from ..extras import extra
from .centreline import LENGTHS
from .toml_source import Source, found

FORMATS = (".stl", ".obj", ".ply", ".off")


def read_mesh(path: str | Path, *, unit: str, **settings: Any) -> Mesh:
    """Read a solid that an arm may touch.

    Parameters
    ----------
    path : str or Path
        A ``.stl``, ``.obj``, ``.ply`` or ``.off`` file with one closed surface; corners at the same place are taken for one.
    unit : {"m", "cm", "mm", "um"}
        Of its lengths, which such files do not say.
    **settings
        What else an `octoctrl.sim.scene.mesh.Mesh` has, such as ``name`` and ``position``; the name is the file's if omitted.

    Returns
    -------
    Mesh

    Raises
    ------
    OctoctrlError
        If trimesh is not installed, the file is missing or damaged, or what `Mesh` refuses.
    """
    path = Path(path)
    known = [item.name for item in fields(Mesh) if item.name not in ("vertices", "triangles")]
    for name in settings:
        if name not in known:
            raise OctoctrlError(f"a mesh has no '{name}'{suggest(name, known)} ({', '.join(known)})")
    vertices, triangles = _surface(path, unit)
    try:
        return Mesh(**({"name": path.stem} | settings), vertices=vertices, triangles=triangles)  # type: ignore[arg-type]
    except OctoctrlError as error:
        raise OctoctrlError(f"{path}: {error}") from None


def put_meshes(data: dict[str, Any], source: Source, folder: Path) -> None:
    """Put the surface into each table of `scene.objects` that names a `file`, in the `folder` of the task file, and its `unit`.

    The `data` of the file are changed; `source` tells where they stand.

    Raises
    ------
    OctoctrlError
        If a file cannot be read, or its table says something wrong.
    """
    scene = data.get("scene")
    objects = scene.get("objects") if isinstance(scene, dict) else None
    for index, table in enumerate(objects if isinstance(objects, list) else []):
        if not isinstance(table, dict) or str(table.get("kind", "")).lower() != "mesh" or ("vertices" in table and "file" not in table):
            continue
        path = ("scene", "objects", index)
        for name, such in (("file", '"stone.stl", for example'), ("unit", ", ".join(LENGTHS))):
            if name not in table:
                raise OctoctrlError(f"{source.where(path)}: '{name}' is missing ({such})")
        for name in ("file", "unit"):
            if not isinstance(table[name], str):
                raise OctoctrlError(f"{source.where((*path, name))}: expected text, found {found(table[name])}")
        for name in ("vertices", "triangles"):
            if name in table:
                raise OctoctrlError(f"{source.where((*path, name))}: {name} follow from the file; leave one of them out")
        try:
            table["vertices"], table["triangles"] = _surface(folder / table.pop("file"), table.pop("unit"))
        except OctoctrlError as error:
            raise OctoctrlError(f"{source.where((*path, 'file'))}: {error}") from None


def _surface(path: Path, unit: str) -> tuple[list[list[float]], list[list[int]]]:
    """Corners, m, and triangles of a file."""
    if unit not in LENGTHS:
        raise OctoctrlError(f"unknown unit '{unit}'{suggest(unit, LENGTHS)} ({', '.join(LENGTHS)})")
    check_source(check_suffix(path, FORMATS))
    trimesh = extra("meshes", "trimesh")
    try:
        surface = trimesh.load_mesh(path, process=True)
        surface.merge_vertices(merge_tex=True, merge_norm=True)
        surface.update_faces(surface.nondegenerate_faces())
        vertices, triangles = LENGTHS[unit] * np.asarray(surface.vertices, dtype=float), np.asarray(surface.faces, dtype=int)
    except Exception as error:  # trimesh lets through whatever a damaged file runs into
        raise OctoctrlError(f"{path} is no {path.suffix} file, or is damaged: {' '.join(str(error).split())[:120]}") from None
    if not len(triangles):
        raise OctoctrlError(f"{path} holds no triangle; a closed surface of them is needed")
    return vertices.tolist(), triangles.tolist()
