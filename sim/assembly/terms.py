"""The terms of a step, in their order, for the two numerics: the true hydrostat, and the published laws for comparison.

A term is a compiled ``term(buffer, share, step)``, with `share` how much of the sample has passed in the middle of the step. Forces are
collected first, then velocities change; positions are moved between steps, by `octoctrl.sim.assembly.stepping`.
"""

from typing import Any, NamedTuple

import numpy as np

from ..body.anatomy import Traits
from ..body.grid import AssemblyGrid
from ..compiler import kernel
from ..contact.body_kernels import kick_bodies
from ..contact.pair_kernels import meet
from .between_kernels import between_kernels
from .contact_kernels import contact_kernels
from .crossing_kernels import crossing_kernels
from .family_kernels import cord_brake, family_kernels, family_offsets, open_solver, ring_solver, ring_spin_brake
from .joint_kernels import RESULTS, load_kernels, ring_joints
from .outside_kernels import outside_kernels
from .pressure_kernels import pressure_kernels
from .published_joint_kernels import RESULTS as PUBLISHED_RESULTS
from .published_joint_kernels import even_repulsion, published_ring_joints, squeeze_kernels
from .published_kernels import published_drag, published_strain, velocity_filters
from .ring_mass_kernels import ring_mass_kernels
from .side_kernels import side_kernels
from .spoke_kernels import beside_kernel, collect_kernel, gather_kernel, share_kernel
from .trait_kernels import sliding_base

ONE = np.uint64(1)
RING_SPIN_RATE = 2500.0
"""Rate (1/s) at which ring elements lose their spin relative to their ring: about a tenth of critical in their shear rotation."""

CORD_SLIP_RATE = 300.0
"""Rate (1/s) at which the nerve cord loses its velocity relative to the muscles around it: about critical for their springs."""

Terms = dict[str, Any]
"""Compiled terms by name, in the order of a step."""


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


def hydrostat_terms(grid: AssemblyGrid, traits: Traits, loaded: bool = False, touching: bool = False) -> Terms:
    """Terms of the default numerics: joints with a potential, slabs that keep their volume, implicit muscle viscosity."""
    gather, (cord, neighbours), (ring_muscle, ring_ring) = gather_kernel(grid, False), side_kernels(grid, False), ring_joints(grid)
    beside, collect, (load, hand_on), share_out = (
        beside_kernel(grid, False),
        collect_kernel(grid, RESULTS),
        load_kernels(grid),
        share_kernel(grid),
    )
    volumes, press, project_slabs = pressure_kernels(grid, traits.sliding)
    smooth_rings = ring_mass_kernels(grid)
    steady, hold, even = ring_spin_brake(grid), cord_brake(grid), traits.even
    rods, rings = family_kernels(grid, False), family_kernels(grid, True, traits.graded, plain=True)
    first_node, last_node = ONE + ONE, np.uint64(grid.rings + 2)

    @kernel
    def sides(b: Any, share: Any, step: Any) -> None:
        gather(b)
        cord(b)
        neighbours(b)

    @kernel
    def ring_connections(b: Any, share: Any, step: Any) -> None:
        ring_muscle(b)
        ring_ring(b)

    @kernel
    def contacts(b: Any, share: Any, step: Any) -> None:
        if not even:
            beside(b)

    @kernel
    def sums(b: Any, share: Any, step: Any) -> None:
        collect(b)
        load(b)
        share_out(b, step.drag[0], step.drag[1])
        hand_on(b)

    @kernel
    def pressure(b: Any, share: Any, step: Any) -> None:
        volumes(b)
        press(b)

    @kernel
    def brakes(b: Any, share: Any, step: Any) -> None:
        steady(b, 1.0 - np.exp(-RING_SPIN_RATE * step.h))
        hold(b, 1.0 - np.exp(-CORD_SLIP_RATE * step.h), first_node, last_node)

    @kernel
    def smooth(b: Any, share: Any, step: Any) -> None:
        smooth_rings(b)

    @kernel
    def project(b: Any, share: Any, step: Any) -> None:
        project_slabs(b, step.h)

    return _touched(grid, touching, _slid(grid, traits, {
        "strains": _strains(grid, rods, rings, rods["strain"], rings["strain"]),
        "crossings": _crossings(grid, False),
        "sides": sides,
        "ring connections": ring_connections,
        "contacts": contacts,
        "sums": sums,
        "pressure": pressure,
        **_loads(grid, loaded),
        "ring spin": _ring_spin(grid, rings),
        "kick": _kick(grid, rods, rings, family_kernels(grid, False, plain=True)["spin"]),
        "brakes": brakes,
        "axial": _axial(grid, rods, rings),
        "smooth": smooth,
        "project": project,
    }))  # fmt: skip


def published_terms(grid: AssemblyGrid, traits: Traits, inclination: float, loaded: bool = False) -> Terms:
    """Terms of the published numerics, for an `inclination` (rad) of the longitudinal muscles."""
    gather, (cord, neighbours) = gather_kernel(grid, True), side_kernels(grid, True)
    ring_muscle, ring_ring = published_ring_joints(grid, inclination)
    beside, collect, share_out = beside_kernel(grid, True), collect_kernel(grid, PUBLISHED_RESULTS), share_kernel(grid)
    squeeze, hand_on = squeeze_kernels(grid)
    repel, brake, filters, even = even_repulsion(grid), published_drag(grid), velocity_filters(grid, not traits.bare), traits.even
    _, _, _, _, close_speed = ring_solver(grid)
    rods, rings = family_kernels(grid, False), family_kernels(grid, True, traits.graded)
    strain, ring_strain = (published_strain(grid, *family, traits.bare) for family in ((False, False), (True, traits.graded)))
    first, last = ONE, np.uint64(grid.open_slots * grid.lanes - 1)

    @kernel
    def drag(b: Any, share: Any, step: Any) -> None:
        # Straight rods have none of it, and the spokes use their scratch.
        close_speed(b)
        brake(b, step.drag[2], step.drag[3])

    @kernel
    def spokes(b: Any, share: Any, step: Any) -> None:
        gather(b)
        cord(b)
        neighbours(b)
        ring_muscle(b)
        if even:
            repel(b)
        ring_ring(b)
        if not even:
            beside(b)

    @kernel
    def sums(b: Any, share: Any, step: Any) -> None:
        collect(b)
        squeeze(b)
        share_out(b, step.drag[0], step.drag[1])
        hand_on(b)

    @kernel
    def smooth(b: Any, share: Any, step: Any) -> None:
        filters(b, first, last)

    terms = {
        "strains": _strains(grid, rods, rings, strain, ring_strain),
        "crossings": _crossings(grid, True),
        "drag": drag,
        "spokes": spokes,
        "sums": sums,
        **_loads(grid, loaded),
        "ring spin": _ring_spin(grid, rings),
        "kick": _kick(grid, rods, rings),
    }
    return _slid(grid, traits, terms) | {"smooth": smooth}


def _loads(grid: AssemblyGrid, loaded: bool) -> Terms:
    """The term of loads from outside, if there are any."""
    if not loaded:
        return {}
    _, add = outside_kernels(grid)

    @kernel
    def loads(b: Any, share: Any, step: Any) -> None:
        add(b, step.outside)

    return {"loads": loads}


def _touched(grid: AssemblyGrid, touching: bool, terms: Terms) -> Terms:
    """With impulses from bodies before the implicit axial step, and anchors that follow at the end, if there are bodies."""
    if not touching:
        return terms
    _, exchange, go_along = contact_kernels(grid)

    @kernel
    def touch(b: Any, share: Any, step: Any) -> None:
        kick_bodies(step.world.bodies, np.float64(step.h))
        exchange(b, step.world, np.float64(step.h))
        meet(step.world, np.float64(step.h))

    @kernel
    def follow(b: Any, share: Any, step: Any) -> None:
        go_along(b, step.world, np.float64(step.h))

    touched = {}
    for name, term in terms.items():
        if name == "brakes":
            touched["touch"] = touch
        touched[name] = term
    return touched | {"follow": follow}


def _slid(grid: AssemblyGrid, traits: Traits, terms: Terms) -> Terms:
    """With the first nodes of muscles and helices back in their plane after the kick and at the end, if the base slides."""
    if not traits.sliding:
        return terms
    hold = sliding_base(grid)

    @kernel
    def slide(b: Any, share: Any, step: Any) -> None:
        hold(b)

    slid = {}
    for name, term in terms.items():
        slid[name] = term
        if name == "kick":
            slid["slide"] = slide
    if "project" in terms:
        slid["slide again"] = slide
    return slid


def _bounds(grid: AssemblyGrid) -> tuple[Any, ...]:
    """First and last index of open rods and of rings."""
    return ONE, np.uint64(grid.open_slots * grid.lanes - 1), np.uint64(grid.lanes), np.uint64((grid.ring_nodes + 1) * grid.lanes)


def _strains(grid: AssemblyGrid, rods: Any, rings: Any, strain: Any, ring_strain: Any) -> Any:
    bend, ring_bend = rods["bend"], rings["bend"]
    _, close_state, close_strain, close_moment, _ = ring_solver(grid)
    first, last, ring_first, ring_last = _bounds(grid)
    muscles, helices = np.uint64(grid.lanes), np.uint64(grid.straight_rods * grid.lanes)

    @kernel
    def strains(b: Any, share: Any, step: Any) -> None:
        elastic = 0.25 * step.h
        close_state(b)
        strain(b, first, muscles, share, elastic, step.laws[3])
        strain(b, muscles, helices, share, elastic, step.laws[0])
        strain(b, helices, last, share, elastic, step.laws[1])
        bend(b, first, last)
        ring_strain(b, ring_first, ring_last, share, elastic, step.laws[2])
        close_strain(b)
        ring_bend(b, ring_first, ring_last)
        close_moment(b)

    return strains


def _crossings(grid: AssemblyGrid, published: bool) -> Any:
    fetch, connect, give = between_kernels(grid) if grid.between else crossing_kernels(grid, published)
    o, g = family_offsets(grid, False), family_offsets(grid, True)
    RF1, RF2, RF3, HF1, HF2, HF3 = (table[f"F{i}"] for table in (g, o) for i in (1, 2, 3))
    _, last, ring_first, ring_last = _bounds(grid)
    helices = np.uint64(grid.straight_rods * grid.lanes)

    @kernel
    def crossings(b: Any, share: Any, step: Any) -> None:
        for k in range(ring_first, ring_last):
            b[RF1 + k], b[RF2 + k], b[RF3 + k] = 0.0, 0.0, 0.0
        for k in range(helices, last):
            b[HF1 + k], b[HF2 + k], b[HF3 + k] = 0.0, 0.0, 0.0
        fetch(b, step.ring_index, step.helix_index)
        connect(b)
        give(b, step.ring_index, step.helix_index)

    return crossings


def _ring_spin(grid: AssemblyGrid, rings: Any) -> Any:
    spin, (_, _, first, last) = rings["spin"], _bounds(grid)

    @kernel
    def ring_spin(b: Any, share: Any, step: Any) -> None:
        spin(b, first, last)

    return ring_spin


def _kick(grid: AssemblyGrid, rods: Any, rings: Any, spin_helices: Any = None) -> Any:
    kick_rods, spin, kick_rings = rods["kick"], rods["spin"], rings["kick"]
    first, last, ring_first, ring_last = _bounds(grid)
    helices, spin_rest = np.uint64(grid.straight_rods * grid.lanes), spin if spin_helices is None else spin_helices

    @kernel
    def kick(b: Any, share: Any, step: Any) -> None:
        kick_rods(b, first, last)
        spin(b, first, helices)
        spin_rest(b, helices, last)
        kick_rings(b, ring_first, ring_last)

    return kick


def _axial(grid: AssemblyGrid, rods: Any, rings: Any) -> Any:
    axial, correct, ring_axial, ring_correct = rods["axial"], rods["correct"], rings["axial"], rings["correct"]
    solve, (ring_solve, _, _, _, close_speed) = open_solver(grid), ring_solver(grid)
    first, last, ring_first, ring_last = _bounds(grid)
    straight, helices, helix_nodes = grid.straight_rods, grid.helices, np.uint64(grid.helix_nodes)
    elements, helix_elements, helix_slot = np.uint64(grid.rings), np.uint64(grid.helix_elements), np.uint64(grid.straight_rods)

    @kernel
    def relax(b: Any, share: Any, step: Any) -> None:
        close_speed(b)
        axial(b, first, last)
        solve(b, elements, straight, np.uint64(0), ONE)
        solve(b, helix_elements, helices, helix_slot, helix_nodes)
        correct(b, first, last)
        ring_axial(b, ring_first, ring_last)
        ring_solve(b)
        ring_correct(b, ring_first, ring_last)

    return relax
