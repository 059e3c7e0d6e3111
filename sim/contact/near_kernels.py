"""Which points of an arm may meet which body until one looks again."""

from typing import Any

import numpy as np

from ..compiler import kernel
from .columns import Body
from .shape_kernels import distance

POSITION, VELOCITY, BOUND = int(Body.POSITION), int(Body.VELOCITY), int(Body.BOUND)
NEAR = 0.5e-3
"""Gap (m) up to which the law is asked; above it nothing acts unless a force did in the step before."""
LEAST_MARGIN = 1e-3
"""Gap (m) within which a pair is watched, at least."""
SWELLING = 1.05
"""By how much a radius may grow meanwhile."""


@kernel
def find_near(world: Any, fastest: float, span: float) -> None:
    """List the points, at their `places`, that may meet each body within a time `span` (s); `fastest` (m/s) is the quickest of them."""
    bodies, places = world.bodies, world.places
    count, widest = places.shape[1], 0.0
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
        if not (low1 - reach < y1 < high1 + reach and low2 - reach < y2 < high2 + reach and low3 - reach < y3 < high3 + reach):
            if reach < np.inf:
                continue
        body, near, found = bodies[j], world.near[j], 0
        for p in range(count):
            x1, x2, x3 = places[0, p], places[1, p], places[2, p]
            within = SWELLING * places[3, p] + margin
            reach = body[BOUND] + within
            if (x1 - y1) ** 2 + (x2 - y2) ** 2 + (x3 - y3) ** 2 > reach * reach:
                continue
            if distance(body, x1, x2, x3)[0] < within:
                near[found] = p
                found += 1
        world.counts[j] = found
