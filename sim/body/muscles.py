"""Muscle laws: active force-length, passive stress and force-velocity of octopus arm muscle.

The curves are polynomial fits to Zullo et al. (2022, *O. vulgaris*) as used by Tekinalp et al. (2024), shifted so that the arm's
rest shape is free of passive stress. A muscle of activation ``a``, stretch ``s`` and stretch rate ``s'`` carries the stress

    sigma = a sigma_max f_l(s) f_v(-s' / v_max) + sigma_passive(s)

on the *present* area, as a true stress: a fibre keeps its volume, so that one of rest area A pulls with A sigma(s) / s (the source
divides its internal forces by the stretch). Tension is positive. The polynomials hold between the stretches of `MuscleLaw.range`; outside
it the active curve ends at zero and the passive curve goes on along its tangent.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from ..contracts import Floats
from ..errors import check_number, check_numbers

SARCOMERE_STRESS = 280e3
"""Stress of a fully overlapping sarcomere, Pa (van Leeuwen & Kier 1997)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MuscleLaw:
    """Constants of one muscle group.

    Attributes
    ----------
    maximum_stress : float, Pa
        Isometric stress at full activation and f_l = 1.
    active, passive : tuple of 9 floats
        Polynomial coefficients of f_l and of the passive stress over `maximum_stress`, highest power first.
    slack : float
        Strain on either side of rest without passive stress.
    compression_modulus : float, Pa
        Slope of the passive stress in compression.
    passive_scale : float
        Factor on the passive stress in tension.
    maximum_rate : float, 1/s
        Shortening rate at which the active stress vanishes.
    curvature : float
        Hill's shape constant K of the shortening branch.
    eccentric_plateau : float
        f_v of fast lengthening.
    eccentric_slope : float
        Constant of the lengthening branch, 7.56 in van Leeuwen & Kier (1997, eq. 5).
    range : (float, float)
        Stretches between which the polynomials hold.

    Raises
    ------
    OctoctrlError
        If a constant is out of range, or a polynomial has not nine coefficients.
    """

    maximum_stress: float
    active: tuple[float, ...]
    passive: tuple[float, ...]
    compression_modulus: float
    slack: float = 0.025
    passive_scale: float = 1.0
    maximum_rate: float = 1.8
    curvature: float = 0.25
    eccentric_plateau: float = 1.8
    eccentric_slope: float = 7.56
    range: tuple[float, float] = field(default=(0.6, 1.8))

    def __post_init__(self) -> None:
        for name in ("active", "passive"):
            check_numbers(f"{name}, the coefficients of a law's polynomial,", getattr(self, name), 9, "(1, 0, 0, 0, 0, 0, 0, 0, 0)")
        check_numbers("range", self.range, 2, "(0.5, 1.5)")
        low, high = self.range
        check_number("begin of range", low, above=0.0, at_most=1.0)
        check_number("end of range", high, at_least=1.0)
        for name in ("maximum_stress", "compression_modulus"):
            check_number(name, getattr(self, name), at_least=0.0, at_most=1e8, unit="Pa")
        check_number("slack", self.slack, at_least=0.0)
        check_number("passive_scale", self.passive_scale, at_least=0.0, at_most=1e3)
        check_number("maximum_rate", self.maximum_rate, at_least=1e-3, at_most=1e3, unit="1/s")
        for name in ("curvature", "eccentric_slope"):
            check_number(name, getattr(self, name), at_least=1e-3, at_most=1e3)
        check_number("eccentric_plateau", self.eccentric_plateau, at_least=1.0, at_most=10.0)

    def stronger(self, factor: float) -> "MuscleLaw":
        """The same muscle with `factor` times the active stress; all that is passive stays."""
        return replace(self, maximum_stress=factor * self.maximum_stress, passive_scale=self.passive_scale / factor)

    def active_factor(self, stretch: ArrayLike) -> Floats:
        """Active force-length factor f_l >= 0 at `stretch`."""
        return np.maximum(0.0, np.polyval(self.active, np.clip(stretch, *self.range)))

    def passive_stress(self, stretch: ArrayLike) -> Floats:
        """Passive stress at `stretch`, Pa on the present area."""
        stretch = np.asarray(stretch, dtype=float)
        top = self.range[1]
        slope = np.polyval(np.polyder(self.passive), top)
        curve = np.polyval(self.passive, np.clip(stretch, 1.0, top)) + slope * np.maximum(stretch - top, 0.0)
        tension = self.maximum_stress * self.passive_scale * np.where(stretch > 1 + self.slack, np.maximum(curve, 0.0), 0.0)
        return tension + self.compression_modulus * np.minimum(stretch - 1 + self.slack, 0.0)

    def passive_energy(self, stretch: ArrayLike) -> Floats:
        """Passive energy per rest volume at `stretch` over that at rest, J/m^3.

        A fibre of rest area A at the stretch s pulls with A sigma(s) / s, so that this is the integral of sigma(s) / s.
        """
        found: Floats = np.interp(np.asarray(stretch, dtype=float), *_passive_energies(self))
        return found

    def velocity_factor(self, shortening: ArrayLike) -> Floats:
        """Hill factor f_v at the shortening rate over `maximum_rate` (negative while lengthening); never below zero."""
        w = np.asarray(shortening, dtype=float)
        fast = np.maximum(w, 0.0)
        slow = np.minimum(w, 0.0)
        concentric = (1 - fast) / (1 + fast / self.curvature)
        eccentric = self.eccentric_plateau - (self.eccentric_plateau - 1) * (1 + slow) / (1 - self.eccentric_slope * slow / self.curvature)
        return np.where(w > 0, np.maximum(concentric, 0.0), eccentric)

    def stress(self, stretch: ArrayLike, rate: ArrayLike = 0.0, activation: ArrayLike = 0.0) -> Floats:
        """Total stress at `stretch`, stretch `rate` (1/s) and `activation`, Pa on the present area."""
        active = np.asarray(activation, dtype=float) * self.maximum_stress * self.active_factor(stretch)
        return active * self.velocity_factor(-np.asarray(rate, dtype=float) / self.maximum_rate) + self.passive_stress(stretch)


@lru_cache(maxsize=32)
def _passive_energies(law: MuscleLaw) -> tuple[Floats, Floats]:
    """Stretches, and passive energies at them by the trapezoidal rule, J/m^3."""
    grid = np.linspace(0.1, 4.0, 78001)
    slope = law.passive_stress(grid) / grid
    total = np.concatenate([[0.0], np.cumsum((slope[1:] + slope[:-1]) / 2 * np.diff(grid))])
    return grid, total - np.interp(1.0, grid, total)


_ISOMETRIC = SARCOMERE_STRESS * (0.81 - 0.14) / (1.58 - 0.14)

LONGITUDINAL = MuscleLaw(
    maximum_stress=_ISOMETRIC,
    active=(
        -5.53265438704305, 61.33230278283245, -285.803140702435, 725.5618890776392, -1086.6197043379318,
        971.3646405512269, -501.5656006816741, 138.4647221578641, -16.276329452477576,
    ),
    passive=(
        -13.1324361826405, 182.62767615193317, -1089.1007813033896, 3631.242969652496, -7388.974887928677,
        9375.769188418119, -7227.6804650509675, 3089.404581277373, -560.1723677218586,
    ),
    compression_modulus=25e3,
)  # fmt: skip
"""Longitudinal, oblique and axial fibres (spec of Tekinalp et al. 2024: one set of curves for the three)."""

TRANSVERSE = MuscleLaw(
    maximum_stress=_ISOMETRIC,
    active=(
        -0.932520420479108, 12.516148988114901, -70.79641305183046, 218.8709522403458, -400.96573640732936,
        441.5430286821498, -284.40041005751306, 99.90355330191163, -14.989443345170805,
    ),
    passive=(
        4.8421289809374945, -62.21579111016296, 335.6305578884992, -986.1855331214203, 1712.712774014372,
        -1786.138996796871, 1088.842906084222, -355.16679907078185, 47.64498888807978,
    ),
    compression_modulus=10e3,
)  # fmt: skip
"""Transverse (ring) muscle."""
