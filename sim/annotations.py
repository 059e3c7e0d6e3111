"""Whether what a user or a file says fits the annotated fields of a class: numbers where numbers belong, arrays where arrays do."""

import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from typing import Any, TypeVar

import numpy as np

from .errors import OctoctrlError, a, brief

Made = TypeVar("Made")


def check_fields(kind: type, values: Mapping[str, Any]) -> None:
    """Check the `values` of the fields of a dataclass (`kind`).

    Raises
    ------
    TypeError
        If one does not fit its annotation; what an annotation does not say is not checked.
    """
    hints = _hints(kind)
    for name, value in values.items():
        if name in hints and not fits(hints[name], value):
            raise TypeError(f"{kind.__name__}.{name} is of type {type(value).__name__}")


def made(kind: type[Made], values: Mapping[str, Any]) -> Made:
    """An object of a dataclass (`kind`) from `values` out of a file.

    Raises
    ------
    TypeError
        If they do not fit, or one is missing or too much.
    """
    check_fields(kind, values)
    return kind(**values)


def fits(hint: Any, value: Any) -> bool:
    """Whether a `value` is what a type `hint` asks for, as far as the hint is one of those that stored classes have."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return any(fits(choice, value) for choice in inner)
    if origin is np.ndarray or hint is np.ndarray:
        return isinstance(value, np.ndarray) and _of_kind(inner, value)
    if origin is tuple:
        if not isinstance(value, tuple):
            return False
        if len(inner) == 2 and inner[1] is Ellipsis:
            return all(fits(inner[0], item) for item in value)
        return len(inner) == len(value) and all(map(fits, inner, value))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return isinstance(value, dict) and all(fits(inner[0], key) and fits(inner[1], item) for key, item in value.items())
    if isinstance(origin, type) and issubclass(origin, Sequence):
        return isinstance(value, list | tuple) and all(fits(inner[0], item) for item in value)
    if origin is typing.Literal:
        return value in inner
    if hint is float:
        return isinstance(value, float) or fits(int, value)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1 << 63
    if hint is None or hint is type(None):
        return value is None
    if isinstance(hint, type) and (hint in (str, bool) or is_dataclass(hint) or issubclass(hint, Enum) or _checkable(hint)):
        return isinstance(value, hint)
    return True


def settle(item: Any) -> None:
    """Check the fields of a dataclass (`item`) as it is made against their annotations: texts, truths, objects, and several of them.

    Lists and arrays become tuples. Numbers are left to who knows their ranges, and so is what fulfils a protocol.

    Raises
    ------
    OctoctrlError
        If a field is something else.
    """
    kind: type = type(item)
    for name, hint in _looked_at(kind):
        value = _kept(item, name, hint)
        if _is_settled(hint, value):
            continue
        needed = f"{_words(hint)} {'are' if _is_tuple(hint) else 'is'} needed"
        if _is_tuple(hint) and _is_settled(hint, (value,)):
            needed += f", in brackets: ({brief(repr(value))},) for one"
        raise OctoctrlError(f"{kind.__name__}: {name} is {brief(repr(value))}; {needed}")


def as_tuples(item: Any) -> None:
    """Make tuples of the lists and arrays that a dataclass (`item`) was given where it keeps tuples."""
    kind: type = type(item)
    for name, hint in _looked_at(kind):
        _kept(item, name, hint)


def _kept(item: Any, name: str, hint: Any) -> Any:
    """The value of a field as the dataclass keeps it: a tuple, where that is annotated, of a list or an array."""
    value = getattr(item, name)
    if isinstance(value, list | np.ndarray) and _is_tuple(hint) and np.ndim(value):
        value = tuple(value.tolist() if isinstance(value, np.ndarray) else value)
        object.__setattr__(item, name, value)
    return value


@cache
def _looked_at(kind: type) -> tuple[tuple[str, Any], ...]:
    """Names and annotations of the fields of a dataclass that may be refused or become tuples: of most, numbers, nothing is asked."""
    hints = _hints(kind)
    pairs = ((field.name, hints.get(field.name, Any)) for field in fields(kind))
    return tuple((name, hint) for name, hint in pairs if _is_tuple(hint) or not _is_settled(hint, _NOTHING))


_NOTHING = object()
"""Of no kind that is ever asked for."""


def _is_tuple(hint: Any) -> bool:
    return typing.get_origin(hint) is tuple


def _is_settled(hint: Any, value: Any) -> bool:
    """Whether a value is of its kind, as far as that is looked at."""
    inner = typing.get_args(hint)
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return any(_is_settled(kind, value) for kind in inner)
    if _is_tuple(hint):
        numbers = inner[-1] is not Ellipsis or inner[0] in (float, int)
        return numbers or (isinstance(value, tuple) and all(_is_settled(inner[0], item) for item in value))
    looked_at = isinstance(hint, type) and (hint in (str, bool, types.NoneType) or is_dataclass(hint) or issubclass(hint, Enum))
    return not looked_at or fits(hint, value)


def _words(hint: Any) -> str:
    """What an annotation asks for, in words."""
    inner = typing.get_args(hint)
    if _is_tuple(hint):
        word = _words(inner[0]).split(maxsplit=1)[-1]
        return f"several {word}{'es' if word.endswith(('s', 'sh', 'x')) else 's'}"
    if inner:
        return " or ".join(map(_words, inner))
    return {str: "a text", bool: "True or False", types.NoneType: "None"}.get(hint) or a(getattr(hint, "__name__", str(hint)))


def _of_kind(inner: tuple[Any, ...], value: np.ndarray) -> bool:
    """Whether an array has numbers of the annotated kind."""
    wanted = typing.get_args(inner[1]) if len(inner) == 2 else ()
    if not wanted or not isinstance(wanted[0], type):
        return value.dtype.kind in "fiub"
    return np.issubdtype(value.dtype, wanted[0])


def _checkable(hint: type) -> bool:
    return bool(getattr(hint, "_is_protocol", False) and getattr(hint, "_is_runtime_protocol", False))


@cache
def _hints(kind: type) -> dict[str, Any]:
    try:
        return typing.get_type_hints(kind)
    except (NameError, TypeError):  # of a class of the user's that names what is imported for type checkers only
        return {}
