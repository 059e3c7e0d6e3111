"""The step of the reduced model as a CasADi function: the form in which it is handed on, and the twin of the compiled one.

A step of length h from the strains q finds the motion m with

    D(q, m / h) m + C(q, u, m / h) m + h f(q + m, u) = 0

D: water drag through the Jacobian of the shape at the begin; C: Hill viscosity of the active fibres there; f: elastic and active forces at
the end. Levels u are those at the end of the step. `stepping_kernels` solves the same equations and is what the planner uses; here CasADi
solves them, so that whoever has a model in CasADi can put the step into it and differentiate it as often as need be.
"""

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.scene.scene import Water

from .drag import chain, drag_force, element_edges, node_drag
from .kinematics import hat_means, section_bounds
from .parameters import FACTORS
from .statics import CONSTANTS, section_constants, section_forces, viscous_force

GROUPS = len(MUSCLE_GROUPS)


class Structure(NamedTuple):
    """What the functions are built for; two models of equal structure share them and differ in the identified factors only."""

    arm: Arm
    water: Water
    laws: str
    sections: int


@lru_cache(maxsize=16)
def statics(structure: Structure) -> ca.Function:
    """Elastic and active forces of all sections.

    Returns
    -------
    casadi.Function
        ``(strains (4, S), levels (11, S), factors) -> force (4, S), tangent (4, 4 S)``
    """
    q, u = ca.SX.sym("q", 4), ca.SX.sym("u", GROUPS)
    place, factors = ca.SX.sym("c", len(CONSTANTS)), ca.SX.sym("factors", len(FACTORS))
    forces = section_forces(structure.arm, structure.laws, q, u, place, factors)
    section = ca.Function("section", [q, u, place, factors], [forces.force, forces.tangent], {"cse": True})
    strains, levels = ca.MX.sym("strains", 4, structure.sections), ca.MX.sym("levels", GROUPS, structure.sections)
    common, constants = ca.MX.sym("factors", len(FACTORS)), ca.DM(section_constants(structure.arm, structure.sections))
    every = section.map("sections", "serial", structure.sections, [3], [])
    return ca.Function("statics", [strains, levels, common], list(every(strains, levels, constants, common)))


@lru_cache(maxsize=16)
def residual(structure: Structure) -> ca.Function:
    """What a step must bring to zero.

    Returns
    -------
    casadi.Function
        ``(motion (4, S), strains (4, S), levels (11, S), h, factors) -> residual (4, S)``, J s per unit strain.
    """
    arm, sections = structure.arm, structure.sections
    motion, q = ca.SX.sym("motion", 4, sections), ca.SX.sym("strains", 4, sections)
    u, h, factors = ca.SX.sym("levels", GROUPS, sections), ca.SX.sym("h"), ca.SX.sym("factors", len(FACTORS))
    edges = element_edges(arm, sections)
    hats, drag = hat_means(edges, section_bounds(arm, sections)), node_drag(arm, structure.water, edges)
    named = dict(zip(FACTORS, ca.vertsplit(factors), strict=True))
    total = drag_force(chain(q, hats, edges), hats, drag, motion / h, motion, named)
    constants = ca.SX(ca.DM(section_constants(arm, sections)))
    for n in range(sections):
        place = constants[:, n]
        begin = section_forces(arm, structure.laws, q[:, n], u[:, n], place, factors)
        end = section_forces(arm, structure.laws, q[:, n] + motion[:, n], u[:, n], place, factors)
        total[:, n] += viscous_force(begin, motion[:, n] / h, motion[:, n]) + h * end.force
    return ca.Function("residual", [motion, q, u, h, factors], [total], {"cse": True})


@lru_cache(maxsize=16)
def step(structure: Structure) -> ca.Function:
    """One step, differentiable.

    Returns
    -------
    casadi.Function
        ``(strains (4, S), levels (11, S), h, factors) -> strains (4, S)`` at the end of the step.
    """
    sections = structure.sections
    z, q = ca.MX.sym("z", 4 * sections), ca.MX.sym("strains", 4, sections)
    u, h, factors = ca.MX.sym("levels", GROUPS, sections), ca.MX.sym("h"), ca.MX.sym("factors", len(FACTORS))
    bounds = section_bounds(structure.arm, sections)
    scale = np.ones((4, sections))
    scale[:3] = 1 / structure.arm.section((bounds[1:] + bounds[:-1]) / 2).muscle_offset
    # In strains that a fibre feels, all unknowns and all equations are of one size.
    balance = ca.vec(residual(structure)(ca.reshape(z, 4, sections) * scale, q, u, h, factors) * scale)
    equations = {"x": z, "p": ca.vertcat(ca.vec(q), ca.vec(u), h, factors), "g": balance}
    # The one of CasADi's solvers that can be written as C.
    root = ca.rootfinder("root", "fast_newton", equations, {"abstol": 1e-13, "abstolStep": 1e-9, "max_iter": 50})
    found = root(x0=0, p=equations["p"])["x"]
    return ca.Function(
        "step", [q, u, h, factors], [q + ca.reshape(found, 4, sections) * scale], ["strains", "levels", "h", "factors"], ["next"]
    )
