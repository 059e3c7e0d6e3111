"""An elastic rod by itself: turn one of its ends, and see it leave the axis at the twist that theory gives.

Clamped at both ends and free to come closer, a rod stays straight up to the torque M = 8.987 B / L (Greenhill 1883), that is up to the
angle 8.987 B / C, and writhes beyond. Run with ``python examples/09_twisted_rod.py [--quick]``; leaves ``09_twisted_rod.png``.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

from octoctrl.sim.rod.elastic import RodSimulation
from octoctrl.sim.rod.rod import Rod
from octoctrl.sim.rod.supports import Clamp
from octoctrl.sim.rotations import rotation_matrix

RADIUS, YOUNG, SHEAR, AXIS = 0.02, 1e6, 1e6 / 1.5, (0.0, 1.0, 0.0)
BENDING, TWISTING = YOUNG * np.pi * RADIUS**4 / 4, SHEAR * np.pi * RADIUS**4 / 2
CRITICAL = 8.987 * BENDING / TWISTING


def turned(share, seconds):
    """A rod of 1 m whose tip is turned by a `share` of the critical angle within a second."""
    rod = Rod.straight(
        length=1.0, radius=RADIUS, elements=24, direction=AXIS, density=1000.0, youngs_modulus=YOUNG, shear_modulus=SHEAR,
        support="clamped", damping=8.0,
    )  # fmt: skip
    # A rotation vector is material: its third component turns about the rod's own axis.
    path = lambda t: rotation_matrix([0.0, 0.0, share * CRITICAL * min(t, 1.0)]) @ rod.frames[-1]  # noqa: E731
    sim = RodSimulation(rod, supports=[Clamp(end="tip", frame=path, slides=AXIS)])
    # A thousandth of what would bend it visibly decides to which side.
    sim.load(force_per_length=(1e-3 * BENDING, 0.0, 0.0))
    return sim, *sim.advance(seconds, samples=60)


def main(quick=False):
    figure, axes = plt.subplots(layout="constrained")
    for share in (0.9, 1.1) if quick else (0.8, 0.9, 0.97, 1.03, 1.1, 1.2):
        sim, time, points, _ = turned(share, 30.0 if quick else 60.0)
        off_axis = 1e3 * np.linalg.norm(points[:, :, [0, 2]], axis=2).max(axis=1)
        print(f"{share * CRITICAL / (2 * np.pi):.3f} turns, {share:.2f} of the critical: {off_axis[-1]:.2f} mm off the axis")
        axes.semilogy(time, off_axis, label=f"{share:.2f} of the critical twist")
    then = sim.state()
    sim.load(tip_force=(0.0, 5.0, 0.0))
    sim.advance(10.0)
    pulled = 1e3 * np.linalg.norm(sim.points[:, [0, 2]], axis=1).max()
    sim.restore(then)
    print(f"pulled straight by 5 N: {pulled:.2f} mm; and back at {sim.time:.0f} s as if nothing had been")
    axes.set(xlabel="time [s]", ylabel="largest distance from the axis [mm]")
    axes.legend(frameon=False)
    figure.savefig("09_twisted_rod.png", dpi=150)


if __name__ == "__main__":
    main(quick="--quick" in sys.argv)
