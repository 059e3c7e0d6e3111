"""Forces from outside on the full arm: the momentum that they give, their direction, and that nothing changes where there are none."""

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import make_plant
from octoctrl.sim.scene.scene import Scene

QUIET = oc.Activation()


def momentum(plant):
    """Of all rods, kg m/s, with the masses that the step has."""
    rods, h, total = plant.core.rods, plant.h, np.zeros(3)
    for view, nodes in ((rods.straight, {"nodes": True}), (rods.oblique, {"nodes": True}), (rods.ring, {})):
        mobility = view(R.NODE_MOBILITY, **nodes)
        mass = np.where(mobility > 0, h / np.where(mobility > 0, mobility, 1.0), 0.0)
        total += [np.sum(mass * view(R.V1 + i, **nodes)) for i in range(3)]
    return total


def pushed(*loads):
    plant = make_plant("assembly-coarse", scene=Scene(water=None, loads=loads), resting_tone=0.0, sample_interval=2e-4, dt=5e-5)
    plant.advance(QUIET, 2e-4)
    return plant


@pytest.fixture(scope="module")
def untouched():
    return pushed()


@pytest.mark.parametrize(
    ("load", "force"),
    [
        (oc.PointLoad(arclength=0.1, force=(1e-3, 2e-3, 3e-3)), (1e-3, 2e-3, 3e-3)),
        (oc.PointLoad(arclength=0.1, force=(1e-3, 2e-3, 3e-3), follower=True), (2e-3, 3e-3, 1e-3)),
        (oc.SpreadLoad(force=(0.0, 0.0, 0.05), window=(0.08, 0.12)), (0.0, 0.0, 2e-3)),
    ],
    ids=["point", "follower", "spread"],
)
def test_force_is_the_rate_of_momentum(untouched, load, force):
    """Before anything has reached the base; at rest d1, d2, d3 are z, x, y."""
    gained = momentum(pushed(load)) - momentum(untouched)
    assert gained == pytest.approx(2e-4 * np.array(force), rel=0.03, abs=1e-9)


def test_a_pull_at_the_tip_bends_the_arm_its_way():
    plant = make_plant("assembly-coarse")
    seen = plant.step(np.zeros(11), 0.05, loads=(oc.PointLoad(force=(0.0, 0.0, 2e-3)),))
    assert seen.points[-1, 2] > 1e-4 and abs(seen.points[-1, 0]) < 0.05 * seen.points[-1, 2]
    assert np.abs(seen.velocities[-1]).max() > 1e-3


def test_a_load_of_nothing_changes_no_bit(untouched):
    other = pushed(oc.PointLoad())
    assert np.array_equal(untouched.core.rods.state()[0], other.core.rods.state()[0])


def test_torques_are_refused():
    with pytest.raises(OctoctrlError, match="the full arm carries forces only; give a torque as two forces, or take the plant 'rod'"):
        make_plant("assembly-coarse").step(np.zeros(11), 0.01, loads=(oc.PointLoad(torque=(0.0, 0.0, 1e-6)),))


@pytest.mark.parametrize("name", ["rod", "assembly-coarse"])
def test_gains_scale_what_muscles_are_told(name):
    """A weak muscle moves as at a lower level, a dead one as at none, to the bit; gains of one change no bit; recordings hold the order."""

    def moved(levels, gains=None):
        plant = make_plant(name, gains=gains)
        return plant.step(levels, 0.02)

    told = {"LM2": 0.4, "TM": 0.2}
    assert moved(told, {"LM2": 0.5}) == moved({"LM2": 0.2, "TM": 0.2})
    assert moved(told, {"LM2": 0.0}) == moved({"TM": 0.2})
    assert moved(told, {"LM2": 1.0, "R-OM": 1.0}) == moved(told)
    plant = make_plant(name, gains={"LM2": 0.5})
    recording = plant.advance(oc.Activation(templates=(oc.Plateau(groups=("LM2",), level=0.4, rise=0.01),)), 0.01)
    assert recording.levels[-1, 1] == pytest.approx(0.4) and plant.gains == {"LM2": 0.5}


@pytest.mark.parametrize(
    ("gains", "message"),
    [
        ({"LM9": 0.5}, "unknown muscle group 'LM9'"),
        ({"LM2": 1.2}, "gain of LM2=1.2 is outside 0…1"),
        ({"LM2": -0.1}, "gain of LM2=-0.1 is outside 0…1"),
        ({"LM2": "half"}, "gain of LM2: expected a number, found the string 'half'"),
    ],
    ids=str,
)
def test_gains_that_cannot_be_are_refused(gains, message):
    with pytest.raises(OctoctrlError) as caught:
        oc.Plant(gains=gains)
    assert message in str(caught.value)
