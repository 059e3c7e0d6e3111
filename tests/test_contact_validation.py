"""A straight rod on a plane and against bodies: sliding, rolling, slipping and collisions in closed form.

A rod of 1 m, 25 mm and 1 kg in 50 elements under gravity; the cases and their numbers are those of Gazzola et al. (2018), R. Soc. Open
Sci. 5:171628, section 3, computed anew.
"""

from math import pi

import numpy as np
import pytest

from octoctrl.sim.compiler import kernel
from octoctrl.sim.contact.body_kernels import drift_bodies, kick_bodies
from octoctrl.sim.contact.columns import Anchor, Body
from octoctrl.sim.contact.sweep_kernels import contact_sweeps
from octoctrl.sim.contact.world import World, points_of
from octoctrl.sim.rod.contact_kernels import rod_surface
from octoctrl.sim.rod.elastic import RodSimulation
from octoctrl.sim.rod.elastic_kernels import rod_kernels
from octoctrl.sim.rod.layout import Row, stride_for
from octoctrl.sim.rod.rod import Rod
from octoctrl.sim.scene.objects import Capsule, Plane, Sphere
from octoctrl.sim.scene.supports import Free

RADIUS, ELEMENTS, G, STEP = 0.025, 50, 9.80665, 1e-4
ALONG, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
SLIDING = (0.8, 0.4)
ROLLING = (0.4, 0.2)

drift, strain, curvature, _, moment, transport, kick, _ = rod_kernels(stride_for(ELEMENTS), True)
watch, touch, follow = contact_sweeps(rod_surface(stride_for(ELEMENTS), constant_section=True))
COUNT = np.uint64(ELEMENTS)


@kernel
def go(b, world, h, steps):
    """The order of a plant's step, for a rod without muscles."""
    drift(b, COUNT, 0.5 * h)
    drift_bodies(world.bodies, 0.5 * h)
    for step in range(steps):
        if step % 10 == 0:
            watch(b, world, 10 * h)
        strain(b, COUNT)
        curvature(b, COUNT)
        moment(b, COUNT)
        transport(b, COUNT)
        kick(b, COUNT)
        kick_bodies(world.bodies, h)
        touch(b, world, h)
        follow(b, world, h)
        way = h if step + 1 < steps else 0.5 * h
        drift(b, COUNT, way)
        drift_bodies(world.bodies, way)


class Case:
    """A rod along x that lies with its lowest line at z = 0, with bodies."""

    def __init__(self, *bodies, young=1e5):
        rod = Rod.straight(
            length=1.0, radius=RADIUS, elements=ELEMENTS, direction=ALONG, normal=UP, density=1 / (pi * RADIUS**2), youngs_modulus=young,
            shear_modulus=young / 1.5, section="constant",
        )  # fmt: skip
        self.sim = RodSimulation(rod, dt=STEP)
        self.sim.place(self.sim.points - self.sim.points[:1] + RADIUS * UP, self.sim.frames)
        self.rows = self.sim.rows
        self.set_inertia(1.0)
        points = points_of(np.linspace(0, 1, ELEMENTS + 1), np.full(ELEMENTS, RADIUS))
        self.world = World.of(points, bodies)

    def set_inertia(self, factor):
        """Rotary inertia of that many times m r^2 / 2, the same in all directions as in an arm."""
        inside = slice(1, ELEMENTS + 1)
        inertia, mobility = factor * self.rows[Row.INERTIA3, inside], self.rows[Row.MOBILITY3, inside] / factor
        self.rows[Row.INERTIA1 : Row.INERTIA3 + 1, inside], self.rows[Row.MOBILITY1 : Row.MOBILITY3 + 1, inside] = inertia, mobility

    def load(self, *, gravity=-G * UP, couple=0.0, pull=0.0):
        """Set loads, spread along the rod: a `couple` (N m) about its axis, and a `pull` (N) along its lowest line."""
        self.sim.load(gravity=gravity, force_per_length=pull * ALONG)
        self.rows[Row.COUPLE1, 1 : ELEMENTS + 1], self.rows[Row.COUPLE2, 1 : ELEMENTS + 1] = couple / ELEMENTS, -pull * RADIUS / ELEMENTS

    def move(self, duration):
        go(self.sim.buffer, self.world, STEP, round(duration / STEP))
        return self

    def settled(self):
        """Let it lie down by its weight."""
        self.load()
        return self.move(0.2)

    def ramp(self, duration, loads, rise=0.1):
        """Put on ``loads(share)`` within a `rise` (s), which counts as half of it under all of them, and go on to `duration`.

        Put on at once, a load near the limit would overshoot what the anchors hold.
        """
        for share in (np.arange(100) + 0.5) / 100:
            self.load(**loads(share))
            self.move(rise / 100)
        self.load(**loads(1.0))
        return self.move(duration - rise / 2)

    def energies(self):
        """Kinetic energy of translation and of rotation, J."""
        v, w = self.sim.velocities, self.sim.spins
        inertia = self.rows[Row.INERTIA1 : Row.INERTIA3 + 1, 1 : ELEMENTS + 1].T
        return 0.5 * (self.sim.node_mass[:, None] * v**2).sum(), 0.5 * (inertia * w**2).sum()


def floor(friction, stiffness=8e4):
    """Soft enough that all points hold alike to the last percent before the limit; the rod sinks in by 0.5 % of its radius."""
    return Plane(name="floor", friction=friction, stiffness=stiffness)


@pytest.mark.parametrize(
    ("friction", "force", "energy"),
    [(SLIDING, 8.0, 0.519522), (SLIDING, 10.0, 1.154189), ((0.4, 0.2), -4.1, 0.142935), ((0.4, 0.2), -8.0, 1.139548)],
)
def test_case_23_a_rod_pulled_along_its_axis_slides_with_kinetic_friction(friction, force, energy):
    # Anchors that give little before they slip, and a rod so stiff that it does not chatter.
    case = Case(floor(friction, 1e5), young=8e6).settled()
    case.load(pull=force)
    assert sum(case.move(0.25).energies()) == pytest.approx(energy, rel=0.01)


@pytest.mark.parametrize(("friction", "force"), [(SLIDING, 7.6), ((0.4, 0.2), -3.8)])
def test_case_23_below_the_limit_it_stays(friction, force):
    """At 0.97 of it: points at the ends bear a percent less than the mean, and slip first."""
    case = Case(floor(friction, 4e4), young=8e6).settled()
    case.ramp(1.0, lambda share: {"pull": share * force}, rise=1.0)
    begin = case.sim.points
    case.move(0.25)
    assert sum(case.energies()) < 1e-12 and np.abs(case.sim.points - begin).max() < 1e-9


@pytest.mark.parametrize(
    ("couple", "translation", "rotation"),
    [
        (0.05, 0.888889, 0.444444),
        (0.10, 3.555556, 1.777778),
        (0.14, 6.968889, 3.484444),
        (0.15, 1.923408, 16.310855),
        (0.18, 1.923408, 27.443663),
    ],
)
def test_case_24_a_couple_rolls_a_rod_and_spins_it_above_the_limit(couple, translation, rotation):
    case = Case(floor(ROLLING)).settled()
    if couple < 0.147:
        case.ramp(1.0, lambda share: {"couple": share * couple})
    else:
        case.load(couple=couple)
        case.move(1.0)
    found = case.energies()
    assert found == pytest.approx((translation, rotation), rel=0.01)


@pytest.mark.parametrize(
    ("factor", "translation", "rotation"), [(0.2, 0.413223, 0.041322), (1.0, 0.222222, 0.111111), (1.9, 0.131492, 0.124918)]
)
def test_case_25_a_rod_that_slips_comes_to_roll(factor, translation, rotation):
    case = Case(floor(ROLLING))
    case.set_inertia(factor)
    case.settled()
    case.sim.velocities = np.tile([0.0, 1.0, 0.0], (ELEMENTS + 1, 1))
    found = case.move(2.0).energies()
    assert found == pytest.approx((translation, rotation), rel=0.01)


@pytest.mark.parametrize(
    ("angle", "translation", "rotation"),
    [
        (0.1, 0.510192, 0.255096),
        (0.2, 1.845892, 0.922946),
        (0.25, 2.671400, 1.335700),
        (0.3, 5.747585, 0.332261),
        (0.4, 9.506095, 0.091835),
    ],
)
def test_case_26_a_rod_rolls_down_an_incline_and_slips_on_a_steep_one(angle, translation, rotation):
    case, across = Case(floor(ROLLING)).settled(), np.array([0.0, G * np.sin(angle * pi), 0.0])
    case.load(gravity=-G * np.cos(angle * pi) * UP)
    case.move(0.2)
    if angle < 0.278:
        case.ramp(0.5, lambda share: {"gravity": share * across - G * np.cos(angle * pi) * UP})
    else:
        case.load(gravity=across - G * np.cos(angle * pi) * UP)
        case.move(0.5)
    found = case.energies()
    assert found == pytest.approx((translation, rotation), rel=0.01)


def test_case_29_what_just_touches_feels_no_force():
    ball = Sphere(name="ball", radius=0.05, position=(0.51, 0.0, 2 * RADIUS + 0.05))
    case = Case(ball)
    case.load(gravity=np.zeros(3))
    before = case.sim.points
    case.move(0.01)
    # Touching is a gap that rounds to zero.
    assert np.abs(case.world.bodies[0, Body.IMPULSE : Body.IMPULSE + 3]).max() < 1e-15
    np.testing.assert_allclose(case.sim.points, before, atol=1e-15)


@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_case_29_a_collision_keeps_momentum_and_rebounds_no_faster_than_it_came(speed):
    other = Capsule(
        name="other", radius=RADIUS, length=0.2, position=(0.5, 0.06, RADIUS), axis=(1, 0, 0), mass=0.5, support=Free(damping=(0, 0)),
        water_mass=False, stiffness=1e5,
    )  # fmt: skip
    case = Case(other, young=1e6)
    case.load(gravity=np.zeros(3))
    case.sim.velocities = np.tile([0.0, speed, 0.0], (ELEMENTS + 1, 1))
    mass, row = case.sim.node_mass[:, None], case.world.bodies[0]

    def momenta():
        points, v, frames = case.sim.points, case.sim.velocities, case.sim.frames
        spin = (case.rows[Row.INERTIA1 : Row.INERTIA3 + 1, 1 : ELEMENTS + 1].T * case.sim.spins)[:, None] @ frames
        centre, velocity = row[Body.POSITION : Body.POSITION + 3], row[Body.VELOCITY : Body.VELOCITY + 3]
        linear = (mass * v).sum(axis=0) + 0.5 * velocity
        angular = (mass * np.cross(points, v)).sum(axis=0) + spin.sum(axis=(0, 1)) + 0.5 * np.cross(centre, velocity)
        return linear, angular + row[Body.MOMENTUM : Body.MOMENTUM + 3]

    before = momenta()
    case.move(0.2 / speed)
    after = momenta()
    closing = (mass * case.sim.velocities).sum(axis=0)[1] - row[Body.VELOCITY + 1]
    assert row[Body.VELOCITY + 1] > 0.3 * speed and -speed < closing < 0
    assert not case.world.anchors[..., Anchor.NORMAL].any()
    assert np.abs(after[0] - before[0]).max() < 1e-12 * speed
    assert np.abs(after[1] - before[1]).max() < 1e-11 * speed
