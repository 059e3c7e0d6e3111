"""Loads from outside: momentum that they give, places and directions, sums, and that nothing changes where there are none."""

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import Plant
from octoctrl.sim.rod.layout import Row
from octoctrl.sim.scene.loads import FORCE, TORQUE, PointLoad, SpreadLoad, sampled_loads
from octoctrl.sim.scene.scene import Scene

EDGES = np.array([0.0, 0.06, 0.1, 0.16, 0.2])
QUIET = oc.Activation()
BEND = oc.Activation(templates=(oc.Plateau(groups=("LM1", "R-OM"), level=0.3, rise=0.1),))


def total(load, times=(0.0,)):
    return sampled_loads((load,), np.asarray(times, dtype=float), EDGES)


# What a load becomes


@pytest.mark.parametrize("place", [0.0, 0.03, 0.1, 0.11, 0.2, None])
def test_a_point_load_acts_at_its_place(place):
    found = total(PointLoad(arclength=place, force=(1.0, 2.0, 3.0)))[0, FORCE]
    assert found.sum(axis=1) == pytest.approx([1, 2, 3])
    assert found @ EDGES == pytest.approx(np.array([1, 2, 3]) * (0.2 if place is None else place))
    assert (found[0] != 0).sum() <= 2


@pytest.mark.parametrize("window", [(0.0, np.inf), (0.02, 0.13), (0.11, 0.12), (0.15, 0.4)])
def test_a_spread_load_has_its_sum_and_its_middle(window):
    low, high = window[0], min(window[1], 0.2)
    found = total(SpreadLoad(force=(0.0, 5.0, 0.0), torque=(0.0, 0.0, 2.0), window=window))[0]
    assert found[FORCE, 1].sum() == pytest.approx(5 * (high - low))
    assert found[FORCE, 1] @ EDGES == pytest.approx(5 * (high - low) * (high + low) / 2)
    assert found[TORQUE, 2].sum() == pytest.approx(2 * (high - low)) and not found[TORQUE, :2].any()


def test_parts_make_the_whole():
    whole = total(SpreadLoad(force=(1.0, 0.0, 2.0)))
    parts = [SpreadLoad(force=(1.0, 0.0, 2.0), window=window) for window in ((0.0, 0.07), (0.07, 1.0))]
    assert sampled_loads(parts, np.zeros(1), EDGES) == pytest.approx(whole)
    assert sampled_loads((), np.zeros(1), EDGES) is None


def test_a_load_may_be_a_function_of_time():
    found = total(PointLoad(force=lambda time: (time, 0.0, -time)), [0.0, 0.5, 2.0])[:, FORCE, :, -1]
    assert np.array_equal(found, [[0, 0, 0], [0.5, 0, -0.5], [2, 0, -2]])


# What it does


def momenta(plant):
    """Linear and angular momentum of a rod, about the base."""
    rows, n, seen = plant.core.rows, plant.elements, plant.observe()
    moving = plant.core.node_mass[:, None] * seen.velocities
    spin = np.einsum("kij,ki->j", seen.frames[1:-1], rows[Row.INERTIA1 : Row.INERTIA3 + 1, 1 : n + 1].T * seen.spins)
    return moving.sum(axis=0), np.cross(seen.points, moving).sum(axis=0) + spin


def kicked(*loads, samples=4):
    """A rod in a vacuum that is loaded for so short a time that nothing has reached its base."""
    plant = Plant(scene=Scene(water=None, loads=loads), sample_interval=1e-4, dt=2e-5)
    plant.advance(QUIET, samples * 1e-4)
    return plant


@pytest.mark.parametrize("follower", [False, True])
def test_force_is_the_rate_of_momentum(follower):
    """At rest d1, d2, d3 are z, x, y."""
    load = PointLoad(arclength=0.17, force=(1e-3, 2e-3, 3e-3), follower=follower)
    momentum, angular = momenta(kicked(load))
    force = np.array([2e-3, 3e-3, 1e-3] if follower else [1e-3, 2e-3, 3e-3])
    assert momentum == pytest.approx(4e-4 * force, rel=2e-3)
    assert angular == pytest.approx(4e-4 * np.cross([0, 0.17, 0], force), rel=2e-3, abs=1e-12)


@pytest.mark.parametrize("follower", [False, True])
def test_torque_is_the_rate_of_angular_momentum(follower):
    load = PointLoad(arclength=0.15, torque=(1e-6, 2e-6, 3e-6), follower=follower)
    momentum, angular = momenta(kicked(load, samples=2))
    torque = np.array([2e-6, 3e-6, 1e-6] if follower else [1e-6, 2e-6, 3e-6])
    assert angular == pytest.approx(2e-4 * torque, rel=2e-3) and np.abs(momentum).max() < 1e-12


def test_a_load_is_linear_between_samples():
    """The midpoints of the steps integrate it without error."""
    momentum, _ = momenta(kicked(PointLoad(force=lambda time: (0.0, 0.0, 5.0 * time))))
    assert momentum[2] == pytest.approx(5.0 * (4e-4) ** 2 / 2, rel=2e-3)


def test_a_follower_is_the_lab_force_of_the_present_frame():
    """Against a plant that is given the force anew in every sample, in lab components that are read off the moving tip."""
    apart = []
    for sample in (1e-3, 5e-4):
        load = PointLoad(force=(0.0, 1e-3, 0.0), torque=(1e-5, 0.0, 0.0), follower=True)
        follower, guided, free = (Plant(sample_interval=sample, scene=Scene(loads=loads)) for loads in ((load,), (), ()))
        follower.advance(BEND, 0.3)
        free.advance(BEND, 0.3)
        for _ in range(round(0.3 / sample)):
            frame = guided.observe().frames[-2]
            guided.step(BEND, sample, loads=(PointLoad(force=tuple(1e-3 * frame[1]), torque=tuple(1e-5 * frame[0])),))
        tips = [plant.observe().points[-1] for plant in (follower, guided, free)]
        apart.append(np.linalg.norm(tips[0] - tips[1]) / np.linalg.norm(tips[0] - tips[2]))
    assert apart[1] < 0.02 and apart[1] < 0.6 * apart[0]


def test_no_load_and_a_load_of_nothing_have_the_same_bits():
    plain, loaded = Plant(), Plant(scene=Scene(loads=(PointLoad(), SpreadLoad(follower=True))))
    assert np.array_equal(plain.advance(BEND, 0.3).points, loaded.advance(BEND, 0.3).points)


def test_a_load_of_one_step_is_gone_in_the_next():
    plain, pushed = Plant(), Plant()
    pushed.step(np.zeros(11), 0.01, loads=(PointLoad(force=(0.0, 0.0, 0.01)),))
    assert np.abs(pushed.observe().velocities[-1]).max() > 1e-3
    pushed.reset()
    assert np.array_equal(plain.step({"LM1": 0.2}, 0.05).points, pushed.step({"LM1": 0.2}, 0.05).points)


def test_a_heavier_load_hangs_lower_and_a_turned_one_turns_the_shape():
    """Dead weight at the tip: twice the load, farther down; turned by a right angle about the axis, the same shape turned."""
    ends = []
    for force in ((0.0, 0.0, -1e-3), (0.0, 0.0, -2e-3), (-1e-3, 0.0, 0.0)):
        plant = Plant(scene=Scene(loads=(PointLoad(force=force),)))
        plant.advance(QUIET, 2.0)
        ends.append(plant.observe())
    assert 0 > ends[0].points[-1, 2] > ends[1].points[-1, 2]
    assert np.abs(ends[0].points[:, [2, 1, 0]] - ends[2].points).max() < 1e-9


# What is refused


NUMBERS = "three finite numbers are needed, or a function of time that gives them"
BAD = [
    (lambda: PointLoad(force=(1.0, 2.0)), f"load: force is (1.0, 2.0); {NUMBERS}"),
    (lambda: PointLoad(torque=(0, 0, float("nan"))), f"load: torque is (0, 0, nan); {NUMBERS}"),
    (lambda: PointLoad(arclength=-0.1), "load: arclength=-0.1 m is outside >= 0 m"),
    (lambda: total(PointLoad(arclength=0.3)), "load at 0.3 m: the arm ends at 0.2 m; leave arclength out for its tip"),
    (lambda: total(PointLoad(force=lambda time: 1.0)), f"load: force is 1.0; {NUMBERS}"),
    (lambda: SpreadLoad(window=(0.1, 0.1)), "load: window (0.1, 0.1) m: the begin must lie before the end"),
    (lambda: Scene(loads=(0.1,)), "loads: float 0.1 is none; give a tuple of PointLoad and SpreadLoad"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "message"), BAD, ids=range(len(BAD)))
def test_bad_loads_are_refused_in_a_sentence(call, message):
    with pytest.raises(OctoctrlError) as caught:
        call()
    assert str(caught.value) == message
