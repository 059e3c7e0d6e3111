"""Many plants at once over the cores of one machine.

A plant's time loop is one compiled call that holds no Python lock, so plain threads are enough: while one thread steps its arm, another
samples the activation of the next or stores its recording. Arms share nothing, hence every one moves as it would alone, bit by bit.
"""

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from threading import Event
from time import perf_counter

from ..contracts import ActivationSource, PlantLike
from ..errors import OctoctrlError, PlantUnstableError, check_number
from ..records import Record
from .recording import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchFailure:
    """An arm that did not reach the end.

    Attributes
    ----------
    index : int
        Its place in the batch.
    time : float, s
    rod : str
    element : int
    mechanism : str
    message : str
        All that in one sentence, with advice.
    """

    index: int
    time: float
    rod: str
    element: int
    mechanism: str
    message: str

    def __str__(self) -> str:
        return f"arm {self.index} at t={self.time:.3f} s: element {self.element} of the {self.rod} {self.mechanism}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class BatchResult(Record):
    """What a batch leaves behind.

    Attributes
    ----------
    recordings : tuple of Recording
        In the order of the plants; that of an arm that failed ends at its last good sample, with ``complete=False``.
    failures : tuple of BatchFailure
        By index; empty if all is well.
    wall_time : float, s
    """

    recordings: tuple[Recording, ...]
    failures: tuple[BatchFailure, ...]
    wall_time: float

    @property
    def arm_seconds(self) -> float:
        """Simulated time of all arms together, s."""
        return sum(float(recording.time[-1] - recording.time[0]) for recording in self.recordings)

    @property
    def throughput(self) -> float:
        """Simulated seconds of arm per second of wall time."""
        return self.arm_seconds / self.wall_time

    def raise_if_failed(self) -> None:
        """Raise the first failure.

        Raises
        ------
        PlantUnstableError
            If an arm failed.
        """
        if self.failures:
            first = self.failures[0]
            raise PlantUnstableError(
                f"{len(self.failures)} of {len(self.recordings)} arms failed; arm {first.index}: {first.message}",
                time=first.time,
                rod=first.rod,
                element=first.element,
                mechanism=first.mechanism,
                recording=self.recordings[first.index],
            )


def simulate_batch(
    plants: Iterable[PlantLike],
    activations: ActivationSource | Iterable[ActivationSource],
    duration: float,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> BatchResult:
    """Move many plants on by `duration`, side by side.

    Parameters
    ----------
    plants : sequence of Plant
        Of any arms, scenes and models; each goes on from its present state, and a further call continues the batch.
    activations : sequence of Activation, or one Activation for all
        Or any objects that `Plant.advance` takes.
    duration : float, s
        A multiple of every plant's `sample_interval`.
    threads : int, optional
        Arms that move at the same time; as many as there are cores if omitted. Results do not depend on it.
    progress : callable, optional
        Called with the number of arms done after each.

    Returns
    -------
    BatchResult
        Arms that diverge are listed in it and do not stop the others. A KeyboardInterrupt ends every recording at its present chunk,
        with ``complete=False``.

    Raises
    ------
    OctoctrlError
        If the numbers of plants and activations differ, a plant is named twice, or what `Plant.advance` refuses; the message names the
        arm, and the others stop where they are.
    """
    plants = tuple(plants)
    sources = tuple(activations) if isinstance(activations, Iterable) else (activations,) * len(plants)
    _check(plants, sources, threads)
    stop, failures = Event(), list[BatchFailure]()

    def heed(_: float) -> None:
        if stop.is_set():
            raise KeyboardInterrupt

    def advance(index: int) -> Recording:
        try:
            return plants[index].advance(sources[index], duration, progress=heed)
        except PlantUnstableError as error:
            failures.append(_failure(index, error))
            kept: Recording = error.recording
            return kept
        except OctoctrlError as error:
            raise OctoctrlError(f"arm {index} of the batch: {error}") from None

    begin = perf_counter()
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        running = [pool.submit(advance, index) for index in range(len(plants))]
        recordings = _collect(running, stop, progress)
    return BatchResult(
        recordings=recordings, failures=tuple(sorted(failures, key=lambda item: item.index)), wall_time=perf_counter() - begin
    )


def _check(plants: Sequence[PlantLike], activations: Sequence[ActivationSource], threads: int | None) -> None:
    if not plants:
        raise OctoctrlError("the batch has no plants; give at least one")
    if len(activations) != len(plants):
        raise OctoctrlError(f"{len(plants)} plants but {len(activations)} activations; give one for each, or a single Activation for all")
    if len({id(plant) for plant in plants}) != len(plants):
        raise OctoctrlError("a plant stands twice in the batch; make one for each arm")
    if threads is not None:
        check_number("threads", threads, at_least=1)


def _collect(running: "Sequence[Future[Recording]]", stop: Event, progress: Callable[[int], None] | None) -> tuple[Recording, ...]:
    """Recordings in order; whatever ends the waiting early also ends the arms."""
    try:
        for done, arm in enumerate(as_completed(running), start=1):
            arm.result()
            if progress is not None:
                progress(done)
    except KeyboardInterrupt:
        stop.set()
    except BaseException:
        stop.set()
        raise
    return tuple(arm.result() for arm in running)


def _failure(index: int, error: PlantUnstableError) -> BatchFailure:
    return BatchFailure(index=index, time=error.time, rod=error.rod, element=error.element, mechanism=error.mechanism, message=str(error))
