"""The kinds of primitives and goals by name: what task files may say, what files may hold, what messages list.

A class registers itself where it is written. The goals of the folder `goals` are found by looking into it.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from types import MappingProxyType
from typing import Any, TypeVar

from octoctrl.sim.errors import OctoctrlError, brief, suggest
from octoctrl.sim.registries import enter

from ..contracts import Goal, Primitive

Kind = TypeVar("Kind", bound=type)

_PRIMITIVES: dict[str, type] = {}
_GOALS: dict[str, type] = {}
_PARTS: dict[str, type] = {}


def register_primitive(kind: Kind) -> Kind:
    """Let task files name a primitive and files hold it; a decorator.

    Parameters
    ----------
    kind : type
        Frozen dataclass with the methods of `octoctrl.planners.contracts.Primitive`; its name is the class's.

    Returns
    -------
    type
        The same.

    Raises
    ------
    OctoctrlError
        If it is not a dataclass, or the name is taken.
    """
    return _register(kind, "primitive", kind.__name__, _PRIMITIVES)


def register_goal(kind: Kind) -> Kind:
    """Let task files name a kind of goal and files hold it; a decorator.

    Parameters
    ----------
    kind : type
        Frozen dataclass with the methods of `octoctrl.planners.contracts.Goal`; its name is its `quantity`.

    Returns
    -------
    type
        The same.

    Raises
    ------
    OctoctrlError
        If it is not a dataclass, or the name is taken.
    """
    return _register(kind, "goal", str(getattr(kind, "quantity", "")), _GOALS)


def register_part(kind: Kind) -> Kind:
    """Let files hold what a primitive or a goal consists of; a decorator.

    Parameters
    ----------
    kind : type
        Frozen dataclass.

    Returns
    -------
    type
        The same.

    Raises
    ------
    OctoctrlError
        If it is not a dataclass, or the name is taken.
    """
    return _register(kind, "part", kind.__name__, _PARTS)


def _register(kind: Kind, what: str, name: str, table: dict[str, type]) -> Kind:
    if not name:
        raise OctoctrlError(f"{kind.__name__} has no quantity; write quantity: ClassVar[str] = ... in it")
    if not is_dataclass(kind):
        raise OctoctrlError(f"{kind.__name__} is not a dataclass; write @dataclass(frozen=True, kw_only=True) above it")
    if not kind.__module__.startswith(f"{__package__}."):  # all of the package's own come first, so that theirs are the names
        stored_kinds()
    enter({other.__name__: other for other in (*_PRIMITIVES.values(), *_GOALS.values(), *_PARTS.values())}, "class", kind.__name__, kind)
    enter(table, what, name, kind)
    return kind


def primitive_kinds() -> Mapping[str, type]:
    """Classes of primitives by name, in alphabetical order."""
    for name in (".primitives", ".wrapping"):
        importlib.import_module(name, __package__)
    return MappingProxyType(dict(sorted(_PRIMITIVES.items())))


def goal_kinds() -> Mapping[str, type]:
    """Classes of goals by quantity, in alphabetical order."""
    goals = importlib.import_module(".goals", __package__)
    for module in pkgutil.iter_modules(goals.__path__):
        importlib.import_module(f"{goals.__name__}.{module.name}")
    return MappingProxyType(dict(sorted(_GOALS.items())))


def stored_kinds() -> dict[str, type]:
    """All classes of primitives, goals and their parts, by the class's name."""
    return {kind.__name__: kind for kind in (*primitive_kinds().values(), *goal_kinds().values(), *_PARTS.values())}


def primitive(kind: str, **numbers: Any) -> Primitive:
    """Make a primitive by name.

    Parameters
    ----------
    kind : str
        Of `primitive_kinds`.
    **numbers
        Its fields.

    Raises
    ------
    OctoctrlError
        If the name or a keyword is unknown; the message suggests the nearest.
    """
    made: Primitive = _make("primitive", primitive_kinds(), kind, numbers)
    return made


def goal(quantity: str, **numbers: Any) -> Goal:
    """Make a goal by the quantity that it is about.

    Parameters
    ----------
    quantity : str
        Of `goal_kinds`.
    **numbers
        Its fields: mostly one of ``value, at_least, at_most, between``, and a ``tolerance``.

    Raises
    ------
    OctoctrlError
        If the quantity or a keyword is unknown; the message suggests the nearest.

    Examples
    --------
    >>> print(goal("twist", value=-1.0, tolerance=0.1))
    twist -1 ± 0.1 turns
    """
    made: Goal = _make("quantity", goal_kinds(), quantity, numbers)
    return made


def _make(what: str, kinds: Mapping[str, type], name: str, numbers: dict[str, Any]) -> Any:
    if not isinstance(name, str) or name not in kinds:
        raise OctoctrlError(f"unknown {what} '{brief(name)}'{suggest(name, kinds)} ({', '.join(kinds)})")
    known = [item.name for item in fields(kinds[name])]
    for key in numbers:
        if key not in known:
            raise OctoctrlError(f"{name} has no '{brief(key)}'{suggest(key, known)} ({', '.join(known)})")
    needed = [item.name for item in fields(kinds[name]) if item.default is MISSING and item.default_factory is MISSING]
    missing = [item for item in needed if item not in numbers]
    if missing:
        raise OctoctrlError(f"{name} needs {' and '.join(missing)} as well ({', '.join(known)})")
    return kinds[name](**numbers)
