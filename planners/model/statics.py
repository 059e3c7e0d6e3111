"""Fibres of one section of the reduced model: elastic and active forces with their exact tangent, and Hill viscosity.

A section has four strains (k1, k2, k3, e): curvatures and twist rate per rest length, 1/m, and stretch. Every fibre of it has a length l
per rest length of the arm, and its tension T does work on l only, so that the generalised force of all fibres is the sum of T dl/dq.
With the radius scale lam = e**-nu / (1 + squeeze * oblique level) and a fibre at the material place rho (sin phi, cos phi),

    straight and oblique    l = sqrt(x^2 + b^2),  x = e + lam rho (k1 cos phi - k2 sin phi),  b = lam rho (turn + k3)
    transverse              l = lam
    nerve cord              l = e

where `turn` is the rest rotation of the fibre about the axis per length (zero for longitudinal, +-2 pi / pitch for oblique fibres; an
oblique fibre winds about the axis and stands for places all around it, `PASSED`, at which it feels the share `oblique_bending` of
the bend: none in an arm of one rod, where x = e). Laws are functions of s = l / (rest value of l); T = area * stress(s) / s.

Hill's viscosity enters as the secant of the force-velocity curve, stress(0) - stress(s') = active stress * `hill_secant(s')` * s', with
the two branches blended over `RATE_BLEND`, so that the model can be differentiated at rest. It vanishes with the activation.

References
----------
Tekinalp et al. (2024), *Topology, dynamics, and control of a muscle-architected soft arm*: muscle groups and laws.
van Leeuwen & Kier (1997), eqs. 4 and 5: force-velocity.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS, Arm, Section, azimuth
from octoctrl.sim.body.muscles import MuscleLaw

from .fibre_kernels import RATE_BLEND
from .kinematics import hat_means, section_bounds
from .parameters import FACTORS

Floats = NDArray[np.float64]
Curves = Callable[[Any, Callable[[str], Any]], tuple[tuple[Any, Any], tuple[Any, Any], tuple[Any, Any]]]
"""Of a stretch and of the factors by name: active factor, passive and compressive stress, each with its slope."""

CONSTANTS = (
    "cord_area", "muscle_area", "ring_area", "oblique_area", "muscle_offset", "oblique_offset", "oblique_stretch", "bending", "twisting",
    "ring_twisting", "narrowing", "length",
)  # fmt: skip
"""Order of a section's constants in the columns of `section_constants`."""


PASSED = (0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi)
"""Azimuths that stand for all by which an oblique fibre passes within a section."""


class GenericLaw(NamedTuple):
    """Shape of a muscle law that is a parabola (active) and two hinges (passive), stresses relative to the maximum stress."""

    active: tuple[float, float, float]
    passive_slope: float
    passive_onset: float


GENERIC = {"longitudinal": GenericLaw((0.93, 1.2, -5.0), 2.7, 0.06), "transverse": GenericLaw((0.75, 1.9, -2.85), 3.8, 0.055)}
"""Rough shapes, from which identification starts: level, slope and curvature at rest length; slope and onset of the passive hinge."""


def section_constants(arm: Arm, sections: int, samples: int = 60) -> Floats:
    """Constants of the sections, (len(CONSTANTS), S), SI units.

    A section stands for all of the arm in which its hat function acts, where the radius r may fall by half. Its curvature at rest is
    to be the mean of the arm's, which goes with 1/r, and its stiffness the integral of the arm's, which goes with r^4: so a section
    has the harmonic mean radius and counts for the length that gives it that stiffness.

    Parameters
    ----------
    arm : Arm
    sections : int
    samples : int
        Points per section of the integrals.
    """
    grid = np.linspace(0.0, arm.length, sections * samples + 1)
    hats = hat_means(grid, section_bounds(arm, sections))
    outline = arm.section((grid[1:] + grid[:-1]) / 2).outline
    harmonic = hats.sum(axis=0) / (1 / outline @ hats)
    lengths = arm.length / (sections * samples) * (outline**4 @ hats) / harmonic**4
    section = arm.section(np.interp(-harmonic, -arm.section(grid).outline, grid))
    offsets = (section.muscle_offset, section.oblique_offset, section.oblique_stretch)
    stiffness = (section.bending_stiffness, section.twist_stiffness, section.ring_tube_stiffness)
    base = arm.section(0.0)
    narrowing = (_inward_load(section) / _inward_load(base)) ** (2 / 3) * base.muscle_offset / section.muscle_offset
    return np.array([*section.areas, *offsets, *stiffness, narrowing, lengths])


def _inward_load(section: Section) -> Floats:
    """Force per length with which an active oblique family squeezes the section, over its stress.

    Round layers that touch give way by the load to the power 2/3 (Hertz).
    """
    return section.areas[3] * (section.oblique_stretch - 1 / section.oblique_stretch) / section.oblique_offset


def hinge(x: Any, width: Any) -> tuple[Any, Any]:
    """max(x, 0) with a parabola between -width and width, and its slope."""
    inside = ca.fmin(ca.fmax(x + width, 0.0), 2 * width)
    return inside**2 / (4 * width) + ca.fmax(x - width, 0.0), inside / (2 * width)


def known_law(law: MuscleLaw) -> Curves:
    """The plant's polynomials: a function of stretch giving active factor, passive stress over maximum stress, and both slopes.

    Tension and compression carry factors of their own: the function returns ``(f, f'), (tension, its slope), (compression, its slope)``.
    """
    active, passive = np.array(law.active), np.array(law.passive)
    low, top = law.range
    end_slope = float(np.polyval(np.polyder(passive), top))

    def curves(s: Any, factor: Callable[[str], Any]) -> tuple[tuple[Any, Any], tuple[Any, Any], tuple[Any, Any]]:
        held = ca.fmin(ca.fmax(s, low), top)
        value, slope = _horner(active, held)
        f, gate = hinge(value, 0.02)
        stretched = ca.fmin(ca.fmax(s, 1.0), top)
        curve, rise = _horner(passive, stretched)
        tension, opening = hinge(curve + end_slope * ca.fmax(s - top, 0.0), 4e-3)
        rise = ca.if_else(s > top, end_slope, rise * (s > 1.0))
        return (f, gate * slope * (s > low) * (s < top)), _scale(tension, opening * rise, law.passive_scale), _compression(law, s)

    return curves


def generic_law(law: MuscleLaw, shape: GenericLaw) -> Curves:
    """A parabola and two hinges in place of the polynomials of `law`; same interface as `known_law`."""

    def curves(s: Any, factor: Callable[[str], Any]) -> tuple[tuple[Any, Any], tuple[Any, Any], tuple[Any, Any]]:
        x = s - 1
        slope, curvature = shape.active[1] * factor("length_slope"), shape.active[2] * factor("length_curvature")
        f, gate = hinge(1 + slope * x + curvature * x**2, 0.1)
        tension, opening = hinge(x - shape.passive_onset * factor("passive_onset"), 0.04)
        active = _scale(f, gate * (slope + 2 * curvature * x), shape.active[0])
        return active, _scale(tension, opening, shape.passive_slope), _compression(law, s)

    return curves


def hill_secant(law: MuscleLaw, rate: Any) -> Any:
    """Loss of active stress per stretch rate, s, relative to the isometric stress: the secant of Hill's curve at the stretch rate `rate`.

    Shortening f_v = (1 - w) / (1 + w / K) and lengthening f_v = p - (p - 1)(1 + w) / (1 - c w / K) at w = -rate / maximum rate
    both have the form 1 - slope |w| / (1 + |w| / scale).
    """
    size = ca.sqrt(rate**2 + RATE_BLEND**2)
    magnitude = rate**2 / size / law.maximum_rate
    lengthening = 0.5 * (1 + rate / size)
    stretch = law.eccentric_slope / law.curvature
    shortening_slope = (1 + 1 / law.curvature) / (1 + magnitude / law.curvature)
    lengthening_slope = (law.eccentric_plateau - 1) * (1 + stretch) / (1 + stretch * magnitude)
    return (shortening_slope + lengthening * (lengthening_slope - shortening_slope)) / law.maximum_rate


class SectionForces(NamedTuple):
    """Expressions of one section, each times the section's length.

    `force` (4), J per unit strain; `tangent` (4, 4); of F fibres `viscosity` (F), coefficients before the secant, `gradients` (4, F),
    dl/dq, `rest` (F), length per rest length of the arm, and `laws`.
    """

    force: ca.SX
    tangent: ca.SX
    viscosity: ca.SX
    gradients: ca.SX
    rest: ca.SX
    laws: tuple[MuscleLaw, ...]


def section_forces(arm: Arm, laws: str, q: ca.SX, u: ca.SX, constants: ca.SX, factors: ca.SX) -> SectionForces:
    """Build the expressions of a section.

    Parameters
    ----------
    arm : Arm
    laws : {"known", "generic"}
    q : (4,) SX
    u : (11,) SX
        Activation by `MUSCLE_GROUPS`.
    constants : (len(CONSTANTS),) SX
    factors : (len(FACTORS),) SX

    Returns
    -------
    SectionForces
    """
    value = dict(zip(CONSTANTS, ca.vertsplit(constants), strict=True))
    names = dict(zip(FACTORS, ca.vertsplit(factors), strict=True))
    k1, k2, k3, e = ca.vertsplit(q)
    nu = arm.lumped.hoop_ratio * names["hoop_ratio"]
    oblique = u[MUSCLE_GROUPS.index("R-OM")] + u[MUSCLE_GROUPS.index("L-OM")]
    lam = e ** (-nu) / (1 + names["squeeze"] * value["narrowing"] * oblique)
    lam1 = -nu * lam / e
    lam2 = -(nu + 1) * lam1 / e
    curves = {
        "longitudinal": _curves(arm.longitudinal, laws, "longitudinal"),
        "oblique": _curves(arm.oblique, laws, "longitudinal"),
        "transverse": _curves(arm.transverse, laws, "transverse"),
    }
    pitch_rate = 2 * np.pi / arm.oblique_pitch
    force, tangent = ca.SX.zeros(4), ca.SX.zeros(4, 4)
    viscosity, gradients, rests, fibres = [], [], [], []

    def tension(kind: str, area: Any, activation: Any, stress: Any, passive: Any, s: Any, rest: Any) -> tuple[Any, Any]:
        law = getattr(arm, kind)
        (f, f1), (p, p1), (c, c1) = curves[kind](s, lambda name: names[name])
        level = activation * stress * law.maximum_stress
        pulled, pressed = passive * names["passive_stress"] * law.maximum_stress, passive * names["compression"]
        sigma, slope = level * f + pulled * p - pressed * c, level * f1 + pulled * p1 - pressed * c1
        viscosity.append(area * level * f * names["viscosity"] / (s * rest))
        rests.append(rest)
        fibres.append(law)
        return area * sigma / s, area * (slope - sigma / s) / (s * rest)

    def off_axis(kind: str, area: Any, activation: Any, stress: Any, passive: Any, place: Any, turn: Any, rest: Any) -> None:
        nonlocal force, tangent
        rho, angle, share = place
        r1, r2 = share * rho * np.sin(angle), share * rho * np.cos(angle)
        bent, turned = k1 * r2 - k2 * r1, rho * (turn + k3)
        x, b = e + lam * bent, lam * turned
        length = ca.sqrt(x**2 + b**2)
        dx, db = ca.vertcat(lam * r2, -lam * r1, 0, 1 + lam1 * bent), ca.vertcat(0, 0, lam * rho, lam1 * turned)
        gradient = (x * dx + b * db) / length
        pull, stiffness = tension(kind, area, activation, stress, passive, length / rest, rest)
        force += pull * gradient
        mixed = ca.SX(4, 4)  # half of x times the second derivatives of x, plus the same of b
        mixed[:, 3] = ca.vertcat(x * lam1 * r2, -x * lam1 * r1, b * lam1 * rho, 0.5 * lam2 * (x * bent + b * turned))
        tangent += (stiffness - pull / length) * gradient @ gradient.T + pull / length * (dx @ dx.T + db @ db.T + mixed + mixed.T)
        gradients.append(gradient)

    straight_stress = arm.lumped.longitudinal_stress * names["longitudinal_stress"]
    oblique_stress = arm.lumped.oblique_stress * names["oblique_stress"]
    for index, group in enumerate(LONGITUDINAL_GROUPS):
        place = (value["muscle_offset"], azimuth(group), 1.0)
        off_axis("longitudinal", value["muscle_area"], u[index] + names["tone"], straight_stress, 1.0, place, 0.0, 1.0)
    embedded = arm.lumped.oblique_passive * names["oblique_passive"]
    for hand, group in ((1.0, "R-OM"), (-1.0, "L-OM")):
        turn, rest, level = hand * pitch_rate, value["oblique_stretch"], u[MUSCLE_GROUPS.index(group)]
        for angle in PASSED:
            around, area = (value["oblique_offset"], angle, names["oblique_bending"]), value["oblique_area"] / len(PASSED)
            off_axis("oblique", area, level, oblique_stress, embedded, around, turn, rest)
    level = u[MUSCLE_GROUPS.index("TM")] + names["tone"]
    pull, stiffness = tension("transverse", value["ring_area"], level, names["transverse_stress"], 1.0, lam, 1.0)
    gradients.append(ca.vertcat(0, 0, 0, lam1))
    force[3] += pull * lam1
    tangent[3, 3] += stiffness * lam1**2 + pull * lam2
    pull, stiffness = tension("longitudinal", value["cord_area"], names["tone"], straight_stress, 1.0, e, 1.0)
    for kept in (viscosity, rests, fibres):  # the tone of the nerve cord is too small for any viscosity
        kept.pop()
    force[3] += pull
    tangent[3, 3] += stiffness
    twisting = value["twisting"] * names["torsion"] + value["ring_twisting"] * names["ring_torsion"]
    own = ca.vertcat(*2 * [value["bending"] * names["bending"]], twisting, 0.0)
    length = value["length"]
    return SectionForces(
        length * (force + own * q),
        ca.triu2symm(ca.triu(length * (tangent + ca.diag(own)))),
        length * ca.vertcat(*viscosity),
        ca.densify(ca.horzcat(*gradients)),
        ca.vertcat(*rests),
        tuple(fibres),
    )


def viscous_force(forces: SectionForces, rates: ca.SX, motion: ca.SX) -> ca.SX:
    """Hill's viscous force of a section: the viscosity at the strain rates `rates` (4,), 1/s, times the strains `motion` (4,)."""
    speeds = ca.vertsplit((forces.gradients.T @ rates) / forces.rest)
    secants = ca.vertcat(*(hill_secant(law, speed) for law, speed in zip(forces.laws, speeds, strict=True)))
    return forces.gradients @ (forces.viscosity * secants * (forces.gradients.T @ motion))


def _curves(law: MuscleLaw, laws: str, shape: str) -> Curves:
    return known_law(law) if laws == "known" else generic_law(law, GENERIC[shape])


def _horner(coefficients: Floats, x: Any) -> tuple[Any, Any]:
    """Polynomial and its slope."""
    value, slope = float(coefficients[0]), 0.0
    for coefficient in coefficients[1:]:
        slope = slope * x + value
        value = value * x + float(coefficient)
    return value, slope


def _compression(law: MuscleLaw, s: Any) -> tuple[Any, Any]:
    """Size of the compressive stress, Pa, and its slope."""
    value, opening = hinge(1 - law.slack - s, 5e-3)
    return law.compression_modulus * value, -law.compression_modulus * opening


def _scale(value: Any, slope: Any, factor: Any) -> tuple[Any, Any]:
    return factor * value, factor * slope
