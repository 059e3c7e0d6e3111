"""Speed and accuracy of the assembly of 197 rods on the first 0.6 s of the published coil programme.

Run with ``python benchmarks/assembly.py`` (about a minute), or with ``full`` for the whole programme of 7 s. Prints the time per step by
part, seconds of processor time per simulated second at several steps, and length and twist against the converged run of an independent
implementation of the same equations (4e-5 s). Times belong to the machine that is named; they may be divided by those of another code only
if that has run beside this one, on the same machine and in the same hour.
"""

import sys
import time

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.assembly.hydrostat_terms import hydrostat_terms
from octoctrl.sim.assembly.parts import whole
from octoctrl.sim.assembly.stepping import mover
from octoctrl.sim.assembly.terms import Step, by_name
from octoctrl.sim.plants import make_plant
from octoctrl.sim.templates import Plateau
from octoctrl.sim.topology.measures import twist, writhe
from octoctrl.tables import machine

INDEPENDENT = {
    0.1: (196.333, -0.06366),
    0.2: (194.337, -0.34444),
    0.3: (194.370, -0.69523),
    0.4: (194.020, -1.02835),
    0.6: (193.265, -1.43478),
}


def programme(oblique=0.3):
    """The published coil programme, with its oblique level free."""
    oblique_end, straight_end = 0.2 * 357 / 360, 0.2 * 178 / 180
    return Activation(
        templates=(
            Plateau(groups=("R-OM",), level=oblique, offset=3.0, window=(0.0, oblique_end)),
            Plateau(groups=("LM1", "LM2", "LM8"), level=0.3, onset=1.5, rise=4.0, window=(0.0, straight_end)),
            Plateau(groups=("L-OM",), level=oblique, onset=4.1, rise=1.0, window=(0.0, oblique_end)),
        )
    )


def shape(plant):
    """Length (mm), twist and writhe (turns) now."""
    seen = plant.observe()
    length = np.linalg.norm(np.diff(seen.points, axis=0), axis=1).sum() * 1e3
    return length, float(twist(seen.points, -seen.frames[1:-1, 1])), float(writhe(seen.points))


def by_part(plant, repeats=60):
    """Microseconds per step of each term, best of `repeats` calls on the present state."""
    rods, core = plant.core.rods, plant.core
    terms, arm = by_name(hydrostat_terms(core.grid, plant.arm.anatomy.traits)), whole(core.grid)
    step = Step(plant.h, core._laws, core._drag, rods.ring_index, rods.helix_index)
    move = mover(core.grid)
    calls = {name: lambda term=term: term(rods.flat, 0.5, step, arm) for name, term in terms.items()}
    calls["drift"] = lambda: move(rods.flat, arm, plant.h)
    state = rods.flat.copy()
    times = {}
    for label, call in calls.items():
        best = np.inf
        for _ in range(repeats):
            rods.flat[:] = state
            for _ in range(2):
                begin = time.perf_counter()
                call()
                best = min(best, time.perf_counter() - begin)
        times[label] = best * 1e6
    rods.flat[:] = state
    return times


def main():
    print(", ".join(f"{name} {value}" for name, value in machine().items()), end="\n\n")
    plant = make_plant("assembly")
    activation = programme()
    plant.advance(activation, 0.2)
    print("microseconds per step by term")
    for label, value in by_part(plant).items():
        print(f"  {label:34s} {value:8.1f}")
    for step in (5e-5, 2.5e-5):
        plant = make_plant("assembly", dt=step)
        print(f"\nstep {plant.h:.2g} s: t, length mm, twist, (independent), processor s per simulated s")
        before = 0.0
        for instant, reference in INDEPENDENT.items():
            begin = time.process_time()
            plant.advance(activation, round(instant - before, 6))
            cost = (time.process_time() - begin) / (instant - before)
            before = instant
            length, turns, _ = shape(plant)
            print(f"  {instant:.1f} {length:9.3f} {turns:9.5f}  {reference}  {cost:6.2f}", flush=True)
    if "full" in sys.argv[1:]:
        plant = make_plant("assembly")
        begin = time.process_time()
        print("\nwhole programme, oblique level 0.17: t, length mm, twist, writhe, volume ml")
        while plant.time < 7.0 - 1e-9:
            plant.advance(programme(0.17), 0.2)
            print(f"  {plant.time:.1f}", *(f"{value:9.4f}" for value in (*shape(plant), plant.core.volume() * 1e6)), flush=True)
        print(f"  {time.process_time() - begin:.1f} s for 7 simulated seconds")


if __name__ == "__main__":
    main()
