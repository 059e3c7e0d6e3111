"""The centreline as a whole: points along the arm that it should pass through."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from octoctrl.sim.errors import OctoctrlError, check_number

from ...contracts import Expression, Outputs
from ..registry import register_goal
from ..shares import Length, unresolved
from .measured import MeasuredGoal, nodes, three_numbers


@register_goal
@dataclass(frozen=True, slots=True, kw_only=True)
class ShapeGoal(MeasuredGoal):
    """Points in the laboratory for equal shares of the arm, the last one for its tip; the miss is the root mean square of the distances.

    Attributes
    ----------
    value : tuple of (float, float, float), m
        At 1/K, 2/K, ... of the arm's rest length.
    """

    quantity: ClassVar[str] = "shape"
    unit: ClassVar[str] = "m"
    value: tuple[tuple[Length, Length, Length], ...]
    tolerance: float = 0.01

    def __post_init__(self) -> None:
        MeasuredGoal.__post_init__(self)
        if not isinstance(self.value, list | tuple) or not self.value:
            raise OctoctrlError(f"goal shape: value is {self.value!r}; points along the arm are needed, each of three numbers")
        object.__setattr__(self, "value", tuple(three_numbers("goal shape: a point", point) for point in self.value))
        for point in () if unresolved(self.value) else self.value:
            for number in point:
                check_number("goal shape", number, unit="m")

    @property
    def target(self) -> str:
        """How many points."""
        return f"through {len(self.value)} points"

    def residuals(self, outputs: Outputs) -> list[Expression]:
        """Coordinates minus those that are asked for, over the root of the number of points."""
        count, edges = len(self.value), nodes(outputs.stations)
        places = edges[-1] * np.arange(1, count + 1) / count
        between = np.stack([np.interp(places, edges, unit) for unit in np.eye(len(edges))])
        found = []
        for axis, row in enumerate(outputs.points):
            at = row @ between
            found += [(at[:, index] - float(point[axis])) / count**0.5 for index, point in enumerate(self.value)]
        return found
