"""The full arm with finer and with coarse rings: parts that add up to the same arm, and the same motion within a stated error."""

import numpy as np
import pytest
from assembly_parts import terms_of

from octoctrl.sim.activation import Activation
from octoctrl.sim.assembly.constants import ring_connections, stiffness, straight_connections
from octoctrl.sim.assembly.geometry import assembly_geometry, octopus_grid
from octoctrl.sim.assembly.layout import CrossingRow
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, Arm
from octoctrl.sim.body.grid import AssemblyGrid
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import make_plant
from octoctrl.sim.templates import Plateau
from octoctrl.sim.topology.measures import twist

ARM = Arm.octopus()
WHOLE = assembly_geometry(ARM)
COUNTS = (216, 360)
COARSE = octopus_grid(ARM, ring_nodes=8)


@pytest.mark.parametrize(("rings", "nodes"), [(216, 48), (360, 80)])
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
def test_finer_rings_add_up_to_the_published_ones(rings):
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


def test_coarse_rings_have_the_constants_of_the_published_ones():
    coarse, whole = assembly_geometry(ARM, COARSE), WHOLE
    assert coarse.elements == 9 * 180 + 8 * 359 + 180 * 8
    np.testing.assert_array_equal(coarse.oblique.points, whole.oblique.points)
    found, published = ring_connections(ARM, coarse), ring_connections(ARM, whole)
    # An octagon's perimeter over that of a polygon of 40.
    polygon = 8 * np.sin(np.pi / 8) / (40 * np.sin(np.pi / 40))
    for name in ("muscle_spring", "muscle_torque", "muscle_contact", "ring_spring", "oblique_spring", "oblique_contact"):
        np.testing.assert_allclose(getattr(found, name), polygon * getattr(published, name), rtol=1e-12)
    assert coarse.rings.element_mass.sum() == pytest.approx(polygon * whole.rings.element_mass.sum(), rel=1e-12)


def test_helices_cross_coarse_rings_on_the_circle():
    plant = make_plant("assembly", ring_nodes=8)
    terms = terms_of(plant)
    terms["strains"]()
    terms["crossings"]()
    assert max(np.abs(plant.core.rods.crossing(CrossingRow[f"FH{i}"])).max() for i in (1, 2, 3)) < 1e-9


def twisting(duration, **resolution):
    tone = Plateau(groups=(*LONGITUDINAL_GROUPS, "TM"), level=0.001, rise=0.01)
    pull = Plateau(groups=("R-OM",), level=0.3, window=(0.0, 0.2 * 357 / 360))
    recording = make_plant("assembly", **resolution).advance(Activation(templates=(tone, pull)), duration)
    return twist(recording.points[-1], -recording.frames[-1, 1:-1, 1]), recording.length[-1]


@pytest.mark.slow
def test_a_coarse_arm_twists_like_the_published_one():
    coarse, fine = twisting(0.6, ring_nodes=8), twisting(0.6)
    # 4.2 % apart at this level, its greatest difference; 3.7 % over the coil programme at 0.17.
    assert coarse[0] == pytest.approx(fine[0], rel=0.045)


def test_step_follows_the_thinnest_ring():
    steps = [make_plant("assembly", **options).h for options in ({"ring_nodes": 8}, {}, {"rings": 360})]
    assert steps[0] == steps[1] == 5e-3 / 71 and steps[2] < 0.5 * steps[1]


@pytest.mark.slow
def test_a_finer_arm_runs_at_its_automatic_step():
    finer, fine = twisting(0.1, rings=360), twisting(0.1)
    # 0.021 turns is the greatest difference while 1.4 turns are stored.
    assert finer[0] == pytest.approx(fine[0], abs=0.021)


@pytest.mark.slow
@pytest.mark.parametrize("nodes", (8, 16, 24))
@pytest.mark.parametrize("groups", (("R-OM",), ("L-OM",), ("LM1", "LM2", "LM8"), ("TM",), ("R-OM", "L-OM")), ids="+".join)
def test_strong_programmes_run_at_the_automatic_step(nodes, groups):
    plant = make_plant("assembly", ring_nodes=nodes)
    recording = plant.advance(Activation(templates=(Plateau(groups=groups, level=0.1 if groups == ("TM",) else 0.2, rise=0.05),)), 0.5)
    assert recording.complete


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"rings": 100}, "rings=100: 180 rings of 40 nodes can only be made finer so that all eight muscles meet a node; choose 180, 216"),
        ({"rings": "fine"}, "rings='fine': 180 rings of 40 nodes can only be made finer"),
        ({"ring_nodes": 12}, "ring_nodes=12: eight muscles need a multiple of 8, at most 40 with 180 rings"),
        ({"ring_nodes": 8, "paper_compatible": True}, "paper_compatible is the published arm with its own numbers"),
        ({"ring_nodes": 8, "dt": 1e-4}, "dt=0.0001 s exceeds the stability bound 8.1e-05 s (thin rings); use dt='auto'"),
    ],
)
def test_what_does_not_fit_is_refused(options, sentence):
    with pytest.raises(OctoctrlError) as caught:
        make_plant("assembly", **options)
    assert sentence in str(caught.value)


def test_a_state_belongs_to_its_resolution(tmp_path):
    make_plant("assembly", ring_nodes=8).save(tmp_path / "state.npz")
    with pytest.raises(OctoctrlError, match="ring_nodes=8, this plant ring_nodes=16"):
        make_plant("assembly", ring_nodes=16, dt=7.1e-5).load(tmp_path / "state.npz")


@pytest.mark.parametrize("rings", [180, 360])
def test_taut_fibres_meet_the_rings_where_others_do_and_are_straight_in_between(rings):
    grid = octopus_grid(ARM, rings, 8)
    loose, taut = (assembly_geometry(ARM, grid, kind).oblique for kind in (False, True))
    np.testing.assert_array_equal(taut.points[:, :: grid.helix_nodes], loose.points[:, :: grid.helix_nodes])
    between = (taut.points[:, :-2:2] + taut.points[:, 2::2]) / 2
    np.testing.assert_allclose(taut.points[:, 1:-1:2], between, rtol=0, atol=1e-15)
    apart = np.linalg.norm(np.diff(loose.points[:, ::2], axis=1), axis=2)
    np.testing.assert_allclose(taut.length[:, : 2 * rings - 2].reshape(8, -1, 2).sum(axis=2), apart, rtol=1e-12)
