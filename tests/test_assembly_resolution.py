"""The full arm with fewer and more rings: bundles that add up to the same arm, and the same motion within a stated error."""

import numpy as np
import pytest

from octoctrl.sim.activation import Activation, Plateau
from octoctrl.sim.arm import LONGITUDINAL_GROUPS, Arm
from octoctrl.sim.assembly import AssemblyPlant, _compiled
from octoctrl.sim.assembly_geometry import assembly_geometry, octopus_grid, ring_connections, stiffness, straight_connections
from octoctrl.sim.assembly_layout import AssemblyGrid, CrossingRow
from octoctrl.sim.assembly_layout import AssemblyRow as R
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.topology import twist

ARM = Arm.octopus()
WHOLE = assembly_geometry(ARM)
COUNTS = (72, 108, 144, 360)


@pytest.mark.parametrize(("rings", "nodes"), [(72, 16), (108, 24), (144, 32), (360, 80)])
def test_helices_meet_ring_nodes_at_every_resolution(rings, nodes):
    geometry = assembly_geometry(ARM, octopus_grid(ARM, rings))
    assert geometry.grid == AssemblyGrid(rings=rings, ring_nodes=nodes, bundle=180 / rings)
    assert geometry.elements == 9 * rings + 8 * (2 * rings - 1) + rings * nodes
    met = []
    for helix in range(8):
        node = geometry.oblique_nodes[helix]
        apart = np.linalg.norm(geometry.oblique.points[helix, ::2] - geometry.rings.points[np.arange(rings), node], axis=1)
        np.testing.assert_allclose(apart, ARM.ring_radius + geometry.oblique.radius[helix, ::2], rtol=1e-12)
        met.append(node)
    # Between two muscles, every place is met, and as often as the others (but for the arm's ends).
    visits = np.bincount(np.concatenate(met) % geometry.grid.spoke_pitch)
    assert visits.size == geometry.grid.spoke_pitch and visits.max() - visits.min() <= 8


@pytest.mark.parametrize("rings", COUNTS)
def test_a_bundle_adds_up_to_its_rings(rings):
    geometry = assembly_geometry(ARM, octopus_grid(ARM, rings))
    # The perimeter of a polygon of n nodes, over that of the published one; tapered sums differ by their midpoint rule.
    nodes = geometry.grid.ring_nodes
    polygon = nodes * np.sin(np.pi / nodes) / (40 * np.sin(np.pi / 40))
    assert geometry.rings.element_mass.sum() == pytest.approx(WHOLE.rings.element_mass.sum() * polygon, rel=1e-9)
    for name in ("straight", "oblique"):
        whole, family = getattr(WHOLE, name), getattr(geometry, name)
        # Chords of the helices are shorter than their arcs: up to 1.2 % with 16 of them to a turn instead of 40.
        assert family.element_mass.sum() == pytest.approx(whole.element_mass.sum(), rel=0.015)
    for name in ("shear", "bend", "twist"):
        whole, bundles = (getattr(stiffness(ARM, item.rings), name)[:, 0].sum() for item in (WHOLE, geometry))
        assert bundles == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize("rings", COUNTS)
def test_connections_have_the_same_limit_per_length(rings):
    geometry = assembly_geometry(ARM, octopus_grid(ARM, rings))
    found, whole = ring_connections(ARM, geometry), ring_connections(ARM, WHOLE)
    # Side by side: springs of the arm's length in parallel; rings on muscles and helices likewise; ring on ring: springs in series.
    sides = [straight_connections(ARM, item).spring.sum(axis=1) for item in (geometry, WHOLE)]
    np.testing.assert_allclose(*sides, rtol=0.01)
    for name in ("muscle_spring", "muscle_contact", "oblique_spring", "oblique_contact"):
        assert getattr(found, name).sum() == pytest.approx(getattr(whole, name).sum(), rel=0.01)
    base = geometry.rings.points[:, 0, 1] < 0.1, WHOLE.rings.points[:, 0, 1] < 0.1
    compliance = [(1 / item.ring_spring[rows[:-1]]).sum() for item, rows in zip((found, whole), base, strict=True)]
    assert compliance[0] == pytest.approx(compliance[1], rel=0.02)
    # The lock's torque on a muscle that is tilted by a small angle: constant times half the length squared.
    torques = [(item.muscle_torque * where.straight.length[1] ** 2).sum() for item, where in ((found, geometry), (whole, WHOLE))]
    assert torques[0] == pytest.approx(torques[1], rel=0.01)


def test_helices_touch_bundles_by_their_law():
    plant = AssemblyPlant(rings=72)
    rods, geometry = plant.rods, plant.geometry
    generator = np.random.default_rng(7)
    for view, options in ((rods.oblique, {"nodes": True}), (rods.ring, {})):
        for row in (R.X1, R.X2, R.X3):
            nodes = view(row, **options)
            nodes += 1e-4 * generator.standard_normal(nodes.shape)
    _, parts = _compiled(plant.grid, geometry.inclination)
    rods.open_rods[R.RADIUS], rods.rings[R.RADIUS] = rods.open_rods[R.REST_RADIUS], rods.rings[R.REST_RADIUS]
    parts["crossings"](rods.flat, rods.ring_index, rods.helix_index)
    _, helices, rings = plant.nodes()
    thick, fibre, constants = ARM.ring_radius, geometry.oblique.radius, ring_connections(ARM, geometry)
    wanted, touched = np.zeros_like(helices), 0
    for j in range(8):
        side = 1 if j < 4 else -1
        for i in range(72):
            q, h = geometry.oblique_nodes[j, i], 2 * i
            outward = rings[i, q] - rings[i, (q + 8) % 16]
            outward /= np.linalg.norm(outward)
            axis = np.cross(outward, rings[i, (q + 2) % 16] - rings[i, q - 2])
            axis /= np.linalg.norm(axis)
            wanted[j, h] += constants.oblique_spring[i] * ((rings[i, q] + thick * outward) - (helices[j, h] - fibre[j, h] * outward))
            for dh, dq in ((0, 0), (side, 1), (side, 2), (-side, -1), (-side, -2)):
                if not 0 <= h + dh <= 142:
                    continue
                between = rings[i, (q + dq) % 16] - helices[j, h + dh]
                reach = thick + fibre[j, h + dh]
                if dh:
                    # From the nearest of the fibres, which lie side by side over the width of the bundle.
                    between = between - np.clip(between @ axis, -1.5 * thick, 1.5 * thick) * axis
                distance = np.linalg.norm(between)
                overlap = max(reach - distance, 0.0)
                touched += overlap > 0 and dh != 0
                soft = rods.crossing(CrossingRow.EFFECTIVE)[j, i]
                push = constants.oblique_contact[i] * overlap * np.sqrt(overlap / (1 + soft * overlap))
                wanted[j, h + dh] -= push * between / distance
    assert touched > 50
    found = np.stack([rods.oblique(R.F1 + i, nodes=True) for i in range(3)], axis=-1)
    np.testing.assert_allclose(found, wanted, atol=1e-10)


def twisting(rings, duration):
    tone = Plateau(groups=(*LONGITUDINAL_GROUPS, "TM"), level=0.001, rise=0.01)
    pull = Plateau(groups=("R-OM",), level=0.3, window=(0.0, 0.2 * 357 / 360))
    recording = AssemblyPlant(rings=rings).advance(Activation(templates=(tone, pull)), duration)
    return twist(recording.points[-1], -recording.frames[-1, 1:-1, 1]), recording.length[-1]


def test_a_coarse_arm_twists_like_the_published_one():
    coarse, fine = twisting(108, 0.3), twisting(None, 0.3)
    assert coarse[0] == pytest.approx(fine[0], rel=0.03)
    assert 0.2 - coarse[1] == pytest.approx(0.2 - fine[1], rel=0.1)


def test_step_follows_the_thinnest_ring():
    steps = [AssemblyPlant(rings=rings).h for rings in (72, 144, 180, 360)]
    assert steps[2] == 5e-5 and steps == sorted(steps, reverse=True) and len(set(steps)) == 4


@pytest.mark.slow
@pytest.mark.parametrize("rings", (72, 108, 144))
@pytest.mark.parametrize("groups", (("R-OM",), ("L-OM",), ("LM1", "LM2", "LM8"), ("TM",), ("R-OM", "L-OM")), ids="+".join)
def test_strong_programmes_run_at_the_automatic_step(rings, groups):
    plant = AssemblyPlant(rings=rings)
    recording = plant.advance(Activation(templates=(Plateau(groups=groups, level=0.2, rise=0.05),)), 0.5)
    assert recording.complete


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"rings": 100}, "rings=100: 180 rings of 40 nodes can only be bundled so that all eight muscles meet a node; choose 72, 108, 144"),
        ({"rings": "fine"}, "rings='fine': 180 rings of 40 nodes can only be bundled"),
        ({"rings": 72, "paper_compatible": True}, "rings=72: paper_compatible is the published arm of 180 rings; leave rings out"),
        ({"rings": 72, "dt": 1e-4}, "dt=0.0001 s is outside 0…7.7e-05 s; use dt='auto'"),
    ],
)
def test_what_does_not_fit_is_refused(options, sentence):
    with pytest.raises(OctoctrlError) as caught:
        AssemblyPlant(**options)
    assert sentence in str(caught.value)


def test_a_state_belongs_to_its_resolution(tmp_path):
    AssemblyPlant(rings=72).save(tmp_path / "state.npz")
    with pytest.raises(OctoctrlError, match="elements=72, this plant elements=108"):
        AssemblyPlant(rings=108).load(tmp_path / "state.npz")
