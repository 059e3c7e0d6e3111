"""The arm as one rod among objects: what it may not change, conservation, restart, what is recorded."""

from dataclasses import replace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS
from octoctrl.sim.contact.columns import Body, Note
from octoctrl.sim.contact.measures import covered_winding, gaps
from octoctrl.sim.contact.near_kernels import LEAST_MARGIN, START, SWELLING, look
from octoctrl.sim.contact.surroundings import Touch
from octoctrl.sim.contact.world import World, points_of
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.findings import Finding
from octoctrl.sim.rod.layout import Row, stride_for
from octoctrl.sim.rod.section_kernels import MAJORANT, section_kernels
from octoctrl.sim.scene.objects import Box, Capsule, Plane, Sphere, frame_of
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.scene.supports import Free, Moved, Push

POST = Capsule(name="post", radius=8e-3, length=0.08, position=(0.0, 0.07, -0.022), axis=(1, 0, 0))
CURL = oc.Activation(templates=(oc.Plateau(groups=("LM6", "LM7", "LM8"), level=0.3, rise=1.0, window=(0.05, 0.2)),))
WRAP = oc.Activation(templates=(oc.Plateau(groups=("LM6", "LM7", "LM8"), level=0.3, rise=3.0, window=(0.05, 0.2)),))
"""The same, slowly: a grasp that does not depend on how the arm was thrown at the post."""


def plant(*objects, **options):
    return oc.make_plant("rod", scene=Scene(objects=objects), **options)


@pytest.fixture(scope="module")
def touched():
    return plant(POST).advance(WRAP, 5.0)


def radius_of(arm):
    return np.asarray(arm.section((arm.edges[1:] + arm.edges[:-1]) / 2).outer_radius)


def test_an_object_out_of_reach_changes_no_bit():
    alone, beside = plant().advance(CURL, 0.5), plant(replace(POST, position=(0.5, 0.5, 0.5))).advance(CURL, 0.5)
    for name in ("points", "frames", "stretch"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(beside, name))
    assert not alone.series and not Touch.of(beside.series, "post").normal_force.any()


def test_nobody_looks_for_what_cannot_come_near_and_notes_of_what_stands_still_are_whole():
    away = replace(POST, name="away", position=(0.3, 0.1, 0.0))
    whole, piecewise = (plant(away, POST, record_every=1) for _ in range(2))
    run = whole.advance(CURL, 1.0)
    # A new call looks at its begin.
    pieces = [piecewise.advance(CURL, piecewise.sample_interval) for _ in range(200)]
    for name in ("away", "post"):
        ours, theirs = run.series[f"touch {name}"], np.concatenate([piece.series[f"touch {name}"][1:] for piece in pieces])
        np.testing.assert_array_equal(ours[1:], theirs)
        np.testing.assert_array_equal(ours[:, : Note.FORCE], np.broadcast_to(ours[0, : Note.FORCE], ours[:, : Note.FORCE].shape))
    np.testing.assert_array_equal(run.points[-1], pieces[-1].points[-1])
    first = int(np.flatnonzero(Touch.of(run.series, "post").loaded)[0])
    assert 100 < first < 200  # within a chunk, after the first


def test_a_lease_is_the_time_in_which_the_clearance_can_be_crossed():
    points = points_of(np.linspace(0, 0.2, 11), np.full(10, 5e-3))
    world = World.of(points, (Sphere(name="ball", radius=0.02, position=(0.1, 0.1, 0.0)),)).with_room(1)
    world.places[1], world.places[3] = np.linspace(0, 0.2, world.places.shape[1]), 5e-3
    for fastest in (0.0, 0.03, 0.5):
        look(world, fastest, 5e-3)
        time, margin = world.lease[0], max(LEAST_MARGIN, 1.5 * 5e-3 * fastest)
        assert 2 * fastest * time + START * time**2 == pytest.approx(0.1 - 0.02 - SWELLING * 5e-3 - margin) and time > 0
    world.bodies[0, Body.MOVING] = 1.0
    look(world, 0.0, 5e-3)
    assert world.lease[0] == 0.0
    close, far = (Sphere(name=f"ball at {x}", radius=0.02, position=(x, 0.2, 0.0)) for x in (0.025, 0.5))
    for balls in ((close, far), (far, close)):
        near = World.of(points, balls).with_room(1)
        near.places[:] = world.places
        look(near, 0.0, 5e-3)
        assert near.lease[0] == 0.0 and near.counts.sum() > 0


def test_the_arm_lies_on_the_post_and_not_in_it(touched):
    touch, arm = Touch.of(touched.series, "post"), oc.Arm.octopus()
    middle = (touched.points[:, 1:] + touched.points[:, :-1]) / 2
    depth = radius_of(arm) / np.sqrt(touched.stretch) - gaps(middle, POST, touch.position, touch.frame)
    # 1 % of the base radius.
    assert depth.max() < 0.14e-3 and touch.deepest.max() < 0.14e-3
    assert touch.normal_force[-1] > 0.01 and touch.loaded[-1] > 3
    assert covered_winding(touched.points, radius_of(arm), POST, touch.position, touch.frame)[-1] < -0.6


FLICK = oc.Activation(templates=(oc.Wave(groups=("LM7", "LM8", "LM1"), level=0.2975, speed=0.1325, width=3e-3, window=(0.092, 0.2)),))
STRUCK = Capsule(name="post", radius=9.6e-3, length=0.08, position=(0.0155, 0.0648, -0.0264), axis=(-0.919, 0.118, -0.02))
"""A post that the light tip of the arm is thrown against, and pulled on by the rest of it within the step."""


def test_a_step_that_lets_a_point_sink_in_is_taken_again_in_parts():
    limit = 0.01 * float(oc.Arm.octopus().section(0.0).outer_radius)
    made = plant(STRUCK)
    assert made.core._around.world.bearable == pytest.approx(0.9 * limit), "what the spring explains comes on top of it"
    once = plant(STRUCK, dt=made.h, sample_interval=made.sample_interval).advance(FLICK, 1.2)
    found = made.advance(FLICK, 1.2)
    assert Touch.of(once.series, "post").deepest.max() > 1.5 * limit and once.finer == 0
    assert Touch.of(found.series, "post").deepest.max() < limit and 0 < found.finer == made.retried < 40


def test_a_run_with_finer_samples_goes_on_bit_by_bit():
    whole, cut = plant(STRUCK).advance(FLICK, 1.2), plant(STRUCK)
    parts = [cut.advance(FLICK, duration) for duration in (0.865, 0.01, 0.325)]
    np.testing.assert_array_equal(parts[-1].points[-1], whole.points[-1])
    assert sum(part.finer for part in parts) == whole.finer


def test_an_object_that_is_soft_on_purpose_may_be_sunk_into():
    found = plant(replace(POST, stiffness=1e4)).advance(CURL, 1.5)
    assert Touch.of(found.series, "post").deepest.max() > 0.3e-3 and found.finer == 0


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.5])
def test_a_held_grasp_comes_to_rest(friction):
    """At the usual step; with much friction it takes some seconds until nothing slips any more."""
    held, speeds = plant(replace(POST, friction=(friction, friction))), []
    held.advance(WRAP, 8.5)
    for _ in range(20):
        run = held.advance(WRAP, 0.01)
        speeds.append((held.observe().velocities ** 2).sum(axis=1).mean())
    assert np.sqrt(np.mean(speeds)) < 0.3e-3
    assert Touch.of(run.series, "post").normal_force[-1] > 0.01


def test_muscles_answer_what_contact_adds_to_the_velocities_as_they_answer_a_kick():
    """The dense form of the implicit step: (1/viscosity + B w B') p = B dv, and w B' p taken away; the same for spins, joint by joint."""
    held = plant(POST)
    held.advance(WRAP, 3.0)
    core = held.core
    n, rows, count = core.elements, core.rows, np.uint64(core.elements)
    *_, remember, brake, relax, keep, answer = section_kernels(stride_for(n), core.arm.layout)
    nodes, inside = slice(1, n + 2), slice(1, n + 1)

    def velocities():
        return rows[Row.V1 : Row.V3 + 1, nodes].T.copy(), rows[Row.W1 : Row.W3 + 1, inside].T.copy()

    remember(core.buffer, count)
    brake(core.buffer, count)
    tangent, length, w = rows[Row.T1 : Row.T3 + 1, nodes].T, rows[Row.LENGTH, inside].copy(), rows[Row.NODE_MOBILITY, nodes].copy()
    yields, joints = rows[Row.YIELD, inside].copy(), rows[Row.DIAGONAL_TURN, inside].copy()
    stiff = MAJORANT * rows[Row.STIFF, inside] / length
    relax(core.buffer, count)
    before = velocities()
    keep(core.buffer, count)
    draw = np.random.default_rng(5)
    added = draw.normal(scale=0.1, size=(n + 1, 3)), draw.normal(scale=5.0, size=(n, 3))
    added[0][0] = 0.0
    rows[Row.V1 : Row.V3 + 1, nodes] += added[0].T
    rows[Row.W1 : Row.W3 + 1, inside] += added[1].T
    answer(core.buffer, count)
    after = velocities()

    along = np.zeros((n, n + 1, 3))
    for k in range(n):
        along[k, k], along[k, k + 1] = -tangent[k], tangent[k]
    flat = along.reshape(n, -1)
    matrix = np.diag(1 / stiff) + (flat * np.repeat(w, 3)) @ flat.T
    expected = before[0] + added[0] - w[:, None] * (np.linalg.solve(matrix, flat @ added[0].ravel()) @ flat).reshape(n + 1, 3)
    np.testing.assert_allclose(after[0], expected, atol=1e-12)

    frames = rows[Row.Q11 : Row.Q33 + 1, inside].T.reshape(n, 3, 3)
    spins = np.einsum("kji,kj->ki", frames, added[1])
    apart = np.eye(n) - np.eye(n, k=-1)  # of a joint: the element behind it less that before it; the first joint's is the held base
    matrix = apart @ np.diag(yields) @ apart.T
    np.fill_diagonal(matrix, joints)
    spins -= yields[:, None] * (apart.T @ np.linalg.solve(matrix, apart @ spins))
    np.testing.assert_allclose(after[1], before[1] + np.einsum("kij,kj->ki", frames, spins), atol=1e-9)


def test_a_grasp_presses_evenly(touched):
    touch = Touch.of(touched.series, "post")
    late = touched.time > 4.5
    assert np.ptp(touch.normal_force[late]) < 0.02 * touch.normal_force[-1]


def test_forces_are_those_that_turn_the_arm_aside(touched):
    """Without the post the same muscles take the arm elsewhere; the sum of the normal forces bounds the force."""
    touch = Touch.of(touched.series, "post")
    assert np.linalg.norm(plant().advance(WRAP, 5.0).points[-1] - touched.points[-1], axis=1).max() > 4e-3
    assert (np.linalg.norm(touch.force, axis=1) <= 1.0001 * np.hypot(1, 0.1) * touch.normal_force + 1e-12).all()


@pytest.mark.parametrize("options", [{"dt": 0.25e-3}, {"elements": 96}, {"stiffness": 4e7}], ids=["step", "elements", "stiffness"])
def test_a_grasp_does_not_depend_on_step_elements_and_stiffness(touched, options):
    arm, item = oc.Arm.octopus(elements=options.get("elements", 48)), replace(POST, stiffness=options.get("stiffness", POST.stiffness))
    again = oc.make_plant("rod", arm, Scene(objects=(item,)), dt=options.get("dt", "auto")).advance(WRAP, 5.0)
    found = [covered(run, shape) for run, shape in ((touched, oc.Arm.octopus()), (again, arm))]
    assert found[1] == pytest.approx(found[0], abs=0.05)


def covered(run, arm):
    touch = Touch.of(run.series, "post")
    return covered_winding(run.points, radius_of(arm), POST, touch.position, touch.frame)[-1]


def test_restart_in_contact_is_bit_exact(tmp_path):
    unbroken = plant(POST)
    unbroken.advance(CURL, 1.2)
    unbroken.save(tmp_path / "state.npz")
    expected = unbroken.advance(CURL, 0.3)
    other = plant(POST)
    other.load(tmp_path / "state.npz")
    found = other.advance(CURL, 0.3)
    for name in ("points", "frames", "stretch"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    for name, values in expected.series.items():
        np.testing.assert_array_equal(found.series[name], values)
    assert Touch.of(found.series, "post").normal_force[0] > 0, "not in contact"
    with pytest.raises(OctoctrlError, match="objects"):
        plant().load(tmp_path / "state.npz")


def test_a_state_is_come_back_to_with_the_thickness_that_the_arm_has_there():
    """Shortened by a quarter it is thicker by a seventh than at rest: whoever took it to be as thin as that would look away too long."""
    short, all_along = oc.Activation(templates=(oc.Plateau(groups=LONGITUDINAL_GROUPS, level=0.5, rise=0.5),)), plant(POST)
    all_along.advance(short, 1.0)
    state = all_along.state()
    all_along.advance(short, all_along.sample_interval)
    world, again = all_along.core._around.world, plant(POST)
    again.restore(state)
    again.advance(short, again.sample_interval)
    assert world.places[3].mean() > 1.1 * world.points.radius.mean()
    for name in ("places", "slack", "counts"):
        np.testing.assert_array_equal(getattr(again.core._around.world, name), getattr(world, name))


def test_a_free_object_receives_what_the_arm_gives():
    """Its momentum is the integral of the recorded force."""
    ball = Sphere(name="ball", radius=0.01, position=(0.0, 0.12, -0.032), mass=0.02, support=Free(damping=(0.0, 0.0)), water_mass=False)
    run = plant(ball, record_every=1).advance(CURL, 0.9)
    touch = Touch.of(run.series, "ball")
    impulse = np.concatenate([[np.zeros(3)], np.cumsum(touch.force[1:], axis=0) * np.diff(run.time)[:, None]])
    assert np.abs(touch.velocity[-1]).max() > 1e-3, "it was not touched"
    np.testing.assert_allclose(0.02 * touch.velocity, impulse, atol=1e-12)


def test_an_object_is_let_go_at_its_time():
    item = replace(POST, density=200.0, support=Free(since=1.2))
    run = plant(item, record_every=1).advance(CURL, 1.6)
    place = Touch.of(run.series, "post").position
    held = run.time <= 1.2 + 1e-9
    assert not np.ptp(place[held], axis=0).any() and np.ptp(place[~held], axis=0).max() > 1e-4
    pieces = plant(item, record_every=1)
    parts = [pieces.advance(CURL, 0.8) for _ in range(2)]
    np.testing.assert_array_equal(parts[1].points[-1], run.points[-1])


def test_points_are_close_enough_for_thin_objects():
    arm = oc.Arm.octopus()
    for thin in (3e-3, 14e-3, np.inf):
        points = points_of(arm.edges, radius_of(arm), thin)
        place = arm.edges[points.element.astype(int) - 1] + points.share * np.diff(arm.edges)[points.element.astype(int) - 1]
        apart, middle = np.diff(place), (points.radius[1:] + points.radius[:-1]) / 2
        assert (apart**2 / (8 * (middle + thin))).max() < 0.0125 * middle.max()
        assert points.length.sum() == pytest.approx(arm.length)
    assert len(points.share) == arm.elements


@pytest.mark.parametrize(
    ("item", "said"),
    [
        (replace(POST, position=(0.0, 0.09, -0.01)), "object 'post' overlaps the arm at rest by"),
        (Box(name="box", size=(0.05, 0.05, 0.05), position=(0.0, 0.1, 0.0)), "object 'box' overlaps the arm at rest by"),
        (Plane(name="wall", position=(0.0, 0.1, 0.0), axis=(0, -1, 0)), "object 'wall' overlaps the arm at rest by"),
    ],
)
def test_objects_in_the_arm_are_refused_before_the_run(item, said):
    with pytest.raises(OctoctrlError, match=said):
        plant(item)


def test_two_objects_of_one_name_are_refused():
    with pytest.raises(OctoctrlError, match="two objects are called 'post'"):
        Scene(objects=(POST, POST))


def test_a_floor_stops_the_arm():
    floor = Plane(name="floor", position=(0.0, 0.0, -0.03), axis=(0, 0, 1))
    run = plant(floor).advance(CURL, 2.0)
    # The tip alone would go 38 mm down; its own radius counts.
    assert run.points[:, :, 2].min() > -0.03
    assert Touch.of(run.series, "floor").force[-1, 2] < 0


TABLE = """
[[scene.objects]]
kind = "capsule"
name = "post"
radius = "8 mm"
length = "80 mm"
position = ["0 mm", "70 mm", "-22 mm"]
axis = [1, 0, 0]
support = { kind = "free", since = "4 s" }
density = "0.105 g/cm^3"
"""


def test_objects_of_a_task_file():
    from octoctrl.files.configuration import parse
    from octoctrl.files.toml_writing import toml_of

    text = toml_of(oc.tasks.load("coil"))
    found = parse(text + TABLE)
    assert found.scene.objects == (replace(POST, density=105.0, support=Free(since=4.0)),)
    assert parse(toml_of(found)) == found
    with pytest.raises(OctoctrlError, match=r"scene.objects\[0\].kind: unknown kind 'capsul'; did you mean 'Capsule'"):
        parse(text + TABLE.replace("capsule", "capsul"))
    with pytest.raises(OctoctrlError, match="object 'post' can move but has no mass; give mass or density"):
        parse(text + TABLE.replace('density = "0.105 g/cm^3"', ""))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"free", since', '"fixed", since', "scene.objects[0].support.since: unknown key"),
        ('kind = "free", ', "", "scene.objects[0].support.since: Fixed has no 'since'; say kind = 'Free'"),
        ("scene.objects", "objects", "objects: unknown key; did you mean 'scene.objects'? (known: "),
        ("g/cm^3", "lb/ft^3", "scene.objects[0].density: unit 'lb/ft^3' not known; use kg/m^3, g/cm^3"),
        ('kind = "capsule"', 'kind = "mesh"', "scene.objects[0]: 'file' is missing"),
    ],
)
def test_what_is_wrong_with_an_object_of_a_task_file(old, new, said, tmp_path):
    from octoctrl.files.toml_writing import toml_of

    (tmp_path / "task.toml").write_text(toml_of(oc.tasks.load("coil")) + TABLE.replace(old, new))
    with pytest.raises(OctoctrlError) as raised:
        oc.tasks.load(tmp_path / "task.toml")
    assert said in str(raised.value)


@pytest.mark.parametrize(
    "astray",
    [
        {"support": Moved(velocity=(-100.0, 0.0, 0.0)), "position": (1.0, 0.1, 0.0)},
        {"support": Free(), "mass": 0.01, "pushes": (Push(force=(-100.0, 0.0, 0.0)),)},
        {"support": Moved(spin=(1e300, 0.0, 0.0))},
    ],
    ids=["told to", "pushed", "spun"],
)
def test_what_goes_too_fast_or_nowhere_stops_the_run(astray):
    """It would pass through the arm between two steps, or no longer be seen."""
    ball = Sphere(**{"name": "ball", "radius": 8e-3, "position": (0.03, 0.1, 0.0)} | astray)
    moving = plant(ball, record_every=1)
    with pytest.raises(
        PlantUnstableError, match=r"object 'ball' goes faster than 10 m/s, or where no number says; it could pass"
    ) as caught:
        moving.advance(CURL, 0.5)
    kept = caught.value.recording
    assert moving.time == 0 and np.isfinite(kept.series["touch ball"]).all() and kept.time[-1] < caught.value.time


def test_what_is_pressed_through_the_base_is_told_by_what_stops_it_at_the_finest_step():
    """Not by how deep it sinks in at the whole one, for that alone stops nothing."""
    pressing = plant(Plane(name="floor", position=(0.0, 0.0, -0.015), support=Moved(velocity=(0.0, 0.0, 0.1))))
    with pytest.raises(PlantUnstableError) as raised:
        pressing.advance(oc.Activation(), 1.0)
    assert raised.value.stop.finding not in (Finding.FINE, Finding.SUNK)
    assert "sinks" not in str(raised.value)


def test_the_length_of_an_axis_says_nothing():
    usual, tiny, vast = (frame_of(replace(POST, axis=(size, size, 0.0))) for size in (1.0, 1e-200, 1e200))
    np.testing.assert_array_equal(usual, tiny)
    np.testing.assert_array_equal(usual, vast)
