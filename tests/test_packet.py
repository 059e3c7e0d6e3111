"""The packet of bending: its way against a bend that is known, and what is drawn of it."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import coil_execution

import octoctrl as oc
from octoctrl.files.configuration import PlanSettings
from octoctrl.judging.comparison import planned_points
from octoctrl.judging.packet import packet_of, packets
from octoctrl.pictures.kymograph import PANELS, kymograph, packet_picture
from octoctrl.pictures.motion import motion_of
from octoctrl.pictures.report import page
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.model.kinematics import element_stations
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.running.recording import Recording

SPEED, BROAD, STRONG = 0.08, 0.015, 0.3


@pytest.fixture(scope="module")
def travelling():
    """A Gaussian of bending strain that goes along the arm at an even speed, in one plane, on an arm of 120 elements."""
    arm = oc.Arm(elements=120)
    time, edges = np.linspace(0.0, 1.0, 41), arm.edges
    stations = element_stations(edges)
    middles = (stations[1:] + stations[:-1]) / 2
    radius = arm.base_radius * (1 - (1 - 1 / arm.taper) * middles / arm.length)
    place = 0.05 + SPEED * time
    curvature = STRONG * np.exp(-0.5 * ((middles - place[:, None]) / BROAD) ** 2) / radius
    angle = np.concatenate([np.zeros((len(time), 1)), np.cumsum(curvature * np.diff(stations), axis=1)], axis=1)
    along = np.stack([np.sin(angle), np.cos(angle), 0 * angle], axis=2)
    aside = np.stack([np.cos(angle), -np.sin(angle), 0 * angle], axis=2)
    frames = np.stack([np.broadcast_to([0.0, 0.0, 1.0], along.shape), aside, along], axis=2)
    points = np.concatenate([np.zeros((len(time), 1, 3)), np.cumsum(along[:, 1:-1] * np.diff(edges)[:, None], axis=1)], axis=1)
    shape = (len(time), arm.elements)
    recording = Recording(
        time=time, points=points, frames=frames, stations=stations, stretch=np.ones(shape), levels=np.zeros((len(time), 11, arm.elements))
    )
    return arm, recording, place


def test_the_packet_is_where_how_fast_how_wide_and_how_strong_it_was_made(travelling):
    arm, recording, place = travelling
    track = packet_of(recording, arm)
    np.testing.assert_allclose(track.position, place, atol=2e-4)
    np.testing.assert_allclose(track.speed, SPEED, rtol=0.02)
    np.testing.assert_allclose(track.width, BROAD, rtol=0.02)
    np.testing.assert_allclose(track.amplitude, STRONG, rtol=0.02)
    way = np.array([[np.interp(at, arm.edges, axis) for axis in points.T] for at, points in zip(place, recording.points, strict=True)])
    np.testing.assert_allclose(track.way, way, atol=3e-4)
    inner = slice(1, -1)
    pace = np.linalg.norm(way[2:] - way[:-2], axis=1) / (recording.time[2:] - recording.time[:-2])
    np.testing.assert_allclose(track.pace[inner], pace, rtol=0.03)


def test_the_goal_reads_the_same_place(travelling):
    arm, recording, place = travelling
    found = oc.goal("packet", value=0.05).miss(recording, None, arm)
    np.testing.assert_allclose(found, np.abs(packet_of(recording, arm).position - 0.05), rtol=0, atol=1e-15)
    assert found[-1] == pytest.approx(place[-1] - 0.05, abs=2e-4)


def test_planned_and_simulated_are_read_at_the_same_reading_of_the_clock(coil_plan):
    """A run that follows its plan to the letter has its packet, whatever the clock: one that stood still for a second, too."""
    run = coil_execution(coil_plan)
    planned, simulated = packets(run)
    np.testing.assert_allclose(planned.strain, simulated.strain, atol=0.02)
    waited = replace(run, clock=np.minimum(run.clock, 1.0))
    planned, _ = packets(waited)
    late = run.recording.time > 1.0
    np.testing.assert_allclose(planned.strain[late], np.broadcast_to(planned.strain[late][0], planned.strain[late].shape), atol=1e-9)
    motion = motion_of(waited)
    seen = planned_points(coil_plan, waited.clock[motion.chosen])
    np.testing.assert_allclose(motion.planned_points[:, -1], seen[:, -1], atol=1e-9)


def test_the_picture_shows_both_fields_their_difference_and_the_ways(coil_run, tmp_path):
    figure = kymograph(coil_run, tmp_path / "k.png")
    panels = figure.axes[: len(PANELS)]
    planned, simulated = packets(coil_run)
    fields = [axes.collections[0].get_array().data for axes in panels]
    np.testing.assert_array_equal(fields[0], planned.strain.T)
    np.testing.assert_array_equal(fields[1], simulated.strain.T)
    np.testing.assert_array_equal(fields[2], simulated.strain.T - planned.strain.T)
    assert [[line.get_label() for line in axes.lines if line.get_label().startswith("packet")] for axes in panels] == [
        ["packet, planned"], ["packet, simulated"], ["packet, planned", "packet, simulated"],
    ]  # fmt: skip
    assert (tmp_path / "k.png").stat().st_size > 10_000
    with pytest.raises(OctoctrlError, match=r"^the plan of 'coil' carries no shape to compare with; plan on the reduced model$"):
        kymograph(replace(coil_run, plan=replace(coil_run.plan, strains=np.empty((0, 8, 4)))))


def test_the_page_of_a_packet_tells_its_way(coil_plan, coil_run):
    """At the end of the phase that asks for it, and of no other; the same run gives the same picture."""
    assert "bending strain, planned" not in page([coil_run])
    first, *others = coil_plan.task.phases
    asked = replace(first, goals=(oc.goal("packet", value=0.1),))
    run = replace(coil_run, plan=replace(coil_plan, task=replace(coil_plan.task, phases=(asked, *others))))
    text = page([run])
    assert "bending strain, planned" in text
    _, simulated = packets(run)
    rows = text[text.index("Packet of bending") :].split("</table>")[0].split("<tr>")[2:]
    assert [row.count("<td>") for row in rows] == [7, 7] and all(f"<td>{first.name}</td>" in row for row in rows)
    at = 1e3 * np.interp(run.events[0].actual, simulated.time, simulated.position)
    assert f"<td>simulated</td><td>{at:.3g}</td>" in rows[1]
    assert packet_picture(*packets(run), 13.0, 76.0) == packet_picture(*packets(run), 13.0, 76.0)


def test_sixteen_sections_foresee_where_a_bend_is_and_eight_do_not():
    """A bend of a fifth of the arm, carried at 30 cm/s through water that hardly damps, on the rod, within 3 % of the length."""
    arm, scene = oc.Arm(), oc.tasks.programme("fig3a").scene
    carried = oc.CarriedBend(level=0.2, stretch=0.04, speed=0.3, offset=0.8, window=(0.02, 0.989 * arm.length))
    activation, duration = oc.Activation(templates=carried.templates(), composition="handover"), 1.8
    track = packet_of(oc.make_plant("rod", arm, scene).advance(activation, duration), arm)
    identified, off = load_identified(arm, scene), {}
    for sections in (8, 16):
        model = identified.divided(sections).model
        assert model.sections == sections and model.parameters == identified.model.parameters
        motion = model.respond(activation, duration, step=0.01)
        foreseen = packet_of(model.recording(motion.time, motion.strains), arm)
        position = np.interp(track.time, foreseen.time, foreseen.position)
        off[sections] = np.sqrt(np.mean((position - track.position)[track.time > 0.8] ** 2))
    assert off[16] < 0.03 * arm.length < off[8] and off[8] > 2 * off[16]


def test_a_task_says_into_how_many_sections_its_plan_divides_the_arm():
    plan = oc.plan("packet")
    assert plan.status.solved and plan.model.sections == 16 and plan.strains.shape[1:] == (16, 4)
    with pytest.raises(OctoctrlError, match=r"^sections=41 is outside 2…40$"):
        PlanSettings(sections=41)
