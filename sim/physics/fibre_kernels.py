"""Muscle fibres in compiled code: stress at a stretch, its slope, and the force-velocity law as a viscosity.

Free functions of one fibre's stretch, rate and constants; each is the twin of a method of `octoctrl.sim.body.muscles.MuscleLaw`.
"""

from typing import Any, NamedTuple

import numpy as np

from ..body.muscles import MuscleLaw
from ..compiler import kernel


class LawConstants(NamedTuple):
    """Scalars of one muscle law for the compiled code; see `octoctrl.sim.body.muscles.MuscleLaw`.

    The polynomials are in powers of the stretch less `centre`.
    """

    stress: float
    compression: float
    slack: float
    rate: float
    concentric: float
    eccentric_gain: float
    eccentric: float
    low: float
    high: float
    high_slope: float
    tangent: float
    centre: float
    active: tuple[float, ...]
    passive: tuple[float, ...]
    viscosity: float


MIDDLE = 1.1
"""Stretch about which single precision expands the polynomials: about zero, large terms of either sign would use up its digits."""


def law_constants(
    law: MuscleLaw, passive_factor: float = 1.0, active_factor: float = 1.0, *, viscosity: float = 0.0, centre: float = 0.0
) -> LawConstants:
    """Constants of a `MuscleLaw`, with factors on its passive and its active stress, and the `viscosity` (Pa s) of the tissue, which no
    level changes.

    Its polynomials are in powers of the stretch less `centre`.
    """
    around = np.poly1d([1.0, centre])
    scale = law.maximum_stress * law.passive_scale * passive_factor
    stretches = np.linspace(1.0, 1.4, 81)
    return LawConstants(
        stress=active_factor * law.maximum_stress,
        compression=law.compression_modulus * passive_factor,
        slack=law.slack,
        rate=1 / law.maximum_rate,
        concentric=1 / law.curvature,
        eccentric_gain=(law.eccentric_plateau - 1) * (1 + law.eccentric_slope / law.curvature),
        eccentric=law.eccentric_slope / law.curvature,
        low=law.range[0],
        high=law.range[1],
        high_slope=scale * float(np.polyval(np.polyder(law.passive), law.range[1])),
        tangent=float(scale * np.polyval(np.polyder(law.passive), stretches).max()),
        centre=centre,
        active=_coefficients(np.poly1d(law.active)(around) if centre else law.active),
        passive=_coefficients(scale * (np.poly1d(law.passive)(around) if centre else np.asarray(law.passive))),
        viscosity=viscosity,
    )


def _coefficients(found: Any) -> tuple[float, ...]:
    """Nine of them, the highest power first."""
    values = np.asarray(found, dtype=float)
    return (0.0,) * (9 - len(values)) + tuple(map(float, values))


@kernel
def horner(c: tuple[float, ...], x: float) -> float:
    """A polynomial of degree 8 with coefficients `c`, highest power first."""
    total = c[0] * x + c[1]
    total = total * x + c[2]
    total = total * x + c[3]
    total = total * x + c[4]
    total = total * x + c[5]
    total = total * x + c[6]
    total = total * x + c[7]
    return total * x + c[8]


@kernel
def passive_stress(law: LawConstants, s: float) -> float:
    """Passive stress; twin of `MuscleLaw.passive_stress`."""
    inside = min(max(s, 1.0), law.high)
    curve = max(horner(law.passive, inside - law.centre) + law.high_slope * max(s - law.high, 0.0), 0.0)
    tension = curve if s > 1.0 + law.slack else 0.0
    return tension + law.compression * min(s - 1.0 + law.slack, 0.0)


@kernel
def passive_tangent(law: LawConstants, s: float) -> float:
    """Slope of the passive stress in tension, and the modulus of compression as its lower bound."""
    p, x = law.passive, min(max(s, 1.0), law.high) - law.centre
    total = 8.0 * p[0] * x + 7.0 * p[1]
    total = total * x + 6.0 * p[2]
    total = total * x + 5.0 * p[3]
    total = total * x + 4.0 * p[4]
    total = total * x + 3.0 * p[5]
    total = total * x + 2.0 * p[6]
    total = total * x + p[7]
    return max(total, law.compression)


@kernel
def isometric_stress(law: LawConstants, s: float) -> float:
    """Active stress per activation at rest; twin of `MuscleLaw.active_factor`."""
    return law.stress * max(horner(law.active, min(max(s, law.low), law.high) - law.centre), 0.0)


@kernel
def hill_secant(law: LawConstants, rate: float) -> float:
    """(f_v - 1) / rate >= 0 at a stretch rate, s: what the isometric stress is multiplied with to give a viscosity."""
    w = -rate * law.rate
    above = 1.0 + law.concentric if w > 0.0 else law.eccentric_gain
    below = max(1.0 + law.concentric * w, (1.0 + law.concentric) * w) if w > 0.0 else 1.0 - law.eccentric * w
    return law.rate * above / below
