"""Reduced model: dense NumPy twins, derivatives against differences, statics, kinematics, cost."""

from dataclasses import replace
from itertools import pairwise
from time import process_time
from types import SimpleNamespace

import numpy as np
import pytest

from octoctrl.planners.model.drag import SLOWEST, element_edges
from octoctrl.planners.model.drag_kernels import drag_impulse, drag_tangent, set_shape
from octoctrl.planners.model.drag_slope_kernels import impulse_along, set_shape_slopes
from octoctrl.planners.model.dynamics import residual, statics
from octoctrl.planners.model.fibre_kernels import fibre_room, section_impulse, section_slopes, set_fibres
from octoctrl.planners.model.kinematics import BASE_FRAME, hat_means, hat_values, rotation_vectors
from octoctrl.planners.model.output_kernels import OUTPUTS
from octoctrl.planners.model.parameters import FACTORS
from octoctrl.planners.model.reduced import LAWS, ReducedModel, ReducedParameters
from octoctrl.planners.model.statics import CONSTANTS, section_constants
from octoctrl.planners.model.stepping_kernels import buffers
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm, LumpedSection, azimuth
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.rotations import rotation_matrix
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.templates import Plateau

COIL = Activation(
    templates=(
        Plateau(groups=("R-OM",), level=0.15, rise=0.5, offset=3.0, fall=0.5),
        Plateau(groups=("LM1", "LM2", "LM8"), level=0.24, onset=1.5, rise=4.0),
        Plateau(groups=("L-OM",), level=0.29, onset=4.1, rise=1.0),
    )
)
"""Programme of Fig. 2c of Tekinalp et al. (2024), with the levels that an arm that keeps its volume needs."""


@pytest.fixture(scope="module")
def model():
    return ReducedModel()


@pytest.fixture(scope="module")
def bent():
    """A strongly bent and twisted shape, rates and levels; fibres away from the kinks of the laws."""
    draw = np.random.default_rng(3)
    outline = 1 - np.linspace(0.06, 0.94, 8) * 11 / 12
    strains = np.column_stack([12 / outline, -6 / outline * draw.uniform(0.5, 1, 8), -20 / outline**0.5, draw.uniform(0.87, 0.93, 8)])
    rates = draw.normal(size=(8, 4)) * [20.0, 20.0, 20.0, 0.2]
    levels = draw.uniform(0.1, 0.4, size=(11, 8))
    return strains, rates, levels


def factors(model):
    return model.parameters.vector()


# Twins


def moved_nodes(model, strains, pieces=60):
    """Positions and frames of the element ends, every element cut into many pieces of the same strain."""
    edges = element_edges(model.arm, model.sections)
    hats = hat_means(edges, model.edges)
    frame, point, nodes, frames = BASE_FRAME.copy(), np.zeros(3), [], []
    for weights, width in zip(hats, np.diff(edges), strict=True):
        k1, k2, k3, e = weights @ strains
        step = width / pieces
        half = rotation_matrix(0.5 * step * np.array([k1, k2, k3]))
        for _ in range(pieces):
            frame = half @ frame
            point = point + e * step * frame[2]
            frame = half @ frame
        nodes.append(point)
        frames.append(frame)
    return np.array(nodes), np.array(frames)


def dense_drag(model, strains, rates):
    """J' M J with a Jacobian from central differences of positions and frames."""
    arm, water = model.arm, model.scene.water
    edges = element_edges(arm, model.sections)
    _, frames = moved_nodes(model, strains)
    columns = []
    for index in range(strains.size):
        shift = np.zeros(strains.size)
        shift[index] = 1e-5 * (1 if index % 4 == 3 else 100)
        (p, f), (m, g) = (moved_nodes(model, strains + sign * shift.reshape(strains.shape)) for sign in (1, -1))
        spin = rotation_vectors(np.swapaxes(f, 1, 2) @ g)  # laboratory rotation from + to -
        columns.append(np.concatenate([p - m, -spin], axis=1) / (2 * shift[index]))
    jacobian = np.moveaxis(np.array(columns), 0, -1)  # (M, 6, 4 S)
    section = arm.section(edges[1:])
    widths = np.diff(edges)
    weights = (widths + np.append(widths[1:], 0.0)) / 2
    (_, _, ring, oblique), (_, _, ring_inertia, oblique_inertia) = section.masses, section.polar_inertias
    velocity = jacobian[:, :3] @ rates.ravel()
    total = np.zeros((strains.size, strains.size))
    for j, weight in enumerate(weights):
        tangent = frames[j, 2]
        across = np.eye(3) - np.outer(tangent, tangent)
        speed = np.sqrt(np.sum((across @ velocity[j]) ** 2) + SLOWEST**2)
        force = (water.ring_rate * ring[j] + water.oblique_rate * oblique[j]) * np.eye(3)
        force += 0.5 * water.density * water.normal_coefficient * 16 * section.muscle_radius[j] * speed * across
        polar = water.ring_rate * ring_inertia[j] + water.oblique_rate * oblique_inertia[j]
        torque = polar * (np.outer(tangent, tangent) + across / 2)
        total += weight * (jacobian[j, :3].T @ force @ jacobian[j, :3] + jacobian[j, 3:].T @ torque @ jacobian[j, 3:])
    return total


def fibres(model, index):
    """(law, area, factors on passive and active stress, level index, length function, rest) of all fibres of one section."""
    arm, lumped = model.arm, model.arm.lumped
    place = dict(zip(CONSTANTS, section_constants(arm, model.sections)[:, index], strict=True))
    nu = lumped.hoop_ratio

    def straight(angle):
        def length(q):
            radius = place["muscle_offset"] * q[3] ** -nu
            x = q[3] + radius * (q[0] * np.cos(angle) - q[1] * np.sin(angle))
            return np.hypot(x, radius * q[2])

        return length

    def helix(hand):
        return lambda q: np.hypot(q[3], place["oblique_offset"] * q[3] ** -nu * (hand * 2 * np.pi / arm.oblique_pitch + q[2]))

    for number, group in enumerate(MUSCLE_GROUPS[:8]):
        yield arm.longitudinal, place["muscle_area"], 1.0, lumped.longitudinal_stress, number, straight(azimuth(group)), 1.0
    for number, hand in ((8, 1), (9, -1)):
        yield (
            arm.oblique,
            place["oblique_area"],
            lumped.oblique_passive,
            lumped.oblique_stress,
            number,
            helix(hand),
            place["oblique_stretch"],
        )
    yield arm.transverse, place["ring_area"], 1.0, 1.0, 10, lambda q: q[3] ** -nu, 1.0
    yield arm.longitudinal, place["cord_area"], 1.0, 1.0, None, lambda q: q[3], 1.0


def dense_section(model, index, q, rate, levels):
    """Force at rest and loss of force at `rate` of one section, from the muscle laws and differences of the fibre lengths."""
    place = dict(zip(CONSTANTS, section_constants(model.arm, model.sections)[:, index], strict=True))
    shifts = np.diag([1e-3, 1e-3, 1e-3, 1e-6])
    force = np.array([place["bending"], place["bending"], place["twisting"], 0.0]) * q
    lost = np.zeros(4)
    for law, area, passive, strength, number, length, rest in fibres(model, index):
        gradient = np.array([(length(q + d) - length(q - d)) / (2 * d.sum()) for d in shifts])
        s = length(q) / rest
        level = 0.0 if number is None else levels[number]
        active = level * strength * law.maximum_stress * law.active_factor(s)
        force += area * (active + passive * law.passive_stress(s)) / s * gradient
        speed = gradient @ rate / rest
        lost += area * active * (law.velocity_factor(-speed / law.maximum_rate) - 1) / s * gradient
    return place["length"] * force, place["length"] * lost


def compiled_drag(model, strains, motion, h):
    """Impulse (S, 4) and tangent (4 S, 4 S) of the water in a step."""
    step, room = model.step_model, buffers(model.step_model, 11, 0)
    set_shape(strains, step.elements, room.shape)
    drag_impulse(motion, h, step.elements, room.shape, room.residual)
    drag_tangent(h, step.elements, room.shape, room.tangent)
    return room.residual, room.tangent


def compiled_section(model, index, q, motion, levels, h):
    """Impulse (4,) and tangent (4, 4) of the fibres of a section in a step."""
    fibres, impulse, tangent = model.step_model.fibres, np.empty(4), np.empty((4, 4))
    room, strains, every = fibre_room(*fibres.area.shape), model.rest, np.zeros((11, model.sections))
    strains[index], every[:, index] = q, levels
    set_fibres(strains, every, fibres, room)
    section_impulse(q, motion, h, index, fibres, room, impulse, tangent)
    return impulse, tangent


def test_drag_is_that_of_a_dense_jacobian(model, bent):
    strains, rates, _ = bent
    expected, h = dense_drag(model, strains, rates), 0.05
    impulse, tangent = compiled_drag(model, strains, h * rates, h)
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(impulse.ravel() / (h * size), expected @ rates.ravel() / size, atol=3e-3 * abs(rates.ravel() * size).max())
    assert abs(tangent - tangent.T).max() < 1e-12 * abs(tangent).max()


def test_forces_are_those_of_the_muscle_laws(model, bent):
    strains, rates, levels = bent
    h = 1e-6
    for index in range(model.sections):
        q, u, motion = strains[index], levels[:, index].copy(), h * rates[index]
        expected, lost = dense_section(model, index, q, rates[index], u)
        force = compiled_section(model, index, q, np.zeros(4), u, 1.0)[0]
        scale = np.array([*3 * [section_constants(model.arm, 8)[4, index]], 1.0]) * abs(expected[3])
        np.testing.assert_allclose(force / scale, expected / scale, atol=2e-3)
        resisting = compiled_section(model, index, q, motion, u, h)[0] / h - compiled_section(model, index, q + motion, 0 * q, u, 1.0)[0]
        scale *= np.abs(lost / scale).max() / np.abs(expected[3] / scale[3])
        np.testing.assert_allclose(resisting / scale, lost / scale, atol=5e-2)  # branches are blended near zero rate


@pytest.mark.parametrize("laws", LAWS)
@pytest.mark.parametrize("h", [0.01, 0.15])
def test_compiled_step_solves_the_equations_that_casadi_writes(laws, h, bent):
    """At the motion that the compiled step finds, the residual of the CasADi twin vanishes."""
    strains, _, levels = bent
    parameters = ReducedParameters.from_vector(np.linspace(0.6, 1.4, len(FACTORS)))
    for model in (ReducedModel(laws=laws), ReducedModel(laws=laws, parameters=parameters)):
        end = model.simulate(levels[None], [h], start=strains).strains[-1]
        function, given = residual(model.structure), (strains.T, levels, h, factors(model))
        left = function((end - strains).T, *given).full()
        size = abs(function(0 * strains.T, *given).full())
        # Newton stops after a correction below 1e-6, whose square, over the 0.004 of the narrowest blend of a law, is left of the residual.
        assert abs(left).max() < 1e-8 * size.max()


def test_step_function_is_the_compiled_step(model, bent):
    import casadi as ca

    strains, _, levels = bent
    step, h = model.step_function(), 0.05
    found = step(strains.T, levels, h).full().T
    expected = model.simulate(levels[None], [h], start=strains)
    np.testing.assert_allclose(found, expected.strains[-1], rtol=1e-7, atol=1e-7)
    q = ca.MX.sym("q", 4, 8)
    by_strains = ca.Function("slopes", [q], [ca.jacobian(ca.vec(step(q, levels, h)), ca.vec(q))])(strains.T).full()
    transition = model.linearise(expected, levels[None], [h]).transition[0]
    scale = model.step_model.scale.ravel()
    np.testing.assert_allclose(by_strains * scale / scale[:, None], transition * scale / scale[:, None], atol=1e-6)


# Derivatives


@pytest.mark.parametrize("laws", LAWS)
def test_tangent_is_the_derivative_of_the_force(laws, bent):
    model, (strains, _, levels) = ReducedModel(laws=laws), bent
    function = statics(model.structure)
    tangent = function(strains.T, levels, factors(model))[1].full().reshape(4, 8, 4).swapaxes(0, 1)
    assert abs(tangent - tangent.swapaxes(1, 2)).max() < 1e-12 * abs(tangent).max()
    for column, step in enumerate((1e-3, 1e-3, 1e-3, 1e-6)):
        shift = np.zeros(4)
        shift[column] = step
        plus, minus = (function((strains + sign * shift).T, levels, factors(model))[0].full().T for sign in (1, -1))
        expected = (plus - minus) / (2 * step)
        np.testing.assert_allclose(tangent[:, :, column], expected, rtol=1e-4, atol=1e-6 * abs(expected).max())


@pytest.mark.parametrize("laws", LAWS)
def test_compiled_tangents_are_derivatives(laws, bent):
    model, (strains, rates, levels) = ReducedModel(laws=laws), bent
    h = 0.05
    motion, step = h * rates, model.step_model
    for index in range(model.sections):
        given = strains[index], motion[index], levels[:, index].copy(), h
        _, tangent = compiled_section(model, index, *given)
        for column, shift in enumerate(1e-6 * step.scale[index]):
            unit = shift * np.eye(4)[column]
            plus, minus = (compiled_section(model, index, given[0], given[1] + s * unit, *given[2:])[0] for s in (1, -1))
            expected = (plus - minus) / (2 * shift) * step.scale[index]
            np.testing.assert_allclose(tangent[:, column] * step.scale[index], expected, rtol=2e-5, atol=1e-6 * abs(expected).max())
    tangent = compiled_drag(model, strains, motion, h)[1].copy()
    for column in (0, 7, 18, 31):
        shift = np.zeros(32)
        shift[column] = 1e-6 * step.scale.ravel()[column]
        plus, minus = (compiled_drag(model, strains, motion + s * shift.reshape(8, 4), h)[0].ravel().copy() for s in (1, -1))
        expected = (plus - minus) / (2 * shift[column])
        np.testing.assert_allclose(tangent[:, column], expected, atol=1e-6 * abs(expected).max())


@pytest.mark.parametrize(
    "parameters", [ReducedParameters(), ReducedParameters(squeeze=0.3, tone=0.05, oblique_bending=0.4)], ids=["rod", "full"]
)
def test_slopes_at_a_fixed_motion_are_derivatives(parameters, bent):
    """Fibres by strains, levels and step; water by strains and step."""
    model, (strains, rates, levels), h = ReducedModel(parameters=parameters), bent, 0.05
    motion, step, draw = h * rates, model.step_model, np.random.default_rng(5)
    fibres, room = step.fibres, buffers(step, 11, 0)
    for index in (0, 4, 7):
        by_strains, by_levels, by_step = np.empty((4, 5)), np.empty((4, 11)), np.empty(4)
        given = strains[index], motion[index], levels[:, index].copy()
        set_fibres(strains, levels, fibres, room.fibres)
        section_slopes(given[0], given[1], h, index, fibres, room.fibres, by_strains, by_levels, by_step)
        dq, du, dh = 1e-6 * step.scale[index] * draw.normal(size=4), 1e-6 * draw.normal(size=11), 1e-7
        plus, minus = (compiled_section(model, index, given[0] + s * dq, given[1], given[2] + s * du, h + s * dh)[0] for s in (1, -1))
        found, expected = 2 * (by_strains[:, :4] @ dq + by_levels @ du + by_step * dh), plus - minus
        np.testing.assert_allclose(found * step.scale[index], expected * step.scale[index], rtol=1e-5, atol=1e-12)
    for dq, dh in ((1e-6 * step.scale * draw.normal(size=(8, 4)), 0.0), (0 * strains, 1e-6)):
        compiled = []
        for sign in (1, -1):
            compiled.append(compiled_drag(model, strains + sign * dq, motion, h + sign * dh)[0].copy())
        set_shape(strains, step.elements, room.shape)
        drag_impulse(motion, h, step.elements, room.shape, room.residual)
        set_shape_slopes(strains, motion, h, step.elements, room.shape, room.shape_slopes)
        impulse_along(dq.ravel(), dh, h, step.elements, room.shape, room.shape_slopes, room.along)
        expected = ((compiled[0] - compiled[1]) / 2).ravel() * step.scale.ravel()
        np.testing.assert_allclose(room.along * step.scale.ravel(), expected, rtol=1e-5, atol=1e-8 * abs(expected).max())


@pytest.mark.parametrize(("laws", "tolerance"), [("generic", 1e-6), ("known", 1e-4)])
def test_sensitivity_is_the_derivative_of_the_simulation(laws, tolerance):
    model, draw = ReducedModel(laws=laws), np.random.default_rng(0)
    count, parameters = 30, 4
    levels = model.levels(COIL, np.arange(1, count + 1) * 0.1)
    level_slopes = 0.1 * draw.normal(size=(*levels.shape, parameters)) * (levels > 0)[..., None]
    steps, step_slopes = np.full(count, 0.1), 0.01 * draw.normal(size=(count, parameters))
    motion, slopes = model.sensitivities(levels, level_slopes, steps, step_slopes)
    np.testing.assert_allclose(motion.strains, model.simulate(levels, steps).strains, atol=1e-9)
    for column in (0, 3):
        shift = 1e-5
        plus, minus = (
            model.simulate(levels + s * level_slopes[..., column], steps + s * step_slopes[:, column]).strains for s in (shift, -shift)
        )
        expected = (plus - minus) / (2 * shift)
        assert abs(slopes[..., column] - expected).max() < tolerance * abs(expected).max()


@pytest.mark.parametrize("laws", LAWS)
def test_linearisation_is_the_derivative_of_a_step(laws, bent):
    model, (strains, _, levels), h = ReducedModel(laws=laws), bent, 0.05
    linear = model.linearise(model.simulate(levels[None], [h], start=strains), levels[None], [h])
    draw = np.random.default_rng(1)
    dq, du, heavier = draw.normal(size=(8, 4)) * [1.0, 1.0, 1.0, 1e-3], 0.1 * draw.normal(size=(11, 8)), 0.3

    def end(share):
        drag = {name: 1 + share * heavier for name in ("linear_drag", "quadratic_drag", "rotational_drag")}
        moved = replace(model, parameters=ReducedParameters(**drag))
        return moved.simulate((levels + share * du)[None], [h], start=strains + share * dq).strains[-1].ravel()

    expected = (end(1e-4) - end(-1e-4)) / 2e-4
    found = linear.transition[0] @ dq.ravel() + np.tensordot(linear.influence[0], du, 2) + linear.drag[0] * heavier
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6 * abs(expected).max())


def test_steps_do_not_expand_more_than_the_motion_does(model):
    """A step that took its rate from the step before had factors up to 2.4 here, where those of the motion are about 1."""
    levels = model.levels(COIL, np.arange(1, 101) * 0.05)
    transition = model.linearise(model.simulate(levels, np.full(100, 0.05)), levels, np.full(100, 0.05)).transition
    assert max(abs(np.linalg.eigvals(matrix)).max() for matrix in transition) < 1.3


def test_output_slopes_are_derivatives(model, bent):
    strains = bent[0]
    pole = (0.36, 0.48, 0.8)
    values, slopes = model.outputs(strains[None], pole)
    assert values.shape == (1, len(OUTPUTS)) and slopes.shape == (1, len(OUTPUTS), 8, 4)
    for section, strain, step in ((0, 0, 1e-4), (3, 1, 1e-4), (5, 2, 1e-4), (7, 3, 1e-7)):
        shift = np.zeros_like(strains)
        shift[section, strain] = step
        plus, minus = (model.outputs((strains + s * shift)[None], pole)[0] for s in (1, -1))
        expected = (plus - minus)[0] / (2 * step)
        np.testing.assert_allclose(slopes[0, :, section, strain], expected, rtol=1e-5, atol=1e-7)


def test_outputs_are_those_that_casadi_writes(model, bent):
    import casadi as ca

    pole, function = (0.36, 0.48, 0.8), model.outputs_function()
    twist, writhe, link, length, tip, frame, uturn = function(q := ca.SX.sym("q", 4, 8), pole)
    every = ca.vertcat(twist, writhe, link, length, tip, frame[:, 2], uturn)
    both = ca.Function("both", [q], [every, ca.jacobian(every, ca.vec(q))])
    # Of the last ones the angles that add up to link pass several half turns, in one direction and in the other.
    coils = (np.tile([hand * 160.0, 0.0, hand * 90.0, 1.0], (8, 1)) for hand in (1, -1))
    for strains in (bent[0], model.rest, model.respond(COIL, 4.0).strains[-1], *coils):
        values, slopes = model.outputs(strains[None], pole)
        expected, jacobian = (part.full() for part in both(strains.T))
        np.testing.assert_allclose(values[0], expected.ravel(), atol=1e-10)
        np.testing.assert_allclose(slopes[0].reshape(len(OUTPUTS), -1), jacobian, atol=1e-10)


def test_strains_of_an_observation_are_those_that_made_it(model, bent):
    strains = bent[0]
    seen = SimpleNamespace(
        time=0.0, points=model.points(strains), frames=model.frames(strains), stations=model.stations,
        stretch=hat_means(model.arm.edges, model.edges) @ strains[:, 3],
    )  # fmt: skip
    np.testing.assert_allclose(model.strains(seen), strains, rtol=1e-8)


# Physics


def test_drag_and_viscosity_dissipate(model, bent):
    strains, rates, levels = bent
    h = 0.05
    impulse, tangent = compiled_drag(model, strains, h * rates, h)
    assert np.sum(rates * impulse) / h == pytest.approx(rates.ravel() @ dense_drag(model, strains, rates) @ rates.ravel(), rel=2e-3)
    scale = np.sqrt(np.diag(tangent))
    assert np.linalg.eigvalsh(tangent / np.outer(scale, scale)).min() > 0
    for index in range(8):
        u, motion = levels[:, index].copy(), h * rates[index]
        elastic = compiled_section(model, index, strains[index] + motion, np.zeros(4), u, h)[0]
        assert motion @ (compiled_section(model, index, strains[index], motion, u, h)[0] - elastic) > 0


def test_rest_is_an_equilibrium(model):
    force = statics(model.structure)(model.rest.T, np.zeros((11, 8)), factors(model))[0].full()
    assert abs(force).max() < 1e-15
    np.testing.assert_allclose(model.equilibrium(np.zeros((11, 8))), model.rest, atol=1e-12)


@pytest.mark.parametrize("laws", LAWS)
def test_motion_ends_at_the_local_equilibrium(laws):
    model = ReducedModel(laws=laws)
    levels = model.levels(COIL, [7.0])
    end = model.simulate(np.repeat(levels, 200, axis=0), np.full(200, 0.2)).strains[-1]
    np.testing.assert_allclose(end, model.equilibrium(levels[0]), rtol=1e-6, atol=1e-6)


def test_end_state_does_not_depend_on_the_water(model):
    levels = np.repeat(model.levels(COIL, [7.0]), 200, axis=0)
    thick = replace(model, scene=Scene.free(factor=2.0))
    ends = [case.simulate(levels, np.full(200, 0.2)).strains[-1] for case in (model, thick)]
    np.testing.assert_allclose(*ends, rtol=1e-5, atol=1e-5)


def test_mirrored_muscles_mirror_the_motion(model):
    """Exchanging the oblique families and the sides of the arm turns twist and writhe round."""
    mirror = {"R-OM": "L-OM", "L-OM": "R-OM"} | {f"LM{m}": f"LM{(9 - m) % 8 + 1}" for m in range(1, 9)}
    mirrored = Activation(templates=tuple(replace(t, groups=tuple(mirror[g] for g in t.groups)) for t in COIL.templates))
    one, two = (model.respond(programme, 4.0) for programme in (COIL, mirrored))
    np.testing.assert_allclose(two.strains, one.strains * [1, -1, -1, 1], rtol=1e-5, atol=1e-5)


def test_steps_are_solved_across_the_kinks_of_the_laws(model):
    """Random programmes: Newton's method must not go to and fro between the two sides of a kink."""
    draw = np.random.default_rng(0)
    for _ in range(12):
        templates = tuple(
            Plateau(groups=groups, level=draw.uniform(0.1, 0.75), onset=draw.uniform(0, 1), rise=draw.uniform(0.1, 1), offset=2, fall=0.3)
            for groups in (("R-OM",), ("L-OM",), ("LM1", "LM2", "LM8"))
        )
        assert np.isfinite(model.respond(Activation(templates=templates, composition="max"), 3.0, step=0.01).strains).all()


def test_steps_converge_with_order_one(model):
    ends = [model.respond(COIL, 2.0, step=0.1 / 2**k).strains[-1] for k in range(4)]
    errors = [abs(ends[k] - ends[k + 1]).max() for k in range(3)]
    assert 0.7 < np.log2(errors[1] / errors[2]) < 1.4


def test_coil_programme_tells_the_known_story(model):
    """That of the full arm with coarse rings: 1.04 turns stored, a spiral of two turns, 0.92 turns of the other sign at the end."""
    motion = model.respond(COIL, 7.0)
    trace = model.trace(motion.time, motion.strains)
    assert trace.twist[30] == pytest.approx(-1.04, abs=0.1)
    assert trace.lifted_writhe[90] == pytest.approx(-2.0, abs=0.25)
    assert trace.crossings[-1] == -2
    assert trace.twist[-1] == pytest.approx(0.92, abs=0.2)
    published = ReducedModel(arm=Arm.octopus(lumped=LumpedSection.published()))
    levels = tuple(replace(template, level=0.3) for template in COIL.templates)
    motion = published.respond(Activation(templates=levels), 7.0)
    trace = published.trace(motion.time, motion.strains)
    assert trace.twist[30] == pytest.approx(-1.14, abs=0.05)
    assert trace.lifted_writhe[90] == pytest.approx(-2.05, abs=0.15)
    assert trace.crossings[-1] == -2
    assert trace.twist[-1] == pytest.approx(1.1, abs=0.05)


# Kinematics


def test_curvature_is_counted_over_the_whole_arm(model):
    """Half elements at the ends included: uniform twist rate gives k3 L / 2 pi, not (n - 1) / n of it."""
    strains = model.rest
    strains[:, 2] = 40.0
    turns = 40.0 * model.arm.length / (2 * np.pi)
    trace = model.trace([0.0, 1.0], np.stack([strains, strains]))
    assert trace.twist[0] == pytest.approx(turns, rel=1e-12)
    assert model.outputs(strains[None])[0][0, 0] == pytest.approx(turns, rel=1e-12)


def test_constant_curvature_is_a_circle(model):
    strains = model.rest
    strains[:, 0] = 2 * np.pi / model.arm.length
    even = replace(model, arm=Arm.octopus(grading=0.0))
    assert abs(even.points(strains)[-1]).max() < 1e-12  # a closed polygon
    frames = model.frames(strains)
    np.testing.assert_allclose(frames[-1], BASE_FRAME, atol=1e-12)
    quarter = model.frames(strains, [0.0, model.arm.length / 4])[1]
    np.testing.assert_allclose(quarter[0], BASE_FRAME[0], atol=1e-12)  # k1 turns about d1
    np.testing.assert_allclose(quarter[2], -BASE_FRAME[1], atol=1e-12)


def test_hat_means_integrate_exactly():
    edges, bounds = np.array([0.0, 0.03, 0.031, 0.1, 0.2]), np.array([0.0, 0.06, 0.1, 0.14, 0.17, 0.19, 0.2])
    fine = np.linspace(0.0, 0.2, 200001)
    values = hat_values((fine[1:] + fine[:-1]) / 2, bounds)
    for row, (low, high) in zip(hat_means(edges, bounds), pairwise(edges), strict=True):
        inside = (fine[1:] <= high + 1e-12) & (fine[:-1] >= low - 1e-12)
        np.testing.assert_allclose(row, values[inside].mean(axis=0), atol=1e-6)


def test_outputs_agree_with_the_measuring_formula(model):
    motion = model.respond(COIL, 4.0)
    trace, points = model.trace(motion.time, motion.strains), model.points(motion.strains)
    values = model.outputs(motion.strains)[0]
    np.testing.assert_allclose(values[:, 0], trace.twist, atol=1e-12)
    np.testing.assert_allclose(values[:, 1], trace.lifted_writhe, atol=1e-10)
    np.testing.assert_allclose(values[:, 4:7], points[:, -1], atol=1e-12)
    np.testing.assert_allclose(values[:, 7:10], model.frames(motion.strains)[:, -1, 2], atol=1e-12)


def test_strains_are_recovered_from_frames(model, bent):
    strains = bent[0]
    stretch = hat_means(model.arm.edges, model.edges) @ strains[:, 3]
    found = model.strains_from_frames(model.stations, model.frames(strains), stretch)
    np.testing.assert_allclose(found, strains, rtol=1e-8)


# Reach, cost, errors


def test_reach_contains_what_the_programme_does(model):
    limits = model.reach_limits()
    assert limits.twist["R-OM"] == pytest.approx(-limits.twist["L-OM"], rel=1e-6)
    assert 1.2 < limits.twist["L-OM"] < 2.5
    assert 1.5 < limits.turns < 4.0
    assert limits.writhe > 2.5
    assert limits.length[0] < 0.16 < 0.2 < limits.length[1]


def test_cost_goes_with_the_number_of_steps(model):
    model.respond(COIL, 7.0)
    pairs = [(_timed(lambda: model.respond(COIL, 7.0)), _timed(lambda: model.respond(COIL, 7.0, step=0.1))) for _ in range(9)]
    assert min(half for _, half in pairs) < 0.8 * min(whole for whole, _ in pairs)


def _timed(call):
    begin = process_time()
    call()
    return process_time() - begin


def test_parameters_are_factors(model):
    vector = np.arange(1.0, len(FACTORS) + 1)
    parameters = ReducedParameters.from_vector(vector)
    np.testing.assert_array_equal(parameters.vector(), vector)
    soft = replace(model, parameters=ReducedParameters(longitudinal_stress=0.8))
    levels = np.zeros((11, 8))
    levels[0] = 0.3
    weaker = levels.copy()
    weaker[0] *= 0.8
    np.testing.assert_allclose(soft.equilibrium(levels), model.equilibrium(weaker), atol=1e-8)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ReducedModel(laws="exact"), "unknown laws 'exact'"),
        (lambda: ReducedModel(sections=1), "sections=1: a whole number from 2 to 40"),
        (lambda: ReducedModel(scene=Scene(water=None)).respond(COIL, 1.0), "give the scene water"),
        (lambda: ReducedModel().simulate(np.zeros((3, 11, 7)), np.ones(3)), r"\(3, 11, 8\) is needed"),
        (lambda: ReducedModel().simulate(np.zeros((1, 11, 8)), [0.0]), "steps must be positive"),
        (lambda: ReducedModel().equilibrium(np.zeros((8, 11))), "it must end in"),
        (lambda: ReducedModel().reach_limits(side=("LM9",)), "unknown muscle group 'LM9'"),
    ],
)
def test_errors_say_what_to_do(call, message):
    with pytest.raises(OctoctrlError, match=message):
        call()
