"""Why runs stop: guards that catch what they should, and the second look that tells an unstable step from a motion beyond the model."""

import numpy as np
import pytest

from octoctrl.laboratory.trials import draw
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, Arm
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.findings import Finding
from octoctrl.sim.plants import Plant
from octoctrl.sim.rod.diagnosis import FEWEST, alternation, explained, substeps
from octoctrl.sim.rod.elastic import RodSimulation
from octoctrl.sim.rod.layout import Row
from octoctrl.sim.rod.rod import Rod
from octoctrl.sim.rotations import rotation_matrix
from octoctrl.sim.templates import Plateau

MATERIAL = {"density": 1000.0, "youngs_modulus": 1e4, "shear_modulus": 4e3}


@pytest.mark.parametrize("degrees, stops", [(50, False), (70, True), (180, True)])
def test_a_section_that_has_fallen_over_is_caught(degrees, stops):
    rod = Rod.straight(length=0.2, radius=0.01, elements=20, **MATERIAL)
    frames = rotation_matrix(np.array([np.radians(degrees), 0.0, 0.0])) @ rod.frames
    simulation = RodSimulation(rod)
    simulation.place(rod.points, frames)
    if stops:
        with pytest.raises(PlantUnstableError, match="is sheared by more than 60 degrees"):
            simulation.advance(1e-5)
    else:
        simulation.advance(1e-5)


def test_a_spin_that_the_step_cannot_follow_is_caught():
    rod = Rod.straight(length=0.2, radius=0.01, elements=20, section="constant", **MATERIAL)
    for share, stops in ((0.3, False), (1.3, True)):
        simulation = RodSimulation(rod)
        simulation.spins = np.tile([0.0, 0.0, share / simulation.dt], (20, 1))
        if stops:
            with pytest.raises(PlantUnstableError, match="turns by a radian within one step"):
                simulation.advance(20 * simulation.dt)
        else:
            simulation.advance(20 * simulation.dt)


def test_the_joint_at_the_clamp_is_watched():
    plant = Plant()
    frame = plant.core.rows[Row.Q11 : Row.Q33 + 1, 1 : plant.elements + 1]
    points = plant.core.rows[Row.X1 : Row.X3 + 1, 1 : plant.elements + 2]
    turn = rotation_matrix(np.array([2.2, 0.0, 0.0]))
    frame[:] = (frame.T.reshape(-1, 3, 3) @ turn.T).reshape(-1, 9).T
    points[:] = turn @ points
    with pytest.raises(PlantUnstableError) as caught:
        plant.advance(Activation(), 0.005)
    assert caught.value.element == 0 and caught.value.mechanism.startswith("is bent")


def test_motion_beyond_the_resolution_is_told_from_an_unstable_step():
    pull = Activation(templates=(Plateau(groups=("LM1", "LM2", "LM8"), level=1.0, rise=0.1),))
    with pytest.raises(
        PlantUnstableError, match=r"stopped at t=.* is bent .* curls tighter than its elements resolve - use more"
    ) as coarse:
        Plant(Arm.octopus(elements=8, grading=0.0)).advance(pull, 2.0)
    assert coarse.value.element == 7 and "to and fro" not in coarse.value.mechanism
    Plant(Arm.octopus(elements=64, grading=1.0)).advance(pull, 2.0)
    plant = Plant()
    plant.set_steps(plant.steps // 2)
    with pytest.raises(PlantUnstableError, match=r"unstable at t=.* to and fro from step to step \(dt=.*predicted limit.* halve dt"):
        plant.advance(pull, 2.0)


def test_the_stop_is_timed_to_the_step_and_later_samples_are_dropped():
    pull = Activation(templates=(Plateau(groups=("LM1", "LM2", "LM8"), level=1.0, rise=0.1),))
    plant = Plant(Arm.octopus(elements=8, grading=0.0), record_every=1)
    with pytest.raises(PlantUnstableError) as caught:
        plant.advance(pull, 2.0)
    stop, last = caught.value.time, caught.value.recording.time[-1]
    assert last < stop <= last + plant.sample_interval + 1e-9
    assert (stop - last) / plant.h == pytest.approx(round((stop - last) / plant.h), abs=1e-6)


def test_a_sample_that_outruns_its_step_is_tried_again_at_finer_ones():
    trial = draw("waves", 0, 3)
    plant, cut = Plant(Arm(**trial.arm)), Plant(Arm(**trial.arm))
    recording = plant.advance(trial.activation, 0.5)
    assert recording.complete and plant.retried > 0 and plant.h == plant.sample_interval / plant.steps
    for _ in range(20):
        piece = cut.advance(trial.activation, 0.025)
    assert cut.retried == plant.retried and np.array_equal(piece.points[-1], recording.points[-1])
    given = Plant(Arm(**trial.arm), dt=plant.h)
    with pytest.raises(PlantUnstableError):
        given.advance(trial.activation, 0.5)


def test_alternation_is_one_for_a_zigzag_and_nothing_for_uniform_motion():
    steps = np.arange(12.0)[:, None]
    assert alternation((-1) ** steps) == pytest.approx(1.0) and alternation(3 * steps) == pytest.approx(0.0)
    assert alternation(np.exp(0.3 * steps)) < 0.3 and alternation(np.zeros((12, 2, 3))) == 0.0
    assert alternation(steps[: FEWEST - 1]) is None


def test_substeps_meet_the_samples_and_are_linear_in_between():
    levels = np.random.default_rng(0).uniform(size=(4, len(LONGITUDINAL_GROUPS), 3))
    fine = substeps(levels, 5)
    assert len(fine) == 16 and np.array_equal(fine[::5], levels)
    assert fine[7] == pytest.approx(0.6 * levels[1] + 0.4 * levels[2])


@pytest.mark.parametrize("unstable", [True, False, None])
def test_a_remedy_is_named_once(unstable):
    for finding in Finding:
        assert str(explained(1.0, 3, finding, unstable)).count("halve dt") <= 1, finding
