"""What objects cost: process time of a step with objects over that without, measured alternately in one run.

Run with ``python benchmarks/contact.py`` (rod, seconds) or ``python benchmarks/contact.py assembly-coarse`` (a minute after compilation).
Far objects are out of reach, one or a hundred; the wrapped arm lies round a post; "cage" is a post that is held, and 99 objects around it.
Every ratio is the median over rounds, each of which runs all cases one after the other.
"""

import sys
from dataclasses import replace
from time import process_time

import numpy as np

import octoctrl as oc
from octoctrl.sim.contact.surroundings import Touch
from octoctrl.sim.scene.objects import Capsule, Sphere
from octoctrl.sim.scene.scene import Scene

POST = Capsule(name="post", radius=8e-3, length=0.08, position=(0.0, 0.07, -0.022), axis=(1, 0, 0))
CURL = oc.Activation(templates=(oc.Plateau(groups=("LM6", "LM7", "LM8"), level=0.3, rise=3.0, window=(0.05, 0.2)),))
ROUNDS = 15


def spheres(count, distance):
    """So many small balls on a sphere of that radius (m)."""
    draw = np.random.default_rng(1).normal(size=(count, 3))
    places = distance * draw / np.linalg.norm(draw, axis=1, keepdims=True)
    return tuple(Sphere(name=f"ball {number}", radius=4e-3, position=tuple(map(float, place))) for number, place in enumerate(places))


def cases():
    """Objects by the name of the case, and whether the arm lies on the post."""
    cage = tuple(replace(item, position=(item.position[0], item.position[1] + 0.1, item.position[2])) for item in spheres(99, 0.3))
    return {
        "none": ((), True),
        "one far": (spheres(1, 0.5), True),
        "100 far": (spheres(100, 0.5), True),
        "wrapped": ((POST,), True),
        "cage": ((POST, *cage), True),
    }


def measured(kind, settle, span):
    """Ratios (rounds,) by case, and what touches in the wrapped one."""
    plants, states = {}, {}
    for name, (objects, _) in cases().items():
        plants[name] = oc.make_plant(kind, scene=Scene(objects=objects), record_every=50)
        plants[name].advance(CURL, settle)
        states[name] = plants[name].state()
    times = {name: [] for name in plants}
    for _ in range(ROUNDS):
        for name, plant in plants.items():
            plant.restore(states[name])
            begin = process_time()
            run = plant.advance(CURL, span)
            times[name].append(process_time() - begin)
    touch = Touch.of(run.series, "post")
    steps = round(span / plants["none"].h)
    return {name: np.array(found) for name, found in times.items()}, touch.loaded[-1], steps


def main():
    """Print the table."""
    kind = sys.argv[1] if len(sys.argv) > 1 else "rod"
    settle, span = (5.0, 2.0) if kind == "rod" else (4.0, 0.25)
    times, loaded, steps = measured(kind, settle, span)
    base = times["none"]
    print(f"{kind}: {1e6 * np.median(base) / steps:.2f} us a step without objects, {loaded:.0f} points loaded when wrapped")
    for name, found in times.items():
        ratio = found / base
        low, middle, high = np.percentile(ratio, (25, 50, 75))
        print(f"{name:10s} x {middle:.3f} ({low:.3f} ... {high:.3f}), {1e6 * np.median(found - base) / steps:+.2f} us a step")


if __name__ == "__main__":
    main()
