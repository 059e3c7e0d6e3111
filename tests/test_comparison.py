"""Planned against simulated, side by side: errors, tip, delays and their text, read again by hand."""

from dataclasses import replace

import numpy as np
import pytest
from verdict_scenes import END, RECORDED, Motion, bump, moved, plan_of, recording_of, run_of, waiting

from octoctrl.carrying.results import ExecutionStatus
from octoctrl.judging.comparison import compare, level_delays, planned_points, rms
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.topology.trace import TopologyTrace

PLANNED = Motion()


def off():
    plan = plan_of(PLANNED)
    motion = replace(PLANNED, twist=bump(PLANNED.twist, 0.3, 4.4, -0.02), bend=bump(PLANNED.bend, 1.0, 4.9, 0.01))
    return run_of(plan, recording_of(plan.arm, motion))


def test_errors_are_simulated_minus_planned():
    run = off()
    found = compare(run)
    assert list(found.errors) == ["lifted_link", "lifted_writhe", "twist"]
    planned = {name: np.interp(RECORDED, run.plan.trace.time, getattr(run.plan.trace, name)) for name in ("lifted_writhe", "twist")}
    planned["lifted_link"] = planned["lifted_writhe"] + planned["twist"]
    for name, error in found.errors.items():
        assert error == pytest.approx(getattr(run.trace, name) - planned[name], abs=1e-9)
    assert found.errors["twist"][20] == pytest.approx(-0.02, abs=1e-9)
    assert found.time.tolist() == RECORDED.tolist() and found.simulated is run.trace and found.execution is run
    assert found.planned.twist == pytest.approx(planned["twist"], abs=1e-12)


def test_summary_holds_rms_and_maximum_of_each_error_and_the_worst_delay():
    found = compare(off())
    numbers = found.summary()
    assert list(numbers) == [*(f"{name}_{kind}" for name in found.errors for kind in ("rms", "max")), "tip_rms", "tip_max", "level_time"]
    for name, error in (*found.errors.items(), ("tip", found.tip_distance)):
        assert numbers[f"{name}_rms"] == pytest.approx(np.sqrt((error**2).sum() / len(error)), rel=1e-12)
        assert numbers[f"{name}_max"] == max(abs(error))
    assert numbers["level_time"] == max(found.delays.values()) > min(found.delays.values())
    assert rms([3.0, -4.0]) == pytest.approx(np.sqrt(12.5)) and type(rms([1.0])) is float


def test_delays_are_named_by_phase_and_quantity_and_only_of_phases_that_change():
    delays = level_delays(off())
    assert list(delays) == ["curl.lifted_writhe", "cross.lifted_writhe", "rest.lifted_writhe", "store.twist", "cross.twist", "rest.twist"]
    # twist falls by 0.6 in 0.8 s and passes -0.3 at 0.4 s; 0.02 less is there 0.02 / 0.75 s earlier
    assert delays["store.twist"] == pytest.approx(0.02 / 0.75, abs=2e-3)
    early = level_delays(run_of(plan_of(PLANNED), recording_of(plan_of(PLANNED).arm, PLANNED, RECORDED[RECORDED <= 2.0])))
    assert list(early) == ["curl.lifted_writhe", "store.twist"]


@pytest.mark.parametrize(("change", "timed"), [(0.2, True), (0.199, False)])
def test_a_change_of_a_fifth_of_a_turn_is_an_event(change, timed):
    motion = replace(PLANNED, twist=(*PLANNED.twist[:5], (6.0, 0.3 + change + 1e-12)))
    plan = plan_of(motion)
    assert ("rest.twist" in level_delays(run_of(plan, recording_of(plan.arm, motion)))) is timed


def test_a_passage_counts_in_its_phase_and_on_a_sample():
    """An excursion of the first phase passes the level of the second, on which a sample lies; the last change is a fifth of a turn."""
    still = Motion(twist=((0.0, 0.0),), bend=((0.0, 0.0),))
    knots = np.array([[0.0, 0.5, 1.0, 2.0, 3.0, 4.5, 6.0], [0.0, -0.5, 0.0, -0.25, -0.5, -0.5, -0.3]])
    late = np.array([[0.0, 0.5, 1.0, 2.125, 3.0, 4.5, 6.0], knots[1]])
    trace = TopologyTrace.from_lifted(time=knots[0], lifted_writhe=0 * knots[1], twist=knots[1])
    plan = plan_of(still, time=knots[0], strains=still.strains(knots[0]), trace=trace)
    run = run_of(
        plan,
        recording_of(plan.arm, still, late[0]),
        trace=TopologyTrace.from_lifted(time=late[0], lifted_writhe=0 * late[1], twist=late[1]),
    )
    assert level_delays(run) == {"curl.twist": 0.125, "rest.twist": 0.0}


def test_the_nearest_of_several_passages_counts():
    twist = ((0.0, 0.0), (0.2, -0.4), (0.3, 0.0), (0.8, -0.6), *PLANNED.twist[2:])  # passes -0.3 twice on the way down
    plan = plan_of(PLANNED)
    delay = level_delays(run_of(plan, recording_of(plan.arm, replace(PLANNED, twist=twist))))["store.twist"]
    assert delay == pytest.approx(abs(0.55 - 0.4), abs=5e-3)


def test_waiting_is_not_late():
    plan = plan_of(PLANNED)
    run = waiting(plan, PLANNED, wait=0.6)
    assert max(level_delays(run).values()) < 0.01 and compare(run).tip_distance.max() < 1e-9
    assert run.waited == pytest.approx(0.6)


def test_tip_distance_is_that_from_the_planned_arm():
    plan = plan_of(PLANNED)
    run = run_of(plan, moved(recording_of(plan.arm, PLANNED), [0.003, 0.0, -0.004]))
    assert compare(run).tip_distance == pytest.approx(np.full(len(RECORDED), 0.005), abs=1e-12)
    shapeless = replace(run, plan=replace(plan, strains=np.empty((0, 0, 4))))
    found = compare(shapeless)
    assert found.tip_distance.size == 0 and "tip_rms" not in found.summary() and "tip" not in str(found)


def test_the_planned_arm_is_held_before_and_after_the_plan():
    plan = plan_of(PLANNED)
    points = planned_points(plan, np.array([-1.0, 0.0, 2.025, END, END + 3.0]))
    expected = recording_of(plan.arm, PLANNED, np.array([0.0, 0.0, 2.025, END, END])).points
    assert points == pytest.approx(expected, abs=1e-9)


def test_a_run_that_was_cut_short_needs_a_word():
    plan = plan_of(PLANNED)
    cut = run_of(plan, recording_of(plan.arm, PLANNED, RECORDED[RECORDED <= 3.5]), status=ExecutionStatus.UNSTABLE)
    with pytest.raises(OctoctrlError) as caught:
        compare(cut)
    assert str(caught.value) == (
        "planned trace covers 0–6.0 s, simulated 0–3.5 s (run stopped early: unstable); comparing 0–3.5 s needs overlap=True"  # noqa: RUF001
    )
    assert compare(cut, overlap=True).time[-1] == 3.5
    with pytest.raises(OctoctrlError, match=r"comparing 0–6\.0 s needs"):  # noqa: RUF001
        compare(waiting_cut(plan))


def waiting_cut(plan):
    return replace(waiting(plan, PLANNED, wait=0.6), status=ExecutionStatus.INTERRUPTED)


def test_the_text_of_a_comparison():
    run = off()
    lines = str(compare(run)).splitlines()
    numbers = compare(run).summary()
    rows = [line.split() for line in lines if line.strip()]
    assert rows[0] == ["simulated", "-", "planned", "rms", "max"]
    assert rows[1] == ["lifted", "link", f"{numbers['lifted_link_rms']:.4f}", "turns", f"{numbers['lifted_link_max']:.4f}", "turns"]
    assert rows[4] == ["tip", f"{1e3 * numbers['tip_rms']:.2f}", "mm", f"{1e3 * numbers['tip_max']:.2f}", "mm"]
    assert rows[5] == ["level", "passed", "time", "error"]
    assert rows[9] == ["store.twist", f"{level_delays(run)['store.twist']:.2f}", "s"]
    never = run_of(run.plan, recording_of(run.plan.arm, replace(PLANNED, twist=(*PLANNED.twist[:5], (6.0, 0.42)))))
    assert ["rest.twist", "never"] in [line.split() for line in str(compare(never)).splitlines()]
    still = Motion(twist=((0.0, 0.0),), bend=((0.0, 0.0),))
    resting = plan_of(still)
    assert "level passed" not in str(compare(run_of(resting, recording_of(resting.arm, still))))
