"""Task files: TOML in, frozen objects out, and every mistake in one sentence that names file, line and key.

The schema is the dataclasses: a key of the file is a field of `Configuration`, `Task`, `Phase`, `Goal`, `Drive`, `Arm`, `Scene` or
`Water`. Numbers are SI; a string with one of a few units ("12 mm", "250 ms", "10 kPa", "45 deg") is accepted where the unit makes sense.
"""

import json
import re
import tomllib
import types
import typing
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass
from decimal import Decimal
from math import inf, radians

import msgspec

from octoctrl.planners.asking.schedule import PRIMITIVES
from octoctrl.planners.asking.task import Drive, Goal, Task
from octoctrl.planners.following.controllers import check_feedback
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.body.muscles import MuscleLaw
from octoctrl.sim.errors import OctoctrlError, check_number, suggest
from octoctrl.sim.plants import check_plant
from octoctrl.sim.scene.scene import Scene

from .toml_source import Source, assign, found

UNITS = {
    "m": ("metres", {"m": 0, "cm": -2, "mm": -3}),
    "s": ("seconds", {"s": 0, "ms": -3}),
    "m/s": ("metres per second", {"m/s": 0, "cm/s": -2, "mm/s": -3}),
    "Pa": ("pascals", {"Pa": 0, "kPa": 3, "MPa": 6}),
    "rad": ("radians", {"rad": 0, "deg": None}),
}
"""For each SI unit its name in words, and the accepted units with their powers of ten (None: degrees)."""

_FIELDS_IN = {
    "m": "length base_radius ring_radius oblique_radius oblique_pitch window width",
    "s": "duration shortest longest rise fall onset offset time_limit",
    "m/s": "speed",
    "Pa": "youngs_modulus shear_modulus maximum_stress compression_modulus",
    "rad": "sucker_azimuth",
}
UNIT_OF = {name: unit for unit, names in _FIELDS_IN.items() for name in names.split()}
"""Unit of the fields that have one, by name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSettings:
    """How to plan.

    Attributes
    ----------
    time_limit : float, s
        Wall-clock limit of the optimisation; the best plan so far is kept.
    """

    time_limit: float = 60.0

    def __post_init__(self):
        check_number("time_limit", self.time_limit, above=0.0, unit="s")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """How to carry out the plan.

    Attributes
    ----------
    feedback : {"tvlqr", "open-loop"}
        What corrects the activations while the plant moves.
    plant : {"rod", "assembly", "assembly-coarse"}
        What the plan is made for and carried out on: one rod, or the full arm of 197 rods.
    """

    feedback: str = "tvlqr"
    plant: str = "rod"

    def __post_init__(self):
        check_feedback(self.feedback)
        check_plant(self.plant)


@dataclass(frozen=True, slots=True, kw_only=True)
class Configuration:
    """All that a task file says.

    Attributes
    ----------
    task : Task
        What the arm should do.
    arm : Arm
    scene : Scene
    plan : PlanSettings
    run : RunSettings
    """

    task: Task
    arm: Arm = field(default=Arm())
    scene: Scene = field(default=Scene())
    plan: PlanSettings = field(default=PlanSettings())
    run: RunSettings = field(default=RunSettings())


_DEFAULTS = {item.name: item.default for item in fields(Configuration) if item.default is not MISSING}


def parse(text, *, name="task.toml", overrides=()):
    """Read a configuration from TOML.

    Parameters
    ----------
    text : str
    name : str
        File name for messages.
    overrides : iterable of str
        Assignments such as ``task.phases.store.duration=1.2``; elements of a list are addressed by their `name` or as ``phases[0]``.

    Returns
    -------
    Configuration

    Raises
    ------
    OctoctrlError
        If anything is wrong, with file, line and key.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        reason, _, place = str(error).partition(" (at ")
        line = re.match(r"line (\d+)", place)
        raise OctoctrlError(f"{name}{':' + line[1] if line else ''}: not valid TOML: {reason[0].lower() + reason[1:]}") from None
    source = Source(name, text)
    for assignment in overrides:
        source.overridden.append(assign(data, assignment))
    return _convert(Configuration, data, source)


def convert(kind, table, *, name):
    """Make an object of a dataclass from plain tables, with the checks and units of `parse`.

    Parameters
    ----------
    kind : type
        Frozen dataclass.
    table : dict
    name : str
        File name for messages.

    Returns
    -------
    kind

    Raises
    ------
    OctoctrlError
        If a key is unknown or a value is wrong.
    """
    return _convert(kind, table, Source(name, ""))


def _convert(kind, data, source):
    ready = _normalise(data, kind, (), source)
    try:
        return msgspec.convert(ready, kind)
    except msgspec.ValidationError as error:
        raise OctoctrlError(_translate(error, data, source)) from None


def toml_of(configuration):
    """Write a configuration as commented TOML that `parse` reads back to an equal object.

    Parameters
    ----------
    configuration : Configuration
        The task is written in full; of arm, scene, plan and run, values that equal the default are written as comments.

    Returns
    -------
    str
    """
    task = configuration.task
    out = ["# Lengths in metres, times in seconds, angles in radians; strings with a unit work too: '12 mm', '250 ms', '45 deg'.", ""]
    simple = [item.name for item in fields(task) if item.name not in ("phases", "drives", "convention")]
    out += ["[task]", *_assignments(task, simple), ""]
    out += ["[task.convention]", *_assignments(task.convention), ""]
    for number, phase in enumerate(task.phases):
        names = [item.name for item in fields(phase) if item.name != "goals"]
        out += ["[[task.phases]]", *_assignments(phase, names, comments=number == 0), *_goals(phase.goals), ""]
    for number, drive in enumerate(task.drives):
        out += ["[[task.drives]]", *_assignments(drive, comments=number == 0), ""]
    for section in _DEFAULTS:
        out += _section(section, getattr(configuration, section), _DEFAULTS[section])
    return "\n".join(out).rstrip("\n") + "\n"


# ---------------------------------------------------------------- from tables to what the dataclasses expect


def _normalise(value, hint, path, source, unit=None, default=None):
    """Check keys and convert units, recursively along the type hints; other types are left to msgspec.

    A table changes single fields of the object that is the `default` of its field.
    """
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        inner = [choice for choice in typing.get_args(hint) if choice is not type(None)]
        return None if value == "none" else _normalise(value, inner[0], path, source, unit, default)
    if is_dataclass(hint):
        return _normalise_table(value, hint, path, source, default)
    if origin is tuple:
        if not isinstance(value, list):
            raise OctoctrlError(f"{source.where(path)}: expected a list, found {found(value)}")
        inner = typing.get_args(hint)
        hints = [inner[0]] * len(value) if len(inner) == 2 and inner[1] is Ellipsis else inner
        if len(hints) != len(value):
            raise OctoctrlError(f"{source.where(path)}: expected {len(hints)} values, found {len(value)}")
        return [_normalise(item, kind, (*path, index), source, unit) for index, (item, kind) in enumerate(zip(value, hints, strict=True))]
    if hint is float:
        return _number(value, unit, path, source)
    return value


def _normalise_table(table, kind, path, source, default=None):
    if not isinstance(table, Mapping):
        raise OctoctrlError(f"{source.where(path)}: expected a table, found {found(table)}")
    hints = typing.get_type_hints(kind)
    known = [item.name for item in fields(kind)]
    for key in table:
        if key not in known:
            raise OctoctrlError(f"{source.where((*path, key))}: unknown key{suggest(key, known)} (known: {', '.join(known)})")
    ready = asdict(default) if is_dataclass(default) else {}
    for item in fields(kind):
        if item.name not in table and item.name not in ready and item.default is MISSING and item.default_factory is MISSING:
            raise OctoctrlError(f"{source.where(path)}: '{item.name}' is missing")
    usual = {item.name: getattr(default, item.name, item.default) for item in fields(kind)}
    for key, value in table.items():
        unit = "m" if kind is Goal and key in ("value", "tolerance") and table.get("quantity") == "length" else UNIT_OF.get(key)
        if kind is Drive and key == "settings" and isinstance(value, Mapping):
            ready[key] = _normalise_settings(value, table.get("primitive"), (*path, key), source)
        else:
            ready[key] = _normalise(value, hints[key], (*path, key), source, unit, usual[key])
    return ready


def _normalise_settings(settings, primitive, path, source):
    """Convert the settings of a drive to the types of its primitive's fields."""
    if primitive not in PRIMITIVES:
        known = ", ".join(PRIMITIVES)
        raise OctoctrlError(
            f"{source.where((*path[:-1], 'primitive'))}: unknown primitive '{primitive}'{suggest(primitive, PRIMITIVES)} ({known})"
        )
    hints, ready = typing.get_type_hints(PRIMITIVES[primitive]), {}
    for key, value in settings.items():
        if key not in hints:
            raise OctoctrlError(f"{source.where((*path, key))}: unknown key{suggest(key, hints)} (known: {', '.join(hints)})")
        normal = _normalise(value, hints[key], (*path, key), source, UNIT_OF.get(key))
        try:
            ready[key] = msgspec.convert(normal, hints[key])
        except msgspec.ValidationError as error:
            raise OctoctrlError(_translate(error, value, source, (*path, key))) from None
    return ready


def _number(value, unit, path, source):
    """Return a float; a string is a number with a unit."""
    words, powers = UNITS[unit] if unit else ("", {})
    if isinstance(value, str):
        match = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-zµ°%/^0-9]*)\s*", value)
        if match and unit and match[2] in powers:
            power = powers[match[2]]
            return radians(float(match[1])) if power is None else float(Decimal(match[1]).scaleb(power))
        if match and unit and match[2]:
            raise OctoctrlError(f"{source.where(path)}: unit '{match[2]}' not known; use {', '.join(powers)}")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise OctoctrlError(f"{source.where(path)}: expected a number{f' in {words}' if words else ''}, found {found(value)}")
    return float(value)


_WORDS = {"str": "text", "float": "a number", "int": "a whole number", "bool": "true or false", "array": "a list", "object": "a table"}


def _translate(error, data, source, base=()):
    """Turn msgspec's message into ours; the text of our own checks is kept and only gets its place."""
    text, _, place = str(error).partition(" - at `$")
    path = (*base, *(int(step[1:-1]) if step.startswith("[") else step.lstrip(".") for step in re.findall(r"\[\d+\]|\.[^.\[\]`]+", place)))
    wrong = re.fullmatch(r"Expected `(\w+)[^`]*`, got `\w+`", text)
    if wrong:
        value = data
        for step in path[len(base) :]:
            value = value[step]
        text = f"expected {_WORDS.get(wrong[1], wrong[1])}, found {found(value)}"
    elif path not in ((), ("task",)):
        path = source.culprit(path, text)
    return f"{source.where(path)}: {text}"


# ---------------------------------------------------------------- writing


def _assignments(item, names=None, comments=True):
    """Write fields as ``name = value``, with what the class's docstring says about them."""
    said = _described(type(item)) if comments else {}
    out = []
    for name in names or [entry.name for entry in fields(item)]:
        line = f"{name} = {_value(getattr(item, name))}"
        out.append(f"{line}  # {said[name]}" if said.get(name) else line)
    return out


def _goals(goals):
    return ["goals = [", *(f"    {_value({item.name: getattr(goal, item.name) for item in fields(goal)})}," for goal in goals), "]"]


def _section(name, item, default):
    """Write a table in which values that equal the default are comments, and its tables after it."""
    if item == default and isinstance(item, MuscleLaw):
        return [f"# [{name}] has the keys {', '.join(entry.name for entry in fields(item))}", ""]
    said, out, inner = _described(type(item)), [], []
    for entry in fields(item):
        value, usual = getattr(item, entry.name), getattr(default, entry.name)
        if is_dataclass(value):
            inner += _section(f"{name}.{entry.name}", value, usual)
            continue
        comment = f"  # {said[entry.name]}" if said.get(entry.name) else ""
        out.append(f"{'# ' if value == usual else ''}{entry.name} = {_value(value)}{comment}")
    return ([f"[{name}]", *out, ""] if out else []) + inner


def _value(value):
    """Write a value as TOML."""
    if value is None:
        return '"none"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, float):
        return ("inf" if value > 0 else "-inf") if value in (inf, -inf) else repr(float(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(inner)}" for key, inner in value.items()) + " }" if value else "{}"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_value(inner) for inner in value) + "]"
    return str(value)


def _described(kind):
    """What the class's docstring says about each field: unit or choices, and the first sentence."""
    known, said, open_names = {item.name for item in fields(kind)}, {}, []
    for line in (kind.__doc__ or "").splitlines():
        entry = re.match(r"\s*([\w, ]+?) : (.*)", line)
        if entry and set(entry[1].split(", ")) <= known:
            choices = re.search(r"\{.*\}", entry[2])
            unit = choices[0].replace('"', "") if choices else entry[2].rpartition(", ")[2] if re.match(r"\w+, ", entry[2]) else ""
            open_names = entry[1].split(", ")
            said.update({name: [unit, ""] for name in open_names})
        elif not line.strip() or re.match(r"\s*-+$", line):
            open_names = []
        else:
            for name in open_names:
                said[name][1] = f"{said[name][1]} {line.strip()}".strip()
    sentences = {name: (unit, re.split(r"(?<! al)[.;] |\.$", text)[0]) for name, (unit, text) in said.items()}
    return {name: ": ".join(filter(None, parts)) for name, parts in sentences.items()}
