"""Configurations as commented TOML, which reads back to equal objects."""

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from math import inf
from typing import Any

from octoctrl.planners.asking.shares import Share
from octoctrl.planners.asking.task import Drive
from octoctrl.planners.contracts import Goal
from octoctrl.sim.body.muscles import MuscleLaw

from .configuration import Configuration

_DEFAULTS = {item.name: item.default for item in fields(Configuration) if item.default is not MISSING}


def toml_of(configuration: Configuration) -> str:
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
        out += ["[[task.drives]]", *_drive(drive, comments=number == 0), ""]
    for section in _DEFAULTS:
        out += _section(section, getattr(configuration, section), _DEFAULTS[section])
    return "\n".join(out).rstrip("\n") + "\n"


def _assignments(item: Any, names: Iterable[str] = (), comments: bool = True) -> list[str]:
    """Write fields as ``name = value``, with what the class's docstring says about them."""
    said = _described(type(item)) if comments else {}
    out = []
    for name in names or [entry.name for entry in fields(item)]:
        line = f"{name} = {_value(getattr(item, name))}"
        out.append(f"{line}  # {said[name]}" if said.get(name) else line)
    return out


def _goals(goals: tuple[Goal, ...]) -> list[str]:
    return ["goals = [", *(f"    {_value({'quantity': goal.quantity} | _changed(goal))}," for goal in goals), "]"]


def _drive(drive: Drive, comments: bool) -> list[str]:
    """The fields of a drive; the primitive's own stand under `settings`, but for the times that follow from the phases."""
    names = [entry.name for entry in fields(drive.primitive) if entry.name not in ("onset", "offset")]  # type: ignore[arg-type]
    settings = {name: getattr(drive.primitive, name) for name in names}
    lines = _assignments(drive, [item.name for item in fields(Drive) if item.name != "primitive"], comments)
    return [lines[0], f"primitive = {_value(type(drive.primitive).__name__)}", f"settings = {_value(settings)}", *lines[1:]]


def _changed(item: Any) -> dict[str, Any]:
    """Fields of an object that are not at their class's default."""
    return {entry.name: value for entry in fields(item) if (value := getattr(item, entry.name)) != entry.default}


def _section(name: str, item: Any, default: Any) -> list[str]:
    """Write a table in which values that equal the default are comments, and its tables after it."""
    if item == default and isinstance(item, MuscleLaw):
        return [f"# [{name}] has the keys {', '.join(entry.name for entry in fields(item))}", ""]
    said, out, inner = _described(type(item)), [], []
    if type(item) is not type(default):
        out.append(f"kind = {_value(type(item).__name__)}")
        default = None
    for entry in fields(item):
        value, usual = getattr(item, entry.name), getattr(default, entry.name, entry.default)
        if is_dataclass(value):
            inner += _section(f"{name}.{entry.name}", value, usual)
            continue
        comment = f"  # {said[entry.name]}" if said.get(entry.name) else ""
        out.append(f"{'# ' if value == usual else ''}{entry.name} = {_value(value)}{comment}")
    return ([f"[{name}]", *out, ""] if out else []) + inner


def _value(value: Any) -> str:
    """Write a value as TOML."""
    if value is None:
        return '"none"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, float):
        return ("inf" if value > 0 else "-inf") if value in (inf, -inf) else repr(float(value))
    if isinstance(value, Enum):
        return _value(value.value)
    if isinstance(value, Share):
        return _value(f"{value.percent!r} %")
    if is_dataclass(value):
        return _value({"kind": type(value).__name__} | _changed(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(inner)}" for key, inner in value.items()) + " }" if value else "{}"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_value(inner) for inner in value) + "]"
    return str(value)


def _described(kind: type) -> dict[str, str]:
    """What the class's docstring says about each field: unit or choices, and the first sentence."""
    known = {item.name for item in fields(kind)}
    said: dict[str, list[str]] = {}
    open_names: list[str] = []
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
