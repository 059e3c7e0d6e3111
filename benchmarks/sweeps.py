"""A sweep of 200 runs on processes and on dask, a worker killed in each: are the tables equal, and what does a run cost?

python benchmarks/sweeps.py PLAN.npz [--runs 200] [--jobs 2]
"""

import argparse
import contextlib
import logging
import multiprocessing
import os
import signal
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import octoctrl as oc
from octoctrl.progress import NullProgress

SWEEP = """plan = "{plan}"
runs = {runs}
[set]
"run.feedback" = "open-loop"
[grid]
"gains.R-OM" = [0.8, 0.9, 1.0, 0.7]
"sensors.angle_noise" = [0.0, 0.01]
[random]
"scene.water.factor" = [0.5, 2.0]
"""


class Killer(NullProgress):
    """Kills a worker when a third of the runs is there."""

    def __init__(self, workers, total):
        self._workers, self._at = workers, total // 3

    def advance(self, done, note=""):
        """Kill when it is time."""
        if self._at and done >= self._at:
            self._at = 0
            victim = self._workers()[0]
            print(f"  killing process {victim} after {done:.0f} runs", flush=True)
            os.kill(victim, signal.SIGKILL)


def bare(rows):
    return [{name: value for name, value in row.items() if name != "seconds"} for row in rows]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("plan", type=Path)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    import distributed

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sweep.toml"
        path.write_text(SWEEP.format(plan=options.plan.resolve(), runs=options.runs // 8))
        total = options.runs // 8 * 8

        def processes():
            return [child.pid for child in multiprocessing.active_children()]

        begin = perf_counter()
        found = {"processes": oc.sweep(path, jobs=options.jobs, output=path.with_name("p.jsonl"), progress=Killer(processes, total))}
        print(f"processes: {len(found['processes'])} rows in {perf_counter() - begin:.1f} s")
        settings = {"n_workers": options.jobs, "threads_per_worker": 1, "dashboard_address": None, "local_directory": folder}
        with distributed.LocalCluster(**settings) as cluster, distributed.Client(cluster) as client, contextlib.suppress(ValueError):

            def workers():
                return [worker.process.pid for worker in cluster.workers.values()]

            begin = perf_counter()
            executor = client.get_executor(pure=False)
            found["dask"] = oc.sweep(path, executor=executor, output=path.with_name("d.jsonl"), progress=Killer(workers, total))
            print(f"dask: {len(found['dask'])} rows in {perf_counter() - begin:.1f} s")
    seconds = sorted(row["seconds"] for row in found["processes"])
    print(f"a run: median {seconds[len(seconds) // 2]:.3f} s of wall time; {len({row['hash'] for row in found['dask']})} different motions")
    equal = bare(found["processes"]) == bare(found["dask"])
    print(f"tables equal: {equal}; statuses: {sorted({row['status'] for row in found['dask']})}")
    return 0 if equal else 1


if __name__ == "__main__":
    sys.exit(main())
