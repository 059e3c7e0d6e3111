"""Topology and tip pose of the reduced model as smooth CasADi functions.

References
----------
Fuller (1978) and Starostin (2005): writhe of a curve with end rays as the area swept by its tangent.
"""

from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from octoctrl.sim.body.arm import Arm

from .kinematics import BASE_FRAME, element_stations, hat_means, section_bounds


def exponential(vector: Any, angle: Any) -> Any:
    """Rotation matrix exp([v]x) as a CasADi expression; `angle` is its size, kept away from zero."""
    cross = ca.skew(vector)
    return ca.SX.eye(3) + ca.sin(angle) / angle * cross + 2 * (ca.sin(angle / 2) / angle) ** 2 * (cross @ cross)


@lru_cache(maxsize=8)
def outputs(arm: Arm, sections: int) -> ca.Function:
    """Topology and tip pose as a smooth `casadi.Function`, by the same formula that measures the plant.

    Parameters
    ----------
    arm : Arm
        Its elements' stations carry the frames.
    sections : int

    Returns
    -------
    casadi.Function
        ``(strains (4, S), pole (3,)) -> twist, lifted_writhe, lifted_link (turns), length (m), tip (3, m), tip_frame (3, 3; columns d1, d2,
        d3), uturn (1 + t_tip . t_base)``. The pole must not be antiparallel to a tangent.

    Notes
    -----
    With w_i the rotation vector from station i to i + 1 and Omega the signed area of a spherical triangle,

        twist = sum of w3 / 2 pi
        lifted link = [sum of Omega(p, t_i, t_i+1) + Omega(p, t_m, t_0) + sum of 2 atan2(w3 / |w| sin(|w| / 2), cos(|w| / 2))] / 2 pi

    which is exact for strains that are constant between stations. The lifted writhe is the difference; it passes smoothly through
    self-crossings, at each of which the Gauss writhe jumps by two.
    """
    q, pole = ca.SX.sym("strains", 4, sections), ca.SX.sym("pole", 3)
    edges, bounds = arm.edges, section_bounds(arm, sections)
    stations, lengths = element_stations(edges), np.diff(edges)
    turns = q[:3, :] @ ca.DM((hat_means(stations, bounds) * np.diff(stations)[:, None]).T)
    extents = q[3, :] @ ca.DM((hat_means(edges, bounds) * lengths[:, None]).T)
    frame = ca.SX(ca.DM(BASE_FRAME.T))
    base = tangent = frame[:, 2]
    tip, area, spin = ca.SX.zeros(3), ca.SX(0), ca.SX(0)
    for index in range(arm.elements + 1):
        vector = turns[:, index]
        angle = ca.sqrt(ca.sumsqr(vector) + 1e-14)
        frame = frame @ exponential(vector, angle)
        before, tangent = tangent, frame[:, 2]
        area += _triangle(pole, before, tangent)
        spin += 2 * ca.atan2(vector[2] / angle * ca.sin(angle / 2), ca.cos(angle / 2))
        if index < arm.elements:
            tip += tangent * extents[index]
    twist = ca.sum2(turns[2, :]) / (2 * np.pi)
    link = (area + _triangle(pole, tangent, base) + spin) / (2 * np.pi)
    total = ca.sum2(extents)
    names = ["twist", "lifted_writhe", "lifted_link", "length", "tip", "tip_frame", "uturn"]
    return ca.Function(
        "outputs", [q, pole], [twist, link - twist, link, total, tip, frame, 1 + ca.dot(base, tangent)], ["strains", "pole"], names
    )


def _triangle(a: ca.SX, b: ca.SX, c: ca.SX) -> ca.SX:
    """Signed area of the spherical triangle of three unit vectors."""
    return 2 * ca.atan2(ca.dot(a, ca.cross(b, c)), 1 + ca.dot(a, b) + ca.dot(b, c) + ca.dot(c, a))
