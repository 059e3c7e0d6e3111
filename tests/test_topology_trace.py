"""Traces: crossing counter, interpolation, passages of levels; frozen, and without a compiler."""

import subprocess
import sys

import numpy as np
import pytest

from octoctrl.sim.topology.trace import TopologyTrace


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
