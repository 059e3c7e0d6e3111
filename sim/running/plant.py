"""A plant: a core that moves by the step of a clock. What all plants share is here: levels, recording, second tries, copies, files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..body.arm import Arm
from ..body.layout import MuscleLayout
from ..contracts import ActivationSource, Core, Floats, Motion, State
from ..errors import OctoctrlError, PlantUnstableError, check_kind, check_number
from ..findings import Finding, Stop
from ..scene.loads import Load, checked_loads, sampled_loads
from ..scene.mesh import Mesh
from ..scene.scene import Scene
from ..sources import Held, sampled
from .clock import Clock, StepLimit
from .observation import Observation, with_ends
from .recording import Recording
from .state_files import read_state, write_state


class Plant:
    """A simulated arm, see `octoctrl.sim.contracts.PlantLike`.

    Parameters
    ----------
    core : Core
    clock : Clock
    gains : mapping of str to float, optional
        Factors in [0, 1] on the levels of muscle groups: what a weak muscle makes of what it is told, 0 for a dead one. Recordings hold
        what it was told.
    automatic : bool
        Whether a sample in which the run would stop is tried again at the finer steps of the core.

    Attributes
    ----------
    retried : int
        How often that helped.

    Raises
    ------
    OctoctrlError
        If a gain is out of range.
    """

    def __init__(self, core: Core, clock: Clock, *, gains: Mapping[str, float] | None = None, automatic: bool = False) -> None:
        if gains is not None:
            check_kind("gains", gains, Mapping, 'for example {"LM2": 0.5}')
        self._core, self._clock, self._gains = core, clock, dict(gains or {})
        self._factors = _factors(self._gains, core.arm.layout)
        edges = core.partitions["arm"]
        self._stations = np.concatenate([[0.0], (edges[1:] + edges[:-1]) / 2, [core.arm.length]])
        self._meshes = {item.name: item for item in core.scene.objects if isinstance(item, Mesh)}
        self._automatic, self._retried, self._samples = automatic, 0, 0
        core.start(clock)
        core.rest()

    def __setattr__(self, name: str, value: Any) -> None:
        """Settle what a plant is when it is made."""
        if isinstance(getattr(type(self), name, None), property):
            raise AttributeError(f"'{name}' of a plant is settled when it is made and cannot be set; make another plant")
        super().__setattr__(name, value)

    @property
    def core(self) -> Any:
        """What moves, a `Core`; what it has beyond that contract is its own."""
        return self._core

    @property
    def model(self) -> str:
        """Name of the model with its numerics."""
        return self._core.model

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self._core.arm

    @property
    def scene(self) -> Scene:
        """What is around it."""
        return self._core.scene

    @property
    def clock(self) -> Clock:
        """How time is divided."""
        return self._clock

    @property
    def limit(self) -> StepLimit:
        """Predicted largest stable step at rest, and what would grow above it."""
        return self._core.limit

    @property
    def period(self) -> float:
        """Usual time between corrections by feedback, s."""
        return self._core.period

    @property
    def h(self) -> float:
        """Time step in use, s."""
        return self._clock.step

    @property
    def steps(self) -> int:
        """Steps in each sample."""
        return self._clock.steps

    @property
    def sample_interval(self) -> float:
        """How often activation is sampled (linear in between) and the motion is checked, s."""
        return self._clock.sample

    @property
    def record_every(self) -> int:
        """Every so many samples are recorded, and the last."""
        return self._clock.record

    @property
    def gains(self) -> dict[str, float]:
        """Factors on the levels of the groups that have one."""
        return dict(self._gains)

    @property
    def edges(self) -> Floats:
        """Arclengths (n + 1,) that bound the elements, m."""
        return self._core.partitions["arm"]

    @property
    def stations(self) -> Floats:
        """Arclengths (n + 2,) of the frames: base, element centres, tip, m."""
        return self._stations

    @property
    def elements(self) -> int:
        """Elements along the arm."""
        return len(self.edges) - 1

    @property
    def automatic(self) -> bool:
        """Whether a sample in which the run would stop is tried again at finer steps."""
        return self._automatic

    @property
    def retried(self) -> int:
        """How often that helped."""
        return self._retried

    @property
    def samples(self) -> int:
        """Samples done."""
        return self._samples

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self._samples * self._clock.sample

    def __repr__(self) -> str:
        return f"<plant '{self.model}' of arm '{self.arm.name}', {self.elements} elements, step {self.h:.3g} s, at t={self.time:g} s>"

    def set_steps(self, steps: int) -> None:
        """Take `steps` steps in each sample, stable or not, and try no others: for studies of stability."""
        self._automatic = False
        self._clock = replace(self._clock, steps=steps)
        self._core.start(self._clock)

    def reset(self) -> Observation:
        """Put the arm back to rest at time zero; returns the first `Observation`."""
        self._core.rest()
        self._samples = 0
        return self.observe()

    def observe(self) -> Observation:
        """What can be seen now, as an `Observation`."""
        return self._seen(*self._core.shape())

    def _seen(self, points: Floats, frames: Floats, stretch: Floats) -> Observation:
        velocities, spins = self._core.speeds()
        return Observation(
            time=self.time,
            points=points,
            frames=with_ends(frames, self.edges),
            stations=self._stations,
            edges=self.edges,
            stretch=stretch,
            velocities=velocities,
            spins=spins,
        )

    def step(
        self, levels: ActivationSource | ArrayLike | Mapping[str, float | ArrayLike], duration: float, *, loads: Sequence[Load] = ()
    ) -> Observation:
        """Move on by `duration` under levels that are held, without a recording.

        Parameters
        ----------
        levels : (groups,) or (groups, n) array_like, dict of str to float or (n,) array_like, or ActivationSource
            Levels of the muscle groups of the arm's layout, by element or for all; a dict names the groups that are active;
            a source is sampled in the plant's own time.
        duration : float, s
            A multiple of `sample_interval`.
        loads : sequence of Load
            Forces and torques on the arm during this step, beside those of the scene; see `octoctrl.sim.scene.loads`.

        Returns
        -------
        Observation
            Afterwards.

        Raises
        ------
        PlantUnstableError
            As `advance` does.
        OctoctrlError
            As `advance` does.
        """
        named: Any = levels
        given: ActivationSource = named if callable(getattr(levels, "levels", None)) else Held.of(named, self.edges, layout=self.arm.layout)
        left, more = self._clock.samples(duration), checked_loads(loads)
        while left:
            count = min(self._clock.chunk, left)
            _, motion = self._moved(self._sampled(given, count), self._loads(count, more))
            left -= count
        return self._seen(motion.points[-1], motion.frames[-1], motion.stretch[-1])

    def advance(self, source: ActivationSource, duration: float, *, progress: Callable[[float], None] | None = None) -> Recording:
        """Move on by `duration` under an activation, recorded.

        Parameters
        ----------
        source : Activation, or any object with ``levels(times, edges)``
            Levels (T, groups, n) of the groups of the arm's layout, in the plant's own time.
        duration : float, s
            A multiple of `sample_interval`.
        progress : callable, optional
            Called with the simulated seconds done, at the begin and after each chunk.

        Returns
        -------
        Recording
            From now to the end, both included. A KeyboardInterrupt ends it at the last chunk, with ``complete=False``.

        Raises
        ------
        PlantUnstableError
            If the motion diverges; carries the recording up to the last good sample. The plant goes back to the begin of the chunk in
            which it happened, at most that many samples earlier.
        OctoctrlError
            If `duration` is not a multiple of the sample interval, or what `octoctrl.sim.sources.sampled` refuses.
        """
        samples, first = self._clock.samples(duration), self._samples
        levels = self._sampled(source, min(self._clock.chunk, samples))
        pieces, last, note = [self._now(levels["arm"][0])], levels["arm"][0], ""
        try:
            _tell(progress, 0.0)
            while True:
                pieces += self._moved(levels, self._loads(len(levels["arm"]) - 1), keep=True)[0]
                last = levels["arm"][-1]
                _tell(progress, (self._samples - first) * self._clock.sample)
                left = samples - (self._samples - first)
                if not left:
                    break
                levels = self._sampled(source, min(self._clock.chunk, left))
        except KeyboardInterrupt:
            note = f"interrupted at t={self.time:.3f} s"
        except PlantUnstableError as error:
            if error.recording is not None:
                pieces.append(error.recording)
            error.recording = _joined(pieces, str(error))
            raise
        if pieces[-1].time.size == 0 or pieces[-1].time[-1] < self.time - 0.5 * self._clock.sample:
            pieces.append(self._now(last))
        return _joined(pieces, note)

    def strands(self) -> dict[str, tuple[Floats, Floats]]:
        """The rods of which the arm consists, for pictures: nodes (rods, nodes, 3) and radii at rest (rods, nodes), m, by family.

        Empty where the arm is one rod.
        """
        found: dict[str, tuple[Floats, Floats]] = getattr(self._core, "strands", dict)()
        return found

    def state(self) -> State:
        """The whole motion now, as arrays by name, to come back to with `restore`."""
        return {**self._core.state(), "samples": np.array(self._samples)}

    def restore(self, state: State) -> Observation:
        """Go to a `state` of this plant, or of one that differs in nothing but its clock's step."""
        samples = int(state["samples"])
        self._core.restore(state)
        self._samples = samples
        return self.observe()

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the state to an ``.npz`` file; `load` continues from it bit by bit.

        Parameters
        ----------
        path : str or Path
        overwrite : bool
            Whether an existing file may be replaced.

        Returns
        -------
        Path

        Raises
        ------
        OctoctrlError
            If the suffix is not ``.npz``, the file exists, or it cannot be written.
        """
        return write_state(path, self.state(), self.identity(), overwrite=overwrite)

    def load(self, path: str | Path) -> Observation:
        """Go to a state written by `save`.

        Parameters
        ----------
        path : str or Path

        Returns
        -------
        Observation

        Raises
        ------
        OctoctrlError
            If there is no such file, it holds no state or is damaged, or it belongs to another model, arm, resolution, water, step or
            sample interval.
        """
        state, mine = read_state(path, self.identity()), self.state()
        # Compiled code trusts the shapes of what it is given.
        if state.keys() != mine.keys() or any(_form(state[name]) != _form(mine[name]) for name in mine):
            raise OctoctrlError(f"{path} holds no whole state of this plant, or is damaged")
        return self.restore(state)

    def identity(self) -> dict[str, Any]:
        """What a saved state must share with the plant that goes on from it."""
        water = self.scene.water
        wet: dict[str, Any] = {"water": "none" if water is None else "there"}
        if water is not None:
            wet |= {f"water.{item.name}": getattr(water, item.name) for item in fields(water)}
        known = {"model": self.model, "arm": self.arm.fingerprint, **self._core.identity()}
        return known | {"sample_interval": self.sample_interval, "steps": self.steps} | wet

    def _sampled(self, source: ActivationSource, count: int) -> dict[str, Floats]:
        if type(source) is Held:  # which has been checked
            return {name: source.over(count + 1, edges) for name, edges in self._core.partitions.items()}
        return sampled(source, self._clock.instants(self._samples, count), self._core.partitions, self.arm.layout)

    def _loads(self, count: int, more: tuple[Load, ...] = ()) -> dict[str, Floats]:
        """Loads at the samples, beside the levels among the inputs of a core; nothing if there are none."""
        loads = self.scene.loads + more
        if not loads:
            return {}
        if not self._core.loadable:
            raise OctoctrlError(f"the plant '{self.model}' carries no loads; leave them out, or take a plant that does, such as 'rod'")
        found = sampled_loads(loads, self._clock.instants(self._samples, count), self.edges)
        return {} if found is None else {"loads": found}

    def _moved(self, levels: dict[str, Floats], loads: dict[str, Floats], *, keep: bool = False) -> tuple[list[Recording], Motion]:
        """Go to the end of `levels`; returns what is recorded on the way, if asked to `keep` it, and the last motion."""
        core, clock, first, count = self._core, self._clock, self._samples, len(levels["arm"]) - 1
        acting = levels if self._factors is None else {name: self._factors * values for name, values in levels.items()}
        acting = acting | loads
        good, pieces = core.state(), []
        while self._samples - first < count:
            done = self._samples - first
            rest, before = {name: values[done:] for name, values in acting.items()}, good if not done else core.state()
            motion = core.move(self._samples, rest, clock)
            again = self._automatic and bool(core.finer)
            if motion.finding is Finding.SUNK:
                motion = motion.until(-1) if again else motion._replace(finding=Finding.FINE)
            if keep or motion.finding:
                pieces.append(self._piece(motion, levels["arm"][done:]))
            moved = len(motion.points)
            if not motion.finding:
                self._samples += moved
                continue
            finer = self._finer(before, rest, moved) if again else None
            if finer is None or finer.finding:
                if finer is not None and motion.finding is Finding.SUNK:  # at a finer step that would not have stopped it
                    motion = motion._replace(finding=finer.finding, rod=finer.rod, element=finer.element)
                if motion.finding is Finding.ASTRAY:
                    stop = Stop.astray((self._samples + moved + 1) * clock.sample, motion.rod)
                else:
                    stop = core.explain(before, self._samples, rest, motion, clock)
                core.restore(good)
                self._samples = first
                kept = Recording.joined(pieces).until(stop.time - 0.5 * clock.step)
                limit = f"predicted limit {core.limit.step:.2g} s from {core.limit.mechanism}"
                raise PlantUnstableError.of(stop, stop.message(clock.step, limit), kept)
            self._samples += moved
            pieces.append(replace(self._piece(finer, levels["arm"][done + moved : done + moved + 2]), finer=1))
            self._samples += 1
            motion = finer
        return pieces, motion

    def _finer(self, before: State, inputs: dict[str, Floats], moved: int) -> Motion:
        """The sample after so many that `moved`, at parts of the step; with a finding if it stops there too."""
        core, first = self._core, self._samples + moved
        core.restore(before)
        if moved:
            core.move(self._samples, {name: values[: moved + 1] for name, values in inputs.items()}, self._clock)
        sample, good = {name: values[moved : moved + 2] for name, values in inputs.items()}, core.state()
        try:
            for parts in core.finer:
                finer = self._clock.finer(parts)
                core.start(finer)
                motion = core.move(first, sample, finer)
                if not motion.finding or (motion.finding is Finding.SUNK and parts == core.finer[-1]):
                    self._retried += 1
                    return motion._replace(finding=Finding.FINE)
                core.restore(good)
        finally:
            core.start(self._clock)
        return motion

    def _piece(self, motion: Motion, levels: Floats) -> Recording:
        """What is recorded of a motion that begins now, whose levels (T + 1, groups, n) begin with those of now."""
        record, first = self._clock.record, self._samples + 1
        keep = slice(-first % record, None, record)
        numbers = first + np.arange(len(motion.points), dtype=np.float64)
        return Recording(
            time=numbers[keep] * self._clock.sample,
            points=motion.points[keep].copy(),
            frames=with_ends(motion.frames[keep], self.edges),
            stations=self._stations,
            stretch=motion.stretch[keep].copy(),
            levels=levels[1 : len(numbers) + 1][keep].copy(),
            series={name: values[keep].copy() for name, values in motion.series.items()},
            meshes=self._meshes,
        )

    def _now(self, levels: Floats) -> Recording:
        points, frames, stretch = self._core.shape()
        return Recording(
            time=np.array([self.time]),
            points=points[None],
            frames=with_ends(frames, self.edges)[None],
            stations=self._stations,
            stretch=stretch[None],
            levels=levels[None],
            series={name: np.asarray(value, dtype=float)[None] for name, value in self._core.series().items()},
            meshes=self._meshes,
        )


def _factors(gains: Mapping[str, float], layout: MuscleLayout) -> Floats | None:
    """Factors (groups, 1) on the levels, None if there are none."""
    factors = np.ones((len(layout), 1))
    for group, gain in gains.items():
        check_number(f"gain of {group}", gain, at_least=0.0, at_most=1.0)
        factors[layout.index(group)] = gain
    return factors if gains else None


def _form(values: Floats) -> tuple[Any, ...]:
    return np.shape(values), np.asarray(values).dtype


def _tell(progress: Callable[[float], None] | None, seconds: float) -> None:
    if progress is not None:
        progress(seconds)


def _joined(pieces: list[Recording], note: str) -> Recording:
    return replace(Recording.joined(pieces), complete=not note, note=note)
