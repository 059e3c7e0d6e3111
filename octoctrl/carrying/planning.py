"""From a task to a plan: finds the reduced model that belongs to the arm and lets the planner work."""

from pathlib import Path

from octoctrl.planners.asking.task import Task

from .. import tasks
from ..files.configuration import Configuration


def plan(task, *, arm=None, scene=None, plant=None, model=None, time_limit=None, guess=None, progress=None, strict=False):
    """Plan a task on the reduced model of an arm.

    Parameters
    ----------
    task : str, Path, Configuration or Task
        Name of a task, path of a task file, or what such a file says.
    arm : Arm, optional
        In place of the configuration's.
    scene : Scene, optional
        In place of the configuration's.
    plant : {"rod", "assembly", "assembly-coarse"}, optional
        What the plan is for, in place of the configuration's.
    model : str, Path or IdentifiedModel, optional
        The arm's reduced model as `octoctrl.carrying.identifying.identify` makes it; the one that comes with octoctrl if omitted.
    time_limit : float, s, optional
        Wall-clock limit, in place of the configuration's.
    guess : Plan, optional
        Where to start from; the task's own numbers if omitted.
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
    from .identifying import load_model

    configuration = as_configuration(task)
    arm = configuration.arm if arm is None else arm
    scene = configuration.scene if scene is None else scene
    identified = load_model(model, arm, scene, configuration.run.plant if plant is None else plant)
    from octoctrl.planners.solving import trajectory

    found = trajectory.plan(
        configuration.task,
        identified,
        time_limit=configuration.plan.time_limit if time_limit is None else time_limit,
        guess=guess,
        progress=progress,
    )
    return found.raise_if_failed() if strict else found


def as_configuration(task):
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
    return Configuration(task=task) if isinstance(task, Task) else task
