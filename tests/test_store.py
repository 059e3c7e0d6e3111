import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum, IntEnum, StrEnum
from math import inf, nan

import numpy as np
import pytest
from conftest import coil_execution
from hypothesis import given, settings
from hypothesis import strategies as st

from octoctrl import tasks
from octoctrl.carrying.results import ExecutionStatus, VerdictStatus
from octoctrl.files import store
from octoctrl.judging.verification import verify
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.topology.trace import TopologyConvention


def same(a, b):
    """Whether two objects are equal to the last bit, types included."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if is_dataclass(a):
        return all(same(getattr(a, item.name), getattr(b, item.name)) for item in fields(a))
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    return a == b or (a != a and b != b)


def test_plan_and_execution_come_back_to_the_last_bit(tmp_path, coil_plan, coil_run):
    for number, item in enumerate((coil_plan, coil_run, coil_run.recording, coil_run.trace, verify(coil_run), tasks.load("coil"))):
        path = store.save(tmp_path / f"{number}.npz", item)
        assert same(store.load(path), item), type(item).__name__


def test_programmes_come_back(tmp_path):
    for name in tasks.programmes():
        activation, _ = tasks.programme(name)
        assert store.load(store.save(tmp_path / f"{name}.npz", activation)) == activation


def test_normalised_values_are_not_normalised_again(tmp_path):
    convention = TopologyConvention(pole=(0.3, -1.7, 0.123))
    assert same(store.load(store.save(tmp_path / "c.npz", convention)), convention)


values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text()),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.lists(inner, max_size=3).map(tuple),
        st.dictionaries(st.one_of(st.text(), st.integers(), st.tuples(st.text(), st.integers())), inner, max_size=3),
    ),
    max_leaves=12,
)


@given(values)
@settings(max_examples=200, deadline=None)
def test_any_nesting_of_plain_values_comes_back(value):
    arrays = {}
    tree = json.loads(json.dumps(store._encode(value, arrays, "x"), allow_nan=False))
    assert same(store._decode(tree, arrays), value)


@pytest.mark.parametrize("value", [inf, -inf, nan, (), {}, {"a": (1, [2.0, None])}, -0.0, 1e-310, np.zeros((0, 3)), np.array(True)])
def test_special_values(tmp_path, coil_run, value):
    back = store.load(store.save(tmp_path / "p.npz", replace(coil_run, statistics={"value": value})))
    assert same(back.statistics["value"], value)


def test_header_says_where_a_file_comes_from(tmp_path, coil_plan):
    path = store.save(tmp_path / "p.npz", coil_plan, origin={"configuration": "text"})
    header = store.read_header(path)
    assert header["content"] == "Plan" and header["schema"] == store.SCHEMA and header["argv"] == sys.argv
    assert header["versions"]["numpy"] == np.__version__ and header["origin"] == {"configuration": "text"}


def test_files_hold_no_pickle(tmp_path, coil_run):
    path = store.save(tmp_path / "run.npz", coil_run)
    with np.load(path, allow_pickle=False) as archive:
        assert all(archive[name].dtype != object for name in archive.files)


@store.register
@dataclass(frozen=True)
class Nod:
    """A primitive of a user's own."""

    level: float = 0.3


@store.register
class Colour(StrEnum):
    RED = "red"


@store.register
class Order(IntEnum):
    FIRST = 1


class Unknown(Enum):
    A = 1


@pytest.mark.parametrize("member", [Colour.RED, Order.FIRST, VerdictStatus.FAIL, ExecutionStatus.FINISHED])
def test_members_of_enums_that_are_text_or_numbers_come_back_as_members(tmp_path, coil_run, member):
    back = store.load(store.save(tmp_path / "r.npz", replace(coil_run, statistics={"value": member})))
    assert back.statistics["value"] is member


def test_classes_of_the_user(tmp_path, coil_plan, coil_run):
    plan = replace(coil_plan, schedule=replace(coil_plan.schedule, primitives=(Nod(level=0.1),)))
    assert store.load(store.save(tmp_path / "p.npz", plan)).schedule.primitives == (Nod(level=0.1),)
    with pytest.raises(
        OctoctrlError, match=r"Execution.statistics.key is of type Unknown, which cannot be stored; .* octoctrl.files.store.register"
    ):
        store.save(tmp_path / "q.npz", replace(coil_run, statistics={"key": Unknown.A}))
    assert not (tmp_path / "q.npz").exists()
    with pytest.raises(OctoctrlError, match="a class called 'Plan' can be stored already"):
        store.register(type("Plan", (), {}))


def test_failed_write_keeps_the_old_file(tmp_path, coil_plan, coil_run):
    path = store.save(tmp_path / "p.npz", coil_plan)
    before = path.read_bytes()
    with pytest.raises(OctoctrlError):
        store.save(path, replace(coil_run, statistics={"key": object()}), overwrite=True)
    assert path.read_bytes() == before
    assert [item.name for item in tmp_path.iterdir()] == ["p.npz"]


def test_run_writer_writes_at_its_period(tmp_path, coil_run):
    writer = store.RunWriter(tmp_path / "run.npz", period=3600.0)
    writer(coil_run)
    first = writer.path.stat().st_mtime_ns
    writer(coil_run)
    assert writer.path.stat().st_mtime_ns == first
    writer.close(replace(coil_run, feedback="open-loop"))
    assert store.load(writer.path).feedback == "open-loop"


WRITING = """
import sys
sys.path.insert(0, {tests!r})
from dataclasses import replace
import conftest
from octoctrl.files import store
run = store.load({source!r})
writer = store.RunWriter({target!r}, period=0.0)
count = 0
while True:
    count += 1
    writer._next = 0.0
    writer(replace(run, statistics={{"count": count}}))
    print(count, flush=True)
"""


@pytest.mark.parametrize("delay", [0.0, 0.013, 0.04, 0.11])
def test_kill_9_leaves_a_readable_file(tmp_path, coil_run, delay):
    source, target = tmp_path / "source.npz", tmp_path / "run.npz"
    store.save(source, coil_run)
    program = WRITING.format(tests=os.path.dirname(__file__), source=str(source), target=str(target))
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        seen = int(process.stdout.readline())
        time.sleep(delay)
        process.send_signal(signal.SIGKILL)
        seen = max([seen, *map(int, process.stdout.read().split())])
    loaded = store.load(target)
    assert loaded.statistics["count"] in (seen, seen + 1)
    assert same(loaded.recording, coil_run.recording)


def test_interrupted_execution_is_stored_as_such(tmp_path, coil_plan):
    cut = coil_execution(coil_plan, until=1.2, status=ExecutionStatus.INTERRUPTED)
    assert store.load(store.save(tmp_path / "run.npz", cut)).status is ExecutionStatus.INTERRUPTED
