"""The published numerics with the published contact against recorded runs of the authors' own code: figures 4a and 4i.

Run with ``python benchmarks/published_grasp.py FOLDER [fig4a] [fig4i]`` (some minutes each), where FOLDER holds ``fig4a.csv`` and
``fig4i.csv``: time (s), tip (mm), writhe, winding, place of the post (mm) and so on, one row every 0.02 s. Tekinalp et al. (2024) give
inertia of a free post without the part of its length, keep it in place by springs of 100 N/m, and in figure 4i take contacts between
straight rods three times as stiff; k is 0.5 N/m for an element and 10 N/m for the posts of figure 4i.
"""

import csv
import sys
from pathlib import Path

import numpy as np

import octoctrl as oc
from octoctrl import tasks
from octoctrl.sim.assembly.layout import SpokeRow
from octoctrl.sim.contact.columns import Body
from octoctrl.sim.contact.measures import winding
from octoctrl.sim.contact.surroundings import Touch
from octoctrl.sim.scene.objects import Capsule
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.scene.supports import Springs
from octoctrl.sim.topology.measures import writhe

NODE = 0.2 / 360
"""Length of arm (m) for which a node of a helix stands."""
HELD = {"stiffness": 0.5 / NODE, "friction": (0.1, 0.1)}
POST = Capsule(
    name="post", radius=14e-3, length=0.08, position=(-0.01968674, 0.04, -0.01968674), axis=(0, 1, 0), mass=5.172e-3, water_mass=False,
    support=Springs(stiffness=100.0, turning=100.0 * 0.04**2, damping=(50.0, 1.02)), **HELD,
)  # fmt: skip
CREVICE = {"radius": 20e-3, "length": 0.08, "axis": (0, 0, 1), "stiffness": 10 / NODE, "friction": (0.0, 0.0)}
CREVICE_OBJECTS = (
    Capsule(name="post 1", position=(0.048, 0.125, 0.0), **CREVICE),
    Capsule(name="post 2", position=(0.048, 0.0375, 0.0), **CREVICE),
    Capsule(name="target", radius=5e-3, length=0.04, position=(0.09, 0.1, 0.0), axis=(0, 0, 1), **HELD),
)


def recorded(folder, name):
    """Columns of a recorded run by name."""
    with open(Path(folder) / f"{name}.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def at(times, columns, *names):
    """Recorded values at `times` (s)."""
    return np.stack([np.interp(times, columns["t_s"], columns[name]) for name in names], axis=-1)


def moved(name, objects, duration, dt):
    """The published arm among objects, and its plant."""
    programme = tasks.programme(name)
    plant = oc.make_plant(
        "assembly", scene=Scene(water=programme.scene.water, objects=objects), paper_compatible=True, dt=dt, sample_interval=5e-4,
        record_every=40,
    )  # fmt: skip
    return plant, lambda: plant.advance(programme.activation, duration)


def fig4a(folder):
    """Winding, post and tip of the grasp to 2.5 s."""
    plant, go = moved("fig4a", (POST,), 2.5, 1e-5)
    # The published inertia, without m L^2 / 12.
    row, square = plant.core._around.world.bodies[0], 5.172e-3 * POST.radius**2
    row[Body.INVERSE_INERTIA : Body.INVERSE_INERTIA + 3] = 1 / (square * np.array([0.25, 0.25, 0.5]))
    run, columns = go(), recorded(folder, "fig4a")
    touch = Touch.of(run.series, "post")
    wound = winding(run.points, touch.position, touch.frame)
    tip = 1e3 * run.points[:, -1] - at(run.time, columns, "tip_x_mm", "tip_y_mm", "tip_z_mm")
    wound_there = at(run.time, columns, "winding_about_post_turns")[:, 0]
    post = 1e3 * touch.position - at(run.time, columns, "post_x_mm", "post_y_mm", "post_z_mm")
    print("fig4a    t s   tip off mm   winding   recorded   post off um   depth mm")
    for t in (1.0, 1.5, 2.0, 2.25, 2.5):
        i = int(np.abs(run.time - t).argmin())
        off, aside = np.linalg.norm(tip[i]), 1e3 * np.linalg.norm(post[i])
        print(f"{run.time[i]:12.2f} {off:12.2f} {wound[i]:9.3f} {wound_there[i]:10.3f} {aside:13.1f} {1e3 * touch.deepest[i]:10.2f}")
    print("largest to 2.5 s:", ", ".join([
        _largest(run.time, "winding", np.abs(wound - wound_there)),
        _largest(run.time, "post (um)", 1e3 * np.linalg.norm(post, axis=1)),
        _largest(run.time, "tip (mm)", np.linalg.norm(tip, axis=1)),
    ]))  # fmt: skip


def fig4i(folder):
    """Tip and writhe of the bend wave through the crevice to 1.2 s."""
    plant, go = moved("fig4i", CREVICE_OBJECTS, 1.2, 9.8e-6)
    for stiffness in (SpokeRow.C_CONTACT, SpokeRow.N_CONTACT):
        plant.core.rods.spoke(stiffness)[:] *= 3
    run, columns = go(), recorded(folder, "fig4i")
    tip = 1e3 * run.points[:, -1] - at(run.time, columns, "tip_x_mm", "tip_y_mm", "tip_z_mm")
    twisted = np.array([writhe(points) for points in run.points])
    off = twisted - at(run.time, columns, "writhe_turns")[:, 0]
    print("fig4i    t s   tip off mm   writhe   off")
    for t in (0.3, 0.6, 0.9, 1.0, 1.1, 1.2):
        i = int(np.abs(run.time - t).argmin())
        print(f"{run.time[i]:12.2f} {np.linalg.norm(tip[i]):12.2f} {twisted[i]:8.4f} {off[i]:8.4f}")
    depth = [1e3 * Touch.of(run.series, f"post {k}").deepest.max() for k in (1, 2)]
    print("largest to 1.2 s:", _largest(run.time, "tip (mm)", np.linalg.norm(tip, axis=1)), ",", _largest(run.time, "writhe", np.abs(off)))
    print("depth in posts (mm):", *np.round(depth, 2))


def _largest(times, name, values):
    place = int(values.argmax())
    return f"{name} {values[place]:.4f} at {times[place]:.2f} s"


def main():
    """Print the comparisons that are named, or both."""
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    for name in sys.argv[2:] or ("fig4a", "fig4i"):
        {"fig4a": fig4a, "fig4i": fig4i}[name](sys.argv[1])


if __name__ == "__main__":
    main()
