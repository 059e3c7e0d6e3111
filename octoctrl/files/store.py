"""Plans, executions, recordings and traces as .npz files without pickle.

A file is a NumPy archive: the member ``header`` is JSON (what the file holds, with which versions and by which command it was made, and
the object as a tree), every array of the object is a member of its own. How a file takes its place: `octoctrl.files.writing`.
"""

import contextlib
import importlib
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from octoctrl import __version__
from octoctrl.planners.asking.registry import stored_kinds
from octoctrl.sim.annotations import made as made_of
from octoctrl.sim.archives import read_archive, write_archive
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.registries import enter
from octoctrl.sim.writing import check_suffix

from ..extras import extra
from . import netcdf
from .writing import check_target

SCHEMA = 2
"""Version of the file format that this program writes."""

_HOMES = {
    "octoctrl.sim.body.arm": ("Arm", "LumpedSection"),
    "octoctrl.sim.body.layout": ("Family", "MuscleGroup", "MuscleLayout"),
    "octoctrl.sim.body.muscles": ("MuscleLaw",),
    "octoctrl.sim.body.squid": ("SquidTentacle",),
    "octoctrl.sim.scene.loads": ("PointLoad", "SpreadLoad"),
    "octoctrl.sim.scene.mesh": ("Mesh",),
    "octoctrl.sim.scene.objects": ("Box", "Capsule", "Cylinder", "Plane", "RigidObject", "Sphere"),
    "octoctrl.sim.scene.supports": ("Fixed", "Free", "Moved", "Push", "Springs"),
    "octoctrl.sim.scene.scene": ("Scene", "Water"),
    "octoctrl.sim.templates": ("Plateau", "Pulse", "Wave"),
    "octoctrl.sim.activation": ("Activation",),
    "octoctrl.sim.running.observation": ("Observation",),
    "octoctrl.sim.running.recording": ("Recording", "StrandMotion"),
    "octoctrl.sim.running.sensors": ("Sensors",),
    "octoctrl.sim.topology.trace": ("TopologyTrace", "TopologyConvention"),
    "octoctrl.planners.contracts": ("ControllerReport", "When"),
    "octoctrl.planners.asking.choice": ("Choice",),
    "octoctrl.planners.asking.schedule": ("Schedule",),
    "octoctrl.planners.asking.task": ("Drive", "Phase", "Task"),
    "octoctrl.planners.fitting.identified": ("IdentifiedModel", "ValidityRegion"),
    "octoctrl.planners.model.parameters": ("ReducedParameters",),
    "octoctrl.planners.model.reach": ("ReachLimits",),
    "octoctrl.planners.model.reduced": ("ReducedModel", "ReducedMotion"),
    "octoctrl.planners.solving.plan": ("Alternative", "GoalReport", "Plan", "PlanReport", "PlanStatus"),
    "octoctrl.carrying.replanning": ("Replanning",),
    "octoctrl.carrying.run_parts": ("RunPart", "RunStart"),
    "octoctrl.carrying.results": (
        "Check",
        "Event",
        "Execution",
        "ExecutionReport",
        "ExecutionStatus",
        "Replan",
        "Verdict",
        "VerdictStatus",
    ),
    "octoctrl.files.configuration": ("Configuration", "PlanSettings", "RunSettings"),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}
_REGISTERED: dict[str, type] = {}


def register(kind: type) -> type:
    """Let files hold objects of a dataclass or enum of the user's own; usable as a decorator.

    Parameters
    ----------
    kind : type

    Returns
    -------
    type
        The same.

    Raises
    ------
    OctoctrlError
        If the name is taken, or the class is neither.
    """
    name = kind.__name__
    if name in _HOME_OF:
        raise OctoctrlError(f"a class called '{name}' can be stored already; choose another name")
    if not is_dataclass(kind) and not issubclass(kind, Enum):
        raise OctoctrlError(f"{name} is neither a dataclass nor an enum; only those can be stored")
    return enter(_REGISTERED, "class that can be stored", name, kind)


def save(path: str | Path, item: Any, *, overwrite: bool = False, origin: Mapping[str, str] | None = None) -> Path:
    """Write an object to a .npz file, or a run to a NetCDF4 file (.nc, with the extra ``io``).

    Parameters
    ----------
    path : str or Path
    item : Plan, Execution, Recording, TopologyTrace or any of the objects they are made of
    overwrite : bool
        Whether an existing file may be replaced.
    origin : dict of str to str, optional
        What the header should say besides versions and command, such as the configuration.

    Returns
    -------
    Path

    Raises
    ------
    OctoctrlError
        If the suffix is unknown, the file exists, or the object holds something that cannot be stored.
    """
    path = check_file(path, overwrite=overwrite, run=type(item).__name__ == "Execution")
    arrays: dict[str, np.ndarray] = {}
    header = {
        "schema": SCHEMA,
        "content": type(item).__name__,
        "versions": versions(),
        "argv": sys.argv,
        "origin": dict(origin or {}),
        "object": _encode(item, arrays, type(item).__name__),
    }
    if path.suffix == ".nc":
        netcdf.write(path, header, arrays, item)
    else:
        write_archive(path, header, arrays)
    return path


def check_file(path: str | Path, *, overwrite: bool = False, run: bool = True) -> Path:
    """Check the `path` of a file that is to hold an object, before the work; `overwrite` allows for an old one, only a `run` can be .nc.

    Raises
    ------
    OctoctrlError
        As `check_target` does, or if the extra is not installed.
    """
    path = check_target(path, overwrite=overwrite, suffixes=(".npz", ".nc") if run else (".npz",))
    if path.suffix == ".nc":
        extra("io", "xarray", "h5netcdf", "h5py")
    return path


def load(path: str | Path, *, expect: str | None = None) -> Any:
    """Read an object from a file, or what the parts hold of one that was broken off while it was made.

    Parameters
    ----------
    path : str or Path
    expect : str, optional
        Name of the class that the file should hold.

    Returns
    -------
    object

    Raises
    ------
    OctoctrlError
        If the file does not exist, is not one of ours, is newer than this program, or holds something else.
    """
    from .parts import folder_of, load_joined

    if not Path(path).is_file() and folder_of(path).is_dir():
        item = load_joined(folder_of(path))
        _check_content(path, type(item).__name__, expect)
        return item
    path, header, arrays = _open(path)
    _check_content(path, header["content"], expect)
    try:
        return _decode(header["object"], arrays)
    except _UnknownClassError:
        raise
    except Exception as error:  # whatever the classes make of values that they do not have
        written = header["versions"].get("octoctrl", "?")
        origin = (
            "is damaged" if written == __version__ else f"was written by octoctrl {written}, which this one, {__version__}, does not know"
        )
        raise OctoctrlError(f"{path} {origin}: {f'no {error}' if isinstance(error, KeyError) else error}") from error


def _check_content(path: str | Path, held: str, expect: str | None) -> None:
    if expect is not None and held != expect:
        advice = {"Plan": "make one with: octoctrl plan", "Execution": "make one with: octoctrl run"}.get(expect, "")
        names = {"Plan": "a plan", "Execution": "a run"}
        found, wanted = (names.get(name, f"'{name}'") for name in (held, expect))
        raise OctoctrlError(f"{path} holds {found}, not {wanted}{'; ' + advice if advice else ''}")


class _UnknownClassError(OctoctrlError):
    """The file holds an object of a class that must be registered first."""


def read_header(path: str | Path) -> dict[str, Any]:
    """Read what a file says of itself: schema, content, versions, argv, origin.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    dict
    """
    _, header, _ = _open(path)
    return {key: value for key, value in header.items() if key != "object"}


_HEADER = {"content": str, "versions": dict, "argv": list, "origin": dict, "object": dict}
"""What every header says besides its schema."""


def _open(path: str | Path) -> tuple[Path, dict[str, Any], dict[str, np.ndarray]]:
    path = check_suffix(path, (".npz", ".nc"))
    header, arrays = (netcdf.read(path) if path.suffix == ".nc" else read_archive(path)) or ({}, {})
    schema = header.get("schema")
    known = schema == SCHEMA and all(isinstance(header.get(key), kind) for key, kind in _HEADER.items())
    if type(schema) is not int or (schema == SCHEMA and not known):
        raise OctoctrlError(f"{path} is not a file of octoctrl, or is damaged")
    if schema != SCHEMA:
        advice = "pip install -U octoctrl" if schema > SCHEMA else "make the file again"
        raise OctoctrlError(f"{path} has schema {schema}, this octoctrl reads {SCHEMA}: {advice}")
    return path, header, arrays


def versions() -> dict[str, str]:
    """Versions of Python, of this program and of what it computes with."""
    from importlib.metadata import PackageNotFoundError, version

    found = {"python": ".".join(map(str, sys.version_info[:3]))}
    for name in ("octoctrl", "numpy", "numba", "casadi", "control"):
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _class(name: Any) -> Any:
    if not isinstance(name, str) or not name.isidentifier() or len(name) > 100:
        raise ValueError("a class has no name")
    kind = _known(name)
    if kind is None:
        raise _UnknownClassError(
            f"the file holds a '{name}', which this program does not know; call octoctrl.files.store.register({name}) first"
        )
    return kind


def _known(name: str) -> Any:
    """The class of that name that files may hold, or None; primitives and goals have registries of their own."""
    if name in _HOME_OF:
        return getattr(importlib.import_module(_HOME_OF[name]), name)
    return _REGISTERED.get(name) or stored_kinds().get(name)


def _encode(item: Any, arrays: dict[str, np.ndarray], place: str) -> Any:
    """Turn an object into a JSON tree; arrays go to `arrays`, by place."""
    name = type(item).__name__
    known = type(item) is _known(name)
    if known and isinstance(item, Enum):  # before anything that its members may be as well: text, a number
        return {"enum": name, "name": item.name}
    if item is None or isinstance(item, bool) or (isinstance(item, str) and not isinstance(item, Enum)):
        return item
    if isinstance(item, np.ndarray) and item.dtype != object:
        arrays[place] = item
        return {"array": place}
    if isinstance(item, np.generic):
        item = item.item()
    if isinstance(item, int) and not isinstance(item, Enum):
        return item
    if isinstance(item, float):
        return item if isfinite(item) else {"float": str(item)}
    if isinstance(item, list):
        return [_encode(inner, arrays, f"{place}[{index}]") for index, inner in enumerate(item)]
    if type(item) is tuple:
        return {"tuple": [_encode(inner, arrays, f"{place}[{index}]") for index, inner in enumerate(item)]}
    if isinstance(item, dict):
        return {"dict": [[_encode(key, arrays, place), _encode(inner, arrays, f"{place}.{key}")] for key, inner in item.items()]}
    if known and is_dataclass(item):
        return {
            "type": name,
            "fields": {entry.name: _encode(getattr(item, entry.name), arrays, f"{place}.{entry.name}") for entry in fields(item)},
        }
    raise OctoctrlError(
        f"{place} is of type {name}, which cannot be stored; a dataclass of your own needs octoctrl.files.store.register({name}) first"
    )


def _decode(tree: Any, arrays: dict[str, np.ndarray]) -> Any:
    if isinstance(tree, list):
        return [_decode(inner, arrays) for inner in tree]
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        return arrays[tree["array"]]
    if "float" in tree:
        return float(tree["float"])
    if "tuple" in tree:
        return tuple(_decode(inner, arrays) for inner in tree["tuple"])
    if "dict" in tree:
        return {_decode(key, arrays): _decode(inner, arrays) for key, inner in tree["dict"]}
    if "enum" in tree:
        return _class(tree["enum"])[tree["name"]]
    kind = _class(tree["type"])
    values = {name: _decode(inner, arrays) for name, inner in tree["fields"].items()}
    made = made_of(kind, values)
    for name, value in values.items():
        # A constructor may normalise what it is given, and a second time to other last digits; what was stored is what counts.
        if not isinstance(value, np.ndarray):
            object.__setattr__(made, name, value)
    return made
