"""The energy ledger of the full arm closes, and what has a potential does its work against it."""

import importlib.util
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).parent.parent / "benchmarks" / "assembly_energy.py"


@pytest.fixture(scope="module")
def twisted():
    spec = importlib.util.spec_from_file_location("assembly_energy", BENCHMARK)
    benchmark = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(benchmark)
    return benchmark.run("twist", 0.02)


def test_work_of_all_forces_is_the_change_of_kinetic_energy(twisted):
    ledger, (before, _), (after, _) = twisted
    assert ledger.work["muscles"] > 2e-7
    assert sum(ledger.work.values()) == pytest.approx(after - before, abs=1e-9 * ledger.work["muscles"])


def test_muscles_work_as_hills_law_has_it(twisted):
    ledger, _, _ = twisted
    assert ledger.hill_work == pytest.approx(ledger.work["muscles"], rel=0.01)


def test_laws_neither_make_nor_lose_energy(twisted):
    ledger, (_, before), (_, after) = twisted
    muscles = ledger.work["muscles"]
    for name in after:
        # That stretching softens a rod in shear and bending is not felt as tension; all else to a thousandth.
        share = 0.005 if name in ("shear", "bending and twist") else 0.001
        assert ledger.work[name] + after[name] - before[name] == pytest.approx(0.0, abs=share * muscles), name


def test_brakes_and_water_only_take(twisted):
    ledger, _, _ = twisted
    for name in ("passive viscosity", "ring spin brake", "cord brake", "linear water", "quadratic water"):
        assert ledger.work[name] <= 0.0, name
