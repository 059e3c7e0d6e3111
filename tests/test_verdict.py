"""Every check of a verdict against an independent reading of the raw recording, on runs that pass and on runs that fail just that check."""

from dataclasses import fields, replace
from itertools import pairwise
from math import inf, nan

import numpy as np
import plain_topology
import pytest
from scipy.spatial.transform import Rotation
from verdict_scenes import EDGES, END, GOALS, RECORDED, Motion, bump, moved, plan_of, recording_of, run_of, waiting

from octoctrl.carrying.results import Check, ExecutionStatus, Verdict, VerdictStatus, VerificationFailedError
from octoctrl.judging.verification import Limits, verify
from octoctrl.planners.asking.registry import goal
from octoctrl.planners.contracts import When
from octoctrl.sim.errors import OctoctrlError

PLANNED = Motion()
LIMITS = {
    "writhe_rms": 0.05, "writhe_max": 0.15, "twist_rms": 0.05, "level_time": 0.3, "link_residual": 0.02, "tip_rms": 0.08,
    "volume": 0.03, "slab_volume": 0.05,
}  # fmt: skip


def wound_to(turns):
    """The motion whose last twist is `turns`: near 0.21 the crossing of the plane begins to count."""
    return replace(PLANNED, twist=(*PLANNED.twist[:3], (4.2, turns)))


def twisted(begin, end, size):
    return replace(PLANNED, twist=bump(PLANNED.twist, begin, end, size))


def bent(begin, end, size):
    return replace(PLANNED, bend=bump(PLANNED.bend, begin, end, size))


def carried_out(motion=PLANNED, plan=None, level=0.25, **changes):
    plan = plan_of(PLANNED) if plan is None else plan
    return run_of(plan, recording_of(plan.arm, motion, level=level), **changes)


def elsewhere():
    plan = plan_of(PLANNED)
    return run_of(plan, moved(recording_of(plan.arm, PLANNED), [0.0, 0.012, -0.012]))


def one_level(level):
    run = carried_out()
    levels = run.recording.levels.copy()
    levels[50, 3, 7] = level
    return replace(run, recording=replace(run.recording, levels=levels))


def swollen(**changes):
    """A run of a plant that keeps books of its volume, which leaves that at rest for one instant."""
    run = carried_out()
    series = {"volume": np.ones(len(run.recording.time)), "slab_volume": np.ones((len(run.recording.time), 9))}
    for name, change in changes.items():
        series[name][50] += change
    return replace(run, recording=replace(run.recording, series=series))


def without_last_event(run):
    return replace(run, events=run.events[:-1])


def asking(phase, goal):
    """A run that does what was planned, of a task that asks for `goal` at the end of a phase."""
    return carried_out(plan=plan_of(PLANNED, goals=GOALS | {phase: (goal,)}))


FAILING = {
    "unfinished_phases": lambda: without_last_event(carried_out()),
    "stopped": lambda: carried_out(status=ExecutionStatus.UNSTABLE),
    "store.twist": lambda: asking("store", goal("twist", value=-0.5, tolerance=0.09)),
    "curl.lifted_writhe": lambda: asking("curl", goal("lifted_writhe", value=-0.9, tolerance=0.1)),
    "cross.lifted_link": lambda: asking("cross", goal("lifted_link", value=-1.8, tolerance=0.15)),
    "rest.length": lambda: asking("rest", goal("length", value=0.195, tolerance=0.004)),
    "writhe_rms": lambda: carried_out(bent(1.4, 2.95, 0.057)),
    "writhe_max": lambda: carried_out(bent(1.8, 2.1, 0.1)),
    "twist_rms": lambda: carried_out(twisted(0.1, 1.2, 0.13)),
    "crossings": lambda: carried_out(wound_to(0.212), plan_of(wound_to(0.198))),
    "level_time": lambda: carried_out(replace(PLANNED, twist=(*PLANNED.twist[:-1], (4.9, 0.3), (6.0, 0.485)))),
    "link_residual": lambda: carried_out(plan=plan_of(PLANNED, elements=20)),
    "activation": lambda: one_level(1.01),
    "tip_rms": elsewhere,
    "volume": lambda: swollen(volume=0.04),
    "slab_volume": lambda: swollen(slab_volume=-0.06),
}
PASSING = {
    "as planned": carried_out,
    "a little off": lambda: carried_out(replace(twisted(0.3, 4.4, 0.01), bend=bump(PLANNED.bend, 1.0, 4.9, 0.01))),
    "a little off the other way": lambda: carried_out(replace(twisted(0.3, 4.4, -0.01), bend=bump(PLANNED.bend, 1.0, 4.9, -0.01))),
    "a phase that waits": lambda: waiting(plan_of(PLANNED), twisted(0.7, 2.6, 0.02)),
    "a volume that moves a little": lambda: swollen(volume=-0.02, slab_volume=0.04),
    "late phases": lambda: late(carried_out(replace(twisted(0.7, 2.6, 0.02), stretch=((0.0, 1.0), (2.5, 0.952))))),
}


def late(run):
    """Phases that end between two recorded instants, later than planned."""
    return replace(run, events=tuple(replace(event, actual=min(event.planned + 0.0137, END)) for event in run.events))


def plain_reading(run):
    """All checks by hand: dict of name to value and limit."""
    found, plan, times, clock = read(run.recording), run.plan, run.recording.time, run.clock
    planned = {name: np.interp(clock, plan.trace.time, getattr(plan.trace, name)) for name in ("twist", "lifted_writhe")}
    begins, ends = [*EDGES.values(), END], {event.phase: event.actual for event in run.events}
    values = {
        "unfinished_phases": (4 - len(run.events), 0),
        "stopped": (0 if run.status.name == "FINISHED" else 1, 0),
    }
    for phase in plan.task.phases:
        for wanted in phase.goals:
            value = np.interp(ends[phase.name], times, found[wanted.quantity]) if phase.name in ends else inf
            values[f"{phase.name}.{wanted.quantity}"] = (abs(value - wanted.value), wanted.tolerance)
    writhe, twist = (found[name] - planned[name] for name in ("lifted_writhe", "twist"))
    crossed = [settled(times, found["crossings"], found["lifted_writhe"])]
    crossed.append(settled(plan.trace.time, plan.trace.crossings, plan.trace.lifted_writhe))
    delays = [0.0]
    for name in ("lifted_writhe", "twist"):
        for begin, end in pairwise(begins):
            first, last = np.interp([begin, end], plan.trace.time, getattr(plan.trace, name))
            if abs(last - first) >= 0.2 and begin < clock[-1]:
                inside = plan.trace.time <= end
                asked = crossing_times(plan.trace.time[inside], getattr(plan.trace, name)[inside], (first + last) / 2, last > first)
                had = crossing_times(clock, found[name], (first + last) / 2, last > first)
                wanted = min(time for time in asked if time >= begin)
                delays.append(min((abs(time - wanted) for time in had), default=inf))
    distance = np.sqrt(((run.recording.points[:, -1] - np.array([planned_tip(plan, reading) for reading in clock])) ** 2).sum(axis=1)) / 0.2
    kept = {
        name: (max(abs(run.recording.series[name].ravel() - 1)), LIMITS[name])
        for name in ("volume", "slab_volume")
        if name in run.recording.series
    }
    return (
        values
        | {
            "writhe_rms": (np.sqrt((writhe**2).sum() / len(writhe)), 0.05),
            "writhe_max": (max(abs(writhe)), 0.15),
            "twist_rms": (np.sqrt((twist**2).sum() / len(twist)), 0.05),
            "crossings": (abs(crossed[0] - crossed[1]), 0),
            "level_time": (max(delays), 0.3),
            "link_residual": (max(abs(found["residual"])), 0.02),
            "activation": (max(run.recording.levels.ravel()), 1.0),
            "tip_rms": (np.sqrt((distance**2).sum() / len(distance)), 0.08),
        }
        | kept
    )


def read(recording, known={}):  # noqa: B006
    """The plain reading of a recording; many runs share one."""
    key = recording.time.tobytes() + recording.points.tobytes() + recording.frames.tobytes()
    if key not in known:
        known[key] = plain_topology.read(recording)
    return known[key]


def settled(time, count, lifted):
    """The last crossing count if it has lasted 0.2 s and lifted writhe has moved by 0.2 turns since, else the first."""
    began = 1 + max(k for k in range(len(time)) if count[k] == count[0])
    assert (np.diff(count) <= 0).all()  # it may go in steps, but not back
    lasted, moved_by = time[-1] - time[began], max(abs(lifted[began:] - lifted[began]))
    return count[-1] if lasted >= 0.2 and moved_by >= 0.2 else count[0]


def crossing_times(times, values, level, upward):
    found = []
    for (before, one), (after, other) in pairwise(zip(times, values, strict=True)):
        if (one < level <= other) if upward else (one > level >= other):
            found.append(before + (level - one) / (other - one) * (after - before))
    return found


def planned_tip(plan, time):
    """Tip of an arm of uniform strains that starts at the origin along +y with d1 = +z: each element along d3 at its centre."""
    k1, k2, k3, stretch = (np.interp(time, plan.time, plan.strains[:, 0, column]) for column in range(4))
    centres, lengths = (plan.arm.edges[1:] + plan.arm.edges[:-1]) / 2, np.diff(plan.arm.edges)
    along = Rotation.from_rotvec(centres[:, None] * np.array([k1, k2, k3])).as_matrix()[:, :, 2]  # d3 in the base frame (d1, d2, d3)
    step = stretch * (lengths[:, None] * along).sum(axis=0)
    return np.array([step[1], step[2], step[0]])  # d1 = +z, d2 = +x, d3 = +y


def unit_of(name):
    units = {
        "volume": "",
        "slab_volume": "",
        "level_time": "s",
        "tip_rms": "lengths",
        "crossings": "",
        "activation": "",
        "unfinished_phases": "",
        "stopped": "",
    }
    return "m" if name.endswith(".length") else units.get(name, "turns")


@pytest.mark.parametrize("scene", PASSING)
def test_runs_that_follow_their_plan_pass(scene):
    verdict = verify(PASSING[scene](), strict=True)
    assert verdict.status is VerdictStatus.PASS and verdict.passed
    assert str(verdict).endswith(f"VERDICT pass ({len(verdict.checks)}/{len(verdict.checks)})")


def test_two_goals_of_one_quantity_have_names_of_their_own():
    run = next(iter(PASSING.values()))()
    first, *others = run.plan.task.phases
    wide = goal("twist", between=(-90.0, 90.0))
    task = replace(run.plan.task, phases=(replace(first, goals=(*first.goals, wide, wide)), *others))
    names = [check.name for check in verify(replace(run, plan=replace(run.plan, task=task))).checks]
    count = sum(item.quantity == "twist" for item in first.goals)
    assert f"{first.name}.twist[{count + 2}]" in names and len(names) == len(set(names))


@pytest.mark.parametrize("scene", FAILING)
def test_a_run_can_fail_any_check_alone(scene):
    verdict = verify(FAILING[scene]())
    assert [check.name for check in verdict.checks if not check.passed] == [scene]
    assert verdict.status is VerdictStatus.FAIL and not verdict.passed
    assert str(verdict).endswith(f"VERDICT fail ({len(verdict.checks) - 1}/{len(verdict.checks)})")
    with pytest.raises(VerificationFailedError, match=rf"^verification failed: {scene} \S+ > \S+$"):
        verify(FAILING[scene](), strict=True)


@pytest.mark.parametrize("name", [item.name for item in fields(Limits)])
def test_a_value_at_its_limit_passes_and_one_just_beyond_fails(name):
    run = FAILING[name]()
    value = next(check.value for check in verify(run).checks if check.name == name)
    at = verify(run, limits=Limits(**{name: value}))
    assert at.passed
    assert next(check for check in at.checks if check.name == name).margin == 0.0
    beyond = verify(run, limits=Limits(**{name: np.nextafter(value, 0.0)}))
    assert [check.name for check in beyond.checks if not check.passed] == [name]
    assert next(check for check in beyond.checks if check.name == name).margin < 0.0


@pytest.mark.parametrize("quantity", ["twist", "lifted_writhe", "lifted_link", "length"])
def test_a_goal_at_its_tolerance_is_met_and_one_just_beyond_is_not(quantity):
    wanted = goal(quantity, value=0.1, tolerance=1.0)
    value = next(check.value for check in verify(asking("cross", wanted)).checks if check.name == f"cross.{quantity}")
    assert value > 0.05
    for tolerance, met in ((value, True), (np.nextafter(value, 0.0), False)):
        verdict = verify(asking("cross", replace(wanted, tolerance=tolerance)))
        assert {check.name: check.passed for check in verdict.checks}[f"cross.{quantity}"] is met
        assert verdict.passed is met


@pytest.mark.parametrize(
    ("phase", "target", "times"),
    [
        ("store", {"at_most": 0.0, "when": When.THROUGHOUT}, (0.0, 1.0)),  # the arm was wound the other way at first
        ("store", {"at_least": -0.55, "when": When.THROUGHOUT}, (0.0, 1.0)),
        ("curl", {"at_most": -0.58, "when": When.THROUGHOUT}, (1.0, 3.0)),  # before and after it is not so
        ("cross", {"between": (-0.62, 0.2), "when": When.THROUGHOUT}, (3.0, 4.5)),
        ("rest", {"at_least": 0.5}, (6.0, 6.0)),
        ("rest", {"at_least": 0.5, "hold": 0.75}, (5.25, 6.0)),
        ("rest", {"at_least": 0.5, "hold": 3.0}, (4.5, 6.0)),
    ],
)
def test_goals_that_hold_for_a_while_are_read_over_that_while(phase, target, times):
    aim = goal("twist", tolerance=0.03, **target)
    motion = twisted(0.1, 0.3, 0.15)
    run = carried_out(motion, plan_of(PLANNED, goals=GOALS | {phase: (aim,)}))
    twist = read(run.recording)["twist"][(times[0] <= RECORDED) & (times[1] >= RECORDED)]
    low, high = target.get("between", (target.get("at_least", -inf), target.get("at_most", inf)))
    expected = max(0.0, low - min(twist), max(twist) - high)
    found = next(check for check in verify(run).checks if check.name == f"{phase}.twist")
    assert found.value == pytest.approx(expected, abs=2e-8) and found.limit == 0.03


def test_limits_are_those_of_the_documentation():
    defaults = {item.name: item.default for item in fields(Limits)}
    assert defaults == LIMITS | {"crossings": 0, "activation": 1.0}


def test_goals_of_a_phase_that_was_not_reached_are_missed_by_any_measure():
    plan = plan_of(PLANNED)
    run = run_of(plan, recording_of(plan.arm, PLANNED, RECORDED[RECORDED <= 3.5]), status=ExecutionStatus.INTERRUPTED)
    missed = {check.name: check.value for check in verify(run).checks if not check.passed}
    assert missed == {"unfinished_phases": 2.0, "stopped": 1.0, "cross.lifted_link": inf, "level_time": inf}


@pytest.mark.parametrize("status", [status for status in ExecutionStatus if status is not ExecutionStatus.FINISHED])
def test_a_run_that_was_stopped_after_its_last_phase_fails_too(status):
    assert [check.name for check in verify(carried_out(status=status)).checks if not check.passed] == ["stopped"]


def test_what_is_not_a_number_passes_nothing():
    assert [check.name for check in verify(one_level(nan)).checks if not check.passed] == ["activation"]
    assert not Check(name="x", value=nan, limit=1.0).passed
    assert not Check(name="x", value=inf, limit=1e308).passed


def test_a_level_that_is_never_passed_is_infinitely_late():
    run = carried_out(replace(PLANNED, twist=(*PLANNED.twist[:5], (6.0, 0.42))))
    by_name = {check.name: check for check in verify(run).checks}
    assert by_name["level_time"].value == inf and by_name["level_time"].margin == -inf
    assert "never" in str(verify(run))


def test_a_verdict_without_checks_is_refused():
    with pytest.raises(OctoctrlError, match="a verdict without checks says nothing; give at least one"):
        Verdict(checks=())


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("writhe_rms", -0.1, "limit writhe_rms=-0.1 is outside >= 0"),
        ("tip_rms", nan, "limit tip_rms is nan; a finite number is needed"),
        ("crossings", "none", "limit crossings: expected a number, found the string 'none'"),
    ],
)
def test_limits_that_cannot_be_are_refused(name, value, message):
    with pytest.raises(OctoctrlError) as caught:
        Limits(**{name: value})
    assert str(caught.value) == message


def test_a_plan_without_a_shape_has_no_check_of_the_tip():
    run = carried_out()
    shapeless = replace(run, plan=replace(run.plan, strains=np.empty((0, 0, 4))))
    assert [check.name for check in verify(shapeless).checks] == [check.name for check in verify(run).checks][:-1]


@pytest.mark.parametrize("scene", [*PASSING, *FAILING])
def test_every_check_is_what_a_plain_reading_of_the_recording_gives(scene):
    run = (PASSING | FAILING)[scene]()
    verdict, by_hand = verify(run), plain_reading(run)
    assert [check.name for check in verdict.checks] == list(by_hand)
    for check in verdict.checks:
        value, limit = by_hand[check.name]
        assert check.value == pytest.approx(value, abs=2e-8), check.name
        assert check.limit == limit, check.name
        assert check.passed is bool(value <= limit), check.name
        assert check.margin == pytest.approx(limit - value, abs=2e-8), check.name
        assert check.unit == unit_of(check.name), check.name
