"""Forces and torques on the arm from outside: at a place or spread, along fixed directions or following it, held or given by a function.

    scene = Scene(loads=(PointLoad(force=(0.0, 0.0, -0.01)),))                      # a dead weight at the tip
    PointLoad(arclength=0.1, force=lambda time: (0.01 * sin(6 * time), 0.0, 0.0))   # a shaker at mid-length
    SpreadLoad(force=(0.02, 0.0, 0.0), window=(0.1, 0.2), follower=True)            # a pressure across the distal half

What a load becomes for a plant is decided here, once: forces on nodes and torques on elements, in the lab frame and in that of the element.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from typing import Protocol

import numpy as np

from ..annotations import settle
from ..contracts import Floats
from ..errors import OctoctrlError, check_number, check_window

Vector = tuple[float, float, float]
Varying = Vector | Callable[[float], Sequence[float]]
"""A vector, or a function of time (s) that gives one."""

STILL = (0.0, 0.0, 0.0)

FORCE, TORQUE, NEAR, FAR, TWIST = range(5)
"""Rows of sampled loads: lab force on nodes; lab torque on elements; force in an element's frame on its near and on its far node; torque in
an element's frame."""


class Load(Protocol):
    """What acts on the arm from outside; `PointLoad` and `SpreadLoad` are two."""

    def add_to(self, total: Floats, times: Floats, edges: Floats) -> None:
        """Add what it is at `times` (T,), s, on the n elements between `edges`, m, to `total` (T, 5, 3, n + 1); see `FORCE` and on."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PointLoad:
    """A force and a torque at one place of the arm.

    Attributes
    ----------
    arclength : float or None, m
        Rest arclength; None is the tip.
    force : (float, float, float), N, or callable
        Or a function of time that gives it, linear in between the samples of the plant.
    torque : (float, float, float), N m, or callable
    follower : bool
        Whether components are along the directors d1, d2, d3 of the section and turn with it, instead of along x, y, z.

    Raises
    ------
    OctoctrlError
        If a number is not finite.
    """

    arclength: float | None = None
    force: Varying = STILL
    torque: Varying = STILL
    follower: bool = False

    def __post_init__(self) -> None:
        if self.arclength is not None:
            check_number("load: arclength", self.arclength, at_least=0.0, unit="m")
        _settle(self)

    def add_to(self, total: Floats, times: Floats, edges: Floats) -> None:
        """See `Load.add_to`."""
        if self.arclength is None:
            _add(self, total[..., -2:], times, 0.0, 1.0)
            return
        place = self.arclength
        if place > edges[-1] * (1 + 1e-9):
            raise OctoctrlError(f"load at {place:g} m: the arm ends at {edges[-1]:g} m; leave arclength out for its tip")
        element = min(int(edges.searchsorted(place, side="right")), len(edges) - 1) - 1
        far = min(float((place - edges[element]) / (edges[element + 1] - edges[element])), 1.0)
        _add(self, total[..., element : element + 2], times, 1 - far, far)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpreadLoad:
    """A force and a torque per length over a part of the arm.

    Attributes
    ----------
    force : (float, float, float), N/m, or callable
        Per rest length; or a function of time that gives it, linear in between the samples of the plant.
    torque : (float, float, float), N m/m, or callable
    window : (float, float), m
        Rest arclengths between which it acts.
    follower : bool
        Whether components are along the directors d1, d2, d3 of the sections and turn with them, instead of along x, y, z.

    Raises
    ------
    OctoctrlError
        If a number is not finite, or the window is empty.
    """

    force: Varying = STILL
    torque: Varying = STILL
    window: tuple[float, float] = (0.0, inf)
    follower: bool = False

    def __post_init__(self) -> None:
        check_window("load", self.window)
        _settle(self)

    def add_to(self, total: Floats, times: Floats, edges: Floats) -> None:
        """See `Load.add_to`."""
        low, high = np.clip(edges[:-1], *self.window), np.clip(edges[1:], *self.window)
        length, middle = high - low, (high + low) / 2
        far = length * (middle - edges[:-1]) / np.diff(edges)
        _add(self, total, times, length - far, far)


def checked_loads(loads: object) -> tuple[Load, ...]:
    """Loads as a tuple.

    Raises
    ------
    OctoctrlError
        If it is no sequence of loads.
    """
    listed = tuple(loads) if isinstance(loads, tuple | list) else (loads,)
    for load in listed:
        if not callable(getattr(load, "add_to", None)):
            raise OctoctrlError(f"loads: {type(load).__name__} {load!r} is none; give a tuple of PointLoad and SpreadLoad")
    return listed


def sampled_loads(loads: Sequence[Load], times: Floats, edges: Floats) -> Floats | None:
    """All loads together at the samples, None if there are none.

    Parameters
    ----------
    loads : sequence of Load
    times : (T,) float64, s
    edges : (n + 1,) float64, m

    Returns
    -------
    (T, 5, 3, n + 1) float64 or None
        See `FORCE` and what follows it; rows of elements leave their last column empty. (T, 2, 3, n + 1) if nothing follows the arm.

    Raises
    ------
    OctoctrlError
        If a load has no place on the arm, or its function gives no three finite numbers.
    """
    if not loads:
        return None
    follows = any(getattr(load, "follower", True) for load in loads)
    total = np.zeros((len(times), 5 if follows else NEAR, 3, len(edges)))
    for load in loads:
        load.add_to(total, times, edges)
    return total


def _settle(load: PointLoad | SpreadLoad) -> None:
    """Check the fields of a load and keep its vectors as tuples."""
    settle(load)
    for name in ("force", "torque"):
        value = getattr(load, name)
        if not callable(value):
            object.__setattr__(load, name, tuple(_vector(name, value).tolist()))


def _vector(name: str, value: object) -> Floats:
    try:
        vector = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        vector = np.empty(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise OctoctrlError(f"load: {name} is {value!r}; three finite numbers are needed, or a function of time that gives them")
    return vector


def _over(name: str, value: Varying, times: Floats) -> Floats:
    """A vector over time (T, 3, 1), or what is the same at all times (3, 1)."""
    if callable(value):
        return np.array([_vector(name, value(float(time))) for time in times])[:, :, None]
    return np.array(value)[:, None]


def _add(load: PointLoad | SpreadLoad, total: Floats, times: Floats, near: Floats | float, far: Floats | float) -> None:
    """Add a load that acts with weights (n,) of its force on the near and far nodes of elements, and of both on the elements."""
    if load.torque != STILL:
        total[:, TWIST if load.follower else TORQUE, :, :-1] += _over("torque", load.torque, times) * (near + far)
    if load.force == STILL:
        return
    force = _over("force", load.force, times)
    back, front = (NEAR, FAR) if load.follower else (FORCE, FORCE)
    if not isinstance(near, float) or near:
        total[:, back, :, :-1] += force * near
    total[:, front, :, slice(None, -1) if load.follower else slice(1, None)] += force * far
