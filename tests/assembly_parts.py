"""Compiled pieces of a step of the full arm one by one, for tests that look at a state between them."""

import numpy as np

from octoctrl.sim.assembly.crossing_kernels import crossing_kernels
from octoctrl.sim.assembly.family_kernels import cord_brake, family_offsets, ring_solver
from octoctrl.sim.assembly.hydrostat_terms import hydrostat_terms
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.parts import whole
from octoctrl.sim.assembly.published_joint_kernels import RESULTS, even_repulsion, published_ring_joints, squeeze_kernels
from octoctrl.sim.assembly.published_terms import published_terms
from octoctrl.sim.assembly.side_kernels import side_kernels
from octoctrl.sim.assembly.spoke_kernels import beside_kernel, collect_kernel, gather_kernel, share_kernels
from octoctrl.sim.assembly.stepping import mover
from octoctrl.sim.assembly.system_kernels import two_ended
from octoctrl.sim.assembly.terms import Step, by_name


def step_of(plant, drag=None):
    """What the terms of a plant's step are given."""
    rods = plant.core.rods
    h, laws, drag = map(plant.core._rounded, (plant.h, plant.core._laws, plant.core._drag if drag is None else drag))
    return Step(h, laws, drag, rods.ring_index, rods.helix_index)


def laws_of(phases):
    """Terms of a step by the name of their law, those of its stages in turn, as functions of ``(buffer, share, step, part)``."""
    stages = {}
    for name, term in by_name(phases).items():
        stages.setdefault(name.split(", ")[0], []).append(term)

    def law(terms):
        def apply(*arguments):
            for term in terms:
                term(*arguments)

        return apply

    return {name: law(terms) for name, terms in stages.items()}


def terms_of(plant, drag=None):
    """Laws of a plant's step by name, as functions of nothing or of the share of the sample."""
    traits, grid = plant.arm.anatomy.traits, plant.core.grid
    if plant.core.paper_compatible:
        phases = published_terms(grid, traits, plant.core.geometry.inclination)
    else:
        phases = hydrostat_terms(grid, traits)
    step, arm = step_of(plant, drag), whole(grid)
    return {name: lambda share=0.5, law=law: law(plant.core.rods.flat, share, step, arm) for name, law in laws_of(phases).items()}


def parts_of(plant):
    """Movement, strains, axial step and systems, and the published connections one by one."""
    grid, step, arm = plant.core.grid, step_of(plant), whole(plant.core.grid)
    laws = laws_of(hydrostat_terms(grid, plant.arm.anatomy.traits))
    (cord, neighbours), (ring_muscle, ring_ring) = side_kernels(grid, True), published_ring_joints(grid, plant.core.geometry.inclination)
    collect, (squeeze, hand_on), (halve, add_up) = collect_kernel(grid, RESULTS), squeeze_kernels(grid), share_kernels(grid)
    gather, beside, move = gather_kernel(grid, True), beside_kernel(grid, True), mover(grid)
    eliminate, substitute = two_ended(family_offsets(grid, False), "CORRECTION")

    def of_all(kernel):
        return lambda b: kernel(b, arm)

    def scatter(b, normal, tangential):
        collect(b, arm)
        squeeze(b)
        halve(b, arm, normal, tangential)
        add_up(b, arm)
        hand_on(b)

    def crossings(b, ring_index, helix_index):
        fetch, connect, give_rings, give_helices = crossing_kernels(grid, True)
        for row in (R.F1, R.F2, R.F3):
            plant.core.rods.rings[row] = 0.0
            plant.core.rods.oblique(row, nodes=True)[:] = 0.0
        fetch(b, arm, ring_index, helix_index)
        connect(b, arm)
        give_rings(b, arm, ring_index)
        give_helices(b, arm, helix_index)

    def spokes(b, drag):
        for part in (pieces[name] for name in ("gather", "cord", "neighbours", "ring_muscle", "ring_ring", "beside")):
            part(b)
        scatter(b, *drag)

    def measure(b, share, h, given):
        laws["strains"](b, share, step._replace(h=h, laws=given), arm)
        for rows in (plant.core.rods.open_rods, plant.core.rods.rings):  # which only the published strains measure
            rows[R.RADIUS] = rows[R.REST_RADIUS] / np.sqrt(np.maximum(rows[R.STRETCH], 1e-9))

    def push(b):
        for name in ("ring spin", "kick"):
            laws[name](b, 0.5, step, arm)

    def solve(b, n, rods, slot, wide):
        system = (np.uint64(1), n + np.uint64(1), wide * np.uint64(grid.middle), slot * np.uint64(grid.lanes), wide * np.uint64(grid.lanes))
        eliminate(b, *system, rods)
        substitute(b, *system, rods)

    pieces = {
        "move": lambda b, h: move(b, arm, h),
        "measure": measure,
        "push": push,
        "relax": lambda b: laws["axial"](b, 0.5, step, arm),
        "solve": solve,
        "ring_solve": of_all(ring_solver(grid)[0]),
        "cord_brake": lambda b, share: cord_brake(grid)(b, arm, share),
        "gather": of_all(gather),
        "cord": of_all(cord),
        "neighbours": of_all(neighbours),
        "ring_muscle": ring_muscle,
        "ring_ring": ring_ring,
        "repel": even_repulsion(grid),
        "beside": of_all(beside),
        "scatter": scatter,
        "crossings": crossings,
        "spokes": spokes,
    }
    return pieces


def vectors(view, row, **nodes):
    """Three rows of a family as vectors, (rods, n, 3)."""
    return np.stack([view(R(row + i), **nodes) for i in range(3)], axis=-1)
