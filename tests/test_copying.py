"""Copying a motion that was measured: the goal of a shape, the task made of a centreline, and the motion that comes of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.files.centreline import read_centreline
from octoctrl.files.configuration import parse
from octoctrl.files.toml_writing import toml_of
from octoctrl.planners.asking.copying import copied
from octoctrl.planners.asking.goals.measured import nodes
from octoctrl.planners.asking.goals.shape import ShapeGoal
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.running.recording import Recording


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


def test_the_rod_copies_a_coil_of_the_full_arm_from_positions_alone():
    """The shipped task in closed loop: within 5 % of the length over arm and time, writhe within 0.1 turns at any instant."""
    configuration = oc.tasks.load("copy")
    centreline = read_centreline(Path(oc.tasks.__file__).parent / "library" / "copy.csv")
    assert centreline.markers is None and centreline.length[0] == pytest.approx(0.2, rel=1e-3)
    run = oc.execute(oc.plan(configuration, time_limit=600.0, strict=True))
    verdict = oc.verify(run)
    assert verdict.passed, verdict
    times, edges = centreline.time, run.plan.arm.edges
    nodes = run.recording.points[np.abs(run.recording.time - times[:, None]).argmin(axis=1)]
    shares = np.linspace(0.0, 0.2, centreline.points.shape[1])
    found = np.stack([[np.interp(shares, edges, axis) for axis in points.T] for points in nodes]).transpose(0, 2, 1)
    assert np.sqrt(np.mean(np.sum((found - centreline.points) ** 2, axis=2))) < 0.05 * 0.2
    wanted = oc.topology_of(centreline, pole=(0.0, 0.0, 1.0)).trace
    writhe = np.interp(times, run.trace.time, run.trace.lifted_writhe) - np.interp(times, wanted.time, wanted.lifted_writhe)
    assert wanted.lifted_writhe[-1] < -2.8 and np.abs(writhe).max() < 0.1


def test_what_cannot_be_copied_is_said(curl):
    centreline, drives, _ = curl
    with pytest.raises(
        OctoctrlError, match=r"^times \[0.1, 5.0\]: instants within the 2 s of the centreline are needed, at least 0.2 s apart$"
    ):
        copied(centreline, drives, times=[0.1, 5.0])
    with pytest.raises(OctoctrlError, match=r"points along the arm are needed"):
        ShapeGoal(value=())


def test_a_shape_is_read_at_the_nodes_that_a_plant_has():
    """The full arm has others than the one rod; nodes follow from the stations."""
    edges = np.concatenate([[0.0], np.cumsum([0.01, 0.03, 0.02, 0.04])])
    stations = np.concatenate([[0.0], (edges[1:] + edges[:-1]) / 2, [0.1]])
    np.testing.assert_allclose(nodes(stations), edges, rtol=0, atol=1e-15)
    arm, time = oc.Arm(length=0.1, base_radius=0.006), np.zeros(1)
    points = np.stack([0 * edges, edges, 0 * edges], axis=1)[None]
    frames = np.broadcast_to(np.eye(3), (1, 6, 3, 3))
    recording = Recording(
        time=time, points=points, frames=frames, stations=stations, stretch=np.ones((1, 4)), levels=np.zeros((1, 11, 4))
    )  # fmt: skip
    goal = ShapeGoal(value=((0.0, 0.05, 0.0), (0.0, 0.1, 0.003)))
    assert goal.miss(recording, None, arm)[0] == pytest.approx(0.003 / 2**0.5, rel=1e-12)


TASK = """[task]
name = "wave"
[task.copy]
file = "line.csv"
times = [0.5, 1.0]
points = 2
[[task.drives]]
name = "bend"
primitive = "Bend"
begins = "1"
"""


def table(*, length=0.2, along=(0.0, 1.0, 0.0), base=(0.0, 0.0, 0.0), heading="time [s],point,x [mm],y [mm],z [mm]"):
    """A straight line whose tip goes 30 mm aside within a second."""
    lines = [heading]
    for time in (0.0, 1.0):
        for point, share in enumerate(np.linspace(0.0, 1.0, 5)):
            place = 1e3 * (np.array(base) + share * length * np.array(along)) + [30.0 * share**2 * time, 0.0, 0.0]
            lines.append(f"{time},{point},{','.join(f'{number:.6f}' for number in place)}")
    return "\n".join(lines)


def test_a_task_file_names_its_table(tmp_path, monkeypatch):
    """The path counts from the task file; phases end at the times, with shapes between the measured ones; nothing of the table is lost."""
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "line.csv").write_text(table())
    (tmp_path / "there" / "wave.toml").write_text(TASK)
    monkeypatch.chdir(tmp_path)
    found = oc.tasks.load("there/wave.toml")
    assert [(phase.name, phase.duration, phase.longest) for phase in found.task.phases] == [("1", 0.5, 0.5), ("2", 0.5, 0.5)]
    half, whole = (phase.goals[0].value for phase in found.task.phases)
    np.testing.assert_allclose(half, [[0.00375, 0.1, 0.0], [0.015, 0.2, 0.0]], atol=6e-4)
    np.testing.assert_allclose(whole[-1], [0.03, 0.2, 0.0], atol=1e-9)
    assert parse(toml_of(found)) == found  # which stands for itself, without the table
    points = oc.tasks.load("there/wave.toml", overrides=["task.copy.points=3"]).task.phases[0].goals[0].value
    assert len(points) == 3


@pytest.mark.parametrize(
    ("text", "rows", "message"),
    [
        (TASK, None, "w.toml:4 task.copy.file: {folder}/line.csv does not exist"),
        (TASK, "time [s],point,x [mm],y [mm]\n0,0,0,0", "w.toml:4 task.copy.file: {folder}/line.csv has no column z (found: time [s], point, x [mm], y [mm]); time, point, x, y, z are needed"),
        (TASK, table(heading="time,point,x,y,z"), "w.toml:4 task.copy.file: {folder}/line.csv does not say its unit of length; write it into the headings, as in 'x [mm]', or give unit='mm'"),
        (TASK, table(length=0.31), "w.toml:4 task.copy.file: the centreline is 310 mm long at first, the arm 200 mm; scale the positions, or give arm.length what was measured"),
        (TASK, table(base=(0.05, 0.0, 0.0)), "w.toml:4 task.copy.file: the centreline begins at (50, 0, 0) mm in the direction (0, 1, 0); the arm's base is at the origin and leaves it along +y: shift and turn the positions"),
        (TASK, table(along=(0.0, 0.0, 1.0)), "w.toml:4 task.copy.file: the centreline begins at (0, 0, 0) mm in the direction (0, 0, 1); the arm's base is at the origin and leaves it along +y: shift and turn the positions"),
        (TASK.replace("0.5, 1.0", "1.0, 0.5"), table(), "w.toml:5 task.copy.times: times [1.0, 0.5]: instants within the 1 s of the centreline are needed, at least 0.2 s apart"),
        (TASK.replace("points = 2", "points = 0"), table(), "w.toml:6 task.copy.points: points=0 is outside >= 1"),
        (TASK.replace("points", "pionts"), table(), "w.toml:6 task.copy.pionts: unknown key; did you mean 'points'? (known: file, times, points, tolerance)"),
        (TASK.replace('file = "line.csv"', ""), table(), "w.toml:3 task.copy: 'file' is missing"),
        (TASK + '[[task.phases]]\nname = "a"\nduration = 1.0\n', table(), "w.toml:11 task.phases: phases follow from task.copy; leave one of them out"),
    ],
    ids=range(11),
)  # fmt: skip
def test_a_table_that_cannot_be_copied_is_said(tmp_path, text, rows, message):
    (tmp_path / "w.toml").write_text(text)
    if rows is not None:
        (tmp_path / "line.csv").write_text(rows)
    with pytest.raises(OctoctrlError) as caught:
        oc.tasks.load(tmp_path / "w.toml")
    assert str(caught.value) == message.format(folder=tmp_path)
