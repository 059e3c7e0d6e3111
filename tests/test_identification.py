"""Identification: known factors are recovered, what was visited is kept, and the published programme stays held out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from octoctrl.planners.fitting.experiments import experiments
from octoctrl.planners.fitting.fit import GENERIC_FREE, KNOWN_FREE, identify
from octoctrl.planners.fitting.identified import IdentifiedModel, load_identified
from octoctrl.planners.model.kinematics import hat_means
from octoctrl.planners.model.reduced import ReducedModel, ReducedParameters
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.templates import Plateau

TRUTH = ReducedParameters(longitudinal_stress=1.15, oblique_stress=0.85, viscosity=1.2)
FREE = ("longitudinal_stress", "oblique_stress", "viscosity")


def recorded(model, activation, duration, step=0.06):
    """What a plant would have recorded, had it moved as `model` does."""
    motion = model.respond(activation, duration, step=step)
    stretch = motion.strains[..., 3] @ hat_means(model.arm.edges, model.edges).T
    return SimpleNamespace(time=motion.time, stations=model.stations, frames=model.frames(motion.strains), stretch=stretch)


@pytest.fixture(scope="module")
def found():
    model = ReducedModel(parameters=TRUTH)
    runs = [
        (activation, recorded(model, activation, 1.5))
        for name, activation, _ in experiments(model.arm)
        if name.startswith("twist, bend, un") or name == "bend, then twist"
    ]
    return identify(runs, model.arm, free=FREE, max_evaluations=6)


def test_known_factors_are_recovered(found):
    for name in FREE:
        assert getattr(found.model.parameters, name) == pytest.approx(getattr(TRUTH, name), rel=0.02)
        assert 0 < found.deviations[name] < 0.1
    assert found.residual_rms < 3e-3


def test_fixed_factors_stay(found):
    assert found.model.parameters.linear_drag == 1.0
    assert found.names == FREE


def test_result_survives_a_file(found, tmp_path):
    path = tmp_path / "model.json"
    found.save(path)
    again = IdentifiedModel.load(path, found.model.arm)
    assert again.model == found.model
    assert again.validity == found.validity
    np.testing.assert_array_equal(again.covariance, found.covariance)
    with pytest.raises(OctoctrlError, match="identify again"):
        IdentifiedModel.load(path, Arm.octopus(length=0.3))


def test_validity_region_names_what_is_outside(found):
    model = found.model
    calm = np.full((2, 11, 8), 0.0)
    rest = np.stack([model.rest, model.rest])
    assert found.validity.outside(model.arm, rest, calm) == ()
    calm[:, MUSCLE_GROUPS.index("TM")] = 0.5
    long = rest * [1, 1, 1, 1.4]
    sentences = found.validity.outside(model.arm, long, calm)
    assert any(sentence.startswith("TM reaches 0.50") for sentence in sentences)
    assert any(sentence.startswith("stretch spans") for sentence in sentences)


def test_experiments_excite_every_group_and_hold_the_programme_out():
    arm = Arm.octopus()
    runs = experiments(arm)
    assert len({name for name, _, _ in runs}) == len(runs) == 12
    assert sum(duration for _, _, duration in runs) == pytest.approx(31.5)
    peak = np.zeros(len(MUSCLE_GROUPS))
    for _, activation, duration in runs:
        levels = activation.levels(np.arange(0, duration, 0.01), arm.edges)
        peak = np.maximum(peak, levels.max(axis=(0, 2)))
        used = set(activation.groups)
        assert not {"R-OM", "L-OM", "LM1", "LM2", "LM8"} <= used or len(activation.templates) > 3  # the coil uses these in three steps
    np.testing.assert_allclose(peak, 0.75)


def test_free_factors_exist_and_leave_the_scale_alone():
    for names in (KNOWN_FREE, GENERIC_FREE):
        assert set(names) <= set(ReducedParameters.__dataclass_fields__)
        assert "linear_drag" not in names


def test_unknown_arm_gets_a_model_without_identification():
    other = load_identified(Arm.octopus(length=0.31))
    assert other.names == () and other.model.parameters == ReducedParameters()
    assert other.validity.outside(other.model.arm, other.model.rest[None], np.full((1, 11, 8), 0.1))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: identify([]), "no recordings given"),
        (lambda: identify([(None, None)], free=("stress",)), "unknown factor 'stress'"),
        (lambda: ReducedParameters(viscosity=-1), "viscosity=-1 is outside >= 0"),
    ],
)
def test_errors_say_what_to_do(call, message):
    with pytest.raises(OctoctrlError, match=message):
        call()


@pytest.mark.slow
@pytest.mark.parametrize("laws", ["known", "generic"])
def test_model_identified_on_the_rod_plant_predicts_the_held_out_coil(laws):
    from octoctrl.sim.plants import Plant
    from octoctrl.sim.topology.measures import measure

    coil = Activation(
        templates=(
            Plateau(groups=("R-OM",), level=0.3, rise=0.5, offset=3.0, fall=0.5),
            Plateau(groups=("LM1", "LM2", "LM8"), level=0.3, onset=1.5, rise=4.0),
            Plateau(groups=("L-OM",), level=0.3, onset=4.1, rise=1.0),
        )
    )
    arm = Arm.octopus()
    runs = [(activation, Plant(arm).advance(activation, duration)) for _, activation, duration in experiments(arm)]
    model = identify(runs, arm, laws=laws).model
    recording = Plant(arm).advance(coil, 7.0)
    motion = replace(model, step=0.05).respond(coil, 7.0)
    plant, predicted = measure(recording.time, recording.points, recording.frames).at(motion.time), model.trace(motion.time, motion.strains)
    error = predicted.lifted_writhe - plant.lifted_writhe
    error -= 2 * np.round(error / 2)
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert np.sqrt(np.mean((predicted.twist - plant.twist) ** 2)) < 0.04
    assert predicted.crossings[-1] == plant.crossings[-1]
