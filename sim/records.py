"""Records that hold arrays: compared by value, and shown in one line."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from .errors import OctoctrlError

WIDEST = 40
"""Characters of a text that are shown."""


class Record:
    """Base of frozen dataclasses some of whose fields are arrays, made with ``eq=False, repr=False``.

    Python would compare them by the truth of an array, which is an error, and show every number. Two records are equal if they are of one
    class and all their fields are, arrays to the last bit of every number, with undefined numbers equal to each other.
    """

    __slots__ = ()
    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(_equal(getattr(self, name), getattr(other, name)) for name in _names(self))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={_shown(getattr(self, name))}' for name in _names(self))})"


def check_shapes(what: str, arrays: Mapping[str, tuple[Any, tuple[int | str, ...]]]) -> dict[str, int]:
    """Check that arrays fit together.

    Parameters
    ----------
    what : str
        What they are of, for the message.
    arrays : mapping of str to (array, tuple)
        By name, with their axes: a length, or the name of one that all arrays with that axis share.

    Returns
    -------
    dict of str to int
        Lengths of the axes by name.

    Raises
    ------
    OctoctrlError
        If one has another shape than it should.
    """
    lengths: dict[str, int] = {}
    for name, (array, axes) in arrays.items():
        shape = np.shape(array)
        if len(shape) == len(axes):
            for axis, length in zip(axes, shape, strict=True):
                lengths.setdefault(str(axis), length if isinstance(axis, str) else axis)
        wanted = tuple(lengths.get(str(axis), axis) for axis in axes)
        if shape != wanted:
            raise OctoctrlError(f"{what}: {name} has shape {shape}, expected {wanted}")
    return lengths


def _names(record: Any) -> list[str]:
    return [field.name for field in fields(record)]


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        if type(one) is not type(other) or one.dtype != other.dtype:
            return False
        return np.array_equal(one, other, equal_nan=one.dtype.kind in "fc")
    if isinstance(one, tuple | list):
        return type(one) is type(other) and len(one) == len(other) and all(map(_equal, one, other))
    if isinstance(one, dict):
        return isinstance(other, dict) and one.keys() == other.keys() and all(_equal(value, other[key]) for key, value in one.items())
    return bool(one == other) or bool(one != one and other != other)


def _shown(value: Any) -> str:
    """A value in a few words: arrays by their shape, records by their class, what holds many things by how many."""
    if isinstance(value, np.ndarray):
        return f"<{value.dtype}{list(value.shape)}>"
    if isinstance(value, Enum):
        return value.name
    if is_dataclass(value) and not isinstance(value, type):
        return f"<{type(value).__name__}>"
    if isinstance(value, tuple | list | dict):
        return f"<{len(value)}>" if value else "<none>"
    text = f"{value:g}" if isinstance(value, float) else repr(value)
    return text if len(text) <= WIDEST else f"{text[: WIDEST - 1]}…"
