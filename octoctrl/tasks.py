"""Tasks and activation programmes by name: the files that come with the package, and files of the user's own."""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from octoctrl.sim.activation import Activation
from octoctrl.sim.archives import check_source
from octoctrl.sim.errors import OctoctrlError, suggest
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.templates import Template

if TYPE_CHECKING:
    from .files.configuration import Configuration

_HERE = Path(__file__).parent
_TASKS = _HERE / "library"
_PROGRAMMES = _HERE / "programmes"


def names() -> tuple[str, ...]:
    """Names of the tasks that come with the package.

    Returns
    -------
    tuple of str
    """
    return _names(_TASKS)


def descriptions() -> dict[str, str]:
    """What each task is for, in one line.

    Returns
    -------
    dict of str to str
    """
    return {name: tomllib.loads((_TASKS / f"{name}.toml").read_text())["task"]["description"] for name in names()}


def load(task: str | Path, *, overrides: Iterable[str] = ()) -> "Configuration":
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
    check_source(path, f"print a template with: octoctrl tasks {names()[0]} --show > {path.name}")
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise OctoctrlError(f"{path} is not a text file; a task file is TOML in UTF-8") from None
    return parse(text, name=path.name, overrides=overrides, folder=path.parent)


@dataclass(frozen=True, slots=True, kw_only=True)
class Programme:
    """A published activation programme and the water that belongs to its figure.

    Attributes
    ----------
    name, description : str
    duration : float, s
    templates : tuple of Plateau, Pulse and Wave
    composition : {"override", "max", "add"}
        How they combine; see `octoctrl.sim.activation.Activation`.
    scene : Scene
    """

    name: str
    description: str
    duration: float
    templates: tuple[Template, ...]
    composition: str = "override"
    scene: Scene = field(default=Scene())

    @property
    def activation(self) -> Activation:
        """What the muscles do."""
        return Activation(templates=self.templates, composition=self.composition)


def programmes() -> tuple[str, ...]:
    """Names of the published activation programmes.

    Returns
    -------
    tuple of str

    Notes
    -----
    They are those of Tekinalp et al. (2024), figures 2 to 4 and the supplement, written as templates; ``si10b`` is supplementary figure
    10b. Levels and drag rates belong to the published numerics. The squid tentacle's law is left out: it belongs to another arm.
    """
    return _names(_PROGRAMMES)


def programme(name: str) -> Programme:
    """Load a published activation programme.

    Parameters
    ----------
    name : str
        Of `programmes`.

    Returns
    -------
    Programme
        With activation, duration and scene.

    Raises
    ------
    OctoctrlError
        If the name is unknown.
    """
    from .files.conversion import build
    from .files.toml_source import Source

    if name not in programmes():
        raise OctoctrlError(f"unknown programme '{name}'{suggest(name, programmes())} ({', '.join(programmes())})")
    text = (_PROGRAMMES / f"{name}.toml").read_text(encoding="utf-8")
    made: Programme = build(Programme, tomllib.loads(text), Source(f"{name}.toml", text))
    return made


def _names(folder: Path) -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in folder.glob("*.toml")))
