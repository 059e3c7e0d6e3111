"""Predictive control: the regulator where nothing limits it, bounds and U-turn guard where the regulator knows none, and giving way."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl import tasks
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.following import mpc
from octoctrl.planners.following.design import Course
from octoctrl.planners.following.mpc import PredictiveTracker
from octoctrl.planners.following.tracking import Tracker
from octoctrl.planners.solving import planner


@pytest.fixture(scope="module")
def plan():
    configuration = tasks.load("coil")
    return planner.plan(configuration.task, load_identified(configuration.arm, configuration.scene), time_limit=600.0)


@pytest.fixture(scope="module")
def course(plan):
    return Course(plan, plan.model)


@pytest.fixture(scope="module")
def roomy(course):
    """The same course with planned levels in the middle of their range, so that no small correction meets a bound."""

    def middle(period):
        return replace(period, levels=np.full_like(period.levels, 0.5))

    return SimpleNamespace(
        channels=course.channels, held=course.held, periods=tuple(map(middle, course.periods)), final=middle(course.final),
        period=course.period,
        standing=lambda clock: middle(course.standing(clock)),
    )  # fmt: skip


def states(course, count, size):
    draw, scale = np.random.default_rng(3), np.sqrt(np.diag(course.final.cost))
    return size * draw.normal(size=(count, len(scale))) / scale


@pytest.mark.parametrize("index", [0, 40, -15, -1, None])
def test_without_active_bounds_it_is_the_regulator(plan, roomy, index, monkeypatch):
    """With errors, bias and drift as well: the horizon's cost to go is the regulator's own, so that its length does not matter."""
    monkeypatch.setattr(mpc, "OPENING", -5.0)
    index = index if index is None or index >= 0 else len(roomy.periods) + index
    regulator = Tracker(roomy)
    period = roomy.standing(2.0) if index is None else roomy.periods[index]
    for horizon in (3, 20):
        predictive = PredictiveTracker(roomy, plan, horizon=horizon, limit=np.inf)
        for tracker in (regulator, predictive):
            tracker.errors, tracker.bias = np.linspace(-0.03, 0.03, len(tracker.errors)), np.array([0.02, -0.03])
        for x in states(roomy, 3, 1e-2):
            wanted, found = (tracker.decided(index, period, x) for tracker in (regulator, predictive))
            np.testing.assert_allclose(found, wanted, atol=2e-4 * np.abs(wanted).max() + 1e-7)
        assert predictive.fallbacks == 0


def test_predicted_levels_keep_their_range(plan, course):
    predictive = PredictiveTracker(course, plan, limit=np.inf)
    for x in states(course, 4, 5.0):
        found = predictive.decided(30, course.periods[30], x) + course.periods[30].levels
        assert found.min() > -1e-6 and found.max() < 1 + 1e-6
    assert predictive.fallbacks == 0


def next_opening(plan, course, index, x, correction):
    """1 + tip . base of the reduced model itself one period on."""
    period = course.periods[index]
    values, slopes = plan.model.outputs(course.periods[index + 1].strains.reshape(1, -1, 4), plan.task.convention.pole)
    there = period.linear.transition @ x + period.linear.influence @ correction
    return values[0, 10] + slopes[0, 10].ravel() @ there


def test_guard_keeps_away_from_a_u_turn(plan, course, monkeypatch):
    """Where the state is pushed below the opening that is aimed at, it is left faster than the regulator would."""
    index = min(range(20, len(course.periods) - 1), key=lambda k: plan.model.outputs(course.periods[k].strains.reshape(1, -1, 4))[0][0, 10])
    slope = plan.model.outputs(course.periods[index].strains.reshape(1, -1, 4))[1][0, 10].ravel()
    x = -0.15 * slope / np.diag(course.periods[index].cost)
    x *= 0.15 / abs(slope @ x)
    monkeypatch.setattr(mpc, "OPENING", 2.0)  # the plan's own
    guarded = PredictiveTracker(course, plan, limit=np.inf).decided(index, course.periods[index], x)
    monkeypatch.setattr(mpc, "OPENING", -5.0)
    free = PredictiveTracker(course, plan, limit=np.inf).decided(index, course.periods[index], x)
    assert next_opening(plan, course, index, x, guarded) > next_opening(plan, course, index, x, free) + 1e-4


def test_a_late_programme_gives_way_to_the_regulator(plan, course):
    late, regulator = PredictiveTracker(course, plan, limit=0.0), Tracker(course)
    for index, x in enumerate(states(course, 3, 0.5)):
        np.testing.assert_array_equal(late.decided(index, course.periods[index], x), regulator.decided(index, course.periods[index], x))
    assert late.fallbacks == 3


def test_coil_under_predictive_control(plan):
    """On tissue that is stiffer, muscles that are weaker and water that is heavier than planned, all at once."""
    arm = plan.arm

    def scaled(law, factor):
        return replace(law, maximum_stress=factor * law.maximum_stress)

    other = replace(
        arm, youngs_modulus=1.2 * arm.youngs_modulus, shear_modulus=1.2 * arm.shear_modulus, longitudinal=scaled(arm.longitudinal, 0.8),
        oblique=scaled(arm.oblique, 0.85),
    )  # fmt: skip
    plant = oc.make_plant("rod", other, oc.Scene.free(factor=2.0))
    errors = {}
    for feedback in ("open-loop", "mpc"):
        run = oc.execute(plan, feedback=feedback, plant=plant)
        errors[feedback] = [check.value / check.limit for check in oc.verify(run).checks if "." in check.name]
    assert max(errors["open-loop"]) > 1 > max(errors["mpc"])
    assert run.report.controller.step_time > 0 and run.feedback == "mpc"
