"""Fibres of one section for the compiled step: viscous and elastic impulses, their tangent, and their derivatives by all that they hang on.

The laws and the geometry are those of `statics`, where they are written out and sourced. Every fibre is a helix about the axis: at a
distance rho from it, on one side of it, with its own turn, its length per rest length of the arm is

    l^2 = x^2 + b^2,      x = axial e + lam (k1 along - k2 across),      b = lam (turn + rho k3),

with the radius lam = e^-hoop / n and the narrowing n = 1 + squeeze (R-OM + L-OM). Longitudinal muscles do not turn, the cord in the middle
has rho = 0, and rings turn once without going along. Functions give values and first derivatives, fibres second ones too.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.compiler import borrowing_kernel

Floats = NDArray[np.float64]
Five = tuple[float, float, float, float, float]

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
RIGHT, LEFT, RING, NONE = 8, 9, 10, -1
"""Rows of the oblique families and of the transverse muscle in a column of levels; what stands for a fibre that no muscle group moves."""


class Fibres(NamedTuple):
    """Fibres of all sections, F of them in each of S sections.

    `laws` (kinds, numbers), see `Law`, and `law` (F,), which of them; `group` (F,): row of its level or `NONE`; `tone` (F,): level at rest;
    `viscosity` and `passive` (F,): factors on Hill's viscosity and on the passive stress; `axial` (F,): 1 for what goes along the arm.
    `along`, `across`, `radius`, `turn` (S, F), m, m, m, 1; `area` (S, F), m^2; `rest` (S, F): length at rest. `narrowing` (S,);
    `stiffness` (S, 2), N m^2, against bending and twist; `length` (S,), m: of the sections. `hoop`: exponent that couples radius to
    stretch; `squeeze`: narrowing by active oblique muscles.
    """

    laws: Floats
    law: NDArray[np.int64]
    group: NDArray[np.int64]
    tone: Floats
    viscosity: Floats
    passive: Floats
    axial: Floats
    along: Floats
    across: Floats
    radius: Floats
    turn: Floats
    area: Floats
    rest: Floats
    narrowing: Floats
    stiffness: Floats
    length: Floats
    hoop: float
    squeeze: float


class FibreRoom(NamedTuple):
    """Buffers: `ahead` (4,); of a step, `narrowed` (S,): n, `levels` (S, F), tone included, `losses` (S, F) and `pulls` (S, F, 4):
    viscosity of the fibres and their gradients where it begins.
    """

    ahead: Floats
    narrowed: Floats
    levels: Floats
    losses: Floats
    pulls: Floats


def fibre_room(sections: int, fibres: int) -> FibreRoom:
    """Fresh buffers."""
    return FibreRoom(*map(np.zeros, ((4,), (sections,), (sections, fibres), (sections, fibres), (sections, fibres, 4))))


@borrowing_kernel
def polynomial(laws: Floats, law: int, first: int, x: float) -> tuple[float, float]:
    """Value and slope of the polynomial of a law that begins at `first`."""
    value, slope = laws[law, first], 0.0
    for index in range(first + 1, first + TERMS):
        slope = slope * x + value
        value = value * x + laws[law, index]
    return value, slope


@borrowing_kernel
def hinge(x: float, width: float) -> tuple[float, float]:
    """max(x, 0) with a parabola between -width and width, and its slope."""
    if x <= -width:
        return 0.0, 0.0
    if x >= width:
        return x, 1.0
    inside = x + width
    return inside * inside / (4 * width), inside / (2 * width)


@borrowing_kernel
def active_stress(laws: Floats, law: int, s: float) -> tuple[float, float]:
    """Active stress at full level, Pa, and its slope."""
    curve, rise = polynomial(laws, law, OF.active, min(max(s, laws[law, OF.low]), laws[law, OF.top]))
    if s <= laws[law, OF.low] or s >= laws[law, OF.top]:
        rise = 0.0
    value, slope = hinge(curve, laws[law, OF.active_blend])
    return laws[law, OF.active_stress] * value, laws[law, OF.active_stress] * slope * rise


@borrowing_kernel
def passive_stress(laws: Floats, law: int, s: float) -> tuple[float, float]:
    """Stress of the resting tissue, Pa, and its slope."""
    curve, rise = polynomial(laws, law, OF.passive, min(max(s, laws[law, OF.floor]), laws[law, OF.top]))
    if s > laws[law, OF.top]:
        rise = laws[law, OF.end_slope]
        curve += rise * (s - laws[law, OF.top])
    elif s <= laws[law, OF.floor]:
        rise = 0.0
    pressed, closing = hinge(1 - laws[law, OF.slack] - s, COMPRESSION_BLEND)
    value, slope = hinge(curve, laws[law, OF.tension_blend])
    return laws[law, OF.tension] * value - laws[law, OF.compression] * pressed, laws[law, OF.tension] * slope * rise + laws[
        law, OF.compression
    ] * closing


@borrowing_kernel
def hill_secant(laws: Floats, law: int, rate: float) -> tuple[float, float]:
    """Loss of active stress per stretch rate, s, over the isometric stress, and its slope."""
    square = rate * rate
    size = np.sqrt(square + RATE_BLEND * RATE_BLEND)
    magnitude, growth = square / size / laws[law, OF.rate], rate * (2 - square / (size * size)) / size / laws[law, OF.rate]
    lengthening, turning = 0.5 * (1 + rate / size), 0.5 * (RATE_BLEND * RATE_BLEND) / (size * size * size)
    stretch = laws[law, OF.eccentric] / laws[law, OF.concentric]
    below, above = 1 / (1 + magnitude / laws[law, OF.concentric]), 1 / (1 + stretch * magnitude)
    short = (1 + 1 / laws[law, OF.concentric]) * below
    long = (laws[law, OF.plateau] - 1) * (1 + stretch) * above
    short_slope, long_slope = -short * below / laws[law, OF.concentric] * growth, -long * above * stretch * growth
    slope = short_slope + turning * (long - short) + lengthening * (long_slope - short_slope)
    return (short + lengthening * (long - short)) / laws[law, OF.rate], slope / laws[law, OF.rate]


@borrowing_kernel
def radius_factor(e: float, narrow: float, hoop: float) -> tuple[float, float, float]:
    """Radius over rest radius of a section, and its first and second derivative by the stretch."""
    lam = np.exp(-hoop * np.log(e)) / narrow
    first = -hoop * lam / e
    return lam, first, -(hoop + 1) * first / e


@borrowing_kernel
def fibre_length(
    q: Floats, lam: float, lam1: float, lam2: float, axial: float, along: float, across: float, radius: float, turn: float
) -> tuple[float, Five, tuple[Five, Five, Five, Five]]:
    """Length of a fibre per rest length of the arm; its derivatives by the four strains and log n; those of the first four by all five."""
    bent, turned = q[0] * along - q[1] * across, turn + radius * q[2]
    x, b = axial * q[3] + lam * bent, lam * turned
    length = np.sqrt(x * x + b * b)
    by = 1 / length
    x0, x1, x3, x4 = lam * along, -lam * across, axial + lam1 * bent, -lam * bent
    b2, b3, b4 = lam * radius, lam1 * turned, -lam * turned
    g0, g1, g2, g3, g4 = x * x0 * by, x * x1 * by, b * b2 * by, (x * x3 + b * b3) * by, (x * x4 + b * b4) * by
    c01, c02, c12 = by * (x0 * x1 - g0 * g1), -by * g0 * g2, -by * g1 * g2
    c03, c13 = by * (x0 * x3 + x * lam1 * along - g0 * g3), by * (x1 * x3 - x * lam1 * across - g1 * g3)
    c23 = by * (b2 * b3 + b * lam1 * radius - g2 * g3)
    return length, (g0, g1, g2, g3, g4), (
        (by * (x0 * x0 - g0 * g0), c01, c02, c03, by * (x0 * x4 - x * x0 - g0 * g4)),
        (c01, by * (x1 * x1 - g1 * g1), c12, c13, by * (x1 * x4 - x * x1 - g1 * g4)),
        (c02, c12, by * (b2 * b2 - g2 * g2), c23, by * (b2 * b4 - b * b2 - g2 * g4)),
        (c03, c13, c23, by * (x3 * x3 + b3 * b3 + lam2 * (x * bent + b * turned) - g3 * g3),
         by * (x3 * x4 + b3 * b4 - x * lam1 * bent - b * b3 - g3 * g4)),
    )  # fmt: skip


@borrowing_kernel
def tension(laws: Floats, law: int, area: float, rest: float, passive: float, level: float, length: float) -> tuple[float, float]:
    """Tension of a fibre over its stretch, and the derivative of that by its length."""
    s = length / rest
    stress, slope = passive_stress(laws, law, s)
    stress, slope = passive * stress, passive * slope
    if level != 0.0:
        active, rise = active_stress(laws, law, s)
        stress, slope = stress + level * active, slope + level * rise
    return area * stress / s, area * (slope - stress / s) / length


@borrowing_kernel
def set_fibres(q: Floats, levels: Floats, fibres: Any, room: Any) -> None:
    """What stays through a step from the strains `q` (S, 4) at the levels (groups, S) of its end: levels of the fibres, what resists."""
    for n in range(q.shape[0]):
        room.narrowed[n] = 1 + fibres.squeeze * fibres.narrowing[n] * (levels[RIGHT, n] + levels[LEFT, n])
        lam, lam1, lam2 = radius_factor(q[n, 3], room.narrowed[n], fibres.hoop)
        for f in range(len(fibres.law)):
            level = fibres.tone[f]
            if fibres.group[f] != NONE:
                level += levels[fibres.group[f], n]
            room.levels[n, f], room.losses[n, f] = level, 0.0
            if level != 0.0 and fibres.viscosity[f] != 0.0:
                length, gradient, _ = fibre_length(
                    q[n], lam, lam1, lam2, fibres.axial[f], fibres.along[n, f], fibres.across[n, f], fibres.radius[n, f],
                    fibres.turn[n, f],
                )  # fmt: skip
                active, _ = active_stress(fibres.laws, fibres.law[f], length / fibres.rest[n, f])
                room.losses[n, f] = fibres.viscosity[f] * fibres.area[n, f] * level * active / length
                for k in range(4):
                    room.pulls[n, f, k] = gradient[k]


@borrowing_kernel
def section_impulse(q: Floats, motion: Floats, h: float, n: int, fibres: Any, room: Any, out: Floats, tangent: Floats) -> None:
    """Viscous impulse at the strains `q` (4) plus elastic impulse at `q + motion` of a step `h`, J s per unit strain, into `out` (4), and
    its derivative by the motion into `tangent` (4, 4); of the section `n`, after `set_fibres`.
    """
    pulls, m0, m1, m2, m3 = room.pulls, motion[0], motion[1], motion[2], motion[3]
    ahead = room.ahead
    for i in range(4):
        ahead[i] = q[i] + motion[i]
    bending, twisting = h * fibres.stiffness[n, 0], h * fibres.stiffness[n, 1]
    o0, o1, o2, o3 = bending * ahead[0], bending * ahead[1], twisting * ahead[2], 0.0
    t00, t01, t02, t03, t11, t12, t13, t22, t23, t33 = bending, 0.0, 0.0, 0.0, bending, 0.0, 0.0, twisting, 0.0, 0.0
    lam, lam1, lam2 = radius_factor(ahead[3], room.narrowed[n], fibres.hoop)
    for f in range(len(fibres.law)):
        loss, rest = room.losses[n, f], fibres.rest[n, f]
        if loss != 0.0:
            g0, g1, g2, g3 = pulls[n, f, 0], pulls[n, f, 1], pulls[n, f, 2], pulls[n, f, 3]
            moved = g0 * m0 + g1 * m1 + g2 * m2 + g3 * m3
            rate = moved / (h * rest)
            secant, slope = hill_secant(fibres.laws, fibres.law[f], rate)
            pull, stiffness = loss * secant * moved, loss * (secant + slope * rate)
            o0, o1, o2, o3 = o0 + pull * g0, o1 + pull * g1, o2 + pull * g2, o3 + pull * g3
            t00, t01, t02, t03 = t00 + stiffness * g0 * g0, t01 + stiffness * g0 * g1, t02 + stiffness * g0 * g2, t03 + stiffness * g0 * g3
            t11, t12, t13 = t11 + stiffness * g1 * g1, t12 + stiffness * g1 * g2, t13 + stiffness * g1 * g3
            t22, t23, t33 = t22 + stiffness * g2 * g2, t23 + stiffness * g2 * g3, t33 + stiffness * g3 * g3
        length, (g0, g1, g2, g3, _), (c0, c1, c2, c3) = fibre_length(
            ahead, lam, lam1, lam2, fibres.axial[f], fibres.along[n, f], fibres.across[n, f], fibres.radius[n, f], fibres.turn[n, f]
        )  # fmt: skip
        pull, stiffness = tension(fibres.laws, fibres.law[f], fibres.area[n, f], rest, fibres.passive[f], room.levels[n, f], length)
        pull, stiffness = h * pull, h * stiffness
        o0, o1, o2, o3 = o0 + pull * g0, o1 + pull * g1, o2 + pull * g2, o3 + pull * g3
        t00, t01 = t00 + stiffness * g0 * g0 + pull * c0[0], t01 + stiffness * g0 * g1 + pull * c0[1]
        t02, t03 = t02 + stiffness * g0 * g2 + pull * c0[2], t03 + stiffness * g0 * g3 + pull * c0[3]
        t11, t12 = t11 + stiffness * g1 * g1 + pull * c1[1], t12 + stiffness * g1 * g2 + pull * c1[2]
        t13, t22 = t13 + stiffness * g1 * g3 + pull * c1[3], t22 + stiffness * g2 * g2 + pull * c2[2]
        t23, t33 = t23 + stiffness * g2 * g3 + pull * c2[3], t33 + stiffness * g3 * g3 + pull * c3[3]
    out[0], out[1], out[2], out[3] = o0, o1, o2, o3
    tangent[0, 0], tangent[1, 1], tangent[2, 2], tangent[3, 3] = t00, t11, t22, t33
    tangent[0, 1], tangent[0, 2], tangent[0, 3], tangent[1, 2], tangent[1, 3], tangent[2, 3] = t01, t02, t03, t12, t13, t23
    for i in range(4):
        out[i] *= fibres.length[n]
        for j in range(i, 4):
            tangent[i, j] *= fibres.length[n]
            tangent[j, i] = tangent[i, j]


@borrowing_kernel
def section_slopes(
    q: Floats, motion: Floats, h: float, n: int, fibres: Any, room: Any, by_strains: Floats, by_levels: Floats, by_step: Floats
) -> None:
    """Derivatives of `section_impulse` at a fixed motion: (4, 5) by the strains and log n, the latter a buffer, (4, groups) and (4,)."""
    ahead = room.ahead
    by_strains[:] = 0.0
    by_levels[:] = 0.0
    by_step[3] = 0.0
    for i in range(4):
        ahead[i] = q[i] + motion[i]
    for i in range(3):
        stiffness = fibres.stiffness[n, 0 if i < 2 else 1]
        by_strains[i, i], by_step[i] = h * stiffness, stiffness * ahead[i]
    narrow = room.narrowed[n]
    lam, lam1, lam2 = radius_factor(q[3], narrow, fibres.hoop)
    for f in range(len(fibres.law)):
        group, rest, level = fibres.group[f], fibres.rest[n, f], room.levels[n, f]
        if fibres.viscosity[f] == 0.0 or group == NONE:
            continue
        length, gradient, curvature = fibre_length(
            q, lam, lam1, lam2, fibres.axial[f], fibres.along[n, f], fibres.across[n, f], fibres.radius[n, f], fibres.turn[n, f]
        )  # fmt: skip
        moved = gradient[0] * motion[0] + gradient[1] * motion[1] + gradient[2] * motion[2] + gradient[3] * motion[3]
        rate = moved / (h * rest)
        secant, slope = hill_secant(fibres.laws, fibres.law[f], rate)
        active, rise = active_stress(fibres.laws, fibres.law[f], length / rest)
        unit = fibres.viscosity[f] * fibres.area[n, f] / length  # loss per level and active stress
        for i in range(4):
            by_levels[i, group] += unit * active * secant * moved * gradient[i]
        if level == 0.0:
            continue
        loss, thicker = unit * active * level, unit * level * (rise / rest - active / length) * secant * moved
        for i in range(4):
            by_step[i] -= loss * slope * rate / h * moved * gradient[i]
        for j in range(5):
            shifted = curvature[0][j] * motion[0] + curvature[1][j] * motion[1] + curvature[2][j] * motion[2] + curvature[3][j] * motion[3]
            change = thicker * gradient[j] + loss * (secant + slope * rate) * shifted
            for i in range(4):
                by_strains[i, j] += change * gradient[i] + loss * secant * moved * curvature[i][j]
    lam, lam1, lam2 = radius_factor(ahead[3], narrow, fibres.hoop)
    for f in range(len(fibres.law)):
        group, rest = fibres.group[f], fibres.rest[n, f]
        length, gradient, curvature = fibre_length(
            ahead, lam, lam1, lam2, fibres.axial[f], fibres.along[n, f], fibres.across[n, f], fibres.radius[n, f], fibres.turn[n, f]
        )  # fmt: skip
        pull, stiffness = tension(fibres.laws, fibres.law[f], fibres.area[n, f], rest, fibres.passive[f], room.levels[n, f], length)
        if group != NONE:
            active, _ = active_stress(fibres.laws, fibres.law[f], length / rest)
            for i in range(4):
                by_levels[i, group] += h * fibres.area[n, f] * active * rest / length * gradient[i]
        for i in range(4):
            by_step[i] += pull * gradient[i]
            for j in range(5):
                by_strains[i, j] += h * (stiffness * gradient[i] * gradient[j] + pull * curvature[i][j])
    squeeze = fibres.squeeze * fibres.narrowing[n] / narrow
    for i in range(4):
        by_step[i] *= fibres.length[n]
        by_levels[i, RIGHT] += squeeze * by_strains[i, 4]
        by_levels[i, LEFT] += squeeze * by_strains[i, 4]
        for group in range(by_levels.shape[1]):
            by_levels[i, group] *= fibres.length[n]
        for j in range(5):
            by_strains[i, j] *= fibres.length[n]
