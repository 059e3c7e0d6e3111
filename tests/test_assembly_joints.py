"""Connections and slabs of the full arm as gradients of energies, which stand beside them in plain NumPy and take a complex step.

A direction in which all nodes and frames move is as good as a gradient: what the compiled loads do along it must be what the energy loses.
"""

import numpy as np
import pytest
from assembly_parts import terms_of, vectors

from octoctrl.sim.assembly.constants import slab_volumes
from octoctrl.sim.assembly.energies import Connections, connections_of
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.layout import SlabRow, SpokeRow
from octoctrl.sim.assembly.parts import whole
from octoctrl.sim.assembly.stepping import mover
from octoctrl.sim.plants import make_plant

TINY = 1e-20
LOADS = (R.F1, R.F2, R.F3, R.C1, R.C2, R.C3, R.N1, R.N2, R.N3)


def body_of(plant):
    return connections_of(plant.arm, plant.core.geometry, plant.core.rods)


@pytest.fixture(scope="module", params=[None, 8], ids=["published rings", "coarse rings"])
def bent(request):
    """An arm of which every node, frame and radius is somewhere near rest, with overlaps."""
    plant = make_plant("assembly", ring_nodes=request.param)
    rods, generator = plant.core.rods, np.random.default_rng(4)
    for view, size, nodes in ((rods.straight, 2e-4, {"nodes": True}), (rods.oblique, 2e-4, {"nodes": True}), (rods.ring, 2e-4, {})):
        for i in range(3):
            view(R.X1 + i, **nodes)[:] += size * generator.standard_normal(view(R.X1, **nodes).shape)
    for i in range(3):
        rods.straight(R.W1 + i)[:] = 2e3 * generator.standard_normal(rods.straight(R.W1).shape)
    terms = terms_of(plant, drag=(0.0, 0.0, 0.0, 0.0))
    mover(plant.core.grid)(rods.flat, whole(plant.core.grid), 1e-4)
    terms["strains"]()
    return plant, terms, rods.flat.copy()


CONNECTIONS = ("sides", "ring connections", "contacts")


def loads(plant, terms, names):
    """Forces on nodes of straight rods, helices and rings and couples on straight elements, in the laboratory, from the terms `names`."""
    rods = plant.core.rods
    for row in LOADS:
        rods.open_rods[row] = rods.rings[row] = 0.0
    rods.spokes[SpokeRow.F1 :] = 0.0
    for name in names:
        terms[name]()
    if set(names) & set(CONNECTIONS):
        terms["sums"]()
    axis = vectors(rods.straight, R.N1)
    straight = vectors(rods.straight, R.F1, nodes=True)
    straight[:, :-1] += axis
    straight[:, 1:] -= axis
    return straight, vectors(rods.oblique, R.F1, nodes=True), vectors(rods.ring, R.F1), vectors(rods.straight, R.C1)


@pytest.mark.parametrize("names", [CONNECTIONS[:1], CONNECTIONS[:2], CONNECTIONS, ("crossings",), ("pressure",)], ids="+".join)
def test_loads_are_the_gradient_of_their_energy_and_keep_both_momenta(bent, names):
    plant, terms, flat = bent
    plant.core.rods.flat[:] = flat
    body, found = body_of(plant), loads(plant, terms, names)
    generator = np.random.default_rng(5)
    for moved in range(8):
        # Each family alone, then all together.
        way = [generator.standard_normal(values.shape) * (moved in (family, 4, 5, 6, 7)) for family, values in enumerate(found)]
        turned = np.cross(way[3][:, :, None, :], body.frames)
        stepped = Connections(
            plant.arm,
            plant.core.geometry,
            plant.core.rods,
            *(x + 1j * TINY * d for x, d in zip((body.straight, body.oblique, body.rings), way[:3], strict=True)),
            body.frames + 1j * TINY * turned,
        )
        slope = sum(getattr(stepped, name.replace(" ", "_"))() for name in names).imag / TINY
        work = sum(np.sum(load * d) for load, d in zip(found, way, strict=True))
        scale = sum(np.abs(load * d).sum() for load, d in zip(found, way, strict=True))
        assert work == pytest.approx(-slope, abs=1e-12 * scale), moved
    force = sum(load.sum(axis=(0, 1)) for load in found[:3])
    places = (body.straight, body.oblique, body.rings)
    arms = [np.cross(x, load) for x, load in zip(places, found, strict=False)]
    moment = sum(arm.sum(axis=(0, 1)) for arm in arms) + found[3].sum(axis=(0, 1))
    assert np.abs(force).max() < 1e-13 * sum(np.abs(load).sum() for load in found[:3])
    assert np.abs(moment).max() < 1e-13 * (sum(np.abs(arm).sum() for arm in arms) + np.abs(found[3]).sum())


def test_pressure_follows_the_volume_of_each_slab(bent):
    plant, terms, flat = bent
    plant.core.rods.flat[:] = flat
    terms["pressure"]()
    volumes, rest = body_of(plant).volumes(), slab_volumes(plant.core.geometry)
    np.testing.assert_allclose(plant.core.rods.slab(SlabRow.VOLUME), volumes, rtol=1e-12)
    np.testing.assert_allclose(plant.core.rods.slab(SlabRow.PRESSURE), 1e7 * (1 - volumes / rest), rtol=1e-9)


def given_way(rods, force, one_tension=True):
    """Change of volume (N,) per pressure over a step of rings under `force` (N, nodes, 3) that their viscous hoops resist.

    The tensions in a ring are either the same all round or each its own, as in the axial solve.
    """
    tangent, mobility = vectors(rods.ring, R.T1), rods.ring(R.NODE_MOBILITY)[:, 0]
    found = []
    for w, pull, t, viscosity in zip(mobility, force, tangent, rods.ring(R.VISCOSITY), strict=True):
        nodes = len(t)
        lengthening = np.zeros((nodes, nodes, 3))
        for k in range(nodes):
            lengthening[k, k], lengthening[k, (k + 1) % nodes] = -t[k], t[k]
        if one_tension:
            lengthening, slack = lengthening.sum(axis=0, keepdims=True), np.array([[np.sum(1 / viscosity)]])
        else:
            slack = np.diag(1 / viscosity)
        speeds = w * np.tensordot(lengthening, pull, axes=2)
        tension = np.linalg.solve(slack + w * np.tensordot(lengthening, lengthening, axes=([1, 2], [1, 2])), speeds)
        found.append(w * np.sum(pull * (pull - np.tensordot(tension, lengthening, axes=1))))
    return np.array(found)


def test_pressure_takes_no_ring_for_stiffer_than_it_is(bent):
    """Round or scalloped: what gives way more than twice as much as the projection takes it to would flutter."""
    plant, terms, flat = bent
    rods = plant.core.rods
    rods.flat[:] = flat
    body, worst = body_of(plant), 0.0
    edge = np.einsum("rn,rnk->nk", rods.straight(R.SECTION)[1:], body.edge[1:])
    angle = 2 * np.pi * np.arange(body.rings.shape[1]) / body.rings.shape[1]
    for depth in (0.0, 0.01, 0.03):
        centre = body.rings.mean(axis=1, keepdims=True)
        rings = centre + (body.rings - centre) * (1 + depth * np.cos(4 * angle)[:, None])
        for i in range(3):
            rods.ring(R.X1 + i)[:] = rings[..., i]
        for name in ("strains", "pressure"):
            terms[name]()
        on_ring = np.cross(edge[:, None], np.roll(rings, -1, axis=1) - np.roll(rings, 1, axis=1)) / 2
        real, taken = given_way(rods, on_ring, one_tension=False)[1:], given_way(rods, on_ring)[1:]
        assert np.all(taken > (1 - 1e-9) * real) and np.all(taken < 1.5 * real), depth
        hoop = rods.ring(R.NODE_MOBILITY)[1:, 0] * rods.ring(R.VISCOSITY)[1:].mean(axis=1) * (2 - 2 * np.cos(angle[1]))
        round_ring = rods.ring(R.NODE_MOBILITY)[1:, 0] * np.sum(on_ring[1:] ** 2, axis=(1, 2)) / (1 + hoop)
        worst = max(worst, (real / round_ring).max())
    # The measure of a round ring would be too stiff for these.
    assert worst > 2


def test_projection_is_that_of_a_dense_system_and_leaves_momentum(bent):
    """What a step does to the volumes, and what takes it back: a dense matrix of all gradients, with the mobilities of breathing rings."""
    plant, terms, flat = bent
    rods, grid, generator = plant.core.rods, plant.core.grid, np.random.default_rng(6)
    rods.flat[:] = flat
    terms["pressure"]()
    for i in range(3):
        rods.straight(R.V1 + i, nodes=True)[:] = generator.standard_normal((grid.straight_rods, grid.rings + 1))
        rods.ring(R.V1 + i)[:] = generator.standard_normal((grid.rings, grid.ring_nodes))
        rods.straight(R.V1 + i, nodes=True)[:, 0] = rods.ring(R.V1 + i)[0] = 0.0
    body, n = body_of(plant), grid.rings
    before = vectors(rods.straight, R.V1, nodes=True), vectors(rods.ring, R.V1)
    # Gradients: of every slab on its ring, and on the ends of its elements.
    edge = np.einsum("rn,rnk->nk", rods.straight(R.SECTION)[1:], body.edge[1:])
    beside = np.roll(body.rings, -1, axis=1) - np.roll(body.rings, 1, axis=1)
    on_ring = np.cross(edge[:, None], beside) / 2
    vector = np.cross(np.roll(body.rings, -1, axis=1), body.rings).sum(axis=1) / 2
    on_muscle = rods.straight(R.SECTION)[1:, :, None] * vector
    gives = rods.ring(R.NODE_MOBILITY)[:, 0] * np.sum(on_ring**2, axis=(1, 2))
    ring_mobility = rods.ring(R.NODE_MOBILITY) * (given_way(rods, on_ring)[:, None] / np.maximum(gives, 1e-30)[:, None])
    mobility = rods.straight(R.NODE_MOBILITY, nodes=True)[1:]
    gradient = np.zeros((n, 8, n + 1, 3))
    for i in range(n):
        gradient[i, :, i], gradient[i, :, i + 1] = -on_muscle[:, i], on_muscle[:, i]
    system = np.einsum("imnk,mn,jmnk->ij", gradient, mobility, gradient)
    system += np.diag(np.sum(ring_mobility[..., None] * on_ring**2, axis=(1, 2)))
    # At a metre per second nodes of the tip move by a twentieth of its radius, of which the gradients alone miss some percent.
    straight, rings = (x + plant.h * v for x, v in zip((body.straight, body.rings), before, strict=True))
    rate = (
        Connections(plant.arm, plant.core.geometry, rods, straight, body.oblique, rings, body.frames).volumes() - body.volumes()
    ) / plant.h
    first_order = np.einsum("imnk,mnk->i", gradient, before[0][1:]) + np.sum(on_ring * before[1], axis=(1, 2))
    assert np.median(np.abs(1 - first_order / rate)[-20:]) > 0.01
    system += np.diag(slab_volumes(plant.core.geometry) / (plant.h * 1e7))
    increment = np.linalg.solve(system, -rate)
    terms["project"]()
    change = [after - was for was, after in zip(before, (vectors(rods.straight, R.V1, nodes=True), vectors(rods.ring, R.V1)), strict=True)]
    push = np.einsum("i,imnk->mnk", increment, gradient)
    np.testing.assert_allclose(change[0][1:], mobility[..., None] * push, atol=1e-10 * np.abs(change[0]).max())
    wanted = ring_mobility[..., None] * increment[:, None, None] * on_ring
    np.testing.assert_allclose(change[1], wanted, atol=1e-10 * np.abs(wanted).max())
    # The held ring and the held ends of the muscles stay, and their slab is kept by what is free.
    assert not (change[0][0].any() or change[0][:, 0].any() or change[1][0].any()) and np.abs(increment).min() > 0
    held = rods.ring(R.NODE_MOBILITY)[1:, :, None]
    momentum = np.sum(change[1][1:] / held, axis=1)
    assert np.abs(momentum).max() < 1e-11 * np.abs(change[1][1:] / held).sum(axis=1).max()


def test_selective_mass_is_that_of_a_dense_cyclic_system(bent):
    plant, terms, flat = bent
    rods, grid, generator = plant.core.rods, plant.core.grid, np.random.default_rng(7)
    rods.flat[:] = flat
    old, raw = generator.standard_normal((2, 3, grid.rings, grid.ring_nodes))
    for i in range(3):
        rods.ring(R.V1 + i)[:] = old[i]
    terms["kick"]()
    for i in range(3):
        rods.ring(R.V1 + i)[:] = raw[i]
    terms["smooth"]()
    left = rods.ring(R.NODE_DECAY) * old
    found = vectors(rods.ring, R.V1)
    second = 2 * np.eye(grid.ring_nodes) - np.roll(np.eye(grid.ring_nodes), 1, axis=0) - np.roll(np.eye(grid.ring_nodes), -1, axis=0)
    rings, arm = plant.core.geometry.rings, plant.arm
    for i in (0, 90, grid.rings - 1):
        tension = rings.area[i, 0] * (arm.transverse.maximum_stress + 4 / 3 * arm.shear_modulus)
        beta = max(plant.h**2 * tension / (4 * 0.7 * rings.length[i, 0] * rings.node_mass[i, 0]), 1e-3)
        wanted = left[:, i] + np.linalg.solve(np.eye(grid.ring_nodes) + beta * second, (raw - left)[:, i].T).T
        np.testing.assert_allclose(found[i].T, wanted, atol=1e-12)
        np.testing.assert_allclose(found[i].sum(axis=0), raw[:, i].sum(axis=1), atol=1e-11)


def test_what_a_ring_does_with_a_force_is_symmetric(bent):
    """Viscosity, selective mass and viscosity again: were it not, forces that have a potential would make rings flutter."""
    plant, terms, flat = bent
    rods, grid, generator = plant.core.rods, plant.core.grid, np.random.default_rng(8)
    angle = 2 * np.pi * np.arange(grid.ring_nodes) / grid.ring_nodes
    centre = body_of(plant).rings.mean(axis=1, keepdims=True)
    forces, moved = generator.standard_normal((2, grid.rings, grid.ring_nodes, 3)), []
    for force in forces:
        rods.flat[:] = flat
        rings = centre + (body_of(plant).rings - centre) * (1 + 0.1 * np.cos(4 * angle)[:, None])
        for i in range(3):
            rods.ring(R.X1 + i)[:] = rings[..., i]
            rods.ring(R.V1 + i)[:] = 0.0
        terms["strains"]()
        for i in range(3):
            rods.ring(R.MMINUS1 + i)[:] = 0.0
            rods.ring(R.V1 + i)[:] = rods.ring(R.NODE_MOBILITY) * force[..., i]
        for name in ("axial", "smooth", "hold"):
            terms[name]()
        moved.append(vectors(rods.ring, R.V1))
    one, other = (np.sum(a * b, axis=(1, 2)) for a, b in zip(moved, forces[::-1], strict=True))
    scale = np.sqrt(np.prod([np.sum(a * b, axis=(1, 2)) for a, b in zip(moved, forces, strict=True)], axis=0))
    assert np.abs(one - other).max() < 1e-9 * scale.max() and np.all(scale[1:] > 0)
