"""The published programmes of figure 3 on the full arm: reaching, a planar pulse, and a corkscrew.

Run with ``python benchmarks/assembly_programmes.py`` (coarse rings, four minutes); names of programmes choose among them, and the name of
a plant another one. Prints how far each came, the samples done at a part of the step, volume, and the way of the bend: the place along the
arm where the line through the rings' centres is bent most, and how fast that place moves in the laboratory, over 50 ms.
"""

import sys
import time

import numpy as np

from octoctrl import tasks
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.plants import PLANTS, make_plant
from octoctrl.sim.topology.measures import twist, writhe

NAMES = ("fig3a", "fig3b", "fig3c")
RELEASED, ENDS = 3.0, 10
"""When the bend is let go (s), and elements at either end in which no bend is looked for."""
OVER = 0.05


def bend(recording):
    """Element (T,) of the greatest curvature of the cord, and its place (T, 3), m."""
    edges = np.diff(recording.points, axis=1)
    unit = edges / np.linalg.norm(edges, axis=2, keepdims=True)
    # Over five elements: a bend, not a kink.
    turn = np.linalg.norm(unit[:, 5:] - unit[:, :-5], axis=2)
    at = ENDS + turn[:, ENDS:-ENDS].argmax(axis=1) + 3
    return at, recording.points[np.arange(len(at)), at]


def main(words):
    kinds = [word for word in words if word in PLANTS] or ["assembly-coarse"]
    for name in [word for word in words if word in NAMES] or NAMES:
        programme = tasks.programme(name)
        plant, begin, said = make_plant(kinds[0], Arm.octopus(), programme.scene, record_every=1), time.process_time(), ""
        try:
            recording = plant.advance(programme.activation, programme.duration)
        except PlantUnstableError as error:
            recording, said = error.recording, f"; {error}"
        spent, end = time.process_time() - begin, recording.time[-1]
        volume, slab = (np.abs(recording.series[key] - 1).max() for key in ("volume", "slab_volume"))
        print(f"{name} on {kinds[0]}: {end:.2f} of {programme.duration:g} s, {plant.retried} samples at a part of the step{said}")
        print(f"  volume {volume:.2%}, slab {slab:.2%} off; {spent / end:.1f} processor s per s; out of plane", end=" ")
        print(f"{1e3 * np.abs(recording.points[..., 2]).max():.2f} mm; at the end twist", end=" ")
        print(f"{twist(recording.points[-1], -recording.frames[-1, 1:-1, 1]):+.3f}, writhe {writhe(recording.points[-1]):+.3f}")
        at, place = bend(recording)
        window = round(OVER / plant.sample_interval)
        speed = np.linalg.norm(place[window:] - place[:-window], axis=1) / OVER
        middle, along = recording.time[window // 2 : window // 2 + len(speed)], 1e3 * plant.edges[at]
        for instant in np.arange(RELEASED - 0.2, end + 1e-9, 0.1):
            k, m = (int(np.argmin(np.abs(times - instant))) for times in (recording.time, middle))
            print(f"  {recording.time[k]:.2f} s: bend at {along[k]:5.1f} mm, {100 * speed[m]:5.1f} cm/s", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
