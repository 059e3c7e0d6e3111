"""The rod in hand: supports at rest and driven, loads that follow, divergence, copies, rods that cannot be; against closed forms."""

import copy
import pickle
import re

import numpy as np
import pytest

from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.rod.elastic import RodSimulation
from octoctrl.sim.rod.elastic_stepping import BLOCK
from octoctrl.sim.rod.rod import Rod
from octoctrl.sim.rod.supports import Clamp, Pin
from octoctrl.sim.rotations import rotation_matrix, rotation_vector

X, Y, Z = np.eye(3)
YOUNG, DENSITY = 1e4, 1000.0


def rod(elements=40, radius=0.005, *, shear=YOUNG / 1.5, support="free", damping=0.0, section="incompressible", length=1.0):
    return Rod.straight(
        length=length, radius=radius, elements=elements, direction=X, normal=Z, density=DENSITY, youngs_modulus=YOUNG,
        shear_modulus=shear, support=support, damping=damping, section=section,
    )  # fmt: skip


def bending(radius):
    return YOUNG * np.pi * radius**4 / 4


def rate(radius):
    """First angular frequency of the cantilever of unit length, 1/s."""
    return 3.516015 * np.sqrt(YOUNG / DENSITY) * radius / 2


# Supports.


@pytest.mark.parametrize("supports, closed_form", [
    ([Pin(node=0), Pin(node=-1, slides=X)], 5 / 384),
    ([Clamp(end="base"), Clamp(end="tip", slides=X)], 1 / 384),
    ([Clamp(end="base"), Pin(node=-1, slides=X)], 1 / 192),
], ids=["pinned", "clamped", "clamped and pinned"])  # fmt: skip
def test_beams_on_two_supports_sag_under_an_even_load(supports, closed_form):
    radius, load, errors = 0.005, 0.02, []
    for elements in (20, 40):
        sim = RodSimulation(rod(elements, radius, damping=3 * rate(radius)), supports=supports)
        sim.load(force_per_length=-load * bending(radius) * Z)
        sim.advance(12 / rate(radius))
        errors.append(abs(-sim.points[elements // 2, 2] / load / closed_form - 1))
    # The bending over the half elements beside a clamp makes it second order.
    assert errors[1] < 6e-3 and errors[1] < 0.3 * errors[0]


def turned_tip(angle, seconds, frame):
    return lambda t: rotation_matrix([0.0, 0.0, angle * np.clip(t / seconds, 0.0, 1.0)]) @ frame


def test_a_turned_end_twists_the_rod_evenly():
    body = rod(30, 0.02, support="clamped", damping=12.0)
    sim = RodSimulation(body, supports=[Clamp(end="tip", frame=turned_tip(2 * np.pi, 0.5, body.frames[-1]), slides=X)])
    sim.advance(4.0)
    twist = rotation_vector(sim.frames[1:] @ np.swapaxes(sim.frames[:-1], 1, 2)) * 30
    assert twist == pytest.approx(np.tile([0.0, 0.0, 2 * np.pi], (29, 1)), abs=1e-6)
    torsion = YOUNG / 1.5 * np.pi * 0.02**4 / 2
    assert sim.energy()["elastic"] == pytest.approx(0.5 * torsion * (2 * np.pi) ** 2, rel=1e-6)


@pytest.mark.parametrize("samples", [1, 7])
def test_driven_ends_are_on_their_paths(samples):
    body = rod(12, 0.03, damping=5.0)

    def place(t):
        return np.array([0.05 * np.sin(3 * t), 0.02 * t**2, 0.1 * (1 - np.cos(2 * t))])

    def frame(t):
        return rotation_matrix([0.1 * np.sin(t), 0.2 * t, 0.05 * t**2]) @ body.frames[0]

    sim = RodSimulation(body, supports=[Clamp(end="base", point=place, frame=frame)])
    time, points, _ = sim.advance(1.4, samples=samples)
    assert points[:, 0] == pytest.approx(np.array([place(t) for t in time]), abs=1e-14)
    ghost = sim.state()["state"][6:15, 0].reshape(3, 3)
    assert ghost == pytest.approx(frame(time[-1]), abs=1e-14)
    # Velocities are those of the path, not of its samples.
    assert sim.velocities[0] == pytest.approx([0.15 * np.cos(4.2), 0.056, 0.2 * np.sin(2.8)], rel=1e-5)


def test_a_table_of_times_and_frames_is_the_path_between_them():
    body = rod(10, 0.03, support="clamped")
    path = turned_tip(1.0, 0.5, body.frames[-1])
    times = np.array([0.0, 0.5, 1.0])
    table = (times, np.array([path(t) for t in times]))
    by_function, by_table = (RodSimulation(body, supports=[Clamp(end="tip", frame=way, slides=X)]) for way in (path, table))
    for sim in (by_function, by_table):
        sim.advance(0.9)
    assert by_table.frames == pytest.approx(by_function.frames, abs=1e-6)


def test_a_rod_that_is_carried_does_not_strain():
    body = rod(10, 0.03, section="constant")
    way = lambda t: 0.1 * t * Y  # noqa: E731
    sim = RodSimulation(body, supports=[Clamp(end="base", point=way), Clamp(end="tip", point=lambda t: X + way(t))])
    sim.velocities = np.tile(0.1 * Y, (11, 1))
    sim.advance(5.0)
    assert sim.points == pytest.approx(body.points + 0.5 * Y, abs=1e-10)
    assert sim.energy()["elastic"] < 1e-18


@pytest.mark.parametrize("share, buckles", [(0.97, False), (1.03, True)])
def test_case_13_twisted_ring_loses_stability(share, buckles):
    # Michell (1889): a ring bent from a straight rod buckles at the total twist 2 sqrt(3) pi B / C. Its weld is held still, which takes
    # away nothing but rigid motion; the weld's own error is what starts it.
    elements, radius, stiffer = 60, 0.004, 2.0
    shear, total = stiffer * YOUNG / 2, share * 2 * np.sqrt(3) * np.pi / stiffer
    swing = (2 * np.pi) ** 2 * np.sqrt(YOUNG / DENSITY) * radius / 2
    body = rod(elements, radius, shear=shear, section="constant", damping=swing)
    # Twist in a ring carries a shear force across its plane, C tau kappa, by which the sections are tilted.
    tilt = radius**2 / 2 * total * 2 * np.pi / body.shear_coefficient

    def frames_at(s):
        angle = 2 * np.pi * s
        d3 = np.stack([np.cos(angle), np.sin(angle), 0 * s], axis=-1)
        flat = np.stack([np.broadcast_to(Z, d3.shape), np.cross(d3, Z), d3], axis=-2)
        return rotation_matrix(np.multiply.outer(total * s, Z)) @ rotation_matrix(-tilt * Y) @ flat

    ends = (Clamp(end=end, frame=frames_at(np.float64(s))) for end, s in (("base", 0), ("tip", 1)))
    sim = RodSimulation(body, supports=list(ends))
    middle = (np.arange(elements) + 0.5) / elements
    edges = np.stack([np.cos(2 * np.pi * middle), np.sin(2 * np.pi * middle), 0 * middle], axis=1) / elements
    sim.place(np.concatenate([np.zeros((1, 3)), np.cumsum(edges, axis=0)]), frames_at(middle))
    sim.advance(80 / swing)
    out = np.abs(sim.points[:, 2]).max()
    assert out > 0.02 if buckles else out < 1e-3


# Loads.


def relaxed(body, **load):
    sim = RodSimulation(body)
    for share in np.linspace(0.25, 1.0, 4):
        sim.load(**{name: share * np.asarray(value) for name, value in load.items()})
        sim.advance((14 if share == 1.0 else 3) / rate(0.005))
    return sim


@pytest.mark.parametrize("load, tip", [(1.0, (0.991104, 0.124444)), (5.0, (0.795523, 0.560423)), (9.0, (0.446780, 0.803400))])
def test_case_5_load_that_stays_across_the_rod(load, tip):
    sim = relaxed(rod(50, support="clamped", damping=2 * rate(0.005)), follower_per_length=load * bending(0.005) * X)
    assert sim.points[-1, [0, 2]] == pytest.approx(tip, abs=2e-3)


@pytest.mark.parametrize("load, tip", [(1.0, (0.991246, 0.123471)), (5.0, (0.846657, 0.495905))])
def test_case_5_load_that_keeps_its_direction(load, tip):
    sim = relaxed(rod(50, support="clamped", damping=2 * rate(0.005)), force_per_length=np.tile(load * bending(0.005) * Z, (50, 1)))
    assert sim.points[-1, [0, 2]] == pytest.approx(tip, abs=2e-3)


def test_followers_turn_with_the_tip():
    # An end moment about d2 is the same, dead or following, in the plane; it bends the rod into an arc of M L / B.
    sim = relaxed(rod(40, support="clamped", damping=3 * rate(0.005)), follower_couple=-np.pi / 2 * bending(0.005) * Y)
    assert np.linalg.norm(sim.points[-1]) == pytest.approx(2 * np.sqrt(2) / np.pi, abs=2e-3)
    # A thrust along d3 of a free rod accelerates it along itself, wherever it points.
    free = RodSimulation(rod(10, 0.05))
    free.load(follower_force=1e-3 * Z)
    free.advance(1.0)
    assert free.node_mass @ free.velocities == pytest.approx(1e-3 * X, abs=1e-9)


# Divergence and state.


def test_divergence_is_caught_at_its_step_and_the_rod_is_back_before_it():
    body = rod(30, 0.02, support="clamped")
    sim = RodSimulation(body)
    sim.advance(0.5)
    sim.load(tip_force=1e3 * X)
    with pytest.raises(PlantUnstableError, match=r"stopped at t=0\.50\d* s: element 29 is stretched") as caught:
        sim.advance(100.0)
    assert 0.5 < caught.value.time < 0.5 + 10 * sim.dt and caught.value.element == 29
    assert 0.5 - 1e-9 < sim.time < caught.value.time and caught.value.time - sim.time < BLOCK * sim.dt
    assert np.isfinite(sim.points).all() and np.isfinite(sim.velocities).all()
    sim.load()
    sim.advance(1.0)
    assert sim.points == pytest.approx(body.points, abs=1e-12)
    sim.reset()
    assert sim.time == 0.0 and np.array_equal(sim.points, body.points) and not sim.velocities.any()


def test_a_late_divergence_keeps_what_came_before():
    body = rod(30, 0.02, support="clamped", damping=1.0)
    path = lambda t: X + np.array([0.6 * max(t - 2.0, 0.0), 0.0, 0.0])  # noqa: E731
    sim = RodSimulation(body, supports=[Clamp(end="tip", point=path)])
    with pytest.raises(PlantUnstableError, match="is stretched") as caught:
        sim.advance(10.0)
    # Drawn out at 0.6 1/s it reaches three times its length 3.3 s after the start at 2 s.
    assert caught.value.time == pytest.approx(2 + 2 / 0.6, rel=0.05)
    assert caught.value.time - BLOCK * sim.dt <= sim.time < caught.value.time
    assert sim.points[-1] == pytest.approx(path(sim.time), abs=1e-12)


def moving():
    sim = RodSimulation(rod(20, 0.02, support="clamped"))
    sim.load(tip_force=1e-3 * Z, follower_force=1e-3 * Y)
    sim.advance(0.3)
    return sim


@pytest.mark.parametrize("twin", [copy.copy, copy.deepcopy, lambda sim: pickle.loads(pickle.dumps(sim))], ids=["copy", "deep", "pickle"])
def test_copies_go_on_by_themselves(twin):
    sim, alone = moving(), moving()
    other = twin(sim)
    alone.advance(0.4)
    other.advance(0.4)
    assert np.array_equal(other.points, alone.points) and np.array_equal(other.rows[:18], alone.rows[:18])
    assert sim.time == pytest.approx(0.3) and not np.array_equal(sim.points, other.points)
    sim.advance(0.4)
    assert np.array_equal(sim.points, alone.points)


def test_a_state_is_gone_back_to_with_the_same_bits(tmp_path):
    sim = moving()
    np.savez(tmp_path / "state.npz", **sim.state())
    _, first, _ = sim.advance(0.5, samples=3)
    sim.restore(np.load(tmp_path / "state.npz"))
    time, second, _ = sim.advance(0.5, samples=3)
    assert np.array_equal(first, second) and time[-1] == pytest.approx(0.8)
    with pytest.raises(OctoctrlError, match=r"state: expected shape \(18, 22\), found \(18, 32\)"):
        sim.restore(RodSimulation(rod(30)).state())
    with pytest.raises(OctoctrlError, match="the state has no 'time'"):
        sim.restore({})


# Frames.


@pytest.mark.parametrize("angle", [1e-9, 1e-8])
def test_frames_stay_orthonormal_in_very_slow_spins(angle):
    # 1 - u^2 / 2 is one when u is below 1.5e-8: without a correction the frames grow by u^2 in every step.
    sim = RodSimulation(rod(2, 0.1, section="constant"))
    steps = 3_000_000
    sim.spins = np.tile(np.array([0.0, 0.0, angle]) / sim.dt, (2, 1))
    sim.advance(steps * sim.dt)
    frames = sim.frames
    assert np.abs(frames @ np.swapaxes(frames, 1, 2) - np.eye(3)).max() < 1e-15
    turned = rotation_vector(frames @ np.swapaxes(sim.rod.frames, 1, 2))
    assert turned == pytest.approx(np.tile([0.0, 0.0, steps * angle], (2, 1)), rel=1e-6, abs=1e-9)


# What cannot be.

STRAIGHT = {"length": 0.2, "radius": 0.01, "elements": 10, "density": 1e3, "youngs_modulus": 1e5, "shear_modulus": 4e4}


def bare(**changes):
    good = Rod.straight(**STRAIGHT)
    given = {name: getattr(good, name) for name in ("points", "frames", "radius", "density", "youngs_modulus", "shear_modulus")}
    return Rod(**(given | {name: make(given[name].copy()) for name, make in changes.items()}))


def changed(place, value):
    def make(array):
        array[place] = value
        return array

    return make


@pytest.mark.parametrize("make, message", [
    (lambda: Rod.straight(**STRAIGHT | {"radius": -0.01}), "radius of element 0 is -0.01 m; it must be positive"),
    (lambda: Rod.straight(**STRAIGHT | {"radius": 0}), "radius of element 0 is 0 m; it must be positive"),
    (lambda: Rod.straight(**STRAIGHT | {"radius": [0.01, 0.02]}), r"radius: expected one number or 10, one for each element, found shape"),
    (lambda: Rod.straight(**STRAIGHT | {"radius": float("nan")}), "radius[0] is nan; finite numbers are needed"),
    (lambda: Rod.straight(**STRAIGHT | {"length": 0}), "length=0 m is outside > 0 m"),
    (lambda: Rod.straight(**STRAIGHT | {"direction": (0, 0, 0)}), "direction is (0, 0, 0); give a vector that points somewhere"),
    (lambda: Rod.straight(**STRAIGHT | {"direction": (0, 0, 2)}), "normal (0, 0, 1) is parallel to direction (0, 0, 2)"),
    (lambda: Rod.straight(**STRAIGHT | {"normal": "up"}), "normal: expected numbers of shape (3,), found str up"),
    (lambda: Rod.straight(**STRAIGHT | {"elements": 0}), "elements=0 is outside 1…2117"),
    (lambda: Rod.straight(**STRAIGHT | {"elements": -1}), "elements=-1 is outside"),
    (lambda: Rod.straight(**STRAIGHT | {"elements": 1.5}), "elements: expected a whole number, found"),
    (lambda: Rod.straight(**STRAIGHT | {"elements": 5000}), "elements=5000 is outside 1…2117"),
    (lambda: Rod.straight(**STRAIGHT | {"density": 0.0}), "density=0 kg/m^3 is outside > 0 kg/m^3"),
    (lambda: Rod.straight(**STRAIGHT | {"shear_modulus": float("nan")}), "shear_modulus is nan"),
    (lambda: Rod.straight(**STRAIGHT, shear_coefficient=0.0), "shear_coefficient=0 is outside > 0"),
    (lambda: bare(points=changed(4, [0.0, 0.06, 0.0])), "nodes 3 and 4 coincide; every element needs a length"),
    (lambda: bare(points=changed((4, 1), np.inf)), "points[4, 1] is inf; finite numbers are needed"),
    (lambda: bare(points=lambda points: points[1:]), "points: expected shape (11, 3), found (10, 3)"),
    (lambda: bare(frames=lambda frames: 2 * frames), "frames: frame 0 is off an orthonormal frame by 3"),
    (lambda: bare(frames=lambda frames: frames[:, [1, 0, 2]]), "frames: frame 0 is left-handed"),
    (
        lambda: bare(frames=lambda frames: np.swapaxes(frames, 1, 2)),
        "frames: d3 of element 0 is 90 degrees off its edge; at most 60 are allowed; directors are rows, these look like columns",
    ),
    (lambda: RodSimulation(rod()).place(np.zeros((3, 3)), rod().frames), "points: expected shape (41, 3), found (3, 3)"),
    (lambda: RodSimulation(rod()).load(tip_force=1.0), "tip_force: expected shape (3,), found ()"),
    (lambda: RodSimulation(rod()).load(gravity=(0, 0, np.nan)), "gravity[2] is nan"),
    (lambda: setattr(RodSimulation(rod()), "velocities", np.zeros(3)), "velocities: expected shape (41, 3), found (3,)"),
    (lambda: RodSimulation(rod()).advance(1.0, samples=0), "samples=0 is outside >= 1"),
    (lambda: RodSimulation(rod()).advance(1.0, samples=1.5), "samples: expected a whole number, found"),
    (lambda: RodSimulation(rod()).advance(-1.0), "duration=-1 s is outside > 0 s"),
    (lambda: RodSimulation(rod(), supports=[Pin(node=41)]), "node=41 is pinned; the rod has nodes 0…40"),
    (lambda: RodSimulation(rod(), supports=[Pin(node=0), Clamp(end="base")]), "node 0 is held by two supports; one is needed"),
    (lambda: RodSimulation(rod(), supports=["clamped"]), "supports: found str; Clamp and Pin are known"),
    (lambda: Clamp(end="middle"), "unknown end 'middle'"),
    (lambda: Clamp(end="tip", frame=np.ones((3, 3))), "frame: frame 0 is off an orthonormal frame"),
    (lambda: Pin(node=0, point=([0.0, 0.0], np.zeros((2, 3)))), "times of point: at least 2 are needed, each later than the one before"),
    (
        lambda: RodSimulation(rod(), supports=[Pin(node=-1, point=(0.0, 0.0, 0.0))]).advance(0.1),
        "node 40 is 1 m from its support at t=0 s; place the rod where it is held",
    ),
])  # fmt: skip
def test_what_cannot_be_is_refused_in_one_sentence(make, message):
    with pytest.raises(OctoctrlError, match=re.escape(message)):
        make()
