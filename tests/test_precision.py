"""Mixed precision of the full arm: one source, single precision throughout, positions and laws that keep their digits."""

import pickle
import re

import numba
import numpy as np
import pytest
from assembly_parts import step_of

from octoctrl.sim import compiler
from octoctrl.sim.activation import Activation
from octoctrl.sim.assembly.hydrostat_terms import hydrostat_terms
from octoctrl.sim.assembly.layout import SINGLE_STATE_ROWS, STATE_ROWS
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.parts import whole
from octoctrl.sim.assembly.stepping import mover
from octoctrl.sim.assembly.terms import by_name
from octoctrl.sim.body.muscles import LONGITUDINAL, TRANSVERSE
from octoctrl.sim.compiler import kernel
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.physics.fibre_kernels import MIDDLE, isometric_stress, law_constants, passive_stress, passive_tangent
from octoctrl.sim.plants import make_plant
from octoctrl.sim.templates import Plateau

SCALE = 2.5
PAIR = (0.25, 0.5)
MOVING = Activation(templates=(Plateau(groups=("R-OM", "LM1", "TM"), level=0.3, rise=0.05),))


@kernel
def helped(x: float) -> float:
    """Of a scalar."""
    return max(x - 1.0, 0.0) * PAIR[1]


@kernel
def scaled(values, share):
    """Literals, constants of the module and of tuples, a call."""
    for i in range(len(values)):
        values[i] = SCALE * helped(values[i]) + share / (1.0 + values[i]) + PAIR[0]


def doubles(dispatcher, *types):
    """Lines of a compiled function's code in which a number is of double precision, without those that unpack its arguments."""
    dispatcher.compile(types)
    lines = dispatcher.inspect_llvm(dispatcher.signatures[-1]).splitlines()
    return [line for line in lines if re.search(r"\bdouble\b", line) and "PyFloat" not in line and not re.search("fptrunc double %", line)]


def test_constants_take_the_precision_of_the_arguments():
    values = np.linspace(0.5, 2.0, 7)
    wanted = 2.5 * np.maximum(values - 1, 0) * 0.5 + 3.0 / (1 + values) + 0.25
    double, single = values.copy(), values.astype(np.float32)
    scaled(double, 3.0)
    scaled(single, np.float32(3.0))
    np.testing.assert_allclose(double, wanted, rtol=1e-15)
    np.testing.assert_allclose(single, wanted, rtol=5e-7)
    alone = kernel(scaled.py_func)
    alone._cache = numba.core.caching.NullCache()
    assert not doubles(alone, numba.float32[::1], numba.float32)


@pytest.mark.parametrize("kind", ["assembly-coarse", pytest.param("assembly", marks=pytest.mark.slow)])
def test_no_term_computes_in_double_precision(kind, monkeypatch):
    monkeypatch.setattr(compiler._Index, "load", lambda *_: None)  # code from a cache does not show how it was made; it is kept for others
    plant = make_plant(kind, precision="mixed")
    buffer, share, step, part = map(numba.typeof, (plant.core.rods.flat, np.float32(0.5), step_of(plant), whole(plant.core.grid)))
    terms = by_name(hydrostat_terms(plant.core.grid, plant.arm.anatomy.traits))
    found = {name: doubles(term, buffer, share, step, part) for name, term in terms.items()}
    found["move"] = doubles(mover(plant.core.grid), buffer, part, share)
    assert {name: lines[:3] for name, lines in found.items() if lines} == {}


def test_positions_keep_steps_that_are_smaller_than_their_last_digit():
    plant = make_plant("assembly-coarse", precision="mixed")
    rods, h, generator = plant.core.rods, np.float32(5e-5), np.random.default_rng(3)
    before = plant.core.nodes()
    for view in (rods.straight, rods.oblique):
        for row in (R.V1, R.V2, R.V3):
            view(row, nodes=True)[:] = 1e-6 * generator.standard_normal(view(row, nodes=True).shape)
    for row in (R.V1, R.V2, R.V3):
        rods.ring(row)[:] = 1e-6 * generator.standard_normal(rods.ring(row).shape)
    speeds = [np.stack([view(row, **n) for row in (R.V1, R.V2, R.V3)], axis=-1).astype(float) for view, n in views(rods)]
    move, part = mover(plant.core.grid), whole(plant.core.grid)
    for _ in range(200):  # each of some 5e-11 m, where the next number is 1.5e-8 m away; low parts are rounded by 4e-16 m
        move(rods.flat, part, h)
    for was, now, speed in zip(before, plant.core.nodes(), speeds, strict=True):
        np.testing.assert_allclose(now - was, 200 * float(h) * speed, rtol=1e-6, atol=1e-13)


def views(rods):
    """Families in the order of `nodes`."""
    return (rods.straight, {"nodes": True}), (rods.oblique, {"nodes": True}), (rods.ring, {})


@pytest.mark.parametrize("law", [LONGITUDINAL, TRANSVERSE], ids=["longitudinal", "transverse"])
def test_laws_keep_their_digits_about_the_middle_of_their_range(law):
    stretches = np.linspace(0.7, 1.6, 300).astype(np.float32)
    about, exact = law_constants(law, centre=MIDDLE), law_constants(law)
    single = type(about)(*(tuple(map(np.float32, v)) if isinstance(v, tuple) else np.float32(v) for v in about))
    for function in (isometric_stress, passive_stress, passive_tangent):
        wanted = np.array([function(exact, float(s)) for s in stretches])
        again = np.array([function(about, float(s)) for s in stretches])
        found = np.array([function(single, s) for s in stretches])
        assert np.array_equal(found, found.astype(np.float32))
        largest = np.abs(wanted).max()
        np.testing.assert_allclose(again, wanted, rtol=0, atol=1e-11 * largest)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=2e-6 * largest)


@pytest.fixture(scope="module")
def runs():
    """The coarse arm after a tenth of a second in either precision."""
    found = {}
    for precision in ("double", "mixed"):
        plant = make_plant("assembly-coarse", precision=precision)
        found[precision] = plant, plant.advance(MOVING, 0.1)
    return found


def test_mixed_precision_moves_the_arm_as_double_precision_does(runs):
    (plant, exact), (mixed, found) = runs["double"], runs["mixed"]
    assert mixed.core.rods.flat.dtype == np.float32 and plant.core.rods.flat.dtype == np.float64
    for frames in (found.frames, mixed.observe().frames):
        assert np.abs(frames @ np.swapaxes(frames, -1, -2) - np.eye(3)).max() < 1e-12
    moved = np.abs(exact.points[-1] - exact.points[0]).max()
    assert moved > 1e-3
    assert np.abs(found.points[-1] - exact.points[-1]).max() < 2e-3 * moved
    lengths = [np.linalg.norm(np.diff(points, axis=0), axis=1).sum() for points in (found.points[-1], exact.points[-1])]
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-4)
    assert np.abs(found.frames[-1] - exact.frames[-1]).max() < 1e-2
    np.testing.assert_allclose(found.series["slab_volume"][-1], exact.series["slab_volume"][-1], atol=2e-5)
    frames = found.frames[-1]
    assert np.abs(frames @ np.swapaxes(frames, -1, -2) - np.eye(3)).max() < 1e-6
    assert found.points.dtype == found.frames.dtype == found.stretch.dtype == np.float64
    for name, value in mixed.core.series().items():
        np.testing.assert_allclose(value, found.series[name][-1], atol=2e-6)


def test_states_of_mixed_precision_are_exact(runs, tmp_path):
    plant = pickle.loads(pickle.dumps(runs["mixed"][0]))  # it moves on, and others read theirs
    state, path = plant.state(), plant.save(tmp_path / "state.npz")
    assert state["rings"].dtype == np.float32 and len(state["rings"]) == SINGLE_STATE_ROWS > STATE_ROWS
    assert len(runs["double"][0].state()["rings"]) == STATE_ROWS
    plant.advance(MOVING, 0.01)
    after = plant.state()
    twin = pickle.loads(pickle.dumps(plant))
    for other in (plant, make_plant("assembly-coarse", precision="mixed"), twin):
        if other is twin:
            other.restore(state)
        else:
            other.load(path)
        other.advance(MOVING, 0.01)
        for name, value in other.state().items():
            assert np.array_equal(value, after[name]), name


def test_states_belong_to_their_precision(runs, tmp_path):
    path = runs["mixed"][0].save(tmp_path / "state.npz")
    with pytest.raises(OctoctrlError, match="state has model=assembly-coarse-mixed, this plant model=assembly-coarse;"):
        make_plant("assembly-coarse").load(path)


def test_a_run_in_mixed_precision_goes_on_from_before_its_stop():
    plant, twin = (make_plant("assembly-coarse", precision="mixed") for _ in range(2))
    plant.advance(MOVING, 0.01)
    good = plant.state()
    plant.core.rods.oblique(R.V2, nodes=True)[6, 200] = 5000.0  # m/s, which no step survives
    with pytest.raises(PlantUnstableError):
        plant.advance(MOVING, 0.01)
    assert plant.time == pytest.approx(0.01)
    plant.restore(good)
    plant.advance(MOVING, 0.01)
    twin.advance(MOVING, 0.02)
    for name, value in plant.state().items():
        assert np.array_equal(value, twin.state()[name]), name
