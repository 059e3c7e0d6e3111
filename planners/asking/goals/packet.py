"""Where the packet of bending is, m of arclength."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...contracts import Expression, Floats, Outputs
from ..registry import register_goal
from .measured import ScalarGoal, bending

POINTS, POWER = 81, 4
"""Points at which the bending strain is read, and the power of it that is its weight: high enough to see the packet alone."""


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class PacketGoal(ScalarGoal):
    """Arclength of the packet: the centroid of (r |k|)^4, on 81 points.

    The bending strain r |k| is weighed and not the curvature, which would find the thin tip.
    """

    quantity: ClassVar[str] = "packet"
    unit: ClassVar[str] = "m"
    steered: ClassVar[bool] = False  # levels say how strongly the arm bends, not where
    timed: ClassVar[bool] = True
    tolerance: float = 0.008

    def read(self, outputs: Outputs) -> Expression:
        """Rest arclength, (T,), m."""
        points = places(outputs)
        weights = bending_strain(outputs) ** POWER
        return (weights @ points) / (weights @ np.ones(POINTS))


def places(outputs: Outputs) -> Floats:
    """Rest arclengths (POINTS,), m, at which `bending_strain` is read: evenly from base to tip."""
    return np.linspace(outputs.stations[0], outputs.stations[-1], POINTS)


def bending_strain(outputs: Outputs) -> Expression:
    """Bending strain r |k| with the nominal radius, (T, POINTS): linear between the middles of the gaps between the stations."""
    stations, points = outputs.stations, places(outputs)
    middles = (stations[1:] + stations[:-1]) / 2
    radius = outputs.arm.base_radius * outputs.arm.section(points).outline
    return bending(outputs) @ (np.stack([np.interp(points, middles, unit) for unit in np.eye(len(middles))]) * radius)
