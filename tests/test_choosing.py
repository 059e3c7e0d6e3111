"""Drives that the planner chooses: what it takes, what it leaves out, what it says when the given ones do not do."""

import os
import signal
from dataclasses import replace
from threading import Timer

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.files.configuration import parse
from octoctrl.planners.asking.choice import Choice
from octoctrl.planners.asking.primitives import Bend, Twist
from octoctrl.planners.asking.registry import goal
from octoctrl.planners.asking.task import Drive, Phase, Task
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.solving import planner
from octoctrl.planners.solving.choosing import channels, guesses
from octoctrl.planners.solving.plan import PlanStatus
from octoctrl.planners.solving.problem import Problem
from octoctrl.sim.errors import OctoctrlError

TWISTS = (
    Phase(name="left", duration=1.2, goals=(goal("twist", value=0.6, tolerance=0.1),)),
    Phase(name="right", duration=1.2, goals=(goal("twist", value=-0.7, tolerance=0.1),)),
)


@pytest.fixture(scope="module")
def identified():
    return load_identified(oc.Arm.octopus(), oc.Scene.free())


@pytest.fixture(scope="module")
def chosen(identified):
    return planner.plan(Task(name="both ways", phases=TWISTS, drives="choose"), identified, time_limit=600.0)


def misses(plan):
    """Of the goals, on a simulation of our own at 10 ms."""
    motion = plan.model.respond(plan.schedule.activation(), plan.schedule.duration, step=0.01)
    trace = plan.model.trace(motion.time, motion.strains, plan.task.convention)
    ends = [*list(plan.phase_begins.values())[1:], plan.schedule.duration]
    return [
        abs(float(np.interp(end, trace.time, getattr(trace, item.quantity))) - item.value) / item.tolerance
        for phase, end in zip(plan.task.phases, ends, strict=True)
        for item in phase.goals
    ]


def test_goals_alone_give_a_plan_that_names_its_drives(chosen):
    assert chosen.status.solved and max(misses(chosen)) <= 1
    hands = {drive.primitive.hand for drive in chosen.task.drives if isinstance(drive.primitive, Twist)}
    assert hands == {"L-OM", "R-OM"}, "each sign of twist is stored by its own hand"
    assert all(drive.name in str(chosen) for drive in chosen.task.drives) and chosen.task.choose is None


def test_what_changes_nothing_is_left_out(chosen):
    """Six channels could act; twist needs no bend, and each phase one hand, or one more that relaxes."""
    assert len(chosen.task.drives) <= 3
    assert not [drive for drive in chosen.task.drives if isinstance(drive.primitive, Bend)]
    first = chosen.report.alternatives[0]
    assert set(first.drives) == {drive.name for drive in chosen.task.drives} and first.worst <= 1


def test_one_goal_needs_one_drive(identified):
    found = planner.plan(Task(name="once", phases=TWISTS[:1], drives="choose"), identified, time_limit=600.0)
    assert found.status.solved and [drive.primitive.hand for drive in found.task.drives] == ["L-OM"]


def test_a_plan_is_a_guess_for_the_same_task_and_keeps_its_drives(chosen, identified):
    again = planner.plan(Task(name="both ways", phases=TWISTS, drives="choose"), identified, guess=chosen, time_limit=600.0)
    assert again.status.solved and again.task.drives == chosen.task.drives and "choice" not in again.report.stages


def test_drives_that_do_not_do_are_answered_with_those_that_would(identified):
    wrong = (Drive(name="wrong hand", primitive=Twist(hand="R-OM", level=0.1), begins="left", free=("level", "rise")),)
    found = planner.plan(Task(name="wrong", phases=TWISTS[:1], drives=wrong), identified, time_limit=600.0)
    assert found.status is PlanStatus.OTHER_DRIVES and not found.status.solved
    assert "L-OM from left" in found.report.reason and [drive.name for drive in found.task.drives] == ["wrong hand"]


def test_a_channel_for_every_hand_and_side_in_every_phase(identified):
    arm = identified.model.arm
    task = Task(name="both ways", phases=TWISTS, drives="choose").on(arm)
    assert task.choose.window[1] == pytest.approx(0.989 * arm.length)
    names = [drive.name for drive in channels(task, task.choose).drives]
    assert names == [f"{channel} from {phase}" for phase in ("left", "right") for channel in ("R-OM", "L-OM", "LM1")]
    about_x = replace(task, convention=replace(task.convention, pole=(1.0, 0.0, 0.0)))
    assert "LM3 from left" in [drive.name for drive in channels(about_x, task.choose).drives]
    assert "LM7 from right" in [drive.name for drive in channels(task, Choice(sides=("LM7",)).on(arm)).drives]
    reach = replace(task, phases=(Phase(name="reach", duration=1.0, goals=(goal("tip", value=(0.05, 0.1, 0.0)),)),))
    wanted = {"R-OM", "L-OM", "LM1", "LM3", "LM5", "LM7", "shorten", "elongate"}
    assert {drive.name.removesuffix(" from reach") for drive in channels(reach, task.choose).drives} == wanted


def test_guesses_keep_within_bounds_and_differ(identified):
    task = Task(name="both ways", phases=TWISTS, drives="choose").on(identified.model.arm)
    problem = Problem(channels(task, task.choose), identified.model)
    found = np.array(guesses(problem, np.random.default_rng(1), 40))
    assert (found >= problem.box.lower).all() and (found <= problem.box.upper).all()
    free = problem.box.upper > problem.box.lower
    bends = np.array([name.startswith("LM1") for name in problem.names])
    assert (found[:, free & ~bends].std(axis=0) > 1e-3).all()


def test_slopes_by_the_delay_are_those_of_differences(identified):
    drive = Drive(name="late", primitive=Twist(hand="R-OM", level=0.2), begins="left", free=("level", "delay"), delay=0.2)
    problem = Problem(Task(name="late", phases=TWISTS[:1], drives=(drive,)), identified.model)
    grid, x, index, h = problem.grid(problem.start, 0.1), problem.start, problem.names.index("late.delay"), 1e-5
    up, down = (problem.read(x + sign * h * np.eye(len(x))[index], grid).misses for sign in (1, -1))
    slope = problem.read(x, grid, True).miss_slopes[:, index]
    np.testing.assert_allclose(slope, (up - down) / (2 * h), rtol=1e-3)
    assert abs(slope).max() > 0.1
    assert drive.at({"left": 1.5}, {"level": 0.1}).onset == pytest.approx(1.7)


TEXT = """
[task]
name = "small"
drives = "choose"
[[task.phases]]
name = "left"
duration = 1.0
goals = [{ quantity = "twist", value = 0.3 }]
"""


def test_a_task_file_leaves_its_drives_to_the_planner(tmp_path, chosen):
    task = parse(TEXT).task
    assert task.drives == () and task.choose == Choice()
    limited = parse(TEXT.replace('drives = "choose"', 'choose = { sides = ["LM5"], most = 3, window = ["10 %", "15 cm"] }')).task
    assert limited.choose.sides == ("LM5",) and limited.choose.most == 3 and limited.choose.window[1] == 0.15
    oc.save(tmp_path / "plan.npz", chosen)
    loaded = oc.load(tmp_path / "plan.npz")
    assert loaded.report.alternatives == chosen.report.alternatives and loaded.task == chosen.task


@pytest.mark.parametrize("after", [0.05, 0.4, 0.9])
def test_an_interrupt_while_drives_are_chosen_leaves_no_plan(after, identified):
    """Of the arm's coil, which takes longer than that to choose for."""
    task = replace(oc.tasks.load("coil").task, drives="choose")
    timer = Timer(after, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            planner.plan(task, identified, time_limit=600.0)
    finally:
        timer.cancel()


def test_mistakes_are_told():
    drive = Drive(name="hand", primitive=Twist(hand="R-OM", level=0.1), begins="left")
    with pytest.raises(OctoctrlError, match="task 'x' has drives, and choose as well; give one of them"):
        Task(name="x", phases=TWISTS, drives=(drive,), choose=Choice())
    with pytest.raises(OctoctrlError, match=r'give at least one drive .* or drives = "choose"'):
        Task(name="x", phases=TWISTS)
    with pytest.raises(OctoctrlError, match="LM9"):
        Choice(sides=("LM9",))
    with pytest.raises(OctoctrlError, match="delay"):
        replace(drive, delay=-1.0)


def test_refused_at_once_whatever_the_drives(identified):
    far = Phase(name="far", duration=1.0, goals=(goal("twist", value=-3.0, tolerance=0.1),))
    found = planner.plan(Task(name="far", phases=(far,), drives="choose"), identified)
    assert found.status is PlanStatus.UNREACHABLE
