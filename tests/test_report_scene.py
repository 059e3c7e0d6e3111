"""What stands in space on the page of a run: rods of the full arm, objects with their recorded poses, and how they were held."""

import re
from dataclasses import replace
from math import inf

import numpy as np
import pytest
from conftest import coil_execution

import octoctrl as oc
from octoctrl.carrying.results import Check, Execution, ExecutionReport, Verdict
from octoctrl.pictures.contact import grips
from octoctrl.pictures.film import pictures
from octoctrl.pictures.motion import motion_of
from octoctrl.pictures.outlines import outlines
from octoctrl.pictures.plots import arm_camera
from octoctrl.pictures.report import page
from octoctrl.pictures.sections import checks_table, heading
from octoctrl.pictures.solids import mesh, solids
from octoctrl.pictures.strands import strand_layers
from octoctrl.sim.contact.measures import gaps
from octoctrl.sim.contact.surroundings import Touch
from octoctrl.sim.running.recording import StrandMotion
from octoctrl.sim.scene.objects import Box, Capsule, Cylinder, Plane, Sphere
from octoctrl.sim.scene.supports import Free, Springs
from octoctrl.sim.topology.measures import measure

PLACE, AXIS = (0.01, -0.02, 0.03), (0.3, 1.0, -0.4)
SHAPES = (
    Sphere(name="ball", radius=0.014, position=PLACE),
    Capsule(name="post", radius=0.01, length=0.05, position=PLACE, axis=AXIS),
    Cylinder(name="can", radius=0.012, length=0.03, position=PLACE, axis=AXIS),
    Box(name="brick", size=(0.02, 0.03, 0.05), position=PLACE, axis=AXIS),
    Plane(name="floor", position=PLACE, axis=AXIS),
)


@pytest.mark.parametrize("item", SHAPES, ids=[item.name for item in SHAPES])
def test_a_mesh_lies_on_the_surface_and_its_normals_and_triangles_look_outwards(item):
    vertices, normals, triangles = mesh(item, 0.2)
    home, frame = np.zeros((1, 3)), np.eye(3)[None]
    at = replace(item, position=(0.0, 0.0, 0.0))
    np.testing.assert_allclose(gaps(vertices[None], at, home, frame)[0], 0.0, atol=1e-9)
    outward = gaps((vertices + 1e-4 * normals)[None], at, home, frame)[0]
    np.testing.assert_allclose(outward, 1e-4, atol=2e-6)
    corners = vertices[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    whole = area > 1e-12
    assert np.einsum("kc,kc->k", across, normals[triangles].mean(axis=1))[whole].min() > 0
    if not isinstance(item, Plane):
        # The divergence theorem over a closed surface; chords of a fine mesh lose a little.
        enclosed = np.einsum("kc,kc->", corners[:, 0], across) / 6
        assert enclosed == pytest.approx(item.volume, rel=0.01) and enclosed <= item.volume * (1 + 1e-9)


@pytest.fixture(scope="module")
def grasp(coil_plan):
    """An arm that curls against a post and a free ball, as an execution."""
    objects = (
        Capsule(name="post <$x$>", radius=8e-3, length=0.08, position=(0.0, 0.07, -0.024), axis=(1, 0, 0)),
        Sphere(name="ball", radius=0.01, position=(0.0, 0.16, -0.03), support=Free(), density=1100.0),
        Box(name="far", size=(0.02, 0.02, 0.02), position=(0.1, 0.2, 0.0), support=Springs(), density=1100.0),
    )
    plan = replace(coil_plan, model=replace(coil_plan.model, scene=oc.Scene(objects=objects)))
    curl = oc.Activation(templates=(oc.Plateau(groups=("LM6", "LM7", "LM8"), level=0.2, rise=2.0, window=(0.05, 0.2)),))
    recording = oc.make_plant("rod", scene=plan.scene).advance(curl, 1.5)
    trace = measure(recording.time, recording.points, recording.frames, plan.task.convention)
    report = ExecutionReport(wall_time=1.0, time_step=1e-4, step_limit="bending")
    return Execution(plan=plan, recording=recording, trace=trace, clock=recording.time, feedback="open-loop", report=report)


def test_objects_stand_where_they_were_recorded(grasp):
    motion = motion_of(grasp)
    arrays, meshes = solids(grasp, motion.chosen)
    assert len(meshes) == 3
    touch = Touch.of(grasp.recording.series, "ball")
    np.testing.assert_allclose(arrays["object 1 place"], 1e3 * touch.position[motion.chosen])
    np.testing.assert_allclose(arrays["object 1 frame"].reshape(-1, 3, 3), touch.frame[motion.chosen])
    assert np.linalg.norm(np.diff(arrays["object 1 place"], axis=0)).max() > 0, "the arm pushes it"
    still = replace(grasp, recording=replace(grasp.recording, series={}))
    np.testing.assert_allclose(solids(still, motion.chosen)[0]["object 0 place"], np.tile([0.0, 70.0, -24.0], (len(motion.time), 1)))


def test_pictures_and_films_show_objects_where_they_were(grasp):
    camera, last = arm_camera(grasp.plan.task.convention.pole), len(grasp.recording.time) - 1
    assert np.linalg.norm(np.diff(Touch.of(grasp.recording.series, "ball").position[[0, last]], axis=0)) > 1e-3
    for index in (0, last):
        post, ball, far = outlines(grasp, index, camera)
        centre = camera[:2] @ (1e3 * Touch.of(grasp.recording.series, "ball").position[index])
        np.testing.assert_allclose(np.linalg.norm(ball - centre, axis=1), 10.0, rtol=0.02)
        assert np.ptp(post @ (camera[:2, 0] / np.linalg.norm(camera[:2, 0]))) == pytest.approx(
            80 * np.linalg.norm(camera[:2, 0]) + 16, rel=0.01
        )
        assert len(far) >= 4
    arms = oc.plot(grasp, overlap=True, snapshots=2).axes[0]
    assert len(arms.patches) == 2 * 2 * 3
    alone = replace(grasp, plan=replace(grasp.plan, model=replace(grasp.plan.model, scene=oc.Scene())))
    with_objects, without = (next(pictures(run, 1.0)) for run in (grasp, alone))
    assert (with_objects != without).any(axis=2).mean() > 0.01


def test_what_has_no_limit_is_told_and_not_counted(grasp):
    told = Verdict(checks=(Check(name="kept", value=0.1, limit=1.0), Check(name="bar.slip", value=0.02, limit=inf, unit="m")))
    assert told.count == (1, 1) and "(1/1)" in str(told)
    assert "passed: 1 of 1 checks are met" in heading([grasp], [told])
    assert "<td>bar.slip</td><td>0.02</td><td></td><td></td><td>m</td>" in checks_table(told)


def test_how_objects_were_held_is_that_of_the_recording(grasp):
    post, ball, far = grips(grasp)
    touch = Touch.of(grasp.recording.series, ball.name)
    np.testing.assert_array_equal(ball.normal_force, touch.normal_force)
    assert ball.covered is None and post.covered is not None
    assert np.abs(post.covered).max() <= np.abs(post.winding).max() + 1e-9
    time = grasp.recording.time
    first = ball.first_touch(time)
    assert touch.normal_force[time < first].max(initial=0.0) == 0 and touch.normal_force[time == first] > 0
    assert np.isnan(far.first_touch(time)) and far.deepest == 0.0
    text = page([grasp])
    assert re.search(rf"<td>ball</td><td>{first:.2f} s</td><td>{touch.normal_force.max():.3g} N</td>", text)
    assert re.search(r"<td>far</td><td>never</td>", text) and "post &lt;$x$&gt;" in text and "post <$x$>" not in text


@pytest.fixture(scope="module")
def full(coil_plan):
    """A run with the rods of the full arm at rest and lifted by 10 mm at its end."""
    strands = oc.make_plant("assembly-coarse").strands()
    run = coil_execution(coil_plan)
    lifted = {name: np.stack([points, points + np.array([0.0, 0.0, 0.01])]).astype(np.float32) for name, (points, _) in strands.items()}
    radius = {name: radius.astype(np.float32) for name, (_, radius) in strands.items()}
    return replace(run, strands=StrandMotion(time=np.array([0.0, run.recording.time[-1]]), points=lifted, radius=radius))


def test_rods_are_layers_at_the_instants_of_the_page(full):
    time = np.array([0.0, 1.5, 3.0])
    arrays, layers = strand_layers(full.strands, time)
    assert [layer["name"] for layer in layers] == ["nerve cord", "longitudinal", "oblique", "transverse"]
    places = arrays["longitudinal places"]
    np.testing.assert_allclose(
        places[:, ..., 2] - places[0, ..., 2], np.broadcast_to([[[0.0]], [[5.0]], [[10.0]]], places.shape[:3]), atol=1e-3
    )
    assert arrays["transverse radius"].shape == (1, 30, 9)
    text = page([full])
    assert re.search(r'data-layer="arm"> arm', text) and re.search(r'data-layer="oblique" checked', text)


def test_a_full_arm_has_a_page_below_two_megabytes_even_when_every_ring_moves_on_its_own(full):
    draw = np.random.default_rng(0)
    time = np.linspace(0.0, full.recording.time[-1], 120)
    points = {
        name: (rods[:1] + 5e-3 * np.sin(time + draw.uniform(0, 6, (*rods.shape[1:3], 3))[..., None]).transpose(3, 0, 1, 2)).astype(
            np.float32
        )
        for name, rods in full.strands.points.items()
    }
    run = replace(full, strands=StrandMotion(time=time, points=points, radius=full.strands.radius))
    assert len(page([run])) < 2e6


def test_a_notebook_shows_verdict_and_traces_and_the_page_in_a_frame(coil_run):
    shown = coil_run._repr_html_()
    assert "failed" in shown and "<svg" in shown and "writhe rms" in shown and "<script" not in shown
    made = oc.report(coil_run)
    assert made.text == page([coil_run]) and repr(made) == f"Page(<{len(made.text)} characters>)"
    framed = made._repr_html_()
    assert framed.startswith('<iframe srcdoc="&lt;!doctype html&gt;') and framed.count('"') == 4
    with pytest.raises(oc.OctoctrlError, match="at least one run"):
        oc.report([])
