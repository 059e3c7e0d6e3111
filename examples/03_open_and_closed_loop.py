"""What feedback is worth: one plan, a plant whose muscles are weaker and whose water is heavier than the planner knows.

Run with ``python examples/03_open_and_closed_loop.py [--quick]``; leaves ``03_open_and_closed_loop.png``.
"""

import sys
from dataclasses import replace

import matplotlib.pyplot as plt

import octoctrl as oc


def other_plant(arm, *, longitudinal=1.0, oblique=1.0, drag=1.0):
    """A plant with other active stresses (the passive ones are kept) and another drag than the plan's."""
    changed = replace(arm, longitudinal=arm.longitudinal.stronger(longitudinal), oblique=arm.oblique.stronger(oblique))
    return oc.Plant(changed, oc.Scene.free(factor=drag))


def main(quick=False):
    plan = oc.plan("coil")
    cases = {"as planned": {}, "LM -20 %": {"longitudinal": 0.8}, "OM -20 %": {"oblique": 0.8}, "drag x 2": {"drag": 2.0}}
    cases["all three"] = {key: value for case in cases.values() for key, value in case.items()}
    if quick:
        cases = {"all three": cases["all three"]}
    figure, axes = plt.subplots(len(cases), squeeze=False, sharex=True, figsize=(7, 2.0 + 1.3 * len(cases)), layout="constrained")

    print(f"{'plant':>12} {'feedback':>10} {'writhe rms':>11} {'twist rms':>10} {'goals missed':>13}")
    for panel, (name, changes) in zip(axes[:, 0], cases.items(), strict=True):
        for feedback, style in (("open-loop", "#E69F00"), ("tvlqr", "#0072B2")):
            run = oc.execute(plan, feedback=feedback, plant=other_plant(plan.arm, **changes))
            numbers = oc.compare(run).summary()
            missed = sum(not check.passed for check in oc.verify(run).checks if "." in check.name)
            print(f"{name:>12} {feedback:>10} {numbers['lifted_writhe_rms']:11.3f} {numbers['twist_rms']:10.3f} {missed:13d}")
            panel.plot(run.trace.time, run.trace.lifted_writhe, color=style, lw=2, label=feedback)
        panel.plot(plan.trace.time, plan.trace.lifted_writhe, "k--", lw=1, label="planned")
        panel.set_ylabel(f"{name}\nlifted writhe")
    axes[0, 0].legend(frameon=False)
    axes[-1, 0].set_xlabel("time [s]")
    figure.savefig("03_open_and_closed_loop.png", dpi=150)


if __name__ == "__main__":
    main(quick="--quick" in sys.argv)
