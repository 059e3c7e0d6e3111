"""The rods of the full arm as they are kept for pictures: against the plant's own nodes, and through a run and its file."""

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.carrying.execution import execute
from octoctrl.carrying.results import ExecutionStatus
from octoctrl.files.store import load, save
from octoctrl.progress import NullProgress
from octoctrl.sim.running.recording import StrandMotion


@pytest.fixture(scope="module")
def moved():
    plant = oc.make_plant("assembly-coarse")
    plant.advance(oc.Activation(templates=(oc.Plateau(groups=("LM1", "R-OM"), level=0.3, rise=0.01),)), 0.02)
    return plant


def test_strands_are_the_plants_own_nodes_from_end_to_end(moved):
    straight, oblique, rings = moved.core.nodes()
    strands = {family: points for family, (points, _) in moved.strands().items()}
    assert {family: len(points) for family, points in strands.items()} == {
        "nerve cord": 1,
        "longitudinal": 8,
        "oblique": 8,
        "transverse": 30,
    }
    for family, own in (("nerve cord", straight[:1]), ("longitudinal", straight[1:]), ("oblique", oblique)):
        np.testing.assert_array_equal(strands[family][:, [0, -1]], own[:, [0, -1]])
        assert (strands[family][:, :, None] == own[:, None]).all(axis=3).any(axis=2).all()
    np.testing.assert_array_equal(strands["transverse"][:, 0], strands["transverse"][:, -1])
    np.testing.assert_array_equal(strands["transverse"][[0, -1], :-1], rings[[0, -1]])


def test_radii_belong_to_the_nodes(moved):
    geometry, strands = moved.core.geometry, moved.strands()
    for points, radius in strands.values():
        assert radius.shape == points.shape[:2] and radius.min() > 0
    np.testing.assert_array_equal(strands["longitudinal"][1][:, [0, -1]], geometry.straight.radius[1:, [0, -1]])
    np.testing.assert_array_equal(
        strands["transverse"][1][:, 0], geometry.rings.radius[np.unique(np.round(np.linspace(0, 179, 30)).astype(int)), 0]
    )


def test_an_arm_of_one_rod_has_none():
    assert oc.make_plant("rod").strands() == {}


def test_places_between_instants_lie_between():
    points = np.arange(24, dtype=np.float32).reshape(2, 2, 2, 3)
    motion = StrandMotion(time=np.array([1.0, 3.0]), points={"a": points}, radius={"a": np.ones((2, 2), dtype=np.float32)})
    found = motion.at(np.array([0.0, 1.0, 1.5, 3.0, 9.0]))["a"]
    for index, share in enumerate((0.0, 0.0, 0.25, 1.0, 1.0)):
        np.testing.assert_allclose(found[index], points[0] + share * 12)
    single = StrandMotion(time=np.array([1.0]), points={"a": points[:1]}, radius={})
    np.testing.assert_array_equal(single.at(np.array([0.0, 2.0]))["a"], points[[0, 0]])


def test_a_run_keeps_them_at_the_ends_of_its_periods_and_so_does_its_file(coil_plan, tmp_path):
    class Stop(NullProgress):
        def advance(self, seconds, text=""):
            raise KeyboardInterrupt

    run = execute(coil_plan, feedback="open-loop", plant="assembly-coarse", progress=Stop())
    assert run.status is ExecutionStatus.INTERRUPTED
    np.testing.assert_allclose(run.strands.time, [0.0, 0.025])
    cord = run.strands.points["nerve cord"]
    np.testing.assert_allclose(cord[:, 0, [0, -1]], run.recording.points[[0, -1]][:, [0, -1]], atol=1e-8)
    assert load(save(tmp_path / "run.npz", run)) == run
