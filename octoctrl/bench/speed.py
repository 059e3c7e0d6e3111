"""Speed: how the time of a step grows with elements, groups and threads, and what is saved by leaving out what a scene does not need."""

import os
import time
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.plants import Plant, warmup
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.templates import Plateau

from ..tables import Table, fastest

LEVEL = 0.3
WINDOW = 0.5
"""Simulated time of the stretches that are timed, s."""


def _held(*groups: str) -> Activation:
    return Activation(templates=(Plateau(groups=groups, level=LEVEL),)) if groups else Activation()


def elastic_rod(elements: int, steps: int = 500) -> float:
    """Time of a step of an elastic rod with damping, s per element of so many `elements`; so many `steps` are timed at a time."""
    from octoctrl.sim.rod.elastic import RodSimulation
    from octoctrl.sim.rod.rod import Rod

    rod = Rod.straight(length=0.2, radius=0.006, elements=elements, density=1050.0, youngs_modulus=1e5, shear_modulus=4e4, damping=5.0)
    sim = RodSimulation(rod)
    sim.spins = np.random.default_rng(0).normal(size=(elements, 3))
    spent, _ = fastest(lambda: sim.advance(steps * sim.dt), 40)
    return spent / steps / elements


def arm_step(elements: int, groups: Sequence[str], times: int = 20) -> tuple[float, float]:
    """Time of a step of the arm, all included, s per element, and how much faster than real time it is.

    Parameters
    ----------
    elements : int
    groups : sequence of str
        Active at `LEVEL`.
    times : int
        How often it is timed.
    """
    plant, activation = Plant(Arm.octopus(elements=elements)), _held(*groups)
    plant.advance(activation, 0.5)
    spent, _ = fastest(lambda: plant.advance(activation, WINDOW), times)
    return spent / (WINDOW / plant.h) / elements, WINDOW / spent


def scaling(*, full: bool = False) -> Table:
    """Time of a step over elements and active groups, and the throughput of a batch over threads; with `full` of more of both."""
    from octoctrl.sim.running.batch import simulate_batch

    warmup()
    counts = (48, 100, 200, 500, 1000) if full else (48, 100, 1000)
    rows: list[tuple[Any, ...]] = [("elastic rod with damping", n, 1e9 * elastic_rod(n), None, None) for n in counts]
    for name, groups in (("arm, no group active", ()), ("arm, one group", ("LM1",)), ("arm, all groups", MUSCLE_GROUPS)):
        for n in counts:
            cost, speed = arm_step(n, groups, 40 if n < 500 else 8)
            rows.append((name, n, 1e9 * cost, speed, None))
    plants, activation = [Plant() for _ in range(64 if full else 32)], _held("LM1", "R-OM")
    best = {threads: 0.0 for threads in sorted({1, os.cpu_count() or 1})}
    for _ in range(6):
        for threads in best:
            best[threads] = max(best[threads], simulate_batch(plants, activation, 0.5, threads=threads).throughput)
    for threads, throughput in best.items():
        name = f"batch of {len(plants)} arms, two groups, {threads} threads, wall time"
        rows.append((name, 48, None, throughput, throughput / best[1]))
    return Table(
        name="scaling", title="Scaling", rows=tuple(rows),
        columns=("what", "elements", "ns per element and step", "x real time", "to one thread"), formats=("", "d", ".1f", ".0f", ".2f"),
        note="Arms with all that belongs to a run: sampling of activations, guard, recording. The step shrinks with the element, so that "
        "real time is lost with the square of the elements. The batch is in wall time and needs its cores to itself: see "
        "`python benchmarks/batch.py`.",
    )  # fmt: skip


def _compared(activation: Activation, scene: Scene) -> tuple[float, float, bool]:
    """Seconds per step with and without skipping, in turns, and whether the motion is the same to the bit."""
    plants = [Plant(scene=scene), Plant(scene=scene, complete=True)]
    spent = [np.inf, np.inf]
    for _ in range(40):
        for index, plant in enumerate(plants):
            begin = time.process_time()
            plant.advance(activation, WINDOW)
            spent[index] = min(spent[index], time.process_time() - begin)
    one, other = (plant.state() for plant in plants)
    same = all(np.array_equal(one[name], other[name]) for name in one)
    return spent[0] * plants[0].h / WINDOW, spent[1] * plants[0].h / WINDOW, same


def skips(*, full: bool = False) -> Table:
    """What leaving out saves; with `full` also what the rod arm does without."""
    warmup()
    cases = {
        "active laws of all groups, none active": (_held(), Scene()),
        "active laws of ten groups, LM1 active": (_held("LM1"), Scene()),
        "active laws of three groups, all LM active": (_held(*MUSCLE_GROUPS[:8]), Scene()),
        "drag and laws of ten groups, vacuum, LM1 active": (_held("LM1"), Scene(water=None)),
    }
    rows = []
    for name, (activation, scene) in cases.items():
        skipped, whole, same = _compared(activation, scene)
        rows.append((name, 1e6 * skipped, 1e6 * whole, 100 * (1 - skipped / whole), "same bits" if same else "DIFFERENT"))
    for name, every in (("recording, one instant instead of fifty", 100),):
        plants = Plant(record_every=every), Plant()
        costs = [fastest(partial(plant.advance, _held("LM1"), WINDOW), 40)[0] / (WINDOW / plant.h) for plant in plants]
        rows.append((name, 1e6 * costs[0], 1e6 * costs[1], 100 * (1 - costs[0] / costs[1]), "same bits"))
    if full:
        from octoctrl.sim.plants import make_plant

        rod, assembly = Plant(), make_plant("assembly")
        assembly.advance(_held("LM1"), assembly.sample_interval)
        costs = [fastest(partial(plant.advance, _held("LM1"), 0.02), 4)[0] / 0.02 * rod.h for plant in (rod, assembly)]
        rows.append(
            ("rings, helices, cord: 196 of 197 rods", 1e6 * costs[0], 1e6 * costs[1], 100 * (1 - costs[0] / costs[1]), "another model")
        )
    return Table(
        name="skips", title="What a scene does not need", rows=tuple(rows),
        columns=("left out", "us per step", "us with it", "saved, %", "motion"), formats=("", ".2f", ".2f", ".0f", ""),
        note="Default arm, one step of 0.5 ms, all included, timed in turns. There is no code for contact, friction, obstacles or free "
        "bodies, so that nothing of it can be left out.",
    )  # fmt: skip
