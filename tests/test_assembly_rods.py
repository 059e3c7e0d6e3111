"""Rods of the full arm against plain NumPy from the equations: internal loads, published filter and drag; and whether bits repeat."""

import os
import subprocess
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest
from assembly_parts import parts_of
from scipy.spatial.transform import Rotation

from octoctrl.sim.activation import Activation
from octoctrl.sim.assembly.buffer import set_filter_masks
from octoctrl.sim.assembly.constants import stiffness
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.published_kernels import published_drag, published_strain, velocity_filters
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, Arm
from octoctrl.sim.physics.fibre_kernels import law_constants
from octoctrl.sim.plants import make_plant
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.templates import Plateau

ARM = Arm.octopus()
LEVEL = 0.2


def vectors(view, row, **nodes):
    return np.stack([view(R(row + i), **nodes) for i in range(3)], axis=-1)


def family(plant, name):
    """View of the rows, geometry, whether closed, muscle laws per rod, of a family."""
    rods, arm = plant.core.rods, plant.arm
    return {
        "straight": (rods.straight, plant.core.geometry.straight, False, arm.longitudinal),
        "oblique": (rods.oblique, plant.core.geometry.oblique, False, arm.oblique),
        "rings": (rods.ring, plant.core.geometry.rings, True, arm.transverse),
    }[name]


@pytest.fixture(scope="module")
def moving():
    """An arm whose nodes and frames lie anywhere near rest, in random motion, with all muscles at one level."""
    plant = make_plant("assembly")
    rods, generator = plant.core.rods, np.random.default_rng(21)
    for name, size in (("straight", 1e-4), ("oblique", 3e-5), ("rings", 3e-5)):
        view, _, closed, _ = family(plant, name)
        nodes = {} if closed else {"nodes": True}
        for i in range(3):
            view(R.X1 + i, **nodes)[:] += size * generator.standard_normal(view(R.X1, **nodes).shape)
            view(R.V1 + i, **nodes)[:] = 1e-3 * generator.standard_normal(view(R.V1, **nodes).shape)
            view(R.W1 + i)[:] = 3e3 * generator.standard_normal(view(R.W1).shape)
        view(R.LEVEL_BEFORE)[:] = view(R.LEVEL_AFTER)[:] = LEVEL
    parts = parts_of(plant)
    parts["move"](rods.flat, 4e-5)
    return plant, parts, rods.flat.copy()


@pytest.fixture
def state(moving):
    plant, parts, flat = moving
    plant.core.rods.flat[:] = flat
    return plant, parts


def difference(values, closed):
    """Values of elements or joints (R, n, 3) on their ends: later minus earlier, with nothing outside an open rod."""
    if closed:
        return values - np.roll(values, 1, axis=1)
    padded = np.pad(values, ((0, 0), (1, 1), (0, 0)))
    return np.diff(padded, axis=1)


def internal_loads(plant, name, published):
    """Forces on nodes, lab frame, and torques on elements, material frame, as the equations have them."""
    view, rods, closed, law = family(plant, name)
    stiff, rest, area = stiffness(ARM, rods), rods.length, rods.area
    nodes = {} if closed else {"nodes": True}
    x, v = vectors(view, R.X1, **nodes), vectors(view, R.V1, **nodes)
    after = (lambda values: np.roll(values, -1, axis=1) - values) if closed else (lambda values: np.diff(values, axis=1))
    edge, faster = after(x), after(v)
    frames = np.stack([view(R.Q11 + i) for i in range(9)], axis=-1).reshape(*rest.shape, 3, 3)
    spin = vectors(view, R.W1)
    length = np.linalg.norm(edge, axis=2)
    e, tangent = length / rest, edge / length[..., None]
    rate = np.sum(tangent * faster, axis=2) / rest
    along = np.einsum("rnij,rnj->rni", frames, tangent)
    shear = stiff.shear[..., None] * e[..., None] * along * [1, 1, 0]
    if published:
        s = e * along[..., 2]
        w = -rate / law.maximum_rate
        lengthening = law.eccentric_plateau - (law.eccentric_plateau - 1) * (1 + w) / (1 - law.eccentric_slope * w / law.curvature)
        factor = np.where(w > 0, (1 - w) / (1 + w / law.curvature), lengthening)
        pull = area * (LEVEL * law.maximum_stress * law.active_factor(s) * factor + law.passive_stress(s))
        shear[..., 2] = pull
        force = np.einsum("rnij,rni->rnj", frames, shear) / e[..., None]
    else:
        pull = area * (law.stress(e, rate, LEVEL) + ARM.anatomy.viscosity * rate)
        if name == "straight":
            # The cord is no stiffer in compression than in bending.
            cord = replace(law, compression_modulus=ARM.youngs_modulus)
            assert law.compression_modulus > 2 * cord.compression_modulus and e[0].min() < 0.97
            pull[0] = area[0] * (cord.stress(e[0], rate[0], LEVEL) + ARM.anatomy.viscosity * rate[0])
        force = (np.einsum("rnij,rni->rnj", frames, shear) + pull[..., None] * tangent) / e[..., None]
    inertia = np.stack([view(R.BEND_INERTIA), view(R.BEND_INERTIA), view(R.TWIST_INERTIA)], axis=-1)
    torque = np.cross(along, shear) * rest[..., None]
    torque += np.cross(inertia * spin, spin) / e[..., None] + inertia * spin * (rate / e**2)[..., None]
    before = (lambda values: np.roll(values, 1, axis=1)) if closed else (lambda values: values[:, :-1])
    here = (lambda values: values) if closed else (lambda values: values[:, 1:])
    joint = (here(rest) + before(rest)) / 2

    def curvature(of):
        turn = here(of) @ np.swapaxes(before(of), 2, 3)
        return -Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec().reshape(*turn.shape[:2], 3) / joint[..., None]

    kappa = curvature(frames)
    material = np.stack([stiff.bend, stiff.bend, stiff.twist], axis=-1) * rest[..., None]
    bending = (here(material) + before(material)) / (2 * joint[..., None])
    swell = (here(length) + before(length)) / (2 * joint)
    moment = bending * (kappa - curvature(rods.frames)) / swell[..., None] ** 3
    twisted = np.cross(kappa, moment) * joint[..., None] / 2
    if closed:
        torque += np.roll(moment + twisted, -1, axis=1) - (moment - twisted)
    else:
        torque[:, :-1] += moment + twisted
        torque[:, 1:] -= moment - twisted
    return difference(force, closed), torque


@pytest.mark.parametrize("published", [False, True], ids=["default", "published"])
@pytest.mark.parametrize("name", ["straight", "oblique", "rings"])
def test_internal_loads_are_those_of_the_equations(state, name, published):
    plant, parts = state
    rods = plant.core.rods
    wanted_force, wanted_torque = internal_loads(plant, name, published)
    parts["measure"](rods.flat, 0.5, plant.h, plant.core._laws)
    view, _, closed, law = family(plant, name)
    if published:
        lanes = rods.grid.lanes
        first, last = {
            "straight": (1, 9 * lanes),
            "oblique": (9 * lanes, 25 * lanes - 1),
            "rings": (lanes, lanes * (1 + rods.ring(R.X1).shape[1])),
        }[name]
        published_strain(rods.grid, closed)(rods.flat, np.uint64(first), np.uint64(last), 0.5, 0.0, law_constants(law))
    force = vectors(view, R.N1)
    scale = np.abs(wanted_force).max()
    np.testing.assert_allclose(difference(force, closed), wanted_force, atol=1e-10 * scale)
    plus, minus = vectors(view, R.MPLUS1), vectors(view, R.MMINUS1)
    torque = vectors(view, R.TORQUE1)
    if closed:
        torque += np.roll(plus, -1, axis=1) - minus
    else:
        torque[:, :-1] += plus[:, 1:]
        torque[:, 1:] -= minus[:, 1:]
    scale = np.abs(wanted_torque).max()
    np.testing.assert_allclose(torque, wanted_torque, atol=1e-9 * scale)


@pytest.mark.parametrize("name", ["straight", "oblique", "rings"])
@pytest.mark.parametrize("row", [R.V1, R.W1], ids=["velocity", "spin"])
def test_published_filter_takes_the_fifth_power_of_the_second_difference(state, name, row):
    plant, _ = state
    rods = plant.core.rods
    view, _, closed, _ = family(plant, name)
    nodes = {"nodes": True} if row == R.V1 and not closed else {}
    before = vectors(view, row, **nodes)
    rough = before
    for step in range(5):
        if closed:
            # One copy beyond either end of the seam, which stays at zero after the first pass.
            low, high = (rough[:, -1:], rough[:, :1]) if step == 0 else (np.zeros_like(rough[:, :1]),) * 2
            padded = np.concatenate([low, rough, high], axis=1)
            rough = (2 * padded[:, 1:-1] - padded[:, :-2] - padded[:, 2:]) / 4
        else:
            inner = (2 * rough[:, 1:-1] - rough[:, :-2] - rough[:, 2:]) / 4
            rough = np.pad(inner, ((0, 0), (1, 1), (0, 0)))
    set_filter_masks(rods)
    velocity_filters(rods.grid)(rods.flat, np.uint64(1), np.uint64(25 * rods.grid.lanes - 1))
    np.testing.assert_allclose(vectors(view, row, **nodes), before - rough, rtol=1e-12, atol=1e-14 * np.abs(before).max())


def test_thin_water_lets_nodes_go_but_not_the_spin_of_fibres():
    """Without a least drag on spins, the corkscrew in the light water of the study ends in helices that spin about themselves."""

    def decays(rate):
        rods = make_plant("assembly-coarse", scene=Scene.free(ring_rate=rate, oblique_rate=rate)).core.rods
        spin = np.concatenate([view(row).ravel() for view in (rods.oblique, rods.ring) for row in (R.BEND_DECAY, R.TWIST_DECAY)])
        return spin, rods.oblique(R.NODE_DECAY)[:, 1:-1].ravel(), rods.straight(R.TWIST_DECAY).copy()

    (thin, let_go, straight), (thicker, slower, _), (thick, slow, unchanged) = decays(1.0), decays(20.0), decays(125.0)
    assert np.array_equal(thin, thicker) and np.all(thick <= thin) and thick.sum() < 0.99 * thin.sum()
    assert let_go.min() > slower.max() > slow.max()
    assert np.array_equal(straight, unchanged)


def test_elements_of_muscles_that_tremble_come_to_rest_without_water():
    """What spins in the thin tip of a muscle is not lost on nodes and fibres: it would tremble on, and end runs where it is sheared."""
    plant = make_plant("assembly-coarse", scene=Scene(water=None))
    muscles, generator = plant.core.rods.straight, np.random.default_rng(0)
    for row in (R.W1, R.W2, R.W3):
        muscles(row)[1:, 150:] = 100 * generator.standard_normal(muscles(row)[1:, 150:].shape)
    plant.advance(Activation(), 0.02)
    assert np.sqrt(np.mean(np.square(vectors(muscles, R.W1)[1:, 150:]))) < 20.0


def test_published_drag_acts_on_the_mean_velocity_of_elements(state):
    plant, parts = state
    rods, rates = plant.core.rods, {"straight": 0.0, "oblique": 125.0, "rings": 250 / 12}
    fill = make_plant("assembly", paper_compatible=True).core.rods
    # Its masses are read off the rotary inertia, which the default raises.
    rods.open_rods[[R.BEND_INERTIA, R.AREA]], rods.rings[[R.BEND_INERTIA, R.AREA]] = (
        fill.open_rods[[R.BEND_INERTIA, R.AREA]],
        fill.rings[[R.BEND_INERTIA, R.AREA]],
    )
    parts["measure"](rods.flat, 0.5, plant.h, plant.core._laws)
    seam = (rods.ring(R.V1).shape[1] + 1) * rods.grid.lanes
    for row in (R.V1, R.V2, R.V3):
        rods.rings[row, seam : seam + rods.grid.lanes] = rods.rings[row, rods.grid.lanes : 2 * rods.grid.lanes]
    for row in (R.F1, R.F2, R.F3):
        rods.open_rods[row] = rods.rings[row] = 0.0
    torque = {name: vectors(family(plant, name)[0], R.TORQUE1) for name in rates}
    published_drag(rods.grid)(rods.flat, rates["oblique"], rates["rings"])
    for name, rate in rates.items():
        view, geometry, closed, _ = family(plant, name)
        nodes = {} if closed else {"nodes": True}
        speed = vectors(view, R.V1, **nodes)
        mean = (speed + np.roll(speed, -1, axis=1)) / 2 if closed else (speed[:, 1:] + speed[:, :-1]) / 2
        weight = rate * geometry.element_mass * view(R.STRETCH)
        load = -weight[..., None] * mean / 2
        wanted = (
            load + np.roll(load, 1, axis=1) if closed else np.pad(load, ((0, 0), (0, 1), (0, 0))) + np.pad(load, ((0, 0), (1, 0), (0, 0)))
        )
        found = vectors(view, R.F1, **nodes)
        if not closed:
            # The clamped node does not move: whatever stands there has no effect.
            found, wanted = found[:, 1:], wanted[:, 1:]
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-20)
        turned = vectors(view, R.TORQUE1) - torque[name]
        np.testing.assert_allclose(
            turned, -weight[..., None] * 1e-6 * vectors(view, R.W1), rtol=1e-6, atol=1e-6 * np.abs(turned).max() + 1e-30
        )


def programme():
    return Activation(
        templates=(
            Plateau(groups=(*LONGITUDINAL_GROUPS, "TM"), level=0.001, rise=0.01),
            Plateau(groups=("R-OM",), level=0.3, rise=0.05),
            Plateau(groups=("LM1", "LM2"), level=0.3, onset=0.01, rise=0.05),
        )
    )


def everything(plant):
    return plant.core.rods.open_rods[:18].tobytes() + plant.core.rods.rings[:18].tobytes()


PRINT_BITS = """
import hashlib
from test_assembly_rods import everything, programme
from octoctrl.sim.plants import make_plant
plant = make_plant("assembly-coarse")
plant.advance(programme(), 0.02)
print(hashlib.sha256(everything(plant)).hexdigest())
"""


def test_same_bits_with_one_and_two_threads_of_numba():
    found = set()
    for threads in ("1", "2"):
        environment = os.environ | {"NUMBA_NUM_THREADS": threads, "PYTHONPATH": os.pathsep.join([os.path.dirname(__file__), *sys.path])}
        found.add(subprocess.run([sys.executable, "-c", PRINT_BITS], env=environment, check=True, capture_output=True, text=True).stdout)
    assert len(found) == 1 and len(found.pop().strip()) == 64


def test_plants_in_two_threads_do_not_disturb_each_other():
    alone = make_plant("assembly-coarse")
    alone.advance(programme(), 0.03)
    plants = [make_plant("assembly-coarse"), make_plant("assembly-coarse")]
    workers = [threading.Thread(target=lambda plant=plant: [plant.advance(programme(), 0.005) for _ in range(6)]) for plant in plants]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert all(everything(plant) == everything(alone) for plant in plants)


@pytest.mark.parametrize(
    "options",
    [{"ring_nodes": 8, "sample_interval": 2e-3}, {"paper_compatible": True, "sample_interval": 2e-3}],
    ids=["default", "published"],
)
def test_state_saved_in_the_middle_of_a_programme_goes_on_bit_by_bit(tmp_path, options):
    plant, other = make_plant("assembly", **options), make_plant("assembly", **options)
    plant.advance(programme(), 0.016)
    plant.save(tmp_path / "state.npz")
    plant.advance(programme(), 0.008)
    other.load(tmp_path / "state.npz")
    assert other.time == pytest.approx(0.016)
    other.advance(programme(), 0.008)
    assert everything(plant) == everything(other)
