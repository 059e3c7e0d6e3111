"""The published programmes of figure 3 on the full arm: reaching, a planar pulse, and a corkscrew.

Run with ``python benchmarks/assembly_programmes.py`` (coarse rings, four minutes); names of programmes choose among them, and the name of
a plant another one; the rod gets even elements, of which a narrow front needs many. Prints how far each came, the samples done at a part of
the step, volume, and the way of the bend, by two measures: the packet, the centroid of |k|^4 with the curvature k over 30 mm, and
what is bent most (the study's, of largest |k|), which jumps from hump to hump. Speeds are those in the laboratory, over 50 ms.
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
RELEASED, FROM, BACK = 3.1, 0.080, 0.005
"""When the bend is let go (s), the place (m) that its way begins at, left for the last time, and how near (m) to the furthest it ends."""
OVER, POINTS, REACH, POWER = 0.05, 401, 15e-3, 4
"""Window of speeds (s), even points along the arm, distance (m) on either side over which it turns, power of that curvature."""
BEFORE = 0.03
"""Length (m) at the base that no bend leaves."""
ROD = {"elements": 240, "grading": 0.0}


def at(places, stations, values):
    """Values (T, points, 3) at places (T,) along the arm, linear in between."""
    return np.stack([[np.interp(s, stations, value[:, c]) for c in range(3)] for s, value in zip(places, values, strict=True)])


def bend(recording, arm, edges):
    """Places (T,) along the arm, m, of the packet and of what is bent most, and where they are (T, 3), m."""
    stations = np.linspace(0.0, arm.length, POINTS)
    line = np.stack([np.stack([np.interp(stations, edges, axis) for axis in points.T], axis=1) for points in recording.points])
    unit, wide = np.diff(line, axis=1), round(REACH / stations[1])
    unit /= np.linalg.norm(unit, axis=2, keepdims=True)
    turn, middle = np.linalg.norm(unit[:, 2 * wide :] - unit[:, : -2 * wide], axis=2), stations[wide : POINTS - 1 - wide] + stations[1] / 2
    weight = turn**POWER * (middle > BEFORE) + 1e-30
    places = weight @ middle / weight.sum(axis=1), middle[turn.argmax(axis=1)]
    return [(place, at(place, stations, line)) for place in places]


def main(words):
    kinds = [word for word in words if word in PLANTS] or ["assembly-coarse"]
    for name in [word for word in words if word in NAMES] or NAMES:
        programme = tasks.programme(name)
        arm = Arm.octopus(**ROD if kinds[0] == "rod" else {})
        plant, begin, said = make_plant(kinds[0], arm, programme.scene, record_every=1), time.process_time(), ""
        try:
            recording = plant.advance(programme.activation, programme.duration)
        except PlantUnstableError as error:
            recording, said = error.recording, f"; {error}"
        spent, end = time.process_time() - begin, recording.time[-1]
        kept = [np.abs(recording.series[key] - 1).max() for key in ("volume", "slab_volume") if key in recording.series]
        print(f"{name} on {kinds[0]}: {end:.2f} of {programme.duration:g} s, {plant.retried} samples at a part of the step{said}")
        print(
            f"  volume, slab off: {', '.join(f'{value:.2%}' for value in kept) or '-'}; {spent / end:.2f} processor s per s",
            end="; out of plane ",
        )
        print(f"{1e3 * np.abs(recording.points[..., 2]).max():.2f} mm; at the end twist", end=" ")
        print(f"{twist(recording.points[-1], -recording.frames[-1, 1:-1, 1]):+.3f}, writhe {writhe(recording.points[-1]):+.3f}")
        window = round(OVER / plant.sample_interval)
        found = [
            (place, np.linalg.norm(where[window:] - where[:-window], axis=1) / OVER) for place, where in bend(recording, arm, plant.edges)
        ]
        first = window // 2
        for k in range(np.searchsorted(recording.time, RELEASED - 0.1), len(found[0][1]) + first, window):
            told = (f"{1e3 * place[k]:5.1f} mm, {100 * speed[k - first]:5.1f} cm/s" for place, speed in found)
            print(f"  {recording.time[k]:.2f} s: packet at {'; bent most at '.join(told)}", flush=True)
        packet, speed = found[0]
        time_there, along = (values[first : first + len(speed)] for values in (recording.time, packet))
        let_go = int(np.argmax(time_there > RELEASED))
        end = let_go + int(np.argmax(along[let_go:] > along[let_go:].max() - BACK))
        begin = int(np.flatnonzero(along[:end] <= FROM)[-1])
        gone = slice(begin, end + 1)
        print(f"  packet outward: from {1e3 * along[gone][0]:.0f} to {1e3 * along[gone][-1]:.0f} mm,", end=" ")
        print(f"from {time_there[gone][0]:.2f} to {time_there[gone][-1]:.2f} s, peak {100 * speed[gone].max():.0f} cm/s,", end=" ")
        print(f"mean {100 * speed[gone].mean():.0f} cm/s")


if __name__ == "__main__":
    main(sys.argv[1:])
