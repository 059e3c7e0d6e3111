"""One run of the stability laboratory and how it ended: accurate, refused beforehand, stopped with the reason, or an undetected failure."""

import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np

from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.plants import Plant, make_plant
from octoctrl.sim.running.recording import Recording

from . import checks
from .trials import Trial

TOLERANCE = 0.01
"""Distance of the tip from that of a run at half the step, rms over time and over the arm's length, up to which a run is accurate."""
COMPARED = 5
"""One in so many finished runs is compared with one at half the step."""
PERTURBATION = 1e-6
"""Initial displacement of the nodes, over the arm's length, with which the sensitivity of a motion is probed."""
SENSITIVE = 100.0
"""Growth of that displacement from which no step could be expected to give the same motion."""


SAME_TIME = 0.1
"""Two runs stop at the same time if their times differ by less than this share."""


class Ending(Enum):
    """How a run of the laboratory ended; the value is the heading of its column."""

    ACCURATE = "accurate"
    FINISHED = "finished, all checks passed"
    SENSITIVE = "depends on everything"
    INACCURATE = "depends on the step"
    REFUSED = "refused beforehand"
    LIMIT = "stopped: beyond the model"
    UNSTABLE = "stopped: unstable step"
    UNDETECTED = "UNDETECTED"


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of a trial.

    Attributes
    ----------
    kind : str
    number : int
    ending : Ending
    reason : str
        For all but finished runs, one sentence.
    automatic : bool
        Whether the step was chosen by ``dt="auto"``.
    error : float or None
        Distance of the tip from that at half the step, rms over the arm's length.
    again : bool or None
        Of a stopped run: whether it also stops, at the same time, at a quarter of the step. It is then not the step that is to blame.
    stop : dict or None
        Of a stopped run: time, rod, element and mechanism.
    volume, slab_volume : float or None
        Of plants that record it, over that at rest: the volume of the whole arm, and of a slab between two rings, furthest from one.
    retried : int
        How many samples were done at a part of the step because they would have stopped.
    simulated, spent : float, s
        Arm motion and processor time.
    """

    kind: str
    number: int
    ending: Ending
    reason: str = ""
    automatic: bool = True
    error: float | None = None
    again: bool | None = None
    stop: dict[str, Any] | None = None
    volume: float | None = None
    slab_volume: float | None = None
    retried: int = 0
    simulated: float = 0.0
    spent: float = 0.0

    @property
    def undetected(self) -> bool:
        """Whether this is a failure that no guard caught."""
        return self.ending is Ending.UNDETECTED


def perform(trial: Trial) -> Outcome:
    """Carry out one `trial` and judge it."""
    begin = thread_time()
    try:
        found = _Run(trial).judged()
    except OctoctrlError as error:
        found = {"ending": Ending.REFUSED, "reason": str(error)}
    except Exception as error:
        found = {"ending": Ending.UNDETECTED, "reason": f"{type(error).__name__}: {error}"}
    if trial.kind == "huge step" and found["ending"] is not Ending.REFUSED:
        found = {"ending": Ending.UNDETECTED, "reason": f"a step of {trial.step:g} times the limit was accepted"}
    return Outcome(kind=trial.kind, number=trial.number, automatic=trial.step is None, spent=thread_time() - begin, **found)


class _Run:
    """A trial on its plant."""

    def __init__(self, trial: Trial) -> None:
        self.trial = trial
        self.plant = self._plant()

    def _plant(self, finer: int = 1, displacement: float = 0.0) -> Plant:
        """The trial's plant at its begin; at a part of the step, or with its nodes displaced at random."""
        from octoctrl.sim.body.arm import Arm
        from octoctrl.sim.scene.scene import Scene

        trial = self.trial
        if trial.plant != "rod":
            return make_plant(trial.plant)
        arm, scene = Arm(**trial.arm), Scene(water=None) if trial.water is None else Scene.free(factor=trial.water)
        plant = Plant(arm, scene)
        if trial.step is not None:
            plant = Plant(arm, scene, dt=trial.step * plant.limit.step)
        if finer > 1:
            plant = Plant(arm, scene, dt=plant.h / finer)
        shift = np.zeros((plant.elements + 1, 3))
        shift[:, 1] = (trial.stretch - 1) * plant.edges
        if displacement:
            shift[1:] += displacement * arm.length * np.random.default_rng(0).standard_normal((plant.elements, 3))
        plant.core.displace(shift)
        return plant

    def judged(self) -> dict[str, Any]:
        trial, plant = self.trial, self.plant
        try:
            recording, differing = self._recorded()
        except PlantUnstableError as error:
            return self._stopped(error)
        found = self._facts(recording)
        complaint = differing or next(filter(None, self._complaints(recording)), None)
        if complaint:
            return found | {"ending": Ending.UNDETECTED, "reason": complaint}
        if trial.number % COMPARED or trial.plant != "rod":
            return found | {"ending": Ending.FINISHED}
        apart = self._apart(recording, self._plant(finer=2))
        if apart < TOLERANCE:
            return found | {"ending": Ending.ACCURATE, "error": apart}
        growth = self._apart(recording, self._plant(displacement=PERTURBATION)) / PERTURBATION
        ending = Ending.SENSITIVE if growth > SENSITIVE else Ending.INACCURATE
        said = f"half the step moves the tip by {apart:.1%} of the length, a displacement of 1e-6 grows {growth:.0f} times"
        return found | {"ending": ending, "error": apart, "reason": f"{said}; {plant.elements} elements, step {plant.h:.2g} s"}

    def _recorded(self) -> tuple[Recording, str | None]:
        """The recording, and a complaint if bits differ that must not."""
        trial, plant = self.trial, self.plant
        if trial.kind == "stretched":
            return self._released()
        recording = plant.advance(trial.activation, trial.duration)
        if trial.kind == "restart":
            return recording, None if self._restarted() else "a loaded state does not continue with the same bits"
        if trial.kind == "threads":
            return recording, None if self._threaded(recording) else "a batch does not move with the same bits"
        return recording, None

    def _released(self) -> tuple[Recording, str | None]:
        def go(plant: Plant) -> tuple[Recording, float]:
            pieces, energies = [], [checks.passive_energy(plant)]
            for _ in range(round(self.trial.duration / 0.01)):
                pieces.append(plant.advance(self.trial.activation, 0.01))
                energies.append(checks.passive_energy(plant))
            return Recording.joined(pieces), checks.growth(np.array(energies))

        recording, growth = go(self.plant)
        if growth < checks.GROWTH:
            return recording, None
        by_itself = go(self._plant(finer=4))[1]
        grew = f"the energy of the passive arm grew by {growth:.1%}, at a quarter of the step by {by_itself:.1%}"
        return recording, grew if growth - by_itself > checks.GROWTH else None

    def _restarted(self) -> bool:
        trial, first = self.trial, self._plant()
        part = first.sample_interval * max(1, round(trial.duration * (1 + trial.number % 7) / 8 / first.sample_interval))
        first.advance(trial.activation, part)
        with tempfile.TemporaryDirectory() as folder:
            first.save(Path(folder) / "state.npz")
            again = self._plant()
            again.load(Path(folder) / "state.npz")
        again.advance(trial.activation, trial.duration - part)
        return all(np.array_equal(one, other) for one, other in zip(_state(self.plant), _state(again), strict=True))

    def _threaded(self, recording: Recording) -> bool:
        from octoctrl.sim.running.batch import simulate_batch

        result = simulate_batch([self._plant() for _ in range(3)], self.trial.activation, self.trial.duration, threads=2)
        return all(np.array_equal(recording.points, other.points) for other in result.recordings)

    def _complaints(self, recording: Recording) -> Iterator[str | None]:
        trial, plant = self.trial, self.plant
        yield checks.finite(recording)
        yield checks.orthonormal(recording)
        yield checks.held(recording)
        yield checks.linked(recording)
        yield checks.voluminous(recording)
        if trial.stretch == 1.0 and trial.plant == "rod":
            yield checks.powered(recording, plant.arm, plant.core.node_mass)
        if trial.kind == "settling":
            yield checks.settled(recording)

    def _apart(self, recording: Recording, plant: Plant) -> float:
        """Distance of the tip from that of another run, rms over time and over the arm's length; infinite if that one stops."""
        try:
            other = plant.advance(self.trial.activation, self.trial.duration)
        except PlantUnstableError:
            return np.inf
        return float(np.sqrt(np.mean(np.sum((recording.tip - other.tip) ** 2, axis=1)))) / plant.arm.length

    def _stopped(self, error: PlantUnstableError) -> dict[str, Any]:
        recording = error.recording
        complaint = checks.finite(recording) or checks.orthonormal(recording)
        if complaint:
            return self._facts(recording) | {"ending": Ending.UNDETECTED, "reason": f"kept in the recording of a stopped run: {complaint}"}
        again = None
        if self.trial.plant == "rod":
            try:
                self._plant(finer=4).advance(self.trial.activation, self.trial.duration)
                again = False
            except PlantUnstableError as other:
                again = abs(other.time - error.time) < SAME_TIME * error.time
        return self._facts(recording) | {
            "ending": Ending.UNSTABLE if error.stop and error.stop.unstable and not again else Ending.LIMIT,
            "reason": str(error),
            "again": again,
            "stop": {"time": error.time, "rod": error.rod, "element": error.element, "mechanism": error.mechanism},
        }

    def _facts(self, recording: Recording) -> dict[str, Any]:
        """What is told of every run: how long it went, how often it had to be helped, and what became of its volume."""
        volumes = {name: values for name, values in recording.series.items() if name in ("volume", "slab_volume")}
        furthest = {name: float(values.flat[np.abs(values - 1).argmax()]) for name, values in volumes.items()}
        return {"simulated": float(recording.time[-1]), "retried": self.plant.retried} | furthest


def _state(plant: Plant) -> Iterable[Any]:
    return plant.state().values()
