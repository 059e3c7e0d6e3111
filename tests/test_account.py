"""Energy on request: books that close, powers and energies against what they mean, and nothing of it where nobody asked."""

import copy

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.muscles import LONGITUDINAL, TRANSVERSE
from octoctrl.sim.rod.core import RodCore
from octoctrl.sim.templates import Plateau

TWIST_AND_BEND = Activation(
    templates=(
        Plateau(groups=("R-OM",), level=0.3, rise=0.15),
        Plateau(groups=("LM1", "LM2"), level=0.2, rise=0.1, offset=0.2, fall=0.1),
        Plateau(groups=("TM",), level=0.2, onset=0.05, rise=0.1),
    )
)
DURATION, SAMPLE = {"rod": 0.5, "assembly-coarse": 0.1}, {"rod": 5e-3, "assembly-coarse": 2e-3}


@pytest.fixture(scope="module", params=list(DURATION))
def runs(request):
    """A recording without account, and the plant that kept it with its recording."""
    name = request.param
    plain = oc.make_plant(name, sample_interval=SAMPLE[name]).advance(TWIST_AND_BEND, DURATION[name])
    plant = oc.make_plant(name, sample_interval=SAMPLE[name], energy=True)
    return plain, plant, plant.advance(TWIST_AND_BEND, DURATION[name])


def stored(recording):
    return np.sum([values for name, values in recording.series.items() if name.startswith("energy_")], axis=0)


def test_account_changes_no_bit(runs):
    plain, _, kept = runs
    for name in ("time", "points", "frames", "stretch", "levels"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(plain, name))
    assert set(kept.series) > set(plain.series) and not any(name.startswith(("energy_", "work_")) for name in plain.series)


def test_nobody_keeps_account_unasked():
    assert type(oc.make_plant("rod").core) is RodCore and type(oc.make_plant("rod", energy=True).core) is not RodCore


def unbooked(recording):
    """Share of the muscles' work that is neither stored nor taken by water, at most."""
    muscles, water = recording.series["work_muscles"], recording.series["work_water"]
    assert muscles[-1] > 1e-5 and (np.diff(water) <= 0).all() and water[-1] < -0.02 * muscles[-1]
    works = np.sum([values for name, values in recording.series.items() if name.startswith("work_")], axis=0)
    return np.abs(works - (stored(recording) - stored(recording)[0])).max() / muscles.max()


def test_books_close(runs):
    """What muscles and water have done is stored. The one rod also brakes the zigzag of its curvature when it is twisted and bent."""
    _, plant, kept = runs
    assert unbooked(kept) < (0.04 if plant.model == "rod" else 0.02)


@pytest.mark.parametrize("group", ["R-OM", "LM3", "TM"])
def test_books_of_each_muscle_of_the_one_rod_close(group):
    activation = Activation(templates=(Plateau(groups=(group,), level=0.3, rise=0.15),))
    # What the implicit step itself takes falls with the step.
    plant = oc.make_plant("rod", energy=True, sample_interval=1e-3, dt=1.25e-4)
    assert unbooked(plant.advance(activation, 0.4)) < 0.01


def test_account_survives_a_file_and_a_copy(runs, tmp_path):
    _, plant, kept = runs
    other = oc.make_plant(plant.model, sample_interval=plant.sample_interval, energy=True)
    other.load(plant.save(tmp_path / "state.npz"))
    twins = [copy.deepcopy(plant), other]
    after = [twin.advance(TWIST_AND_BEND, 2 * twin.sample_interval) for twin in twins]
    assert after[0].series["work_muscles"][0] == kept.series["work_muscles"][-1]
    for name, values in after[0].series.items():
        np.testing.assert_array_equal(values, after[1].series[name], err_msg=name)
    twins[0].reset()
    assert twins[0].core.series()["work_muscles"] == 0.0


@pytest.mark.parametrize("law", [LONGITUDINAL, TRANSVERSE])
def test_passive_energy_is_the_integral_of_the_pull(law):
    s = np.concatenate([np.linspace(0.5, 0.95, 10), np.linspace(1.1, 2.2, 12)])
    slope = (law.passive_energy(s + 1e-3) - law.passive_energy(s - 1e-3)) / 2e-3
    np.testing.assert_allclose(slope, law.passive_stress(s) / s, rtol=2e-3)
    assert law.passive_energy(1.0) == 0.0
    # Compressed beyond the slack, E (s - s0) / s integrates to a logarithm.
    short, begin = 0.7, 1 - law.slack
    assert law.passive_energy(short) == pytest.approx(law.compression_modulus * (short - begin - begin * np.log(short / begin)), rel=1e-6)


def test_kinetic_energy_of_a_given_motion_and_the_power_of_the_water_that_slows_it():
    """At rest in shape nothing but water acts on an arm that is given velocities: what it loses is the water's power."""
    plant = oc.make_plant("rod", energy=True, sample_interval=1e-4, record_every=1)
    velocities = 0.1 * np.outer(np.linspace(0, 1, plant.elements + 1) ** 2, [1.0, 0.0, 0.5])
    plant.core.displace(velocities=velocities)
    expected = 0.5 * np.sum(plant.core.node_mass * np.sum(velocities**2, axis=1))
    assert plant.core.energies()["kinetic"] == pytest.approx(expected, rel=1e-12)
    assert stored_now(plant) == pytest.approx(expected, rel=1e-12)
    kept = plant.advance(Activation(), 2e-4)
    lost = stored(kept)[0] - stored(kept)[-1]
    assert lost > 1e-3 * expected and kept.series["work_muscles"][-1] == 0.0
    assert -kept.series["work_water"][-1] == pytest.approx(lost, rel=2e-3)


def stored_now(plant):
    return sum(plant.core.energies().values())


def test_muscles_that_are_held_do_no_work_and_weak_muscles_less():
    recordings = [oc.make_plant("rod", energy=True, gains=gains).advance(TWIST_AND_BEND, 0.2) for gains in ({}, {"R-OM": 0.0, "TM": 0.0})]
    strong, weak = (recording.series["work_muscles"][-1] for recording in recordings)
    assert 0 < weak < strong
    still = oc.make_plant("rod", energy=True)
    levels = {"arm": np.full((11, still.elements), 0.3)}
    assert still.core.powers(levels, 0.0) == {"muscles": pytest.approx(0.0, abs=1e-15), "water": 0.0}
