"""The terms of a step of the true hydrostat, in their order: joints with a potential, slabs that keep their volume, implicit muscle
viscosity; see `octoctrl.sim.assembly.terms`.
"""

from typing import Any

import numpy as np

from ..body.anatomy import Traits
from ..body.grid import AssemblyGrid
from ..compiler import kernel
from ..contact.body_kernels import kick_bodies
from ..contact.near_kernels import CLOSE, MEETING, MOVES
from ..contact.pair_kernels import meet
from .contact_kernels import contact_kernels, fold_kernels
from .family_kernels import cord_brake, family_kernels, family_offsets, ring_solver, ring_spin_brake
from .halves import Stage
from .joint_kernels import RESULTS, load_kernels, ring_joints
from .parts import sweep, sweep_open
from .pressure_kernels import pressure_kernels
from .ring_mass_kernels import ring_mass_kernels
from .side_kernels import side_kernels
from .spoke_kernels import beside_kernel, collect_kernel, gather_kernel, share_kernels
from .system_kernels import two_ended
from .terms import Phase, Phases, Terms, base_slide, crossing_terms, kick_term, on_its_own, outside_loads, ring_spin_term, strain_terms

RING_SPIN_RATE = 2500.0
"""Rate (1/s) at which ring elements lose their spin relative to their ring: about a tenth of critical in their shear rotation."""

CORD_SLIP_RATE = 300.0
"""Rate (1/s) at which the nerve cord loses its velocity relative to the muscles around it: about critical for their springs."""


def hydrostat_terms(grid: AssemblyGrid, traits: Traits, loaded: bool = False, touching: bool = False, folding: bool = False) -> Phases:
    """Terms of the default numerics: joints with a potential, slabs that keep their volume, implicit muscle viscosity."""
    gather, (cord, neighbours), (ring_muscle, ring_ring) = gather_kernel(grid, False), side_kernels(grid, False), ring_joints(grid)
    beside, collect, (load, hand_on) = beside_kernel(grid, False), collect_kernel(grid, RESULTS), load_kernels(grid)
    (halve, add_up), (volumes, press, resist, deflate, settle) = share_kernels(grid), pressure_kernels(grid, traits.sliding)
    smooth_rings = ring_mass_kernels(grid)
    steady, hold, even = ring_spin_brake(grid), cord_brake(grid), traits.even
    rods, rings = family_kernels(grid, False), family_kernels(grid, True, traits.graded, plain=True)
    strains, bending = strain_terms(grid, rods, rings, rods["strain"], rings["strain"])
    crossings, on_helices = crossing_terms(grid, False)
    relax, hold_rings, outward, pull = _axial(grid, rods, rings)

    @kernel
    def sides(b: Any, share: Any, step: Any, part: Any) -> None:
        gather(b, part)
        cord(b, part)
        neighbours(b, part)

    @kernel
    def ring_connections(b: Any, share: Any, step: Any, part: Any) -> None:
        ring_muscle(b, part)

    @kernel
    def ring_slip(b: Any, share: Any, step: Any, part: Any) -> None:
        ring_ring(b, part)

    @kernel
    def contacts(b: Any, share: Any, step: Any, part: Any) -> None:
        if not even:
            beside(b, part)

    @kernel
    def sums(b: Any, share: Any, step: Any, part: Any) -> None:
        collect(b, part)
        load(b, part)
        halve(b, part, step.drag[0], step.drag[1])

    @kernel
    def on_nodes(b: Any, share: Any, step: Any, part: Any) -> None:
        add_up(b, part)
        hand_on(b, part)

    @kernel
    def pressure(b: Any, share: Any, step: Any, part: Any) -> None:
        volumes(b, part)
        press(b, part)

    @kernel
    def brakes(b: Any, share: Any, step: Any, part: Any) -> None:
        steady(b, part, 1.0 - np.exp(-RING_SPIN_RATE * step.h))
        hold(b, part, 1.0 - np.exp(-CORD_SLIP_RATE * step.h))

    @kernel
    def smooth(b: Any, share: Any, step: Any, part: Any) -> None:
        smooth_rings(b, part)

    @kernel
    def project(b: Any, share: Any, step: Any, part: Any) -> None:
        resist(b, part, step.h)

    @kernel
    def project_rings(b: Any, share: Any, step: Any, part: Any) -> None:
        deflate(b, part)

    @kernel
    def project_muscles(b: Any, share: Any, step: Any, part: Any) -> None:
        settle(b, part)

    slide, (touch, follow) = base_slide(grid, traits), _touched(grid, touching, folding)
    first = {
        "strains": strains,
        "crossings": crossings,
        "sides": sides,
        "ring connections": ring_connections,
        "contacts": contacts,
        "sums": sums,
    }
    forces = {
        "strains, bending": bending,
        "crossings, helices": on_helices,
        "ring connections, slip": ring_slip,
        "sums, nodes": on_nodes,
        "pressure": pressure,
        **outside_loads(grid, loaded),
    }
    velocities = {
        "ring spin": ring_spin_term(grid, rings),
        "kick": kick_term(grid, rods, rings, family_kernels(grid, False, plain=True)["spin"]),
        **slide("slide"),
        "brakes": brakes,
    }
    phases: Phases = (
        Phase(first),
        Phase(forces, Stage.FORCES),
        Phase(velocities, Stage.VELOCITIES),
        Phase(touch, alone=True),
        Phase({"axial": relax, "smooth": smooth, "hold": hold_rings}, Stage.AXIAL),
        Phase({"axial, outward": outward}, Stage.OUTWARD),
        Phase({"axial, speeds": pull}, Stage.SPEEDS),
        Phase({"project": project}, Stage.PROJECT),
        Phase({"project, rings": project_rings}, Stage.RINGS),
        Phase({"project, muscles": project_muscles, **slide("slide again")}, Stage.MUSCLES),
        Phase(follow, alone=True),
        Phase({}, Stage.MOTION),
    )
    return tuple(phase for phase in phases if phase.terms or phase.stage is not None)


def _touched(grid: AssemblyGrid, touching: bool, folding: bool) -> tuple[Terms, Terms]:
    """Impulses from bodies and of the arm on itself, before the implicit axial step; anchors that follow at the end."""
    touches, follows = _touched_by_bodies(grid) if touching else ({}, {})
    if folding:
        _, part, _ = fold_kernels(grid)

        @kernel
        def fold(b: Any, share: Any, step: Any) -> None:
            part(b, step.folds, np.float64(step.h))

        touches = touches | {"fold": on_its_own(fold)}
    return touches, follows


def _touched_by_bodies(grid: AssemblyGrid) -> tuple[Terms, Terms]:
    _, exchange, go_along = contact_kernels(grid)

    @kernel
    def touch(b: Any, share: Any, step: Any) -> None:
        world, h = step.world, np.float64(step.h)
        if world.seen[MOVES]:
            kick_bodies(world.bodies, h)
        if world.seen[CLOSE]:
            exchange(b, world, h)
        if world.seen[MEETING]:
            meet(world, h)

    @kernel
    def follow(b: Any, share: Any, step: Any) -> None:
        if step.world.seen[CLOSE]:
            go_along(b, step.world, np.float64(step.h))

    return {"touch": on_its_own(touch)}, {"follow": on_its_own(follow)}


def _axial(grid: AssemblyGrid, rods: Any, rings: Any) -> tuple[Any, Any, Any, Any]:
    """Axial systems: of the rings, and of the open rods half way; of the rings again, when their increments of velocity have been smoothed;
    of the open rods outward again, and what they do to velocities.
    """
    axial, correct = (sweep_open(grid, rods[name]) for name in ("axial", "correct"))
    ring_axial, ring_rates, ring_correct = (sweep(grid, "rings", rings[name]) for name in ("axial", "elongate", "correct"))
    ring_solve, _, _, _, close_speed = ring_solver(grid)
    eliminate, substitute = two_ended(family_offsets(grid, False), "CORRECTION")
    straight, helices = grid.straight_rods, grid.helices
    none, jump, nodes = (np.uint64(value) for value in (0, grid.lanes, grid.helix_nodes))
    start, wide = np.uint64(straight * grid.lanes), np.uint64(grid.helix_nodes * grid.lanes)

    @kernel
    def relax(b: Any, share: Any, step: Any, part: Any) -> None:
        close_speed(b, part)
        axial(b, part)
        eliminate(b, part.first, part.last, part.middle, none, jump, straight)
        eliminate(b, part.helix_first, part.helix_last, nodes * part.middle, start, wide, helices)
        ring_axial(b, part)
        ring_solve(b, part)
        ring_correct(b, part)
        close_speed(b, part)
        ring_rates(b, part)

    @kernel
    def hold(b: Any, share: Any, step: Any, part: Any) -> None:
        close_speed(b, part)
        ring_axial(b, part)
        ring_solve(b, part)
        ring_correct(b, part)

    @kernel
    def outward(b: Any, share: Any, step: Any, part: Any) -> None:
        substitute(b, part.first, part.last, part.middle, none, jump, straight)
        substitute(b, part.helix_first, part.helix_last, nodes * part.middle, start, wide, helices)

    @kernel
    def pull(b: Any, share: Any, step: Any, part: Any) -> None:
        correct(b, part)

    return relax, hold, outward, pull
