"""What the parts of the physical world ask of each other: protocols that an object of one's own may fulfil."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from .findings import Finding, Stop

if TYPE_CHECKING:
    from .body.arm import Arm
    from .running.clock import Clock, StepLimit
    from .running.observation import Observation
    from .running.recording import Recording
    from .scene.scene import Scene

Floats = NDArray[np.float64]
State = Mapping[str, Floats]
"""Arrays by name."""


class ActivationSource(Protocol):
    """What moves a plant: an `octoctrl.sim.activation.Activation` or any object with this method."""

    def levels(self, times: Floats, edges: Floats) -> Floats:
        """Levels (T, groups, n) at `times` (T,), s, in the n cells between `edges` (n + 1,), m; asked once for each partition."""
        ...


class Motion(NamedTuple):
    """What a core leaves behind of some samples, T of them done, n elements.

    Attributes
    ----------
    points : (T, n + 1, 3) float64, m
    frames : (T, n, 3, 3) float64
    stretch : (T, n) float64
    series : mapping of str to (T, ...) float64
        What else is kept, see `Core.series`.
    finding : Finding
        `Finding.FINE` if all samples were done; else what ended the sample after the last, or what is to be said of the last if it is
        `Finding.SUNK`.
    rod : str
    element : int
        Where.
    """

    points: Floats
    frames: Floats
    stretch: Floats
    series: State = MappingProxyType({})
    finding: Finding = Finding.FINE
    rod: str = "arm"
    element: int = 0

    def until(self, samples: int) -> "Motion":
        """The first so many `samples`, or all but so many if negative."""
        points, frames, stretch = (values[:samples] for values in self[:3])
        series = {name: each[:samples] for name, each in self.series.items()}
        return self._replace(points=points, frames=frames, stretch=stretch, series=series)


def joined(motions: Sequence[Motion]) -> Motion:
    """One motion of consecutive ones, of which only the last may have ended early."""
    if len(motions) == 1:
        return motions[0]
    series = {name: np.concatenate([motion.series[name] for motion in motions]) for name in motions[0].series}
    points, frames, stretch = (np.concatenate([motion[part] for motion in motions]) for part in range(3))
    return motions[-1]._replace(points=points, frames=frames, stretch=stretch, series=series)


class Core(Protocol):
    """The compiled part of a plant: what moves, at the step of a clock. `octoctrl.sim.running.plant.Plant` makes a plant of it."""

    @property
    def model(self) -> str:
        """Name of the model with its numerics, as written into saved states."""
        ...

    @property
    def arm(self) -> "Arm":
        """The arm."""
        ...

    @property
    def scene(self) -> "Scene":
        """What is around it."""
        ...

    @property
    def partitions(self) -> State:
        """Edges (n + 1,) of the cells in which levels are read, m; ``"arm"``, whose cells are the elements of the axis, comes first."""
        ...

    @property
    def limit(self) -> "StepLimit":
        """Predicted largest stable step at rest."""
        ...

    @property
    def usual(self) -> float:
        """Step that ``dt="auto"`` takes at most, s."""
        ...

    @property
    def finer(self) -> tuple[int, ...]:
        """Parts of the step at which ``dt="auto"`` tries a sample again before it stops; empty for never."""
        ...

    @property
    def loadable(self) -> bool:
        """Whether loads of the scene act on it."""
        ...

    @property
    def period(self) -> float:
        """Usual time between corrections by feedback, s."""
        ...

    def start(self, clock: "Clock") -> None:
        """Set all that depends on the step."""
        ...

    def rest(self) -> None:
        """Put the arm to rest."""
        ...

    def shape(self) -> tuple[Floats, Floats, Floats]:
        """Points (n + 1, 3), m, frames (n, 3, 3) and stretch (n,) of the axis now."""
        ...

    def speeds(self) -> tuple[Floats, Floats]:
        """Velocities of the points (n + 1, 3), m/s, and spins of the elements about their directors (n, 3), rad/s."""
        ...

    def series(self) -> State:
        """What is kept of the present instant beside the shape, by name; empty where there is nothing more."""
        ...

    def move(self, first: int, inputs: State, clock: "Clock") -> Motion:
        """Go on from sample `first` over T more; may end early with a finding.

        Parameters
        ----------
        first : int
        inputs : mapping of str to (T + 1, ...) float64
            Linear in between: levels (T + 1, groups, cells) by partition, and ``"loads"`` of `octoctrl.sim.scene.loads.sampled_loads` if
            there are any.
        clock : Clock
        """
        ...

    def explain(self, before: State, first: int, inputs: State, motion: Motion, clock: "Clock") -> Stop:
        """Why `motion` ended early, which began at sample `first` in the state `before`; the state afterwards does not matter."""
        ...

    def state(self) -> State:
        """Copies of the arrays that hold the whole motion."""
        ...

    def restore(self, state: State) -> None:
        """Go back to a `state`."""
        ...

    def identity(self) -> dict[str, Any]:
        """What a saved state must share with the core that goes on from it, beside arm, water and step."""
        ...


@runtime_checkable
class Resumable(Protocol):
    """What can be put away and gone on with, bit by bit: plants, sensors, and the controllers of this package."""

    def state(self) -> Mapping[str, Any]:
        """All that it remembers, as plain values and arrays by name."""
        ...

    def restore(self, state: Any) -> Any:
        """Go to a `state`."""
        ...


class AccountableCore(Core, Protocol):
    """A core that can tell its energies, see `octoctrl.sim.running.account.Accounted`."""

    @property
    def works(self) -> tuple[str, ...]:
        """What does work and stores none, such as ``"muscles"`` and ``"water"``."""
        ...

    def energies(self) -> dict[str, float]:
        """Energy of the present state by part, J; ``"kinetic"`` is one of them."""
        ...

    def powers(self, levels: State, time: float) -> dict[str, float]:
        """Power of each of `works`, W, positive if it moves the arm, at `levels` (groups, cells) by partition."""
        ...


class PlantLike(Protocol):
    """What a run, a batch or an environment asks of a plant."""

    @property
    def model(self) -> str:
        """Name of the model with its numerics."""
        ...

    @property
    def arm(self) -> "Arm":
        """The arm."""
        ...

    @property
    def scene(self) -> "Scene":
        """What is around it."""
        ...

    @property
    def clock(self) -> "Clock":
        """How time is divided."""
        ...

    @property
    def limit(self) -> "StepLimit":
        """Predicted largest stable step."""
        ...

    @property
    def time(self) -> float:
        """Simulated time, s."""
        ...

    def reset(self) -> "Observation":
        """Put the arm to rest at time zero."""
        ...

    def observe(self) -> "Observation":
        """What can be seen now."""
        ...

    def advance(self, source: ActivationSource, duration: float, *, progress: Callable[[float], None] | None = None) -> "Recording":
        """Move on by `duration` (s), recorded."""
        ...
