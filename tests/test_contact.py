"""Distances, friction and rigid bodies against closed forms and conservation laws."""

from math import pi

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from octoctrl.sim.compiler import kernel
from octoctrl.sim.contact.bodies import kinetic_energy, rows_of
from octoctrl.sim.contact.body_kernels import drift_bodies, kick_bodies, straighten
from octoctrl.sim.contact.columns import Anchor, Body
from octoctrl.sim.contact.friction_kernels import follow, push, touch
from octoctrl.sim.contact.measures import covered_winding, winding
from octoctrl.sim.contact.shape_kernels import distance
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene.objects import Box, Capsule, Cylinder, Plane, Sphere, frame_of
from octoctrl.sim.scene.supports import Free, Moved, Springs

PLACE, AXIS = (0.01, -0.02, 0.03), (0.3, 1.0, -0.4)
SHAPES = (
    Sphere(name="ball", radius=0.014, position=PLACE),
    Capsule(name="post", radius=0.01, length=0.05, position=PLACE, axis=AXIS),
    Cylinder(name="can", radius=0.012, length=0.03, position=PLACE, axis=AXIS),
    Box(name="brick", size=(0.02, 0.03, 0.05), position=PLACE, axis=AXIS),
    Plane(name="floor", position=PLACE, axis=AXIS),
)
IDS = [shape.name for shape in SHAPES]


# Distances


def surface(item, draw):
    """Points on the surface of a body, by its own parametrisation."""
    frame, count = frame_of(item), 400
    angle, up = draw.uniform(0, 2 * pi, count), draw.uniform(-1, 1, count)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if isinstance(item, Sphere | Capsule):
        ball = np.concatenate([np.sqrt(1 - up[:, None] ** 2) * ring, up[:, None]], axis=1)
        local = item.radius * ball
        if isinstance(item, Capsule):
            local[:, 2] += np.sign(up) * item.length / 2
            barrel = np.concatenate([item.radius * ring, draw.uniform(-0.5, 0.5, (count, 1)) * item.length], axis=1)
            local = np.concatenate([local, barrel])
    elif isinstance(item, Cylinder):
        side = np.concatenate([item.radius * ring, draw.uniform(-0.5, 0.5, (count, 1)) * item.length], axis=1)
        lid = np.concatenate([item.radius * np.sqrt(draw.uniform(0, 1, (count, 1))) * ring, np.sign(up)[:, None] * item.length / 2], axis=1)
        local = np.concatenate([side, lid])
    elif isinstance(item, Box):
        local = draw.uniform(-0.5, 0.5, (count, 3))
        face = draw.integers(0, 3, count)
        local[np.arange(count), face] = np.sign(up) / 2
        local *= item.size
    else:
        local = np.concatenate([draw.uniform(-0.1, 0.1, (count, 2)), np.zeros((count, 1))], axis=1)
    return np.asarray(item.position) + local @ frame


@pytest.mark.parametrize("item", SHAPES, ids=IDS)
def test_distance_is_zero_on_the_surface_and_that_to_the_nearest_point_outside(item):
    draw, (row,) = np.random.default_rng(3), rows_of([item])
    points = surface(item, draw)
    assert max(abs(distance(row, *point)[0]) for point in points) < 1e-15
    dense = np.concatenate([surface(item, draw) for _ in range(40)])
    for point in np.asarray(item.position) + draw.uniform(-0.06, 0.06, (60, 3)):
        gap, *normal = distance(row, *point)
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-14)
        nearest = np.linalg.norm(dense - point, axis=1).min()
        if gap > 0:
            assert gap <= nearest + 1e-12
            if not isinstance(item, Plane):
                assert nearest < gap + 4e-3
            # The foot of the point lies on the surface.
            assert abs(distance(row, *(point - gap * np.array(normal)))[0]) < 1e-14
        else:
            assert -gap <= nearest + 1e-12


def slopes_of(row, point, h):
    return np.array([(distance(row, *(point + h * e))[0] - distance(row, *(point - h * e))[0]) / (2 * h) for e in np.eye(3)])


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(SHAPES), st.tuples(*(st.floats(-0.08, 0.08),) * 3))
@example(next(item for item in SHAPES if isinstance(item, Capsule)), (0.0, 1e-5, 0.0))
def test_the_normal_is_the_slope_of_the_distance(item, place):
    (row,), h = rows_of([item]), 1e-7
    point = np.asarray(item.position) + place
    _, *normal = distance(row, *point)
    slopes = slopes_of(row, point, h)
    # Not at the ridges, where the nearest point jumps, nor so near to an axis that differences depend on their step.
    if abs(np.linalg.norm(slopes) - 1) < 1e-4 and np.abs(slopes_of(row, point, 2 * h) - slopes).max() < 1e-5:
        np.testing.assert_allclose(normal, slopes, atol=2e-5)


# One point and one body


@kernel
def push_point(bodies, x, v, m, radius, anchors, stiffness, h, steps, force):
    """A ball of mass m that a force pushes, with all bodies: the order of a plant's step."""
    normals = np.zeros((bodies.shape[0], 6))
    for _ in range(steps):
        for i in range(3):
            x[i] += 0.5 * h * v[i]
        drift_bodies(bodies, 0.5 * h)
        for i in range(3):
            v[i] += h * force[i] / m
        kick_bodies(bodies, h)
        for j in range(bodies.shape[0]):
            gap, n1, n2, n3 = distance(bodies[j], x[0], x[1], x[2])
            normals[j, 0], normals[j, 1], normals[j, 2] = n1, n2, n3
            p1, p2, p3 = touch(
                bodies[j], anchors, j, gap - radius, n1, n2, n3, x[0], x[1], x[2], v[0], v[1], v[2], 1 / m, 1 / m, stiffness, h
            )
            v[0] += p1 / m
            v[1] += p2 / m
            v[2] += p3 / m
        for j in range(bodies.shape[0]):
            if anchors[j, 5] > 0:
                follow(bodies[j], anchors, j, normals[j, 0], normals[j, 1], normals[j, 2], x[0], x[1], x[2], v[0], v[1], v[2], h)
        for i in range(3):
            x[i] += 0.5 * h * v[i]
        drift_bodies(bodies, 0.5 * h)


class Block:
    """A point mass on a body, pressed and pulled."""

    def __init__(self, item, *, mass=1e-3, place=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), radius=0.0, stiffness=100.0, h=5e-4):
        self.rows, self.anchors = rows_of([item]), np.zeros((1, Anchor.WIDTH))
        self.x, self.v, self.mass, self.radius, self.stiffness, self.h = (
            np.array(place, dtype=float), np.array(velocity, dtype=float), mass, radius, stiffness, h,
        )  # fmt: skip

    def move(self, duration, force=(0.0, 0.0, 0.0)):
        steps = round(duration / self.h)
        push_point(self.rows, self.x, self.v, self.mass, self.radius, self.anchors, self.stiffness, self.h, steps, np.array(force))
        return self


FLOOR = Plane(name="floor", friction=(0.5, 0.4))
WEIGHT = 0.01


def settled(**options):
    return Block(FLOOR, **options).move(2.0, (0, 0, -WEIGHT))


def test_a_block_sinks_in_by_its_weight_over_the_stiffness():
    assert -settled().x[2] == pytest.approx(WEIGHT / 100.0, rel=1e-9)


def test_below_the_limit_it_holds_and_does_not_creep():
    block = settled()
    # Put on slowly: a load put on at once overshoots the anchor.
    for share in np.linspace(0.0, 0.9, 401):
        block.move(5e-3, (share * 0.5 * WEIGHT, 0, -WEIGHT))
    block.move(2.0, (0.9 * 0.5 * WEIGHT, 0, -WEIGHT))
    begin = block.x.copy()
    block.move(10.0, (0.9 * 0.5 * WEIGHT, 0, -WEIGHT))
    assert np.linalg.norm(block.x - begin) < 1e-9
    # The anchor's spring alone gives way.
    assert block.x[0] == pytest.approx(0.9 * 0.5 * WEIGHT / 50.0, rel=1e-6)


@pytest.mark.parametrize("share", [1.02, 2.0])
def test_above_the_limit_it_slides_with_kinetic_friction(share):
    block, force = settled(), (share * 0.5 * WEIGHT, 0, -WEIGHT)
    block.move(1.0, force)
    before = block.v[0]
    block.move(1.0, force)
    assert block.v[0] - before == pytest.approx((share * 0.5 - 0.4) * WEIGHT / block.mass, rel=1e-9)
    assert block.anchors[0, Anchor.SLIP] > 0.1


@pytest.mark.parametrize("h", [5e-4, 5e-5])
def test_stopping_distance(h):
    block = settled(h=h)
    begin = block.x[0]
    block.v[0] = 1.0
    block.move(2.0, (0, 0, -WEIGHT))
    assert block.x[0] - begin == pytest.approx(1 / (2 * 0.4 * WEIGHT / block.mass), rel=1e-3)
    assert abs(block.v[0]) < 1e-9


def test_no_force_at_a_gap_of_zero_and_none_apart():
    for gap in (0.0, 1e-12, 1e-3):
        block = Block(FLOOR, place=(0, 0, gap)).move(5e-4)
        assert not block.rows[0, Body.IMPULSE : Body.IMPULSE + 3].any() and block.x[2] == gap
    assert Block(FLOOR, place=(0, 0, -1e-6)).move(5e-4).rows[0, Body.IMPULSE + 2] < 0


def test_any_stiffness_is_stable():
    for stiffness in (1e-2, 1.0, 1e4, 1e9):
        block = Block(FLOOR, place=(0, 0, 0.01), stiffness=stiffness).move(3.0, (0, 0, -WEIGHT))
        assert -block.x[2] == pytest.approx(WEIGHT / stiffness, rel=1e-3, abs=1e-9)


def test_a_body_that_is_moved_carries_a_block_along():
    belt = Plane(name="belt", friction=(0.5, 0.4), support=Moved(velocity=(0.03, 0.0, 0.0)))
    block = Block(belt).move(3.0, (0, 0, -WEIGHT))
    assert block.v[0] == pytest.approx(0.03, rel=1e-9)


# Free bodies


def momenta(block):
    row = block.rows[0]
    mass, velocity, centre = 1 / row[Body.INVERSE_MASS], row[Body.VELOCITY : Body.VELOCITY + 3], row[Body.POSITION : Body.POSITION + 3]
    linear = block.mass * block.v + mass * velocity
    angular = block.mass * np.cross(block.x, block.v) + mass * np.cross(centre, velocity) + row[Body.MOMENTUM : Body.MOMENTUM + 3]
    return linear, angular


@pytest.mark.parametrize("h", [5e-4, 5e-5])
@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.5, 0.4)], ids=["smooth", "rough"])
def test_a_free_pair_keeps_momentum_and_angular_momentum(h, friction):
    item = Capsule(
        name="post", radius=0.01, length=0.06, axis=(0.3, 1, 0.2), density=1000.0, support=Free(damping=(0, 0)), friction=friction,
        water_mass=False,
    )  # fmt: skip
    block = Block(item, mass=5e-3, place=(0.03, 0.012, 0.0), velocity=(-0.5, 0.1, 0.05), radius=3e-3, stiffness=50.0, h=h)
    before = momenta(block)
    energy = 0.5 * block.mass * block.v @ block.v
    block.move(0.2)
    after = momenta(block)
    assert block.rows[0, Body.VELOCITY] < -1e-3, "they did not meet"
    assert abs(after[0] - before[0]).max() < 1e-12 * abs(before[0]).max()
    assert abs(after[1] - before[1]).max() < 1e-11 * abs(before[1]).max()
    assert 0.5 * block.mass * block.v @ block.v + kinetic_energy(block.rows[0]) < energy


def spin(row, rates):
    """Let a body spin at `rates` (rad/s) about its own directors."""
    inertia = 1 / row[Body.INVERSE_INERTIA : Body.INVERSE_INERTIA + 3]
    row[Body.MOMENTUM : Body.MOMENTUM + 3] = inertia * np.array(rates) @ row[Body.FRAME : Body.FRAME + 9].reshape(3, 3)


@pytest.mark.parametrize("size", [(0.02, 0.02, 0.02), (0.02, 0.02, 0.06), (0.02, 0.04, 0.06)], ids=["cube", "rod", "brick"])
def test_free_rotation_keeps_energy_and_angular_momentum(size):
    rows = rows_of([Box(name="top", size=size, density=1000.0, support=Free(damping=(0, 0)), water_mass=False)])
    spin(rows[0], (0.01, 5.0, 0.02))
    before, worst = kinetic_energy(rows[0]), 0.0
    for _ in range(10_000):
        for _ in range(2):
            drift_bodies(rows, 5e-4)
        straighten(rows[0])
        worst = max(worst, abs(kinetic_energy(rows[0]) / before - 1))
    frame = rows[0, Body.FRAME : Body.FRAME + 9].reshape(3, 3)
    assert worst < 1e-6
    assert abs(frame @ frame.T - np.eye(3)).max() < 1e-14


def test_free_rotation_is_second_order():
    def end(h):
        rows = rows_of([Box(name="top", size=(0.02, 0.04, 0.06), density=1000.0, support=Free(damping=(0, 0)), water_mass=False)])
        spin(rows[0], (1.0, 2.0, 3.0))
        for _ in range(round(1.0 / h)):
            drift_bodies(rows, h)
        return rows[0, Body.FRAME : Body.FRAME + 9].copy()

    exact = end(2.5e-4 / 4)
    errors = [abs(end(h) - exact).max() for h in (4e-3, 2e-3, 1e-3)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.1)


def swung(support, *, h=5e-4, duration=2.0, force=0.0):
    """A ball of 20 g over time, begun a millimetre off, at the usual step: the order of a plant's, with a `force` from what touches it."""
    rows = rows_of([Sphere(name="ball", radius=0.01, mass=0.02, support=support, water_mass=False)], step=h)
    rows[0, Body.POSITION] += 1e-3
    places, speeds = [], []
    drift_bodies(rows, 0.5 * h)
    for _ in range(round(duration / h)):
        kick_bodies(rows, h)
        push(rows[0], h * force, 0.0, 0.0, 0.0, 0.0, 0.0)
        drift_bodies(rows, 0.5 * h)
        places.append(rows[0, Body.POSITION])
        speeds.append(rows[0, Body.VELOCITY])
        drift_bodies(rows, 0.5 * h)
    return h * (1 + np.arange(len(places))), np.array(places), np.array(speeds)


@pytest.mark.parametrize("stiffness", [2.0, 100.0, 1e4])
@pytest.mark.parametrize("rate", [0.0, 5.0, 50.0])
def test_an_object_on_springs_swings_as_its_closed_form_at_the_usual_step(stiffness, rate):
    time, places, _ = swung(Springs(stiffness=stiffness, turning=0.0, damping=(rate, 0)))
    natural = complex(stiffness / 0.02 - rate**2 / 4) ** 0.5
    exact = 1e-3 * np.exp(-rate * time / 2) * (np.cos(natural * time) + rate / 2 / natural * np.sin(natural * time)).real
    np.testing.assert_allclose(places, exact, rtol=0, atol=3e-6)
    assert abs(exact).max() > 0.9e-3


@pytest.mark.parametrize("stiffness", [100.0, 1e5, 1e9, 1e15])
def test_an_object_on_springs_of_any_stiffness_comes_to_rest_where_forces_balance(stiffness):
    _, places, speeds = swung(Springs(stiffness=stiffness, turning=0.0), force=0.3)
    assert places[-1] * stiffness == pytest.approx(0.3, rel=1e-6, abs=1e-14 * stiffness)
    assert abs(speeds[-1]) < 1e-9


def test_an_axis_swings_about_where_springs_turn_it_to():
    support = Springs(stiffness=1.0, turning=0.16, damping=(0, 0))
    item = Capsule(name="post", radius=8e-3, length=0.08, axis=(1, 0, 0), mass=0.02, support=support, water_mass=False)
    (row,) = rows = rows_of([item], step=5e-4)
    natural = np.sqrt(0.16 / (0.02 * item.gyration[0]))
    row[Body.MOMENTUM + 2] = 1e-3 * natural / row[Body.INVERSE_INERTIA]
    drift_bodies(rows, 2.5e-4)
    for number in range(1, 4001):
        kick_bodies(rows, 5e-4)
        drift_bodies(rows, 5e-4)
        exact = 1e-3 * np.sin(natural * 5e-4 * (number + 0.5))
        assert row[Body.FRAME + 7] == pytest.approx(exact, abs=1e-5)


def test_damping_is_exact_at_any_step():
    item = Sphere(name="ball", radius=0.01, mass=5e-3, support=Free(damping=(50.0, 5.0)), water_mass=False)
    for h in (1e-2, 1e-3):
        rows = rows_of([item])
        rows[0, Body.VELOCITY], rows[0, Body.MOMENTUM] = 1.0, 1e-7
        for _ in range(round(0.1 / h)):
            kick_bodies(rows, h)
            drift_bodies(rows, h)
        assert rows[0, Body.VELOCITY] == pytest.approx(np.exp(-5.0), rel=1e-12)
        assert rows[0, Body.POSITION] == pytest.approx((1 - np.exp(-5.0)) / 50, rel=1e-12)
        assert rows[0, Body.MOMENTUM] == pytest.approx(1e-7 * np.exp(-0.5), rel=1e-12)


# Inertia of the solids, by integration over points


@pytest.mark.parametrize("item", SHAPES[:4], ids=IDS[:4])
def test_volume_and_inertia_are_those_of_the_solid(item):
    (row,), frame, bound = rows_of([item]), frame_of(item), item.bound
    grid = bound * np.random.default_rng(2).uniform(-1, 1, (60_000, 3))
    inside = grid[[distance(row, *point)[0] < 0 for point in np.asarray(item.position) + grid @ frame]]
    assert len(inside) / len(grid) * (2 * bound) ** 3 == pytest.approx(item.volume, rel=0.03)
    second = (inside**2).mean(axis=0)
    np.testing.assert_allclose(item.gyration, second.sum() - second, rtol=0.03)


# How an arm holds an object


def helix_round(item, turns, clearance, radius, count=400):
    """A centreline that winds `turns` times round a post, at rest and turned with it."""
    frame = frame_of(item)
    angle = 2 * pi * turns * np.linspace(0, 1, count + 1)
    away = item.radius + radius + clearance
    local = np.stack([away * np.cos(angle), away * np.sin(angle), np.linspace(-0.4, 0.4, count + 1) * item.length], axis=1)
    return (np.asarray(item.position) + local @ frame)[None], np.asarray(item.position)[None], frame[None]


@pytest.mark.parametrize("turns", [1.25, -0.7, 2.0])
def test_winding_counts_turns_and_only_what_touches_is_covered(turns):
    item, radius = SHAPES[1], 4e-3
    for clearance, covered in ((-1e-4, turns), (1.9e-3, turns), (2.1e-3, 0.0)):
        points, position, frame = helix_round(item, turns, clearance, radius)
        assert winding(points, position, frame)[0] == pytest.approx(turns, abs=1e-9)
        found = covered_winding(points, np.full(400, radius), item, position, frame)[0]
        assert found == pytest.approx(covered, abs=1e-9)


@pytest.mark.parametrize("count", [18, 25, 60])
def test_covered_winding_does_not_jump_by_elements(count):
    """A helix whose clearance grows along it, or that leaves the post's end: what is covered follows, between elements too."""
    item, radius = SHAPES[1], 4e-3
    angle = 2 * pi * 1.5 * np.linspace(0, 1, count + 1)
    frame = frame_of(item)
    for covered in np.linspace(0.4, 1.2, 7):
        for clearance, along in (
            (2e-3 * angle / (2 * pi) / covered, 0 * angle),
            (0 * angle, item.length / 2 * angle / (2 * pi) / covered),
        ):
            away = (item.radius + radius + clearance) / np.cos(pi * 1.5 / count)  # middles of chords lie at the clearance
            local = np.stack([away * np.cos(angle), away * np.sin(angle), along], axis=1)
            points = (np.asarray(item.position) + local @ frame)[None]
            found = covered_winding(points, np.full(count, radius), item, np.asarray(item.position)[None], frame[None])[0]
            assert found == pytest.approx(covered, abs=0.012)


def test_a_curl_beside_a_post_or_beyond_its_end_is_not_covered():
    item, radius = SHAPES[1], 4e-3
    points, position, frame = helix_round(item, 1.0, 0.0, radius)
    beyond = points + 0.06 * frame[:, None, 2]
    assert winding(beyond, position, frame)[0] == pytest.approx(1.0)
    assert abs(covered_winding(beyond, np.full(400, radius), item, position, frame)[0]) < 0.2
    beside = points + 0.05 * frame[:, None, 0]
    assert abs(winding(beside, position, frame)[0]) < 1e-9


# Objects that cannot be


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Sphere(name="ball", radius=0.0), "object 'ball': radius=0 m is outside > 0 m"),
        (lambda: Capsule(name="post", radius=0.01, length=-1.0), "object 'post': length=-1 m is outside > 0 m"),
        (lambda: Sphere(name="ball", radius=0.01, support=Free()), "object 'ball' can move but has no mass; give mass or density"),
        (lambda: Sphere(name="ball", radius=0.01, mass=1.0, density=2.0), "object 'ball' has a mass and a density; give one of them"),
        (
            lambda: Sphere(name="ball", radius=0.01, mass=1.0),
            "object 'ball' has a mass but nothing can move it; leave mass out, or use support Free() or Springs()",
        ),
        (lambda: Sphere(name="ball", radius=0.01, density=1.0, support=Moved(velocity=(0, 0, 1))), "has a density but nothing can move it"),
        (lambda: Plane(name="floor", axis=(0, 0, 0)), "object 'floor': axis is zero; give a direction, such as (0, 1, 0)"),
        (
            lambda: Sphere(name="ball", radius=0.01, position=(0, 0, float("nan"))),
            "object 'ball': position is (0, 0, nan); three finite numbers",
        ),
        (lambda: Sphere(name="ball", radius=0.01, friction=(0.1, 0.2)), "kinetic friction 0.2 is larger than static 0.1"),
        (lambda: Plane(name="floor", mass=1.0, support=Free()), "a plane cannot be moved by what touches it"),
    ],
)
def test_objects_that_cannot_be_are_refused(make, message):
    with pytest.raises(OctoctrlError) as found:
        make()
    assert message in str(found.value)
