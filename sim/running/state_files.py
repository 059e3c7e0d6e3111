"""States of plants as .npz files: the arrays of the motion, and what the plant must be that goes on from them."""

import json
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..contracts import State
from ..errors import OctoctrlError
from ..writing import check_target, written_aside

SCHEMA = 1
"""Version of the file format."""

IDENTITY = "identity"


def write_state(path: str | Path, state: State, identity: Mapping[str, Any], *, overwrite: bool = False) -> Path:
    """Write a state.

    Parameters
    ----------
    path : str or Path
    state : mapping of str to array
    identity : mapping of str to str or number
    overwrite : bool

    Returns
    -------
    Path

    Raises
    ------
    OctoctrlError
        If the suffix is not ``.npz``, the file exists and may not be replaced, or it cannot be written.
    """
    path = check_target(path, overwrite=overwrite)
    text = json.dumps({"state": SCHEMA, IDENTITY: dict(identity)}, allow_nan=False)
    with written_aside(path) as part, open(part, "wb") as file:
        np.savez(file, allow_pickle=False, header=np.frombuffer(text.encode(), dtype=np.uint8), **state)
    return path


def read_state(path: str | Path, identity: Mapping[str, Any]) -> State:
    """Read a state of a plant of this `identity`.

    Parameters
    ----------
    path : str or Path
    identity : mapping of str to str or number

    Returns
    -------
    mapping of str to array

    Raises
    ------
    OctoctrlError
        If there is no such file, it holds no state or is damaged, was written by a newer octoctrl, or belongs to another plant.
    """
    path = Path(path)
    if path.suffix != ".npz":
        raise OctoctrlError(f"unknown format '{path.suffix}'; use .npz")
    if not path.is_file():
        raise OctoctrlError(f"{path} does not exist; write one with Plant.save")
    try:
        with np.load(path, allow_pickle=False) as archive:
            state = {name: archive[name] for name in archive.files}
        header = json.loads(state.pop("header").tobytes())
        schema, found = header["state"], dict(header[IDENTITY])
        whole = type(schema) is int and schema > 0
    except (OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, NotImplementedError, zipfile.BadZipFile, zlib.error):
        whole = False
    if not whole:
        raise OctoctrlError(f"{path} holds no state of a plant, or is damaged")
    if schema > SCHEMA:
        raise OctoctrlError(f"{path} was written by a newer octoctrl: pip install -U octoctrl")
    for name in dict.fromkeys((*identity, *found)):
        mine, theirs = identity.get(name, "none"), found.get(name, "none")
        if mine != theirs:
            raise OctoctrlError(f"{path}: state has {name}={theirs}, this plant {name}={mine}; make the plant as it was when saved")
    return state
