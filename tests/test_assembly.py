"""The arm of 197 rods: its numbers at rest, the laws of its connections one by one, and its motion."""

import numpy as np
import pytest

from octoctrl.sim.arm import Arm
from octoctrl.sim.assembly_geometry import assembly_geometry, ring_connections, stiffness, straight_connections
from octoctrl.sim.errors import OctoctrlError

ARM = Arm.octopus()
GEOMETRY = assembly_geometry(ARM)
STRAIGHT, RINGS, OBLIQUE = GEOMETRY.straight, GEOMETRY.rings, GEOMETRY.oblique
MM, GRAM, CONTACT = 1e-3, 1e-3, 0.0316227766
"""Units of the printed numbers: mm, g; contact constants in g s^-2 mm^-1/2."""


def test_counts_of_rods_elements_and_connections():
    assert (GEOMETRY.count, GEOMETRY.elements) == (180, 9 * 180 + 8 * 359 + 180 * 40)
    assert STRAIGHT.points.shape[0] + RINGS.points.shape[0] + OBLIQUE.points.shape[0] == 197
    assert straight_connections(ARM, GEOMETRY).spring.size == 2880
    assert GEOMETRY.oblique_nodes.size == 1440 and ring_connections(ARM, GEOMETRY).ring_spring.size == 179


def at_joints(stiffnesses):
    return (stiffnesses[:, 1:] + stiffnesses[:, :-1]) / 2


PRINTED = {
    "cord radius": (STRAIGHT.radius[0, [0, 1, 45, 90, 135, 179]] / MM, (4.6810995, 4.657127, 3.602355, 2.523610, 1.444865, 0.390092)),
    "muscle radius": (
        STRAIGHT.radius[1, [0, 1, 45, 90, 135, 178, 179]] / MM,
        (2.882572, 2.867928, 2.223551, 1.564530, 0.905508, 0.275777, 0.261132),
    ),
    "ring path": (
        RINGS.points[[0, 1, 45, 90, 135, 178, 179], 0, 0] / MM,
        (11.001800, 10.948538, 8.605012, 6.208225, 3.811437, 1.521173, 1.467911),
    ),
    "oblique path": (
        np.hypot(*OBLIQUE.points[0, [0, 1, 2, 90, 180, 270, 358, 359]][:, [0, 2]].T) / MM,
        (12.68965, 12.68965, 12.63059, 10.03193, 7.374207, 4.716486, 2.117825, 2.117825),
    ),
    "oblique radius": (
        OBLIQUE.radius[5, [0, 1, 2, 90, 179, 357, 358]] / MM,
        (1.132295, 1.129396, 1.126497, 0.871361, 0.613327, 0.097257, 0.094358),
    ),
    "muscle length": (STRAIGHT.length[3].sum() / MM, 200.1208),
    "oblique length": (OBLIQUE.length[3].sum() / MM, 469.918),
    "oblique element": (OBLIQUE.length[6, [0, 358]] / MM, (2.067285, 0.647365)),
    "ring element": (RINGS.length[[0, 179], 0] / MM, (1.726383, 0.230342)),
    "ring mass": (RINGS.element_mass.sum(axis=1)[[0, 179]] / GRAM, (0.0574797, 0.0076692)),
    "family masses": (
        [STRAIGHT.element_mass[0].sum() / GRAM, STRAIGHT.element_mass[1:].sum() / GRAM, RINGS.element_mass.sum() / GRAM]
        + [OBLIQUE.element_mass.sum() / GRAM],
        (5.2652, 19.3463, 5.8634, 7.2505),
    ),
    "cord nodes": (STRAIGHT.node_mass[0, [0, 1, -1]] / GRAM, (0.0401571, 0.0799040, 2.78869e-4)),
    "muscle nodes": (STRAIGHT.node_mass[1, [0, 1, -1]] / GRAM, (0.0183019, 0.0364184, 1.50195e-4)),
    "oblique nodes": (OBLIQUE.node_mass[7, [0, 1, -1]] / GRAM, (4.36086e-3, 8.69182e-3, 9.48329e-6)),
    "shear": (stiffness(ARM, STRAIGHT).shear[:2, 0] * 1e6, (611918, 232037)),
    "bending": (at_joints(stiffness(ARM, STRAIGHT).bend)[:2, [0, -1]].ravel() * 1e12, (3.73289e6, 206.37, 5.36796e5, 40.97)),
    "twisting": (at_joints(stiffness(ARM, STRAIGHT).twist)[:2, 0] * 1e12, (4.97718e6, 7.15728e5)),
    "oblique bending": (at_joints(stiffness(ARM, OBLIQUE).bend)[0, [0, -1]] * 1e12, (12844.3, 0.663)),
    "ring stiffness": (
        [stiffness(ARM, RINGS).shear[0, 0] * 1e6, stiffness(ARM, RINGS).bend[0, 0] * 1e12, stiffness(ARM, RINGS).twist[0, 0] * 1e12],
        (8618.9, 748.17, 997.56),
    ),
    "oblique shear": (stiffness(ARM, OBLIQUE).shear[0, 0] * 1e6, 35802.8),
    "cord-muscle connection": (straight_connections(ARM, GEOMETRY).spring[0, 0] * 1e3, 435.04),
    "cord-muscle contact": (straight_connections(ARM, GEOMETRY).contact[0, 0] / CONTACT, 5241.4),
    "muscle-muscle connection": (straight_connections(ARM, GEOMETRY).spring[8, 0] * 1e3, 461.11),
    "muscle-muscle gap": (straight_connections(ARM, GEOMETRY).gap[9, [0, -1]] / MM, (0.02384, -0.02384)),
    "ring-muscle spring": (ring_connections(ARM, GEOMETRY).muscle_spring[[0, -1]] * 1e3, (111584, 62676)),
    "ring-muscle torque": (ring_connections(ARM, GEOMETRY).muscle_torque[[0, -1]] * 1e3, (3596.6, 479.9)),
    "ring-muscle contact": (ring_connections(ARM, GEOMETRY).muscle_contact[[0, -1]] / CONTACT, (1.11584e6, 6.2676e5)),
    "ring-ring spring": (ring_connections(ARM, GEOMETRY).ring_spring[[0, 89, 178]] * 1e3, (20702, 11739, 2775.6)),
    "ring-oblique spring": (ring_connections(ARM, GEOMETRY).oblique_spring[[0, -1]] * 1e3, (11365, 3938)),
    "ring-oblique contact": (ring_connections(ARM, GEOMETRY).oblique_contact[[0, -1]] / CONTACT, (1.0910e6, 3.780e5)),
}


@pytest.mark.parametrize("name", PRINTED)
def test_numbers_at_rest_are_the_published_ones(name):
    found, printed = (np.atleast_1d(np.asarray(values, dtype=float)) for values in PRINTED[name])
    # Printed to five to seven digits: half a unit of the last one, and 1e-5.
    digits = np.array([len(f"{value:.10g}".replace(".", "").lstrip("-0").split("e")[0].rstrip("0")) for value in printed])
    np.testing.assert_array_less(np.abs(found / printed - 1), 1e-5 + 5.0 * 10.0**-digits)


def test_frames_are_orthonormal_and_follow_the_edges():
    for family in (STRAIGHT, RINGS, OBLIQUE):
        product = family.frames @ np.swapaxes(family.frames, -1, -2)
        np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-14)
        np.testing.assert_allclose(family.frames[..., 2, :], family.edges / family.length[..., None], atol=1e-12)


def test_helices_meet_the_rings_at_their_nodes():
    for number in range(8):
        nodes = RINGS.points[np.arange(180), GEOMETRY.oblique_nodes[number]]
        apart = np.linalg.norm(OBLIQUE.points[number, ::2] - nodes, axis=1)
        np.testing.assert_allclose(apart, ARM.ring_radius + OBLIQUE.radius[number, ::2], rtol=1e-12)


def test_a_pitch_that_misses_the_ring_nodes_is_refused_with_the_nearest():
    with pytest.raises(OctoctrlError, match=r"nearest pitch is 0\.0222222 m"):
        assembly_geometry(Arm.octopus(oblique_pitch=0.0235))
