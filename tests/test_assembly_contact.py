"""The full arm among objects: what it may not change, conservation, restart, what is recorded."""

from dataclasses import replace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.sim.assembly import contact_kernels, hydrostat_terms, published_contact_kernels, published_terms
from octoctrl.sim.assembly.core import compiled
from octoctrl.sim.assembly.layout import AssemblyRow
from octoctrl.sim.assembly.surroundings import outer_nodes
from octoctrl.sim.body.anatomy import PLAIN
from octoctrl.sim.contact.columns import Body
from octoctrl.sim.contact.measures import covered_winding, gaps
from octoctrl.sim.contact.surroundings import Touch
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene.objects import Capsule, Plane, Sphere
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.scene.supports import Free

BALL = Sphere(name="ball", radius=0.01, position=(0.0, 0.16, 0.0155))
PRESS = oc.Activation(templates=(oc.Plateau(groups=("LM2", "LM3", "LM4"), level=0.3, rise=0.1, window=(0.05, 0.2)),))
"""Bends the arm onto the ball within a tenth of a second."""
POST = Capsule(name="post", radius=14e-3, length=0.08, position=(-0.01968674, 0.04, -0.01968674), axis=(0, 1, 0))
"""That of the published grasp."""


def plant(*objects, kind="assembly-coarse", **options):
    return oc.make_plant(kind, scene=Scene(objects=objects), **options)


def same(one, other):
    for name in ("points", "frames", "stretch"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("kind", ["assembly-coarse", pytest.param("assembly-coarse-mixed", marks=pytest.mark.slow)])
def test_an_object_out_of_reach_changes_no_bit(kind):
    alone, beside = (plant(*objects, kind=kind).advance(PRESS, 0.05) for objects in ((), (replace(BALL, position=(0.5, 0.5, 0.5)),)))
    same(alone, beside)
    assert not any("touch" in name for name in alone.series) and not Touch.of(beside.series, "ball").normal_force.any()


def test_without_objects_nothing_of_contact_is_built(monkeypatch):
    def refuse(grid):
        raise AssertionError("contact is built")

    for module in (hydrostat_terms, published_terms, contact_kernels, published_contact_kernels):
        for name in ("contact_kernels", "published_contact_kernels"):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, refuse)
    grid = plant().core.grid
    for published in (False, True):
        compiled.__wrapped__(grid, 0.1, published, PLAIN, False, False)
        with pytest.raises(AssertionError, match="contact is built"):
            compiled.__wrapped__(grid, 0.1, published, PLAIN, False, True)


def test_what_may_touch_are_the_nodes_of_the_helices():
    core = plant(BALL).core
    nodes, helices = outer_nodes(core.geometry), core.geometry.oblique
    rows = core.rods.open_rods
    found = np.stack([rows[AssemblyRow.X1 + i, nodes.place.astype(int)] for i in range(3)], axis=1)
    np.testing.assert_array_equal(found, helices.points.reshape(-1, 3))
    assert nodes.length.sum() == pytest.approx(8 * 0.2)
    # The outline of the whole arm: path and radius of the helices.
    assert np.hypot(found[:, 0], found[:, 2]).max() + nodes.radius.max() == pytest.approx(13.82e-3, abs=2e-5)


@pytest.fixture(scope="module")
def pressed():
    """A plant in mid-contact, and its recording so far."""
    found = plant(BALL, record_every=1)
    return found, found.advance(PRESS, 0.15)


def test_the_arm_lies_on_the_ball_and_not_in_it(pressed):
    made, run = pressed
    touch = Touch.of(run.series, "ball")
    assert touch.normal_force[-1] > 1e-3 and touch.loaded[-1] >= 1
    assert 0 < touch.deepest.max() < 0.14e-3
    nodes = made.core.nodes()[1].reshape(1, -1, 3)
    depth = outer_nodes(made.core.geometry).radius - gaps(nodes, BALL, touch.position[-1:], touch.frame[-1:])[0]
    assert 0 < depth.max() < 0.14e-3
    assert (np.linalg.norm(touch.force, axis=1) <= 1.0001 * np.hypot(1, 0.1) * touch.normal_force + 1e-12).all()


def test_restart_in_contact_is_bit_exact(pressed, tmp_path):
    made, _ = pressed
    made.save(tmp_path / "state.npz")
    before = made.state()
    expected = made.advance(PRESS, 0.02)
    made.restore(before)
    other = plant(BALL, record_every=1)
    other.load(tmp_path / "state.npz")
    found = other.advance(PRESS, 0.02)
    same(found, expected)
    for name, values in expected.series.items():
        np.testing.assert_array_equal(found.series[name], values)
    assert Touch.of(found.series, "ball").normal_force[0] > 0, "not in contact"
    with pytest.raises(OctoctrlError, match="objects"):
        plant().load(tmp_path / "state.npz")


def test_a_sample_that_stops_is_tried_again_with_the_contact_that_it_began_with(pressed, monkeypatch):
    made, _ = pressed
    before, core = made.state(), made.core
    half = oc.make_plant("assembly-coarse", scene=Scene(objects=(BALL,)), dt=made.h / core.finer[0], record_every=1)
    half.restore(before)
    expected, move, tries = half.advance(PRESS, made.sample_interval), core.move, []

    def stops_at_first(first, inputs, clock):
        motion = move(first, inputs, clock)
        tries.append(clock.step)
        if len(tries) > 1:
            return motion
        none = {name: values[:0] for name, values in motion.series.items()}
        return motion._replace(points=motion.points[:0], frames=motion.frames[:0], stretch=motion.stretch[:0], series=none, finding=1)

    monkeypatch.setattr(core, "move", stops_at_first)
    found = made.advance(PRESS, made.sample_interval)
    made.restore(before)
    assert len(tries) == 2
    same(found, expected)
    np.testing.assert_array_equal(found.series["touch ball"], expected.series["touch ball"])


def test_a_free_object_receives_what_the_arm_gives():
    """Its momentum is the integral of the recorded force, and its angular momentum that of the couple."""
    ball = replace(BALL, mass=0.02, support=Free(damping=(0.0, 0.0)), water_mass=False, friction=(0.3, 0.3))
    made = plant(ball, record_every=1)
    run = made.advance(PRESS, 0.15)
    touch = Touch.of(run.series, "ball")
    pushed, turned = (
        np.concatenate([[np.zeros(3)], np.cumsum(values[1:], axis=0) * made.sample_interval]) for values in (touch.force, touch.couple)
    )
    assert np.abs(touch.velocity[-1]).max() > 1e-3, "it was not touched"
    np.testing.assert_allclose(0.02 * touch.velocity, pushed, atol=1e-14)
    momentum = made.state()["bodies"][0, 19:22]
    assert np.abs(momentum).max() > 1e-9
    np.testing.assert_allclose(momentum, turned[-1], atol=1e-16)


def test_a_touch_keeps_momentum_and_angular_momentum():
    """Of arm and ball together, over the exchange alone, whatever the step does beside it."""
    ball = replace(BALL, mass=0.02, support=Free(damping=(0.0, 0.0)), water_mass=False, friction=(0.3, 0.3), position=(0.0, 0.16, 0.0))
    far = replace(ball, position=(0.5, 0.5, 0.5))
    made = plant(far)
    made.advance(PRESS, 0.05)
    core = made.core
    watch, touch, _ = contact_kernels.contact_kernels(core.grid)
    world, rods = core._around.world, core.rods
    nodes = outer_nodes(core.geometry).place.astype(int)

    def momenta():
        mobility = rods.open_rods[AssemblyRow.NODE_MOBILITY, nodes] / made.h
        mass = np.where(mobility > 0, 1 / np.where(mobility > 0, mobility, 1.0), 0.0)[:, None]
        place, velocity = (np.stack([rods.open_rods[row + i, nodes] for i in range(3)], axis=1) for row in (AssemblyRow.X1, AssemblyRow.V1))
        row = world.bodies[0]
        linear = (mass * velocity).sum(axis=0) + 0.02 * row[16:19]
        return linear, (mass * np.cross(place, velocity)).sum(axis=0) + 0.02 * np.cross(row[4:7], row[16:19]) + row[19:22]

    world.bodies[0, 4:7] = rods.open_rods[AssemblyRow.X1 : AssemblyRow.X3 + 1, nodes[1000]] + [0.0, 0.0, 0.0112]
    before = momenta()
    watch(rods.flat, world, 1e-3)
    for _ in range(5):
        touch(rods.flat, world, made.h)
    after = momenta()
    assert np.abs(world.bodies[0, 16:19]).max() > 1e-4 and np.abs(world.bodies[0, 19:22]).max() > 1e-9
    for one, other in zip(before, after, strict=True):
        assert np.abs(one - other).max() < 1e-12 * np.abs(one).max()


def test_an_object_is_let_go_at_its_time():
    item = replace(BALL, density=200.0, support=Free(since=0.12))
    run = plant(item, record_every=1).advance(PRESS, 0.15)
    place, held = Touch.of(run.series, "ball").position, run.time <= 0.12 + 1e-9
    assert not np.ptp(place[held], axis=0).any() and np.ptp(place[~held], axis=0).max() > 1e-5
    pieces = plant(item, record_every=1)
    parts = [pieces.advance(PRESS, 0.075) for _ in range(2)]
    np.testing.assert_array_equal(parts[1].points[-1], run.points[-1])


@pytest.mark.parametrize(
    ("item", "said"),
    [
        # The skin is 13.2 mm from the axis there; between its nodes it is open.
        (replace(BALL, position=(0.0, 0.01, 0.0228)), "object 'ball' overlaps the arm at rest by"),
        (replace(POST, radius=14.4e-3), "object 'post' overlaps the arm at rest by"),
        (Plane(name="wall", position=(0.0, 0.1, 0.0), axis=(0, -1, 0)), "object 'wall' overlaps the arm at rest by"),
    ],
)
def test_objects_in_the_arm_are_refused_before_the_run(item, said):
    with pytest.raises(OctoctrlError, match=said):
        plant(item)
    assert plant(POST).scene.objects


def segments_apart(first, edge, other, axis):
    """Distance of two segments, by minimising over both shares on ever finer grids."""
    low, high = np.zeros(2), np.ones(2)
    for _ in range(12):
        u, t = (np.linspace(low[i], high[i], 21) for i in range(2))
        apart = first + u[:, None, None] * edge - other - t[None, :, None] * axis
        square = (apart**2).sum(axis=2)
        i, j = np.unravel_index(square.argmin(), square.shape)
        width = (high - low) / 10
        best = np.array([u[i], t[j]])
        low, high = np.maximum(best - width, 0.0), np.minimum(best + width, 1.0)
    return np.sqrt(square.min())


def test_published_contact_finds_the_nearest_places_of_two_segments():
    draw = np.random.default_rng(4)
    for _ in range(200):
        first, edge, other, axis = draw.normal(size=(4, 3))
        u, t = published_contact_kernels.closest(*(first - other), *edge, *axis)
        assert 0 <= u <= 1 and 0 <= t <= 1
        assert np.linalg.norm(first + u * edge - other - t * axis) == pytest.approx(segments_apart(first, edge, other, axis), rel=1e-6)


def test_published_contact_gives_to_the_body_what_it_takes_from_the_arm():
    """Forces on the nodes sum up to what the body receives, with k times the overlap along the normal."""
    post = Capsule(name="post", radius=14e-3, length=0.08, position=(-0.0205, 0.04, -0.0205), axis=(0, 1, 0), stiffness=900.0)
    made = oc.make_plant("assembly", scene=Scene(objects=(post,)), paper_compatible=True)
    core, (watch, press) = made.core, published_contact_kernels.published_contact_kernels(made.core.grid)
    world, rods = core._around.world, core.rods
    rods.open_rods[AssemblyRow.RADIUS] = rods.open_rods[AssemblyRow.REST_RADIUS]
    world.bodies[0, Body.POSITION : Body.POSITION + 3] = (-0.0185, 0.04, -0.0185)
    world.bodies[0, Body.KINETIC] = 0.0
    before = [rods.oblique(AssemblyRow.F1 + i, nodes=True).copy() for i in range(3)]
    watch(rods.flat, world, 1e-4)
    press(rods.flat, world, 1e-5)
    given = np.array([(rods.oblique(AssemblyRow.F1 + i, nodes=True) - before[i]).sum() for i in range(3)])
    row = world.bodies[0]
    assert row[Body.LOADED] > 3 and np.linalg.norm(given) > 1e-4
    np.testing.assert_allclose(row[Body.IMPULSE : Body.IMPULSE + 3] / 1e-5, -given, rtol=1e-9, atol=1e-15)
    # At rest nothing damps: the sum of normal forces is k times that of the overlaps, here of distances found on grids.
    helices = core.geometry.oblique
    middle, edge = helices.centres, helices.edges
    low = np.array([-0.0185, 0.0, -0.0185])
    deep = [
        post.radius + r - segments_apart(m, e, low, np.array([0.0, 0.08, 0.0]))
        for m, e, r in zip(middle.reshape(-1, 3), edge.reshape(-1, 3), helices.radius.ravel(), strict=True)
        if np.linalg.norm((m - low)[[0, 2]]) < post.radius + 4e-3
    ]
    assert row[Body.NORMAL] / 1e-5 == pytest.approx(900.0 * 0.2 / 360 * sum(d for d in deep if d > 0), rel=1e-3)


def test_published_contact_knows_capsules_only():
    with pytest.raises(
        OctoctrlError, match=r"the published contact knows capsules only \(found 'ball'\); leave it or paper_compatible out"
    ):
        oc.make_plant("assembly", scene=Scene(objects=(BALL,)), paper_compatible=True)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["assembly-coarse", "assembly-coarse-mixed"])
def test_an_arm_that_lies_on_a_post_comes_to_rest(kind):
    """The programme of the published grasp, at levels for the default numerics."""
    act = oc.tasks.programme("fig4a").activation
    act = replace(act, templates=tuple(replace(item, level=0.12) if "R-OM" in item.groups else item for item in act.templates))
    made = plant(POST, kind=kind)
    run = made.advance(act, 5.5)
    touch, radius = Touch.of(run.series, "post"), np.asarray(made.arm.section((made.edges[1:] + made.edges[:-1]) / 2).outer_radius)
    covered = covered_winding(run.points, radius, POST, touch.position, touch.frame)
    late = run.time > 5.0
    assert abs(covered[-1]) > 0.15 and np.ptp(covered[late]) < 0.01
    assert touch.normal_force[-1] > 0.1 and np.ptp(touch.normal_force[late]) < 0.02 * touch.normal_force[-1]
    assert touch.deepest.max() < 0.14e-3
