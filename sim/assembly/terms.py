"""The terms of a step, in their order, for the two numerics: the true hydrostat, and the published laws for comparison.

A term is a compiled ``term(buffer, share, step, part)``, with `share` how much of the sample has passed in the middle of the step, and
works on a part of the arm (`octoctrl.sim.assembly.parts`). Forces are collected first, then velocities change; positions are moved between
steps, by `octoctrl.sim.assembly.stepping`.

Terms stand in phases. Where one reads of the neighbouring cross-section what another has written, parts have to exchange it between them,
so that it stands in a later phase, which says what it reads (`octoctrl.sim.assembly.halves.Stage`); what goes on under one name with ``, ``
behind is one law in stages. A term that is not made for parts is one `on_its_own`, in a phase of its own.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..body.anatomy import Traits
from ..body.grid import AssemblyGrid
from ..compiler import kernel
from ..contact.body_kernels import kick_bodies
from ..contact.near_kernels import CLOSE, MEETING, MOVES
from ..contact.pair_kernels import meet
from .between_kernels import between_kernels
from .contact_kernels import contact_kernels
from .crossing_kernels import crossing_kernels
from .family_kernels import cord_brake, family_kernels, family_offsets, ring_solver, ring_spin_brake
from .halves import Stage
from .joint_kernels import RESULTS, load_kernels, ring_joints
from .outside_kernels import outside_kernels
from .parts import sweep, sweep_open
from .pressure_kernels import pressure_kernels
from .published_contact_kernels import published_contact_kernels
from .published_joint_kernels import RESULTS as PUBLISHED_RESULTS
from .published_joint_kernels import even_repulsion, published_ring_joints, squeeze_kernels
from .published_kernels import published_drag, published_strain, velocity_filters
from .ring_mass_kernels import ring_mass_kernels
from .side_kernels import side_kernels
from .spoke_kernels import beside_kernel, collect_kernel, gather_kernel, share_kernels
from .system_kernels import two_ended
from .trait_kernels import sliding_base

ONE = np.uint64(1)
RING_SPIN_RATE = 2500.0
"""Rate (1/s) at which ring elements lose their spin relative to their ring: about a tenth of critical in their shear rotation."""

CORD_SLIP_RATE = 300.0
"""Rate (1/s) at which the nerve cord loses its velocity relative to the muscles around it: about critical for their springs."""

Terms = dict[str, Any]
"""Compiled terms by name, in the order of a phase."""


class Phase(NamedTuple):
    """Terms between which parts of the arm exchange nothing.

    Attributes
    ----------
    terms : Terms
    stage : Stage or None
        What they read of the other part, if there is anything.
    alone : bool
        Whether one thread does them for all parts, while the other waits.
    """

    terms: Terms
    stage: Stage | None = None
    alone: bool = False


Phases = tuple[Phase, ...]
"""What is done in a step; the last does nothing but to exchange what movement needs."""

NOTHING = np.zeros((3, 1))
"""Forces of no loads."""


class Step(NamedTuple):
    """What the terms of a step are given beside the buffer.

    Attributes
    ----------
    h : float, s
    laws : tuple of LawConstants
        Longitudinal, oblique and transverse muscle, and nerve cord.
    drag : tuple of float
        Normal and tangential drag of the muscles, kg/m^3; linear drag of helices and rings in the published numerics, 1/s.
    ring_index, helix_index : (places, helices * lanes) uint64
        Where the crossings find their nodes.
    outside : (3, straight rods * lanes) float64
        Forces of loads from outside on the nodes of cord and muscles, N, if there are any.
    world : World or ()
        Bodies to touch, if there are any, see `octoctrl.sim.contact.world`.
    """

    h: float
    laws: tuple
    drag: tuple
    ring_index: np.ndarray
    helix_index: np.ndarray
    outside: np.ndarray = NOTHING
    world: Any = ()


def by_name(phases: Phases) -> Terms:
    """All terms of a step."""
    return {name: term for phase in phases for name, term in phase.terms.items()}


def on_its_own(term: Any) -> Any:
    """Compile a term of the whole arm, ``term(buffer, share, step)``, as one of parts: the first of them does it."""

    @kernel
    def alone(b: Any, share: Any, step: Any, part: Any) -> None:
        if part.before == 0:
            term(b, share, step)

    return alone


def hydrostat_terms(grid: AssemblyGrid, traits: Traits, loaded: bool = False, touching: bool = False) -> Phases:
    """Terms of the default numerics: joints with a potential, slabs that keep their volume, implicit muscle viscosity."""
    gather, (cord, neighbours), (ring_muscle, ring_ring) = gather_kernel(grid, False), side_kernels(grid, False), ring_joints(grid)
    beside, collect, (load, hand_on) = beside_kernel(grid, False), collect_kernel(grid, RESULTS), load_kernels(grid)
    (halve, add_up), (volumes, press, resist, deflate, settle) = share_kernels(grid), pressure_kernels(grid, traits.sliding)
    smooth_rings = ring_mass_kernels(grid)
    steady, hold, even = ring_spin_brake(grid), cord_brake(grid), traits.even
    rods, rings = family_kernels(grid, False), family_kernels(grid, True, traits.graded, plain=True)
    strains, bending = _strains(grid, rods, rings, rods["strain"], rings["strain"])
    crossings, on_helices = _crossings(grid, False)
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

    slide, (touch, follow) = _slide(grid, traits), _touched(grid, touching)
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
        **_loads(grid, loaded),
    }
    velocities = {
        "ring spin": _ring_spin(grid, rings),
        "kick": _kick(grid, rods, rings, family_kernels(grid, False, plain=True)["spin"]),
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


def published_terms(grid: AssemblyGrid, traits: Traits, inclination: float, loaded: bool = False, touching: bool = False) -> Phases:
    """Terms of the published numerics, for an `inclination` (rad) of the longitudinal muscles; they know no parts but the whole."""
    gather, (cord, neighbours) = gather_kernel(grid, True), side_kernels(grid, True)
    ring_muscle, ring_ring = published_ring_joints(grid, inclination)
    beside, collect, (halve, add_up) = beside_kernel(grid, True), collect_kernel(grid, PUBLISHED_RESULTS), share_kernels(grid)
    squeeze, hand_on = squeeze_kernels(grid)
    repel, brake, filters, even = even_repulsion(grid), published_drag(grid), velocity_filters(grid, not traits.bare), traits.even
    _, _, _, _, close_speed = ring_solver(grid)
    rods, rings = family_kernels(grid, False), family_kernels(grid, True, traits.graded)
    strain, ring_strain = (published_strain(grid, *family, traits.bare) for family in ((False, False), (True, traits.graded)))
    strains, bending = _strains(grid, rods, rings, strain, ring_strain)
    crossings, on_helices = _crossings(grid, True)
    first, last = ONE, np.uint64(grid.open_slots * grid.lanes - 1)

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
        **_loads(grid, loaded),
        "ring spin": _ring_spin(grid, rings),
        "kick": _kick(grid, rods, rings),
        **_slide(grid, traits)("slide"),
        "smooth": smooth,
    }
    return (Phase(terms),)


def _loads(grid: AssemblyGrid, loaded: bool) -> Terms:
    """The term of loads from outside, if there are any."""
    if not loaded:
        return {}
    _, add = outside_kernels(grid)

    @kernel
    def loads(b: Any, share: Any, step: Any, part: Any) -> None:
        add(b, part, step.outside)

    return {"loads": loads}


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


def _touched(grid: AssemblyGrid, touching: bool) -> tuple[Terms, Terms]:
    """Impulses from bodies, before the implicit axial step, and anchors that follow at the end, if there are bodies."""
    if not touching:
        return {}, {}
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


def _slide(grid: AssemblyGrid, traits: Traits) -> Callable[[str], Terms]:
    """The term, under any name, that puts the first nodes of muscles and helices back into their plane, if the base slides."""
    if not traits.sliding:
        return lambda name: {}
    hold = sliding_base(grid)

    @kernel
    def slide(b: Any, share: Any, step: Any, part: Any) -> None:
        hold(b, part)

    return lambda name: {name: slide}


def _strains(grid: AssemblyGrid, rods: Any, rings: Any, strain: Any, ring_strain: Any) -> tuple[Any, Any]:
    """Strains of all rods with the moments of the rings, and, when all parts have them, the moments of the open rods."""
    _, close_state, close_strain, close_moment, _ = ring_solver(grid)
    cord, muscles, helices = (sweep(grid, family, strain) for family in ("cord", "muscles", "helices"))
    bend, strain_rings, bend_rings = sweep_open(grid, rods["bend"]), sweep(grid, "rings", ring_strain), sweep(grid, "rings", rings["bend"])

    @kernel
    def strains(b: Any, share: Any, step: Any, part: Any) -> None:
        elastic = 0.25 * step.h
        close_state(b, part)
        cord(b, part, share, elastic, step.laws[3])
        muscles(b, part, share, elastic, step.laws[0])
        helices(b, part, share, elastic, step.laws[1])
        strain_rings(b, part, share, elastic, step.laws[2])
        close_strain(b, part)
        bend_rings(b, part)
        close_moment(b, part)

    @kernel
    def bending(b: Any, share: Any, step: Any, part: Any) -> None:
        bend(b, part)

    return strains, bending


def _crossings(grid: AssemblyGrid, published: bool) -> tuple[Any, Any]:
    """Crossings with their forces on rings, and, when all parts have them, the forces on helices."""
    fetch, connect, give_rings, give_helices = between_kernels(grid) if grid.between else crossing_kernels(grid, published)
    (ring_forces, helix_forces) = (tuple(family_offsets(grid, rings)[f"F{i}"] for i in (1, 2, 3)) for rings in (True, False))

    @kernel
    def clear(b: Any, first: Any, last: Any, rows: Any) -> None:
        for row in rows:
            for k in range(first, last):
                b[row + k] = 0.0

    clear_rings, clear_helices = sweep(grid, "rings", clear), sweep(grid, "helices", clear)

    @kernel
    def crossings(b: Any, share: Any, step: Any, part: Any) -> None:
        clear_rings(b, part, ring_forces)
        clear_helices(b, part, helix_forces)
        fetch(b, part, step.ring_index, step.helix_index)
        connect(b, part)
        give_rings(b, part, step.ring_index)

    @kernel
    def on_helices(b: Any, share: Any, step: Any, part: Any) -> None:
        give_helices(b, part, step.helix_index)

    return crossings, on_helices


def _ring_spin(grid: AssemblyGrid, rings: Any) -> Any:
    spin = sweep(grid, "rings", rings["spin"])

    @kernel
    def ring_spin(b: Any, share: Any, step: Any, part: Any) -> None:
        spin(b, part)

    return ring_spin


def _kick(grid: AssemblyGrid, rods: Any, rings: Any, spin_helices: Any = None) -> Any:
    kick_rods, kick_rings = sweep_open(grid, rods["kick"]), sweep(grid, "rings", rings["kick"])
    spin, spin_rest = sweep(grid, "straight", rods["spin"]), sweep(grid, "helices", rods["spin"] if spin_helices is None else spin_helices)

    @kernel
    def kick(b: Any, share: Any, step: Any, part: Any) -> None:
        kick_rods(b, part)
        spin(b, part)
        spin_rest(b, part)
        kick_rings(b, part)

    return kick


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
