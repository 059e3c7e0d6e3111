"""Traces: crossing counter, interpolation, passages of levels; frozen, and without a compiler."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.topology.trace import TopologyConvention, TopologyTrace


def dithering_trace():
    t = np.arange(0.0, 8.0, 0.05)
    lifted = np.interp(t, [0.0, 3.0, 4.0, 5.0, 8.0], [0.0, 1.95, 2.05, 2.6, 2.6])
    count = np.where(t > 4.22, 2, np.where(t > 3.8, 1, 0))
    count[(t > 3.3) & (t < 3.38)] = -1
    count[(t > 3.95) & (t < 4.03)] = 2
    return TopologyTrace.from_lifted(time=t, lifted_writhe=lifted, twist=0.1 * t, crossings=count)


def test_net_crossings_ignore_dither():
    trace = dithering_trace()
    net = trace.net_crossings()
    assert np.all(np.diff(net) >= 0)
    assert (net[0], net[-1]) == (0, 2)
    assert trace.time[np.argmax(net == 2)] == pytest.approx(4.25, abs=1e-9)
    assert np.array_equal(trace.net_crossings(0.0, 0.0), trace.crossings)
    assert trace.net_crossings(5.0).max() == 0


def test_interpolation_never_lands_between_two_branches():
    trace = dithering_trace()
    fine = trace.at(np.linspace(0.0, trace.time[-1], 997))
    assert fine.writhe + 2 * fine.crossings == pytest.approx(fine.lifted_writhe, abs=1e-12)
    assert fine.twist == pytest.approx(0.1 * fine.time, abs=1e-12)
    assert trace.at(1.5).lifted_writhe == pytest.approx([0.975])
    again = trace.at(trace.time)
    assert all(np.array_equal(getattr(again, name), getattr(trace, name)) for name in ("crossings", "uturn", "twist"))
    part = trace.slice(1.0, 2.0)
    assert (part.time[0], part.time[-1], part.convention) == (pytest.approx(1.0), pytest.approx(2.0), trace.convention)


def test_level_times():
    t = np.linspace(0.0, 4.0, 5)
    trace = TopologyTrace.from_lifted(time=t, lifted_writhe=[0.0, 1.0, 0.0, 2.0, 2.0], twist=-t)
    assert trace.level_times("lifted_writhe", [0.5, 2.0, 3.0], for_good=False) == pytest.approx([0.5, 3.0, np.nan], nan_ok=True)
    assert trace.level_times("lifted_writhe", [0.5, 1.0]) == pytest.approx([2.25, 2.5])
    assert trace.level_times("twist", -2.5) == pytest.approx([2.5])
    assert np.isnan(trace.level_times("twist", 1.0)).all()


def test_traces_are_frozen_and_need_no_compiler():
    with pytest.raises(ValueError, match="read-only"):
        dithering_trace().twist[0] = 1.0
    code = "import sys, octoctrl.sim.topology.trace; sys.exit('numba' in sys.modules or 'octoctrl.sim.topology.measures' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def counted(counts, lifted=None, turns=0.5, seconds=0.5):
    """Net crossings of samples a quarter of a second apart, lifted writhe growing by a quarter of a turn in each."""
    steps = 0.25 * np.arange(len(counts))
    trace = TopologyTrace.from_lifted(time=steps, lifted_writhe=steps if lifted is None else lifted, twist=0 * steps, crossings=counts)
    return trace.net_crossings(turns, seconds).tolist()


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("first", [0, 3])
@pytest.mark.parametrize(
    ("counts", "net"),
    [
        ([0, 0, 1, 1, 1, 1], [0, 0, 1, 1, 1, 1]),
        ([0, 0, 1, 1], [0, 0, 0, 0]),  # too short a time
        ([0, 0, 1, 1, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 0, 0]),  # and back
        ([0, 1, 1, 1, 0, 0, 0, 1], [0, 1, 1, 1, 0, 0, 0, 0]),
        ([0, 1, 2, 2, 2], [0, 1, 2, 2, 2]),  # in steps, each dated to its own begin
        ([0, 1, 2, 2], [0, 1, 1, 1]),
        ([0, 2, 1, 2, 2, 2], [0, 1, 1, 2, 2, 2]),  # what never came back counts
        ([0, 3, 1, 3, 1, 1, 1], [0, 1, 1, 1, 1, 1, 1]),
        ([0, 1, 1, -1, -1, -1], [0, 0, 0, -1, -1, -1]),  # to the other side
        ([0, 1, 1, -1, -1, 1, 1, 1], [0, 0, 0, 0, 0, 1, 1, 1]),
        ([0, 1, 1, 1, -1, -1, -1], [0, 1, 1, 1, -1, -1, -1]),
        ([0, 1, 1, 1, 1, 1, 2, 2, 2], [0, 1, 1, 1, 1, 1, 2, 2, 2]),
    ],
)
def test_net_crossings_of_known_sequences(counts, net, first, sign):
    assert counted([first + sign * count for count in counts]) == [first + sign * count for count in net]


def test_a_crossing_counts_from_both_thresholds_on():
    counts = [0, 1, 1, 1, 1]
    assert counted(counts, turns=0.75, seconds=0.75) == [0, 1, 1, 1, 1]
    assert counted(counts, turns=0.75 + 1e-9) == counted(counts, seconds=0.75 + 1e-9) == [0, 0, 0, 0, 0]
    assert counted(counts, lifted=[0.0, 1.0, 0.5, 1.0, 1.0]) == counted(counts, lifted=[0.0, 1.0, 1.5, 1.0, 1.0]) == [0, 1, 1, 1, 1]
    assert counted(counts, lifted=[0.0, 1.0, 1.0, 1.0, 1.4]) == [0, 0, 0, 0, 0]  # what it moved before does not count
    lifted = np.array([0.0, 0.0, 0.2, 0.2])
    trace = TopologyTrace.from_lifted(time=[0.0, 0.0625, 0.125, 0.2625], lifted_writhe=lifted, twist=lifted, crossings=[0, 1, 1, 1])
    assert trace.net_crossings().tolist() == [0, 1, 1, 1]  # 0.2 s and 0.2 turns
    assert trace.net_crossings(0.2000001).tolist() == trace.net_crossings(0.2, 0.2000001).tolist() == [0, 0, 0, 0]


def random_trace(seed, count=7):
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.1, 1.0, count)) - 1.0
    jumps = random.integers(-2, 3, count)
    smooth = random.normal(size=(4, count))
    return TopologyTrace(
        time=time, writhe=smooth[0] - 2 * jumps, link=smooth[1] - 2 * jumps, twist=smooth[2], residual=smooth[3], lifted_writhe=smooth[0],
        crossings=jumps, uturn=random.random(count) < 0.4, convention=TopologyConvention(pole=(0, 1, 0)),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(6))
def test_interpolation_sample_by_sample(seed):
    trace = random_trace(seed)
    middles = (trace.time[1:] + trace.time[:-1]) / 2
    wanted = np.sort(np.concatenate([trace.time, middles - 1e-3, middles + 1e-3, trace.time[:-1] + 1e-5, trace.time[1:] - 1e-5]))
    found = trace.at(wanted)
    assert found.convention == trace.convention and found.time.tolist() == wanted.tolist()
    for k, time in enumerate(wanted):
        right = next(i for i, sample in enumerate(trace.time) if sample >= time)
        left = right if trace.time[right] == time else right - 1
        share = 0.0 if left == right else (time - trace.time[left]) / (trace.time[right] - trace.time[left])
        nearest = left if share < 0.5 else right
        assert found.crossings[k] == trace.crossings[nearest]
        assert found.uturn[k] == (trace.uturn[left] or trace.uturn[right])
        for name, jumps in (("twist", 0), ("residual", 0), ("lifted_writhe", 0), ("writhe", 2), ("link", 2)):
            series = getattr(trace, name) + jumps * trace.crossings
            smooth = (1 - share) * series[left] + share * series[right]
            assert getattr(found, name)[k] == pytest.approx(smooth - jumps * trace.crossings[nearest], abs=1e-9)


def test_half_way_the_sample_before_gives_the_branch():
    trace = TopologyTrace.from_lifted(time=[0.0, 1.0], lifted_writhe=[0.0, 0.0], twist=[0.0, 0.0], crossings=[1, 2])
    assert trace.at(0.5).crossings.tolist() == [1]
    single = TopologyTrace.from_lifted(time=[2.0], lifted_writhe=[0.5], twist=[0.0], uturn=[True])
    assert single.at(2.0).lifted_writhe.tolist() == [0.5] and single.at(2.0).uturn.tolist() == [True]


@pytest.mark.parametrize(("ends", "slack"), [((0.0, 0.5), 1e-9), ((0.0, 100.0), 1e-7), ((-100.0, 0.0), 1e-7)])
def test_rounding_of_times_is_forgiven_and_no_more(ends, slack):
    trace = TopologyTrace.from_lifted(time=ends, lifted_writhe=[1.0, 2.0], twist=[0.0, 0.0])
    for end, outward in zip(ends, (-1, 1), strict=True):
        assert trace.at(end + 0.9 * outward * slack).lifted_writhe[0] == pytest.approx(trace.lifted_writhe[0 if outward < 0 else 1])
        with pytest.raises(OctoctrlError, match=r"is outside the trace, which covers"):
            trace.at(end + 1.1 * outward * slack)
    flagged = replace(trace, uturn=[True, False])
    assert flagged.at([ends[0] - slack / 2, ends[1] + slack / 2]).uturn.tolist() == [True, False]
    with pytest.raises(OctoctrlError) as caught:
        trace.at([ends[0] - 1.0, ends[0] - 0.5])
    assert str(caught.value) == f"time {ends[0] - 1:g}…{ends[0] - 0.5:g} s is outside the trace, which covers {ends[0]:g}…{ends[1]:g} s"


def test_slices_keep_all_series_and_both_ends():
    trace = random_trace(3)
    part = trace.slice(trace.time[1], trace.time[4])
    assert part.convention == trace.convention
    for name in ("time", "link", "writhe", "twist", "lifted_writhe", "crossings", "uturn", "residual"):
        assert getattr(part, name).tolist() == getattr(trace, name)[1:5].tolist()


def test_smooth_quantities_make_a_whole_trace():
    trace = TopologyTrace.from_lifted(time=[0, 1], lifted_writhe=[0.5, 2.5], twist=[0.25, 0.5], crossings=[0, 1], uturn=[False, True])
    assert trace.writhe.tolist() == [0.5, 0.5] and trace.link.tolist() == [0.75, 1.0] and trace.residual.tolist() == [0.0, 0.0]
    assert trace.lifted_link.tolist() == [0.75, 3.0] and trace.uturn.tolist() == [False, True]
    plain = TopologyTrace.from_lifted(time=[0, 1], lifted_writhe=[0.5, 2.5], twist=[0.25, 0.5])
    assert plain.crossings.tolist() == [0, 0] and plain.uturn.tolist() == [False, False] and plain.convention == TopologyConvention()


@pytest.mark.parametrize(
    ("values", "level", "first", "last"),
    [
        ([0, 1, 0, 2, 2], 0.5, 0.5, 2.25),
        ([0, 1, 0, 2, 0], 0.5, 0.5, None),  # it does not stay beyond
        ([0, -1, 0, -2, -2], -0.5, 0.5, 2.25),
        ([3, 2, 1, 0, -1], 0.0, 3.0, 3.0),  # exactly on a sample
        ([1, 1, 0, 0, -1], 0.0, 2.0, 2.0),  # rests on the level
        ([0, 0, 1, 2, 3], 0.0, 1.0, 1.0),  # starts on the level and leaves it
        ([0, 0, -1, -2, -3], 0.0, 1.0, 1.0),
        ([0, 1, 0, -1, 1], 0.0, 0.0, 3.5),
        ([2, 2, 2, 2, 2], 2.0, None, None),  # never leaves it
        ([0, 1, 2, 3, 4], 9.0, None, None),
        ([0, 1, 2, 3, 4], 4.0, 4.0, 4.0),
    ],
)
def test_passages_of_levels(values, level, first, last):
    trace = TopologyTrace.from_lifted(time=[0.0, 1.0, 2.0, 3.0, 4.0], lifted_writhe=values, twist=np.zeros(5))
    for for_good, expected in ((False, first), (True, last)):
        found = trace.level_times("lifted_writhe", level, for_good=for_good)
        assert found == pytest.approx([np.nan if expected is None else expected], nan_ok=True)


def test_levels_of_all_series_can_be_asked_for():
    trace = random_trace(1)
    for name in ("lifted_writhe", "twist", "lifted_link", "writhe", "link", "crossings", "residual"):
        series = np.asarray(getattr(trace, name), dtype=float)
        levels = (series[0] + series[-1]) / 2 + np.array([0.0, 1e-3])
        found = trace.level_times(name, levels)
        assert np.interp(found, trace.time, series) == pytest.approx(levels, abs=1e-9)
