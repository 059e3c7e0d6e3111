"""Where things stand in a TOML file, so that a complaint can name file, line and key; and changes made on the command line."""

import re
import tomllib
from typing import Any

from octoctrl.sim.errors import OctoctrlError, brief, suggest

Path = tuple[str | int, ...]
"""Keys and numbers of elements on the way to a value."""


class Source:
    """A file's `name`, the lines of its keys, and which keys were set on the command line instead."""

    def __init__(self, name: str, text: str) -> None:
        self.name, self.lines = name, _line_numbers(text)
        self.overridden: list[Path] = []

    def where(self, path: Path) -> str:
        """Say where the value at `path` was written: ``file:line key.path``."""
        key = dotted(path)
        if not path:
            return self.name
        if any(path[: len(other)] == other or (other[: len(path)] == path and path not in self.lines) for other in self.overridden):
            return f"--set {key}"
        for length in range(len(path), 0, -1):
            if path[:length] in self.lines:
                return f"{self.name}:{self.lines[path[:length]]} {key}"
        return f"{self.name} {key}"

    def culprit(self, path: Path, complaint: str) -> Path:
        """The key under `path` that a complaint about the whole table is about, as far as one can tell."""
        overridden = [key for key in self.overridden if key[: len(path)] == path]
        keys = {*overridden, *self.lines}
        named = [(*path, word) for word in re.findall(r"\w+", complaint) if (*path, word) in keys]
        return [*named, *overridden, path][0]


def tables(text: str, name: str) -> dict[str, Any]:
    """The tables of a TOML `text`, from a file called `name`.

    Raises
    ------
    OctoctrlError
        If it is no TOML, with the line.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        reason, _, place = str(error).partition(" (at ")
        line = re.match(r"line (\d+)", place)
        raise OctoctrlError(f"{name}{':' + line[1] if line else ''}: not valid TOML: {reason[0].lower() + reason[1:]}") from None
    except RecursionError:
        raise OctoctrlError(f"{name}: not valid TOML: brackets are nested too deeply") from None
    except ValueError:
        raise OctoctrlError(f"{name}: not valid TOML: a number has thousands of digits") from None


def dotted(path: Path) -> str:
    """Write a `path` of keys and numbers as ``a.b[0].c``."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f"{'.' if text else ''}{step}"
    return text


_KEY = r"""(?:"[^"]*"|'[^']*'|[\w-]+)"""


def _names(key: str) -> list[str]:
    """The parts of a dotted key, without their quotes."""
    return [part.strip("\"'") for part in re.findall(_KEY, key)]


def _line_numbers(text: str) -> dict[Path, int]:
    """Map key paths to line numbers by reading headers, assignments and one-line elements of arrays."""
    lines: dict[Path, int] = {}
    table: Path = ()
    counts: dict[Path, int] = {}
    open_array: Path | None = None
    quoted = False
    for number, line in enumerate(text.splitlines(), start=1):
        toggles = line.count('"""') % 2 == 1
        if quoted:
            quoted = not toggles
            continue
        quoted = toggles
        header = re.match(r"\s*(\[\[?)([^\[\]]+)\]", line)
        assigned = re.match(rf"\s*({_KEY}(?:\s*\.\s*{_KEY})*)\s*=\s*(.*)", line)
        if header and open_array is None:
            table, names = (), _names(header[2])
            for position, part in enumerate(names):
                table += (part,)
                if header[1] == "[[" and position == len(names) - 1:
                    counts[table] = counts.get(table, -1) + 1
                if table in counts:
                    table += (counts[table],)
            lines.setdefault(table, number)
            lines.setdefault(table[:-1], number)
        elif open_array is not None:
            if line.lstrip().startswith("{"):
                lines[(*open_array, counts[open_array])] = number
                counts[open_array] += 1
            elif line.lstrip().startswith("]"):
                del counts[open_array]
                open_array = None
        elif assigned:
            path = (*table, *_names(assigned[1]))
            lines.setdefault(path, number)
            if re.fullmatch(r"\[\s*(#.*)?", assigned[2]):
                open_array, counts[path] = path, 0
    return lines


def assign(data: dict[str, Any], assignment: str) -> Path:
    """Carry out an `assignment` ``a.b[0].c=value`` on nested tables `data` and return the path as a tuple."""
    key, equals, raw = assignment.partition("=")
    steps = [int(step[1:-1]) if step.startswith("[") else step for step in re.findall(r"\[\d+\]|[^.\[\]]+", key.strip())]
    if not equals or not steps:
        raise OctoctrlError(f"--set {assignment}: expected key=value, for example --set task.phases.store.duration=1.2")
    try:
        value = tomllib.loads(f"value = {raw.strip()}")["value"]
    except (ValueError, RecursionError):
        value = raw.strip()
    path: Path = ()
    target: Any = data
    for step in steps[:-1]:
        step = _element(target, step, path)
        if isinstance(target, dict):
            target.setdefault(step, {})
        path, target = (*path, step), target[step]
        if not isinstance(target, dict | list):
            raise OctoctrlError(f"--set {dotted(path)}: is {found(target)}, not a table")
    last = _element(target, steps[-1], path)
    target[last] = value
    return (*path, last)


def _element(target: Any, step: str | int, path: Path) -> str | int:
    """Index of an element of a list, given its index or its name."""
    if not isinstance(target, list):
        return str(step)
    names = [str(item.get("name", "")) if isinstance(item, dict) else "" for item in target]
    if isinstance(step, int) and step < len(target):
        return step
    if step in names:
        return names.index(step)
    known = ", ".join(name for name in names if name) or f"0 to {len(target) - 1}"
    raise OctoctrlError(f"--set {dotted(path)}: no element '{brief(step)}'{suggest(step, names)} ({known})")


def found(value: object) -> str:
    """Say what a `value` is, for "expected …, found …"."""
    if isinstance(value, str):
        return f"the string {brief(repr(value))}"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"the number {value:g}" if isinstance(value, float) or abs(value) < 1e300 else "a number beyond 1e300"
    if isinstance(value, dict | list):
        return "a table" if isinstance(value, dict) else "a list"
    return f"{type(value).__name__} {brief(value)}"
