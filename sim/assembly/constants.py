"""Stiffnesses of the rods of an assembly and constants of their connections, and the limit that these set to the step.

All are functions of an `Arm` and of the rods that `octoctrl.sim.assembly.geometry` builds for it; connection scales are those of the
published model (Tekinalp et al. 2024, SI). Forces N, lengths m.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..body.arm import Arm
from ..body.muscles import MuscleLaw
from .geometry import PUBLISHED_NODES, AssemblyGeometry, RodFamily

Floats = NDArray[np.float64]

SHEAR_COEFFICIENT = 4 / 3
STRAIGHT_SPRING, STRAIGHT_CONTACT = 0.166, 2.0
RING_RING_SPRING = 0.241
RING_MUSCLE_SPRING, RING_MUSCLE_TORQUE, RING_MUSCLE_CONTACT = 0.5, 5 / 480, 10.0
RING_OBLIQUE_SPRING, RING_OBLIQUE_CONTACT = 1.0, 96.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Stiffness:
    """Stiffnesses of a rod family (R, n), at rest.

    Attributes
    ----------
    shear : (R, n) float64, N
    bend, twist : (R, n) float64, N m^2
    inertia : (R, n) float64, kg m^2
        Rotary, in bending; twice that in twist.
    """

    shear: np.ndarray
    bend: np.ndarray
    twist: np.ndarray
    inertia: np.ndarray


def stiffness(arm: Arm, family: RodFamily) -> Stiffness:
    """Stiffnesses of the rods of `family`, from the moduli of `arm`."""
    moment = family.second_moment
    return Stiffness(
        shear=SHEAR_COEFFICIENT * arm.shear_modulus * family.area,
        bend=family.stiffening * arm.youngs_modulus * moment,
        twist=family.stiffening * 2 * arm.shear_modulus * moment,
        inertia=family.density[:, None] * family.length * moment,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightConnections:
    """Side-by-side connections of two straight rods, element by element; P pairs of rods.

    Attributes
    ----------
    first, second : (P,) int
    direction1, direction2 : (P, N, 3) float64
        Unit vectors towards the other rod, in the own material frame.
    gap : (P, N) float64, m
    spring : (P, N) float64, N/m
    contact : (P, N) float64, N/m^1.5
    """

    first: np.ndarray
    second: np.ndarray
    direction1: np.ndarray
    direction2: np.ndarray
    gap: np.ndarray
    spring: np.ndarray
    contact: np.ndarray


def straight_connections(arm: Arm, geometry: AssemblyGeometry) -> StraightConnections:
    """Connections of the cord with each longitudinal muscle (first half), and of these with their neighbours."""
    muscles = np.arange(1, geometry.grid.straight_rods)
    first, second = np.concatenate([0 * muscles, muscles]), np.concatenate([muscles, np.roll(muscles, -1)])
    rods = geometry.straight
    between = rods.centres[second] - rods.centres[first]
    distance = np.linalg.norm(between, axis=2)
    unit = between / distance[..., None]
    radius1, radius2 = rods.radius[first], rods.radius[second]
    stiff = radius1 * radius2 / (radius1 + radius2) ** 2 * geometry.spacing * arm.youngs_modulus
    spring, contact = STRAIGHT_SPRING * stiff, STRAIGHT_CONTACT * stiff * ROOT_MILLIMETRE
    uniform = arm.anatomy.connections
    if uniform is not None:
        spring, contact = np.full(stiff.shape, uniform.straight_spring), np.full(stiff.shape, uniform.straight_contact)
    return StraightConnections(
        first=first,
        second=second,
        direction1=np.einsum("pnij,pnj->pni", rods.frames[first], unit),
        direction2=np.einsum("pnij,pnj->pni", rods.frames[second], -unit),
        gap=distance - radius1 - radius2,
        spring=spring,
        contact=contact,
    )


ROOT_MILLIMETRE = 1e-3**-0.5
"""Contacts in the source have the spring's number in force per mm^1.5: this turns N/m into N/m^1.5."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RingConnections:
    """Constants of the connections of N rings.

    Attributes
    ----------
    muscle_spring : (N,) float64, N/m
        Ring to longitudinal muscle.
    muscle_torque : (N,) float64, N/m
        Orientation lock of the same joint.
    muscle_contact : (N,) float64, N/m^1.5
    muscle_repulsion : (N,) float64, N/m
        Per relative overlap, in the place of the contact.
    ring_spring : (N - 1,) float64, N/m
        Ring i to ring i + 1, at each spoke.
    oblique_spring : (N,) float64, N/m
    oblique_contact : (N,) float64, N/m^1.5
    """

    muscle_spring: np.ndarray
    muscle_torque: np.ndarray
    muscle_contact: np.ndarray
    muscle_repulsion: np.ndarray
    ring_spring: np.ndarray
    oblique_spring: np.ndarray
    oblique_contact: np.ndarray


def ring_connections(arm: Arm, geometry: AssemblyGeometry) -> RingConnections:
    """Constants of all connections that involve a ring."""
    uniform, count = arm.anatomy.connections, geometry.grid.rings
    if uniform is not None:
        return RingConnections(
            muscle_spring=np.full(count, uniform.muscle_spring),
            muscle_torque=np.full(count, uniform.muscle_torque),
            muscle_contact=np.zeros(count),
            muscle_repulsion=np.full(count, uniform.muscle_repulsion),
            ring_spring=np.full(count - 1, uniform.ring_spring),
            oblique_spring=np.full(count, uniform.oblique_spring),
            oblique_contact=np.zeros(count),
        )
    thick, modulus = arm.ring_radius, arm.youngs_modulus
    perimeter = geometry.rings.length.sum(axis=1)
    bundle = geometry.grid.bundle
    element = perimeter * bundle / PUBLISHED_NODES
    muscle = bundle * 2 * thick * perimeter * modulus / (thick + geometry.straight.radius[1]) * RING_MUSCLE_SPRING
    oblique = 2 * thick * element * modulus / (thick + geometry.oblique.radius[0, :: geometry.grid.helix_nodes]) * RING_OBLIQUE_SPRING
    return RingConnections(
        muscle_spring=muscle,
        muscle_torque=perimeter / 2 * modulus * RING_MUSCLE_TORQUE / bundle,
        muscle_contact=RING_MUSCLE_CONTACT * muscle * ROOT_MILLIMETRE,
        muscle_repulsion=np.zeros(count),
        ring_spring=2 * thick * perimeter[1:] / geometry.grid.spokes * modulus / geometry.spacing * RING_RING_SPRING,
        oblique_spring=oblique,
        oblique_contact=RING_OBLIQUE_CONTACT * oblique * ROOT_MILLIMETRE,
    )


def fibre_laws(arm: Arm, published: bool = False) -> tuple[MuscleLaw, MuscleLaw, MuscleLaw, MuscleLaw]:
    """Laws of longitudinal, oblique and transverse muscle and of the nerve cord.

    The cord is no muscle: it has the longitudinal fibres' law, but in compression it is no stiffer than in bending. With the muscles'
    modulus, 2.5 times as high, it would buckle into a helix where they shorten by 15 %. Where an arm's rings are stiff in compression in
    the place of the volume, which is kept here, they are as soft as its anatomy says. In the `published` numerics neither is so.
    """
    muscle, ring, soft = arm.longitudinal, arm.transverse, arm.anatomy.ring_compression
    if published:
        return muscle, arm.oblique, ring, muscle
    cord = replace(muscle, compression_modulus=min(muscle.compression_modulus, arm.youngs_modulus))
    return muscle, arm.oblique, ring if soft is None else replace(ring, compression_modulus=soft), cord


def slab_volumes(geometry: AssemblyGeometry) -> Floats:
    """Volumes (N,) at rest between the ends of the muscles' elements, inside the rings' middle lines, m^3."""
    ring, area = geometry.rings.points, geometry.straight.area[1:]
    vector = np.cross(np.roll(ring, -1, axis=1), ring).sum(axis=1) / 2
    edge = np.einsum("rn,rnk->nk", area / area.sum(axis=0), geometry.straight.edges[1:])
    return np.sum(vector * edge, axis=1)


MUSCLE_MASS = 2.0
"""Nodes of the longitudinal muscles have at least this times h^2 k as mass, k the spring to their ring: light tips would flutter on it."""


def straight_mass(arm: Arm, geometry: AssemblyGeometry, h: float) -> Floats:
    """Masses (straight rods, N + 1) of the nodes of cord and muscles, with what the tips of the muscles need for the step `h` (s), kg."""
    mass, spring = geometry.straight.node_mass, ring_connections(arm, geometry).muscle_spring
    mass[1:] = np.maximum(mass[1:], MUSCLE_MASS * h * h * np.append(spring, spring[-1]))
    return mass


HELIX_MASS = 0.1
"""Nodes of the helices have at least this times h^2 k as mass, k the spring to their ring and the tension of a whole muscle on either side.

Three and a half times as much slows a twist by half a percent while it begins.
"""


def oblique_mass(arm: Arm, geometry: AssemblyGeometry, h: float) -> Floats:
    """Masses (helices, nodes) of the nodes of the helices, with what their tips need for the step `h` (s), kg."""
    helices, mass = geometry.oblique, geometry.oblique.node_mass
    # Of neighbours that move against each other.
    string = 2 * arm.oblique.maximum_stress * helices.area / helices.length
    stiff = np.pad(string, ((0, 0), (1, 0)), mode="edge") + np.pad(string, ((0, 0), (0, 1)), mode="edge")
    met = geometry.grid.helix_nodes * np.arange(geometry.grid.rings)
    stiff[:, met] += ring_connections(arm, geometry).oblique_spring
    return np.maximum(mass, HELIX_MASS * h * h * stiff)


STRING_SHARE, LEAST_SMOOTHING = 0.7, 1e-3
"""Share of the limit of a ring's elements as strings that a step may take; smoothing below which there is practically none."""


def ring_smoothing(arm: Arm, geometry: AssemblyGeometry, h: float) -> Floats:
    """Factor beta (N,) of the rings' selective mass for the step `h` (s), see `octoctrl.sim.assembly.ring_mass_kernels`.

    A string of elements of length l and mass m under the tension T is stable for h < sqrt(l m / T); with the mass added, for every h.
    """
    rings = geometry.rings
    tension = rings.area[:, 0] * (arm.transverse.maximum_stress + SHEAR_COEFFICIENT * arm.shear_modulus)
    return np.maximum(h * h * tension / (4 * STRING_SHARE * rings.length[:, 0] * rings.node_mass[:, 0]), LEAST_SMOOTHING)


CONTACT_STEP = 7.1e-5
"""Step (s) that contacts are softened for, the usual one of the published arm; at any other too, so that all steps have one law."""


def thin_ring_limit(arm: Arm, geometry: AssemblyGeometry) -> tuple[float, int]:
    """Linear limit of the step, 2 over the highest frequency of the springs at a ring's nodes, which no implicit step carries.

    The two modes that bind are a ring node against the longitudinal muscle inside it (few rings), and a ring node against its neighbours
    in the next rings (many). Coarse rings have the limit of the rings that they stand for: their own nodes are heavier, but what carries
    helices and tips over a step is not.

    Returns
    -------
    float, s
    int
        Ring where it binds.
    """
    joints = ring_connections(arm, geometry)
    ring, muscle = geometry.rings.node_mass[:, 0], geometry.straight.element_mass[1]
    ring = ring * min(1.0, geometry.grid.ring_nodes * geometry.grid.bundle / PUBLISHED_NODES)
    beside = np.append(joints.ring_spring, 0.0) + np.insert(joints.ring_spring, 0, 0.0)
    opposite = joints.muscle_spring * (1 / ring + 1 / muscle)
    alternate = (joints.muscle_spring + 2 * beside + joints.oblique_spring) / ring
    square = np.maximum(opposite, alternate)
    return 2 / float(np.sqrt(square.max())), int(square.argmax())
