"""Windows that end inside one of the thin sections at the tip, where a step that is too large for them once had no solution."""

from dataclasses import replace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.planners.asking.primitives import Shorten, Twist
from octoctrl.planners.asking.registry import goal
from octoctrl.planners.asking.task import Drive, Phase, Task
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.solving import planner
from octoctrl.planners.solving.plan import PlanStatus
from octoctrl.sim.activation import Activation
from octoctrl.sim.templates import Plateau

ENDS = (0.15, 0.16, 0.17, 0.18, 0.185, 0.19, 0.195, 0.2)


@pytest.fixture(scope="module")
def identified():
    return load_identified(oc.Arm.octopus(), oc.Scene.free())


@pytest.mark.parametrize("group", ["R-OM", "LM1", "TM"])
def test_the_model_moves_at_every_step_that_planning_takes(group, identified):
    """And comes to rest where fine steps lead, once nothing changes any more."""
    for end in ENDS:
        activation = Activation(templates=(Plateau(groups=(group,), level=0.2, window=(0.0, end)),))
        for step in (0.05, 0.15, 0.3):
            assert np.isfinite(identified.model.respond(activation, 2.0, step=step).strains).all(), (end, step)
    ends = [identified.model.respond(activation, 20.0, step=step).strains[-1] for step in (0.05, 0.3)]
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-3, atol=0.02)


def small(drive, **wanted):
    return Task(name="small", phases=(Phase(name="go", duration=1.5, goals=(goal(**wanted),)),), drives=(drive,))


@pytest.mark.parametrize("window", [(0.0, 0.17), (0.0, 0.18), (0.0, 0.185), (0.0, 0.193), (0.1, 0.19)])
def test_twist_is_planned_in_any_window(window, identified):
    drive = Drive(name="store", primitive=Twist(hand="R-OM", level=0.2, window=window), begins="go", free=("level", "rise"))
    assert planner.plan(small(drive, quantity="twist", value=-0.5, tolerance=0.1), identified, time_limit=600.0).status.solved


def test_a_window_in_the_tip_alone_stores_too_little(identified):
    drive = Drive(name="store", primitive=Twist(hand="R-OM", level=0.2, window=(0.19, 0.2)), begins="go", free=("level", "rise"))
    found = planner.plan(small(drive, quantity="twist", value=-0.5, tolerance=0.1), identified, time_limit=600.0)
    assert found.status is PlanStatus.OTHER_DRIVES and "R-OM from go" in found.report.reason


def test_length_and_coil_are_planned_with_windows_that_end_there(identified):
    shorten = Drive(name="shorten", primitive=Shorten(level=0.2, window=(0.0, 0.18)), begins="go")
    assert planner.plan(small(shorten, quantity="length", value=0.18, tolerance=0.004), identified, time_limit=600.0).status.solved
    coil = oc.tasks.load("coil").task
    first = coil.drives[0]
    drives = (replace(first, primitive=replace(first.primitive, window=(0.0, 0.19))), *coil.drives[1:])
    assert planner.plan(replace(coil, drives=drives), identified, time_limit=600.0).status.solved
