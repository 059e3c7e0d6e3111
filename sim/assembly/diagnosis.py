"""Why an assembly diverged, in physical terms, from the state in which the guard stopped it."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SQUEEZED = 0.75
"""Share of its rest radius below which a ring counts as squeezed: the published programmes stay above 0.85."""
BUCKLED = 0.5
"""Deflection of the nerve cord from the middle of its muscles, in radii of the cord, from which it counts as buckled."""


def cause(straight: Floats, rings: Floats, rest_radius: Floats, cord_radius: Floats) -> str:
    """The most likely cause of a divergence and what to do, as a part of a sentence.

    Parameters
    ----------
    straight : (R, N + 1, 3) float64, m
        Nodes of the nerve cord and of the longitudinal muscles.
    rings : (N, nodes, 3) float64, m
    rest_radius : (N,) float64, m
        Of the rings' middle lines.
    cord_radius : (N,) float64, m

    Returns
    -------
    str
    """
    radius = np.linalg.norm(rings - rings.mean(axis=1, keepdims=True), axis=2).mean(axis=1) / rest_radius
    radius = np.where(np.isfinite(radius), radius, np.inf)
    tightest = int(radius.argmin())
    if radius[tightest] < SQUEEZED:
        return (
            f"ring {tightest} is squeezed to {radius[tightest]:.0%} of its radius, the arm is crushed or kinks there: more than "
            "the contacts between its layers hold - lower the levels, or raise them for a shorter time"
        )
    off = np.linalg.norm(straight[0] - straight[1:].mean(axis=0), axis=1)[1:] / cord_radius
    off = np.where(np.isfinite(off), off, -np.inf)
    furthest = int(off.argmax())
    if off[furthest] > BUCKLED:
        return (
            f"the nerve cord has buckled between the contracted muscles (element {furthest}, {off[furthest]:.1f} of its radius off the "
            "middle) - lower the longitudinal level"
        )
    return "most likely a sudden activation - smooth it (ramp >= 20 ms) or halve dt"
