"""Tridiagonal systems along the arm, solved from both ends at once.

Elimination begins at either end and stops at the middle, where two unknowns are left; substitution goes from there outward again. So the
two halves of a system can be solved side by side, and the rounding is the same if one thread solves both. Where the rest of a system is
the unknowns of its other half, with d what elimination leaves of the diagonal, c the coupling of the middle two and r the right side,

    x_a = (r_a / d_a - c r_b / (d_a d_b)) / (1 - c^2 / (d_a d_b)),     and x_b likewise.
"""

from typing import Any

import numpy as np

from ..compiler import kernel

ONE = np.uint64(1)


def two_ended(rows: dict[str, np.uint64], coupling: str) -> tuple[Any, Any]:
    """Compile the solver of systems side by side.

    Parameters
    ----------
    rows : dict of str to uint64
        Offsets of the rows by name: SCALE the diagonal, later one over what is left of it, `coupling` that of an unknown and the next,
        IMPULSE the right side and in the end the solution, RATE for what elimination leaves of the right side.
    coupling : str

    Returns
    -------
    eliminate, substitute : compiled functions
        Of ``(buffer, first, last, middle, start, jump, count)``: the first unknown of a part and that behind its last, the first
        unknown above the middle, the place before the first unknown in the first system, and the distance to the next, of so many.
        Between the two all parts must have been eliminated, and know what that has left of the unknown beside the middle.
    """
    SCALE, IMPULSE, REDUCED, COUPLING = (rows[name] for name in ("SCALE", "IMPULSE", "RATE", coupling))

    @kernel
    def close(b: Any, place: Any) -> None:
        b[SCALE + place], b[IMPULSE + place], b[REDUCED + place], b[COUPLING + place] = 0.0, 0.0, 0.0, 0.0

    @kernel
    def eliminate(b: Any, first: Any, last: Any, middle: Any, start: Any, jump: Any, count: Any) -> None:
        # Systems in the inner loop: their chains of divisions run side by side in the processor.
        for system in range(count):
            place = start + np.uint64(system) * jump
            if first < middle:
                close(b, place + first - ONE)
            if last > middle:
                close(b, place + last)
                b[COUPLING + place + last - ONE] = 0.0
        for e in range(first, min(last, middle)):
            k = start + e
            for _ in range(count):
                coupling = b[COUPLING + k - ONE]
                scale = 1.0 / (b[SCALE + k] - coupling * coupling * b[SCALE + k - ONE])
                b[SCALE + k], b[REDUCED + k] = scale, scale * (b[IMPULSE + k] - coupling * b[REDUCED + k - ONE])
                k += jump
        e = last
        while e > max(first, middle):
            e -= ONE
            k = start + e
            for _ in range(count):
                coupling = b[COUPLING + k]
                scale = 1.0 / (b[SCALE + k] - coupling * coupling * b[SCALE + k + ONE])
                b[SCALE + k], b[REDUCED + k] = scale, scale * (b[IMPULSE + k] - coupling * b[REDUCED + k + ONE])
                k += jump

    @kernel
    def substitute(b: Any, first: Any, last: Any, middle: Any, start: Any, jump: Any, count: Any) -> None:
        k = start + middle - ONE
        for _ in range(count):
            n, coupling = k + ONE, b[COUPLING + k]
            here, there = coupling * b[SCALE + k], coupling * b[SCALE + n]
            share = 1.0 / (1.0 - here * there)
            if first < middle:
                b[IMPULSE + k] = share * (b[REDUCED + k] - here * b[REDUCED + n])
            if last > middle:
                b[IMPULSE + n] = share * (b[REDUCED + n] - there * b[REDUCED + k])
            k += jump
        e = min(last, middle - ONE)
        while e > first:
            e -= ONE
            k = start + e
            for _ in range(count):
                b[IMPULSE + k] = b[REDUCED + k] - b[SCALE + k] * b[COUPLING + k] * b[IMPULSE + k + ONE]
                k += jump
        for e in range(max(first, middle + ONE), last):
            k = start + e
            for _ in range(count):
                b[IMPULSE + k] = b[REDUCED + k] - b[SCALE + k] * b[COUPLING + k - ONE] * b[IMPULSE + k - ONE]
                k += jump

    return eliminate, substitute
