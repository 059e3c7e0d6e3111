"""A plant and an object from outside the package, written with public names only: by name, in a run, on the command line, in files."""

import copy
import gc
import json
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.cli.application import main
from octoctrl.sim import annotations, plants
from octoctrl.sim.contracts import Motion
from octoctrl.sim.findings import Finding, Stop
from octoctrl.sim.running.clock import StepLimit
from octoctrl.sim.scene.objects import Capsule

REST = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
LAG, SHARE, SHORTEST = 0.1, 0.3, 0.8
"""Seconds; shortening at level 1 of all longitudinal muscles; stretch at which the guard stops it."""
TEXT = "a straight arm that shortens with a lag"


class LaggingCore:
    """A straight arm whose elements follow the mean level of the longitudinal muscles with a lag: x' = (SHARE a - x) / LAG."""

    model, finer, loadable, period, usual = "lagging", (), False, 0.05, 1e-3

    def __init__(self, arm, scene):
        self.arm, self.scene = arm, scene
        self.partitions = {"arm": arm.edges}
        self.limit = StepLimit(step=0.05, mechanism="the lag", element=0)

    def start(self, clock):
        self._h = clock.step

    def rest(self):
        self._short = np.zeros(self.arm.elements)

    def shape(self):
        stretch, points = 1 - self._short, np.zeros((self.arm.elements + 1, 3))
        points[1:, 1] = np.cumsum(stretch * np.diff(self.arm.edges))
        return points, np.tile(REST, (self.arm.elements, 1, 1)), stretch

    def speeds(self):
        return np.zeros((self.arm.elements + 1, 3)), np.zeros((self.arm.elements, 3))

    def series(self):
        return {}

    def move(self, first, inputs, clock):
        levels = inputs["arm"][:, :8].mean(axis=1)
        shapes, finding, element = [], Finding.FINE, 0
        for before, after in pairwise(levels):
            for step in range(clock.steps):
                level = before + (after - before) * (step + 0.5) / clock.steps
                self._short = self._short + self._h / LAG * (SHARE * level - self._short)
            if (1 - self._short).min() < SHORTEST:
                finding, element = Finding.STRETCHED, int(self._short.argmax())
                break
            shapes.append(self.shape())
        count = self.arm.elements
        points, frames, stretch = (
            np.array([shape[part] for shape in shapes]).reshape(-1, *size)
            for part, size in enumerate(((count + 1, 3), (count, 3, 3), (count,)))
        )
        return Motion(points=points, frames=frames, stretch=stretch, finding=finding, element=element)

    def explain(self, before, first, inputs, motion, clock):
        time = (first + len(motion.points) + 1) * clock.sample
        return Stop(time=time, rod="arm", element=motion.element, finding=motion.finding, unstable=False, cause="lower the levels")

    def state(self):
        return {"short": self._short.copy()}

    def restore(self, state):
        self._short = np.array(state["short"])

    def identity(self):
        return {}


@pytest.fixture(scope="module", autouse=True)
def registered():
    row = plants.PlantRow(name="lagging", text=TEXT, core=LaggingCore, modelled_as="rod", lumped="everything")
    yield plants.register(row)
    del plants.PLANTS["lagging"]


def pull(level):
    return oc.Activation(templates=(oc.Plateau(groups=tuple(f"LM{number}" for number in range(1, 9)), level=level, rise=1e-3),))


def test_it_moves_by_its_own_law_and_is_recorded_like_any_other():
    plant = oc.make_plant("lagging")
    run = plant.advance(pull(0.5), 0.4)
    begin = plant.sample_interval / 2  # a level that jumps rises over the first sample
    expected = 1 - SHARE * 0.5 * (1 - np.exp(-np.maximum(run.time - begin, 0.0) / LAG))
    np.testing.assert_allclose(run.stretch, np.broadcast_to(expected[:, None], run.stretch.shape), atol=1e-3)
    assert run.time[-1] == pytest.approx(0.4) and run.length[-1] == pytest.approx(expected[-1] * plant.arm.length, rel=2e-3)
    twin = copy.deepcopy(plant)
    assert twin.advance(pull(0.5), 0.1) == plant.advance(pull(0.5), 0.1)
    batch = oc.simulate_batch([oc.make_plant("lagging") for _ in range(2)], pull(0.5), 0.4)
    assert batch.recordings[0] == run


def test_its_guard_stops_it_with_a_place_and_a_remedy():
    plant = oc.make_plant("lagging")
    with pytest.raises(oc.PlantUnstableError, match=r"element 0 is stretched beyond .*; lower the levels") as caught:
        plant.advance(pull(1.0), 1.0)
    assert caught.value.recording.stretch.min() > SHORTEST and not caught.value.recording.complete
    weak = oc.make_plant("lagging", gains={f"LM{number}": 0.5 for number in range(1, 9)})
    assert weak.advance(pull(1.0), 1.0).complete


@pytest.fixture(scope="module")
def plan():
    drive = oc.Drive(name="pull", primitive=oc.Shorten(level=0.2), begins="hold")
    task = oc.Task(name="pull", phases=(oc.Phase(name="hold", duration=0.5),), drives=(drive,))
    return replace(oc.plan(task), plant="lagging")


def test_plans_run_on_it_and_files_name_it(plan, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    oc.save("plan.npz", plan)
    assert main(["run", "plan.npz", "-o", "run.npz", "--open-loop", "--json", "-q"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["plant"] == "lagging" and answer["status"] == "finished"
    run = oc.load("run.npz")
    assert run.plant == "lagging" and 0.9 < run.recording.stretch.min() < 1.0 and oc.verify(run).checks
    assert main(["run", "plan.npz", "-o", "other.npz", "--plant", "laging", "-q"]) == 2
    assert "did you mean 'lagging'" in capsys.readouterr().err
    assert main(["doctor", "coil", "--plant", "lagging", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["task"]
    assert told["plant"]["found"] == "lagging: a straight arm that shortens with a lag" and "everything" in told


def test_a_name_that_is_taken_is_refused(registered):
    with pytest.raises(oc.OctoctrlError, match="a plant called 'rod' exists already"):
        plants.register(replace(registered, name="rod"))
    with pytest.raises(oc.OctoctrlError, match="unknown plant 'rood'"):
        plants.register(replace(registered, name="another", modelled_as="rood"))
    assert plants.register(registered) is registered


# An object


@pytest.fixture
def forgotten():
    """Task files know every shape that there is by its name: those of a test are gone after it."""
    before = set(Capsule.__subclasses__())
    yield
    for keeps in (annotations._hints, annotations._looked_at):
        keeps.cache_clear()
    gc.collect()
    assert set(Capsule.__subclasses__()) == before


def test_an_object_of_ones_own_is_touched_like_the_one_that_it_is(forgotten):
    @dataclass(frozen=True, slots=True, kw_only=True)
    class Stick(Capsule):
        """A stick that is given by its whole length and its slenderness."""

        radius: float = 0.0
        length: float = 0.0
        whole: float
        slenderness: float = 10.0

        def __post_init__(self):
            object.__setattr__(self, "radius", self.whole / (2 * self.slenderness))
            object.__setattr__(self, "length", self.whole - 2 * self.radius)
            Capsule.__post_init__(self)

    place = {"position": (0.0, 0.07, -0.022), "axis": (1, 0, 0)}
    curl = oc.Activation(templates=(oc.Plateau(groups=("LM6", "LM7", "LM8"), level=0.3, rise=0.3, window=(0.05, 0.2)),))
    runs = [
        oc.make_plant("rod", scene=oc.Scene(objects=(item,))).advance(curl, 1.0)
        for item in (Stick(name="post", whole=0.096, slenderness=6.0, **place), Capsule(name="post", radius=8e-3, length=0.08, **place))
    ]
    free = oc.make_plant("rod").advance(curl, 1.0)
    np.testing.assert_allclose(runs[0].points, runs[1].points, atol=1e-9)
    assert np.abs(runs[0].points - free.points).max() > 1e-3
    with pytest.raises(oc.OctoctrlError, match="object 'post': radius"):
        Stick(name="post", whole=-1.0)
