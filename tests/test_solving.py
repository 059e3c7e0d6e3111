"""Parts of the planner: numbers with slopes, least squares in a box, rows of a task, its price, the optimiser, doubt."""

from copy import copy
from dataclasses import replace
from itertools import islice

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares, lsq_linear

from octoctrl import tasks
from octoctrl.planners.asking.primitives import Bend, BendWave, Twist
from octoctrl.planners.asking.registry import goal
from octoctrl.planners.asking.schedule import Schedule
from octoctrl.planners.asking.task import Drive, Phase, Task
from octoctrl.planners.contracts import When
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.model.stepping import simulate
from octoctrl.planners.solving.doubt import doubt
from octoctrl.planners.solving.least_squares import Box, bounded_step, fit
from octoctrl.planners.solving.optimiser import BAND, OPENING, _Constraints, objective, optimise
from octoctrl.planners.solving.problem import GUARD, GUARD_SCALE, SAMPLE, Problem
from octoctrl.planners.solving.search import COARSE, Search
from octoctrl.planners.solving.slopes import Slopes, SlopesMath
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.templates import Plateau, Wave

COIL = tasks.load("coil").task.on(Arm())


@pytest.fixture(scope="module")
def model():
    return load_identified(Arm.octopus()).model


@pytest.fixture(scope="module")
def problem(model):
    return Problem(COIL, model)


# Numbers with slopes


def templates(numbers, math):
    level, onset, rise, fall, speed = numbers
    offset = onset + 2 * rise + level**2
    return Activation(
        templates=(
            Plateau(groups=("R-OM",), level=level, onset=onset, rise=rise, offset=offset, fall=fall, window=(0.0, 0.11)),
            Wave(groups=("R-OM",), level=0.8 - level, onset=onset / 2, speed=speed, width=0.01, offset=offset),
            Wave(groups=("R-OM",), level=level, onset=2 * onset, speed=speed, width=0.02, offset=3 * offset, end_level=0.3),
        ),
        composition="handover",
    )


def test_slopes_of_composed_activation_are_central_differences():
    x, edges, times = np.array([0.3, 0.4, 0.7, 0.5, 0.13]), np.linspace(0.0, 0.2, 9), np.linspace(0.05, 6.0, 60)
    numbers = [Slopes(value, row) for value, row in zip(x, np.eye(5), strict=True)]
    found = templates(numbers, SlopesMath).compose(SlopesMath, "R-OM", times[:, None], edges[:-1], edges[1:])
    np.testing.assert_allclose(found.value, templates(x, np).levels(times, edges)[:, MUSCLE_GROUPS.index("R-OM")], atol=1e-12)
    slopes = np.broadcast_to(found.slope, (*found.value.shape, 5))
    for index, shift in enumerate(1e-6 * np.eye(5)):
        plus, minus = (templates(x + s * shift, np).levels(times, edges)[:, MUSCLE_GROUPS.index("R-OM")] for s in (1, -1))
        np.testing.assert_allclose(slopes[..., index], (plus - minus) / 2e-6, atol=1e-5)


@given(st.floats(0.2, 3.0), st.floats(0.2, 3.0))
@settings(max_examples=30, deadline=None)
def test_slopes_follow_the_rules_of_differentiation(a, b):
    x, y = Slopes(a, [1.0, 0.0]), Slopes(b, [0.0, 1.0])
    u, v = ca.SX.sym("u"), ca.SX.sym("v")
    for formula in (
        lambda m, p, q: p * q - p / q + 2 / p - (3 - q) * -p,
        lambda m, p, q: m.exp(-p) * m.cos(q) + m.sin(p * q) + m.log1p(p + q),
        lambda m, p, q: m.fmax(p, q) * m.fmin(p, 1.7) + m.fabs(p - q) + p**3,
    ):
        if abs(a - b) < 1e-6 or abs(a - 1.7) < 1e-6:
            continue
        found, expected = formula(SlopesMath, x, y), formula(ca, u, v)
        exact = ca.Function("exact", [u, v], [expected, ca.gradient(expected, ca.vertcat(u, v))])(a, b)
        assert float(found.value) == pytest.approx(float(exact[0]), rel=1e-12)
        np.testing.assert_allclose(found.slope, np.asarray(exact[1]).ravel(), rtol=1e-10, atol=1e-12)


# Handover


def test_handover_takes_over_from_the_level_that_it_finds_and_gives_back_what_lies_beneath():
    low, high = (
        Plateau(groups=("LM1",), level=0.5, rise=0.2),
        Plateau(groups=("LM1",), level=0.1, onset=1.0, rise=0.5, offset=3.0, fall=0.5),
    )
    levels = Activation(templates=(low, high), composition="handover").levels(np.array([0.9, 1.25, 2.0, 3.25, 4.0]), np.array([0.0, 0.2]))
    np.testing.assert_allclose(levels[:, 0, 0], [0.5, 0.3, 0.1, 0.3, 0.5], atol=1e-12)


def test_a_lone_template_is_handed_over_what_it_always_was():
    for template in (Plateau(groups=("TM",), level=0.4, offset=2.0), Wave(groups=("TM",), level=0.4, speed=0.1, width=0.01, offset=2.0)):
        times, edges = np.linspace(0, 4, 81), np.linspace(0, 0.2, 9)
        one, other = (Activation(templates=(template,), composition=name).levels(times, edges) for name in ("handover", "add"))
        np.testing.assert_allclose(one, other, atol=1e-12)


@given(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=5), st.floats(0.0, 2.0))
@settings(max_examples=50, deadline=None)
def test_levels_that_are_handed_over_stay_between_those_of_the_templates(levels, onset):
    parts = tuple(Plateau(groups=("TM",), level=level, onset=onset * k, offset=2 * onset * k + 1) for k, level in enumerate(levels))
    found = Activation(templates=parts, composition="handover").levels(np.linspace(0, 8, 60), np.array([0.0, 0.2]))
    assert 0 <= found.min() and found.max() <= max(levels) + 1e-12


# Least squares


@given(st.integers(0, 10**6))
@settings(max_examples=40, deadline=None)
def test_bounded_step_is_the_minimum_in_the_box(seed):
    draw = np.random.default_rng(seed)
    matrix, rows = draw.normal(size=(7, 5)), draw.normal(size=7)
    low, high = -draw.uniform(0, 1, 5), draw.uniform(0, 1, 5)
    step = bounded_step(matrix, rows, 1e-12, low, high)
    assert (step >= low).all() and (step <= high).all()
    np.testing.assert_allclose(step, lsq_linear(matrix, -rows, (low, high), method="bvls", tol=1e-14).x, atol=1e-6)


@pytest.mark.parametrize("upper", [2.0, 0.5])
def test_fit_finds_what_scipy_finds_on_rosenbrock(upper):
    def values(x):
        return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])

    def slopes(x):
        return values(x), np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])

    box = Box(np.array([-2.0, -2.0]), np.array([upper, 2.0]), np.ones(2))
    found = fit(values, slopes, np.array([-1.2, 1.0]), box, enough=1e-9, iterations=200)
    expected = least_squares(values, [-1.2, 1.0], bounds=(box.lower, box.upper), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    np.testing.assert_allclose(found.x, expected.x, atol=2e-3)


# Rows


def test_unknowns_are_the_durations_and_what_drives_leave_free(problem):
    assert problem.names[:2] == ["store.duration", "open.duration"] and problem.names[-1] == "counter_twist.rise"
    assert problem.box.lower[problem.names.index("twist.level")] == 0.0


@pytest.mark.parametrize(("laws", "tolerance"), [("generic", 1e-6), ("known", 1e-3)])  # the known laws have kinks
def test_slopes_of_the_rows_are_central_differences(laws, tolerance):
    problem = Problem(COIL, load_identified(Arm.octopus(), laws=laws).model).with_guard(1.9)
    x = problem.start * (1 + 0.1 * np.random.default_rng(0).uniform(-1, 1, len(problem.start)))
    grid = problem.grid(x, COARSE)
    reading = problem.read(x, grid, slopes=True)
    assert len(reading.rows) > len(reading.misses) + 5  # the guard takes part
    np.testing.assert_allclose(reading.rows, problem.read(x, grid).rows, atol=1e-9)
    for index, shift in enumerate(np.diag(1e-5 * problem.box.scale)):
        plus, minus = problem.read(x + shift, grid), problem.read(x - shift, grid)
        for name, slopes in (("misses", reading.miss_slopes), ("openings", reading.opening_slopes)):
            expected = (getattr(plus, name) - getattr(minus, name)) / (2 * shift.sum())
            size = max(abs(expected).max(), 0.1 / problem.box.scale[index])
            assert abs(slopes[:, index] - expected).max() < tolerance * size, problem.names[index]


def test_what_was_read_before_changes_nothing_that_is_read_now(model):
    """Motions begin their iterations from a similar one; where they end does not hang on that."""
    used, shift = Problem(COIL, model), np.random.default_rng(1).uniform(-0.2, 0.2, len(Problem(COIL, model).start))
    grid, far = used.grid(used.start, COARSE), used.vector(dict(zip(used.names, used.start * (1 + shift), strict=True)))
    used.read(used.start, grid, slopes=True)
    for x in (far, used.start, far):
        for slopes in (False, True):
            found, fresh = used.read(x, grid, slopes), Problem(COIL, model).read(x, grid, slopes)
            np.testing.assert_allclose(found.misses, fresh.misses, atol=1e-7)
            if slopes:
                np.testing.assert_allclose(found.miss_slopes, fresh.miss_slopes, atol=1e-4 * abs(fresh.miss_slopes).max())
    for other in (
        used.on(replace(model, parameters=replace(model.parameters, linear_drag=2.0))),
        used.with_durations(used.start[:5] + 0.1),
    ):
        x = np.clip(used.start, other.box.lower, other.box.upper)
        fresh = copy(other)
        fresh.last = fresh.sloped = None
        np.testing.assert_allclose(other.read(x, grid).misses, fresh.read(x, grid).misses, atol=1e-7)


def wound(writhe, twist):
    """One hand, one bend, the other hand, in one phase."""
    first, second = ("L-OM", "R-OM") if writhe > 0 else ("R-OM", "L-OM")
    goals = goal("lifted_writhe", value=writhe, tolerance=0.15), goal("twist", value=twist, tolerance=0.1)
    drives = (
        Drive(name="store", primitive=Twist(hand=first, level=0.2), begins="wind", free=("level", "rise")),
        Drive(name="bend", primitive=Bend(side="LM1", level=0.2), begins="wind", free=("level", "rise")),
        Drive(name="back", primitive=Twist(hand=second, level=0.1), begins="wind", free=("level", "rise")),
    )
    return Task(name="wound", phases=(Phase(name="wind", duration=1.8, goals=goals),), drives=drives).on(Arm())


def test_one_programme_says_nothing_of_another(model):
    """From the motion of another programme the iterations would end at roots that nothing leads to, or nowhere."""
    used, fresh = (Problem(wound(0.9, -0.3), model) for _ in range(2))
    grid = used.grid(used.start, COARSE)
    for x in islice(Search(used, lambda: False)._samples(), 12):
        found, fresh.last = used.read(x, grid, slopes=True), None
        np.testing.assert_allclose(found.misses, fresh.read(x, grid).misses, atol=1e-4)


@pytest.mark.parametrize(("writhe", "twist"), [(-1.298, 0.411), (0.923, -0.255)])
def test_searches_leave_the_dead_end_of_an_arm_that_does_not_bend(model, writhe, twist):
    """Straight, it meets the goal of twist; that bending would give it writhe does not show in slopes."""
    problem = Problem(wound(writhe, twist), model)
    assert Search(problem, lambda: False).run(problem.start).solved
    straight = problem.vector({"bend.level": 0.0, "store.level": 0.05})
    assert Search(problem, lambda: False).promised(straight) == pytest.approx(abs(writhe) / 0.15, abs=0.1)


def test_misses_are_evened_out_where_one_is_near_its_tolerance(model):
    """Two goals that cannot both be met, one twice as tight: the sums of squares and of sixth powers of what they miss, in closed form."""
    phase = wound(0.9, 0.0).phases[0]
    twists = goal("twist", value=-0.3, tolerance=0.1), goal("twist", value=-0.1, tolerance=0.2)
    drive = Drive(name="store", primitive=Twist(hand="R-OM", level=0.1), begins="wind", free=("level", "rise"))
    problem = Problem(Task(name="torn", phases=(replace(phase, goals=twists),), drives=(drive,)).on(Arm()), model)
    search = Search(problem, lambda: False)
    x, reading = search.finished(search.fitted(problem.start, COARSE, 15, largest=0.5))
    _, evened = search.evened(x, reading)
    assert reading.worst == pytest.approx(0.8, abs=0.02) and evened.worst == pytest.approx(0.2 / (0.2 + 0.1 * 0.5**0.2), abs=0.005)


def test_slopes_of_what_was_just_simulated_need_no_simulation(model, monkeypatch):
    count = 0

    def counted(*arguments):
        nonlocal count
        count += 1
        return simulate(*arguments)

    monkeypatch.setattr("octoctrl.planners.solving.problem.simulate", counted)
    problem = Problem(COIL, model)
    grid = problem.grid(problem.start, COARSE)
    problem.read(problem.start, grid)
    problem.read(problem.start, grid, slopes=True)
    problem.read(problem.start, grid)
    assert count == 1
    problem.read(problem.start, problem.grid(problem.start, 0.05))
    assert count == 2


def test_goals_hold_at_the_steps_that_they_name(model):
    drive = Drive(name="twist", primitive=Twist(hand="R-OM", level=0.2), begins="a")
    held = goal("twist", value=-0.5, tolerance=0.1, hold=0.5)
    always = goal("length", value=0.2, tolerance=0.01, when=When.THROUGHOUT)
    task = Task(
        name="t", phases=(Phase(name="a", duration=1.0, goals=(held,)), Phase(name="b", duration=2.0, goals=(always,))), drives=(drive,)
    )
    problem = Problem(task, model)
    grid = problem.grid(problem.start, 0.1)
    assert grid.steps == (10, 20) and grid.instants == (range(5, 11), range(10, 31))
    assert problem.guarded == 0 and problem.read(problem.start, grid).opening == 2.0  # nothing reads writhe


def test_guard_stands_up_to_the_last_goal_that_reads_writhe(problem):
    assert problem.guarded == 4
    grid = problem.grid(problem.start, COARSE)
    reading = problem.with_guard(3.0).read(problem.start, grid)
    assert len(reading.openings) == sum(grid.steps[:4]) + 1 and len(reading.rows) == len(reading.misses) + len(reading.openings)
    np.testing.assert_allclose(reading.rows[len(reading.misses) :], (3.0 - reading.openings) / GUARD_SCALE)
    assert GUARD > 0.2 and problem.with_guard(0.0).read(problem.start, grid).opening == 2.0


def test_writhe_is_followed_through_its_branches(model):
    """Three turns of twist in a bent arm: the area that the tangent sweeps is known up to two turns at each instant."""
    bend = Drive(name="bend", primitive=BendWave(side="LM1", level=0.4, speed=0.1), begins="a")
    twist = Drive(name="twist", primitive=Twist(hand="L-OM", level=0.4), begins="b")
    phases = tuple(Phase(name=name, duration=3.0, goals=(goal("lifted_writhe", value=0.0, tolerance=1.0),)) for name in "ab")
    problem = Problem(Task(name="t", phases=phases, drives=(bend, twist)), model)
    motion = model.respond(problem.schedule(problem.start)[1].activation(), 6.0, step=0.02)
    expected = model.trace(motion.time, motion.strains).at(np.array([3.0, 6.0])).lifted_writhe
    np.testing.assert_allclose(problem.read(problem.start, problem.grid(problem.start, 0.02)).misses, expected, atol=1e-6)


# Price, optimiser, doubt


def test_price_is_what_the_module_says(problem):
    """Integrals of the effort and of the ramps, by quadrature of the activation itself."""
    begins, schedule = problem.schedule(problem.start)
    time = np.linspace(0.0, schedule.duration, 20001)
    effort, smoothness = 0.0, 0.0
    for drive, primitive in zip(COIL.drives, schedule.primitives, strict=True):
        (template,) = primitive.templates()
        lone = Schedule(primitives=(primitive,), duration=schedule.duration).activation()
        level = lone.levels(time, np.array([0.05, 0.1]))[:, MUSCLE_GROUPS.index(template.groups[0]), 0]
        on = level[(time >= begins[drive.begins]) & (time <= primitive.onset + primitive.rise)]
        smoothness += np.sum(np.diff(on) ** 2) / (time[1] - time[0])
        if drive.ends:
            off = level[(time >= primitive.offset) & (time <= primitive.offset + primitive.fall)]
            smoothness += np.sum(np.diff(off) ** 2) / (time[1] - time[0])
        effort += primitive.level**2 * (min(primitive.offset, schedule.duration) - primitive.onset)
    expected = COIL.time_weight * schedule.duration + COIL.effort_weight * effort + COIL.smoothness_weight * smoothness
    assert float(objective(problem, 0.0)(problem.start)) == pytest.approx(expected, rel=2e-3)


def test_price_asks_for_levels_as_slow_as_those_the_model_knows(problem):
    fast = np.array(problem.start)
    fast[problem.names.index("twist.rise")] = 0.1
    excess = np.pi / 2 * 0.16 / 0.1 / 1.5 - 1
    more = float(objective(problem, 1.5)(fast)) - float(objective(problem, 0.0)(fast))
    assert more == pytest.approx(4.5 * excess**2, rel=1e-6)


def test_price_asks_for_one_oblique_family_at_a_time(model):
    phases = (Phase(name="a", duration=1.0), Phase(name="b", duration=1.0))
    both = tuple(Drive(name=hand, primitive=Twist(hand=hand, level=0.3), begins="a", ends="b") for hand in ("R-OM", "L-OM"))
    one = (both[0], replace(both[1], begins="b", ends=""))
    prices = [float(objective(p, 0.0)(p.start)) for p in (Problem(Task(name="t", phases=phases, drives=d), model) for d in (both, one))]
    assert prices[0] - prices[1] > 3


def test_optimiser_keeps_goals_guard_and_bounds_and_lowers_the_price(problem):
    found = Search(problem, lambda: False).run(problem.start)
    price = objective(problem, 1.84)
    ended = optimise(problem, found.x, found.reading, price, lambda: False)
    assert (ended.x >= problem.box.lower).all() and (ended.x <= problem.box.upper).all()
    ends = np.cumsum(ended.x[: len(COIL.phases)]) / SAMPLE
    np.testing.assert_allclose(ends, np.round(ends), atol=1e-9)  # the plant knows its shape where phases end
    reading = Problem(COIL, problem.model).read(ended.x, problem.grid(ended.x, 0.02))
    np.testing.assert_allclose(ended.reading.misses, reading.misses, atol=1e-7)
    assert reading.shares.max() < BAND + 0.1 and reading.opening > OPENING - 0.05
    assert float(price(ended.x)) < 0.8 * float(price(found.x))


def test_rounding_beyond_a_bound_is_not_taken_for_a_wrong_level(problem):
    """A drive that is not needed ends at level 0, which the quadratic programmes hit from either side."""
    x = np.where([name == "curl.level" for name in problem.names], -1e-17, problem.start)
    grid = problem.grid(problem.start, COARSE)
    first = problem.read(problem.start, grid)
    constraints = _Constraints(problem, grid, len(first.misses) + len(first.openings))
    found = np.asarray(constraints(x / problem.box.scale)).ravel()
    np.testing.assert_allclose(found[: len(first.misses)], problem.read(np.maximum(x, 0.0), grid).misses)


def test_optimiser_stops_when_told(problem):
    found = Search(problem, lambda: False).run(problem.start)
    ended = optimise(problem, found.x, found.reading, objective(problem, 1.84), lambda: True)
    assert ended.iterations == 0
    np.testing.assert_array_equal(ended.x, found.x)


def test_doubt_grows_with_what_errors_of_the_model_do(problem):
    x = problem.start
    reading = problem.read(x, problem.grid(x, 0.02))
    schedule = problem.schedule(x)[1]
    usual = doubt(problem, x, reading, schedule)
    # Tolerances half as wide: twice the spread.
    halved = replace(COIL, phases=tuple(
        replace(phase, goals=tuple(replace(item, tolerance=item.tolerance / 2) for item in phase.goals)) for phase in COIL.phases
    ))  # fmt: skip
    strict = doubt(Problem(halved, problem.model), x, reading, schedule)
    np.testing.assert_allclose(strict.spread, 2 * usual.spread, rtol=1e-9)
    assert usual.spread.min() > 0.02 and any("small errors of the model move" in reason for reason in strict.reasons)
    fast = problem.schedule(np.where([name.endswith("rise") for name in problem.names], 0.1, x))[1]
    assert np.pi / 2 * max(primitive.level for primitive in fast.primitives) / 0.1 > 4
    assert any("per second" in reason for reason in doubt(problem, x, reading, fast).reasons)
