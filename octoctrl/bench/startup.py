"""Start-up, each in a process of its own: import, first step compiled anew and from the cache, and the memory that this takes."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

from octoctrl.sim.errors import OctoctrlError

from ..tables import Table

FIRST_STEP = """
from octoctrl.sim.activation import Activation
from octoctrl.sim.plants import make_plant
plant = make_plant("{plant}")
plant.advance(Activation(), plant.sample_interval)
"""

REPORT = """
import json, resource
spent = resource.getrusage(resource.RUSAGE_SELF)
try:  # Linux counts the parent's memory at the fork into ru_maxrss
    peak = next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM")) / 1e3
except OSError:
    peak = spent.ru_maxrss / 1e6
print(json.dumps([spent.ru_utime + spent.ru_stime, peak]))
"""


def child(code: str, cache: str | Path | None = None) -> tuple[float, float, float]:
    """Run code in a fresh interpreter.

    Parameters
    ----------
    code : str
    cache : path, optional
        Folder for compiled code instead of the usual one.

    Returns
    -------
    float, float, float
        Wall time and processor time, s, and largest resident memory, MB.

    Raises
    ------
    OctoctrlError
        If it fails.
    """
    places = dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path)))
    environment = places if cache is None else places | {"NUMBA_CACHE_DIR": str(cache)}
    begin = perf_counter()
    done = subprocess.run([sys.executable, "-P", "-c", code + REPORT], env=environment, capture_output=True, text=True)
    wall = perf_counter() - begin
    if done.returncode:
        raise OctoctrlError(f"start-up failed: {done.stderr.strip().splitlines()[-1]}")
    spent, peak = json.loads(done.stdout.splitlines()[-1])
    return wall, spent, peak


def startup(*, full: bool = False) -> Table:
    """Time and memory of the first step; with `full` of the assembly too."""
    rows: list[tuple[Any, ...]] = [("import octoctrl", *child("import octoctrl"), None)]
    rows.append(("octoctrl --help", *child("from octoctrl.cli.application import main; main(['--help'])"), None))
    models = {"rod arm": ("rod", (30.0, 3.0))}
    if full:
        models["arm of 197 rods"] = ("assembly", (90.0, 3.0))
    for name, (plant, limits) in models.items():
        code = FIRST_STEP.format(plant=plant)
        with tempfile.TemporaryDirectory() as cache:
            for state, limit in zip(("compiled anew", "from the cache"), limits, strict=True):
                rows.append((f"{name}: first step, {state}", *child(code, cache), limit))
    return Table(
        name="startup", title="Start-up", rows=tuple(rows),
        columns=("what", "wall, s", "CPU, s", "memory, MB", "goal, s"), formats=("", ".2f", ".2f", ".0f", ".0f"),
        note="Each line is a process of its own, interpreter included; wall times once, on a machine that may be busy, where the processor "
        "time tells more. Memory is the largest resident set.",
    )  # fmt: skip
