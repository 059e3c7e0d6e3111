"""Margins of the feedback: against closed forms, against the loop itself, against the whole map as one matrix."""

from types import SimpleNamespace

import numpy as np
import pytest

from octoctrl import tasks
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.following.design import Course
from octoctrl.planners.following.margins import delay_margin, disk_margin, induced_gain, margins
from octoctrl.planners.solving import planner

PERIOD = 0.05


def scalar(a, b, k, count=5, slope=1.0):
    """A course of one strain and one channel."""
    linear = SimpleNamespace(transition=np.array([[a]]), influence=np.array([[b]]), slopes=np.array([[slope]]))
    period = SimpleNamespace(linear=linear, gain=np.array([[k]]), closed=lambda: np.array([[a - b * k]]))
    return SimpleNamespace(period=PERIOD, channels=("R-OM",), periods=(period,) * count, final=period)


@pytest.fixture(scope="module")
def course():
    configuration = tasks.load("coil")
    plan = planner.plan(configuration.task, load_identified(configuration.arm, configuration.scene), time_limit=600.0)
    return Course(plan, plan.model)


def test_disk_margin_of_one_loop_is_that_of_its_closed_form():
    """L = k / (z - a) at z = -1, where S - 1/2 is largest."""
    a, k = 0.5, 0.6
    sensitivity = 1 / (1 + k / (-1 - a))
    assert disk_margin(scalar(a, 1.0, k)) == pytest.approx(1 / abs(sensitivity - 0.5), rel=1e-6)


def test_disk_margin_agrees_with_python_control(course):
    """Its state-space system, loop closed by itself, and its frequency response."""
    import control

    final, groups = course.final, len(course.channels)
    loop = control.ss(final.linear.transition, final.linear.influence, final.gain, np.zeros((groups, groups)), course.period)
    sensitivity = control.feedback(control.ss([], [], [], np.eye(groups), course.period), loop)
    omega = np.geomspace(0.01, 1.0, 400) * np.pi / course.period
    response = np.moveaxis(np.asarray(sensitivity(np.exp(1j * course.period * omega), squeeze=False)), -1, 0)
    peak = np.linalg.norm(response - np.eye(groups) / 2, 2, axis=(1, 2)).max()
    assert disk_margin(course) == pytest.approx(1 / peak, rel=1e-3)


def stable(course, factors, late=0):
    """Whether the standing clock is under feedback whose groups answer by `factors`, `late` periods later, tried by simulating it."""
    linear, gain = course.final.linear, course.final.gain
    x, held = np.random.default_rng(0).normal(size=len(gain[0])), [np.zeros(len(gain))] * late
    sizes = []
    for _ in range(3000):
        held = [*held, -gain @ x]
        x = linear.transition @ x + linear.influence @ (factors * held.pop(0))
        sizes.append(np.linalg.norm(x))
        if sizes[-1] > 1e12:
            return False
    return sizes[-1] < 1e-3 * sizes[0]


def test_gains_within_the_disk_keep_the_loop_stable(course):
    draw, gain = np.random.default_rng(1), margins(course)["gain"]
    assert 1.2 < gain < np.inf
    for _ in range(4):
        factors = np.exp(draw.uniform(-1, 1, size=len(course.channels)) * np.log(0.999 * gain))
        assert stable(course, factors)


def test_one_period_more_than_the_delay_margin_is_too_much(course):
    late = round(delay_margin(course) / course.period)
    unit = np.ones(len(course.channels))
    assert late >= 1 and stable(course, unit, late) and not stable(course, unit, late + 1)


def test_delay_margin_of_one_loop():
    """x+ = x - k x, late by one period: stable up to k = 1."""
    assert delay_margin(scalar(1.0, 1.0, 0.99)) >= PERIOD and delay_margin(scalar(1.0, 1.0, 1.01)) == 0.0


def test_induced_gain_is_the_largest_singular_value_of_the_whole_map():
    made = scalar(0.9, 0.3, 1.0, count=6, slope=2.0)
    closed = 0.9 - 0.3
    whole = np.array([[2.0 * 0.3 * closed ** (row - column) if row >= column else 0.0 for column in range(6)] for row in range(6)])
    assert induced_gain(made) == pytest.approx(np.linalg.norm(whole, 2), rel=1e-3)
