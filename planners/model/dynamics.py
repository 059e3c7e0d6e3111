"""Motion of the reduced model: one step, its exact sensitivity, its linearisation, as CasADi functions.

    (D(q, q') + C(q, a, q')) q' = -f(q, a)

D: water drag through the Jacobian of the current shape; C: Hill viscosity; f: elastic and active forces of the sections. A step of length
h solves, twice,

    A dq = -h f(q, a),      A = D(q, r) + C(q, a, r) + h K(q, a),      K = df/dq

first with the rate r of the step before, then with r = dq / h. Activations are those at the end of the step. Everything here is a pure
function of arrays with section columns: strains and rates (4, S), activations (11, S).

The sensitivity of a step never differentiates the assembly of A: with the residual R = A dq + h f, evaluated without matrices,

    A d(dq) = -(dR/dq dq0 + dR/dr dr0 + dR/da da + dR/dh dh)        at fixed dq

costs a product along each direction and a solution with the factor that the step has needed anyway.
"""

from functools import lru_cache
from typing import NamedTuple

import casadi as ca

from octoctrl.sim.body.arm import MUSCLE_GROUPS

from .drag import Chain, chain, drag_force, drag_matrix, element_edges, node_drag
from .kinematics import hat_means, section_bounds
from .parameters import FACTORS
from .statics import CONSTANTS, section_constants, section_forces, section_viscosity, viscous_force

GROUPS = len(MUSCLE_GROUPS)


class Structure(NamedTuple):
    """What the functions are built for; two models of equal structure share them and differ in the identified factors only."""

    arm: object
    water: object
    laws: str
    sections: int


class Functions(NamedTuple):
    """The functions of a structure; the last argument of each is the vector of factors."""

    statics: ca.Function
    """(strains, levels, factors) -> force (4, S), tangent (4, 4 S), viscosity (11, S), gradients (4, 11 S)."""
    step: ca.Function
    """(strains, rates, levels, h, factors) -> strains, rates."""
    drag: ca.Function
    """(strains, rates, factors) -> D (4 S, 4 S)."""
    viscosity: ca.Function
    """(strains, rates, levels, factors) -> C (4 S, 4 S)."""


@lru_cache(maxsize=16)
def functions(structure):
    """Build the functions of a structure; about half a second, once.

    Raises
    ------
    OctoctrlError
        If there is no water.
    """
    parts = _parts(structure)
    sections = structure.sections
    q, r = ca.MX.sym("strains", 4, sections), ca.MX.sym("rates", 4, sections)
    u, h, factors = ca.MX.sym("levels", GROUPS, sections), ca.MX.sym("h"), ca.MX.sym("factors", len(FACTORS))
    moved, rate = q, r
    for solved in _passes(parts, q, r, u, h, factors):
        moved, rate = q + ca.reshape(solved.motion, 4, sections), ca.reshape(solved.motion, 4, sections) / h
    step = ca.Function("step", [q, r, u, h, factors], [moved, rate], ["strains", "rates", "levels", "h", "factors"], ["moved", "rate"])
    force, tangent, coefficients, gradients = parts.statics(q, u, parts.constants, factors)
    statics = ca.Function("statics", [q, u, factors], [force, tangent, coefficients, gradients])
    viscous = _block_diagonal(parts.viscosity(coefficients, gradients, parts.constants, r), 4, 4, sections)
    return Functions(
        statics,
        step,
        ca.Function("drag", [q, r, factors], [parts.assembly(*parts.chain(q), r, factors)]),
        ca.Function("viscosity", [q, r, u, factors], [ca.densify(viscous)]),
    )


@lru_cache(maxsize=64)
def horizon(structure, count):
    """`count` steps in a row: (strains, rates, levels (11, S count), h (1, count), factors (n, count)) -> all strains and rates."""
    return functions(structure).step.mapaccum("horizon", count, 2)


@lru_cache(maxsize=32)
def sensitivity_step(structure, directions):
    """One step with forward derivatives along `directions` parameters.

    Returns
    -------
    casadi.Function
        ``(strains, rates, strain slopes (4 S, p), rate slopes (4 S, p), levels, level slopes (11 S, p), h, h slopes (1, p), factors)
        -> strains, rates, strain slopes, rate slopes``
    """
    parts = _parts(structure)
    sections, size = structure.sections, 4 * structure.sections
    q, r = ca.MX.sym("strains", 4, sections), ca.MX.sym("rates", 4, sections)
    u, h, factors = ca.MX.sym("levels", GROUPS, sections), ca.MX.sym("h"), ca.MX.sym("factors", len(FACTORS))
    dq, dr = ca.MX.sym("strain_slopes", size, directions), ca.MX.sym("rate_slopes", size, directions)
    du, dh = ca.MX.sym("level_slopes", GROUPS * sections, directions), ca.MX.sym("h_slopes", 1, directions)
    residual = _residual(structure, directions, q, dq)
    rate, rate_slopes = r, dr
    for solved in _passes(parts, q, r, u, h, factors):
        change = residual(rate, ca.reshape(solved.motion, 4, sections), u, h, factors, rate_slopes, du, dh)
        moved = -ca.solve(solved.matrix, change, "ldl")
        rate, rate_slopes = ca.reshape(solved.motion, 4, sections) / h, moved / h - solved.motion @ dh / h**2
    moved_slopes = dq + moved
    return ca.Function("sensitivity", [q, r, dq, dr, u, du, h, dh, factors], [q + h * rate, rate, moved_slopes, rate_slopes])


@lru_cache(maxsize=32)
def sensitivity_horizon(structure, directions, count):
    """`count` sensitivity steps in a row; see `sensitivity_step`."""
    return sensitivity_step(structure, directions).mapaccum("sensitivity_horizon", count, 4)


@lru_cache(maxsize=8)
def linearisation(structure):
    """Linear model of one step whose rate has converged.

    Returns
    -------
    casadi.Function
        ``(strains, rates, levels, h, factors) -> A (4 S, 4 S), B (4 S, 11 S)`` with the change of the next strains
        A dq + B du. `rates` are those of the step itself, so that the step's rate is no state of its own: with R = A dq + h f at
        r = dq / h, the derivative of dq is -(A + dR/dr / h)^-1 dR/dq, and so on.
    """
    parts = _parts(structure)
    sections, size = structure.sections, 4 * structure.sections
    q, r = ca.MX.sym("strains", 4, sections), ca.MX.sym("rates", 4, sections)
    u, h, factors = ca.MX.sym("levels", GROUPS, sections), ca.MX.sym("h"), ca.MX.sym("factors", len(FACTORS))
    matrix = _driving(parts, q, u, factors)[1](r, h)
    every = ca.MX.eye(size)
    (by_strain, by_rate, by_level), _ = _local_derivatives(structure, q, r, h * r, u, h, factors)
    shape, shape_slopes = _shape_slopes(structure, size, q, every)
    by_strain += _drag_slopes(structure, size, "shape")(*shape, r, h * r, factors, shape_slopes)
    by_rate += _drag_slopes(structure, size, "rates")(*shape, r, h * r, factors, every)
    change = -ca.solve(matrix + by_rate / h, ca.horzcat(by_strain, ca.densify(by_level)), "lapacklu" if ca.has_linsol("lapacklu") else "qr")
    return ca.Function("linearisation", [q, r, u, h, factors], [every + change[:, :size], change[:, size:]])


class _Parts(NamedTuple):
    constants: ca.DM
    statics: ca.Function
    viscosity: ca.Function
    chain: ca.Function
    assembly: ca.Function


class _Solved(NamedTuple):
    matrix: ca.MX
    motion: ca.MX


@lru_cache(maxsize=16)
def _parts(structure):
    arm, sections = structure.arm, structure.sections
    constants = section_constants(arm, sections)
    q, u = ca.SX.sym("q", 4), ca.SX.sym("u", GROUPS)
    place, factors = ca.SX.sym("c", len(CONSTANTS)), ca.SX.sym("factors", len(FACTORS))
    forces = section_forces(arm, structure.laws, q, u, place, factors)
    statics = ca.Function("section", [q, u, place, factors], list(forces), {"cse": True})
    rates = ca.SX.sym("rates", 4)
    symbols = forces._replace(viscosity=ca.SX.sym("v", GROUPS), gradients=ca.SX.sym("g", 4, GROUPS))
    viscosity = ca.Function(
        "viscosity", [symbols.viscosity, symbols.gradients, place, rates], [section_viscosity(arm, symbols, place, rates)]
    )
    edges, hats, drag = _elements(structure)
    strains, motion = ca.SX.sym("strains", 4, sections), ca.SX.sym("rates", 4, sections)
    shape = chain(strains, hats, edges)
    columns, held = _held_chain(len(hats))
    matrix = drag_matrix(held, hats, drag, motion, _named(factors))
    return _Parts(
        ca.DM(constants),
        statics.map("sections", "serial", sections, [3], []),
        viscosity.map(sections),
        ca.Function("chain", [strains], [ca.horzcat(*part) for part in shape], {"cse": True}),
        ca.Function("assembly", [*columns, motion, factors], [ca.densify(matrix)], {"cse": True}),
    )


def _elements(structure):
    """Edges of the fine elements, their hats and the drag of their ends."""
    edges = element_edges(structure.arm, structure.sections)
    return edges, hat_means(edges, section_bounds(structure.arm, structure.sections)), node_drag(structure.arm, structure.water, edges)


def _driving(parts, q, u, factors):
    """The force f (4 S) and the matrix A as a function of rate and step length, the shape being fixed."""
    sections = q.shape[1]
    shape = parts.chain(q)
    force, tangent, coefficients, gradients = parts.statics(q, u, parts.constants, factors)

    def matrix(rates, h):
        local = parts.viscosity(coefficients, gradients, parts.constants, rates) + h * tangent
        return parts.assembly(*shape, rates, factors) + _block_diagonal(local, 4, 4, sections)

    return ca.vec(force), matrix


def _passes(parts, q, r, u, h, factors):
    """The two passes of a step, as matrix and motion."""
    force, matrix = _driving(parts, q, u, factors)
    for _ in range(2):
        held = matrix(r, h)
        motion = -ca.solve(held, h * force, "ldl")
        r = ca.reshape(motion, *q.shape) / h
        yield _Solved(held, motion)


def _block_diagonal(columns, rows, width, count):
    """Block-diagonal matrix of `count` blocks (rows, width) that stand side by side in `columns`; their numbers are in the same order."""
    pattern = ca.diagcat(*[ca.Sparsity.dense(rows, width)] * count)
    return ca.MX(pattern, ca.vec(columns))


@lru_cache(maxsize=8)
def _section_residual(structure):
    """Local part of the residual of one section and its derivatives by strains, rates, levels and step length."""
    arm = structure.arm
    q, r, motion, u, h = ca.SX.sym("q", 4), ca.SX.sym("r", 4), ca.SX.sym("dq", 4), ca.SX.sym("u", GROUPS), ca.SX.sym("h")
    place, factors = ca.SX.sym("c", len(CONSTANTS)), ca.SX.sym("factors", len(FACTORS))
    forces = section_forces(arm, structure.laws, q, u, place, factors)
    viscous = viscous_force(arm, forces, place, r, motion)
    driving = forces.tangent @ motion + forces.force
    residual = viscous + h * driving
    # The tangent is symmetric in all its derivatives: d(K dq)/dq is the change of K along dq, one sweep in place of four.
    bent = ca.triu2symm(ca.jtimes(ca.triu(forces.tangent), q, motion))
    by_strain = ca.jacobian(viscous, q) + h * (forces.tangent + bent)
    by_level = ca.horzcat(*(ca.jtimes(residual, level, ca.SX(1)) for level in ca.vertsplit(u)))
    derivatives = [ca.densify(part) for part in (by_strain, ca.jacobian(viscous, r), by_level)]
    function = ca.Function("section_residual", [q, r, motion, u, h, place, factors], [*derivatives, driving], {"cse": True})
    return function.map("section_residuals", "serial", structure.sections, [4, 6], [])


def _local_derivatives(structure, q, r, motion, u, h, factors):
    parts, sections = _parts(structure), structure.sections
    by_strain, by_rate, by_level, driving = _section_residual(structure)(q, r, motion, u, h, parts.constants, factors)
    widths = ((by_strain, 4), (by_rate, 4), (by_level, GROUPS))
    return [_block_diagonal(part, 4, width, sections) for part, width in widths], ca.vec(driving)


def _shape_slopes(structure, directions, q, dq):
    """The chain of elements and its derivatives along the `directions` columns of `dq`, these in one column each."""
    chain_function = _parts(structure).chain
    shape = chain_function(q)
    slopes = chain_function.forward(directions)(q, *shape, ca.reshape(dq, 4, -1))
    return shape, ca.vertcat(*(ca.reshape(part, -1, directions) for part in slopes))


@lru_cache(maxsize=16)
def _drag_slopes(structure, directions, by):
    """Derivative of the drag force at fixed motion along `directions` changes of the shape, or of the rates."""
    sections = structure.sections
    _, hats, drag = _elements(structure)
    columns, held = _held_chain(len(hats))
    r, motion, factors = ca.SX.sym("r", 4, sections), ca.SX.sym("dq", 4, sections), ca.SX.sym("factors", len(FACTORS))
    force = ca.vec(drag_force(held, hats, drag, r, motion, _named(factors)))
    variable = ca.vec(r) if by == "rates" else ca.vertcat(*map(ca.vec, columns))
    seeds = ca.SX.sym("seeds", variable.shape[0], directions)
    return ca.Function("drag_slopes", [*columns, r, motion, factors, seeds], [ca.jtimes(force, variable, seeds)], {"cse": True})


def _held_chain(elements):
    """Symbols for a chain of elements: as matrices, and as the lists that `Chain` holds."""
    widths = {"turning": 3, "moving": 4, "points": 1, "tangents": 1}
    columns = [ca.SX.sym(name, 3, width * elements) for name, width in widths.items()]
    return columns, Chain(*(ca.horzsplit(part, width) for part, width in zip(columns, widths.values(), strict=True)))


def _residual(structure, directions, q, dq):
    """Derivative of the residual along `directions` changes of everything but the motion; the shape is the same in both passes."""
    shape, shape_slopes = _shape_slopes(structure, directions, q, dq)

    def derivative(r, motion, u, h, factors, dr, du, dh):
        (by_strain, by_rate, by_level), driving = _local_derivatives(structure, q, r, motion, u, h, factors)
        drag = _drag_slopes(structure, directions, "shape")(*shape, r, motion, factors, shape_slopes)
        drag += _drag_slopes(structure, directions, "rates")(*shape, r, motion, factors, dr)
        return by_strain @ dq + by_rate @ dr + by_level @ du + driving @ dh + drag

    return derivative


def _named(factors):
    return dict(zip(FACTORS, ca.vertsplit(factors), strict=True))
