"""What the measures of topology are given: a finite number or one clear sentence, whatever comes in."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.spatial.transform import Rotation

from octoctrl.sim.errors import OctoctrlError, OctoctrlWarning
from octoctrl.sim.topology import measures as topology
from octoctrl.sim.topology.inputs import AXES, unit_pole
from octoctrl.sim.topology.trace import TopologyConvention, TopologyTrace

CURVE = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.5, 1.8, 0.0], [0.6, 2.2, 0.9]])
ACROSS = np.tile([0.3, 0.1, 0.9], (3, 1))
REST = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
RESTING = np.tile(REST, (4, 1, 1))
HALF_TURNED = np.array([REST, REST, REST * np.array([[-1.0], [-1.0], [1.0]])])
LINE = np.outer(np.arange(3.0), [0.0, 1.0, 0.0])
FOLDED = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.25, 0.0], [0.0, 0.25, 1.0]])


def a_trace(**changes):
    t = np.arange(5.0)
    return replace(TopologyTrace.from_lifted(time=t, lifted_writhe=0.1 * t, twist=-t), **changes)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: topology.writhe(np.zeros((4, 2))), "points has shape (4, 2); (n+1, 3) or (T, n+1, 3) with at least 2 nodes is needed"),
        (lambda: topology.writhe(np.zeros((1, 3))), "points has shape (1, 3); (n+1, 3) or (T, n+1, 3) with at least 2 nodes is needed"),
        (lambda: topology.writhe(np.zeros((0, 4, 3))), "points has shape (0, 4, 3); (n+1, 3) or (T, n+1, 3) with at least 2 nodes is needed"),
        (lambda: topology.writhe(np.zeros((4, 3))), "nodes 0 and 1 of frame 0 coincide; every segment needs a length"),
        (lambda: topology.writhe(CURVE[[0, 1, 1, 2]]), "nodes 1 and 2 of frame 0 coincide; every segment needs a length"),
        (lambda: topology.writhe([[0, 0, 0], [1, 0, 0], [1 + 1e-14, 0, 0]]), "nodes 1 and 2 of frame 0 coincide; every segment needs a length"),
        (lambda: topology.writhe([[1, 0, 0], [0, 0, 0], [6e-13, 6e-13, 6e-13]]), "nodes 1 and 2 of frame 0 coincide; every segment needs a length"),
        (lambda: topology.writhe(1e-40 * CURVE), "points of frame 0 span 2.2e-40, 1e-30…1e+30 is allowed; choose another unit of length"),
        (lambda: topology.writhe(1e40 * CURVE), "points of frame 0 span 2.2e+40, 1e-30…1e+30 is allowed; choose another unit of length"),
        (lambda: topology.writhe([[0, 0, 0], [0, np.nan, 1]]), "points is nan at (1, 1); finite numbers are needed"),
        (lambda: topology.writhe("arm"), "points: expected an array of numbers, found str of <U3"),
        (lambda: topology.writhe([["0", "1", "2"]] * 2), "points: expected an array of numbers, found list of <U1"),
        (lambda: topology.writhe(CURVE + 1j), "points: expected an array of numbers, found ndarray of complex128"),
        (lambda: topology.writhe([[0, 0, 0], [1]]), "points: expected an array of numbers, found rows of different lengths"),
        (lambda: topology.writhe(CURVE, -1.0), "ray_length=-1 arm lengths is outside 0…1e+06 arm lengths"),
        (lambda: topology.writhe_map(CURVE[None]), "points has shape (1, 4, 3); one curve (n+1, 3) at a time is needed here"),
        (lambda: topology.writhe_map(CURVE, 4), "sections=4; a whole number from 1 to 3 is needed"),
        (lambda: topology.writhe_map(CURVE, True), "sections=True; a whole number from 1 to 3 is needed"),
        (lambda: topology.twist(CURVE, np.ones((4, 3))), "normals has shape (4, 3); one per segment, (3, 3), is needed"),
        (lambda: topology.twist(CURVE, 0 * ACROSS), "normal 0 is zero or parallel to its segment; give a direction across the arm"),
        (lambda: topology.link(CURVE, np.diff(CURVE, axis=0), 0.1), "normal 0 is zero or parallel to its segment; give a direction across the arm"),
        (lambda: topology.twist(FOLDED, [[1, 0, 0]] * 3), "segments 0 and 1 fold back on each other; twist over their node has no meaning"),
        (lambda: topology.link(CURVE, ACROSS, -1.0), "radius is -1.0; a positive number or one per segment (3,) is needed"),
        (lambda: topology.link(CURVE, ACROSS, [1.0, 2.0]), "radius is [1.0, 2.0]; a positive number or one per segment (3,) is needed"),
        (lambda: topology.link(CURVE, ACROSS, "thin"), "radius: expected an array of numbers, found str of <U4"),
        (lambda: topology.frame_twist(np.ones((4, 3, 3))), "frames are off orthonormal by 3.0e+00; rows must be unit vectors at right angles to 1e-4"),
        (lambda: topology.frame_twist(2 * RESTING), "frames are off orthonormal by 3.0e+00; rows must be unit vectors at right angles to 1e-4"),
        (lambda: topology.frame_twist(-RESTING), "frames are left-handed; d3 must be d1 x d2"),
        (lambda: topology.frame_twist(RESTING[:1]), "frames has shape (1, 3, 3); (m, 3, 3) or (T, m, 3, 3) with at least 2 stations is needed"),
        (lambda: topology.frame_twist(HALF_TURNED), "frames 1 and 2 of instant 0 differ by half a turn; more stations are needed between"),
        (lambda: topology.regional(RESTING[None]), "frames has shape (1, 4, 3, 3); one arm (m, 3, 3) at a time is needed here"),
        (lambda: topology.lifted_writhe(RESTING, (0, 0, 0)), "pole is (0, 0, 0); three finite numbers are needed, not all zero, for example (0, 0, 1)"),
        (lambda: topology.lifted_writhe(RESTING, "up"), "pole is 'up'; three finite numbers are needed, not all zero, for example (0, 0, 1)"),
        (lambda: topology.classify_sections(RESTING, 9), "sections=9; a whole number from 1 to 3 is needed"),
        (lambda: topology.sucker_orientation(RESTING, np.nan), "azimuth is nan; a finite number is needed"),
        (lambda: topology.packet_position(RESTING, [0, 1]), "arclength needs 4 increasing values, one per frame; found shape (2,)"),
        (lambda: topology.packet_position(RESTING, [0, 1, 1, 2]), "arclength needs 4 increasing values, one per frame; found shape (4,)"),
        (lambda: topology.packet_position(RESTING, range(4), window=(0.4,)), "window is (0.4,); two numbers are needed, begin and end in arm lengths"),
        (lambda: topology.packet_position(RESTING, range(4), window=(2.0, 3.0)), "window (2.0, 3.0) holds no station; it must cover part of 0…1 arm lengths"),
        (lambda: topology.measure([0.0], LINE, RESTING[None].repeat(2, axis=0)), "time has 1 samples, points 1, frames 2; they must agree"),
        (lambda: topology.measure([[0.0]], LINE, RESTING), "time has shape (1, 1); one value per time is needed"),
        (lambda: topology.measure([1.0, 1.0], [LINE] * 2, [RESTING] * 2), "time goes from 1 s to 1 s; it must increase"),
        (lambda: topology.measure([0.0], LINE, RESTING, (0, 0, 1)), "convention: expected a TopologyConvention, found tuple"),
        (lambda: topology.present([LINE, LINE], [RESTING] * 2), "points has shape (2, 3, 3); one curve (n+1, 3) at a time is needed here"),
        (lambda: TopologyConvention(pole=(0, 0, np.inf)), "pole is (0, 0, inf); three finite numbers are needed, not all zero, for example (0, 0, 1)"),
        (lambda: TopologyConvention(closure="ray"), "unknown closure 'ray'; did you mean 'rays'? (rays)"),
        (lambda: TopologyConvention(ray_length=0), "ray_length=0 arm lengths is outside 0…1e+06 arm lengths"),
        (lambda: TopologyTrace.from_lifted(time=[0, 1], lifted_writhe=[0.0], twist=[0, 0]), "lifted_writhe has shape (1,), but time (2,); one value per time is needed"),
        (lambda: TopologyTrace.from_lifted(time=[0, 1], lifted_writhe=[0, 0], twist=[0, 0], crossings=[0]), "crossings has shape (1,), but time (2,); one value per time is needed"),
        (lambda: TopologyTrace.from_lifted(time=[], lifted_writhe=[], twist=[]), "time is empty; a trace needs at least one sample"),
        (lambda: TopologyTrace.from_lifted(time=[1, 1], lifted_writhe=[0, 0], twist=[0, 0]), "time goes from 1 s to 1 s; it must increase"),
        (lambda: a_trace(convention="rays"), "convention: expected a TopologyConvention, found str"),
        (lambda: a_trace(crossings=np.full(5, 0.5)), "crossings holds 0.5; whole numbers are needed"),
        (lambda: a_trace(uturn=np.full(5, 2)), "uturn holds 2; true or false are needed"),
        (lambda: a_trace(link=np.zeros(4)), "link has 4 samples, but time has 5"),
        (lambda: a_trace(link=np.zeros((5, 1))), "link has shape (5, 1); one value per time is needed"),
        (lambda: a_trace().at(99.0), "time 99…99 s is outside the trace, which covers 0…4 s"),
        (lambda: a_trace().at([1.0, np.nan]), "time is nan at (1,); finite numbers are needed"),
        (lambda: a_trace().at([]), "time has shape (0,); one or more times are needed"),
        (lambda: a_trace().at([2.0, 1.0]), "time goes from 2 s to 1 s; it must increase"),
        (lambda: a_trace().slice(9.0, 10.0), "no sample lies in 9…10 s; the trace covers 0…4 s"),
        (lambda: a_trace().slice("0", 1.0), "start: expected a number in s, found the string '0'"),
        (lambda: a_trace().slice(0.0, np.nan), "stop is nan; a finite number is needed"),
        (lambda: a_trace().net_crossings(-0.1), "hysteresis_turns=-0.1 turns is outside >= 0 turns"),
        (lambda: a_trace().net_crossings(0.1, -0.1), "hysteresis_time=-0.1 s is outside >= 0 s"),
        (lambda: a_trace().level_times("writh", 1.0), "unknown quantity 'writh'; did you mean 'writhe'? (lifted_writhe, twist, lifted_link, writhe, link, crossings, residual)"),
        (lambda: a_trace().level_times("twist", [[1.0]]), "levels has shape (1, 1); one level or a list of them is needed"),
        (lambda: a_trace().level_times("twist", [np.nan]), "levels is nan at (0,); finite numbers are needed"),
    ],
)  # fmt: skip
def test_bad_input_is_named_in_one_sentence(call, message):
    with pytest.raises(OctoctrlError) as caught:
        call()
    assert str(caught.value) == message


def rod(tilt=0.0, elements=12, bend=1.0):
    """Points and frames (base, element centres, tip) of an arm along `-z` turned by `tilt`, bent by `bend` rad in the plane of x and z."""
    middle = (np.arange(elements) + 0.5) / elements
    angle = np.concatenate([[0.0], bend * middle**2, [bend]])
    hanging = Rotation.from_rotvec(np.outer(angle + tilt, [0.0, 1.0, 0.0])).as_matrix()
    frames = np.stack([hanging[:, :, 0], -hanging[:, :, 1], -hanging[:, :, 2]], axis=1)  # rows d1, d2, d3: d3 from -z
    return np.concatenate([np.zeros((1, 3)), np.cumsum(frames[1:-1, 2] / elements, axis=0)]), frames


def swing(noise=0.0, instants=60):
    """A hanging arm that swings in a plane, its markers with noise; its frames lie on its edges."""
    random, time = np.random.default_rng(3), np.linspace(0.0, 2.0, instants)
    points = np.stack([rod(bend=0.6 * np.sin(np.pi * t))[0] for t in time])
    points = points + noise * random.normal(size=points.shape)
    d3 = np.diff(points, axis=1)
    d3 /= np.linalg.norm(d3, axis=2, keepdims=True)
    d1 = np.cross([0.0, 1.0, 0.0], d3)
    d1 /= np.linalg.norm(d1, axis=2, keepdims=True)
    inner = np.stack([d1, np.cross(d3, d1), d3], axis=2)
    return time, points, np.concatenate([inner[:, :1], inner, inner[:, -1:]], axis=1)


@pytest.mark.parametrize(("noise", "bound"), [(0.0, 1e-9), (1e-6, 1e-4), (1e-3, 0.05)])
def test_a_hanging_arm_gets_a_pole_that_suits_it_and_is_told_so(noise, bound):
    with pytest.warns(OctoctrlWarning, match=r"opposite of the pole \(0, 0, 1\): the pole \(0, 0, -1\) is taken instead") as told:
        trace = topology.measure(*swing(noise))
    assert [warning.filename for warning in told] == [__file__]
    assert trace.convention.pole == (0.0, 0.0, -1.0)
    assert np.abs(trace.lifted_writhe).max() < bound and np.abs(trace.writhe).max() < bound
    assert not trace.crossings.any()
    across = topology.measure(*swing(noise), TopologyConvention(pole=(0.0, 1.0, 0.0)))
    assert across.lifted_writhe == pytest.approx(trace.lifted_writhe, abs=1e-9)


def test_a_pole_that_was_asked_for_is_kept_and_the_trouble_is_told():
    time, points, frames = swing(1e-3)
    with pytest.warns(
        OctoctrlWarning,
        match=r"the arm starts within 0\.\d degrees of the opposite of the pole \(0, 0, 1\): lifted writhe and crossings are",
    ):
        trace = topology.measure(time, points, frames, TopologyConvention())
    assert trace.convention == TopologyConvention()
    with pytest.warns(OctoctrlWarning, match="choose another pole") as told:
        topology.lifted_writhe(frames, (0, 0, 2))
    assert [warning.filename for warning in told] == [__file__]
    with pytest.warns(OctoctrlWarning, match="is taken instead") as told:
        topology.regional(frames[0])
    assert [warning.filename for warning in told] == [__file__]


@pytest.mark.parametrize(("degrees", "told"), [(4.9, True), (5.1, False)])
def test_five_degrees_are_far_enough(degrees, told):
    _, frames = rod(tilt=np.radians(degrees), bend=0.5)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        topology.lifted_writhe(frames)
        topology.lifted_writhe(frames, (0, 0, 1))
    assert [bool(caught), len(caught)] == [told, 2 * told]


def test_of_the_axes_the_farthest_is_taken():
    for turn, expected in (([0, 0, 0], (0, 0, -1)), ([0.3, 0, 0], (0, 0, 1)), ([0, 0.2, 0], (0, 0, 1))):
        _, frames = rod(bend=0.1)
        turned = frames @ Rotation.from_rotvec(turn).as_matrix().T
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            points = np.concatenate([np.zeros((1, 3)), np.cumsum(turned[1:-1, 2], axis=0)])
            assert topology.measure([0.0], points, turned).convention.pole == expected


def test_the_poles_to_choose_from_are_the_six_axes():
    assert sorted(AXES) == sorted(tuple(sign * row) for row in np.eye(3) for sign in (1.0, -1.0)) and AXES[0] == (0.0, 0.0, 1.0)


def test_frames_given_as_columns_are_refused_with_the_remedy():
    turn = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix().T
    points, frames = (array @ turn for array in rod(tilt=0.4))
    for rows in (frames, frames[1:-1], frames[::13]):  # at base, centres and tip; at the centres alone; at the ends alone
        columns = rows.swapaxes(-1, -2)
        with pytest.raises(
            OctoctrlError, match=r"do not follow the points \(mean cosine -?0\.\d\d\): they are columns; swap the last two axes"
        ):
            topology.measure([0.0], points, columns, TopologyConvention(pole=(0, 1, 0)))
        topology.measure([0.0], points, rows, TopologyConvention(pole=(0, 1, 0)))
    with pytest.raises(OctoctrlError, match="rows d1, d2, d3 with d3 along the arm are needed"):
        topology.present(points[:, [1, 2, 0]], frames)


def test_a_single_frame_that_points_back_is_refused():
    points, frames = rod(tilt=1.0)
    turned = frames.copy()
    turned[5] = Rotation.from_rotvec(3.1 * turned[5, 0]).apply(turned[5])
    with pytest.raises(OctoctrlError, match=r"d3 of frame 0 points back along segment 4 \(cosine -0.999\)"):
        topology.present(points, turned)


def test_the_convention_that_was_asked_for_is_kept_to_the_last_bit():
    asked = TopologyConvention(pole=(0.3, -1.7, 0.123))
    assert topology.measure([0.0], *rod(tilt=1.0), asked).convention == asked


def test_a_pole_of_any_size_is_a_direction():
    for size in (1e-300, 1e-3, 1.0, 1e300):
        assert unit_pole((0.6 * size, 0.0, -0.8 * size)) == pytest.approx((0.6, 0.0, -0.8), abs=1e-15)


NUMBERS = st.one_of(st.sampled_from([0.0, 1.0, -1.0, 1e-13, 1e-200, 1e200, np.inf, np.nan]), st.floats(-2.0, 2.0))
ODD = st.one_of(st.none(), st.booleans(), st.text(max_size=3), st.integers(-3, 9), NUMBERS, st.just(1j), st.just([[0.0], [1.0, 2.0]]))
LATTICE = st.sampled_from([0.0, 0.0, 1.0, -1.0, 0.5])


def arrays_of(*shapes):
    """Arrays of about the right shape: numbers of a lattice, where curves fold and meet, or any numbers."""
    return st.one_of(*(arrays(float, shape, elements=item) for shape in shapes for item in (LATTICE, NUMBERS)))


CURVES = st.one_of(arrays_of((4, 3), (2, 3), (5, 3), (2, 4, 3)), arrays_of(array_shapes(max_dims=4, max_side=4)), ODD)
SIGNED_AXES = st.sampled_from([Rotation.create_group("O").as_matrix()[k] for k in range(24)])
FRAMES = st.one_of(
    st.lists(SIGNED_AXES, min_size=1, max_size=6).map(np.array),
    st.lists(SIGNED_AXES, min_size=8, max_size=8).map(lambda frames: np.array(frames).reshape(2, 4, 3, 3)),
    st.integers(0, 99).map(lambda seed: Rotation.random(5, random_state=seed).as_matrix()),
    arrays_of((3, 3, 3), array_shapes(max_dims=4, max_side=3)),
    ODD,
)
POLES = st.one_of(arrays_of((3,)), st.sampled_from([(0, 0, 1), (0, 0, -1)]), ODD)
RAYS = st.one_of(st.sampled_from([0.0, 10.0, 1000.0]), ODD)
TRACES = st.fixed_dictionaries({name: st.one_of(arrays_of((4,)), ODD) for name in ("lifted_writhe", "twist", "crossings", "uturn")})


def check(call):
    """The call gives numbers without a sound, or one sentence."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", OctoctrlWarning)
        try:
            answer = call()
        except OctoctrlError as error:
            assert len(str(error)) > 20 and "\n" not in str(error)
            return
    for values in answer if isinstance(answer, tuple) else (answer,):
        assert np.isfinite(np.asarray(values, dtype=float)).all(), values


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
@pytest.mark.parametrize(
    "call",
    [
        lambda draw: topology.writhe(draw(CURVES), draw(RAYS)),
        lambda draw: topology.writhe_map(draw(CURVES), draw(st.one_of(st.integers(1, 3), ODD)), draw(RAYS)),
        lambda draw: topology.writhe_density(draw(CURVES), draw(RAYS)),
        lambda draw: topology.link(draw(CURVES), draw(CURVES), draw(st.one_of(st.floats(0.01, 1.0), arrays_of((3,)), ODD)), draw(RAYS)),
        lambda draw: topology.twist(draw(CURVES), draw(CURVES)),
        lambda draw: topology.frame_twist(draw(FRAMES)),
        lambda draw: topology.lifted_writhe(draw(FRAMES), draw(POLES)),
        lambda draw: topology.regional(draw(FRAMES), draw(POLES)),
        lambda draw: topology.present(draw(CURVES), draw(FRAMES), draw(POLES)),
        lambda draw: series_of(topology.measure(draw(st.one_of(arrays_of((2,)), st.just([0.0]), ODD)), draw(CURVES), draw(FRAMES))),
        lambda draw: np.nan_to_num(topology.sucker_orientation(draw(FRAMES), draw(st.one_of(NUMBERS, ODD)), draw(st.one_of(NUMBERS, ODD)))),
        lambda draw: topology.classify_sections(draw(FRAMES), draw(st.one_of(st.integers(1, 3), ODD)), draw(st.one_of(st.just(0.1), ODD))),
        lambda draw: packet(draw(FRAMES), draw(st.one_of(arrays_of((4,)), st.just(range(4)), ODD)), draw(st.one_of(st.just(0.1), ODD)), draw(ODD)),
        lambda draw: series_of(TopologyTrace.from_lifted(time=draw(st.one_of(st.just(range(4)), arrays_of((4,)))), **draw(TRACES))),
        lambda draw: series_of(a_trace().at(draw(st.one_of(arrays_of((3,)), ODD)))),
        lambda draw: series_of(a_trace().slice(draw(ODD), draw(ODD))),
        lambda draw: a_trace().net_crossings(draw(ODD), draw(ODD)),
        lambda draw: np.nan_to_num(a_trace().level_times("twist", draw(st.one_of(arrays_of((3,)), ODD)))),
        lambda draw: np.array(TopologyConvention(pole=draw(POLES), ray_length=draw(RAYS)).pole),
    ],
)  # fmt: skip
def test_whatever_comes_in_gives_numbers_or_one_sentence(call, data):
    check(lambda: call(data.draw))


def packet(frames, arclength, smoothing, window):
    position, curvature = topology.packet_position(frames, arclength, smoothing, (0.0, 1.0) if window is None else window)
    return np.nan_to_num(position), curvature  # a straight arm has no packet


def series_of(trace):
    return tuple(getattr(trace, name) for name in ("time", "link", "writhe", "twist", "lifted_writhe", "crossings", "uturn", "residual"))


def test_more_crossings_than_can_be_counted_are_refused():
    with pytest.raises(OctoctrlError, match=r"^crossings holds 1e\+200; whole numbers up to 9.0072e\+15 are needed$"):
        TopologyTrace.from_lifted(time=range(4), lifted_writhe=np.zeros(4), twist=np.zeros(4), crossings=np.full(4, 1e200))
