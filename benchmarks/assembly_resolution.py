"""The full arm with coarse and with finer rings: what another resolution costs and what it changes.

Run with ``python benchmarks/assembly_resolution.py`` (half a minute) for the first 0.6 s of the published coil programme, with ``fine`` for
360 rings besides (a minute more), or with ``full`` for the whole programme of 7 s at oblique level 0.17 (two minutes). Prints processor
time per simulated second, and link, lifted writhe, twist and shortening against the published 180 rings of 40 nodes: greatest and
root-mean-square difference, in turns or mm and in percent of the greatest value. Link is the sum of lifted writhe and twist, without its
jumps where the arm crosses itself.
"""

import sys
import time

import numpy as np
from assembly import programme

from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.plants import make_plant
from octoctrl.sim.topology.measures import measure

BUILDS = {"180 x  8": {"ring_nodes": 8}, "180 x 16": {"ring_nodes": 16}, "180 x 24": {"ring_nodes": 24}, "180 x 40": {}}
PUBLISHED = "180 x 40"
FINE = {"360 x 80": {"rings": 360}}
TRACES = ("Lk", "Wr", "Tw", "shortening")


def run(options, oblique, duration):
    """The plant, its `TRACES` (4, T) in turns and mm, and processor seconds per simulated second."""
    plant, activation = make_plant("assembly", **options), programme(oblique)
    # The first call compiles.
    pieces = [plant.advance(activation, 0.01)]
    begin = time.process_time()
    while plant.time < duration - 1e-9:
        pieces.append(plant.advance(activation, min(0.2, round(duration - plant.time, 6))))
    cost = (time.process_time() - begin) / (duration - 0.01)
    instants, points, frames = (np.concatenate([getattr(piece, name)[1:] for piece in pieces]) for name in ("time", "points", "frames"))
    trace = measure(instants, points, frames)
    length = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    shortening = 1e3 * (plant.arm.length - length)
    return plant, np.stack([trace.lifted_writhe + trace.twist, trace.lifted_writhe, trace.twist, shortening]), cost


def compare(found, reference):
    """One line of differences between traces; percentages where there is anything to compare with."""
    cells = []
    for name, mine, theirs in zip(TRACES, found, reference, strict=True):
        apart, scale = np.abs(mine - theirs), np.abs(theirs).max()
        most, rms = apart.max(), np.sqrt(np.mean(apart**2))
        share = f" ({100 * most / scale:4.1f} {100 * rms / scale:4.1f} %)" if scale > 0.05 else ""
        cells.append(f"{name} {most:6.3f} {rms:6.3f}{share}")
    return "   ".join(cells)


def main(words):
    oblique, duration = (0.17, 7.0) if "full" in words else (0.3, 0.6)
    builds = BUILDS | (FINE if "fine" in words else {})
    runs = {}
    print(f"oblique level {oblique}, {duration} s")
    print("rings x nodes  elements  step us  processor s per simulated s      Lk      Wr      Tw  shortening mm")
    for name, options in builds.items():
        try:
            runs[name] = plant, traces, cost = run(options, oblique, duration)
        except PlantUnstableError as error:
            print(f"{name:13s}  {error}")
            continue
        end = " ".join(f"{value:7.3f}" for value in traces[:, -1])
        print(f"{name:13s} {plant.core.geometry.elements:9d} {plant.h * 1e6:8.1f} {cost:28.2f}  {end}", flush=True)
    print(f"\nagainst {PUBLISHED}: greatest and rms difference, cost over its cost")
    for name in [name for name in runs if name != PUBLISHED]:
        print(f"{name}  {compare(runs[name][1], runs[PUBLISHED][1])}   {runs[name][2] / runs[PUBLISHED][2]:.2f}")
    if len(runs) > 1:
        elements, per_step = zip(*((plant.core.geometry.elements, cost * plant.h) for plant, _, cost in runs.values()), strict=True)
        print(f"\ntime per step grows as the number of elements to the power {np.polyfit(np.log(elements), np.log(per_step), 1)[0]:.2f}")


if __name__ == "__main__":
    main(sys.argv[1:])
