"""Planner: derivatives, optimality, honesty about what it cannot do, and the reduced model it stands on against the plant."""

import os
import re
import signal
import traceback
from dataclasses import dataclass, replace
from math import inf
from threading import Timer

import numpy as np
import pytest

from octoctrl import tasks
from octoctrl.planners.asking.primitives import Bend, BendWave, Elongate, Shorten, Twist
from octoctrl.planners.asking.registry import goal
from octoctrl.planners.asking.schedule import Schedule
from octoctrl.planners.asking.task import Drive, Phase, Task
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.solving import planner
from octoctrl.planners.solving.interrupts import heed, interrupts_kept
from octoctrl.planners.solving.plan import PlanFailedError, PlanStatus
from octoctrl.planners.solving.problem import SAMPLE, Problem
from octoctrl.planners.solving.search import ENOUGH
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.templates import Plateau
from octoctrl.sim.topology.measures import measure

COIL = tasks.load("coil").task.on(Arm())


@pytest.fixture(scope="module")
def identified():
    configuration = tasks.load("coil")
    return load_identified(configuration.arm, configuration.scene)


@pytest.fixture(scope="module")
def coil(identified):
    return planner.plan(COIL, identified)


@pytest.fixture(scope="module")
def problem(identified):
    return Problem(COIL, identified.model)


def aims(quantity, value, tolerance=0.1):
    return (goal(quantity, value=value, tolerance=tolerance),)


def with_goals(**goals):
    """The coil with the goals of some phases replaced."""
    return replace(COIL, phases=tuple(replace(phase, goals=goals.get(phase.name, phase.goals)) for phase in COIL.phases))


def numbers(plan):
    return np.array(list(plan.report.numbers.values()))


# The coil


def test_coil_is_solved_and_its_goals_hold_on_a_simulation_of_our_own(coil, identified):
    assert coil.status is PlanStatus.SOLVED and not coil.report.reason and coil.raise_if_failed() is coil
    model, ends = identified.model, [*list(coil.phase_begins.values())[1:], coil.schedule.duration]
    motion = model.respond(coil.schedule.activation(), coil.schedule.duration, step=0.01)
    trace = model.trace(motion.time, motion.strains, COIL.convention).at(np.array(ends))
    for index, phase in enumerate(COIL.phases):
        for wanted in phase.goals:
            assert abs(getattr(trace, wanted.quantity)[index] - wanted.value) <= wanted.tolerance, (phase.name, str(wanted))


def test_goals_of_the_coil_leave_tolerance_to_the_plant(coil):
    used = {f"{item.phase}.{item.goal.quantity}": item.share for item in coil.report.goals}
    assert len(used) == 6
    assert max(used.values()) <= ENOUGH + 0.05, used


def test_coil_respects_bounds_and_headroom(coil, problem):
    p = numbers(coil)
    assert (p >= problem.box.lower).all() and (p <= problem.box.upper).all()
    levels = coil.schedule.activation().levels(np.arange(0, coil.schedule.duration, 0.01), coil.arm.edges)
    assert levels.max() <= 0.75 and coil.report.headroom == pytest.approx(1 - levels.max(), abs=0.01)
    assert coil.report.extrapolates == ()


def test_coil_tells_the_story_of_the_paper(coil):
    """One turn of twist stored, given over to writhe, twice the turns crossed, and extended with twist of the other hand."""
    trace = coil.trace
    assert coil.trace.time[-1] == pytest.approx(coil.schedule.duration)
    assert trace.net_crossings()[-1] == -2
    assert trace.twist.min() < -0.9 and trace.twist[-1] > 0.9
    assert abs(trace.residual).max() < 0.02


def test_plan_is_deterministic(coil, identified):
    again = planner.plan(COIL, identified)
    np.testing.assert_array_equal(numbers(again), numbers(coil))
    assert again.report.iterations == coil.report.iterations


def same_plan_from(perturbation, coil, problem, identified):
    start = dict(zip(problem.names, problem.start * (1 + 0.3 * perturbation), strict=True))
    found = planner.plan(COIL, identified, start=start)
    assert found.status.solved
    return abs((numbers(found) - numbers(coil)) / problem.box.scale).max()


@pytest.mark.parametrize("count", [6, pytest.param(20, marks=pytest.mark.slow)])
def test_perturbed_guesses_lead_to_the_same_plan(count, coil, problem, identified):
    draw = np.random.default_rng(1)
    assert all(same_plan_from(draw.uniform(-1, 1, len(problem.start)), coil, problem, identified) < 0.05 for _ in range(count))


# What cannot be done, or not in time

UNREACHABLE = {
    "five turns of writhe": ({"cross": aims("lifted_writhe", -5.0, 0.15)}, ["cross", "lifted writhe -5 ± 0.15 turns", "at most 4.48"]),
    "three turns of twist": ({"telescope": aims("twist", 3.0)}, ["telescope", "twist 3", "L-OM stores at most"]),
    "half a metre": ({"telescope": aims("length", 0.5, 0.01)}, ["telescope", "length 0.5", "mm long at activation 0.75"]),
}


@pytest.mark.parametrize("case", UNREACHABLE)
def test_unreachable_targets_are_refused_before_solving(case, identified, monkeypatch):
    def never(*_, **__):
        pytest.fail("the solver was called")

    goals, words = UNREACHABLE[case]
    monkeypatch.setattr(planner, "Search", never)
    found = planner.plan(with_goals(**goals), identified)
    assert found.status is PlanStatus.UNREACHABLE
    assert all(word in found.report.reason for word in words), found.report.reason
    with pytest.raises(PlanFailedError, match="lies outside what the arm can do"):
        found.raise_if_failed()


HARD = replace(
    COIL,
    phases=(
        Phase(name="store", duration=1.5, goals=aims("twist", -1.0) + aims("lifted_writhe", -1.5)),
        *COIL.phases[1:],
    ),
)
"""Writhe before anything bends: either goal can be met alone, not both."""


def test_the_time_limit_covers_everything_and_the_plan_so_far_is_kept(identified):
    free = planner.plan(HARD, identified)
    short = planner.plan(HARD, identified, time_limit=0.2)
    assert short.status is PlanStatus.TIME_LIMIT and short.report.starts < free.report.starts
    assert short.report.wall_time < 0.5 * free.report.wall_time
    assert "phase 'store' misses" in short.report.reason and len(short.trace.time) > 50 and short.schedule.duration > 3
    with pytest.raises(PlanFailedError, match="Stopped at the time limit"):
        short.raise_if_failed()


def test_contradicting_goals_are_never_called_solved(identified):
    found = planner.plan(HARD, identified)
    assert found.status is PlanStatus.NOT_FOUND and not found.status.solved
    assert re.fullmatch(
        r"\d+ searches came no nearer than this: phase 'store' misses (twist -1|lifted writhe -1.5) ± 0.1 turns by .*", found.report.reason
    )


@pytest.mark.parametrize("after", [0.02, 0.15, 0.5])
def test_an_interrupt_at_any_moment_leaves_no_plan(after, identified):
    """The optimiser takes whatever its functions raise for a point without a value, and would call the task infeasible."""
    timer = Timer(after, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            for _ in range(40):  # and not for ever, were it lost
                planner.plan(COIL, identified)
    finally:
        timer.cancel()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_treated_at_the_next_simulation_as_the_user_wants_it(number):
    """CasADi would lose what the handler raises, or give it another name."""
    called = []
    usual = signal.signal(number, lambda came, _: called.append(came))
    try:
        with interrupts_kept():
            os.kill(os.getpid(), number)
            os.kill(os.getpid(), number)
            assert not called
            heed()
            heed()
            assert called == [number]
        assert signal.getsignal(number).__name__ == "<lambda>"
        with interrupts_kept():
            os.kill(os.getpid(), number)
        assert called == [number, number]
    finally:
        signal.signal(number, usual)


def test_an_interrupt_within_the_optimiser_leaves_no_plan(identified, monkeypatch):
    read, count = Problem.read, [0]

    def interrupted(self, x, grid, slopes=False):
        # The third reading with slopes after the search has ended lies within the optimiser.
        count[0] += slopes and any("optimiser" in frame.filename for frame in traceback.extract_stack())
        if count[0] == 3:
            count[0] += 1
            raise KeyboardInterrupt
        return read(self, x, grid, slopes)

    monkeypatch.setattr(Problem, "read", interrupted)
    with pytest.raises(KeyboardInterrupt):
        planner.plan(COIL, identified)


def test_phases_end_on_samples_of_the_plant(coil):
    ends = np.array([*list(coil.phase_begins.values())[1:], coil.schedule.duration])
    np.testing.assert_allclose(ends / SAMPLE, np.round(ends / SAMPLE), atol=1e-9)


def test_the_optimiser_makes_the_plan_cheaper_than_the_point_it_began_from(coil):
    assert coil.report.optimised and coil.report.price < 0.8 * coil.report.first_price


def test_a_task_whose_only_path_leads_past_a_u_turn_says_so(identified, monkeypatch):
    """With a guard that no bending path can keep, what is solved without one is told apart from what is not found."""
    bend = Drive(name="bend", primitive=Bend(side="LM1", level=0.3), begins="bend", free=("level", "rise"))
    task = Task(name="bend", phases=(Phase(name="bend", duration=3.0, goals=aims("lifted_writhe", 0.0, 0.05)),), drives=(bend,))
    monkeypatch.setattr("octoctrl.planners.solving.problem.PASSED", 1.9)
    monkeypatch.setattr(planner, "OTHER_WORK", 0.0)  # other drives would do
    task = replace(task, phases=(replace(task.phases[0], goals=aims("lifted_writhe", 0.0, 0.05) + aims("length", 0.19, 0.002)),))
    found = planner.plan(task, identified)
    assert found.status is PlanStatus.UTURN and found.report.opening > 0


# Planning again


def test_planning_again_is_quicker_and_ends_where_a_cold_start_ends(coil, problem, identified):
    task = with_goals(telescope=aims("twist", 0.95))
    cold = planner.plan(task, identified)
    again = planner.plan(task, identified, guess=coil)
    assert again.status is cold.status and cold.status.solved
    assert again.report.iterations < cold.report.iterations
    assert abs((numbers(again) - numbers(cold)) / problem.box.scale).max() < 0.05


def test_a_guess_that_is_not_solved_is_ignored(coil, identified):
    astray = planner.plan(HARD, identified, time_limit=0.2)
    assert not astray.status.solved
    np.testing.assert_array_equal(numbers(planner.plan(COIL, identified, guess=astray)), numbers(coil))


# Primitives


@dataclass(frozen=True, slots=True, kw_only=True)
class Flick:
    """A primitive of the user's own: one longitudinal muscle, for a moment."""

    level: float = 0.2
    onset: float = 0.0

    def templates(self):
        return (Plateau(groups=("LM5",), level=self.level, onset=self.onset, rise=0.1, offset=self.onset + 0.3, fall=0.1),)

    def bounds(self):
        return {"level": (0.0, 0.5)}

    def effort(self, seconds):
        return self.level**2 * 0.3


def test_a_primitive_of_ones_own_fits_into_a_schedule(identified):
    schedule = Schedule(primitives=(Flick(onset=0.2), Twist(hand="L-OM", level=0.2)), duration=1.0)
    levels = schedule.activation().levels(np.array([0.1, 0.4, 0.9]), identified.model.arm.edges)
    flick = levels[:, MUSCLE_GROUPS.index("LM5")]
    np.testing.assert_allclose(flick.max(axis=1), [0.0, 0.2, 0.0], atol=1e-12)
    motion = identified.model.respond(schedule.activation(), schedule.duration)
    assert motion.strains[-1, :, 2].max() > 1.0 and np.abs(motion.strains[:, :, :2]).max() > 1.0


def test_a_schedule_needs_primitives():
    with pytest.raises(OctoctrlError, match=r"^no primitives given; pass at least one or leave it out for the task's default \(Bend, "):
        Schedule(primitives=(), duration=1.0)


MOVED = {
    "Twist": (Twist(hand="R-OM", level=0.2), {"R-OM"}),
    "Bend": (Bend(side="LM3", level=0.2), {"LM2", "LM3", "LM4"}),
    "Bend across the numbering": (Bend(side="LM1", level=0.2), {"LM8", "LM1", "LM2"}),
    "BendWave": (BendWave(side="LM7", level=0.2, speed=0.4), {"LM6", "LM7", "LM8"}),
    "Shorten": (Shorten(level=0.2), set(LONGITUDINAL_GROUPS)),
    "Elongate": (Elongate(level=0.2), {"TM"}),
}


@pytest.mark.parametrize("case", MOVED)
def test_primitives_move_their_muscles(case, identified):
    primitive, groups = MOVED[case]
    activation = Schedule(primitives=(primitive,), duration=2.0).activation()
    levels = activation.levels(np.linspace(0, 2, 41), identified.model.edges)
    moving = {group for group, level in zip(MUSCLE_GROUPS, levels.max(axis=(0, 2)), strict=True) if level > 0}
    assert moving == groups == set(activation.groups) and levels.max() == pytest.approx(0.2, abs=1e-3)
    for name, (low, high) in primitive.bounds().items():
        assert 0 <= low < high < inf and hasattr(primitive, name)


def test_what_primitives_do_to_the_arm(identified):
    model = identified.model
    ends = {
        name: model.respond(Schedule(primitives=(case[0],), duration=2.0).activation(), 2.0).strains[-1] for name, case in MOVED.items()
    }
    assert (ends["Twist"][:, 2] < -1).all() and (ends["Shorten"][:, 3] < 0.95).all() and (ends["Elongate"][:, 3] > 1.01).all()
    assert (ends["Bend across the numbering"][:, 0] ** 2 + ends["Bend across the numbering"][:, 1] ** 2 > 1).all()
    across, along = np.abs(ends["Bend"][:, :2]).sum(axis=0), np.abs(ends["Bend across the numbering"][:, :2]).sum(axis=0)
    assert (across > 5 * along).sum() == (along > 5 * across).sum() == 1  # two sides a quarter turn apart


def test_drives_follow_the_phases(problem):
    longer = dict(zip(problem.names, problem.start, strict=True)) | {"store.duration": 2.0}
    begins, schedule = problem.schedule(np.array(list(longer.values())))
    twist, curl, counter = schedule.primitives
    assert begins == pytest.approx({"store": 0.0, "open": 2.0, "spiral": 3.5, "cross": 4.6, "telescope": 5.1})
    assert (twist.onset, twist.offset) == (begins["store"], begins["spiral"])
    assert (curl.onset, curl.offset) == (begins["open"], inf)
    assert counter.onset == begins["cross"] and schedule.duration == pytest.approx(6.6)


def test_a_task_without_goals_plans_its_own_numbers(identified):
    phase = Phase(name="hold", duration=1.0, goals=aims("twist", -0.4, 0.2))
    drive = Drive(name="twist", primitive=Twist(hand="R-OM", level=0.2), begins="hold")
    found = planner.plan(Task(name="hold", phases=(phase,), drives=(drive,)), identified)
    assert found.status is PlanStatus.SOLVED and list(found.report.numbers) == ["hold.duration", "twist.level"]


def test_another_arm_plans_without_identification_and_says_so():
    arm = Arm.octopus(length=0.25)
    phase = Phase(name="hold", duration=1.0, goals=aims("twist", -0.4, 0.2))
    drive = Drive(name="twist", primitive=Twist(hand="R-OM", level=0.2), begins="hold")
    found = planner.plan(Task(name="hold", phases=(phase,), drives=(drive,)), load_identified(arm))
    assert found.status is PlanStatus.SOLVED and any("R-OM reaches" in sentence for sentence in found.report.extrapolates)


# The model behind it, against the plant


@pytest.fixture(scope="module")
def fig2c():
    from octoctrl.sim.plants import Plant

    programme = tasks.programme("fig2c")
    activation, duration = programme.activation, programme.duration
    recording = Plant().advance(activation, duration)
    return activation, duration, recording, measure(recording.time, recording.points, recording.frames)


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


@pytest.mark.parametrize("laws", ["known", "generic"])
def test_model_foresees_the_held_out_programme(laws, fig2c):
    activation, duration, recording, measured = fig2c
    model = load_identified(Arm.octopus(), laws=laws).model
    motion = model.respond(activation, duration)
    predicted, simulated = model.trace(motion.time, motion.strains), measured.at(motion.time)
    writhe = predicted.lifted_writhe - simulated.lifted_writhe
    tip = np.stack([np.interp(motion.time, recording.time, column) for column in recording.tip.T], axis=1)
    distance = np.linalg.norm(model.points(motion.strains)[:, -1] - tip, axis=1) / model.arm.length
    assert rms(writhe) <= 0.05 and abs(writhe).max() <= 0.15
    assert rms(predicted.twist - simulated.twist) <= 0.04
    assert rms(distance) <= 0.04
    assert predicted.net_crossings()[-1] == simulated.net_crossings()[-1] == -2


def test_model_foresees_a_motion_in_thin_water():
    """A hand and a bend at a tenth of the usual drag, where mass over drag is 0.37 s; as a lag that would be 0.4 turns of twist off."""
    from octoctrl.sim.plants import Plant

    arm, scene = Arm.octopus(elements=24), Scene.free(factor=0.1)
    hand, bend = Plateau(groups=("L-OM",), level=0.2, rise=0.5), Plateau(groups=("LM1",), level=0.2, onset=0.5, rise=0.5)
    activation = Activation(templates=(hand, bend))
    recording = Plant(arm, scene).advance(activation, 1.5)
    measured = measure(recording.time, recording.points, recording.frames)
    model = replace(load_identified(Arm.octopus()).model, arm=arm, scene=scene)
    motion = model.respond(activation, 1.5, step=0.01)
    predicted = model.trace(motion.time, motion.strains).at(measured.time)
    assert rms(predicted.twist - measured.twist) <= 0.05
    assert rms(predicted.lifted_writhe - measured.lifted_writhe) <= 0.06
