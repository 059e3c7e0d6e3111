"""What goals have in common: a target, and one formula that reads the reduced model and the recording alike."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from math import inf, isfinite
from typing import Any, ClassVar

import numpy as np

from octoctrl.sim.annotations import settle
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import OctoctrlError, check_number, check_window
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.topology.trace import TopologyTrace

from ...contracts import Expression, Floats, Outputs, Reach, When
from ..shares import Length, Share, unresolved
from .recorded import RecordedOutputs


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredGoal:
    """A goal whose miss follows from its residuals; a subclass names its `quantity` and `unit` and gives `residuals`.

    Attributes
    ----------
    tolerance : float
        What still counts as reached, in planning and in the verdict.
    when : {"end", "throughout"}
        At the end of its phase, or all the time.
    hold : float, s
        How long before the end it has to hold already.
    """

    quantity: ClassVar[str]
    unit: ClassVar[str]
    steered: ClassVar[bool] = True
    """Whether feedback holds it, by its slopes on the reduced model."""
    tolerance: float
    when: When = When.END
    hold: float = 0.0

    def __post_init__(self) -> None:
        settle(self)
        check_number("tolerance", self.tolerance, above=0.0)
        check_number("hold", self.hold, at_least=0.0, unit="s")
        if not isinstance(self.when, When):
            raise OctoctrlError(f"when is {self.when!r}; {' or '.join(str(item) for item in When)} is needed")

    def __str__(self) -> str:
        return f"{self.quantity.replace('_', ' ')} {self.target} ± {_number(self.tolerance)} {self.unit}".rstrip() + self._where()

    def _where(self) -> str:
        words = f" for {_number(self.hold)} s" if self.hold else ""
        return words + (" throughout" if self.when is When.THROUGHOUT else "")

    @property
    def target(self) -> str:
        """The target in words."""
        raise NotImplementedError

    def residuals(self, outputs: Outputs) -> list[Expression]:
        """Expressions whose root of the sum of squares is the miss; see `octoctrl.planners.contracts.Goal.residuals`."""
        raise NotImplementedError

    def miss(self, recording: Recording, trace: TopologyTrace, arm: Arm) -> Floats:
        """By how much the goal is missed at each instant of a recording, (T,)."""
        found = self.residuals(RecordedOutputs(recording, trace, arm))
        miss: Floats = np.sqrt(np.sum([np.square(residual) for residual in found], axis=0))
        if miss.shape != recording.time.shape:
            raise OctoctrlError(f"goal {self} gives the shape {miss.shape} for {recording.time.size} instants; one number each is needed")
        return miss

    def beyond(self, reach: Reach) -> str:
        """What the limit at rest is if the goal lies beyond it; nothing is known against most."""
        return ""

    def excludes(self, other: "MeasuredGoal") -> bool:
        """Whether no shape could meet both goals; a subclass says when."""
        return False


@dataclass(frozen=True, slots=True, kw_only=True)
class ScalarGoal(MeasuredGoal):
    """A goal for one number, which a subclass reads in `read`; exactly one of the four targets is given.

    Attributes
    ----------
    value : float
        To be reached.
    at_least, at_most : float
        To be reached or passed.
    between : (float, float)
        To stay between.
    """

    timed: ClassVar[bool] = False
    """Whether it is a matter of when what travels arrives, which feedback sees to by its clock."""
    value: Length | None = None
    at_least: Length | None = None
    at_most: Length | None = None
    between: tuple[Length, Length] | None = None

    def __post_init__(self) -> None:
        MeasuredGoal.__post_init__(self)
        if isinstance(self.between, list):
            object.__setattr__(self, "between", tuple(self.between))
        if self.between is not None and (not isinstance(self.between, tuple) or len(self.between) != 2):
            raise OctoctrlError(f"goal {self.quantity}: between is {self.between!r}; two numbers are needed, the lower first")
        given = self._given()
        if len(given) != 1:
            found = f"{' and '.join(given)} are given" if given else "none is given"
            raise OctoctrlError(f"goal {self.quantity}: {found}; one of value, at_least, at_most, between is needed")
        if unresolved(self):
            if self.unit != "m":
                raise OctoctrlError(f"goal {self}: only lengths can be shares of the arm")
            return
        for number in self.between if self.between is not None else given.values():
            check_number(f"goal {self.quantity}", number)
        if self.band[0] > self.band[1]:
            raise OctoctrlError(f"goal {self.quantity}: between {self.between}: the first must not be above the second")

    def read(self, outputs: Outputs) -> Expression:
        """The number, (T,)."""
        raise NotImplementedError

    def _given(self) -> Mapping[str, Any]:
        return {name: found for name in ("value", "at_least", "at_most", "between") if (found := getattr(self, name)) is not None}

    @property
    def band(self) -> tuple[float, float]:
        """Least and greatest value without a miss."""
        if self.value is not None:
            return float(self.value), float(self.value)
        if self.between is not None:
            return float(self.between[0]), float(self.between[1])
        return (-inf if self.at_least is None else float(self.at_least)), (inf if self.at_most is None else float(self.at_most))

    @property
    def target(self) -> str:
        """The target in words."""
        if self.between is not None:
            return f"between {_number(self.between[0])} and {_number(self.between[1])}"
        ((name, number),) = self._given().items()
        return f"{name.replace('_', ' ')} {_number(number)}".removeprefix("value ")

    def residuals(self, outputs: Outputs) -> list[Expression]:
        """Distance from the band, with its sign."""
        value, (low, high) = self.read(outputs), self.band
        if low == high:
            return [value - low]
        below = outputs.math.fmin(value - low, 0.0) if isfinite(low) else 0.0
        return [below + (outputs.math.fmax(value - high, 0.0) if isfinite(high) else 0.0)]

    def excludes(self, other: MeasuredGoal) -> bool:
        """Whether both ask for the same number and the bands lie apart, by more than the tolerances."""
        if type(other) is not type(self) or not isinstance(other, ScalarGoal) or unresolved((self, other)):
            return False
        # Equal but for the target: the same window, the same side.
        if replace(other, **{item.name: getattr(self, item.name) for item in fields(self) if item.name in _TARGETS}) != self:
            return False
        (low, high), (other_low, other_high) = self.band, other.band
        return max(low, other_low) - min(high, other_high) > self.tolerance + other.tolerance


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowedGoal(ScalarGoal):
    """A goal for one number that is summed along the arm, or along a window of it.

    Attributes
    ----------
    window : (float, float), m
        Rest arclengths between which it is read.
    """

    window: tuple[Length, Length] = (0.0, inf)

    def __post_init__(self) -> None:
        if isinstance(self.window, list):
            object.__setattr__(self, "window", tuple(self.window))
        ScalarGoal.__post_init__(replace(self, window=(0.0, inf)) if unresolved(self.window) else self)
        if not unresolved(self.window):
            check_window(f"goal {self.quantity}", self.window)

    def _where(self) -> str:
        low, high = (str(edge) if isinstance(edge, Share) else f"{1e3 * edge:g} mm" for edge in self.window)
        words = "" if self.window == (0.0, inf) else f" from {low} to " + ("the tip" if self.window[1] == inf else high)
        return words + ScalarGoal._where(self)

    def weights(self, outputs: Outputs) -> Floats:
        """What lies of each gap between the stations inside the window, (n + 1,), m."""
        lower, upper = outputs.stations[:-1], outputs.stations[1:]
        return np.maximum(np.minimum(upper, float(self.window[1])) - np.maximum(lower, float(self.window[0])), 0.0)


def three_numbers(name: str, vector: Any) -> tuple[Any, Any, Any]:
    """A list, tuple or array of three as a tuple.

    Raises
    ------
    OctoctrlError
        If it is something else.
    """
    items = vector.tolist() if isinstance(vector, np.ndarray) else vector
    if not isinstance(items, list | tuple) or len(items) != 3:
        raise OctoctrlError(f"{name} is {vector!r}; three numbers are needed, such as (0, 0.1, 0)")
    first, second, third = items
    return first, second, third


def bending(outputs: Outputs) -> Expression:
    """Size of the curvature in each gap between the stations, (T, n + 1), 1/m; never zero, so that a straight arm has slopes too."""
    first, second, _ = outputs.curvatures
    return outputs.math.sqrt(first**2 + second**2 + STRAIGHT**2)


STRAIGHT = 0.1
"""Curvature, 1/m, that says nothing of a direction."""

_TARGETS = ("value", "at_least", "at_most", "between", "tolerance", "when", "hold")


def _number(value: Length) -> str:
    return str(value) if isinstance(value, Share) else f"{value:g}"


def nodes(stations: Floats) -> Floats:
    """Rest arclengths (n + 1,), m, of the nodes between `stations` (n + 2,): base, element centres, tip. A plant's own, not the arm's."""
    edges = [float(stations[0])]
    for centre in stations[1:-1]:
        edges.append(2 * float(centre) - edges[-1])
    return np.array(edges)
