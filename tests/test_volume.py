"""Volume of the full arm: kept, recorded, and judged."""

from dataclasses import replace

import numpy as np
import pytest
from verdict_scenes import Motion, plan_of, recording_of, run_of

from octoctrl.judging.verification import Limits, verify
from octoctrl.sim.activation import Activation
from octoctrl.sim.plants import make_plant
from octoctrl.sim.templates import Plateau


@pytest.mark.parametrize("groups", [("TM",), ("LM1", "LM2", "LM8"), ("R-OM", "L-OM")], ids="+".join)
def test_strong_muscles_leave_the_volume_and_the_recording_says_so(groups):
    plant = make_plant("assembly-coarse")
    before = plant.core.volume()
    recording = plant.advance(Activation(templates=(Plateau(groups=groups, level=0.6, rise=0.1),)), 0.15)
    whole, slabs = recording.series["volume"], recording.series["slab_volume"]
    assert whole.shape == recording.time.shape and slabs.shape == (*recording.time.shape, 180)
    assert np.abs(whole - 1).max() < 0.005 and np.abs(slabs - 1).max() < 0.02
    # Fans of tetrahedra from ring to ring are another measure of the same.
    assert plant.core.volume() / before == pytest.approx(whole[-1], abs=0.005)
    last = plant.core.series()
    assert last["volume"] == pytest.approx(whole[-1], rel=1e-12)
    np.testing.assert_allclose(last["slab_volume"], slabs[-1], rtol=1e-12)
    # Pressure at the last step is what bulk modulus makes of the volume then.
    pressure = plant.core.pressure()
    assert pressure[90] > 100.0
    np.testing.assert_allclose(1 - pressure / plant.arm.anatomy.bulk_modulus, slabs[-1], atol=1e-5)


def test_published_numerics_lose_volume_and_say_so():
    recording = make_plant("assembly", paper_compatible=True).advance(Activation(templates=(Plateau(groups=("R-OM",), level=0.6),)), 0.02)
    assert recording.series["volume"][-1] < 1 - 1e-4


@pytest.mark.parametrize(
    ("change", "failed"), [({"volume": 0.035}, ("volume",)), ({"slab_volume": -0.06}, ("slab_volume",)), ({"volume": -0.02}, ())]
)
def test_a_verdict_holds_the_volume(change, failed):
    plan = plan_of(Motion())
    recording = recording_of(plan.arm, Motion())
    count = len(recording.time)
    series = {"volume": np.ones(count), "slab_volume": np.ones((count, 180))}
    for name, value in change.items():
        series[name][count // 2] += value
    verdict = verify(run_of(plan, replace(recording, series=series)))
    assert tuple(check.name for check in verdict.checks if not check.passed) == failed
    assert {check.name: check.limit for check in verdict.checks}["volume"] == Limits().volume == 0.03


def test_a_plant_without_volume_is_not_asked_for_it():
    plan = plan_of(Motion())
    assert not {"volume", "slab_volume"} & {check.name for check in verify(run_of(plan, recording_of(plan.arm, Motion()))).checks}
