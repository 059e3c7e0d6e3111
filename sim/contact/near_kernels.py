"""Which points of an arm may meet which body until one looks again."""

from typing import Any

import numpy as np

from ..compiler import borrowing_kernel
from .body_kernels import any_moves
from .columns import Anchor, Body
from .shape_kernels import distance

POSITION, VELOCITY, BOUND = int(Body.POSITION), int(Body.VELOCITY), int(Body.BOUND)
NORMAL = int(Anchor.NORMAL)
MOVES, CLOSE, MEETING, SINKS = range(4)
"""Places in a world's `seen`: whether any body goes anywhere, is near the arm, or near another body; whether a point sank in too deep."""
LEAST_MARGIN = 1e-3
"""Gap (m) within which a pair is watched, at least."""
HASTE = 0.1
"""Speed (m/s) that a point may gain until one looks again, beside twice what it has; a gap too wide for it is not measured."""
START = 20.0
"""Acceleration (m/s^2) at which a point may come near what is far from the whole arm."""
SWELLING = 1.05
"""By how much a radius may grow meanwhile."""


@borrowing_kernel
def find_near(world: Any, fastest: float, span: float) -> bool:
    """List the points, at their `places`, that may meet each body within a time `span` (s); `fastest` (m/s) is the quickest of them.

    Returns whether there are any. If all bodies are far from the whole arm, the world's `lease` is the time in which that cannot change.
    """
    bodies, places = world.bodies, world.places
    count, widest, close, clearance = places.shape[1], 0.0, False, np.inf
    low1, low2, low3, high1, high2, high3 = np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf
    for p in range(count):
        x1, x2, x3 = places[0, p], places[1, p], places[2, p]
        low1, low2, low3 = min(low1, x1), min(low2, x2), min(low3, x3)
        high1, high2, high3 = max(high1, x1), max(high2, x2), max(high3, x3)
        widest = max(widest, places[3, p])
    for j in range(bodies.shape[0]):
        world.counts[j] = 0
        quickest = np.sqrt(bodies[j, VELOCITY] ** 2 + bodies[j, VELOCITY + 1] ** 2 + bodies[j, VELOCITY + 2] ** 2)
        margin = max(LEAST_MARGIN, 1.5 * span * (fastest + quickest))
        y1, y2, y3 = bodies[j, POSITION], bodies[j, POSITION + 1], bodies[j, POSITION + 2]
        reach = bodies[j, BOUND] + SWELLING * widest + margin
        # First the box of the whole arm; what has no end is always in it.
        outside = max(low1 - y1, y1 - high1, low2 - y2, y2 - high2, low3 - y3, y3 - high3) - reach
        clearance = min(clearance, outside)
        if outside >= 0:
            continue
        body, near, slack, found = bodies[j], world.near[j], world.slack[j], 0
        world.paces[j] = 2 * (fastest + quickest) + HASTE
        for p in range(count):
            x1, x2, x3 = places[0, p], places[1, p], places[2, p]
            within = SWELLING * places[3, p] + margin
            reach = body[BOUND] + within
            if (x1 - y1) ** 2 + (x2 - y2) ** 2 + (x3 - y3) ** 2 > reach * reach:
                continue
            gap = distance(body, x1, x2, x3)[0]
            if gap < within:
                # What touched is asked in any case.
                near[found], slack[found] = p, 0.0 if world.anchors[j, p, NORMAL] > 0 else gap - places[3, p]
                found += 1
        world.counts[j] = found
        close = close or found > 0
    # A point that has twice the speed of the quickest, and gains more all the time, goes as far as the clearance in this time.
    world.lease[0] = 0.0 if clearance <= 0 or world.seen[MOVES] else (np.sqrt(fastest * fastest + START * clearance) - fastest) / START
    return close


@borrowing_kernel
def find_pairs(world: Any, span: float) -> bool:
    """Mark the pairs of bodies that may meet within a time `span` (s); returns whether there are any."""
    bodies, pairs, close = world.bodies, world.pairs, False
    for k in range(pairs.pairs.shape[0]):
        a, b = bodies[pairs.pairs[k, 0]], bodies[pairs.pairs[k, 1]]
        apart, speed = 0.0, 0.0
        for i in range(3):
            apart += (a[POSITION + i] - b[POSITION + i]) ** 2
            speed += (a[VELOCITY + i] - b[VELOCITY + i]) ** 2
        reach = a[BOUND] + b[BOUND] + max(LEAST_MARGIN, 2 * span * np.sqrt(speed))
        pairs.near[k] = 0 if apart > reach * reach else 1
        close = close or pairs.near[k] == 1
    return close


@borrowing_kernel
def due(world: Any, span: float) -> bool:
    """Whether one has to look again, a time `span` (s) after the last: what is far from the whole arm grants a lease."""
    world.lease[0] -= span
    return not world.lease[0] > 0


@borrowing_kernel
def look(world: Any, fastest: float, span: float) -> None:
    """Look what may meet within a time `span` (s), of an arm whose points are at their `places` and none quicker than `fastest` (m/s)."""
    world.seen[MOVES] = any_moves(world.bodies)
    world.seen[CLOSE] = find_near(world, fastest, span)
    world.seen[MEETING] = find_pairs(world, span)
