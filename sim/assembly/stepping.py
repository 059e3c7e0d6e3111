"""The time loop of the assembly: one compiled call for many steps.

A step is drift, the terms of its numerics (`octoctrl.sim.assembly.terms`), drift; the two half drifts that meet between steps are merged
inside a sample, as in `octoctrl.sim.rod.stepping`. Terms are called by their addresses, so that each is compiled once and not again with
every loop that has it. The guard looks at every element at the end of each sample and reports the family and
place of the first bad one.
"""

from typing import Any, NamedTuple

import numpy as np

from ..body.grid import AssemblyGrid
from ..compiler import call, kernel
from ..contact.body_kernels import any_moves, drift_bodies
from ..contact.near_kernels import MOVES, SINKS
from ..contact.note_kernels import note
from .contact_kernels import LOOK
from .family_kernels import family_kernels, family_offsets, position_kernels
from .meeting_kernels import LEFT, exchange, meet
from .outside_kernels import outside_kernels
from .parts import sweep, sweep_open
from .pressure_kernels import pressure_kernels, slab_offsets
from .terms import Phases

ONE = np.uint64(1)
FINE, STRETCHED, NOT_A_NUMBER, FAST, SUNK = 0, 1, 3, 4, 7
"""What the guard found, numbered as in `octoctrl.sim.rod.stepping`, and speed."""

STRETCH_LIMITS = (0.2, 3.0)
SPEED_LIMIT = 10.0
"""Fastest velocity component (m/s) that can be meant: the strike of a squid, the fastest of its kind, reaches 3 m/s."""


class Turn(NamedTuple):
    """When a term is done.

    Attributes
    ----------
    stage : int
        What parts exchange before it; -1 for nothing.
    alone : bool
        Whether all wait before and after it.
    term : int
        Which, of all terms of a step; -1 for none.
    """

    stage: int
    alone: bool
    term: int


def turns_of(phases: Phases) -> tuple[tuple[Turn, ...], tuple[Any, ...]]:
    """The turns of a step of such `phases`, and the terms that have one."""
    turns: list[Turn] = []
    terms: list[Any] = []
    for phase in phases:
        stage = -1 if phase.stage is None else int(phase.stage)
        for term in phase.terms.values():
            turns.append(Turn(stage, phase.alone, len(terms)))
            terms.append(term)
            stage = -1
        if stage >= 0:
            turns.append(Turn(stage, phase.alone, -1))
    return tuple(turns), tuple(terms)


def mover(grid: AssemblyGrid) -> Any:
    """Compile ``move(buffer, part, h)``: nodes and frames of a part go on with their velocities."""
    drift = sweep_open(grid, family_kernels(grid, False)["drift"])
    ring_drift = sweep(grid, "rings", family_kernels(grid, True)["drift"])

    @kernel
    def move(b: Any, part: Any, h: Any) -> None:
        drift(b, part, h)
        ring_drift(b, part, h)

    return move


def assembly_stepper(
    grid: AssemblyGrid, phases: Phases, loaded: bool = False, look: Any = None, fold: tuple[Any, Any] | None = None
) -> tuple[Any, tuple[Any, ...]]:
    """Compile the loop of an assembly.

    Parameters
    ----------
    grid : AssemblyGrid
    phases : Phases
        Of a step.
    loaded : bool
        Whether loads act from outside.
    look : compiled function, optional
        What watches for bodies, if there are any.
    fold : (compiled function, compiled function), optional
        What watches for the arm's contact with itself and what notes it, if it may touch itself.

    Returns
    -------
    advance : compiled function
        ``advance(buffer, step, terms, steps, longitudinal, oblique, transverse, points, frames, stretch, volumes, loads, shares, watch,
        crew)`` takes so many `steps`, each a `Step` given to the terms at their addresses, for each sample, with levels (samples + 1,
        straight rods, N), the cord's first, (samples + 1, 2, helix elements) and (samples + 1, N), linear in time between samples; `loads`
        as in `octoctrl.sim.scene.loads.sampled_loads`, of which each straight rod carries its `shares` (straight rods, N + 1); `watch`
        asks for the guard at every step; `crew` is the `octoctrl.sim.assembly.meeting_kernels.Crew` of the thread. Of loads and bodies
        nothing is compiled where there are none. Fills the cord's nodes, frames and stretch and the slabs' volumes, (samples, N), of its
        part; returns ``(samples done, finding, family, index in row, part)``, the same in all threads.
    terms : tuple of compiled functions
        Which the loop calls through their addresses, see `octoctrl.sim.compiler.by_address`.
    """
    o, g = family_offsets(grid, False), family_offsets(grid, True)
    lanes, ring_nodes, helices = grid.lanes, grid.ring_nodes, grid.helices
    nodes = np.uint64(ring_nodes + 1)
    straight, helix_slots = grid.straight_rods, grid.helix_nodes
    left = helices // 2
    L, wide = np.uint64(lanes), np.uint64(helix_slots)
    BEFORE, AFTER, RING_BEFORE, RING_AFTER = (table[k] for table in (o, g) for k in ("LEVEL_BEFORE", "LEVEL_AFTER"))
    X, Q = tuple(o[f"X{i}"] for i in (1, 2, 3)), tuple(o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    V, RING_V = tuple(o[f"V{i}"] for i in (1, 2, 3)), tuple(g[f"V{i}"] for i in (1, 2, 3))
    STRETCH, LENGTH, RING_STRETCH, RING_X = o["STRETCH"], o["LENGTH"], g["STRETCH"], g["X1"]
    VOLUME = slab_offsets(grid)["VOLUME"]
    find, _ = outside_kernels(grid)
    touching, folding = look is not None, fold is not None
    watching: tuple[Any, Any] = fold or (None, None)
    look_at_folds, note_folds = watching
    real, single = np.float32 if grid.single else np.float64, grid.single
    apart = position_kernels(grid, False)[0]
    straighten = sweep_open(grid, family_kernels(grid, False)["straighten"])
    straighten_rings = sweep(grid, "rings", family_kernels(grid, True)["straighten"])
    LOW = tuple(o[f"LOW{i}"] for i in (1, 2, 3))
    turns, terms = turns_of(phases)
    move, measure = mover(grid), pressure_kernels(grid, False)[0]

    @kernel
    def set_levels(b: Any, part: Any, row: Any, ring_row: Any, longitudinal: Any, oblique: Any, transverse: Any) -> None:
        for m in range(straight):
            for i in range(part.first, part.last):
                b[row + np.uint64(m) * L + i] = longitudinal[m, i + part.before - ONE]
        for j in range(helices):
            for e in range(part.helix_first, part.helix_last):
                # The first helices are left-handed: the second family.
                b[row + np.uint64(straight + helix_slots * j) * L + e] = oblique[1 if j < left else 0, e + wide * part.before - ONE]
        for node in range(1, ring_nodes + 1):
            for i in range(part.first, part.last):
                b[ring_row + np.uint64(node) * L + i] = transverse[i + part.before - ONE]

    @kernel
    def fast(b: Any, first: Any, last: Any, rows: Any) -> Any:
        for k in range(first, last):
            if max(abs(b[rows[0] + k]), abs(b[rows[1] + k]), abs(b[rows[2] + k])) > SPEED_LIMIT:
                return k
        return last

    @kernel
    def stretched(b: Any, place: Any) -> Any:
        return not STRETCH_LIMITS[0] < b[place] < STRETCH_LIMITS[1]

    @kernel
    def guard(b: Any, part: Any) -> Any:
        # Speed first: in the step after an element runs away, the implicit solve has spread it over the whole rod.
        for rod in range(straight + helices):
            wide = np.uint64(1 if rod < straight else helix_slots)
            start = np.uint64(rod if rod < straight else straight + helix_slots * (rod - straight)) * L
            end = start + wide * part.stop
            k = fast(b, start + wide * part.start, end, V)
            if k < end:
                return FAST, 0, k
        for node in range(ONE, nodes):
            end = node * L + part.stop
            k = fast(b, node * L + part.start, end, RING_V)
            if k < end:
                return FAST, 1, k
        for rod in range(straight + helices):
            wide = np.uint64(1 if rod < straight else helix_slots)
            start = np.uint64(rod if rod < straight else straight + helix_slots * (rod - straight)) * L
            for k in range(start + wide * part.start, start + wide * part.stop):
                if not np.isfinite(b[X[0] + k] + b[X[1] + k] + b[X[2] + k]):
                    return NOT_A_NUMBER, 0, k
        for rod in range(straight + helices):
            start = np.uint64(rod if rod < straight else straight + helix_slots * (rod - straight)) * L
            first, last = (part.first, part.last) if rod < straight else (part.helix_first, part.helix_last)
            for k in range(start + first, start + last):
                if stretched(b, STRETCH + k):
                    return STRETCHED, 0, k
        for node in range(ONE, nodes):
            for k in range(node * L + part.start, node * L + part.stop):
                if not np.isfinite(b[RING_X + k]):
                    return NOT_A_NUMBER, 1, k
                if stretched(b, RING_STRETCH + k):
                    return STRETCHED, 1, k
        return FINE, 0, ONE

    @kernel
    def worst_of(b: Any, crew: Any) -> Any:
        """What the guard found in all parts, and in which: speed first, then what is nearest to the base."""
        findings, number = crew.findings, crew.number
        findings[number, 0], findings[number, 1], findings[number, 2] = guard(b, crew.part)
        meet(crew)
        worst = 0
        for number in range(1, crew.threads):
            found = findings[number, 0]
            if found != FINE and (findings[worst, 0] == FINE or (found == FAST and findings[worst, 0] != FAST)):
                worst = number
        return findings[worst, 0], findings[worst, 1], findings[worst, 2], worst

    @kernel
    def record(b: Any, part: Any, points: Any, frames: Any, stretch: Any, volumes: Any) -> None:
        for k in range(part.node, part.behind):
            node = k + part.before - ONE
            for c in range(3):
                points[node, c] = b[X[c] + k]
                if single:
                    points[node, c] += b[LOW[c] + k]
        measure(b, part)
        for k in range(part.first, part.last):
            element = k + part.before - ONE
            for c in range(9):
                frames[element, c // 3, c % 3] = b[Q[c] + k]
            d1, d2, d3 = apart(b, k + ONE, k)
            stretch[element] = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3) / b[LENGTH + k]
            volumes[element] = b[VOLUME + k]

    @kernel
    def force(b: Any, share: Any, step: Any, crew: Any, terms: Any) -> None:
        for turn in turns:
            if turn.stage >= 0:
                exchange(b, crew, turn.stage)
            if turn.alone:
                meet(crew)
            if turn.term >= 0:
                call(terms, turn.term, (b, share, step, crew.part))
            if turn.alone:
                meet(crew)

    @kernel
    def advance(
        b: Any,
        step: Any,
        terms: Any,
        steps: Any,
        longitudinal: Any,
        oblique: Any,
        transverse: Any,
        points: Any,
        frames: Any,
        stretch: Any,
        volumes: Any,
        loads: Any,
        shares: Any,
        watch: Any,
        crew: Any,
    ) -> Any:  # fmt: skip
        meet(crew)
        if crew.counts[LEFT]:
            return 0, FINE, 0, 0, 0
        h, world, folds, outside, part = step.h, step.world, step.folds, step.outside, crew.part
        for sample in range(points.shape[0]):
            set_levels(b, part, BEFORE, RING_BEFORE, longitudinal[sample], oblique[sample], transverse[sample])
            set_levels(b, part, AFTER, RING_AFTER, longitudinal[sample + 1], oblique[sample + 1], transverse[sample + 1])
            move(b, part, 0.5 * h)
            if touching and crew.number == 0 and any_moves(world.bodies):
                drift_bodies(world.bodies, np.float64(0.5 * h))
            for number in range(steps):
                if (touching or folding) and number % LOOK == 0:
                    meet(crew)
                    if crew.number == 0:
                        if touching:
                            look(b, world, np.float64(LOOK * h))
                        if folding:
                            look_at_folds(b, folds, np.float64(LOOK * h))
                if loaded:
                    find(b, part, outside, shares, loads[sample], loads[sample + 1], (number + 0.5) / steps)
                force(b, real((number + 0.5) / steps), step, crew, terms)
                move(b, part, h if number + 1 < steps else 0.5 * h)
                if touching and crew.number == 0 and world.seen[MOVES]:
                    drift_bodies(world.bodies, np.float64(h if number + 1 < steps else 0.5 * h))
                if watch:
                    finding, family, where, half = worst_of(b, crew)
                    if finding != FINE:
                        return sample, finding, family, where, half
            if touching and crew.number == 0:
                note(world, sample, np.float64(h), steps)
            if folding and crew.number == 0:
                folds.sunk[0] = note_folds(folds, sample, np.float64(h), steps)
            finding, family, where, half = worst_of(b, crew)
            if finding != FINE:
                return sample, finding, family, where, half
            if single:
                straighten(b, part)
                straighten_rings(b, part)
            record(b, part, points[sample], frames[sample], stretch[sample], volumes[sample])
            meet(crew)
            if (touching and world.seen[SINKS]) or (folding and folds.sunk[0]):
                return sample + 1, SUNK, 0, ONE, 0
        return points.shape[0], FINE, 0, 0, 0

    return advance, terms
