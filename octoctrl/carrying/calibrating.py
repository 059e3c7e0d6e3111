"""How much twist a level stores on a plant: measured once, and kept on disk by what the plant is.

Levels belong to a plant and turns to a plan, so that what was planned in turns on one plant can be carried out on another.
"""

import hashlib
import json
import os
from pathlib import Path

import numpy as np

from octoctrl.planners.asking.wrapping import TwistCurve
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.plants import check_plant, make_plant
from octoctrl.sim.scene.scene import Scene, Water
from octoctrl.sim.templates import Plateau
from octoctrl.sim.topology.measures import present_of_frames

from ..files.writing import written_aside
from ..progress import NullProgress, Progress

LEVELS = (0.005, 0.01, 0.02, 0.04, 0.08, 0.12, 0.2, 0.3, 0.5, 1.0)
"""At which it is measured."""

WINDOW, RISE, AFTER = 0.5, 0.5, 1.0
"""Share of the arm that is twisted, how long the level rises, and when the twist is read, s."""


def twist_curve(arm: Arm, water: Water | None, plant: str = "rod", *, progress: Progress | None = None) -> TwistCurve:
    """The curve of a plant: the one that is kept, or a new one.

    Parameters
    ----------
    arm : Arm
    water : Water or None
    plant : str
        By its name in `octoctrl.sim.plants.PLANTS`.
    progress : Progress, optional

    Returns
    -------
    TwistCurve
    """
    check_plant(plant)
    key = arm, water, plant
    if key not in _KNOWN:
        _KNOWN[key] = _kept(arm, water, plant, progress or NullProgress())
    return _KNOWN[key]


_KNOWN: dict[tuple[Arm, Water | None, str], TwistCurve] = {}
"""Of this process."""


def _kept(arm: Arm, water: Water | None, plant: str, progress: Progress) -> TwistCurve:
    path = folder() / f"twist-{key_of(arm, water, plant)}.json"
    if path.is_file():
        try:
            held = json.loads(path.read_text(encoding="utf-8"))
            return TwistCurve(levels=tuple(held["levels"]), turns=tuple(held["turns"]))
        except (OSError, ValueError, KeyError, TypeError):  # damaged: measured again
            pass
    found = measured(arm, water, plant, progress)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with written_aside(path) as part:
            Path(part).write_text(
                json.dumps({"plant": plant, "arm": arm.fingerprint, "levels": found.levels, "turns": found.turns}), encoding="utf-8"
            )
    except OSError:  # where nothing can be kept it is measured in every process
        pass
    return found


def measured(arm: Arm, water: Water | None, plant: str, progress: Progress) -> TwistCurve:
    """Twist the near half of an arm in still `water` at each of `LEVELS`, on a plant, and read how much it stores; `progress` is told."""
    moved, window = make_plant(plant, arm, Scene(water=water)), (0.0, WINDOW * arm.length)
    levels, turns = [0.0], [0.0]
    progress.start(f"measuring how much twist a level stores on the plant '{plant}' (once)", float(len(LEVELS)))
    try:
        for number, level in enumerate(LEVELS):
            moved.reset()
            moved.advance(Activation(templates=(Plateau(groups=("L-OM",), level=level, rise=RISE, window=window),)), AFTER)
            twist, _ = present_of_frames(moved.observe().frames, (1.0, 0.0, 0.0))
            # What saturates stores no more: levels beyond are of no use.
            if twist / window[1] > turns[-1] * (1 + 1e-6):
                levels.append(level)
                turns.append(float(twist / window[1]))
            progress.advance(number + 1.0)
    finally:
        progress.stop()
    return TwistCurve(levels=tuple(levels), turns=tuple(turns))


def key_of(arm: Arm, water: Water | None, plant: str) -> str:
    """What tells curves apart: the `plant`, all of the `arm` and of the `water`, and how it answers to a short jerk.

    The answer changes with every law and every constant of the plant, of which no field of the arm tells.
    """
    moved = make_plant(plant, arm, Scene(water=water))
    moved.advance(Activation(templates=(Plateau(groups=("L-OM",), level=0.3, rise=0.01),)), 4 * moved.sample_interval)
    answer = np.round(moved.observe().frames, 9).tobytes()
    return f"{plant}-{hashlib.sha256(repr((plant, arm, water)).encode() + answer).hexdigest()[:12]}"


def folder() -> Path:
    """Where curves are kept: ``OCTOCTRL_CACHE``, or the folder for such things of the user."""
    given = os.environ.get("OCTOCTRL_CACHE") or os.environ.get("XDG_CACHE_HOME")
    return Path(given) / "octoctrl" if given else Path.home() / ".cache" / "octoctrl"
