"""Kernels of topology on small inputs, each against plain NumPy and SciPy; quick also where the kernels run as Python."""

import numpy as np
import plain_topology as plain
import pytest
from scipy.spatial.transform import Rotation

from octoctrl.sim.topology import topology_kernels as kernels

POLE = plain.unit(np.array([0.3, -0.5, 1.0]))


def curves(seed, count=2, nodes=7):
    return np.cumsum(np.random.default_rng(seed).normal(size=(count, nodes, 3)), axis=1)


def closed(seed, nodes=7):
    curve = curves(seed, 1, nodes)[0]
    curve[-1] = curve[0]
    return curve


def directions(series):
    ends = np.stack([series[:, 1] - series[:, 0], series[:, -1] - series[:, -2]], axis=1)
    return ends / np.linalg.norm(ends, axis=2, keepdims=True)


def frames_of(seed, count=6, size=0.8):
    """Frames that turn by less than half a turn from one to the next."""
    random, frames = np.random.default_rng(seed), [Rotation.random(random_state=seed).as_matrix()]
    for _ in range(count - 1):
        frames.append(Rotation.from_rotvec(size * random.normal(size=3)).as_matrix() @ frames[-1])
    return np.array(frames)


@pytest.mark.parametrize("size", [1, 63, 64, 65, 130])
@pytest.mark.parametrize("bias", [-2.0, 0.0, 2.0])
def test_arguments_add_up_over_blocks(size, bias):
    angle = np.clip(np.random.default_rng(size).normal(bias, 1.5, size), -3.141, 3.141)
    real, imaginary = np.cos(angle), np.sin(angle)
    assert kernels._summed_argument(real, imaginary) == pytest.approx(angle.sum(), abs=1e-11)
    assert kernels._summed_argument(0.7 * real, 0.7 * imaginary) == pytest.approx(angle.sum(), abs=1e-11)


def test_arguments_on_the_axes_are_counted_once():
    for angles in (
        [np.pi / 2] * 5,
        [-np.pi / 2] * 5,
        [0.0, np.pi / 2, np.pi / 2, 0.0, -np.pi / 2],
        [3.0, 3.0, 3.0, 3.0],
        [-3.0, -3.0, -3.0],
    ):
        real, imaginary = np.round(np.cos(angles), 15), np.round(np.sin(angles), 15)
        total = kernels._summed_argument(real, imaginary)
        assert (total - sum(angles)) % (2 * np.pi) == pytest.approx(0.0, abs=1e-9) or (total - sum(angles)) % (2 * np.pi) > 6.283
        if abs(sum(angles)) > 4.0:
            assert total == pytest.approx(sum(angles), abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("ray", [0.0, 1.0, 10.0])
def test_writhe(seed, ray):
    series, out = curves(seed), np.empty(2)
    ends = directions(series)
    kernels.writhe_series(series, ends, ray, out)
    for curve, (first, last), value in zip(series, ends, out, strict=True):
        drawn = plain.with_rays(curve, first, last, ray) if ray else curve
        assert value == pytest.approx(plain.writhe(drawn), abs=2e-8)


def test_rays_leave_in_the_directions_that_are_given():
    series, out = curves(1), np.empty(2)
    ends = directions(series)[::-1].copy()
    kernels.writhe_series(series, ends, 3.0, out)
    expected = [plain.writhe(plain.with_rays(curve, *pair, 3.0)) for curve, pair in zip(series, ends, strict=True)]
    assert out == pytest.approx(expected, abs=2e-8)


@pytest.mark.parametrize("seed", range(4))
def test_writhe_of_closed_curves_does_not_depend_on_where_they_begin(seed):
    curve, out = closed(seed), np.empty(2)
    turned = np.concatenate([curve[2:-1], curve[:3]])
    kernels.writhe_series(np.stack([curve, turned]), np.zeros((2, 2, 3)), 0.0, out)
    i, j = (index for index in np.triu_indices(6, 2))
    apart = ~((i == 0) & (j == 5))  # neighbours over the seam
    expected = 2 * plain.gauss_pairs(curve[i], curve[i + 1], curve[j], curve[j + 1])[apart].sum()
    assert out == pytest.approx([expected, expected], abs=2e-8)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_few_segments(count):
    series, out = curves(5, 1, count), np.empty(1)
    kernels.writhe_series(series, directions(series), 0.0, out)
    assert out[0] == pytest.approx(plain.writhe(series[0]), abs=1e-12)


def test_what_lies_in_one_plane_has_no_writhe_at_all():
    series, out = curves(3), np.empty(2)
    series[:, :, 2] = 0.0
    kernels.writhe_series(series, directions(series), 5.0, out)
    assert out.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("seed", range(3))
def test_pairs(seed):
    for curve in (curves(seed, 1)[0], closed(seed)):
        nodes, out = np.empty((3, 9)), np.full((6, 6), np.nan)
        count = kernels.extend(curve, np.zeros(3), np.zeros(3), 0.0, nodes)
        kernels.pair_matrix(nodes, count, out)
        expected = np.zeros((6, 6))
        for i in range(6):
            for j in range(i + 2, 6):
                if i == 0 and j == 5 and np.array_equal(curve[0], curve[-1]):
                    continue
                expected[i, j] = expected[j, i] = plain.gauss_pairs(curve[i], curve[i + 1], curve[j], curve[j + 1])
        assert out == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_link(seed):
    first, second = curves(seed, 1)[0], curves(seed + 50, 1, 5)[0]
    linked = kernels.link_of_curves(np.ascontiguousarray(first.T), np.ascontiguousarray(second.T))
    assert linked == pytest.approx(plain.link(first, second), abs=1e-9)


def test_a_polyline_with_and_without_rays():
    points = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 4.0], [3.0, 2.0, 4.0]])
    assert kernels.polyline_length(points) == 7.0
    nodes = np.full((3, 5), np.nan)
    assert kernels.extend(points, np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, -1.0]), 0.0, nodes) == 3
    assert nodes[:, :3].T.tolist() == points.tolist() and np.isnan(nodes[:, 3:]).all()
    assert kernels.extend(points, np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, -1.0]), 10.0, nodes) == 5
    assert nodes.T.tolist() == [[-10.0, -20.0, -30.0], *points.tolist(), [3.0, 12.0, -6.0]]


@pytest.mark.parametrize("seed", range(6))
def test_transported_twist(seed):
    points, random, out = curves(seed, 1)[0], np.random.default_rng(seed), np.empty(5)
    normals = random.normal(size=(6, 3))
    kernels.transport_twist(points, normals, out)
    along = plain.unit(np.diff(points, axis=0))
    carried = plain.smallest_rotation(along[:-1], along[1:]).apply(
        normals[:-1] - np.sum(normals[:-1] * along[:-1], axis=1)[:, None] * along[:-1]
    )
    found = normals[1:] - np.sum(normals[1:] * along[1:], axis=1)[:, None] * along[1:]
    angle = np.arctan2(np.einsum("ij,ij->i", np.cross(carried, found), along[1:]), np.einsum("ij,ij->i", carried, found))
    assert out == pytest.approx(angle / (2 * np.pi), abs=1e-9)


AXES = np.concatenate(
    [np.eye(3), -np.eye(3), plain.unit(np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, 0.2], [0.1, -1.0, 1.0], [1.0, 0.3, -1.0]]))]
)


@pytest.mark.parametrize("angle", [0.0, 1e-10, 1e-3, 1.0, 2.0, 3.0, 3.14])
def test_rotations_between_frames(angle):
    start, vectors = Rotation.random(random_state=4).as_matrix(), angle * AXES
    further = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix().T
    turned = [Rotation.from_rotvec(vector).as_matrix().T @ start for vector in vectors]
    frames = np.stack([np.stack([start, one, further @ one]) for one in turned])
    out = np.empty((len(vectors), 2, 3))
    kernels.frame_rotations(frames, out)
    assert out[:, 0] == pytest.approx(vectors, abs=1e-9)
    assert out[:, 1] == pytest.approx(np.tile([0.3, -0.2, 0.5], (len(vectors), 1)), abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_twist_and_lifted_writhe_of_steps(seed):
    frames = frames_of(seed)
    turned, lifted = np.empty((2, 5))
    closure = kernels.frame_steps(frames, POLE, turned, lifted)
    vectors = Rotation.from_matrix(frames[:-1] @ frames[1:].swapaxes(-1, -2)).as_rotvec()
    assert turned == pytest.approx(vectors[:, 2] / (2 * np.pi), abs=1e-9)
    assert closure == pytest.approx(plain.triangle_area(POLE, frames[-1, 2], frames[0, 2]) / (2 * np.pi), abs=1e-6)
    assert kernels.pole_area(POLE, frames[0, 2], frames[1, 2]) == pytest.approx(
        plain.triangle_area(POLE, frames[0, 2], frames[1, 2]), abs=1e-6
    )
    first, second = plain.reference(POLE, frames[:, 2])
    phase = np.arctan2(np.einsum("ij,ij->i", frames[:, 0], second), np.einsum("ij,ij->i", frames[:, 0], first))
    linked = np.diff(phase) / (2 * np.pi)
    assert (lifted + turned - linked + 0.5) % 1.0 == pytest.approx(np.full(5, 0.5), abs=1e-6)
    series = np.stack([frames, frames_of(seed + 20)])
    twist, whole, opening = np.empty((3, 2))
    kernels.frame_series(series, POLE, twist, whole, opening)
    assert [twist[0], whole[0]] == pytest.approx([turned.sum(), lifted.sum() + closure], abs=1e-12)
    assert opening == pytest.approx(1 + np.einsum("ti,ti->t", series[:, 0, 2], series[:, -1, 2]), abs=1e-12)
    by_hand = [plain.frame_numbers(one) for one in series]
    assert twist == pytest.approx([one for one, _ in by_hand], abs=1e-9)
    assert (whole - [two for _, two in by_hand] + 0.5) % 1.0 == pytest.approx([0.5, 0.5], abs=1e-6)


def test_small_turns_about_the_tangent_are_all_twist():
    for angle in (1e-12, 1e-10, 1e-8, 1e-6):
        frames = np.stack([np.eye(3), Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix().T])
        turned, lifted = np.empty((2, 1))
        assert kernels.frame_steps(frames, np.array([1.0, 0.0, 0.0]), turned, lifted) == 0.0
        assert turned[0] * 2 * np.pi == pytest.approx(angle, rel=1e-6) and abs(lifted[0]) < 1e-15 + 1e-9 * angle


def test_jumps_by_two_are_taken_out():
    values = np.array([0.1, 0.9, -0.8, -0.3, 1.9, 0.2, -1.5])
    assert kernels.unwrap_by_two(values, values[0], 0.0) == 4.0
    assert values == pytest.approx([0.1, 0.9, 1.2, 1.7, 1.9, 2.2, 2.5], abs=1e-12)
    more = np.array([-1.4, 0.4])
    assert kernels.unwrap_by_two(more, 2.5, 4.0) == 2.0
    assert more == pytest.approx([2.6, 2.4], abs=1e-12)


def test_the_vertex_of_the_parabola_through_the_greatest_value():
    places = np.array([0.0, 1.0, 2.5, 3.0, 4.5])
    values = np.stack([7.0 - (places - at) ** 2 for at in (2.2, 2.9, 0.2, 9.0)])
    position, height = np.empty((2, 4))
    kernels.parabola_peaks(places, values, 0, 4, position, height)
    assert position == pytest.approx([2.2, 2.9, 0.0, 4.5]) and height[:2] == pytest.approx([7.0, 7.0])
    assert height[2:].tolist() == [values[2, 0], values[3, 4]]  # at either end the value is its own vertex
    kernels.parabola_peaks(places, values, 1, 2, position, height)
    assert position == pytest.approx([2.2, 2.5, 1.0, 2.5]) and height[1:].tolist() == [values[1, 2], values[2, 1], values[3, 2]]
    flat = np.array([[1.0, 1.0, 1.0, 1.0, 1.0], [0.0, 2.0, 2.0, 2.0, 0.0]])
    kernels.parabola_peaks(places, flat, 2, 3, position[:2], height[:2])
    assert position[:2].tolist() == [2.5, 2.5] and height[:2].tolist() == [1.0, 2.0]
