"""Resistance of water in compiled code."""

import numpy as np

from ..compiler import kernel


@kernel
def braked(
    v1: float, v2: float, v3: float, t1: float, t2: float, t3: float, across: float, along: float, mobility: float
) -> tuple[float, float, float]:
    """Velocity after a step of quadratic drag, split into parts across and along the direction t of any length.

    `across` and `along` are the coefficients of either part, kg/m, and `mobility` is the step over the mass, s/kg. v / (1 + c |v| h) is the
    exact solution of v' = -c |v| v, so that a whipping tip, whose drag rate exceeds 1 / h, cannot be thrown back.
    """
    share = (v1 * t1 + v2 * t2 + v3 * t3) / (t1 * t1 + t2 * t2 + t3 * t3 + 1e-300)
    g1, g2, g3 = share * t1, share * t2, share * t3
    h1, h2, h3 = v1 - g1, v2 - g2, v3 - g3
    normal, tangent = across * np.sqrt(h1 * h1 + h2 * h2 + h3 * h3) * mobility, along * np.sqrt(g1 * g1 + g2 * g2 + g3 * g3) * mobility
    normal, tangent = normal / (1 + normal), tangent / (1 + tangent)
    return v1 - normal * h1 - tangent * g1, v2 - normal * h2 - tangent * g2, v3 - normal * h3 - tangent * g3
