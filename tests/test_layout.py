"""Muscle layouts as data: an arm with other muscles is one class with one attribute, and moves as its geometry says."""

import numpy as np
import pytest

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS, Arm, azimuth
from octoctrl.sim.body.layout import OCTOPUS_MUSCLES, Family, MuscleGroup, MuscleLayout
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import Plant
from octoctrl.sim.sources import Held
from octoctrl.sim.templates import Plateau


class Hexapus(Arm):
    layout = MuscleLayout.evenly(6)


class Bare(Arm):
    layout = MuscleLayout.evenly(8, oblique=False)


def tip_after(arm, group, duration=0.4):
    plant = Plant(arm)
    pull = Activation(templates=(Plateau(groups=(group,), level=0.3, rise=0.1),), layout=arm.layout)
    return plant.advance(pull, duration).points[-1, -1]


def test_octopus_layout_is_the_one_of_the_paper():
    assert MUSCLE_GROUPS == (*(f"LM{m}" for m in range(1, 9)), "R-OM", "L-OM", "TM")
    assert [azimuth(name) for name in LONGITUDINAL_GROUPS] == pytest.approx(np.arange(8) * np.pi / 4, rel=1e-15)
    assert [OCTOPUS_MUSCLES[name].hand for name in ("R-OM", "L-OM")] == [1, -1]
    assert OCTOPUS_MUSCLES.transverse.name == "TM" and OCTOPUS_MUSCLES.index("L-OM") == 9


def test_six_muscles_bend_towards_their_own_azimuths():
    arm = Hexapus()
    tips = [tip_after(arm, f"LM{m}") for m in (1, 2, 3)]
    for number, tip in enumerate(tips):
        angle = number * np.pi / 3
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        bend = tip[[0, 2]]
        assert bend @ along > 0.01
        # The arm is its own mirror image at the plane of each muscle.
        assert abs(bend @ across) < 1e-9
        assert [bend @ along, tip[1]] == pytest.approx([tips[0][0], tips[0][1]], abs=1e-9)


def test_sections_count_the_muscles_of_the_layout():
    six, eight = (arm.section(np.array([0.0])) for arm in (Hexapus(), Arm()))
    share = {count: np.sin(np.pi / count) / (1 - np.sin(np.pi / count)) for count in (6, 8)}
    assert six.muscle_radius / six.cord_radius == pytest.approx(share[6])
    for section, count in ((six, 6), (eight, 8)):
        cord, muscle, _, _ = section.areas
        assert cord + count * muscle == pytest.approx(0.62 * np.pi * 0.012**2)
        assert section.masses[1] == pytest.approx(1261.238 * count * muscle)
    assert Hexapus().fingerprint != Arm().fingerprint


def test_an_arm_without_oblique_muscles():
    arm = Bare()
    plant = Plant(arm)
    assert arm.section(np.array([0.0])).masses[3] == 0.0
    with pytest.raises(OctoctrlError, match="unknown muscle group 'R-OM'"):
        Activation(templates=(Plateau(groups=("R-OM",), level=0.1),), layout=arm.layout)
    levels = np.zeros(9)
    levels[arm.layout.index("TM")] = 0.2
    recording = plant.advance(Held(held=levels, layout=arm.layout), 0.5)
    assert recording.levels.shape[1] == 9
    # Rings alone lengthen the arm, straight ahead.
    assert recording.points[-1, -1] == pytest.approx([0.0, recording.points[-1, -1, 1], 0.0], abs=1e-12)
    assert recording.points[-1, -1, 1] > 1.01 * arm.length


def test_levels_of_another_layout_are_refused():
    with pytest.raises(OctoctrlError, match=r"gave shape \(\d+, 11, 48\) for \d+ instants, 9 groups"):
        Plant(Hexapus()).advance(Activation(), 0.1)


LM = [MuscleGroup(name=f"LM{m}", family=Family.LONGITUDINAL, azimuth=m) for m in range(4)]
TM = MuscleGroup(name="TM", family=Family.TRANSVERSE)


@pytest.mark.parametrize("make, message", [
    (lambda: MuscleGroup(name="OM", family=Family.OBLIQUE), "OM: hand=0; oblique groups have hand 1 or -1, all others 0"),
    (lambda: MuscleGroup(name="LM1", family=Family.LONGITUDINAL, hand=1), "LM1: hand=1; oblique groups have hand 1 or -1, all others 0"),
    (lambda: MuscleLayout(groups=(*LM, LM[0], TM)), "two muscle groups are called LM0; give each its own name"),
    (lambda: MuscleLayout(groups=tuple(LM)), "0 transverse groups: exactly 1 is needed"),
    (lambda: MuscleLayout(groups=(*LM[:2], TM)), "2 longitudinal muscles: at least 3 are needed around the nerve cord"),
    (
        lambda: MuscleLayout(groups=(*LM, TM, *(MuscleGroup(name=n, family=Family.OBLIQUE, hand=1) for n in "AB"))),
        "oblique groups A and B have one hand, 1: at most one group of each hand is possible",
    ),
    (lambda: OCTOPUS_MUSCLES["LM9"], "unknown muscle group 'LM9'"),
])  # fmt: skip
def test_layouts_that_cannot_be(make, message):
    with pytest.raises(OctoctrlError, match=message):
        make()
