"""The stability laboratory: thousands of random runs, each of which must end as accurate, refused beforehand, or stopped with the reason.

A run that ends otherwise, with numbers that no guard caught and no sensible motion has, is an *undetected failure*; there must be none.
Outcomes are appended to a file of JSON lines, one for each run, so that an interrupted study goes on where it was.
"""

import json
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict
from math import ceil
from pathlib import Path
from typing import Any

from octoctrl import __version__
from octoctrl.sim.errors import OctoctrlError, check_choice, check_number

from ..progress import NullProgress, Progress
from ..tables import plain
from .endings import Ending, Outcome, perform
from .trials import ASSEMBLY_KINDS, KINDS, Trial, draw

PLANTS = {"rod": KINDS, **dict.fromkeys(("assembly", "assembly-mixed", "assembly-coarse", "assembly-coarse-mixed"), ASSEMBLY_KINDS)}
"""Kinds of trials, by plant."""


def schedule(plant: str, runs: int) -> list[tuple[str, int]]:
    """Kinds and numbers of a study, mixed so that any beginning of it is a small study of its own.

    Parameters
    ----------
    plant : str
        One of `PLANTS`.
    runs : int
        At least so many; every kind gets its share of them, rounded up.
    """
    check_choice("plant", plant, PLANTS)
    check_number("runs", runs, at_least=1)
    kinds = PLANTS[plant]
    total = sum(kind.share for kind in kinds.values())
    counts = {name: ceil(runs * kind.share / total) for name, kind in kinds.items()}
    return sorted(((name, number) for name in kinds for number in range(counts[name])), key=lambda item: (item[1] + 0.5) / counts[item[0]])


def study(
    path: str | Path,
    runs: int,
    *,
    plant: str = "rod",
    seed: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
) -> list[Outcome]:
    """Carry out a study, or what is missing of it.

    Parameters
    ----------
    path : str or Path
        File of JSON lines; outcomes that it holds already are kept.
    runs : int
    plant : str
        One of `PLANTS`.
    seed : int
    threads : int, optional
        Runs at the same time; as many as there are cores if omitted. Outcomes do not depend on it.
    progress : Progress, optional

    Returns
    -------
    list of Outcome
        In the order of `schedule`; fewer than asked for if interrupted.

    Raises
    ------
    OctoctrlError
        If the file belongs to another study.
    """
    progress, path = progress or NullProgress(), Path(path)
    planned, known = schedule(plant, runs), _known(path, plant, seed)
    missing = [item for item in planned if item not in known]
    progress.start(f"stability of the {plant}", total=len(planned))
    pool = ThreadPoolExecutor(threads or os.cpu_count())
    try:
        with path.open("a", encoding="utf-8") as file:
            running = [pool.submit(lambda item: perform(draw(item[0], seed, item[1], plant)), item) for item in missing]
            for done, future in enumerate(as_completed(running), start=len(planned) - len(missing) + 1):
                outcome = future.result()
                known[outcome.kind, outcome.number] = outcome
                file.write(json.dumps(plain(written(outcome))) + "\n")
                file.flush()
                progress.advance(done, f"{outcome.kind}: {outcome.ending.value}")
    except KeyboardInterrupt:
        pass
    finally:
        pool.shutdown(cancel_futures=True)
        progress.stop()
    return [known[item] for item in planned if item in known]


def read(path: str | Path) -> tuple[dict[str, Any], list[Outcome]]:
    """What a file of outcomes holds.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    header : dict
        Plant, seed and version.
    outcomes : list of Outcome

    Raises
    ------
    OctoctrlError
        If it is not such a file.
    """
    try:
        first, *lines = Path(path).read_text(encoding="utf-8").splitlines()
        header, outcomes = json.loads(first), list[Outcome]()
        header = {"plant": header["plant"], "seed": header["seed"], "version": header["version"]}
        for line in lines:
            try:
                outcomes.append(_read(json.loads(line)))
            except json.JSONDecodeError:  # cut off when the study was killed; that run is done again
                continue
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise OctoctrlError(f"{path} does not hold outcomes of the stability laboratory; give another file") from error
    return header, outcomes


def _known(path: Path, plant: str, seed: int) -> dict[tuple[str, int], Outcome]:
    if not path.exists():
        path.write_text(json.dumps({"plant": plant, "seed": seed, "version": __version__}) + "\n", encoding="utf-8")
        return {}
    header, outcomes = read(path)
    if (header["plant"], header["seed"]) != (plant, seed):
        raise OctoctrlError(
            f"{path} holds a study of plant {header['plant']} with seed {header['seed']}, not of {plant} with {seed}; give another file"
        )
    text = path.read_text(encoding="utf-8")
    if not text.endswith("\n"):
        path.write_text(text + "\n", encoding="utf-8")
    return {(outcome.kind, outcome.number): outcome for outcome in outcomes}


def matrix(outcomes: Sequence[Outcome]) -> dict[str, dict[Ending, int]]:
    """How many of the `outcomes` there are by kind and ending."""
    counts: dict[str, dict[Ending, int]] = {}
    for outcome in outcomes:
        row = counts.setdefault(outcome.kind, dict.fromkeys(Ending, 0))
        row[outcome.ending] += 1
    known = [*KINDS, *ASSEMBLY_KINDS]
    return {kind: counts[kind] for kind in known if kind in counts}


def summary(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """The numbers of the `outcomes` that matter."""
    stopped = [outcome for outcome in outcomes if outcome.stop]
    stops = [outcome.stop for outcome in outcomes if outcome.stop]
    errors = sorted(outcome.error for outcome in outcomes if outcome.error is not None and outcome.ending is not Ending.SENSITIVE)
    return {
        "runs": len(outcomes),
        "undetected": sum(outcome.undetected for outcome in outcomes),
        "automatic_steps": sum(outcome.automatic and outcome.ending is not Ending.REFUSED for outcome in outcomes),
        "automatic_unstable": sum(outcome.automatic and outcome.ending is Ending.UNSTABLE for outcome in outcomes),
        "stopped": len(stopped),
        "stopped_at_quarter_step_too": sum(bool(outcome.again) for outcome in stopped),
        "stops_without_a_place": sum(any(stop.get(key) is None for key in ("time", "rod", "element", "mechanism")) for stop in stops),
        "compared_with_half_the_step": len(errors),
        "median_error": errors[len(errors) // 2] if errors else None,
        "error_of_95_percent": errors[int(0.95 * len(errors))] if errors else None,
        "retried": sum(outcome.retried for outcome in outcomes),
        "volume": _furthest(outcome.volume for outcome in outcomes),
        "slab_volume": _furthest(outcome.slab_volume for outcome in outcomes),
        "simulated": sum(outcome.simulated for outcome in outcomes),
        "processor_time": sum(outcome.spent for outcome in outcomes),
    }


def _furthest(volumes: Iterable[float | None]) -> float | None:
    """The volume that is furthest from that at rest, None if no run has any."""
    return max((value for value in volumes if value is not None), key=lambda value: abs(value - 1), default=None)


def content(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """All that is reported of the `outcomes`, as plain data."""
    counts = {kind: {ending.name: count for ending, count in row.items()} for kind, row in matrix(outcomes).items()}
    return {"summary": summary(outcomes), "matrix": counts}


def written(outcome: Outcome) -> dict[str, Any]:
    """An `outcome` as plain data, its ending by name."""
    return asdict(outcome) | {"ending": outcome.ending.name}


def _read(fields: dict[str, Any]) -> Outcome:
    return Outcome(**fields | {"ending": Ending[fields["ending"]]})


def repeat(name: str, seed: int = 0, plant: str = "rod") -> tuple[Trial, Outcome]:
    """Do one trial again.

    Parameters
    ----------
    name : str
        ``KIND:NUMBER``.
    seed : int
    plant : str
        One of `PLANTS`; of a kind of the full arm, ``"assembly"`` stands in for the rod.

    Raises
    ------
    OctoctrlError
        If there is no such kind or the number is none.
    """
    kind, _, number = name.partition(":")
    check_choice("kind", kind, (*KINDS, *ASSEMBLY_KINDS))
    if not number.isdigit():
        raise OctoctrlError(f"--repeat {name}: expected KIND:NUMBER, for example 'all groups:7'")
    check_choice("plant", plant, PLANTS)
    trial = draw(kind, seed, int(number), "assembly" if plant == "rod" else plant)
    return trial, perform(trial)
