"""The reduced model as a python-control system: linearise it about a pose, look at its poles and its step response, check on the plant.

Hill's law brakes lengthening more than shortening; a linear model at rest knows one mean viscosity and lies between the two.

Run with ``python examples/06_reduced_model_to_control.py [--quick]``; leaves ``06_reduced_model_to_control.png``.
"""

import sys

import control
import matplotlib.pyplot as plt
import numpy as np

import octoctrl as oc
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.topology.measures import measure

PERIOD, HAND, LEVEL, CHANGE, AT = 0.05, "R-OM", 0.15, 0.02, 3.0


def activation(before, after):
    """Hold one level up to the time AT, another one from then on."""
    timing = {"offset": AT, "fall": 1e-3} if after < before else {"onset": AT, "rise": 1e-3}
    step = oc.Plateau(groups=(HAND,), level=abs(after - before), **timing)
    return oc.Activation(composition="add", templates=(oc.Plateau(groups=(HAND,), level=min(before, after)), step))


def main(quick=False):
    arm, scene, after = oc.Arm.octopus(), oc.Scene.free(), 1.0 if quick else 2.0
    model = load_identified(arm, scene).model
    pose, held = model.respond(activation(LEVEL, LEVEL), AT).strains[-1:], model.levels(activation(LEVEL, LEVEL), [AT])
    a, b, _ = model.linearise(model.simulate(held, [PERIOD], start=pose[0]), held, [PERIOD])
    slopes = model.outputs(pose)[1][0, 0].reshape(1, -1)  # of twist
    column = b[0][:, MUSCLE_GROUPS.index(HAND)].sum(axis=1, keepdims=True)  # one input: the level in all sections at once
    system = control.ss(a[0], column, slopes, 0, PERIOD, inputs=["level"], outputs=["twist"])

    rates = np.sort(-np.log(np.abs(system.poles())) / PERIOD)
    print(f"{system.nstates} states, dc gain {system.dcgain().real:+.2f} turns per unit of {HAND} at level {LEVEL}")
    print("slowest rates 1/s:", " ".join(f"{rate:.2f}" for rate in rates[:6]))
    linear, plant = control.step_response(system, T=np.arange(0.0, after + 1e-9, PERIOD)), {}
    for name, change in (("plant, up", CHANGE), ("plant, down", -CHANGE)):
        recording = oc.Plant(arm, scene).advance(activation(LEVEL, LEVEL + change), AT + after)
        twist = measure(recording.time, recording.points, recording.frames).twist
        plant[name] = np.interp(AT + linear.time, recording.time, (twist - np.interp(AT, recording.time, twist)) / change)
    curves = {"linear": linear.outputs.ravel()} | plant
    print(f"{'time s':>7}" + "".join(f"{name:>13}" for name in curves) + "   turns per unit of level")
    for k in range(0, linear.time.size, 4):
        print(f"{linear.time[k]:7.2f}" + "".join(f"{values[k]:+13.3f}" for values in curves.values()))

    figure, axes = plt.subplots(layout="constrained")
    for (name, values), colour in zip(curves.items(), ("#D55E00", "#0072B2", "#56B4E9"), strict=True):
        axes.plot(linear.time, values, color=colour, label=name)
    axes.set(xlabel="time after a step of the level [s]", ylabel="twist [turns per unit of level]")
    axes.legend(frameon=False)
    figure.savefig("06_reduced_model_to_control.png", dpi=150)


if __name__ == "__main__":
    main(quick="--quick" in sys.argv)
