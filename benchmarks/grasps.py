"""How many posts the planner can grasp: random posts, each searched on the rod, then checked on the plant that is named.

Run `python benchmarks/grasps.py --posts 50 --plant rod`; results go to standard output, a line for each post, and at the end the shares.
"""

import argparse
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from time import process_time

import numpy as np

import octoctrl as oc
from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.planners.asking.goals.touching import hold_in
from octoctrl.planners.solving.grasping import nearest
from octoctrl.sim.scene.objects import Capsule


def random_post(draw, arm):
    """A post of 10 to 36 mm, which meets the arm at 10 to 120 mm, 1 to 20 mm away from it, at 3 to 90 degrees to it."""
    radius, place, gap = draw.uniform(5e-3, 18e-3), draw.uniform(0.01, 0.12), draw.uniform(1e-3, 20e-3)
    around, tilt, along = draw.uniform(0, 2 * np.pi), np.radians(draw.uniform(3, 90)), draw.uniform(-0.02, 0.02)
    out = np.array([np.cos(around), 0.0, np.sin(around)])
    aside = np.cross([0.0, 1.0, 0.0], out)
    axis = np.cos(tilt) * np.array([0.0, 1.0, 0.0]) + np.sin(tilt) * aside
    centre = np.array([0.0, place, 0.0]) + (float(arm.section(place).outer_radius) + radius + gap) * out + along * axis
    return Capsule(name="post", radius=radius, length=0.08, position=tuple(map(float, centre)), axis=tuple(map(float, axis)))


def posts(seed, count, arm):
    """Posts that stay at least a millimetre away from the arm at rest."""
    draw, found = np.random.default_rng(seed), []
    while len(found) < count:
        item = random_post(draw, arm)
        if nearest(arm, item)[1] > 1e-3:
            found.append(item)
    return found


def main():
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--posts", type=int, default=50)
    asked.add_argument("--first", type=int, default=0, help="number of the first post that is tried")
    asked.add_argument("--seed", type=int, default=7)
    asked.add_argument("--plant", default="rod")
    given = asked.parse_args()
    arm, base = oc.Arm.octopus(), oc.tasks.load("grasp")
    counts = {"held": 0, "missed": 0, "refused": 0}
    first_held = 0
    with ThreadPoolExecutor(1) as one:
        for number, item in enumerate(posts(given.seed, given.posts, arm)):
            if number < given.first:
                continue
            configuration = replace(base, scene=oc.Scene(objects=(item,)))
            begin = process_time()
            plan = oc.plan(configuration, plant=given.plant, executor=one, time_limit=1e5)
            spent = process_time() - begin
            status, said = plan.status.name.lower(), [line for line in plan.report.tried if line.startswith("candidate")]
            counts[status] += 1
            first_held += status == "held" and len(said) == 1
            place, gap, _ = nearest(arm, item)
            where = f"{number:2d}  D {2e3 * item.radius:4.1f} mm  meets {1e3 * place:5.1f} mm  gap {1e3 * gap:4.1f} mm"
            if status == "refused":
                print(f"{where}  refused: {plan.report.reason}", flush=True)
                continue
            run = oc.execute(plan, plant=given.plant, allow_unsolved=True)
            hold = hold_in(RecordedOutputs(run.recording, run.trace, arm), "post")
            late = run.recording.time > run.recording.time[-1] - 1.0
            covered = np.abs(hold.covered[late]).min()
            search, tries = plan.report.stages["search"], f"{len(said)} of {plan.report.starts}"
            print(
                f"{where}  {status}  C {covered:.2f}  W {abs(hold.winding[-1]):.2f}  N {1e3 * hold.touch.normal_force[-1]:.0f} mN  depth "
                f"{1e3 * hold.touch.deepest.max():.3f} mm  price {plan.report.price:.2f}  candidates {tries}  "
                f"search {search:.1f} s of {spent:.1f} s",
                flush=True,
            )
    tried = counts["held"] + counts["missed"]
    print(f"{counts}; held {counts['held']} of {tried}, by the first candidate {first_held}", flush=True)


if __name__ == "__main__":
    main()
