"""Tasks and activation programmes by name: the files that come with the package, and files of the user's own."""

import tomllib
from dataclasses import dataclass, fields
from pathlib import Path

from octoctrl.sim.errors import OctoctrlError, suggest

_HERE = Path(__file__).parent
_TASKS = _HERE / "library"
_PROGRAMMES = _HERE / "programmes"


def names():
    """Names of the tasks that come with the package.

    Returns
    -------
    tuple of str
    """
    return _names(_TASKS)


def descriptions():
    """What each task is for, in one line.

    Returns
    -------
    dict of str to str
    """
    return {name: tomllib.loads((_TASKS / f"{name}.toml").read_text())["task"]["description"] for name in names()}


def load(task, *, overrides=()):
    """Load a task with its arm, scene and settings.

    Parameters
    ----------
    task : str or Path
        Name of a task, or path of a TOML file.
    overrides : iterable of str
        Assignments such as ``task.phases.store.duration=1.2``.

    Returns
    -------
    Configuration

    Raises
    ------
    OctoctrlError
        If the name is unknown, the file does not exist or says something wrong.
    """
    from .files.configuration import parse

    path = Path(task)
    if path.suffix != ".toml" and not path.is_file():
        if str(task) not in names():
            raise OctoctrlError(f"unknown task '{task}'{suggest(task, names())} ({', '.join(names())}, or the path of a .toml file)")
        path = _TASKS / f"{task}.toml"
    if not path.is_file():
        raise OctoctrlError(f"{path} does not exist; print a template with: octoctrl tasks {names()[0]} --show > {path.name}")
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise OctoctrlError(f"{path} is not a text file; a task file is TOML in UTF-8") from None
    return parse(text, name=path.name, overrides=overrides)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgrammeHeader:
    """What a programme file says besides its templates.

    Attributes
    ----------
    name, description : str
    duration : float, s
    composition : str
    """

    name: str
    description: str
    duration: float
    composition: str = "override"


def programmes():
    """Names of the published activation programmes.

    Returns
    -------
    tuple of str

    Notes
    -----
    They are those of Tekinalp et al. (2024), figures 2 to 4 and the supplement, written as templates; ``si10b`` is supplementary figure
    10b. Levels belong to the published numerics. The squid tentacle's law is left out: it belongs to another arm.
    """
    return _names(_PROGRAMMES)


def programme(name):
    """Load a published activation programme.

    Parameters
    ----------
    name : str
        Of `programmes`.

    Returns
    -------
    Activation
    float, s
        How long it runs.

    Raises
    ------
    OctoctrlError
        If the name is unknown.
    """
    from octoctrl.sim.activation import Activation, Plateau, Wave

    from .files.configuration import convert

    if name not in programmes():
        raise OctoctrlError(f"unknown programme '{name}'{suggest(name, programmes())} ({', '.join(programmes())})")
    file = f"{name}.toml"
    data = tomllib.loads((_PROGRAMMES / file).read_text(encoding="utf-8"))
    header = convert(ProgrammeHeader, {item.name: data[item.name] for item in fields(ProgrammeHeader) if item.name in data}, name=file)
    kinds = {"Plateau": Plateau, "Wave": Wave}
    templates = []
    for table in data["templates"]:
        kind = table.pop("kind", None)
        if kind not in kinds:
            raise OctoctrlError(f"{file}: unknown kind '{kind}'{suggest(kind, kinds)} ({', '.join(kinds)})")
        templates.append(convert(kinds[kind], table, name=file))
    return Activation(templates=tuple(templates), composition=header.composition), header.duration


def _names(folder: Path) -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in folder.glob("*.toml")))
