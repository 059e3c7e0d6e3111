"""Where a plan begins: at rest, or in the middle of a motion, with muscles that are already at work."""

from dataclasses import dataclass, replace

import numpy as np

from octoctrl.sim.errors import OctoctrlError, check_number
from octoctrl.sim.topology.trace import TopologyTrace

from ..contracts import Floats, Observation, Primitive
from ..model.reduced import ReducedModel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Present:
    """The state from which is planned. The reduced model has no inertia, so that velocities do not belong to it.

    Attributes
    ----------
    strains : (S, 4) float64
        Of the sections.
    lifted_writhe : float, optional, turns
        If it is known on which branch the arm is; the shape alone tells it up to two turns.
    before : tuple of Primitive
        What the muscles were told before, on the plan's clock; what is planned takes over from it.
    clock : float, s
        Reading of the plan's clock.
    """

    strains: Floats
    lifted_writhe: float | None = None
    before: tuple[Primitive, ...] = ()
    clock: float = 0.0

    def __post_init__(self) -> None:
        check_number("clock", self.clock, at_least=0.0, unit="s")
        if self.strains.ndim != 2 or self.strains.shape[1] != 4 or not np.isfinite(self.strains).all():
            raise OctoctrlError(f"strains of shape {self.strains.shape} are no state of a reduced model; (sections, 4) numbers are needed")

    @classmethod
    def at_rest(cls, model: ReducedModel) -> "Present":
        """The straight arm whose muscles rest."""
        return cls(strains=model.rest)

    @classmethod
    def seen(cls, observation: Observation, model: ReducedModel) -> "Present":
        """The shape that an `observation` shows, with muscles that rest from now on."""
        return cls(strains=model.strains(observation))

    def branch(self, writhe: float) -> float:
        """By how many turns, an even number, a `writhe` that is known up to two turns at the begin lies off the arm's."""
        return 0.0 if self.lifted_writhe is None else float(2 * np.round((self.lifted_writhe - writhe) / 2))


def lifted_by(trace: TopologyTrace, turns: float) -> TopologyTrace:
    """A trace on another branch, an even number of `turns` away."""
    return replace(trace, lifted_writhe=trace.lifted_writhe + turns, crossings=trace.crossings + round(turns / 2))
