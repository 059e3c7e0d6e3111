"""One step of an arm's contact with itself: an implicit impulse between two of its points, along the line of their centres.

The law along the normal is that of `octoctrl.sim.contact.friction_kernels`, with the mobilities of both points. There is no friction: laps
of wet skin slide on each other, and so an impulse goes along the line of centres, which keeps momentum and angular momentum.
"""

from typing import Any

import numpy as np

from ..compiler import borrowing_kernel
from .friction_kernels import normal_impulse
from .near_kernels import HASTE, LEAST_MARGIN, SWELLING
from .sweep_kernels import Surface


def fold_sweeps(surface: Surface) -> Any:
    """Compile the contact of a surface with itself.

    Returns
    -------
    watch, part, note : compiled functions
        ``watch(buffer, folds, span)`` lists the pairs that may meet within a time (s), ``part(buffer, folds, h)`` exchanges impulses and
        returns whether there were any, and ``note(folds, sample, h, steps)`` keeps what there was of them in a sample and returns whether
        a finer step would follow better; `folds` an `octoctrl.sim.contact.folds.Folds`.
    """
    place, velocity, mobility, push = surface.place, surface.velocity, surface.mobility, surface.push

    @borrowing_kernel
    def watch(b: Any, folds: Any, span: Any) -> None:
        points, places, first, fastest, found = folds.points, folds.places, folds.first, 0.0, 0
        count = len(first)
        for p in range(count):
            places[0, p], places[1, p], places[2, p], places[3, p], square = place(b, points, p)
            fastest = max(fastest, square)
        folds.pace[0] = 2 * (2 * np.sqrt(fastest) + HASTE)
        margin = max(LEAST_MARGIN, span * folds.pace[0])
        for p in range(count):
            for q in range(first[p], count):
                d1, d2, d3 = places[0, p] - places[0, q], places[1, p] - places[1, q], places[2, p] - places[2, q]
                thick, square = SWELLING * (places[3, p] + places[3, q]), d1 * d1 + d2 * d2 + d3 * d3
                if square < (thick + margin) * (thick + margin):
                    folds.pairs[found, 0], folds.pairs[found, 1], folds.slack[found] = p, q, np.sqrt(square) - thick
                    found += 1
        folds.found[0] = found

    @borrowing_kernel
    def part(b: Any, folds: Any, h: Any) -> bool:
        points, sums, slack, rate, closes, pushed = folds.points, folds.sums, folds.slack, 1.0 / h, h * folds.pace[0], False
        for k in range(folds.found[0]):
            slack[k] -= closes
            if slack[k] > 0:
                continue
            p, q = folds.pairs[k, 0], folds.pairs[k, 1]
            x1, x2, x3, thick, _ = place(b, points, p)
            y1, y2, y3, thin, _ = place(b, points, q)
            n1, n2, n3 = x1 - y1, x2 - y2, x3 - y3
            distance = np.sqrt(n1 * n1 + n2 * n2 + n3 * n3)
            if distance == 0.0:
                continue
            n1, n2, n3, gap = n1 / distance, n2 / distance, n3 / distance, distance - thick - thin
            u1, u2, u3 = velocity(b, points, p, 0.0, 0.0, 0.0)
            v1, v2, v3 = velocity(b, points, q, 0.0, 0.0, 0.0)
            closing = (u1 - v1) * n1 + (u2 - v2) * n2 + (u3 - v3) * n3
            if gap >= 0 and gap + h * closing >= 0:
                slack[k] = distance - SWELLING * (thick + thin)
                continue
            w = mobility(b, points, p, 0.0, rate)[0] + mobility(b, points, q, 0.0, rate)[0]
            if w == 0.0:
                continue
            stiffness = folds.stiffness * min(points.length[p], points.length[q])
            size = normal_impulse(gap, closing, w, stiffness, h)
            if size > 0:
                push(b, points, p, 0.0, 0.0, 0.0, rate, size * n1, size * n2, size * n3)
                push(b, points, q, 0.0, 0.0, 0.0, rate, -size * n1, -size * n2, -size * n3)
                sums[0] += size
                sums[1] = max(sums[1], -gap)
                sums[2] += 1.0
                sums[3] = max(sums[3], -gap - size / (h * stiffness))
                pushed = True
        return pushed

    @borrowing_kernel
    def note(folds: Any, sample: Any, h: Any, steps: Any) -> bool:
        sums, notes = folds.sums, folds.notes
        notes[sample, 0], notes[sample, 1], notes[sample, 2] = sums[0] / (h * steps), sums[1], sums[2] / steps
        sunk = sums[3] > folds.bearable
        sums[:] = 0.0
        return sunk

    return watch, part, note
