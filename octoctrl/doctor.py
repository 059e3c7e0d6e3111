"""The doctor: whether the installation is sound, and what a task needs, what is left out for it, and how long it will run."""

import os
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module, metadata
from typing import Any

import numpy as np

from octoctrl import __version__
from octoctrl.sim.activation import Activation
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import PLANTS, Plant, PlantRow
from octoctrl.sim.scene.scene import Scene, self_contact

from .files.configuration import Configuration

TIP = (0.0010627002, 0.1972058310, 0.0)
"""Where the default arm's tip stands after 0.1 s of LM1 at 0.3, m: x towards LM1, y along the arm."""
TIP_TOLERANCE = 1e-8
"""Rounding differs between processors; nothing else does."""

STRETCH = 0.05
"""Simulated time that is timed to foresee a run, s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """Lines of a diagnosis.

    Attributes
    ----------
    title : str
    rows : tuple of (str, str, str)
        What, what was found, and a mark: "well", "NOT WELL", "needed", "left out" or nothing.
    """

    title: str
    rows: tuple[tuple[str, str, str], ...]

    @property
    def sound(self) -> bool:
        """Whether nothing is wrong."""
        return all(mark != "NOT WELL" for *_, mark in self.rows)

    def __str__(self) -> str:
        width, marks = max(len(what) for what, *_ in self.rows), max(len(mark) for *_, mark in self.rows)
        return "\n".join([self.title, *(f" {what:{width}}   {mark:{marks}}   {found}".rstrip() for what, found, mark in self.rows)])

    def content(self) -> dict[str, dict[str, str]]:
        """The lines as plain data."""
        return {what: {"found": found, "mark": mark} for what, found, mark in self.rows}


def installation() -> Findings:
    """Check versions, cache of compiled code, solver and plant."""
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("numpy", "numba", "casadi", "scipy", "control", "matplotlib"))
    rows = [
        ("octoctrl", f"{__version__}, Python {platform.python_version()}, {platform.system()}", "well"),
        ("libraries", versions, "well"),
        ("processor", f"{os.cpu_count()} cores; one arm runs on one, a batch on all", "well"),
    ]
    for what, check in (("compiled code", _cache), ("solver", _solver), ("plant", _plant)):
        try:
            rows.append((what, check(), "well"))
        except Exception as error:
            rows.append((what, f"{type(error).__name__}: {error}", "NOT WELL"))
    return Findings(title="Installation", rows=tuple(rows))


def compiled() -> dict[str, bool]:
    """Which plants are compiled and on disk, by name; those without compiled code are left out."""
    from octoctrl.sim.compiler import cache_folder

    def kept(stepper: Callable[..., Any]) -> bool:
        folder, module = cache_folder(stepper), stepper.__module__.rpartition(".")[2]
        return folder is not None and any(folder.glob(f"{module}.{stepper.__name__}*advance*.nbc"))

    return {name: kept(_stepper(row)) for name, row in PLANTS.items() if row.compiled}


def _stepper(row: PlantRow) -> Callable[..., Any]:
    module, _, name = row.compiled.partition(":")
    found: Callable[..., Any] = getattr(import_module(module), name)
    return found


def _cache() -> str:
    from octoctrl.sim.compiler import cache_folder

    folder = cache_folder(_stepper(PLANTS["rod"]))
    if folder is None or not os.access(folder, os.W_OK):
        raise OctoctrlError("no folder for compiled code can be written, so that every start compiles; set NUMBA_CACHE_DIR to one that can")
    state = [f"{name} {'kept on disk' if done else f'not yet (octoctrl warmup --plant {name})'}" for name, done in compiled().items()]
    return f"folder can be written; {', '.join(state)}"


def _solver() -> str:
    import casadi as ca

    x = ca.SX.sym("x", 5)
    # The last term makes it strictly convex, which DAQP needs.
    problem = {"x": x, "f": ca.sumsqr(x[1:] - x[:-1]) + 1e-8 * ca.sumsqr(x), "g": ca.vertcat(x[0], x[-1])}
    quiet = {"print_header": False, "print_iteration": False, "print_status": False, "print_time": False}
    solver = ca.nlpsol("solver", "sqpmethod", problem, {"qpsol": "daqp", "qpsol_options": {"print_time": False}, **quiet})
    found = np.asarray(solver(x0=0, lbg=[0, 1], ubg=[0, 1])["x"]).ravel()
    if not np.allclose(found, np.linspace(0, 1, 5), atol=1e-6):
        raise OctoctrlError("CasADi's sqpmethod with DAQP does not solve a problem of five nodes; reinstall casadi")
    return "sqpmethod with DAQP solves a problem of five nodes"


def _plant() -> str:
    from octoctrl.sim.templates import Plateau

    plant = Plant()
    plant.advance(Activation(templates=(Plateau(groups=("LM1",), level=0.3),)), 0.1)
    away = float(np.abs(plant.observe().points[-1] - TIP).max())
    if not away < TIP_TOLERANCE:
        raise OctoctrlError(
            f"after 0.1 s the tip is {1e3 * away:.2g} mm from where it should be; delete the cache of compiled code and try again"
        )
    return f"0.1 s of motion end within {1e9 * TIP_TOLERANCE:.0f} nm of the stored place"


def needs(configuration: Configuration) -> Findings:
    """Say what the task of a `configuration` needs, what is left out for it, which step binds, and how long a run will take."""
    task, name = configuration.task, configuration.run.plant
    activation, duration = _guess(configuration)
    row, plant = PLANTS[name], Plant(configuration.arm, configuration.scene, name)
    rows = [("plant", f"{name}: {row.text}", "needed"), *_features(plant, row, activation.groups)]
    rows += [("step", step_text(plant), ""), ("run time", _run_time(plant, row, activation, duration), "")]
    rows += _volume(plant)
    if plant.retried:
        rows.append(("finer steps", f"{plant.retried} samples of these {plant.time:.3g} s would have stopped at the whole step", "needed"))
    return Findings(title=f"Task '{task.name}'", rows=tuple(rows))


def _volume(plant: Plant) -> list[tuple[str, str, str]]:
    """A line on the volume after the stretch that was timed, if the plant keeps books of it."""
    series = plant.core.series()
    if "volume" not in series:
        return []
    whole, worst = float(series["volume"]), float(np.abs(series["slab_volume"] - 1).max())
    return [
        ("volume", f"{whole:.2%} of rest after {plant.time:.3g} s, worst slab {worst:.2%} off; `verify` holds it to 3 % and 5 %", "needed")
    ]


def _guess(configuration: Configuration) -> tuple[Activation, float]:
    """Activation and duration of a task at the numbers with which planning starts."""
    from octoctrl.planners.asking.schedule import Schedule

    task = configuration.task.on(configuration.arm)
    begins, duration = dict[str, float](), 0.0
    for phase in task.phases:
        begins[phase.name], duration = duration, duration + phase.duration
    if task.choose is not None:  # what the muscles will do, nobody knows before it is planned
        return Activation(), duration
    return Schedule(primitives=tuple(drive.at(begins, {}) for drive in task.drives), duration=duration).activation(), duration


def _features(plant: Plant, row: PlantRow, groups: Sequence[str]) -> list[tuple[str, str, str]]:
    """Lines on what is computed and what not."""
    water = plant.scene.water
    resting = ", ".join(group for group in plant.arm.layout.names if group not in groups)
    every = 1e3 * plant.record_every * plant.sample_interval
    rows = [("muscles", f"{', '.join(groups) or 'none'}: active law while they pull", "needed")]
    if resting and row.law_of_each:
        rows.append(("muscles at rest", f"{resting}: passive stress, no active law", "left out"))
    elif resting:
        rows.append(("muscles at rest", f"{resting}: evaluated with the others of their family", "needed"))
    if water is None or water.factor == 0:
        rows.append(("water", "a vacuum: no drag", "left out"))
    else:
        rows.append(("water", f"quadratic and linear drag, factor {water.factor:g}", "needed"))
    if row.lumped:
        rows.append((row.lumped, "lumped into the section of one rod", "left out"))
    nothing = "no such code: costs nothing and hinders nothing"
    if plant.scene.objects:
        named = ", ".join(item.name for item in plant.scene.objects)
        rows.append(("contact, friction", f"with {named}: an implicit impulse, anchored friction", "needed"))
    else:
        rows.append(("contact, friction", f"no objects: {nothing}", "left out"))
    between = "" if row.lumped else "between sections of the arm: "
    if plant.scene.self_contact:
        rows.append(("self-contact", f"{between}an implicit impulse without friction", "needed"))
    else:
        rows.append(("self-contact", f"{between}{nothing}; crossings are counted", "left out"))
    return [
        *rows,
        ("third dimension", "always computed", "needed"),
        ("recording", f"points, frames, stretch, levels every {every:g} ms; no energies", "needed"),
    ]


def step_text(plant: Plant) -> str:
    """The step in use by a `plant`, against the predicted limit, with the reason for it."""
    from octoctrl.sim.running.clock import SAFETY

    limit, usual, share = plant.limit, plant.core.usual, plant.h / plant.limit.step
    if not np.isclose(usual, SAFETY * limit.step) and usual > SAFETY * limit.step:
        return f"{1e3 * plant.h:.3g} ms; the largest allowed is {1e3 * limit.step:.3g} ms ({limit.mechanism})"
    if plant.sample_interval < usual:
        reason = f"one per sample of {1e3 * plant.sample_interval:g} ms"
    elif usual < SAFETY * limit.step:
        reason = f"held at {1e3 * usual:g} ms, which the onset of muscles needs"
    else:
        reason = f"{SAFETY:g} of it in whole steps per sample"
    where = f"{limit.mechanism}, element {limit.element + 1} of {plant.elements}"
    return f"{1e3 * plant.h:.3g} ms; predicted limit {1e3 * limit.step:.3g} ms ({where}); {share:.2f} of it: {reason}"


def _run_time(plant: Plant, row: PlantRow, activation: Activation, duration: float) -> str:
    """What a run of `duration` will take, from a short stretch of it."""
    from .tables import fastest

    if row.compiled and not compiled()[row.name] and row.name != "rod":
        return f"not known before it is compiled: octoctrl warmup --plant {row.name}"
    plant.advance(activation, plant.sample_interval)
    once, _ = fastest(lambda: plant.advance(activation, plant.sample_interval), 1)
    # Several short stretches of a plant that is fast, one sample of one that is not.
    stretch, times = (STRETCH, 5) if once < plant.sample_interval else (plant.sample_interval, 1)
    spent, _ = fastest(lambda: plant.advance(activation, stretch), times)
    return f"about {spent / stretch * duration:.2g} s for {duration:.3g} s of motion ({stretch / spent:.2g} x real time), without feedback"


def plan_header(configuration: Configuration) -> str:
    """One line on what a plan of a `configuration` takes into account."""
    from octoctrl.planners.solving.grasping import is_simulated

    activation, duration = _guess(configuration)
    task, scene, phases = configuration.task, configuration.scene, len(configuration.task.phases)
    groups = "any" if task.choose is not None else str(len(activation.groups))
    counted = f"{groups} of {len(configuration.arm.layout)} muscle groups, {'no drag' if scene.water is None else 'drag'}"
    lasting = f"{phases} phase{'s' * (phases != 1)}, {duration:.3g} s at first"
    if is_simulated(task):
        return f"planned by simulating one rod: {counted}, {_contact(scene)}; {lasting}"
    return f"reduced model: {counted}, no inertia, no contact{', no loads' if scene.loads else ''}; {lasting}"


def _contact(scene: Scene) -> str:
    """What of a `scene` acts on a plant, besides the water."""
    count = len(scene.objects)
    contact = f"contact with {count} object{'s' * (count != 1)}" if count else "no contact"
    contact += f", {self_contact(scene)}" if scene.self_contact else ""
    return contact + (f", {len(scene.loads)} load{'s' * (len(scene.loads) != 1)}" if scene.loads else "")


def header(plant: Plant, groups: Sequence[str]) -> str:
    """One line on what a run on a `plant` with these active `groups` of muscles computes."""
    water = plant.scene.water is not None and plant.scene.water.factor > 0
    active, drag = f"{len(groups)} of {len(plant.arm.layout)} muscle groups active", "drag" if water else "no drag"
    return (
        f"{plant.model} plant: {active}, {drag}, {_contact(plant.scene)}; "
        f"step {1e3 * plant.h:.3g} ms, {plant.h / plant.limit.step:.2f} of the limit ({plant.limit.mechanism})"
    )
