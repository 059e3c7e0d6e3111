"""Feedback of drives that act on parts of the arm, and of goals other than topology: where corrections act, what is held, its worth."""

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.planners.following.channels import Channels
from octoctrl.planners.following.design import SHAPE_NOISE, Course
from octoctrl.planners.following.held import LOOSE, TOPOLOGY_ERROR, Held
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.sources import Corrected
from octoctrl.sim.templates import Plateau, Wave

EDGES = np.linspace(0.0, 0.2, 41)


@pytest.fixture(scope="module")
def tip():
    return oc.plan("tip")


@pytest.fixture(scope="module")
def course(tip):
    return Course(tip, tip.model)


# Channels

PARTS = Activation(
    templates=(
        Plateau(groups=("LM1", "LM2"), level=0.3, window=(0.0, 0.08)),
        Plateau(groups=("LM2",), level=0.2, onset=2.0, window=(0.0, 0.08)),
        Plateau(groups=("LM2",), level=0.2, window=(0.08, 0.2)),
        Wave(groups=("LM1",), level=0.3, speed=0.1, width=2e-3, onset=0.5),
    ),
    composition="handover",
)


def test_templates_in_one_place_share_a_channel():
    channels = Channels(PARTS)
    assert [channel.group for channel in channels.each] == ["LM1", "LM1", "LM2", "LM2"] and channels.groups == ("LM1", "LM2")
    np.testing.assert_array_equal(channels.members, [[1, 0], [1, 0], [0, 1], [0, 1]])


def test_corrections_act_where_their_templates_do():
    """In the window, before and after the ramps too; a wave takes its correction along."""
    channels, times = Channels(PARTS), np.array([0.0, 1.0, 1.5])
    base, wave, low, high = np.moveaxis(channels.shares(times, EDGES), 1, 0)
    middles = (EDGES[1:] + EDGES[:-1]) / 2
    np.testing.assert_allclose(base, np.tile(middles < 0.08, (3, 1)), atol=1e-12)
    np.testing.assert_allclose(low, base)
    np.testing.assert_allclose(high, 1 - base, atol=1e-12)
    np.testing.assert_allclose(wave @ np.diff(EDGES), [0.0, 0.05, 0.1], atol=1e-3)
    source = Corrected(
        activation=PARTS, begin=1.0, period=0.5, clock=(1.0, 1.5), groups=tuple(channel.group for channel in channels.each),
        before=np.array([0.0, 0.0, 0.0, 0.1]), after=np.array([0.0, 0.0, 0.0, 0.1]), places=channels,
    )  # fmt: skip
    added = source.levels(times[1:], EDGES) - PARTS.levels(times[1:], EDGES)
    expected = np.zeros_like(added)
    expected[:, MUSCLE_GROUPS.index("LM2"), middles > 0.08] = 0.1
    np.testing.assert_allclose(added, expected, atol=1e-12)


def test_influence_and_disturbance_are_those_of_the_model(tip, course):
    """Of each channel where it acts, and of each group's gain on the levels that every section has."""
    model, k = tip.model, 20
    times = course.period * np.arange(1, k + 2)
    levels = model.levels(tip.schedule.activation(), times)
    strains = model.simulate(levels, course.steps[: k + 1]).strains[-2]
    shares = course.channels.shares(times[-1:] - model.lag, model.edges)[0]

    def by(change):
        ends = [model.simulate((levels[-1] + sign * change)[None], [course.period], start=strains).strains[-1].ravel() for sign in (1, -1)]
        return (ends[0] - ends[1]) / 2

    for index, channel in enumerate(course.channels.each):
        change = np.zeros_like(levels[-1])
        change[MUSCLE_GROUPS.index(channel.group)] = 1e-4 * shares[index]
        found, expected = 1e-4 * course.periods[k].linear.influence[:, index], by(change)
        assert abs(found - expected).max() < 0.02 * abs(expected).max(), channel
    for index, group in enumerate(course.channels.groups):
        change = np.zeros_like(levels[-1])
        change[MUSCLE_GROUPS.index(group)] = 1e-3 * levels[-1][MUSCLE_GROUPS.index(group)]
        found, expected = 1e-3 * course.periods[k].linear.disturbance[:, index], by(change)
        assert abs(found - expected).max() < 0.02 * abs(expected).max(), group


# What is held


def held_of(plan):
    return Held(plan.task, (*plan.phase_begins.values(), plan.schedule.duration), plan.model)


def test_slopes_of_what_is_held_are_its_differences(tip):
    held, model = held_of(tip), tip.model
    time, none = np.array([1.0]), np.zeros(32)
    strains = np.array([np.interp(1.0, tip.time, row) for row in tip.strains.reshape(len(tip.time), -1).T]).reshape(1, 8, 4)
    found, steps = held.along(time, strains, none), 1e-5 * np.eye(32).reshape(32, 1, 8, 4)
    assert found.values.shape == (1, 10) and model.sections == 8
    differences = [
        (held.along(time, strains + step, none).values - held.along(time, strains - step, none).values)[0] / 2e-5 for step in steps
    ]
    np.testing.assert_allclose(found.slopes[0].T, differences, atol=1e-6)


def test_goals_are_aimed_at_from_when_they_have_to_hold(tip):
    """And weigh more and more until then, a band as much as all of its tolerance; of a straight arm nothing is known."""
    held, model = held_of(tip), tip.model
    begin, end = tip.phase_begins["hold"], tip.schedule.duration
    full = end - 0.5
    times = np.array([begin, 0.5 * (begin + full), end - 0.1, end + 3.0])
    along = held.along(times, np.repeat(tip.strains[-1:], 4, axis=0), np.zeros(32))
    np.testing.assert_allclose(along.weights[:, :2], LOOSE**-2)
    np.testing.assert_allclose(along.weights[:, 6] * 0.0012**2, [0.05**2, 0.25, 1.0, 1.0], rtol=1e-5)
    assert along.weights[-1, 9] == pytest.approx(0.1**-2)
    assert (along.weights[2:, 2:6] == 0).all() and along.weights[0, 2] > 0  # the phase before ends where this one begins
    missed = model.points(tip.strains[-1])[-1] - np.array([0.06, 0.09, 0.035])
    np.testing.assert_allclose(along.aims[:, 6:9], np.outer([0, 0, 1, 1], missed), atol=1e-9)
    assert held.along(times, np.repeat(tip.strains[:1], 4, axis=0), SHAPE_NOISE * 200 * np.ones(32)).weights[-1, 9] < 1


def test_topology_is_held_tightly_where_goals_read_it():
    coil = oc.plan("coil")
    along = held_of(coil).along(np.zeros(1), coil.strains[:1], np.zeros(32))
    assert along.values.shape == (1, 2)
    np.testing.assert_allclose(along.weights, TOPOLOGY_ERROR**-2)


# What it is worth on the rod


@pytest.mark.parametrize("feedback", ["tvlqr", "mpc"])
def test_feedback_halves_what_the_tip_misses(tip, feedback):
    missed = {}
    for name in ("open-loop", feedback):
        checks = {check.name: check for check in oc.verify(oc.execute(tip, feedback=name)).checks}
        missed[name] = checks["hold.tip"].value
    assert missed[feedback] < 0.5 * missed["open-loop"] < 0.006


def test_feedback_betters_a_helix_of_three_windows():
    plan = oc.plan("lm-helix")
    opened, closed = (
        {check.name: check.value for check in oc.verify(oc.execute(plan, feedback=name)).checks} for name in ("open-loop", "tvlqr")
    )
    assert closed["curl.lifted_writhe"] < 0.6 * opened["curl.lifted_writhe"] and closed["writhe_rms"] < 0.6 * opened["writhe_rms"]
