"""What a scene does not need is left out, and leaving it out changes nothing."""

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.plants import Plant
from octoctrl.sim.rod.core import RodCore
from octoctrl.sim.rod.layout import STATE_ROWS
from octoctrl.sim.running.plant import Plant as CorePlant
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.templates import Plateau


class Unskipped(RodCore):
    """A rod that evaluates the active law of every group and the drag of the water, needed or not."""

    def start(self, clock):
        super().start(clock)
        self._scalars = self._scalars._replace(wet=True)

    @staticmethod
    def _active(levels):
        return np.ones((len(levels) - 1, len(MUSCLE_GROUPS)), dtype=bool)


def motions(activation, duration, **settings):
    """Whole states after a run with everything skipped that can be, and with nothing skipped."""
    usual = Plant(**settings)
    plants = usual, CorePlant(Unskipped(usual.arm, usual.scene), usual.clock)
    for plant in plants:
        plant.advance(activation, duration)
    return [plant.core.rows[:STATE_ROWS, : plant.elements + 2].copy() for plant in plants]


def test_groups_at_rest_are_left_out_without_a_changed_bit():
    # Each group pulls in its own part of the run, so that every sample skips others.
    templates = tuple(
        Plateau(groups=(group,), level=0.3, onset=0.08 * index, rise=0.02, offset=0.08 * index + 0.1)
        for index, group in enumerate(MUSCLE_GROUPS)
    )
    skipped, whole = motions(Activation(templates=templates), 1.2)
    assert np.array_equal(skipped, whole)
    assert np.abs(skipped[:3]).max() > 0.05


def test_drag_is_left_out_in_a_vacuum_without_a_changed_bit():
    push = Activation(templates=(Plateau(groups=("LM1", "R-OM"), level=0.2, rise=0.1),))
    for scene in (Scene(water=None), Scene.free(factor=0.0)):
        skipped, whole = motions(push, 0.4, scene=scene)
        assert np.array_equal(skipped, whole)
        assert np.abs(skipped[:3]).max() > 0.05


def test_a_group_that_pulls_is_not_left_out():
    levels = np.zeros((4, len(MUSCLE_GROUPS), 5))
    levels[2, 3, 4] = 1e-9
    found = RodCore._active(levels)
    expected = np.zeros((3, len(MUSCLE_GROUPS)), dtype=bool)
    expected[1:, 3] = True
    assert np.array_equal(found, expected)
