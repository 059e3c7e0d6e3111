"""Bends that travel: how fast, how evenly, in what plane; and what of a packet, a tip or a sucker side feedback mends.

Run with ``python benchmarks/travelling.py`` (two minutes on the rod). Of the words ``reach planned packet corkscrew held`` some choose what
is measured, and the name of a plant another one (``assembly-coarse-mixed``: five minutes for the first four); ``markdown`` prints tables
for the docs. Water: the usual, and that of figure 3, in which layers hardly damp.

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
from octoctrl.sim.activation import Activation
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.plants import PLANTS, make_plant
from octoctrl.sim.templates import PEAK
from octoctrl.sim.topology.measures import writhe
from octoctrl.tables import Table

ARM = oc.Arm()
END, SMOOTH, NEAR, OVER, HELD = 0.075 * ARM.length, 0.05 * ARM.length, 0.15 * ARM.length, 0.05, 1.2
"""How near to the tip a bend has left, over what is smoothed, how far from a bend its centroid looks, m; time of a speed, and how long a
bend is held first, s."""
SPEEDS = (0.1, 0.2, 0.3, 0.4)
WATERS = {"figure 3": tasks.programme("fig3a").scene, "usual": oc.Scene()}
PULSES = {0.05: 0.2, 0.1: 0.25, 0.2: 0.3}
"""Levels of packets by their speed, m/s: water weakens a fast one, and a slow one has the time to bend the arm so far that it lies across
itself."""
WINDOW = (0.0, 0.989 * ARM.length)
STRONG = ["task.drives.pulse.settings.level=0.4", "task.drives.pulse.free=['speed']"]
"""A packet of bending strain 0.3."""
CARRIED = {"level": 0.2, "stretch": 0.2 * ARM.length, "shrinks_to": 0.6, "window": (0.1 * ARM.length, 0.989 * ARM.length)}

FIGURE = [
    'task.drives.bend.settings.window=["10 %","98.9 %"]',
    "task.drives.bend.settings.shrinks_to=0.6",
    'task.phases.bend.goals=[{quantity="curvature",window=["0 %","20 %"],between=[18.0,26.0],tolerance=6.0}]',
]
"""What makes of the task `reach` one for the water of figure 3: a bend that its inertia does not carry away."""


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


def reach(plant):
    rows = []
    for speed in SPEEDS:
        carried = CarriedBend(speed=speed, offset=HELD, **CARRIED)
        lasts = time_of(carried)
        recording = moved(plant, WATERS["figure 3"], [carried], HELD + lasts + 0.2)
        rows.append((100 * speed, *course(recording, speed, HELD, lasts)))
    return Table(
        name="reach",
        title=f"A bend carried along the arm, {plant}, water of figure 3",
        note=COURSE,
        columns=("asked for", *COURSE_COLUMNS),
        formats=(".0f", *COURSE_FORMATS),
        rows=tuple(rows),
    )


def planned(plant):
    rows = []
    for speed in SPEEDS:
        configuration = tasks.load("reach", overrides=[*FIGURE, f"task.drives.bend.settings.speed={speed}"])
        plan = oc.plan(configuration, scene=WATERS["figure 3"], plant=plant)
        run = oc.execute(plan, allow_unsolved=True, settle=0.4)
        misses = {check.name: check.value for check in oc.verify(run).checks}
        carried = plan.schedule.primitives[0]
        way = course(run.recording, speed, plan.phase_begins["carry"], time_of(carried))
        rows.append((100 * speed, plan.status.name.lower(), carried.level, 1e3 * misses["carry.packet"], misses["bend.curvature"], *way))
    return Table(
        name="planned",
        title=f"The task reach, planned, {plant}, water of figure 3",
        note="How far the packet is from its place in the middle of its way, mm (20 allowed), and the bend's curvature from its band as it "
        "sets out, 1/m. " + COURSE,
        columns=("asked for", "plan", "level", "packet", "curvature", *COURSE_COLUMNS),
        formats=(".0f", "", ".2f", ".1f", ".1f", *COURSE_FORMATS),
        rows=tuple(rows),
    )


COURSE = (
    "Speeds in cm/s, the greatest over 50 ms, off what was asked for in the laboratory; bell: root mean square distance from the nearest "
    f"bell. To: how far the bend comes, mm, of {1e3 * ARM.length:.0f}. Left: the greatest bending strain behind it in the end, over that "
    "of the bend as it set out. Out of plane: in arm lengths."
)
COURSE_COLUMNS = ("along the arm", "bell", "in the laboratory", "bell ", "off", "to", "left", "out of plane")
COURSE_FORMATS = (".1f", ".3f", ".1f", ".3f", "+.0%", ".0f", ".0%", ".2%")


def time_of(carried):
    """How long a carried bend is on its way, but for the share by which it shrinks, s."""
    begin, end = carried.window
    return PEAK * (end - begin) / carried.speed


def course(recording, speed, begin, lasts):
    """Columns of a bend that sets out at `begin` to go at `speed`."""
    time, (along, strength, place) = recording.time, bend(recording)
    arrived = np.flatnonzero((time > begin) & (along > ARM.length - END))
    way = (time >= begin) & (time <= (time[arrived[0]] if arrived.size else time[-1]))
    found = []
    for moving in (along[:, None], place):
        speeds = np.linalg.norm(rate(time, moving), axis=1)[way]
        found += [100 * speeds.max(), off_bell((time[way] - begin) / lasts, speeds / speeds.max())]
    track = packet_of(recording, ARM)
    behind = track.strain[-1, track.places < ARM.length - 2 * END].max() / strength[time <= begin].max()
    out = np.abs(recording.points[..., 2]).max() / ARM.length
    return (*found, found[2] / (100 * speed) - 1, 1e3 * along[time > begin].max(), behind, out)


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
    rows = []
    for water, scene in WATERS.items():
        for speed, level in PULSES.items():
            wave = oc.BendWave(level=level, speed=speed, width=5e-3, offset=0.04 / speed, window=WINDOW)
            recording, along, strength, way = travelling(plant, [wave], speed, scene)
            slope, _ = np.polyfit(recording.time[way], along[way], 1)
            most = max(abs(writhe(points)) for points in recording.points[way][::5])
            rows.append((water, 100 * speed, 100 * slope, slope / speed - 1, strength[way].min(), strength[way].max(), most))
    return Table(
        name="packet",
        title=f"Two fronts 40 mm apart, {plant}",
        note="Speeds in cm/s, of the bend between 30 and 75 % of the arm; its bending strain on that way; greatest |Wr|, turns.",
        columns=("water", "asked for", "speed", "off", "strain, least", "greatest", "writhe"),
        formats=("", ".0f", ".1f", "+.0%", ".2f", ".2f", ".3f"),
        rows=tuple(rows),
    )


def corkscrew(plant):
    rows = []
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
            curvature = (strength / radius)[way]
            rows.append((water, 100 * speed, np.sqrt(np.mean(apart**2)), apart.max(), curvature[0], curvature[-1]))
    return Table(
        name="corkscrew",
        title=f"Fronts of bend and of twist, {plant}",
        note="Speeds in cm/s; how far the packets of bend and twist are apart, in arm lengths; its curvature at 30 and at 75 %, 1/m.",
        columns=("water", "asked for", "apart, rms", "at most", "curvature, first", "last"),
        formats=("", ".0f", ".1%", ".1%", ".0f", ".0f"),
        rows=tuple(rows),
    )


def held(plant):
    rows = []
    for name, changes in (("tip", []), ("lm-helix", []), ("packet", []), ("packet", STRONG)):
        configuration = tasks.load(name, overrides=[f"run.plant={plant}", *changes])
        plan = oc.plan(configuration)
        runs = [oc.execute(plan, feedback=kind, allow_unsolved=True) for kind in ("open-loop", "tvlqr")]
        checks = [oc.verify(run).checks for run in runs]
        label = name
        if name == "packet":
            strength = packet_of(runs[0].recording, ARM).amplitude[runs[0].recording.time > plan.phase_begins["middle"]]
            label = f"{name}, strain {strength.min():.2f} to {strength.max():.2f}"
        asked = {f"{phase.name}.{goal.quantity}" for phase in plan.task.phases for goal in phase.goals}
        rows += [
            (label, without.name, without.unit, without.value, with_it.value, without.limit)
            for without, with_it in zip(*checks, strict=True)
            if without.name in asked
        ]
    return Table(
        name="held",
        title=f"Goals that are held or read off bends, {plant}",
        note="Misses without feedback and with it.",
        columns=("task", "goal", "unit", "open loop", "tvlqr", "tolerance"),
        formats=("", "", "", ".4f", ".4f", "g"),
        rows=tuple(rows),
    )


def main(words):
    plants = [word for word in words if word in PLANTS] or ["rod"]
    parts = {"reach": reach, "planned": planned, "packet": packet, "corkscrew": corkscrew, "held": held}
    for plant in plants:
        for name in [word for word in words if word in parts] or parts:
            found = parts[name](plant)
            print(found.markdown() if "markdown" in words else found, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
