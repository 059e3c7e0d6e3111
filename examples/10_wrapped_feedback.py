"""The built-in feedback inside an object of one's own, which watches what it does, with sensors that are late.

Run with ``python examples/10_wrapped_feedback.py [--quick]``; leaves ``10_wrapped_feedback.png``.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import octoctrl as oc


class Watched:
    """Does what the built-in feedback does, and notes what it sees of the tip."""

    name = "watched"

    def __init__(self, plan):
        self.inner, self.tips = oc.controllers.tvlqr(plan), []

    def levels(self, observation, reading):
        """What the built-in feedback would do."""
        self.tips.append((reading.now, *observation.points[-1]))
        return self.inner.levels(observation, reading)

    def report(self):
        """What the built-in feedback says."""
        return self.inner.report()


def main(quick=False):
    plan = oc.plan("twist")
    delays = (0.05,) if quick else (0.0, 0.05, 0.1)
    figure, axes = plt.subplots(layout="constrained")
    print(f"{'delay ms':>9} {'twist turns':>12} {'error rms':>10} {'tip moves mm':>13}")
    for delay in delays:
        watched = Watched(plan)
        run = oc.execute(plan, feedback=watched, sensors=oc.Sensors(delay=delay) if delay else None)
        error = np.sqrt(np.mean((run.trace.twist - run.planned.twist) ** 2))
        moved = 1e3 * np.ptp(np.array(watched.tips)[:, 1:], axis=0).max()
        print(f"{1e3 * delay:9.0f} {run.trace.twist[-1]:+12.3f} {error:10.4f} {moved:13.1f}")
        axes.plot(run.trace.time, run.trace.twist, label=f"seen {1e3 * delay:.0f} ms late")
    axes.plot(run.trace.time, run.planned.twist, "k--", lw=1, label="planned")
    axes.set(xlabel="time [s]", ylabel="twist [turns]")
    axes.legend(frameon=False)
    figure.savefig("10_wrapped_feedback.png", dpi=150)


if __name__ == "__main__":
    main(quick="--quick" in sys.argv)
