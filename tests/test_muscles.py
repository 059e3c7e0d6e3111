"""Muscle laws: the tables of the specification, the limits of the curves, and the compiled twins."""

from dataclasses import replace

import numpy as np
import pytest

from octoctrl.sim.body.muscles import LONGITUDINAL, TRANSVERSE
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.physics.fibre_kernels import hill_secant, isometric_stress, law_constants, passive_stress

LAWS = pytest.mark.parametrize("law", [LONGITUDINAL, TRANSVERSE], ids=["longitudinal", "transverse"])

ACTIVE = {
    "longitudinal": {0.7: 0.21528, 0.8: 0.51736, 0.9: 0.77038, 1.0: 0.92613, 1.05: 0.96268, 1.098: 0.97349, 1.2: 0.93224, 1.3: 0.83840,
                     1.4: 0.72795, 1.5: 0.62477, 1.6: 0.53554, 1.8: 0.36214},
    "transverse": {0.7: 0.19774, 0.8: 0.38076, 0.9: 0.57268, 1.0: 0.74916, 1.1: 0.88499, 1.281: 0.98320, 1.4: 0.94627, 1.6: 0.77032,
                   1.8: 0.55300},
}  # fmt: skip
PASSIVE = {
    "longitudinal": {1.05: 0.0265, 1.1: 0.1137, 1.2: 0.3820, 1.3: 0.6931, 1.4: 0.9730, 1.5: 1.1969, 1.6: 1.3815, 1.7: 1.5609, 1.8: 1.7626},
    "transverse": {1.05: 0.0399, 1.1: 0.1601, 1.2: 0.5438, 1.3: 1.0949, 1.4: 1.7566, 1.5: 2.4594, 1.8: 4.3276},
}
BY_NAME = {"longitudinal": LONGITUDINAL, "transverse": TRANSVERSE}
GRID = np.linspace(0.3, 2.5, 2201)


@pytest.mark.parametrize("name", BY_NAME)
def test_force_length_table(name):
    stretch, factor = np.array(list(ACTIVE[name].items())).T
    assert BY_NAME[name].active_factor(stretch) == pytest.approx(factor, abs=1e-5)


def test_force_length_ends_and_peaks():
    assert LONGITUDINAL.active_factor(0.62) == 0.0 < LONGITUDINAL.active_factor(0.626)
    grid = np.linspace(0.6, 1.8, 12001)
    assert grid[LONGITUDINAL.active_factor(grid).argmax()] == pytest.approx(1.098, abs=1e-3)
    assert grid[TRANSVERSE.active_factor(grid).argmax()] == pytest.approx(1.281, abs=1e-3)
    assert LONGITUDINAL.active_factor([0.1, 0.6]) == pytest.approx(0.0)


@pytest.mark.parametrize("name", BY_NAME)
def test_passive_table(name):
    law = BY_NAME[name]
    stretch, share = np.array(list(PASSIVE[name].items())).T
    assert law.passive_stress(stretch) / law.maximum_stress == pytest.approx(share, abs=6e-5)


def test_stresses_in_pascal():
    assert LONGITUDINAL.maximum_stress == TRANSVERSE.maximum_stress == pytest.approx(130.27778e3, rel=1e-7)
    # To half a unit of the last digit given.
    assert LONGITUDINAL.passive_stress([1.1, 1.2, 1.3, 1.5]) == pytest.approx([14.8e3, 49.8e3, 90.3e3, 155.9e3], abs=50)
    assert TRANSVERSE.passive_stress([1.1, 1.2, 1.3]) == pytest.approx([20.9e3, 70.8e3, 142.6e3], abs=50)
    assert TRANSVERSE.passive_stress(1.5) == pytest.approx(320e3, abs=500)


@LAWS
def test_slack_and_compression(law):
    assert np.all(law.passive_stress(np.linspace(0.976, 1.024, 21)) == 0.0)
    assert law.passive_stress(0.875) == pytest.approx(-0.1 * law.compression_modulus)
    assert LONGITUDINAL.compression_modulus == 25e3 and TRANSVERSE.compression_modulus == 10e3


@LAWS
def test_passive_curve_goes_on_safely_outside_the_polynomials(law):
    # The polynomials themselves turn down beyond 1.9.
    stress = law.passive_stress(GRID)
    assert np.all(np.diff(stress) >= 0.0) and np.isfinite(stress).all()
    assert np.all(law.active_factor(GRID) >= 0.0) and law.active_factor(GRID).max() < 1.0


def test_force_velocity():
    law = LONGITUDINAL
    # The formula's plateau lies 0.8 K / 7.56 above the 1.8 in it.
    assert law.velocity_factor([0.0, 1.0, 2.0, -1e9]) == pytest.approx([1.0, 0.0, 0.0, 1.8 + 0.8 * 0.25 / 7.56])
    assert law.velocity_factor(0.25) == pytest.approx(0.75 / 2)
    assert law.velocity_factor(-0.1) == pytest.approx(1.8 - 0.8 * 0.9 / (1 + 7.56 * 0.1 / 0.25))
    assert np.all(np.diff(law.velocity_factor(np.linspace(-3, 3, 601))) <= 0.0)
    # The isotonic speed at a share of the isometric force is the inverse of the shortening branch.
    share = np.linspace(0.05, 1, 20)
    assert law.velocity_factor((1 - share) / (1 + share / law.curvature)) == pytest.approx(share)


@LAWS
def test_isometric_force_is_activation_times_stress_times_factor(law):
    stretch, level = np.linspace(0.98, 1.02, 5), 0.37
    assert law.stress(stretch, 0.0, level) == pytest.approx(level * law.maximum_stress * law.active_factor(stretch), rel=1e-14)


@LAWS
def test_a_stronger_muscle_pulls_more_and_resists_as_before(law):
    stretch, stronger = np.linspace(0.5, 2.0, 31), law.stronger(1.3)
    np.testing.assert_allclose(stronger.passive_stress(stretch), law.passive_stress(stretch), rtol=1e-12)
    active = law.stress(stretch, 0.1, 0.4) - law.passive_stress(stretch)
    np.testing.assert_allclose(stronger.stress(stretch, 0.1, 0.4) - stronger.passive_stress(stretch), 1.3 * active, rtol=1e-12, atol=1e-9)


@LAWS
@pytest.mark.parametrize("factor", [1.0, 2.7])
def test_compiled_passive_stress_is_the_law(law, factor):
    constants = law_constants(law, factor)
    compiled = np.array([passive_stress(constants, s) for s in GRID])
    # Terms of the polynomial cancel to a ten-thousandth of their size; what is left of rounding is that of the sum of the sizes.
    sizes = factor * law.maximum_stress * np.polyval(np.abs(law.passive), np.clip(GRID, 1.0, law.range[1]))
    assert np.all(np.abs(compiled - factor * law.passive_stress(GRID)) < 8 * np.finfo(float).eps * sizes)
    grid = np.linspace(1.0, 1.4, 401)
    assert constants.tangent >= np.diff(factor * law.passive_stress(grid)).max() / (grid[1] - grid[0]) * 0.99


@LAWS
def test_compiled_isometric_stress_is_the_law(law):
    compiled = np.array([isometric_stress(law_constants(law), s) for s in GRID])
    assert compiled == pytest.approx(law.maximum_stress * law.active_factor(GRID), rel=1e-12, abs=1e-6)


@LAWS
def test_compiled_secant_is_the_force_velocity_law(law):
    constants = law_constants(law)
    rates = np.concatenate([-np.geomspace(1e-6, 50, 200), np.geomspace(1e-6, 50, 200)])
    secant = np.array([hill_secant(constants, rate) for rate in rates])
    assert np.all(secant > 0.0)
    assert 1 + secant * rates == pytest.approx(law.velocity_factor(-rates / law.maximum_rate), abs=1e-12)
    # At rest the secant is the slope of the branch: finite, 5 / v_max of shortening.
    assert hill_secant(constants, -1e-12) == pytest.approx((1 + 1 / law.curvature) / law.maximum_rate)


@pytest.mark.parametrize(
    "changes",
    [
        {"maximum_stress": -1.0},
        {"maximum_rate": 0.0},
        {"curvature": float("nan")},
        {"slack": -0.1},
        {"active": (1.0,)},
        {"passive": (float("nan"),) * 9},
        {"range": (1.2, 1.8)},
    ],
)
def test_bad_laws_are_refused(changes):
    with pytest.raises(OctoctrlError, match=next(iter(changes))):
        replace(LONGITUDINAL, **changes)
