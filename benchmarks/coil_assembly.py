"""The coil on the full arm of 197 rods, planned and carried out in closed loop, measured against what the study shows.

Run with ``python benchmarks/coil_assembly.py`` (about four minutes of processor time). The first part plans the coil twice, with the
longitudinal muscles on the side of the suckers and on the other, and carries both out; the second plays the supplement's helix of
longitudinal muscles alone, beside the helix that twist and longitudinal muscles make together. ``coil`` or ``helix`` behind the command
does one part only. Nothing is drawn or kept; ``octoctrl demo coil --plant assembly`` does that.
"""

import sys
from time import process_time

import numpy as np

import octoctrl as oc
from octoctrl import tasks
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.plants import warmup
from octoctrl.sim.topology.measures import measure, sucker_orientation

SIDES = {
    "suckers inward (LM 1, 2, 8)": (),
    "suckers outward (LM 4, 5, 6)": ("task.drives.curl.settings.side=LM5", "task.convention.pole=[0, 0, -1]"),
}
"""Changes of the task: bending to the other side winds the same coil about the opposite pole."""

PARTS = 8
"""Stretches of the arm for which the side of the suckers is printed."""


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def line(label, value, wanted, good):
    print(f"  {label:58} {value:>22}   {wanted:24} {'yes' if good else 'NO'}")


def suckers(frames):
    """Cosine between the sucker line and the centre of curvature, mean and of each stretch: 1 is inward, -1 outward."""
    parts = np.array_split(np.arange(len(frames)), PARTS)
    return sucker_orientation(frames, 0.0), np.array([sucker_orientation(frames[part[0] : part[-1] + 2], 0.0) for part in parts])


def toward_centre(recording, instant):
    """Mean cosine between the sucker line of the proximal half and the direction to the middle of the distal half, the spiral's centre."""
    half = recording.points.shape[1] // 2
    points, frames = recording.points[instant], recording.frames[instant, 1 : half + 1]
    inward = points[half:].mean(axis=0) - (points[1 : half + 1] + points[:half]) / 2
    inward -= np.sum(inward * frames[:, 2], axis=1, keepdims=True) * frames[:, 2]
    return float(np.mean(np.sum(inward * frames[:, 1], axis=1) / np.linalg.norm(inward, axis=1)))


def coil(label, changes):
    configuration = tasks.load("coil", overrides=changes)
    plan = oc.plan(configuration, plant="assembly", strict=True)
    begin = process_time()
    run = oc.execute(plan, progress=None)
    spent = process_time() - begin
    trace, recording, planned = run.trace, run.recording, run.planned
    ends = {event.phase: event.actual for event in run.events}

    def at(name, phase):
        return float(np.interp(ends[phase], trace.time, getattr(trace, name)))

    jumps = np.diff(trace.writhe - trace.lifted_writhe)
    events = np.flatnonzero(np.abs(jumps) > 1)
    spiral = int(np.searchsorted(recording.time, ends["cross"]))
    link = trace.link[trace.time >= max(ends["cross"], trace.time[events[-1] + 1])] if len(events) else trace.link[spiral:]
    stored, lk, wr = at("twist", "store"), at("lifted_link", "cross"), at("lifted_writhe", "cross")
    mean, parts = suckers(recording.frames[spiral])
    centre, side = toward_centre(recording, spiral), -1 if "outward" in label else 1
    levels = {name: round(number, 2) for name, number in plan.report.numbers.items() if name.endswith("level")}
    print(f"\n{label}: {recording.time[-1]:.2f} s simulated in {spent:.0f} s of processor time; planned levels {levels}")
    print(
        f"  status {run.status.name}, verdict {oc.verify(run).status}, phases met {sum(event.met for event in run.events)} of {len(ends)}"
    )
    line("|Tw| stored, at the end of 'store'", f"{abs(stored):.3f} turns", "1 +- 0.1", abs(abs(stored) - 1) <= 0.1)
    line("|Lk| at the spiral, lifted, at the end of 'cross'", f"{abs(lk):.3f} turns", "2 +- 0.15", abs(abs(lk) - 2) <= 0.15)
    line("|Wr| at the spiral, lifted", f"{abs(wr):.3f} turns", "2 +- 0.15", abs(abs(wr) - 2) <= 0.15)
    told = ", ".join(f"{jumps[k]:+.2f} at {trace.time[k + 1]:.2f} s" for k in events)
    line(
        "jumps of Wr and Lk as the arm passes through itself",
        told,
        "two of 2, same sign",
        [round(abs(jumps[k]), 2) for k in events] == [2, 2],
    )
    drift = float(np.abs(link - link.mean()).max())
    line(
        "|Lk| while telescoping: mean, largest distance from it", f"{abs(link.mean()):.3f}, {drift:.3f}", "constant +- 0.15", drift <= 0.15
    )
    errors = [trace.lifted_writhe - planned.lifted_writhe, trace.twist - planned.twist]
    line(
        "simulated - planned, Wr: rms, max",
        f"{rms(errors[0]):.3f}, {abs(errors[0]).max():.3f} turns",
        "rms <= 0.15",
        rms(errors[0]) <= 0.15,
    )
    line(
        "simulated - planned, Tw: rms, max",
        f"{rms(errors[1]):.3f}, {abs(errors[1]).max():.3f} turns",
        "rms <= 0.10",
        rms(errors[1]) <= 0.10,
    )
    line("suckers at the spiral: cosine to the centre of curvature", f"{mean:+.2f}", "+1 inward, -1 outward", side * mean > 0.5)
    line("suckers at the spiral: cosine to the spiral's centre", f"{centre:+.2f}", "the same sign", side * centre > 0.5)
    print(f"  by stretch from base to tip: {' '.join(f'{part:+.2f}' for part in parts)}")
    opened = int(np.searchsorted(recording.time, ends["open"]))
    return recording.frames[opened], at("lifted_writhe", "open")


def helix(beside):
    """The supplement's helix: eight longitudinal muscles that contract in turn along the arm at level 1, no oblique muscle."""
    programme = tasks.programme("si9")
    plant = oc.make_plant("assembly", scene=programme.scene)
    begin, stopped = process_time(), ""
    try:
        recording = plant.advance(programme.activation, programme.duration)
    except PlantUnstableError as error:
        recording, stopped = error.recording, str(error)
    trace = measure(recording.time, recording.points, recording.frames)
    spent = f"{recording.time[-1]:.2f} of {programme.duration:g} s simulated in {process_time() - begin:.0f} s of processor time"
    print(f"\nhelix without oblique muscles (supplement): {spent}")
    if stopped:
        print(f"  {stopped}")
    print(f"  {'t':>6} {'Tw':>7} {'Wr':>7} {'suckers':>8}   by stretch from base to tip (1 inward, -1 outward)")
    for instant in np.arange(1.0, recording.time[-1] + 1e-9, 1.0):
        k = int(np.searchsorted(recording.time, instant - 1e-9))
        mean, parts = suckers(recording.frames[k])
        turns = f"{trace.twist[k]:+7.2f} {trace.lifted_writhe[k]:+7.2f}"
        print(f"  {instant:5.1f}s {turns} {mean:+8.2f}   {' '.join(f'{part:+.2f}' for part in parts)}")
    for frames, writhe in beside:
        mean, parts = suckers(frames)
        print(f"  oblique and longitudinal muscles, 'open', Wr {writhe:+.2f}: {mean:+.2f}   {' '.join(f'{part:+.2f}' for part in parts)}")


def main():
    wanted = sys.argv[1:] or ["coil", "helix"]
    warmup("assembly")
    beside = [coil(label, changes) for label, changes in SIDES.items()] if "coil" in wanted else []
    if "helix" in wanted:
        helix(beside)


if __name__ == "__main__":
    main()
