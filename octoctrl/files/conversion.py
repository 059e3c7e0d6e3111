"""From tables to objects along the type hints of their classes: keys are checked, units converted, mistakes named with their place.

Numbers are SI; a string with one of a few units ("12 mm", "250 ms", "10 kPa", "45 deg") is accepted where the unit makes sense. Where a
field may hold objects of several classes, the key `kind` names the class.
"""

import re
import types
import typing
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass, replace
from decimal import Decimal, InvalidOperation
from enum import Enum
from inspect import isabstract
from math import inf, radians
from typing import Any

from octoctrl.planners.asking.registry import goal_kinds, primitive_kinds
from octoctrl.planners.asking.shares import Share, unresolved
from octoctrl.planners.asking.task import CHOOSE, Drive
from octoctrl.planners.contracts import Goal
from octoctrl.sim.errors import OctoctrlError, brief, suggest

from .toml_source import Path, Source, found

UNITS: dict[str, tuple[str, dict[str, int | None]]] = {
    "m": ("metres", {"m": 0, "cm": -2, "mm": -3}),
    "s": ("seconds", {"s": 0, "ms": -3}),
    "m/s": ("metres per second", {"m/s": 0, "cm/s": -2, "mm/s": -3}),
    "Pa": ("pascals", {"Pa": 0, "kPa": 3, "MPa": 6}),
    "rad": ("radians", {"rad": 0, "deg": None}),
    "rad/s": ("radians per second", {"rad/s": 0, "deg/s": None}),
    "kg": ("kilograms", {"kg": 0, "g": -3, "mg": -6}),
    "kg/m^3": ("kilograms per cubic metre", {"kg/m^3": 0, "g/cm^3": 3}),
    "N": ("newtons", {"N": 0, "mN": -3}),
    "N/m": ("newtons per metre", {"N/m": 0, "N/mm": 3}),
    "N m": ("newton metres", {"N m": 0, "mN m": -3}),
}
"""For each SI unit its name in words, and the accepted units with their powers of ten (None: degrees)."""

_FIELDS_IN = {
    "m": "length base_radius ring_radius oblique_radius oblique_pitch window width centre radius margin start stop point position size "
    "stretch vertices apex arclength sarcomere myosin",
    "s": "duration shortest longest rise fall onset offset time_limit hold since until period lasts times delay",
    "m/s": "speed velocity",
    "Pa": "youngs_modulus shear_modulus maximum_stress compression_modulus stiffness",
    "rad": "sucker_azimuth azimuth",
    "rad/s": "spin",
    "kg": "mass club_mass tip_mass",
    "kg/m^3": "density densities",
    "N": "Push.force PointLoad.force",
    "N/m": "Springs.stiffness SpreadLoad.force",
    "N m": "Springs.turning PointLoad.torque",
}
UNIT_OF = {name: unit for unit, names in _FIELDS_IN.items() for name in names.split()}
"""Unit of the fields that have one, by name, or by class and name."""

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_IN_UNIT_OF_GOAL = ("value", "at_least", "at_most", "between", "tolerance")
_PLAIN: dict[type, tuple[type, str]] = {str: (str, "text"), int: (int, "a whole number"), bool: (bool, "true or false")}


def build(hint: Any, value: Any, source: Source, path: Path = (), *, unit: str | None = None, default: Any = None) -> Any:
    """Make what a type hint asks for of what a TOML file says.

    Parameters
    ----------
    hint : type
        A frozen dataclass, a tuple, a union, an enum or a plain type.
    value : object
        Tables, lists, strings and numbers.
    source : Source
        For messages.
    path : tuple of str and int
        Where the value stands in the file.
    unit : str, optional
        SI unit of its numbers.
    default : object, optional
        Of which a table changes single fields.

    Raises
    ------
    OctoctrlError
        If a key is unknown or missing, a type is wrong, or an object refuses its values.
    """
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        return _build_one_of(typing.get_args(hint), value, source, path, unit, default)
    if hint is Goal:
        return _build_goal(value, source, path)
    if hint is Drive:
        return _build_drive(value, source, path)
    if is_dataclass(hint) and isinstance(hint, type):
        if isinstance(value, hint):  # made already, of what the file names
            return value
        return _build_table([hint], value, source, path, default)
    if hint == tuple[Drive, ...] and value == CHOOSE:
        return value
    if origin is tuple:
        return _build_tuple(typing.get_args(hint), value, source, path, unit)
    if hint is float:
        return _number(value, unit, source, path)
    if isinstance(hint, type) and issubclass(hint, Enum):
        if value not in (known := [item.value for item in hint]):
            raise OctoctrlError(f"{source.where(path)}: expected {' or '.join(known)}, found {found(value)}")
        return hint(value)
    if hint in _PLAIN and (not isinstance(value, _PLAIN[hint][0]) or (hint is int and isinstance(value, bool))):
        raise OctoctrlError(f"{source.where(path)}: expected {_PLAIN[hint][1]}, found {found(value)}")
    return value


def _build_one_of(choices: tuple[Any, ...], value: Any, source: Source, path: Path, unit: str | None, default: Any) -> Any:
    if type(None) in choices and value == "none":
        return None
    if Share in choices and unit == "m" and isinstance(value, str) and (match := re.fullmatch(rf"\s*({_NUMBER})\s*%\s*", value)):
        return Share(percent=float(match[1]))
    choices = tuple(choice for choice in choices if choice is not Share)
    classes = [choice for choice in choices if is_dataclass(choice)]
    others = [choice for choice in choices if choice is not type(None) and choice not in classes]
    if classes and (isinstance(value, Mapping) or not others):
        return _build_table(classes, value, source, path, default)
    return build(others[0], value, source, path, unit=unit, default=default)


def _build_tuple(inner: tuple[Any, ...], value: Any, source: Source, path: Path, unit: str | None) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise OctoctrlError(f"{source.where(path)}: expected a list, found {found(value)}")
    hints = [inner[0]] * len(value) if len(inner) == 2 and inner[1] is Ellipsis else list(inner)
    if len(hints) != len(value):
        raise OctoctrlError(f"{source.where(path)}: expected {len(hints)} values, found {len(value)}")
    return tuple(build(kind, item, source, (*path, index), unit=unit) for index, (item, kind) in enumerate(zip(value, hints, strict=True)))


def _build_table(classes: list[Any], table: Any, source: Source, path: Path, default: Any = None) -> Any:
    """An object of one of the classes or of their subclasses, named by `kind`; else that of the default, or the first."""
    _check_table(table, source, path)
    kind = type(default) if default is not None else classes[0]
    known = {choice.__name__: choice for choice in _with_subclasses(classes) if not isabstract(choice)}
    if kind.__name__ not in known and "kind" not in table:
        raise OctoctrlError(f"{source.where(path)}: 'kind' is missing ({', '.join(known)})")
    if "kind" in table and not any(item.name == "kind" for item in fields(kind)):
        name = next((word for word in known if word.lower() == str(table["kind"]).lower()), str(table["kind"]))
        if name not in known:
            raise OctoctrlError(f"{source.where((*path, 'kind'))}: unknown kind '{brief(name)}'{suggest(name, known)} ({', '.join(known)})")
        default, kind = default if known[name] is kind else None, known[name]
        table = {key: value for key, value in table.items() if key != "kind"}
    elif len(known) > 1 and kind.__name__ in known:
        _check_kind_is_named(kind, known, table, source, path)
    return _build_fields(kind, table, source, path, default)


def _check_kind_is_named(kind: Any, known: Mapping[str, Any], table: Mapping[str, Any], source: Source, path: Path) -> None:
    """Check that a table without `kind` has no key that only other kinds have."""
    own = {item.name for item in fields(kind)}
    for key in table:
        others = [name for name, other in known.items() if key not in own and any(item.name == key for item in fields(other))]
        if others:
            where = source.where((*path, key))
            raise OctoctrlError(f"{where}: {kind.__name__} has no '{key}'; say kind = {' or '.join(map(repr, others))}")


def _build_fields(kind: Any, table: Mapping[str, Any], source: Source, path: Path, default: Any = None, **ready: Any) -> Any:
    """The object of the class `kind` with the fields of the table, those that are `ready`, and the others of the default."""
    known = [item.name for item in fields(kind)]
    hints = typing.get_type_hints(kind)
    inner = {f"{name}.{item.name}": item.name for name in known if is_dataclass(hints[name]) for item in fields(hints[name])}
    _check_keys(table, known, source, path, inner)
    if default is None:
        for item in fields(kind):
            if item.name not in table and item.name not in ready and item.default is MISSING and item.default_factory is MISSING:
                raise OctoctrlError(f"{source.where(path)}: '{item.name}' is missing")
    for item in fields(kind):
        if item.name in table and item.name not in ready:
            usual = getattr(default, item.name, item.default)
            ready[item.name] = build(
                hints[item.name], table[item.name], source, (*path, item.name), unit=_unit(kind, item.name),
                default=usual if is_dataclass(usual) else None,
            )  # fmt: skip
    try:
        return kind(**ready) if default is None else replace(default, **ready)
    except OctoctrlError as error:
        # A complaint about a table is about one of its keys, as far as one can tell; the whole task's are about no key of its own.
        place = path if path in ((), ("task",)) else source.culprit(path, str(error))
        raise OctoctrlError(f"{source.where(place)}: {error}") from None


def _build_goal(table: Any, source: Source, path: Path) -> Any:
    _check_table(table, source, path)
    if "quantity" not in table:
        raise OctoctrlError(f"{source.where(path)}: 'quantity' is missing")
    kind = _named("quantity", table["quantity"], goal_kinds(), source, (*path, "quantity"))
    return _build_fields(kind, {key: value for key, value in table.items() if key != "quantity"}, source, path)


def _build_drive(table: Any, source: Source, path: Path) -> Any:
    """A drive; its table names the primitive and has the primitive's fields under `settings`."""
    _check_table(table, source, path)
    _check_keys(table, [*(item.name for item in fields(Drive)), "settings"], source, path)
    if "primitive" not in table:
        raise OctoctrlError(f"{source.where(path)}: 'primitive' is missing")
    kind = _named("primitive", table["primitive"], primitive_kinds(), source, (*path, "primitive"))
    settings = table.get("settings", {})
    _check_table(settings, source, (*path, "settings"))
    primitive = _build_fields(kind, settings, source, (*path, "settings"))
    start, stop = getattr(primitive, "start", 0.0), getattr(primitive, "stop", inf)
    if not unresolved((start, stop)) and start >= stop:
        where = source.where((*path, "settings"))
        raise OctoctrlError(f"{where}: start={start:g} m is not before stop={stop:g} m; give the end that is nearer to the base first")
    rest = {key: value for key, value in table.items() if key != "settings"}
    return _build_fields(Drive, rest, source, path, primitive=primitive)


def _named(what: str, name: Any, kinds: Mapping[str, type], source: Source, path: Path) -> type:
    if not isinstance(name, str) or name not in kinds:
        raise OctoctrlError(f"{source.where(path)}: unknown {what} '{brief(name)}'{suggest(name, kinds)} ({', '.join(kinds)})")
    return kinds[name]


def _with_subclasses(classes: Iterable[Any]) -> Iterable[Any]:
    for kind in classes:
        yield kind
        yield from _with_subclasses(kind.__subclasses__())


def _check_table(table: Any, source: Source, path: Path) -> None:
    if not isinstance(table, Mapping):
        raise OctoctrlError(f"{source.where(path)}: expected a table, found {found(table)}")


def _check_keys(table: Mapping[str, Any], known: list[str], source: Source, path: Path, inner: Mapping[str, str] | None = None) -> None:
    """Check that a `table` has `known` keys only; what is one of the `inner` names, or nearly, is looked for one table further in."""
    for key in table:
        if key not in known:
            within = [place for place, name in (inner or {}).items() if key in (name, name.removesuffix("s"))]
            meant = f"; did you mean '{within[0]}'?" if within else suggest(key, known)
            raise OctoctrlError(f"{source.where((*path, key))}: unknown key{meant} (known: {', '.join(known)})")


def _unit(kind: Any, name: str) -> str | None:
    """SI unit of a field, if it has one that can be written; the target of a goal is in the goal's unit."""
    unit = getattr(kind, "unit", None) if name in _IN_UNIT_OF_GOAL else unit_of(kind, name)
    return unit if unit in UNITS else None


def unit_of(kind: type, name: str) -> str | None:
    """SI unit of the field `name` of a class (`kind`), None if it has none that can be written."""
    return UNIT_OF.get(f"{kind.__name__}.{name}", UNIT_OF.get(name))


def _number(value: Any, unit: str | None, source: Source, path: Path) -> float:
    """A float; a string is a number with a unit."""
    words, powers = UNITS[unit] if unit else ("", {})
    try:
        if isinstance(value, str):
            match = re.fullmatch(rf"\s*({_NUMBER})\s*([A-Za-zµ°%/^0-9 ]*?)\s*", value)
            if match and unit and match[2] in powers:
                power = powers[match[2]]
                return radians(float(match[1])) if power is None else float(Decimal(match[1]).scaleb(power))
            if match and unit and match[2]:
                raise OctoctrlError(f"{source.where(path)}: unit '{match[2]}' not known; use {', '.join(powers)}")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            return float(value)
    except (OverflowError, InvalidOperation):
        raise OctoctrlError(f"{source.where(path)}: the number is beyond 1e308") from None
    raise OctoctrlError(f"{source.where(path)}: expected a number{f' in {words}' if words else ''}, found {found(value)}")
