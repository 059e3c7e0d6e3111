"""Time of a plant: the step, and the limit above which it would be unstable."""

from dataclasses import dataclass

import numpy as np

from ..errors import OctoctrlError, check_number

SAFETY = 0.8
"""Share of the predicted limit at rest that ``dt="auto"`` takes; a strongly shortened arm has a limit lower by up to 17 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepLimit:
    """Predicted largest stable step of a rod.

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

    def __str__(self):
        return f"{self.step:.2g} s ({self.mechanism}, element {self.element})"


def choose_step(dt, limit, largest=np.inf):
    """The time step: `dt` if it is stable, or `SAFETY` times the limit for ``"auto"``.

    Parameters
    ----------
    dt : float or "auto", s
    limit : StepLimit
    largest : float, s
        What ``"auto"`` takes at most, stable or not.

    Returns
    -------
    float, s

    Raises
    ------
    OctoctrlError
        If `dt` is larger than the limit.
    """
    if dt == "auto":
        return min(SAFETY * limit.step, largest)
    check_number("dt", dt, above=0.0, unit="s")
    if dt > limit.step:
        raise OctoctrlError(f"dt={dt:g} s exceeds the stability bound {limit.step:.2g} s ({limit.mechanism}); use dt='auto'")
    return dt
