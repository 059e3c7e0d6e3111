"""Runs as NetCDF4: arrays with names, units and coordinates for xarray, MATLAB and Panoply, and all that makes it the same run again.

The root group holds what was recorded and measured, `plan` what was planned. The variable `header` is the JSON of the .npz file, whose tree
of objects refers to arrays by place; `header` says which variable each of them is. Arrays that nobody looks for are in the group `more`.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.archives import check_source, swells

from ..extras import extra
from .writing import written_aside

if TYPE_CHECKING:
    import xarray

SEAL = b"octoctrl sha256 "
"""Stands behind what HDF5 reads, before the digest of that: HDF5 may well never come back from a file in which a byte is wrong."""

CHUNK = 64
"""Instants that are compressed together."""

_VARIABLES = {
    "position": ("recording.points", ("time", "node", "axis"), "m", "nodes, base first"),
    "director": ("recording.frames", ("time", "station", "triad", "axis"), "1", "material frames: d1, d2, d3"),
    "stretch": ("recording.stretch", ("time", "element"), "1", "length over rest length of each element"),
    "activation": ("recording.levels", ("time", "muscle", "element"), "1", "level of each muscle group"),
    "clock": ("clock", ("time",), "s", "reading of the plan's clock, which may wait"),
    "link": ("trace.link", ("time",), "turns", "link of the frames, closed by rays"),
    "writhe": ("trace.writhe", ("time",), "turns", "writhe of the centreline, closed by rays"),
    "twist": ("trace.twist", ("time",), "turns", "twist of the frames"),
    "lifted_writhe": ("trace.lifted_writhe", ("time",), "turns", "writhe that does not jump at self-crossings"),
    "residual": ("trace.residual", ("time",), "turns", "link minus writhe minus twist"),
    "crossings": ("trace.crossings", ("time",), "1", "net number of self-crossings"),
    "uturn": ("trace.uturn", ("time",), "1", "whether the tip looks back along the base, where writhe is uncertain"),
}
"""Variables of the root group: place in the run, dimensions, unit, and what it is."""

_PLANNED = {
    "strains": ("plan.strains", ("plan_time", "section", "strain"), "1/m", "curvature about d1 and d2, twist (1/m); stretch (1)"),
    **{
        name: (f"plan.{place}", ("plan_time",), unit, said)
        for name, (place, dimensions, unit, said) in _VARIABLES.items()
        if dimensions == ("time",) and place.startswith("trace")
    },
}


def dataset(run: Any) -> "xarray.Dataset":
    """What was recorded, measured and planned, over the recorded times.

    Parameters
    ----------
    run : Execution

    Returns
    -------
    xarray.Dataset
        Of double numbers, with units and coordinates.
    """
    xarray = extra("io", "xarray")
    recording, planned = run.recording, run.planned
    variables = {
        name: (dims, _at(run, place), {"units": unit, "long_name": said}) for name, (place, dims, unit, said) in _VARIABLES.items()
    }
    for name in ("link", "writhe", "twist", "lifted_writhe"):
        said = {"units": "turns", "long_name": f"{name} of the plan, at its clock"}
        variables[f"planned_{name}"] = (("time",), getattr(planned, name), said)
    for name, values in recording.series.items():
        dims = ("time", *(f"{_series(name)}_{axis}" for axis in range(1, values.ndim)))
        variables[_series(name)] = (dims, values, {"long_name": name.replace("_", " ")})
    arclength = {"units": "m", "long_name": "rest arclength from the base"}
    coordinates = {
        "time": ("time", recording.time, {"units": "s", "long_name": "time of the plant", "axis": "T"}),
        "s_node": ("node", _edges(recording.stations), arclength),
        "s_station": ("station", recording.stations, arclength),
        "s_element": ("element", recording.stations[1:-1], arclength),
        "axis": ("axis", np.array(["x", "y", "z"], dtype="S1")),
        "triad": ("triad", np.array(["d1", "d2", "d3"], dtype="S2")),
        "muscle": ("muscle", np.array([group.name for group in run.plan.arm.layout.groups], dtype="S")),
    }
    convention = run.trace.convention
    attributes = {
        "Conventions": "CF-1.11",
        "title": f"run of '{run.plan.task.name}' on arm {run.plan.arm.name}",
        "status": run.status.name.lower(),
        "plant": run.plant,
        "feedback": run.feedback,
        "pole": list(convention.pole),
        "closure": convention.closure,
        "ray_length": convention.ray_length,
    }
    return xarray.Dataset(variables, coordinates, attributes)


def write(path: Path, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], run: Any) -> None:
    """Write a run.

    Parameters
    ----------
    path : Path
    header, arrays : mapping
        As an archive has them.
    run : Execution

    Raises
    ------
    OctoctrlError
        If an extra is missing, or it cannot be written.
    """
    xarray = extra("io", "xarray", "h5netcdf", "h5py")
    root = dataset(run)
    root.attrs |= {"octoctrl_version": header["versions"].get("octoctrl", "?"), "schema": header["schema"]}
    plan = xarray.Dataset(
        {name: (dims, _at(run, place), {"units": unit, "long_name": said}) for name, (place, dims, unit, said) in _PLANNED.items()},
        {"plan_time": ("plan_time", run.plan.time, {"units": "s"})},
    )
    where = {f"Execution.{place}": name for name, (place, *_) in _VARIABLES.items()}
    where |= {f"Execution.{place}": f"plan/{name}" for name, (place, *_) in _PLANNED.items()}
    where |= {"Execution.recording.time": "time", "Execution.plan.time": "plan/plan_time", "Execution.recording.stations": "s_station"}
    where |= {f"Execution.recording.series.{name}": _series(name) for name in run.recording.series}
    more, known = {}, {}
    for number, (place, values) in enumerate(arrays.items()):
        if values.size and place not in where:
            where[place] = f"more/a{number}"
            more[f"a{number}"] = (tuple(f"a{number}_{axis}" for axis in range(values.ndim)), values, {"long_name": place})
        known[place] = [where.get(place, ""), values.dtype.str, list(values.shape)]
    text = json.dumps({**header, "arrays": known}, allow_nan=False)
    with written_aside(path) as part:
        for group, content in (("", root.assign(header=((), text))), ("plan", plan), ("more", xarray.Dataset(more))):
            encoding = {name: _encoding(variable) for name, variable in content.variables.items()}
            content.to_netcdf(part, mode="a" if group else "w", group=group or None, engine="h5netcdf", encoding=encoding)
        with open(part, "r+b") as file:
            digest = hashlib.file_digest(file, "sha256").digest()
            file.write(SEAL + digest)
            file.flush()
            os.fsync(file.fileno())


def read(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]] | None:
    """Header and arrays of a run, as an archive has them.

    Parameters
    ----------
    path : Path

    Returns
    -------
    (dict, dict of str to array) or None
        None if it is no run, or damaged.

    Raises
    ------
    OctoctrlError
        If there is no such file, or an extra is missing.
    """
    h5netcdf = extra("io", "h5netcdf", "h5py")
    check_source(path)
    try:
        if not _sealed(path):
            return None
        with h5netcdf.File(path, "r") as file:
            text = file["header"][()]
            header = json.loads(text)
            known = header.pop("arrays")
            if swells(sum(int(np.prod(shape)) * np.dtype(kind).itemsize for _, kind, shape in known.values()), path.stat().st_size):
                return None
            return header, {place: _array(file, *entry) for place, entry in known.items()}
    except (Exception, RecursionError):
        # Whatever HDF5 and JSON make of bytes that nobody meant.
        return None


def _sealed(path: Path) -> bool:
    content = path.read_bytes()
    body, seal = content[: -len(SEAL) - 32], content[-len(SEAL) - 32 :]
    return seal == SEAL + hashlib.sha256(body).digest()


def _array(file: Any, name: str, kind: str, shape: list[int]) -> NDArray[Any]:
    dtype = np.dtype(kind)
    if dtype.kind not in "fiub" or (name and list(file[name].shape) != shape):
        raise ValueError(name)
    return np.asarray(file[name][...] if name else np.zeros(shape)).astype(dtype)


def _at(run: Any, place: str) -> Any:
    for name in place.split("."):
        run = getattr(run, name)
    return run


def _series(name: str) -> str:
    """A series as a variable that no other has the name of."""
    return "series_" + name.replace("/", "_")


def _edges(stations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Nodes of elements whose centres are the inner stations."""
    edges = [0.0]
    for centre in stations[1:-1]:
        edges.append(2 * float(centre) - edges[-1])
    return np.array(edges)


def _encoding(variable: Any) -> dict[str, Any]:
    if variable.dtype.kind not in "fiub" or not variable.ndim:
        return {} if variable.dtype.kind not in "f" else {"_FillValue": None}
    chunks = (min(CHUNK, variable.shape[0]), *variable.shape[1:])
    fill = {"_FillValue": None} if variable.dtype.kind == "f" else {}
    return {"zlib": True, "complevel": 1, "shuffle": True, "chunksizes": chunks, **fill}
