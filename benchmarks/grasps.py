"""How many posts the planner can grasp: random posts, each searched on the rod, then checked on the plant that is named.

Run `python benchmarks/grasps.py posts.jsonl --plant assembly-coarse-mixed`. A line for each post goes to the file as soon as it is done,
and the next call goes on with those that are not in it; the table goes to standard output.

*held* is what the planner says, by which candidate. With `--again` it is carried out once more, and judged by that verdict.
"""

import argparse
import json
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

import octoctrl as oc
from octoctrl.planners.solving.grasping import most_turns, nearest
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


def tried(item, arm, plant, executor, again):
    """What became of one post, as numbers and words."""
    task = oc.tasks.load("grasp")
    configuration = replace(task, scene=oc.Scene(objects=(item,)), plan=replace(task.plan, seed=0))
    begin = process_time()
    plan = oc.plan(configuration, plant=plant, executor=executor, time_limit=1e5)
    place, gap, _ = nearest(arm, item)
    tilt = float(np.degrees(np.arccos(min(abs(item.axis[1]), 1.0))))
    row = {"diameter": 2e3 * item.radius, "meets": 1e3 * place, "gap": 1e3 * gap, "tilt": tilt, "turns": most_turns(arm, item)[1]}
    row["status"] = plan.status.name.lower()
    row |= {"processor": process_time() - begin, "reason": plan.report.reason, **plan.report.stages}
    if row["status"] == "refused":
        return row
    # Whatever is tried after the first that passes on the plant is tried for the sake of the scenarios.
    tried_there = [line for line in plan.report.tried if line.startswith("candidate") and f"on the plant '{plant}': worst goal " in line]
    carried = [line for line in tried_there if "by scenario" not in line]
    passed = [float(line.split("worst goal ")[1].split()[0]) <= 1 and "beyond its limit" not in line for line in carried]
    row["candidate"] = passed.index(True) + 1 if True in passed else len(carried)
    row |= {"price": plan.report.price, "trials": plan.report.starts, "tried": plan.report.tried}
    row |= {name: plan.report.measured.get(f"post.{name}", np.nan) for name in ("covered_winding", "normal_force", "depth", "drift")}
    if plan.status.solved and again:
        run = oc.execute(plan, plant=plant, allow_unsolved=True)
        row["falsely"] = not oc.verify(run).passed
    return row


def shown(number, row):
    """A row as a line of the table."""
    where = f"{number:3d}  D {row['diameter']:4.1f} mm  meets {row['meets']:5.1f} mm  gap {row['gap']:4.1f} mm  {row['tilt']:2.0f} deg"
    where += f"  {row['turns']:.2f} turns"
    if row["status"] == "refused":
        return f"{where}  refused"
    cost = f"price {row['price']:.2f}, {row['trials']} trials; search {row['search']:.0f} s, check {row['check']:.0f} s"
    said = f"C {row['covered_winding']:.2f}, {1e3 * row['normal_force']:.0f} mN, {1e3 * row['depth']:.3f} mm deep"
    if row["status"] == "missed":
        return f"{where}  missed   {said}; {cost}: {row['reason']}"
    return f"{where}  {row['status']:8} by candidate {row['candidate']}: {said}; {cost}" + ("  FALSELY" if row.get("falsely") else "")


def main():
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("file", type=Path, help="what was found, a line of JSON for each post")
    asked.add_argument("--posts", type=int, default=50)
    asked.add_argument("--seed", type=int, default=7)
    asked.add_argument("--plant", default="rod")
    asked.add_argument("--again", action="store_true")
    given = asked.parse_args()
    arm, rows = oc.tasks.load("grasp").arm, {}
    if given.file.exists():
        for line in given.file.read_text(encoding="utf-8").splitlines():
            row = json.loads(line)
            if (row["seed"], row["plant"]) == (given.seed, given.plant):
                rows[row["number"]] = row
                print(shown(row["number"], row))
    with ThreadPoolExecutor(1) as one:
        for number, item in enumerate(posts(given.seed, given.posts, arm)):
            if number in rows:
                continue
            rows[number] = {"seed": given.seed, "plant": given.plant, "number": number, **tried(item, arm, given.plant, one, given.again)}
            with given.file.open("a", encoding="utf-8") as out:
                out.write(json.dumps(rows[number]) + "\n")
            print(shown(number, rows[number]), flush=True)
    tries = [row for row in rows.values() if row["status"] != "refused"]
    held = [row for row in tries if row["status"] != "missed"]
    counts = dict(Counter(row["status"] for row in rows.values()))
    first, false = sum(row["candidate"] == 1 for row in held), sum(row.get("falsely", False) for row in held)
    search = sorted(row["search"] for row in tries)
    print(f"{counts}; of {len(tries)} tried {len(held)} are held, {first} of them by the first candidate, {false} falsely")
    if search:
        middle, most = np.quantile(search, (0.5, 0.9))
        print(f"processor time of a search: median {middle:.0f} s, nine of ten within {most:.0f} s, at most {search[-1]:.0f} s")


if __name__ == "__main__":
    main()
