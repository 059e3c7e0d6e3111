"""The doctor: an installation that is sound or not, what a task needs, and one line before planning and running."""

import json
from dataclasses import replace

import numpy as np
import pytest

from octoctrl import doctor as diagnosis
from octoctrl import tasks
from octoctrl.cli.application import main
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.plants import Plant
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.sources import sampled


def marks(findings):
    return {what: (mark, found) for what, found, mark in findings.rows}


def test_this_installation_is_sound(capsys):
    assert main(["doctor"]) == 0
    said = capsys.readouterr().out
    assert "numba" in said and "sqpmethod with DAQP solves" in said and "NOT WELL" not in said


def test_a_plant_that_moves_otherwise_is_found(monkeypatch, capsys):
    monkeypatch.setattr(diagnosis, "TIP", tuple(np.add(diagnosis.TIP, [1e-6, 0, 0])))
    assert main(["doctor", "--json"]) == 2
    plant = json.loads(capsys.readouterr().out)["installation"]["plant"]
    assert plant["mark"] == "NOT WELL" and "0.001 mm" in plant["found"]


def test_a_task_is_told_what_it_needs_and_what_is_left_out(capsys):
    assert main(["doctor", "coil", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["task"]
    assert told["muscles"]["found"].startswith("LM1, LM2, LM8, R-OM, L-OM")
    assert told["muscles at rest"] == {"found": "LM3, LM4, LM5, LM6, LM7, TM: passive stress, no active law", "mark": "left out"}
    assert told["water"]["mark"] == "needed" and "no such code" in told["contact, friction"]["found"]
    assert "shear and bending of the section" in told["step"]["found"] and "x real time" in told["run time"]["found"]


def test_groups_at_rest_are_those_that_the_plant_leaves_out():
    configuration = tasks.load("coil")
    activation, duration = diagnosis._guess(configuration)
    plant = Plant(configuration.arm, configuration.scene)
    pulled = plant.core._active(
        sampled(activation, plant.clock.instants(0, plant.clock.samples(duration)), plant.core.partitions, plant.arm.layout)["arm"]
    ).any(axis=0)
    told = marks(diagnosis.needs(configuration))["muscles at rest"][1].partition(":")[0].split(", ")
    assert told == [group for group, active in zip(plant.arm.layout.names, pulled, strict=True) if not active]


def test_a_vacuum_has_no_drag():
    told = marks(diagnosis.needs(replace(tasks.load("coil"), scene=Scene(water=None))))
    assert told["water"][0] == "left out"


@pytest.mark.parametrize(
    "plant, reason",
    [
        ({}, "0.8 of it in whole steps per sample"),
        ({"arm": Arm.octopus(elements=16, taper=2.0)}, "held at 1 ms, which the onset of muscles needs"),
        ({"sample_interval": 2e-4}, "one per sample of 0.2 ms"),
    ],
)
def test_a_step_far_below_the_limit_says_why(plant, reason):
    made = Plant(**plant)
    assert reason in diagnosis.step_text(made)
    assert reason.startswith("0.8") == (made.h > 0.5 * made.limit.step)


def test_one_line_before_planning_and_running():
    assert diagnosis.plan_header(tasks.load("coil")).startswith("reduced model: 5 of 11 muscle groups, drag, no inertia, no contact;")
    for name in tasks.names():  # also of windows that are shares of the arm
        assert diagnosis.plan_header(tasks.load(name)).startswith("reduced model: ") == (name != "grasp")
    assert diagnosis.plan_header(tasks.load("grasp")) == (
        "planned by simulating one rod: any of 11 muscle groups, drag, contact with 1 object; 1 phase, 5 s at first"
    )
    line = diagnosis.header(Plant(), ("LM1", "R-OM"))
    assert line.startswith("rod plant: 2 of 11 muscle groups active, drag, no contact; step 0.5 ms, 0.74 of the limit")


def test_objects_are_needed_where_there_are_any():
    from octoctrl.sim.scene.objects import Sphere

    scene = Scene(objects=(Sphere(name="ball", radius=0.01, position=(0.05, 0.1, 0.0)),))
    told = marks(diagnosis.needs(replace(tasks.load("coil"), scene=scene)))
    assert told["contact, friction"][0] == "needed" and "with ball" in told["contact, friction"][1]
    assert "contact with 1 object;" in diagnosis.header(Plant(scene=scene), ("LM1",))


def test_contact_with_itself_is_needed_where_it_is_asked_for():
    told = [marks(diagnosis.needs(replace(tasks.load("coil"), scene=Scene(self_contact=on)))) for on in (True, False)]
    assert told[0]["self-contact"][0] == "needed" and "an implicit impulse" in told[0]["self-contact"][1]
    assert told[1]["self-contact"][0] == "left out" and "no such code" in told[1]["self-contact"][1]
    made = Plant(scene=Scene(self_contact=True))
    assert "drag, no contact, self-contact on; step" in diagnosis.header(made, ("LM1",))
