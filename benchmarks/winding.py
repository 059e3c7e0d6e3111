"""Twist against the winding angle of the oblique fibres, for a tapered and an untapered arm, on the full arm and on the one-rod plant.

Run with ``python benchmarks/winding.py`` (some three minutes); prints a table and writes ``docs/winding.png``. The left-handed helices are
held at a moderate level for a second. The full arm has coarse rings, which helices cross between nodes, so that any pitch fits; twice as
many helix elements show how well steep helices are resolved. The pitch is constant, so that the angle of a tapered arm falls towards the
tip: its values are drawn against the angle at the base and against the mean along the arm.
"""

from dataclasses import dataclass, replace
from math import radians, tan, tau
from pathlib import Path

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.anatomy import OCTOPUS
from octoctrl.sim.body.arm import Arm, oblique_angle
from octoctrl.sim.body.grid import AssemblyGrid
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.plants import Plant, make_plant
from octoctrl.sim.templates import Plateau
from octoctrl.sim.topology.measures import twist, writhe

HELIX_NODES = {2: 0.0, 4: 70.0}
"""Helix nodes per ring, and from which angle on: at smaller ones the slack helices of the other hand flutter with 4."""
ANGLES = np.array([30.0, 40.0, 50.0, 55.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0])
LEVEL, HOLD = 0.17, 1.0
TAPERS = {"tapered 12 : 1": 12.0, "untapered": 1.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class WoundArm(Arm):
    """An octopus arm whose helices may have any pitch and number of nodes per ring."""

    helix_nodes: int

    @property
    def anatomy(self):
        """The octopus arm's, on coarse rings and with so many helix nodes per ring."""
        return replace(OCTOPUS, grid=AssemblyGrid(rings=180, ring_nodes=8, helix_nodes=self.helix_nodes, between=True))


def pitch(taper, angle):
    """Pitch (m) of a helix that winds at `angle` (degrees) at the base."""
    return tau * float(Arm(taper=taper).section(0.0).oblique_offset) / tan(radians(angle))


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
    """Angle at the base, mean angle (degrees) and what `hold` gives, for every angle."""
    for angle in ANGLES[ANGLES >= HELIX_NODES[helix_nodes]]:
        arm = WoundArm(taper=taper, helix_nodes=helix_nodes, oblique_pitch=pitch(taper, angle))
        mean = np.degrees(np.arctan(tau * arm.section(np.linspace(0, arm.length, 200)).oblique_offset / arm.oblique_pitch)).mean()
        try:
            yield angle, mean, *hold(make_plant("assembly", arm, dt=5e-5))
        except PlantUnstableError as error:
            print(f"  {angle:.1f} degrees: {error}")
            yield angle, mean, *4 * (np.nan,)


def one_rod(taper):
    """Angle at the base (degrees) and what `hold` gives, on the one-rod plant."""
    for angle in ANGLES:
        try:
            yield angle, *hold(Plant(Arm(taper=taper, oblique_pitch=pitch(taper, angle))))
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
        for helix_nodes, style in zip(HELIX_NODES, ("o-", "x"), strict=True):
            print(f"  {helix_nodes} helix nodes per ring")
            rows = np.array(list(full_arm(taper, helix_nodes)))
            for row in rows:
                print("  {:6.1f} {:6.1f} {:8.3f} {:8.3f} {:8.3f}".format(*row[:5]), f"{row[5] * 1e3:8.1f}", flush=True)
            angles, means, turns = rows[np.isfinite(rows[:, 3])][:, [0, 1, 3]].T
            print(f"  largest twist {turns.max():.2f} at {peak(angles, turns):.1f} degrees at the base, {peak(means, turns):.1f} mean")
            label = f"full arm, {name}" if style == "o-" else None
            axes.plot(angles, turns, style, color=color, label=label)
            if taper != 1.0 and style == "o-":
                axes.plot(means, turns, "o--", color=color, alpha=0.4, label=f"full arm, {name}, against the mean angle")
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
