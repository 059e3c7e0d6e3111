"""The reduced model: eight sections of four strains that creep against water drag, for planning, observing and feedback design.

It has no inertia: strains q obey (D(q, q') + C(q, a, q')) q' = -f(q, a), with D the water drag at the current shape, C Hill's viscosity
of the active fibres and f the elastic and active forces, which are local to a section because no load acts from outside. The step is
fully implicit (`stepping_kernels`); kinematics, fibres, drag and the same step in CasADi stand in modules of their own.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from octoctrl.sim.annotations import settle
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError, brief, check_choice, check_kind, check_number
from octoctrl.sim.records import Record
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.scene.scene import Scene, Water
from octoctrl.sim.topology.trace import TopologyConvention, TopologyTrace

from ..contracts import ActivationSource, Linear, Observation, Sensitivity
from .kinematics import StrainFit, element_points, element_stations, hat_means, integrate_frames, section_bounds
from .parameters import ReducedParameters

if TYPE_CHECKING:
    import casadi as ca

    from .dynamics import Structure
    from .reach import ReachLimits
    from .stepping_kernels import StepModel

Floats = NDArray[np.float64]

LAWS = ("known", "generic")
"""The plant's own muscle polynomials, or a parabola and hinges whose shape is identified."""


SWIFT = 0.12
"""Lag, s, at which inertia and elasticity begin to answer one another: of the rod, whose coil is so foreseen in water that damps a 27th of
the usual, writhe within 0.06 turns and twist within 0.05 (RMS)."""


@lru_cache(maxsize=32)
def inertial_lag(arm: Arm, water: Water, sections: int) -> float:
    """Time by which inertia delays the answer of an arm to its muscles.

    The equation of motion is M q'' + D q' + K q = f. Against the same without inertia its answer at the angular frequency w is late by

        [atan2(w D, K - w^2 M) - atan2(w D, K)] / w  =  L / (1 + (L / tau)^2),    L = M / D,    1 / tau^2 = (K / (w M))^2 - K / M

    to first order: by L where the water damps, M / D being nearly the same everywhere, and by less and less where it hardly does, for then
    the arm answers as fast as its elasticity, not its drag, has it. That leaves the model its first order.

    Parameters
    ----------
    arm : Arm
    water : Water
    sections : int

    Returns
    -------
    float
        Seconds.
    """
    edges = section_bounds(arm, sections)
    widths, masses = np.diff(edges), np.array(arm.section((edges[1:] + edges[:-1]) / 2).masses)
    drag = water.factor * (water.ring_rate * masses[2] + water.oblique_rate * masses[3]) @ widths
    damped = float(masses.sum(axis=0) @ widths / drag) if drag > 0 else np.inf
    return damped / (1 + (damped / SWIFT) ** 2) if np.isfinite(damped) else 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ReducedMotion(Record):
    """Simulated motion, T instants.

    Attributes
    ----------
    time : (T,) float64, s
    strains : (T, S, 4) float64
        k1, k2, k3 (1/m) and stretch of each section.
    """

    time: Floats
    strains: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class ReducedModel:
    """The reduced model of an arm in water.

    Attributes
    ----------
    arm : Arm
    scene : Scene
        Only its water is used; the model knows no contact.
    laws : {"known", "generic"}
    parameters : ReducedParameters
    sections : int
    step : float, s
        Default time step; 0.05 for prediction, 0.1 is enough for planning.
    gains : mapping of str to float
        What of their level muscle groups do, as of a plant; all of it if not named, 0 of one that is dead.

    Raises
    ------
    OctoctrlError
        If an argument is out of range, or there is no water: without drag a model without inertia has no rate of its own.

    Examples
    --------
    >>> model = ReducedModel()
    >>> motion = model.respond(activation, 7.0)  # doctest: +SKIP
    >>> model.trace(motion.time, motion.strains).lifted_writhe  # doctest: +SKIP
    """

    arm: Arm = field(default_factory=Arm)
    scene: Scene = field(default_factory=Scene)
    laws: str = "known"
    parameters: ReducedParameters = field(default_factory=ReducedParameters)
    sections: int = 8
    step: float = 0.05
    gains: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        settle(self)
        check_kind("gains", self.gains, Mapping, 'for example {"LM2": 0.5}')
        for group, gain in self.gains.items():
            check_choice("muscle group", group, MUSCLE_GROUPS)
            check_number(f"gain of {group}", gain, at_least=0.0)
        check_choice("laws", self.laws, LAWS)
        check_number("step", self.step, above=0.0, at_most=0.5, unit="s")
        if self.scene.water is None or self.scene.water.factor == 0.0:
            raise OctoctrlError("the reduced model has no inertia and moves against drag; give the scene water with a factor above 0")
        if not isinstance(self.sections, Integral) or not 2 <= self.sections <= 40:
            raise OctoctrlError(f"sections={brief(repr(self.sections))}: a whole number from 2 to 40 is needed (8 advised)")

    @property
    def edges(self) -> Floats:
        """Arclengths that bound the sections, (S + 1,), m."""
        return section_bounds(self.arm, self.sections)

    @property
    def shares(self) -> Floats:
        """Share of each section in the arm's length, (S,): the mean of a strain over the arm is its product with these."""
        return hat_means([0.0, self.arm.length], self.edges)[0]

    @property
    def rest(self) -> Floats:
        """Strains at rest, (S, 4)."""
        return np.tile([0.0, 0.0, 0.0, 1.0], (self.sections, 1))

    @property
    def structure(self) -> "Structure":
        """What the CasADi functions of this model are built for; models that differ only in parameters share them."""
        from .dynamics import Structure

        assert self.scene.water is not None  # checked when the model was made

        return Structure(self.arm, self.scene.water, self.laws, self.sections)

    @property
    def lag(self) -> float:
        """Time by which inertia delays the answer to an activation, s; see `inertial_lag`."""
        return inertial_lag(self.arm, self.scene.water, self.sections) if self.scene.water is not None else 0.0

    def levels(self, activation: ActivationSource, times: ArrayLike) -> Floats:
        """Section averages of an activation as the model feels it, later by `lag`, (T, 11, S)."""
        levels = activation.levels(np.asarray(times) - self.lag, self.edges)
        for group, gain in self.gains.items():
            levels[:, MUSCLE_GROUPS.index(group)] *= gain
        return levels

    # Motion

    @property
    def step_model(self) -> "StepModel":
        """The constants of the compiled step."""
        from .stepping import step_model

        return step_model(self.structure, self.parameters)

    def step_function(self) -> "ca.Function":
        """One step as a differentiable `casadi.Function`: (strains (4, S), levels (11, S) at the end of the step, h) -> strains."""
        import casadi as ca

        from .dynamics import step

        function = step(self.structure)
        inputs = [ca.MX.sym(function.name_in(i), *function.size_in(i)) for i in range(3)]
        return ca.Function("step", inputs, [function(*inputs, self.parameters.vector())], function.name_in()[:3], ["next"])

    def respond(
        self,
        activation: ActivationSource,
        duration: float,
        *,
        start: ArrayLike | None = None,
        begin: float = 0.0,
        step: float | None = None,
    ) -> ReducedMotion:
        """Simulate under an activation.

        Parameters
        ----------
        activation : Activation, or any object with ``levels(times, edges)``
        duration : float, s
        start : (S, 4) array_like, optional
            Strains at the begin, at rest when omitted.
        begin : float, s
            Time on the activation's clock at which to begin.
        step : float, optional, s
            Largest time step; it is shortened to divide the duration.

        Returns
        -------
        ReducedMotion
            Start included.
        """
        check_number("duration", duration, above=0.0, unit="s")
        count = int(np.ceil(duration / (self.step if step is None else step) - 1e-9))
        time = begin + duration * np.arange(count + 1) / count
        return self.simulate(self.levels(activation, time[1:]), np.diff(time), start=start, begin=begin)

    def simulate(self, levels: ArrayLike, steps: ArrayLike, *, start: ArrayLike | None = None, begin: float = 0.0) -> ReducedMotion:
        """Simulate under given levels.

        Parameters
        ----------
        levels : (N, 11, S) array_like
            Section averages at the end of each step.
        steps : (N,) array_like, s
        start : (S, 4) array_like, optional
            Strains at the begin; rest when omitted.
        begin : float, s

        Returns
        -------
        ReducedMotion
            N + 1 instants; strains are not a number from a step on that has no solution.
        """
        from .stepping import simulate

        levels, steps = self._checked(levels, steps)
        strains = simulate(self.step_model, self._state(start), levels, steps)
        return ReducedMotion(time=begin + np.concatenate([[0.0], np.cumsum(steps)]), strains=strains)

    def sensitivities(
        self,
        levels: ArrayLike,
        level_slopes: ArrayLike,
        steps: ArrayLike,
        step_slopes: ArrayLike,
        *,
        start: ArrayLike | None = None,
    ) -> Sensitivity:
        """Simulate, and differentiate exactly with respect to p parameters on which levels and step lengths depend.

        Parameters
        ----------
        levels : (N, 11, S) array_like
        level_slopes : (N, 11, S, p) array_like
            Derivatives of the levels.
        steps : (N,) array_like, s
        step_slopes : (N, p) array_like
            Derivatives of the step lengths.
        start : (S, 4) array_like, optional
            Strains at the begin; they do not depend on the parameters.

        Returns
        -------
        Sensitivity
            The motion, and derivatives of its strains, (N + 1, S, 4, p).
        """
        from .stepping import simulate, slopes_of

        levels, steps = self._checked(levels, steps)
        level_slopes, step_slopes = np.ascontiguousarray(level_slopes, dtype=float), np.ascontiguousarray(step_slopes, dtype=float)
        count, directions = step_slopes.shape
        if level_slopes.shape != (*levels.shape, directions) or count != len(steps):
            raise OctoctrlError(
                f"level_slopes {level_slopes.shape} and step_slopes {step_slopes.shape} do not fit levels {levels.shape}; "
                "they need the same steps, and one last axis for the parameters"
            )
        strains = simulate(self.step_model, self._state(start), levels, steps)
        slopes = slopes_of(self.step_model, strains, levels, level_slopes, steps, step_slopes)
        motion = ReducedMotion(time=np.concatenate([[0.0], np.cumsum(steps)]), strains=strains)
        return Sensitivity(motion, slopes.reshape(count + 1, self.sections, 4, directions))

    def linearise(self, motion: ReducedMotion, levels: ArrayLike, steps: ArrayLike) -> Linear:
        """Linear model of the steps of a motion, exact, for feedback design.

        Parameters
        ----------
        motion : ReducedMotion
            What `simulate` made of these levels and steps.
        levels : (N, 11, S) array_like
            At the end of each step.
        steps : (N,) array_like, s

        Returns
        -------
        Linear
            Strains of all sections in a row, as in ``strains[k].ravel()``.
        """
        from .stepping import linearise

        levels, steps = self._checked(levels, steps)
        return Linear(*linearise(self.step_model, np.ascontiguousarray(motion.strains), levels, steps))

    def prepare(self) -> None:
        """Compile all that planning and feedback call, or load it from the cache on disk: one step and one instant of each."""
        levels, steps = np.zeros((1, len(MUSCLE_GROUPS), self.sections)), np.array([0.01])
        slopes = np.zeros((*levels.shape, 1))
        motion = self.sensitivities(levels, slopes, steps, np.zeros((1, 1))).motion
        self.linearise(self.simulate(levels, steps), levels, steps)
        self.outputs(motion.strains)
        self.trace(motion.time, motion.strains)

    # Shape

    @property
    def stations(self) -> Floats:
        """Arclengths at which a plant of this arm has its frames, (n + 2,), m."""
        return element_stations(self.arm.edges)

    def frames(self, strains: ArrayLike, stations: ArrayLike | None = None) -> Floats:
        """Frames (..., m, 3, 3), rows d1, d2, d3, at the arclengths `stations` (m; the plant's when omitted)."""
        return integrate_frames(strains, self.stations if stations is None else np.asarray(stations, dtype=float), self.edges)

    def points(self, strains: ArrayLike) -> Floats:
        """Node positions (..., n + 1, 3), m, of as many elements as the plant has."""
        return element_points(strains, self.frames(strains), self.arm.edges, self.edges)

    def trace(self, time: ArrayLike, strains: ArrayLike, convention: TopologyConvention | None = None) -> TopologyTrace:
        """Topology over time, by the formula that also measures the plant, as `octoctrl.sim.topology.trace.TopologyTrace`."""
        from octoctrl.sim.topology.measures import measure

        frames = self.frames(strains)
        points = element_points(strains, frames, self.arm.edges, self.edges)
        return measure(time, points, frames, TopologyConvention() if convention is None else convention)

    def recording(self, time: ArrayLike, strains: ArrayLike) -> Recording:
        """The motion as a plant would have recorded it, without levels, as an `octoctrl.sim.running.recording.Recording`."""
        edges, frames, time = self.arm.edges, self.frames(strains), np.asarray(time, dtype=float)
        return Recording(
            time=time, points=element_points(strains, frames, edges, self.edges), frames=frames,
            stations=self.stations, stretch=np.asarray(strains)[..., 3] @ hat_means(edges, self.edges).T,
            levels=np.zeros((len(time), len(MUSCLE_GROUPS), len(edges) - 1)),
        )  # fmt: skip

    def strains_from_frames(self, stations: ArrayLike, frames: ArrayLike, stretch: ArrayLike) -> Floats:
        """Section strains of a measured shape; to project many frames one by one, keep a `StrainFit`.

        Parameters
        ----------
        stations : (n + 2,) array_like, m
            Base, element centres, tip.
        frames : (..., n + 2, 3, 3) array_like
        stretch : (..., n) array_like
            Of the elements.

        Returns
        -------
        (..., S, 4) float64
        """
        stations = np.asarray(stations, dtype=float)
        if np.shape(frames)[-3:] != (len(stations), 3, 3) or np.shape(stretch)[-1] != len(stations) - 2:
            raise OctoctrlError(
                f"frames {np.shape(frames)} and stretch {np.shape(stretch)} do not fit {len(stations)} stations: base, element centres, tip"
            )
        return StrainFit(stations, self.edges)(frames, stretch)

    def strains(self, observation: Observation) -> Floats:
        """Section strains (S, 4) of an observed shape."""
        return self.strains_from_frames(observation.stations, observation.frames, observation.stretch)

    def outputs_function(self) -> "ca.Function":
        """Topology and tip pose as a smooth `casadi.Function`; see `octoctrl.planners.model.outputs.outputs`."""
        from .outputs import outputs

        return outputs(self.arm, self.sections)

    def outputs(self, strains: ArrayLike, pole: ArrayLike = (0.0, 0.0, 1.0)) -> tuple[Floats, Floats]:
        """Outputs and their derivatives.

        Parameters
        ----------
        strains : (T, S, 4) array_like
        pole : (3,) array_like
            Direction from which lifted writhe is measured.

        Returns
        -------
        values : (T, 11) float64
            In the order of `octoctrl.planners.model.output_kernels.OUTPUTS`. Each instant stands alone: writhe and link are known up to two
            turns.
        slopes : (T, 11, S, 4) float64
        """
        from .stepping import output_tables, outputs

        strains = np.ascontiguousarray(strains, dtype=float)
        return outputs(output_tables(self.arm, self.sections), strains, np.array(pole, dtype=float))

    # Equilibrium

    def equilibrium(self, levels: ArrayLike, *, start: ArrayLike | None = None) -> Floats:
        """Strains (..., S, 4) at which the sections rest under constant levels (..., 11, S); see `octoctrl.planners.model.reach`."""
        from .reach import equilibrium

        return equilibrium(self, levels, start)

    def reach_limits(self, *, side: tuple[str, ...] = ("LM1", "LM2", "LM8"), level: float = 0.75) -> "ReachLimits":
        """What the arm can do at rest under levels up to `level`; see `octoctrl.planners.model.reach.ReachLimits`."""
        from .reach import reach_limits

        return reach_limits(self, side, level)

    def _checked(self, levels: ArrayLike, steps: ArrayLike) -> tuple[Floats, Floats]:
        levels, steps = np.ascontiguousarray(levels, dtype=float), np.ascontiguousarray(steps, dtype=float)
        expected = (len(steps), len(MUSCLE_GROUPS), self.sections)
        if levels.shape != expected:
            raise OctoctrlError(f"levels has shape {levels.shape}; {expected} is needed: steps, muscle groups, sections")
        if not (np.isfinite(steps).all() and steps.min(initial=np.inf) > 0.0):
            raise OctoctrlError(f"steps must be positive and there must be one; found {steps.min(initial=np.inf):g} s as the shortest")
        return levels, steps

    def _state(self, strains: ArrayLike | None) -> Floats:
        if strains is None:
            return self.rest
        strains = np.ascontiguousarray(strains, dtype=float)
        if strains.shape != (self.sections, 4):
            raise OctoctrlError(f"strains has shape {strains.shape}; ({self.sections}, 4) is needed")
        return strains
