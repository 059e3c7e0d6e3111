"""Goals: one definition, read on the reduced model and on a recording of the same motion; targets, bands, times."""

import pickle
from dataclasses import replace
from math import inf

import casadi as ca
import numpy as np
import pytest
from conftest import coil_strains

import octoctrl as oc
from octoctrl.planners.asking.goals.keep_out import CapsuleZone, HalfSpaceZone, SphereZone
from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.planners.asking.registry import goal, goal_kinds
from octoctrl.planners.asking.task import miss_in_phase
from octoctrl.planners.contracts import Goal, When
from octoctrl.planners.model.output_kernels import OUTPUTS
from octoctrl.planners.model.readings import Rows, residual_function
from octoctrl.planners.model.reduced import ReducedModel
from octoctrl.sim.topology.trace import TopologyConvention

TIME = np.linspace(0.05, 2.9, 20)
POLE = (0.2, 0.1, 1.0)

ASKED = {
    "twist": goal("twist", value=-0.4),
    "twist in a window": goal("twist", window=(0.03, 0.117), between=(-0.1, 0.1)),
    "lifted writhe": goal("lifted_writhe", at_most=-0.8),
    "lifted link": goal("lifted_link", at_least=0.1),
    "length": goal("length", value=0.19),
    "curvature": goal("curvature", value=30.0),
    "curvature in a window": goal("curvature", window=(0.1, inf), at_least=50.0),
    "sucker side": goal("sucker_side", azimuth=0.7, at_least=0.8),
    "sucker side in a window": goal("sucker_side", window=(0.05, 0.06), value=-0.2),
    "packet": goal("packet", value=0.06),
    "tip": goal("tip", value=(0.02, 0.1, -0.03)),
    "shape": goal("shape", value=((0.0, 0.06, 0.01), (0.01, 0.1, -0.02), (0.02, 0.12, -0.03))),
    "tip tangent": goal("tip_tangent", direction=(1.0, 1.0, 0.5)),
    "clear of a sphere": goal("keep_out", shape=SphereZone(centre=(0.01, 0.08, 0.02), radius=0.01)),
    "clear of a capsule": goal("keep_out", shape=CapsuleZone(start=(0.03, 0.1, 0.0), stop=(0.0, 0.12, 0.05), radius=0.02)),
    "clear of a wall": goal("keep_out", shape=HalfSpaceZone(point=(0.0, 0.0, -0.02), normal=(0.0, 0.1, 2.0))),
}


@pytest.fixture(scope="module")
def model():
    return ReducedModel()


def motion(time=TIME):
    """The coil's strains, with bends in both directions and a wave, so that nothing is symmetric."""
    strains = coil_strains(time)
    places = np.arange(strains.shape[1])
    strains[..., 1] += 25 * np.sin(2 * time[:, None] + places)
    strains[..., 3] += 0.03 * np.cos(places)
    return strains


def measured(model, asked, strains=None, time=TIME):
    strains = motion() if strains is None else strains
    convention = TopologyConvention(pole=POLE)
    return asked.miss(model.recording(time, strains), model.trace(time, strains, convention), model.arm)


@pytest.fixture(scope="module")
def outputs(model):
    return model.outputs(motion(), TopologyConvention(pole=POLE).pole)


def test_every_kind_is_asked_here():
    on_the_model = {name for name, kind in goal_kinds().items() if not getattr(kind, "simulated", False)}
    assert {asked.quantity for asked in ASKED.values()} == on_the_model
    assert all(isinstance(asked, Goal) and hash(asked) == hash(replace(asked)) for asked in ASKED.values())


@pytest.mark.parametrize("case", ASKED)
def test_model_and_recording_agree(case, model, outputs):
    """What a goal misses on the model is what it misses on the same motion, recorded."""
    function = residual_function([ASKED[case]], model.arm, model.sections)
    planned = []
    for values, strains in zip(outputs[0], motion(), strict=True):
        residuals = np.asarray(function(values, strains.T)[0]).ravel()
        planned.append(np.linalg.norm(residuals))
    found = measured(model, ASKED[case])
    assert found.shape == TIME.shape and found.max() > 0.0
    # Lifted writhe is known modulo 2 at a single instant.
    difference = np.abs(found - planned)
    if ASKED[case].quantity in ("lifted_writhe", "lifted_link"):
        difference = np.minimum(difference, np.abs(difference - 2))
    np.testing.assert_allclose(difference, 0.0, atol=2e-7)


@pytest.mark.parametrize("case", ASKED)
def test_slopes_are_derivatives_also_of_a_straight_arm(case, model):
    function = residual_function([ASKED[case]], model.arm, model.sections)
    pole = np.array(POLE) / np.linalg.norm(POLE)

    def residuals(strains):
        return np.asarray(function(model.outputs(strains[None], pole)[0][0], strains.T)[0]).ravel()

    for strains in (motion()[9], model.rest + 1e-3 * motion()[9] * [1, 1, 1, 0]):
        outputs, output_slopes = model.outputs(strains[None], pole)
        _, by_outputs, by_strains = (np.asarray(part) for part in function(outputs[0], strains.T))
        slopes = by_strains + by_outputs @ output_slopes[0].reshape(len(OUTPUTS), -1)
        assert np.isfinite(slopes).all()
        for place, step in ((1, 1e-3), (4 * 5, 1e-3), (4 * 3 + 2, 1e-3), (4 * 2 + 3, 1e-6)):
            shift = np.zeros(strains.size)
            shift[place] = step
            plus, minus = (residuals(strains + sign * shift.reshape(strains.shape)) for sign in (1, -1))
            np.testing.assert_allclose(slopes[:, place], (plus - minus) / (2 * step), rtol=1e-4, atol=1e-6)


# What the numbers mean, on shapes whose answer is known


def bent(model, k1=0.0, k2=0.0, k3=0.0, stretch=1.0, sections=slice(None)):
    strains = np.tile(model.rest, (2, 1, 1))
    strains[:, sections] = (k1, k2, k3, stretch)
    return strains


def value(model, strains, quantity, **numbers):
    """What is read: the miss of a target of zero, with its sign from one far above."""
    pair = np.array([0.0, 1.0])
    far = measured(model, goal(quantity, value=1e3, **numbers), strains, pair)
    return 1e3 - far[-1]


def test_regional_twist_is_the_window_times_its_curvature(model):
    strains = bent(model, k3=12.0)
    assert value(model, strains, "twist") == pytest.approx(12.0 * 0.2 / (2 * np.pi), rel=1e-9)
    assert value(model, strains, "twist", window=(0.05, 0.11)) == pytest.approx(12.0 * 0.06 / (2 * np.pi), rel=1e-9)
    parts = [value(model, motion()[[0, 9]], "twist", window=window) for window in ((0.0, 0.07), (0.07, inf))]
    assert sum(parts) == pytest.approx(value(model, motion()[[0, 9]], "twist"), abs=1e-9)


def value_of(model, strains, asked):
    return measured(model, asked, strains, np.array([0.0, 1.0]))[-1]


def test_curvature_and_sucker_side_of_a_ring_segment(model):
    strains = bent(model, k1=-8.0)  # towards LM1, at azimuth 0
    assert value(model, strains, "curvature") == pytest.approx(np.hypot(8.0, 0.1), rel=1e-9)
    for azimuth in (0.0, 0.5, np.pi / 2, np.pi):
        missed = value_of(model, strains, goal("sucker_side", azimuth=azimuth, value=1.0))
        assert 1 - missed == pytest.approx(8.0 * np.cos(azimuth) / np.hypot(8.0, 0.1), abs=1e-9)
    assert value_of(model, bent(model), goal("sucker_side", value=0.0)) == 0.0


def test_bend_of_the_side_of_the_suckers_is_towards_them(model):
    from octoctrl.planners.asking.primitives import Bend
    from octoctrl.planners.asking.schedule import Schedule

    for number in (1, 4, 7):
        activation = Schedule(primitives=(Bend(side=f"LM{number}", level=0.2),), duration=1.0).activation()
        strains = model.respond(activation, 1.0, step=0.1).strains[[0, -1]]
        asked = goal("sucker_side", azimuth=(number - 1) * np.pi / 4, value=1.0)
        assert value_of(model, strains, asked) < 0.02
        assert value_of(model, strains, replace(asked, value=-1.0)) > 1.98


def test_packet_stands_where_the_bend_is(model):
    for section in (2, 4, 6):
        strains = bent(model, k1=-60.0, sections=[section])
        centre = (model.edges[section] + model.edges[section + 1]) / 2
        assert value_of(model, strains, goal("packet", value=centre)) < 0.2 * np.diff(model.edges)[section]


def test_tip_of_a_straight_and_of_a_stretched_arm(model):
    asked = goal("tip", value=(0.0, 0.2, 0.0))
    assert value_of(model, bent(model), asked) == pytest.approx(0.0, abs=1e-12)
    assert value_of(model, bent(model, stretch=1.1), asked) == pytest.approx(0.02, rel=1e-9)
    assert value_of(model, bent(model), goal("tip_tangent", direction=(3.0, 0.0, 0.0))) == pytest.approx(np.sqrt(2), rel=1e-9)


def test_keep_out_is_entered_by_the_surface_of_the_arm(model):
    """A straight arm along y, 12 mm wide at the base, beside bodies whose distance is known."""
    section = model.arm.section(model.arm.edges)
    shapes = {
        SphereZone(centre=(0.05, 0.1, 0.0), radius=0.02): np.hypot(0.05, model.arm.edges - 0.1) - 0.02,
        CapsuleZone(start=(0.04, 0.05, 0.0), stop=(0.04, 0.15, 0.0), radius=0.01): np.hypot(
            0.04, np.maximum(np.maximum(0.05 - model.arm.edges, model.arm.edges - 0.15), 0.0)
        )
        - 0.01,
        HalfSpaceZone(point=(0.0, 0.19, 0.0), normal=(0.0, -1.0, 0.0)): 0.19 - model.arm.edges,
    }
    for shape, distance in shapes.items():
        clearance = (distance - section.outer_radius).min()
        missed = value_of(model, bent(model), goal("keep_out", shape=shape, margin=0.05))
        assert missed == pytest.approx(0.05 - clearance, abs=1e-9)
        assert value_of(model, bent(model), goal("keep_out", shape=shape, margin=max(clearance - 1e-9, 0.0))) == pytest.approx(
            max(-clearance, 0.0), abs=1e-8
        )


def test_keep_out_is_read_at_the_nodes_of_the_plant_that_moved():
    """A plant may have other elements than the arm's own, as the full arm has."""
    fine = oc.Arm.octopus(elements=64)
    recording = oc.make_plant("rod", fine).advance(oc.Activation(templates=(oc.Plateau(groups=("LM1",), level=0.2),)), 0.2)
    outputs = RecordedOutputs(recording, None, oc.Arm.octopus())
    distance = np.linalg.norm(recording.points - [0.05, 0.1, 0.0], axis=2) - 0.02 - fine.section(fine.edges).outer_radius
    zone = goal("keep_out", shape=SphereZone(centre=(0.05, 0.1, 0.0), radius=0.02), margin=0.05)
    np.testing.assert_allclose(zone.clearance(outputs), distance.min(axis=1), atol=1e-12)


# Targets


def test_bands_are_missed_outside_only(model):
    strains = bent(model, k3=2 * np.pi)  # 0.2 turns
    for target, missed in {
        "value": (0.5, 0.3), "at_least": (0.5, 0.3), "at_most": (0.05, 0.15), "between": ((0.3, 0.5), 0.1),
    }.items():  # fmt: skip
        assert value_of(model, strains, goal("twist", **{target: missed[0]})) == pytest.approx(missed[1], abs=1e-9)
    for target in ({"at_least": 0.1}, {"at_most": 0.3}, {"between": (0.1, 0.3)}):
        assert value_of(model, strains, goal("twist", **target)) == 0.0


def test_a_goal_is_judged_while_it_has_to_hold():
    time, misses = np.linspace(0.0, 2.0, 201), np.abs(np.linspace(-1.0, 1.0, 201))
    end = goal("twist", value=0.0)
    assert miss_in_phase(end, time, misses, 0.5, 1.0) == pytest.approx(0.0, abs=1e-12)
    assert miss_in_phase(end, time, misses, 0.5, 1.305) == pytest.approx(0.305)
    assert miss_in_phase(replace(end, hold=0.2), time, misses, 0.5, 1.0) == pytest.approx(0.2)
    assert miss_in_phase(replace(end, hold=3.0), time, misses, 0.5, 1.0) == pytest.approx(0.5)  # not before its phase
    assert miss_in_phase(replace(end, when=When.THROUGHOUT), time, misses, 0.55, 1.2) == pytest.approx(0.45)
    misses[80] = np.nan
    assert np.isnan(miss_in_phase(replace(end, when=When.THROUGHOUT), time, misses, 0.5, 1.0))


def test_goals_say_what_they_are():
    assert [str(asked) for asked in ASKED.values()] == [
        "twist -0.4 ± 0.05 turns",
        "twist between -0.1 and 0.1 ± 0.05 turns from 30 mm to 117 mm",
        "lifted writhe at most -0.8 ± 0.05 turns",
        "lifted link at least 0.1 ± 0.05 turns",
        "length 0.19 ± 0.005 m",
        "curvature 30 ± 2 1/m",
        "curvature at least 50 ± 2 1/m from 100 mm to the tip",
        "sucker side at least 0.8 ± 0.1",
        "sucker side -0.2 ± 0.1 from 50 mm to 60 mm",
        "packet 0.06 ± 0.008 m",
        "tip (0.02, 0.1, -0.03) ± 0.01 m",
        "shape through 3 points ± 0.01 m",
        "tip tangent (0.667, 0.667, 0.333) ± 0.2 rad",
        "keep out of a SphereZone by 6 mm ± 0.003 m throughout",
        "keep out of a CapsuleZone by 6 mm ± 0.003 m throughout",
        "keep out of a HalfSpaceZone by 6 mm ± 0.003 m throughout",
    ]
    assert str(goal("twist", value=1.0, hold=0.4)) == "twist 1 ± 0.05 turns for 0.4 s"


EXCLUDED = [
    (goal("twist", value=1.0), goal("twist", value=1.2), True),
    (goal("twist", value=1.0), goal("twist", value=1.05), False),
    (goal("twist", value=1.0), goal("twist", at_least=0.5), False),
    (goal("twist", value=1.0), goal("twist", at_most=0.5), True),
    (goal("twist", value=1.0), goal("twist", window=(0.0, 0.1), value=-1.0), False),
    (goal("twist", value=1.0), goal("lifted_writhe", value=-1.0), False),
    (goal("tip", value=(0.0, 0.1, 0.0)), goal("tip", value=(0.0, 0.15, 0.0)), True),
    (goal("tip", value=(0.0, 0.1, 0.0)), goal("tip", value=(0.0, 0.11, 0.0)), False),
    (goal("tip_tangent", direction=(0, 1, 0)), goal("tip_tangent", direction=(1, 0, 0)), True),
]


@pytest.mark.parametrize(("first", "second", "excluded"), EXCLUDED, ids=range(len(EXCLUDED)))
def test_what_contradicts_what(first, second, excluded):
    assert first.excludes(second) is second.excludes(first) is excluded


def test_several_goals_share_one_function(model):
    both = residual_function([ASKED["tip"], ASKED["twist"]], model.arm, model.sections)
    assert both.size1_out(0) == 4 and isinstance(both, ca.Function)


def test_rows_of_many_instants_are_those_of_each(model, outputs):
    """Also of a copy that has been in a file, and with memory that earlier answers do not share."""
    function = residual_function([ASKED["tip"], ASKED["twist"]], model.arm, model.sections)
    rows = pickle.loads(pickle.dumps(Rows(function)))
    found, again = rows(outputs[0], motion()), rows(outputs[0][::-1], motion()[::-1])
    for index, (values, strains) in enumerate(zip(outputs[0], motion(), strict=True)):
        for part, other, expected in zip(found, again, function(values, strains.T), strict=True):
            np.testing.assert_array_equal(part[index], np.asarray(expected).reshape(part[index].shape))
            np.testing.assert_array_equal(other[len(TIME) - 1 - index], part[index])
