"""How well the task `copy` follows the centreline that it copies: over the arm and all the time, not at the copied instants alone.

Run with ``python benchmarks/copying.py`` (a quarter of a minute on the rod); names of plants choose others (``assembly-coarse-mixed``: a
minute).
"""

import sys
import time
from pathlib import Path

import numpy as np

import octoctrl as oc
from octoctrl import tasks
from octoctrl.files.centreline import read_centreline
from octoctrl.planners.asking.goals.shape import nodes

TABLE = Path(tasks.__file__).parent / "library" / "copy.csv"


def off(run, centreline, pole):
    """Root mean square distance over points and instants, in arm lengths; rms and largest error of lifted writhe, turns."""
    times = centreline.time[centreline.time <= run.recording.time[-1] + 1e-9]
    shares = np.linspace(0.0, run.plan.arm.length, centreline.points.shape[1])
    away, edges = [], nodes(run.recording.stations)
    for instant, wanted in zip(times, centreline.points, strict=False):
        points = run.recording.points[np.argmin(np.abs(run.recording.time - instant))]
        away.append(np.stack([np.interp(shares, edges, axis) for axis in points.T], axis=1) - wanted)
    trace = oc.topology_of(centreline, pole=pole).trace
    writhe = np.interp(times, run.trace.time, run.trace.lifted_writhe) - np.interp(times, trace.time, trace.lifted_writhe)
    distance = np.sqrt(np.mean(np.sum(np.square(away), axis=2)))
    return distance / run.plan.arm.length, np.sqrt(np.mean(writhe**2)), np.abs(writhe).max()


def main(plants):
    centreline = read_centreline(TABLE)
    for plant in plants or ["rod"]:
        begin = time.process_time()
        plan = oc.plan(tasks.load("copy", overrides=[f"run.plant={plant}"]), time_limit=600.0)
        print(f"copy, planned for {plant} in {time.process_time() - begin:.1f} processor s: {plan.status.value}", flush=True)
        for feedback in ("open-loop", "tvlqr"):
            run = oc.execute(plan, feedback=feedback, allow_unsolved=True)
            distance, writhe, most = off(run, centreline, plan.task.convention.pole)
            checks = oc.verify(run).checks
            print(f"  {feedback:9}  {distance:6.2%} of the length off, writhe {writhe:.3f} rms, {most:.3f} turns at most", end="")
            print(f", verdict {sum(check.passed for check in checks)} of {len(checks)}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
