"""States of plants as .npz files: the arrays of the motion, and what the plant must be that goes on from them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..archives import check_source, read_archive, write_archive
from ..contracts import State
from ..errors import OctoctrlError, brief
from ..writing import check_suffix, check_target

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
    write_archive(path, {"state": SCHEMA, IDENTITY: dict(identity)}, state)
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
    path = check_source(check_suffix(path, (".npz",)), "write one with Plant.save")
    header, state = read_archive(path) or ({}, {})
    schema, found = header.get("state"), header.get(IDENTITY)
    plain = isinstance(found, dict) and all(
        value is None or (isinstance(value, str | int | float) and str(value).isprintable()) for value in found.values()
    )
    if type(schema) is not int or schema < 1 or not isinstance(found, dict) or not plain:
        raise OctoctrlError(f"{path} holds no state of a plant, or is damaged")
    if schema > SCHEMA:
        raise OctoctrlError(f"{path} was written by a newer octoctrl: pip install -U octoctrl")
    check_identity(path, found, identity)
    return state


def check_identity(path: str | Path, found: Mapping[str, Any], identity: Mapping[str, Any]) -> None:
    """Check that a plant of this `identity` is the one that was `found` in the file at `path`.

    Raises
    ------
    OctoctrlError
        If it is another; the message names what differs.
    """
    for name in dict.fromkeys((*identity, *found)):
        mine, theirs = identity.get(name, "none"), found.get(name, "none")
        if mine != theirs:
            said = brief(name)
            raise OctoctrlError(f"{path}: state has {said}={brief(theirs)}, this plant {said}={mine}; make the plant as it was when saved")
