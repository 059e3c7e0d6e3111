"""Sensors: what is seen of an arm is what was there, later, rougher, rarer, or in fewer places."""

import numpy as np
import pytest

from octoctrl.sim.activation import Activation
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import Plant
from octoctrl.sim.running.observation import Observation
from octoctrl.sim.running.sensors import Sensors
from octoctrl.sim.templates import Plateau

FIELDS = ("points", "frames", "stretch", "velocities", "spins")


def still(time, elements=400):
    """An arm at rest along +y, with many elements for statistics."""
    edges = np.linspace(0.0, 0.2, elements + 1)
    points = np.zeros((elements + 1, 3))
    points[:, 1] = edges
    return Observation(
        time=time, points=points, frames=np.broadcast_to(np.eye(3), (elements + 2, 3, 3)).copy(), edges=edges,
        stations=np.concatenate([[0.0], (edges[1:] + edges[:-1]) / 2, [0.2]]), stretch=np.ones(elements),
        velocities=np.zeros((elements + 1, 3)), spins=np.zeros((elements, 3)),
    )  # fmt: skip


@pytest.fixture(scope="module")
def moved():
    plant = Plant()
    plant.advance(Activation(templates=(Plateau(groups=("LM1", "R-OM"), level=0.3, rise=0.1),)), 0.5)
    return plant.observe()


def test_perfect_sensors_see_the_arm(moved):
    assert Sensors().start().see(moved) == moved


@pytest.mark.parametrize(
    ("name", "field"),
    [("position_noise", "points"), ("stretch_noise", "stretch"), ("velocity_noise", "velocities"), ("spin_noise", "spins")],
)
def test_noise_has_its_size_and_touches_nothing_else(name, field):
    there = still(0.0)
    seen = Sensors(**{name: 1e-3}).start().see(there)
    away = getattr(seen, field) - getattr(there, field)
    assert away.std() == pytest.approx(1e-3, rel=0.1) and abs(away.mean()) < 2e-4
    assert all(np.array_equal(getattr(seen, other), getattr(there, other)) for other in FIELDS if other != field)


def test_noise_of_angles_turns_frames_and_leaves_them_orthonormal():
    there = still(0.0)
    seen = Sensors(angle_noise=0.02).start().see(there)
    assert np.abs(seen.frames @ np.swapaxes(seen.frames, 1, 2) - np.eye(3)).max() < 1e-12
    turned = np.stack([seen.frames[:, 1, 2], seen.frames[:, 2, 0], seen.frames[:, 0, 1]])
    assert turned.std(axis=1) == pytest.approx(0.02, rel=0.15)
    assert np.array_equal(seen.points, there.points)


def test_a_seed_is_a_run():
    def run(**more):
        readings = Sensors(position_noise=1e-3, **more).start()
        return [readings.see(still(0.01 * k, 8)).points for k in range(3)]

    first = run(seed=3)
    assert np.array_equal(first, run(seed=3)) and not np.array_equal(first, run(seed=4))
    assert not np.array_equal(first[0], first[1])
    assert np.array_equal(first, run(seed=3, angle_noise=0.1)), "one kind of noise does not change another"


@pytest.mark.parametrize(
    ("delay", "period", "seen"),
    [
        (0.0, None, [0, 1, 2, 3, 4, 5, 6]),
        (0.02, None, [0, 0, 0, 1, 2, 3, 4]),
        (0.025, None, [0, 0, 0, 0, 1, 2, 3]),
        (0.0, 0.03, [0, 0, 0, 3, 3, 3, 6]),
        (0.02, 0.03, [0, 0, 0, 0, 0, 3, 3]),
    ],
)
def test_delay_and_rate(delay, period, seen):
    readings = Sensors(delay=delay, period=period).start()
    assert [round(100 * readings.see(still(0.01 * k, 8)).time) for k in range(7)] == seen


def test_a_reading_stays_as_it_was_read():
    readings = Sensors(position_noise=1e-3, period=0.05).start()
    first, again = readings.see(still(0.0, 8)), readings.see(still(0.02, 8))
    assert np.array_equal(first.points, again.points)


def test_going_back_in_time_begins_a_new_run():
    readings = Sensors(delay=0.02).start()
    for k in range(5):
        readings.see(still(0.01 * k, 8))
    assert readings.see(still(0.0, 8)).time == 0.0


@pytest.mark.parametrize("stations", [5, (0, 7, 20, 33, 47)])
def test_fewer_stations_are_an_arm_of_fewer_elements(moved, stations):
    seen = Sensors(stations=stations).start().see(moved)
    assert len(seen.points) == 6 and len(seen.frames) == 7 and len(seen.stretch) == len(seen.spins) == 5
    assert seen.edges == pytest.approx(np.concatenate([[0], (seen.stations[1:-2] + seen.stations[2:-1]) / 2, [0.2]]))
    for station, frame in zip(seen.stations, seen.frames, strict=True):
        assert np.array_equal(frame, moved.frames[np.flatnonzero(moved.stations == station)[0]])
    assert np.array_equal(seen.points[[0, -1]], moved.points[[0, -1]])
    assert seen.stretch @ np.diff(seen.edges) == pytest.approx(moved.stretch @ np.diff(moved.edges))
    # Points lie on the arm: on the straight piece between the two nodes beside them.
    for edge, point in zip(seen.edges[1:-1], seen.points[1:-1], strict=True):
        k = int(np.searchsorted(moved.edges, edge)) - 1
        share = (edge - moved.edges[k]) / (moved.edges[k + 1] - moved.edges[k])
        assert point == pytest.approx((1 - share) * moved.points[k] + share * moved.points[k + 1])


BAD = [
    ({"position_noise": -1e-3}, "position_noise=-0.001 m is outside >= 0 m"),
    ({"delay": float("nan")}, "delay is nan; a finite number is needed"),
    ({"period": 0.0}, "period=0 s is outside > 0 s"),
    ({"stations": 1}, "stations=1 is outside >= 2"),
    ({"stations": (3, 3)}, "stations=(3, 3): at least two element centres from base to tip are needed, each once"),
    ({"stations": (3, 1.5)}, "stations: expected a whole number, found float 1.5"),
    ({"seed": -1}, "seed=-1 is outside >= 0"),
]


@pytest.mark.parametrize(("settings", "message"), BAD, ids=str)
def test_bad_sensors_are_refused_in_a_sentence(settings, message):
    with pytest.raises(OctoctrlError) as caught:
        Sensors(**settings)
    assert str(caught.value) == message


@pytest.mark.parametrize("stations", [49, (0, 48)])
def test_stations_that_the_arm_does_not_have_are_refused(moved, stations):
    with pytest.raises(OctoctrlError, match="the arm has 48 elements, numbered from 0"):
        Sensors(stations=stations).start().see(moved)
