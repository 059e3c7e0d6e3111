"""Copying a motion that was measured: the goal of a shape, the task made of a centreline, and the motion that comes of it."""

from dataclasses import replace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.planners.asking.copying import copied
from octoctrl.planners.asking.goals.shape import ShapeGoal
from octoctrl.sim.errors import OctoctrlError


@pytest.fixture(scope="module")
def curl():
    """Half a second of twist and a second of bending on the rod, and the drives that made it."""
    task = oc.tasks.load("coil").task
    twist, bend = task.drives[:2]
    drives = (replace(twist, begins="1", ends=""), replace(bend, begins="2"))
    made = [replace(twist.primitive, window=(0.0, 0.1978)), replace(bend.primitive, window=(0.0, 0.1978), onset=0.6, rise=1.5)]
    plant = oc.make_plant("rod")
    recording = plant.advance(oc.Schedule(primitives=tuple(made), duration=2.0, composition="handover").activation(), 2.0)
    return oc.Centreline(time=recording.time, points=recording.points), drives, recording


def test_a_shape_is_missed_by_the_root_mean_square_of_its_distances(curl):
    centreline, _, recording = curl
    goal = copied(centreline, curl[1], times=[0.6, 2.0], points=4).phases[-1].goals[0]
    assert len(goal.value) == 4
    np.testing.assert_allclose(goal.value[-1], recording.points[-1, -1], atol=1e-9)
    arm = oc.Arm()
    trace = oc.topology_of(centreline).trace
    assert goal.miss(recording, trace, arm)[-1] < 2e-3  # points lie at shares of the stretched length
    moved = replace(goal, value=tuple((x + 0.003, y, z) for x, y, z in goal.value))
    away = [np.array(point) for point in moved.value]
    edges, last = arm.edges, recording.points[-1]
    places = arm.length * np.arange(1, 5) / 4
    there = np.stack([np.interp(places, edges, axis) for axis in last.T], axis=1)
    expected = np.sqrt(np.mean(np.sum(np.square(there - away), axis=1)))
    assert moved.miss(recording, trace, arm)[-1] == pytest.approx(expected, rel=1e-9)


def test_a_motion_is_copied_from_positions_alone(curl):
    """Within 5 % of the arm's length over the arm and the time, and its writhe within 0.08 turns, root mean squares."""
    centreline, drives, recording = curl
    plan = oc.plan(copied(centreline, drives, times=[0.6, 0.95, 1.3, 1.65, 2.0]), time_limit=600.0)
    assert plan.status.solved
    run = oc.execute(plan)
    times = np.linspace(0.0, 1.99, 40)

    def along(found):
        flat = found.points.reshape(len(found.time), -1)
        return np.stack([np.interp(times, found.time, column) for column in flat.T], axis=1).reshape(len(times), -1, 3)

    away = np.linalg.norm(along(run.recording) - along(recording), axis=2)
    assert np.sqrt(np.mean(away**2)) < 0.05 * 0.2
    wanted = oc.topology_of(centreline, pole=(0.0, 0.0, 1.0)).trace
    writhe = np.interp(times, run.trace.time, run.trace.lifted_writhe) - np.interp(times, wanted.time, wanted.lifted_writhe)
    assert np.sqrt(np.mean(writhe**2)) < 0.08


def test_what_cannot_be_copied_is_said(curl):
    centreline, drives, _ = curl
    with pytest.raises(
        OctoctrlError, match=r"^times \[0.1, 5.0\]: instants within the 2 s of the centreline are needed, at least 0.2 s apart$"
    ):
        copied(centreline, drives, times=[0.1, 5.0])
    with pytest.raises(OctoctrlError, match=r"points along the arm are needed"):
        ShapeGoal(value=())
