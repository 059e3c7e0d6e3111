"""What the numerics of an arm have in common: terms, the phases they stand in, and the terms that both of them have.

A term is a compiled ``term(buffer, share, step, part)``, with `share` how much of the sample has passed in the middle of the step, and
works on a part of the arm (`octoctrl.sim.assembly.parts`). Forces are collected first, then velocities change; positions are moved between
steps, by `octoctrl.sim.assembly.stepping`. Their order is that of `octoctrl.sim.assembly.hydrostat_terms`, the true hydrostat, or of
`octoctrl.sim.assembly.published_terms`, the published laws for comparison.

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
from .between_kernels import between_kernels
from .crossing_kernels import crossing_kernels
from .family_kernels import family_offsets, ring_solver
from .halves import Stage
from .outside_kernels import outside_kernels
from .parts import sweep, sweep_open
from .trait_kernels import sliding_base

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
    folds : Folds or ()
        What of the arm may touch itself, if it may, see `octoctrl.sim.contact.folds`.
    """

    h: float
    laws: tuple
    drag: tuple
    ring_index: np.ndarray
    helix_index: np.ndarray
    outside: np.ndarray = NOTHING
    world: Any = ()
    folds: Any = ()


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


def outside_loads(grid: AssemblyGrid, loaded: bool) -> Terms:
    """The term of loads from outside, if there are any."""
    if not loaded:
        return {}
    _, add = outside_kernels(grid)

    @kernel
    def loads(b: Any, share: Any, step: Any, part: Any) -> None:
        add(b, part, step.outside)

    return {"loads": loads}


def base_slide(grid: AssemblyGrid, traits: Traits) -> Callable[[str], Terms]:
    """The term, under any name, that puts the first nodes of muscles and helices back into their plane, if the base slides."""
    if not traits.sliding:
        return lambda name: {}
    hold = sliding_base(grid)

    @kernel
    def slide(b: Any, share: Any, step: Any, part: Any) -> None:
        hold(b, part)

    return lambda name: {name: slide}


def strain_terms(grid: AssemblyGrid, rods: Any, rings: Any, strain: Any, ring_strain: Any) -> tuple[Any, Any]:
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


def crossing_terms(grid: AssemblyGrid, published: bool) -> tuple[Any, Any]:
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


def ring_spin_term(grid: AssemblyGrid, rings: Any) -> Any:
    """The term that turns the elements of the rings."""
    spin = sweep(grid, "rings", rings["spin"])

    @kernel
    def ring_spin(b: Any, share: Any, step: Any, part: Any) -> None:
        spin(b, part)

    return ring_spin


def kick_term(grid: AssemblyGrid, rods: Any, rings: Any, spin_helices: Any = None) -> Any:
    """The term in which forces and moments change the velocities of all rods, with a `spin_helices` of their own for the helices."""
    kick_rods, kick_rings = sweep_open(grid, rods["kick"]), sweep(grid, "rings", rings["kick"])
    spin, spin_rest = sweep(grid, "straight", rods["spin"]), sweep(grid, "helices", rods["spin"] if spin_helices is None else spin_helices)

    @kernel
    def kick(b: Any, share: Any, step: Any, part: Any) -> None:
        kick_rods(b, part)
        spin(b, part)
        spin_rest(b, part)
        kick_rings(b, part)

    return kick
