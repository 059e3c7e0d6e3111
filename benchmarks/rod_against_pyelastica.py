"""Steps per second and agreement of the rod kernel with PyElastica 1.0 on the same rod, in one process.

Run with ``python benchmarks/rod_against_pyelastica.py`` (needs ``pip install pyelastica``; about a minute). The first ten steps of either,
which compile or load compiled code, are not timed. Absolute times depend on the machine; the ratio hardly does.
"""

import time

import numpy as np

from octoctrl.sim.rod import Rod, RodSimulation

LENGTH, RADIUS, DENSITY, YOUNG = 0.2, 0.006, 1050.0, 1e5
STEPS, DT, WARM = 10_000, 1e-5, 10
TIP_FORCE = np.array([3e-3, 0.0, 6e-3])


def motion(elements):
    """Velocities of nodes and spins of elements of a rod that tumbles."""
    s, k = np.linspace(0, 1, elements + 1), np.linspace(0, 1, elements)
    velocities = np.stack([0.1 * np.sin(3 * s), 0.05 * np.cos(2 * s), 0.1 * s**2], axis=1)
    return velocities, np.stack([np.full(elements, 0.3), np.sin(6 * k), 5 * np.cos(3 * k)], axis=1)


def run_theirs(elements, clamped):
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
    for _ in range(WARM):
        now = stepper.step(system, now, DT)
    begin = time.perf_counter()
    for _ in range(STEPS - WARM):
        now = stepper.step(system, now, DT)
    return rod.position_collection.T, (time.perf_counter() - begin) / (STEPS - WARM)


def run_ours(elements, clamped):
    rod = Rod.straight(
        length=LENGTH, radius=RADIUS, elements=elements, density=DENSITY, youngs_modulus=YOUNG, shear_modulus=YOUNG / 1.5,
        support="element" if clamped else "free",
    )  # fmt: skip
    sim = RodSimulation(rod, dt=DT)
    if clamped:
        sim.load(tip_force=TIP_FORCE)
    else:
        sim.velocities, sim.spins = motion(elements)
    sim.advance(WARM * DT)
    begin = time.perf_counter()
    sim.advance((STEPS - WARM) * DT)
    return sim.points, (time.perf_counter() - begin) / (STEPS - WARM)


def main():
    print(f"{'rod':>8} {'n':>4} {'PyElastica us/step':>19} {'octoctrl us/step':>17} {'ns/element':>11} {'ratio':>6} {'difference / L':>15}")
    for clamped in (False, True):
        for elements in (50, 100, 200):
            ours, spent = run_ours(elements, clamped)
            theirs, theirs_spent = run_theirs(elements, clamped)
            difference = np.abs(ours - theirs).max() / LENGTH
            print(
                f"{'clamped' if clamped else 'free':>8} {elements:4d} {theirs_spent * 1e6:19.1f} {spent * 1e6:17.2f} "
                f"{spent / elements * 1e9:11.1f} {theirs_spent / spent:6.1f} {difference:15.1e}"
            )


if __name__ == "__main__":
    main()
