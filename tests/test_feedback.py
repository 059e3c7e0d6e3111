"""Feedback on the reduced model itself: what the regulator does where everything it assumes is true, and where one thing is not."""

import numpy as np
import pytest

from octoctrl import tasks
from octoctrl.planners.asking.primitives import Twist
from octoctrl.planners.asking.schedule import Schedule
from octoctrl.planners.fitting.identification import load_identified
from octoctrl.planners.following import tracking as feedback
from octoctrl.planners.following.tracking import BIAS_SHARE, TOPOLOGY_ERROR, Tracker, design
from octoctrl.planners.solving import trajectory
from octoctrl.planners.solving.plan import Plan, PlanStatus
from octoctrl.sim.body.arm import MUSCLE_GROUPS


@pytest.fixture(scope="module")
def coil():
    configuration = tasks.load("coil")
    identified = load_identified(configuration.arm, configuration.scene)
    return trajectory.plan(configuration.task, identified), identified.model


@pytest.fixture(scope="module")
def made(coil):
    return design(*coil)


@pytest.fixture(scope="module")
def resting(coil):
    """Feedback of a plan that holds one pose until nothing changes any more, so that it is time-invariant."""
    plan, model = coil
    schedule = Schedule(primitives=(Twist(hand="R-OM", level=0.2),), duration=12.0)
    motion = model.respond(schedule.activation(), schedule.duration)
    held = Plan(
        task=plan.task, model=model, schedule=schedule, phase_begins={"store": 0.0}, time=motion.time,
        strains=motion.strains, trace=model.trace(motion.time, motion.strains), status=PlanStatus.SOLVED,
    )  # fmt: skip
    return design(held, model)


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def follow(coil, made, adapt, gains=None, offset=0.0, tracker=None):
    """The reduced model as the plant, whose groups answer with `gains` times their level; topology is measured with an `offset` (turns).

    Returns errors of twist and lifted writhe (N, 2), corrections (N, m) and the tracker.
    """
    plan, model = coil
    tracker = Tracker(made, adapt=adapt) if tracker is None else tracker
    count = len(made.gains)
    levels = model.levels(plan.schedule.activation(), made.period * np.arange(1, count + 1))
    columns = [MUSCLE_GROUPS.index(group) for group in made.groups]
    gain = np.ones(len(MUSCLE_GROUPS))
    for group, factor in (gains or {}).items():
        gain[MUSCLE_GROUPS.index(group)] = factor
    strains, errors, corrections = model.rest, [], []
    for k in range(count):
        topology = model.outputs(strains[None], plan.task.convention.pole)[0][0, :2]
        correction = tracker.correct(k, strains, topology + offset)
        given = levels[k].copy()
        given[columns] += correction[:, None]
        given = np.clip(given, 0, 1) * gain[:, None]
        strains = model.simulate(given[None], [made.period], start=strains).strains[-1]
        errors.append(model.outputs(strains[None], plan.task.convention.pole)[0][0, :2] - made.topology[k + 1])
        corrections.append(correction)
    return np.array(errors), np.array(corrections), tracker


# The regulator


def test_design_holds_the_plan(coil, made):
    plan, _ = coil
    count = len(made.gains)
    assert set(made.groups) == {"R-OM", "L-OM", "LM1", "LM2", "LM8"}
    assert count == np.ceil(plan.schedule.duration / made.period)
    assert made.levels.shape == (count, 5) and made.gains.shape == (count, 5, 32)
    when = made.period * np.arange(count + 1)
    planned = plan.trace.at(np.clip(when, 0, plan.trace.time[-1]))
    assert rms(made.topology[:, 0] - planned.twist) < 0.02 and rms(made.topology[:, 1] - planned.lifted_writhe) < 0.02


def test_final_pose_is_stable_under_feedback(made):
    assert 0 < made.closed_loop_radius < 1
    closed = made.transition[-1] - made.influence[-1] @ made.gains[-1]
    assert np.abs(np.linalg.eigvals(closed)).max() < 1


def test_cost_to_go_falls_along_the_closed_loop(made):
    """x' P x is what remains to be paid: in each period it falls by what the period costs, for every x."""
    for k in range(0, len(made.gains), 10):
        closed = made.transition[k] - made.influence[k] @ made.gains[k]
        paid = made.cost[k] - closed.T @ made.cost[k + 1] @ closed
        scale = np.sqrt(np.diag(made.cost[k]))
        assert np.linalg.eigvalsh(paid / np.outer(scale, scale)).min() > -1e-9
        assert np.linalg.eigvalsh(made.cost[k] / np.outer(scale, scale)).min() > 0


def test_recursion_agrees_with_the_algebraic_riccati_equation(coil, resting):
    """Where nothing changes any more, gains and cost of the recursion are those that scipy finds in one go."""
    from scipy.linalg import solve_discrete_are

    _, model = coil
    k = 200
    a, b, c = resting.transition[k], resting.influence[k], resting.slopes[k]
    assert abs(resting.transition[k] - resting.transition[-1]).max() < 1e-6 * abs(a).max()
    price = c.T @ c / TOPOLOGY_ERROR**2 + np.diag(1 / (feedback.SHAPE_ERROR * feedback._strain_scale(model)) ** 2)
    effort = np.diag([1 / (feedback.CORRECTION * (feedback.REST_SHARE + 1)) ** 2])
    expected = solve_discrete_are(a, b, price, effort)
    gain = np.linalg.solve(effort + b.T @ expected @ b, b.T @ expected @ a)
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(resting.cost[k] / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-5)
    np.testing.assert_allclose(resting.gains[k] / scale, gain / scale, atol=1e-5 * abs(gain / scale).max())
    closed = np.abs(np.linalg.eigvals(a - b @ gain)).max()
    assert resting.closed_loop_radius == pytest.approx(closed, abs=1e-6)


def test_influence_is_that_of_a_step(coil, made):
    """What one per cent of each level changes in one period, by the model itself."""
    plan, model = coil
    k = 60
    levels = model.levels(plan.schedule.activation(), made.period * np.arange(1, k + 2))
    before = model.simulate(levels[:k], np.full(k, made.period)).strains[-1]

    def moved(levels):
        return model.simulate(levels[None], [made.period], start=before).strains[-1].ravel()

    for index, group in enumerate(made.groups):
        shift = np.zeros_like(levels[-1])
        shift[MUSCLE_GROUPS.index(group)] = 1e-5
        expected = (moved(levels[-1] + shift) - moved(levels[-1] - shift)) / 2e-5
        assert abs(made.influence[k][:, index] - expected).max() < 1e-3 * abs(expected).max(), group
    np.testing.assert_allclose(made.disturbance[k][:, :-1], made.influence[k] * made.levels[k])


# The tracker at work


def test_nothing_is_corrected_where_nothing_is_wrong(coil, made):
    for adapt in (True, False):
        errors, corrections, tracker = follow(coil, made, adapt)
        assert abs(errors).max() < 1e-6 and abs(corrections).max() < 1e-6
        assert abs(tracker.errors).max() < 1e-6


@pytest.mark.parametrize("weak", [{"R-OM": 0.8}, {"LM1": 0.8, "LM2": 0.8, "LM8": 0.8}])
def test_weak_muscles_are_found_out_and_made_up_for(coil, made, weak):
    adapted, _, tracker = follow(coil, made, True, weak)
    plain, _, stubborn = follow(coil, made, False, weak)
    estimates = dict(zip((*made.groups, "drag"), tracker.errors, strict=True))
    found = np.mean([estimates[group] for group in weak])
    assert found == pytest.approx(-0.2, abs=0.04), estimates
    assert abs(estimates["drag"]) < 0.3
    assert (stubborn.errors == 0).all()
    open_loop = follow(coil, made, False, weak, tracker=Passive(made))[0]
    assert rms(adapted) < 0.5 * rms(plain) and rms(plain) < rms(open_loop)


class Passive:
    """No feedback."""

    def __init__(self, made):
        self.zeros = np.zeros(len(made.groups))

    def correct(self, index, strains, topology):
        return self.zeros


def test_strong_muscles_are_found_out_too(coil, made):
    errors, _, tracker = follow(coil, made, True, {"L-OM": 1.2})
    assert tracker.errors[made.groups.index("L-OM")] == pytest.approx(0.2, abs=0.04)
    assert rms(errors) < rms(follow(coil, made, False, {"L-OM": 1.2})[0])


def test_corrections_keep_levels_within_bounds(coil, made):
    _, corrections, _ = follow(coil, made, True, dict.fromkeys(made.groups, 0.3))
    levels = made.levels + corrections
    assert levels.min() >= -1e-12 and levels.max() <= 1 + 1e-12 and abs(corrections).max() > 0.2


# Bias


def test_bias_is_what_the_linear_model_does_not_explain(made):
    tracker, x = Tracker(made), np.zeros(made.transition.shape[1])
    for k in range(40):  # the shape does what the linear model says, so that there is nothing to learn from it
        topology = made.topology[k] + made.slopes[k] @ x + [0.05, -0.03]
        correction = tracker.correct(k, made.strains[k] + x.reshape(-1, 4), topology)
        x = made.transition[k] @ x + made.influence[k] @ correction
    assert abs(x).max() > 0.01
    np.testing.assert_allclose(tracker.bias, np.array([0.05, -0.03]) * (1 - (1 - BIAS_SHARE) ** 40), rtol=1e-6)
    assert abs(tracker.errors).max() < 1e-9


@pytest.mark.parametrize("jump", [2.0, -2.0, 4.0])
def test_crossings_are_no_bias(made, jump):
    """The Gauss writhe jumps by two where the arm crosses itself."""
    one, other = Tracker(made), Tracker(made)
    for k in range(10, 20):
        smooth = one.correct(k, made.strains[k], made.topology[k] + [0.0, 0.1])
        jumped = other.correct(k, made.strains[k], made.topology[k] + [0.0, 0.1 + jump])
        np.testing.assert_allclose(jumped, smooth, atol=1e-9)
    assert other.bias[1] == pytest.approx(0.1, abs=0.01)


def test_bias_moves_the_arm_the_other_way(coil, made):
    """A plant that measures too much twist is driven to less, and the offset of what is measured goes down."""
    offset = np.array([0.1, 0.0])
    errors, _, _ = follow(coil, made, True, offset=offset)
    late = errors[-20:, 0].mean()
    assert late == pytest.approx(-0.1, abs=0.04)


def test_plain_regulator_ignores_bias_and_errors(made):
    tracker = Tracker(made, adapt=False)
    tracker.correct(5, made.strains[5], made.topology[5] + 0.3)
    assert (tracker.bias == 0).all() and (tracker.errors == 0).all()


def test_periods_after_the_last_are_held(made):
    last = len(made.gains)
    correction = Tracker(made).correct(last + 7, made.strains[-2], made.topology[-2])
    np.testing.assert_allclose(correction, 0.0, atol=1e-9)
