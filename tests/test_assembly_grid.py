"""Grids of the assembly: other counts of muscles, ring nodes and helices than the octopus arm's."""

import copy

import numpy as np
import pytest
from assembly_parts import laws_of

from octoctrl.sim.assembly.buffer import fill_parameters, new_assembly, set_rest
from octoctrl.sim.assembly.geometry import assembly_geometry, octopus_grid
from octoctrl.sim.assembly.hydrostat_terms import hydrostat_terms
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.parts import whole
from octoctrl.sim.assembly.terms import Step
from octoctrl.sim.body.anatomy import PLAIN
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.body.grid import AssemblyGrid
from octoctrl.sim.errors import OctoctrlError

STALK = 53.143e-3
TENTACLE = Arm.octopus(
    length=STALK,
    base_radius=3.7e-3,
    taper=1.0,
    straight_fraction=0.2,
    ring_radius=0.894718e-3,
    oblique_radius=0.1567596e-3,
    oblique_pitch=6 * STALK / 96,
)
"""Outline of a squid's tentacle stalk (van Leeuwen & Kier 1997)."""
TWELVE = AssemblyGrid(rings=96, ring_nodes=24, spokes=12, helix_nodes=4)


def test_the_octopus_arm_has_the_octopus_grid():
    assert octopus_grid(Arm.octopus()) == AssemblyGrid(rings=180, ring_nodes=40, spokes=8, helices=8, helix_nodes=2)


def test_a_grid_of_twelve_muscles_has_the_published_places():
    geometry = assembly_geometry(TENTACLE, TWELVE)
    straight, rings, oblique = geometry.straight, geometry.rings, geometry.oblique
    assert straight.points.shape == (13, 97, 3) and rings.points.shape == (96, 24, 3) and oblique.points.shape == (8, 383, 3)
    assert geometry.inclination == 0 and geometry.oblique_nodes.size == 768
    found = straight.radius[0, 0], straight.radius[5, 0], rings.points[0, 0, 0], rings.length[7, 3], oblique.length[6].sum()
    printed = 1.054291, 0.368157, 2.685322, 0.701010, 376.37
    np.testing.assert_array_less(np.abs(np.array(found) * 1e3 - printed), (1e-6, 1e-6, 1e-6, 1e-6, 1e-2))
    for number in range(8):
        nodes = rings.points[np.arange(96), geometry.oblique_nodes[number]]
        apart = np.linalg.norm(oblique.points[number, ::4] - nodes, axis=1)
        np.testing.assert_allclose(apart, TENTACLE.ring_radius + TENTACLE.oblique_radius, rtol=1e-9)
    assert oblique.points[0, -1, 1] == pytest.approx(STALK)


def total_force(rods):
    views = (rods.straight, rods.oblique)
    return np.stack([sum(view(R.F1 + i, nodes=True).sum() for view in views) + rods.ring(R.F1 + i).sum() for i in range(3)])


def test_connections_of_twelve_muscles_rest_and_conserve_momentum():
    geometry = assembly_geometry(TENTACLE, TWELVE)
    rods = new_assembly(geometry)
    set_rest(rods, geometry)
    fill_parameters(rods, TENTACLE, geometry, 1e-5, None)
    laws, step = laws_of(hydrostat_terms(TWELVE, PLAIN)), Step(1e-5, (), (0.0, 0.0), rods.ring_index, rods.helix_index)

    def connect():
        rods.open_rods[R.N1 : R.N3 + 1] = 0.0
        for name in ("crossings", "sides", "ring connections", "contacts", "sums", "pressure"):
            laws[name](rods.flat, 0.5, step, whole(TWELVE))

    # The current radius, as the strain kernel would leave it at rest.
    for family in (rods.open_rods, rods.rings):
        family[R.RADIUS] = family[R.REST_RADIUS]
    connect()
    # Largest constants: 1e5 N/m on lengths of 0.05 m, rounded to 1e-16.
    assert max(np.abs(rods.ring(R.F1 + i)).max() for i in range(3)) < 1e-10
    assert max(np.abs(rods.straight(R.F1 + i, nodes=True)).max() for i in range(3)) < 1e-10
    generator = np.random.default_rng(3)
    for view in (rods.straight, rods.oblique, rods.ring):
        for row in (R.X1, R.X2, R.X3):
            nodes = view(row) if view == rods.ring else view(row, nodes=True)
            nodes += 2e-5 * generator.standard_normal(nodes.shape)
    connect()
    each = np.abs(np.stack([rods.ring(R.F1 + i) for i in range(3)]))
    # Every ring, every spoke and every crossing carries a force.
    assert (each.max(axis=0)[:, :: TWELVE.spoke_pitch] > 0).all()
    assert all((each.max(axis=0)[np.arange(96), geometry.oblique_nodes[j]] > 0).all() for j in range(8))
    assert np.abs(total_force(rods)).max() < 1e-12 * each.sum()


@pytest.mark.parametrize(
    ("counts", "sentence"),
    [
        ({"rings": 4}, "rings=4: a grid needs a multiple of 1 from 8 to 400"),
        ({"spokes": 6}, "spokes=6: a grid needs a multiple of 4 from 4 to 96"),
        ({"ring_nodes": 20}, "ring_nodes=20: a grid needs a multiple of 8 from 8 to 96"),
        ({"helix_nodes": 3}, "helix_nodes=3: a grid needs a multiple of 2 from 2 to 96"),
        ({"helices": 12}, "ring_nodes=40: a grid needs a multiple of the 6 helices of either hand"),
    ],
)
def test_counts_that_do_not_fit_are_refused(counts, sentence):
    with pytest.raises(OctoctrlError) as caught:
        AssemblyGrid(**{"rings": 180} | counts)
    assert sentence in str(caught.value)


def test_the_buffer_begins_with_a_cache_line_and_its_copies_are_views_as_well():
    buffer = new_assembly(assembly_geometry(TENTACLE, TWELVE))
    buffer.flat[:] = np.arange(buffer.flat.size)
    for each in (buffer, copy.deepcopy(buffer)):
        assert each.flat.__array_interface__["data"][0] % 64 == 0
        np.testing.assert_array_equal(each.flat, np.arange(each.flat.size))
        each.rings[R.V1, 7] = -1.0
        assert np.count_nonzero(each.flat == -1.0) == 1
