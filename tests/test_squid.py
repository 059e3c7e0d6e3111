"""A squid's tentacle stalk: its numbers at rest, what its anatomy adds to the connections, and its strike in both numerics."""

import numpy as np
import pytest
from assembly_parts import parts_of

from octoctrl.sim.assembly.constants import ring_connections, stiffness, straight_connections
from octoctrl.sim.assembly.geometry import assembly_geometry
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.layout import SlabRow, SpokeRow
from octoctrl.sim.body.squid import SquidTentacle
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import Plant, make_plant
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.sources import Strike

TENTACLE = SquidTentacle()
GEOMETRY = assembly_geometry(TENTACLE)
STRAIGHT, RINGS, OBLIQUE = GEOMETRY.straight, GEOMETRY.rings, GEOMETRY.oblique
SIDES, JOINTS = straight_connections(TENTACLE, GEOMETRY), ring_connections(TENTACLE, GEOMETRY)
MM, GRAM, CONTACT = 1e-3, 1e-3, 0.0316227766
"""Units of the printed numbers: mm, g; contact constants in g s^-2 mm^-1/2."""
AIR = Scene(water=None)

PRINTED = {
    "spacing": (GEOMETRY.spacing / MM, 0.553573),
    "cord radius": (STRAIGHT.radius[0, 7] / MM, 1.054291),
    "muscle radius": (STRAIGHT.radius[5, 90] / MM, 0.368157),
    "ring radius": (TENTACLE.ring_radius / MM, 0.894718),
    "ring path": (RINGS.points[40, 0, 0] / MM, 2.685322),
    "ring element": (RINGS.length[3, 5] / MM, 0.701010),
    "ring density": (RINGS.density[0] * 1e-6, 4.12420e-4),
    "ring mass": (RINGS.element_mass[9].sum() / GRAM, 0.0174501),
    "oblique radius": (OBLIQUE.radius[0, 0] / MM, 0.1567596),
    "oblique path": (np.hypot(*OBLIQUE.points[2, 33, [0, 2]]) / MM, 3.736799),
    "oblique length": (OBLIQUE.length[0].sum() / MM, 376.37),
    "oblique mass": (OBLIQUE.element_mass[5].sum() / GRAM, 0.03),
    "oblique density": (OBLIQUE.density[0] * 1e-6, 1.03249e-3),
    "club": (TENTACLE.club_length / MM, 39.8593),
    "cord mass": (STRAIGHT.node_mass[0].sum() / GRAM, 0.92559),
    "muscle mass": (STRAIGHT.node_mass[7].sum() / GRAM, 0.112866),
    "tip masses": (STRAIGHT.node_mass[[0, 1], -1] / GRAM, (0.7317501, 0.0892291)),
    "all": (sum(family.node_mass.sum() for family in (STRAIGHT, RINGS, OBLIQUE)) / GRAM, 4.1952),
    "straight shear": (stiffness(TENTACLE, STRAIGHT).shear[[0, 1], 0] * 1e6, (1.16399e6, 1.41936e5)),
    "straight bending": (stiffness(TENTACLE, STRAIGHT).bend[[0, 1], 0] * 1e12, (1.8194e7, 2.7053e5)),
    "straight twisting": (stiffness(TENTACLE, STRAIGHT).twist[[0, 1], 0] * 1e12, (2.4259e7, 3.6071e5)),
    "ring stiffness": ([stiffness(TENTACLE, RINGS).shear[0, 0] * 1e6, stiffness(TENTACLE, RINGS).bend[0, 0] * 1e12], (8.383e5, 1.8874e5)),
    "oblique stiffness": (
        [stiffness(TENTACLE, OBLIQUE).shear[0, 0] * 1e6, stiffness(TENTACLE, OBLIQUE).bend[0, 0] * 1e12],
        (25733, 177.85),
    ),
    "strength of rings": (TENTACLE.ring_grades(96)[0][[0, 50, 95]] * 280, (161.525, 113.32, 69.94)),
    "rate of rings": (TENTACLE.ring_grades(96)[1][[0, 50, 95]] * TENTACLE.transverse.maximum_rate, (30.07, 39.59, 55.37)),
    "straight spring": (SIDES.spring[0, 0] * 1e3, 578299),
    "straight contact": (SIDES.contact[13, 5] / CONTACT, 4.62639e6),
    "ring spring": (JOINTS.ring_spring[0] * 1e3, 18472.7),
    "muscle spring": (JOINTS.muscle_spring[0] * 1e3, 5674.8),
    "muscle torque": (JOINTS.muscle_torque[0] * 1e3, 23940.7),
    "muscle repulsion": (JOINTS.muscle_repulsion[0] * 1e3, 7.56643e6),
    "oblique spring": (JOINTS.oblique_spring[0] * 1e3, 632.44),
}


@pytest.mark.parametrize("name", PRINTED)
def test_numbers_at_rest_are_the_published_ones(name):
    found, printed = (np.atleast_1d(np.asarray(values, dtype=float)) for values in PRINTED[name])
    digits = np.array([len(f"{value:.10g}".replace(".", "").lstrip("-0").split("e")[0].rstrip("0")) for value in printed])
    np.testing.assert_array_less(np.abs(found / printed - 1), 1e-5 + 5.0 * 10.0**-digits)


def test_counts_of_rods_and_connections():
    assert STRAIGHT.points.shape[0] + RINGS.points.shape[0] + OBLIQUE.points.shape[0] == 117
    assert (SIDES.spring.size, GEOMETRY.oblique_nodes.size, OBLIQUE.radius.shape) == (2304, 768, (8, 382))
    assert JOINTS.ring_spring.size * GEOMETRY.grid.spokes == 95 * 12 and JOINTS.muscle_spring.size * GEOMETRY.grid.spokes == 1152
    assert not JOINTS.muscle_contact.any() and not JOINTS.oblique_contact.any()


def test_radii_solve_the_equations_of_the_section():
    cord, muscle, ring = STRAIGHT.radius[0, 0], STRAIGHT.radius[1, 0], TENTACLE.ring_radius
    disc = np.pi * TENTACLE.base_radius**2
    assert np.pi * (cord**2 + 12 * muscle**2) == pytest.approx(0.2 * disc, rel=1e-12)
    assert (cord + muscle) * np.sin(np.pi / 12) == pytest.approx(muscle, rel=1e-12)
    assert 48 * np.sin(np.pi / 24) * (cord + 2 * muscle + ring) * 2 * ring == pytest.approx(0.7 * disc, rel=1e-12)


def test_the_strike_is_the_fifteenth_power_of_a_raised_cosine():
    times = np.array([0.0, 0.0304, 0.038, 0.08])
    levels = Strike().levels(times, np.linspace(0, 1, 4))
    assert levels[:, :10].max() == 0 and levels.shape == (4, 11, 3)
    np.testing.assert_allclose(levels[:, 10, 1], [0.0, ((1 + np.sin(0.3 * np.pi)) / 2) ** 15, 1.0, 1.0], atol=1e-15)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (
            lambda: Plant(SquidTentacle()),
            "arm 'squid-tentacle' is not built as an octopus arm, as the one-rod plant is; use make_plant('assembly', arm)",
        ),
        (lambda: SquidTentacle(myosin=(0.1e-6, 0.5e-6)), "myosin=1e-07 m"),
        (lambda: Strike(rise=0.0), "rise=0 s"),
        (
            lambda: make_plant("assembly", TENTACLE, rings=72),
            "rings=72: arm 'squid-tentacle' is built of 96 rings of 24 nodes only; leave rings out",
        ),
        (
            lambda: make_plant("assembly", TENTACLE, dt=2e-5),
            "dt=2e-05 s exceeds the stability bound 5e-06 s (contacts of straight rods); use dt='auto'",
        ),
    ],
)
def test_bad_input_is_refused_in_one_sentence(make, sentence):
    with pytest.raises(OctoctrlError) as caught:
        make()
    assert sentence in str(caught.value)


# Connections.


def test_repulsion_presses_muscles_singly_and_rings_evenly():
    """Twin of the kernel, on one cross-section whose muscles overlap their ring by different amounts."""
    plant = make_plant("assembly", TENTACLE, AIR)
    parts = parts_of(plant)
    rods, generator = plant.core.rods, np.random.default_rng(1)
    for row in (R.X1, R.X3):
        rods.straight(row, nodes=True)[1:] *= 1.01 + 0.01 * generator.standard_normal((12, 97))
    for family in (rods.open_rods, rods.rings):
        family[R.RADIUS] = family[R.REST_RADIUS]
    parts["gather"](rods.flat)
    parts["ring_muscle"](rods.flat)
    names = ("F1", "F2", "F3", "F1_R", "F2_R", "F3_R", "SUM", "G1", "G2", "G3")
    before = np.stack([rods.spoke(SpokeRow[name]) for name in names])
    parts["repel"](rods.flat)
    change = np.stack([rods.spoke(SpokeRow[name]) for name in names]) - before
    straight, _, rings = plant.core.nodes()
    centre, node = (straight[1:, 1:] + straight[1:, :-1]) / 2, np.swapaxes(rings[:, ::2], 0, 1)
    outward = node - np.roll(node, 6, axis=0)
    outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
    muscle, ring = STRAIGHT.radius[1, 0], TENTACLE.ring_radius
    across = (centre - node) * [1, 0, 1]
    overlap = np.maximum(1 - np.linalg.norm(across, axis=-1) / (muscle + ring), 0)
    force = JOINTS.muscle_repulsion[0] * overlap[..., None] * (centre + muscle * outward - node + ring * outward) * [1, 0, 1]
    assert 0.2 < (overlap > 0).mean() and overlap.max() > 0.02
    mean = np.sum(force * outward, axis=-1).mean(axis=0)
    np.testing.assert_allclose(change[:3], -np.moveaxis(force, -1, 0), atol=1e-9)
    np.testing.assert_allclose(change[3:6], np.moveaxis(mean[:, None] * outward, -1, 0), atol=1e-9)
    np.testing.assert_allclose(change[6], -np.sum(force * outward, axis=-1), atol=1e-9)
    np.testing.assert_allclose(change[7:], -np.moveaxis(force, -1, 0), atol=1e-9)


# Motion.

REFERENCE = {24: (53.160980, -4.1681), 30: (53.265528, 91.7711), 33: (54.015742, 484.3095), 36: (56.683959, 1346.1373)}
LATER = {
    40: (64.160375, 2228.4238),
    42: (68.712415, 2291.3561),
    50: (84.288857, 1423.0928),
    60: (90.875849, -51.1672),
    70: (85.279970, -882.8576),
}
PEAK = 2291.3561
"""Recorded run of the published code: time (ms) to place (mm) and velocity (mm/s) of the cord's tip."""


def strike(duration, **settings):
    plant = make_plant("assembly", TENTACLE, AIR, sample_interval=1e-4, record_every=1, **settings)
    recording = plant.advance(Strike(), duration)
    place = recording.points[:, -1, 1]
    return plant, place, np.gradient(place, recording.time)


def compare(reference, place, speed, apart, slower):
    for instant, (where, fast) in reference.items():
        assert abs(place[10 * instant] / MM - where) < apart, instant
        assert abs(speed[10 * instant] / MM - fast) < slower, instant


@pytest.mark.slow
def test_published_numerics_begin_as_the_recorded_run():
    # Rest is a knife's edge of the published law, so that rounding decides when the rings spring open: spread 0.1 mm and 20 mm/s here.
    _, place, speed = strike(0.0362, paper_compatible=True)
    compare(REFERENCE, place, speed, 0.15, 40.0)


@pytest.mark.slow
def test_published_numerics_follow_the_recorded_run():
    plant, place, speed = strike(0.08, paper_compatible=True)
    assert round(0.08 / plant.h) == 64_000
    compare(REFERENCE | LATER, place, speed, 1.0, 0.05 * PEAK)
    assert speed.max() / MM == pytest.approx(PEAK, rel=0.02)


@pytest.fixture(scope="module")
def default_strike():
    return strike(0.08)


def test_default_strike_is_in_the_filmed_range(default_strike):
    """Filmed are extensions of 43 to 80 % in 20 to 40 ms, more than 2 m/s and about 250 m/s^2 (Kier & van Leeuwen 1997)."""
    _, place, speed = default_strike
    extension = place - TENTACLE.length
    assert 0.43 < extension.max() / TENTACLE.length < 0.80
    begin, end = (np.argmax(extension > share * extension.max()) * 1e-4 for share in (0.01, 0.99))
    assert 0.020 < end - begin < 0.040
    assert 2.0 < speed.max() < 2.2 and 220 < np.gradient(speed, 1e-4).max() < 280


def test_default_strike_keeps_its_volume(default_strike):
    plant, _, _ = default_strike
    slabs = plant.core.rods.slab(SlabRow.VOLUME) / plant.core.rods.slab(SlabRow.REST)
    assert np.abs(slabs - 1).max() < 0.001
    assert plant.core.volume() == pytest.approx(make_plant("assembly", TENTACLE, AIR).core.volume(), rel=0.005)


def test_default_strike_does_not_depend_on_the_step(default_strike):
    _, place, speed = default_strike
    _, finer, finer_speed = strike(0.05, dt=2.5e-6)
    assert np.abs(place[: len(finer)] - finer).max() < 2e-3 * (finer.max() - TENTACLE.length)
    assert np.abs(speed[: len(finer)] - finer_speed).max() < 0.01 * speed.max()


@pytest.mark.slow
def test_published_numerics_are_not_resolved_at_the_published_step():
    """Explicit Hill muscles need steps of some 20 ns; at the published 1.25 µs velocities alternate and the rings shorten too fast."""
    start, _, _ = strike(0.034, resting_tone=0.0)
    state = start.state()

    def shrinkage(**settings):
        plant = make_plant("assembly", TENTACLE, AIR, sample_interval=1e-4, resting_tone=0.0, paper_compatible=True, **settings)
        plant.restore(state)
        before = plant.core.muscle_lengths()[2]
        plant.advance(Strike(), 1e-4)
        return (before - plant.core.muscle_lengths()[2]).mean()

    assert shrinkage() > 1.5 * shrinkage(dt=2e-8)


def test_the_base_slides_and_rests_on_its_plane(default_strike):
    plant, _, _ = default_strike
    straight, oblique, rings = plant.core.nodes()
    assert not straight[0, 0].any()
    np.testing.assert_array_equal(straight[1:, 0, 1], STRAIGHT.points[1:, 0, 1])
    np.testing.assert_array_equal(oblique[:, 0, 1], OBLIQUE.points[:, 0, 1])
    inward = np.linalg.norm(STRAIGHT.points[1:, 0, ::2], axis=1) - np.linalg.norm(straight[1:, 0, ::2], axis=1)
    assert inward.min() > 0.1 * MM and np.ptp(rings[0, :, 1]) < 0.2 * MM
