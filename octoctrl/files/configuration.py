"""Task files: TOML in, frozen objects out, and every mistake in one sentence that names file, line and key.

The schema is the dataclasses: a key of the file is a field of `Configuration`, `Task`, `Phase`, a goal, `Drive`, `Arm`, `Scene` or `Water`.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from octoctrl.planners.asking.copying import check_like
from octoctrl.planners.asking.task import Task
from octoctrl.planners.following.controllers import check_feedback
from octoctrl.sim.annotations import settle
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import OctoctrlError, check_count, check_number
from octoctrl.sim.plants import check_plant
from octoctrl.sim.scene.scene import Scene

from .conversion import build
from .copying import KEY, copied_centreline
from .meshes import put_meshes
from .toml_source import Source, assign, tables


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSettings:
    """How to plan.

    Attributes
    ----------
    time_limit : float, s
        Wall-clock limit of the optimisation; the best plan so far is kept.
    sections : int, optional
        Of the reduced model, 2 to 40; as many as it was identified with if omitted. A bend that travels is seen as finely as these are.
    seed : int
        Of the numbers that are drawn where a task is searched by simulating.
    spread : float
        How far such a search looks at first from the task's own numbers, over the usual.
    twist_error, bend_error, profile_error, oblique_error : float
        What such a plan must withstand: shares by which twist and bends may come out otherwise, by how much a bend's profile may, and the
        share by which the oblique muscles may pull more or less.
    """

    time_limit: float = 60.0
    sections: int | None = None
    seed: int = 0
    spread: float = 1.0
    twist_error: float = 0.3
    bend_error: float = 0.15
    profile_error: float = 0.25
    oblique_error: float = 0.0

    def __post_init__(self) -> None:
        check_number("time_limit", self.time_limit, above=0.0, unit="s")
        if self.sections is not None:
            check_count("sections", self.sections, at_least=2, at_most=40)
        check_count("seed", self.seed, at_least=0)
        check_number("spread", self.spread, above=0.0, at_most=10.0)
        for name in ("twist_error", "bend_error", "profile_error", "oblique_error"):
            check_number(name, getattr(self, name), at_least=0.0, at_most=0.9)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """How to carry out the plan.

    Attributes
    ----------
    feedback : {"tvlqr", "mpc", "grip", "open-loop"}
        What corrects the activations while the plant moves.
    plant : str
        What the plan is made for and carried out on, by its name in `octoctrl.sim.plants.PLANTS`: one rod, or the full arm of 197 rods.
    period : float, s
        Between corrections; the plant's own if none.
    """

    feedback: str = "tvlqr"
    plant: str = "rod"
    period: float | None = None

    def __post_init__(self) -> None:
        settle(self)
        check_feedback(self.feedback)
        check_plant(self.plant)
        if self.period is not None:
            check_number("period", self.period, above=0.0, unit="s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Configuration:
    """All that a task file says.

    Attributes
    ----------
    task : Task
        What the arm should do.
    arm : Arm
    scene : Scene
    plan : PlanSettings
    run : RunSettings
    """

    task: Task
    arm: Arm = field(default=Arm())
    scene: Scene = field(default=Scene())
    plan: PlanSettings = field(default=PlanSettings())
    run: RunSettings = field(default=RunSettings())


def parse(text: str, *, name: str = "task.toml", overrides: Iterable[str] = (), folder: Path = Path()) -> Configuration:
    """Read a configuration from TOML; a byte-order mark is passed over.

    Parameters
    ----------
    text : str
    name : str
        File name for messages.
    overrides : iterable of str
        Assignments such as ``task.phases.store.duration=1.2``; elements of a list are addressed by their `name` or as ``phases[0]``.
    folder : Path
        Where files stand that the text names.

    Returns
    -------
    Configuration

    Raises
    ------
    OctoctrlError
        If anything is wrong, with file, line and key.
    """
    text = text.removeprefix("\ufeff")
    data = tables(text, name)
    source = Source(name, text)
    for assignment in overrides:
        source.overridden.append(assign(data, assignment))
    copied = copied_centreline(data, source, folder)
    put_meshes(data, source, folder)
    made: Configuration = build(Configuration, data, source)
    if copied is not None:
        try:
            check_like(copied, made.arm)
        except OctoctrlError as error:
            raise OctoctrlError(f"{source.where((*KEY, 'file'))}: {error}") from None
    return made
