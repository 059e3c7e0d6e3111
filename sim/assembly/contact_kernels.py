"""The full arm touching bodies, and itself.

The nodes of its outermost rods, the helices, are balls that exchange impulses with bodies. Only forces act, no couples: a thin rod that
spins about its own axis would be a roller bearing. The body's lever reaches to the node, so that angular momentum is kept. Helices are too
far from one another to keep laps of the arm apart: it meets itself by its sections, each a ball around the cord and the longitudinal
muscles, as wide as they have spread. Whatever the precision of the arm, bodies and distances are of double.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import borrowing_kernel
from ..contact.fold_kernels import fold_sweeps
from ..contact.shape_kernels import distance
from ..contact.sweep_kernels import Surface, contact_sweeps
from .family_kernels import family_offsets

LOOK = 10
"""Steps after which one looks again which nodes are near."""


def node_kernel(grid: AssemblyGrid) -> Any:
    """Compile ``node(buffer, k) -> x1, x2, x3``: where a node of an open rod is, in double precision."""
    o, single = family_offsets(grid, False), grid.single
    X1, X2, X3, LOW1, LOW2, LOW3 = (o[f"{field}{i}"] for field in ("X", "LOW") for i in (1, 2, 3))

    @borrowing_kernel
    def node(b: Any, k: Any) -> Any:
        x1, x2, x3 = np.float64(b[X1 + k]), np.float64(b[X2 + k]), np.float64(b[X3 + k])
        if single:
            x1, x2, x3 = x1 + b[LOW1 + k], x2 + b[LOW2 + k], x3 + b[LOW3 + k]
        return x1, x2, x3

    return node


def contact_kernels(grid: AssemblyGrid) -> Any:
    """Compile the contact of an assembly with bodies.

    Returns
    -------
    watch, touch, follow : compiled functions
        See `octoctrl.sim.contact.sweep_kernels.contact_sweeps`.
    """
    o, node = family_offsets(grid, False), node_kernel(grid)
    V1, V2, V3, MOBILITY = (o[name] for name in ("V1", "V2", "V3", "NODE_MOBILITY"))

    @borrowing_kernel
    def velocity(b: Any, points: Any, p: Any, l1: Any, l2: Any, l3: Any) -> Any:
        k = points.place[p]
        return np.float64(b[V1 + k]), np.float64(b[V2 + k]), np.float64(b[V3 + k])

    @borrowing_kernel
    def place(b: Any, points: Any, p: Any) -> Any:
        x1, x2, x3 = node(b, points.place[p])
        v1, v2, v3 = velocity(b, points, p, 0.0, 0.0, 0.0)
        return x1, x2, x3, points.radius[p], v1 * v1 + v2 * v2 + v3 * v3

    @borrowing_kernel
    def meet(b: Any, points: Any, p: Any, body: Any) -> Any:
        x1, x2, x3 = node(b, points.place[p])
        gap, n1, n2, n3 = distance(body, x1, x2, x3)
        return gap - points.radius[p], n1, n2, n3, x1, x2, x3, 0.0

    @borrowing_kernel
    def mobility(b: Any, points: Any, p: Any, arm: Any, rate: Any) -> Any:
        found = np.float64(b[MOBILITY + points.place[p]]) * rate
        return found, found

    @borrowing_kernel
    def push(b: Any, points: Any, p: Any, l1: Any, l2: Any, l3: Any, rate: Any, p1: Any, p2: Any, p3: Any) -> None:
        k = points.place[p]
        gives = np.float64(b[MOBILITY + k]) * rate
        b[V1 + k] += gives * p1
        b[V2 + k] += gives * p2
        b[V3 + k] += gives * p3

    return contact_sweeps(Surface(place, meet, velocity, mobility, push))


def fold_kernels(grid: AssemblyGrid) -> Any:
    """Compile the contact of an assembly with itself.

    Returns
    -------
    watch, part, note : compiled functions
        See `octoctrl.sim.contact.fold_kernels.fold_sweeps`; points are `octoctrl.sim.assembly.surroundings.Sections`.
    """
    return fold_sweeps(section_surface(grid))


def section_surface(grid: AssemblyGrid) -> Surface:
    """Compile where the sections are: cord and longitudinal muscles at one node, which share an impulse by their masses."""
    o, node, rods, L = family_offsets(grid, False), node_kernel(grid), grid.straight_rods, np.uint64(grid.lanes)
    V1, V2, V3, MOBILITY = (o[name] for name in ("V1", "V2", "V3", "NODE_MOBILITY"))

    @borrowing_kernel
    def mass(b: Any, k: Any) -> Any:
        """Of a node, in steps: none of one that is held."""
        gives = np.float64(b[MOBILITY + k])
        return 1.0 / gives if gives > 0 else 0.0

    @borrowing_kernel
    def velocity(b: Any, points: Any, p: Any, l1: Any, l2: Any, l3: Any) -> Any:
        v1, v2, v3, total = 0.0, 0.0, 0.0, 0.0
        for rod in range(rods):
            k = points.place[p] + np.uint64(rod) * L
            m = mass(b, k)
            v1, v2, v3, total = v1 + m * b[V1 + k], v2 + m * b[V2 + k], v3 + m * b[V3 + k], total + m
        return (v1 / total, v2 / total, v3 / total) if total > 0 else (0.0, 0.0, 0.0)

    @borrowing_kernel
    def place(b: Any, points: Any, p: Any) -> Any:
        c1, c2, c3, total = 0.0, 0.0, 0.0, 0.0
        for rod in range(rods):
            k = points.place[p] + np.uint64(rod) * L
            x1, x2, x3 = node(b, k)
            m = mass(b, k)
            c1, c2, c3, total = c1 + m * x1, c2 + m * x2, c3 + m * x3, total + m
        if total == 0:
            c1, c2, c3 = node(b, points.place[p])
        else:
            c1, c2, c3 = c1 / total, c2 / total, c3 / total
        spread = 0.0
        for rod in range(1, rods):
            x1, x2, x3 = node(b, points.place[p] + np.uint64(rod) * L)
            spread += (x1 - c1) ** 2 + (x2 - c2) ** 2 + (x3 - c3) ** 2
        v1, v2, v3 = velocity(b, points, p, 0.0, 0.0, 0.0)
        return c1, c2, c3, points.radius[p] * np.sqrt(spread) / points.spread[p], v1 * v1 + v2 * v2 + v3 * v3

    @borrowing_kernel
    def mobility(b: Any, points: Any, p: Any, arm: Any, rate: Any) -> Any:
        total = 0.0
        for rod in range(rods):
            total += mass(b, points.place[p] + np.uint64(rod) * L)
        found = rate / total if total > 0 else 0.0
        return found, found

    @borrowing_kernel
    def push(b: Any, points: Any, p: Any, l1: Any, l2: Any, l3: Any, rate: Any, p1: Any, p2: Any, p3: Any) -> None:
        gives = mobility(b, points, p, 0.0, rate)[0]
        if gives > 0:
            for rod in range(rods):
                k = points.place[p] + np.uint64(rod) * L
                b[V1 + k] += gives * p1
                b[V2 + k] += gives * p2
                b[V3 + k] += gives * p3

    return Surface(place, None, velocity, mobility, push)
