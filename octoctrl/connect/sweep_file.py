"""Sweep files: a task or a plan, and what is changed from run to run. From TOML to a list of jobs, every mistake in one sentence."""

import hashlib
import itertools
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from octoctrl.planners.solving.grasping import check_objects
from octoctrl.sim.archives import check_source
from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.errors import OctoctrlError, brief, check_count, suggest
from octoctrl.sim.running.sensors import Sensors

from .. import tasks
from ..files.configuration import Configuration, parse
from ..files.store import read_header
from ..files.toml_source import found, tables
from ..files.toml_writing import toml_of

FAMILIES = ("task", "arm", "scene", "plan", "run")
"""Tables of a task file; keys that begin otherwise are ``gains.GROUP`` and ``sensors.FIELD``."""

_KEYS = ("task", "plan", "seed", "runs", "set", "grid", "random")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """What a sweep file says.

    Attributes
    ----------
    configuration : str
        Of the task, as TOML.
    plan, digest : str
        Path of the plan that every run carries out, and what its file is known by; empty if each makes its own.
    seed : int
    runs : int
        For each point of the grid.
    fixed : mapping of str to value
        Changes of every run, as ``octoctrl plan --set`` takes them.
    grid : mapping of str to list
        Values by key; every combination is run.
    random : mapping of str to (float, float)
        Ranges by key, from which each run draws.
    """

    configuration: str
    plan: str
    digest: str
    seed: int
    runs: int
    fixed: Mapping[str, Any]
    grid: Mapping[str, list[Any]]
    random: Mapping[str, tuple[float, float]]

    def jobs(self) -> list[dict[str, Any]]:
        """The runs as plain dicts, in order; what a run draws depends on the seed and its index alone."""
        made: list[dict[str, Any]] = []
        for values in itertools.product(*self.grid.values()):
            for _ in range(self.runs):
                index = len(made)
                chance = np.random.default_rng([self.seed, index])
                drawn = {key: float(chance.uniform(*ends)) for key, ends in self.random.items()}
                changes = {**self.fixed, **dict(zip(self.grid, values, strict=True)), **drawn}
                job = {"configuration": self.configuration, "changes": changes, "seed": int(chance.integers(2**31))}
                text = json.dumps({**job, "plan": self.digest}, sort_keys=True)
                made.append({"index": index, "key": hashlib.sha256(text.encode()).hexdigest()[:16], "plan": self.plan, **job})
        return made


def read_sweep(path: str | Path) -> Sweep:
    """Read a sweep file.

    Parameters
    ----------
    path : str or Path
        The task and the plan that it names are looked for beside it.

    Returns
    -------
    Sweep

    Raises
    ------
    OctoctrlError
        If anything is wrong, before anything is run: every value of the grid and both ends of every range are tried.
    """
    path = check_source(path)
    try:
        data = tables(path.read_text(encoding="utf-8"), str(path))
    except OSError as error:
        raise OctoctrlError(f"{path} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise OctoctrlError(f"{path} is not text in UTF-8") from None
    for key in data:
        if key not in _KEYS:
            raise OctoctrlError(f"{path}: unknown key '{brief(key)}'{suggest(key, _KEYS)} (known: {', '.join(_KEYS)})")
    for key in ("set", "grid", "random"):
        if not isinstance(data.setdefault(key, {}), dict):
            raise OctoctrlError(f"{path}: '{key}' is not a table; write [{key}] and under it lines such as \"scene.water.factor\" = ...")
    configuration, plan = _subject(path, data.get("task"), data.get("plan"))
    grid, random = dict(_grid(path, data["grid"])), dict(_ranges(path, data["random"]))
    check_count(f"{path}: seed", data.setdefault("seed", 0), at_least=0)
    check_count(f"{path}: runs", data.setdefault("runs", 1), at_least=1)
    digest = hashlib.sha256(Path(plan).read_bytes()).hexdigest() if plan else ""
    sweep = Sweep(
        configuration=configuration,
        plan=plan,
        digest=digest,
        seed=data["seed"],
        runs=data["runs"],
        fixed=data["set"],
        grid=grid,
        random=random,
    )
    _check(path, sweep)
    return sweep


def configuration_of(text: str, changes: Mapping[str, Any], name: str = "sweep") -> Configuration:
    """The configuration of a run: TOML (`text`), with those `changes` that belong to it; `name` is for messages."""
    mine = {key: value for key, value in changes.items() if _family(key) in FAMILIES}
    return parse(text, name=name, overrides=[f"{key}={json.dumps(value)}" for key, value in mine.items()])


def part(changes: Mapping[str, Any], family: str) -> dict[str, Any]:
    """Those of the `changes` that are of one `family`, without its name."""
    return {key.partition(".")[2]: value for key, value in changes.items() if _family(key) == family}


def _family(key: str) -> str:
    return key.partition(".")[0]


def _subject(path: Path, task: Any, plan: Any) -> tuple[str, str]:
    """The configuration as TOML, and the path of the plan or nothing."""
    if (task is None) == (plan is None) or not isinstance(task or plan, str):
        raise OctoctrlError(f'{path}: give either task = "coil" (or a task file), or plan = "plan.npz"')
    beside = path.parent / str(task or plan)
    if task is not None:
        return toml_of(tasks.load(beside if beside.suffix == ".toml" else task)), ""
    origin = read_header(beside)["origin"]
    if not isinstance(origin.get("configuration"), str):
        raise OctoctrlError(f"{beside} does not say which task it was made for; make it with: octoctrl plan")
    return origin["configuration"], str(beside.resolve())


def _grid(path: Path, table: Mapping[str, Any]) -> Iterable[tuple[str, list[Any]]]:
    for key, values in table.items():
        if isinstance(values, dict) and set(values) == {"from", "to", "count"}:
            check_count(f"{path}: {key}.count", values["count"], at_least=1)
            first, last = _ends(path, key, values["from"], values["to"])
            values = np.linspace(first, last, values["count"]).tolist()
        if not isinstance(values, list) or not values:
            raise OctoctrlError(f"{path}: '{key}' of the grid: give a list of values, or {{ from = ..., to = ..., count = ... }}")
        yield key, values


def _ranges(path: Path, table: Mapping[str, Any]) -> Iterable[tuple[str, tuple[float, float]]]:
    for key, ends in table.items():
        if not isinstance(ends, list) or len(ends) != 2:
            raise OctoctrlError(f"{path}: '{key}' is drawn at random: give the ends of its range, [lowest, highest]")
        yield key, _ends(path, key, *ends)


def _ends(path: Path, key: str, first: Any, last: Any) -> tuple[float, float]:
    for value in (first, last):
        if not isinstance(value, int | float) or isinstance(value, bool) or not np.isfinite(value):
            raise OctoctrlError(f"{path}: '{key}': the ends of a range are numbers, found {brief(repr(value))}")
    return float(first), float(last)


def _check(path: Path, sweep: Sweep) -> None:
    """Try every change alone, on top of those of all runs."""
    single = [(key, value) for table in (sweep.grid, sweep.random) for key, values in table.items() for value in values]
    for key, _ in single:
        if sum(key in table for table in (sweep.fixed, sweep.grid, sweep.random)) > 1:
            raise OctoctrlError(f"{path}: '{key}' is changed twice; give it in one of [set], [grid] and [random]")
    known = (*FAMILIES, "gains", "sensors")
    for changes in (sweep.fixed, *({**sweep.fixed, key: value} for key, value in single)):
        for key, value in changes.items():
            if not _plain(value):
                raise OctoctrlError(f"{path}: '{key}' is {found(value)}; give a number, a text, true or false, or a list of these")
            if _family(key) not in known:
                raise OctoctrlError(
                    f"{path}: unknown key '{brief(key)}'{suggest(_family(key), known)} (keys begin with {', '.join(known)})"
                )
            if sweep.plan and _family(key) in ("task", "plan"):
                raise OctoctrlError(f"{path}: '{key}' cannot be changed, for the plan is made; give task = ... to plan each run")
        configuration = configuration_of(sweep.configuration, changes, str(path))
        check_objects(configuration.task, configuration.scene)
        Sensors(**_known(path, "sensors", part(changes, "sensors"), [item.name for item in fields(Sensors)]))
        _known(path, "gains", part(changes, "gains"), MUSCLE_GROUPS)


def _plain(value: Any) -> bool:
    return all(map(_plain, value)) if isinstance(value, list) else isinstance(value, str | bool | int | float)


def _known(path: Path, family: str, given: dict[str, Any], names: Iterable[str]) -> dict[str, Any]:
    names = list(names)
    for name in given:
        if name not in names:
            raise OctoctrlError(f"{path}: unknown key '{family}.{name}'{suggest(name, names)} (known: {', '.join(names)})")
    return given
