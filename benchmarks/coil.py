"""The figures of the coil: what the reduced model foresees, how long planning takes, and what feedback is worth on a wrong plant.

Run with ``python benchmarks/coil.py`` (about a minute). Errors are simulated on the rod plant minus planned or predicted, in turns, root
mean square and largest over the run; the tip's distance is in arm lengths. Open and closed loop are compared on the plant's own clock,
without waiting for goals. Times belong to the machine that is named; compilation is not counted.
"""

import os
import platform
from dataclasses import replace
from time import perf_counter

import numpy as np

from octoctrl import tasks
from octoctrl.carrying.execution import execute
from octoctrl.judging.comparison import level_delays
from octoctrl.planners.asking.registry import goal
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.solving import planner
from octoctrl.planners.solving.problem import Problem
from octoctrl.sim.plants import Plant, warmup
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.topology.measures import measure

GUESSES = 20
PLANTS = {
    "as modelled": (1.0, 1.0, 1.0),
    "LM gain -20 %": (0.8, 1.0, 1.0),
    "OM gain -20 %": (1.0, 0.8, 1.0),
    "drag x 2": (1.0, 1.0, 2.0),
    "all at once": (0.8, 0.8, 2.0),
}
"""Gain of the longitudinal and of the oblique muscles, and factor on the drag."""


def machine():
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            name = next(line.partition(":")[2].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        name = platform.processor() or platform.machine()
    return f"{name}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def model_errors(configuration):
    programme = tasks.programme("fig2c")
    activation, duration = programme.activation, programme.duration
    plant = Plant(configuration.arm, configuration.scene)
    recording = plant.advance(activation, duration)
    measured = measure(recording.time, recording.points, recording.frames)
    print("Reduced model against the rod plant on the programme of Fig 2c, held out from identification")
    print(f"{'laws':>9} {'writhe rms':>11} {'max':>6} {'twist rms':>10} {'tip rms':>8} {'crossings':>10} {'time':>8} {'x real time':>12}")
    for laws in ("known", "generic"):
        model = load_identified(configuration.arm, configuration.scene, laws=laws).model
        motion = model.respond(activation, duration)
        spent = np.inf
        for _ in range(10):
            begin = perf_counter()
            motion = model.respond(activation, duration)
            spent = min(spent, perf_counter() - begin)
        predicted, simulated = model.trace(motion.time, motion.strains), measured.at(motion.time)
        writhe = predicted.lifted_writhe - simulated.lifted_writhe
        tip = np.stack([np.interp(motion.time, recording.time, column) for column in recording.tip.T], axis=1)
        distance = np.linalg.norm(model.points(motion.strains)[:, -1] - tip, axis=1) / model.arm.length
        crossings = f"{predicted.net_crossings()[-1]:+d} / {simulated.net_crossings()[-1]:+d}"
        print(
            f"{laws:>9} {rms(writhe):11.3f} {abs(writhe).max():6.3f} {rms(predicted.twist - simulated.twist):10.3f} {rms(distance):8.2%} "
            f"{crossings:>10} {spent * 1e3:5.1f} ms {duration / spent:12.0f}"
        )


def with_goal(task, phase, quantity, value, tolerance=0.1):
    """The task with one goal of a phase replaced."""
    wanted = goal(quantity, value=value, tolerance=tolerance)
    phases = [
        replace(item, goals=(*(old for old in item.goals if old.quantity != quantity), wanted)) if item.name == phase else item
        for item in task.phases
    ]
    return replace(task, phases=tuple(phases))


def planning_times(configuration, identified):
    task = configuration.task

    def timed(label, task, **how):
        begin = perf_counter()
        found = planner.plan(task, identified, **how)
        spent = perf_counter() - begin
        iterations = found.report.iterations
        print(f"{label:>44} {spent:9.4f} s {iterations:5d}   {found.status.name}")
        return found

    print(f"\nPlanning\n{'':>44} {'time':>11} {'iter.':>5}   status")
    plan = timed("the first in this process", task)
    timed("again from the task's own numbers", task)
    timed("again, last goal from 1.0 to 0.95", with_goal(task, "telescope", "twist", 0.95), guess=plan)
    timed("again, first goal from -1.0 to -1.1", with_goal(task, "store", "twist", -1.1), guess=plan)
    timed("again, writhe from -2.0 to -1.95", with_goal(task, "cross", "lifted_writhe", -1.95, 0.15), guess=plan)
    timed("unreachable: three turns of twist", with_goal(task, "telescope", "twist", 3.0))
    timed("unreachable: arm of half a metre", with_goal(task, "telescope", "length", 0.5, 0.01))
    timed("three turns of planar writhe", with_goal(task, "cross", "lifted_writhe", -3.0, 0.15))
    problem = Problem(task, identified.model)
    draw, same, worst, begin = np.random.default_rng(1), 0, 0.0, perf_counter()
    for _ in range(GUESSES):
        start = problem.start * (1 + 0.3 * draw.uniform(-1, 1, len(problem.start)))
        found = planner.plan(task, identified, start=dict(zip(problem.names, start, strict=True)))
        numbers = [np.array(list(item.report.numbers.values())) for item in (plan, found)]
        distance = float(abs((numbers[1] - numbers[0]) / problem.box.scale).max())
        same, worst = same + (found.status is plan.status and distance < 0.05), max(worst, distance)
    mean = (perf_counter() - begin) / GUESSES
    print(
        f"{same} of {GUESSES} guesses perturbed by 30 % reach the same plan (within {worst:.2%} of the unknowns' scale), {mean:.2f} s each"
    )
    return plan


def wrong_plant(plan, longitudinal, oblique, drag):
    arm = replace(plan.arm, longitudinal=plan.arm.longitudinal.stronger(longitudinal), oblique=plan.arm.oblique.stronger(oblique))
    return Plant(arm, Scene.free(factor=drag))


def loops(plan):
    print("\nThe coil on the rod plant")
    print(
        f"{'plant':>14} {'loop':>10} {'writhe rms':>11} {'max':>6} {'twist rms':>10} {'max':>6} "
        f"{'crossings':>10} {'level time':>11} {'wall':>7}"
    )
    for name, factors in PLANTS.items():
        for feedback in ("open-loop", "tvlqr"):
            begin = perf_counter()
            run = execute(plan, feedback=feedback, plant=wrong_plant(plan, *factors), patience=0.0)
            spent = perf_counter() - begin
            planned = plan.trace.at(np.clip(run.trace.time, 0.0, plan.trace.time[-1]))
            writhe, twist = run.trace.lifted_writhe - planned.lifted_writhe, run.trace.twist - planned.twist
            crossings = f"{run.trace.net_crossings()[-1]:+d} / {planned.net_crossings()[-1]:+d}"
            print(
                f"{name:>14} {feedback:>10} {rms(writhe):11.3f} {abs(writhe).max():6.3f} {rms(twist):10.3f} {abs(twist).max():6.3f} "
                f"{crossings:>10} {max(level_delays(run).values()):9.2f} s {spent:5.2f} s"
            )


def main():
    print(machine(), end="\n\n")
    warmup()
    configuration = tasks.load("coil")
    model_errors(configuration)
    loops(planning_times(configuration, load_identified(configuration.arm, configuration.scene)))


if __name__ == "__main__":
    main()
