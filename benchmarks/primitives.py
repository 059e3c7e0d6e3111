"""Primitives of the full arm: each muscle group alone, its deformation with sign and size, and a picture.

Run with ``python benchmarks/primitives.py`` (about two minutes), which prints the table and writes ``docs/primitives.png``; or with
``buckling`` for the growth of the bend of an arm whose transverse muscles contract.
"""

import sys
from math import degrees
from pathlib import Path

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.plants import make_plant
from octoctrl.sim.templates import Plateau
from octoctrl.sim.topology.measures import twist, writhe

PRIMITIVES = (
    ("shortening", "LM1..8", LONGITUDINAL_GROUPS, 0.3),
    ("bending", "LM1", ("LM1",), 0.3),
    ("elongation", "TM", ("TM",), 0.3),
    ("twisting, negative", "R-OM", ("R-OM",), 0.17),
    ("twisting, positive", "L-OM", ("L-OM",), 0.17),
    ("twisting, negative", "R-OM", ("R-OM",), 0.3),
    ("twisting, positive", "L-OM", ("L-OM",), 0.3),
)
RISE, DURATION, PIECE = 0.4, 0.8, 0.05


def ring_radius(rings):
    """Mean radius (N,) of the rings' middle lines, m."""
    return np.linalg.norm(rings - rings.mean(axis=1, keepdims=True), axis=2).mean(axis=1)


def measured(plant, volume):
    """Deformation of the line through the rings' centres: the nerve cord inside may buckle, and says less.

    Length and volume over rest, turning of the tangent from base to tip (degrees) and the azimuth it turns to (LM1 at 0, LM3 at 90), twist
    and writhe in turns, mean ring radius over rest, length of the nerve cord over rest.
    """
    seen, rings = plant.observe(), plant.core.nodes()[2]
    centres = rings.mean(axis=1)
    tangents = np.diff(centres[::3], axis=0)
    spacing = np.linalg.norm(tangents, axis=1)
    tangents /= spacing[:, None]
    turned = np.cross(np.concatenate([[[0.0, 1.0, 0.0]], tangents[:-1]]), tangents).sum(axis=0)
    return {
        "length": spacing.sum() / np.ptp(plant.core.geometry.rings.points[::3, 0, 1]) - 1,
        "bend": degrees(np.linalg.norm(turned)),
        "towards": degrees(np.arctan2(turned[0], -turned[2])),
        "twist": float(twist(seen.points, -seen.frames[1:-1, 1])),
        "writhe": float(writhe(seen.points)),
        "radius": float(np.mean(ring_radius(rings) / ring_radius(plant.core.geometry.rings.points))) - 1,
        "volume": plant.core.volume() / volume - 1,
        "cord": seen.stretch.mean() - 1,
    }


def contraction(groups, level, duration=DURATION, scene=None):
    """A plant under one group at one level, with its measures every `PIECE` seconds; stops where the arm does."""
    plant = make_plant("assembly-mixed", scene=scene)
    volume, activation = plant.core.volume(), Activation(templates=(Plateau(groups=groups, level=level, rise=RISE),))
    history = [{"time": 0.0} | measured(plant, volume)]
    try:
        while plant.time < duration - 1e-9:
            plant.advance(activation, PIECE)
            history.append({"time": plant.time} | measured(plant, volume))
    except PlantUnstableError as error:
        print(f"  {error}")
    return plant, history


def table():
    """Print the table; returns the plants and histories."""
    columns = ("length", "cord", "radius", "volume")
    print(f"{'primitive':20s} {'group':7s} level   t s", *(f"{name:>8s}" for name in (*columns, "bend", "towards", "twist")))
    runs = []
    for name, label, groups, level in PRIMITIVES:
        plant, history = contraction(groups, level)
        runs.append((name, label, level, plant, history))
        last = history[-1]
        cells = [f"{last[column]:+8.1%}" for column in columns] + [f"{last['bend']:8.1f}"]
        cells += [f"{last['towards']:8.0f}" if last["bend"] > 1 else f"{'-':>8s}", f"{last['twist']:+8.3f}"]
        print(f"{name:20s} {label:7s} {level:5.2f} {last['time']:5.2f}", *cells, flush=True)
    return runs


COLOURS = {"TM": "tab:orange", "R-OM": "tab:purple", "L-OM": "tab:green", "LM1": "tab:red", "LM1..8": "tab:brown"}
CURVES = (("length", "length change, %", 100), ("bend", "turning of the tangent, degrees", 1), ("twist", "twist, turns", 1))


def picture(runs, path):
    """Side views of the arms above their length, bend and twist in time."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.collections import LineCollection

    shown = [("rest", "", 0.3, make_plant("assembly-mixed"), None), *(run for run in runs if run[2] == 0.3)]
    figure = plt.figure(figsize=(11, 7.5), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(1.2, 1))
    for axes, (name, label, level, plant, _) in zip(above.subplots(1, len(shown), sharey=True), shown, strict=True):
        straight, oblique, rings = (nodes * 1e3 for nodes in plant.core.nodes())
        axes.add_collection(LineCollection(rings[::2][:, [*range(rings.shape[1]), 0]][..., [0, 1]], colors="0.75", linewidths=0.4))
        for helix, colour in ((oblique[0], "tab:green"), (oblique[4], "tab:purple")):
            axes.plot(helix[:, 0], helix[:, 1], color=colour, linewidth=0.7)
        axes.plot(straight[1][:, 0], straight[1][:, 1], color="tab:red", linewidth=1.2)
        axes.plot(straight[0][:, 0], straight[0][:, 1], color="black", linewidth=1.0)
        axes.set(xlim=(-35, 100), ylim=(-5, 215), aspect="equal")
        axes.set_title(f"{name}\n{label} {level}" if label else "rest\n", fontsize=9)
        axes.set_xlabel("x, mm", fontsize=8)
        axes.tick_params(labelsize=7)
    for axes, (key, label, factor) in zip(below.subplots(1, len(CURVES)), CURVES, strict=True):
        for _, group, level, _, history in runs:
            times, values = [row["time"] for row in history], [factor * row[key] for row in history]
            axes.plot(times, values, color=COLOURS[group], linestyle="-" if level == 0.3 else "--", label=f"{group} {level}")
        axes.set(xlabel="time, s", ylabel=label)
        if key == "length":
            axes.legend(fontsize=7)
    figure.savefig(path, dpi=130)


def buckling():
    """Print how the arm leaves its axis under transverse contraction, after a push of the tip to +x."""
    print("distance of the tip from the axis, mm; stretch of the nerve cord; narrowest ring over rest; pressure at ring 170, kPa; at")
    times = np.arange(0.2, 0.81, 0.1)
    print(f"{'TM':>5s} {'push mm/s':>10s} {'LM':>5s}", *(f"{f'{time:.1f} s':>25s}" for time in times))
    for level, push, stiffen in (
        (0.1, 1e-3, 0.0),
        (0.2, 1e-3, 0.0),
        (0.2, 1.0, 0.0),
        (0.3, 1e-3, 0.0),
        (0.3, 1e-3, 0.05),
        (0.3, 1e-3, 0.15),
    ):
        plant = make_plant("assembly")
        plant.core.rods.straight(R.V1, nodes=True)[:] += push * 1e-3 * np.linspace(0, 1, plant.elements + 1) ** 2
        templates = (Plateau(groups=("TM",), level=level, rise=RISE), Plateau(groups=LONGITUDINAL_GROUPS, level=stiffen, rise=RISE))
        rest, cells = ring_radius(plant.core.nodes()[2]), []
        try:
            for time in times:
                plant.advance(Activation(templates=templates[: 1 + bool(stiffen)]), round(time - plant.time, 6))
                seen = plant.observe()
                aside = np.hypot(seen.points[-1, 0], seen.points[-1, 2]) * 1e3
                narrowest = (ring_radius(plant.core.nodes()[2]) / rest).min()
                cells.append(f"{aside:8.1e} {seen.stretch.mean() - 1:+6.1%} {narrowest:4.2f} {plant.core.pressure()[170] / 1e3:4.2f}")
        except PlantUnstableError as error:
            cells.append(str(error))
        print(f"{level:5.2f} {push:10.0e} {stiffen:5.2f}", *cells, flush=True)


def main():
    if "buckling" in sys.argv[1:]:
        buckling()
        return
    path = Path(__file__).parent.parent / "docs" / "primitives.png"
    picture(table(), path)
    print(f"picture: {path.relative_to(Path(__file__).parent.parent)}")


if __name__ == "__main__":
    main()
