"""Link, writhe and twist against closed forms, independent formulas and invariances."""

import dataclasses
import itertools
from time import process_time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from octoctrl.sim.topology import measures as topology
from octoctrl.sim.topology import topology_kernels as kernels
from octoctrl.sim.topology.meter import Meter

REST = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # rows d1 = +z, d2 = +x, d3 = +y


def helix(pitch_degrees, hand=1, segments=150, length=200.0, turns=2):
    pitch, s = np.radians(pitch_degrees), np.linspace(0.0, 1.0, segments + 1)
    radius, angle = length * np.cos(pitch) / (2 * np.pi * turns), 2 * np.pi * turns * s
    return np.stack([radius * np.cos(angle), hand * radius * np.sin(angle), length * np.sin(pitch) * s], axis=1)


def torus_curve(p, q, segments, large=2.0, small=1.0):
    a = np.linspace(0.0, 2 * np.pi, segments + 1)
    ring = large + small * np.cos(q * a)
    curve = np.stack([ring * np.cos(p * a), ring * np.sin(p * a), small * np.sin(q * a)], axis=1)
    curve[-1] = curve[0]
    return curve


def tangents(points):
    steps = np.diff(points, axis=0)
    return steps / np.linalg.norm(steps, axis=1, keepdims=True)


def ribbon(points, turns, start=(0.3, 0.5, 0.8)):
    """Normals carried along by parallel transport, with `turns` right-handed turns added evenly."""
    along = tangents(points)
    normal = np.array(start) - np.dot(start, along[0]) * along[0]
    carried = [normal / np.linalg.norm(normal)]
    for before, after in itertools.pairwise(along):
        axis = np.cross(before, after)
        size = np.linalg.norm(axis)
        vector = axis * (np.arctan2(size, before @ after) / size if size > 0 else 0.0)
        carried.append(Rotation.from_rotvec(vector).apply(carried[-1]))
    carried, angle = np.array(carried), 2 * np.pi * turns * np.linspace(0.0, 1.0, len(along))[:, None]
    return np.cos(angle) * carried + np.sin(angle) * np.cross(along, carried)


def smooth_curve(seed, segments, harmonics=3, size=0.15):
    """A random smooth open curve around a line."""
    random, s = np.random.default_rng(seed), np.linspace(0.0, 1.0, segments + 1)
    curve = np.outer(s, [0.2, 0.9, 0.3])
    for k in range(1, harmonics + 1):
        waves = np.stack([np.sin(2 * np.pi * k * s), np.cos(2 * np.pi * k * s)], axis=1)
        curve += size / k * waves @ random.normal(size=(2, 3))
    return curve


def rod(strain, elements, length=1.0):
    """Nodes, frames at base, element centres and tip, and their arclength, of a rod with material curvature strain(s) (m, 3)."""
    step = length / elements
    spacing = np.concatenate([[step / 2], np.full(elements - 1, step), [step / 2]])
    middle = np.cumsum(spacing) - spacing / 2
    frames = [REST]
    for vector in strain(middle) * spacing[:, None]:
        frames.append(Rotation.from_rotvec(vector).as_matrix().T @ frames[-1])
    frames = np.array(frames)
    points = np.concatenate([np.zeros((1, 3)), np.cumsum(frames[1:-1, 2] * step, axis=0)])
    return points, frames, np.concatenate([[0.0], np.cumsum(spacing)])


def uniform(first, second, third):
    return lambda s: np.stack([first + 0 * s, second + 0 * s, third + 0 * s], axis=1)


def tapered_coil(turns, twist_rate, elements=180):
    """One-sided bending of an arm of taper 12 (curvature as 1/radius), with a little twist: a spiral just off its plane."""

    def strain(s):
        bend = 2 * np.pi * turns * 11.0 / (12.0 - 11.0 * s) / np.log(12.0)
        return np.stack([bend, 0 * s, twist_rate + 0 * s], axis=1)

    return rod(strain, elements)


def twin_writhe(points, ray_length):
    """Klenin and Langowski's sum with two triangles and two arctangents for each pair, all pairs at once."""
    along, far = tangents(points), ray_length * np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    if far > 0.0:
        points = np.concatenate([[points[0] - far * along[0]], points, [points[-1] + far * along[-1]]])
    i, j = np.triu_indices(len(points) - 1, 2)
    return -sum_of_angles(points[i], points[i + 1], points[j], points[j + 1]).sum() / (2 * np.pi)


def twin_link(first, second):
    i, j = (index.ravel() for index in np.indices((len(first) - 1, len(second) - 1)))
    return -sum_of_angles(first[i], first[i + 1], second[j], second[j + 1]).sum() / (4 * np.pi)


def sum_of_angles(a0, a1, b0, b1):
    corners = [b0 - a0, b1 - a0, b1 - a1, b0 - a1]
    return triangle(*corners[:3]) + triangle(corners[0], *corners[2:])


def triangle(a, b, c):
    na, nb, nc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    volume = np.einsum("...i,...i", a, np.cross(b, c))
    edge = na * nb * nc + np.einsum("...i,...i", a, b) * nc + np.einsum("...i,...i", b, c) * na + np.einsum("...i,...i", c, a) * nb
    return 2.0 * np.arctan2(volume, edge)


def twin_frames(frames, pole):
    """Twist by SciPy's rotation vectors; lifted writhe by cutting each step into small arcs of constant strain (a Riemann area)."""
    vectors = Rotation.from_matrix(frames[:-1] @ frames[1:].transpose(0, 2, 1)).as_rotvec()
    fine = [frames[0, 2]]
    for frame, vector in zip(frames[:-1], vectors, strict=True):
        turned = Rotation.from_rotvec(np.linspace(0.0, 1.0, 41)[1:, None] * vector).as_matrix()
        fine.extend(frame.T @ turned[k, :, 2] for k in range(40))
    fine = np.array(fine)
    area = triangle(np.broadcast_to(pole, fine[1:].shape), fine[:-1], fine[1:]).sum() + triangle(np.array(pole), fine[-1], fine[0])
    return vectors[:, 2].sum() / (2 * np.pi), area / (2 * np.pi)


@pytest.mark.parametrize(
    ("hand", "pitch", "writhe", "link"),
    [
        (1, 60, 0.267296, 1.267298),
        (1, 30, 0.998838, 1.998838),
        (1, 5, 1.825417, 2.825421),
        (-1, 60, -0.267296, 0.732706),
        (-1, 30, -0.998839, 0.001161),
        (-1, 5, -1.825417, -0.825421),
    ],
)
def test_published_convention_reproduces_reference_values(hand, pitch, writhe, link):
    curve = helix(pitch, hand)
    normals = ribbon(curve, 1, start=(0.0, 0.0, 1.0))
    assert topology.writhe(curve, 10.0) == pytest.approx(writhe, abs=1.1e-6)
    assert topology.twist(curve, normals) == pytest.approx(1.0, abs=1e-12)
    assert topology.link(curve, normals, 2.0, 10.0) == pytest.approx(link, abs=1e-6)


def test_straight_rod_with_one_turn():
    line = np.outer(np.linspace(0.0, 200.0, 151), [0.0, 1.0, 0.0])
    assert topology.link(line, ribbon(line, 1), 2.0, 10.0) == pytest.approx(0.9999996, abs=1e-7)
    assert topology.link(line, ribbon(line, 1), 2.0, 1000.0) == pytest.approx(1.0, abs=1e-10)
    assert topology.twist(line, ribbon(line, 1)) == pytest.approx(1.0, abs=1e-13)
    assert topology.writhe(line) == 0.0


def test_uniformly_twisted_rod_loses_one_half_element_at_each_end():
    count = 180
    points, frames, _ = rod(uniform(0.0, 0.0, 3 * np.pi), count)
    assert topology.frame_twist(frames) == pytest.approx(1.5, abs=1e-12)
    assert topology.frame_twist(frames[1:-1]) == pytest.approx(1.5 * (count - 1) / count, abs=1e-12)
    assert topology.twist(points, -frames[1:-1, 1]) == pytest.approx(1.5 * (count - 1) / count, abs=1e-12)
    assert topology.lifted_writhe(frames) == pytest.approx(0.0, abs=1e-13)


def test_planar_simple_curves_have_no_writhe():
    s = np.linspace(0.0, 1.0, 181)
    wave = np.stack([s, 0.2 * np.sin(9 * s), 0 * s], axis=1)
    spiral = np.stack([(1 + 0.1 * s) * np.cos(6 * s), (1 + 0.1 * s) * np.sin(6 * s), 0 * s], axis=1)[60:]
    tilt = Rotation.from_rotvec([0.4, -1.0, 0.3])
    for curve in (wave, spiral):
        assert topology.writhe(curve, 0.0) == 0.0
        assert topology.writhe(tilt.apply(curve), 0.0) == pytest.approx(0.0, abs=1e-12)
    assert topology.writhe(tilt.apply(wave)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("pitch", "value"), [(80, 0.0304), (40, 0.7140), (10, 1.6525), (2, 1.9302)])
def test_helix_family(pitch, value):
    analytic = 2 * (1 - np.sin(np.radians(pitch)))
    assert topology.writhe(helix(pitch, segments=200)) == pytest.approx(value, abs=5e-5)
    assert topology.writhe(helix(pitch, segments=200)) == pytest.approx(analytic, abs=5e-4)
    assert topology.writhe(helix(pitch, -1, segments=200)) == pytest.approx(-analytic, abs=5e-4)


def test_helix_error_falls_with_the_square_of_the_segment():
    exact = 2 * (1 - np.sin(np.radians(20)))
    error = [abs(topology.writhe(helix(20, segments=n)) - exact) for n in (100, 200, 400)]
    assert np.log2(error[0] / error[1]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(error[1] / error[2]) == pytest.approx(2.0, abs=0.1)


def test_long_helix():
    def coil(turns, per_turn):
        a = np.linspace(0.0, 2 * np.pi * turns, turns * per_turn + 1)
        return np.stack([np.cos(a), np.sin(a), a / np.pi], axis=1)

    assert topology.writhe(coil(10, 240)) / 10 == pytest.approx(1 - 2 / np.sqrt(4 * np.pi**2 + 4), abs=5e-5)  # 0.69669
    assert topology.writhe(coil(2, 200), 0.0) / 2 == pytest.approx(0.420, abs=5e-4)
    assert topology.writhe(coil(50, 40), 0.0) / 50 == pytest.approx(0.683, abs=1e-3)


@pytest.mark.parametrize(("p", "q", "value"), [(2, 3, -3.51824), (3, 2, -3.90079), (2, 5, -6.86811), (1, 4, -2.22040)])
def test_torus_curves(p, q, value):
    coarse, fine = (topology.writhe(torus_curve(p, q, n), 0.0) for n in (600, 1200))
    assert (4 * fine - coarse) / 3 == pytest.approx(value, abs=1.1e-5)
    if (p, q) == (2, 3):
        assert topology.writhe(torus_curve(2, 3, 1600), 0.0) == pytest.approx(-3.5182155, abs=6e-8)


def test_the_common_figure_eight_knot_has_writhe_although_the_knot_is_its_own_mirror_image():
    a = np.linspace(0.0, 2 * np.pi, 801)
    curve = np.stack([(2 + np.cos(2 * a)) * np.cos(3 * a), (2 + np.cos(2 * a)) * np.sin(3 * a), np.sin(4 * a)], axis=1)
    curve[-1] = curve[0]
    assert abs(topology.writhe(curve, 0.0)) == pytest.approx(0.086, abs=5e-4)


def test_tapered_coil_on_either_side_of_its_plane():
    (first, below, _), (second, above, _) = tapered_coil(2.04, 0.01), tapered_coil(2.04, -0.01)
    assert [topology.writhe(first), topology.writhe(second)] == pytest.approx([1.9985, -1.9985], abs=5e-5)
    assert topology.lifted_writhe(np.stack([below, above])) == pytest.approx([1.9985, 2.0015], abs=5e-5)


@pytest.mark.parametrize("seed", range(8))
def test_link_by_double_sum_is_writhe_plus_twist(seed):
    curve = smooth_curve(seed, 120)
    normals = ribbon(curve, turns=1.3 - 0.4 * seed)
    for ray_length in (10.0, 1000.0):
        residual = topology.link(curve, normals, 0.002, ray_length) - topology.writhe(curve, ray_length) - topology.twist(curve, normals)
        assert abs(residual) < 1e-5


def closed_ribbon(curve, turns):
    """Normals along a closed curve that come back to the first after `turns` more turns than parallel transport makes."""
    along = tangents(curve)
    carried = ribbon(np.concatenate([curve, curve[1:2]]), 0.0)
    angle = np.arctan2(np.dot(np.cross(carried[0], carried[-1]), along[0]), carried[0] @ carried[-1])
    share = (2 * np.pi * turns - angle) * np.arange(len(along))[:, None] / len(along)
    return np.cos(share) * carried[:-1] + np.sin(share) * np.cross(along, carried[:-1])


@pytest.mark.parametrize(("p", "q"), [(2, 3), (3, 2), (1, 4)])
@pytest.mark.parametrize("turns", [-2, 0, 1])
def test_link_of_a_closed_ribbon_is_a_whole_number_and_writhe_plus_twist(p, q, turns):
    curve = torus_curve(p, q, 300)
    normals = closed_ribbon(curve, turns)
    link = topology.link(curve, normals, 0.01, 0.0)
    assert link == pytest.approx(round(link), abs=1e-9)
    assert link == pytest.approx(topology.writhe(curve, 0.0) + topology.twist(curve, normals), abs=1e-9)
    more = topology.link(curve, closed_ribbon(curve, turns + 1), 0.01, 0.0)
    assert more - link == pytest.approx(1.0, abs=1e-9)
    shift = 117  # where the ribbon is cut open does not matter
    turned = np.concatenate([curve[shift:-1], curve[: shift + 1]])
    assert topology.link(turned, np.roll(normals, -shift, axis=0), 0.01, 0.0) == pytest.approx(link, abs=1e-9)
    assert topology.twist(turned, np.roll(normals, -shift, axis=0)) == pytest.approx(topology.twist(curve, normals), abs=1e-9)


def test_link_of_a_plane_ring_is_the_number_of_turns_of_its_ribbon():
    angle = np.linspace(0.0, 2 * np.pi, 61)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    ring[-1] = ring[0]
    for turns in (-1, 0, 3):
        assert topology.link(ring, closed_ribbon(ring, turns), 0.01, 0.0) == pytest.approx(turns, abs=1e-9)
        assert topology.twist(ring, closed_ribbon(ring, turns)) == pytest.approx(turns, abs=1e-9)


def test_residual_of_frames_and_nodes_falls_with_the_square_of_the_element():
    error = []
    for count in (45, 90, 180):
        points, frames, _ = rod(lambda s: np.stack([-11 - 3 * s, 2 * np.sin(3 * s), 5.5 + 0 * s], axis=1), count)
        trace = topology.measure([0.0], points[None], frames[None])
        error.append(abs(trace.residual[0]))
    assert error[-1] < 1e-3
    assert np.log2(error[0] / error[1]) == pytest.approx(2.0, abs=0.25)
    assert np.log2(error[1] / error[2]) == pytest.approx(2.0, abs=0.25)


def test_no_near_planar_crossing_loses_a_unit():
    random, count = np.random.default_rng(1), 10_000
    height = 10.0 ** random.uniform(-12, -3, count)
    first, second = random.normal(size=(2, count, 2))
    cross = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / np.linalg.norm(first, axis=1) / np.linalg.norm(second, axis=1)
    second[cross < 0.1] = first[cross < 0.1] @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    share = random.uniform(0.1, 0.9, (2, count, 1))
    jumps = []
    for sign in (1, -1):
        curve = np.zeros((count, 4, 3))
        curve[:, 0, :2], curve[:, 1, :2] = -share[0] * first, (1 - share[0]) * first
        curve[:, 2, :2], curve[:, 3, :2] = -share[1] * second, (1 - share[1]) * second
        curve[:, 2:, 2] = sign * height[:, None]
        jumps.append(topology.writhe(Rotation.from_rotvec([0.3, 0.2, -0.5]).apply(curve.reshape(-1, 3)).reshape(curve.shape), 0.0))
    size = np.minimum(np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1))
    jump = np.abs(jumps[0] - jumps[1])
    assert np.all(np.abs(jump - 2.0) < 260 * height / size + 1e-12)  # the solid angle lacks at most 2 h / distance per edge seen
    assert np.all(np.round(jump) == 2)


def test_row_products_count_windings_as_separate_arctangents_do():
    random = np.random.default_rng(2)
    for bias in (0.0, 0.5, 3.0):
        angle = np.clip(random.normal(bias, 1.5, 1000), -np.pi, np.pi)
        assert kernels._summed_argument(np.cos(angle), np.sin(angle)) == pytest.approx(angle.sum(), abs=1e-10)
    near_planar = np.concatenate([[np.pi - 1e-12, np.pi - 1e-14, 1e-13, -1e-13] * 20, [-np.pi + 1e-13] * 9])
    assert kernels._summed_argument(np.cos(near_planar), np.sin(near_planar)) == pytest.approx(near_planar.sum(), abs=1e-9)


def test_lifted_writhe_runs_through_two_self_crossings_of_a_coil():
    rates = np.linspace(6.0, -6.0, 121)
    points, frames = (np.stack(values) for values in zip(*(tapered_coil(2.04, rate)[:2] for rate in rates), strict=True))
    trace = topology.measure(np.arange(121.0), points, frames)
    assert np.abs(np.diff(trace.lifted_writhe)).max() < 0.06
    assert np.abs(trace.residual).max() < 1e-3
    assert trace.crossings[-1] - trace.crossings[0] == 2
    jumps = np.diff(trace.writhe)
    assert jumps[np.abs(jumps) > 1].sum() == pytest.approx(-4.0, abs=0.06)
    assert trace.lifted_writhe == pytest.approx(trace.writhe + 2 * trace.crossings, abs=1e-3)
    assert trace.twist == pytest.approx(rates / (2 * np.pi), abs=1e-12)
    assert trace.lifted_link == pytest.approx(trace.lifted_writhe + trace.twist)
    assert not trace.uturn.any()


def test_series_is_made_continuous_modulo_two():
    values = np.array([0.1, 0.9, -0.8, -0.3, 1.9, 0.2, -1.5])
    kernels.unwrap_by_two(values, values[0], 0.0)
    assert values == pytest.approx([0.1, 0.9, 1.2, 1.7, 1.9, 2.2, 2.5], abs=1e-12)


@given(st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=12), st.integers(1, 10))
def test_pieces_of_a_series_are_made_continuous_to_the_same_bits(values, cut):
    whole, pieces = np.array(values), np.array(values)
    kernels.unwrap_by_two(whole, whole[0], 0.0)
    cut = min(cut, len(values) - 1)
    shift = kernels.unwrap_by_two(pieces[:cut], pieces[0], 0.0)
    kernels.unwrap_by_two(pieces[cut:], pieces[cut - 1], shift)
    np.testing.assert_array_equal(pieces, whole)


@pytest.mark.parametrize("cuts", [(1,), (40, 41, 100), (30, 60, 90)])
def test_a_meter_that_grows_by_pieces_gives_the_bits_of_the_whole(cuts, monkeypatch):
    """A coil that runs on through its plane; pieces begin with the instant at which the last one ends, as those of a plant do."""
    rates = np.linspace(-25.0, 25.0, 121)
    points, frames = (np.stack(values) for values in zip(*(tapered_coil(2.04, rate)[:2] for rate in rates), strict=True))
    time, counted = np.arange(121.0), []
    whole = topology.measure(time, points, frames)
    kernel = kernels.writhe_series
    monkeypatch.setattr(kernels, "writhe_series", lambda *arguments: (counted.append(len(arguments[0])), kernel(*arguments))[1])
    meter = Meter()
    for begin, end in itertools.pairwise((0, *cuts, 120)):
        piece = slice(begin, end + 1)
        meter.extend(time[piece], points[piece], frames[piece])
        assert meter.trace.time[-1] == end and meter.trace.writhe[-1] == whole.writhe[end]
    assert sum(counted) == len(time)
    for field in dataclasses.fields(whole):
        np.testing.assert_array_equal(getattr(meter.trace, field.name), getattr(whole, field.name))


def test_tip_antiparallel_to_the_base_is_flagged():
    turned = np.array([0.9, 0.999, 1.2])
    points, frames = (np.stack(v) for v in zip(*(rod(uniform(np.pi * t, 0.0, 0.2), 60)[:2] for t in turned), strict=True))
    assert topology.measure([0.0, 1.0, 2.0], points, frames).uturn.tolist() == [True, True, False]


ANGLES = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), turn=ANGLES, shift=ANGLES, scale=st.floats(1e-3, 1e3))
def test_invariances(seed, turn, shift, scale):
    curve = smooth_curve(seed, 50)
    normals = ribbon(curve, 0.7)
    rotation, mirror = Rotation.from_rotvec(turn), [1.0, 1.0, -1.0]
    for ray_length in (0.0, 1000.0):
        value = topology.writhe(curve, ray_length)
        assert topology.writhe(scale * (rotation.apply(curve) + shift), ray_length) == pytest.approx(value, abs=1e-9)
        assert topology.writhe(curve * mirror, ray_length) == pytest.approx(-value, abs=1e-12)
        assert topology.writhe(curve[::-1], ray_length) == pytest.approx(value, abs=1e-9)
    value = topology.twist(curve, normals)
    assert topology.twist(scale * (rotation.apply(curve) + shift), rotation.apply(normals)) == pytest.approx(value, abs=1e-9)
    assert topology.twist(curve * mirror, normals * mirror) == pytest.approx(-value, abs=1e-12)
    assert topology.twist(curve[::-1], normals[::-1]) == pytest.approx(value, abs=1e-12)


def test_frame_measures_turn_with_the_pole_and_change_sign_in_a_mirror():
    strain = lambda s: np.stack([9 * np.cos(2 * s), 4 * np.sin(5 * s), 3 - s], axis=1)  # noqa: E731
    _, frames, _ = rod(strain, 90)
    rotation, pole = Rotation.from_rotvec([0.5, -0.7, 1.1]), np.array([0.0, 0.0, 1.0])
    turned = frames @ rotation.as_matrix().T
    assert topology.lifted_writhe(turned, rotation.apply(pole)) == pytest.approx(topology.lifted_writhe(frames, pole), abs=1e-10)
    mirror = np.diag([-1.0, 1.0, 1.0])  # contains the base axis and the pole; d1 is reversed to stay right-handed
    reflected = frames @ mirror * np.array([-1.0, 1.0, 1.0])[:, None]
    assert topology.lifted_writhe(reflected, pole) == pytest.approx(-topology.lifted_writhe(frames, pole), abs=1e-10)
    assert topology.frame_twist(reflected) == pytest.approx(-topology.frame_twist(frames), abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_kernels_agree_with_plain_numpy(seed):
    curve = smooth_curve(seed, 90)
    for ray_length in (0.0, 10.0, 1000.0):
        assert topology.writhe(curve, ray_length) == pytest.approx(twin_writhe(curve, ray_length), abs=1e-10)
    second = curve + 0.003 * np.random.default_rng(seed).normal(size=3)
    linked = kernels.link_of_curves(np.ascontiguousarray(curve.T), np.ascontiguousarray(second.T))
    assert linked == pytest.approx(twin_link(curve, second), abs=1e-10)
    random = np.random.default_rng(seed)
    _, frames, _ = rod(lambda s: random.normal(size=3) * 8 * np.sin(np.outer(s, [3.0, 5.0, 4.0])), 40)
    twist, lifted = twin_frames(frames, (0.0, 0.0, 1.0))
    assert topology.frame_twist(frames) == pytest.approx(twist, abs=1e-12)
    assert (topology.lifted_writhe(frames) - lifted + 1) % 2 == pytest.approx(1.0, abs=2e-4)


def test_rotations_up_to_half_a_turn_match_scipy():
    vectors = Rotation.random(300, random_state=3).as_rotvec()
    frames = np.stack([np.tile(np.eye(3), (300, 1, 1)), Rotation.from_rotvec(vectors).as_matrix().transpose(0, 2, 1)], axis=1)
    out = np.empty((300, 1, 3))
    kernels.frame_rotations(frames, out)
    assert out[:, 0] == pytest.approx(vectors, abs=1e-10)


def test_pair_map_and_density_sum_to_the_writhe():
    curve = smooth_curve(4, 100)
    for ray_length in (0.0, 1000.0):
        value = topology.writhe(curve, ray_length)
        assert topology.writhe_map(curve, None, ray_length).sum() == pytest.approx(value, abs=1e-10)
        blocks = topology.writhe_map(curve, 7, ray_length)
        assert blocks.shape == ((7, 7) if ray_length == 0.0 else (9, 9))
        assert blocks == pytest.approx(blocks.T)
        assert blocks.sum() == pytest.approx(value, abs=1e-10)
        assert topology.writhe_density(curve, ray_length).sum() == pytest.approx(value, abs=1e-10)
    assert topology.writhe_density(torus_curve(2, 3, 300), 0.0).sum() == pytest.approx(topology.writhe(torus_curve(2, 3, 300), 0.0))


def test_regional_values_sum_to_the_whole():
    frames = tapered_coil(1.3, 4.0)[1]
    closure = kernels.pole_area(np.array([0.0, 0.0, 1.0]), frames[-1, 2], frames[0, 2]) / (2 * np.pi)
    twist, lifted = topology.regional(frames)
    assert twist.sum() == pytest.approx(topology.frame_twist(frames), abs=1e-12)
    assert lifted.sum() + closure == pytest.approx(topology.lifted_writhe(frames), abs=1e-12)


def test_sucker_side_is_the_side_of_the_shortened_muscle():
    for azimuth in (0.0, 0.7, 2.4, -1.9):  # a bend toward material direction (sin, cos, 0) turns d3 by (-cos, sin, 0)
        points, frames, _ = rod(uniform(-3 * np.cos(azimuth), 3 * np.sin(azimuth), 0.5), 60)
        assert topology.sucker_orientation(frames, azimuth) == pytest.approx(1.0, abs=1e-12)
        assert topology.sucker_orientation(frames, azimuth + np.pi) == pytest.approx(-1.0, abs=1e-12)
        assert topology.sucker_orientation(frames, azimuth + np.pi / 3) == pytest.approx(0.5, abs=1e-12)
        assert points[5] @ np.array([np.cos(azimuth), 0.0, np.sin(azimuth)]) > 0.0  # LM direction at that azimuth
    assert np.isnan(topology.sucker_orientation(rod(uniform(0.0, 0.0, 1.0), 20)[1], 0.0))


def test_sections_are_straight_planar_or_helical():
    def strain(s):
        bent, coiled = s > 1 / 3, s > 2 / 3
        return np.stack([8.0 * bent, 0 * s, 12.0 * coiled], axis=1)

    _, frames, _ = rod(strain, 180)
    turned = frames @ Rotation.from_rotvec([1.0, 0.4, 2.0]).as_matrix().T
    assert topology.classify_sections(frames, 3).tolist() == topology.classify_sections(turned, 3).tolist() == [1, 2, 3]
    assert topology.classify_sections(np.stack([frames, turned]), 6).tolist() == [[1, 1, 2, 2, 3, 3]] * 2
    assert [topology.SECTION_SHAPES[k] for k in (1, 2, 3)] == ["straight", "planar", "helical"]


def test_packet_is_found_between_the_stations():
    frames, places = [], np.linspace(0.05, 0.15, 41)
    for place in places:
        _, packet, stations = rod(
            lambda s, at=place: np.stack([20 + 60 * np.exp(-(((s - at) / 0.012) ** 2)), 0 * s, 0 * s], axis=1), 90, 0.2
        )
        frames.append(packet)
    found, curvature = topology.packet_position(np.array(frames), stations)
    assert found == pytest.approx(places, abs=1e-4)
    assert curvature == pytest.approx(np.full(41, 20 + 60 / np.sqrt(1 + 2 * (0.004 / 0.012) ** 2)), rel=0.01)
    assert topology.packet_position(frames[0], stations, window=(0.5, 1.0))[0] == pytest.approx(0.1, abs=2e-3)
    assert np.isnan(topology.packet_position(np.tile(REST, (5, 1, 1)), np.arange(5.0))[0])


def test_one_arctangent_per_block_is_faster_than_one_per_pair(capsys):
    points = np.repeat(smooth_curve(5, 180)[None], 50, axis=0)
    nodes, pairs = np.empty((3, 183)), np.empty((182, 182))
    along = tangents(points[0])
    count = kernels.extend(points[0], along[0], along[-1], 1000.0, nodes)
    directions, out = np.repeat(along[None, [0, -1]], 50, axis=0), np.empty(50)
    calls = (lambda: kernels.writhe_series(points, directions, 1000.0, out), lambda: kernels.pair_matrix(nodes, count, pairs))
    elapsed = ([], [])
    for _ in range(9):  # in turn, so that whatever else the machine does meets both alike
        for call, times in zip(calls, elapsed, strict=True):
            begin = process_time()
            call()
            times.append(process_time() - begin)
    per_block, per_pair = map(min, elapsed)
    with capsys.disabled():
        print(f" [180 segments and 2 rays: {20 * per_block:.3f} ms per frame; one arctangent per pair: {1e3 * per_pair:.3f} ms] ", end="")
    assert per_block / 50 < 0.8 * per_pair
