"""What the compiled step and the compiled outputs are given: the constants of a model as arrays, made once, and room for the results."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS, Arm, azimuth
from octoctrl.sim.body.muscles import MuscleLaw

from .drag import element_edges, node_drag
from .drag_kernels import Elements
from .dynamics import Structure
from .fibre_kernels import LEFT, NONE, OF, RIGHT, RING, TERMS, Fibres, Law
from .kinematics import element_stations, hat_means, section_bounds
from .output_kernels import OUTPUTS, outputs_along
from .parameters import ReducedParameters
from .statics import CONSTANTS, GENERIC, PASSED, section_constants
from .stepping_kernels import StepModel, buffers, linearise_steps, roll_out, roll_out_slopes

Floats = NDArray[np.float64]


def law_row(law: MuscleLaw, laws: str, kind: str, stress: float, parameters: ReducedParameters) -> Floats:
    """A muscle law as the kernels take it.

    Parameters
    ----------
    law : MuscleLaw
    laws : {"known", "generic"}
    kind : {"longitudinal", "transverse"}
        Which of the generic shapes stands for it.
    stress : float
        Factor on the active stress.
    parameters : ReducedParameters
    """
    low, top = law.range
    numbers = {
        "compression": parameters.compression * law.compression_modulus, "slack": law.slack, "rate": law.maximum_rate,
        "concentric": law.curvature, "plateau": law.eccentric_plateau, "eccentric": law.eccentric_slope,
    }  # fmt: skip
    if laws == "known":
        active, passive = law.active, law.passive
        numbers |= {
            "low": low, "top": top, "floor": 1.0, "end_slope": float(np.polyval(np.polyder(np.array(passive)), top)),
            "active_blend": 0.02, "tension_blend": 4e-3, "active_stress": stress * law.maximum_stress,
            "tension": parameters.passive_stress * law.passive_scale * law.maximum_stress,
        }  # fmt: skip
    else:
        shape = GENERIC[kind]
        slope, curvature = shape.active[1] * parameters.length_slope, shape.active[2] * parameters.length_curvature
        # The polynomials of s - 1 as polynomials of s.
        active = (curvature, slope - 2 * curvature, 1 - slope + curvature)
        passive = (1.0, -1.0 - shape.passive_onset * parameters.passive_onset)
        numbers |= {
            "low": -np.inf, "top": np.inf, "floor": -np.inf, "end_slope": 0.0, "active_blend": 0.1, "tension_blend": 0.04,
            "active_stress": stress * shape.active[0] * law.maximum_stress,
            "tension": parameters.passive_stress * shape.passive_slope * law.maximum_stress,
        }  # fmt: skip
    row = np.zeros(OF.passive + TERMS)
    for name, value in numbers.items():
        row[Law._fields.index(name)] = value
    row[OF.active + TERMS - len(active) : OF.active + TERMS] = active
    row[OF.passive + TERMS - len(passive) :] = passive
    return row


def fibres(structure: Structure, parameters: ReducedParameters) -> Fibres:
    """The fibres of all sections: eight longitudinal muscles, both oblique families, rings, cord."""
    arm, sections, lumped = structure.arm, structure.sections, structure.arm.lumped
    at = dict(zip(CONSTANTS, section_constants(arm, sections), strict=True))
    longitudinal = lumped.longitudinal_stress * parameters.longitudinal_stress
    laws = np.stack([
        law_row(arm.longitudinal, structure.laws, "longitudinal", longitudinal, parameters),
        law_row(arm.oblique, structure.laws, "longitudinal", lumped.oblique_stress * parameters.oblique_stress, parameters),
        law_row(arm.transverse, structure.laws, "transverse", parameters.transverse_stress, parameters),
    ])  # fmt: skip
    ones, zeros = np.ones(sections), np.zeros(sections)
    # An oblique fibre feels a share of the bend at each place by which it passes; without a share all places are one.
    share, passed = parameters.oblique_bending, np.array(PASSED if parameters.oblique_bending else PASSED[:1])
    inside = lumped.oblique_passive * parameters.oblique_passive
    rows = []
    for number, name in enumerate(LONGITUDINAL_GROUPS):
        rho, angle = at["muscle_offset"], azimuth(name)
        rows.append(
            (0, number, parameters.tone, 1.0, 1.0, 1.0, rho * np.cos(angle), rho * np.sin(angle), rho, zeros, at["muscle_area"], ones)
        )
    for number, hand in ((RIGHT, 1), (LEFT, -1)):
        rho, area = at["oblique_offset"], at["oblique_area"] / len(passed)
        turn = hand * 2 * np.pi / arm.oblique_pitch * rho
        rows += [
            (
                1,
                number,
                0.0,
                1.0,
                inside,
                1.0,
                share * np.cos(angle) * rho,
                share * np.sin(angle) * rho,
                rho,
                turn,
                area,
                at["oblique_stretch"],
            )
            for angle in passed
        ]
    rows.append((2, RING, parameters.tone, 1.0, 1.0, 0.0, zeros, zeros, zeros, ones, at["ring_area"], ones))
    rows.append((0, NONE, parameters.tone, 0.0, 1.0, 1.0, zeros, zeros, zeros, zeros, at["cord_area"], ones))
    law, group, tone, viscous, passive, axial, *shape = zip(*rows, strict=True)
    along, across, radius, turn, area, rest = (np.ascontiguousarray(np.array(part).T) for part in shape)
    stiffness = parameters.bending * at["bending"], parameters.torsion * at["twisting"] + parameters.ring_torsion * at["ring_twisting"]
    return Fibres(
        laws=laws, law=np.array(law), group=np.array(group), tone=np.array(tone), viscosity=parameters.viscosity * np.array(viscous),
        passive=np.array(passive), axial=np.array(axial), along=along, across=across, radius=radius, turn=turn, area=area, rest=rest,
        narrowing=at["narrowing"], stiffness=np.ascontiguousarray(np.array(stiffness).T), length=at["length"],
        hoop=lumped.hoop_ratio * parameters.hoop_ratio, squeeze=parameters.squeeze,
    )  # fmt: skip


@lru_cache(maxsize=32)
def step_model(structure: Structure, parameters: ReducedParameters) -> StepModel:
    """The constants of a model's step."""
    arm, sections = structure.arm, structure.sections
    edges = element_edges(arm, sections)
    hats, drag = hat_means(edges, section_bounds(arm, sections)), node_drag(arm, structure.water, edges)
    first = np.minimum([np.flatnonzero(row)[0] for row in hats], sections - 2)
    elements = Elements(
        first=first,
        weights=np.stack([row[index : index + 2] for row, index in zip(hats, first, strict=True)]),
        widths=np.diff(edges),
        linear=parameters.linear_drag * drag.linear,
        quadratic=parameters.quadratic_drag * drag.quadratic,
        rotational=parameters.rotational_drag * drag.rotational,
    )
    return StepModel(fibres(structure, parameters), elements, strain_scale(arm, sections))


def strain_scale(arm: Arm, sections: int) -> Floats:
    """Strains (S, 4) that a fibre at the longitudinal muscles' distance from the axis feels as one."""
    bounds = section_bounds(arm, sections)
    scale = np.ones((sections, 4))
    scale[:, :3] = 1 / arm.section((bounds[1:] + bounds[:-1]) / 2).muscle_offset[:, None]
    return scale


def simulate(model: StepModel, start: Floats, levels: Floats, steps: Floats, near: Floats | None = None) -> Floats:
    """Strains (N + 1, S, 4); not a number from a step on that has no solution. `near`: a similar motion, for whom it is quicker."""
    strains, similar = np.empty((len(steps) + 1, *start.shape)), np.empty((0, *start.shape)) if near is None else near
    solved = roll_out(start, levels, steps, model, buffers(model, len(MUSCLE_GROUPS), 0), similar, np.zeros_like(start), strains)
    strains[solved + 1 :] = np.nan
    return strains


def slopes_of(model: StepModel, strains: Floats, levels: Floats, level_slopes: Floats, steps: Floats, step_slopes: Floats) -> Floats:
    """Derivatives (N + 1, 4 S, p) of a motion that `simulate` made."""
    sections, unknowns = strains.shape[1], step_slopes.shape[1]
    slopes, room = np.empty((len(strains), 4 * sections, unknowns)), buffers(model, len(MUSCLE_GROUPS), unknowns)
    roll_out_slopes(strains, levels, level_slopes, steps, step_slopes, model, room, np.empty((sections, 4)), slopes)
    return slopes


def linearise(model: StepModel, strains: Floats, levels: Floats, steps: Floats) -> tuple[Floats, Floats, Floats]:
    """Derivatives of the next strains by strains (N, 4 S, 4 S), levels (N, 4 S, groups, S) and a relative error of all drag (N, 4 S)."""
    count, groups, sections = levels.shape
    size = 4 * sections
    transition, influence, drag = np.empty((count, size, size)), np.empty((count, size, groups, sections)), np.empty((count, size))
    room = buffers(model, groups, size + groups * sections + 1)
    unit, none, motion = np.zeros(size), np.zeros((groups, sections)), np.empty((sections, 4))
    linearise_steps(strains, levels, steps, model, room, motion, unit, none, transition, influence, drag)
    return transition, influence, drag


class OutputTables(NamedTuple):
    """What the outputs need of an arm: hat functions (m, S) and widths (m,) of the intervals between stations, the same of the elements."""

    hats: Floats
    widths: Floats
    stretch_hats: Floats
    lengths: Floats


@lru_cache(maxsize=32)
def output_tables(arm: Arm, sections: int) -> OutputTables:
    """Tables for the outputs of an arm."""
    bounds, stations = section_bounds(arm, sections), element_stations(arm.edges)
    return OutputTables(hat_means(stations, bounds), np.diff(stations), hat_means(arm.edges, bounds), np.diff(arm.edges))


def outputs(tables: OutputTables, strains: Floats, pole: Floats, slopes: bool = True) -> tuple[Floats, Floats]:
    """Outputs (T, 11) of strains (T, S, 4), and their derivatives (T, 11, S, 4), none of which are made without `slopes`."""
    count, sections = strains.shape[:2]
    values = np.empty((count, len(OUTPUTS)))
    gradients = np.empty((count if slopes else 0, len(OUTPUTS), sections, 4))
    outputs_along(strains, pole, *tables, np.eye(3), values, gradients)
    return values, gradients
