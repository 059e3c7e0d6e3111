"""The arm of 197 rods: its numbers at rest, the laws of its connections one by one, and its motion."""

import numpy as np
import pytest
from assembly_parts import parts_of

from octoctrl.sim.activation import Activation
from octoctrl.sim.assembly.constants import CONTACT_STEP, oblique_mass, ring_connections, stiffness, straight_connections, straight_mass
from octoctrl.sim.assembly.core import AssemblyCore
from octoctrl.sim.assembly.geometry import assembly_geometry
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.layout import CrossingRow, SlabRow, SpokeRow
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.findings import Finding
from octoctrl.sim.plants import make_plant
from octoctrl.sim.running.clock import Clock
from octoctrl.sim.running.plant import Plant
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.templates import Plateau
from octoctrl.sim.topology.measures import twist

ARM = Arm.octopus()
GEOMETRY = assembly_geometry(ARM)
STEP = 5e-3 / 71
STRAIGHT, RINGS, OBLIQUE = GEOMETRY.straight, GEOMETRY.rings, GEOMETRY.oblique
MM, GRAM, CONTACT = 1e-3, 1e-3, 0.0316227766
"""Units of the printed numbers: mm, g; contact constants in g s^-2 mm^-1/2."""


def test_counts_of_rods_elements_and_connections():
    assert (GEOMETRY.grid.rings, GEOMETRY.elements) == (180, 9 * 180 + 8 * 359 + 180 * 40)
    assert STRAIGHT.points.shape[0] + RINGS.points.shape[0] + OBLIQUE.points.shape[0] == 197
    assert straight_connections(ARM, GEOMETRY).spring.size == 2880
    assert GEOMETRY.oblique_nodes.size == 1440 and ring_connections(ARM, GEOMETRY).ring_spring.size == 179


def at_joints(stiffnesses):
    return (stiffnesses[:, 1:] + stiffnesses[:, :-1]) / 2


PRINTED = {
    "cord radius": (STRAIGHT.radius[0, [0, 1, 45, 90, 135, 179]] / MM, (4.6810995, 4.657127, 3.602355, 2.523610, 1.444865, 0.390092)),
    "muscle radius": (
        STRAIGHT.radius[1, [0, 1, 45, 90, 135, 178, 179]] / MM,
        (2.882572, 2.867928, 2.223551, 1.564530, 0.905508, 0.275777, 0.261132),
    ),
    "ring path": (
        RINGS.points[[0, 1, 45, 90, 135, 178, 179], 0, 0] / MM,
        (11.001800, 10.948538, 8.605012, 6.208225, 3.811437, 1.521173, 1.467911),
    ),
    "oblique path": (
        np.hypot(*OBLIQUE.points[0, [0, 1, 2, 90, 180, 270, 358, 359]][:, [0, 2]].T) / MM,
        (12.68965, 12.68965, 12.63059, 10.03193, 7.374207, 4.716486, 2.117825, 2.117825),
    ),
    "oblique radius": (
        OBLIQUE.radius[5, [0, 1, 2, 90, 179, 357, 358]] / MM,
        (1.132295, 1.129396, 1.126497, 0.871361, 0.613327, 0.097257, 0.094358),
    ),
    "muscle length": (STRAIGHT.length[3].sum() / MM, 200.1208),
    "oblique length": (OBLIQUE.length[3].sum() / MM, 469.918),
    "oblique element": (OBLIQUE.length[6, [0, 358]] / MM, (2.067285, 0.647365)),
    "ring element": (RINGS.length[[0, 179], 0] / MM, (1.726383, 0.230342)),
    "ring mass": (RINGS.element_mass.sum(axis=1)[[0, 179]] / GRAM, (0.0574797, 0.0076692)),
    "family masses": (
        [part.sum() / GRAM for part in (STRAIGHT.element_mass[0], STRAIGHT.element_mass[1:], RINGS.element_mass, OBLIQUE.element_mass)],
        (5.2652, 19.3463, 5.8634, 7.2505),
    ),
    "cord nodes": (STRAIGHT.node_mass[0, [0, 1, -1]] / GRAM, (0.0401571, 0.0799040, 2.78869e-4)),
    "muscle nodes": (STRAIGHT.node_mass[1, [0, 1, -1]] / GRAM, (0.0183019, 0.0364184, 1.50195e-4)),
    "oblique nodes": (OBLIQUE.node_mass[7, [0, 1, -1]] / GRAM, (4.36086e-3, 8.69182e-3, 9.48329e-6)),
    "shear": (stiffness(ARM, STRAIGHT).shear[:2, 0] * 1e6, (611918, 232037)),
    "bending": (at_joints(stiffness(ARM, STRAIGHT).bend)[:2, [0, -1]].ravel() * 1e12, (3.73289e6, 206.37, 5.36796e5, 40.97)),
    "twisting": (at_joints(stiffness(ARM, STRAIGHT).twist)[:2, 0] * 1e12, (4.97718e6, 7.15728e5)),
    "oblique bending": (at_joints(stiffness(ARM, OBLIQUE).bend)[0, [0, -1]] * 1e12, (12844.3, 0.663)),
    "ring stiffness": (
        [stiffness(ARM, RINGS).shear[0, 0] * 1e6, stiffness(ARM, RINGS).bend[0, 0] * 1e12, stiffness(ARM, RINGS).twist[0, 0] * 1e12],
        (8618.9, 748.17, 997.56),
    ),
    "oblique shear": (stiffness(ARM, OBLIQUE).shear[0, 0] * 1e6, 35802.8),
    "cord-muscle connection": (straight_connections(ARM, GEOMETRY).spring[0, 0] * 1e3, 435.04),
    "cord-muscle contact": (straight_connections(ARM, GEOMETRY).contact[0, 0] / CONTACT, 5241.4),
    "muscle-muscle connection": (straight_connections(ARM, GEOMETRY).spring[8, 0] * 1e3, 461.11),
    "muscle-muscle gap": (straight_connections(ARM, GEOMETRY).gap[9, [0, -1]] / MM, (0.02384, -0.02384)),
    "ring-muscle spring": (ring_connections(ARM, GEOMETRY).muscle_spring[[0, -1]] * 1e3, (111584, 62676)),
    "ring-muscle torque": (ring_connections(ARM, GEOMETRY).muscle_torque[[0, -1]] * 1e3, (3596.6, 479.9)),
    "ring-muscle contact": (ring_connections(ARM, GEOMETRY).muscle_contact[[0, -1]] / CONTACT, (1.11584e6, 6.2676e5)),
    "ring-ring spring": (ring_connections(ARM, GEOMETRY).ring_spring[[0, 89, 178]] * 1e3, (20702, 11739, 2775.6)),
    "ring-oblique spring": (ring_connections(ARM, GEOMETRY).oblique_spring[[0, -1]] * 1e3, (11365, 3938)),
    "ring-oblique contact": (ring_connections(ARM, GEOMETRY).oblique_contact[[0, -1]] / CONTACT, (1.0910e6, 3.780e5)),
}


@pytest.mark.parametrize("name", PRINTED)
def test_numbers_at_rest_are_the_published_ones(name):
    found, printed = (np.atleast_1d(np.asarray(values, dtype=float)) for values in PRINTED[name])
    # Printed to five to seven digits: half a unit of the last one, and 1e-5.
    digits = np.array([len(f"{value:.10g}".replace(".", "").lstrip("-0").split("e")[0].rstrip("0")) for value in printed])
    np.testing.assert_array_less(np.abs(found / printed - 1), 1e-5 + 5.0 * 10.0**-digits)


def test_frames_are_orthonormal_and_follow_the_edges():
    for family in (STRAIGHT, RINGS, OBLIQUE):
        product = family.frames @ np.swapaxes(family.frames, -1, -2)
        np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-14)
        np.testing.assert_allclose(family.frames[..., 2, :], family.edges / family.length[..., None], atol=1e-12)


def test_helices_meet_the_rings_at_their_nodes():
    for number in range(8):
        nodes = RINGS.points[np.arange(180), GEOMETRY.oblique_nodes[number]]
        apart = np.linalg.norm(OBLIQUE.points[number, ::2] - nodes, axis=1)
        np.testing.assert_allclose(apart, ARM.ring_radius + OBLIQUE.radius[number, ::2], rtol=1e-12)


def test_a_pitch_that_misses_the_ring_nodes_is_refused_with_the_nearest():
    with pytest.raises(OctoctrlError, match=r"nearest pitch is 0\.0222222 m"):
        assembly_geometry(Arm.octopus(oblique_pitch=0.0235))


# Dynamics. One plant for all tests: connections are looked at in a bent, twisted and shaken state.


def programme():
    return Activation(
        templates=(
            Plateau(groups=(*LONGITUDINAL_GROUPS, "TM"), level=0.001, rise=0.01),
            Plateau(groups=("R-OM",), level=0.3, offset=3.0, window=(0.0, 0.2 * 357 / 360)),
        )
    )


@pytest.fixture(scope="module")
def shaken():
    plant = make_plant("assembly")
    generator = np.random.default_rng(5)
    rods = plant.core.rods
    for view, size in ((rods.straight, 2e-4), (rods.oblique, 2e-5), (rods.ring, 2e-5)):
        for row in (R.X1, R.X2, R.X3):
            nodes = view(row) if view == rods.ring else view(row, nodes=True)
            nodes += size * generator.standard_normal(nodes.shape)
        for row in (R.W1, R.W2, R.W3):
            view(row)[:] = 2e3 * generator.standard_normal(view(row).shape)
    parts = parts_of(plant)
    parts["move"](rods.flat, 2e-5)
    for row in (R.W1, R.W2, R.W3):
        for view in (rods.straight, rods.oblique, rods.ring):
            view(row)[:] = 0.0
    parts["measure"](rods.flat, 0.5, plant.h, plant.core._laws)
    return plant, parts, rods.flat.copy()


@pytest.fixture
def state(shaken):
    plant, parts, flat = shaken
    plant.core.rods.flat[:] = flat
    return plant.core.rods, parts


def vectors(view, first):
    return np.stack([view(first.__class__(first + i)) for i in range(3)], axis=-1).copy()


def spokes(rods, name, suffix=""):
    return np.stack([rods.spoke(SpokeRow[f"{name}{i}{suffix}"]) for i in (1, 2, 3)], axis=-1).copy()


def test_directors_stay_orthonormal_when_turned(state):
    rods, _ = state
    for view in (rods.straight, rods.oblique, rods.ring):
        frames = np.stack([view(R.Q11 + i) for i in range(9)], axis=-1).reshape(*view(R.Q11).shape, 3, 3)
        np.testing.assert_allclose(frames @ np.swapaxes(frames, -1, -2), np.broadcast_to(np.eye(3), frames.shape), atol=1e-12)


def elements(rods):
    nodes = np.stack([rods.straight(R.X1 + i, nodes=True) for i in range(3)], axis=-1)
    centre, edge = (nodes[:, 1:] + nodes[:, :-1]) / 2, np.diff(nodes, axis=1)
    frames = np.stack([rods.straight(R.Q11 + i) for i in range(9)], axis=-1).reshape(9, -1, 3, 3)
    return centre, edge, frames, rods.straight(R.RADIUS).copy(), rods.straight(R.STRETCH).copy()


def side_by_side(rods, first, second, u, v, gap, spring, contact):
    centre, _, frames, radius, stretch = elements(rods)
    lab = [np.einsum("enji,enj->eni", frames[rod], direction) for rod, direction in ((first, u), (second, v))]
    reach = [radius[rod] + gap / (2 * np.sqrt(stretch[rod])) for rod in (first, second)]
    arm1, arm2 = (length[..., None] * direction for length, direction in zip(reach, lab, strict=True))
    between = centre[second] - centre[first]
    distance = np.linalg.norm(between, axis=-1)
    pull = spring[..., None] * (between + arm2 - arm1)
    overlap = np.maximum(reach[0] + reach[1] - distance, 0)
    force = pull - (contact * overlap**1.5 / distance)[..., None] * between
    touching = overlap > 0
    return (
        force,
        np.cross(arm1, pull),
        -np.cross(arm2, pull),
        touching * np.sum(force * lab[0], -1),
        -1.0 * touching * np.sum(force * lab[1], -1),
    )


def test_connections_side_by_side_follow_their_law_and_conserve_momentum(state):
    rods, parts = state
    parts["gather"](rods.flat)
    sides = straight_connections(ARM, GEOMETRY)
    centre = elements(rods)[0]
    for part, pairs, of_first, of_second in (("cord", slice(0, 8), "_C", ""), ("neighbours", slice(8, 16), "", "_N")):
        for row in SpokeRow:
            if row >= SpokeRow.F1:
                rods.spokes[row] = 0.0
        parts[part](rods.flat)
        first, second = sides.first[pairs], sides.second[pairs]
        arguments = (values[pairs] for values in (sides.direction1, sides.direction2, sides.gap, sides.spring, sides.contact))
        force, torque1, torque2, normal1, _ = side_by_side(rods, first, second, *arguments)
        np.testing.assert_allclose(spokes(rods, "F", of_first), force, atol=1e-12)
        np.testing.assert_allclose(spokes(rods, "T", of_first), torque1, atol=1e-15)
        np.testing.assert_allclose(rods.spoke(SpokeRow[f"SUM{of_first}"]), normal1, atol=1e-12)
        assert (normal1 != 0).any() and (normal1 == 0).any()
        if of_second == "_N":
            # Results on the neighbour stand one slot further; muscle 8's neighbour is muscle 1.
            lanes = rods.grid.lanes
            rows = [rods.spokes[SpokeRow[f"{name}_N"], 3 * lanes : 11 * lanes].reshape(8, lanes)[:, 1:181] for name in ("F1", "F2", "F3")]
            other = np.stack(rows, axis=-1)
            rows = [rods.spokes[SpokeRow[f"{name}_N"], 3 * lanes : 11 * lanes].reshape(8, lanes)[:, 1:181] for name in ("T1", "T2", "T3")]
            couple = np.stack(rows, axis=-1)
        else:
            other, couple = spokes(rods, "F"), spokes(rods, "T")
        np.testing.assert_allclose(other, -force, atol=1e-12)
        np.testing.assert_allclose(couple, torque2, atol=1e-15)
        spin = np.cross(centre[first], force) + np.cross(centre[second], other) + torque1 + couple
        np.testing.assert_allclose(spin, 0, atol=1e-14)


def test_ring_and_muscle_follow_their_law_and_push_each_other_equally(state):
    rods, parts = state
    parts["gather"](rods.flat)
    for row in SpokeRow:
        if row >= SpokeRow.F1:
            rods.spokes[row] = 0.0
    parts["ring_muscle"](rods.flat)
    centre, edge, _, radius, _ = elements(rods)
    nodes = np.stack([rods.ring(R.X1 + i) for i in range(3)], axis=-1)
    thick = rods.ring(R.RADIUS)
    constants = ring_connections(ARM, GEOMETRY)
    for m in range(8):
        q = 5 * m
        x = nodes[:, q]
        outward = x - nodes[:, (q + 20) % 40]
        outward /= np.linalg.norm(outward, axis=1)[:, None]
        hinge = nodes[:, (q + 10) % 40] - nodes[:, q - 10]
        hinge /= np.linalg.norm(hinge, axis=1)[:, None]
        along = -np.cross(outward, hinge)
        muscle, w = centre[m + 1], edge[m + 1]
        reach = (thick[:, q] + radius[m + 1])[:, None]
        spring = constants.muscle_spring[:, None] * (muscle - x + reach * outward)
        distance = np.linalg.norm(muscle - x, axis=1)
        overlap = np.maximum(reach[:, 0] - distance, 0)
        effective = rods.spoke(SpokeRow.R_EFFECTIVE)[m] * overlap
        push = constants.muscle_contact * overlap**1.5 / np.sqrt(1 + effective)  # the published joint's own softening
        contact = (push / distance)[:, None] * (muscle - x)
        np.testing.assert_allclose(spokes(rods, "F", "_R")[m], spring - contact, atol=1e-10)
        np.testing.assert_allclose(spokes(rods, "F")[m], contact - spring, atol=1e-10)
        lean = GEOMETRY.inclination
        length = np.linalg.norm(w, axis=1)[:, None]
        place = x - outward * reach + length / 2 * (np.cos(lean) * along - np.sin(lean) * outward)
        aim = place - (muscle + w / 2) - np.sum(w * hinge, axis=1)[:, None] * hinge
        torque = constants.muscle_torque[:, None] * np.cross(w / 2, aim)
        np.testing.assert_allclose(spokes(rods, "T")[m], torque, atol=1e-14)
        np.testing.assert_allclose(spokes(rods, "T", "_R")[m], -torque, atol=1e-14)
        in_plane = spring - np.sum(spring * along, axis=1)[:, None] * along
        flat = muscle - x - np.sum((muscle - x) * along, axis=1)[:, None] * along
        pressing = np.linalg.norm(flat, axis=1) < reach[:, 0]
        assert pressing.any() and not pressing.all()
        total = -1.0 * pressing * np.sum(in_plane * outward, axis=1) - push
        np.testing.assert_allclose(rods.spoke(SpokeRow.SUM)[m], total, atol=1e-10)
        np.testing.assert_allclose(spokes(rods, "G")[m], contact - pressing[:, None] * in_plane, atol=1e-10)


def test_neighbouring_rings_aim_at_each_other(state):
    rods, parts = state
    for name in ("gather", "ring_muscle", "ring_ring"):
        parts[name](rods.flat)
    centre, _, _, radius, _ = elements(rods)
    nodes = np.stack([rods.ring(R.X1 + i) for i in range(3)], axis=-1)
    thick = rods.ring(R.RADIUS)
    for m, i in ((0, 3), (5, 100), (7, 178)):
        q, j = 5 * m, i + 1
        inward = nodes[i, (q + 20) % 40] - nodes[i, q]
        inward /= np.linalg.norm(inward)
        hinge = nodes[i, (q + 10) % 40] - nodes[i, q - 10]
        along = np.cross(inward, hinge / np.linalg.norm(hinge))
        step = centre[m + 1, j] - centre[m + 1, i]
        sink = step @ inward + abs(radius[m + 1, i] - radius[m + 1, j]) + abs(thick[i, q] - thick[j, q])
        target = nodes[i, q] + abs(step @ along) * along + sink * inward
        force = ring_connections(ARM, GEOMETRY).ring_spring[i] * (target - nodes[j, q])
        np.testing.assert_allclose(spokes(rods, "F", "_X")[m, i], force, atol=1e-12)
    np.testing.assert_array_equal(spokes(rods, "F", "_X")[:, -1], 0.0)


def test_rings_and_helices_follow_their_law(state):
    rods, parts = state
    parts["crossings"](rods.flat, rods.ring_index, rods.helix_index)
    ring, helix = vectors(rods.ring, R.F1), np.stack([rods.oblique(R.F1 + i, nodes=True) for i in range(3)], axis=-1)
    nodes, thick = np.stack([rods.ring(R.X1 + i) for i in range(3)], axis=-1), rods.ring(R.RADIUS)
    helices = np.stack([rods.oblique(R.X1 + i, nodes=True) for i in range(3)], axis=-1)
    fibre = rods.oblique(R.RADIUS)
    constants = ring_connections(ARM, GEOMETRY)
    mass_ring, mass_helix = RINGS.node_mass[:, 0], OBLIQUE.node_mass[0]
    want_ring, want_helix = np.zeros_like(ring), np.zeros_like(helix)
    pairs = 0
    for j in range(8):
        side = 1 if j < 4 else -1
        for i in range(180):
            q, h = GEOMETRY.oblique_nodes[j, i], 2 * i
            outward = nodes[i, q] - nodes[i, (q + 20) % 40]
            outward /= np.linalg.norm(outward)
            force = constants.oblique_spring[i] * ((nodes[i, q] + thick[i, q] * outward) - (helices[j, h] - fibre[j, h] * outward))
            want_helix[j, h] += force
            want_ring[i, q] -= force
            for dh, dq in ((0, 0), (side, 1), (side, 2), (-side, -1), (-side, -2)):
                if not 0 <= h + dh <= 358:
                    continue
                pairs += 1
                between = nodes[i, (q + dq) % 40] - helices[j, h + dh]
                distance = np.linalg.norm(between)
                overlap = max(thick[i, (q + dq) % 40] + fibre[j, h + dh] - distance, 0.0)
                soft = 0.75 * CONTACT_STEP**2 * constants.oblique_contact[i] * (1 / mass_ring[i] + 1 / mass_helix[h])
                push = constants.oblique_contact[i] * overlap**1.5 / (1 + soft**4 * overlap**2) ** 0.25 * between / distance
                want_helix[j, h + dh] -= push
                want_ring[i, (q + dq) % 40] += push
    assert pairs == 7168
    np.testing.assert_allclose(ring, want_ring, atol=1e-10)
    np.testing.assert_allclose(helix, want_helix, atol=1e-10)


def test_all_connections_together_conserve_momentum(state):
    rods, parts = state
    parts["crossings"](rods.flat, rods.ring_index, rods.helix_index)
    parts["spokes"](rods.flat, (0.0, 0.0))
    total = vectors(rods.ring, R.F1).sum(axis=(0, 1))
    total += np.stack([rods.oblique(R.F1 + i, nodes=True).sum() + rods.straight(R.F1 + i, nodes=True).sum() for i in range(3)])
    scale = np.abs(vectors(rods.ring, R.F1)).sum()
    assert scale > 1.0 and np.abs(total).max() < 1e-12 * scale


def test_axial_systems_are_solved(state):
    rods, parts = state
    generator = np.random.default_rng(1)
    for view, solve, count in ((rods.straight, "solve", 180), (rods.ring, "ring_solve", 40)):
        for row, low in ((R.SCALE, 3.0), (R.CORRECTION, -1.0), (R.IMPULSE, -1.0)):
            view(row)[:] = low + generator.random(view(row).shape)
        diagonal, off, right = (view(row).copy() for row in (R.SCALE, R.CORRECTION, R.IMPULSE))
        arguments = () if solve == "ring_solve" else (np.uint64(180), 9, np.uint64(0), np.uint64(1))
        parts[solve](rods.flat, *arguments)
        for rod in (0, 7):
            matrix = np.diag(diagonal[rod]) + np.diag(off[rod, :-1], 1) + np.diag(off[rod, :-1], -1)
            if solve == "ring_solve":
                matrix[0, -1] = matrix[-1, 0] = off[rod, -1]
            np.testing.assert_allclose(view(R.IMPULSE)[rod], np.linalg.solve(matrix, right[rod]), rtol=1e-12, atol=1e-14)
        assert count == view(R.IMPULSE).shape[1]


def test_rest_is_rest_without_any_tone():
    plant = make_plant("assembly", ring_nodes=8, resting_tone=0.0)
    plant.advance(Activation(), 0.2)
    families = ((plant.core.rods.straight, {"nodes": True}), (plant.core.rods.oblique, {"nodes": True}), (plant.core.rods.ring, {}))
    assert max(np.abs(view(row, **nodes)).max() for view, nodes in families for row in (R.V1, R.V2, R.V3)) < 1e-9


def test_twisting_keeps_the_volume():
    plant = make_plant("assembly-coarse")
    volume = plant.core.volume()
    plant.advance(programme(), 0.1)
    slabs = plant.core.rods.slab(SlabRow.VOLUME) / plant.core.rods.slab(SlabRow.REST)
    assert plant.core.volume() == pytest.approx(volume, rel=0.005)
    assert np.abs(slabs - 1).max() < 0.003
    # No chatter: the grid-scale part of the cord's velocity is far below its scale.
    velocity = np.stack([plant.core.rods.straight(R.V1 + i, nodes=True)[0] for i in range(3)])
    assert np.abs(np.diff(velocity, 2, axis=1)).mean() < 5e-3 * np.abs(velocity).max()


def test_left_and_right_hand_are_mirror_images():
    moved = {}
    for group in ("R-OM", "L-OM"):
        plant = make_plant("assembly", ring_nodes=8)
        recording = plant.advance(Activation(templates=(Plateau(groups=(group,), level=0.3, rise=0.1),)), 0.1)
        moved[group] = [(twist(recording.points[i], -recording.frames[i, 1:-1, 1]), recording.length[i]) for i in (2, -1)]
    # Compressed fibres of the other hand then buckle, and rounding decides which way.
    for (right, shorter), (left, short), digits in zip(*moved.values(), (1e-9, 1e-3), strict=True):
        assert right < -0.009 and left == pytest.approx(-right, rel=digits) and short == pytest.approx(shorter, rel=digits)


@pytest.mark.slow
def test_published_numerics_give_the_published_motion():
    plant = make_plant("assembly", paper_compatible=True, sample_interval=2e-3)
    for instant, length, turns in ((0.1, 194.85181, -0.10138), (0.2, 194.61658, -0.52262), (0.3, 195.1019, -0.8943)):
        recording = plant.advance(programme(), round(instant - plant.time, 6))
        assert recording.length[-1] * 1e3 == pytest.approx(length, abs=0.1)
        assert twist(recording.points[-1], -recording.frames[-1, 1:-1, 1]) == pytest.approx(turns, abs=0.02)


def test_a_saved_state_continues_bit_by_bit(tmp_path):
    plant, other = make_plant("assembly-coarse"), make_plant("assembly-coarse")
    plant.advance(programme(), 0.01)
    plant.save(tmp_path / "state.npz")
    plant.advance(programme(), 0.01)
    other.load(tmp_path / "state.npz")
    other.advance(programme(), 0.01)
    for mine, theirs in zip(plant.core.nodes(), other.core.nodes(), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    with pytest.raises(OctoctrlError, match="steps=71"):
        make_plant("assembly-coarse", dt=2e-5).load(tmp_path / "state.npz")


def test_cord_brake_moves_momentum_from_the_cord_to_its_muscles(state):
    rods, parts = state
    generator = np.random.default_rng(2)
    speed = rods.straight(R.V1, nodes=True)
    speed[:] = generator.normal(size=speed.shape)
    speed[:, 0] = 0.0
    before, mass = speed.copy(), straight_mass(ARM, GEOMETRY, STEP)
    parts["cord_brake"](rods.flat, 0.25)
    np.testing.assert_allclose((mass * speed).sum(axis=0), (mass * before).sum(axis=0), atol=1e-15 * mass.max())
    np.testing.assert_allclose((speed[0] - speed[1:].mean(axis=0))[1:], 0.75 * (before[0] - before[1:].mean(axis=0))[1:], rtol=1e-12)


@pytest.mark.parametrize("h", [5e-5, 7e-5])
def test_helix_tips_weigh_what_their_springs_and_their_own_tension_need(h):
    """A node between two taut elements, on its spring."""
    mass, helices, joints = oblique_mass(ARM, GEOMETRY, h), GEOMETRY.oblique, ring_connections(ARM, GEOMETRY)
    bare = helices.node_mass
    for rod, node in ((0, 0), (0, 100), (3, 250), (7, 339), (7, 340), (2, 357), (5, helices.points.shape[1] - 1)):
        elements = (max(node - 1, 0), min(node, helices.radius.shape[1] - 1))
        stiff = sum(2 * ARM.oblique.maximum_stress * np.pi * helices.radius[rod, e] ** 2 / helices.length[rod, e] for e in elements)
        stiff += joints.oblique_spring[node // 2] if node % 2 == 0 else 0.0
        assert mass[rod, node] == pytest.approx(max(bare[rod, node], 0.1 * h**2 * stiff), rel=1e-12)
    assert mass[0, 358] == bare[0, 358] and (mass[0, 359] > 1.1 * bare[0, 359]) == (h > 6e-5)


def test_contacts_have_one_law_at_every_step():
    rods, finer = (make_plant("assembly", dt=dt).core.rods for dt in ("auto", 2e-5))
    np.testing.assert_array_equal(rods.spoke(SpokeRow.R_EFFECTIVE), finer.spoke(SpokeRow.R_EFFECTIVE))
    np.testing.assert_array_equal(rods.crossing(CrossingRow.EFFECTIVE), finer.crossing(CrossingRow.EFFECTIVE))
    assert rods.crossing(CrossingRow.EFFECTIVE).min() > 0


@pytest.mark.parametrize(
    ("groups", "level", "length"),
    # Elongation against passive longitudinal muscle and shortening against passive rings, at constant volume.
    [(("TM",), 0.3, 0.070), (("TM",), 1.0, 0.125), (LONGITUDINAL_GROUPS, 1.0, -0.29)],
    ids=["elongated", "elongated fully", "shortened fully"],
)
@pytest.mark.slow
def test_muscles_deform_the_arm_at_constant_volume(groups, level, length):
    plant = make_plant("assembly")
    volume, rings = plant.core.volume(), plant.core.nodes()[2].mean(axis=1)
    plant.advance(Activation(templates=(Plateau(groups=groups, level=level, rise=0.5),)), 0.7)
    assert plant.core.volume() == pytest.approx(volume, rel=0.02)
    slabs = plant.core.rods.slab(SlabRow.VOLUME) / plant.core.rods.slab(SlabRow.REST)
    assert np.abs(slabs - 1).max() < 0.03
    now = plant.core.nodes()[2].mean(axis=1)
    assert np.ptp(now[:, 1]) / np.ptp(rings[:, 1]) - 1 == pytest.approx(length, abs=0.01)
    assert np.abs(now[:170, ::2]).max() < 1e-3


@pytest.mark.parametrize(
    ("groups", "reach", "least"), [(("TM",), 0.16, 0.25), (LONGITUDINAL_GROUPS, 0.2, -0.33)], ids=["elongated", "shortened"]
)
@pytest.mark.slow
def test_compliant_arms_lengthen_by_a_quarter_and_shorten_by_a_third(groups, reach, least):
    """Where the muscles are active: without the tip, which bends aside when it is pressed out at full level."""
    plant = make_plant("assembly-coarse", Arm.octopus(tissue="compliant"))
    there = slice(round(180 * reach / 0.2))
    before = plant.core.nodes()[2].mean(axis=1)[there]
    found = plant.advance(Activation(templates=(Plateau(groups=groups, level=1.0, rise=0.5, window=(0.0, reach)),)), 1.5)
    now = plant.core.nodes()[2].mean(axis=1)[there]
    length, rest = (np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in (now, before))
    assert (length / rest - 1) * np.sign(least) > abs(least)
    assert np.abs(now[:, ::2]).max() < 1e-3 and np.abs(found.series["slab_volume"] - 1).max() < 0.01


def test_a_sample_that_stops_is_tried_again_at_parts_of_the_step():
    """At 250 µs a sample soon stops; tried again it is that of an arm at a half or a quarter of that, to the bit."""
    pull = Activation(templates=(Plateau(groups=("R-OM",), level=0.3, rise=0.02),))
    cores = [AssemblyCore(ARM, Scene(), ring_nodes=8) for _ in range(3)]
    plant, halved, quartered = (Plant(core, Clock(steps=20 * parts), automatic=True) for core, parts in zip(cores, (1, 2, 4), strict=True))
    while not plant.retried:
        before = plant.state()
        recording = plant.advance(pull, 0.005)
        assert recording.finer == plant.retried
        found = recording.points[-1]
        assert plant.time < 0.05
    with pytest.raises(PlantUnstableError):
        coarse = Plant(AssemblyCore(ARM, Scene(), ring_nodes=8), Clock(steps=20))
        coarse.restore(before)
        coarse.advance(pull, 0.005)
    finer = []
    for other in (halved, quartered):
        other.restore(before)
        finer.append(other.advance(pull, 0.005).points[-1])
    assert np.array_equal(found, finer[0]) or np.array_equal(found, finer[1])
    assert not np.array_equal(*finer) and plant.h == pytest.approx(2.5e-4)


def test_all_muscles_together_contract_without_flutter():
    """Contracted helices and muscles scallop the rings; taken for stiffer than they are, these flutter at half a metre per second."""
    plant = make_plant("assembly-coarse")
    everything = Plateau(groups=plant.arm.layout.names, level=1.0, rise=0.5)
    recording = plant.advance(Activation(templates=(everything,)), 0.12)
    ring = np.stack([plant.core.rods.ring(R.V1 + i) for i in range(3)])
    assert plant.h > 7e-5 and recording.finer == plant.retried == 0
    assert np.abs(ring).max() < 0.08


def test_guard_names_rod_and_element():
    plant = make_plant("assembly-coarse")
    plant.core.rods.oblique(R.V2, nodes=True)[6, 200] = 5000.0
    with pytest.raises(PlantUnstableError, match=r"element \d+ of (R-OM helix 3|ring \d+)") as caught:
        plant.advance(Activation(), 0.01)
    assert caught.value.recording.complete is False and np.isfinite(plant.observe().points).all()


def test_an_arm_that_is_faster_than_any_muscle_could_throw_it_is_stopped():
    """Alike everywhere, so that nothing else is wrong with it."""
    for speed in (8.0, 12.0):
        plant = make_plant("assembly-coarse", sample_interval=1e-4)
        for view, nodes in (
            (plant.core.rods.straight, {"nodes": True}),
            (plant.core.rods.oblique, {"nodes": True}),
            (plant.core.rods.ring, {}),
        ):
            view(R.V1, **nodes)[...] = speed
        if speed < 10.0:
            assert plant.advance(Activation(), 1e-4).complete
        else:
            with pytest.raises(PlantUnstableError, match="moves faster than 10 m/s"):
                plant.advance(Activation(), 1e-4)


@pytest.mark.parametrize(("rows", "rod"), [((R.X2,), "nerve cord"), ((R.X1, R.X3), "ring 0")], ids=["along", "around"])
def test_an_arm_that_is_stretched_beyond_what_its_laws_describe_is_stopped(rows, rod):
    """Seen after one step, so short that nothing has come up to speed yet; within the limits it is thrown apart some steps later."""
    core = AssemblyCore(ARM, Scene(), ring_nodes=8)
    still = {name: np.zeros((2, len(core.arm.layout.names), len(edges) - 1)) for name, edges in core.partitions.items()}
    for factor, steps, found in (
        (0.19, 100_000, Finding.STRETCHED), (0.21, 10_000, Finding.FAST), (2.95, 10_000, Finding.FAST), (3.05, 100_000, Finding.STRETCHED),
    ):  # fmt: skip
        clock = Clock(sample=1e-4, steps=steps)
        core.start(clock)
        core.rest()
        for view, nodes in ((core.rods.straight, {"nodes": True}), (core.rods.oblique, {"nodes": True}), (core.rods.ring, {})):
            for row in rows:
                view(row, **nodes)[...] *= factor
        stop = core.explain(core.state(), 0, still, None, clock)
        assert stop.finding is found and (stop.rod == rod or found is Finding.FAST), (factor, stop)


def test_places_have_names():
    plant = make_plant("assembly")
    lanes = plant.core.grid.lanes
    assert plant.core.place(0, 1) == ("nerve cord", 0) and plant.core.place(0, 3 * lanes + 180) == ("LM3", 179)
    assert plant.core.place(0, 9 * lanes + 1) == ("L-OM helix 1", 0) and plant.core.place(0, 24 * lanes + 8) == ("R-OM helix 4", lanes + 7)
    assert plant.core.place(1, lanes + 1) == ("ring 0", 0) and plant.core.place(1, 40 * lanes + 180) == ("ring 179", 39)
