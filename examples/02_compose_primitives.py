"""Primitives without a planner: compose a schedule by hand, play it on the plant, look at the topology.

Run with ``python examples/02_compose_primitives.py [--quick]``; leaves ``02_compose_primitives.png``.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import octoctrl as oc
from octoctrl.sim.topology.measures import measure


def main(quick=False):
    duration = 2.5 if quick else 5.0
    schedule = oc.Schedule(
        duration=duration,
        composition="add",
        primitives=(
            oc.Twist(hand="L-OM", level=0.3, onset=0.0, rise=0.5),
            oc.Bend(side="LM3", level=0.25, onset=0.8, rise=1.0, window=(0.08, 0.2)),
            oc.Shorten(level=0.1, onset=1.6, rise=0.5),
        ),
    )
    plant = oc.Plant(oc.Arm.octopus(), oc.Scene.free())
    recording = plant.advance(schedule.activation(), duration)
    trace = measure(recording.time, recording.points, recording.frames, oc.TopologyConvention(pole=(1, 0, 0)))

    print(f"{'time s':>7} {'Tw':>7} {'Wr':>7} {'length mm':>10}")
    for time in np.arange(0.5, duration + 0.01, 0.5):
        k = int(np.argmin(np.abs(trace.time - time)))
        print(f"{trace.time[k]:7.2f} {trace.twist[k]:+7.3f} {trace.lifted_writhe[k]:+7.3f} {1e3 * recording.length[k]:10.1f}")

    figure, axes = plt.subplots(layout="constrained")
    axes.plot(trace.time, trace.twist, color="#D55E00", label="twist Tw")
    axes.plot(trace.time, trace.lifted_writhe, color="#0072B2", label="lifted writhe Wr")
    axes.plot(trace.time, trace.lifted_link, color="#009E73", label="lifted link Lk")
    axes.set(xlabel="time [s]", ylabel="turns")
    axes.legend(frameon=False)
    figure.savefig("02_compose_primitives.png", dpi=150)


if __name__ == "__main__":
    main(quick="--quick" in sys.argv)
