import json
import subprocess
import sys
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum, IntEnum, StrEnum
from math import inf, nan
from typing import Any

import numpy as np
import pytest
from conftest import coil_execution
from hypothesis import given, settings
from hypothesis import strategies as st

from octoctrl import tasks
from octoctrl.carrying.results import ExecutionStatus, VerdictStatus
from octoctrl.files import store, writing
from octoctrl.judging.verification import verify
from octoctrl.planners.asking.registry import stored_kinds
from octoctrl.planners.contracts import ControllerReport
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.templates import Plateau
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
        activation = tasks.programme(name).activation
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


@store.register
@dataclass(frozen=True)
class Carrier:
    """Of anything."""

    value: Any


@pytest.mark.parametrize("value", [inf, -inf, nan, (), {}, {"a": (1, [2.0, None])}, -0.0, 1e-310, np.zeros((0, 3)), np.array(True)])
def test_special_values(tmp_path, coil_run, value):
    back = store.load(store.save(tmp_path / "p.npz", Carrier(value)))
    assert same(back.value, value)


def test_header_says_where_a_file_comes_from(tmp_path, coil_plan):
    path = store.save(tmp_path / "p.npz", coil_plan, origin={"configuration": "text"})
    header = store.read_header(path)
    assert header["content"] == "Plan" and header["schema"] == store.SCHEMA and header["argv"] == sys.argv
    assert header["versions"]["numpy"] == np.__version__ and header["origin"] == {"configuration": "text"}


def test_files_hold_no_pickle(tmp_path, coil_run):
    path = store.save(tmp_path / "run.npz", coil_run)
    with np.load(path, allow_pickle=False) as archive:
        assert all(archive[name].dtype != object for name in archive.files)


def test_primitives_and_goals_have_names_of_their_own():
    assert not set(stored_kinds()) & set(store._HOME_OF)


@store.register
@dataclass(frozen=True)
class Nod:
    """A primitive of a user's own."""

    level: float = 0.3

    def templates(self):
        return (Plateau(groups=("LM1",), level=self.level),)

    def bounds(self):
        return {}

    def effort(self, seconds):
        return 0.0


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
    back = store.load(store.save(tmp_path / "r.npz", Carrier(member)))
    assert back.value is member


def test_classes_of_the_user(tmp_path, coil_plan, coil_run):
    plan = replace(coil_plan, schedule=replace(coil_plan.schedule, primitives=(Nod(level=0.1),)))
    assert store.load(store.save(tmp_path / "p.npz", plan)).schedule.primitives == (Nod(level=0.1),)
    with pytest.raises(
        OctoctrlError,
        match=r"ControllerReport.estimated_errors.key is of type Unknown, which cannot be stored; .* octoctrl.files.store.register",
    ):
        store.save(tmp_path / "q.npz", ControllerReport(estimated_errors={"key": Unknown.A}))
    assert not (tmp_path / "q.npz").exists()
    with pytest.raises(OctoctrlError, match="a class called 'Plan' can be stored already"):
        store.register(type("Plan", (), {}))


def test_failed_write_keeps_the_old_file(tmp_path, coil_plan, coil_run):
    path = store.save(tmp_path / "p.npz", coil_plan)
    before = path.read_bytes()
    with pytest.raises(OctoctrlError):
        store.save(path, ControllerReport(estimated_errors={"key": object()}), overwrite=True)
    assert path.read_bytes() == before
    assert [item.name for item in tmp_path.iterdir()] == ["p.npz"]


def test_interrupted_execution_is_stored_as_such(tmp_path, coil_plan):
    cut = coil_execution(coil_plan, until=1.2, status=ExecutionStatus.INTERRUPTED)
    assert store.load(store.save(tmp_path / "run.npz", cut)).status is ExecutionStatus.INTERRUPTED


# Files that are damaged, foreign or newer


@pytest.fixture
def stored(tmp_path, coil_plan):
    return store.save(tmp_path / "plan.npz", coil_plan)


def rewritten(path, change):
    """The same file with another header."""
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    header = json.loads(arrays.pop("header").tobytes())
    change(header)
    np.savez(path, header=np.frombuffer(json.dumps(header).encode(), dtype=np.uint8), **arrays)
    return path


def test_damaged_files_are_called_so(stored):
    whole = stored.read_bytes()
    for content in (b"", b"PK", whole[: len(whole) // 2], whole[:200] + b"\0" * 400 + whole[600:], b"not an archive"):
        stored.write_bytes(content)
        with pytest.raises(OctoctrlError, match=r"plan\.npz (is not a file of octoctrl, or is damaged|is damaged: )"):
            store.load(stored)


@pytest.mark.parametrize("key", ["content", "versions", "argv", "origin", "object", "schema"])
def test_a_header_without_its_keys_is_damaged(stored, key):
    rewritten(stored, lambda header: header.pop(key))
    for read in (store.load, store.read_header):
        with pytest.raises(OctoctrlError, match="is not a file of octoctrl, or is damaged"):
            read(stored)


@pytest.mark.parametrize("schema", ["1", 1.0, None, True, [1]])
def test_a_schema_that_is_no_number_is_damage(stored, schema):
    rewritten(stored, lambda header: header.update(schema=schema))
    with pytest.raises(OctoctrlError, match="is not a file of octoctrl, or is damaged"):
        store.load(stored)


@pytest.mark.parametrize(("written", "said"), [(None, "is damaged: "), ("9.9.9", "was written by octoctrl 9.9.9, which this one, ")])
@pytest.mark.parametrize(
    "change",
    [
        lambda tree: tree["fields"].pop("task"),
        lambda tree: tree["fields"].update(colour="blue"),
        lambda tree: tree["fields"].update(time={"array": "nowhere"}),
        lambda tree: tree["fields"]["status"].update(name="SOMEWHAT"),
    ],
    ids=["a field less", "a field more", "a missing array", "another status"],
)
def test_fields_that_do_not_fit_are_damage_or_another_version(stored, change, written, said):
    def edit(header):
        change(header["object"])
        header["versions"]["octoctrl"] = written or header["versions"]["octoctrl"]

    from octoctrl import __version__

    rewritten(stored, lambda header: header["versions"].update(octoctrl=__version__))
    with pytest.raises(OctoctrlError, match=f"plan.npz {said}"):
        store.load(rewritten(stored, edit))


# Where files are written


TURNS = """
import sys
from octoctrl.files import store, writing
from octoctrl.sim.activation import Activation
from octoctrl.sim.templates import Plateau
for turn in range(150):
    store.save("shared.npz", Activation(templates=(Plateau(groups=("LM1",), level=(turn + 1) / 1000),)), overwrite=True)
    store.load("shared.npz", expect="Activation")
"""


def test_two_writers_of_one_file_do_not_disturb_each_other(tmp_path):
    processes = [subprocess.Popen([sys.executable, "-c", TURNS], cwd=tmp_path, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    assert [process.communicate()[1] for process in processes] == ["", ""]
    assert [item.name for item in tmp_path.iterdir()] == ["shared.npz"]


def test_a_link_goes_on_pointing_and_modes_are_kept(tmp_path):
    from octoctrl.sim.activation import Activation

    (tmp_path / "kept").mkdir()
    place, link = tmp_path / "kept" / "real.npz", tmp_path / "link.npz"
    place.write_bytes(b"old")
    place.chmod(0o640)
    link.symlink_to(place)
    store.save(link, Activation(), overwrite=True)
    assert link.is_symlink() and store.load(place) == Activation() and place.stat().st_mode & 0o777 == 0o640
    place.chmod(0o400)
    with pytest.raises(OctoctrlError, match="write-protected"):
        store.save(place, Activation(), overwrite=True)
    with pytest.raises(OctoctrlError, match="is a folder"):
        writing.check_target(tmp_path / "kept", overwrite=True, suffixes=("",))


def test_what_fails_while_it_is_written_leaves_the_old_file(tmp_path):
    target = tmp_path / "page.md"
    target.write_text("old")
    with pytest.raises(ZeroDivisionError), writing.written_aside(target) as part:
        part.write_text("half")
        raise ZeroDivisionError
    with pytest.raises(OctoctrlError, match=r"page\.md cannot be written: No space left on device"), writing.written_aside(target) as part:
        raise OSError(28, "No space left on device")
    assert target.read_text() == "old" and [item.name for item in tmp_path.iterdir()] == ["page.md"]
    assert part.suffix == ".md" and part.parent == tmp_path


def test_a_folder_that_cannot_be_written_is_refused_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr("os.access", lambda path, mode: False)
    with pytest.raises(OctoctrlError, match="cannot be written; give a path in another one"):
        writing.check_target(tmp_path / "run.npz")
    (tmp_path / "file").touch()
    with pytest.raises(OctoctrlError, match=r"cannot be made: .*; give another one"):
        writing.make_folder(tmp_path / "file" / "folder")
