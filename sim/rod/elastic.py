"""A passive elastic rod in space: the building block of the arm and the subject of the validation cases."""

from dataclasses import dataclass, field
from functools import cache
from math import pi

import numpy as np

from ..errors import OctoctrlError, PlantUnstableError, check_choice, check_number
from ..findings import Finding, Stop
from ..physics.damping import damped
from ..records import Record
from ..rotations import rotation_vector
from ..running.clock import choose_step
from .layout import STATE_ROWS, Row, new_buffer, stride_for
from .step_limits import predict_limit

CIRCULAR_SHEAR = 27 / 28
"""Shear coefficient of a circular section (PyElastica's default; Tekinalp et al. 2024 use 4/3)."""

SUPPORTS = ("free", "clamped", "element")
SECTIONS = ("incompressible", "constant")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Rod(Record):
    """Geometry and material of a rod with n elements.

    Attributes
    ----------
    points : (n + 1, 3) float64, m
        Nodes at rest.
    frames : (n, 3, 3) float64
        Directors (rows d1, d2, d3) of the elements at rest.
    radius : (n,) float64, m
    density : float, kg/m^3
    youngs_modulus, shear_modulus : float, Pa
    shear_coefficient : float
    support : {"free", "clamped", "element"}
        ``clamped`` holds the base node and the frame at s = 0, with bending over the half element in between, which is second order in
        the element length; ``element`` holds node and frame of the whole first element, as PyElastica does, which is first order.
    section : {"incompressible", "constant"}
        Whether the section shrinks as the rod stretches, as PyElastica has it, or keeps its area. Only the latter conserves energy.
    damping : float, 1/s
        Rate at which velocities decay in the absence of forces, exact over a step and independent of it.

    Raises
    ------
    OctoctrlError
        If shapes do not fit or a constant is out of range.
    """

    points: np.ndarray
    frames: np.ndarray
    radius: np.ndarray
    density: float
    youngs_modulus: float
    shear_modulus: float
    shear_coefficient: float = CIRCULAR_SHEAR
    support: str = field(default="free")
    section: str = field(default="incompressible")
    damping: float = 0.0

    def __post_init__(self):
        count = len(self.radius)
        for name, shape in (("points", (count + 1, 3)), ("frames", (count, 3, 3))):
            if np.shape(getattr(self, name)) != shape:
                raise OctoctrlError(f"{name}: expected shape {shape}, found {np.shape(getattr(self, name))}")
        check_choice("support", self.support, SUPPORTS)
        check_choice("section", self.section, SECTIONS)
        check_number("density", self.density, above=0.0, unit="kg/m^3")
        check_number("youngs_modulus", self.youngs_modulus, above=0.0, unit="Pa")
        check_number("shear_modulus", self.shear_modulus, above=0.0, unit="Pa")
        check_number("damping", self.damping, at_least=0.0, unit="1/s")

    @classmethod
    def straight(cls, *, length, radius, elements, direction=(0.0, 1.0, 0.0), normal=(0.0, 0.0, 1.0), **material):
        """A straight rod of constant or given radius from the origin along `direction`, with d1 along `normal`."""
        d3 = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
        d1 = np.asarray(normal, dtype=float) - np.dot(normal, d3) * d3
        d1 /= np.linalg.norm(d1)
        frame = np.array([d1, np.cross(d3, d1), d3])
        return cls(
            points=np.linspace(0, length, elements + 1)[:, None] * d3,
            frames=np.broadcast_to(frame, (elements, 3, 3)).copy(),
            radius=np.broadcast_to(np.asarray(radius, dtype=float), (elements,)).copy(),
            **material,
        )


@cache
def _elastic_advance(stride, constant_section):
    from .stepping import elastic_stepper

    return elastic_stepper(stride, constant_section)


class RodSimulation:
    """A rod in motion.

    Parameters
    ----------
    rod : Rod
    dt : float or "auto", s
        Time step; ``"auto"`` takes 0.8 of the predicted stability limit.

    Attributes
    ----------
    time : float, s
    limit : StepLimit
        Predicted largest stable step at rest, and what would grow above it.

    Raises
    ------
    OctoctrlError
        If `dt` exceeds the stability limit.
    """

    def __init__(self, rod, dt="auto"):
        self.rod = rod
        self.elements = len(rod.radius)
        self.time = 0.0
        self.buffer, self.rows = new_buffer(self.elements)
        self._fill()
        self.limit = self.step_limit()
        self.dt = choose_step(dt, self.limit)
        self._prepare(self.dt)

    def _prepare(self, h):
        rate = self.rod.damping
        set_damping(self.rows, self.elements, h, rate, rate, rate, fixed=self.rod.support, masses=self.node_mass)

    def _step(self, h, steps, points, frames, stretch):
        step = _elastic_advance(stride_for(self.elements), self.rod.section == "constant")
        return step(self.buffer, np.uint64(self.elements), h, steps, points, frames, stretch)

    def step_limit(self):
        """Predicted largest stable step in the present state, as a `StepLimit`."""
        n = self.elements
        scratch = np.empty((1, n + 1, 3)), np.empty((1, n, 3, 3)), np.empty((1, n))
        return predict_limit(self.rows, n, self.node_mass, self._prepare, lambda h: self._step(h, 1, *scratch))

    def _fill(self):
        rod, n, rows = self.rod, self.elements, self.rows
        edges = np.diff(rod.points, axis=0)
        length = np.linalg.norm(edges, axis=1)
        area = pi * rod.radius**2
        second_moment = area**2 / (4 * pi)
        set_state(rows, n, rod.points, rod.frames, rod.frames[0])
        rows[Row.SHEAR, 1 : n + 1] = rod.shear_coefficient * rod.shear_modulus * area
        rows[Row.AXIAL, 1 : n + 1] = rod.youngs_modulus * area
        inertia = rod.density * length * second_moment
        rows[Row.INERTIA1, 1 : n + 1] = rows[Row.INERTIA2, 1 : n + 1] = inertia
        rows[Row.INERTIA3, 1 : n + 1] = 2 * inertia
        bend, twist = rod.youngs_modulus * second_moment, 2 * rod.shear_modulus * second_moment
        set_joints(rows, n, length, bend, twist, clamped=rod.support == "clamped")
        rows[Row.REST1 : Row.REST3 + 1, 1 : n + 1] = joint_curvature(rows, n)
        self.node_mass = node_masses(rod.density * area * length)
        rows[Row.NODE_MOBILITY, 1 : n + 2] = 1 / self.node_mass
        for component in range(3):
            rows[Row.MOBILITY1 + component, 1 : n + 1] = 1 / rows[Row.INERTIA1 + component, 1 : n + 1]

    @property
    def points(self):
        """Node positions (n + 1, 3), m."""
        return self.rows[Row.X1 : Row.X3 + 1, 1 : self.elements + 2].T.copy()

    @property
    def velocities(self):
        """Node velocities (n + 1, 3), m/s; assign to set them."""
        return self.rows[Row.V1 : Row.V3 + 1, 1 : self.elements + 2].T.copy()

    @velocities.setter
    def velocities(self, value):
        """Set node velocities from `value` (n + 1, 3), m/s."""
        self.rows[Row.V1 : Row.V3 + 1, 1 : self.elements + 2] = np.asarray(value, dtype=float).T

    @property
    def spins(self):
        """Angular velocities of the elements in their own frames (n, 3), rad/s; assign to set them."""
        return self.rows[Row.W1 : Row.W3 + 1, 1 : self.elements + 1].T.copy()

    @spins.setter
    def spins(self, value):
        """Set angular velocities from `value` (n, 3), rad/s."""
        self.rows[Row.W1 : Row.W3 + 1, 1 : self.elements + 1] = np.asarray(value, dtype=float).T

    @property
    def frames(self):
        """Directors (n, 3, 3)."""
        return self.rows[Row.Q11 : Row.Q33 + 1, 1 : self.elements + 1].T.reshape(-1, 3, 3).copy()

    def place(self, points, frames):
        """Put the rod into a shape, nodes (n + 1, 3) in m and frames (n, 3, 3), without motion; what it is at rest does not change."""
        n = self.elements
        base = self.rows[Row.Q11 : Row.Q33 + 1, 0].copy()
        set_state(self.rows, n, points, frames, base.reshape(3, 3))

    def load(self, *, tip_force=(0.0, 0.0, 0.0), tip_couple=(0.0, 0.0, 0.0), force_per_length=(0.0, 0.0, 0.0), gravity=(0.0, 0.0, 0.0)):
        """Set dead loads: force (N) and couple (N m) at the tip, force per rest length (N/m), gravity (m/s^2), in the lab frame."""
        n, rows = self.elements, self.rows
        share = node_masses(rows[Row.LENGTH, 1 : n + 1])
        for component in range(3):
            force = share * force_per_length[component] + self.node_mass * gravity[component]
            force[-1] += tip_force[component]
            rows[Row.FORCE1 + component, 1 : n + 2] = force
            rows[Row.COUPLE1 + component, 1 : n + 1] = 0.0
            rows[Row.COUPLE1 + component, n] = tip_couple[component]

    def energy(self):
        """Kinetic and elastic energy, J."""
        return rod_energy(self.rows, self.elements, self.node_mass, constant_section=self.rod.section == "constant")

    def advance(self, duration, samples=1):
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
            If the rod diverges; the message names time, element and mechanism.
        """
        check_number("duration", duration, above=0.0, unit="s")
        interval = duration / samples
        steps = max(1, round(interval / self.dt))
        if abs(steps * self.dt - interval) > 1e-9 * interval:
            steps = int(np.ceil(interval / self.dt * (1 - 1e-12)))
        h = interval / steps
        self._prepare(h)
        n = self.elements
        points, frames, stretch = np.empty((samples, n + 1, 3)), np.empty((samples, n, 3, 3)), np.empty((samples, n))
        done, finding, element = self._step(h, steps, points, frames, stretch)
        time = self.time + interval * np.arange(1, samples + 1)
        self.time += interval * done
        if finding:
            raise_unstable(self.time + interval, int(element) - 1, finding, h, self.limit)
        return time, points, frames


def set_state(rows, n, points, frames, base_frame):
    """Write positions (n + 1, 3), frames (n, 3, 3) and the ghost frame of the clamp; everything at rest."""
    rows[:STATE_ROWS] = 0.0
    rows[Row.X1 : Row.X3 + 1, 1 : n + 2] = np.asarray(points).T
    rows[Row.Q11 : Row.Q33 + 1, 1 : n + 1] = np.asarray(frames).reshape(n, 9).T
    rows[Row.Q11 : Row.Q33 + 1, 0] = np.asarray(base_frame).reshape(9)
    rows[Row.STRETCH] = 1.0


def set_joints(rows, n, length, bend, twist, clamped):
    """Lengths of elements and joints, and stiffnesses (per element, N m^2) averaged over the two half elements of each joint."""
    joint = np.empty(n + 1)
    joint[0], joint[-1], joint[1:-1] = length[0] / 2, length[-1] / 2, (length[1:] + length[:-1]) / 2
    rows[Row.JOINT_LENGTH, 1 : n + 2], rows[Row.INVERSE_JOINT, 1 : n + 2] = joint, 1 / joint
    rows[Row.LENGTH, 1 : n + 1], rows[Row.INVERSE_LENGTH, 1 : n + 1] = length, 1 / length
    for row, stiffness in ((Row.BEND1, bend), (Row.BEND2, bend), (Row.TWIST, twist)):
        rows[row, 2 : n + 1] = (stiffness[1:] * length[1:] + stiffness[:-1] * length[:-1]) / (length[1:] + length[:-1])
        rows[row, 1] = stiffness[0] if clamped else 0.0


def node_masses(element_values):
    """Half of each element's value on either of its nodes."""
    return np.concatenate([[element_values[0] / 2], (element_values[1:] + element_values[:-1]) / 2, [element_values[-1] / 2]])


def set_damping(rows, n, h, node_rate, bend_rate, twist_rate, *, fixed, masses=None):
    """Decay factors exp(-g h) and mobilities h phi1(g h) / inertia; held nodes and elements get neither."""
    masses = 1 / rows[Row.NODE_MOBILITY, 1 : n + 2] if masses is None else masses
    decay, weight = damped(node_rate, h)
    rows[Row.NODE_DECAY, 1 : n + 2] = decay
    rows[Row.NODE_MOBILITY, 1 : n + 2] = weight / masses
    bend_decay, bend_weight = damped(bend_rate, h)
    twist_decay, twist_weight = damped(twist_rate, h)
    rows[Row.BEND_DECAY, 1 : n + 1], rows[Row.TWIST_DECAY, 1 : n + 1] = bend_decay, twist_decay
    rows[Row.MOBILITY1, 1 : n + 1] = bend_weight / rows[Row.INERTIA1, 1 : n + 1]
    rows[Row.MOBILITY2, 1 : n + 1] = bend_weight / rows[Row.INERTIA2, 1 : n + 1]
    rows[Row.MOBILITY3, 1 : n + 1] = twist_weight / rows[Row.INERTIA3, 1 : n + 1]
    if fixed != "free":
        rows[Row.NODE_DECAY, 1] = rows[Row.NODE_MOBILITY, 1] = 0.0
    if fixed == "element":
        for row in (Row.BEND_DECAY, Row.TWIST_DECAY, Row.MOBILITY1, Row.MOBILITY2, Row.MOBILITY3):
            rows[row, 1] = 0.0


def raise_unstable(time, element, finding, dt, limit):
    """Raise `PlantUnstableError` in physical terms."""
    cause = "most likely a sudden load - smooth it (ramp >= 20 ms) or halve dt"
    stop = Stop(time=time, rod="arm", element=element, finding=Finding(finding), unstable=None, cause=cause)
    known = f"(dt={dt:.2g} s, predicted limit {limit.step:.2g} s from {limit.mechanism})"
    raise PlantUnstableError.of(stop, f"unstable at t={time:.3f} s: {stop.place} {stop.mechanism} {known}; {cause}")


def joint_curvature(rows, n):
    """Curvature (3, n) of the joints, 1/m, from the present frames; joint 1 is the one at the base."""
    frames = rows[Row.Q11 : Row.Q33 + 1, : n + 1].T.reshape(-1, 3, 3)
    return (rotation_vector(frames[1:] @ np.swapaxes(frames[:-1], 1, 2)) / rows[Row.JOINT_LENGTH, 1 : n + 1, None]).T


def rod_energy(rows, n, node_mass, constant_section):
    """Kinetic and elastic energy of a rod at a sample, J; for an incompressible section what is called elastic is its nearest relative."""
    points, frames = rows[Row.X1 : Row.X3 + 1, 1 : n + 2], rows[Row.Q11 : Row.Q33 + 1, 1 : n + 1].T.reshape(-1, 3, 3)
    edges, length = np.diff(points, axis=1).T, rows[Row.LENGTH, 1 : n + 1]
    stretch = np.ones(n) if constant_section else np.linalg.norm(edges, axis=1) / length
    sigma = np.einsum("kij,kj->ki", frames, edges) / length[:, None] - np.array([0.0, 0.0, 1.0])
    stiffness = np.stack([rows[Row.SHEAR, 1 : n + 1], rows[Row.SHEAR, 1 : n + 1], rows[Row.AXIAL, 1 : n + 1]], axis=1)
    kinetic = 0.5 * np.sum(node_mass * np.sum(rows[Row.V1 : Row.V3 + 1, 1 : n + 2] ** 2, axis=0))
    kinetic += 0.5 * np.sum(rows[Row.INERTIA1 : Row.INERTIA3 + 1, 1 : n + 1] * rows[Row.W1 : Row.W3 + 1, 1 : n + 1] ** 2 / stretch)
    bending = np.stack([rows[row, 1 : n + 1] for row in (Row.BEND1, Row.BEND2, Row.TWIST)])
    kappa = joint_curvature(rows, n) - rows[Row.REST1 : Row.REST3 + 1, 1 : n + 1]
    elastic = 0.5 * np.sum(stiffness * sigma**2 / stretch[:, None] * length[:, None])
    elastic += 0.5 * np.sum(bending * kappa**2 * rows[Row.JOINT_LENGTH, 1 : n + 1])
    return {"kinetic": float(kinetic), "elastic": float(elastic)}
