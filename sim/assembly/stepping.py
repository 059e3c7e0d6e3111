"""The time loop of the assembly: one compiled call for many steps.

A step is drift, the terms of its numerics (`octoctrl.sim.assembly.terms`), drift; the two half drifts that meet between steps are merged
inside a sample, as in `octoctrl.sim.rod.stepping`. The guard looks at every element at the end of each sample and reports the family and
place of the first bad one.
"""

from typing import Any

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import kernel
from ..contact.body_kernels import drift_bodies
from ..contact.note_kernels import note
from .contact_kernels import LOOK, contact_kernels
from .family_kernels import family_kernels, family_offsets, position_kernels
from .outside_kernels import outside_kernels
from .pressure_kernels import pressure_kernels, slab_offsets
from .terms import Step, Terms

ONE = np.uint64(1)
FINE, STRETCHED, NOT_A_NUMBER, FAST = 0, 1, 3, 4
"""What the guard found, numbered as in `octoctrl.sim.rod.stepping`, and speed."""

STRETCH_LIMITS = (0.2, 3.0)
SPEED_LIMIT = 10.0
"""Fastest velocity component (m/s) that can be meant: the strike of a squid, the fastest of its kind, reaches 3 m/s."""


def in_order(terms: list[Any]) -> Any:
    """One kernel ``(buffer, share, step)`` that goes through `terms`."""
    if len(terms) == 1:
        return terms[0]
    half = len(terms) // 2
    before, after = in_order(terms[:half]), in_order(terms[half:])

    @kernel
    def both(b: Any, share: Any, step: Any) -> None:
        before(b, share, step)
        after(b, share, step)

    return both


def mover(grid: AssemblyGrid) -> Any:
    """Compile ``move(buffer, h)``: all nodes and frames go on with their velocities."""
    drift, ring_drift = family_kernels(grid, False)["drift"], family_kernels(grid, True)["drift"]
    first, last = ONE, np.uint64(grid.open_slots * grid.lanes - 1)
    ring_first, ring_last = np.uint64(grid.lanes), np.uint64((grid.ring_nodes + 1) * grid.lanes)

    @kernel
    def move(b: Any, h: Any) -> None:
        drift(b, first, last, h)
        ring_drift(b, ring_first, ring_last, h)

    return move


def assembly_stepper(grid: AssemblyGrid, terms: Terms, loaded: bool = False, touching: bool = False) -> Any:
    """Compile the loop of an assembly.

    Returns
    -------
    advance : compiled function
        ``advance(buffer, h, steps, longitudinal, oblique, transverse, laws, drag, ring_index, helix_index, points, frames, stretch,
        volumes, loads, shares, outside, world, watch)`` with levels (samples + 1, straight rods, N), the cord's first, (samples + 1, 2,
        helix elements) and (samples + 1, N), linear in time between samples; `loads` as in `octoctrl.sim.scene.loads.sampled_loads`, of
        which each straight rod carries its `shares` (straight rods, N + 1); for the others see `Step`; `watch` asks for the guard at
        every step. Of loads and bodies nothing is compiled where there are none. Fills the cord's nodes, frames and stretch and the
        slabs' volumes, (samples, N); returns ``(samples done, finding, family, index in row)``.
    """
    o, g = family_offsets(grid, False), family_offsets(grid, True)
    lanes, count, ring_nodes, helices, helix_elements = grid.lanes, grid.rings, grid.ring_nodes, grid.helices, grid.helix_elements
    straight, helix_slots = grid.straight_rods, grid.helix_nodes
    left = helices // 2
    L, n = np.uint64(lanes), np.uint64(count)
    long = np.uint64(helix_elements)
    first, last = ONE, np.uint64(grid.open_slots * lanes - 1)
    ring_first, ring_last = L, np.uint64((ring_nodes + 1) * lanes)
    BEFORE, AFTER, RING_BEFORE, RING_AFTER = (table[k] for table in (o, g) for k in ("LEVEL_BEFORE", "LEVEL_AFTER"))
    X, Q = tuple(o[f"X{i}"] for i in (1, 2, 3)), tuple(o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    V, RING_V = tuple(o[f"V{i}"] for i in (1, 2, 3)), tuple(g[f"V{i}"] for i in (1, 2, 3))
    STRETCH, LENGTH, RING_STRETCH, RING_X = o["STRETCH"], o["LENGTH"], g["STRETCH"], g["X1"]
    VOLUME = slab_offsets(grid)["VOLUME"]
    find, _ = outside_kernels(grid)
    look: Any = contact_kernels(grid)[0] if touching else None
    real, single = np.float32 if grid.single else np.float64, grid.single
    apart, straighten, straighten_rings = position_kernels(grid, False)[0], *(family_kernels(grid, k)["straighten"] for k in (False, True))
    LOW = tuple(o[f"LOW{i}"] for i in (1, 2, 3))
    force, move, (measure, _, _) = in_order(list(terms.values())), mover(grid), pressure_kernels(grid, False)

    @kernel
    def set_levels(b: Any, row: Any, ring_row: Any, longitudinal: Any, oblique: Any, transverse: Any) -> None:
        for m in range(straight):
            for e in range(count):
                b[row + np.uint64(m) * L + np.uint64(e + 1)] = longitudinal[m, e]
        for j in range(helices):
            for e in range(helix_elements):
                # The first helices are left-handed: the second family.
                b[row + np.uint64(straight + helix_slots * j) * L + np.uint64(e + 1)] = oblique[1 if j < left else 0, e]
        for node in range(1, ring_nodes + 1):
            for i in range(count):
                b[ring_row + np.uint64(node) * L + np.uint64(i + 1)] = transverse[i]

    @kernel
    def guard(b: Any) -> Any:
        # Speed first: in the step after an element runs away, the implicit solve has spread it over the whole rod.
        for k in range(first, last):
            if max(abs(b[V[0] + k]), abs(b[V[1] + k]), abs(b[V[2] + k])) > SPEED_LIMIT:
                return FAST, 0, k
        for k in range(ring_first, ring_last):
            if max(abs(b[RING_V[0] + k]), abs(b[RING_V[1] + k]), abs(b[RING_V[2] + k])) > SPEED_LIMIT:
                return FAST, 1, k
        for k in range(first, last):
            if not np.isfinite(b[X[0] + k] + b[X[1] + k] + b[X[2] + k]):
                return NOT_A_NUMBER, 0, k
        for rod in range(straight + helices):
            start = np.uint64(rod if rod < straight else straight + helix_slots * (rod - straight)) * L
            for k in range(start + ONE, start + ONE + (n if rod < straight else long)):
                if not STRETCH_LIMITS[0] < b[STRETCH + k] < STRETCH_LIMITS[1]:
                    return STRETCHED, 0, k
        for k in range(ring_first, ring_last):
            if not np.isfinite(b[RING_X + k]):
                return NOT_A_NUMBER, 1, k
            if not STRETCH_LIMITS[0] < b[RING_STRETCH + k] < STRETCH_LIMITS[1]:
                return STRETCHED, 1, k
        return FINE, 0, ONE

    @kernel
    def record(b: Any, points: Any, frames: Any, stretch: Any, volumes: Any) -> None:
        for k in range(ONE, n + ONE + ONE):
            for c in range(3):
                points[k - ONE, c] = b[X[c] + k]
                if single:
                    points[k - ONE, c] += b[LOW[c] + k]
        for k in range(ONE, n + ONE):
            for c in range(9):
                frames[k - ONE, c // 3, c % 3] = b[Q[c] + k]
            d1, d2, d3 = apart(b, k + ONE, k)
            stretch[k - ONE] = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3) / b[LENGTH + k]
        measure(b)
        for k in range(ONE, n + ONE):
            volumes[k - ONE] = b[VOLUME + k]

    @kernel
    def advance(
        b: Any,
        h: Any,
        steps: Any,
        longitudinal: Any,
        oblique: Any,
        transverse: Any,
        laws: Any,
        drag: Any,
        ring_index: Any,
        helix_index: Any,
        points: Any,
        frames: Any,
        stretch: Any,
        volumes: Any,
        loads: Any,
        shares: Any,
        outside: Any,
        world: Any,
        watch: Any,
    ) -> Any:  # fmt: skip
        step = Step(h, laws, drag, ring_index, helix_index, outside, world)
        for sample in range(points.shape[0]):
            set_levels(b, BEFORE, RING_BEFORE, longitudinal[sample], oblique[sample], transverse[sample])
            set_levels(b, AFTER, RING_AFTER, longitudinal[sample + 1], oblique[sample + 1], transverse[sample + 1])
            move(b, 0.5 * h)
            if touching:
                drift_bodies(world.bodies, np.float64(0.5 * h))
            for number in range(steps):
                if touching and number % LOOK == 0:
                    look(b, world, np.float64(LOOK * h))
                if loaded:
                    find(b, outside, shares, loads[sample], loads[sample + 1], (number + 0.5) / steps)
                force(b, real((number + 0.5) / steps), step)
                move(b, h if number + 1 < steps else 0.5 * h)
                if touching:
                    drift_bodies(world.bodies, np.float64(h if number + 1 < steps else 0.5 * h))
                if watch:
                    finding, family, where = guard(b)
                    if finding != FINE:
                        return sample, finding, family, where
            if touching:
                note(world, sample, np.float64(h), steps)
            finding, family, where = guard(b)
            if finding != FINE:
                return sample, finding, family, where
            if single:
                straighten(b, first, last)
                straighten_rings(b, ring_first, ring_last)
            record(b, points[sample], frames[sample], stretch[sample], volumes[sample])
        return points.shape[0], FINE, 0, ONE

    return advance
