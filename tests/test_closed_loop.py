"""Carrying out the coil on the rod plant: as planned, with a plant that is not as modelled, with feedback of one's own, and cut short."""

from dataclasses import replace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl import tasks
from octoctrl.carrying.execution import GRACE, PATIENCE, execute
from octoctrl.carrying.results import ExecutionStatus
from octoctrl.judging.comparison import level_delays
from octoctrl.judging.verification import verify
from octoctrl.planners.contracts import ControllerReport
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.solving import planner
from octoctrl.planners.solving.plan import Plan, PlanStatus
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.plants import Plant
from octoctrl.sim.running.sensors import Sensors
from octoctrl.sim.scene.scene import Scene


@pytest.fixture(scope="module")
def plan():
    configuration = tasks.load("coil")
    found = planner.plan(configuration.task, load_identified(configuration.arm, configuration.scene), time_limit=600.0)
    assert found.status.solved
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
    return replace(arm, longitudinal=arm.longitudinal.stronger(longitudinal), oblique=arm.oblique.stronger(oblique))


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
    assert rms(writhe) < 0.1 and rms(twist) < 0.1 and execution.waited == pytest.approx(0.0, abs=1e-9)


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
    weak = execute(plan, plant=Plant(weakened(plan.arm, oblique=0.8), plan.scene)).report.controller.estimated_errors
    heavy = execute(plan, plant=Plant(plan.arm, Scene.free(factor=2.0))).report.controller.estimated_errors
    right = execute(plan).report.controller.estimated_errors
    for group in ("R-OM", "L-OM"):
        assert weak[group] - right[group] == pytest.approx(-0.2, abs=0.06)
    assert heavy["drag"] - right["drag"] == pytest.approx(1.0, abs=0.3)


# Sensors


def test_delay_is_foreseen(plan):
    run = execute(plan, sensors=Sensors(delay=0.05))
    verify(run, strict=True)
    writhe, twist = errors(run)
    assert rms(writhe) <= 0.04 and rms(twist) <= 0.04


@pytest.mark.parametrize("seed", range(3))
def test_noise_does_not_shake_the_arm(plan, seed):
    run = execute(plan, sensors=Sensors(position_noise=5e-4, angle_noise=np.radians(1.0), seed=seed))
    verify(run, strict=True)
    writhe, twist = errors(run)
    assert rms(twist) <= 0.04 and rms(writhe) <= 0.05
    assert run.report.controller.largest_correction < 0.3


@pytest.mark.parametrize(
    "sensors",
    [
        Sensors(position_noise=5e-4, angle_noise=np.radians(1.0), delay=0.05, seed=7),
        Sensors(position_noise=5e-4, angle_noise=np.radians(1.0), stations=12, seed=7),
        Sensors(period=0.1),
    ],
    ids=["noise and delay", "noise and few stations", "rate"],
)
def test_poor_sensors_are_enough(plan, sensors):
    run = execute(plan, sensors=sensors)
    verify(run, strict=True)
    writhe, twist = errors(run)
    assert rms(twist) <= 0.04 and rms(writhe) <= 0.05


def test_controllers_see_through_the_sensors(short):
    times, shapes = [], set()

    def watch(time, observation):
        times.append((time, observation.time))
        shapes.add((observation.points.shape, observation.frames.shape))
        return {}

    execute(short, feedback=watch, sensors=Sensors(delay=0.1, stations=6))
    np.testing.assert_allclose([now - then for now, then in times], [0, 0.05, 0.1, 0.1, 0.1, 0.1], atol=1e-9)
    assert shapes == {((7, 3), (8, 3, 3))}


# Phases that wait


def test_waiting_is_bounded(plan):
    hopeless = weakened(plan.arm, oblique=0.2)
    execution = execute(plan, plant=Plant(hopeless, plan.scene))
    assert execution.status is ExecutionStatus.FINISHED
    assert not all(event.met for event in execution.events)
    duration = plan.schedule.duration
    assert 0.05 < execution.waited <= PATIENCE * duration + 0.05 * len(plan.task.phases)
    assert execution.recording.time[-1] == pytest.approx(duration + execution.waited, abs=0.03)
    ends = [event.actual for event in execution.events]
    assert ends == sorted(ends) and len(ends) == len(plan.task.phases)
    impatient = execute(plan, plant=Plant(hopeless, plan.scene), patience=0.0)
    assert impatient.waited == pytest.approx(0.0, abs=0.01)


def long_arm_plan(ends, level, duration):
    """Twist, then writhe, on an arm of 30 cm for which the built-in model is a first guess: the plan promises what the arm does not do."""
    arm = Arm.octopus(length=0.3, youngs_modulus=15e3, shear_modulus=10e3, name="octopus-30cm")
    model = load_identified(arm, Scene()).model
    goals = oc.goal("twist", value=-0.8, tolerance=0.05), oc.goal("lifted_writhe", value=-0.6, tolerance=0.05)
    begins = {"twist": 0.0, "writhe": 1.45}
    phases = oc.Phase(name="twist", duration=1.5, goals=goals[:1]), oc.Phase(name="writhe", duration=2.0, goals=goals[1:])
    drives = (
        oc.Drive(name="store", primitive=oc.Twist(hand="R-OM", level=0.0658), begins="twist", ends=ends),
        oc.Drive(name="bend", primitive=oc.Bend(level=level), begins="writhe"),
    )
    schedule = oc.Schedule(primitives=tuple(drive.at(begins, {}) for drive in drives), duration=duration)
    motion = model.respond(schedule.activation(), duration)
    return Plan(
        task=oc.Task(name="long", phases=phases, drives=drives), model=model, schedule=schedule, phase_begins=begins, time=motion.time,
        strains=motion.strains, trace=model.trace(motion.time, motion.strains), status=PlanStatus.SOLVED,
    )  # fmt: skip


@pytest.mark.parametrize("numbers", [("", 0.192, 2.318), ("writhe", 0.233, 2.277)], ids=["held", "released"])
def test_waiting_never_ends_farther_from_the_goal(numbers):
    plan, errors = long_arm_plan(*numbers), []
    for patience in (0.0, 0.3, 1.0):
        run = execute(plan, patience=patience)
        (event,) = (event for event in run.events if event.phase == "writhe")
        errors.append(abs(np.interp(event.actual, run.trace.time, run.trace.lifted_writhe) + 0.6))
        assert event.met == (errors[-1] <= 0.05)
    assert errors[0] >= errors[1] - 1e-9 and errors[0] >= errors[2] - 1e-9, errors
    assert errors[2] < 0.05


def test_waiting_ends_where_it_does_no_good(short):
    """In open loop the arm goes on under the levels that stay: past a goal that it had overshot already, so that waiting is given up."""
    goal = oc.goal("twist", value=-0.01, tolerance=0.005)
    task = replace(short.task, phases=(replace(short.task.phases[0], goals=(goal,)),))
    run = execute(replace(short, task=task), feedback="open-loop", patience=1.0)
    assert not run.events[0].met and run.waited == pytest.approx(GRACE * 0.05)


@pytest.mark.parametrize("feedback", ["open-loop", "tvlqr"])
def test_settling_goes_on_after_the_last_phase(plan, feedback):
    execution = execute(plan, feedback=feedback, settle=0.4)
    waited, late = execution.waited, execution.recording.time > plan.schedule.duration + execution.waited
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
        (np.zeros(10), r"feedback: shape \(10,\); \(11,\), \(11, n\) or a dict of group to level is needed, n = 48 cells of the arm"),
        (np.zeros((11, 7)), r"feedback: shape \(11, 7\)"),
        (0.3, r"feedback: shape \(\)"),
        (None, r"feedback: found NoneType None; numbers from 0 to 1 are needed"),
        ("fast", r"feedback: found str fast"),
        ({"R-MO": 0.2}, r"feedback: there is no muscle group 'R-MO'; did you mean 'R-OM'\?"),
        ({"R-OM": 1.4}, r"activation levels span 0…1.4 feedback; allowed is 0…1"),
        (np.full(11, np.nan), r"activation levels span nan…nan"),
    ],
    ids=["too short", "elements", "scalar", "nothing", "text", "group", "too large", "nan"],
)
def test_wrong_answers_of_a_callable_are_named(short, answer, message):
    with pytest.raises(OctoctrlError, match=message):
        execute(short, feedback=answers(answer))


class Doubled:
    """A controller from outside: the built-in one, whose levels are looked at on the way, with a push of its own."""

    name = "doubled"

    def __init__(self, plan, push=0.0):
        self.inner, self.push, self.readings = oc.controllers.tvlqr(plan), push, []

    def levels(self, observation, reading):
        self.readings.append(reading)
        source, push = self.inner.levels(observation, reading), self.push

        class Pushed:
            def levels(self, times, edges):
                return np.clip(source.levels(times, edges) + push, 0.0, 1.0)

        return Pushed()

    def report(self):
        return self.inner.report()


def test_the_built_in_controller_can_be_wrapped(short):
    wrapped = Doubled(short)
    run, plain = oc.execute(short, feedback=wrapped), oc.execute(short)
    np.testing.assert_array_equal(run.recording.points, plain.recording.points)
    assert run.feedback == "doubled" and run.report.controller.estimated_errors == plain.report.controller.estimated_errors
    assert run.report.controller.largest_correction > 0 and plain.report.controller.design_time > 0
    assert [reading.begin for reading in wrapped.readings[:6]] == pytest.approx([0.0, 0.05, 0.1, 0.15, 0.2, 0.25])
    pushed = oc.execute(short, feedback=Doubled(short, push=0.1))
    assert np.abs(pushed.recording.points - plain.recording.points).max() > 1e-3
    assert pushed.recording.levels.min() >= 0.1


def test_one_controller_serves_several_runs(short):
    controller = oc.controllers.tvlqr(short)
    first, again = (execute(short, feedback=controller) for _ in range(2))
    np.testing.assert_array_equal(first.recording.points, again.recording.points)
    finer = execute(short, feedback=controller, period=0.025)
    np.testing.assert_array_equal(finer.recording.points, execute(short, period=0.025).recording.points)


def test_a_controller_is_added_by_name(short, monkeypatch):
    monkeypatch.setattr(oc.controllers, "CONTROLLERS", dict(oc.controllers.CONTROLLERS))
    oc.controllers.register("doubled", Doubled)
    assert oc.execute(short, feedback="doubled").feedback == "doubled"
    from octoctrl.files.configuration import RunSettings

    assert RunSettings(feedback="doubled").feedback == "doubled"
    with pytest.raises(OctoctrlError, match="a controller called 'tvlqr' exists already; choose another name"):
        oc.controllers.register("tvlqr", Doubled)


class Failing:
    name, patience = "failing", 0.0

    def __init__(self, when):
        self.when = when

    def levels(self, observation, reading):
        if reading.now > self.when - 1e-9:
            raise ZeroDivisionError("no more ideas")
        return oc.Activation(templates=(oc.Plateau(groups=("R-OM",), level=0.2),))

    def report(self):
        return ControllerReport(estimated_errors={"mine": 0.5})


def test_a_controller_that_fails_leaves_the_run(short, tmp_path):
    run = oc.execute(short, feedback=Failing(0.15))
    assert run.status is ExecutionStatus.CONTROLLER_FAILED and not run.recording.complete
    assert run.recording.time[-1] == pytest.approx(0.15) and run.trace.twist[-1] < -0.01
    assert run.recording.note == "controller 'failing' failed at t=0.15 s: ZeroDivisionError: no more ideas"
    assert "in levels\n" in run.cause and run.cause.endswith("ZeroDivisionError: no more ideas\n")
    assert run.report.controller.estimated_errors == {"mine": 0.5}
    assert not verify(run).passed and run.recording.note in str(run)
    kept = oc.load(oc.save(tmp_path / "run.npz", run))
    assert kept.cause == run.cause and kept.status is run.status and kept.report == run.report
    with pytest.raises(ZeroDivisionError):  # nothing has moved that could be lost
        oc.execute(short, feedback=Failing(0.0))


def test_a_wrong_answer_after_the_first_leaves_the_run(short):
    run = execute(short, feedback=lambda time, observation: {"R-OM": 0.2 if time < 0.1 else 1.4})
    assert run.status is ExecutionStatus.CONTROLLER_FAILED and run.recording.time[-1] == pytest.approx(0.1)
    assert "OctoctrlError: activation levels span 0…1.4 feedback; allowed is 0…1" in run.recording.note


def test_unknown_feedback(short):
    with pytest.raises(
        OctoctrlError, match=r"unknown feedback 'tvlq'; did you mean 'tvlqr'\? \(tvlqr, mpc, grip, open-loop, a callable or a controller\)"
    ):
        execute(short, feedback="tvlq")


def test_plan_of_another_arm_is_refused(short):
    other = Arm.octopus(length=0.15, name="octopus-15cm")
    pattern = r"plan was made for arm 'octopus-20cm' \(hash \w{4}\), scene has 'octopus-15cm' \(\w{4}\); re-plan or pass arm=plan.arm"
    with pytest.raises(OctoctrlError, match=pattern):
        execute(short, plant=Plant(other))


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"settle": -100}, "settle=-100 s is outside >= 0 s"),
        ({"settle": "0.05"}, "settle: expected a number in s, found the string '0.05'"),
        ({"period": 0}, "period=0 s is outside > 0 s"),
        ({"period": float("nan")}, "period is nan; a finite number is needed"),
        ({"period": "0.05"}, "period: expected a number in s, found the string '0.05'"),
        (
            {"period": 0.35, "settle": 0.05},
            "period=0.35 s: feedback corrects once per period, and the run takes 0.35 s, so that it never would; give less, or "
            "feedback='open-loop'",
        ),
        ({"period": 0.0123}, "period=0.0123 s: needs a multiple of the plant's sample interval 0.005 s"),
        ({"patience": -0.1}, "patience=-0.1 is outside >= 0"),
        (
            {"feedback": 3},
            "feedback is int 3; give the name of a controller (tvlqr, mpc, grip, open-loop), a callable, or an object like a Controller",
        ),
    ],
)
def test_numbers_that_cannot_be_meant(short, how, message):
    with pytest.raises(OctoctrlError) as caught:
        execute(short, **how)
    assert str(caught.value) == message


def test_patience_with_a_callable_is_honoured(short):
    def rest(time, observation):
        return {}

    assert execute(short, feedback=rest).waited == pytest.approx(0.0, abs=1e-9)
    run = execute(short, feedback=rest, patience=0.5)
    assert run.waited == pytest.approx(0.15, abs=1e-9) and run.events[0].actual == pytest.approx(0.45)
    np.testing.assert_allclose(run.clock, np.minimum(run.recording.time, 0.3), atol=1e-9)


@pytest.mark.parametrize("status", [PlanStatus.NOT_FOUND, PlanStatus.TIME_LIMIT])
def test_a_plan_that_is_not_solved_needs_a_word(short, status):
    unsolved = replace(short, status=status)
    with pytest.raises(OctoctrlError, match=rf"the plan of 'coil' is not solved \({status.name.lower()}\); plan again, or pass allow_uns"):
        execute(unsolved)
    assert execute(unsolved, allow_unsolved=True).status is ExecutionStatus.FINISHED


def test_a_plan_that_is_refused_can_still_be_run():
    goal = oc.goal("twist", value=-9.0)
    drive = oc.Drive(name="store", primitive=oc.Twist(hand="R-OM", level=0.2), begins="store")
    refused = oc.plan(oc.Task(name="much", phases=(oc.Phase(name="store", duration=0.3, goals=(goal,)),), drives=(drive,)))
    assert refused.status is PlanStatus.UNREACHABLE
    run = oc.execute(refused, allow_unsolved=True, patience=0.0)
    assert run.status is ExecutionStatus.FINISHED and not run.events[0].met and run.trace.twist[-1] < -0.02


def test_a_plan_remembers_how_it_is_to_be_run(short, tmp_path):
    plan = replace(short, feedback="open-loop", period=0.1)
    loaded = oc.load(oc.save(tmp_path / "plan.npz", plan))
    run = oc.execute(loaded)
    assert run.feedback == "open-loop" and oc.execute(loaded, feedback="tvlqr").feedback == "tvlqr"
    times = []
    oc.execute(loaded, feedback=lambda time, observation: times.append(time) or {})
    np.testing.assert_allclose(times, [0.0, 0.1, 0.2], atol=1e-12)


def test_planning_takes_the_settings_of_the_task_file():
    from octoctrl.files.configuration import parse

    configuration = parse(
        """
        [task]
        name = "hold"
        [[task.phases]]
        name = "hold"
        duration = 0.5
        [[task.drives]]
        name = "pull"
        primitive = "Shorten"
        begins = "hold"
        free = []
        [run]
        feedback = "open-loop"
        period = "20 ms"
        plant = "assembly-coarse"
        """
    )
    plan = oc.plan(configuration)
    assert (plan.feedback, plan.period, plan.plant) == ("open-loop", 0.02, "assembly-coarse")


# Two clocks


@pytest.fixture(scope="module")
def waiting(plan):
    """A run whose first phase waits: it asks for a little more twist than is planned, to which feedback does not come."""
    first = plan.task.phases[0]
    phases = (replace(first, goals=(replace(first.goals[0], value=-1.02, tolerance=0.004),)), *plan.task.phases[1:])
    return execute(replace(plan, task=replace(plan.task, phases=phases)))


def test_planned_arm_follows_the_clock_of_the_plan(plan, waiting):
    """A phase that waits is not late: the planned tip, as the planned trace, is that of the clock's reading."""
    assert waiting.waited >= 0.1
    duration, time = plan.schedule.duration, waiting.recording.time
    stands = (time > plan.phase_begins["open"] + 0.02) & (time < plan.phase_begins["open"] + waiting.waited - 0.06)
    assert stands.sum() > 3 and np.ptp(waiting.clock[stands]) < 1e-9
    late = time > plan.phase_begins["open"] + waiting.waited + 0.06
    np.testing.assert_allclose(waiting.clock[late], time[late] - waiting.waited, atol=1e-9)
    assert waiting.clock[-1] == pytest.approx(duration, abs=0.005)
    expected = plan.trace.at(np.clip(waiting.clock, 0, duration)[late])
    np.testing.assert_allclose(waiting.planned.twist[late], expected.twist, atol=1e-12)
    strains = [
        np.interp(np.minimum(waiting.clock, plan.time[-1]), plan.time, column) for column in plan.strains.reshape(len(plan.time), -1).T
    ]
    tip = plan.model.points(np.array(strains).T.reshape(len(time), *plan.strains.shape[1:]))[:, -1]
    distance = rms(np.linalg.norm(waiting.recording.tip - tip, axis=1))
    assert oc.compare(waiting).summary()["tip_rms"] == pytest.approx(distance, rel=1e-9)
    checks = {check.name: check for check in verify(waiting).checks}
    assert checks["tip_rms"].value == pytest.approx(distance / plan.arm.length, rel=1e-9) and checks["tip_rms"].passed
    assert checks["level_time"].value < 0.3


# Cut short


def test_an_interrupt_between_keeping_and_measuring_leaves_a_whole_run(short, monkeypatch):
    from octoctrl.sim.topology.meter import Meter

    extend, calls = Meter.extend, []

    def interrupted(self, *piece):
        calls.append(piece)
        if len(calls) == 2:
            raise KeyboardInterrupt
        extend(self, *piece)

    monkeypatch.setattr(Meter, "extend", interrupted)
    run = execute(short, feedback="open-loop")
    assert run.status is ExecutionStatus.INTERRUPTED and run.recording.time[-1] > 0
    np.testing.assert_array_equal(run.trace.time, run.recording.time)
    assert len(run.clock) == len(run.recording.time)


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
            self.core.rows[6:9, self.elements] += 1e6
            self.core.rows[0:3, self.elements + 1] += 1.0
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
