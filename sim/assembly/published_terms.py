"""The terms of a step by the published laws, in their order, for comparison; see `octoctrl.sim.assembly.terms`."""

from typing import Any

import numpy as np

from ..body.anatomy import Traits
from ..body.grid import AssemblyGrid
from ..compiler import kernel
from ..contact.body_kernels import kick_bodies
from ..contact.near_kernels import CLOSE, MOVES
from .family_kernels import family_kernels, ring_solver
from .published_contact_kernels import published_contact_kernels
from .published_joint_kernels import RESULTS, even_repulsion, published_ring_joints, squeeze_kernels
from .published_kernels import published_drag, published_strain, velocity_filters
from .side_kernels import side_kernels
from .spoke_kernels import beside_kernel, collect_kernel, gather_kernel, share_kernels
from .terms import Phase, Phases, Terms, base_slide, crossing_terms, kick_term, on_its_own, outside_loads, ring_spin_term, strain_terms


def published_terms(grid: AssemblyGrid, traits: Traits, inclination: float, loaded: bool = False, touching: bool = False) -> Phases:
    """Terms of the published numerics, for an `inclination` (rad) of the longitudinal muscles; they know no parts but the whole."""
    gather, (cord, neighbours) = gather_kernel(grid, True), side_kernels(grid, True)
    ring_muscle, ring_ring = published_ring_joints(grid, inclination)
    beside, collect, (halve, add_up) = beside_kernel(grid, True), collect_kernel(grid, RESULTS), share_kernels(grid)
    squeeze, hand_on = squeeze_kernels(grid)
    repel, brake, filters, even = even_repulsion(grid), published_drag(grid), velocity_filters(grid, not traits.bare), traits.even
    _, _, _, _, close_speed = ring_solver(grid)
    rods, rings = family_kernels(grid, False), family_kernels(grid, True, traits.graded)
    strain, ring_strain = (published_strain(grid, *family, traits.bare) for family in ((False, False), (True, traits.graded)))
    strains, bending = strain_terms(grid, rods, rings, strain, ring_strain)
    crossings, on_helices = crossing_terms(grid, True)
    first, last = np.uint64(1), np.uint64(grid.open_slots * grid.lanes - 1)

    @kernel
    def drag(b: Any, share: Any, step: Any, part: Any) -> None:
        # Straight rods have none of it, and the spokes use their scratch.
        close_speed(b, part)
        brake(b, step.drag[2], step.drag[3])

    @kernel
    def spokes(b: Any, share: Any, step: Any, part: Any) -> None:
        gather(b, part)
        cord(b, part)
        neighbours(b, part)
        ring_muscle(b)
        if even:
            repel(b)
        ring_ring(b)
        if not even:
            beside(b, part)

    @kernel
    def sums(b: Any, share: Any, step: Any, part: Any) -> None:
        collect(b, part)
        squeeze(b)
        halve(b, part, step.drag[0], step.drag[1])
        add_up(b, part)
        hand_on(b)

    @kernel
    def smooth(b: Any, share: Any, step: Any, part: Any) -> None:
        filters(b, first, last)

    terms = {
        "strains": strains,
        "strains, bending": bending,
        "crossings": crossings,
        "crossings, helices": on_helices,
        **_pressed(grid, touching),
        "drag": drag,
        "spokes": spokes,
        "sums": sums,
        **outside_loads(grid, loaded),
        "ring spin": ring_spin_term(grid, rings),
        "kick": kick_term(grid, rods, rings),
        **base_slide(grid, traits)("slide"),
        "smooth": smooth,
    }
    return (Phase(terms),)


def _pressed(grid: AssemblyGrid, touching: bool) -> Terms:
    """The term of published contact forces, if there are bodies."""
    if not touching:
        return {}
    _, exert = published_contact_kernels(grid)

    @kernel
    def press(b: Any, share: Any, step: Any) -> None:
        if step.world.seen[MOVES]:
            kick_bodies(step.world.bodies, step.h)
        if step.world.seen[CLOSE]:
            exert(b, step.world, step.h)

    return {"press": on_its_own(press)}
