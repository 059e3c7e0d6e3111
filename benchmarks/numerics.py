"""The two numerics of the full arm on the same programme: twist, length, and the shear of the active oblique muscles.

Run with ``python benchmarks/numerics.py`` (a minute); prints a table and writes ``docs/numerics.png``. R-OM is held at 0.3 as in the
published coil programme. Dots are a recorded run of the published code (Tekinalp et al. 2024).
"""

from pathlib import Path

import numpy as np
from assembly import programme, shape

from octoctrl.sim.assembly.layout import AssemblyRow
from octoctrl.sim.plants import make_plant

DURATION, PIECE = 1.0, 0.02
RECORDED = {0.1: (194.852, -0.1014), 0.2: (194.617, -0.5226), 0.3: (195.102, -0.8943), 0.4: (194.833, -0.9971), 0.6: (194.840, -1.0269)}
"""Time (s): length (mm) and twist (turns)."""


def shear_angle(plant):
    """Mean angle (degrees) between director and tangent in the right-handed helices."""
    points = np.stack([plant.core.rods.oblique(AssemblyRow.X1 + i, nodes=True)[4:] for i in range(3)], axis=-1)
    director = np.stack([plant.core.rods.oblique(AssemblyRow.Q31 + i)[4:] for i in range(3)], axis=-1)
    tangent = np.diff(points, axis=1)
    along = np.sum(director * tangent, axis=-1) / np.linalg.norm(tangent, axis=-1)
    return float(np.degrees(np.arccos(np.clip(along, -1.0, 1.0))).mean())


def run(**options):
    """Rows (T, 4) of time (s), twist (turns), length (mm) and shear angle (degrees)."""
    plant, rows = make_plant("assembly", **options), []
    while plant.time < DURATION - 1e-9:
        plant.advance(programme(), PIECE)
        length, turns, _ = shape(plant)
        rows.append((plant.time, turns, length, shear_angle(plant)))
    return np.array(rows)


def main():
    from matplotlib.figure import Figure

    runs = {"default, 50 µs": run(), "published, 10 µs": run(paper_compatible=True, sample_interval=2e-3)}
    print("time s, and for either numerics: twist, length mm, shear of R-OM in degrees")
    for rows in zip(*runs.values(), strict=True):
        print(f"{rows[0][0]:5.2f}", *("{:9.4f} {:9.3f} {:7.2f}".format(*row[1:]) for row in rows))
    figure = Figure(figsize=(10, 3.2), layout="constrained")
    labels = ("twist (turns)", "length (mm)", "shear of the active\noblique muscles (degrees)")
    for column, (axes, label) in enumerate(zip(figure.subplots(1, 3), labels, strict=True), start=1):
        for (name, rows), color in zip(runs.items(), ("tab:blue", "tab:orange"), strict=True):
            axes.plot(rows[:, 0], rows[:, column], color=color, label=name)
        if column < 3:
            axes.plot(list(RECORDED), [pair[2 - column] for pair in RECORDED.values()], "o", color="0.3", markersize=4, label="recorded")
        axes.set(xlabel="time (s)", ylabel=label)
        axes.spines[["top", "right"]].set_visible(False)
    figure.axes[0].legend(frameon=False, fontsize="small")
    path = Path(__file__).parent.parent / "docs" / "numerics.png"
    figure.savefig(path, dpi=130)
    print(path)


if __name__ == "__main__":
    main()
