"""The tentacle stalk of a squid and its strike (van Leeuwen & Kier 1997, Kier & van Leeuwen 1997), as another `Arm`.

The stalk is a cylinder: a nerve cord, twelve longitudinal muscles, 96 rings, eight helices. The club rides at its end as a mass. Nothing
is active but the rings, whose sarcomeres become shorter from base to tip: short ones are weak and fast. When the rings contract, the
squeezed core lengthens by 70 % within 30 ms.

Constants as in the model of Tekinalp et al. (2024, SI); those of the connections are multiples of modulus times radius. In the source they
are pure numbers in millimetres, so that multiples of an area here carry 1/mm.
"""

from dataclasses import dataclass, field
from math import pi, sin

import numpy as np

from ..contracts import Floats
from ..errors import check_number, check_numbers
from .anatomy import Anatomy, Traits, UniformConnections
from .arm import Arm, touching_radii
from .grid import AssemblyGrid
from .muscles import SARCOMERE_STRESS, MuscleLaw

RINGS, RING_NODES, SPOKES = 96, 24, 12
STALK = 53.143e-3
ROOT_MILLIMETRE = 1e-3**-0.5
FASTEST_RATE = 17 * 2.37
"""Shortening rate (1/s) of a sarcomere of 1 µm without load: 17 1/s of one of 2.37 µm (van Leeuwen & Kier 1997)."""
LONGEST_MYOSIN, BARE_MYOSIN = 1.58e-6, 0.14e-6
"""Myosin (m) of a sarcomere that bears `SARCOMERE_STRESS`, and its middle, which pulls on nothing."""

AXIAL = MuscleLaw(
    maximum_stress=SARCOMERE_STRESS,
    active=(
        -0.5092804679233424, 5.433057569241495, -23.859890141688467, 55.425090708575404, -72.59515160555948,
        52.79848585025103, -20.582380032405908, 5.518953254112145, -0.6558195483734557,
    ),
    passive=(
        -0.09091477780980316, 0.9237969418938158, -3.755628033397892, 7.6971571613066665, -8.190950966922804,
        4.349644244466947, -0.9621762151229161, 0.09179097641553997, -0.06313674363990686,
    ),
    compression_modulus=100e3,
    slack=0.0,
    passive_scale=0.5,
    maximum_rate=FASTEST_RATE,
    range=(0.6, 2.0),
)  # fmt: skip
"""Cord, longitudinal and oblique fibres of the stalk."""

RING = MuscleLaw(
    maximum_stress=SARCOMERE_STRESS,
    active=(
        -3.391022766884218, 39.24922725577608, -188.68483412221883, 485.5210963364872, -717.7641720507827,
        608.3940472257646, -280.5697743604353, 64.4774805123077, -6.242607208810248,
    ),
    passive=(
        -0.7371579796157279, 7.8179095500792455, -33.74417078529503, 75.61933197516306, -92.82241365047213,
        62.93246491442137, -22.863016842319883, 4.0579577129837, -0.2704179573044058,
    ),
    compression_modulus=520e3,
    slack=0.0,
    maximum_rate=FASTEST_RATE,
    range=(0.6, 1.8),
)  # fmt: skip
"""A ring of the stalk with the longest myosin in a sarcomere of 1 µm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SquidTentacle(Arm):
    """A squid's tentacle; an `Arm` with other defaults and a club.

    Attributes
    ----------
    club_mass : float, kg
    sarcomere, myosin : (float, float), m
        Lengths at base and tip, of the rings.
    straight_stiffening : float
        Factor on bending and twist stiffness of cord and longitudinal muscles.

    Raises
    ------
    OctoctrlError
        As `Arm`, or if a length or mass is not positive.
    """

    name: str = "squid-tentacle"
    length: float = STALK
    base_radius: float = 3.7e-3
    taper: float = 1.0
    straight_fraction: float = 0.2
    ring_radius: float = 0.8947178702864644e-3
    oblique_radius: float = 0.15675957580072614e-3
    oblique_pitch: float = 6 * STALK / RINGS
    youngs_modulus: float = 375e3
    shear_modulus: float = 375e3 / 1.5
    densities: tuple[float, float, float, float] = (1050.0, 1050.0, 412.42002, 1032.48878)
    longitudinal: MuscleLaw = field(default=AXIAL)
    oblique: MuscleLaw = field(default=AXIAL)
    transverse: MuscleLaw = field(default=RING)
    club_mass: float = 1.8e-3
    sarcomere: tuple[float, float] = (1.3399e-6, 0.7276e-6)
    myosin: tuple[float, float] = (0.9707e-6, 0.4997e-6)
    straight_stiffening: float = 50.0

    def __post_init__(self) -> None:
        Arm.__post_init__(self)
        check_number("club_mass", self.club_mass, at_least=0.0, unit="kg")
        check_number("straight_stiffening", self.straight_stiffening, above=0.0)
        for name, least in (("sarcomere", 0.0), ("myosin", BARE_MYOSIN)):
            check_numbers(name, getattr(self, name), 2, "(1.3e-6, 0.7e-6)")
            for length in getattr(self, name):
                check_number(name, length, above=least, unit="m")

    @property
    def club_length(self) -> float:
        """Length (m) of a club as thick as the stalk, which only adds to the length that is reported."""
        return self.club_mass / (self.densities[0] * pi * self.base_radius**2)

    def ring_grades(self, count: int) -> tuple[Floats, Floats]:
        """Strength and shortening rate (count,) of the rings, over those of the law `transverse`."""
        share = np.linspace(0.0, 1.0, count)
        myosin, sarcomere = (ends[0] + (ends[1] - ends[0]) * share for ends in (self.myosin, self.sarcomere))
        return (myosin - BARE_MYOSIN) / (LONGEST_MYOSIN - BARE_MYOSIN), 1e-6 / sarcomere

    @property
    def anatomy(self) -> Anatomy:
        """Counts, connections, damping and steps."""
        muscle = pi * touching_radii(self, SPOKES)[1] * self.youngs_modulus
        ring = pi * self.ring_radius * self.youngs_modulus
        # Modulus times area over a millimetre: the source's numbers are in millimetres.
        patch = ring * self._ring_element / 1e-3
        return Anatomy(
            grid=AssemblyGrid(rings=RINGS, ring_nodes=RING_NODES, spokes=SPOKES, helix_nodes=4),
            connections=UniformConnections(
                straight_spring=128 / RINGS * muscle,
                straight_contact=1024 / RINGS * muscle * ROOT_MILLIMETRE,
                ring_spring=0.6 / RING_NODES * patch,
                muscle_spring=7.68e-3 * patch,
                muscle_torque=32.4e-3 * patch,
                muscle_repulsion=10.24 * patch,
                oblique_spring=6e-4 * ring,
            ),
            traits=Traits(graded=True, sliding=True, even=True, bare=True),
            straight_stiffening=self.straight_stiffening,
            tip_mass=self.club_mass,
            straight_rate=84.0,
            oblique_rate=40.0,
            published_tone=0.0,
            bulk_modulus=1e8,
            ring_compression=AXIAL.compression_modulus,
            step=5e-6,
            published_step=1.25e-6,
        )

    @property
    def _ring_element(self) -> float:
        """Length of one element of a ring, m."""
        cord, muscle = touching_radii(self, SPOKES)
        return 2 * (cord + 2 * muscle + self.ring_radius) * sin(pi / RING_NODES)
