"""Account of the energy of a plant, for those who ask: what is stored in which part, and what muscles and water have done so far.

`Accounted` is a core around another one. It moves sample by sample, which changes no bit, and asks the core in between; a plant that was
not asked to keep account knows nothing of it.
"""

from typing import Any, cast

import numpy as np

from ..contracts import AccountableCore, Core, Floats, Motion, State, joined
from ..errors import OctoctrlError
from .clock import Clock

STORED, DONE = "energy_", "work_"
"""What the names of stored energies, and of works, begin with."""


class Accounted:
    """A core that keeps account of its energy; everything else is the core's own.

    Works are integrals of the power at the samples, by the trapezoidal rule, from rest or from a loaded state that knows of none.

    Parameters
    ----------
    core : Core
        An `AccountableCore`.

    Raises
    ------
    OctoctrlError
        If the core cannot tell its energies.
    """

    def __init__(self, core: Core) -> None:
        if not (hasattr(core, "energies") and hasattr(core, "powers")):
            raise OctoctrlError(
                f"the plant '{core.model}' keeps no account of its energy; leave energy out, or give its core energies() and powers()"
            )
        self._core: AccountableCore = cast(AccountableCore, core)
        self._works = dict.fromkeys(self._core.works, 0.0)

    def __getattr__(self, name: str) -> Any:
        """What the core has."""
        if name.startswith("__") or name == "_core":
            raise AttributeError(name)
        return getattr(self._core, name)

    def rest(self) -> None:
        """Put the arm to rest; nothing has been done."""
        self._core.rest()
        self._works = dict.fromkeys(self._works, 0.0)

    def series(self) -> State:
        """What the core keeps, the energies stored in its parts, and the works done on the arm, J."""
        stored = {STORED + name: np.array(value) for name, value in self._core.energies().items()}
        return {**self._core.series(), **stored, **{DONE + name: np.array(value) for name, value in self._works.items()}}

    def move(self, first: int, inputs: State, clock: Clock) -> Motion:
        """Go on as the core does, with its account after every sample."""
        motions: list[Motion] = []
        before = self._powers(first, inputs, 0, clock)
        for k in range(len(inputs["arm"]) - 1):
            motion = self._core.move(first + k, {name: values[k : k + 2] for name, values in inputs.items()}, clock)
            if motion.finding.ends:
                empty = {STORED + name: np.empty(0) for name in self._core.energies()} | {DONE + name: np.empty(0) for name in self._works}
                motions.append(motion._replace(series={**motion.series, **empty}))
                break
            after = self._powers(first + k, inputs, 1, clock, k)
            for name in self._works:
                self._works[name] += clock.sample * (before[name] + after[name]) / 2
            before = after
            kept: dict[str, Floats] = {STORED + name: np.array([value]) for name, value in self._core.energies().items()}
            kept |= {DONE + name: np.array([value]) for name, value in self._works.items()}
            motions.append(motion._replace(series={**motion.series, **kept}))
            if motion.finding:
                break
        return joined(motions)

    def _powers(self, first: int, inputs: State, later: int, clock: Clock, k: int = 0) -> dict[str, float]:
        levels = {name: inputs[name][k + later] for name in self._core.partitions}
        return self._core.powers(levels, (first + later) * clock.sample)

    def state(self) -> State:
        """The core's, and what has been done."""
        return {**self._core.state(), **{DONE + name: np.array(value) for name, value in self._works.items()}}

    def restore(self, state: State) -> None:
        """Go back to a `state`."""
        self._core.restore({name: values for name, values in state.items() if not name.startswith(DONE)})
        self._works = {name: float(state.get(DONE + name, 0.0)) for name in self._works}
