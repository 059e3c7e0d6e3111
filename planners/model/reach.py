"""What the arm can do at rest: equilibrium of the sections under constant levels, and the twist and turns within reach.

Without load from outside the internal force and moment vanish everywhere, so that each section is at equilibrium on its own: four
equations, a Newton iteration with the exact tangent of the fibres. Water does not enter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.errors import OctoctrlError, check_choice, check_number

Floats = NDArray[np.float64]

if TYPE_CHECKING:
    from .reduced import ReducedModel

TRUST = 0.1
"""Largest change of strain (curvature times fibre distance, or stretch) in one iteration."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachLimits:
    """Largest topology at rest under levels up to a bound.

    Attributes
    ----------
    level : float
        The bound.
    side : tuple of str
        Longitudinal muscles that bend.
    twist : dict of str to float, turns
        Stored by each oblique family alone, with its sign.
    turns : float, turns
        Bending of the arm by `side` alone: integral of curvature over 2 pi. A planar coil has at most as much writhe; telescoped on
        through its plane, its lifted writhe goes on towards twice the turns.
    writhe : float, turns
        Largest size of the lifted writhe at rest with `side` and one oblique family at any of the levels that were tried.
    length : (float, float), m
        Shortest (all longitudinal muscles) and longest (transverse muscle) length.
    """

    level: float
    side: tuple[str, ...]
    twist: dict[str, float]
    turns: float
    writhe: float
    length: tuple[float, float]


def equilibrium(model: "ReducedModel", levels: ArrayLike, start: ArrayLike | None = None) -> Floats:
    """Strains at rest under constant levels.

    Parameters
    ----------
    model : ReducedModel
    levels : (..., 11, S) array_like
    start : (..., S, 4) array_like, optional
        Where to begin; a section with several equilibria goes to the one downhill from there. Rest shape when omitted.

    Returns
    -------
    (..., S, 4) float64

    Raises
    ------
    OctoctrlError
        If a section finds no equilibrium.
    """
    from .dynamics import statics

    levels = np.asarray(levels, dtype=float)
    expected = (len(MUSCLE_GROUPS), model.sections)
    if levels.shape[-2:] != expected:
        raise OctoctrlError(f"levels has shape {levels.shape}; it must end in {expected}: muscle groups, sections")
    batch = levels.shape[:-2]
    u = np.moveaxis(levels, -1, -2).reshape(-1, len(MUSCLE_GROUPS))
    q = np.broadcast_to(model.rest if start is None else np.asarray(start, dtype=float), (*batch, model.sections, 4)).reshape(-1, 4).copy()
    forces = statics(model.structure).map(len(u) // model.sections)
    factors = np.repeat(model.parameters.vector()[:, None], len(u) // model.sections, axis=1)
    section = model.arm.section((model.edges[1:] + model.edges[:-1]) / 2)
    scale = np.ones((model.sections, 4))
    scale[:, :3] = 1 / section.muscle_offset[:, None]
    scale = np.tile(scale, (len(u) // model.sections, 1))
    trust, before = np.full(len(q), TRUST), np.full(len(q), np.inf)
    for _ in range(200):
        force, tangent = forces(q.T, u.T, factors)
        force = np.asarray(force).T * scale
        tangent = np.asarray(tangent).reshape(4, -1, 4).swapaxes(0, 1) * scale[:, :, None] * scale[:, None, :]
        size = np.linalg.norm(force, axis=1)
        trust = np.where(size > before, trust / 2, np.minimum(1.5 * trust, TRUST))
        before = size
        curvature, modes = np.linalg.eigh(tangent)
        floor = 1e-6 * np.abs(curvature).max(axis=1, keepdims=True)
        step = -np.einsum("bij,bj->bi", modes, np.einsum("bji,bj->bi", modes, force) / np.maximum(np.abs(curvature), floor))
        step *= np.minimum(1.0, trust / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
        q += step * scale
        if np.abs(step).max(initial=0.0) < 1e-11:
            return q.reshape(*batch, model.sections, 4)
    worst = int(np.argmax(np.abs(step).max(axis=1))) % model.sections
    raise OctoctrlError(f"section {worst} of {model.sections} finds no equilibrium at these levels; lower them or pass a nearer start")


def reach_limits(model: "ReducedModel", side: Sequence[str], level: float) -> ReachLimits:
    """Largest twist, turns, writhe and length at rest.

    Parameters
    ----------
    model : ReducedModel
    side : tuple of str
        Longitudinal muscles that bend.
    level : float
        Largest activation; 0.75 leaves a quarter to feedback.

    Returns
    -------
    ReachLimits

    Raises
    ------
    OctoctrlError
        If a muscle is unknown or the level lies outside 0…1.
    """
    check_number("level", level, above=0.0, at_most=1.0)
    for group in side:
        check_choice("muscle group", group, MUSCLE_GROUPS)
    tried = level * np.array([0.25, 0.5, 0.75, 1.0])
    cases = []
    for hand in ("R-OM", "L-OM"):
        cases += [{hand: value} for value in tried]
    cases += [dict.fromkeys(side, value) for value in tried]
    mixed = len(cases)
    for hand in ("R-OM", "L-OM"):
        cases += [dict.fromkeys(side, bend) | {hand: twist} for bend in tried for twist in tried * 0.5]
    cases += [dict.fromkeys(MUSCLE_GROUPS[:8], level), {"TM": level}]
    levels = np.zeros((len(cases), len(MUSCLE_GROUPS), model.sections))
    for row, case in zip(levels, cases, strict=True):
        for group, value in case.items():
            row[MUSCLE_GROUPS.index(group)] = value
    strains = equilibrium(model, levels)
    twists = strains[..., 2] @ model.shares * model.arm.length / (2 * np.pi)
    turns = np.linalg.norm(strains[..., :2], axis=-1) @ model.shares * model.arm.length / (2 * np.pi)
    stretch = strains[..., 3] @ model.shares
    mean_bend = strains[mixed - 1, :, :2].sum(axis=0)
    base1, base2 = model.frames(model.rest, [0.0, model.arm.length])[0, :2]
    pole = mean_bend[0] * base1 + mean_bend[1] * base2
    writhe = model.outputs(strains[mixed:-2], pole / np.linalg.norm(pole))[0][:, 1]
    return ReachLimits(
        level=level,
        side=tuple(side),
        twist={"R-OM": float(twists[:4].min()), "L-OM": float(twists[4:8].max())},
        turns=float(turns[8:12].max()),
        writhe=float(np.abs(writhe).max()),
        length=(float(stretch.min() * model.arm.length), float(stretch.max() * model.arm.length)),
    )
