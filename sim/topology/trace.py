"""The topology of an arm over time: link, writhe, twist, and the convention under which they were measured.

Only NumPy here: planned and simulated traces are the same type, whoever made them.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import OctoctrlError, check_choice, check_number
from ..records import Record
from .inputs import AXES, Direction, Floats, numbers, unit_pole

Integers = NDArray[np.int64]

UTURN_LIMIT = 0.15
"""Below this value of 1 + t_tip . t_base the two end rays nearly coincide and writhe is decided by noise."""

MOST_CROSSINGS = 2.0**53
"""Beyond this, whole numbers are no longer told apart in double precision."""

_FLOAT_SERIES = ("time", "link", "writhe", "twist", "lifted_writhe", "residual")
_ALLOWED = {np.int64: "whole numbers", np.bool_: "true or false"}


@dataclass(frozen=True, slots=True, kw_only=True)
class TopologyConvention:
    """How an open arm was closed, and from where its lifted writhe was measured.

    Parameters
    ----------
    pole : tuple of 3 floats
        Fixed laboratory direction, kept as a unit vector: the axis of the expected coil, normal to the plane of bending.
    closure : {"rays"}
        The arm is continued by a straight ray at either end, along its end tangents.
    ray_length : float, arm lengths
        Length of the rays; 10 arm lengths (the published treatment) cost up to 0.004 turns in coils, 1000 cost nothing.
    """

    pole: Direction = AXES[0]
    closure: str = "rays"
    ray_length: float = 1000.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "pole", unit_pole(self.pole))
        check_choice("closure", self.closure, ("rays",))
        check_number("ray_length", self.ray_length, above=0.0, at_most=1e6, unit="arm lengths")
        object.__setattr__(self, "ray_length", float(self.ray_length))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class TopologyTrace(Record):
    """Link, writhe and twist of an arm over time, in turns.

    Parameters
    ----------
    time : (T,) float64, s
        Increasing.
    link : (T,) float64, turns
        Link of the frames, independent of the Gauss sum: lifted link minus twice the crossing count.
    writhe : (T,) float64, turns
        Gauss integral of the centreline closed by end rays; jumps by 2 at each self-crossing.
    twist : (T,) float64, turns
        Rotation of the frames about the arm.
    lifted_writhe : (T,) float64, turns
        Writhe without the jumps: writhe plus twice the crossing count.
    crossings : (T,) int64
        Signed number of self-crossings so far; crossings of a ray count too.
    uturn : (T,) bool
        Tip nearly antiparallel to the base (1 + t_tip . t_base below 0.15): writhe is ill-conditioned, compare modulo 2.
    residual : (T,) float64, turns
        link - (writhe + twist): discretisation plus whatever else is wrong.
    convention : TopologyConvention
        Pole, closure, ray length.
    """

    time: Floats
    link: Floats
    writhe: Floats
    twist: Floats
    lifted_writhe: Floats
    crossings: Integers
    uturn: NDArray[np.bool_]
    residual: Floats
    convention: TopologyConvention = TopologyConvention()

    def __post_init__(self) -> None:
        for name in _FLOAT_SERIES:
            _store(self, name, getattr(self, name), np.float64)
        _store(self, "crossings", self.crossings, np.int64)
        _store(self, "uturn", self.uturn, np.bool_)
        if not isinstance(self.convention, TopologyConvention):
            raise OctoctrlError(f"convention: expected a TopologyConvention, found {type(self.convention).__name__}")
        if self.time.size == 0:
            raise OctoctrlError("time is empty; a trace needs at least one sample")
        for name in (*_FLOAT_SERIES[1:], "crossings", "uturn"):
            if getattr(self, name).shape != self.time.shape:
                raise OctoctrlError(f"{name} has {getattr(self, name).size} samples, but time has {self.time.size}")
        if np.any(np.diff(self.time) <= 0.0):
            worst = int(np.argmax(np.diff(self.time) <= 0.0))
            raise OctoctrlError(f"time goes from {self.time[worst]:g} s to {self.time[worst + 1]:g} s; it must increase")

    @classmethod
    def from_lifted(
        cls,
        *,
        time: ArrayLike,
        lifted_writhe: ArrayLike,
        twist: ArrayLike,
        crossings: ArrayLike | None = None,
        uturn: ArrayLike | None = None,
        convention: TopologyConvention | None = None,
    ) -> "TopologyTrace":
        """Make a trace from the smooth quantities alone, as a planner predicts them.

        Parameters
        ----------
        time, lifted_writhe, twist : (T,) array_like
            As in the trace.
        crossings : (T,) array_like of int, optional
            Predicted crossing count, zero when omitted.
        uturn : (T,) array_like of bool, optional
            U-turn flag, false when omitted.
        convention : TopologyConvention, optional
            The default convention when omitted.

        Returns
        -------
        TopologyTrace
            With writhe = lifted writhe - 2 crossings, link = writhe + twist, residual 0.
        """
        when, lifted, turned = numbers("time", time), numbers("lifted_writhe", lifted_writhe), numbers("twist", twist)
        count: Any = numbers("crossings", np.zeros(when.shape) if crossings is None else crossings)
        flags: Any = np.zeros(when.shape, dtype=bool) if uturn is None else uturn
        for name, values in (("lifted_writhe", lifted), ("twist", turned), ("crossings", count)):
            if values.shape != when.shape:
                raise OctoctrlError(f"{name} has shape {values.shape}, but time {when.shape}; one value per time is needed")
        return cls(
            time=when,
            link=lifted - 2 * count + turned,
            writhe=lifted - 2 * count,
            twist=turned,
            lifted_writhe=lifted,
            crossings=count,
            uturn=flags,
            residual=np.zeros(when.shape),
            convention=TopologyConvention() if convention is None else convention,
        )

    @property
    def lifted_link(self) -> Floats:
        """Lifted writhe plus twist (T,), turns."""
        return self.lifted_writhe + self.twist

    def at(self, time: ArrayLike) -> "TopologyTrace":
        """Interpolate linearly to other times.

        Writhe and link are interpolated without their jumps, which are put back at the crossing count of the nearest sample, so that no
        value between two branches arises.

        Parameters
        ----------
        time : float or (K,) array_like, s
            Increasing, within the trace.

        Returns
        -------
        TopologyTrace
            At those times; the U-turn flag is set where either neighbour has it.

        Raises
        ------
        OctoctrlError
            If a time lies outside the trace.
        """
        wanted = np.atleast_1d(numbers("time", time))
        if wanted.ndim != 1 or wanted.size == 0:
            raise OctoctrlError(f"time has shape {wanted.shape}; one or more times are needed")
        slack = 1e-9 * max(1.0, abs(self.time[0]), abs(self.time[-1]))  # rounding of arange and the like
        if not (wanted.min() >= self.time[0] - slack and wanted.max() <= self.time[-1] + slack):
            raise OctoctrlError(
                f"time {wanted.min():g}…{wanted.max():g} s is outside the trace, which covers {self.time[0]:g}…{self.time[-1]:g} s"
            )
        right = np.minimum(np.searchsorted(self.time, wanted), self.time.size - 1)
        left = np.maximum(right - 1, 0)
        nearest = np.where(wanted - self.time[left] <= self.time[right] - wanted, left, right)
        count = self.crossings[nearest]

        def smooth(values: Floats) -> Floats:
            return np.interp(wanted, self.time, values)

        return replace(
            self,
            time=wanted,
            link=smooth(self.link + 2 * self.crossings) - 2 * count,
            writhe=smooth(self.writhe + 2 * self.crossings) - 2 * count,
            twist=smooth(self.twist),
            lifted_writhe=smooth(self.lifted_writhe),
            crossings=count,
            uturn=self.uturn[right] | (self.uturn[left] & (wanted < self.time[right])),
            residual=smooth(self.residual),
        )

    def slice(self, start: float, stop: float) -> "TopologyTrace":
        """Return the samples from time `start` to time `stop`, both included.

        Parameters
        ----------
        start, stop : float, s
            Ends of the interval.

        Returns
        -------
        TopologyTrace
            A shorter trace.

        Raises
        ------
        OctoctrlError
            If no sample lies in the interval.
        """
        check_number("start", start, unit="s")
        check_number("stop", stop, unit="s")
        inside = (self.time >= start) & (self.time <= stop)
        if not inside.any():
            raise OctoctrlError(f"no sample lies in {start:g}…{stop:g} s; the trace covers {self.time[0]:g}…{self.time[-1]:g} s")
        return replace(self, **{f.name: getattr(self, f.name)[inside] for f in fields(self) if f.name != "convention"})

    def net_crossings(self, hysteresis_turns: float = 0.2, hysteresis_time: float = 0.2) -> Integers:
        """Count self-crossings without the dither near a planar spiral.

        A change of the count is accepted once it has persisted for `hysteresis_time` and lifted writhe has meanwhile
        moved by `hysteresis_turns`; it is then dated back to where it began.

        Parameters
        ----------
        hysteresis_turns : float, turns
            Least change of lifted writhe since the crossing.
        hysteresis_time : float, s
            Least duration.

        Returns
        -------
        (T,) int64
            Net crossing count.
        """
        check_number("hysteresis_turns", hysteresis_turns, at_least=0.0, unit="turns")
        check_number("hysteresis_time", hysteresis_time, at_least=0.0, unit="s")
        net = np.empty(self.time.size, dtype=np.int64)
        accepted, began = int(self.crossings[0]), -1
        for k, count in enumerate(self.crossings):
            net[k] = accepted
            same_side = began >= 0 and (count - accepted) * (self.crossings[began] - accepted) > 0
            if not same_side:
                began = k if count != accepted else -1
            if began < 0:
                continue
            run = self.crossings[began : k + 1]
            moved = np.abs(self.lifted_writhe[began : k + 1] - self.lifted_writhe[began]).max()
            if self.time[k] - self.time[began] >= hysteresis_time and moved >= hysteresis_turns:
                # of a run that went further in steps, the part that never came back counts now; the rest starts a run of its own
                level = int(run.min() if run[0] > accepted else run.max())
                accepted = level
                net[began : k + 1] = accepted
                later = np.flatnonzero(run == accepted)
                began = began + int(later[-1]) + 1 if count != accepted else -1
        return net

    def level_times(self, quantity: str, levels: ArrayLike, *, for_good: bool = True) -> Floats:
        """Return the times at which a quantity passes given levels.

        Parameters
        ----------
        quantity : str
            ``"lifted_writhe"``, ``"twist"``, ``"lifted_link"``, ``"writhe"``, ``"link"``, ``"crossings"`` or ``"residual"``.
        levels : float or (K,) array_like
            Levels, in turns.
        for_good : bool
            True: the passage after which the quantity stays beyond the level until the end. False: the first passage.

        Returns
        -------
        (K,) float64, s
            Interpolated linearly; nan where the level is never passed.
        """
        names = ("lifted_writhe", "twist", "lifted_link", "writhe", "link", "crossings", "residual")
        check_choice("quantity", quantity, names)
        values = np.asarray(getattr(self, quantity), dtype=float)
        wanted = np.atleast_1d(numbers("levels", levels))
        if wanted.ndim != 1:
            raise OctoctrlError(f"levels has shape {wanted.shape}; one level or a list of them is needed")
        times = np.full(wanted.size, np.nan)
        for k, level in enumerate(wanted):
            offset = values - level
            side = np.where(offset > 0.0, 1, np.where(offset < 0.0, -1, 0))
            if side[0] == 0:  # a start exactly on the level belongs to the side opposite to where it goes
                moved = np.flatnonzero(side)
                side[: moved[0] if moved.size else side.size] = -side[moved[0]] if moved.size else 0
            beyond = side * side[0] <= 0
            if not beyond.any() or side[0] == 0 or (for_good and not beyond[-1]):
                continue
            index = int(np.flatnonzero(~beyond)[-1]) + 1 if for_good else int(np.argmax(beyond))
            step = values[index] - values[index - 1]
            fraction = (level - values[index - 1]) / step if step != 0.0 else 1.0
            times[k] = self.time[index - 1] + fraction * (self.time[index] - self.time[index - 1])
        return times


def _store(trace: TopologyTrace, name: str, values: ArrayLike, dtype: type[np.generic]) -> None:
    """Keep `values` as a read-only one-dimensional array of the trace."""
    array = numbers(name, values)
    if array.ndim != 1:
        raise OctoctrlError(f"{name} has shape {array.shape}; one value per time is needed")
    if dtype is np.int64 and np.any(beyond := np.abs(array) > MOST_CROSSINGS):
        raise OctoctrlError(f"{name} holds {array[beyond][0]:g}; whole numbers up to {MOST_CROSSINGS:g} are needed")
    stored = array.astype(dtype)
    if np.any(stored != array):
        raise OctoctrlError(f"{name} holds {array[stored != array][0]:g}; {_ALLOWED[dtype]} are needed")
    stored.flags.writeable = False
    object.__setattr__(trace, name, stored)
