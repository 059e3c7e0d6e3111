"""One run of a sweep, in whatever process it is carried out: a plain dict in, a row of plain values out."""

import hashlib
from collections.abc import Mapping
from functools import lru_cache
from time import perf_counter
from typing import Any

from octoctrl.planners.solving.plan import Plan
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.plants import make_plant
from octoctrl.sim.running.sensors import Sensors

from ..carrying.execution import execute
from ..carrying.planning import plan as make_plan
from ..files.store import load
from ..judging.verification import verify
from ..tables import plain
from .sweep_file import configuration_of, part


@lru_cache(maxsize=4)
def _plan(path: str) -> Plan:
    loaded: Plan = load(path, expect="Plan")
    return loaded


def carry_out(job: Mapping[str, Any]) -> dict[str, Any]:
    """Plan, unless there is a plan, run and verify.

    Parameters
    ----------
    job : mapping
        As `octoctrl.connect.sweep_file.Sweep.jobs` makes it.

    Returns
    -------
    dict
        ``index``, ``key``, the changes, ``status`` (of the run, of a plan without solution, or ``refused``), ``verdict`` and its checks,
        ``note``, a ``hash`` of the motion, and ``seconds``.
    """
    begin = perf_counter()
    row = {"index": job["index"], "key": job["key"], **job["changes"]}
    try:
        row |= _outcome(job)
    except (OctoctrlError, PlantUnstableError) as error:
        row |= {"status": "refused", "note": str(error)}
    found: dict[str, Any] = plain(row | {"seconds": round(perf_counter() - begin, 4)})
    return found


def _outcome(job: Mapping[str, Any]) -> dict[str, Any]:
    changes = job["changes"]
    configuration = configuration_of(job["configuration"], changes)
    plan = _plan(job["plan"]) if job["plan"] else make_plan(configuration)
    if not plan.status.solved and not job["plan"]:
        return {"status": plan.status.name.lower(), "note": plan.report.reason}
    asked = part(changes, "sensors")
    sensors = Sensors(**{"seed": job["seed"]} | asked) if asked else None
    settled = configuration.run
    plant = make_plant(settled.plant, configuration.arm, configuration.scene, gains=part(changes, "gains"))
    run = execute(plan, feedback=settled.feedback, plant=plant, period=settled.period, sensors=sensors, allow_unsolved=True)
    verdict = verify(run)
    checks = {check.name: check.value for check in verdict.checks}
    found = hashlib.sha256(run.recording.points.tobytes()).hexdigest()[:16]
    return {"status": run.status.name.lower(), "verdict": str(verdict.status), **checks, "note": run.recording.note, "hash": found}
