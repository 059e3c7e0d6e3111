"""Planning on goals that nobody has seen: status, honesty on a fine simulation, goals met on the rod, time and price.

Random tasks of three kinds from one seed: twist only, in two phases; writhe and twist, in one or two phases; variants of the coil. Goals of
the first two lie where random programmes lead, and beyond. Run with ``python benchmarks/planning.py [tasks] [seed] [--plant]``; with
``--plant`` every solved plan is carried out on the rod, open loop and with feedback.
"""

import argparse
from collections import Counter
from dataclasses import replace
from time import process_time

import numpy as np

import octoctrl as oc
from octoctrl import tasks
from octoctrl.judging.verification import verify
from octoctrl.planners.asking.primitives import Bend, Twist
from octoctrl.planners.asking.registry import goal
from octoctrl.planners.asking.task import Drive, Phase, Task
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.solving import planner
from octoctrl.planners.solving.plan import PlanStatus


def twist_only(draw):
    """Two phases, each with a twist of its own; both hands may act in each."""
    phases = tuple(
        Phase(
            name=name, duration=float(draw.uniform(0.8, 2.0)), goals=(goal("twist", value=float(draw.uniform(-1.5, 1.5)), tolerance=0.1),)
        )
        for name in ("first", "second")
    )
    drives = tuple(
        Drive(name=f"{hand} {phase.name}", primitive=Twist(hand=hand, level=0.1), begins=phase.name, free=("level", "rise"))
        for phase in phases
        for hand in ("R-OM", "L-OM")
    )
    return Task(name="twist", phases=phases, drives=drives)


def writhe_and_twist(draw):
    """One hand first, one bend, the other hand last, in one or two phases."""
    count, sign = int(draw.integers(1, 3)), float(draw.choice([-1, 1]))
    names = ("wind", "turn")[:count]
    last = (
        goal("lifted_writhe", value=sign * float(draw.uniform(0.3, 2.5)), tolerance=0.15),
        goal("twist", value=float(draw.uniform(-1.0, 1.0)), tolerance=0.1),
    )
    early = (goal("twist", value=sign * float(draw.uniform(0.2, 1.3)), tolerance=0.1),)
    phases = tuple(Phase(name=name, duration=1.8, goals=last if name == names[-1] else early) for name in names)
    first, second = ("L-OM", "R-OM") if sign > 0 else ("R-OM", "L-OM")
    drives = (
        Drive(name="store", primitive=Twist(hand=first, level=0.2), begins=names[0], free=("level", "rise")),
        Drive(name="bend", primitive=Bend(side="LM1", level=0.2), begins=names[-1], free=("level", "rise")),
        Drive(name="back", primitive=Twist(hand=second, level=0.1), begins=names[-1], free=("level", "rise")),
    )
    return Task(name="writhe and twist", phases=phases, drives=drives)


def coil_variant(draw):
    """The coil with goals moved by up to a quarter."""
    coil = tasks.load("coil").task
    phases = tuple(
        replace(phase, goals=tuple(replace(item, value=item.value * float(draw.uniform(0.75, 1.25))) for item in phase.goals))
        for phase in coil.phases
    )
    return replace(coil, phases=phases)


TIME_LIMIT = 600.0
"""Wall-clock limit, s: what other work on the machine does to it shall not decide."""

KINDS = (twist_only, writhe_and_twist, writhe_and_twist, coil_variant)


def met_on_rod(plan, feedback):
    """Whether every goal is met on the rod, by the verdict's own lines."""
    checks = verify(oc.execute(plan, feedback=feedback)).checks
    return all(check.passed for check in checks if "." in check.name)


def quantiles(values):
    return "P50 {:.2f}   P90 {:.2f}   max {:.2f}".format(*np.quantile(values, [0.5, 0.9, 1.0])) if len(values) else "none"


def main(count, seed, plant):
    draw = np.random.default_rng(seed)
    identified = load_identified(oc.Arm.octopus(), oc.Scene.free())
    planner.plan(tasks.load("coil").task, identified)  # compiled code is loaded before anything is timed
    status, spent, solved_spent, shares, prices, durations = Counter(), [], [], [], [], []
    carried = {"open-loop": Counter(), "tvlqr": Counter()}
    for index in range(count):
        kind = KINDS[index % len(KINDS)]
        task = kind(draw)
        begin = process_time()
        plan = planner.plan(task, identified, time_limit=TIME_LIMIT)
        seconds = process_time() - begin
        spent.append(seconds)
        status[kind.__name__, plan.status.name] += 1
        report, worst = plan.report, plan.report.worst
        share = 0.0 if worst is None else worst.share
        told = f"{index:3d} {kind.__name__:17} {plan.status.name:12} {seconds:5.2f} s  starts {report.starts:2d}  worst {share:5.2f}"
        if plan.status.solved:
            solved_spent.append(seconds)
            shares.append(worst.share)
            prices.append(report.price / report.first_price)
            durations.append(plan.schedule.duration / report.first_duration)
            if plant:
                for feedback, counter in carried.items():
                    good = met_on_rod(plan, feedback)
                    counter[plan.status.name, good] += 1
                    told += f"  {feedback} {'met' if good else 'MISSED'}"
        print(told, report.reason[:90], flush=True)
    print("\nstatus:", *(f"{kind} {name} {number}" for (kind, name), number in sorted(status.items())), sep="\n  ")
    solved = sum(number for (_, name), number in status.items() if PlanStatus[name].solved)
    print(f"solved {solved} of {count}; false on a simulation at 10 ms: {sum(share > 1 for share in shares)}")
    print(f"processor time, all:    {quantiles(spent)} s\nprocessor time, solved: {quantiles(solved_spent)} s")
    print(f"price over that of the first point that met the goals:    {quantiles(prices)}")
    print(f"duration over that of the first point that met the goals: {quantiles(durations)}")
    for feedback, counter in carried.items():
        for name in ("SOLVED", "DOUBTFUL"):
            total = counter[name, True] + counter[name, False]
            if total:
                print(f"met on the rod, {feedback}, {name}: {counter[name, True]} of {total}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tasks", nargs="?", type=int, default=60)
    parser.add_argument("seed", nargs="?", type=int, default=7)
    parser.add_argument("--plant", action="store_true")
    given = parser.parse_args()
    main(given.tasks, given.seed, given.plant)
