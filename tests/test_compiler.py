"""Compiled code is found again by the next process, and not when anything that it is made of has changed."""

import os
import pickle
import subprocess
import sys

import numba
import numpy as np
import pytest

from octoctrl.sim.compiler import _Index, by_address, call, fingerprint, kernel

INNER = """
from octoctrl.sim.compiler import kernel

FACTOR = {factor}


@kernel
def scale(x):
    return FACTOR * x
"""

OUTER = """
from inner import scale

from octoctrl.sim.compiler import kernel


def loop(count):
    @kernel
    def shifted(x):
        return scale(x) + count

    @kernel
    def total(x):
        result = 0.0
        for _ in range(count):
            result += shifted(x)
        return result

    return total


total = loop(3)
print(total(1.0), sum(total.stats.cache_hits.values()), sum(total.stats.cache_misses.values()))
"""


def start(folder, factor=2.0):
    """Value, hits and misses of the loop in a process of its own."""
    text = INNER.format(factor=factor)
    if not (folder / "inner.py").is_file() or (folder / "inner.py").read_text() != text:
        (folder / "inner.py").write_text(text)
    (folder / "outer.py").touch() if (folder / "outer.py").is_file() else (folder / "outer.py").write_text(OUTER)
    os.utime(folder / "outer.py", (1, 1))
    places = os.pathsep.join([str(folder), *filter(None, sys.path)])
    environment = dict(os.environ, PYTHONPATH=places, NUMBA_CACHE_DIR=str(folder / "cache"), PYTHONDONTWRITEBYTECODE="1")
    done = subprocess.run([sys.executable, "outer.py"], cwd=folder, env=environment, capture_output=True, text=True, check=True)
    return tuple(float(word) for word in done.stdout.split())


def test_a_loop_made_of_kernels_is_compiled_once(tmp_path):
    assert start(tmp_path) == (15.0, 0, 1)
    before = sorted(path.name for path in (tmp_path / "cache").rglob("*.nb?"))
    assert start(tmp_path) == (15.0, 1, 0)
    assert sorted(path.name for path in (tmp_path / "cache").rglob("*.nb?")) == before


def test_a_change_in_another_file_is_seen(tmp_path):
    assert start(tmp_path)[0] == 15.0
    assert start(tmp_path, factor=10.0) == (39.0, 0, 1)


VARIANTS = """
import sys

from octoctrl.sim.compiler import kernel


def adder(shift):
    @kernel
    def inner(x, y):
LINES
        return x + shift

    @kernel
    def outer(x):
        return 10 * inner(x, 0.0) + inner(0.0 * x, 0.0)

    return outer


print(*(adder(float(word))(1.0) for word in sys.argv[1:]))
""".replace("LINES", "\n".join(f"        x = x + y * shift / (x + {number} + y)" for number in range(2, 302)))
"""Two variants of a function that is too long to be merged into what calls it."""


@pytest.mark.parametrize("rest", [b"cno_such_module\nNoSuchType\n.", b"coctoctrl.sim.errors\nNoSuchType\n.", b""])
def test_an_index_that_can_no_longer_be_read_is_made_anew(tmp_path, rest):
    """Types that compiled code takes move between versions of the package, and the disk keeps what the older one wrote."""
    first = start(tmp_path)
    for path in (tmp_path / "cache").rglob("*.nbi"):
        with open(path, "rb") as file:
            version = pickle.load(file)
        path.write_bytes(pickle.dumps(version) + rest)
    assert start(tmp_path) == first == (15.0, 0, 1)
    assert start(tmp_path) == (15.0, 1, 0)


def test_variants_compiled_by_different_processes_do_not_take_each_others_place(tmp_path):
    (tmp_path / "variants.py").write_text(VARIANTS)
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join(filter(None, sys.path)), NUMBA_CACHE_DIR=str(tmp_path / "cache"))

    def run(*shifts):
        done = subprocess.run(
            [sys.executable, "variants.py", *shifts], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout.split()

    # The second of the first process and the second of the second are numbered alike by numba.
    assert run("9", "1") == ["109.0", "21.0"]
    assert run("1", "2") == ["21.0", "32.0"]
    assert run("2", "1", "9") == ["32.0", "21.0", "109.0"]


def made(shift, factor=2.0):
    def inner(x):
        return factor * x

    called = kernel(inner)

    def outer(x):
        return called(x) + shift

    return outer


def test_a_process_that_began_before_a_change_does_not_give_its_code_to_one_after_it(tmp_path):
    """While the one keeps its code, the other keeps and loads its own."""
    after, found = _Index(str(tmp_path), "f", "after"), []

    class Before(_Index):
        def _save_data(self, name, data):
            after.save("new", "new code")
            super()._save_data(name, data)
            found.append(after.load("new"))

    before = Before(str(tmp_path), "f", "before")
    before.save("old", "old code")
    assert found == ["new code"] and before.load("old") == "old code"


def test_fingerprint_depends_on_closure_and_on_called_functions():
    assert fingerprint(made(1)) == fingerprint(made(1))
    assert len({fingerprint(made(1)), fingerprint(made(2)), fingerprint(made(1, factor=3.0)), fingerprint(made(np.uint64(1)))}) == 4


def test_fingerprint_of_a_function_that_calls_itself():
    def fall(n):
        return 0 if n == 0 else fall(n - 1)

    assert fingerprint(fall) == fingerprint(fall)


def writer(shift):
    @kernel
    def write(out, number):
        out[0] += number + shift

    return write


@kernel
def in_turn(addresses, out, number):
    for which in range(addresses.shape[0] - 1):
        call(addresses, which, (out, number))


def test_kernels_are_called_by_address_in_turn():
    out, compiled = np.zeros(1), []
    for shifts in ((1.0,), (2.0, 3.0)):
        in_turn(by_address(tuple(map(writer, shifts)), out, 10.0), out, 10.0)
        compiled.append(len(in_turn.signatures))
    assert out[0] == 11.0 + 12.0 + 13.0
    assert compiled[0] == compiled[1]  # compiled once for them all


def test_what_is_compiled_for_a_call_is_found_for_an_address_and_the_other_way_round(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path))
    for called_first in (True, False):
        out, shift = np.zeros(1), 30.0 + called_first
        for called in (called_first, not called_first):
            write = writer(shift)
            if called:
                write(out, 10.0)
            else:
                in_turn(by_address((write,), out, 10.0), out, 10.0)
        assert out[0] == 2 * (10.0 + shift) and write.stats.cache_hits and not write.stats.cache_misses


def test_a_kernel_at_an_address_is_called_with_nothing_that_it_is_not_compiled_for():
    out = np.zeros(1)
    with pytest.raises(TypeError, match="called with other types than it is compiled for"):
        in_turn(by_address((writer(1.0),), out, 10.0), out, np.float32(10.0))
    assert out[0] == 0.0


@pytest.mark.parametrize("options", [{}, {"fastmath": False}])
def test_options_belong_to_the_key(options):
    def double(x):
        return 2 * x

    compiled = kernel(**options)(double)
    assert compiled(2.0) == 4.0
    assert ("contract" in compiled._cache._settings) == (not options)


def test_what_cannot_be_kept_is_said_once():
    """Of an installation and a home that cannot be written; without the test's own folder for compiled code."""
    program = "from octoctrl.sim.compiler import kernel\n"
    program += "exec(compile('def f(x): return x\\ndef g(x): return 2 * x', '/dev/null/nowhere.py', 'exec'))\n"
    program += "print(kernel(f)(1) + kernel(g)(1))"
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"HOME": "/dev/null", "XDG_CACHE_HOME": "/dev/null", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "3\n"
    (line,) = done.stderr.splitlines()
    assert line.startswith("compiled code is not kept between runs") and "NUMBA_CACHE_DIR" in line


def test_options_of_what_is_called_count():
    def caller(**options):
        @kernel(**options)
        def inner(x):
            return 2 * x

        def outer(x):
            return inner(x)

        return fingerprint(outer)

    assert caller(inline="never") == caller(inline="never") != caller(inline="always")
