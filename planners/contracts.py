"""What the rooms of the planners ask of one another: goals, primitives, the reduced model, controllers.

Only protocols and the small values that they exchange. Members are read-only; a class need not inherit to fulfil a protocol.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.body.arm import Arm
from octoctrl.sim.contracts import ActivationSource
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.templates import Template
from octoctrl.sim.topology.trace import TopologyTrace

Floats = NDArray[np.float64]
Expression = Any
"""A number, an array, or a CasADi expression of the same shape: what is computed with it must work on each of them."""


class When(Enum):
    """The instants of its phase at which a goal has to hold."""

    END = "end"
    THROUGHOUT = "throughout"


class Outputs(Protocol):
    """What a goal may read of the arm, at T instants.

    On a recording these are arrays of all instants; on the reduced model they are CasADi expressions of one instant, with T = 1 (and a
    quantity of shape (T,) is 1 by 1). A goal calculates with `math`, element by element, sums along the arm by ``row @ weights`` and takes
    a column by ``row[:, index]``, so that one formula serves both.
    """

    @property
    def math(self) -> Any:
        """`numpy` or `casadi`: for ``sqrt, fmax, fmin, sin, cos, atan2``."""
        ...

    @property
    def arm(self) -> Arm:
        """The arm that is read."""
        ...

    @property
    def twist(self) -> Expression:
        """(T,), turns."""
        ...

    @property
    def lifted_writhe(self) -> Expression:
        """(T,), turns."""
        ...

    @property
    def lifted_link(self) -> Expression:
        """(T,), turns."""
        ...

    @property
    def length(self) -> Expression:
        """(T,), m."""
        ...

    @property
    def uturn(self) -> Expression:
        """1 + tip tangent . base tangent, (T,): near zero the writhe's branch is a matter of chance."""
        ...

    @property
    def tip(self) -> Expression:
        """(T, 3), m."""
        ...

    @property
    def tip_tangent(self) -> Expression:
        """Unit vectors (T, 3)."""
        ...

    @property
    def stations(self) -> Floats:
        """Rest arclengths (n + 2,) of the plant's frames, m: base, element centres, tip."""
        ...

    @property
    def curvatures(self) -> tuple[Expression, Expression, Expression]:
        """Material curvatures k1, k2, k3, each (T, n + 1), 1/m: means between neighbouring stations."""
        ...

    @property
    def points(self) -> tuple[Expression, Expression, Expression]:
        """Laboratory x, y, z of the nodes, each (T, n + 1), m."""
        ...


class Reach(Protocol):
    """What an arm can do at rest under levels up to `level`; see `octoctrl.planners.model.reach.ReachLimits`."""

    @property
    def level(self) -> float:
        """Largest level."""
        ...

    @property
    def twist(self) -> dict[str, float]:
        """Stored by each oblique family alone, with its sign, turns."""
        ...

    @property
    def writhe(self) -> float:
        """Largest size of the lifted writhe, turns."""
        ...

    @property
    def length(self) -> tuple[float, float]:
        """Shortest and longest, m."""
        ...


@runtime_checkable
class Goal(Protocol):
    """Something that has to hold in a phase: one definition, read on the reduced model for planning and on the recording for the verdict.

    ``str(goal)`` is the goal in words, for messages: ``"twist -1 ± 0.1 turns"``.
    """

    @property
    def quantity(self) -> str:
        """What it is about, as task files and verdicts call it."""
        ...

    @property
    def when(self) -> When:
        """At the end of its phase, or throughout."""
        ...

    @property
    def hold(self) -> float:
        """For how long before the end it has to hold already, s."""
        ...

    @property
    def tolerance(self) -> float:
        """Largest miss that still counts as reached, in `unit`."""
        ...

    @property
    def unit(self) -> str:
        """``"turns"``, ``"m"``, ``"1/m"``, ``"rad"`` or ``""``."""
        ...

    def miss(self, recording: Recording, trace: TopologyTrace, arm: Arm) -> Floats:
        """By how much it is missed at each instant of a recording, (T,) in `unit`: 0 where it holds exactly."""
        ...

    def residuals(self, outputs: Outputs) -> list[Expression]:
        """Expressions in `unit`, one by one of shape (T,), whose root of the sum of squares is the miss."""
        ...

    def beyond(self, reach: Reach) -> str:
        """Why the arm cannot do it at any time, as what the limit is; empty if nothing is known against it."""
        ...


@runtime_checkable
class Primitive(Protocol):
    """A named motion with a few numbers, as plant and planner see it: a frozen dataclass with an `onset`, mostly an `offset`.

    A search by simulating asks for more where there is more: `spreads`, how far it looks at first from each number; `chosen_anew`, the name
    of the number that depends on the plant; and `carried_out(curve, since)`, the same primitive for the plant whose twist curve is given,
    idle until a time. Who has none of them is searched and carried out as it is.
    """

    def templates(self) -> tuple[Template, ...]:
        """Activation templates; fields may be CasADi expressions."""
        ...

    def bounds(self) -> dict[str, tuple[float, float]]:
        """Allowed range of each number that the planner may choose."""
        ...

    def effort(self, seconds: Expression) -> Expression:
        """Integral of the squared level over the `seconds` for which it is on, s."""
        ...


class ReducedMotion(Protocol):
    """Motion of a reduced model, T instants, S sections."""

    @property
    def time(self) -> Floats:
        """(T,), s."""
        ...

    @property
    def strains(self) -> Floats:
        """(T, S, 4): k1, k2, k3 (1/m) and stretch."""
        ...


class Sensitivity(NamedTuple):
    """A motion and the derivatives (T, S, 4, p) of its strains by p parameters."""

    motion: ReducedMotion
    slopes: Floats


class Linear(NamedTuple):
    """A motion's N steps linearised: next strains by strains (N, 4 S, 4 S), by levels (N, 4 S, groups, S), by all drag's error (N, 4 S)."""

    transition: Floats
    influence: Floats
    drag: Floats


class Observation(Protocol):
    """What a controller may see at one instant; shapes as in `Recording`, without the first axis."""

    @property
    def time(self) -> float:
        """When, s."""
        ...

    @property
    def points(self) -> Floats:
        """Nodes (n + 1, 3), m."""
        ...

    @property
    def frames(self) -> Floats:
        """Directors (n + 2, 3, 3), in rows."""
        ...

    @property
    def stations(self) -> Floats:
        """Rest arclengths of the frames (n + 2,), m."""
        ...

    @property
    def edges(self) -> Floats:
        """Rest arclengths of the nodes (n + 1,), m."""
        ...

    @property
    def stretch(self) -> Floats:
        """Of the elements (n,)."""
        ...


class ReducedModel(Protocol):
    """The small model of an arm that planning, observing and feedback share."""

    def levels(self, source: ActivationSource, times: Floats) -> Floats:
        """Levels (T, groups, S) that the model feels."""
        ...

    def simulate(self, levels: Floats, steps: Floats, *, start: Floats | None = None) -> ReducedMotion:
        """Motion under `levels` (N, groups, S) at the ends of `steps` (N,), s, from the strains `start` (S, 4), else from rest."""
        ...

    def sensitivities(self, levels: Floats, level_slopes: Floats, steps: Floats, step_slopes: Floats) -> Sensitivity:
        """The motion, and its exact derivatives by the parameters on which `levels` and `steps` depend."""
        ...

    def linearise(self, motion: ReducedMotion, levels: Floats, steps: Floats) -> Linear:
        """The motion's steps, linearised."""
        ...

    def outputs(self, strains: Floats, pole: Floats) -> tuple[Floats, Floats]:
        """Topology and tip pose (T, m) of strains (T, S, 4), and their derivatives (T, m, S, 4)."""
        ...

    def strains(self, observation: Observation) -> Floats:
        """Section strains (S, 4) of a measured shape."""
        ...


class ClockReading(NamedTuple):
    """Plant time now (s), and the phase clock's reading at the begin and the end of the coming period: equal while a phase waits."""

    now: float
    begin: float
    end: float
    period: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerReport:
    """What a controller has to say after a run.

    Attributes
    ----------
    largest_correction : float
        Of any level.
    estimated_errors : mapping of str to float
        Relative errors that it believes in, by what they belong to.
    dead_groups : mapping of str to float
        Muscle groups that it found to do nothing, and when it was sure, s.
    design_time : float, s
        Processor time before the run.
    margins : mapping of str to float
        What a linear loop withstands, where the controller is one; see `octoctrl.planners.following.margins.margins`.
    fallbacks : int
        Periods in which a controller that optimises had no answer in time and gave way to another.
    step_time, longest_step : float, s
        Wall time of a step of such a controller, median and largest.
    """

    largest_correction: float = 0.0
    estimated_errors: Mapping[str, float] = field(default_factory=dict)
    dead_groups: Mapping[str, float] = field(default_factory=dict)
    design_time: float = 0.0
    margins: Mapping[str, float] = field(default_factory=dict)
    fallbacks: int = 0
    step_time: float = 0.0
    longest_step: float = 0.0


class Controller(Protocol):
    """What turns observations into activation."""

    name: str

    def levels(self, observation: Observation, reading: ClockReading) -> ActivationSource:
        """The activation for the coming period."""
        ...

    def report(self) -> ControllerReport:
        """What there is to say after a run."""
        ...
