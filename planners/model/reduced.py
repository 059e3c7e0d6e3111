"""The reduced model: eight sections of four strains that creep against water drag, for planning, observing and feedback design.

It has no inertia: strains q obey (D(q, q') + C(q, a, q')) q' = -f(q, a), with D the water drag at the current shape, C Hill's viscosity
of the active fibres and f the elastic and active forces, which are local to a section because no load acts from outside. Kinematics,
fibres, drag and time step stand in modules of their own (`reduced_kinematics`, `reduced_statics`, `reduced_drag`, `reduced_dynamics`).
"""

from dataclasses import dataclass, field, replace

import numpy as np

from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError, check_choice, check_number
from octoctrl.sim.records import Record
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.scene.scene import Scene

from .kinematics import StrainFit, element_points, element_stations, hat_means, integrate_frames, section_bounds
from .parameters import ReducedParameters

LAWS = ("known", "generic")
"""The plant's own muscle polynomials, or a parabola and hinges whose shape is identified."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ReducedMotion(Record):
    """Simulated motion, T instants.

    Attributes
    ----------
    time : (T,) float64, s
    strains : (T, S, 4) float64
        k1, k2, k3 (1/m) and stretch of each section.
    rates : (T, S, 4) float64
        Mean strain rates over the step that ends at each instant, 1/s times the unit.
    """

    time: np.ndarray
    strains: np.ndarray
    rates: np.ndarray


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

    Raises
    ------
    OctoctrlError
        If an argument is out of range, or there is no water: without drag a model without inertia has no rate of its own.

    Examples
    --------
    >>> model = ReducedModel()
    >>> motion = model.simulate(activation, 7.0)  # doctest: +SKIP
    >>> model.trace(motion.time, motion.strains).lifted_writhe  # doctest: +SKIP
    """

    arm: Arm = field(default_factory=Arm)
    scene: Scene = field(default_factory=Scene)
    laws: str = "known"
    parameters: ReducedParameters = field(default_factory=ReducedParameters)
    sections: int = 8
    step: float = 0.05

    def __post_init__(self):
        check_choice("laws", self.laws, LAWS)
        check_number("step", self.step, above=0.0, at_most=0.5, unit="s")
        if self.scene.water is None or self.scene.water.factor == 0.0:
            raise OctoctrlError("the reduced model has no inertia and moves against drag; give the scene water with a factor above 0")
        if not isinstance(self.sections, int) or not 2 <= self.sections <= 40:
            raise OctoctrlError(f"sections={self.sections!r}: a whole number from 2 to 40 is needed (8 advised)")

    @property
    def edges(self):
        """Arclengths that bound the sections, (S + 1,), m."""
        return section_bounds(self.arm, self.sections)

    @property
    def shares(self):
        """Share of each section in the arm's length, (S,): the mean of a strain over the arm is its product with these."""
        return hat_means([0.0, self.arm.length], self.edges)[0]

    @property
    def rest(self):
        """Strains at rest, (S, 4)."""
        return np.tile([0.0, 0.0, 0.0, 1.0], (self.sections, 1))

    @property
    def structure(self):
        """What the CasADi functions of this model are built for; models that differ only in parameters share them."""
        from .dynamics import Structure

        return Structure(self.arm, self.scene.water, self.laws, self.sections)

    @property
    def lag(self):
        """Time by which inertia delays the answer to an activation, s: the arm's mass over its linear drag.

        With inertia the equation of motion reads M q'' + D q' = -f(a), and M / D being nearly the same everywhere, q' follows f as if the
        activation had come later by M / D. That leaves the model its first order.
        """
        water, section = self.scene.water, self.arm.section((self.edges[1:] + self.edges[:-1]) / 2)
        if water is None:
            return 0.0
        widths, masses = np.diff(self.edges), np.array(section.masses)
        drag = water.factor * (water.ring_rate * masses[2] + water.oblique_rate * masses[3]) @ widths
        return float(masses.sum(axis=0) @ widths / drag) if drag > 0 else 0.0

    def levels(self, activation, times):
        """Section averages of an activation as the model feels it, later by `lag`, (T, 11, S)."""
        return activation.levels(np.asarray(times) - self.lag, self.edges)

    # Motion

    def step_function(self):
        """One step as a `casadi.Function`: (strains (4, S), rates (4, S), levels (11, S), h) -> strains, rates.

        `rates` are those of the step before (zero at rest), `levels` those at the end of the step.
        """
        import casadi as ca

        from .dynamics import functions

        step = functions(self.structure).step
        inputs = [ca.MX.sym(step.name_in(i), *step.size_in(i)) for i in range(4)]
        return ca.Function("step", inputs, step(*inputs, self.parameters.vector()), step.name_in()[:4], ["strains_next", "rates_next"])

    def simulate(self, activation, duration, *, start=None, begin=0.0, step=None):
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
        return self.simulate_levels(self.levels(activation, time[1:]), np.diff(time), start=start, begin=begin)

    def simulate_levels(self, levels, steps, *, start=None, rates=None, begin=0.0):
        """Simulate under given levels.

        Parameters
        ----------
        levels : (N, 11, S) array_like
            Section averages at the end of each step.
        steps : (N,) array_like, s
        start, rates : (S, 4) array_like, optional
            Strains and strain rates at the begin; rest when omitted.
        begin : float, s

        Returns
        -------
        ReducedMotion
            N + 1 instants.
        """
        from .dynamics import horizon

        levels, steps = self._checked(levels, steps)
        count = len(steps)
        start, rates = self._state(start), np.zeros((self.sections, 4)) if rates is None else self._state(rates)
        factors = np.repeat(self.parameters.vector()[:, None], count, axis=1)
        run = horizon(self.structure, count)
        strains, speeds = (np.asarray(out) for out in run(start.T, rates.T, _columns(levels), steps[None], factors))
        time = begin + np.concatenate([[0.0], np.cumsum(steps)])
        return ReducedMotion(time=time, strains=_stack(start, strains, self.sections), rates=_stack(rates, speeds, self.sections))

    def sensitivities(self, levels, level_slopes, steps, step_slopes, *, start=None):
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
        motion : ReducedMotion
        slopes : (N + 1, S, 4, p) float64
            Derivatives of the strains.
        """
        from .dynamics import sensitivity_horizon

        levels, steps = self._checked(levels, steps)
        level_slopes, step_slopes = np.asarray(level_slopes, dtype=float), np.asarray(step_slopes, dtype=float)
        count, directions = step_slopes.shape
        if level_slopes.shape != (*levels.shape, directions) or count != len(steps):
            raise OctoctrlError(f"level_slopes {level_slopes.shape} and step_slopes {step_slopes.shape} do not fit levels {levels.shape}")
        start, size = self._state(start), 4 * self.sections
        zeros = np.zeros((size, directions))
        seeds = level_slopes.transpose(2, 1, 0, 3).reshape(self.sections * len(MUSCLE_GROUPS), count * directions)
        factors = np.repeat(self.parameters.vector()[:, None], count, axis=1)
        run = sensitivity_horizon(self.structure, directions, count)
        strains, rates, slopes, _ = (
            np.asarray(out)
            for out in run(
                start.T,
                np.zeros((4, self.sections)),
                zeros,
                zeros,
                _columns(levels),
                seeds,
                steps[None],
                step_slopes.reshape(1, -1),
                factors,
            )
        )
        motion = ReducedMotion(
            time=np.concatenate([[0.0], np.cumsum(steps)]),
            strains=_stack(start, strains, self.sections),
            rates=_stack(np.zeros_like(start), rates, self.sections),
        )
        slopes = slopes.reshape(size, count, directions).transpose(1, 0, 2).reshape(count, self.sections, 4, directions)
        return motion, np.concatenate([np.zeros((1, self.sections, 4, directions)), slopes])

    def linearise(self, strains, rates, levels, steps):
        """Linear model of steps along a trajectory, for feedback design.

        Parameters
        ----------
        strains : (N, S, 4) array_like
            At the begin of each step.
        rates : (N, S, 4) array_like
            Of each step: `ReducedMotion.rates` one instant later.
        levels : (N, 11, S) array_like
            At the end of each step.
        steps : (N,) array_like, s

        Returns
        -------
        A : (N, 4 S, 4 S) float64
            Derivative of the next strains by the strains; strains of all sections in a row, as in ``strains[k].ravel()``.
        B : (N, 4 S, 11, S) float64
            Derivative of the next strains by the levels.
        """
        from .dynamics import linearisation

        levels, steps = self._checked(levels, steps)
        count, size = len(steps), 4 * self.sections
        factors = np.repeat(self.parameters.vector()[:, None], count, axis=1)
        inputs = [np.asarray(part, dtype=float).reshape(-1, 4).T for part in (strains, rates)]
        a, b = linearisation(self.structure).map(count)(*inputs, _columns(levels), steps[None], factors)
        a, b = (np.asarray(matrix).reshape(size, count, -1).transpose(1, 0, 2) for matrix in (a, b))
        return a, b.reshape(count, size, self.sections, len(MUSCLE_GROUPS)).swapaxes(2, 3)

    def drag_slopes(self, strains, rates, levels, steps, change=0.05):
        """What a heavier water would change in each step: derivative of the next strains by a common relative error of all drag.

        Parameters
        ----------
        strains, rates : (N, S, 4) array_like
            As in `linearise`.
        levels : (N, 11, S) array_like
        steps : (N,) array_like, s
        change : float
            Relative change of the drag, either way, of the central difference.

        Returns
        -------
        (N, 4 S) float64
        """
        from .dynamics import functions

        levels, steps = self._checked(levels, steps)
        count = len(steps)
        step = functions(self.structure).step.map(count)
        inputs = [np.asarray(part, dtype=float).reshape(-1, 4).T for part in (strains, rates)]
        ends = []
        for sign in (1, -1):
            scale = 1 + sign * change
            names = ("linear_drag", "quadratic_drag", "rotational_drag")
            heavier = replace(self.parameters, **{name: scale * getattr(self.parameters, name) for name in names})
            moved, _ = step(*inputs, _columns(levels), steps[None], np.repeat(heavier.vector()[:, None], count, axis=1))
            ends.append(np.asarray(moved).T.reshape(count, -1))
        return (ends[0] - ends[1]) / (2 * change)

    # Shape

    def strain_fit(self, stations):
        """The map from measured frames and stretches at `stations` (m,), m, to section strains, to be kept and called: a `StrainFit`."""
        return StrainFit(stations, self.edges)

    @property
    def stations(self):
        """Arclengths at which a plant of this arm has its frames, (n + 2,), m."""
        return element_stations(self.arm.edges)

    def frames(self, strains, stations=None):
        """Frames (..., m, 3, 3), rows d1, d2, d3, at the arclengths `stations` (m; the plant's when omitted)."""
        return integrate_frames(strains, self.stations if stations is None else np.asarray(stations, dtype=float), self.edges)

    def points(self, strains):
        """Node positions (..., n + 1, 3), m, of as many elements as the plant has."""
        return element_points(strains, self.frames(strains), self.arm.edges, self.edges)

    def trace(self, time, strains, convention=None):
        """Topology over time, by the formula that also measures the plant, as `octoctrl.sim.topology.trace.TopologyTrace`."""
        from octoctrl.sim.topology.measures import measure
        from octoctrl.sim.topology.trace import TopologyConvention

        frames = self.frames(strains)
        points = element_points(strains, frames, self.arm.edges, self.edges)
        return measure(time, points, frames, TopologyConvention() if convention is None else convention)

    def recording(self, time, strains):
        """The motion as a plant would have recorded it, without levels, as an `octoctrl.sim.running.recording.Recording`."""
        edges, frames = self.arm.edges, self.frames(strains)
        return Recording(
            time=np.asarray(time, dtype=float), points=element_points(strains, frames, edges, self.edges), frames=frames,
            stations=self.stations, stretch=np.asarray(strains)[..., 3] @ hat_means(edges, self.edges).T,
            levels=np.zeros((len(time), len(MUSCLE_GROUPS), len(edges) - 1)),
        )  # fmt: skip

    def strains_from_frames(self, stations, frames, stretch):
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
        if np.shape(frames)[-3:] != (len(stations), 3, 3) or np.shape(stretch)[-1] != len(stations) - 2:
            raise OctoctrlError(
                f"frames {np.shape(frames)} and stretch {np.shape(stretch)} do not fit {len(stations)} stations: base, element centres, tip"
            )
        return StrainFit(stations, self.edges)(frames, stretch)

    def outputs_function(self):
        """Topology and tip pose as a smooth `casadi.Function`; see `octoctrl.planners.model.outputs.outputs`."""
        from .outputs import outputs

        return outputs(self.arm, self.sections)

    def output_slopes(self, strains, pole=(0.0, 0.0, 1.0)):
        """Outputs and their derivatives.

        Parameters
        ----------
        strains : (T, S, 4) array_like
        pole : (3,) array_like
            Direction from which lifted writhe is measured.

        Returns
        -------
        values : (T, outputs) float64
            In turns and metres, in the order of `octoctrl.planners.model.readings.OUTPUTS`.
        slopes : (T, outputs, S, 4) float64
        """
        from .outputs import output_slopes

        strains = np.asarray(strains, dtype=float)
        count = len(strains)
        function = output_slopes(self.arm, self.sections).map(count)
        values, slopes = function(strains.reshape(-1, 4).T, np.tile(np.asarray(pole, dtype=float)[:, None], (1, count)))
        slopes = np.asarray(slopes).reshape(-1, count, self.sections, 4)
        return np.asarray(values).T, slopes.swapaxes(0, 1)

    # Equilibrium

    def equilibrium(self, levels, *, start=None):
        """Strains (..., S, 4) at which the sections rest under constant levels (..., 11, S); see `octoctrl.planners.model.reach`."""
        from .reach import equilibrium

        return equilibrium(self, levels, start)

    def reach_limits(self, *, side=("LM1", "LM2", "LM8"), level=0.75):
        """What the arm can do at rest under levels up to `level`; see `octoctrl.planners.model.reach.ReachLimits`."""
        from .reach import reach_limits

        return reach_limits(self, side, level)

    def _checked(self, levels, steps):
        levels, steps = np.asarray(levels, dtype=float), np.asarray(steps, dtype=float)
        expected = (len(steps), len(MUSCLE_GROUPS), self.sections)
        if levels.shape != expected:
            raise OctoctrlError(f"levels has shape {levels.shape}; {expected} is needed: steps, muscle groups, sections")
        if not (np.isfinite(steps).all() and steps.min(initial=np.inf) > 0.0):
            raise OctoctrlError(f"steps must be positive and there must be one; found {steps.min(initial=np.inf):g} s as the shortest")
        return levels, steps

    def _state(self, strains):
        if strains is None:
            return self.rest
        strains = np.asarray(strains, dtype=float)
        if strains.shape != (self.sections, 4):
            raise OctoctrlError(f"strains has shape {strains.shape}; ({self.sections}, 4) is needed")
        return strains


def _columns(levels):
    """Levels (N, 11, S) as the columns (11, N S) that the functions take."""
    return levels.swapaxes(0, 1).reshape(levels.shape[1], -1)


def _stack(first, columns, sections):
    """Columns (4, N S) behind the first (S, 4), as (N + 1, S, 4)."""
    return np.concatenate([first[None], columns.T.reshape(-1, sections, 4)])
