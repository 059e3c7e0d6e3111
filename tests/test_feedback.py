"""Feedback on the reduced model itself: what the regulator does where everything it assumes is true, and where one thing is not."""

import numpy as np
import pytest

from octoctrl import tasks
from octoctrl.planners.asking.primitives import Twist
from octoctrl.planners.asking.schedule import Schedule
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.following import design
from octoctrl.planners.following.design import DISCOUNT, Course
from octoctrl.planners.following.observer import Observer, Sight
from octoctrl.planners.following.tracking import BIAS_SHARE, Tracker
from octoctrl.planners.model.output_kernels import OUTPUTS
from octoctrl.planners.solving import planner
from octoctrl.planners.solving.plan import Plan, PlanStatus
from octoctrl.sim.body.arm import MUSCLE_GROUPS


@pytest.fixture(scope="module")
def coil():
    configuration = tasks.load("coil")
    identified = load_identified(configuration.arm, configuration.scene)
    return planner.plan(configuration.task, identified, time_limit=600.0), identified.model


@pytest.fixture(scope="module")
def made(coil):
    return Course(*coil)


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
    return Course(held, model)


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def exact(strains, topology):
    """A measurement without noise."""
    size = np.size(strains)
    return Sight(np.reshape(strains, (-1, 4)), outputs_of(topology), np.zeros((size, size)))


def outputs_of(topology):
    """Outputs of which only twist and writhe are read."""
    outputs = np.zeros(len(OUTPUTS))
    outputs[:2] = np.asarray(topology)[:2]
    return outputs


def corrected(made, model, levels, correction, shares=None):
    """Levels (groups, S) with a correction of each channel where that acts, which stays unless `shares` say so."""
    levels = levels.copy()
    shares = made.channels.shares(np.zeros(1), model.edges)[0] if shares is None else shares
    for channel, part in zip(made.channels.each, correction[:, None] * shares, strict=True):
        levels[MUSCLE_GROUPS.index(channel.group)] += part
    return levels


def follow(coil, made, adapt=True, gains=None, offset=0.0, tracker=None, delay=0, noise=0.0, seed=0):
    """The reduced model as the plant, whose groups answer with `gains` times their level; topology is measured with an `offset` (turns).

    What is measured is `delay` periods old; `noise` is that of the strains, as a share of their scale. Returns errors of twist and lifted
    writhe (N, 2), corrections (N, m) and the tracker.
    """
    plan, model = coil
    tracker = Tracker(made, adapt=adapt) if tracker is None else tracker
    random, scale = np.random.default_rng(seed), design.strain_scale(model)
    count = len(made.periods)
    levels, planned = model.levels(plan.schedule.activation(), np.cumsum(made.steps)), [*made.periods[1:], made.final]
    gain = np.ones(len(MUSCLE_GROUPS))
    for group, factor in (gains or {}).items():
        gain[MUSCLE_GROUPS.index(group)] = factor
    strains, errors, corrections, sights = model.rest, [], [], []
    for k in range(count):
        seen = strains + noise * (scale * random.normal(size=len(scale))).reshape(strains.shape)
        topology = model.outputs(seen[None], plan.task.convention.pole)[0][0, :2]
        sights.append(Sight(seen, outputs_of(topology + offset), np.diag((noise * scale) ** 2)))
        age = min(delay, k)
        correction = tracker.correct(k, sights[k - age], age=age)
        given = np.clip(corrected(made, model, levels[k], correction), 0, 1) * gain[:, None]
        strains = model.simulate(given[None], made.steps[k : k + 1], start=strains).strains[-1]
        errors.append(model.outputs(strains[None], plan.task.convention.pole)[0][0, :2] - planned[k].held)
        corrections.append(correction)
    return np.array(errors), np.array(corrections), tracker


# The regulator


def test_course_holds_the_plan(coil, made):
    plan, _ = coil
    count = len(made.periods)
    assert set(made.channels.groups) == {"R-OM", "L-OM", "LM1", "LM2", "LM8"}
    assert count == np.ceil(plan.schedule.duration / made.period)
    assert made.periods[3].levels.shape == (5,) and made.periods[3].gain.shape == (5, 32)
    planned = plan.trace.at(made.period * np.arange(count))
    topology = np.array([period.held for period in made.periods])
    assert rms(topology[:, 0] - planned.twist) < 0.02 and rms(topology[:, 1] - planned.lifted_writhe) < 0.02
    assert not any(period.linear.drift.any() for period in made.periods)


@pytest.mark.parametrize("period", [0.05, 0.07, 0.5])
def test_course_ends_where_the_plan_does(coil, period):
    """The last period is as long as what is left of the plan, and what is held after it is the plan's end."""
    plan, model = coil
    course = Course(plan, model, period)
    times = np.append(np.arange(0.0, plan.schedule.duration - 1e-6 * period, period), plan.schedule.duration)
    np.testing.assert_allclose(course.steps, np.diff(times), atol=1e-12)
    planned = model.simulate(model.levels(plan.schedule.activation(), times[1:]), np.diff(times)).strains
    np.testing.assert_allclose(course.final.strains, planned[-1].ravel(), rtol=1e-9)
    np.testing.assert_allclose(course.standing(times[-2]).strains, planned[-2].ravel(), rtol=1e-9)


def test_final_pose_is_stable_under_feedback(made):
    assert 0 < np.abs(np.linalg.eigvals(made.final.closed())).max() < 1
    assert np.abs(np.linalg.eigvals(made.periods[-1].closed())).max() < 1


def test_cost_to_go_falls_along_the_closed_loop(made):
    """x' P x is what remains to be paid: in each period it falls by what the period costs, for every x."""
    for before, after in zip(made.periods[:-1:10], made.periods[1::10], strict=True):
        closed, gain = after.closed(), after.gain
        paid = before.cost - closed.T @ after.cost @ closed
        scale = np.sqrt(np.diag(before.cost))
        expected = after.linear.price + gain.T @ after.linear.effort @ gain
        np.testing.assert_allclose(paid / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-8)
        assert np.linalg.eigvalsh(before.cost / np.outer(scale, scale)).min() > 0


def test_standing_clock_agrees_with_the_algebraic_riccati_equation(made):
    """The recursion of a standing clock ends where scipy finds the discounted equation solved in one go."""
    from scipy.linalg import solve_discrete_are

    linear = made.final.linear
    a, b = np.sqrt(DISCOUNT) * linear.transition, np.sqrt(DISCOUNT) * linear.influence
    scale = np.sqrt(np.diag(made.final.cost))
    shrink = np.diag(1 / scale)
    grown = np.diag(scale)
    expected = shrink @ solve_discrete_are(a, b, linear.price, linear.effort) @ shrink
    np.testing.assert_allclose(shrink @ made.final.cost @ shrink / DISCOUNT, expected, atol=1e-5)
    cost = grown @ expected @ grown
    gain = np.linalg.solve(linear.effort + b.T @ cost @ b, b.T @ cost @ a)
    np.testing.assert_allclose(made.final.gain / scale, gain / scale, atol=1e-5 * abs(gain / scale).max())


def test_influence_and_drift_are_those_of_the_model(coil, made):
    """What one per mille of each level changes in one period, and where the model goes while the clock stands, by the model itself."""
    plan, model = coil
    k, when = 60, np.array([60 * made.period])
    levels = model.levels(plan.schedule.activation(), made.period * np.arange(1, k + 2))
    strains = model.simulate(levels, np.full(k + 1, made.period)).strains[-2]

    def moved(levels):
        return model.simulate(levels[None], [made.period], start=strains).strains[-1].ravel()

    for index, group in enumerate(made.channels.groups):
        shift = corrected(made, model, np.zeros_like(levels[-1]), 1e-3 * np.eye(5)[index])
        expected = (moved(levels[-1] + shift) - moved(levels[-1] - shift)) / 2e-3
        assert abs(made.periods[k].linear.influence[:, index] - expected).max() < 0.02 * abs(expected).max(), group
    linear = made.periods[k].linear
    np.testing.assert_allclose(linear.disturbance[:, :5], linear.influence * made.periods[k].levels, atol=1e-12)
    held = model.levels(plan.schedule.activation(), when + model.lag)[0]
    standing = made.standing(when[0])
    np.testing.assert_allclose(standing.linear.drift, moved(held) - strains.ravel(), atol=1e-9)
    assert abs(standing.linear.drift).max() > 0.05


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
    estimates = tracker.believed()
    found = np.mean([estimates[group] for group in weak])
    assert found == pytest.approx(-0.2, abs=0.04), estimates
    assert abs(estimates["drag"]) < 0.3
    assert (stubborn.errors == 0).all()
    open_loop = follow(coil, made, False, weak, tracker=Passive(made))[0]
    assert rms(adapted) < 0.5 * rms(plain) and rms(plain) < rms(open_loop)


class Passive:
    """No feedback."""

    def __init__(self, made):
        self.zeros = np.zeros(len(made.channels))

    def correct(self, index, sight, age=0):
        return self.zeros


def test_strong_muscles_are_found_out_too(coil, made):
    errors, _, tracker = follow(coil, made, True, {"L-OM": 1.2})
    assert tracker.errors[made.channels.groups.index("L-OM")] == pytest.approx(0.2, abs=0.04)
    assert rms(errors) < rms(follow(coil, made, False, {"L-OM": 1.2})[0])


def test_corrections_keep_levels_within_bounds(coil, made):
    _, corrections, _ = follow(coil, made, True, dict.fromkeys(made.channels.groups, 0.3))
    levels = np.array([period.levels for period in made.periods]) + corrections
    assert levels.min() >= -1e-12 and levels.max() <= 1 + 1e-12 and abs(corrections).max() > 0.2


# Delay and noise


def test_a_known_delay_costs_only_what_cannot_be_foreseen(coil, made):
    """Weak muscles, seen 150 ms late; a tracker that takes the late measurement for the present one is worse than no feedback."""
    weak = {"R-OM": 0.8}

    class Unaware(Tracker):
        def correct(self, index, sight, *, clock=0.0, age=0):
            return super().correct(index, sight, clock=clock)

    prompt, late = (rms(follow(coil, made, gains=weak, delay=delay)[0]) for delay in (0, 3))
    unaware = rms(follow(coil, made, gains=weak, delay=3, tracker=Unaware(made))[0])
    assert late < 2 * prompt and late < 0.5 * unaware


def test_late_measurements_of_a_plant_as_modelled_ask_for_nothing(coil, made):
    errors, corrections, tracker = follow(coil, made, delay=2)
    assert abs(errors).max() < 1e-5 and abs(corrections).max() < 1e-5 and abs(tracker.errors).max() < 1e-5


def test_estimate_weighs_prediction_against_measurement(made):
    """The share of a measurement is that of the scalar Kalman filter where all covariances are multiples of one."""
    tracker = Tracker(made, adapt=False)
    doubt = made.final.noise**2
    x = 0.01 * np.ones(32)
    tracker.correct(0, Sight(made.periods[0].strains.reshape(8, 4) + x.reshape(8, 4), outputs_of(made.periods[0].held), np.diag(3 * doubt)))
    np.testing.assert_allclose(tracker._estimate, x / 4, rtol=1e-9)
    np.testing.assert_allclose(np.diag(tracker._doubt), 0.75 * doubt, rtol=1e-9)
    exactly = Tracker(made, adapt=False)
    exactly.correct(0, exact(made.periods[0].strains + x, made.periods[0].held))
    np.testing.assert_allclose(exactly._estimate, x, rtol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_not_taken_for_errors_of_the_model(coil, made, seed):
    errors, corrections, tracker = follow(coil, made, noise=0.01, seed=seed)
    trusting = Tracker(made)

    class Trusting(Tracker):
        def correct(self, index, sight, *, clock=0.0, age=0):
            return super().correct(index, exact(sight.strains, sight.outputs), clock=clock, age=age)

    bad, wild, _ = follow(coil, made, noise=0.01, seed=seed, tracker=Trusting(made))
    assert rms(errors) < 0.5 * rms(bad) and rms(corrections) < 0.5 * rms(wild)
    assert abs(tracker.errors[:-1]).max() < 0.1, (tracker.errors, trusting)


class Look:
    """An observation of an arm that is as the reduced model has it."""

    def __init__(self, model, strains, elements=None, position=0.0, angle=0.0, random=None):
        from octoctrl.sim.rotations import rotation_matrix

        arm = model.arm
        keep = np.arange(arm.elements) if elements is None else elements
        frames, points = model.frames(strains), model.points(strains)
        centres = model.stations[1:-1][keep]
        inner = arm.edges[1:-1] if elements is None else (centres[1:] + centres[:-1]) / 2
        self.edges = np.concatenate([[0.0], inner, [arm.length]])
        self.stations = np.concatenate([[0.0], centres, [arm.length]])
        self.frames = frames[np.concatenate([[0], keep + 1, [-1]])]
        self.points = np.stack([np.interp(self.edges, arm.edges, axis) for axis in points.T], axis=1)
        if random is not None:
            self.points = self.points + position * random.normal(size=self.points.shape)
            self.frames = rotation_matrix(angle * random.normal(size=(len(self.frames), 3))) @ self.frames


def curl(model):
    strains = model.rest.copy()
    strains[:, 0], strains[:, 2], strains[:, 3] = np.linspace(-10, -50, 8), 20.0, np.linspace(0.9, 1.1, 8)
    return strains


def test_observer_finds_the_strains(coil):
    _, model = coil
    pole, strains = (0.0, 0.0, 1.0), curl(coil[1])
    sight = Observer(model, pole).see(Look(model, strains))
    np.testing.assert_allclose(sight.strains[:, :3], strains[:, :3], atol=1e-6)
    np.testing.assert_allclose(sight.strains[:, 3], strains[:, 3], rtol=5e-3)
    np.testing.assert_allclose(sight.outputs, model.outputs(strains[None], pole)[0][0], atol=1e-4)
    part = Observer(model, pole).see(Look(model, strains, np.arange(1, 48, 3)))
    np.testing.assert_allclose(part.strains[:, :3], strains[:, :3], atol=0.2)
    np.testing.assert_allclose(part.strains[:, 3], strains[:, 3], rtol=0.04)


def test_observer_measures_the_noise_and_what_it_does_to_the_strains(coil):
    """Covariances against the scatter of repeated measurements, 0.5 mm and 1 degree; and stretches that noise does not lengthen."""
    _, model = coil
    random, strains = np.random.default_rng(5), curl(coil[1])
    observer, noise = Observer(model, (0.0, 0.0, 1.0)), (5e-4, np.radians(1.0))
    sights = [observer.see(Look(model, strains, None, *noise, random)) for _ in range(200)]
    np.testing.assert_allclose(np.sqrt(observer._variances), noise[::-1], rtol=0.1)
    found = np.array([sight.strains.ravel() for sight in sights[20:]])
    stated = np.sqrt(np.diag(np.mean([sight.noise for sight in sights[20:]], axis=0)))
    np.testing.assert_allclose(found.std(axis=0), stated, rtol=0.35)
    np.testing.assert_allclose(found.mean(axis=0).reshape(8, 4)[:, 3], strains[:, 3], atol=0.02)
    assert np.array([sight.outputs for sight in sights]).std(axis=0)[:2].max() < 0.02


# A clock that stands


@pytest.mark.parametrize("gain", [0.8, 1.0, 1.2])
def test_a_standing_clock_holds_the_pose(coil, made, gain):
    """The model under the levels of one instant would move on; feedback holds twist and writhe where they were planned."""
    plan, model = coil
    clock = 40 * made.period
    held = model.levels(plan.schedule.activation(), np.array([clock + model.lag]))[0]
    standing, pole = made.standing(clock), plan.task.convention.pole
    tracker, misses, moved = Tracker(made), [], standing.strains.reshape(8, 4)
    strains = moved
    for _ in range(60):
        seen = model.outputs(strains[None], pole)[0][0, :2]
        misses.append(seen - standing.held)
        given = corrected(made, model, held, tracker.correct(None, exact(strains, seen), clock=clock))
        strains = model.simulate((gain * np.clip(given, 0, 1))[None], [made.period], start=strains).strains[-1]
        moved = model.simulate(held[None], [made.period], start=moved).strains[-1]
    left_alone = np.abs(model.outputs(moved[None], pole)[0][0, :2] - standing.held).max()
    assert left_alone > 0.05 and np.abs(misses[-10:]).max() < 0.02, (left_alone, misses[-1])
    assert np.abs(misses).max() < 0.1


# Predictions


def test_a_period_is_predicted_by_the_model_from_wherever_the_arm_is(coil, made):
    """With its derivatives by the begin and by the gains; those of the linear form along the plan would miss by a third here."""
    _, model = coil
    period = made.periods[60]
    start, correction = 0.7 * period.strains, 0.05 * np.arange(len(made.channels))
    ahead = made.predicted(period, correction, start)

    def end(begin, gains=()):
        levels = corrected(made, model, period.activation, correction, period.shares)
        for group, gain in gains:
            levels[MUSCLE_GROUPS.index(group)] *= gain
        return model.simulate(np.clip(levels, 0, 1)[None], [period.step], start=begin.reshape(8, 4)).strains[-1].ravel()

    np.testing.assert_allclose(ahead.strains, end(start), rtol=1e-12)
    scale = design.strain_scale(model)
    way = 1e-5 * scale * np.random.default_rng(0).normal(size=32)
    change = (end(start + way) - end(start - way)) / 2
    np.testing.assert_allclose(ahead.transition @ way / scale, change / scale, atol=1e-4 * abs(change / scale).max())
    assert abs((period.linear.transition - ahead.transition) @ way / scale).max() > 0.1 * abs(change / scale).max()
    for column, group in enumerate(made.channels.groups):
        change = (end(start, [(group, 1 + 1e-4)]) - end(start, [(group, 1 - 1e-4)])) / 2e-4 / scale
        np.testing.assert_allclose(ahead.effect[:, column] / scale, change, atol=1e-4 * abs(change).max() + 1e-9)


def test_where_the_model_has_no_answer_the_watch_learns_nothing(coil, made):
    tracker, torn = Tracker(made), made.periods[0].strains + 30 * design.strain_scale(coil[1])
    tracker.correct(0, exact(torn, made.periods[0].held))
    assert not np.isfinite(made.predicted(made.periods[0], np.zeros(len(made.channels)), torn).strains).all()
    tracker.correct(1, exact(made.periods[1].strains, made.periods[1].held))
    assert tracker.watch.state()["count"] == 0


# Bias


def test_bias_is_what_the_linear_model_does_not_explain(made):
    tracker, x = Tracker(made), np.zeros(32)
    for k in range(40):  # the shape does what the linear model says, so that there is nothing to learn from it
        period = made.periods[k]
        topology = period.held + period.linear.slopes @ x + [0.05, -0.03]
        correction = tracker.correct(k, exact(period.strains + x, topology))
        x = period.linear.transition @ x + period.linear.influence @ correction
    assert abs(x).max() > 0.01
    np.testing.assert_allclose(tracker.bias, np.array([0.05, -0.03]) * (1 - (1 - BIAS_SHARE) ** 40), rtol=1e-6)
    assert abs(tracker.errors).max() < 1e-9


@pytest.mark.parametrize("jump", [2.0, -2.0, 4.0])
def test_crossings_are_no_bias(made, jump):
    """The Gauss writhe jumps by two where the arm crosses itself."""
    one, other = Tracker(made), Tracker(made)
    for k in range(10, 20):
        period = made.periods[k]
        smooth = one.correct(k, exact(period.strains, period.held + np.array([0.0, 0.1])))
        jumped = other.correct(k, exact(period.strains, period.held + np.array([0.0, 0.1 + jump])))
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
    tracker.correct(5, exact(made.periods[5].strains, made.periods[5].held + 0.3))
    assert (tracker.bias == 0).all() and (tracker.errors == 0).all()
