"""What holds an elastic rod: clamps of its ends, pins and rails of its nodes, at rest or driven along a path in time.

A clamp holds the frame *beyond* an end, with bending over the half element in between, which is second order in the element length. Driven
supports follow a path exactly at the end of every block of steps; in between their rates are a parabola that begins and ends at the path's.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contracts import Floats
from ..errors import OctoctrlError, check_choice
from ..rotations import rotation_matrix, rotation_vector
from .rod import check_frames, finite_array, unit_vector

Path = ArrayLike | Callable[[float], ArrayLike] | tuple[ArrayLike, ArrayLike]
"""A fixed value, a function of time (s), or a pair of times (T,) and values (T, ...), between which is interpolated."""

INSTANT = 1e-6
"""Time (s) over which the rate of a path is measured."""
LARGEST_TURN = 1.0
"""Angle (rad) by which a path may turn within one block of steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Clamp:
    """Hold an end: its node and the frame beyond it.

    Attributes
    ----------
    end : {"base", "tip"}
    point : Path of (3,) float64, m, or None
        Where the node is; None is where it is when the motion begins.
    frame : Path of (3, 3) float64, or None
        Directors as rows; None is the frame of the end element at rest.
    slides : (3,) array_like or None
        Direction in which the node is free to slide.

    Raises
    ------
    OctoctrlError
        If the end is unknown, or a value has the wrong shape.
    """

    end: str
    point: Path | None = None
    frame: Path | None = None
    slides: ArrayLike | None = None

    def __post_init__(self) -> None:
        check_choice("end", self.end, ("base", "tip"))
        _check_path("point", self.point, (3,))
        _check_path("frame", self.frame, (3, 3))
        if self.slides is not None:
            object.__setattr__(self, "slides", unit_vector("slides", self.slides))


@dataclass(frozen=True, slots=True, kw_only=True)
class Pin:
    """Hold a node, about which the rod turns freely.

    Attributes
    ----------
    node : int
        Negative ones count from the tip.
    point : Path of (3,) float64, m, or None
        Where it is; None is where it is when the motion begins.
    slides : (3,) array_like or None
        Direction in which it is free to slide.

    Raises
    ------
    OctoctrlError
        If a value has the wrong shape.
    """

    node: int
    point: Path | None = None
    slides: ArrayLike | None = None

    def __post_init__(self) -> None:
        _check_path("point", self.point, (3,))
        if self.slides is not None:
            object.__setattr__(self, "slides", unit_vector("slides", self.slides))


Support = Clamp | Pin


class HeldRows(NamedTuple):
    """Supports for the compiled loop, over the blocks of steps of one call; row 0 of a path that does not move serves all blocks.

    `moves`, `slides` and `tip` say whether anything is driven, whether a node slides, and whether the tip is clamped. `nodes` (M,) uint64
    counts from 1; `rails` (M, 3) are directions in which they slide, or zero; `ghosts` (G,) uint64 are the places of the frames beyond the
    ends. `*_rates` (B + 1, ., 3) at the knots between blocks, in the lab frame for nodes and material for frames, `*_moves` (B, ., 3) the
    way in each block, `points` (B + 1, M, 3) and `frames` (B + 1, G, 3, 3) where they are then.
    """

    moves: bool
    slides: bool
    tip: bool
    nodes: NDArray[np.uint64]
    rails: Floats
    points: Floats
    point_rates: Floats
    point_moves: Floats
    ghosts: NDArray[np.uint64]
    frames: Floats
    frame_rates: Floats
    frame_moves: Floats


class Holding:
    """The supports of one rod as functions of time.

    Parameters
    ----------
    supports : sequence of Support
    elements : int
    points : (n + 1, 3) float64, m
        Of the rod when it is taken hold of.
    frames : (2, 3, 3) float64
        Of its ends.

    Raises
    ------
    OctoctrlError
        If a node does not exist, or two supports hold the same.
    """

    def __init__(self, supports: Sequence[Support], elements: int, points: Floats, frames: Floats) -> None:
        nodes, rails, self._points = [], [], []
        ghosts, self._frames = [], []
        for support in supports:
            if not isinstance(support, Clamp | Pin):
                raise OctoctrlError(f"supports: found {type(support).__name__}; Clamp and Pin are known")
            tip = isinstance(support, Clamp) and support.end == "tip"
            wanted = support.node if isinstance(support, Pin) else (-1 if tip else 0)
            if isinstance(wanted, bool) or not isinstance(wanted, int | np.integer) or not -elements - 1 <= wanted <= elements:
                raise OctoctrlError(f"node={wanted} is pinned; the rod has nodes 0…{elements}")
            node = wanted % (elements + 1)
            if node in nodes:
                raise OctoctrlError(f"node {node} is held by two supports; one is needed")
            nodes.append(node)
            rails.append(np.zeros(3) if support.slides is None else support.slides)
            self._points.append(_as_function(points[node] if support.point is None else support.point, _between))
            if isinstance(support, Clamp):
                ghosts.append(elements + 1 if tip else 0)
                self._frames.append(_as_function(frames[int(tip)] if support.frame is None else support.frame, _turned_between))
        self.nodes, self.ghosts = np.array(nodes, dtype=np.uint64) + np.uint64(1), np.array(ghosts, dtype=np.uint64)
        self.rails = np.array(rails).reshape(-1, 3)
        self.driven = any(
            callable(path) or isinstance(path, tuple)
            for support in supports
            for path in ((support.point, support.frame) if isinstance(support, Clamp) else (support.point,))
        )

    def at(self, knots: Floats) -> HeldRows:
        """Rows for blocks of steps between the times `knots` (B + 1,), s."""
        if not self.driven:
            knots = knots[:1]
        points, before, after = (self._placed(knots + shift) for shift in (0.0, -INSTANT, INSTANT))
        frames, back, ahead = (self._turned(knots + shift) for shift in (0.0, -INSTANT, INSTANT))
        moves = _turn(frames[:-1], frames[1:])
        fastest = np.linalg.norm(moves, axis=-1).max(initial=0.0)
        if fastest > LARGEST_TURN:
            raise OctoctrlError(f"a support turns by {fastest:.2g} rad between two knots of its path near t={knots[0]:.4g} s; halve dt")
        parts = max(len(knots) - 1, 1)
        still = np.zeros((1, len(self.nodes), 3)), np.zeros((1, len(self.ghosts), 3))
        return HeldRows(
            moves=self.driven,
            slides=bool(self.rails.any()),
            tip=bool(self.ghosts.any()),
            nodes=self.nodes,
            rails=self.rails,
            points=points,
            point_rates=(after - before) / (2 * INSTANT),
            point_moves=(np.diff(points, axis=0) if self.driven else still[0]).reshape(parts, -1, 3),
            ghosts=self.ghosts,
            frames=frames,
            frame_rates=_turn(back, ahead) / (2 * INSTANT),
            frame_moves=moves if self.driven else still[1],
        )

    def _placed(self, times: Floats) -> Floats:
        return np.array([[finite_array("point of a support", path(t), (3,)) for path in self._points] for t in times]).reshape(
            len(times), -1, 3
        )

    def _turned(self, times: Floats) -> Floats:
        found = [[finite_array("frame of a support", path(t), (3, 3)) for path in self._frames] for t in times]
        frames = np.array(found).reshape(len(times), -1, 3, 3)
        check_frames("frame of a support", frames)
        return frames


def _turn(before: Floats, after: Floats) -> Floats:
    """Material rotation vectors that take frames to frames."""
    return rotation_vector(after @ np.swapaxes(before, -1, -2))


def _as_function(path: Path, between: Callable[[Floats, Floats, float], Floats]) -> Callable[[float], ArrayLike]:
    if callable(path):
        return path
    table = _table(path)
    if table is None:
        return partial(_fixed, np.asarray(path, dtype=float))
    return partial(between, np.asarray(table[0], dtype=float), np.asarray(table[1], dtype=float))


def _table(path: ArrayLike | tuple[ArrayLike, ArrayLike]) -> tuple[Any, Any] | None:
    """Times and values of a path that is given as such."""
    if isinstance(path, tuple) and len(path) == 2 and np.ndim(path[0]) == 1 and np.ndim(path[1]) > 1:
        return path[0], path[1]
    return None


def _fixed(value: Floats, t: float) -> Floats:
    return value


def _between(times: Floats, values: Floats, t: float) -> Floats:
    return np.array([np.interp(t, times, column) for column in values.T])


def _turned_between(times: Floats, values: Floats, t: float) -> Floats:
    k = int(np.clip(np.searchsorted(times, t) - 1, 0, len(times) - 2))
    share = np.clip((t - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0)
    return rotation_matrix(share * _turn(values[k], values[k + 1])) @ values[k]


def _check_path(name: str, path: Path | None, shape: tuple[int, ...]) -> None:
    """What can be checked before the motion begins: fixed values, and tables of times and values."""
    if path is None or callable(path):
        return
    table = _table(path)
    if table is None:
        values = finite_array(name, cast(ArrayLike, path), shape)
    else:
        times = finite_array(f"times of {name}", table[0], (np.size(table[0]),))
        values = finite_array(name, table[1], (times.size, *shape))
        if times.size < 2 or np.any(np.diff(times) <= 0):
            raise OctoctrlError(f"times of {name}: at least 2 are needed, each later than the one before")
    if shape == (3, 3):
        check_frames(name, values)
