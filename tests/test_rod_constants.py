"""Constants of the muscular rod: what one infinitesimal step answers to a load, a strain or a muscle, against closed forms of the section.

Starting from a shape at rest, a step h gives a node h F / m and an element h C / J: so forces, couples, masses and inertias are read off
the motion itself. The arm has no taper, so that every section is the same; its numbers are written here once more from the anatomy.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from octoctrl.sim.body.arm import REST_FRAME, Arm
from octoctrl.sim.body.muscles import LONGITUDINAL, TRANSVERSE
from octoctrl.sim.rod.core import RodCore
from octoctrl.sim.rod.layout import Row
from octoctrl.sim.rotations import rotation_matrix
from octoctrl.sim.scene.loads import FORCE, TORQUE
from octoctrl.sim.scene.scene import Scene, Water

N, LENGTH = 20, 0.2
ARM = Arm(taper=1.0, elements=N)
DRY = Scene(water=None)
INSTANT = 1e-13
"""Seconds: long against rounding, short against all that muscle viscosity could do."""

# The section, by hand: eight muscles around the cord, touching it and each other, rings around them, helices outside.
CORD = 0.012 * np.sqrt(0.62 / (1 + 8 * 0.6199142**2))
MUSCLE = 0.6199142 * CORD
OFFSET, RING = CORD + MUSCLE, CORD + 2 * MUSCLE + 0.2 / 360
HELIX_FIBRE = 1.1322951e-3
HELIX = RING + 0.2 / 360 + HELIX_FIBRE
WINDING = 2 * np.pi / (0.2 / 9)
REST = np.hypot(1.0, HELIX * WINDING)
CORD_AREA, MUSCLE_AREA, RING_AREA = np.pi * CORD**2, np.pi * MUSCLE**2, np.pi**2 * RING * (0.2 / 360)
HELIX_AREA = 4 * np.pi * HELIX_FIBRE**2
MASSES = 1050.0 * CORD_AREA, 1261.238 * 8 * MUSCLE_AREA, 858.4457 * RING_AREA, 1047.449 * 2 * HELIX_AREA * REST
"""Per length, kg/m: cord, longitudinal, transverse, oblique."""
INERTIAS = (
    MASSES[0] * CORD**2 / 2, MASSES[1] * (OFFSET**2 + MUSCLE**2 / 2), MASSES[2] * RING**2, MASSES[3] * HELIX**2,
)  # fmt: skip
"""Polar, kg m."""
STEP = LENGTH / N
TIP_MASS, INERTIA = sum(MASSES) * STEP / 2, sum(INERTIAS) * STEP


def core(scene=DRY, arm=ARM):
    return RodCore(arm, scene)


def inside(rod, row, values):
    rod.rows[row : row + 3, 1 : N + 1 + (row in (Row.X1, Row.V1))] = np.asarray(values).T


def answer(rod, levels=None, *, forces=None, couples=None, h=INSTANT):
    """Accelerations (n + 1, 3) of nodes in the lab frame and (n, 3) of elements in their own, under loads of the same shapes."""
    levels = {} if levels is None else levels
    both = np.zeros((2, len(rod.arm.layout), N))
    for group, level in levels.items():
        both[:, rod.arm.layout.index(group)] = level
    loads = np.zeros((2, 2, 3, N + 1))
    if forces is not None:
        loads[:, FORCE] = forces.T
    if couples is not None:
        loads[:, TORQUE, :, :N] = couples.T
    clock = SimpleNamespace(step=h, steps=1)
    rod.start(clock)
    velocities, spins = rod.speeds()
    rod.move(0, {"arm": both, "loads": loads}, clock)
    after = rod.speeds()
    return (after[0] - velocities) / h, (after[1] - spins) / h


def test_masses_of_the_layers_are_those_of_the_anatomy():
    # Of the tapered arm, in grammes, as its source prints them, to what cells of an arm that is not straight-sided differ by.
    masses = Arm().section(np.array([0.0])).masses
    assert masses == pytest.approx([mass for (mass,) in zip(MASSES, strict=True)], rel=1e-6)


def test_nodes_have_the_mass_of_their_share():
    rod = core()
    weight = np.array([1.0, -2.0, 3.0])
    nodes, _ = answer(rod, forces=np.tile(weight, (N + 1, 1)))
    assert nodes[-1] == pytest.approx(weight / TIP_MASS, rel=1e-6)
    assert nodes[5] == pytest.approx(weight / (2 * TIP_MASS), rel=1e-6)
    assert not nodes[0].any()


@pytest.mark.parametrize("axis", range(3))
def test_a_couple_spins_up_what_the_layers_weigh(axis):
    # Bending has the polar inertia as well: the implicit step asks for one that is alike in all directions.
    rod, couple = core(), np.zeros(3)
    couple[axis] = 1e-3
    _, spins = answer(rod, couples=np.tile(couple @ REST_FRAME, (N, 1)))
    assert spins == pytest.approx(np.tile(couple / INERTIA, (N, 1)), rel=1e-6, abs=1e-6)


def bent(rod, curvature):
    """Put the rod into a uniform curvature (d1, d2, d3), 1/m, without shear or stretch."""
    half = rotation_matrix(np.asarray(curvature) * STEP / 2)
    frames = [half @ REST_FRAME]
    for _ in range(N - 1):
        frames.append(rotation_matrix(np.asarray(curvature) * STEP) @ frames[-1])
    frames = np.array(frames)
    inside(rod, Row.X1, np.concatenate([np.zeros((1, 3)), np.cumsum(frames[:, 2] * STEP, axis=0)]))
    rod.rows[Row.Q11 : Row.Q33 + 1, 1 : N + 1] = frames.reshape(N, 9).T


BEND = 10e3 * np.pi / 4 * (CORD**4 + 8 * MUSCLE**4)
TWIST = 10e3 / 1.5 * (np.pi / 2 * (CORD**4 + 8 * MUSCLE**4) + 0.155 * 4 * np.pi * (0.2 / 360) * RING**3)


@pytest.mark.parametrize("curvature, stiffness", [((0.5, 0, 0), BEND), ((0, 0.5, 0), BEND), ((0, 0, 0.5), TWIST)])
def test_the_last_element_is_turned_back_by_the_stiffness_of_straight_rods_and_rings(curvature, stiffness):
    # So gently that no fibre leaves its slack.
    rod = core()
    bent(rod, curvature)
    _, spins = answer(rod)
    assert spins[-1] == pytest.approx(-stiffness * np.array(curvature) / INERTIA, rel=1e-6, abs=1e-6)
    # In between moments cancel, and at the clamp the bending over half an element holds as much.
    assert np.abs(spins[:-1]).max() < 1e-6 * np.abs(spins[-1]).max()


def test_shear_is_carried_by_all_that_runs_along():
    rod, angle = core(), 1e-3
    nodes = np.zeros((N + 1, 3))
    nodes[:, 1], nodes[:, 0] = np.linspace(0, LENGTH, N + 1), angle * np.linspace(0, LENGTH, N + 1)
    inside(rod, Row.X1, nodes)
    shear = 4 / 3 * 10e3 / 1.5 * (CORD_AREA + 8 * MUSCLE_AREA + 2 * HELIX_AREA * REST)
    accelerations, spins = answer(rod)
    assert accelerations[-1, 0] == pytest.approx(-shear * angle / TIP_MASS, rel=1e-5)
    # The couple of the shear force about the element's length: it turns d3 towards the tangent, about d1 = z from y to x.
    assert spins[5] == pytest.approx([-shear * angle * STEP / INERTIA, 0, 0], rel=1e-5, abs=1e-6)


LEVEL = 0.3
ISOMETRIC = LEVEL * LONGITUDINAL.maximum_stress * float(LONGITUDINAL.active_factor(1.0))
PULL, WIND = 0.908 * ISOMETRIC, 0.461 * ISOMETRIC
SQUEEZE = LEVEL * TRANSVERSE.maximum_stress * float(TRANSVERSE.active_factor(1.0))
HOOP = 0.448


def at_the_tip(levels):
    """Force along the arm on the tip, N, and couple on the last element, N m."""
    nodes, spins = answer(core(), levels)
    assert np.abs(nodes[1:-1]).max() < 1e-5 * np.abs(nodes[-1]).max()  # tension is the same everywhere
    return nodes[-1] * TIP_MASS, spins[-1] * INERTIA


def test_longitudinal_muscles_pull_with_stress_times_area():
    force, couple = at_the_tip({f"LM{m}": LEVEL for m in range(1, 9)})
    assert force == pytest.approx([0, -8 * MUSCLE_AREA * PULL, 0], rel=1e-6, abs=1e-9)
    assert couple == pytest.approx(np.zeros(3), abs=1e-9)


@pytest.mark.parametrize("muscle", range(8))
def test_one_longitudinal_muscle_bends_by_its_lever(muscle):
    force, couple = at_the_tip({f"LM{muscle + 1}": LEVEL})
    azimuth = muscle * np.pi / 4
    assert force[1] == pytest.approx(-MUSCLE_AREA * PULL, rel=1e-6)
    # Material components: d1 = +z, d2 = +x; the fibre stands at (sin, cos) and pulls along -d3.
    lever = OFFSET * np.array([np.sin(azimuth), np.cos(azimuth), 0.0])
    assert couple == pytest.approx(np.cross(lever, [0, 0, -MUSCLE_AREA * PULL]), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("group, hand", [("R-OM", 1), ("L-OM", -1)])
def test_oblique_muscles_twist_by_their_winding(group, hand):
    force, couple = at_the_tip({group: LEVEL})
    turn = HELIX * WINDING
    # Shortening of l = sqrt(e^2 + (rho lam)^2 (h q + k3)^2) per stretch and per twist, with lam = e^-nu.
    assert force[1] == pytest.approx(-HELIX_AREA * WIND * (1 - HOOP * turn**2) / REST, rel=1e-6)
    assert couple == pytest.approx([0, 0, -hand * HELIX_AREA * WIND * HELIX * turn / REST], rel=1e-6, abs=1e-9)


def test_rings_push_the_tip_out():
    force, couple = at_the_tip({"TM": LEVEL})
    assert force == pytest.approx([0, HOOP * RING_AREA * SQUEEZE, 0], rel=1e-6, abs=1e-9)
    assert couple == pytest.approx(np.zeros(3), abs=1e-9)


@pytest.mark.parametrize("stretch", [0.9, 1.1, 1.3])
def test_a_fibre_of_constant_volume_pulls_with_its_stress_on_the_present_area(stretch):
    # Isometric: at a fixed length eight muscles pull with a sigma f(s) A / s, and so do cord and muscles with their passive stress.
    def force(levels):
        rod = core()
        rod.rows[Row.X2, 1 : N + 2] *= stretch
        nodes, _ = answer(rod, levels)
        return nodes[-1, 1] * TIP_MASS

    active = force({f"LM{m}": LEVEL for m in range(1, 9)}) - force({})
    assert active == pytest.approx(
        -8 * MUSCLE_AREA / stretch * 0.908 * LEVEL * LONGITUDINAL.maximum_stress * float(LONGITUDINAL.active_factor(stretch)), rel=1e-5
    )
    lam = stretch**-HOOP
    length = np.hypot(stretch, HELIX * WINDING * lam)
    slope = (stretch - HOOP * (HELIX * WINDING * lam) ** 2 / stretch) / length
    passive = (CORD_AREA + 8 * MUSCLE_AREA) / stretch * float(LONGITUDINAL.passive_stress(stretch))
    passive += 2 * HELIX_AREA * REST / length * 0.445 * float(LONGITUDINAL.passive_stress(length / REST)) * slope
    passive -= RING_AREA * HOOP / stretch * float(TRANSVERSE.passive_stress(lam))
    assert force({}) == pytest.approx(-passive, rel=1e-5, abs=1e-6)


# Water.


def moving(scene, velocity, seconds, *, spin=0.0, samples=4):
    """Tip velocity and spin of a straight arm after `seconds`, before what holds its base is felt there."""
    rod = core(scene)
    h = seconds / samples / round(seconds / samples / 1e-5)
    inside(rod, Row.V1, np.tile(velocity, (N + 1, 1)))
    inside(rod, Row.W1, np.tile([0.0, 0.0, spin], (N, 1)))
    clock = SimpleNamespace(step=h, steps=round(seconds / samples / h))
    rod.start(clock)
    assert len(rod.move(0, {"arm": np.zeros((samples + 1, 11, N))}, clock).points) == samples
    velocities, spins = rod.speeds()
    return velocities[-1], spins[-1]


def water(**changes):
    return Scene(water=Water(**{"ring_rate": 0.0, "oblique_rate": 0.0, "normal_coefficient": 0.0, "tangential_coefficient": 0.0} | changes))


def test_quadratic_drag_across_is_that_of_eight_cylinders():
    # v' = -c v^2 with c = rho/2 C 2 r per length and muscle over the mass per length; factor and density enter once.
    speed, seconds = 0.5, 8e-3
    drag = 8 * 0.5 * 1050.0 * 1.013 * 2 * MUSCLE / sum(MASSES)
    tip, _ = moving(water(normal_coefficient=1.013), [0, 0, speed], seconds)
    assert tip == pytest.approx([0, 0, speed / (1 + drag * speed * seconds)], rel=2e-4, abs=1e-6)
    assert moving(water(normal_coefficient=0.5 * 1.013, factor=2.0), [0, 0, speed], seconds)[0] == pytest.approx(tip, rel=1e-12)


def test_quadratic_drag_along_is_that_of_their_surface():
    speed, seconds = 1.0, 4e-3
    drag = 8 * 0.5 * 1050.0 * 0.256 * 2 * np.pi * MUSCLE / sum(MASSES)
    tip, _ = moving(water(tangential_coefficient=0.256), [0, speed, 0], seconds)
    assert tip == pytest.approx([0, speed / (1 + drag * speed * seconds), 0], rel=2e-4, abs=1e-6)


def test_linear_drag_is_that_of_rings_and_helices():
    seconds = 5e-3
    rates = {"ring_rate": 20.833, "oblique_rate": 125.0}
    share = (20.833 * MASSES[2] + 125.0 * MASSES[3]) / sum(MASSES)
    turning = (20.833 * INERTIAS[2] + 125.0 * INERTIAS[3]) / sum(INERTIAS)
    tip, spin = moving(water(**rates), [0, 0, 0.1], seconds, spin=2.0)
    assert tip[2] == pytest.approx(0.1 * np.exp(-share * seconds), rel=2e-4)
    assert spin[2] == pytest.approx(2.0 * np.exp(-turning * seconds), rel=2e-3)
