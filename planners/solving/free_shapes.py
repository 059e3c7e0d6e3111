"""Where an arm comes to lie in free water, in closed form: quick enough to choose among hundreds of programmes which to simulate.

Muscles bend an arm by a curvature that goes with 1/radius, up to what its own stiffness allows, whatever the place; twist goes by the curve
that was measured. What an object does to the arm is left out, but for whether the arm would have to pass through it on its way, which is
told from shapes at rest at some instants of it: a simulation judges what is chosen here.
"""

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS, Arm, azimuth
from octoctrl.sim.contact.hold import FADES
from octoctrl.sim.contact.measures import gaps, turns
from octoctrl.sim.scene.objects import Capsule, Cylinder, RigidObject, frame_of

from ..asking.wrapping import TwistCurve
from ..model.kinematics import element_points, element_stations, integrate_frames

Floats = NDArray[np.float64]

BENDS = (0.0, 0.03, 0.06, 0.1, 0.2, 0.3, 0.5, 0.8), (0.0, 0.075, 0.15, 0.235, 0.305, 0.34, 0.375, 0.4)
"""Levels of longitudinal muscles towards one side, and curvature times radius at which the rod then rests: mean of 30 to 170 mm."""

PAST = 0.01
"""How far beyond an end of an object an arm comes by, m."""


def free_points(levels: Floats, arm: Arm, curve: TwistCurve) -> Floats:
    """Nodes of an arm that rests at constant levels and touches nothing.

    Parameters
    ----------
    levels : (M, 11, n) float64
        Of M programmes, in the order of `MUSCLE_GROUPS`, by element.
    arm : Arm
    curve : TwistCurve
        What levels of oblique families store.

    Returns
    -------
    (M, n + 1, 3) float64, m
    """
    edges = np.asarray(arm.edges)
    radius = np.asarray(arm.section((edges[1:] + edges[:-1]) / 2).outer_radius)
    along = [MUSCLE_GROUPS.index(name) for name in LONGITUDINAL_GROUPS]
    towards = np.exp(1j * np.array([azimuth(name) for name in LONGITUDINAL_GROUPS]))
    # Muscles that share a level by the cosine add up to twice it where there are eight.
    pull = np.einsum("mgk,g->mk", levels[:, along], towards) / (len(along) / 4)
    size = np.abs(pull)
    bend = np.interp(size, *BENDS) / radius * pull / np.maximum(size, 1e-12)
    stored = [np.interp(levels[:, MUSCLE_GROUPS.index(name)], curve.levels, curve.turns) for name in ("L-OM", "R-OM")]
    strains = np.stack([-bend.real, bend.imag, 2 * np.pi * (stored[0] - stored[1]), np.ones_like(size)], axis=-1)
    frames = integrate_frames(strains, element_stations(edges), edges)
    return element_points(strains, frames, edges, edges)


def turns_near(points: Floats, arm: Arm, item: RigidObject) -> Floats:
    """Turns (M,) of an arm with the nodes `points` (M, n + 1, 3), m, about an object, each element's the less the farther off it is.

    As `octoctrl.sim.contact.hold.Hold.near`, for shapes of which there are no recordings.
    """
    count, edges = len(points), np.asarray(arm.edges)
    radius = np.asarray(arm.section((edges[1:] + edges[:-1]) / 2).outer_radius)
    position, frame = np.tile(np.asarray(item.position, dtype=float), (count, 1)), np.tile(frame_of(item), (count, 1, 1))
    gap = gaps((points[:, 1:] + points[:, :-1]) / 2, item, position, frame) - radius
    return np.asarray(np.abs((turns(points, position, frame) * np.exp(-np.maximum(gap, 0.0) / FADES)).sum(axis=1)))


def last_free(points: Floats, item: RigidObject) -> NDArray[np.int64]:
    """Last of K instants to which arms come from rest without passing through the axis of an object, within its length.

    Between two instants an arm has passed through it if the turns from the base to one of its nodes have changed by more than a half.

    Parameters
    ----------
    points : (M, K, n + 1, 3) float64, m
        Nodes of M arms, at rest at the first instant.
    item : RigidObject

    Returns
    -------
    (M,) int64
    """
    count, instants = points.shape[:2]
    position, frame = np.asarray(item.position, dtype=float), frame_of(item)
    flat = points.reshape(-1, *points.shape[2:])
    turned = turns(flat, np.tile(position, (len(flat), 1)), np.tile(frame, (len(flat), 1, 1))).reshape(count, instants, -1)
    passed = np.abs(np.diff(turned.cumsum(axis=2), axis=1)) > 0.5
    if isinstance(item, Capsule | Cylinder):
        # Where the first node beyond the crossing is: past the end of a post an arm comes by.
        along = np.abs((points[:, 1:, 1:] - position) @ frame[2])
        first = np.take_along_axis(along, passed.argmax(axis=2)[..., None], axis=2)[..., 0]
        passed &= (first < item.length / 2 + PAST)[..., None]
    crossed = np.asarray(np.any(passed, axis=2))
    return np.where(crossed.any(axis=1), crossed.argmax(axis=1), instants - 1)
