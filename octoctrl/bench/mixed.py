"""Mixed against double precision of the full arm: what it saves, and what it misses beside what a step misses."""

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS
from octoctrl.sim.plants import Plant, make_plant
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.templates import Plateau

from ..tables import Table

Floats = NDArray[np.float64]

PIECE = 0.02
"""Simulated time (s) after which the plants take turns."""

CASES = (("R-OM at 0.3", ("R-OM",), 0.3, 0.2),)
MORE = (
    ("R-OM at 0.3", ("R-OM",), 0.3, 0.4),
    ("TM at 0.3", ("TM",), 0.3, 0.2),
    ("all LM at 0.3", LONGITUDINAL_GROUPS, 0.3, 0.2),
    ("everything at 1", MUSCLE_GROUPS, 1.0, 0.2),
)
"""Name, groups, level and duration (s)."""


def in_turns(plants: dict[str, Plant], activation: Activation, duration: float) -> tuple[dict[str, Recording], dict[str, float]]:
    """Motions of plants that go on by turns.

    Parameters
    ----------
    plants : dict of str to Plant
    activation : Activation
    duration : float, s

    Returns
    -------
    dict of str to Recording
    dict of str to float
        Processor time of each one's fastest piece, s per simulated second.
    """
    pieces: dict[str, list[Recording]] = {name: [] for name in plants}
    spent = dict.fromkeys(plants, np.inf)
    for _ in range(round(duration / PIECE)):
        for name, plant in plants.items():
            begin = time.process_time()
            pieces[name].append(plant.advance(activation, PIECE))
            spent[name] = min(spent[name], (time.process_time() - begin) / PIECE)
    return {name: Recording.joined(parts) for name, parts in pieces.items()}, spent


def missed(found: Recording, right: Recording) -> tuple[float, float, float]:
    """Largest differences of twist (turns), length of the cord (%) and tip (mm) between what was `found` and what is `right`."""
    from octoctrl.sim.topology.measures import measure

    turns, exact = (measure(run.time, run.points, run.frames).twist for run in (found, right))
    length, whole = (np.linalg.norm(np.diff(run.points, axis=1), axis=2).sum(axis=1) for run in (found, right))
    tip = np.linalg.norm(found.tip - right.tip, axis=1)
    return float(np.abs(turns - exact).max()), 100 * float(np.abs(length / whole - 1).max()), 1e3 * float(tip.max())


def mixed_precision(*, full: bool = False) -> Table:
    """Mixed beside double precision and half the step, on the full and the coarse arm; with `full`, more programmes."""
    rows: list[tuple[Any, ...]] = []
    for name in ("assembly", "assembly-coarse"):
        for case, groups, level, duration in MORE if full else CASES:
            plants = {"double": make_plant(name), "mixed": make_plant(name, precision="mixed")}
            plants["half"] = make_plant(name, dt=plants["double"].h / 2)
            activation = Activation(templates=(Plateau(groups=groups, level=level, rise=min(0.4, duration)),))
            runs, spent = in_turns(plants, activation, duration)
            errors = *missed(runs["mixed"], runs["double"]), *missed(runs["half"], runs["double"])
            rows.append((name, case, duration, spent["double"], spent["mixed"], spent["mixed"] / spent["double"], *errors))
    what = ("twist, turns", "length, %", "tip, mm")
    return Table(
        name="mixed", title="Full arm in mixed precision", rows=tuple(rows),
        columns=(
            "plant", "case", "s", "CPU s / s, double", "CPU s / s, mixed", "ratio", *what, *(f"half the step: {name}" for name in what)
        ),
        formats=("", "", ".1f", ".2f", ".2f", ".3f", ".1e", ".1e", ".1e", ".1e", ".1e", ".1e"),
        note='Runs with `precision="mixed"` against those in double precision, all at the default step and in turns; and, for comparison, '
        "what half the step changes. Differences are the largest of the run, those of length in percent of the length.",
    )  # fmt: skip
