"""Records with arrays: equal by value, one line to look at."""

import copy
import pickle
from dataclasses import dataclass, fields, is_dataclass, replace
from importlib import import_module

import numpy as np
import pytest

from octoctrl.sim.records import Record


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Sample(Record):
    values: np.ndarray
    name: str = "sample"
    parts: tuple = ()
    table: dict | None = None
    share: float = 0.5


def test_equal_by_value_and_never_an_error(coil_plan, coil_run):
    for record in (coil_run, coil_plan, coil_run.recording, coil_run.trace):
        again = copy.deepcopy(record)
        assert again == record and again is not record
        assert pickle.loads(pickle.dumps(record)) == record
        assert record != "something else" and record is not None
    assert coil_plan != replace(coil_plan, plant="assembly") and coil_run.recording != replace(coil_run.recording, complete=False)
    points = coil_run.recording.points.copy()
    points[3, 2, 1] = np.nextafter(points[3, 2, 1], 1.0)
    assert coil_run.recording != replace(coil_run.recording, points=points)
    assert coil_run != replace(coil_run, recording=replace(coil_run.recording, points=points))


@pytest.mark.parametrize(
    "other",
    [
        {"values": np.array([1.0, 2.0])},
        {"values": np.array([1.0, np.nan, 4.0])},
        {"values": np.array([1.0, np.nan, 3.0], dtype=np.float32)},
        {"values": [1.0, np.nan, 3.0]},
        {"name": "other"},
        {"parts": (np.arange(3), 2)},
        {"parts": [np.arange(2), 2]},
        {"parts": (np.arange(2),)},
        {"table": {"a": np.zeros(3)}},
        {"table": {"b": np.zeros(2)}},
        {"table": None},
        {"share": 0.25},
    ],
)
def test_any_other_field_makes_another_record(other):
    made = {"values": np.array([1.0, np.nan, 3.0]), "parts": (np.arange(2), 2), "table": {"a": np.zeros(2)}, "share": float("nan")}
    assert Sample(**made) == Sample(**copy.deepcopy(made))
    assert Sample(**made) != Sample(**made | other)


def test_a_record_is_shown_in_one_line(coil_plan, coil_run):
    assert repr(Sample(values=np.zeros((2, 3)), name="n" * 60, parts=(1, 2), share=1 / 3)) == (
        f"Sample(values=<float64[2, 3]>, name='{'n' * 38}…, parts=<2>, table=None, share=0.333333)"
    )
    for record in (coil_run, coil_plan, coil_run.recording, coil_run.trace):
        assert len(repr(record)) < 500 and "\n" not in repr(record) and repr(record).startswith(f"{type(record).__name__}(")
    assert "status=FINISHED" in repr(coil_run) and "recording=<Recording>" in repr(coil_run)


def test_what_users_hold_and_holds_arrays_is_a_record():
    """Of all public dataclasses that have an array for a field."""
    package = import_module("octoctrl")
    for name in package.__all__:
        kind = getattr(package, name)
        if isinstance(kind, type) and is_dataclass(kind):
            arrays = [field.name for field in fields(kind) if "ndarray" in str(field.type) or "Floats" in str(field.type)]
            assert not arrays or issubclass(kind, Record), (name, arrays)
