"""The one entrance of levels: what a source may answer, and that nothing else reaches compiled code."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.body.layout import OCTOPUS_MUSCLES
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import Plant, make_plant
from octoctrl.sim.sources import Corrected, Held, sampled
from octoctrl.sim.templates import Plateau

EDGES = np.linspace(0.0, 0.2, 9)
PARTITIONS = {"arm": EDGES, "oblique": np.linspace(0.0, 0.2, 16)}


class Answers:
    """A source that answers what it is given, however it is asked."""

    def __init__(self, answer):
        self.answer = answer

    def levels(self, times, edges):
        return self.answer(len(times), len(edges) - 1)


def test_every_partition_is_asked_once_with_its_own_cells():
    asked = []

    class Source:
        def levels(self, times, edges):
            asked.append(len(edges) - 1)
            return np.zeros((len(times), 11, len(edges) - 1))

    found = sampled(Source(), np.arange(3.0), PARTITIONS, OCTOPUS_MUSCLES)
    assert asked == [8, 15] and {name: levels.shape for name, levels in found.items()} == {"arm": (3, 11, 8), "oblique": (3, 11, 15)}


def test_levels_come_as_compiled_code_reads_them():
    found = sampled(Answers(lambda t, n: np.zeros((n, 11, t), dtype=np.float32).T), np.arange(3.0), PARTITIONS, OCTOPUS_MUSCLES)
    assert all(levels.flags.c_contiguous and levels.dtype == np.float64 for levels in found.values())


def shape(found, cells, name):
    return (
        f"Answers.levels gave shape {found} for 3 instants, 11 groups and the {cells} cells of the partition '{name}'; "
        f"(3, 11, {cells}) is needed"
    )


NONE = "activation levels of Answers: found {}; numbers from 0 to 1 are needed"
BAD = [
    (Answers(lambda t, n: np.zeros((t, 11, 8))), shape("(3, 11, 8)", 15, "oblique")),
    (Answers(lambda t, n: np.zeros((t, 10, n))), shape("(3, 10, 8)", 8, "arm")),
    (Answers(lambda t, n: np.zeros((1, 11, n))), shape("(1, 11, 8)", 8, "arm")),
    (Answers(lambda t, n: 0.3), shape("()", 8, "arm")),
    (Answers(lambda t, n: np.full((t, 11, n), np.nan)), "activation levels span nan…nan near t=0.00 s; allowed is 0…1"),
    (Answers(lambda t, n: np.full((t, 11, n), 1.2)), "activation levels span 1.2…1.2 near t=0.00 s; allowed is 0…1"),
    (Answers(lambda t, n: np.full((t, 11, n), -0.1)), "activation levels span -0.1…-0.1 near t=0.00 s; allowed is 0…1"),
    (Answers(lambda t, n: None), NONE.format("NoneType None")),
    (Answers(lambda t, n: np.zeros((t, 11, n), dtype=complex)[0, 0, 0]), NONE.format("complex128 0j")),
    (0.3, "the activation is float, which has no levels(times, edges); give an Activation, or levels that are held to Plant.step"),
]


@pytest.mark.parametrize(("source", "message"), BAD, ids=range(len(BAD)))
def test_anything_else_is_refused_in_a_sentence(source, message):
    with pytest.raises(OctoctrlError) as caught:
        sampled(source, np.arange(3.0), PARTITIONS, OCTOPUS_MUSCLES)
    assert str(caught.value) == message


def test_full_arm_does_not_read_beyond_the_levels_that_it_is_given():
    """Cells of the muscles along the arm where those of the helices are asked for: the kernel would read on in foreign memory."""
    plant = make_plant("assembly", ring_nodes=8)
    with pytest.raises(OctoctrlError, match=r"gave shape \(\d, 11, 180\) .* 359 cells of the partition 'oblique'"):
        plant.advance(Answers(lambda t, n: np.full((t, 11, 180), 0.2)), 5 * plant.sample_interval)
    with pytest.raises(OctoctrlError, match=r"gave shape \(\d, 11, 40\) .* 48 cells of the partition 'arm'"):
        Plant().advance(Answers(lambda t, n: np.full((t, 11, 40), 0.2)), 0.025)


@pytest.mark.parametrize("make", [Plant, lambda **options: make_plant("assembly", ring_nodes=8, **options)], ids=["rod", "assembly-coarse"])
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"record_every": 0}, "record_every=0 is outside >= 1"),
        ({"record_every": -1}, "record_every=-1 is outside >= 1"),
        ({"record_every": 1.5}, "record_every: expected a whole number, found float 1.5"),
        ({"record_every": True}, "record_every: expected a whole number, found bool True"),
        ({"sample_interval": 0.0}, "sample_interval=0 s is outside 0.0001…0.1 s"),
        ({"sample_interval": float("nan")}, "sample_interval is nan; a finite number is needed"),
        ({"sample_interval": "5 ms"}, "sample_interval: expected a number in s, found the string '5 ms'"),
    ],
    ids=str,
)
def test_settings_of_the_clock_are_checked(make, wrong, message):
    with pytest.raises(OctoctrlError) as caught:
        make(**wrong)
    assert str(caught.value) == message


def test_whole_numbers_of_numpy_count():
    assert Plant(record_every=np.int64(3)).record_every == 3


# What holds still


@pytest.mark.parametrize("answer", [{"LM2": 0.3, "TM": 0.1}, [0, 0.3, *[0] * 8, 0.1], np.outer([0, 0.3, *[0] * 8, 0.1], np.ones(8))])
def test_held_levels_are_those_given_at_every_instant(answer):
    found = Held.of(answer, EDGES).levels(np.arange(4.0), EDGES)
    wanted = np.zeros((4, 11, 8))
    wanted[:, 1], wanted[:, 10] = 0.3, 0.1
    assert np.array_equal(found, wanted)


@given(st.lists(st.floats(0, 1), min_size=8, max_size=8), st.lists(st.floats(1e-3, 1.0), min_size=1, max_size=30))
def test_held_levels_keep_their_integral_on_any_partition(levels, lengths):
    """Mean over the arm: cells between other edges take what they cover."""
    others = 0.2 * np.concatenate([[0.0], np.cumsum(lengths)]) / np.sum(lengths)
    found = Held.of({"L-OM": levels}, EDGES).levels(np.zeros(1), others)[0, 9]
    assert found @ np.diff(others) == pytest.approx(np.dot(levels, np.diff(EDGES)), abs=1e-12)
    assert found.min() >= min(levels) - 1e-12 and found.max() <= max(levels) + 1e-12


HELD = [
    ({"LM9": 0.3}, f"feedback: there is no muscle group 'LM9'; did you mean 'LM8'? ({', '.join(MUSCLE_GROUPS)})"),
    ({"LM2": [0.1, 0.2]}, "feedback: LM2 has shape (2,); one level or 8, one for each cell, are needed"),
    ({"LM2": "full"}, "feedback: LM2: found str full; numbers from 0 to 1 are needed"),
    (np.zeros((11, 7)), "feedback: shape (11, 7); (11,), (11, n) or a dict of group to level is needed, n = 8 cells of the arm"),
    (0.3, "feedback: shape (); (11,), (11, n) or a dict of group to level is needed, n = 8 cells of the arm"),
    ([[0.1], [0.1, 0.2]], "feedback: found list [[0.1], [0.1, 0.2]]; numbers from 0 to 1 are needed"),
    (np.full(11, 1.4), "activation levels span 1.4…1.4 feedback; allowed is 0…1"),
]


@pytest.mark.parametrize(("answer", "message"), HELD, ids=range(len(HELD)))
def test_levels_that_cannot_be_held_are_refused(answer, message):
    with pytest.raises(OctoctrlError) as caught:
        Held.of(answer, EDGES, "feedback")
    assert str(caught.value) == message


def test_levels_by_cell_need_their_cells():
    with pytest.raises(OctoctrlError, match=r"levels of shape \(11, 8\) are held; \(11,\) is needed; levels by cell also need the edges"):
        Held(held=np.zeros((11, 8)))


# A correction on a clock


def test_corrected_levels_run_on_their_clock_and_stay_levels():
    activation = Activation(templates=(Plateau(groups=("LM1", "TM"), level=0.5, rise=1.0),))
    source = Corrected(
        activation=activation, begin=3.0, period=0.5, clock=(0.2, 0.2), groups=("TM",), before=np.array([0.0]), after=np.array([1.0])
    )
    found = source.levels(np.array([3.0, 3.25, 3.5]), EDGES)
    standing = activation.levels([0.2], EDGES)[0]
    assert np.array_equal(found[:, 0], np.repeat(standing[None, 0], 3, axis=0))
    assert found[:, 10, 0] == pytest.approx(np.clip(standing[10, 0] + np.array([0.0, 0.5, 1.0]), 0, 1))
    running = Corrected(activation=activation, begin=3.0, period=0.5, clock=(0.2, 0.7)).levels(np.array([3.0, 3.5]), EDGES)
    assert np.array_equal(running, activation.levels([0.2, 0.7], EDGES))


def test_held_source_moves_plants_of_every_partition_alike():
    arm = Arm.octopus()
    source = Held.of(np.full((11, 180), 0.1), np.linspace(0, arm.length, 181))
    plant = make_plant("assembly", arm, ring_nodes=8)
    recording = plant.advance(source, plant.sample_interval)
    assert np.array_equal(recording.levels, np.full((len(recording.time), 11, 180), 0.1))
    Plant(arm).advance(source, 0.01)
