"""Predicted step limits against what runs do, for every kind of load, against a closed form, and against all eigenvalues of the step."""

import numpy as np
import pytest

from octoctrl.bench.steps import arm_families, arm_is_stable, arm_prediction, bisect, rod_families, rod_is_stable
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import Plant
from octoctrl.sim.rod.core import LARGEST_STEP
from octoctrl.sim.rod.elastic import RodSimulation
from octoctrl.sim.rod.layout import STATE_ROWS, Row
from octoctrl.sim.rod.rod import Rod
from octoctrl.sim.rod.step_limits import SHEAR, STRETCH, TWIST
from octoctrl.sim.rotations import rotation_matrix, rotation_vector
from octoctrl.sim.running.clock import SAFETY

MATERIAL = {"length": 0.2, "density": 1050.0}


@pytest.fixture(scope="module")
def rods():
    return rod_families()


MECHANISMS = {
    "rod, stretch": STRETCH,
    "rod, twist": TWIST,
    "rod, shear": SHEAR,
    "rod, bending": SHEAR,
    "rod, stretched": SHEAR,
    "rod, bent round": SHEAR,
}


@pytest.mark.parametrize("name", MECHANISMS)
def test_rods_are_stable_below_the_predicted_limit_and_not_above(rods, name):
    sim = rods[name]
    limit = sim.step_limit()
    assert limit.mechanism == MECHANISMS[name]
    assert rod_is_stable(sim, 0.95 * limit.step)
    assert not rod_is_stable(sim, 1.05 * limit.step)


def test_rods_are_really_deformed(rods):
    assert np.linalg.norm(rods["rod, stretched"].points[-1]) > 1.25 * 0.2
    assert np.linalg.norm(rods["rod, bent round"].points[-1]) < 0.8 * 0.2


@pytest.mark.parametrize("name", arm_families())
def test_arms_are_stable_below_the_predicted_limit_and_not_above(name):
    activation, scene = arm_families()[name]
    rest, lowest, tip = arm_prediction(activation, scene)
    assert arm_is_stable(0.9 * lowest.step, activation, scene, tip)
    assert not arm_is_stable(1.12 * lowest.step, activation, scene, tip)
    # What dt="auto" takes is stable under the load, and not needlessly small.
    assert 0.5 * lowest.step < Plant(scene=scene).h < lowest.step
    assert SAFETY * rest.step < lowest.step


@pytest.mark.parametrize("elements", [20, 80])
def test_twist_wave_against_the_closed_form(elements):
    shear = 2e5
    rod = Rod.straight(
        radius=0.01, elements=elements, youngs_modulus=1e5, shear_modulus=shear, shear_coefficient=1e-4, support="clamped", **MATERIAL
    )
    # A chain of equal discs and springs, clamped half an element away, free at the other end: its fastest mode is this.
    expected = 0.2 / elements / np.sqrt(shear / 1050.0)
    limit = RodSimulation(rod).limit
    assert limit.mechanism == TWIST
    assert limit.step == pytest.approx(expected, rel=0.01)


def step_matrix(sim, h):
    """The linear map of one step on displacements, rotations, velocities and spins, by central differences."""
    n, rows = sim.elements, sim.rows
    sim.dt = h
    start = rows[:STATE_ROWS].copy()
    nodes, elements = slice(2, n + 2), slice(1, n + 1)
    scales = np.concatenate([np.full(3 * n, 1e-3), np.ones(3 * n), np.full(3 * n, 1e-3 / h), np.full(3 * n, 1 / h)])

    def moved(change):
        rows[:STATE_ROWS] = start
        place, turn, speed, spin = (part.reshape(3, n) for part in np.split(change * scales, 4))
        rows[Row.X1 : Row.X3 + 1, nodes] += place
        frames = start[Row.Q11 : Row.Q33 + 1, elements].T.reshape(n, 3, 3)
        rows[Row.Q11 : Row.Q33 + 1, elements] = (rotation_matrix(turn.T) @ frames).reshape(n, 9).T
        rows[Row.V1 : Row.V3 + 1, nodes] += speed
        rows[Row.W1 : Row.W3 + 1, elements] += spin
        sim.advance(h)
        after = rows[Row.Q11 : Row.Q33 + 1, elements].T.reshape(n, 3, 3)
        turned = rotation_vector(after @ np.swapaxes(frames, 1, 2)).T
        found = [rows[Row.X1 : Row.X3 + 1, nodes] - start[Row.X1 : Row.X3 + 1, nodes], turned]
        found += [rows[Row.V1 : Row.V3 + 1, nodes], rows[Row.W1 : Row.W3 + 1, elements]]
        return np.concatenate([part.ravel() for part in found]) / scales

    columns = [(moved(1e-5 * unit) - moved(-1e-5 * unit)) / 2e-5 for unit in np.eye(12 * n)]
    rows[:STATE_ROWS] = start
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("damping", [0.0, 30.0])
def test_no_eigenvalue_of_the_step_leaves_the_unit_circle_before_the_limit(damping):
    rod = Rod.straight(
        radius=np.linspace(0.012, 0.004, 8),
        elements=8,
        youngs_modulus=1e5,
        shear_modulus=4e4,
        support="clamped",
        damping=damping,
        **MATERIAL,
    )
    sim = RodSimulation(rod)
    largest = {share: np.abs(np.linalg.eigvals(step_matrix(sim, share * sim.limit.step))).max() for share in (0.98, 1.02)}
    assert largest[0.98] < 1 + 1e-6
    assert largest[1.02] > 1.1


def test_prediction_leaves_the_plant_as_it_was():
    plant = Plant()
    before, scalars = plant.core.buffer[: STATE_ROWS * plant.core.rows.shape[1]].copy(), plant.core._scalars
    damping = plant.core.rows[Row.NODE_DECAY : Row.MOBILITY3 + 1].copy()
    plant.core.step_limit(np.full((11, plant.elements), 0.3))
    assert np.array_equal(before, plant.core.buffer[: before.size]) and plant.core._scalars == scalars
    assert np.array_equal(damping, plant.core.rows[Row.NODE_DECAY : Row.MOBILITY3 + 1])


def test_step_of_a_coarse_arm_is_that_of_its_muscles():
    plant = Plant(Arm.octopus(elements=16, taper=2.0))
    assert plant.limit.step > 2 * LARGEST_STEP and plant.h == LARGEST_STEP
    with pytest.raises(OctoctrlError, match=r"exceeds the stability bound .* \(shear and bending of the section\)"):
        Plant(dt=1e-3)


def test_bisection_finds_a_threshold():
    assert bisect(lambda h: h < 1.37, 1.0, tolerance=0.001) == pytest.approx(1.37, rel=0.002)
    assert bisect(lambda h: h < 0.6, 1.0, tolerance=0.001) == pytest.approx(0.6, rel=0.002)
