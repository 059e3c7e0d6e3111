"""The time loop of the assembly: one compiled call for many steps.

A step is drift, forces, kick, implicit axial correction, drift; the two half drifts that meet between steps are merged inside a sample,
as in `octoctrl.sim.rod.stepping`. The guard looks at every element at the end of each sample and reports the family and place of the first
bad one.
"""

import numpy as np

from ..body.anatomy import PLAIN
from ..compiler import kernel
from .between_kernels import between_kernels
from .crossing_kernels import crossing_kernels
from .family_kernels import cord_brake, family_kernels, family_offsets, open_solver, ring_solver, ring_spin_brake
from .joint_kernels import gather_kernel, joint_kernels, scatter_kernels
from .published_kernels import published_drag, published_strain, velocity_filters
from .trait_kernels import even_repulsion, sliding_base

ONE = np.uint64(1)
FINE, STRETCHED, NOT_A_NUMBER, FAST = 0, 1, 3, 4
"""What the guard found, numbered as in `octoctrl.sim.rod.stepping`, and speed."""

RING_SPIN_RATE = 2500.0
"""Rate (1/s) at which ring elements lose their spin relative to their ring: about a tenth of critical in their shear rotation."""

CORD_SLIP_RATE = 300.0
"""Rate (1/s) at which the nerve cord loses its velocity relative to the muscles around it: about critical for their springs."""

STRETCH_LIMITS = (0.2, 3.0)
SPEED_LIMIT = 10.0
"""Fastest velocity component (m/s) that can be meant: the strike of a squid, the fastest of its kind, reaches 3 m/s."""


def assembly_stepper(grid, inclination, published=False, traits=PLAIN):
    """Compile the loop of an assembly.

    Parameters
    ----------
    grid : AssemblyGrid
    inclination : float, rad
        Of the longitudinal muscles.
    published : bool
        Whether to take the published numerics, see `octoctrl.sim.assembly.published_kernels`.
    traits : Traits
        Of the anatomy.

    Returns
    -------
    advance : compiled function
        ``advance(buffer, h, steps, longitudinal, oblique, transverse, laws, drag, ring_index, helix_index, points, frames, stretch,
        watch)`` with levels (samples + 1, straight rods, N), the cord's first, (samples + 1, 2, helix elements) and (samples + 1, N),
        linear in time between samples; `watch` asks for the guard at every step. Fills the cord's nodes, frames and stretch; returns
        ``(samples done, finding, family, index in row)``.
    parts : dict of str to compiled function
        Pieces of one step, for tests and timing; ``(buffer, ...)``.
    """
    o, g = family_offsets(grid, False), family_offsets(grid, True)
    rods, rings = family_kernels(grid, False), family_kernels(grid, True, traits.graded)
    drift, strain, bend, kick, spin, axial, correct = (rods[k] for k in ("drift", "strain", "bend", "kick", "spin", "axial", "correct"))
    ring_drift, ring_strain, ring_bend, ring_kick, ring_spin, ring_axial, ring_correct = (
        rings[k] for k in ("drift", "strain", "bend", "kick", "spin", "axial", "correct")
    )
    if published:
        strain = published_strain(grid, False, bare=traits.bare)
        ring_strain = published_strain(grid, True, traits.graded, traits.bare)
    smooth, brake = velocity_filters(grid, not traits.bare), published_drag(grid)
    repel, slide, even, sliding = even_repulsion(grid), sliding_base(grid), traits.even, traits.sliding
    solve, steady, hold = open_solver(grid), ring_spin_brake(grid), cord_brake(grid)
    ring_solve, close_state, close_strain, close_moment, close_speed = ring_solver(grid)
    gather = gather_kernel(grid)
    cord, neighbours, ring_muscle, ring_ring = joint_kernels(grid, inclination)
    beside, scatter = scatter_kernels(grid)
    fetch, connect, give = (between_kernels if grid.between else crossing_kernels)(grid)
    lanes, count, ring_nodes, helices, helix_elements = grid.lanes, grid.rings, grid.ring_nodes, grid.helices, grid.helix_elements
    straight, helix_slots = grid.straight_rods, grid.helix_nodes
    left = helices // 2
    L, n = np.uint64(lanes), np.uint64(count)
    long = np.uint64(helix_elements)
    first, last = ONE, np.uint64(grid.open_slots * lanes - 1)
    ring_first, ring_last = L, np.uint64((ring_nodes + 1) * lanes)
    RF1, RF2, RF3, HF1, HF2, HF3 = (table[f"F{i}"] for table in (g, o) for i in (1, 2, 3))
    helix_first = np.uint64(straight * lanes)
    BEFORE, AFTER, RING_BEFORE, RING_AFTER = (table[k] for table in (o, g) for k in ("LEVEL_BEFORE", "LEVEL_AFTER"))
    X, Q = tuple(o[f"X{i}"] for i in (1, 2, 3)), tuple(o[f"Q{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3))
    V, RING_V = tuple(o[f"V{i}"] for i in (1, 2, 3)), tuple(g[f"V{i}"] for i in (1, 2, 3))
    STRETCH, LENGTH, RING_STRETCH, RING_X = o["STRETCH"], o["LENGTH"], g["STRETCH"], g["X1"]

    @kernel
    def measure(b, share, h, laws):
        close_state(b)
        strain(b, first, helix_first, share, 0.25 * h, laws[0])
        strain(b, helix_first, last, share, 0.25 * h, laws[1])
        bend(b, first, last)
        ring_strain(b, ring_first, ring_last, share, 0.25 * h, laws[2])
        close_strain(b)
        ring_bend(b, ring_first, ring_last)
        close_moment(b)

    @kernel
    def spokes(b, drag):
        gather(b)
        cord(b)
        neighbours(b)
        ring_muscle(b)
        if even:
            repel(b)
        ring_ring(b)
        if not even:
            beside(b)
        scatter(b, drag[0], drag[1])

    @kernel
    def crossings(b, ring_index, helix_index):
        for k in range(ring_first, ring_last):
            b[RF1 + k], b[RF2 + k], b[RF3 + k] = 0.0, 0.0, 0.0
        for k in range(helix_first, last):
            b[HF1 + k], b[HF2 + k], b[HF3 + k] = 0.0, 0.0, 0.0
        fetch(b, ring_index, helix_index)
        connect(b)
        give(b, ring_index, helix_index)

    @kernel
    def push(b):
        kick(b, first, last)
        spin(b, first, last)
        ring_kick(b, ring_first, ring_last)
        ring_spin(b, ring_first, ring_last)

    @kernel
    def relax(b):
        close_speed(b)
        axial(b, first, last)
        solve(b, n, straight, np.uint64(0), ONE)
        solve(b, long, helices, np.uint64(straight), np.uint64(helix_slots))
        correct(b, first, last)
        ring_axial(b, ring_first, ring_last)
        ring_solve(b)
        ring_correct(b, ring_first, ring_last)

    @kernel
    def move(b, h):
        drift(b, first, last, h)
        ring_drift(b, ring_first, ring_last, h)

    @kernel
    def set_levels(b, row, ring_row, longitudinal, oblique, transverse):
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
    def guard(b):
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
    def record(b, points, frames, stretch):
        for k in range(ONE, n + ONE + ONE):
            for c in range(3):
                points[k - ONE, c] = b[X[c] + k]
        for k in range(ONE, n + ONE):
            for c in range(9):
                frames[k - ONE, c // 3, c % 3] = b[Q[c] + k]
            total = 0.0
            for c in range(3):
                total += (b[X[c] + k + ONE] - b[X[c] + k]) ** 2
            stretch[k - ONE] = np.sqrt(total) / b[LENGTH + k]

    @kernel
    def advance(b, h, steps, longitudinal, oblique, transverse, laws, drag, ring_index, helix_index, points, frames, stretch, watch):
        for sample in range(points.shape[0]):
            set_levels(b, BEFORE, RING_BEFORE, longitudinal[sample], oblique[sample], transverse[sample])
            set_levels(b, AFTER, RING_AFTER, longitudinal[sample + 1], oblique[sample + 1], transverse[sample + 1])
            move(b, 0.5 * h)
            for step in range(steps):
                measure(b, (step + 0.5) / steps, h, laws)
                crossings(b, ring_index, helix_index)
                if published:
                    # Straight rods have none of it, and the spokes use their scratch.
                    close_speed(b)
                    brake(b, drag[2], drag[3])
                spokes(b, drag)
                push(b)
                if sliding:
                    slide(b)
                if published:
                    smooth(b, first, last)
                else:
                    steady(b, 1 - np.exp(-RING_SPIN_RATE * h))
                    hold(b, 1 - np.exp(-CORD_SLIP_RATE * h), ONE + ONE, n + ONE + ONE)
                    relax(b)
                    if sliding:
                        slide(b)
                move(b, h if step + 1 < steps else 0.5 * h)
                if watch:
                    finding, family, where = guard(b)
                    if finding != FINE:
                        return sample, finding, family, where
            finding, family, where = guard(b)
            if finding != FINE:
                return sample, finding, family, where
            record(b, points[sample], frames[sample], stretch[sample])
        return points.shape[0], FINE, 0, ONE

    parts = {
        "measure": measure,
        "crossings": crossings,
        "spokes": spokes,
        "push": push,
        "relax": relax,
        "move": move,
        "gather": gather,
        "cord": cord,
        "neighbours": neighbours,
        "ring_muscle": ring_muscle,
        "ring_ring": ring_ring,
        "beside": beside,
        "scatter": scatter,
        "strain": strain,
        "bend": bend,
        "ring_strain": ring_strain,
        "ring_bend": ring_bend,
        "fetch": fetch,
        "connect": connect,
        "give": give,
        "solve": solve,
        "ring_solve": ring_solve,
        "kick": kick,
        "spin": spin,
        "ring_kick": ring_kick,
        "ring_spin": ring_spin,
        "cord_brake": hold,
        "repel": repel,
        "slide": slide,
        "drift": drift,
        "ring_drift": ring_drift,
    }
    return advance, parts
