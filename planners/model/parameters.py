"""The identified numbers of the reduced model."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from octoctrl.sim.errors import OctoctrlError, brief, check_number, suggest

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReducedParameters:
    """Factors on what follows from the arm and the water; as they stand by default, nothing was identified.

    Attributes
    ----------
    longitudinal_stress, oblique_stress, transverse_stress : float
        On the active stress of the groups.
    passive_stress : float
        On the tension of all passive tissue.
    oblique_passive : float
        On the passive stress of the oblique fibres, on top of that.
    compression : float
        On the compressive stress of all passive tissue.
    hoop_ratio : float
        On the exponent that couples radius to stretch.
    bending, torsion : float
        On the stiffness of the straight rods about their own axes.
    viscosity : float
        On Hill's viscosity.
    linear_drag, quadratic_drag, rotational_drag : float
        On the water's drag. Forces and drag share a scale in a model without inertia: keep one of them, by custom the linear drag, at 1.
    length_slope, length_curvature, passive_onset : float
        On the shape of the generic muscle laws; the known laws do not use them.
    ring_torsion : float
        Share of the torsional stiffness of a tube as thick as the layer of rings. In the full arm the rings keep the longitudinal muscles
        upright, and the layer does not taper, so that it stiffens the thin tip most. 0 in an arm of one rod.
    oblique_bending : float
        Share of the arm's bend that the oblique fibres feel as they wind from the outer to the inner side. In the full arm they stiffen it,
        most of all the tip, where they run almost along it. 0 in an arm of one rod, whose oblique fibres lie on the axis in bending.
    squeeze : float
        Share by which fully active oblique muscles narrow the base, without the arm getting longer: the layers of the full arm give way
        to each other. 0 in an arm of one rod.
    tone : float
        Level that the nerve cord, the longitudinal and the transverse muscles keep at rest. A property of the plant, never fitted.
    """

    longitudinal_stress: float = 1.0
    oblique_stress: float = 1.0
    transverse_stress: float = 1.0
    passive_stress: float = 1.0
    oblique_passive: float = 1.0
    compression: float = 1.0
    hoop_ratio: float = 1.0
    bending: float = 1.0
    torsion: float = 1.0
    viscosity: float = 1.0
    linear_drag: float = 1.0
    quadratic_drag: float = 1.0
    rotational_drag: float = 1.0
    length_slope: float = 1.0
    length_curvature: float = 1.0
    passive_onset: float = 1.0
    ring_torsion: float = 0.0
    oblique_bending: float = 0.0
    squeeze: float = 0.0
    tone: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            check_number(item.name, getattr(self, item.name), at_least=0.0)

    def vector(self) -> Floats:
        """The factors in the order of `FACTORS`, (len(FACTORS),) float64."""
        return np.array([getattr(self, name) for name in FACTORS], dtype=float)

    @classmethod
    def from_vector(cls, vector: ArrayLike) -> "ReducedParameters":
        """Inverse of `vector`."""
        return cls(**dict(zip(FACTORS, np.asarray(vector, dtype=float).tolist(), strict=True)))


FACTORS = tuple(item.name for item in fields(ReducedParameters))
"""Order of the factors in every vector of them."""

GENERIC_ONLY = ("length_slope", "length_curvature", "passive_onset")
"""Factors without effect on the known laws."""


def factor_indices(names: Sequence[str]) -> list[int]:
    """Positions of named factors.

    Raises
    ------
    OctoctrlError
        If a name is unknown; the message suggests the nearest.
    """
    for name in names:
        if name not in FACTORS:
            raise OctoctrlError(f"unknown factor '{brief(name)}'{suggest(name, FACTORS)} ({', '.join(FACTORS)})")
    return [FACTORS.index(name) for name in names]
