"""Selective mass of the rings: what a step changes in their velocities, smoothed round each ring.

The short elements at the tip carry the tension of a thick ring, and as strings they would need a third of the step. Mass is added to the
differences of neighbouring nodes only, 1/2 beta m sum |v_q+1 - v_q|^2: with v* the velocity after all forces and axial solves, and D v_old
what linear damping leaves of the old one,

    v = D v_old + (1 + beta L)^-1 (v* - D v_old),     L v = 2 v_q - v_q-1 - v_q+1

Translation feels nothing of it, and momentum stays. The inverse is two recursions in turn, with r + 1/r = 2 + 1/beta,

    (1 + beta L)^-1 = (1 - r)^2 (1 - r T)^-1 (1 - r T^-1)^-1,     T the shift by one node

each closed round the ring with 1 / (1 - r^n). It has to come after the axial solves: forces smoothed before would leave the explicit part
of the viscous tension and its implicit correction at different places.

And there has to be another axial solve behind it. Over a step the viscosity of a hoop at the tip is thousands of times its mass, so that
the axial solve all but forbids its elements to change their length: it takes from the other forces f what would do so, P f with P a
projector. Smoothed afterwards, they move the ring by (1 + beta L)^-1 P f. Neither of the two factors knows the other, so that their product
is not symmetric, and what was the gradient of an energy is none any more: thick muscles that push into a ring of the tip make it flutter,
by 50 to 200 1/s, also at a quarter of the step if the mass is left as it is. Solved again, for the rates that the first solve had left, it
is P (1 + beta L)^-1 P f, which is symmetric, and the hoop is as stiff as its viscosity has it.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from .family_kernels import family_offsets
from .pressure_kernels import slab_offsets

ONE = np.uint64(1)


def ring_mass_kernels(grid: AssemblyGrid) -> Any:
    """Compile ``smooth(buffer, part)``; the rows MMINUS of the rings hold what damping has left of the old velocities."""
    g, t = family_offsets(grid, True), slab_offsets(grid)
    L, nodes = np.uint64(grid.lanes), np.uint64(grid.ring_nodes)
    rows, kept = (tuple(g[f"{f}{i}"] for i in (1, 2, 3)) for f in ("V", "MMINUS"))
    ROOT, GAIN, CLOSURE, UP, DOWN, SHARE = (t[k] for k in ("ROOT", "GAIN", "CLOSURE", "UP", "DOWN", "SHARE"))

    @kernel
    def smooth(b: Any, part: Any) -> None:
        for row in range(3):
            v, old = rows[row], kept[row]
            for i in range(part.low, part.high):
                b[UP + i], b[DOWN + i], b[SHARE + i] = 0.0, 0.0, 1.0
            # What the recursion up ends with, if it begins with nothing: closed, it begins with what it ends with.
            for node in range(ONE, nodes + ONE):
                for i in range(part.low, part.high):
                    k = node * L + i
                    b[UP + i] = b[v + k] - b[old + k] + b[ROOT + i] * b[UP + i]
            for i in range(part.low, part.high):
                b[UP + i] *= b[CLOSURE + i]
            # Up: y_q = x_q + r y_q-1; and what that down will end with.
            for node in range(ONE, nodes + ONE):
                for i in range(part.low, part.high):
                    k = node * L + i
                    y = b[v + k] - b[old + k] + b[ROOT + i] * b[UP + i]
                    b[UP + i], b[v + k] = y, y
                    b[DOWN + i] += b[SHARE + i] * y
                    b[SHARE + i] *= b[ROOT + i]
            for i in range(part.low, part.high):
                b[DOWN + i] *= b[CLOSURE + i]
            # Down: z_q = y_q + r z_q+1.
            place = nodes
            while place >= ONE:
                for i in range(part.low, part.high):
                    k = place * L + i
                    z = b[v + k] + b[ROOT + i] * b[DOWN + i]
                    b[DOWN + i], b[v + k] = z, b[old + k] + b[GAIN + i] * z
                place -= ONE

    return smooth
