"""A plan: schedule of primitives, predicted shape and predicted topology, with an honest status."""

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.records import Record, check_shapes
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.topology.trace import TopologyTrace

from ..asking.schedule import Schedule
from ..asking.task import Task
from ..contracts import Goal
from ..fitting.identified import IdentifiedModel
from ..model.reduced import ReducedModel

Floats = NDArray[np.float64]


class PlanStatus(Enum):
    """How planning ended; the value is a sentence that says what to do next."""

    SOLVED = "Solved: every goal is met on the reduced model, checked at 10 ms; run it on the plant."
    DOUBTFUL = (
        "Solved, but in doubt: every goal is met on the reduced model, yet the plant may do otherwise; use feedback or longer phases."
    )
    UNREACHABLE = "Unreachable: a goal lies outside what the arm can do at the allowed levels; lower it or allow more activation."
    NOT_FOUND = (
        "Not found: the search came no nearer, which proves nothing; relax the goal named here, or give longer phases or more drives."
    )
    OTHER_DRIVES = 'Not with these drives, but with others: take those named here, or leave them to the planner with drives = "choose".'
    UTURN = "Only past a U-turn of the tip, where the branch of writhe is chance: store twist first, or ask for less writhe."
    HELD = "Held: a simulation of the plant itself passes its verdict, and the search's model meets the goals in every scenario; run it."
    FRAGILE = "Held as planned, but not in every scenario: a simulation of the plant itself passes its verdict; run it, and verify it."
    MISSED = "Missed: no candidate passes the verdict in a simulation of the plant, which proves nothing; search longer or ask for less."
    REFUSED = "Refused: the arm's and the object's sizes forbid it."
    TIME_LIMIT = "Stopped at the time limit: the best plan so far is kept; raise time_limit."

    @property
    def solved(self) -> bool:
        """Whether every goal is met: on the reduced model, or in a simulation of the plant where that was searched."""
        return self in (PlanStatus.SOLVED, PlanStatus.DOUBTFUL, PlanStatus.HELD, PlanStatus.FRAGILE)


class PlanFailedError(RuntimeError):
    """A plan was asked to be strict and did not meet its goals."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalReport:
    """A goal of a phase, and by how much it is missed on the reduced model, in the goal's unit."""

    phase: str
    goal: Goal
    miss: float

    @property
    def share(self) -> float:
        """Part of the tolerance that the miss uses up; above 1 the goal is not met."""
        return self.miss / self.goal.tolerance


@dataclass(frozen=True, slots=True, kw_only=True)
class Alternative:
    """Drives that would do as well, where the planner chose them.

    Attributes
    ----------
    drives : tuple of str
    duration : float, s
        Of all phases.
    effort : float, s
        Sum over the drives of the squared level times the time for which it is on.
    worst : float
        Largest miss of a goal on the reduced model, in tolerances.
    opening : float
        Smallest 1 + tip . base up to the last goal of writhe or link; 0 is a U-turn.
    """

    drives: tuple[str, ...]
    duration: float
    effort: float
    worst: float
    opening: float

    def __str__(self) -> str:
        return (
            f"{len(self.drives)} drives ({', '.join(self.drives)}): {self.duration:.2f} s, effort {self.effort:.2f} s, worst miss "
            f"{self.worst:.2f} tolerances, 1 + tip . base at least {self.opening:.2f}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanReport:
    """How a plan came about, and how well it does on the reduced model; also of a plan that was refused.

    Attributes
    ----------
    reason : str
        Why the goals are not met, or what is in doubt; empty if nothing is.
    numbers : dict of str to float
        The unknowns by name: durations of phases (s), free numbers of drives.
    goals : tuple of GoalReport
    spread : tuple of float
        What small errors of the model would do to each goal, in tolerances.
    opening : float
        Smallest 1 + tip . base up to the last goal of writhe or link; 0 is a U-turn.
    headroom : float
        Distance of the highest level from 1, which is left to feedback.
    at_bounds : tuple of str
        Unknowns that stand at one of their bounds.
    extrapolates : tuple of str
        What of the motion lies outside of what the model was identified on.
    alternatives : tuple of Alternative
        Of a task that leaves its drives to the planner: what it found, the one with the fewest drives first, which is the plan's.
    tried : tuple of str
        Of a task that is searched by simulating: what each search tried, with its seed.
    measured : dict of str to float
        Of a task that is searched: what the verdict on the plant reads of the objects, by the names of its checks.
    starts, iterations : int
        Programmes from which the search began; iterations of search and optimiser.
    optimised : bool
        Whether the plan is the optimiser's; otherwise it is the point from which that began.
    optimiser : str
        What the optimiser said last.
    price, first_price : float
        Of the plan, and of the point from which the optimiser began.
    first_duration : float, s
        Of that point.
    stages : dict of str to float
        Processor time of search, optimisation and check, s.
    wall_time : float, s
    """

    reason: str = ""
    numbers: dict[str, float] = field(default_factory=dict)
    goals: tuple[GoalReport, ...] = ()
    spread: tuple[float, ...] = ()
    opening: float = 2.0
    headroom: float = 1.0
    at_bounds: tuple[str, ...] = ()
    extrapolates: tuple[str, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    tried: tuple[str, ...] = ()
    measured: dict[str, float] = field(default_factory=dict)
    starts: int = 0
    iterations: int = 0
    optimised: bool = False
    optimiser: str = ""
    price: float = 0.0
    first_price: float = 0.0
    first_duration: float = 0.0
    stages: dict[str, float] = field(default_factory=dict)
    wall_time: float = 0.0

    @property
    def worst(self) -> GoalReport | None:
        """The goal that uses up most of its tolerance."""
        return max(self.goals, key=lambda goal: goal.share, default=None)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Plan(Record):
    """Result of planning.

    Attributes
    ----------
    task : Task
    model : ReducedModel
        What it was planned on; it knows the arm and the scene.
    schedule : Schedule
    phase_begins : dict of str to float, s
        In order; the schedule's duration ends the last phase.
    time : (T,) float64, s
    strains : (T, S, 4) float64
        Predicted section strains k1, k2, k3 (1/m) and stretch.
    trace : TopologyTrace
        Predicted topology, by the formula that also measures the plant.
    status : PlanStatus
    plant : str
        Name of the plant that it was made for and is carried out on.
    feedback : str
        Name of the controller with which it is carried out.
    period : float, optional, s
        Between corrections; the plant's own if omitted.
    identified : IdentifiedModel, optional
        What it was planned on, with its region of validity and its reach.
    since : float, s
        Reading of its clock from which on it was planned; what lies before is history.
    report : PlanReport
    """

    task: Task
    model: ReducedModel
    schedule: Schedule
    phase_begins: dict[str, float]
    time: Floats
    strains: Floats
    trace: TopologyTrace
    status: PlanStatus
    plant: str = "rod"
    feedback: str = "tvlqr"
    period: float | None = None
    identified: IdentifiedModel | None = None
    since: float = 0.0
    report: PlanReport = field(default_factory=PlanReport)

    def __post_init__(self) -> None:
        # A plan that was refused may have no shapes.
        shapes = ("T" if len(self.strains) else 0, "sections", 4)
        check_shapes("plan", {"time": (self.time, ("T",)), "trace": (self.trace.time, ("T",)), "strains": (self.strains, shapes)})

    @property
    def arm(self) -> Arm:
        """The arm that it was made for."""
        return self.model.arm

    @property
    def scene(self) -> Scene:
        """The scene that it was made for."""
        return self.model.scene

    def __str__(self) -> str:
        phases = [*self.phase_begins.items()]
        ends = [*[begin for _, begin in phases[1:]], self.schedule.duration]
        lines = [
            f"plan '{self.task.name}'   {self.schedule.duration:.2f} s on arm {self.arm.name} ({self.arm.fingerprint})   plant {self.plant}"
        ]
        lines.append(" phase        from     to     twist   lifted writhe   (at its end, predicted)")
        for (name, begin), end in zip(phases, ends, strict=True):
            twist, writhe = (np.interp(end, self.trace.time, getattr(self.trace, key)) for key in ("twist", "lifted_writhe"))
            lines.append(f"  {name:10} {begin:5.2f}  {end:5.2f}    {twist:+6.2f}          {writhe:+6.2f}")
        names = [drive.name for drive in self.task.drives]
        width = max([16, *(len(name) + 2 for name in names)])
        lines.append(f" {'drive':{width + 2}}primitive  muscles       level   onset    rise  offset")
        names += [""] * (len(self.schedule.primitives) - len(names))
        for name, primitive in zip(names, self.schedule.primitives, strict=False):
            groups = "+".join(dict.fromkeys(group for template in primitive.templates() for group in template.groups))
            groups = groups.replace("LM1+LM2+LM3+LM4+LM5+LM6+LM7+LM8", "all LM") or "-"
            numbers = [getattr(primitive, key, np.nan) for key in ("level", "onset", "rise", "offset")]
            cells = "".join(f"{number:8.2f}" if np.isfinite(number) else "       -" for number in numbers)
            lines.append(f"  {name:{width}}{type(primitive).__name__:11}{groups:11}{cells}")
        for other in self.report.alternatives[1:]:
            lines.append(f" or with {other}")
        lines += [f" {line}" for line in self.report.tried]
        lines.append(f" planning: {self.report.wall_time:.2f} s, {self.report.iterations} iterations")
        lines.append(" " + " ".join(filter(None, (self.status.value, self.report.reason))))
        return "\n".join(lines)

    def raise_if_failed(self) -> "Plan":
        """Return the plan if it is solved.

        Raises
        ------
        PlanFailedError
            Otherwise, with the status' sentence.
        """
        if not self.status.solved:
            raise PlanFailedError(self.status.value)
        return self

    def check_arm(self, arm: Arm) -> None:
        """Check that `arm` is the one the plan was made for.

        Raises
        ------
        OctoctrlError
            If it differs in anything but name and resolution.
        """
        if arm.fingerprint != self.arm.fingerprint:
            raise OctoctrlError(
                f"plan was made for arm '{self.arm.name}' (hash {self.arm.fingerprint}), scene has '{arm.name}' ({arm.fingerprint}); "
                "re-plan or pass arm=plan.arm"
            )
