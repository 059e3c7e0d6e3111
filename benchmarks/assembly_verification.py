"""Verification of the full arm: time step, rings, hands, velocity noise, volume, buckling, and a recorded run of the published code.

Run with ``python benchmarks/assembly_verification.py halves`` (70 against 35 us; five minutes, with ``coarse mixed`` one), ``rings`` (360
against 180; ten minutes, with ``coarse`` two), ``mirror`` (left against right; two minutes), ``noise`` (one minute), ``rest`` (one minute),
``buckling`` (three minutes), ``volume`` (every group and pair at 0.3 and 1.0; fifteen minutes, with ``coarse`` five; see there for its
words), or ``published FOLDER`` with the folder of the recorded run (``fig2c.csv`` and ``fig2c-states.npz``; three minutes).
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from assembly import programme
from assembly_resolution import TRACES, compare, run

from octoctrl.sim.activation import Activation
from octoctrl.sim.assembly.core import AssemblyCore
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.layout import SpokeRow as S
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.plants import make_plant
from octoctrl.sim.running.clock import Clock
from octoctrl.sim.running.plant import Plant
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.sources import sampled
from octoctrl.sim.templates import Plateau
from octoctrl.sim.topology.measures import measure, twist, writhe

FAMILIES = ("cord", "LM", "L-OM", "R-OM", "rings")


def families(rods):
    """Velocities (rods, nodes, 3) of the families, m/s."""
    straight, oblique = (np.stack([view(R.V1 + i, nodes=True) for i in range(3)], axis=-1) for view in (rods.straight, rods.oblique))
    return straight[:1], straight[1:], oblique[:4], oblique[4:], np.stack([rods.ring(R.V1 + i) for i in range(3)], axis=-1)


def single_steps(plant, activation, count):
    """Velocities of the families (count, rods, nodes, 3) after each of `count` steps at the levels of now."""
    found = sampled(activation, plant.clock.instants(plant.samples, 0), plant.core.partitions, plant.arm.layout)
    held = {name: np.repeat(levels, 2, axis=0) for name, levels in found.items()}
    one, seen = replace(plant.clock, steps=1), []
    for _ in range(count):
        plant.core.move(plant.samples, held, one)
        seen.append(families(plant.core.rods))
    return [np.stack(values) for values in zip(*seen, strict=True)]


def size(vectors):
    """Mean length of vectors."""
    return np.linalg.norm(vectors, axis=-1).mean()


def grid_scale(velocity, closed):
    """Part of the velocities at the scale of the grid: a quarter of the second difference, five times, which keeps no rigid turning."""
    for _ in range(5):
        if closed:
            velocity = (2 * velocity - np.roll(velocity, 1, axis=-2) - np.roll(velocity, -1, axis=-2)) / 4
        else:
            velocity = (2 * velocity[..., 1:-1, :] - velocity[..., :-2, :] - velocity[..., 2:, :]) / 4
    return velocity


def noise():
    """Print velocity noise in time (chatter) and in space, over the mean speed of the family."""
    cases = (("default, 70 us", {}, 0.3), ("default, 35 us", {"dt": 3.5e-5}, 0.3), ("published, 10 us", {"paper_compatible": True}, 0.3))
    print("noise over mean speed, R-OM at 0.3 after 0.3 s: in time / in space / in space of the mean of 60 steps")
    kept = {}
    for label, options, until in cases:
        plant = make_plant("assembly", **options)
        plant.advance(programme(), until)
        cells = []
        for name, v in zip(FAMILIES, single_steps(plant, programme(), 60), strict=True):
            in_time, in_space = size(v[2:] - 2 * v[1:-1] + v[:-2]) / 4 / size(v), grid_scale(v, name == "rings")
            cells.append(f"{name} {in_time:.1e} {size(in_space) / size(v):.1e} {size(in_space.mean(axis=0)) / size(v):.1e}")
            kept.setdefault(name, []).append(in_space[-1])
        print(f"  {label:17s}", "; ".join(cells), flush=True)
    print("  correlation of the default's noise in space at the two steps:", end=" ")
    print("; ".join(f"{name} {np.vdot(a, b) / np.sqrt(np.vdot(a, a) * np.vdot(b, b)):.3f}" for name, (a, b, *_) in kept.items()))


SINGLES = (("LM1",), ("TM",), ("R-OM",), ("L-OM",))
PAIRS = (
    *((("LM1", other)) for other in ("LM2", "LM3", "LM4", "LM5", "TM", "R-OM", "L-OM")),
    ("TM", "R-OM"),
    ("TM", "L-OM"),
    ("R-OM", "L-OM"),
)
"""All that differ by more than a turn of the arm about its axis or its mirror image, which swaps the hands."""

MORE = (("LM1", "LM2", "LM8"), LONGITUDINAL_GROUPS, (*LONGITUDINAL_GROUPS, "TM"), MUSCLE_GROUPS)
NAMES = {LONGITUDINAL_GROUPS: "LM1..8", (*LONGITUDINAL_GROUPS, "TM"): "LM1..8, TM", MUSCLE_GROUPS: "everything"}
RISE, HELD = 0.5, 2.0


def centre_line(plant):
    """Change of length of the line through the rings' centres, and the greatest turning of its tangent, degrees."""
    parts = np.diff(plant.core.nodes()[2].mean(axis=1), axis=0)
    lengths = np.linalg.norm(parts, axis=1)
    along = parts / lengths[:, None]
    turning = np.degrees(np.arccos(np.clip(along @ along[0], -1, 1)).max())
    return lengths.sum() / np.ptp(plant.core.geometry.rings.points[:, 0, 1]) - 1, turning


def bowstring(plant):
    """Greatest tension of the cord over the one that an arm of equal sections bears straight, sqrt(B k), and the ring where it is.

    The cord is stretched inside muscles that the pressure keeps apart: a string of tension P in a column of bending stiffness B, tied to
    it by springs k per length. A wave of number q turns aside where B q^4 < P^2 q^4 / (P q^2 + k), the longest first, at P^2 = B k. B is
    that of the muscles' passive tension, sum A r^2 (e / 2) d(sigma / e)/de over rods of rest area A at the distance r from the cord.
    """
    rods, law, geometry = plant.core.rods, plant.arm.longitudinal, plant.core.geometry
    stretch, area = rods.straight(R.STRETCH).astype(float), geometry.straight.area
    nodes = plant.core.nodes()[0]
    apart = np.linalg.norm(nodes[1:] - nodes[0], axis=2)
    radius, e, small = (apart[:, 1:] + apart[:, :-1]) / 2, stretch[1:], 1e-4
    slope = (law.passive_stress(e + small) / (e + small) - law.passive_stress(e - small) / (e - small)) / (2 * small)
    bending = np.sum(area[1:] * radius**2 * e / 2 * slope, axis=0)
    spring = rods.spoke(S.C_SPRING).sum(axis=0) / 2 / (geometry.spacing * stretch[0])
    taut = (e > 1 + law.slack).all(axis=0)  # the muscles near the base are not
    share = np.where(taut, area[0] * law.passive_stress(stretch[0]) / stretch[0] / np.sqrt(np.where(taut, bending, 1.0) * spring), 0.0)
    return share.max(), int(share.argmax())


def buckling():
    """Print how the tip of an arm with coarse rings turns aside while TM is held: by itself, pushed, with more rings, tied otherwise."""
    print("level, push in m/s: load of the cord at the rise's end over that of the bowstring, ring; greatest turning every 0.05 s from the")
    print("rise's end on, degrees; elongation at the end")
    cases = (
        ("", 1.0, 0.0, RISE, 1.2, {}, 1.0),
        ("", 1.0, 1e-4, RISE, 1.2, {}, 1.0),
        ("", 1.0, 1e-2, RISE, 1.2, {}, 1.0),
        ("", 0.9, 0.0, RISE, 2.0, {}, 1.0),
        ("", 0.8, 0.0, RISE, 2.0, {}, 1.0),
        ("twice the rise", 1.0, 0.0, 2 * RISE, 1.6, {}, 1.0),
        ("half the step", 0.9, 0.0, RISE, 1.6, {"dt": 3.5e-5}, 1.0),
        ("360 rings", 0.9, 0.0, RISE, 1.6, {"rings": 360}, 1.0),
        ("360 rings", 0.8, 0.0, RISE, 2.0, {"rings": 360}, 1.0),
        ("cord tied 4 x as stiffly", 1.0, 0.0, RISE, 2.0, {}, 4.0),
    )
    for label, level, push, rise, until, build, tied in cases:
        plant = make_plant("assembly", **({"ring_nodes": 8, "precision": "mixed"} | build))
        activation = Activation(templates=(Plateau(groups=("TM",), level=level, rise=rise),))
        plant.core.rods.spoke(S.C_SPRING)[:] *= tied
        plant.advance(activation, rise)
        load, ring = bowstring(plant)
        sideways, cells = plant.core.rods.straight(R.V1, nodes=True)[1:, 140:], []
        sideways += push * np.linspace(0, 1, sideways.shape[1])
        while plant.time < until - 1e-9:
            plant.advance(activation, 0.05)
            length, turning = centre_line(plant)
            cells.append(f"{turning:.2g}")
        print(f"{level:4.2f} {push:6g} {label}: {load:.2f} at {ring};", *cells, f" {length:+.1%}", flush=True)


def volume(words):
    """Print what groups alone, in pairs and together do in 2 s to volume and shape, and whether they are survived.

    `words` may hold ``coarse``, ``mixed``, ``notone``, ``singles`` (no pairs), a level, and a step in microseconds as ``50us``.
    """
    kind, tone = "assembly" + "-coarse" * ("coarse" in words) + "-mixed" * ("mixed" in words), (0.0 if "notone" in words else None)
    levels = [float(word) for word in words if word.replace(".", "", 1).isdigit()] or [0.3, 1.0]
    step = next((float(word[:-2]) * 1e-6 for word in words if word.endswith("us")), "auto")
    print("volume of the whole and of the slab furthest from rest, ever, %; line through the rings' centres: change of length, greatest")
    print("turning of its tangent, twist and link of the cord at the end; samples done at a part of the step")
    print(f"{'groups':14s} level {'until s':>8s} {'whole':>7s} {'slab':>7s} {'length':>8s} {'turning':>8s} {'Tw':>9s} {'again':>6s}")
    for level in levels:
        for groups in SINGLES + (() if "singles" in words else PAIRS) + MORE:
            plant, said = make_plant(kind, dt=step, resting_tone=tone), ""
            try:
                recording = plant.advance(Activation(templates=(Plateau(groups=groups, level=level, rise=RISE),)), HELD)
            except PlantUnstableError as error:
                recording, said = error.recording, f"  {error}"
            series = (recording.series[name] for name in ("volume", "slab_volume"))
            furthest = [values.flat[np.abs(values - 1).argmax()] for values in series]
            length, turning = centre_line(plant)
            turns = twist(recording.points[-1], -recording.frames[-1, 1:-1, 1])
            name = NAMES.get(groups, ", ".join(groups))
            cells = f"{100 * furthest[0]:7.2f} {100 * furthest[1]:7.2f} {length:+8.2%} {turning:8.1f} {turns:+9.5f} {plant.retried:6d}"
            print(f"{name:14s} {level:5.2f} {recording.time[-1]:8.2f}", cells + said, flush=True)


def halves(words):
    """Print what 70 instead of 35 us changes while R-OM and TM rise to 0.3, and in the whole coil at oblique level 0.17.

    `words` may hold ``coarse`` and ``mixed``.
    """
    build = {"ring_nodes": 8 if "coarse" in words else None, "precision": "mixed" if "mixed" in words else "double"}
    plateau = {groups: Activation(templates=(Plateau(groups=groups, level=0.3, rise=0.4),)) for groups in (("R-OM",), ("TM",))}
    for label, activation, duration in (
        *((groups[0], source, 0.5) for groups, source in plateau.items()),
        ("coil", programme(0.17), 7.0),
    ):
        traces = []
        for steps_in_a_sample in (71, 142):  # 70 us is more than a user may ask for
            plant = Plant(AssemblyCore(Arm.octopus(), Scene.free(), **build), Clock(steps=steps_in_a_sample))
            recording = plant.advance(activation, duration)
            trace = measure(recording.time, recording.points, recording.frames)
            traces.append({"Lk": trace.lifted_link, "Wr": trace.lifted_writhe, "Tw": trace.twist, "length": recording.length * 1e3})
        cells = []
        for name, fine in traces[1].items():
            apart, scale = np.abs(traces[0][name] - fine).max(), np.abs(fine - fine[0]).max()
            cells.append(f"{name} {apart:.4f}" + (f" ({100 * apart / scale:.2f} %)" if scale > 1e-3 else ""))
        print(f"{label:5s} 70 against 35 us, greatest difference in turns or mm:", ", ".join(cells), flush=True)


def mirror(words):
    """Print how far left and right are apart that should be each other's mirror image: the greatest difference in time.

    `words` may hold ``coarse``.
    """
    kind = "assembly" + "-coarse" * ("coarse" in words) + "-mixed"
    print("groups and their mirror image, level: greatest twist, how far the two are apart, in turns and of the greatest; length in mm")
    for others in ((), ("LM1",), ("TM",)):
        for level in (0.3, 1.0):
            found = []
            for hand in ("R-OM", "L-OM"):
                plateau = Activation(templates=(Plateau(groups=(hand, *others), level=level, rise=RISE),))
                recording = make_plant(kind).advance(plateau, 1.0)
                found.append((measure(recording.time, recording.points, recording.frames).twist, 1e3 * recording.length))
            (right, length), (left, other) = found
            most, apart = np.abs(right).max(), np.abs(right + left).max()
            name = ", ".join(("R-OM", *others))
            print(f"{name:10s} {level:4.2f}: {most:7.4f} {apart:.1e} {apart / most:.1e}; {np.abs(length - other).max():.4f}", flush=True)


def rings(words):
    """Print what twice as many rings change in the whole coil at oblique level 0.17, and where, in mixed precision.

    `words` may hold ``coarse``, rings of eight nodes, and ``taut``, helices that are straight from ring to ring.
    """
    build, found = {"precision": "mixed", "taut": "taut" in words} | ({"ring_nodes": 8} if "coarse" in words else {}), {}
    for count in (180, 360):
        plant, found[count], cost = run(build | {"rings": count}, 0.17, 7.0)
        at_end = ", ".join(f"{name} {value:.4f}" for name, value in zip(TRACES, found[count][:, -1], strict=True))
        print(f"{count} rings, {1e6 * plant.h:.1f} us, {cost:.1f} processor s per s, at the end:", at_end, flush=True)
    print("360 against 180 rings, greatest and rms difference in turns or mm, and of the greatest value:")
    print(" ", compare(found[180], found[360]))
    print("  the same when one turn is stored and when the coil is there (turns or mm):")
    for time in (1.5, 7.0):
        k = round(time / 7.0 * found[180].shape[1]) - 1
        print(
            f"  {time:.1f} s:",
            ", ".join(f"{name} {a - b:+.4f}" for name, a, b in zip(TRACES, found[180][:, k], found[360][:, k], strict=True)),
        )


def rest():
    """Print the fastest node of an arm without any tone, pushed by 1 nm/s."""
    print(f"{'step us':>8s}  fastest node, m/s, every 0.1 s")
    for dt in (5e-5, 2.5e-5):
        plant, cells = make_plant("assembly", dt=dt, resting_tone=0.0), []
        rods, generator = plant.core.rods, np.random.default_rng(1)
        for view in (rods.straight, rods.oblique, rods.ring):
            for row in (R.V1, R.V2, R.V3):
                view(row)[1:] += 1e-9 * generator.standard_normal(view(row)[1:].shape)
        for _ in range(10):
            plant.advance(Activation(), 0.1)
            cells.append(max(np.abs(v).max() for v in families(rods)))
        print(f"{plant.h * 1e6:8g} ", *(f"{cell:.1e}" for cell in cells), flush=True)


def published(folder):
    """Print the published numerics against a recorded run of the published code."""
    rows = np.loadtxt(folder / "fig2c.csv", delimiter=",", skiprows=1)
    states = np.load(folder / "fig2c-states.npz")
    plant = make_plant("assembly", paper_compatible=True, sample_interval=2e-3)
    print("differences: twist, writhe (turns), length, tip (mm), rms of the nodes (mm) of cord, LM, OM, rings")
    worst = {}
    for t, *tip, length, wr, tw in rows[1:]:
        plant.advance(programme(), round(t - plant.time, 6))
        seen = plant.observe()
        found = {
            "twist": twist(seen.points, -seen.frames[1:-1, 1]) - tw,
            "writhe": writhe(seen.points) - wr,
            "length": np.linalg.norm(np.diff(seen.points, axis=0), axis=1).sum() * 1e3 - length,
            "tip": np.linalg.norm(seen.points[-1] * 1e3 - tip),
        }
        for name, value in found.items():
            worst.setdefault(name, []).append(abs(value))
        line = f"{t:5.2f} " + " ".join(f"{value:9.4f}" for value in found.values())
        close = np.flatnonzero(np.abs(states["t"] - t) < 1e-6)
        if close.size:
            straight, oblique, rings = plant.core.nodes()
            theirs = [np.moveaxis(states[name][close[0]], 1, 2) * 1e-3 for name in ("straight", "oblique", "rings")]
            pairs = ((straight[:1], theirs[0][:1]), (straight[1:], theirs[0][1:]), (oblique, theirs[1]), (rings, theirs[2]))
            line += "   " + " ".join(f"{np.sqrt(np.mean(np.sum((a - b) ** 2, axis=-1))) * 1e3:8.4f}" for a, b in pairs)
            print(line, flush=True)
        elif round(t * 50) % 10 == 0:
            print(line, flush=True)
    early = rows[1:, 0] <= 0.6 + 1e-9
    for name, values in worst.items():
        values = np.array(values)
        print(f"largest difference of {name}: {values[early].max():.4f} to 0.6 s, {values.max():.4f} to {rows[-1, 0]:.2f} s")


def main():
    subjects = {"noise": noise, "rest": rest, "buckling": buckling}
    with_words = {"volume": volume, "halves": halves, "mirror": mirror, "rings": rings}
    if sys.argv[1:2] == ["published"] and len(sys.argv) == 3:
        published(Path(sys.argv[2]))
    elif sys.argv[1:2] and sys.argv[1] in with_words:
        with_words[sys.argv[1]](sys.argv[2:])
    elif sys.argv[1:] and all(name in subjects for name in sys.argv[1:]):
        for name in sys.argv[1:]:
            subjects[name]()
    else:
        print(__doc__)


if __name__ == "__main__":
    main()
