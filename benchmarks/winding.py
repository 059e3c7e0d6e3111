"""Twist against the winding angle of the oblique fibres, for a tapered and an untapered arm, on the full arm and on the one-rod plant.

Run with ``python benchmarks/winding.py`` (some five minutes); prints a table and writes ``docs/winding.png``. The left-handed helices are
held at a moderate level for a second. A helix must meet a node of every ring, so that its pitch takes steps; 60 rings of 40 nodes, each a
bundle of three published rings, give ten angles from 31 to 83 degrees. Left out are pitches at which every crossing falls on a longitudinal
muscle (each 45 degrees of every ring): they twist otherwise than their neighbours. Steep helices are not resolved, so all is done with 2, 4
and 6 helix nodes per ring; the line is their mean, the band their range. The pitch is constant, so that the angle of a
tapered arm is that at its base and falls towards the tip.
"""

from dataclasses import dataclass
from math import radians, tan, tau
from pathlib import Path

import numpy as np

from octoctrl.sim.activation import Activation, Plateau
from octoctrl.sim.anatomy import Anatomy
from octoctrl.sim.arm import Arm, oblique_angle
from octoctrl.sim.assembly import AssemblyPlant
from octoctrl.sim.assembly_layout import AssemblyGrid
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.plant import Plant
from octoctrl.sim.topology import twist, writhe

RINGS, RING_NODES, HELIX_NODES = 60, 40, (2, 4, 6)
STEPS = (1, 2, 3, 4, 6, 7, 8, 9, 11, 14)
"""Ring nodes that a helix advances by from ring to ring; 5 and 10 would hit longitudinal muscles only."""
ANGLES = np.arange(30.0, 86.0, 2.5)
LEVEL, HOLD = 0.17, 1.0
TAPERS = {"tapered 12 : 1": 12.0, "untapered": 1.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class WoundArm(Arm):
    """An octopus arm on a grid of its own."""

    helix_nodes: int

    @property
    def anatomy(self):
        """The octopus arm's, on bundled rings and with so many helix nodes per ring."""
        return Anatomy(grid=AssemblyGrid(rings=RINGS, ring_nodes=RING_NODES, helix_nodes=self.helix_nodes, bundle=3.0))


def hold(plant):
    """Twist (turns) at 0.8 and 1.0 of the time, and writhe and length (m) at the end."""
    pull = Plateau(groups=("L-OM",), level=LEVEL, rise=0.3, window=(0.0, 0.99 * plant.arm.length))
    turns = []
    for part in (0.8, 0.2):
        plant.advance(Activation(templates=(pull,)), part * HOLD)
        seen = plant.observe()
        turns.append(float(twist(seen.points, -seen.frames[1:-1, 1])))
    return *turns, float(writhe(seen.points)), np.linalg.norm(np.diff(seen.points, axis=0), axis=1).sum()


def full_arm(taper, helix_nodes):
    """Angle at the base, mean angle (degrees) and what `hold` gives, for every pitch on the grid."""
    for step in STEPS:
        arm = WoundArm(taper=taper, helix_nodes=helix_nodes, oblique_pitch=RING_NODES * Arm().length / RINGS / step)
        angles = np.degrees(np.arctan(tau * arm.section(np.linspace(0, arm.length, 200)).oblique_offset / arm.oblique_pitch))
        try:
            yield angles[0], angles.mean(), *hold(AssemblyPlant(arm, dt=4e-5))
        except PlantUnstableError as error:
            print(f"  {angles[0]:.1f} degrees: {error}")
            yield angles[0], angles.mean(), *4 * (np.nan,)


def one_rod(taper):
    """Angle at the base (degrees) and what `hold` gives, on the one-rod plant."""
    reach = float(Arm(taper=taper).section(0.0).oblique_offset)
    for angle in ANGLES:
        try:
            yield angle, *hold(Plant(Arm(taper=taper, oblique_pitch=tau * reach / tan(radians(angle)))))
        except PlantUnstableError as error:
            print(f"  {angle:.1f} degrees: {error}")


def peak(angles, turns):
    """Angle of the largest twist: of the parabola through it and its neighbours."""
    best = int(np.clip(np.nanargmax(turns), 1, len(turns) - 2))
    near = slice(best - 1, best + 2)
    curve = np.polyfit(angles[near], turns[near], 2)
    return -curve[1] / (2 * curve[0])


def main():
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.5, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.axvspan(65, 75, facecolor="0.93", label="maximum expected: 70° ± 5°")
    for (name, taper), color in zip(TAPERS.items(), ("tab:blue", "tab:orange"), strict=True):
        print(f"{name}, full arm: angle at the base and its mean along the arm, twist at 0.8 and 1 s, writhe, length mm")
        turns = []
        for helix_nodes in HELIX_NODES:
            print(f"  {helix_nodes} helix nodes per ring")
            rows = np.array(list(full_arm(taper, helix_nodes)))
            for row in rows:
                print("  {:6.1f} {:6.1f} {:8.3f} {:8.3f} {:8.3f}".format(*row[:5]), f"{row[5] * 1e3:8.1f}", flush=True)
            print(f"  largest twist {np.nanmax(rows[:, 3]):.2f} at {peak(rows[:, 0], rows[:, 3]):.1f} degrees")
            turns.append(rows[:, 3])
        angles, mean = rows[:, 0], np.nanmean(turns, axis=0)
        print(f"  of the mean: {mean.max():.2f} at {peak(angles, mean):.1f} degrees")
        axes.plot(angles, mean, "o-", color=color, label=f"full arm, {name}")
        axes.fill_between(angles, np.nanmin(turns, axis=0), np.nanmax(turns, axis=0), color=color, alpha=0.2, linewidth=0)
        rod = np.array(list(one_rod(taper)))
        best = int(np.argmax(rod[:, 2]))
        print(f"{name}, one rod: largest twist {rod[best, 2]:.2f} at {rod[best, 0]:.1f} degrees")
        axes.plot(rod[:, 0], rod[:, 2], ":", color=color, label=f"one rod, {name}")
    axes.set(xlabel="winding angle at the base (degrees from the axis)", ylabel=f"twist after {HOLD:g} s of L-OM {LEVEL:g} (turns)")
    axes.legend(frameon=False, fontsize="small")
    path = Path(__file__).parent.parent / "docs" / "winding.png"
    figure.savefig(path, dpi=130)
    print(path, f"(published winding: {oblique_angle(Arm(), 0.0):.1f} degrees)")


if __name__ == "__main__":
    main()
