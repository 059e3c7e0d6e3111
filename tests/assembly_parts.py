"""Compiled pieces of a step of the full arm one by one, for tests that look at a state between them."""

import numpy as np

from octoctrl.sim.assembly.crossing_kernels import crossing_kernels
from octoctrl.sim.assembly.family_kernels import cord_brake, open_solver, ring_solver
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.published_joint_kernels import RESULTS, even_repulsion, published_ring_joints, squeeze_kernels
from octoctrl.sim.assembly.side_kernels import side_kernels
from octoctrl.sim.assembly.spoke_kernels import beside_kernel, collect_kernel, gather_kernel, share_kernel
from octoctrl.sim.assembly.stepping import mover
from octoctrl.sim.assembly.terms import Step, hydrostat_terms, published_terms


def step_of(plant, drag=None):
    """What the terms of a plant's step are given."""
    rods = plant.core.rods
    h, laws, drag = map(plant.core._rounded, (plant.h, plant.core._laws, plant.core._drag if drag is None else drag))
    return Step(h, laws, drag, rods.ring_index, rods.helix_index)


def terms_of(plant, drag=None):
    """Terms of a plant's step by name, as functions of nothing or of the share of the sample."""
    traits = plant.arm.anatomy.traits
    if plant.core.paper_compatible:
        terms = published_terms(plant.core.grid, traits, plant.core.geometry.inclination)
    else:
        terms = hydrostat_terms(plant.core.grid, traits)
    step = step_of(plant, drag)
    return {name: lambda share=0.5, term=term: term(plant.core.rods.flat, share, step) for name, term in terms.items()}


def parts_of(plant):
    """Movement, strains, axial step and systems, and the published connections one by one."""
    grid, terms, step = plant.core.grid, hydrostat_terms(plant.core.grid, plant.arm.anatomy.traits), step_of(plant)
    (cord, neighbours), (ring_muscle, ring_ring) = side_kernels(grid, True), published_ring_joints(grid, plant.core.geometry.inclination)
    collect, (squeeze, hand_on), share_out = collect_kernel(grid, RESULTS), squeeze_kernels(grid), share_kernel(grid)
    gather, beside = gather_kernel(grid, True), beside_kernel(grid, True)

    def scatter(b, normal, tangential):
        collect(b)
        squeeze(b)
        share_out(b, normal, tangential)
        hand_on(b)

    def crossings(b, ring_index, helix_index):
        fetch, connect, give = crossing_kernels(grid, True)
        for row in (R.F1, R.F2, R.F3):
            plant.core.rods.rings[row] = 0.0
            plant.core.rods.oblique(row, nodes=True)[:] = 0.0
        fetch(b, ring_index, helix_index)
        connect(b)
        give(b, ring_index, helix_index)

    def spokes(b, drag):
        for part in (gather, cord, neighbours, ring_muscle, ring_ring, beside):
            part(b)
        scatter(b, *drag)

    def measure(b, share, h, laws):
        terms["strains"](b, share, step._replace(h=h, laws=laws))
        for rows in (plant.core.rods.open_rods, plant.core.rods.rings):  # which only the published strains measure
            rows[R.RADIUS] = rows[R.REST_RADIUS] / np.sqrt(np.maximum(rows[R.STRETCH], 1e-9))

    def push(b):
        for name in ("ring spin", "kick"):
            terms[name](b, 0.5, step)

    return {
        "move": mover(grid),
        "measure": measure,
        "push": push,
        "relax": lambda b: terms["axial"](b, 0.5, step),
        "solve": open_solver(grid),
        "ring_solve": ring_solver(grid)[0],
        "cord_brake": cord_brake(grid),
        "gather": gather,
        "cord": cord,
        "neighbours": neighbours,
        "ring_muscle": ring_muscle,
        "ring_ring": ring_ring,
        "repel": even_repulsion(grid),
        "beside": beside,
        "scatter": scatter,
        "crossings": crossings,
        "spokes": spokes,
    }


def vectors(view, row, **nodes):
    """Three rows of a family as vectors, (rods, n, 3)."""
    return np.stack([view(R(row + i), **nodes) for i in range(3)], axis=-1)
