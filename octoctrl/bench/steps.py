"""Predicted against found step limits: power iteration on one side, bisection over whole runs on the other, for every kind of load."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.rod.layout import Row
from octoctrl.sim.running.clock import StepLimit
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.templates import Plateau

from ..tables import Table

if TYPE_CHECKING:
    from octoctrl.sim.rod.elastic import RodSimulation

Floats = NDArray[np.float64]

SEED = 1e-6
"""Random velocities (m/s) from which a mode can grow, where symmetry would leave it exactly zero."""
DURATION = 2.0
ROUGH = 0.01
"""Second difference of velocity along the arm, over the largest mean speed of the run, from which on a run counts as unstable."""
ASTRAY = 0.01
"""Distance of the final tip from that of a run at small steps, in arm lengths, from which on a run counts as unstable."""

GROUPS = {
    "LM1": ("LM1",),
    "LM1, LM2, LM8": ("LM1", "LM2", "LM8"),
    "all LM": LONGITUDINAL_GROUPS,
    "R-OM": ("R-OM",),
    "both OM": ("R-OM", "L-OM"),
    "TM": ("TM",),
    "LM and TM": (*LONGITUDINAL_GROUPS, "TM"),
    "all": MUSCLE_GROUPS,
}


def arm_families() -> dict[str, tuple[Activation, Scene]]:
    """Loads of the arm by name: activation and scene."""
    found = {"none": (Activation(), Scene())}
    for name, groups in GROUPS.items():
        for level in (0.3, 1.0):
            found[f"{name} at {level:g}"] = (Activation(templates=(Plateau(groups=groups, level=level, rise=0.5),)), Scene())
    bend = Activation(templates=(Plateau(groups=("LM1",), level=0.3, rise=0.5),))
    return found | {"LM1 at 0.3, vacuum": (bend, Scene(water=None)), "LM1 at 0.3, ten times the drag": (bend, Scene.free(factor=10.0))}


def stirring(elements: int) -> Floats:
    """Small random velocities (n + 1, 3) for the nodes of a rod of so many `elements` that is clamped at its base, m/s."""
    velocities = SEED * np.random.default_rng(2).normal(size=(3, elements + 1)).T
    velocities[0] = 0.0
    return velocities


def arm_prediction(activation: Activation, scene: Scene, instants: int = 20) -> tuple[StepLimit, StepLimit, Floats]:
    """Step limits of an arm along its motion under a load.

    Parameters
    ----------
    activation : Activation
    scene : Scene
    instants : int
        At which the limit is predicted.

    Returns
    -------
    rest, lowest : StepLimit
        At rest, and the smallest of the motion.
    tip : (3,) float64, m
        At the end.
    """
    from octoctrl.sim.plants import Plant

    plant = Plant(scene=scene, dt=1e-4)
    limits = [plant.limit]
    for _ in range(instants):
        plant.advance(activation, DURATION / instants)
        limits.append(plant.core.step_limit(activation.levels(np.array([plant.time]), plant.edges)[0]))
    return limits[0], min(limits, key=lambda limit: limit.step), plant.observe().points[-1]


def arm_is_stable(h: float, activation: Activation, scene: Scene, tip: Floats, steps: int = 10) -> bool:
    """Whether an arm comes through a load at the step h, with the tip where it should be and without chatter.

    Parameters
    ----------
    h : float, s
    activation : Activation
    scene : Scene
    tip : (3,) float64, m
        Where the run should end.
    steps : int
        In each sample.
    """
    from octoctrl.sim.plants import Plant

    plant = Plant(scene=scene, sample_interval=steps * h)
    plant.set_steps(steps)
    plant.core.displace(velocities=stirring(plant.elements))
    peak, count = SEED, round(DURATION / plant.sample_interval)
    try:
        for _ in range(4):
            plant.advance(activation, max(1, count // 4) * plant.sample_interval)
            peak = max(peak, np.linalg.norm(plant.observe().velocities, axis=1).mean())
    except PlantUnstableError:
        return False
    rough = np.linalg.norm(np.diff(plant.observe().velocities, 2, axis=0), axis=1).mean() / peak
    away = np.linalg.norm(plant.observe().points[-1] - tip) / plant.arm.length
    # An arm that never moved keeps nothing but its seed, which is rough.
    return bool(away < ASTRAY and (rough < ROUGH or peak < 2 * SEED))


def rod_families() -> "dict[str, RodSimulation]":
    """Elastic rods of which each stresses one mechanism, at rest, stretched and bent, ready to be advanced."""
    from octoctrl.sim.rod.elastic import RodSimulation
    from octoctrl.sim.rod.rod import Rod

    def rod(
        radius: float = 0.01,
        young: float = 1e5,
        shear: float = 4e4,
        coefficient: float = 0.9,
        elements: int = 40,
        fibres: float = 1.0,
        **load: tuple[float, float, float],
    ) -> RodSimulation:
        sim = RodSimulation(
            Rod.straight(
                length=0.2, radius=radius, elements=elements, density=1050.0, youngs_modulus=young, shear_modulus=shear,
                shear_coefficient=coefficient, support="clamped", damping=20.0,
            )
        )  # fmt: skip
        # Stiff fibres along the axis: in a homogeneous rod sections turn at least as fast as they stretch.
        sim.rows[Row.AXIAL] *= fibres
        sim.limit = sim.step_limit()
        sim.load(**load)
        if load:
            sim.dt = 0.3 * sim.limit.step
            sim.advance(3.0)
        return sim

    return {
        "rod, stretch": rod(fibres=10.0),
        "rod, twist": rod(shear=2e5, coefficient=0.02),
        "rod, shear": rod(radius=0.02, elements=20),
        "rod, bending": rod(radius=0.004, young=1e6, shear=4e5),
        "rod, stretched": rod(radius=0.004, tip_force=(0.0, 1.25, 0.0)),
        "rod, bent round": rod(radius=0.004, tip_couple=(0.0, 0.0, 5e-4)),
    }


def rod_is_stable(sim: "RodSimulation", h: float, steps: int = 4000) -> bool:
    """Whether a rod stays where it is at the step h.

    Parameters
    ----------
    sim : RodSimulation
        It is left as found.
    h : float, s
    steps : int
    """
    good, dt = sim.state(), sim.dt
    before = np.abs(sim.velocities).max()
    sim.velocities = sim.velocities + stirring(sim.elements)
    sim.dt = h
    try:
        sim.advance(steps * h)
        return bool(np.abs(sim.velocities).max() < 100 * SEED + 10 * before)
    except PlantUnstableError:
        return False
    finally:
        sim.restore(good)
        sim.dt = dt


def bisect(stable: Callable[[float], bool], guess: float, tolerance: float = 0.02) -> float:
    """Largest stable step, between a quarter and four times a guess.

    Parameters
    ----------
    stable : callable
        ``stable(h)`` -> bool.
    guess : float, s
    tolerance : float

    Returns
    -------
    float, s
        The quarter if nothing is stable, four times the guess if everything is.
    """
    low, high = guess / 4, guess * 4
    for factor in (0.8, 1.25):
        if stable(factor * guess):
            low = factor * guess
        else:
            high = min(high, factor * guess)
    while high / low > 1 + tolerance:
        middle = np.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return float(low)


def steps(*, full: bool = False) -> Table:
    """Predicted against found step limits; `full` makes no difference."""
    from octoctrl.sim.plants import Plant, warmup

    warmup()
    rows = []
    for name, sim in rod_families().items():
        limit = sim.step_limit()
        found = bisect(partial(rod_is_stable, sim), limit.step)
        rows.append(
            (name, 1e3 * sim.limit.step, 1e3 * limit.step, limit.mechanism, 1e3 * found, limit.step / found, 0.8 * sim.limit.step / found)
        )
    for name, (activation, scene) in arm_families().items():
        rest, lowest, tip = arm_prediction(activation, scene)
        found = bisect(partial(arm_is_stable, activation=activation, scene=scene, tip=tip), lowest.step)
        auto = Plant(scene=scene).h
        rows.append((name, 1e3 * rest.step, 1e3 * lowest.step, lowest.mechanism, 1e3 * found, lowest.step / found, auto / found))
    return Table(
        name="steps", title="Largest stable step: predicted and found", rows=tuple(rows),
        columns=("load", "at rest, ms", "lowest of the motion, ms", "mechanism", "found, ms", "lowest / found", "auto / found"),
        formats=("", ".3f", ".3f", "", ".3f", ".2f", ".2f"),
        note="Predicted by power iteration on the compiled step, at rest and in twenty states of the motion; found by bisection of whole "
        "runs (2 s of the arm, 4000 steps of a rod) from small random velocities: the largest step at which a run neither stops nor "
        "chatters nor ends elsewhere. The last column is the step of dt=\"auto\", which divides the sample interval, over the found limit.",
    )  # fmt: skip
