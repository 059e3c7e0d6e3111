"""Bodies touching bodies, pushes, and objects that overlap."""

from dataclasses import replace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.sim.compiler import kernel
from octoctrl.sim.contact.body_kernels import drift_bodies, kick_bodies, straighten
from octoctrl.sim.contact.columns import Anchor, Body
from octoctrl.sim.contact.markers import Pairs, markers_of
from octoctrl.sim.contact.measures import gaps
from octoctrl.sim.contact.near_kernels import find_pairs
from octoctrl.sim.contact.pair_kernels import meet
from octoctrl.sim.contact.surroundings import Touch
from octoctrl.sim.contact.world import Points, World
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene.objects import Box, Capsule, Cylinder, Plane, Sphere, frame_of
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.scene.supports import Free, Moved, Push, Springs

LOOSE = Free(damping=(0.0, 0.0))
NOTHING = Points(element=np.empty(0, dtype=np.uint64), share=np.empty(0), radius=np.empty(0), length=np.empty(0))
BALL = Sphere(name="ball", radius=0.01, mass=0.01, support=LOOSE, water_mass=False)
POST = Capsule(name="post", radius=0.012, length=0.05, axis=(1, 0.2, 0), mass=0.03, support=LOOSE, water_mass=False)
CAN = Cylinder(name="can", radius=0.02, length=0.03, mass=0.02, support=LOOSE, water_mass=False)
BRICK = Box(name="brick", size=(0.03, 0.04, 0.02), mass=0.02, support=LOOSE, water_mass=False)
FLOOR = Plane(name="floor", friction=(0.5, 0.4))


@kernel
def go(world, h, steps):
    """The order of a plant's step, without an arm."""
    drift_bodies(world.bodies, 0.5 * h)
    for step in range(steps):
        if step % 10 == 0:
            find_pairs(world, 10 * h)
            for j in range(world.bodies.shape[0]):
                straighten(world.bodies[j])
        kick_bodies(world.bodies, h)
        meet(world, h)
        drift_bodies(world.bodies, h if step + 1 < steps else 0.5 * h)


def moved(objects, duration, *, velocities=(), forces=(), h=5e-4):
    world = World.of(NOTHING, objects)
    for row, velocity in zip(world.bodies, velocities, strict=False):
        row[Body.VELOCITY : Body.VELOCITY + 3] = velocity
    for row, force in zip(world.bodies, forces, strict=False):
        row[Body.PUSH : Body.PUSH + 3] = force
    before = momenta(world)
    go(world, h, round(duration / h))
    return world, before


def momenta(world):
    linear, angular = np.zeros(3), np.zeros(3)
    for row in world.bodies[world.bodies[:, Body.INVERSE_MASS] > 0]:
        momentum = row[Body.VELOCITY : Body.VELOCITY + 3] / row[Body.INVERSE_MASS]
        linear += momentum
        angular += np.cross(row[Body.POSITION : Body.POSITION + 3], momentum) + row[Body.MOMENTUM : Body.MOMENTUM + 3]
    return linear, angular


@pytest.mark.parametrize("item", [BALL, POST, CAN, BRICK], ids=lambda item: item.name)
def test_points_lie_on_the_surface_and_cover_it(item):
    rows = markers_of(item)
    world = (np.asarray(item.position) + rows[:, :3] @ frame_of(item))[None]
    depth = gaps(world, item, np.array([item.position]), frame_of(item)[None])[0] + rows[:, 3]
    np.testing.assert_allclose(depth, 0.0, atol=1e-15)
    # Seen from anywhere, the points reach as far as the body does, to 2 % of its size.
    for direction in np.random.default_rng(5).normal(size=(60, 3)):
        direction /= np.linalg.norm(direction)
        reach = (rows[:, :3] @ frame_of(item) @ direction + rows[:, 3]).max()
        assert supported(item, direction) * 0.98 - 1e-12 <= reach <= supported(item, direction) + 1e-12


def supported(item, direction):
    """How far a body reaches in a direction, in closed form."""
    along = frame_of(item) @ direction
    if isinstance(item, Sphere):
        return item.radius
    if isinstance(item, Box):
        return np.abs(along) @ item.sizes
    if isinstance(item, Capsule):
        return item.radius + abs(along[2]) * item.length / 2
    return item.radius * np.hypot(along[0], along[1]) + abs(along[2]) * item.length / 2


@pytest.mark.parametrize("other", [POST, CAN, BRICK, replace(BALL, name="other", radius=0.015)], ids=lambda item: item.name)
@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.5, 0.4)], ids=["smooth", "rough"])
def test_a_collision_keeps_momentum_and_angular_momentum(other, friction):
    ball = replace(BALL, position=(0.01, 0.04, 0.005), friction=friction)
    world, before = moved((ball, replace(other, friction=friction)), 0.2, velocities=[(0.0, -0.5, 0.0)])
    after = momenta(world)
    row = world.bodies[1]
    assert row[Body.VELOCITY + 1] < -1e-2, "they did not meet"
    assert np.abs(row[Body.MOMENTUM : Body.MOMENTUM + 3]).max() > 1e-8 or other.name == "other"
    assert np.abs(after[0] - before[0]).max() < 1e-12 * np.abs(before[0]).max()
    assert np.abs(after[1] - before[1]).max() < 1e-11 * np.abs(before[1]).max()
    # What bodies do to each other is none of the arm's.
    assert not world.bodies[:, Body.IMPULSE : Body.SLIPPED + 1].any()


@pytest.mark.parametrize("item", [BALL, POST, CAN, BRICK], ids=lambda item: item.name)
def test_a_body_comes_to_rest_on_a_floor(item):
    item = replace(item, axis=(0, 0, 1) if isinstance(item, Cylinder | Box) else (1, 0, 0))
    height = supported(item, np.array([0.0, 0.0, 1.0]))
    weight = np.array([0.0, 0.0, -9.81 * item.mass])
    world, _ = moved((FLOOR, replace(item, position=(0.0, 0.0, height + 1e-3))), 1.0, forces=[(0, 0, 0), weight])
    row = world.bodies[1]
    assert np.abs(row[Body.VELOCITY : Body.VELOCITY + 3]).max() < 1e-6
    # The weight is what the floor bears, and the depth that over the stiffness.
    force = world.pairs.anchors[..., Anchor.NORMAL].sum()
    assert force == pytest.approx(9.81 * item.mass, rel=1e-6)
    assert 0 < height - row[Body.POSITION + 2] < 1e-4


def test_a_box_on_a_floor_slides_as_its_friction_says():
    force = 0.6 * 9.81 * BRICK.mass
    world, _ = moved((FLOOR, replace(BRICK, position=(0.0, 0.0, 0.01))), 0.5, forces=[(0, 0, 0), (force, 0.0, -9.81 * BRICK.mass)])
    # It slides at once, and stays flat: pulled at a third of its width it does not tip.
    assert world.bodies[1, Body.VELOCITY] == pytest.approx(0.2 * 9.81 * 0.5, rel=0.02)
    world, _ = moved((FLOOR, replace(BRICK, position=(0.0, 0.0, 0.01))), 0.5, forces=[(0, 0, 0), (0.5 * force, 0.0, -9.81 * BRICK.mass)])
    assert abs(world.bodies[1, Body.VELOCITY]) < 1e-6


@pytest.mark.parametrize(
    ("item", "low", "high"),
    [(BALL, 0.99, 1.01), (replace(POST, axis=(0, 1, 0)), 0.99, 1.01), (CAN, 0.8, 0.95)],
    ids=lambda item: getattr(item, "name", ""),
)
def test_what_is_round_rolls_down_a_slope_and_a_cylinder_as_a_polygon(item, low, high):
    """A ball and a capsule roll as their closed forms; a cylinder stands on points round its rims, and is a sixth slower."""
    slope, weight = 0.35, 9.81 * item.mass
    item = replace(item, axis=(0, 1, 0), position=(0.0, 0.0, item.radius))
    world, _ = moved((FLOOR, item), 0.3, forces=[(0, 0, 0), (weight * np.sin(slope), 0.0, -weight * np.cos(slope))])
    rolling = 9.81 * np.sin(slope) / (1 + item.gyration[2] / item.radius**2)
    assert low < world.bodies[1, Body.VELOCITY] / (0.3 * rolling) < high


def test_what_is_moved_pushes_what_is_free():
    plate = Box(name="plate", size=(0.1, 0.01, 0.1), position=(0.0, -0.02, 0.0), support=Moved(velocity=(0.0, 0.05, 0.0)))
    world, _ = moved((plate, BALL), 1.0)
    assert world.bodies[1, Body.VELOCITY + 1] >= 0.05 - 1e-9
    assert world.bodies[0, Body.VELOCITY + 1] == 0.05


def test_pairs_are_those_that_something_can_move_and_points_those_of_the_smaller():
    fixed = [replace(POST, name=name, mass=None, support=oc.sim.scene.supports.Fixed()) for name in ("a", "b")]
    assert not len(Pairs.of(fixed).pairs)
    pairs = Pairs.of([FLOOR, BALL, *fixed]).pairs
    assert {tuple(pair) for pair in pairs} == {(1, 0), (1, 2), (1, 3)}


def test_objects_that_overlap_are_refused_and_fixed_ones_may():
    def plant(*objects):
        return oc.make_plant("rod", scene=Scene(objects=objects))

    post = Capsule(name="post", radius=0.01, length=0.08, position=(0.0, 0.1, -0.05), axis=(1, 0, 0))
    with pytest.raises(OctoctrlError, match=r"object 'ball' overlaps object 'post' by 5 mm, near \(0, 0.1, -0.065\) m; move one of them"):
        plant(post, replace(BALL, position=(0.0, 0.1, -0.065)))
    # Touching is not overlapping, and fixed ones make a cross.
    plant(post, replace(BALL, position=(0.0, 0.1, -0.07)))
    plant(post, replace(post, name="across", axis=(0, 1, 0)))


def test_a_push_acts_from_its_begin_to_its_end():
    item = replace(BALL, position=(0.3, 0.0, 0.0), pushes=(Push(force=(1e-3, 0.0, 0.0), since=0.1, until=0.3),))
    made = oc.make_plant("rod", scene=Scene(objects=(item,)), record_every=1)
    run = made.advance(oc.Activation(), 0.5)
    expected = np.clip(run.time - 0.1, 0.0, 0.2) * 1e-3 / 0.01
    np.testing.assert_allclose(Touch.of(run.series, "ball").velocity[:, 0], expected, atol=1e-12)
    # Also in pieces that end in the middle of it.
    made.reset()
    pieces = [made.advance(oc.Activation(), 0.25).series["touch ball"][-1] for _ in range(2)]
    np.testing.assert_array_equal(pieces[1], run.series["touch ball"][-1])


@pytest.mark.parametrize("model", ["rod", "assembly-coarse-mixed"])
def test_springs_swing_an_object_as_they_should_at_the_step_of_a_plant(model):
    h = oc.make_plant(model).h
    far = {"position": (0.5, 0.0, 0.0), "water_mass": False, "mass": 0.02}
    support = Springs(stiffness=0.02 / h**2, turning=0.0, damping=(0, 0))
    made = oc.make_plant(model, scene=Scene(objects=(Sphere(name="bob", radius=0.01, support=support, **far),)), dt=h, record_every=1)
    state = made.state()
    state["bodies"][0, Body.POSITION] += 1e-5
    made.restore(state)
    run = made.advance(oc.Activation(), 0.05)
    swung = Touch.of(run.series, "bob").position[:, 0] - 0.5
    np.testing.assert_allclose(swung, 1e-5 * np.cos(run.time / h), rtol=0, atol=1e-8)


def test_arrays_and_lists_are_taken_where_tuples_are():
    made = replace(BRICK, size=np.array([0.03, 0.04, 0.02]), axis=[0.0, 0.0, 1.0], pushes=[Push(force=np.array([1.0, 0.0, 0.0]))])
    assert made == replace(BRICK, pushes=(Push(force=(1.0, 0.0, 0.0)),))
    assert hash(made) and Moved(velocity=np.zeros(3)) == Moved()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Push(force=1.0), "push: force is 1.0; three finite numbers are needed, such as (0, 0.04, 0)"),
        (lambda: Push(force=(1, 0, 0), since=0.3, until=0.2), "push: until=0.2 s is outside > 0.3 s"),
        (
            lambda: replace(FLOOR, pushes=(Push(force=(1, 0, 0)),)),
            "object 'floor' is pushed but cannot move; use support Free()",
        ),
        (lambda: replace(BALL, pushes=((1, 0, 0),)), "Sphere: pushes is ((1, 0, 0),); several Pushes are needed"),
        (lambda: replace(BALL, support="fixed"), "object 'ball': support is fixed; use Fixed(), Moved(...), Free(...) or Springs(...)"),
        (lambda: replace(BRICK, size=(0.1, -0.1, 0.1)), "object 'brick': size=-0.1 m is outside > 0 m"),
        (lambda: replace(BRICK, size=np.ones(2)), "object 'brick': size is (1.0, 1.0); three finite numbers are needed"),
        (lambda: replace(BRICK, size=0.05), "object 'brick': size is 0.05; three finite numbers are needed"),
        (lambda: replace(BALL, friction=0.1), "object 'ball': friction is 0.1; two finite numbers are needed, such as (0.1, 0.1)"),
        (lambda: replace(BALL, name="a\nball"), "an object's name is 'a\\nball'; a word is needed, such as 'post'"),
        (lambda: replace(BALL, name=""), "an object's name is ''; a word is needed, such as 'post'"),
        (lambda: Free(damping=5), "free: damping is 5; two finite numbers are needed, such as (50, 5)"),
        (lambda: Scene(objects=5), "5 is no object that an arm can touch; use one of Sphere, Capsule, Cylinder, Box, Plane"),
    ],
)
def test_what_cannot_be_is_refused(make, message):
    with pytest.raises(OctoctrlError) as found:
        make()
    assert message in str(found.value)
