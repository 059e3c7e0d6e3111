"""Archives that anyone may have written: read, or refused as a whole, and nothing in them is ever carried out."""

import os
import zipfile

import numpy as np
import pytest

from octoctrl.sim import archives
from octoctrl.sim.annotations import fits
from octoctrl.sim.archives import read_archive, write_archive
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.registries import enter
from octoctrl.sim.running.state_files import read_state


class Spy:
    def __reduce__(self):
        return os.mkdir, ("spied",)


def header(text=b"{}"):
    return np.frombuffer(text, dtype=np.uint8)


def test_headers_and_arrays_come_back(tmp_path):
    arrays = {"a": np.arange(6.0).reshape(2, 3), "b.c[0]": np.zeros((0, 2)), "d": np.array(True)}
    write_archive(tmp_path / "a.npz", {"x": [1, None, "y"]}, arrays)
    read, back = read_archive(tmp_path / "a.npz")
    assert read == {"x": [1, None, "y"]} and list(back) == list(arrays)
    assert all(back[name].dtype == array.dtype and np.array_equal(back[name], array) for name, array in arrays.items())


def test_nothing_is_carried_out_that_a_file_holds(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.savez("spy.npz", header=header(), x=np.array([Spy()], dtype=object))
    np.savez("header.npz", header=np.array([Spy()], dtype=object))
    assert read_archive("spy.npz") is None and read_archive("header.npz") is None
    assert not (tmp_path / "spied").exists()
    np.load("spy.npz", allow_pickle=True)["x"]
    assert (tmp_path / "spied").exists(), "which is what a reader with pickle does"


@pytest.mark.parametrize("text", [b"[1]", b"{", b'{"a": ' + b"[" * 100_000, b"\xff\xfe", b"null"])
def test_headers_that_are_none(tmp_path, text):
    np.savez(tmp_path / "a.npz", header=header(text))
    assert read_archive(tmp_path / "a.npz") is None


def test_what_swells_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "ALLOWANCE", 1 << 16)
    np.savez_compressed(tmp_path / "bomb.npz", header=header(), x=np.zeros(1 << 21))
    assert read_archive(tmp_path / "bomb.npz") is None
    np.savez(tmp_path / "large.npz", header=header(), x=np.zeros(1 << 21))
    assert read_archive(tmp_path / "large.npz") is not None


def test_what_lies_about_its_size_is_damaged(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr(
            "x.npy", b"\x93NUMPY\x01\x00F\x00{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000000,), }".ljust(80)
        )
        archive.writestr("header.npy", b"")
    assert read_archive(tmp_path / "a.npz") is None


def test_files_that_are_not_there_are_said_to_be(tmp_path):
    for name, message in (("none.npz", "none.npz does not exist"), ("a.txt", "unknown format '.txt'; use .npz")):
        with pytest.raises(OctoctrlError, match=message):
            read_archive(tmp_path / name)


def test_numbers_that_no_computer_has_fit_nowhere():
    assert fits(float, 3) and fits(int, -(2**62)) and fits(float | None, None) and fits(tuple[float, ...], (1.0, 2))
    assert not fits(float, 10**400) and not fits(int, 2**70) and not fits(float, True) and not fits(tuple[float, float], (1.0,))


def test_a_state_of_something_else_is_not_told_at_length(tmp_path):
    write_archive(tmp_path / "s.npz", {"state": 1, "identity": {"arm": "x\n"}}, {"a": np.zeros(1)})
    with pytest.raises(OctoctrlError, match=r"s\.npz holds no state of a plant, or is damaged$"):
        read_state(tmp_path / "s.npz", {"arm": "y"})


def test_the_same_may_be_entered_twice_and_another_never():
    table, item = {}, object()
    assert enter(table, "thing", "a", item) is item and enter(table, "thing", "a", item) is item
    again = [type("Kind", (), {}) for _ in range(2)]
    assert [enter(table, "thing", "Kind", kind) for kind in again] == again and table["Kind"] is again[1]
    with pytest.raises(OctoctrlError, match="a thing called 'a' exists already; choose another name"):
        enter(table, "thing", "a", object())
    with pytest.raises(OctoctrlError, match="a thing called 'Kind' exists already; choose another name"):
        enter(table, "thing", "Kind", type("Kind", (), {"__module__": "of_another_author"}))
    assert table["a"] is item
