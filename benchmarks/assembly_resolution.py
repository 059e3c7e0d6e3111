"""The full arm with fewer and with more rings: what another resolution costs and what it changes.

Run with ``python benchmarks/assembly_resolution.py`` (half a minute) for the first 0.6 s of the published coil programme, with ``fine`` for
360 rings besides (a minute more), or with ``full`` for the whole programme of 7 s at oblique level 0.17 (two minutes). Prints processor
time per simulated second, and twist, lifted writhe, their sum (link, without its jumps where the arm crosses itself) and shortening
against the published 180 rings and against 360: greatest and root-mean-square difference, in turns or mm and in percent of the
reference's greatest value.
"""

import sys
import time

import numpy as np
from assembly import programme

from octoctrl.sim.assembly import AssemblyPlant
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.topology import measure

COARSE, PUBLISHED, FINE = (72, 108, 144), 180, 360
TRACES = ("Lk", "Wr", "Tw", "shortening")


def run(rings, oblique, duration):
    """The plant, its `TRACES` (4, T) in turns and mm, and processor seconds per simulated second."""
    plant, activation = AssemblyPlant(rings=rings), programme(oblique)
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
    counts = (*COARSE, PUBLISHED, FINE) if "fine" in words else (*COARSE, PUBLISHED)
    runs = {}
    print(f"oblique level {oblique}, {duration} s")
    print("rings  elements  step us  processor s per simulated s      Lk      Wr      Tw  shortening mm")
    for rings in counts:
        try:
            runs[rings] = plant, traces, cost = run(rings, oblique, duration)
        except PlantUnstableError as error:
            print(f"{rings:5d}  {error}")
            continue
        end = " ".join(f"{value:7.3f}" for value in traces[:, -1])
        print(f"{rings:5d} {plant.geometry.elements:9d} {plant.h * 1e6:8.1f} {cost:28.2f}  {end}", flush=True)
    for reference in [count for count in (PUBLISHED, FINE) if count in runs]:
        print(f"\nagainst {reference} rings: greatest and rms difference")
        for rings in [count for count in runs if count != reference]:
            print(f"{rings:5d}  {compare(runs[rings][1], runs[reference][1])}")
    if len(runs) > 1:
        elements, per_step = zip(*((plant.geometry.elements, cost * plant.h) for plant, _, cost in runs.values()), strict=True)
        print(f"\ntime per step grows as the number of elements to the power {np.polyfit(np.log(elements), np.log(per_step), 1)[0]:.2f}")


if __name__ == "__main__":
    main(sys.argv[1:])
