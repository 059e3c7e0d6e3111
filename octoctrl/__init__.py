"""octoctrl: plan the muscle activations of a soft arm in the language of topology, and verify them on a Cosserat simulator.

>>> import octoctrl as oc
>>> plan = oc.plan("coil")  # doctest: +SKIP
>>> run = oc.execute(plan)  # doctest: +SKIP
>>> print(oc.verify(run))  # doctest: +SKIP
"""

import importlib
from pathlib import Path
from typing import TYPE_CHECKING

# In a source checkout `sim/` and `planners/` stand beside this folder; this makes them importable as octoctrl.sim and octoctrl.planners.
if (Path(__file__).parent.parent / "sim" / "arm.py").is_file():
    __path__.append(str(Path(__file__).parent.parent))

__version__ = "0.1.0"

if TYPE_CHECKING:
    from octoctrl.planners.plan import Plan
    from octoctrl.planners.schedule import Bend, BendWave, Elongate, Schedule, Shorten, Twist
    from octoctrl.planners.task import Drive, Goal, Phase, Task
    from octoctrl.sim.activation import Activation, Plateau, Wave
    from octoctrl.sim.arm import Arm
    from octoctrl.sim.batch import simulate_batch
    from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
    from octoctrl.sim.plant import Plant
    from octoctrl.sim.scene import Scene, Water
    from octoctrl.sim.trace import TopologyConvention, TopologyTrace

    from . import tasks
    from .comparison import compare
    from .execution import execute
    from .planning import plan
    from .plants import make_plant
    from .plots import plot
    from .results import Execution, Verdict
    from .store import load, save
    from .verification import verify

_HOMES = {
    "octoctrl.planners.plan": ("Plan",),
    "octoctrl.planners.schedule": ("Bend", "BendWave", "Elongate", "Schedule", "Shorten", "Twist"),
    "octoctrl.planners.task": ("Drive", "Goal", "Phase", "Task"),
    "octoctrl.sim.activation": ("Activation", "Plateau", "Wave"),
    "octoctrl.sim.arm": ("Arm",),
    "octoctrl.sim.batch": ("simulate_batch",),
    "octoctrl.sim.errors": ("OctoctrlError", "PlantUnstableError"),
    "octoctrl.sim.plant": ("Plant",),
    "octoctrl.sim.scene": ("Scene", "Water"),
    "octoctrl.sim.trace": ("TopologyConvention", "TopologyTrace"),
    "octoctrl.comparison": ("compare",),
    "octoctrl.execution": ("execute",),
    "octoctrl.planning": ("plan",),
    "octoctrl.plants": ("make_plant",),
    "octoctrl.plots": ("plot",),
    "octoctrl.results": ("Execution", "Verdict"),
    "octoctrl.store": ("load", "save"),
    "octoctrl.verification": ("verify",),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "Activation",
    "Arm",
    "Bend",
    "BendWave",
    "Drive",
    "Elongate",
    "Execution",
    "Goal",
    "OctoctrlError",
    "Phase",
    "Plan",
    "Plant",
    "PlantUnstableError",
    "Plateau",
    "Scene",
    "Schedule",
    "Shorten",
    "Task",
    "TopologyConvention",
    "TopologyTrace",
    "Twist",
    "Verdict",
    "Water",
    "Wave",
    "compare",
    "execute",
    "load",
    "make_plant",
    "plan",
    "plot",
    "save",
    "simulate_batch",
    "tasks",
    "verify",
]


def __getattr__(name):
    if name == "tasks":
        return importlib.import_module("octoctrl.tasks")
    if name not in _HOME_OF:
        raise AttributeError(f"module 'octoctrl' has no attribute '{name}' ({', '.join(__all__)})")
    value = getattr(importlib.import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted({*globals(), *__all__})
