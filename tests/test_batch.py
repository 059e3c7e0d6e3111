"""Many arms side by side: same bits as alone, one failure stops nobody else, interruption keeps what was done."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.plants import Plant
from octoctrl.sim.running.batch import simulate_batch
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.templates import Plateau


def drive(*groups, level=0.5, rise=0.1, onset=0.0):
    return Activation(templates=(Plateau(groups=groups, level=level, rise=rise, onset=onset),))


def same(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("time", "points", "frames", "stretch", "levels"))


def unstable():
    plant = Plant()
    plant.set_steps(plant.steps // 2)  # over the stability limit, behind the back of its check
    return plant


CASES = st.tuples(
    st.integers(8, 64), st.floats(1.0, 20.0), st.floats(0.0, 3.0), st.sets(st.sampled_from(MUSCLE_GROUPS), min_size=1), st.floats(0.0, 1.0)
)


@settings(max_examples=15, deadline=None)
@given(cases=st.lists(CASES, min_size=1, max_size=5), threads=st.integers(1, 4))
def test_every_arm_moves_as_it_would_alone(cases, threads):
    def made():
        return [Plant(Arm.octopus(elements=n, taper=taper), Scene.free(factor=water)) for n, taper, water, _, _ in cases]

    activations = [drive(*sorted(groups), level=level) for *_, groups, level in cases]

    def alone(plant, activation):
        try:
            return plant.advance(activation, 0.1)
        except PlantUnstableError as error:  # a coarse arm at full level may curl tighter than its elements resolve
            return error.recording

    together = simulate_batch(made(), activations, 0.1, threads=threads)
    expected = [alone(plant, activation) for plant, activation in zip(made(), activations, strict=True)]
    assert all(same(one, other) for one, other in zip(expected, together.recordings, strict=True))
    assert [failure.index for failure in together.failures] == [i for i, arm in enumerate(expected) if not arm.complete]
    assert together.throughput > 0


def test_a_second_call_continues_the_batch():
    plants, whole = [Plant(), Plant()], Plant()
    activations = [drive("LM1"), drive("R-OM")]
    simulate_batch(plants, activations, 0.3)
    second = simulate_batch(plants, activations, 0.2)
    expected = whole.advance(activations[1], 0.5)
    assert np.array_equal(second.recordings[1].points, expected.points[30:]) and plants[1].time == whole.time


def test_one_failure_is_named_and_stops_nobody_else():
    activation = drive("LM1", level=1.0, rise=0.05, onset=0.5)
    plants = [Plant(), unstable(), Plant(Arm.octopus(elements=24)), unstable()]
    result = simulate_batch(plants, activation, 2.0, threads=2)
    assert [failure.index for failure in result.failures] == [1, 3]
    failure, recording = result.failures[0], result.recordings[1]
    assert f"arm 1 at t={failure.time:.3f} s: element {failure.element} of the arm {failure.mechanism}" == str(failure)
    assert failure.mechanism in failure.message and "unstable at t=" in failure.message
    assert not recording.complete and 0.49 < recording.time[-1] < failure.time and np.isfinite(recording.points).all()
    for index, elements in ((0, 48), (2, 24)):
        assert result.recordings[index].complete
        assert same(result.recordings[index], Plant(Arm.octopus(elements=elements)).advance(activation, 2.0))
    with pytest.raises(PlantUnstableError, match="2 of 4 arms failed; arm 1: unstable at") as caught:
        result.raise_if_failed()
    assert caught.value.recording is recording and caught.value.element == failure.element


def test_interruption_keeps_what_was_done():
    plants = [Plant() for _ in range(6)]

    def interrupt(done):
        if done == 2:
            raise KeyboardInterrupt

    result = simulate_batch(plants, drive("L-OM"), 1.0, threads=1, progress=interrupt)
    complete = [recording.complete for recording in result.recordings]
    assert complete.count(True) in (2, 3) and not complete[-1] and not result.failures
    for plant, recording in zip(plants, result.recordings, strict=True):
        assert recording.time[-1] == pytest.approx(plant.time)
        assert np.array_equal(recording.points[-1], plant.observe().points)
        assert recording.complete or "interrupted at t=" in recording.note


def test_progress_counts_arms():
    seen = []
    simulate_batch([Plant() for _ in range(3)], Activation(), 0.05, progress=seen.append)
    assert seen == [1, 2, 3]


TWICE = Plant()
BAD = [
    (([], Activation(), 0.1), {}, "the batch has no plants; give at least one"),
    (([Plant(), Plant()], [Activation()], 0.1), {}, "2 plants but 1 activations; give one for each, or a single Activation for all"),
    (([TWICE, TWICE], Activation(), 0.1), {}, "a plant stands twice in the batch; make one for each arm"),
    (([Plant()], Activation(), 0.1), {"threads": 0}, "threads=0 is outside >= 1"),
    (
        ([Plant()], Activation(), 0.012),
        {},
        "arm 0 of the batch: duration=0.012 s: needs a positive multiple of the sample interval 0.005 s",
    ),
]


@pytest.mark.parametrize(("arguments", "options", "message"), BAD, ids=range(len(BAD)))
def test_bad_input_is_refused_in_a_sentence(arguments, options, message):
    with pytest.raises(OctoctrlError) as caught:
        simulate_batch(*arguments, **options)
    assert str(caught.value) == message
