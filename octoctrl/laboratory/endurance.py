"""Long runs: what ten million steps of a conservative rod leave of energy, momentum and frames, and whether an arm at rest slows down."""

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..progress import Progress

Floats = NDArray[np.float64]

STEPS = 10_000_000
PULSE, REST = 0.5, 60.0
"""Seconds of an arm's movement, and of the rest after it."""


def long_run(steps: int = STEPS, pieces: int = 20, progress: Progress | None = None) -> dict[str, float]:
    """A free elastic rod of ten elements tumbles, bends and twists; its section is constant, so that it conserves.

    Parameters
    ----------
    steps : int
    pieces : int
        How often it is measured.
    progress : Progress, optional

    Returns
    -------
    dict
        ``steps``; largest relative change of ``energy`` and its ``energy_trend`` over the run (slope of a straight line through it);
        largest departure of frames from ``orthonormality``; relative changes of ``momentum`` and ``angular_momentum``.
    """
    from octoctrl.sim.rod.elastic import RodSimulation
    from octoctrl.sim.rod.rod import Rod

    rod = Rod.straight(length=0.2, radius=0.01, elements=10, density=1000.0, youngs_modulus=1e5, shear_modulus=4e4, section="constant")
    simulation, along = RodSimulation(rod), np.linspace(0.0, 1.0, 11)
    simulation.velocities = np.stack([0.1 * np.sin(np.pi * along), 0.02 * along, 0.1 * np.cos(2 * np.pi * along)], axis=1)
    simulation.spins = np.tile([0.0, 2.0, 5.0], (10, 1))
    energies = [sum(simulation.energy().values())]
    momentum, angular = _momenta(simulation)
    if progress is not None:
        progress.start(f"{steps:,} steps of an elastic rod", total=pieces)
    for piece in range(pieces):
        simulation.advance(steps // pieces * simulation.dt)
        energies.append(sum(simulation.energy().values()))
        if progress is not None:
            progress.advance(piece + 1)
    change, frames = np.array(energies) / energies[0] - 1, simulation.frames
    last_momentum, last_angular = _momenta(simulation)
    return {
        "steps": steps,
        "energy": float(np.abs(change).max()),
        "energy_trend": float(np.polyfit(np.linspace(0.0, 1.0, len(change)), change, 1)[0]),
        "orthonormality": float(np.abs(frames @ np.swapaxes(frames, 1, 2) - np.eye(3)).max()),
        "momentum": float(np.linalg.norm(last_momentum - momentum) / np.linalg.norm(momentum)),
        "angular_momentum": float(np.linalg.norm(last_angular - angular) / np.linalg.norm(angular)),
    }


def _momenta(simulation: Any) -> tuple[Floats, Floats]:
    moving = simulation.node_mass[:, None] * simulation.velocities
    rod = simulation.rod
    # A disc of radius r turns about its diameter with m r^2 / 4, about its axis with twice that.
    discs = rod.density * np.pi * rod.radius**4 / 4 * np.linalg.norm(np.diff(rod.points, axis=0), axis=1)
    spin = np.einsum("kij,ki->j", simulation.frames, discs[:, None] * [1.0, 1.0, 2.0] * simulation.spins)
    return moving.sum(axis=0), np.cross(simulation.points, moving).sum(axis=0) + spin


def settled_speed(progress: Progress | None = None) -> dict[str, float]:
    """Whether numbers that fade towards zero (subnormal ones are slow on many processors) slow down an arm that has come to rest.

    Parameters
    ----------
    progress : Progress, optional

    Returns
    -------
    dict of str to float, s
        Processor time of a step while it is ``moving``, after 60 s of ``rest``, and of one that was ``never`` moved; and the smallest
        speed that is not zero, ``smallest``, m/s.
    """
    from octoctrl.sim.activation import Activation
    from octoctrl.sim.plants import Plant
    from octoctrl.sim.templates import Plateau

    pull = Activation(templates=(Plateau(groups=("LM1", "R-OM"), level=0.3, rise=0.1, offset=PULSE - 0.2, fall=0.1),))
    if progress is not None:
        progress.start("an arm at rest for a minute")

    def step_time(activation: Activation, before: float) -> tuple[Any, float]:
        plant, best = Plant(), np.inf
        plant.advance(activation, before)
        for _ in range(10):
            begin = time.process_time()
            plant.advance(Activation(), 0.25)
            best = min(best, time.process_time() - begin)
        return plant, best * plant.h / 0.25

    moved, moving = step_time(pull, PULSE)
    rested, rest = step_time(pull, PULSE + REST)
    _, never = step_time(Activation(), 0.05)
    speeds = np.abs(rested.observe().velocities[1:])
    return {"moving": moving, "rest": rest, "never": never, "smallest": float(speeds[speeds > 0].min(initial=np.inf)), "step": moved.h}
