"""Step an arm by hand at 100 Hz while something pulls at its tip, and read tip, strains, link, writhe and twist after every step.

Run with ``python examples/08_step_by_hand.py [--quick]``; leaves ``08_step_by_hand.png``.
"""

import sys
import time

import matplotlib.pyplot as plt
import numpy as np

import octoctrl as oc


def main(quick=False):
    plant, seen, begin = oc.Plant(gains={"LM3": 0.5}), [], 0.0
    for k in range(100 if quick else 500):
        if k == 1:  # the first step loads the compiled code
            begin = time.process_time()
        pull = oc.PointLoad(force=(0.0, 0.0, 5e-4 * np.sin(4 * plant.time)))
        arm = plant.step({"R-OM": 0.2, "LM1": 0.1, "LM3": min(0.1 * plant.time, 0.1)}, 0.01, loads=(pull,))
        position, frame = arm.tip
        seen.append((arm.time, *position, frame[2, 1], np.abs(arm.strains[:, :2]).max(), *arm.topology()))
    speed = (len(seen) - 1) * 0.01 / (time.process_time() - begin)
    table = np.array(seen)

    print("   time    tip, mm                    bend, 1/m      Lk      Wr      Tw")
    for row in table[9 :: len(seen) // 5]:
        print(f"{row[0]:7.2f}" + "".join(f"{1e3 * x:9.1f}" for x in row[1:4]) + f"{row[5]:12.1f}" + "".join(f"{x:8.3f}" for x in row[6:]))
    print(f"{speed:.0f} x real time, of processor time")

    figure, axes = plt.subplots(2, sharex=True, layout="constrained")
    axes[0].plot(table[:, 0], 1e3 * table[:, 1:4], label=["x", "y", "z"])
    axes[0].set(ylabel="tip [mm]")
    axes[1].plot(table[:, 0], table[:, 6:], label=["Lk", "Wr", "Tw"])
    axes[1].set(xlabel="time [s]", ylabel="turns")
    for part in axes:
        part.legend(frameon=False)
    figure.savefig("08_step_by_hand.png", dpi=150)


if __name__ == "__main__":
    main(quick="--quick" in sys.argv)
