"""Carrying out the coil on the rod plant: as planned, with a plant that is not as modelled, with feedback of one's own, and cut short."""

from dataclasses import replace

import numpy as np
import pytest

from octoctrl import tasks
from octoctrl.carrying.execution import PATIENCE, execute
from octoctrl.carrying.results import ExecutionStatus
from octoctrl.judging.comparison import level_delays
from octoctrl.judging.verification import verify
from octoctrl.planners.fitting.identification import load_identified
from octoctrl.planners.solving import trajectory
from octoctrl.planners.solving.plan import PlanStatus
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.rod.plant import Plant
from octoctrl.sim.scene.scene import Scene


@pytest.fixture(scope="module")
def plan():
    configuration = tasks.load("coil")
    found = trajectory.plan(configuration.task, load_identified(configuration.arm, configuration.scene))
    assert found.status is PlanStatus.SOLVED
    return found


@pytest.fixture(scope="module")
def short(plan):
    """The plan's first 0.3 s as a plan of its own: for what does not depend on how far it goes."""
    schedule = replace(plan.schedule, duration=0.3)
    phases = (replace(plan.task.phases[0], duration=0.3),)
    drives = tuple(replace(drive, ends="") for drive in plan.task.drives if drive.begins == "store")
    return replace(plan, task=replace(plan.task, phases=phases, drives=drives), schedule=schedule, phase_begins={"store": 0.0})


def weakened(arm, longitudinal=1.0, oblique=1.0):
    """An arm whose muscles have another gain, and everything else as it was."""

    def scaled(law, factor):
        return replace(law, maximum_stress=factor * law.maximum_stress, passive_scale=law.passive_scale / factor)

    return replace(arm, longitudinal=scaled(arm.longitudinal, longitudinal), oblique=scaled(arm.oblique, oblique))


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def errors(execution):
    """Errors of lifted writhe and twist at the same time of the plant's own clock, turns: waiting does not excuse anything."""
    plan = execution.plan
    wanted = plan.trace.at(np.clip(execution.trace.time, 0.0, plan.trace.time[-1]))
    return execution.trace.lifted_writhe - wanted.lifted_writhe, execution.trace.twist - wanted.twist


# As planned


@pytest.fixture(scope="module")
def closed(plan):
    return execute(plan)


def test_closed_loop_follows_the_plan(plan, closed):
    assert closed.status is ExecutionStatus.FINISHED and closed.feedback == "tvlqr"
    writhe, twist = closed.trace.lifted_writhe - closed.planned.lifted_writhe, closed.trace.twist - closed.planned.twist
    assert rms(writhe) <= 0.05 and abs(writhe).max() <= 0.15
    assert rms(twist) <= 0.05 and abs(twist).max() <= 0.15
    writhe, twist = errors(closed)
    assert rms(writhe) <= 0.05 and rms(twist) <= 0.05
    assert closed.trace.net_crossings()[-1] == plan.trace.net_crossings()[-1] == -2
    assert max(level_delays(closed).values()) <= 0.3 and len(level_delays(closed)) >= 5
    assert [event.phase for event in closed.events] == list(plan.phase_begins) and all(event.met for event in closed.events)


def test_verdict_of_the_closed_loop_passes(closed):
    verdict = verify(closed, strict=True)
    checks = {check.name: check for check in verdict.checks}
    assert verdict.passed and {"writhe_rms", "twist_rms", "crossings", "level_time", "tip_rms", "telescope.twist"} <= set(checks)
    assert checks["activation"].value <= 1.0 and checks["link_residual"].value <= 0.02


def test_open_loop_plays_the_plan_and_nothing_else(plan):
    execution = execute(plan, feedback="open-loop")
    planned = plan.schedule.activation().levels(execution.recording.time, plan.arm.edges)
    np.testing.assert_allclose(execution.recording.levels, planned, atol=2e-3)  # linear between samples of 5 ms
    writhe, twist = errors(execution)
    assert rms(writhe) < 0.1 and rms(twist) < 0.1 and execution.statistics["waited"] == pytest.approx(0.0, abs=1e-9)


def test_execution_is_deterministic(plan, closed):
    np.testing.assert_array_equal(execute(plan).recording.points, closed.recording.points)


# Not as modelled

WRONG = {
    "longitudinal -20 %": ((0.8, 1.0), 1.0),
    "oblique -20 %": ((1.0, 0.8), 1.0),
    "drag x 2": ((1.0, 1.0), 2.0),
    "all at once": ((0.8, 0.8), 2.0),
}


@pytest.mark.parametrize("case", WRONG)
def test_feedback_halves_the_error_of_a_plant_that_is_not_as_modelled(case, plan):
    gains, factor = WRONG[case]
    arm, scene = weakened(plan.arm, *gains), Scene.free(factor=factor)
    open_loop = errors(execute(plan, feedback="open-loop", plant=Plant(arm, scene)))
    run = execute(plan, plant=Plant(arm, scene), patience=0.0)
    closed_loop = errors(run)
    assert run.status is ExecutionStatus.FINISHED and run.recording.levels.max() <= 1.0
    for before, after in zip(open_loop, closed_loop, strict=True):
        assert rms(after) <= 0.5 * rms(before) or rms(after) <= 0.04, (rms(before), rms(after))
    if case == "all at once":
        assert all(rms(after) <= 0.5 * rms(before) for before, after in zip(open_loop, closed_loop, strict=True))
        assert all(rms(after) <= 0.06 for after in closed_loop)
        assert run.trace.net_crossings()[-1] == plan.trace.net_crossings()[-1]


def test_estimates_name_what_is_wrong(plan):
    weak = execute(plan, plant=Plant(weakened(plan.arm, oblique=0.8), plan.scene)).statistics["estimated_errors"]
    heavy = execute(plan, plant=Plant(plan.arm, Scene.free(factor=2.0))).statistics["estimated_errors"]
    right = execute(plan).statistics["estimated_errors"]
    for group in ("R-OM", "L-OM"):
        assert weak[group] - right[group] == pytest.approx(-0.2, abs=0.06)
    assert heavy["drag"] - right["drag"] == pytest.approx(1.0, abs=0.3)


# Phases that wait


def test_waiting_is_bounded(plan):
    hopeless = weakened(plan.arm, oblique=0.2)
    execution = execute(plan, plant=Plant(hopeless, plan.scene))
    assert execution.status is ExecutionStatus.FINISHED
    assert not all(event.met for event in execution.events)
    duration = plan.schedule.duration
    assert 0.05 < execution.statistics["waited"] <= PATIENCE * duration + 0.05 * len(plan.task.phases)
    assert execution.recording.time[-1] == pytest.approx(duration + execution.statistics["waited"], abs=0.03)
    ends = [event.actual for event in execution.events]
    assert ends == sorted(ends) and len(ends) == len(plan.task.phases)
    impatient = execute(plan, plant=Plant(hopeless, plan.scene), patience=0.0)
    assert impatient.statistics["waited"] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("feedback", ["open-loop", "tvlqr"])
def test_settling_goes_on_after_the_last_phase(plan, feedback):
    execution = execute(plan, feedback=feedback, settle=0.4)
    waited, late = execution.statistics["waited"], execution.recording.time > plan.schedule.duration + execution.statistics["waited"]
    assert execution.recording.time[-1] == pytest.approx(plan.schedule.duration + 0.4 + waited, abs=0.03)
    assert execution.status is ExecutionStatus.FINISHED and late.sum() > 10
    np.testing.assert_allclose(execution.planned.twist[late], plan.trace.twist[-1], atol=1e-9)
    assert abs(execution.trace.twist[-1] - plan.trace.twist[-1]) < 0.1


# Feedback of one's own


@pytest.mark.parametrize("form", ["dict", "one per group", "one per group and element"])
def test_a_callable_sees_time_and_shape_and_sets_levels(short, form):
    seen, elements = [], short.arm.elements
    wanted = np.zeros((len(MUSCLE_GROUPS), elements))
    wanted[MUSCLE_GROUPS.index("R-OM")] = 0.2 if form != "one per group and element" else np.linspace(0, 0.2, elements)

    def hold_twist(time, observation):
        assert observation.points.shape == (elements + 1, 3) and observation.frames.shape == (elements + 2, 3, 3)
        seen.append((time, observation.time))
        return {"dict": {"R-OM": 0.2}, "one per group": wanted[:, 0] * 1.0, "one per group and element": wanted}[form]

    execution = execute(short, feedback=hold_twist)
    assert execution.feedback == "hold_twist" and execution.status is ExecutionStatus.FINISHED
    np.testing.assert_allclose(execution.recording.levels, np.broadcast_to(wanted, execution.recording.levels.shape))
    np.testing.assert_allclose(seen, np.repeat(np.arange(6)[:, None] * 0.05, 2, axis=1), atol=1e-12)
    assert execution.trace.twist[-1] < -0.05


def answers(value):
    return lambda time, observation: value


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (np.zeros(10), r"feedback returned levels of shape \(10,\); \(11,\), \(11, n\) or a dict of group to level is needed, n = 48"),
        (np.zeros((11, 7)), r"feedback returned levels of shape \(11, 7\)"),
        (0.3, r"feedback returned levels of shape \(\)"),
        (None, r"feedback returned levels of shape \(\)"),
        ("fast", r"feedback returned str 'fast'; \(11,\)"),
        ({"R-MO": 0.2}, r"feedback returned a level for 'R-MO'; did you mean 'R-OM'\?"),
        ({"R-OM": 1.4}, r"activation levels span 0…1.4 near t=0.00 s; allowed is 0…1"),
        (np.full(11, np.nan), r"activation levels span nan…nan"),
    ],
    ids=["too short", "elements", "scalar", "nothing", "text", "group", "too large", "nan"],
)
def test_wrong_answers_of_a_callable_are_named(short, answer, message):
    with pytest.raises(OctoctrlError, match=message):
        execute(short, feedback=answers(answer))


def test_unknown_feedback(short):
    with pytest.raises(OctoctrlError, match=r"unknown feedback 'tvlq'; did you mean 'tvlqr'\? \(tvlqr|open-loop, tvlqr, or a callable\)"):
        execute(short, feedback="tvlq")


def test_plan_of_another_arm_is_refused(short):
    other = Arm.octopus(length=0.15, name="octopus-15cm")
    pattern = r"plan was made for arm 'octopus-20cm' \(hash \w{4}\), scene has 'octopus-15cm' \(\w{4}\); re-plan or pass arm=plan.arm"
    with pytest.raises(OctoctrlError, match=pattern):
        execute(short, plant=Plant(other))


# Cut short


@pytest.mark.parametrize("when", [0.0, 0.2])
def test_interrupt_keeps_what_was_recorded(short, when):
    def interrupted(time, observation):
        if time >= when - 1e-9:
            raise KeyboardInterrupt
        return {"R-OM": 0.2}

    execution = execute(short, feedback=interrupted)
    assert execution.status is ExecutionStatus.INTERRUPTED and not execution.recording.complete
    assert execution.recording.time[-1] == pytest.approx(when) and len(execution.trace.time) == len(execution.recording.time)
    assert f"interrupted at t={when:.2f} s" in execution.recording.note
    assert "INTERRUPTED" in execution.status.name and str(execution)
    verdict = {check.name: check for check in verify(execution).checks}
    assert not verdict["unfinished_phases"].passed


class Exploding(Plant):
    """A plant whose tip is torn away after 0.15 s."""

    def advance(self, activation, duration, *, progress=None):
        if self.time > 0.149:
            self.rows[6:9, self.elements] += 1e6
            self.rows[0:3, self.elements + 1] += 1.0
        return super().advance(activation, duration, progress=progress)


@pytest.mark.parametrize("feedback", ["open-loop", "tvlqr"])
def test_a_plant_that_diverges_ends_the_run_with_what_was_good(short, feedback):
    execution = execute(short, feedback=feedback, plant=Exploding(short.arm, short.scene))
    assert execution.status is ExecutionStatus.UNSTABLE and not execution.recording.complete
    assert 0.14 <= execution.recording.time[-1] <= 0.2
    assert execution.recording.note.startswith("stopped at t=0.1") and execution.recording.note in str(execution)
    assert np.isfinite(execution.recording.points[:-1]).all()
    assert not verify(execution).passed
    with pytest.raises(PlantUnstableError):
        plant = Exploding(short.arm, short.scene)
        for _ in range(6):
            plant.advance(short.schedule.activation(), 0.05)


def test_checkpoints_hold_the_run_so_far(short, monkeypatch):
    from octoctrl.carrying import execution as module

    moments = iter(np.arange(0.0, 1e3, 0.7))
    monkeypatch.setattr(module, "perf_counter", lambda: next(moments))
    kept = []
    # The clock ticks once per period and once while a checkpoint is made, of which nine times as much must pass until the next.
    execute(short, feedback="open-loop", checkpoint=kept.append, period=0.01)
    assert 3 <= len(kept) <= 5
    ends = [item.recording.time[-1] for item in kept]
    assert ends == sorted(ends) and ends[-1] <= 0.3 + 1e-9
    assert all(item.status is ExecutionStatus.INTERRUPTED and not item.recording.complete for item in kept)
