"""octoctrl: plan the muscle activations of a soft arm in the language of topology, and verify them on a Cosserat simulator.

>>> import octoctrl as oc
>>> plan = oc.plan("coil")  # doctest: +SKIP
>>> run = oc.execute(plan)  # doctest: +SKIP
>>> print(oc.verify(run))  # doctest: +SKIP
"""

import importlib.util
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any


def _find_in_checkout(name: str) -> None:
    """In a source checkout, take `sim` or `planners` from the folder beside this one: those two and nothing else of the checkout."""
    folder = Path(__file__).parent.parent / name
    if not (folder / "py.typed").is_file() or (Path(__file__).parent / name).exists():
        return
    spec = importlib.util.spec_from_file_location(f"{__name__}.{name}", folder / "__init__.py", submodule_search_locations=[str(folder)])
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    globals()[name] = module


for _name in ("sim", "planners"):
    _find_in_checkout(_name)

__version__ = "0.1.0"

if TYPE_CHECKING:
    from octoctrl.planners.asking.goals.measured import MeasuredGoal, ScalarGoal
    from octoctrl.planners.asking.primitives import Bend, BendWave, CarriedBend, Elongate, Shorten, Twist, TwistWave
    from octoctrl.planners.asking.registry import goal, register_goal, register_primitive
    from octoctrl.planners.asking.schedule import Schedule
    from octoctrl.planners.asking.task import Drive, Phase, Task
    from octoctrl.planners.following import controllers
    from octoctrl.planners.solving.plan import Plan
    from octoctrl.sim.activation import Activation
    from octoctrl.sim.body.arm import Arm
    from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
    from octoctrl.sim.plants import Plant, make_plant
    from octoctrl.sim.running.batch import simulate_batch
    from octoctrl.sim.running.sensors import Sensors
    from octoctrl.sim.scene.loads import PointLoad, SpreadLoad
    from octoctrl.sim.scene.scene import Scene, Water
    from octoctrl.sim.templates import Plateau, Pulse, Wave
    from octoctrl.sim.topology.centreline import Centreline
    from octoctrl.sim.topology.measured import topology_of
    from octoctrl.sim.topology.trace import TopologyConvention, TopologyTrace

    from . import tasks
    from .carrying.execution import execute, resume
    from .carrying.planning import plan
    from .carrying.results import Execution, Verdict
    from .connect.sweep import sweep
    from .files.centreline import read_centreline
    from .files.fibres import read_fibres
    from .files.meshes import read_mesh
    from .files.store import load, save
    from .judging.comparison import compare
    from .judging.verification import verify
    from .pictures.export import export
    from .pictures.live import View
    from .pictures.plots import plot
    from .pictures.report import report

_HOMES = {
    "octoctrl.planners.solving.plan": ("Plan",),
    "octoctrl.planners.asking.goals.measured": ("MeasuredGoal", "ScalarGoal"),
    "octoctrl.planners.asking.primitives": ("Bend", "BendWave", "CarriedBend", "Elongate", "Shorten", "Twist", "TwistWave"),
    "octoctrl.planners.asking.registry": ("goal", "register_goal", "register_primitive"),
    "octoctrl.planners.asking.schedule": ("Schedule",),
    "octoctrl.planners.asking.task": ("Drive", "Phase", "Task"),
    "octoctrl.sim.activation": ("Activation",),
    "octoctrl.sim.body.arm": ("Arm",),
    "octoctrl.sim.running.batch": ("simulate_batch",),
    "octoctrl.sim.running.sensors": ("Sensors",),
    "octoctrl.sim.errors": ("OctoctrlError", "PlantUnstableError"),
    "octoctrl.sim.scene.loads": ("PointLoad", "SpreadLoad"),
    "octoctrl.sim.scene.scene": ("Scene", "Water"),
    "octoctrl.sim.templates": ("Plateau", "Pulse", "Wave"),
    "octoctrl.sim.topology.centreline": ("Centreline",),
    "octoctrl.sim.topology.measured": ("topology_of",),
    "octoctrl.files.centreline": ("read_centreline",),
    "octoctrl.files.fibres": ("read_fibres",),
    "octoctrl.files.meshes": ("read_mesh",),
    "octoctrl.sim.topology.trace": ("TopologyConvention", "TopologyTrace"),
    "octoctrl.judging.comparison": ("compare",),
    "octoctrl.carrying.execution": ("execute", "resume"),
    "octoctrl.carrying.planning": ("plan",),
    "octoctrl.connect.sweep": ("sweep",),
    "octoctrl.sim.plants": ("Plant", "make_plant"),
    "octoctrl.pictures.export": ("export",),
    "octoctrl.pictures.live": ("View",),
    "octoctrl.pictures.plots": ("plot",),
    "octoctrl.pictures.report": ("report",),
    "octoctrl.carrying.results": ("Execution", "Verdict"),
    "octoctrl.files.store": ("load", "save"),
    "octoctrl.judging.verification": ("verify",),
}
_MODULES = {"controllers": "octoctrl.planners.following.controllers", "tasks": "octoctrl.tasks"}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "Activation",
    "Arm",
    "Bend",
    "BendWave",
    "CarriedBend",
    "Centreline",
    "Drive",
    "Elongate",
    "Execution",
    "MeasuredGoal",
    "OctoctrlError",
    "Phase",
    "Plan",
    "Plant",
    "PlantUnstableError",
    "Plateau",
    "PointLoad",
    "Pulse",
    "ScalarGoal",
    "Scene",
    "Schedule",
    "Sensors",
    "Shorten",
    "SpreadLoad",
    "Task",
    "TopologyConvention",
    "TopologyTrace",
    "Twist",
    "TwistWave",
    "Verdict",
    "View",
    "Water",
    "Wave",
    "compare",
    "controllers",
    "execute",
    "export",
    "goal",
    "load",
    "make_plant",
    "plan",
    "plot",
    "read_centreline",
    "read_fibres",
    "read_mesh",
    "register_goal",
    "register_primitive",
    "report",
    "resume",
    "save",
    "simulate_batch",
    "sweep",
    "tasks",
    "topology_of",
    "verify",
]


if not TYPE_CHECKING:  # type checkers read the imports above, and must see that there is nothing else

    def __getattr__(name: str) -> Any:
        if name in _MODULES:
            return importlib.import_module(_MODULES[name])
        if name not in _HOME_OF:
            raise AttributeError(f"module 'octoctrl' has no attribute '{name}' ({', '.join(__all__)})")
        value = getattr(importlib.import_module(_HOME_OF[name]), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
