"""Plans and runs made by hand, for tests of the verdict: an arm of uniform strains that winds up, curls, crosses its plane and rests."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from octoctrl.carrying.results import Event, Execution, ExecutionReport
from octoctrl.planners.asking.primitives import Twist
from octoctrl.planners.asking.registry import goal
from octoctrl.planners.asking.schedule import Schedule
from octoctrl.planners.asking.task import Drive, Phase, Task
from octoctrl.planners.model.kinematics import element_points, element_stations, integrate_frames, section_bounds
from octoctrl.planners.model.reduced import ReducedModel
from octoctrl.planners.solving.plan import Plan, PlanStatus
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.topology.measures import measure

EDGES = {"store": 0.0, "curl": 1.0, "cross": 3.0, "rest": 4.5}
END, SECTIONS, LENGTH = 6.0, 8, 0.2
RECORDED = np.linspace(0.0, END, 121)
"""Instants of a run: among them the ends of the phases."""


@dataclass(frozen=True)
class Motion:
    """Turns of twist, turns of bending and stretch as knots over time, piecewise linear."""

    twist: tuple = ((0.0, 0.0), (0.8, -0.6), (3.0, -0.6), (4.2, 0.3), (4.5, 0.3), (6.0, 0.55))
    bend: tuple = ((1.0, 0.0), (1.5, 1.3), (3.1, 1.3), (3.6, 2.0))
    stretch: tuple = ((0.0, 1.0), (2.5, 0.95))

    def strains(self, time):
        series = np.zeros((len(time), SECTIONS, 4))
        series[..., 0] = -2 * np.pi / LENGTH * along(self.bend, time)[:, None]
        series[..., 2] = 2 * np.pi / LENGTH * along(self.twist, time)[:, None]
        series[..., 3] = along(self.stretch, time)[:, None]
        return series


def along(knots, time):
    return np.interp(time, *np.transpose(knots))


def bump(knots, begin, end, size):
    """The same knots with a trapezoid of height `size` between two times."""
    times = np.unique([*(time for time, _ in knots), begin, begin + 0.05, end - 0.05, end])
    extra = np.interp(times, [begin, begin + 0.05, end - 0.05, end], [0.0, size, size, 0.0], left=0.0, right=0.0)
    return tuple(zip(times.tolist(), (along(knots, times) + extra).tolist(), strict=True))


def posed(arm, strains):
    stations, bounds = element_stations(arm.edges), section_bounds(arm, SECTIONS)
    frames = integrate_frames(strains, stations, bounds)
    return {"points": element_points(strains, frames, arm.edges, bounds), "frames": frames, "stations": stations}


GOALS = {
    "store": (goal("twist", value=-0.55, tolerance=0.1),),
    "curl": (goal("lifted_writhe", value=-0.7, tolerance=0.1), goal("length", value=0.191, tolerance=0.004)),
    "cross": (goal("lifted_link", value=-1.95, tolerance=0.1),),
    "rest": (),
}


@lru_cache
def predicted(motion, elements):
    """Times, strains and topology of a motion."""
    time = np.linspace(0.0, END, 241)
    strains = motion.strains(time)
    pose = posed(Arm(elements=elements), strains)
    return time, strains, measure(time, pose["points"], pose["frames"])


def plan_of(motion, *, goals=GOALS, elements=48, **changes):
    """A plan that predicts `motion`."""
    arm = Arm(elements=elements)
    ends = [*list(EDGES.values())[1:], END]
    phases = tuple(
        Phase(name=name, duration=end - begin, goals=goals[name]) for (name, begin), end in zip(EDGES.items(), ends, strict=True)
    )
    drive = Drive(name="wind", primitive=Twist(hand="R-OM", level=0.25), begins="store")
    task = Task(name="by hand", phases=phases, drives=(drive,))
    time, strains, trace = predicted(motion, elements)
    model = ReducedModel(arm=arm, scene=Scene(), sections=SECTIONS)
    made = {
        "task": task, "model": model, "schedule": Schedule(primitives=(drive.at(EDGES, {}),), duration=END),
        "phase_begins": dict(EDGES), "time": time, "strains": strains, "status": PlanStatus.SOLVED,
        "trace": trace,
    }  # fmt: skip
    return Plan(**(made | changes))


def recording_of(arm, motion, time=RECORDED, level=0.25):
    strains = motion.strains(time)
    levels = np.full((len(time), 11, arm.elements), level)
    return Recording(time=time, stretch=np.repeat(strains[:, :1, 3], arm.elements, axis=1), levels=levels, **posed(arm, strains))


def run_of(plan, recording, clock=None, **changes):
    """An execution of `plan` that left `recording`; the clock never waited if it is not given."""
    clock = recording.time if clock is None else clock
    ends = [*list(plan.phase_begins.values())[1:], plan.schedule.duration]
    events = tuple(
        Event(phase=name, planned=end, actual=float(recording.time[np.searchsorted(clock, end - 1e-9)]), met=True)
        for name, end in zip(plan.phase_begins, ends, strict=True)
        if end <= clock[-1]
    )
    made = {
        "plan": plan, "recording": recording, "trace": measure(recording.time, recording.points, recording.frames), "clock": clock,
        "feedback": "tvlqr", "events": events, "report": ExecutionReport(wall_time=1.0, time_step=1e-4, step_limit="shear"),
    }  # fmt: skip
    return Execution(**(made | changes))


def waiting(plan, motion, at=1.0, wait=0.4):
    """A run that follows `motion` on the clock, which stands for `wait` seconds when it reads `at`."""
    time = np.linspace(0.0, END + wait, round(20 * (END + wait)) + 1)
    clock = np.where(time < at, time, np.maximum(time - wait, at))
    pose = recording_of(plan.arm, motion, clock)
    run = run_of(plan, replace(pose, time=time), clock)
    late = tuple(event if event.planned != at else replace(event, actual=at + wait) for event in run.events)
    return replace(run, events=late)


def moved(recording, shift):
    """The whole arm elsewhere: topology and length stay, the tip does not."""
    return replace(recording, points=recording.points + shift)
