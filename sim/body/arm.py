"""The arm: outline, tissue and muscle layout, as continuous functions of arclength.

Cross-section of the octopus arm (Tekinalp et al. 2024): an axial nerve cord (ANC) in the middle, eight longitudinal muscles (LM1…LM8)
touching it and each other, transverse muscle (TM) wound around them, and two families of four oblique helices outside:

    ANC radius r_c, LM radius r_o           (touching circles: r_o = (r_c + r_o) sin(pi/8))
    TM   at radius r_c + 2 r_o + r_t
    OM   at radius r_c + 2 r_o + 2 r_t + r_h

The material frame at rest has d1 = +z, d2 = +x, d3 = +y (arm axis); LM m stands at azimuth 45° (m - 1) from +x towards +z, which is the
material direction (sin, cos, 0). R-OM is the geometrically right-handed family (its contraction gives negative twist), L-OM the other.
"""

import hashlib
from dataclasses import asdict, dataclass, field, fields, replace
from math import atan2, cos, degrees, pi, sin, sqrt, tau
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..annotations import settle
from ..errors import OctoctrlError, check_count, check_number
from .layout import OCTOPUS_MUSCLES, MuscleLayout
from .muscles import LONGITUDINAL, TRANSVERSE, MuscleLaw

if TYPE_CHECKING:
    from .anatomy import Anatomy

Floats = NDArray[np.float64]

MUSCLE_GROUPS = OCTOPUS_MUSCLES.names
"""Names of the octopus arm's groups, in the order of every array indexed by group."""
LONGITUDINAL_GROUPS = tuple(group.name for group in OCTOPUS_MUSCLES.longitudinal)

REST_FRAME = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Frame of the base, and of every section at rest: rows d1 = +z, d2 = +x, d3 = +y (arm axis)."""


COMPLIANT = 0.15
"""Factor on the passive stress in tension of an arm that lengthens and shortens as real arms do."""

_LAWS = {"longitudinal": LONGITUDINAL, "oblique": LONGITUDINAL, "transverse": TRANSVERSE}


def azimuth(group: str) -> float:
    """Azimuth of a longitudinal muscle of the octopus arm, rad, from +x (d2) towards +z (d1)."""
    return OCTOPUS_MUSCLES[group].azimuth


@dataclass(frozen=True, slots=True, kw_only=True)
class LumpedSection:
    """What a one-rod arm must lump, because its cross-section has no rods of its own that could move.

    By default the rod that is nearest to the full arm, as ``benchmarks/rod_against_assembly.py fit`` finds it; see also `published`.

    Attributes
    ----------
    hoop_ratio : float
        Exponent nu in (radius / rest radius) = stretch**-nu; 0.5 is a section that keeps its volume with rigid connections,
        less is what compliant connections between the layers leave of it.
    oblique_passive : float
        Factor on the passive stress of the oblique fibres, which also stands for the tissue that they are embedded in.
    torsion : float
        Factor on the torsional stiffness of the straight rods, for their winding round each other.
    ring_torsion : float
        Share of the torsional stiffness of a tube as thick as the layer of rings. Rings that turn against each other drag the muscles
        between them along; the layer does not taper, so that this holds the thin tip most of all, and the smallest levels.
    longitudinal_stress, oblique_stress : float
        Factors on the active stress of the fibres, for what their joints to the other layers do not hand on.
    """

    hoop_ratio: float = 0.448
    oblique_passive: float = 0.445
    torsion: float = 1.0
    ring_torsion: float = 0.155
    longitudinal_stress: float = 0.908
    oblique_stress: float = 0.461

    def __post_init__(self) -> None:
        check_number("hoop_ratio", self.hoop_ratio, at_least=0.0, at_most=0.5)
        check_number("ring_torsion", self.ring_torsion, at_least=0.0)
        for name in ("oblique_passive", "torsion", "longitudinal_stress", "oblique_stress"):
            check_number(name, getattr(self, name), above=0.0)

    @classmethod
    def published(cls) -> "LumpedSection":
        """Constants tuned to the recorded twist storage of the published assembly of 197 rods, which does not keep its volume."""
        return cls(hoop_ratio=0.19, oblique_passive=2.7, torsion=3.0, ring_torsion=0.0, longitudinal_stress=1.0, oblique_stress=1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """A tapered muscular arm.

    Attributes
    ----------
    name : str
    length : float, m
    base_radius : float, m
        Nominal radius at the base, before the oblique layer; the section's areas are fractions of its disc.
    taper : float
        Base radius over tip radius.
    elements : int
        Elements along the arm of the one-rod model.
    grading : float
        Elements are as long as the local radius to this power, so that the thin tip, which curls most, is resolved as well as the base.
    straight_fraction : float
        Share of the nominal disc taken by nerve cord and longitudinal muscles.
    ring_radius : float, m
        Radius of the transverse fibres, which fill a layer of twice that thickness.
    oblique_radius : float, m
        Radius of an oblique fibre at the base.
    oblique_pitch : float, m
        Axial length of one turn of an oblique fibre (constant along the arm).
    youngs_modulus, shear_modulus : float, Pa
        Of the passive tissue; they set shear, bending and twist of the straight rods.
    densities : (float, float, float, float), kg/m^3
        Nerve cord, longitudinal, transverse, oblique.
    longitudinal, oblique, transverse : MuscleLaw
    lumped : LumpedSection

    Raises
    ------
    OctoctrlError
        If a length, ratio or count is outside what rod theory can carry.

    References
    ----------
    Tekinalp et al. (2024), *Topology, dynamics, and control of a muscle-architected soft arm*, Methods and SI.
    """

    name: str = "octopus-20cm"
    length: float = 0.2
    base_radius: float = 0.012
    taper: float = 12.0
    elements: int = 48
    grading: float = 1.0
    straight_fraction: float = 0.62
    ring_radius: float = 0.2 / 360
    oblique_radius: float = 1.1322951e-3
    oblique_pitch: float = 0.2 / 9
    youngs_modulus: float = 10e3
    shear_modulus: float = 10e3 / 1.5
    densities: tuple[float, float, float, float] = (1050.0, 1261.238, 858.4457, 1047.449)
    longitudinal: MuscleLaw = field(default=LONGITUDINAL)
    oblique: MuscleLaw = field(default=LONGITUDINAL)
    transverse: MuscleLaw = field(default=TRANSVERSE)
    lumped: LumpedSection = field(default=LumpedSection())

    def __post_init__(self) -> None:
        settle(self)
        large = _is_number(self.length) and self.length > 0
        metres = f"lengths are SI - did you mean {self.length / 100:.2f} ({self.length:g} cm)?" if large else ""
        check_number("length", self.length, at_least=1e-3, at_most=5.0, unit="m", advice=metres)
        check_number("base_radius", self.base_radius, at_least=1e-4 * self.length, unit="m")
        ratio = self.base_radius / self.length
        if ratio >= 0.25:
            raise OctoctrlError(
                f"radius {self.base_radius:g} m for a {self.length:.2f} m arm: rod theory wants radius/length < 0.25, found {ratio:.2f}"
            )
        check_number("taper", self.taper, at_least=1.0, at_most=50.0)
        object.__setattr__(self, "elements", check_count("elements", self.elements, at_least=0, at_most=2000))
        if self.elements < 8:
            raise OctoctrlError(
                f"elements={self.elements}: at least 8 are needed to carry a curvature packet (10 per packet width advised)"
            )
        check_number("grading", self.grading, at_least=0.0, at_most=1.0)
        self._check_layers()

    def _check_layers(self) -> None:
        check_number("straight_fraction", self.straight_fraction, above=0.0, at_most=1.0)
        for name in ("ring_radius", "oblique_radius"):
            check_number(name, getattr(self, name), above=0.0, at_most=self.base_radius, unit="m", advice="a layer is thinner than the arm")
        check_number("oblique_pitch", self.oblique_pitch, at_least=1e-3 * self.length, unit="m", advice="it is the length of one turn")
        for name in ("youngs_modulus", "shear_modulus"):
            check_number(name, getattr(self, name), at_least=1.0, at_most=1e9, unit="Pa", advice="soft tissue has 1e3…1e6 Pa")
        if not isinstance(self.densities, tuple) or len(self.densities) != 4:
            raise OctoctrlError(f"densities={self.densities!r}: four are needed (nerve cord, longitudinal, transverse, oblique)")
        for density in self.densities:
            check_number("density", density, at_least=1.0, at_most=3e4, unit="kg/m^3")
        for name in ("longitudinal", "oblique", "transverse"):
            if not isinstance(getattr(self, name), MuscleLaw):
                raise OctoctrlError(f"{name}={getattr(self, name)!r}: a MuscleLaw is needed")

    @classmethod
    def octopus(cls, *, tissue: str = "study", **changes: Any) -> "Arm":
        """The 20 cm arm of *O. rubescens* in Tekinalp et al. (2024), with any field changed by keyword.

        Parameters
        ----------
        tissue : {"study", "compliant"}
            Passive tissue. The study's keeps the full arm between +13 and -29 % of its length, whatever is active. Real arms go further:
            *O. vulgaris* reaches with 0.57 +- 0.41 of strain (Hanassy et al. 2015, Bioinspir. Biomim. 10:035001), for which their model
            needs next to no passive force of longitudinal muscle. The study's curves are those of isolated muscles from their own rest
            length; in the arm longitudinal muscle rests at 20 % compression (Di Clemente et al. 2021, J. Exp. Biol. 224:jeb242644), so that
            its passive force begins later. ``"compliant"`` stands for that by `COMPLIANT` times the passive stress in tension.
        **changes
            Fields of `Arm`; they come after the tissue.

        Raises
        ------
        OctoctrlError
            If there is no such tissue, or a keyword is not a field of `Arm`.
        """
        from ..errors import check_choice, suggest

        check_choice("tissue", tissue, ("study", "compliant"))
        if tissue == "compliant":
            soft = {name: replace(law, passive_scale=COMPLIANT) for name, law in _LAWS.items()}
            changes = {"name": "octopus-20cm-compliant", **soft, **changes}
        known = [item.name for item in fields(cls)]
        for key in changes:
            if key not in known:
                raise OctoctrlError(f"Arm has no field '{key}'{suggest(key, known)} ({', '.join(known)})")
        return cls(**changes)

    @property
    def fingerprint(self) -> str:
        """Four hexadecimal digits that differ between arms that differ in any field but the name and the resolution."""
        content = {key: value for key, value in asdict(self).items() if key not in ("name", "elements", "grading")}
        # What does nothing leaves no mark.
        idle = {"longitudinal_stress": 1.0, "oblique_stress": 1.0, "ring_torsion": 0.0}
        content["lumped"] = {key: value for key, value in content["lumped"].items() if value != idle.get(key)}
        if self.layout != OCTOPUS_MUSCLES:
            content["layout"] = self.layout
        return hashlib.sha256(repr(sorted(_plain(content).items())).encode()).hexdigest()[:4]

    @property
    def edges(self) -> Floats:
        """Arclengths (elements + 1,) of the element boundaries, m, from base to tip."""
        return self.partition(self.elements, self.grading)

    def partition(self, count: int, grading: float) -> Floats:
        """Arclengths (count + 1,) that divide the arm into parts as long as the local radius to the power `grading`, m."""
        share = np.linspace(0.0, 1.0, count + 1)
        slope, power = 1 - 1 / self.taper, 1 - grading
        if slope < 1e-9:  # no taper, or none that the differences below could resolve
            return self.length * share
        # Lengths dL ~ (1 - slope s/L)^grading: equal steps of the integral of its inverse.
        if power == 0:
            return self.length * (1 - self.taper**-share) / slope
        return self.length * (1 - (1 - share * (1 - self.taper**-power)) ** (1 / power)) / slope

    def section(self, arclength: ArrayLike) -> "Section":
        """Cross-section at the given arclengths.

        Parameters
        ----------
        arclength : (n,) float64, m

        Returns
        -------
        Section
        """
        outline = 1 - (1 - 1 / self.taper) * np.asarray(arclength, dtype=float) / self.length
        cord, muscle = touching_radii(self, len(self.layout.longitudinal))
        return Section(arm=self, cord_radius=cord * outline, muscle_radius=muscle * outline, outline=outline)

    @property
    def layout(self) -> MuscleLayout:
        """The muscle groups, as a `MuscleLayout`; an arm with others overrides this."""
        return OCTOPUS_MUSCLES

    @property
    def anatomy(self) -> "Anatomy":
        """How the rods of the full arm are counted, joined, held and damped, as an `Anatomy`."""
        from .anatomy import OCTOPUS

        return OCTOPUS


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """Cross-sections of an arm: radii (n,) in m, and what follows from them."""

    arm: Arm
    cord_radius: np.ndarray
    muscle_radius: np.ndarray
    outline: np.ndarray

    @property
    def muscle_count(self) -> int:
        """Number of longitudinal muscles."""
        return len(self.arm.layout.longitudinal)

    @property
    def muscle_offset(self) -> Floats:
        """Distance of the longitudinal muscles from the axis, m."""
        return self.cord_radius + self.muscle_radius

    @property
    def ring_offset(self) -> Floats:
        """Radius of the transverse layer's middle, m."""
        return self.cord_radius + 2 * self.muscle_radius + self.arm.ring_radius

    @property
    def fibre_radius(self) -> Floats:
        """Radius of one oblique fibre, m."""
        return self.arm.oblique_radius * self.outline

    @property
    def oblique_offset(self) -> Floats:
        """Radius of the oblique helices, m."""
        return self.ring_offset + self.arm.ring_radius + self.fibre_radius

    @property
    def outer_radius(self) -> Floats:
        """Radius of the arm's surface, m."""
        return self.oblique_offset + self.fibre_radius

    @property
    def oblique_stretch(self) -> Floats:
        """Rest length of an oblique fibre per unit of arm length."""
        return np.sqrt(1 + (self.oblique_offset * tau / self.arm.oblique_pitch) ** 2)

    @property
    def areas(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Fibre areas, m^2: nerve cord, one longitudinal muscle, transverse muscle (hoop force per arm length), one oblique family."""
        ring_density = pi * self.arm.ring_radius**2 / (2 * self.arm.ring_radius)
        return (
            pi * self.cord_radius**2,
            pi * self.muscle_radius**2,
            tau * self.ring_offset * ring_density,
            4 * pi * self.fibre_radius**2,
        )

    @property
    def masses(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Mass per unit length, kg/m: nerve cord, all longitudinal muscles, transverse, all oblique families."""
        cord, muscle, ring, oblique = self.areas
        densities = self.arm.densities
        return (
            densities[0] * cord,
            densities[1] * self.muscle_count * muscle,
            densities[2] * ring,
            densities[3] * len(self.arm.layout.oblique) * oblique * self.oblique_stretch,
        )

    @property
    def polar_inertias(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Polar moment of inertia per unit length, kg m, of the same four layers; bending inertias are half of it."""
        cord, longitudinal, ring, oblique = self.masses
        return (
            cord * self.cord_radius**2 / 2,
            longitudinal * (self.muscle_offset**2 + self.muscle_radius**2 / 2),
            ring * self.ring_offset**2,
            oblique * self.oblique_offset**2,
        )

    @property
    def bending_stiffness(self) -> Floats:
        """Bending stiffness of the straight rods about their own axes, N m^2."""
        return self.arm.youngs_modulus * pi / 4 * (self.cord_radius**4 + self.muscle_count * self.muscle_radius**4)

    @property
    def twist_stiffness(self) -> Floats:
        """Torsional stiffness of the straight rods about their own axes and of the layer of rings, as one rod lumps them, N m^2."""
        lumped, shear = self.arm.lumped, self.arm.shear_modulus
        straight = shear * pi / 2 * (self.cord_radius**4 + self.muscle_count * self.muscle_radius**4) * lumped.torsion
        return straight + lumped.ring_torsion * self.ring_tube_stiffness

    @property
    def ring_tube_stiffness(self) -> Floats:
        """Torsional stiffness of a tube as thick as the layer of rings, N m^2."""
        return 4 * pi * self.arm.shear_modulus * self.arm.ring_radius * self.ring_offset**3

    @property
    def shear_stiffness(self) -> Floats:
        """Shear stiffness 4/3 G A of everything that runs along the arm, N: cord, longitudinal and oblique fibres, but not the rings."""
        cord, muscle, _, oblique = self.areas
        return (
            4
            / 3
            * self.arm.shear_modulus
            * (cord + self.muscle_count * muscle + len(self.arm.layout.oblique) * oblique * self.oblique_stretch)
        )


def touching_radii(arm: Arm, muscles: int = 8) -> tuple[float, float]:
    """Radii (m) of the cord and of `muscles` longitudinal muscles around it, which touch it and each other, at the base."""
    touching = sin(pi / muscles) / (1 - sin(pi / muscles))
    cord = arm.base_radius * sqrt(arm.straight_fraction / (1 + muscles * touching**2))
    return cord, touching * cord


def oblique_angle(arm: Arm, arclength: float) -> float:
    """Angle between an oblique fibre and the arm's axis, degrees (74.4 at the base of the octopus arm)."""
    return degrees(atan2(tau * float(arm.section(arclength).oblique_offset), arm.oblique_pitch))


def material_direction(angle: float) -> Floats:
    """Material components (d1, d2, d3) of the radial direction at azimuth `angle`, rad."""
    return np.array([sin(angle), cos(angle), 0.0])


def _plain(value: Any) -> Any:
    """The same with every number as a float, whether it came as a whole number or from NumPy."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    return float(value) if isinstance(value, Real) and not isinstance(value, bool) else value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300  # a whole number may be beyond floats
