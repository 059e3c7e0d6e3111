"""The time loop of the elastic rod: blocks of steps, supports and follower loads, guard and recording inside one compiled call.

The motion is checked, and its state kept, at the end of every block, so that a run that diverges can go back to where it was still well.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..compiler import kernel
from ..contracts import Floats
from ..physics.rotation_kernels import rotation, turned
from .elastic_kernels import frame_kernel, rod_kernels
from .guard_kernels import FINE, guard_kernel, record_kernel
from .layout import STATE_ROWS, offsets
from .supports import HeldRows

ONE = np.uint64(1)
BLOCK, DRIVEN_BLOCK = 128, 8
"""Steps from one check to the next, and from knot to knot of the paths of driven supports."""


class Followers(NamedTuple):
    """Loads for the compiled loop: dead ones in the lab frame, and followers in the material frame of their element.

    `force` (n + 1, 3) and `couple` (n, 3) are dead; `inner` and `outer` (n, 3) are an element's forces on its nodes, `turning` (n, 3) its
    couples.
    """

    follow: bool
    force: Floats
    couple: Floats
    inner: Floats
    outer: Floats
    turning: Floats


def support_kernels(stride: int) -> tuple[Callable[..., Any], ...]:
    """Compile what supports do; `held` is `octoctrl.sim.rod.supports.HeldRows`.

    Returns
    -------
    hold, carry, snap : compiled functions
        ``hold(buffer, held, block, time, share, bulge)`` sets rates at a `share` of the block of that many seconds, `bulge` being the
        height of the parabola that makes up the way; ``carry(buffer, held, h)`` turns the frames beyond the ends;
        ``snap(buffer, held, knot)`` puts nodes and frames on their paths.
    """
    o = offsets(stride)
    X, V, W = (tuple(o[f"{field}{i}"] for i in (1, 2, 3)) for field in "XVW")
    Q = tuple(o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))

    @kernel
    def rate(rates: Floats, moves: Floats, block: int, after: Floats, place: int, i: int, time: float, share: float, bulge: float) -> float:
        begin, end = rates[block, place, i], rates[after, place, i]
        return (1 - share) * begin + share * end + bulge * (moves[block, place, i] / time - 0.5 * (begin + end))

    @kernel
    def hold(b: Floats, held: HeldRows, block: int, time: float, share: float, bulge: float) -> None:
        after = block + 1 if held.moves else block
        for m in range(held.nodes.shape[0]):
            k, along = held.nodes[m], 0.0
            for i in range(3):
                b[V[i] + k] -= rate(held.point_rates, held.point_moves, block, after, m, i, time, share, bulge)
                along += b[V[i] + k] * held.rails[m, i]
            for i in range(3):
                way = rate(held.point_rates, held.point_moves, block, after, m, i, time, share, bulge)
                b[V[i] + k] = way + along * held.rails[m, i]
        for g in range(held.ghosts.shape[0]):
            for i in range(3):
                b[W[i] + held.ghosts[g]] = rate(held.frame_rates, held.frame_moves, block, after, g, i, time, share, bulge)

    @kernel
    def carry(b: Floats, held: HeldRows, h: float) -> None:
        for g in range(held.ghosts.shape[0]):
            k = held.ghosts[g]
            r = rotation(h * b[W[0] + k], h * b[W[1] + k], h * b[W[2] + k])
            for j in range(3):
                b[Q[j] + k], b[Q[3 + j] + k], b[Q[6 + j] + k] = turned(r, b[Q[j] + k], b[Q[3 + j] + k], b[Q[6 + j] + k])

    @kernel
    def snap(b: Floats, held: HeldRows, knot: int) -> None:
        for m in range(held.nodes.shape[0]):
            k, along = held.nodes[m], 0.0
            for i in range(3):
                along += (b[X[i] + k] - held.points[knot, m, i]) * held.rails[m, i]
            for i in range(3):
                b[X[i] + k] = held.points[knot, m, i] + along * held.rails[m, i]
        for g in range(held.ghosts.shape[0]):
            for i in range(9):
                b[Q[i] + held.ghosts[g]] = held.frames[knot, g, i // 3, i % 3]

    return hold, carry, snap


def load_kernel(stride: int) -> Callable[..., Any]:
    """Compile ``follow(buffer, n, loads)``, which writes the forces and couples of `Followers` for the present frames."""
    o = offsets(stride)
    F, C = (tuple(o[f"{field}{i}"] for i in (1, 2, 3)) for field in ("FORCE", "COUPLE"))
    Q = tuple(tuple(o[f"Q{i}{j}"] for i in (1, 2, 3)) for j in (1, 2, 3))

    @kernel
    def follow(b: Floats, n: np.uint64, loads: Followers) -> None:
        for k in range(ONE, n + ONE + ONE):
            for j in range(3):
                b[F[j] + k] = loads.force[k - ONE, j]
        for k in range(ONE, n + ONE):
            e = k - ONE
            for j in range(3):
                d1, d2, d3 = b[Q[j][0] + k], b[Q[j][1] + k], b[Q[j][2] + k]
                b[F[j] + k] += d1 * loads.inner[e, 0] + d2 * loads.inner[e, 1] + d3 * loads.inner[e, 2]
                b[F[j] + k + ONE] += d1 * loads.outer[e, 0] + d2 * loads.outer[e, 1] + d3 * loads.outer[e, 2]
                b[C[j] + k] = loads.couple[e, j] + d1 * loads.turning[e, 0] + d2 * loads.turning[e, 1] + d3 * loads.turning[e, 2]

    return follow


def elastic_stepper(stride: int, constant_section: bool) -> Callable[..., Any]:
    """Compile the loop of an elastic rod.

    Parameters
    ----------
    stride : int
        Of the buffer.
    constant_section : bool
        See `octoctrl.sim.rod.elastic_kernels.rod_kernels`.

    Returns
    -------
    advance : compiled function
        ``advance(buffer, n, h, steps, size, held, loads, good, points, directors, stretch)`` takes `steps` steps of `h` for each of the
        samples, whose count is the length of `points`, in blocks of `size`, and fills the three arrays; rows of `held` are for the blocks
        of one sample. The last state that was well is in `good` (rows, n + 2). Returns ``(samples done, steps done in the next, finding,
        element)``.
    """
    drift, strain, curvature, _, moment, transport, kick, _ = rod_kernels(stride, constant_section)
    hold, carry, snap = support_kernels(stride)
    guard, straighten, record, follow = guard_kernel(stride), frame_kernel(stride), record_kernel(stride), load_kernel(stride)
    width = np.uint64(stride)

    @kernel
    def keep(b: Floats, n: np.uint64, good: Floats) -> None:
        for row in range(STATE_ROWS):
            for k in range(n + ONE + ONE):
                good[row, k] = b[np.uint64(row) * width + k]

    @kernel
    def advance(
        b: Floats,
        n: np.uint64,
        h: float,
        steps: int,
        size: int,
        held: HeldRows,
        loads: Followers,
        good: Floats,
        points: Floats,
        directors: Floats,
        stretch: Floats,
    ) -> tuple[int, int, int, Any]:
        # Pinned nodes have no mobility, so that what neither moves nor slides needs nothing more; a free tip's joint carries nothing.
        acts, joints = held.moves or held.slides, n + ONE if held.tip else n
        for sample in range(points.shape[0]):
            done, block = 0, 0
            while done < steps:
                count = min(size, steps - done)
                here, time = (block if held.moves else 0), count * h
                if acts:
                    hold(b, held, here, time, 0.0, 0.0)
                drift(b, n, 0.5 * h)
                if acts:
                    carry(b, held, 0.5 * h)
                for step in range(count):
                    strain(b, n)
                    curvature(b, joints)
                    moment(b, joints)
                    transport(b, joints)
                    if loads.follow:
                        follow(b, n, loads)
                    kick(b, n)
                    way = h if step + 1 < count else 0.5 * h
                    if acts:
                        share = (step + 1) / count
                        # Summed by the trapezoidal rule, which the drifts follow, this parabola has the mean 1.
                        hold(b, held, here, time, share, 6 * share * (1 - share) / (1 - 1 / (count * count)) if count > 1 else 0.0)
                        carry(b, held, way)
                    drift(b, n, way)
                snap(b, held, here + 1 if held.moves else 0)
                finding, element = guard(b, n)
                if finding != FINE:
                    return sample, done, finding, element
                straighten(b, n)
                keep(b, n, good)
                done += count
                block += 1
            record(b, n, points[sample], directors[sample], stretch[sample])
        return points.shape[0], 0, FINE, ONE

    return advance
