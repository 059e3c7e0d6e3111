"""How the rods of an assembly are counted, joined, held and damped, where hydrostats differ beside outline and tissue.

An `Arm` says how thick and of what tissue a hydrostat is; its anatomy says the rest. The defaults are the octopus arm's, whose connections
follow from radii and moduli and whose rings, muscles and helices are counted from its length (`octoctrl.sim.assembly.geometry`).
"""

from dataclasses import dataclass
from typing import NamedTuple

from .grid import AssemblyGrid


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformConnections:
    """Constants of connections that are the same everywhere in an assembly, SI units.

    Attributes
    ----------
    straight_spring, straight_contact : float, N/m and N/m^1.5
        Cord to muscle and muscle to neighbour.
    ring_spring : float, N/m
        Ring to next ring, at each muscle.
    muscle_spring, muscle_torque, muscle_repulsion : float, N/m
        Ring to muscle: spring, orientation lock, and repulsion per relative overlap.
    oblique_spring : float, N/m
        Ring to helix.
    """

    straight_spring: float
    straight_contact: float
    ring_spring: float
    muscle_spring: float
    muscle_torque: float
    muscle_repulsion: float
    oblique_spring: float


class Traits(NamedTuple):
    """What of an anatomy decides which code is compiled; all false for the octopus arm.

    Attributes
    ----------
    graded : bool
        Rings differ in strength and speed.
    sliding : bool
        At the base muscles and helices are free to move across, and the first ring is free; only the cord is clamped.
    even : bool
        Muscles push on a ring with the mean of their forces and not node by node.
    bare : bool
        In the published numerics, rings are not filtered, and passive stress in tension is the bare polynomial, of either sign.
    """

    graded: bool = False
    sliding: bool = False
    even: bool = False
    bare: bool = False


PLAIN = Traits()


@dataclass(frozen=True, slots=True, kw_only=True)
class Anatomy:
    """The build of an assembly.

    Attributes
    ----------
    grid : AssemblyGrid or None
        Counts of rods and nodes; None counts them from the arm's length.
    connections : UniformConnections or None
        None takes the laws of the octopus arm.
    traits : Traits
    straight_stiffening : float
        Factor on bending and twist stiffness of cord and longitudinal muscles.
    tip_mass : float, kg
        What cord and longitudinal muscles carry at their far ends, by their areas.
    straight_rate, oblique_rate : float, 1/s
        Linear damping of the straight rods and of the helices beside that of the water.
    bulk_modulus : float, Pa
        Of the tissue between the rings in the default numerics; the published ones do not keep the volume.
    viscosity : float, Pa s
        Of passive tissue along the fibres, in the default numerics. The octopus arm's is its Young's modulus times 10 ms: a loss tangent
        of 0.1 at 1.6 Hz; muscle at a level of 0.1 is some hundred times as viscous.
    ring_compression : float or None, Pa
        Compression modulus of the rings in the default numerics; None takes that of their law.
    resting_tone, published_tone : float
        Smallest activation of the cord, the longitudinal and the transverse muscles in the two numerics.
    step, published_step : float or None, s
        Largest steps of the two numerics; None takes the plant's.
    """

    grid: AssemblyGrid | None = None
    connections: UniformConnections | None = None
    traits: Traits = PLAIN
    straight_stiffening: float = 1.0
    tip_mass: float = 0.0
    straight_rate: float = 0.0
    oblique_rate: float = 0.0
    bulk_modulus: float = 1e7
    viscosity: float = 0.0
    ring_compression: float | None = None
    resting_tone: float = 0.001
    published_tone: float = 0.001
    step: float | None = None
    published_step: float | None = None


OCTOPUS = Anatomy(viscosity=100.0)
