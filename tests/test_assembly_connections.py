"""Published connections of the full arm: twins of the laws that `test_assembly.py` leaves out, momentum, and what does not balance."""

import numpy as np
import pytest
from assembly_parts import parts_of

from octoctrl.sim.assembly.constants import CONTACT_STEP, ring_connections
from octoctrl.sim.assembly.family_kernels import ring_spin_brake
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.layout import SpokeRow as S
from octoctrl.sim.assembly.parts import whole
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.plants import make_plant

ARM = Arm.octopus()
MUSCLES = range(1, 9)
RESULTS = ("F1", "F2", "F3", "T1", "T2", "T3", "SUM", "G1", "G2", "G3")


def of_family(view, row, **nodes):
    """Three rows of a rod family as vectors."""
    return np.stack([view(R(row + i), **nodes) for i in range(3)], axis=-1)


def of_spokes(rods, name, suffix="", later=0):
    """Three result rows of the spokes, (8, N, 3); those on a neighbour stand one slot `later`."""
    lanes, slots = rods.grid.lanes, slice((2 + later) * rods.grid.lanes, (10 + later) * rods.grid.lanes)
    rows = [rods.spokes[S[f"{name}{i}{suffix}"], slots].reshape(8, lanes)[:, 1 : rods.grid.rings + 1] for i in (1, 2, 3)]
    return np.stack(rows, axis=-1)


def frames_of(view):
    return np.stack([view(R.Q11 + i) for i in range(9)], axis=-1).reshape(*view(R.Q11).shape, 3, 3)


def straight_elements(rods):
    nodes = of_family(rods.straight, R.X1, nodes=True)
    return (nodes[:, 1:] + nodes[:, :-1]) / 2, np.diff(nodes, axis=1)


@pytest.fixture(scope="module")
def squeezed():
    """A bent arm of which each ring is drawn together on one side by up to a third of a millimetre, in random motion."""
    plant = make_plant("assembly")
    rods, generator = plant.core.rods, np.random.default_rng(11)
    for view, size in ((rods.straight, 1e-4), (rods.oblique, 2e-5), (rods.ring, 2e-5)):
        nodes = {} if view == rods.ring else {"nodes": True}
        for row in (R.X1, R.X2, R.X3):
            view(row, **nodes)[:] += size * generator.standard_normal(view(row, **nodes).shape)
        for row in (R.V1, R.V2, R.V3):
            view(row, **nodes)[:] = 0.05 * generator.standard_normal(view(row, **nodes).shape)
        for row in (R.W1, R.W2, R.W3):
            view(row)[:] = 20 * generator.standard_normal(view(row).shape)
    inward = of_family(rods.ring, R.X1).mean(axis=1, keepdims=True) - of_family(rods.ring, R.X1)
    inward *= (3e-4 * generator.random(inward.shape[:2]) / np.linalg.norm(inward, axis=2))[..., None]
    for i in range(3):
        rods.ring(R.X1 + i)[:] += inward[..., i]
    parts = parts_of(plant)
    for row in (R.LEVEL_BEFORE, R.LEVEL_AFTER):
        rods.open_rods[row] = rods.rings[row] = 0.2
    parts["move"](rods.flat, 2e-5)
    parts["measure"](rods.flat, 0.5, plant.h, plant.core._laws)
    return plant, parts, rods.flat.copy()


@pytest.fixture
def state(squeezed):
    plant, parts, flat = squeezed
    plant.core.rods.flat[:] = flat
    for name in RESULTS:
        for suffix in ("", "_N", "_C"):
            plant.core.rods.spokes[S[name + suffix]] = 0.0
    for name in ("F1_R", "F2_R", "F3_R", "T1_R", "T2_R", "T3_R", "F1_X", "F2_X", "F3_X"):
        plant.core.rods.spokes[S[name]] = 0.0
    for row in (R.F1, R.F2, R.F3, R.C1, R.C2, R.C3):
        plant.core.rods.open_rods[row] = plant.core.rods.rings[row] = 0.0
    return plant, plant.core.rods, parts


def test_muscles_touch_the_ring_nodes_beside_their_spoke(state):
    plant, rods, parts = state
    parts["gather"](rods.flat)
    parts["beside"](rods.flat)
    nodes, thick = of_family(rods.ring, R.X1), rods.ring(R.RADIUS)
    per_ring = nodes.shape[1]
    centre, _ = straight_elements(rods)
    radius = rods.straight(R.RADIUS)
    stiff = ring_connections(ARM, plant.core.geometry).muscle_contact
    masses = 1 / plant.core.geometry.rings.node_mass[:, 0] + 1 / plant.core.geometry.straight.element_mass[1]
    on_ring, on_muscle, total, touched = np.zeros_like(nodes), np.zeros((8, rods.grid.rings, 3)), np.zeros((8, rods.grid.rings)), 0
    for m in MUSCLES:
        for i in range(rods.grid.rings):
            for away in (-4, -3, -2, -1, 1, 2, 3, 4):
                q = (per_ring // 8 * (m - 1) + away) % per_ring
                between = nodes[i, q] - centre[m, i]
                distance = np.linalg.norm(between)
                overlap = thick[i, q] + radius[m, i] - distance
                if overlap <= 0:
                    continue
                touched += 1
                push = stiff[i] * overlap**1.5 / (1 + (1.5 * CONTACT_STEP**2 * stiff[i] * masses[i]) ** 4 * overlap**2) ** 0.25
                on_ring[i, q] += push * between / distance
                on_muscle[m - 1, i] -= push * between / distance
                total[m - 1, i] -= push
    assert 500 < touched < 8 * 8 * rods.grid.rings
    np.testing.assert_allclose(of_family(rods.ring, R.F1), on_ring, atol=1e-12)
    for name in ("F", "G"):
        np.testing.assert_allclose(of_spokes(rods, name), on_muscle, atol=1e-12)
    np.testing.assert_allclose(rods.spoke(S.SUM), total, atol=1e-12)


def test_squeeze_becomes_pressure_and_forces_are_shared_by_the_nodes(state):
    plant, rods, parts = state
    generator = np.random.default_rng(3)
    shape, lanes = (8, rods.grid.rings), rods.grid.lanes
    booked = {}
    for name in RESULTS:
        for suffix, later in (("", 0), ("_N", 1), ("_C", 0)):
            booked[name + suffix] = generator.standard_normal(shape)
            slots = rods.spokes[S[name + suffix], (2 + later) * lanes : (10 + later) * lanes].reshape(8, lanes)
            slots[:, 1 : rods.grid.rings + 1] = booked[name + suffix]
    before = of_family(rods.straight, R.N1)
    tangent, length = of_family(rods.straight, R.T1), rods.straight(R.STRETCH) * plant.core.geometry.straight.length
    parts["scatter"](rods.flat, 0.0, 0.0)

    def summed(name):
        on_muscles = booked[name] + np.roll(booked[f"{name}_N"], 1, axis=0)
        return np.concatenate([booked[f"{name}_C"].sum(axis=0)[None], on_muscles])

    radius = rods.straight(R.RADIUS)
    pressure = np.abs(summed("SUM")) - np.linalg.norm([summed(f"G{i}") for i in (1, 2, 3)], axis=0)
    pressure /= 2 * np.pi * radius * length
    load = (-pressure * np.pi * radius**2)[..., None] * tangent
    np.testing.assert_allclose(of_family(rods.straight, R.N1) - before, load, atol=1e-13)
    force = np.stack([summed(f"F{i}") for i in (1, 2, 3)], axis=-1)
    shared = np.zeros((9, rods.grid.rings + 1, 3))
    shared[:, 1:] += force / 2
    shared[:, :-1] += force / 2
    np.testing.assert_allclose(of_family(rods.straight, R.F1, nodes=True), shared, atol=1e-14)
    couple = np.stack([summed(f"T{i}") for i in (1, 2, 3)], axis=-1)
    np.testing.assert_allclose(of_family(rods.straight, R.C1), couple, atol=1e-14)


def test_water_resists_the_muscles_and_not_the_cord(state):
    plant, rods, parts = state
    normal, tangential = plant.core._drag[:2]
    water = plant.scene.water
    parts["gather"](rods.flat)
    parts["scatter"](rods.flat, normal, tangential)
    speed = of_family(rods.straight, R.V1, nodes=True)
    speed = (speed[1:, 1:] + speed[1:, :-1]) / 2
    _, edge = straight_elements(rods)
    length = np.linalg.norm(edge, axis=2)[1:]
    tangent = edge[1:] / length[..., None]
    along = np.sum(speed * tangent, axis=2)
    across = speed - along[..., None] * tangent
    radius = rods.straight(R.RADIUS)[1:]
    wide, wetted = 2 * radius * length, 2 * np.pi * radius * length
    force = (wide * water.normal_coefficient * np.linalg.norm(across, axis=2))[..., None] * across
    force += (wetted * water.tangential_coefficient * np.abs(along) * along)[..., None] * tangent
    force *= -water.density / 2
    found = of_family(rods.straight, R.F1, nodes=True)
    shared = np.zeros_like(found)
    shared[1:, 1:] += force / 2
    shared[1:, :-1] += force / 2
    assert np.abs(force).max() > 1e-7
    np.testing.assert_allclose(found, shared, rtol=1e-10, atol=1e-18)


def axial_twin(speed, tangent, yielding, rate, mobility):
    """Velocities (n, 3) after the increments of tension, from one dense system in the velocities themselves.

    With B from velocities to elongation rates, G the tension per elongation rate, W the mobility: (1 + W B' G B) v = v* + W B' G old.
    """
    elements, nodes = len(tangent), len(speed)
    gradient = np.zeros((elements, nodes, 3))
    for k in range(elements):
        gradient[k, k] -= tangent[k]
        gradient[k, (k + 1) % nodes] += tangent[k]
    gradient = gradient.reshape(elements, -1)
    pull = np.repeat(mobility, 3)[:, None] * gradient.T / yielding
    matrix = np.eye(3 * nodes) + pull @ gradient
    return np.linalg.solve(matrix, speed.ravel() + pull @ rate).reshape(nodes, 3)


@pytest.mark.parametrize("family", ["cord", "muscle", "helix", "ring", "last ring"])
def test_implicit_axial_step_is_that_of_a_dense_system(state, family):
    _, rods, parts = state
    parts["push"](rods.flat)
    number = {"cord": 0, "muscle": 5, "helix": 6, "ring": 40, "last ring": rods.grid.rings - 1}[family]
    view, nodes = {
        "cord": (rods.straight, {"nodes": True}),
        "muscle": (rods.straight, {"nodes": True}),
        "helix": (rods.oblique, {"nodes": True}),
    }.get(family, (rods.ring, {}))
    elongation = view(R.RATE)[number] * view(R.LENGTH)[number]
    mobility = view(R.NODE_MOBILITY, **nodes)[number]
    speed, tangent = of_family(view, R.V1, **nodes)[number], of_family(view, R.T1)[number]
    wanted = axial_twin(speed, tangent, 1 / view(R.VISCOSITY)[number], elongation, mobility)
    parts["relax"](rods.flat)
    found = of_family(view, R.V1, **nodes)[number]
    change = np.abs(wanted - speed).max()
    assert change > 1e-4
    np.testing.assert_allclose(found, wanted, atol=1e-10 * change)
    # What the increments of tension do within the rod leaves its momentum alone, but for the clamp.
    free = mobility > 0
    if free.all():
        np.testing.assert_allclose(np.sum((found - speed) / mobility[:, None], axis=0), 0, atol=1e-12 * np.sum(change / mobility))


def test_spin_brake_keeps_the_mean_spin_of_every_ring(state):
    _, rods, _ = state

    def spin():
        return np.einsum("rnij,rni->rnj", frames_of(rods.ring), of_family(rods.ring, R.W1))

    before, share = spin(), 0.1
    ring_spin_brake(rods.grid)(rods.flat, whole(rods.grid), share)
    mean = before.mean(axis=1, keepdims=True)
    np.testing.assert_allclose(spin(), mean + (1 - share) * (before - mean), atol=1e-10)


def couples(rods, straight_force, straight_couple, ring_force, ring_couple):
    """Sum of forces and of moments about the origin of loads on muscle elements (8, N, 3) and ring nodes (N, nodes, 3)."""
    centre, _ = straight_elements(rods)
    force = straight_force.sum(axis=(0, 1)) + ring_force.sum(axis=(0, 1))
    moment = np.cross(centre[1:], straight_force).sum(axis=(0, 1)) + np.cross(of_family(rods.ring, R.X1), ring_force).sum(axis=(0, 1))
    return force, moment + straight_couple.sum(axis=(0, 1)) + ring_couple.sum(axis=(0, 1))


def at_spokes(rods, values):
    """Values (8, N, 3) of the spokes at their ring nodes (N, nodes, 3)."""
    per_ring = rods.ring(R.X1).shape[1]
    placed = np.zeros((rods.grid.rings, per_ring, 3))
    placed[:, :: per_ring // 8] = np.swapaxes(values, 0, 1)
    return placed


def outward_of(nodes):
    """Unit vectors (N, nodes, 3) to each ring node from the opposite one."""
    across = nodes - np.roll(nodes, nodes.shape[1] // 2, axis=1)
    return across / np.linalg.norm(across, axis=2)[..., None]


def test_moment_left_over_by_ring_and_muscle_is_that_of_the_surface_gap(state):
    """The published joint acts at centre and node, not on the surfaces between which it is stretched: reach x force is missing."""
    plant, rods, parts = state
    parts["gather"](rods.flat)
    parts["ring_muscle"](rods.flat)
    force, moment = couples(
        rods,
        of_spokes(rods, "F"),
        of_spokes(rods, "T"),
        at_spokes(rods, of_spokes(rods, "F", "_R")),
        at_spokes(rods, of_spokes(rods, "T", "_R")),
    )
    scale = np.abs(of_spokes(rods, "F")).sum()
    np.testing.assert_allclose(force, 0, atol=1e-13 * scale)
    per_ring = rods.ring(R.X1).shape[1]
    outward = np.swapaxes(outward_of(of_family(rods.ring, R.X1))[:, :: per_ring // 8], 0, 1)
    thick = np.swapaxes(rods.ring(R.RADIUS)[:, :: per_ring // 8], 0, 1)
    centre, _ = straight_elements(rods)
    nodes = np.swapaxes(of_family(rods.ring, R.X1)[:, :: per_ring // 8], 0, 1)
    reach = (thick + rods.straight(R.RADIUS)[1:])[..., None] * outward
    spring = ring_connections(ARM, plant.core.geometry).muscle_spring[None, :, None] * (centre[1:] - nodes + reach)
    left = np.cross(reach, spring).sum(axis=(0, 1))
    np.testing.assert_allclose(moment, left, atol=1e-12 * scale)
    assert np.linalg.norm(left) > 1e-6


def test_moment_left_over_by_ring_and_helix_is_that_of_the_surface_gap(state):
    plant, rods, parts = state
    parts["crossings"](rods.flat, rods.ring_index, rods.helix_index)
    ring, helix = of_family(rods.ring, R.X1), of_family(rods.oblique, R.X1, nodes=True)
    on_ring, on_helix = of_family(rods.ring, R.F1), of_family(rods.oblique, R.F1, nodes=True)
    scale = np.abs(on_helix).sum()
    np.testing.assert_allclose(on_ring.sum(axis=(0, 1)) + on_helix.sum(axis=(0, 1)), 0, atol=1e-12 * scale)
    moment = np.cross(ring, on_ring).sum(axis=(0, 1)) + np.cross(helix, on_helix).sum(axis=(0, 1))
    every, left = np.arange(rods.grid.rings), np.zeros(3)
    outward, spring = outward_of(ring), ring_connections(ARM, plant.core.geometry).oblique_spring[:, None]
    for j, nodes in enumerate(plant.core.geometry.oblique_nodes):
        met = helix[j, :: rods.grid.helix_nodes]
        thick = rods.ring(R.RADIUS)[every, nodes] + rods.oblique(R.RADIUS)[j, :: rods.grid.helix_nodes]
        reach = thick[:, None] * outward[every, nodes]
        left += np.cross(reach, spring * (ring[every, nodes] + reach - met)).sum(axis=0)
    np.testing.assert_allclose(moment, left, atol=1e-12 * scale)
    assert np.linalg.norm(left) > 1e-8


def test_moment_left_over_by_neighbouring_rings_is_what_the_muscles_do_not_take(state):
    """Rings aim at places that depend on the muscles; these feel nothing of it, and force and arm are not parallel."""
    _, rods, parts = state
    for name in ("gather", "ring_muscle", "ring_ring"):
        parts[name](rods.flat)
    push = at_spokes(rods, of_spokes(rods, "F", "_X"))[:-1]
    nodes = of_family(rods.ring, R.X1)
    on_rings = np.zeros_like(nodes)
    on_rings[1:] += push
    on_rings[:-1] -= push
    np.testing.assert_allclose(on_rings.sum(axis=(0, 1)), 0, atol=1e-13 * np.abs(push).sum())
    moment = np.cross(nodes, on_rings).sum(axis=(0, 1))
    assert np.linalg.norm(moment) > 1e-3 * np.abs(np.cross(nodes[1:] - nodes[:-1], push)).sum() > 0


def test_contacts_beside_the_spokes_conserve_angular_momentum(state):
    _, rods, parts = state
    parts["gather"](rods.flat)
    parts["beside"](rods.flat)
    none = np.zeros((8, rods.grid.rings, 3))
    force, moment = couples(rods, of_spokes(rods, "F"), none, of_family(rods.ring, R.F1), np.zeros_like(of_family(rods.ring, R.F1)))
    scale = np.abs(of_spokes(rods, "F")).sum()
    np.testing.assert_allclose(force, 0, atol=1e-13 * scale)
    np.testing.assert_allclose(moment, 0, atol=1e-13 * scale)
