"""A controller of one's own: a function u = f(t, observation) that holds a length by pulling along or squeezing the arm.

Run with ``python examples/05_own_controller.py [--quick]``; leaves ``05_own_controller.png``.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import octoctrl as oc
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS


class LengthController:
    """Proportional and integral; shortens with the longitudinal muscles, elongates with the transverse muscle."""

    def __init__(self, wanted, proportional=3.0, integral=15.0):
        self.wanted, self.proportional, self.integral = wanted, proportional, integral
        self.sum, self.before = 0.0, 0.0

    def __call__(self, time, observation):
        """Levels of the muscle groups; those not named rest."""
        length = np.linalg.norm(np.diff(observation.points, axis=0), axis=1).sum()
        error = self.wanted(time) / length - 1
        effort = float(np.clip(self.proportional * error + self.sum, -0.6, 0.6))
        if abs(effort) < 0.6:  # the integral waits while the muscles are at their bound
            self.sum += self.integral * error * (time - self.before)
        self.before = time
        return {"TM": max(effort, 0.0)} | dict.fromkeys(LONGITUDINAL_GROUPS, max(-effort, 0.0))


def main(quick=False):
    hold = 2.0 if quick else 4.0
    rest, steps = oc.Arm.octopus().length, [(0.0, 0.9), (hold, 1.05), (2 * hold, 1.0)]

    def wanted(time):
        return rest * next(share for begin, share in reversed(steps) if time >= begin - 1e-9)

    task = oc.Task(  # only says how long to run: no goals, and the drive's activation is replaced by the controller's
        name="length",
        phases=(oc.Phase(name="follow", duration=3 * hold, longest=20.0),),
        drives=(oc.Drive(name="pull", primitive=oc.Shorten(), begins="follow", free=()),),
    )
    run = oc.execute(oc.plan(task), feedback=LengthController(wanted), period=0.02)
    time, length = run.recording.time, run.recording.length
    print(f"{'step':>5} {'wanted mm':>10} {'reached mm':>11} {'error mm':>9}")
    for number, (begin, share) in enumerate(steps, start=1):
        end = 1e3 * float(np.interp(min(begin + hold, 3 * hold) - 0.05, time, length))
        print(f"{number:5d} {1e3 * rest * share:10.1f} {end:11.1f} {end - 1e3 * rest * share:+9.2f}")
    figure, axes = plt.subplots(layout="constrained")
    axes.plot(time, 1e3 * length, color="#0072B2", label="measured")
    axes.plot(time, [1e3 * wanted(t) for t in time], "k--", lw=1, label="wanted")
    axes.set(xlabel="time [s]", ylabel="arm length [mm]")
    axes.legend(frameon=False)
    figure.savefig("05_own_controller.png", dpi=150)


if __name__ == "__main__":
    main(quick="--quick" in sys.argv)
