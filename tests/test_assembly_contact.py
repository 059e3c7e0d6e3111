"""The full arm among objects: what it may not change, conservation, restart, what is recorded."""

from dataclasses import replace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.sim.assembly import stepping, terms
from octoctrl.sim.assembly.layout import AssemblyRow
from octoctrl.sim.assembly.surroundings import outer_nodes
from octoctrl.sim.body.anatomy import PLAIN
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

    monkeypatch.setattr(terms, "contact_kernels", refuse)
    monkeypatch.setattr(stepping, "contact_kernels", refuse)
    grid = plant().core.grid
    stepping.assembly_stepper(grid, terms.hydrostat_terms(grid, PLAIN))
    with pytest.raises(AssertionError, match="contact is built"):
        stepping.assembly_stepper(grid, terms.hydrostat_terms(grid, PLAIN, touching=True), touching=True)


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
    watch, touch, _ = terms.contact_kernels(core.grid)
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
