"""What a regulator withstands, as information beside a verdict: disk margin, delay margin, induced gain.

The first two belong to the clock that stands at the plan's end, where the loop is time-invariant: L(z) = K (z - A)^-1 B, opened at the
levels of all channels at once. With S = (1 + L)^-1 and T = 1 - S, the disk margin alpha with

    1 / alpha  =  largest singular value of (S - T) / 2  over all frequencies

lets all gains change independently between (1 - alpha/2) / (1 + alpha/2) and its inverse, and all phases by 2 atan(alpha/2) (Seiler,
Packard & Gahinet 2020; with the largest singular value in the place of the structured one this is a lower bound). The induced gain is
that of the whole plan, which is time-varying: the largest ratio of root sums of squares, twist and writhe in turns over disturbances of
the levels. All of it is said of the linear models along the plan: it knows no bounds of levels, and nothing of a state far from the plan.
"""

import numpy as np

from ..contracts import Floats
from .design import Course

FREQUENCIES, ITERATIONS, LONGEST = 200, 30, 60
"""Points between a hundredth of the Nyquist frequency and that; iterations for the induced gain; periods of delay that are tried."""


def disk_margin(course: Course) -> float:
    """The disk margin alpha of the standing clock at the end of a `course`."""
    final, groups = course.final, len(course.channels)
    nyquist, one = np.pi / course.period, np.eye(len(final.linear.transition))
    places = np.exp(1j * course.period * np.geomspace(0.01 * nyquist, nyquist, FREQUENCIES))
    response = final.gain @ np.linalg.solve(places[:, None, None] * one - final.linear.transition, final.linear.influence)
    unit = np.eye(groups)
    sensitivity = np.linalg.inv(unit + response)
    return float(1 / np.linalg.norm(sensitivity - unit / 2, 2, axis=(1, 2)).max())


def delay_margin(course: Course) -> float:
    """Longest unforeseen delay of all corrections, s, with which the standing clock's loop is stable; whole periods, `LONGEST` at most."""
    final = course.final
    a, b, k = final.linear.transition, final.linear.influence, final.gain
    size, groups = b.shape
    for late in range(1, LONGEST + 1):
        held = late * groups
        whole = np.zeros((size + held, size + held))
        whole[:size, :size], whole[:size, size : size + groups] = a, b
        whole[size : size + held - groups, size + groups :] = np.eye(held - groups)
        whole[size + held - groups :, :size] = -k
        if np.abs(np.linalg.eigvals(whole)).max() >= 1:
            return (late - 1) * course.period
    return LONGEST * course.period


def induced_gain(course: Course) -> float:
    """Largest ratio of errors of twist and writhe to disturbances of the levels over the whole `course`, turns: by power iteration."""
    closed = [period.closed() for period in course.periods]
    influence = [period.linear.influence for period in course.periods]
    slopes = [*(period.linear.slopes[:2] for period in course.periods[1:]), course.final.linear.slopes[:2]]
    pushed, gain = np.ones((len(closed), len(course.channels))), 0.0
    for _ in range(ITERATIONS):
        pushed = pushed / np.linalg.norm(pushed)
        x, errors = np.zeros(len(closed[0])), list[Floats]()
        for k, push in enumerate(pushed):
            x = closed[k] @ x + influence[k] @ push
            errors.append(slopes[k] @ x)
        gain, back = float(np.linalg.norm(errors)), np.zeros(len(closed[0]))
        for k in range(len(closed) - 1, -1, -1):
            back = back + slopes[k].T @ errors[k]
            pushed[k] = influence[k].T @ back
            back = closed[k].T @ back
    return gain


def margins(course: Course) -> dict[str, float]:
    """All of them: of the standing clock at the end of a `course`, and of the course itself.

    Parameters
    ----------
    course : Course

    Returns
    -------
    dict of str to float
        ``"disk"``; ``"gain"``, the factor by which all gains may rise or fall; ``"phase"``, rad; ``"delay"``, s; ``"induced gain"``, turns.
    """
    alpha = disk_margin(course)
    gain = (2 + alpha) / (2 - alpha) if alpha < 2 else np.inf
    return {
        "disk": alpha,
        "gain": float(gain),
        "phase": float(2 * np.arctan(alpha / 2)),
        "delay": delay_margin(course),
        "induced gain": induced_gain(course),
    }
