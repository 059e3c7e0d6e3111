"""Bends that travel: how fast, how evenly, in what plane; and what of a packet, a tip or a sucker side feedback mends.

Run with ``python benchmarks/travelling.py`` (two minutes on the rod). Of the words ``reach packet corkscrew held`` some choose what is
measured, and the name of a plant another one (``assembly-coarse-mixed``: five minutes for the first three). Water: the usual, and that of
figure 3, in which layers hardly damp.

The bend is where the bending strain, smoothed over 5 % of the arm, is greatest; its speed is taken over 50 ms, along the arm and in the
laboratory. Of a reach it is looked at from when the bend sets out until it is 7.5 % of the arm from the tip: the greatest, and how far its
course is from a bell, 16 x^2 (1 - x)^2 over the greatest, of that begin and that duration with which it is nearest.
"""

import sys

import numpy as np

import octoctrl as oc
from octoctrl import tasks
from octoctrl.judging.packet import packet_of
from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.planners.asking.primitives import CarriedBend
from octoctrl.sim.activation import PEAK, Activation
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.plants import PLANTS, make_plant
from octoctrl.sim.topology.measures import writhe

ARM = oc.Arm()
END, SMOOTH, NEAR, OVER, HELD = 0.075 * ARM.length, 0.05 * ARM.length, 0.15 * ARM.length, 0.05, 1.2
"""How near to the tip a bend has left, over what is smoothed, how far from a bend its centroid looks, m; time of a speed, and how long a
bend is held first, s."""
WATERS = {"figure 3": tasks.programme("fig3a").scene, "usual": oc.Scene()}
WINDOW = (0.0, 0.989 * ARM.length)
STRONG = ["task.drives.pulse.settings.level=0.4", "task.drives.pulse.free=['speed']"]
"""A packet of bending strain 0.3."""
CARRIED = (0.1 * ARM.length, 0.989 * ARM.length)


def moved(plant, scene, primitives, duration):
    """What the plant does, as far as it comes."""
    duration = round(duration, 1)
    templates = tuple(template for primitive in primitives for template in primitive.templates())
    try:
        return make_plant(plant, ARM, scene, record_every=1).advance(Activation(templates=templates, composition="handover"), duration)
    except PlantUnstableError as error:
        print(f"  stopped: {error}")
        return error.recording


def greatest(places, field):
    """Place (T,) about which a field (T, M) is greatest: the centroid of its square within `NEAR` of itself; and its size there."""
    weights = np.exp(-0.5 * ((places[:, None] - places) / (SMOOTH / 2)) ** 2)
    smooth = field @ (weights / weights.sum(axis=1, keepdims=True)).T
    at = places[smooth.argmax(axis=1)]
    for _ in range(8):
        share = smooth**2 * np.clip(1 - ((places - at[:, None]) / NEAR) ** 2, 0.0, None)
        at = (share @ places) / np.maximum(share.sum(axis=1), 1e-300)
    return at, np.array([np.interp(place, places, row) for place, row in zip(at, smooth, strict=True)])


def rate(time, values):
    """How fast values (T, n) change."""
    ends = [np.clip(time + shift * OVER / 2, time[0], time[-1]) for shift in (-1, 1)]
    before, after = (np.stack([np.interp(when, time, column) for column in values.T], axis=1) for when in ends)
    return (after - before) / (ends[1] - ends[0])[:, None]


def bend(recording):
    """Place (T,) of the bend along the arm, its strength, and its place (T, 3) in the laboratory."""
    track = packet_of(recording, ARM)
    along, strength = greatest(track.places, track.strain)
    edges = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(recording.points[0], axis=0), axis=1) / recording.stretch[0])])
    return along, strength, np.array([[np.interp(s, edges, axis) for axis in p.T] for s, p in zip(along, recording.points, strict=True)])


def out_of_plane(recording):
    """Largest distance from the plane of bending, in arm lengths."""
    return np.abs(recording.points[..., 2]).max() / ARM.length


def reach(plant):
    print(f"reach on {plant}: speeds in cm/s")
    for water, scene in WATERS.items():
        for speed in (0.1, 0.2, 0.3, 0.4):
            carried = CarriedBend(level=0.2, speed=speed, offset=HELD, window=CARRIED)
            lasts = PEAK * (CARRIED[1] - CARRIED[0]) / speed
            recording = moved(plant, scene, [carried], HELD + lasts + 0.2)
            time, (along, strength, place) = recording.time, bend(recording)
            arrived = np.flatnonzero((time > HELD) & (along > ARM.length - END))
            print(f"  {water} water, {100 * speed:.0f} asked for:", end=" ")
            if not arrived.size:
                print(f"the bend does not come to the tip, but to {1e3 * along[time > HELD].max():.0f} mm")
                continue
            way = (time >= HELD) & (time <= time[arrived[0]])
            for words, moving in (("along the arm", along[:, None]), ("in the laboratory", place)):
                speeds = np.linalg.norm(rate(time, moving), axis=1)[way]
                off = off_bell((time[way] - HELD) / lasts, speeds / speeds.max())
                print(f"{words} {100 * speeds.max():.1f} ({speeds.max() / speed - 1:+.0%}), {off:.3f} rms off a bell;", end=" ")
            track = packet_of(recording, ARM)
            behind = track.strain[-1, track.places < ARM.length - 2 * END].max() / strength[time <= HELD].max()
            print(f"then {behind:.0%} of the bend left; {out_of_plane(recording):.2%} of the length out of plane", flush=True)


def off_bell(time, speeds):
    """Root mean square distance from the nearest bell; both of greatest 1, time as a share of what was commanded."""
    best = np.inf
    for begin in np.arange(-0.1, 0.4, 0.01):
        for lasts in np.arange(0.5, 1.3, 0.01):
            share = np.clip((time - begin) / lasts, 0.0, 1.0)
            best = min(best, np.sqrt(np.mean((speeds - 16 * share**2 * (1 - share) ** 2) ** 2)))
    return best


def travelling(plant, primitives, speed, scene):
    """Recording of two fronts 40 mm apart, and the instants at which the bend is on its way between 30 and 75 % of the arm."""
    recording = moved(plant, scene, primitives, (0.04 + 0.85 * ARM.length) / speed)
    along, strength, _ = bend(recording)
    middle = 0.02 + 0.0 * along + speed * (recording.time - 0.04 / speed)
    return recording, along, strength, (middle > 0.3 * ARM.length) & (middle < 0.75 * ARM.length)


def packet(plant):
    print(f"packet on {plant}: speeds in cm/s")
    for water, scene in WATERS.items():
        for speed in (0.05, 0.1, 0.2):
            wave = oc.BendWave(level=0.25, speed=speed, width=5e-3, offset=0.04 / speed, window=WINDOW)
            recording, along, strength, way = travelling(plant, [wave], speed, scene)
            slope, _ = np.polyfit(recording.time[way], along[way], 1)
            most = max(abs(writhe(points)) for points in recording.points[way][::5])
            print(f"  {water} water, {100 * speed:.0f} asked for: {100 * slope:.1f} ({slope / speed - 1:+.0%}),", end=" ")
            print(f"bending strain {strength[way].min():.2f} to {strength[way].max():.2f}, |Wr| {most:.3f} at most", flush=True)


def corkscrew(plant):
    print(f"corkscrew on {plant}")
    for water, scene in WATERS.items():
        for speed in (0.1, 0.2):
            same = {"speed": speed, "width": 5e-3, "offset": 0.04 / speed, "window": WINDOW}
            waves = [oc.BendWave(level=0.3, **same), oc.TwistWave(hand="L-OM", level=0.3, **same)]
            recording, along, strength, way = travelling(plant, waves, speed, scene)
            track, outputs = packet_of(recording, ARM), RecordedOutputs(recording, None, ARM)
            middles = (outputs.stations[1:] + outputs.stations[:-1]) / 2
            turning = np.stack([np.interp(track.places, middles, row) for row in np.abs(outputs.curvatures[2])])
            twisted, _ = greatest(track.places, turning * ARM.base_radius * ARM.section(track.places).outline)
            apart = np.abs(along - twisted)[way] / ARM.length
            radius = ARM.base_radius * np.interp(along, [0.0, ARM.length], [1.0, 1 / ARM.taper])
            first, last = ((strength / radius)[way][edge] for edge in (0, -1))
            print(
                f"  {water} water, {100 * speed:.0f} cm/s: bend and twist {np.sqrt(np.mean(apart**2)):.1%} of the length apart (rms),",
                end=" ",
            )
            print(f"{apart.max():.1%} at most; curvature from {first:.0f} to {last:.0f} 1/m", flush=True)


def held(plant):
    print(f"goals that are held or read off bends, on {plant}: misses without feedback and with it")
    for name, changes in (("tip", []), ("lm-helix", []), ("packet", []), ("packet", STRONG)):
        configuration = tasks.load(name, overrides=[f"run.plant={plant}", *changes])
        plan = oc.plan(configuration)
        runs = [oc.execute(plan, feedback=kind, allow_unsolved=True) for kind in ("open-loop", "tvlqr")]
        checks = [oc.verify(run).checks for run in runs]
        if name == "packet":
            strength = packet_of(runs[0].recording, ARM).amplitude[runs[0].recording.time > plan.phase_begins["middle"]]
            print(f"  {name}, bending strain {strength.min():.2f} to {strength.max():.2f}:")
        asked = {f"{phase.name}.{goal.quantity}" for phase in plan.task.phases for goal in phase.goals}
        for without, with_it in zip(*checks, strict=True):
            if without.name in asked:
                print(
                    f"  {name}: {without.name} {without.value:.4g}, {with_it.value:.4g} {without.unit} (tolerance {without.limit:g})",
                    flush=True,
                )


def main(words):
    plants = [word for word in words if word in PLANTS] or ["rod"]
    parts = {"reach": reach, "packet": packet, "corkscrew": corkscrew, "held": held}
    for plant in plants:
        for name in [word for word in words if word in parts] or parts:
            parts[name](plant)


if __name__ == "__main__":
    main(sys.argv[1:])
