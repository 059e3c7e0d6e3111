"""Steps per second and agreement of the rod kernel with PyElastica 1.0 on the same rod, in one process.

Run with ``python benchmarks/rod_against_pyelastica.py`` (needs ``pip install pyelastica``; about a minute). The first ten steps of either,
which compile or load compiled code, are not timed. Absolute times depend on the machine; the ratio hardly does.
"""

import time
from importlib import metadata
from itertools import product

import numpy as np

from octoctrl.sim.rod.elastic import RodSimulation
from octoctrl.sim.rod.rod import Rod
from octoctrl.tables import Table

LENGTH, RADIUS, DENSITY, YOUNG = 0.2, 0.006, 1050.0, 1e5
STEPS, TURN, DT, WARM = 10_000, 1000, 1e-5, 10
TIP_FORCE = np.array([3e-3, 0.0, 6e-3])


def motion(elements):
    """Velocities of nodes and spins of elements of a rod that tumbles."""
    s, k = np.linspace(0, 1, elements + 1), np.linspace(0, 1, elements)
    velocities = np.stack([0.1 * np.sin(3 * s), 0.05 * np.cos(2 * s), 0.1 * s**2], axis=1)
    return velocities, np.stack([np.full(elements, 0.3), np.sin(6 * k), 5 * np.cos(3 * k)], axis=1)


def theirs(elements, clamped):
    """A rod of PyElastica as (step, positions): `step` takes so many steps."""
    import elastica

    class System(elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing):
        pass

    system = System()
    rod = elastica.CosseratRod.straight_rod(
        elements, np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), LENGTH, RADIUS, DENSITY,
        youngs_modulus=YOUNG, shear_modulus=YOUNG / 1.5,
    )  # fmt: skip
    system.append(rod)
    if clamped:
        system.constrain(rod).using(elastica.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,))
        system.add_forcing_to(rod).using(elastica.EndpointForces, np.zeros(3), TIP_FORCE, ramp_up_time=1e-12)
    else:
        velocities, spins = motion(elements)
        rod.velocity_collection[:], rod.omega_collection[:] = velocities.T, spins.T
    system.finalize()
    stepper, now = elastica.PositionVerlet(), 0.0

    def step(count):
        nonlocal now
        for _ in range(count):
            now = stepper.step(system, now, DT)

    return step, lambda: rod.position_collection.T


def ours(elements, clamped):
    """The same rod of octoctrl as (step, positions)."""
    rod = Rod.straight(
        length=LENGTH, radius=RADIUS, elements=elements, density=DENSITY, youngs_modulus=YOUNG, shear_modulus=YOUNG / 1.5,
        support="element" if clamped else "free",
    )  # fmt: skip
    sim = RodSimulation(rod, dt=DT)
    if clamped:
        sim.load(tip_force=TIP_FORCE)
    else:
        sim.velocities, sim.spins = motion(elements)
    return lambda count: sim.advance(count * DT), lambda: sim.points


def compare(full=True):
    """Both kinds of rod, in turns of `TURN` steps, each at its fastest turn; as a `Table`."""
    rows = []
    for clamped, elements in product((False, True), (50, 100, 200, 1000) if full else (100,)):
        rods = theirs(elements, clamped), ours(elements, clamped)
        spent = [np.inf, np.inf]
        for step, _ in rods:
            step(WARM)
        for _ in range(STEPS // TURN):
            for index, (step, _) in enumerate(rods):
                begin = time.process_time()
                step(TURN)
                spent[index] = min(spent[index], (time.process_time() - begin) / TURN)
        difference = float(np.abs(rods[0][1]() - rods[1][1]()).max() / LENGTH)
        label = "clamped" if clamped else "free"
        rows.append((label, elements, 1e6 * spent[0], 1e6 * spent[1], 1e9 * spent[1] / elements, spent[0] / spent[1], difference))
    return Table(
        name="pyelastica", title=f"Elastic rod beside PyElastica {metadata.version('pyelastica')}", rows=tuple(rows),
        columns=("rod", "elements", "PyElastica, us / step", "octoctrl, us / step", "ns per element and step", "ratio", "difference / L"),
        formats=("", "d", ".1f", ".2f", ".1f", ".1f", ".1e"),
        note=f"The same rod for {STEPS} steps in one process, in turns of {TURN} steps, the fastest of which counts: "
        "`python benchmarks/rod_against_pyelastica.py`.",
    )  # fmt: skip


if __name__ == "__main__":
    print(compare())
