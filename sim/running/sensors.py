"""Sensors between a plant and who watches it: noise, delay, rate, and a part of the stations only.

`Sensors` says what they are like; `start` gives the `Readings` of one run, which turn the plant's observations into what is seen of them.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..contracts import Floats
from ..errors import OctoctrlError, check_count, check_number
from ..rotations import rotation_matrix
from .observation import Observation

ROUNDING = 1e-9
"""Difference of times (s) that is none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """What is measured of an arm, and how well.

    Attributes
    ----------
    position_noise : float, m
        Standard deviation of each coordinate of each point.
    angle_noise : float, rad
        Of a frame's rotation about each of its directors.
    stretch_noise : float
    velocity_noise, spin_noise : float, m/s and rad/s
    delay : float, s
        What is seen was measured at least so long ago; until then, it is the first reading.
    period : float, s, optional
        Between readings; every observation that comes is one if omitted.
    stations : int or tuple of int, optional
        Which element centres have a frame, or how many, evenly spread; all if omitted. Base and tip always have one. Points are seen
        halfway between stations.
    seed : int
        Of the noise: runs with the same seed see the same.

    Raises
    ------
    OctoctrlError
        If a number is out of range.
    """

    position_noise: float = 0.0
    angle_noise: float = 0.0
    stretch_noise: float = 0.0
    velocity_noise: float = 0.0
    spin_noise: float = 0.0
    delay: float = 0.0
    period: float | None = None
    stations: int | tuple[int, ...] | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        units = {"position_noise": "m", "angle_noise": "rad", "velocity_noise": "m/s", "spin_noise": "rad/s", "delay": "s"}
        for name in (*units, "stretch_noise"):
            check_number(name, getattr(self, name), at_least=0.0, unit=units.get(name, ""))
        if self.period is not None:
            check_number("period", self.period, above=0.0, unit="s")
        check_count("seed", self.seed, at_least=0)
        if isinstance(self.stations, tuple):
            for index in self.stations:
                check_count("stations", index, at_least=0)
            if len(self.stations) < 2 or list(self.stations) != sorted(set(self.stations)):
                raise OctoctrlError(f"stations={self.stations}: at least two element centres from base to tip are needed, each once")
        elif self.stations is not None:
            check_count("stations", self.stations, at_least=2)

    def start(self) -> "Readings":
        """Readings of a new run."""
        return Readings(self)


class Readings:
    """What `Sensors` show of one run.

    Parameters
    ----------
    sensors : Sensors
    """

    def __init__(self, sensors: Sensors) -> None:
        self.sensors = sensors
        self._random = np.random.default_rng(sensors.seed)
        self._taken: deque[Observation] = deque()
        self._due = self._latest = -np.inf

    def see(self, observation: Observation) -> Observation:
        """What is seen now.

        Parameters
        ----------
        observation : Observation
            The arm as it is; call it at every instant at which a reading may be taken. A time before the last one begins a new run.

        Returns
        -------
        Observation
            As it was read; its `time` is when.
        """
        if observation.time < self._latest - ROUNDING:
            self._taken.clear()
            self._due = -np.inf
        self._latest = observation.time
        if observation.time >= self._due - ROUNDING:
            self._taken.append(self._read(observation))
            if self.sensors.period is not None:
                self._due = (np.floor(observation.time / self.sensors.period + 1e-6) + 1) * self.sensors.period
        shown = observation.time - self.sensors.delay + ROUNDING
        while len(self._taken) > 1 and self._taken[1].time <= shown:
            self._taken.popleft()
        return self._taken[0]

    @property
    def shown(self) -> Observation:
        """What was seen last."""
        return self._taken[0]

    def state(self) -> dict[str, Any]:
        """Readings on their way, when the next is due, and where the noise stands."""
        noise = self._random.bit_generator.state
        return {"taken": tuple(self._taken), "due": float(self._due), "latest": float(self._latest), "noise": dict(noise)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go to a `state` of readings of the same sensors."""
        self._taken = deque(state["taken"])
        self._due, self._latest = state["due"], state["latest"]
        self._random.bit_generator.state = state["noise"]

    def _read(self, observation: Observation) -> Observation:
        seen, sensors = _part(observation, _seen_elements(self.sensors.stations, len(observation.stretch))), self.sensors
        turns = self._noise(sensors.angle_noise, (len(seen.frames), 3))
        return replace(
            seen,
            points=seen.points + self._noise(sensors.position_noise, seen.points.shape),
            frames=rotation_matrix(turns) @ seen.frames if sensors.angle_noise else seen.frames,
            stretch=seen.stretch + self._noise(sensors.stretch_noise, seen.stretch.shape),
            velocities=seen.velocities + self._noise(sensors.velocity_noise, seen.velocities.shape),
            spins=seen.spins + self._noise(sensors.spin_noise, seen.spins.shape),
        )

    def _noise(self, size: float, shape: tuple[int, ...]) -> Floats:
        # Drawn also without effect, so that one kind of noise does not change another.
        return size * self._random.standard_normal(shape)


def _seen_elements(stations: int | tuple[int, ...] | None, elements: int) -> tuple[int, ...] | None:
    """Element centres that are seen, of so many `elements`; None for all.

    Raises
    ------
    OctoctrlError
        If there are not so many.
    """
    if stations is None:
        return None
    chosen = stations if isinstance(stations, tuple) else tuple(((np.arange(stations) + 0.5) * elements / stations).astype(int).tolist())
    if chosen[-1] >= elements or len(chosen) > elements:
        raise OctoctrlError(f"stations={stations}: the arm has {elements} elements, numbered from 0")
    return chosen


def _part(whole: Observation, chosen: tuple[int, ...] | None) -> Observation:
    """An observation of fewer elements, whose centres are those `chosen`."""
    if chosen is None:
        return whole
    places = np.array(chosen)
    centres = whole.stations[places + 1]
    edges = np.concatenate([whole.edges[:1], (centres[1:] + centres[:-1]) / 2, whole.edges[-1:]])
    length = np.diff(whole.edges)
    along = np.interp(edges, whole.edges, np.concatenate([[0.0], np.cumsum(whole.stretch * length)]))

    def at_edges(values: Floats) -> Floats:
        return np.stack([np.interp(edges, whole.edges, values[:, i]) for i in range(3)], axis=1)

    return replace(
        whole,
        points=at_edges(whole.points),
        frames=whole.frames[np.concatenate([[0], places + 1, [len(whole.stations) - 1]])],
        stations=np.concatenate([whole.stations[:1], centres, whole.stations[-1:]]),
        edges=edges,
        stretch=np.diff(along) / np.diff(edges),
        velocities=at_edges(whole.velocities),
        spins=whole.spins[places],
    )
