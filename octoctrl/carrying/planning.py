"""From a task to a plan: finds the reduced model that belongs to the arm and lets the planner work."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from octoctrl.planners.asking.task import Task
from octoctrl.planners.solving.plan import Plan
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import OctoctrlError, check_kind, check_number
from octoctrl.sim.scene.scene import Scene

from .. import tasks
from ..files.configuration import Configuration
from ..progress import Progress

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from octoctrl.planners.contracts import Observation
    from octoctrl.planners.fitting.identified import IdentifiedModel
    from octoctrl.planners.solving.present import Present


def plan(
    task: str | Path | Configuration | Task,
    *,
    arm: Arm | None = None,
    scene: Scene | None = None,
    plant: str | None = None,
    model: "str | Path | IdentifiedModel | None" = None,
    time_limit: float | None = None,
    guess: Plan | None = None,
    start: "Observation | Present | None" = None,
    executor: "Executor | None" = None,
    progress: Progress | None = None,
    strict: bool = False,
) -> Plan:
    """Plan a task: on the reduced model of an arm, or by simulating where its goals are about what the arm touches.

    Parameters
    ----------
    task : str, Path, Configuration or Task
        Name of a task, path of a task file, or what such a file says.
    arm : Arm, optional
        In place of the configuration's.
    scene : Scene, optional
        In place of the configuration's.
    plant : str, optional
        What the plan is for, by its name in `octoctrl.sim.plants.PLANTS`, in place of the configuration's.
    model : str, Path or IdentifiedModel, optional
        The arm's reduced model as `octoctrl.carrying.identifying.identify` makes it; the one that comes with octoctrl if omitted.
    time_limit : float, s, optional
        Wall-clock limit, in place of the configuration's.
    guess : Plan, optional
        Where to start from; the task's own numbers if omitted.
    start : Observation or Present, optional
        Where the arm is, as the plant shows it, or with what its muscles were told before; at rest if omitted.
    executor : Executor, optional
        Of `concurrent.futures`, or anything like it, over which tasks that touch something are searched; all cores if omitted.
    progress : Progress, optional
        Live display.
    strict : bool
        Whether a plan that does not meet its goals raises.

    Returns
    -------
    Plan
        With an honest status.

    Raises
    ------
    OctoctrlError
        If the task is wrong.
    PlanFailedError
        If `strict` and some goal is not met.
    """
    from octoctrl.planners.solving.grasping import check_objects, is_simulated

    from .identifying import load_model

    configuration = as_configuration(task)
    arm = configuration.arm if arm is None else arm
    scene = configuration.scene if scene is None else scene
    check_kind("arm", arm, Arm)
    check_kind("scene", scene, Scene)
    if guess is not None:
        check_kind("guess", guess, Plan, "what oc.plan gives, or oc.load of its file")
    check_objects(configuration.task, scene)
    identified = load_model(model, arm, scene, configuration.run.plant if plant is None else plant)
    if configuration.plan.sections is not None:
        identified = identified.divided(configuration.plan.sections)
    from octoctrl.planners.solving.scenarios import ERRORS

    limit = configuration.plan.time_limit if time_limit is None else time_limit
    check_number("time_limit", limit, above=0.0, unit="s")
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise OctoctrlError(f"executor is {executor!r}; give one of concurrent.futures, such as ThreadPoolExecutor(4)")
    if is_simulated(configuration.task):
        from .searching import plan_by_search

        for name, given in (("guess", guess), ("start", start)):
            if given is not None:
                raise OctoctrlError(f"task '{configuration.task.name}' is planned by simulating, from rest; leave {name} out")
        found = plan_by_search(
            configuration.task,
            identified.model,
            plant=configuration.run.plant if plant is None else plant,
            time_limit=limit,
            seed=configuration.plan.seed,
            spread=configuration.plan.spread,
            errors={name: getattr(configuration.plan, f"{name}_error") for name in ERRORS},
            executor=executor,
            progress=progress,
        )
        found = replace(found, feedback=configuration.run.feedback, period=configuration.run.period)
        return found.raise_if_failed() if strict else found
    from octoctrl.planners.solving import planner
    from octoctrl.planners.solving.present import Present

    found = planner.plan(
        configuration.task,
        identified,
        time_limit=limit,
        guess=guess,
        present=start if start is None or isinstance(start, Present) else Present.seen(start, identified.model),
        progress=progress,
    )
    # The model may have been identified on a finer plant than the plan is carried out on.
    run = configuration.run
    found = replace(found, plant=run.plant if plant is None else plant, feedback=run.feedback, period=run.period)
    return found.raise_if_failed() if strict else found


def as_configuration(task: str | Path | Configuration | Task) -> Configuration:
    """Make a configuration of a task's name, file or object.

    Parameters
    ----------
    task : str, Path, Configuration or Task

    Returns
    -------
    Configuration
    """
    if isinstance(task, str | Path):
        return tasks.load(task)
    check_kind("task", task, (Task, Configuration), "the name of a task, the path of a file, or what oc.tasks.load gives")
    return Configuration(task=task) if isinstance(task, Task) else task
