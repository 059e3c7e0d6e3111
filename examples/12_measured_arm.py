"""A filmed arm from a CSV file: 17 points that hang, swing and coil, with 0.3 mm of noise; with and without markers on its skin.

The file is made up here, so that it can be compared with what is true; one of your own looks the same.
"""

import csv
import sys
import tempfile
from pathlib import Path

import numpy as np

import octoctrl as oc
from octoctrl.pictures.measured import plot_measured

POINTS, INSTANTS, NOISE, SKIN = 17, 40, 0.3, 6.0  # mm
QUICK = "--quick" in sys.argv
times = np.linspace(0.0, 2.0, 12 if QUICK else INSTANTS)
draw = np.random.default_rng(7)


def arm(share):
    """An arm of 200 mm that hangs along -z, then coils by 1.2 turns while it is twisted once: points and markers (n, 3), mm."""
    s = np.linspace(0.0, 200.0, POINTS)
    psi, turns = np.radians(90.0 - 55.0 * share), 1.2 * share
    angle = 2 * np.pi * turns * s / 200.0
    radius = 200.0 * np.cos(psi) / (2 * np.pi * turns) if share else 0.0
    points = np.stack([radius * (np.cos(angle) - 1), radius * np.sin(angle), -s * np.sin(psi)], axis=1)
    around = angle + 2 * np.pi * share * s / 200.0
    return points, points + SKIN * np.stack([np.cos(around), np.sin(around), 0 * s], axis=1)


def write(path, lines):
    """One row for each point of each line at each instant; units stand in the headings."""
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["time [s]", "point", "x [mm]", "y [mm]", "z [mm]", "line"])
        for time in times:
            for line, places in zip(lines, arm(time / times[-1]), strict=False):
                for index, place in enumerate(places + NOISE * draw.standard_normal(places.shape)):
                    table.writerow([f"{time:.3f}", index, *(f"{value:.3f}" for value in place), line])


with tempfile.TemporaryDirectory() as folder:
    for name, lines in (("without-markers", ["axis"]), ("with-markers", ["axis", "skin"])):
        path = Path(folder) / f"{name}.csv"
        write(path, lines)
        found = oc.topology_of(oc.read_centreline(path), sections=3)
        print(found, end="\n\n")
plot_measured(found, "12_measured_arm.png", overwrite=True)
