"""Planning from the middle of a motion: exact slopes there, levels without jumps, a run that plans again, and goes on after a break."""

from dataclasses import replace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.carrying.replanning import Replanning, planned_again
from octoctrl.planners.following.design import Course
from octoctrl.planners.solving.plan import PlanStatus
from octoctrl.planners.solving.present import Present
from octoctrl.planners.solving.problem import Problem
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import make_plant

CLOCK = 2.0
"""In the midst of the coil's second phase, s."""


@pytest.fixture(scope="module")
def coil():
    return oc.plan("coil")


@pytest.fixture(scope="module")
def seen(coil):
    """The rod as it is at `CLOCK`, and its lifted writhe."""
    plant = make_plant("rod", coil.arm, coil.scene)
    recording = plant.advance(coil.schedule.activation(), CLOCK)
    from octoctrl.sim.topology.measures import measure

    return plant.observe(), measure(recording.time, recording.points, recording.frames, coil.task.convention).lifted_writhe[-1]


@pytest.fixture(scope="module")
def again(coil, seen):
    return planned_again(coil, CLOCK, ("open", "spiral", "cross", "telescope"), *seen, (), 600.0)


def test_slopes_are_exact_from_a_present_state_with_muscles_at_work(coil, again):
    drives = again.task.drives[-len(again.report.numbers) :]
    before = tuple(again.schedule.primitives[: len(again.schedule.primitives) - 2])
    task = replace(again.task, phases=again.task.phases[1:], drives=tuple(drive for drive in drives if drive.begins != "store"))
    present = Present(strains=again.strains[np.searchsorted(again.time, CLOCK)], lifted_writhe=-0.2, before=before, clock=CLOCK)
    problem = Problem(task, replace(coil.model, gains={"LM2": 0.5}), present)
    x, grid = problem.start, problem.grid(problem.start, 0.15)
    found = problem.read(x, grid, slopes=True)
    np.testing.assert_allclose(found.misses, problem.read(x, grid).misses, atol=1e-9)
    for index in range(len(x)):
        step = 1e-5 * problem.box.scale[index] * np.eye(len(x))[index]
        difference = (problem.read(x + step, grid).misses - problem.read(x - step, grid).misses) / (2 * step[index])
        np.testing.assert_allclose(found.miss_slopes[:, index], difference, atol=2e-3 * (1 + abs(difference).max()))


def test_a_plan_goes_on_from_what_is_seen(coil, again, seen):
    """Its motion begins at the shape that is seen, its levels do not jump, and its goals hold on a simulation from there."""
    assert again.status.solved and again.since == CLOCK and next(iter(again.phase_begins)) == "store"
    at = np.searchsorted(again.time, CLOCK)
    np.testing.assert_allclose(again.strains[at], coil.model.strains(seen[0]))
    assert abs(again.trace.lifted_writhe[at] - seen[1]) < 0.05 and (np.diff(again.time) > 0).all()
    edges = coil.arm.edges
    just = [plan.schedule.activation().levels(np.array([CLOCK + 1e-6]), edges) for plan in (coil, again)]
    np.testing.assert_allclose(*just, atol=1e-3)
    model, activation = again.model, again.schedule.activation()
    motion = model.respond(activation, again.schedule.duration - CLOCK, start=again.strains[at], begin=CLOCK, step=0.01)
    trace = model.trace(motion.time, motion.strains, coil.task.convention)
    ends = [*list(again.phase_begins.values())[2:], again.schedule.duration]
    for phase, end in zip(again.task.phases[1:], ends, strict=True):
        for goal in phase.goals:
            assert abs(np.interp(end, trace.time, getattr(trace, goal.quantity)) - goal.value) <= goal.tolerance, (phase.name, str(goal))


def test_feedback_follows_it_from_there(again):
    course = Course(again, again.model)
    assert course.since == CLOCK and len(course.periods) == np.ceil((again.schedule.duration - CLOCK) / course.period)
    np.testing.assert_allclose(course.periods[0].strains, again.strains[np.searchsorted(again.time, CLOCK)].ravel())


def test_plan_from_an_observation(coil, seen):
    """By hand: what is left of the task, from the shape alone."""
    drive = replace(coil.task.drives[2], begins="telescope")
    last = replace(coil.task.phases[4], goals=(oc.goal("twist", value=0.5, tolerance=0.1),))
    made = oc.plan(replace(coil.task, phases=(last,), drives=(drive,)), start=seen[0])
    assert made.status.solved and made.since == 0.0
    np.testing.assert_allclose(made.strains[0], made.model.strains(seen[0]))
    with pytest.raises(OctoctrlError, match=r"are no state of a reduced model"):
        Present(strains=np.full((8, 4), np.nan))


# In a run


def run_of(coil, gains=None, **settings):
    return oc.execute(coil, plant=make_plant("rod", coil.arm, coil.scene, gains=gains or {}), replan=True, **settings)


def test_nothing_calls_for_a_new_plan_where_nothing_is_wrong(coil):
    run = run_of(coil)
    assert run.replans == () and run.plan is coil


def test_a_dead_muscle_is_planned_around(coil):
    run = run_of(coil, {"LM2": 0.0})
    (once,) = run.replans
    assert (
        once.reason == "LM2 does nothing"
        and once.status.solved
        and run.report.controller.dead_groups["LM2"] == pytest.approx(once.time, abs=0.06)
    )
    assert all(event.met for event in run.events) and len(run.events) == 5
    assert run.plan.model.gains == {"LM2": 0.0} and run.plan.since == pytest.approx(once.clock)
    assert "planned again at" in str(run)
    used = run.plan.trace.at(np.clip(run.clock, 0, run.plan.trace.time[-1])[::40].astype(float))
    assert abs(used.twist - run.trace.twist[::40]).max() < 0.3


def test_what_no_plan_mends_is_refused_and_the_run_goes_on(coil):
    """Without L-OM nothing twists the other way: the run keeps its plan, and says why."""
    run = run_of(coil, {"L-OM": 0.0})
    assert run.replans and not run.replans[0].status.solved and run.plan is coil
    assert run.replans[0].status in (PlanStatus.NOT_FOUND, PlanStatus.UNREACHABLE, PlanStatus.UTURN) and len(run.events) == 5


def test_a_missed_goal_is_tried_once_more(coil):
    """A phase that asks for more than was planned, beyond what waiting brings."""
    first = coil.task.phases[0]
    harder = replace(first, goals=(replace(first.goals[0], value=-1.3, tolerance=0.1),))
    asked = replace(coil, task=replace(coil.task, phases=(harder, *coil.task.phases[1:])))
    once = oc.execute(asked, replan=Replanning(most=1))
    never = oc.execute(asked)
    assert next(event.met for event in never.events) is False
    assert once.replans[0].reason.startswith("phase 'store' misses its goals by") and once.replans[0].status.solved
    assert [event.met for event in once.events] == [True] * 5


class Broken:
    """Ends a run at a time."""

    def __init__(self, time):
        self.time = time

    def begin(self, plan, plant):
        pass

    def see(self, plant, clock):
        if plant.time > self.time:
            raise KeyboardInterrupt


def test_a_run_that_was_planned_again_goes_on_with_its_bits(coil, tmp_path):
    path, gains = tmp_path / "run.npz", {"LM2": 0.0}
    whole = run_of(coil, gains)
    broken = run_of(coil, gains, path=path, watch=Broken(3.0))
    assert len(broken.replans) == 1
    ended = oc.resume(path, plant=make_plant("rod", coil.arm, coil.scene, gains=gains))
    np.testing.assert_array_equal(ended.recording.points, whole.recording.points)
    assert ended.replans == whole.replans and ended.plan.since == whole.plan.since
    kept = oc.load(path)
    assert kept.replans == whole.replans and kept.plan.identified.reach == coil.identified.reach


def test_what_waves_on_their_way_have_missed_is_tried_with_drives_that_the_planner_chooses():
    """The corkscrew's two waves, both on their way when its last phase is to be planned again: none of its drives can be changed."""
    plan = oc.plan("corkscrew")
    last = list(plan.phase_begins)[-1]
    clock = round(plan.phase_begins[last] + 0.5, 1)
    plant = make_plant("rod", plan.arm, plan.scene)
    plant.advance(plan.schedule.activation(), clock)
    again = planned_again(plan, clock, [last], plant.observe(), 0.0, (), 20.0)
    assert again.since == pytest.approx(clock) and again.status in PlanStatus
    assert {drive.name for drive in plan.task.drives} <= {drive.name for drive in again.task.drives}


def test_replanning_needs_feedback_by_name(coil):
    with pytest.raises(OctoctrlError, match=r"give feedback by its name$"):
        oc.execute(coil, feedback=lambda _time, _observation: {}, replan=True)
    with pytest.raises(OctoctrlError, match=r"most"):
        Replanning(most=-1)


def test_what_is_planned_by_simulating_is_not_planned_again(coil):
    goal = oc.goal("covered_winding", object="post", at_least=0.9)
    task = replace(coil.task, phases=tuple(replace(phase, goals=(goal,)) for phase in coil.task.phases))
    with pytest.raises(OctoctrlError, match=r"is planned by simulating, from rest, and never in the middle of a run; leave replan out$"):
        oc.execute(replace(coil, task=task), replan=True)


def test_planning_again_begins_from_the_numbers_of_the_plan(coil, seen, again):
    """Of a plan that the arm follows little is left to search for."""
    forgetful = replace(coil, report=replace(coil.report, numbers={}))
    anew = planned_again(forgetful, CLOCK, ("open", "spiral", "cross", "telescope"), *seen, (), 600.0)
    assert anew.status.solved and again.report.starts == 1 and again.report.iterations < anew.report.iterations
