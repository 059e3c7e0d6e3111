"""Two threads for one full arm: the same bits as one, systems from both ends, the barrier, and ends that both threads reach."""

import os
import threading
import time

import numpy as np
import pytest
from scipy.linalg import solve_banded

from octoctrl.sim.activation import Activation, Plateau
from octoctrl.sim.assembly.core import AssemblyCore
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.meeting_kernels import APART, LEFT, Crew, cores, meet, together
from octoctrl.sim.assembly.parts import halves, whole
from octoctrl.sim.assembly.system_kernels import two_ended
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.body.grid import AssemblyGrid
from octoctrl.sim.compiler import kernel
from octoctrl.sim.errors import OctoctrlError, OctoctrlWarning, PlantUnstableError
from octoctrl.sim.plants import make_plant
from octoctrl.sim.scene.scene import Scene

pytestmark = pytest.mark.filterwarnings("ignore:threads=2, but this process has one core")
MOVING = Activation(templates=(Plateau(groups=("R-OM", "LM1", "TM"), level=0.3, rise=0.05),))
GRID = AssemblyGrid(rings=180)


@kernel
def take_turns(shared, seen, turns, crew):
    """Each thread writes its turn, and when both have met sees whether the other has."""
    for turn in range(turns):
        shared[crew.number] = turn
        meet(crew)
        seen[crew.number] += shared[1 - crew.number] == turn
        meet(crew)
    return crew.number


@kernel
def gate(done, crew):
    """Do something, unless the other thread has left."""
    meet(crew)
    if not crew.counts[LEFT]:
        done[crew.number] = 1


def test_parts_leave_no_lane_out_and_share_none():
    for rings in (8, 11, 12, 13, 16, 17, 29, 180, 400):
        grid = AssemblyGrid(rings=rings)
        low, high = halves(grid)
        for first, last in (("low", "high"), ("first", "last"), ("node", "behind"), ("helix_first", "helix_last"), ("met", "unmet")):
            ends = [(int(getattr(part, first)), int(getattr(part, last))) for part in (low, high, whole(grid))]
            assert ends[0][0] == ends[2][0] and ends[0][1] == ends[1][0] and ends[1][1] == ends[2][1], (rings, first)
            assert ends[0][0] < ends[0][1] < ends[1][1], (rings, first)
        assert (low.first, high.last, high.behind) == (1, rings + 1, rings + 2)
        assert grid.lanes % 16 == 0 and (grid.middle % 16 == 0 or rings <= 16)


def test_threads_meet_at_every_turn():
    shared, seen = np.full(2, -1), np.zeros(2, dtype=np.int64)
    assert together(take_turns, halves(GRID), (shared, seen, 20000)) == 0
    assert seen.tolist() == [20000, 20000]


def test_a_thread_that_leaves_before_it_begins_keeps_the_other_from_beginning():
    done = np.zeros(2, dtype=np.int64)
    gate(done, Crew(whole(GRID), 0, 1, np.zeros(3 * APART, dtype=np.int64), np.zeros((1, 3), dtype=np.int64)))
    assert done.tolist() == [1, 0]

    class Interrupted:
        signatures = gate.signatures

        def __call__(self, done, crew):
            if crew.number == 0:
                raise KeyboardInterrupt
            gate(done, crew)

    done[:] = 0
    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        together(Interrupted(), halves(GRID), (done,))
    assert done.tolist() == [0, 0] and threading.active_count() == before


def test_what_goes_wrong_in_the_other_thread_comes_to_the_caller():
    class Failing:
        signatures = gate.signatures

        def __call__(self, done, crew):
            if crew.number == 1:
                raise OctoctrlError("of the other thread")
            gate(done, crew)

    with pytest.raises(OctoctrlError, match="of the other thread"):
        together(Failing(), halves(GRID), (np.zeros(2, dtype=np.int64),))


@pytest.mark.parametrize("middle", [2, 9, 57, 60])
def test_systems_from_both_ends_agree_with_a_banded_solver(middle):
    n, systems, width, generator = 60, 3, 64, np.random.default_rng(5)
    rows = {name: np.uint64(place * systems * width) for place, name in enumerate(("SCALE", "COUPLING", "IMPULSE", "RATE"))}
    eliminate, substitute = two_ended(rows, "COUPLING")
    buffer = generator.standard_normal(4 * systems * width)  # in the places around a system too
    scale, coupling, impulse, _ = buffer.reshape(4, systems, width)
    scale[:] = 2.5 + generator.random(scale.shape)
    banded = np.zeros((systems, 3, n))
    banded[:, 0, 1:] = banded[:, 2, :-1] = coupling[:, 1:n]
    banded[:, 1] = scale[:, 1 : n + 1]
    wanted = np.stack([solve_banded((1, 1), banded[s], impulse[s, 1 : n + 1]) for s in range(systems)])
    system = [np.uint64(value) for value in (middle, 0, width)]
    again = buffer.copy()
    ends = [np.uint64(value) for value in (1, middle, n + 1)]
    for stage in (eliminate, substitute):
        stage(buffer, ends[0], ends[2], *system, systems)
        for first, last in ((ends[1], ends[2]), (ends[0], ends[1])):  # halves, the second first
            stage(again, first, last, *system, systems)
    np.testing.assert_allclose(impulse[:, 1 : n + 1], wanted, rtol=1e-12, atol=1e-13)
    assert np.array_equal(again, buffer)
    assert not impulse[:, 0].any() and not impulse[:, n + 1].any()


@pytest.mark.parametrize("precision", ["double", "mixed"])
def test_two_threads_give_the_bits_of_one(precision):
    one, two = (make_plant("assembly-coarse", precision=precision, threads=threads, record_every=1) for threads in (1, 2))
    runs = [plant.advance(MOVING, 0.04) for plant in (one, two)]
    assert np.abs(runs[0].points[-1] - runs[0].points[0]).max() > 1e-3
    for name in ("points", "frames", "stretch"):
        assert np.array_equal(*(getattr(run, name) for run in runs)), name
    for name, values in runs[0].series.items():
        assert np.array_equal(values, runs[1].series[name]), name
    for name, values in one.state().items():
        assert np.array_equal(values, two.state()[name]), name
    assert np.array_equal(one.core.pressure(), two.core.pressure())


@pytest.mark.parametrize("node", [20, 200, 340])
def test_what_stops_one_half_of_the_arm_stops_both_threads(node):
    texts, places = [], []
    for threads in (1, 2):
        plant = make_plant("assembly-coarse", threads=threads)
        plant.advance(MOVING, 0.01)
        plant.core.rods.oblique(R.V2, nodes=True)[6, node] = 5000.0  # m/s, which no step survives
        with pytest.raises(PlantUnstableError) as caught:
            plant.advance(MOVING, 0.01)
        texts.append(str(caught.value))
        places.append((caught.value.time, caught.value.recording.time[-1]))
        assert plant.time == pytest.approx(0.01)
    assert texts[0] == texts[1] and places[0] == places[1]


def test_two_threads_on_one_core_cost_less_than_twice_as_much():
    if not hasattr(os, "sched_setaffinity"):
        pytest.skip("cores cannot be chosen here")
    plants = [make_plant("assembly-coarse", threads=threads) for threads in (1, 2)]
    allowed = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(allowed)})
        spent = [[], []]
        for _ in range(5):
            for plant, times in zip(plants, spent, strict=True):
                begin = time.process_time()
                plant.advance(MOVING, 0.005)
                times.append(time.process_time() - begin)
    finally:
        os.sched_setaffinity(0, allowed)
    assert min(spent[1]) < 2 * min(spent[0])


def test_a_process_with_one_core_is_told():
    if not hasattr(os, "sched_setaffinity"):
        pytest.skip("cores cannot be chosen here")
    allowed = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(allowed)})
        assert cores() == 1
        with pytest.warns(OctoctrlWarning, match="threads=2, but this process has one core, on which they take turns"):
            AssemblyCore(Arm.octopus(), Scene(), ring_nodes=8, threads=2)
    finally:
        os.sched_setaffinity(0, allowed)
