"""Time of a plant: one vocabulary for all of it, and the choice of a step below the limit above which it would be unstable.

======== ============================================================================================
step     of the integration; ``h`` in compiled code
sample   so many steps: levels and loads are linear in between, motion is checked at its end
record   every so many samples an instant is kept
chunk    so many samples in one compiled call: how often progress is shown and Ctrl-C is answered
period   between corrections of a controller
======== ============================================================================================

``dt`` is what a user calls the step that he asks for; no part of the package does.
"""

from dataclasses import dataclass, replace
from math import ceil
from typing import Literal

import numpy as np

from ..contracts import Floats
from ..errors import OctoctrlError, check_count, check_number

SAFETY = 0.8
"""Share of the predicted limit at rest that ``dt="auto"`` takes; a strongly shortened arm has a limit lower by up to 17 %."""

SAMPLE, RECORD, CHUNK = 5e-3, 2, 100
"""Usual sample (s), record (samples) and chunk (samples)."""

MOST_STEPS = 100_000
"""Steps per sample: more would hold up progress and Ctrl-C for minutes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepLimit:
    """Predicted largest stable step of a plant.

    Attributes
    ----------
    step : float, s
    mechanism : str
        What moves in the mode that would grow.
    element : int
        Where that mode is largest.
    """

    step: float
    mechanism: str
    element: int

    def __str__(self) -> str:
        return f"{self.step:.2g} s ({self.mechanism}, element {self.element})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Clock:
    """How a plant's time is divided.

    Attributes
    ----------
    steps : int
        In each sample.
    sample : float, s
    record : int
        Samples.
    chunk : int
        Samples.

    Raises
    ------
    OctoctrlError
        If a number is out of range.
    """

    steps: int
    sample: float = SAMPLE
    record: int = RECORD
    chunk: int = CHUNK

    def __post_init__(self) -> None:
        check_number("sample_interval", self.sample, at_least=1e-4, at_most=0.1, unit="s")
        check_count("record_every", self.record)
        check_count("chunk", self.chunk)
        check_count("steps", self.steps)

    @classmethod
    def choose(
        cls,
        limit: StepLimit,
        usual: float,
        *,
        dt: float | Literal["auto"] = "auto",
        sample_interval: float = SAMPLE,
        record_every: int = RECORD,
    ) -> "Clock":
        """The clock of a plant with whole steps in each sample.

        Parameters
        ----------
        limit : StepLimit
            Of the plant.
        usual : float, s
            What ``"auto"`` takes at most.
        dt : float or "auto", s
            Largest step.
        sample_interval : float, s
        record_every : int
            Samples.

        Raises
        ------
        OctoctrlError
            If `dt` is larger than the limit, or the plant would need more than `MOST_STEPS` in a sample.
        """
        check_number("sample_interval", sample_interval, at_least=1e-4, at_most=0.1, unit="s")
        steps = max(1, ceil(sample_interval / choose_step(dt, limit, usual) - 1e-9))
        if steps > MOST_STEPS:
            raise OctoctrlError(
                f"the arm needs steps of {sample_interval / steps:.1g} s, {steps} in each sample_interval={sample_interval:g} s; "
                f"at most {MOST_STEPS} are done - use fewer elements or softer tissue"
            )
        return cls(steps=steps, sample=sample_interval, record=record_every)

    @property
    def step(self) -> float:
        """Time step, s."""
        return self.sample / self.steps

    def finer(self, parts: int) -> "Clock":
        """The same with `parts` steps in place of each."""
        return replace(self, steps=self.steps * parts)

    def samples(self, duration: float) -> int:
        """How many samples `duration` (s) is; refused if not a whole number of them."""
        check_number("duration", duration, unit="s")
        count = round(duration / self.sample)
        if count < 1 or abs(count * self.sample - duration) > 1e-9:
            raise OctoctrlError(f"duration={duration:g} s: needs a positive multiple of the sample interval {self.sample:g} s")
        return count

    def instants(self, first: int, count: int) -> Floats:
        """Times (count + 1,) of sample `first` and the `count` that follow, s."""
        return np.arange(first, first + count + 1) * np.float64(self.sample)


def choose_step(dt: float | Literal["auto"], limit: StepLimit, usual: float | None = None) -> float:
    """The time step: `dt` if it is stable, or for ``"auto"`` the `usual` one.

    Parameters
    ----------
    dt : float or "auto", s
    limit : StepLimit
    usual : float, optional, s
        `SAFETY` times the limit if omitted.

    Returns
    -------
    float, s

    Raises
    ------
    OctoctrlError
        If `dt` is larger than the limit.
    """
    if dt == "auto":
        return SAFETY * limit.step if usual is None else usual
    check_number("dt", dt, above=0.0, unit="s", advice="use dt='auto'")
    if dt > limit.step:
        raise OctoctrlError(f"dt={dt:g} s exceeds the stability bound {limit.step:.2g} s ({limit.mechanism}); use dt='auto'")
    return dt
