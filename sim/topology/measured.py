"""Link, writhe and twist of a measured arm, with what the noise of the measurement does to them.

Noise is seen in third differences: a smooth motion has small ones, white noise of size s large ones, s sqrt(20). It makes a line longer and
more wriggled than the arm is, and that biases writhe as well as it scatters it: more noise of the same size is laid on top, and what that
changes is told.
"""

import warnings
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import OctoctrlWarning, check_kind, check_number
from ..records import Record
from .centreline import Centreline
from .inputs import Floats, unit_pole
from .measures import SECTION_SHAPES, classify_sections, measure, present
from .trace import TopologyConvention, TopologyTrace

DRAWS, INSTANTS = 24, 16
"""Copies with more noise, and instants at which they are measured, at most."""
ENOUGH = 8
"""Instants or points from which on noise can be told from motion."""
_THIRD = np.sqrt(20.0) * 0.6745
"""Median of the size of a third difference of white noise of size 1."""

QUANTITIES = ("lifted_link", "lifted_writhe", "twist")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class MeasuredTopology(Record):
    """What was measured on a centreline, T instants.

    Attributes
    ----------
    centreline : Centreline
    trace : TopologyTrace
        With the pole that was taken.
    frames : (T, m, 3, 3) float64
    sections : (T, S) int64
        1 straight, 2 bent in a plane, 3 helical, of stretches of equal length from base to tip.
    noise : float, m
        Of each coordinate, at most; not a number if there are too few instants and points to tell.
    bias, spread : dict of str to float, turns
        What more noise of that size adds to lifted link, lifted writhe and twist on average, and how far it scatters them (one standard
        deviation). The measured values are off by about as much already.
    notes : tuple of str
        What a reader must know.
    """

    centreline: Centreline
    trace: TopologyTrace
    frames: Floats
    sections: NDArray[np.int64]
    noise: float
    bias: dict[str, float] = field(default_factory=dict)
    spread: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        line, trace = self.centreline, self.trace
        instants, count = line.points.shape[:2]
        pole = ", ".join(f"{part:g}" for part in trace.convention.pole)
        lines = [
            f"'{line.name}'   {instants} instants, {trace.time[0]:g} to {trace.time[-1]:g} s   {count} points   length "
            f"{1e3 * line.length.min():.1f} to {1e3 * line.length.max():.1f} mm   pole ({pole})",
            f" {'turns':16}{'first':>9}{'last':>9}{'least':>9}{'most':>9}   more noise adds",
        ]
        for name in QUANTITIES:
            values = getattr(trace, name)
            numbers = "".join(f"{value:+9.3f}" for value in (values[0], values[-1], values.min(), values.max()))
            doubt = f"   {self.bias[name]:+.3f} ± {self.spread[name]:.3f}" if self.bias else ""
            lines.append(f" {name.replace('_', ' '):16}{numbers}{doubt}")
        lines.append(f" net self-crossings {int(trace.net_crossings()[-1]):+d}")
        for name, index in (("first", 0), ("last", -1)):
            lines.append(f" sections, base to tip, {name}: {' '.join(SECTION_SHAPES[int(value)] for value in self.sections[index])}")
        known = f"{1e3 * self.noise:.2g} mm in each coordinate, at most" if np.isfinite(self.noise) else "cannot be told from so few points"
        return "\n".join([*lines, f" noise: {known}", *(f" {note}" for note in self.notes)])


def topology_of(
    centreline: Centreline, *, pole: ArrayLike | None = None, sections: int = 8, noise: float | None = None, draws: int = DRAWS
) -> MeasuredTopology:
    """Measure link, writhe and twist of a measured arm, and how far noise moves them.

    Parameters
    ----------
    centreline : Centreline
    pole : (3,) array_like, optional
        Of lifted writhe: the axis of the expected coil. If omitted, (0, 0, 1), or the axis that suits the arm; the notes say which.
    sections : int
        Stretches to be called straight, planar or helical.
    noise : float, optional, m
        Of each coordinate; estimated if omitted.
    draws : int
        Copies with more noise; 0 leaves the estimate out.

    Returns
    -------
    MeasuredTopology

    Raises
    ------
    OctoctrlError
        If an argument is out of range, or what `octoctrl.sim.topology.measures.measure` refuses.
    """
    check_kind("centreline", centreline, Centreline, "time and points of the line, or what oc.read_centreline gives")
    if noise is not None:
        check_number("noise", noise, at_least=0.0, unit="m")
    points, frames = centreline.ribbon()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", OctoctrlWarning)
        trace = measure(centreline.time, points, frames, None if pole is None else TopologyConvention(pole=unit_pole(pole)))
    notes = [f"{str(item.message)[0].upper()}{str(item.message)[1:]}." for item in told if issubclass(item.category, OctoctrlWarning)]
    if centreline.markers is None:
        notes.append("No markers on the skin: the frames are carried along the line, so that twist is zero and link is writhe.")
    if trace.uturn.any():
        notes.append(f"At {int(trace.uturn.sum())} instants the tip points back along the base, where noise decides writhe.")
    found = noise_of(centreline) if noise is None else noise
    bias, spread = _doubt(centreline, found, trace, draws) if found > 0 and draws else ({}, {})
    return MeasuredTopology(
        centreline=centreline,
        trace=trace,
        frames=frames,
        sections=np.asarray(classify_sections(frames, sections)),
        noise=found,
        bias=bias,
        spread=spread,
        notes=tuple(notes),
    )


def noise_of(centreline: Centreline) -> float:
    """Noise of each coordinate of a `centreline`, m, at most: the smaller of what third differences in time and along the arm show.

    Not a number with fewer than eight instants and eight points.
    """
    found = [np.nan]
    for axis in (0, 1):
        if centreline.points.shape[axis] >= ENOUGH:
            found.append(float(np.median(np.abs(np.diff(centreline.points, 3, axis=axis)))) / _THIRD)
    return float(np.nanmin(found)) if len(found) > 1 else np.nan


def _doubt(centreline: Centreline, noise: float, trace: TopologyTrace, draws: int) -> tuple[dict[str, float], dict[str, float]]:
    """What more noise adds to the three numbers: mean and standard deviation over copies and instants."""
    draw = np.random.default_rng(0)
    chosen = np.unique(np.round(np.linspace(0, len(centreline.time) - 1, min(INSTANTS, len(centreline.time)))).astype(int))
    pole = trace.convention.pole
    changes = []
    for _ in range(draws):
        moved = {
            name: values[chosen] + noise * draw.standard_normal(values[chosen].shape)
            for name, values in (("points", centreline.points), ("markers", centreline.markers))
            if values is not None
        }
        points, frames = replace(centreline, time=centreline.time[chosen], **moved).ribbon()
        for index, curve, arm in zip(chosen, points, frames, strict=True):
            turned, lifted = present(curve, arm, pole)
            writhe = (lifted - trace.lifted_writhe[index] + 1) % 2 - 1
            changes.append((writhe + turned - trace.twist[index], writhe, turned - trace.twist[index]))
    mean, deviation = np.mean(changes, axis=0), np.std(changes, axis=0)
    return tuple(dict(zip(QUANTITIES, map(float, values), strict=True)) for values in (mean, deviation))  # type: ignore[return-value]
