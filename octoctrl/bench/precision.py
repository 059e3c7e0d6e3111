"""Work against precision: run time against the error of tip, curvature, link, writhe and twist, for each of the three models of the arm."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from octoctrl.planners.model.reduced import ReducedMotion
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.plants import Plant
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.templates import Plateau
from octoctrl.sim.topology.trace import TopologyTrace

from .. import tasks
from ..judging.comparison import QUANTITIES, rms
from ..tables import Table
from .benchmark import timed_motion

Floats = NDArray[np.float64]

ERRORS = ("tip max, %L", "tip rms, %L", "curvature, %", "Lk max, turns", "Wr max, turns", "Tw max, turns")
FORMATS = (".2f", ".2f", ".2f", ".4f", ".4f", ".4f")
EVERY = 4
"""Samples between recorded instants."""


def programmes(full: bool) -> dict[str, tuple[Activation, float]]:
    """Activations to be measured, by name, with their durations (s); more of them if `full`."""

    def held(groups: tuple[str, ...], level: float) -> Activation:
        return Activation(templates=(Plateau(groups=groups, level=level),))

    whole = tasks.programme("fig2c")
    chosen = {"one group: LM1 at 0.3": (held(("LM1",), 0.3), 4.0), "all groups: Fig 2c": (whole.activation, whole.duration)}
    if full:
        chosen |= {
            "one group: R-OM at 0.3": (held(("R-OM",), 0.3), 2.0),
            "one group: LM1 at 1": (held(("LM1",), 1.0), 4.0),
            "all groups at 0.3": (held(MUSCLE_GROUPS, 0.3), 2.0),
        }
    return chosen


def curvature(frames: Floats, stations: Floats) -> Floats:
    """Curvature between neighbouring stations.

    Parameters
    ----------
    frames : (T, m, 3, 3) float64
    stations : (m,) float64, m

    Returns
    -------
    (T, m - 1, 3) float64, 1/m
    """
    from octoctrl.sim.rotations import rotation_vector

    return rotation_vector(frames[:, 1:] @ np.swapaxes(frames[:, :-1], -1, -2)) / np.diff(stations)[:, None]


def apart(found: Floats, exact: Floats, points: Floats | None) -> float | None:
    """Largest difference of two histories of link, writhe or twist, in turns.

    Parameters
    ----------
    found, exact : (T,) float64
    points : (T, n + 1, 3) float64, m, or None
        Of the arm, for link and writhe, which say nothing where it stays in a plane: there self-crossings have no sign.
    """
    if points is not None:
        extents = np.linalg.svd(points.reshape(-1, 3), compute_uv=False)
        if extents[-1] < 1e-6 * extents[0]:
            return None
    return float(np.abs(np.asarray(found) - exact).max())


def errors(recording: Recording, reference: Recording, arm: Arm) -> tuple[float | None, ...]:
    """Errors of the `recording` of an `arm` against a `reference` at the same instants, in the order of `ERRORS`."""
    from octoctrl.sim.topology.measures import measure

    distance = np.linalg.norm(recording.tip - reference.tip, axis=1) / arm.length
    mine, exact = curvature(recording.frames, recording.stations), curvature(reference.frames, reference.stations)
    middle, exact_middle = ((run.stations[1:] + run.stations[:-1]) / 2 for run in (recording, reference))
    at = np.clip(np.searchsorted(exact_middle, middle), 1, len(exact_middle) - 1)
    share = ((middle - exact_middle[at - 1]) / (exact_middle[at] - exact_middle[at - 1]))[:, None]
    there = (1 - share) * exact[:, at - 1] + share * exact[:, at]
    # Curvature times the local radius is what bending strains the tissue by; unweighted, the thin tip would be all that counts.
    weights = (np.diff(recording.stations) * arm.section(middle).outline ** 2)[:, None]
    bent = np.sqrt(np.sum(weights * (mine - there) ** 2) / max(np.sum(weights * there**2), 1e-300))
    found, right = (measure(run.time, run.points, run.frames) for run in (recording, reference))
    turns = [apart(getattr(found, name), getattr(right, name), None if name == "twist" else reference.points) for name in QUANTITIES]
    return 100 * float(distance.max()), 100 * rms(distance), 100 * float(bent), *turns


def _row(
    case: str, label: str, make: Callable[[], Plant], activation: Activation, duration: float, reference: Recording, times: int
) -> tuple[Any, ...]:
    """One line of a table: what was asked for, what it cost and what it missed, or why there is nothing."""
    try:
        plant = make()
    except OctoctrlError as error:
        return (case, label, None, f"refused: {str(error).partition(' (')[0]}", *(None,) * (3 + len(ERRORS)))
    try:
        recording, spent, wall = timed_motion(plant, activation, duration, times)
    except PlantUnstableError as error:
        return (case, label, 1e3 * plant.h, f"stopped at {error.time:.2f} s", *(None,) * (3 + len(ERRORS)))
    speed = 1e3 * spent / duration, 1e3 * wall / duration, duration / spent
    return (case, label, 1e3 * plant.h, "well", *speed, *errors(recording, reference, plant.arm))


COLUMNS = ("case", "resolution", "step, ms", "end", "CPU ms / s", "wall ms / s", "x real time", *ERRORS)
COLUMN_FORMATS = ("", "", ".3f", "", ".2f", ".2f", ".0f", *FORMATS)


def rod_precision(*, full: bool = False) -> Table:
    """Rod plant over resolution and step; with `full`, more programmes and more repetitions."""
    from octoctrl.sim.plants import warmup

    warmup()
    largest = Plant().limit.step

    def above() -> Plant:
        plant = Plant(record_every=EVERY)
        plant.set_steps(6)
        return plant

    def arm(n: int) -> Callable[[], Plant]:
        return lambda: Plant(Arm.octopus(elements=n), record_every=EVERY)

    def step(share: float) -> Callable[[], Plant]:
        return lambda: Plant(dt=Plant().h / share, record_every=EVERY)

    choices = {f"n = {n}": arm(n) for n in ((24, 36, 48, 72, 96) if full else (24, 48, 96))}
    choices |= {f"n = 48, step / {share}": step(share) for share in ((2, 4, 8) if full else (2, 4))}
    choices |= {"n = 48, step 1.5 x limit": lambda: Plant(dt=1.5 * largest), "the same, forced to 1.2 x limit": above}
    rows = []
    for case, (activation, duration) in programmes(full).items():
        reference = Plant(Arm.octopus(elements=192), dt=3e-5, record_every=EVERY).advance(activation, duration)
        rows += [_row(case, label, make, activation, duration, reference, 20 if full else 8) for label, make in choices.items()]
    return Table(
        name="rod", title="Rod plant: time against error", columns=COLUMNS, formats=COLUMN_FORMATS, rows=tuple(rows),
        note="Reference: the same model with 192 elements and steps of 30 us. Link, writhe and twist are the lifted ones, in turns; the "
        "largest difference over the run counts; link and writhe are left out where the arm stays in a plane, where self-crossings have no "
        "sign. Curvature is weighted by the local radius. Without anything that breaks its symmetry a straight arm does not show that its "
        "step is too large. The defaults are n = 48 and the first step given for it.",
        curve=("tip rms, %L", "CPU ms / s", "case"),
    )  # fmt: skip


def assembly_precision(*, full: bool = False) -> Table:
    """The arm of 197 rods over the step; with `full`, 0.6 s instead of 0.2 s."""
    from octoctrl.sim.plants import make_plant

    duration, case = (0.6, "Fig 2c to 0.6 s") if full else (0.2, "Fig 2c to 0.2 s")
    activation = tasks.programme("fig2c").activation
    reference = make_plant("assembly", dt=1e-5, record_every=EVERY).advance(activation, duration)

    def make(**settings: Any) -> Callable[[], Plant]:
        return lambda: make_plant("assembly", **settings, record_every=EVERY)

    choices = {"default": make(), "step / 2": make(dt=make_plant("assembly").h / 2), "step of 0.1 ms": make(dt=1e-4)}
    rows = [_row(case, label, plant, activation, duration, reference, 2) for label, plant in choices.items()]
    return Table(
        name="assembly", title="Arm of 197 rods: time against error", columns=COLUMNS, formats=COLUMN_FORMATS, rows=tuple(rows),
        note="Reference: the same model with steps of 10 us. Errors are those of the nerve cord.",
        curve=("tip rms, %L", "CPU ms / s", "case"),
    )  # fmt: skip


def reduced_precision(*, full: bool = False) -> Table:
    """The planner's model over its step, against itself and against the rod plant; with `full`, more programmes."""
    from octoctrl.planners.fitting.identified import load_identified
    from octoctrl.sim.plants import warmup
    from octoctrl.sim.topology.measures import measure

    from ..tables import fastest

    warmup()
    configuration = tasks.load("coil")
    model = load_identified(configuration.arm, configuration.scene).model
    rows = []

    def difference(motion: ReducedMotion, time: Floats, points: Floats, trace: TopologyTrace) -> tuple[float | None, ...]:
        found = model.trace(motion.time, motion.strains)
        mine = model.points(motion.strains)[:, -1]
        tip = np.stack([np.interp(time, motion.time, column) for column in mine.T], axis=1)
        distance = np.linalg.norm(tip - points[:, -1], axis=1) / model.arm.length
        turns = [
            apart(np.interp(time, motion.time, getattr(found, name)), getattr(trace, name), None if name == "twist" else points)
            for name in QUANTITIES
        ]
        return 100 * float(distance.max()), 100 * rms(distance), *turns

    for case, (activation, duration) in programmes(full).items():
        recording = Plant(configuration.arm, configuration.scene, record_every=EVERY).advance(activation, duration)
        plant = recording.time, recording.points, measure(recording.time, recording.points, recording.frames)
        fine = model.respond(activation, duration, step=model.step / 32)
        exact = fine.time, model.points(fine.strains), model.trace(fine.time, fine.strains)
        for factor in (2, 1, 0.5, 0.25):
            step = factor * model.step
            motion = model.respond(activation, duration, step=step)
            spent, wall = fastest(partial(model.respond, activation, duration, step=step), 10)
            own, away = difference(motion, *exact), difference(motion, *plant)
            rows.append((case, 1e3 * step, 1e3 * spent / duration, 1e3 * wall / duration, duration / spent, *own, *away))
    numbers = ("tip max, %L", "tip rms, %L", "Lk", "Wr", "Tw")
    return Table(
        name="reduced", title="Reduced model: time against error", rows=tuple(rows),
        columns=("case", "step, ms", "CPU ms / s", "wall ms / s", "x real time", *numbers, *(f"{name} to plant" for name in numbers)),
        formats=("", ".1f", ".2f", ".2f", ".0f", *(".2f", ".2f", ".4f", ".4f", ".4f") * 2),
        note="Eight sections without inertia, as identified. First the error of the step, against the same model at a 32nd of its "
        "usual step; then the distance to the rod plant, which is what the model leaves out. Link, writhe and twist in turns, largest "
        "over the run.",
        curve=("tip rms, %L", "CPU ms / s", "case"),
    )  # fmt: skip
