"""The state of a plant: copies are plants of their own, time ends where it was asked to, files continue bit by bit or are refused."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.files.configuration import parse
from octoctrl.files.toml_writing import toml_of
from octoctrl.sim.assembly.buffer import new_assembly, set_rest
from octoctrl.sim.assembly.geometry import assembly_geometry, assembly_grid
from octoctrl.sim.body.arm import LumpedSection
from octoctrl.sim.body.squid import SquidTentacle
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.findings import Finding, Stop
from octoctrl.sim.plants import make_plant
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.sources import Strike

BEND = oc.Activation(templates=(oc.Plateau(groups=("LM1", "LM2", "LM8"), level=0.3),))
MAKE = {
    "rod": (lambda: make_plant("rod"), BEND),
    "assembly-coarse": (lambda: make_plant("assembly-coarse"), BEND),
    "squid": (lambda: make_plant("assembly", SquidTentacle(), Scene(water=None), sample_interval=5e-4), Strike()),
}
WAYS = {
    "deepcopy": copy.deepcopy,
    "copy of a copy": lambda plant: copy.deepcopy(copy.deepcopy(plant)),
    "pickle": lambda plant: pickle.loads(pickle.dumps(plant)),
}


def later(plant, source, samples=4):
    return plant.advance(source, samples * plant.sample_interval)


# Copies


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", MAKE)
def test_a_copy_is_a_plant_of_its_own(kind, way):
    make, source = MAKE[kind]
    plant = make()
    later(plant, source)
    twin = WAYS[way](plant)
    assert twin.time == plant.time and twin.observe() == plant.observe()
    expected = later(plant, source)
    seen = plant.observe()
    found = later(twin, source)
    assert found == expected and twin.observe() == seen
    later(twin, source)
    assert plant.observe() == seen and twin.observe() != seen, "moving one leaves the other where it was"
    twin.reset()
    assert plant.observe() == seen and np.abs(twin.observe().points[:, [0, 2]]).max() < 1e-12


def test_the_example_of_the_bent_arm():
    plant = oc.Plant(oc.Arm.octopus(lumped=LumpedSection.published()))
    plant.advance(BEND, 0.5)
    twin = copy.deepcopy(plant)
    twin.advance(BEND, 0.5)
    assert twin.observe().points[-1] == pytest.approx([0.0632, 0.0249, 0.0], abs=2e-4)


def test_a_copied_buffer_of_an_assembly_keeps_its_views():
    arm = oc.Arm.octopus()
    geometry = assembly_geometry(arm, assembly_grid(arm, None, 8))
    rods = new_assembly(geometry)
    set_rest(rods, geometry)
    twin = copy.deepcopy(rods)
    twin.open_rods[0, 3] = 7.0
    assert (
        not np.shares_memory(twin.flat, rods.flat)
        and np.shares_memory(twin.open_rods, twin.flat)
        and np.shares_memory(twin.rings, twin.flat)
    )
    assert (twin.flat == 7.0).sum() == 1 and not (rods.flat == 7.0).any()


def tip_after(plant):
    plant.advance(BEND, 0.02)
    return plant.observe().points[-1]


def fail(_):
    stop = Stop(time=1.0, rod="LM3", element=4, finding=Finding.BENT, unstable=None, cause="of a test")
    raise PlantUnstableError.of(stop, stop.message(1e-3, ""))


def test_plants_and_their_errors_go_through_a_pool_of_processes():
    plants = [oc.Plant(gains={"LM2": gain}) for gain in (1.0, 0.0)]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        tips = list(pool.map(tip_after, plants))
        with pytest.raises(PlantUnstableError, match=r"stopped at t=1 s: element 4 of LM3 is bent by more than 1\.5 rad") as caught:
            list(pool.map(fail, [0]))
    assert caught.value.stop.finding is Finding.BENT and caught.value.rod == "LM3"
    assert all(np.array_equal(tip, tip_after(plant)) for tip, plant in zip(tips, plants, strict=True))
    assert not np.array_equal(*tips)


def test_a_state_in_hand_is_come_back_to():
    plant = oc.Plant()
    plant.advance(BEND, 0.1)
    kept, first = plant.state(), plant.advance(BEND, 0.1)
    plant.restore(kept)
    assert plant.advance(BEND, 0.1) == first


# Time


@pytest.mark.parametrize(("record", "samples"), [(2, 1), (2, 5), (3, 7), (1, 3), (7, 4), (3, 205), (2, 100)])
@pytest.mark.parametrize("begin", [0, 1])
def test_recordings_end_at_the_time_asked_for(record, samples, begin):
    plant = oc.Plant(record_every=record)
    if begin:
        plant.step(np.zeros(11), begin * plant.sample_interval)
    found = plant.advance(BEND, samples * plant.sample_interval)
    end = begin + samples
    wanted = sorted({begin, end, *(k for k in range(begin, end) if k % record == 0)})
    assert found.time == pytest.approx(np.array(wanted) * plant.sample_interval)
    assert np.array_equal(found.points[-1], plant.observe().points) and np.array_equal(found.frames[-1], plant.observe().frames)
    assert np.array_equal(found.levels[-1], BEND.levels([plant.time], plant.edges)[0])


def test_the_last_instant_is_the_one_that_a_finer_recording_has():
    coarse, fine = oc.Plant(record_every=2), oc.Plant(record_every=1)
    one, other = coarse.advance(BEND, 0.125), fine.advance(BEND, 0.125)
    for name in ("time", "points", "frames", "levels"):
        assert np.array_equal(getattr(one, name)[-1], getattr(other, name)[-1])
    assert one.stretch[-1] == pytest.approx(other.stretch[-1], rel=1e-15)


def test_stepping_by_hand_shows_the_state_after_the_action():
    plant, whole = oc.Plant(), oc.Plant(record_every=1)
    recording = whole.advance(BEND, 0.05)
    seen = [plant.advance(BEND, 0.005).points[-1] for _ in range(10)]
    assert np.array_equal(seen, recording.points[1:])


def test_an_interrupted_recording_ends_where_the_plant_stands():
    plant = oc.Plant(record_every=7)

    def stop(seconds):
        if seconds > 0:
            raise KeyboardInterrupt

    found = plant.advance(BEND, 2.0, progress=stop)
    assert not found.complete and found.time[-1] == plant.time == pytest.approx(0.5)
    assert np.array_equal(found.points[-1], plant.observe().points)


# Settings


@pytest.mark.parametrize(
    "name", ["record_every", "sample_interval", "arm", "scene", "h", "steps", "time", "samples", "clock", "gains", "model"]
)
def test_what_a_plant_is_cannot_be_set_afterwards(name):
    plant = oc.Plant()
    with pytest.raises(AttributeError) as caught:
        setattr(plant, name, getattr(plant, name))
    assert str(caught.value) == f"'{name}' of a plant is settled when it is made and cannot be set; make another plant"


# Files


@pytest.fixture
def saved(tmp_path):
    plant = oc.Plant()
    plant.advance(BEND, 0.1)
    return plant.save(tmp_path / "state.npz")


OTHERS = [
    (lambda: oc.Plant(sample_interval=2.5e-3), "state has sample_interval=0.005, this plant sample_interval=0.0025"),
    (lambda: oc.Plant(dt=2.5e-4), "state has steps=10, this plant steps=20"),
    (lambda: oc.Plant(scene=oc.Scene.free(factor=2.0)), "state has water.factor=1.0, this plant water.factor=2.0"),
    (lambda: oc.Plant(oc.Arm.octopus(elements=40)), "state has elements=48, this plant elements=40"),
    (lambda: oc.Plant(oc.Arm.octopus(grading=0.5)), "state has grading=1.0, this plant grading=0.5"),
    (lambda: oc.Plant(oc.Arm.octopus(youngs_modulus=2e4)), "state has arm="),
    (lambda: make_plant("assembly-coarse"), "state has model=rod, this plant model=assembly-coarse"),
]


@pytest.mark.parametrize(("make", "message"), OTHERS, ids=range(len(OTHERS)))
def test_a_state_of_another_plant_is_refused(saved, make, message):
    plant = make()
    before = plant.observe()
    with pytest.raises(OctoctrlError) as caught:
        plant.load(saved)
    assert message in str(caught.value)
    assert str(caught.value).endswith("make the plant as it was when saved") and plant.observe() == before


def test_a_state_of_water_is_refused_in_a_vacuum_and_back(tmp_path, saved):
    dry = oc.Plant(scene=oc.Scene(water=None))
    with pytest.raises(OctoctrlError, match="state has water=there, this plant water=none"):
        dry.load(saved)
    with pytest.raises(OctoctrlError, match="state has water=none, this plant water=there"):
        oc.Plant().load(dry.save(tmp_path / "dry.npz"))


def test_files_that_are_no_states_are_said_to_be(tmp_path, saved):
    cases = {"does not exist; write one with Plant.save": tmp_path / "none.npz"}
    for name, content in (("empty", b""), ("text", b"hello"), ("cut", saved.read_bytes()[:400])):
        (tmp_path / f"{name}.npz").write_bytes(content)
        cases[f"{name}.npz holds no state of a plant, or is damaged"] = tmp_path / f"{name}.npz"
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    cases["other.npz holds no state of a plant, or is damaged"] = tmp_path / "other.npz"
    with np.load(saved) as archive:
        content = dict(archive)
    header = content.pop("header").tobytes()
    np.savez(tmp_path / "newer.npz", header=np.frombuffer(header.replace(b'"state": 1', b'"state": 9'), dtype=np.uint8), **content)
    cases["newer.npz was written by a newer octoctrl: pip install -U octoctrl"] = tmp_path / "newer.npz"
    content.pop("samples")
    np.savez(tmp_path / "part.npz", header=np.frombuffer(header, dtype=np.uint8), **content)
    cases["part.npz holds no whole state of this plant, or is damaged"] = tmp_path / "part.npz"
    for message, path in cases.items():
        with pytest.raises(OctoctrlError) as caught:
            oc.Plant().load(path)
        assert message in str(caught.value)


def test_a_state_is_not_replaced_without_a_word(saved):
    before = saved.read_bytes()
    with pytest.raises(OctoctrlError, match=r"state\.npz exists"):
        oc.Plant().save(saved)
    assert saved.read_bytes() == before
    oc.Plant().save(saved, overwrite=True)
    assert saved.read_bytes() != before and [path.name for path in saved.parent.iterdir()] == ["state.npz"]
    with pytest.raises(OctoctrlError, match="does not exist; make it first"):
        oc.Plant().save(saved.parent / "no" / "state.npz")


@pytest.mark.parametrize("kind", MAKE)
def test_a_loaded_state_goes_on_with_the_same_bits(tmp_path, kind):
    make, source = MAKE[kind]
    plant, other = make(), make()
    later(plant, source, 3)
    other.load(plant.save(tmp_path / "state.npz"))
    assert other.observe() == plant.observe() and later(other, source) == later(plant, source)


def test_published_numerics_meet_their_period_of_feedback():
    assert make_plant("assembly", paper_compatible=True).period == make_plant("assembly").period == 0.025
    assert oc.Plant().period == 0.05


def test_arms_of_other_classes_loads_sensors_and_observations_can_be_stored(tmp_path):
    loads = (oc.PointLoad(force=(0.0, 0.0, -1e-3)), oc.SpreadLoad(torque=(0.0, 0.0, 1e-6), window=(0.1, 0.2), follower=True))
    for number, item in enumerate((SquidTentacle(), oc.Scene(loads=loads), oc.Sensors(delay=0.05), oc.Plant().observe())):
        path = oc.save(tmp_path / f"{number}.npz", item)
        assert oc.load(path) == item and type(oc.load(path)) is type(item)
    with pytest.raises(OctoctrlError, match=r"PointLoad\.force is of type function, which cannot be stored"):
        oc.save(tmp_path / "function.npz", oc.PointLoad(force=lambda time: (time, 0.0, 0.0)))


def test_a_task_file_says_the_loads_and_the_class_of_the_arm():
    loads = (oc.PointLoad(arclength=0.01, force=(0.0, 0.0, -1e-3)), oc.SpreadLoad(torque=(0.0, 0.0, 1e-6)))
    configuration = replace(oc.tasks.load("coil"), arm=SquidTentacle(), scene=oc.Scene(loads=loads))
    again = parse(toml_of(configuration))
    assert again.scene == configuration.scene and type(again.arm) is SquidTentacle and again.arm == configuration.arm
