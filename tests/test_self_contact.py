"""An arm that touches itself: what it keeps apart, what it conserves, and that nothing changes where it is not asked for."""

import copy

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.sim.assembly.contact_kernels import section_surface
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.contact.fold_kernels import fold_sweeps
from octoctrl.sim.contact.folds import APART
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.rod.contact_kernels import rod_surface
from octoctrl.sim.rod.layout import Row, stride_for
from octoctrl.sim.scene.scene import SELF_CONTACT


def spiral(level):
    """Three longitudinal muscles wind the arm up in a plane: tightly at 0.3, so that laps press the tip out of it."""
    return oc.Activation(templates=(oc.Wave(groups=("LM7", "LM8", "LM1"), level=level, speed=0.1, width=3e-3),))


SPIRAL = spiral(0.3)
ARM = oc.Arm.octopus()
MIDDLE = (ARM.edges[1:] + ARM.edges[:-1]) / 2
RADIUS = np.asarray(ARM.section(MIDDLE).outer_radius)


def plant(**options):
    return oc.make_plant("rod", scene=oc.Scene(self_contact=True), **options)


def closest(recording, every=10):
    """Least distance of two elements that are no neighbours over the sum of their radii, by plain NumPy."""
    apart = np.abs(MIDDLE[:, None] - MIDDLE) > APART * (RADIUS[:, None] + RADIUS)
    least = np.inf
    for points, stretch in zip(recording.points[::every], recording.stretch[::every], strict=True):
        centres, radius = (points[1:] + points[:-1]) / 2, RADIUS / np.sqrt(stretch)
        distance = np.linalg.norm(centres[:, None] - centres, axis=2) / (radius[:, None] + radius)
        least = min(least, distance[apart].min())
    return least


@pytest.fixture(scope="module")
def wound():
    return plant().advance(SPIRAL, 3.0)


def test_laps_lie_on_each_other_and_not_in_each_other(wound):
    assert closest(oc.make_plant("rod").advance(SPIRAL, 3.0)) < 0.5
    assert closest(wound) > 1.0
    force, deepest, loaded = wound.series[SELF_CONTACT].T
    assert deepest.max() < 0.004 * RADIUS[0] and force.max() > 5e-3 and loaded.max() >= 1


def test_half_the_step_winds_the_same_spiral():
    """As nearly as it does without contact."""
    off, forces = [], []
    for scene in (oc.Scene(), oc.Scene(self_contact=True)):
        made = oc.make_plant("rod", scene=scene)
        whole, half = (oc.make_plant("rod", scene=scene, dt=made.h / part).advance(spiral(0.24), 3.0) for part in (1, 2))
        off.append(np.linalg.norm(half.points - whole.points, axis=2).max(axis=1) / ARM.length)
        forces = [item.series[SELF_CONTACT][:, 0].max() for item in (whole, half) if scene.self_contact]
    assert off[1].max() < 1.2 * off[0].max() and off[1].max() < 0.02 and off[1][-1] < 1e-3
    assert forces[0] == pytest.approx(forces[1], rel=0.2) and forces[1] > 5e-3


def test_a_run_goes_on_bit_by_bit(wound):
    made = plant()
    first = made.advance(SPIRAL, 2.2)
    other = copy.deepcopy(made)
    second = other.advance(SPIRAL, 0.8)
    np.testing.assert_array_equal(second.points[-1], wound.points[-1])
    np.testing.assert_array_equal(second.series[SELF_CONTACT][0], first.series[SELF_CONTACT][-1])


def test_an_arm_that_does_not_meet_itself_moves_as_it_did():
    bend = oc.Activation(templates=(oc.Plateau(groups=("LM1",), level=0.2, window=(0.0, 0.1)),))
    made = plant()
    np.testing.assert_array_equal(made.advance(bend, 0.5).points, oc.make_plant("rod", dt=made.h).advance(bend, 0.5).points)


def exchanged(folds, nodes, velocities, inverse_mass, h, stretch=1.0):
    """Node velocities after one step's impulses: the law for every pair in turn, in plain NumPy, at a `stretch` of the elements."""
    points, velocities = folds.points, velocities.copy()
    k, xi = points.element.astype(int) - 1, points.share
    shares = np.zeros((len(xi), len(nodes)))
    shares[np.arange(len(xi)), k], shares[np.arange(len(xi)), k + 1] = 1 - xi, xi
    places, radius = shares @ nodes, points.radius / np.sqrt(np.broadcast_to(stretch, len(nodes) - 1))[k]
    for p in range(len(xi)):
        for q in range(int(folds.first[p]), len(xi)):
            line = places[p] - places[q]
            gap, normal = np.linalg.norm(line) - radius[p] - radius[q], line / np.linalg.norm(line)
            closing = normal @ ((shares[p] - shares[q]) @ velocities)
            mobility = (shares[p] ** 2 + shares[q] ** 2) @ inverse_mass
            stiffness = folds.stiffness * min(points.length[p], points.length[q])
            damping = 2 * np.sqrt(stiffness / mobility) if gap < 0 else 0.0
            a = h * (h * stiffness + damping)
            impulse = max(0.0, (-h * stiffness * gap - a * closing) / (1 + a * mobility))
            velocities += inverse_mass[:, None] * np.outer(shares[p] - shares[q], impulse * normal)
    return velocities


def test_an_impulse_keeps_momentum_and_is_what_the_law_says():
    """A hairpin whose legs lie in each other and move at random."""
    core, h = plant().core, 1e-4
    n, rows, along, nodes = core.elements, core.rows, core.partitions["arm"], slice(1, core.elements + 2)
    turn = 0.12
    hairpin = np.stack([np.where(along > turn, 0.011, 0.0), np.minimum(along, 2 * turn - along), 0.004 * np.sin(30 * along)], axis=1)
    rows[Row.X1 : Row.X3 + 1, nodes] = hairpin.T
    before = np.random.default_rng(1).normal(scale=0.1, size=(n + 1, 3))
    rows[Row.V1 : Row.V3 + 1, nodes] = before.T
    rows[Row.STRETCH, 1 : n + 1] = 1.0
    rows[Row.NODE_MOBILITY, nodes] = h / core.node_mass  # the base as well
    folds = core._folds.with_room(1)
    watch, part, note = fold_sweeps(rod_surface(stride_for(n)))
    watch(core.buffer, folds, 1e-3)
    part(core.buffer, folds, h)
    after = rows[Row.V1 : Row.V3 + 1, nodes].T
    gained = (after - before) * core.node_mass[:, None]
    size = np.abs(gained).max()
    assert size > 1e-6
    assert np.abs(gained.sum(axis=0)).max() < 1e-12 * size and np.abs(np.cross(hairpin, gained).sum(axis=0)).max() < 1e-12 * size
    stretch = np.linalg.norm(np.diff(hairpin, axis=0), axis=1) / np.diff(along)
    np.testing.assert_allclose(after, exchanged(folds, hairpin, before, 1 / core.node_mass, h, stretch), rtol=0, atol=1e-10)
    assert note(folds, 0, h, 1) and folds.notes[0, 2] > 5 and not folds.sums.any()


FIST = oc.Activation(templates=(oc.Plateau(groups=("LM7", "LM8", "LM1"), level=0.6, rise=0.1, window=(0.12, 0.2)),))


def full_arm(on=True, **options):
    return oc.make_plant("assembly-coarse-mixed", ARM, oc.Scene(self_contact=on), **options)


def nearest(recording):
    """As `closest`, of the nodes of the cord, with radii at rest."""
    along = np.linspace(0.0, ARM.length, recording.points.shape[1])
    radius = np.asarray(ARM.section(along).outer_radius)
    apart = np.abs(along[:, None] - along) > APART * (radius[:, None] + radius)
    distance = np.linalg.norm(recording.points[:, :, None] - recording.points[:, None], axis=3) / (radius[:, None] + radius)
    return distance[:, apart].min()


@pytest.mark.slow
def test_the_full_arm_keeps_its_laps_apart_and_goes_on_bit_by_bit():
    made = full_arm()
    first = made.advance(FIST, 0.6)
    state = made.state()
    second = made.advance(FIST, 0.2)
    assert min(nearest(first), nearest(second)) > 0.99
    force, deepest, loaded = np.concatenate([first.series[SELF_CONTACT], second.series[SELF_CONTACT]]).T
    assert deepest.max() < 0.02 * RADIUS[0] and force.max() > 5e-3 and loaded.max() >= 1
    again = full_arm()
    again.restore(state)
    np.testing.assert_array_equal(again.advance(FIST, 0.2).points[-1], second.points[-1])
    assert made.identity()["self_contact"] and "self_contact" not in full_arm(on=False).identity()


def test_sections_of_the_full_arm_keep_momentum_and_give_way_as_wholes():
    """A hairpin of cord and muscles whose legs lie in each other and move at random."""
    core, h = full_arm().core, 7e-5
    rods, folds, rng = core.rods, core._folds.with_room(1), np.random.default_rng(4)
    place, speed, mobility = (range(R.X1, R.X1 + 3), range(R.V1, R.V1 + 3), R.NODE_MOBILITY)
    count = folds.points.radius.size
    along, turn = np.linspace(0.0, ARM.length, count), 0.12
    hairpin = np.stack([np.where(along > turn, 0.008, 0.0), np.minimum(along, 2 * turn - along), np.zeros(count)], axis=1)
    shape = rods.straight(R.X1, nodes=True).shape
    offsets = np.stack([rods.straight(row, nodes=True) - [0.0, along][row == R.X1 + 1] for row in place])
    mass = rng.uniform(1e-5, 3e-5, shape)
    for axis, (x, v) in enumerate(zip(place, speed, strict=True)):
        rods.straight(x, nodes=True)[:] = hairpin[:, axis] + offsets[axis]
        rods.straight(R.LOW1 + axis, nodes=True)[:] = 0.0
        rods.straight(v, nodes=True)[:] = rng.normal(scale=0.1, size=shape)
    rods.straight(mobility, nodes=True)[:] = h / mass
    mass = h / rods.straight(mobility, nodes=True).astype(float)
    before = np.stack([rods.straight(v, nodes=True) for v in speed], axis=2).astype(float)
    watch, part, note = fold_sweeps(section_surface(core.grid))
    watch(rods.flat, folds, 1e-3)
    part(rods.flat, folds, h)
    after = np.stack([rods.straight(v, nodes=True) for v in speed], axis=2).astype(float)
    places = np.stack([rods.straight(x, nodes=True) for x in place], axis=2).astype(float)
    gained = mass[:, :, None] * (after - before)
    size = np.abs(gained).max()
    assert size > 1e-7 and np.abs(gained.sum(axis=(0, 1))).max() < 1e-4 * size, "in single precision"
    assert np.abs(np.cross(places, gained).sum(axis=(0, 1))).max() < 1e-4 * size
    kicks = after - before
    assert np.abs(kicks - kicks.mean(axis=0)).max() < 1e-4 * np.abs(kicks).max(), "all rods of a section alike"
    note(folds, 0, h, 1)
    assert folds.notes[0, 2] > 5 and not folds.sums.any()


@pytest.mark.slow
def test_laps_of_the_full_arm_lie_in_each_other_where_nothing_keeps_them_apart():
    assert nearest(full_arm(on=False).advance(FIST, 0.8)) < 0.9


@pytest.mark.slow
def test_two_threads_fold_the_full_arm_as_one_does():
    runs = [full_arm(threads=threads).advance(FIST, 0.45) for threads in (1, 2)]
    assert runs[0].series[SELF_CONTACT].any()
    np.testing.assert_array_equal(runs[0].points, runs[1].points)
    np.testing.assert_array_equal(runs[0].series[SELF_CONTACT], runs[1].series[SELF_CONTACT])


def test_what_cannot_be_is_refused_in_one_sentence():
    with pytest.raises(OctoctrlError, match="the published arm does not touch itself; leave self_contact or paper_compatible out"):
        # Before anything is built: a pitch that fits no ring would be found then.
        oc.make_plant("assembly", oc.Arm.octopus(oblique_pitch=0.0123), oc.Scene(self_contact=True), paper_compatible=True)
    with pytest.raises(OctoctrlError, match="Scene: self_contact is 'yes'; True or False is needed"):
        oc.Scene(self_contact="yes")
