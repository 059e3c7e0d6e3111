"""The tasks that come with the package: each is planned, carried out on the rod and passes its verdict; and each fits another arm."""

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.sim.body.arm import Arm

NEW = ("coil-outward", "corkscrew", "lm-helix", "packet", "reach", "tip", "twist")


@pytest.fixture(scope="module", params=NEW)
def run(request):
    configuration = oc.tasks.load(request.param)
    return oc.execute(oc.plan(configuration, time_limit=600.0, strict=True), feedback=configuration.run.feedback)


def test_shipped_tasks_pass_their_verdict(run):
    verdict = oc.verify(run)
    assert verdict.passed, verdict


def test_goals_are_met_by_a_plain_reading(run):
    """Twist, lifted writhe and tip at the phases' actual ends, from the recorded arrays alone."""
    time, ends = run.recording.time, {event.phase: event.actual for event in run.events}
    read = {"twist": run.trace.twist, "lifted_writhe": run.trace.lifted_writhe}
    asked = [(phase.name, goal) for phase in run.plan.task.phases for goal in phase.goals]
    assert asked
    for phase, goal in asked:
        if goal.quantity in read:
            assert abs(np.interp(ends[phase], time, read[goal.quantity]) - goal.value) <= goal.tolerance, (phase, str(goal))
        if goal.quantity == "tip":
            held = (time >= ends[phase] - goal.hold) & (time <= ends[phase])
            assert held.sum() >= max(1, 50 * goal.hold)
            assert np.linalg.norm(run.recording.points[held, -1] - goal.value, axis=1).max() <= goal.tolerance


def test_outward_coil_is_the_mirror_image_of_the_coil():
    """By half a turn about the arm's axis: x and z change their sign, and so does the pole; the plan's numbers are the same."""
    inward, outward = (oc.plan(name, time_limit=600.0) for name in ("coil", "coil-outward"))
    for name, number in inward.report.numbers.items():
        assert outward.report.numbers[name] == pytest.approx(number, abs=0.02), name
    times = np.linspace(0.0, min(inward.schedule.duration, outward.schedule.duration), 20)
    for quantity in ("twist", "lifted_writhe"):
        pair = [np.interp(times, plan.trace.time, getattr(plan.trace, quantity)) for plan in (inward, outward)]
        np.testing.assert_allclose(*pair, atol=0.05)


@pytest.mark.parametrize("name", oc.tasks.names())
def test_windows_follow_the_arm(name):
    task = oc.tasks.load(name).task
    last = 0.9 if name == "reach" else 0.989
    for length in (0.15, 0.3):
        windows = [template.window for drive in task.on(Arm(length=length)).drives for template in drive.primitive.templates()]
        assert max((end for _, end in windows), default=last * length) == pytest.approx(last * length)
