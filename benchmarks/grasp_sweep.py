"""One schedule that grasps a post, tried on others: thicker ones, other shapes, other friction, and with its bend faster or all at once.

Run `python benchmarks/grasp_sweep.py all --figure docs/grasp-sweep.png`, or one of its parts alone. The schedule is planned once, for the
post of the task `grasp`, and stays as it is; of other diameters the surface stays where it was.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import octoctrl as oc
from octoctrl.carrying.trials import schedule_of
from octoctrl.carrying.tugging import tugs
from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.planners.asking.goals.touching import hold_in
from octoctrl.planners.asking.wrapping import Curl
from octoctrl.planners.solving.grasping import nearest
from octoctrl.sim.contact.surroundings import Touch
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.scene.objects import Box, Capsule
from octoctrl.sim.topology.measures import writhe

SECONDS = 5.0


def run(plan, schedule, objects, model, tugged=False):
    """Winding, covered winding, writhe and normal force at the end about the first object, and what a tug along it met."""
    try:
        plant = oc.make_plant(model, plan.arm, replace(plan.scene, objects=tuple(objects)))
        recording = plant.advance(schedule.activation(), SECONDS)
    except (OctoctrlError, PlantUnstableError) as error:
        return {"note": str(error)[:90]}
    found = {"C": 0.0, "W": 0.0}
    for item in objects:
        hold = hold_in(RecordedOutputs(recording, None, plan.arm), item.name)
        late = recording.time > SECONDS - 1.0
        if np.abs(hold.covered[late]).min() >= found["C"]:
            drift, slip = np.ptp(hold.winding[late]), hold.touch.slip[-1] - hold.touch.slip[late][0]
            found = {
                "C": np.abs(hold.covered[late]).min(),
                "W": abs(hold.winding[-1]),
                "N": hold.touch.normal_force[-1],
                "drift": drift,
                "slip": slip,
            }
    found |= {
        "Wr": abs(writhe(recording.points[-1])),
        "depth": max(Touch.of(recording.series, item.name).deepest.max() for item in objects),
    }
    if tugged and found["C"] > 0.3:
        along = tugs(plant, schedule.activation(), objects[0].name, model=model)["along"]
        found |= {"axial": along.force, "normal": along.normal_force}
    return found


def shown(name, found):
    print(
        f"{name:34}", "  ".join(f"{key} {value:.3g}" if not isinstance(value, str) else value for key, value in found.items()), flush=True
    )
    return found


def thicker(post, arm, diameter):
    """A post of another diameter whose surface is where it was, as seen from the arm."""
    _, _, azimuth = nearest(arm, post)
    away = (diameter / 2 - post.radius) * np.array([np.cos(azimuth), 0.0, np.sin(azimuth)])
    return replace(post, radius=diameter / 2, position=tuple(map(float, np.add(post.position, away))))


def main():
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("part", nargs="?", default="all", choices=["diameter", "shapes", "friction", "wave", "all"])
    asked.add_argument("--plant", default="rod")
    asked.add_argument("--plan", type=Path, help="a plan of the task grasp that was made before")
    asked.add_argument("--figure", type=Path)
    given = asked.parse_args()
    plan = oc.load(given.plan) if given.plan else oc.plan("grasp", plant=given.plant)
    post, arm, results = plan.scene.objects[0], plan.arm, {}
    if given.part in ("diameter", "all"):
        results["diameter"] = []
        for diameter in (10, 12, 14, 16, 18, 20, 22, 23, 24, 25, 26, 27, 28, 30, 32, 36, 42, 50, 60):
            found = run(plan, plan.schedule, [thicker(post, arm, diameter * 1e-3)], given.plant)
            results["diameter"].append((diameter, shown(f"diameter {diameter} mm, D/L {diameter / 200:.2f}", found)))
    if given.part in ("shapes", "all"):
        others = {f"bar, {share:.1f} of the way round": [square(post, share)] for share in (0.7, 0.8, 0.9, 1.0)}
        others |= {f"cross, second {share:.2f} as thick": [post, crossing(post, share)] for share in (0.25, 0.5, 1.0)}
        others |= {f"tilted by {angle} deg": [replace(post, axis=turned(post.axis, angle))] for angle in (-25, -15, -10, -5, 5, 10, 15, 25)}
        results["shapes"] = [(name, shown(name, run(plan, plan.schedule, objects, given.plant))) for name, objects in others.items()]
    if given.part in ("friction", "all"):
        results["friction"] = []
        for mu in (0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0):
            found = run(plan, plan.schedule, [replace(post, friction=(mu, mu))], given.plant, tugged=True)
            if "axial" in found and mu:
                found["axial over mu N"] = found["axial"] / (mu * found["normal"])
            results["friction"].append((mu, shown(f"friction {mu}", found)))
    if given.part in ("wave", "all"):
        results["wave"] = []
        for name, factor in {"as planned": 1.0, "twice as fast": 2.0, "four times": 4.0, "eight times": 8.0, "at once": 300.0}.items():
            faster = schedule_of(tuple(hastened(item, factor) for item in plan.schedule.primitives), SECONDS)
            results["wave"].append((name, shown(f"front {name}", run(plan, faster, [post], given.plant))))
    if given.figure:
        drawn(results, plan.arm.length, given.figure)


def square(post, share):
    """A square bar in the place of a post, the way round which is a share of that round the post."""
    side = share * 0.5 * np.pi * post.radius
    return Box(name="bar", size=(side, side, post.length), position=post.position, axis=post.axis)


def crossing(post, share):
    """A second post across the first one's middle, a share as thick."""
    across = tuple(map(float, np.cross(post.axis, [1.0, 0.0, 0.0])))
    return Capsule(name="second", radius=share * post.radius, length=post.length, position=post.position, axis=across)


def turned(axis, degrees):
    """An axis turned about the direction of the arm and a little about x."""
    angle = np.radians(degrees)
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    return float(x), float(np.cos(angle) * y - np.sin(angle) * z), float(np.sin(angle) * y + np.cos(angle) * z)


def hastened(item, factor):
    """A curl whose front is faster; a few hundred times: the whole of it bends at once, at the same levels."""
    return replace(item, speed=factor * item.speed) if isinstance(item, Curl) else item


def drawn(results, length, path):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.0 * ((len(results) + 1) // 2)), layout="constrained")
    panels = figure.subplots((len(results) + 1) // 2, 2, squeeze=False).ravel()
    for axes, (name, rows) in zip(panels, results.items(), strict=False):
        good = [(key, found) for key, found in rows if "note" not in found]
        if name == "diameter":
            for what, colour in (("C", "#0072B2"), ("W", "#56B4E9"), ("Wr", "#D55E00")):
                axes.plot(
                    [key * 1e-3 / length for key, _ in good], [found[what] for _, found in good], "o-", ms=3, color=colour, label=what
                )
            axes.set_xlabel("diameter over length of the arm")
            axes.set_ylabel("turns")
            axes.legend(frameon=False)
        elif name == "friction":
            held = [(key, found) for key, found in good if "axial" in found]
            axes.plot(
                [key * found["normal"] * 1e3 for key, found in held], [found["axial"] * 1e3 for _, found in held], "o", color="#0072B2"
            )
            most = max((key * found["normal"] * 1e3 for key, found in held), default=1.0)
            axes.plot([0, most], [0, most], ":", color="0.5")
            axes.set_xlabel("mu N [mN]")
            axes.set_ylabel("force along the axis [mN]")
        else:
            axes.barh([key for key, _ in good][::-1], [found["C"] for _, found in good][::-1], color="#009E73")
            axes.axvline(0.9, ls=":", color="0.5")
            axes.set_xlabel("covered winding")
            axes.tick_params(axis="y", labelsize=7)
        axes.set_title(name, fontsize=10)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
