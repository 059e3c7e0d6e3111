"""A passive elastic rod in motion: the subject of the validation cases, and of studies without muscles."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from math import ceil, pi
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..contracts import Floats
from ..errors import OctoctrlError, PlantUnstableError, check_count, check_number
from ..findings import Finding, Stop
from ..running.clock import StepLimit, choose_step
from .buffer import joint_curvature, node_masses, rod_energy, set_damping, set_joints, set_state
from .diagnosis import ALTERNATING, alternation
from .elastic_stepping import BLOCK, DRIVEN_BLOCK, Followers
from .layout import STATE_ROWS, Row, new_buffer, stride_for
from .rod import Rod, check_frames, finite_array
from .step_limits import predict_limit
from .supports import Clamp, Holding, Pin, Support

NOWHERE = (0.0, 0.0, 0.0)
NEAR = 1e-3
"""Largest distance between a held node and its support, in element lengths, when a motion begins."""


@cache
def _elastic_advance(stride: int, constant_section: bool) -> Callable[..., Any]:
    from .elastic_stepping import elastic_stepper

    return elastic_stepper(stride, constant_section)


class RodSimulation:
    """A rod in motion. It can be copied and pickled; a copy goes on by itself.

    Parameters
    ----------
    rod : Rod
    dt : float or "auto", s
        Time step; ``"auto"`` takes 0.8 of the predicted stability limit.
    supports : sequence of Clamp and Pin
        What holds the rod beside `Rod.support`. A `Clamp` of the base takes the place of ``support="clamped"``.

    Attributes
    ----------
    time : float, s
    limit : StepLimit
        Predicted largest stable step at rest, and what would grow above it.

    Raises
    ------
    OctoctrlError
        If `dt` exceeds the stability limit, or a support does not fit.

    Examples
    --------
    A rod whose tip is turned about its axis by four turns in two seconds while it may slide along it:

    >>> from octoctrl.sim.rotations import rotation_matrix
    >>> rod = Rod.straight(length=1.0, radius=0.02, elements=40, density=1e3, youngs_modulus=1e6, shear_modulus=4e5,
    ...                    support="clamped", damping=2.0)
    >>> turn = lambda t: rotation_matrix([0.0, 0.0, 4 * 2 * np.pi * min(t / 2.0, 1.0)]) @ rod.frames[-1]
    >>> sim = RodSimulation(rod, supports=[Clamp(end="tip", frame=turn, slides=(0.0, 1.0, 0.0))])
    >>> time, points, frames = sim.advance(3.0, samples=30)
    """

    def __init__(self, rod: Rod, dt: float | Literal["auto"] = "auto", *, supports: Sequence[Support] = ()) -> None:
        self.rod = rod
        self.elements = len(rod.radius)
        held = tuple(supports)
        if rod.support != "free" and not any(_holds_base(support) for support in held):
            held = (*((Clamp(end="base"),) if rod.support == "clamped" else (Pin(node=0),)), *held)
        elif rod.support == "element":
            raise OctoctrlError("support='element' and a support of the base node were given; one is needed")
        self.supports = held
        self.buffer, _ = new_buffer(self.elements)
        self._fill()
        self.load()
        self.reset()
        self.limit = self.step_limit()
        self.dt = choose_step(dt, self.limit)
        self._prepare(self.dt)

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Even a shallow copy has a motion of its own.
        self.__dict__.update(state | {name: state[name].copy() for name in ("buffer", "_good")})

    @property
    def rows(self) -> Floats:
        """View of the buffer as rows of `octoctrl.sim.rod.layout.Row`; made anew each time, so that copies are not bound to one another."""
        return self.buffer.reshape(len(Row), -1)

    def _prepare(self, h: float) -> None:
        rate, rows = self.rod.damping, self.rows
        fixed = "element" if self.rod.support == "element" else "free"
        set_damping(rows, self.elements, h, rate, rate, rate, fixed=fixed, masses=self.node_mass)
        pinned = self._holding.nodes[~self._holding.rails.any(axis=1)].astype(int)
        rows[Row.NODE_DECAY, pinned] = rows[Row.NODE_MOBILITY, pinned] = 0.0

    def _step(self, start: float, h: float, steps: int, samples: int) -> tuple[int, int, int, int, Floats, Floats]:
        """Samples of `steps` steps each from the time `start`: samples done, steps beyond, finding, element, points and frames."""
        n = self.elements
        points, frames, stretch = np.empty((samples, n + 1, 3)), np.empty((samples, n, 3, 3)), np.empty((samples, n))
        step = _elastic_advance(stride_for(n), self.rod.section == "constant")
        size = DRIVEN_BLOCK if self._holding.driven else BLOCK
        blocks = np.append(np.arange(0, steps, size), steps) * h

        def move(begin: int, end: int) -> tuple[int, int, int, int]:
            held = self._holding.at(start + begin * steps * h + blocks)
            part = slice(begin, end)
            return step(self.buffer, np.uint64(n), h, steps, size, held, self._loads, self._good, points[part], frames[part], stretch[part])

        if self._holding.driven:
            # Each sample has blocks, and so knots of the paths, of its own.
            done, beyond, finding, element = 0, 0, 0, 1
            while done < samples and not finding:
                moved, beyond, finding, element = move(done, done + 1)
                done += moved
        else:
            done, beyond, finding, element = move(0, samples)
        return done, beyond, finding, int(element) - 1, points[:done], frames[:done]

    def step_limit(self) -> StepLimit:
        """Predicted largest stable step in the present state, as a `StepLimit`."""
        good = self._good.copy()
        try:
            return predict_limit(self.rows, self.elements, self.node_mass, self._prepare, lambda h: self._step(self.time, h, 1, 1))
        finally:
            self._good[:] = good

    def _fill(self) -> None:
        rod, n, rows = self.rod, self.elements, self.rows
        length = np.linalg.norm(np.diff(rod.points, axis=0), axis=1)
        area = pi * rod.radius**2
        second_moment = area**2 / (4 * pi)
        self._ends = rod.frames[[0, -1]]
        self._hold(rod.points)
        set_state(rows, n, rod.points, rod.frames, rod.frames[0])
        rows[Row.Q11 : Row.Q33 + 1, n + 1] = rod.frames[-1].reshape(9)
        rows[Row.SHEAR, 1 : n + 1] = rod.shear_coefficient * rod.shear_modulus * area
        rows[Row.AXIAL, 1 : n + 1] = rod.youngs_modulus * area
        inertia = rod.density * length * second_moment
        rows[Row.INERTIA1, 1 : n + 1] = rows[Row.INERTIA2, 1 : n + 1] = inertia
        rows[Row.INERTIA3, 1 : n + 1] = 2 * inertia
        bend, twist = rod.youngs_modulus * second_moment, 2 * rod.shear_modulus * second_moment
        clamped = {support.end for support in self.supports if isinstance(support, Clamp)}
        set_joints(rows, n, length, bend, twist, clamped="base" in clamped)
        if "tip" in clamped:
            rows[Row.BEND1, n + 1] = rows[Row.BEND2, n + 1] = bend[-1]
            rows[Row.TWIST, n + 1] = twist[-1]
        rows[Row.REST1 : Row.REST3 + 1, 1 : n + 2] = joint_curvature(rows, n + 1)
        self.node_mass = node_masses(rod.density * area * length)
        rows[Row.NODE_MOBILITY, 1 : n + 2] = 1 / self.node_mass
        for component in range(3):
            rows[Row.MOBILITY1 + component, 1 : n + 1] = 1 / rows[Row.INERTIA1 + component, 1 : n + 1]

    def _hold(self, points: Floats) -> None:
        self._holding = Holding(self.supports, self.elements, points, self._ends)

    def reset(self) -> None:
        """Put the rod back to rest at time zero; loads and supports stay."""
        self.time = 0.0
        self.place(self.rod.points, self.rod.frames)

    def state(self) -> dict[str, Floats]:
        """The whole motion as arrays by name, for `restore`; ``numpy.savez(file, **sim.state())`` keeps it."""
        return {"time": np.array(self.time), "state": self.rows[:STATE_ROWS, : self.elements + 2].copy()}

    def restore(self, state: Mapping[str, ArrayLike]) -> None:
        """Go back to a `state` of this rod or of one like it; what follows has the same bits.

        Raises
        ------
        OctoctrlError
            If it is that of a rod with other elements, or not well.
        """
        for name in ("time", "state"):
            if name not in state:
                raise OctoctrlError(f"the state has no '{name}'; give what state() returned")
        rows = finite_array("state", state["state"], (STATE_ROWS, self.elements + 2))
        self.time = float(finite_array("time", state["time"], ()))
        self._hold(rows[Row.X1 : Row.X3 + 1, 1:].T)
        self.rows[:STATE_ROWS, : self.elements + 2] = rows
        self._good = rows

    @property
    def points(self) -> Floats:
        """Node positions (n + 1, 3), m."""
        return self.rows[Row.X1 : Row.X3 + 1, 1 : self.elements + 2].T.copy()

    @property
    def velocities(self) -> Floats:
        """Node velocities (n + 1, 3), m/s; assign to set them."""
        return self.rows[Row.V1 : Row.V3 + 1, 1 : self.elements + 2].T.copy()

    @velocities.setter
    def velocities(self, value: ArrayLike) -> None:
        """Set node velocities from `value` (n + 1, 3), m/s."""
        self.rows[Row.V1 : Row.V3 + 1, 1 : self.elements + 2] = finite_array("velocities", value, (self.elements + 1, 3)).T

    @property
    def spins(self) -> Floats:
        """Angular velocities of the elements in their own frames (n, 3), rad/s; assign to set them."""
        return self.rows[Row.W1 : Row.W3 + 1, 1 : self.elements + 1].T.copy()

    @spins.setter
    def spins(self, value: ArrayLike) -> None:
        """Set angular velocities from `value` (n, 3), rad/s."""
        self.rows[Row.W1 : Row.W3 + 1, 1 : self.elements + 1] = finite_array("spins", value, (self.elements, 3)).T

    @property
    def frames(self) -> Floats:
        """Directors (n, 3, 3)."""
        return self.rows[Row.Q11 : Row.Q33 + 1, 1 : self.elements + 1].T.reshape(-1, 3, 3).copy()

    def place(self, points: ArrayLike, frames: ArrayLike) -> None:
        """Put the rod into a shape without motion; what it is at rest does not change. Supports without a path hold it there.

        Parameters
        ----------
        points : (n + 1, 3) array_like, m
        frames : (n, 3, 3) array_like

        Raises
        ------
        OctoctrlError
            If a shape does not fit, or frames are not orthonormal.
        """
        n, rows = self.elements, self.rows
        points, frames = finite_array("points", points, (n + 1, 3)), finite_array("frames", frames, (n, 3, 3))
        check_frames("frames", frames)
        self._hold(points)
        set_state(rows, n, points, frames, self._ends[0])
        rows[Row.Q11 : Row.Q33 + 1, n + 1] = self._ends[1].reshape(9)
        held = self._holding.at(np.array([self.time]))
        for ghost, frame in zip(held.ghosts.astype(int), held.frames[0], strict=True):
            rows[Row.Q11 : Row.Q33 + 1, ghost] = frame.reshape(9)
        self._good = rows[:STATE_ROWS, : n + 2].copy()

    def load(
        self,
        *,
        tip_force: ArrayLike = NOWHERE,
        tip_couple: ArrayLike = NOWHERE,
        force_per_length: ArrayLike = NOWHERE,
        gravity: ArrayLike = NOWHERE,
        follower_force: ArrayLike = NOWHERE,
        follower_couple: ArrayLike = NOWHERE,
        follower_per_length: ArrayLike = NOWHERE,
    ) -> None:
        """Set all loads; what is not named is none.

        Parameters
        ----------
        tip_force, tip_couple : (3,) array_like, N and N m
            Dead loads at the tip, in the lab frame.
        force_per_length : (3,) or (n, 3) array_like, N/m
            Dead load per rest length, the same everywhere or of each element.
        gravity : (3,) array_like, m/s^2
        follower_force, follower_couple : (3,) array_like, N and N m
            At the tip, in the material frame (d1, d2, d3) of the last element, with which they turn.
        follower_per_length : (3,) or (n, 3) array_like, N/m
            In the material frame of each element, with which it turns.

        Raises
        ------
        OctoctrlError
            If a shape does not fit or a number is not finite.
        """
        n, rows = self.elements, self.rows
        half = rows[Row.LENGTH, 1 : n + 1, None] / 2
        dead, follower = (
            half * finite_array(name, value, (n, 3) if np.ndim(value) == 2 else (3,))
            for name, value in (("force_per_length", force_per_length), ("follower_per_length", follower_per_length))
        )
        force, couple, turning, outer = np.zeros((n + 1, 3)), np.zeros((n, 3)), np.zeros((n, 3)), follower.copy()
        force[:-1] += dead
        force[1:] += dead
        force += self.node_mass[:, None] * finite_array("gravity", gravity, (3,))
        force[-1] += finite_array("tip_force", tip_force, (3,))
        couple[-1] = finite_array("tip_couple", tip_couple, (3,))
        outer[-1] += finite_array("follower_force", follower_force, (3,))
        turning[-1] = finite_array("follower_couple", follower_couple, (3,))
        rows[Row.FORCE1 : Row.FORCE3 + 1, 1 : n + 2], rows[Row.COUPLE1 : Row.COUPLE3 + 1, 1 : n + 1] = force.T, couple.T
        self._loads = Followers(bool(outer.any() or turning.any()), force, couple, follower, outer, turning)

    def energy(self) -> dict[str, float]:
        """Kinetic and elastic energy, J."""
        return rod_energy(self.rows, self.elements, self.node_mass, constant_section=self.rod.section == "constant")

    def advance(self, duration: float, samples: int = 1) -> tuple[Floats, Floats, Floats]:
        """Move on by `duration` (s).

        Parameters
        ----------
        duration : float, s
        samples : int
            Instants at which the motion is recorded, equally spaced, the last at the end.

        Returns
        -------
        time : (samples,) float64, s
        points : (samples, n + 1, 3) float64, m
        frames : (samples, n, 3, 3) float64

        Raises
        ------
        PlantUnstableError
            If the rod diverges; the message names time, element and mechanism. The rod is then where it was at most 128 steps before, at
            `time`; other loads, `restore` or `reset` lead on from there.
        OctoctrlError
            If an argument is out of range, or a held node is not at its support.
        """
        check_number("duration", duration, above=0.0, unit="s")
        samples = check_count("samples", samples)
        interval = duration / samples
        steps = max(1, round(interval / self.dt))
        if abs(steps * self.dt - interval) > 1e-9 * interval:
            steps = ceil(interval / self.dt * (1 - 1e-12))
        h = interval / steps
        self._check_supports()
        self._prepare(h)
        self._good[:] = self.rows[:STATE_ROWS, : self.elements + 2]
        start = self.time
        done, beyond, finding, element, points, frames = self._step(start, h, steps, samples)
        self.time = start + interval * done + h * beyond
        if finding:
            raise self._stopped(h, finding, element)
        time: Floats = start + interval * np.arange(1.0, samples + 1)
        return time, points, frames

    def _check_supports(self) -> None:
        held, points = self._holding.at(np.array([self.time])), self.points
        for node, place, rail in zip(held.nodes.astype(int) - 1, held.points[0], held.rails, strict=True):
            gap = points[node] - place
            gap -= (gap @ rail) * rail
            if np.linalg.norm(gap) > NEAR * self.rows[Row.LENGTH, 1 : self.elements + 1].min():
                raise OctoctrlError(
                    f"node {node} is {np.linalg.norm(gap):.3g} m from its support at t={self.time:.4g} s; place the rod where it is held"
                )

    def _stopped(self, h: float, finding: int, element: int) -> PlantUnstableError:
        """Go the last block again, step by step: when and where it began, and whether the motion alternated; then go back before it."""
        good = self._good.copy()
        self.rows[:STATE_ROWS, : self.elements + 2] = good
        done, _, first, where, _, frames = self._step(self.time, h, 1, BLOCK)
        if first:
            finding, element = first, where
        turned = alternation(frames[:, max(0, element - 1) : element + 2])
        unstable = turned is not None and turned > ALTERNATING
        self.rows[:STATE_ROWS, : self.elements + 2] = self._good[:] = good
        remedy = "halve dt" if unstable else "lower or ramp the load, use more elements, or halve dt"
        stop = Stop(
            time=self.time + h * (done + 1),
            rod="arm",
            element=element,
            finding=Finding(finding),
            unstable=unstable,
            cause=f"{remedy}; the rod is back at t={self.time:.4g} s",
        )
        return PlantUnstableError.of(stop, stop.message(h, f"predicted limit {self.limit.step:.2g} s from {self.limit.mechanism}"))


def _holds_base(support: Support) -> bool:
    return support.node == 0 if isinstance(support, Pin) else support.end == "base"
