"""Fibres of one section for the compiled step: viscous and elastic forces, and their exact tangent.

The laws and the geometry are those of `statics`, where they are written out and sourced. All functions take real or complex numbers:
branches look at real parts and nothing takes a size, so that a derivative along any direction is the imaginary part of the residual at an
argument with an imaginary part of `TINY`, exact to rounding (complex step: Squire & Trapp 1998).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.compiler import kernel

Floats = NDArray[np.float64]
Numbers = NDArray[Any]
"""Real, or complex where slopes are taken by a complex step."""
Number = Any
"""One of them."""

TINY = 1e-30
"""Imaginary part of a complex step."""

RATE_BLEND = 0.01
"""Stretch rate, 1/s, over which the shortening and lengthening branches of Hill's law are blended."""

COMPRESSION_BLEND = 5e-3
"""Strain over which compressive stress sets in."""


class Law(NamedTuple):
    """Positions in the row of numbers of a muscle law.

    Active stress: `active_stress` times the hinge, of half-width `active_blend`, of the polynomial that begins at `active`, of the stretch
    held within `low` and `top`. Tension: `tension` times the hinge, of half-width `tension_blend`, of the polynomial that begins at
    `passive`, held within `floor` and `top` and going on with `end_slope`. Compression: `compression` times a hinge that opens `slack`
    below rest. Stresses in Pa; polynomials of `TERMS` terms, the highest power first.
    """

    low: int = 0
    top: int = 1
    floor: int = 2
    end_slope: int = 3
    active_blend: int = 4
    tension_blend: int = 5
    active_stress: int = 6
    tension: int = 7
    compression: int = 8
    slack: int = 9
    rate: int = 10
    concentric: int = 11
    plateau: int = 12
    eccentric: int = 13
    active: int = 14
    passive: int = 23


OF, TERMS = Law(), 9


class Fibres(NamedTuple):
    """What the fibres of all sections share: rows of three laws (see `Law`), and

    `sides` (8, 2): sine and cosine of the azimuth of the longitudinal muscles; `around` (parts, 2): the same of the places by which an
    oblique fibre passes, times the share of the bend that it feels there; `hoop`: exponent that couples radius to stretch; `squeeze`:
    narrowing by active oblique muscles; `tone`: level at rest; `viscosity`: factor on Hill's; `pitch_rate`, 1/m: turn of oblique fibres;
    `embedded`: factor on the passive stress of oblique fibres.
    """

    longitudinal: Floats
    oblique: Floats
    transverse: Floats
    sides: Floats
    around: Floats
    hoop: float
    squeeze: float
    tone: float
    viscosity: float
    pitch_rate: float
    embedded: float


class Place(NamedTuple):
    """Positions of a section's constants in its row; the order of `statics.CONSTANTS`, stiffnesses with their factors."""

    cord: int = 0
    muscle: int = 1
    ring: int = 2
    oblique: int = 3
    muscle_offset: int = 4
    oblique_offset: int = 5
    oblique_stretch: int = 6
    bending: int = 7
    twisting: int = 8
    ring_twisting: int = 9
    narrowing: int = 10
    length: int = 11


AT = Place()
RIGHT, LEFT, RING = 8, 9, 10
"""Rows of the oblique families and of the transverse muscle in a column of levels."""


@kernel
def polynomial(law: Any, first: int, x: Number) -> Number:
    """Value of the polynomial of a law that begins at `first`."""
    value = law[first] + 0 * x
    for index in range(first + 1, first + TERMS):
        value = value * x + law[index]
    return value


@kernel
def hinge(x: Number, width: Number) -> Number:
    """max(x, 0) with a parabola between -width and width."""
    if x.real <= -width:
        return 0 * x
    if x.real >= width:
        return x
    inside = x + width
    return inside * inside / (4 * width)


@kernel
def active_stress(law: Any, s: Number) -> Number:
    """Active stress at full level, Pa."""
    held = s
    if s.real <= law[OF.low]:
        held = law[OF.low] + 0 * s
    elif s.real >= law[OF.top]:
        held = law[OF.top] + 0 * s
    return law[OF.active_stress] * hinge(polynomial(law, OF.active, held), law[OF.active_blend])


@kernel
def passive_stress(law: Any, s: Number) -> Number:
    """Stress of the resting tissue, Pa."""
    if s.real > law[OF.top]:
        curve = polynomial(law, OF.passive, law[OF.top] + 0 * s) + law[OF.end_slope] * (s - law[OF.top])
    elif s.real <= law[OF.floor]:
        curve = polynomial(law, OF.passive, law[OF.floor] + 0 * s)
    else:
        curve = polynomial(law, OF.passive, s)
    pressed = hinge(1 - law[OF.slack] - s, COMPRESSION_BLEND)
    return law[OF.tension] * hinge(curve, law[OF.tension_blend]) - law[OF.compression] * pressed


@kernel
def hill_secant(law: Any, rate: Number) -> Number:
    """Loss of active stress per stretch rate, s, over the isometric stress."""
    square = rate * rate
    size = np.sqrt(square + RATE_BLEND * RATE_BLEND)
    magnitude = square / size / law[OF.rate]
    lengthening = 0.5 * (1 + rate / size)
    stretch = law[OF.eccentric] / law[OF.concentric]
    short = (1 + 1 / law[OF.concentric]) / (1 + magnitude / law[OF.concentric])
    long = (law[OF.plateau] - 1) * (1 + stretch) / (1 + stretch * magnitude)
    return (short + lengthening * (long - short)) / law[OF.rate]


@kernel
def radius_factor(q: Numbers, levels: Numbers, place: Any, hoop: Number, squeeze: Number) -> tuple[Number, ...]:
    """Radius over rest radius of a section, and its first and second derivative by the stretch."""
    narrowed = 1 + squeeze * place[AT.narrowing] * (levels[RIGHT] + levels[LEFT])
    lam = np.exp(-hoop * np.log(q[3])) / narrowed
    first = -hoop * lam / q[3]
    return lam, first, -(hoop + 1) * first / q[3]


@kernel
def fibre_length(q: Numbers, lam: Number, lam1: Number, rho: Number, side: Number, turn: Number, gradient: Numbers) -> Number:
    """Length per rest length of the arm of a fibre at the distance `rho` from the axis, on a `side` (2) of it; its gradient by the strains
    goes to `gradient`.
    """
    across, along = rho * side[0], rho * side[1]
    bent, turned = q[0] * along - q[1] * across, rho * (turn + q[2])
    x, b = q[3] + lam * bent, lam * turned
    length = np.sqrt(x * x + b * b)
    gradient[0] = x * lam * along / length
    gradient[1] = -x * lam * across / length
    gradient[2] = b * lam * rho / length
    gradient[3] = (x * (1 + lam1 * bent) + b * lam1 * turned) / length
    return length


@kernel
def winding(index: int, fibres: Any) -> Number:
    """Turn of the oblique fibres `index` about the axis, 1/m."""
    return fibres.pitch_rate if index == RIGHT else -fibres.pitch_rate


@kernel
def viscous_tension(law: Any, area: Number, level: Number, s: Number, rest: Number, h: Number, moved: Number) -> Number:
    """Viscous impulse along a fibre whose length changes by `moved` within `h`; `level` carries the factor on the viscosity."""
    return area * level * active_stress(law, s) / (s * rest) * hill_secant(law, moved / (h * rest)) * moved


@kernel
def add_viscous(
    law: Any, area: Number, level: Number, s: Number, rest: Number, h: Number, motion: Numbers, gradient: Numbers, out: Numbers
) -> None:
    """Add the viscous impulse of one fibre to `out`."""
    moved = gradient[0] * motion[0] + gradient[1] * motion[1] + gradient[2] * motion[2] + gradient[3] * motion[3]
    tension = viscous_tension(law, area, level, s, rest, h, moved)
    for k in range(4):
        out[k] += gradient[k] * tension


@kernel
def section_residual(
    q: Numbers, motion: Numbers, levels: Numbers, h: Number, place: Any, fibres: Any, gradient: Numbers, ahead: Any, out: Numbers
) -> None:
    """Viscous impulse at the strains `q` plus elastic impulse at `q + motion` of a step `h`, J s per unit strain, into `out` (4).

    `levels` (11) are those at the end of the step; `gradient` and `ahead` (4) are buffers.
    """
    for k in range(4):
        out[k] = 0 * (q[k] + motion[k] + levels[RING] + h)
        ahead[k] = q[k] + motion[k]
    lam, lam1, _ = radius_factor(q, levels, place, fibres.hoop, fibres.squeeze)
    for index in range(RIGHT):
        level = levels[index] + fibres.tone
        if level != 0:
            length = fibre_length(q, lam, lam1, place[AT.muscle_offset], fibres.sides[index], 0.0, gradient)
            add_viscous(fibres.longitudinal, place[AT.muscle], fibres.viscosity * level, length, 1.0, h, motion, gradient, out)
    parts, rest = len(fibres.around), place[AT.oblique_stretch]
    for index in range(RIGHT, RING):
        if levels[index] != 0:
            for part in range(parts):
                length = fibre_length(q, lam, lam1, place[AT.oblique_offset], fibres.around[part], winding(index, fibres), gradient)
                level = fibres.viscosity * levels[index]
                add_viscous(fibres.oblique, place[AT.oblique] / parts, level, length / rest, rest, h, motion, gradient, out)
    ring = levels[RING] + fibres.tone
    if ring != 0:
        for k in range(4):
            gradient[k] = 0 * lam1
        gradient[3] = lam1
        add_viscous(fibres.transverse, place[AT.ring], fibres.viscosity * ring, lam, 1.0, h, motion, gradient, out)
    lam, lam1, _ = radius_factor(ahead, levels, place, fibres.hoop, fibres.squeeze)
    for index in range(RIGHT):
        s = fibre_length(ahead, lam, lam1, place[AT.muscle_offset], fibres.sides[index], 0.0, gradient)
        stress = (levels[index] + fibres.tone) * active_stress(fibres.longitudinal, s) + passive_stress(fibres.longitudinal, s)
        for k in range(4):
            out[k] += h * place[AT.muscle] * stress / s * gradient[k]
    for index in range(RIGHT, RING):
        for part in range(parts):
            s = fibre_length(ahead, lam, lam1, place[AT.oblique_offset], fibres.around[part], winding(index, fibres), gradient) / rest
            stress = levels[index] * active_stress(fibres.oblique, s) + fibres.embedded * passive_stress(fibres.oblique, s)
            for k in range(4):
                out[k] += h * place[AT.oblique] / parts * stress / s * gradient[k]
    stress = ring * active_stress(fibres.transverse, lam) + passive_stress(fibres.transverse, lam)
    out[3] += h * place[AT.ring] * stress / lam * lam1
    e = ahead[3]
    stress = fibres.tone * active_stress(fibres.longitudinal, e) + passive_stress(fibres.longitudinal, e)
    out[3] += h * place[AT.cord] * stress / e
    out[0] += h * place[AT.bending] * ahead[0]
    out[1] += h * place[AT.bending] * ahead[1]
    out[2] += h * (place[AT.twisting] + place[AT.ring_twisting]) * ahead[2]
    for k in range(4):
        out[k] *= place[AT.length]


@kernel
def add_viscous_tangent(
    law: Any, area: Number, level: Number, s: Number, rest: Number, h: Number, motion: Numbers, gradient: Numbers, tangent: Numbers
) -> None:
    """Add the derivative of `add_viscous` by the motion to `tangent` (4, 4)."""
    moved = gradient[0] * motion[0] + gradient[1] * motion[1] + gradient[2] * motion[2] + gradient[3] * motion[3]
    slope = viscous_tension(law, area, level, s, rest, h, moved + 1j * TINY).imag / TINY
    for i in range(4):
        for j in range(4):
            tangent[i, j] += slope * gradient[i] * gradient[j]


@kernel
def pull_and_stiffness(law: Any, area: Number, level: Number, embedded: Number, s: Number, rest: Number) -> tuple[Number, ...]:
    """Tension of a fibre over its stretch, and the derivative of that by its length, which is `rest` at rest."""
    shifted = s + 1j * TINY
    pull = area * (level * active_stress(law, shifted) + embedded * passive_stress(law, shifted)) / shifted
    return pull.real, pull.imag / (TINY * rest)


@kernel
def add_fibre_tangent(
    pull: Number, stiffness: Number, length: Number, e: Number, bent: Number, turned: Number, lam: Number, lam1: Number, lam2: Number,
    across: Number, along: Number, rho: Number, gradient: Numbers, tangent: Numbers,
) -> None:  # fmt: skip
    """Add the derivative of pull times the gradient of length^2 = x^2 + b^2, x = e + lam bent, b = lam turned."""
    x, b, by = e + lam * bent, lam * turned, pull / length
    for i in range(4):
        for j in range(4):
            tangent[i, j] += (stiffness - by) * gradient[i] * gradient[j]
    x0, x1, x3, b2, b3 = lam * along, -lam * across, 1 + lam1 * bent, lam * rho, lam1 * turned
    mixed0, mixed1, mixed2 = by * (x0 * x3 + x * lam1 * along), by * (x1 * x3 - x * lam1 * across), by * (b2 * b3 + b * lam1 * rho)
    tangent[0, 0] += by * x0 * x0
    tangent[1, 1] += by * x1 * x1
    tangent[0, 1] += by * x0 * x1
    tangent[1, 0] += by * x0 * x1
    tangent[2, 2] += by * b2 * b2
    tangent[3, 3] += by * (x3 * x3 + b3 * b3 + lam2 * (x * bent + b * turned))
    tangent[0, 3] += mixed0
    tangent[3, 0] += mixed0
    tangent[1, 3] += mixed1
    tangent[3, 1] += mixed1
    tangent[2, 3] += mixed2
    tangent[3, 2] += mixed2


@kernel
def section_tangent(
    q: Numbers, motion: Numbers, levels: Numbers, h: Number, place: Any, fibres: Any, gradient: Numbers, ahead: Any, tangent: Numbers
) -> None:
    """Derivative (4, 4) of `section_residual` by the motion, for real numbers."""
    for i in range(4):
        for j in range(4):
            tangent[i, j] = 0.0
        ahead[i] = q[i] + motion[i]
    lam, lam1, _ = radius_factor(q, levels, place, fibres.hoop, fibres.squeeze)
    stretch, parts = place[AT.oblique_stretch], len(fibres.around)
    for index in range(RIGHT):
        level = levels[index] + fibres.tone
        if level != 0.0:
            s = fibre_length(q, lam, lam1, place[AT.muscle_offset], fibres.sides[index], 0.0, gradient)
            add_viscous_tangent(fibres.longitudinal, place[AT.muscle], fibres.viscosity * level, s, 1.0, h, motion, gradient, tangent)
    for index in range(RIGHT, RING):
        if levels[index] != 0.0:
            for part in range(parts):
                s = fibre_length(q, lam, lam1, place[AT.oblique_offset], fibres.around[part], winding(index, fibres), gradient) / stretch
                level = fibres.viscosity * levels[index]
                add_viscous_tangent(fibres.oblique, place[AT.oblique] / parts, level, s, stretch, h, motion, gradient, tangent)
    ring = levels[RING] + fibres.tone
    if ring != 0.0:
        for k in range(3):
            gradient[k] = 0.0
        gradient[3] = lam1
        add_viscous_tangent(fibres.transverse, place[AT.ring], fibres.viscosity * ring, lam, 1.0, h, motion, gradient, tangent)
    lam, lam1, lam2 = radius_factor(ahead, levels, place, fibres.hoop, fibres.squeeze)
    e = ahead[3]
    rho = place[AT.muscle_offset]
    for index in range(RIGHT):
        across, along = rho * fibres.sides[index, 0], rho * fibres.sides[index, 1]
        s = fibre_length(ahead, lam, lam1, rho, fibres.sides[index], 0.0, gradient)
        pull, stiffness = pull_and_stiffness(fibres.longitudinal, h * place[AT.muscle], levels[index] + fibres.tone, 1.0, s, 1.0)
        bent, turned = ahead[0] * along - ahead[1] * across, rho * ahead[2]
        add_fibre_tangent(pull, stiffness, s, e, bent, turned, lam, lam1, lam2, across, along, rho, gradient, tangent)
    rho = place[AT.oblique_offset]
    for index in range(RIGHT, RING):
        turned, area = rho * (ahead[2] + winding(index, fibres)), h * place[AT.oblique] / parts
        for part in range(parts):
            across, along = rho * fibres.around[part, 0], rho * fibres.around[part, 1]
            length = fibre_length(ahead, lam, lam1, rho, fibres.around[part], winding(index, fibres), gradient)
            pull, stiffness = pull_and_stiffness(fibres.oblique, area, levels[index], fibres.embedded, length / stretch, stretch)
            bent = ahead[0] * along - ahead[1] * across
            add_fibre_tangent(pull, stiffness, length, e, bent, turned, lam, lam1, lam2, across, along, rho, gradient, tangent)
    pull, stiffness = pull_and_stiffness(fibres.transverse, h * place[AT.ring], ring, 1.0, lam, 1.0)
    tangent[3, 3] += stiffness * lam1 * lam1 + pull * lam2
    pull, stiffness = pull_and_stiffness(fibres.longitudinal, h * place[AT.cord], fibres.tone, 1.0, e, 1.0)
    tangent[3, 3] += stiffness
    tangent[0, 0] += h * place[AT.bending]
    tangent[1, 1] += h * place[AT.bending]
    tangent[2, 2] += h * (place[AT.twisting] + place[AT.ring_twisting])
    for i in range(4):
        for j in range(4):
            tangent[i, j] *= place[AT.length]
