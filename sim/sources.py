"""Sources of activation that are not composed of templates, and the one entrance by which levels reach a plant.

A source answers ``levels(times, edges)`` for any partition of the arm, for a plant may have several: the muscles along the arm and the
helices around it have cells of their own. `sampled` asks once for each partition and lets nothing through that the compiled code could
not read: every plant takes its levels from there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from .annotations import settle
from .body.layout import OCTOPUS_MUSCLES, Family, MuscleLayout
from .contracts import ActivationSource, Floats
from .errors import OctoctrlError, brief, check_number, suggest
from .templates import raised_cosine

ROUNDING = 1e-12
"""By how much sums of levels may exceed 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """Levels that stay as they are.

    Attributes
    ----------
    held : (groups,) or (groups, n) float64
        One level for each muscle group, or one for each and every cell.
    edges : (n + 1,) float64, m
        Of those cells; cells of another partition get the mean of what they cover.
    layout : MuscleLayout
        Of the arm.

    Raises
    ------
    OctoctrlError
        If the shapes do not fit, or a level is not in [0, 1].
    """

    held: Floats
    edges: Floats | None = None
    layout: MuscleLayout = field(default=OCTOPUS_MUSCLES, repr=False)

    def __post_init__(self) -> None:
        held, count = _as_levels("levels", self.held), len(self.layout)
        if held.shape == (count, 1):
            held = held[:, 0]
        cells = None if self.edges is None else len(self.edges) - 1
        if held.shape not in ((count,), (count, cells)):
            wanted = f"({count},)" if cells is None else f"({count},) or ({count}, {cells})"
            without = "; levels by cell also need the edges of the cells" if cells is None and held.ndim == 2 else ""
            raise OctoctrlError(f"levels of shape {held.shape} are held; {wanted} is needed{without}")
        _check_range(held, "held")
        object.__setattr__(self, "held", held)

    @classmethod
    def of(
        cls, answer: ArrayLike | Mapping[str, float | ArrayLike], edges: Floats, who: str = "levels", layout: MuscleLayout = OCTOPUS_MUSCLES
    ) -> "Held":
        """Make one from what a person or a controller gives.

        Parameters
        ----------
        answer : (groups,), (groups, 1) or (groups, n) array_like, or dict of str to float or (n,) array_like
            Of a dict, groups that are not named are not active.
        edges : (n + 1,) float64, m
            Cells that n counts.
        who : str
            Who gave it, for the message.
        layout : MuscleLayout
            Of the arm.

        Returns
        -------
        Held

        Raises
        ------
        OctoctrlError
            If it is none of these, names a group that is unknown, or a level is not in [0, 1].
        """
        names, count, cells = layout.names, len(layout), len(edges) - 1
        if isinstance(answer, Mapping):
            levels = np.zeros((count, cells))
            for group, level in answer.items():
                if group not in names:
                    listed = ", ".join(names)
                    raise OctoctrlError(f"{who}: there is no muscle group '{group}'{suggest(str(group), names)} ({listed})")
                one = _as_levels(f"{who}: {group}", level)
                if one.shape not in ((), (1,), (cells,)):
                    raise OctoctrlError(f"{who}: {group} has shape {one.shape}; one level or {cells}, one for each cell, are needed")
                levels[names.index(group)] = one
        else:
            levels = _as_levels(who, answer)
            if levels.shape not in ((count,), (count, 1), (count, cells)):
                raise OctoctrlError(
                    f"{who}: shape {levels.shape}; ({count},), ({count}, n) or a dict of group to level is needed, "
                    f"n = {cells} cells of the arm"
                )
        _check_range(levels, who)
        made = object.__new__(cls)  # checked already
        for name, value in (("held", levels[:, 0] if levels.shape == (count, 1) else levels), ("edges", edges), ("layout", layout)):
            object.__setattr__(made, name, value)
        return made

    def levels(self, times: Floats, edges: Floats) -> Floats:
        """Levels (T, groups, m) at `times`, s, in the m cells between `edges`, m."""
        return self.over(len(times), edges)

    def over(self, instants: int, edges: Floats) -> Floats:
        """Levels (instants, groups, m) in the m cells between `edges`, m."""
        held, cells = self.held, len(edges) - 1
        if held.ndim == 2 and self.edges is not None and self.edges is not edges and not np.array_equal(self.edges, edges):
            held = np.clip(held @ _overlap(self.edges, np.asarray(edges, dtype=float)), 0.0, 1.0)
        found = np.empty((instants, len(held), cells))
        found[:] = held if held.ndim == 2 else held[:, None]
        return found


class Places(Protocol):
    """Where corrections act along the arm."""

    def shares(self, times: Floats, edges: Floats) -> Floats:
        """Share (T, corrections, n) in which each reaches the n cells between `edges`, m, at the readings `times`, s, of the clock."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Corrected:
    """An activation on a clock of its own, plus a correction of some groups that is linear in time over one period.

    Attributes
    ----------
    activation : ActivationSource
    begin : float, s
        Time of the plant at which the period begins.
    period : float, s
    clock : (float, float), s
        Readings of the activation's clock at the begin and at the end of the period; equal while a phase waits.
    groups : tuple of str
        Which are corrected; one may be named several times, for several places.
    before, after : (groups,) float64
        Corrections at the begin and at the end; what they lead to is kept within [0, 1].
    places : Places, optional
        Where along the arm each of them acts; everywhere if omitted.
    layout : MuscleLayout
        Of the arm.
    """

    activation: ActivationSource
    begin: float
    period: float
    clock: tuple[float, float]
    groups: tuple[str, ...] = ()
    before: Floats | float = 0.0
    after: Floats | float = 0.0
    places: Places | None = None
    layout: MuscleLayout = field(default=OCTOPUS_MUSCLES, repr=False)

    def levels(self, times: Floats, edges: Floats) -> Floats:
        """Levels (T, groups, n) at the plant's `times`, s, in the n cells between `edges`, m."""
        share = (times - self.begin) / self.period
        readings = self.clock[0] + share * (self.clock[1] - self.clock[0])
        levels = self.activation.levels(readings, edges)
        if self.groups:
            correction = (self.before + np.clip(share, 0.0, 1.0)[:, None] * (np.asarray(self.after) - self.before))[:, :, None]
            if self.places is not None:
                correction = correction * self.places.shares(readings, edges)
            for index, group in enumerate(self.groups):
                levels[:, self.layout.index(group)] += correction[:, index]
            np.clip(levels, 0.0, 1.0, out=levels)
        return levels


@dataclass(frozen=True, slots=True, kw_only=True)
class Strike:
    """Activation of a strike: all rings at once, steeply; takes the place of an `Activation`.

    Attributes
    ----------
    rise : float, s
        Time to full activation.
    steepness : float
        Power of the raised cosine.
    layout : MuscleLayout
        Of the arm.

    Raises
    ------
    OctoctrlError
        If either is not positive.
    """

    rise: float = 0.038
    steepness: float = 15.0
    layout: MuscleLayout = field(default=OCTOPUS_MUSCLES, repr=False)

    def __post_init__(self) -> None:
        settle(self)
        check_number("rise", self.rise, above=0.0, unit="s")
        check_number("steepness", self.steepness, above=0.0)

    def levels(self, times: Floats, edges: Floats) -> Floats:
        """Levels (T, groups, n) of the muscle groups at `times`, s, in the cells between `edges`, m."""
        levels = np.zeros((len(times), len(self.layout), len(edges) - 1))
        ramp = raised_cosine(np, np.asarray(times, dtype=float), 0.0, self.rise)
        levels[:, self.layout.families == Family.TRANSVERSE] = ramp[:, None, None] ** self.steepness
        return levels


def sampled(source: ActivationSource, times: Floats, partitions: Mapping[str, Floats], layout: MuscleLayout) -> dict[str, Floats]:
    """Levels of a source at the samples, as compiled code may read them.

    Parameters
    ----------
    source : ActivationSource
    times : (T,) float64, s
    partitions : mapping of str to (n + 1,) float64, m
        Edges of the cells of each partition of the arm.
    layout : MuscleLayout
        Of the arm.

    Returns
    -------
    dict of str to (T, groups, n) float64
        Contiguous in memory.

    Raises
    ------
    OctoctrlError
        If the source has no levels, or they are no numbers, have another shape than asked for, or leave [0, 1].
    """
    ask = getattr(source, "levels", None)
    if not callable(ask):
        raise OctoctrlError(
            f"the activation is {type(source).__name__}, which has no levels(times, edges); "
            "give an Activation, or levels that are held to Plant.step"
        )
    found = {}
    for name, edges in partitions.items():
        levels = _as_levels(f"activation levels of {type(source).__name__}", ask(times, edges))
        wanted = len(times), len(layout), len(edges) - 1
        if levels.shape != wanted:
            raise OctoctrlError(
                f"{type(source).__name__}.levels gave shape {levels.shape} for {wanted[0]} instants, {wanted[1]} groups and the "
                f"{wanted[2]} cells of the partition '{name}'; {wanted} is needed"
            )
        _check_range(levels, f"near t={times[0]:.2f} s")
        found[name] = np.ascontiguousarray(levels)
    return found


def _as_levels(what: str, values: ArrayLike) -> Floats:
    try:
        found = np.asarray(values)
    except ValueError:  # rows of several lengths
        found = np.empty(0, dtype=object)
    if found.dtype.kind not in "biuf":
        raise OctoctrlError(f"{what}: found {type(values).__name__} {brief(values)}; numbers from 0 to 1 are needed")
    return found.astype(float, copy=False)


def _check_range(levels: Floats, where: str) -> None:
    # A comparison with a value that is not a number is false.
    if not (levels.min(initial=0.0) >= 0 and levels.max(initial=0.0) <= 1 + ROUNDING):
        raise OctoctrlError(f"activation levels span {levels.min():g}…{levels.max():g} {where}; allowed is 0…1")


def _overlap(edges: Floats, others: Floats) -> Floats:
    """Share (n, m) of each cell between `others` that each cell between `edges` covers; the end cells reach on as far as needed."""
    lower, upper = edges[:-1].copy(), edges[1:].copy()
    lower[0], upper[-1] = -np.inf, np.inf
    inside = np.minimum(upper[:, None], others[1:]) - np.maximum(lower[:, None], others[:-1])
    return np.maximum(inside, 0.0) / np.diff(others)
