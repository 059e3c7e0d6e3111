"""A batch: 64 arms of different taper pull the same muscle at different levels, side by side on all cores.

Run with ``python examples/07_batch.py [--quick]``; leaves ``07_batch.png``.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import octoctrl as oc


def main(quick=False):
    tapers, levels = np.linspace(2.0, 16.0, 2 if quick else 8), np.linspace(0.05, 0.4, 3 if quick else 8)
    plants = [oc.Plant(oc.Arm.octopus(taper=taper)) for taper in tapers for _ in levels]
    pulls = [oc.Activation(templates=(oc.Plateau(groups=("LM1", "LM2"), level=level),)) for _ in tapers for level in levels]
    result = oc.simulate_batch(plants, pulls, 2.0)
    for failure in result.failures:
        print(failure)

    def turned(recording):
        """Angle between the arm's ends, degrees, from the frames' axes d3."""
        axes = recording.frames[-1, :, 2]
        return np.degrees(np.arccos(np.clip(np.sum(axes[1:] * axes[:-1], axis=1), -1.0, 1.0)).sum())

    angles = np.reshape([turned(recording) for recording in result.recordings], (tapers.size, levels.size))
    print("taper" + "".join(f"{level:9.2f}" for level in levels) + "   bend in degrees, by level")
    for taper, row in zip(tapers, angles, strict=True):
        print(f"{taper:5.1f}" + "".join(f"{angle:9.1f}" for angle in row))
    print(f"{len(plants)} arms, {result.arm_seconds:.0f} s of arm motion at {result.throughput:.0f} arm-seconds per second")

    figure, axes = plt.subplots(layout="constrained")
    for taper, row in zip(tapers, angles, strict=True):
        axes.plot(levels, row, color=plt.cm.viridis(taper / 20), label=f"taper {taper:.0f}")
    axes.set(xlabel="activation of LM1 and LM2", ylabel="bend after 2 s [degrees]")
    axes.legend(frameon=False)
    figure.savefig("07_batch.png", dpi=150)


if __name__ == "__main__":
    main(quick="--quick" in sys.argv)
