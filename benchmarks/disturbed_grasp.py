"""A held object is pushed for a tenth of a second, or the arm stands in a current: what is left of the grasp, with feedback and without.

Run `python benchmarks/disturbed_grasp.py`. The grasp is planned once, for the post of the task `grasp`, which is let go at 5 s. A current
is a drag on the arm as if it stood still in water that moves.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import octoctrl as oc
from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.planners.asking.goals.touching import hold_in
from octoctrl.sim.scene.objects import Free, Push

BEGIN, SETTLE = 6.0, 5.0
"""When the disturbance begins, and how long it goes on after the plan, s."""


def current(arm, speed):
    """Loads (N/m) of water at a speed (m/s) along x on an arm at rest, in ten windows, from `BEGIN` on."""
    water, edges = oc.Water(), np.linspace(0.0, arm.length, 11)
    section = arm.section((edges[1:] + edges[:-1]) / 2)
    width = 2 * np.asarray(section.muscle_radius) * 8
    size = 0.5 * water.density * water.normal_coefficient * width * speed * abs(speed)
    return tuple(
        oc.SpreadLoad(force=lambda time, one=float(one): (one * np.clip((time - BEGIN) / 0.2, 0.0, 1.0), 0.0, 0.0), window=(low, high))
        for one, low, high in zip(size, edges[:-1], edges[1:], strict=True)
    )


def main():
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--plant", default="rod")
    asked.add_argument("--plan", type=Path, help="a plan of the task grasp that was made before")
    given = asked.parse_args()
    plan = oc.load(given.plan) if given.plan else oc.plan("grasp", plant=given.plant)
    post, arm = plan.scene.objects[0], plan.arm
    free = replace(post, density=105.0, support=Free(since=5.0, damping=(5.0, 5.0)))
    axis = np.array(post.axis, dtype=float) / np.linalg.norm(post.axis)
    away = np.array([0.0, 1.0, 0.0]) - axis[1] * axis
    cases = {"undisturbed": ((), ())}
    for force in (0.01, 0.03, 0.1):
        for word, way in (("along", axis), ("across", away / np.linalg.norm(away))):
            cases[f"{1e3 * force:.0f} mN {word}"] = (Push(force=tuple(map(float, force * way)), since=BEGIN, until=BEGIN + 0.1),), ()
    for speed in (0.05, -0.05, 0.1):
        cases[f"current {100 * speed:.0f} cm/s"] = (), current(arm, speed)
    print(f"{'':22}" + "".join(f"{name:>28}" for name in ("open-loop", "grip")))
    for name, (pushes, loads) in cases.items():
        said = []
        for feedback in ("open-loop", "grip"):
            scene = replace(plan.scene, objects=(replace(free, pushes=pushes),), loads=loads)
            run = oc.execute(plan, feedback=feedback, plant=oc.make_plant(given.plant, arm, scene), settle=SETTLE, allow_unsolved=True)
            hold = hold_in(RecordedOutputs(run.recording, run.trace, arm), post.name)
            after = run.recording.time >= BEGIN
            covered = np.abs(hold.covered)
            moved = 1e3 * np.linalg.norm(hold.touch.position[-1] - post.position)
            said.append(f"C {covered[after].min():.2f} at least, {covered[-1]:.2f} ({moved:.0f} mm)")
        print(f"{name:22}" + "".join(f"{word:>28}" for word in said), flush=True)


if __name__ == "__main__":
    main()
