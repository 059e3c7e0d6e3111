"""Two threads for one full arm: the same bits as one, systems from both ends, the barrier, and ends that both threads reach."""

import os
import pickle
import threading
import time

import numpy as np
import pytest
from scipy.linalg import solve_banded

from octoctrl.sim.activation import Activation
from octoctrl.sim.assembly.core import AssemblyCore
from octoctrl.sim.assembly.halves import Halves
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.meeting_kernels import LEFT, cores, crews, exchange, meet, together
from octoctrl.sim.assembly.parts import halves, whole
from octoctrl.sim.assembly.system_kernels import two_ended
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.body.grid import AssemblyGrid
from octoctrl.sim.compiler import kernel
from octoctrl.sim.contact.surroundings import Touch
from octoctrl.sim.errors import OctoctrlError, OctoctrlWarning, PlantUnstableError
from octoctrl.sim.plants import make_plant
from octoctrl.sim.scene.loads import SpreadLoad
from octoctrl.sim.scene.objects import Sphere
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.scene.supports import Free
from octoctrl.sim.templates import Plateau

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
def send(own, stages, crew):
    """Exchange in every stage, and each thread adds one to what it sends."""
    for stage in range(stages):
        exchange(own, crew, stage)
        own[0] += 1.0


@kernel
def gate(done, crew):
    """Do something, unless the other thread has left."""
    meet(crew)
    if not crew.counts[LEFT]:
        done[crew.number] = 1


def jobs(*arguments):
    """The same of two threads that exchange nothing."""
    return tuple((*arguments, crew) for crew in crews(halves(GRID), np.float64))


def test_parts_leave_no_lane_out_and_share_none():
    for rings in (8, 11, 12, 13, 16, 17, 29, 180, 400):
        grid = AssemblyGrid(rings=rings)
        low, high = halves(grid)
        for first, last in (("first", "last"), ("node", "behind"), ("helix_first", "helix_last"), ("met", "unmet")):
            wide = 2 if first == "helix_first" else 1
            ends = [[int(getattr(part, name)) + wide * int(part.before) for name in (first, last)] for part in (low, high, whole(grid))]
            assert ends[0][0] == ends[2][0] and ends[0][1] == ends[1][0] and ends[1][1] == ends[2][1], (rings, first)
            assert ends[0][0] < ends[0][1] < ends[1][1], (rings, first)
        assert (low.first, high.last + high.before, high.behind + high.before) == (1, rings + 1, rings + 2)
        assert (low.start, low.stop, high.start) == (0, grid.middle, 1) and high.behind <= high.stop
        assert low.middle == low.last and high.middle == high.first and abs(int(low.last - low.first) - int(high.last - high.first)) <= 1
        # The border stands beside, and a helix has room behind the last ring.
        assert grid.half.lanes % 16 == 0 and all(part.behind + 2 <= part.high == grid.half.lanes for part in (low, high))


def test_threads_meet_at_every_turn():
    shared, seen = np.full(2, -1), np.zeros(2, dtype=np.int64)
    assert together(take_turns, jobs(shared, seen, 20000)) == 0
    assert seen.tolist() == [20000, 20000]


def test_a_thread_that_leaves_before_it_begins_keeps_the_other_from_beginning():
    done = np.zeros(2, dtype=np.int64)
    gate(done, *crews((whole(GRID),), np.float64))
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
        together(Interrupted(), jobs(done))
    assert done.tolist() == [0, 0] and threading.active_count() == before


def test_what_goes_wrong_in_the_other_thread_comes_to_the_caller():
    class Failing:
        signatures, compile = gate.signatures, gate.compile  # when it is the first that compiles it, too

        def __call__(self, done, crew):
            if crew.number == 1:
                raise OctoctrlError("of the other thread")
            gate(done, crew)

    with pytest.raises(OctoctrlError, match="of the other thread"):
        together(Failing(), jobs(np.zeros(2, dtype=np.int64)))


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


def test_threads_take_what_the_other_sends():
    own = [np.array([10.0, 0.0, 1.0]), np.array([20.0, 0.0, 2.0])]
    sends, takes, bounds = np.array([[0, 2, 0]] * 2), np.array([[1, 1, 1]] * 2), np.array([0, 1, 2, 3])
    together(send, tuple((mine, 3, crew) for mine, crew in zip(own, crews(halves(GRID), np.float64, (sends, takes, bounds)), strict=True)))
    assert [mine.tolist() for mine in own] == [[13.0, 22.0, 1.0], [23.0, 12.0, 2.0]]


def test_halves_hold_the_arm_and_give_it_back():
    core = AssemblyCore(Arm.octopus(), Scene(), ring_nodes=8)
    rods, cuts = core.rods, {"straight": 90, "oblique": 180, "spoke": 90, "crossing": 90, "ring": 90}

    def rows(buffer):
        """One row of each family, along the arm."""
        found = {view: getattr(buffer, view)(3, **{"nodes": True} if view in ("straight", "oblique") else {}) for view in cuts}
        return found | {"ring": found["ring"].T}

    rods.flat[:] = np.random.default_rng(2).random(rods.flat.size)
    memory, before = pickle.loads(pickle.dumps((rods, Halves(rods, core.geometry))))[1], {k: v.copy() for k, v in rows(rods).items()}
    rods = memory._rods
    memory.renew()
    with memory.lent():
        low, high = map(rows, memory.buffers)
        for view, cut in cuts.items():
            found = np.concatenate([low[view][:, :cut], high[view][:, : before[view].shape[1] - cut]], axis=1)
            assert np.array_equal(found, before[view]), view
        memory.workers[0][0][:] += 1.0  # which reaches into the other half
    for view, values in rows(rods).items():
        assert np.array_equal(values, before[view] + 1.0), view


def test_places_in_halves_are_those_of_the_arm():
    ball = Sphere(name="ball", radius=0.01, position=(0.1, 0.1, 0.0))
    core = AssemblyCore(Arm.octopus(), Scene(objects=(ball,), self_contact=True), ring_nodes=8)
    rods, memory, straight = core.rods, Halves(core.rods, core.geometry), core.grid.straight_rods
    rods.open_rods[R.X1], rods.rings[R.X1] = np.arange(rods.open_rods.shape[1]), np.arange(rods.rings.shape[1])
    lanes = memory.grid.lanes
    memory.renew()
    with memory.lent():
        for part, (buffer, (_, _, crew)) in enumerate(zip(memory.buffers, memory.workers, strict=True)):
            own = np.arange(int(crew.part.start), int(crew.part.stop))
            along = np.arange(2 * own[0], 2 * own[-1] + 2)
            for family, places in ((0, 3 * lanes + own), (0, (straight + 4) * lanes + along), (1, 7 * lanes + own)):
                values = (buffer.rings if family else buffer.open_rods)[R.X1]
                assert [memory.where(family, int(place), part) for place in places] == values[places].tolist()
        for points in (core._around.points, core._folds.points):
            assert np.array_equal(memory.workers[0][0][memory.points(points).place], points.place)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["mixed", "double"])
def test_two_threads_give_the_bits_of_one(precision):
    one, two = (make_plant("assembly-coarse", precision=precision, threads=threads, record_every=1) for threads in (1, 2))
    runs = [plant.advance(MOVING, 0.04) for plant in (one, two)]
    assert np.abs(runs[0].points[-1] - runs[0].points[0]).max() > 1e-3
    for name in ("points", "frames", "stretch"):
        assert np.array_equal(*(getattr(run, name) for run in runs)), name
    for name, values in runs[0].series.items():
        assert np.array_equal(values, runs[1].series[name]), name
    for row in range(R.LENGTH):
        for view in ("straight", "oblique"):
            assert np.array_equal(*(getattr(plant.core.rods, view)(row, nodes=row < R.Q11) for plant in (one, two))), (R(row).name, view)
        assert np.array_equal(*(plant.core.rods.ring(row) for plant in (one, two))), R(row).name
    assert np.array_equal(one.core.pressure(), two.core.pressure())


@pytest.mark.slow
def test_two_threads_touch_and_carry_as_one_does():
    arm, around = Arm.octopus(), {"right": (1.0, 0.0), "left": (-1.0, 0.0), "up": (0.0, 1.0), "down": (0.0, -1.0)}
    away = float(arm.section(0.1).outer_radius) + 0.0105
    balls = tuple(
        Sphere(name=name, radius=0.01, position=(away * x, 0.1, away * z), mass=0.004, support=Free(since=0.01))
        for name, (x, z) in around.items()
    )
    weight = SpreadLoad(force=(0.0, 0.0, -0.1), window=(0.06, 0.18), follower=True)
    runs = []
    for threads in (1, 2):
        plant = make_plant("assembly-coarse-mixed", arm, Scene(objects=balls, loads=(weight,)), threads=threads, record_every=1)
        runs.append(plant.advance(MOVING, 0.06))
    assert max(Touch.of(runs[0].series, name).loaded.max() for name in around) > 0
    for name in ("points", "frames"):
        assert np.array_equal(*(getattr(run, name) for run in runs)), name
    for name, values in runs[0].series.items():
        assert np.array_equal(values, runs[1].series[name]), name


@pytest.mark.slow
@pytest.mark.parametrize("node", [20, 200, 340])
def test_what_stops_one_half_of_the_arm_stops_both_threads(node):
    texts, places = [], []
    for threads in (1, 2):
        plant = make_plant("assembly-coarse-mixed", threads=threads)
        plant.advance(MOVING, 0.01)
        plant.core.rods.oblique(R.V2, nodes=True)[6, node] = 5000.0  # m/s, which no step survives
        with pytest.raises(PlantUnstableError) as caught:
            plant.advance(MOVING, 0.01)
        texts.append(str(caught.value))
        places.append((caught.value.time, caught.value.recording.time[-1]))
        assert plant.time == pytest.approx(0.01)
    assert texts[0] == texts[1] and places[0] == places[1]


@pytest.mark.slow
def test_two_threads_on_one_core_cost_less_than_twice_as_much():
    if not hasattr(os, "sched_setaffinity"):
        pytest.skip("cores cannot be chosen here")
    plants = [make_plant("assembly-coarse-mixed", threads=threads) for threads in (1, 2)]
    allowed = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(allowed)})
        spent = [[], []]
        while len(spent[1]) < 3 or (min(spent[1]) > 2 * min(spent[0]) and len(spent[1]) < 20):  # others may be busy on that core
            for plant, times in zip(plants, spent, strict=True):
                begin = time.process_time()
                plant.advance(MOVING, 0.02)
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
