"""A plan: schedule of primitives, predicted shape and predicted topology, with an honest status."""

from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from octoctrl.sim.arm import Arm
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene import Scene
from octoctrl.sim.trace import TopologyTrace

from .schedule import Schedule
from .task import Task


class PlanStatus(Enum):
    """How planning ended; the value is a sentence that says what to do next."""

    SOLVED = "Solved: every goal is met within its tolerance on the reduced model; run it on the plant."
    UNREACHABLE = "Unreachable: a goal lies outside what the arm can do at the allowed levels; lower it or allow more activation."
    INFEASIBLE = "Infeasible: no plan meets all goals; relax the goal named in the statistics, or allow longer phases."
    TIME_LIMIT = "Stopped at the time limit: the best plan so far is kept; pass it as the guess or raise time_limit."
    ITERATION_LIMIT = "Stopped at the iteration limit: the best plan so far is kept; pass it as the guess or raise max_iterations."


class PlanFailedError(RuntimeError):
    """A plan was asked to be strict and did not meet its goals."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Result of planning.

    Attributes
    ----------
    task, arm, scene : what was planned for
    schedule : Schedule
    phase_begins : dict of str to float, s
        In order; the schedule's duration ends the last phase.
    time : (T,) float64, s
    strains : (T, S, 4) float64
        Predicted section strains k1, k2, k3 (1/m) and stretch.
    trace : TopologyTrace
        Predicted topology, by the formula that also measures the plant.
    status : PlanStatus
    statistics : dict
        Wall times, iterations, largest goal violation, headroom, model fingerprint and the like.
    """

    task: Task
    arm: Arm
    scene: Scene
    schedule: Schedule
    phase_begins: dict[str, float]
    time: np.ndarray
    strains: np.ndarray
    trace: TopologyTrace
    status: PlanStatus
    statistics: dict = field(default_factory=dict)

    def raise_if_failed(self):
        """Return the plan if it is solved.

        Raises
        ------
        PlanFailedError
            Otherwise, with the status' sentence.
        """
        if self.status is not PlanStatus.SOLVED:
            raise PlanFailedError(self.status.value)
        return self

    def check_arm(self, arm):
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
