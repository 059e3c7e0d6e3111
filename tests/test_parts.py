"""A run in parts: whatever kills it leaves what was done, and it goes on with the bits of the unbroken run."""

import os
import re
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.carrying import run as running
from octoctrl.carrying.execution import execute, resume
from octoctrl.carrying.results import ExecutionStatus
from octoctrl.files import parts, store
from octoctrl.sim.errors import OctoctrlError


@pytest.fixture(autouse=True)
def often(monkeypatch):
    """A part after each period."""
    monkeypatch.setattr(running, "KEPT_EVERY", 0.0)
    monkeypatch.setattr(running, "WRITING", 0.0)


@pytest.fixture(scope="module")
def plan(coil_plan):
    """The coil's first phase, whose goals the arm misses, so that it waits."""
    phases = (replace(coil_plan.task.phases[0], duration=0.6),)
    drives = tuple(replace(drive, ends="") for drive in coil_plan.task.drives if drive.begins == "store")
    schedule = replace(coil_plan.schedule, duration=0.6)
    return replace(coil_plan, task=replace(coil_plan.task, phases=phases, drives=drives), schedule=schedule, phase_begins={"store": 0.0})


class Broken(Exception):
    """What ends a run like a kill does: at once, with nothing said."""


def broken_off(plan, path, periods, **options):
    """A run that leaves its parts as a process does that is killed after so many periods."""

    class Killed(parts.Parts):
        def append(self, item):
            super().append(item)
            if self._next > periods:
                raise Broken

    known = running.Parts, sys.modules["octoctrl.carrying.execution"].Parts
    sys.modules["octoctrl.carrying.execution"].Parts = Killed
    try:
        with pytest.raises(Broken):
            execute(plan, path=path, **options)
    finally:
        sys.modules["octoctrl.carrying.execution"].Parts = known[1]


def same(one, other):
    """All but how long it took."""
    assert one.recording == other.recording and one.trace == other.trace and one.events == other.events
    assert np.array_equal(one.clock, other.clock) and one.status == other.status
    assert replace(one.report.controller, design_time=0.0) == replace(other.report.controller, design_time=0.0)
    assert one.strands == other.strands
    return True


SEEN = oc.Sensors(position_noise=1e-4, angle_noise=0.01, delay=0.1, seed=3)


@pytest.mark.parametrize(
    ("options", "periods"),
    [({}, 1), ({}, 6), ({"feedback": "open-loop"}, 7), ({"sensors": SEEN}, 10), ({"settle": 0.3, "sensors": SEEN}, 15)],
    ids=["after a period", "half way", "open loop", "late and noisy sensors", "after the plan"],
)
def test_a_run_that_is_broken_off_goes_on_with_the_same_bits(tmp_path, plan, options, periods):
    whole = execute(plan, **options)
    path = tmp_path / "run.npz"
    broken_off(plan, path, periods, **options)
    cut = oc.load(path)
    assert cut.status is ExecutionStatus.INTERRUPTED and not cut.recording.complete and not path.exists()
    assert np.array_equal(cut.recording.points, whole.recording.points[: len(cut.recording.time)])
    found = resume(path)
    assert same(found, whole) and same(oc.load(path), whole)
    assert [item.name for item in tmp_path.iterdir()] == ["run.npz"]


def test_it_may_be_broken_off_again_and_again(tmp_path, plan, monkeypatch):
    whole, path = execute(plan), tmp_path / "run.npz"
    broken_off(plan, path, 3)
    append, ends = parts.Parts.append, []
    for further in (4, 4):

        def kill(self, item, left=[further]):  # noqa: B006
            append(self, item)
            left[0] -= 1
            if not left[0]:
                raise Broken

        monkeypatch.setattr(parts.Parts, "append", kill)
        with pytest.raises(Broken):
            resume(path)
        ends.append(oc.load(path).recording.time[-1])
    monkeypatch.setattr(parts.Parts, "append", append)
    assert ends == pytest.approx([0.35, 0.55]) and same(resume(path), whole)


def test_an_interrupted_run_is_whole_and_goes_on(tmp_path, plan, monkeypatch):
    whole, path, advance = execute(plan), tmp_path / "run.npz", oc.Plant().__class__.advance

    def interrupt(self, source, duration, progress=None):
        if self.time > 0.29:
            raise KeyboardInterrupt
        return advance(self, source, duration, progress=progress)

    with monkeypatch.context() as patch:
        patch.setattr("octoctrl.sim.running.plant.Plant.advance", interrupt)
        cut = execute(plan, path=path)
    assert cut.status is ExecutionStatus.INTERRUPTED and oc.load(path) == cut and parts.folder_of(path).is_dir()
    assert same(resume(path), whole) and not parts.folder_of(path).exists()
    with pytest.raises(
        OctoctrlError, match=r"run.npz.parts holds no parts to go on with, and .*run.npz exists: nothing was broken off; run the plan anew"
    ):
        resume(path)


def test_what_was_broken_off_is_not_replaced_without_a_word(tmp_path, plan):
    path = tmp_path / "run.npz"
    broken_off(plan, path, 2)
    with pytest.raises(OctoctrlError, match=r"holds a run that was broken off; go on with: octoctrl run --resume .*run.npz, or begin anew"):
        execute(plan, path=path)
    short = replace(plan, schedule=replace(plan.schedule, duration=0.1))
    execute(short, feedback="open-loop", path=path, overwrite=True)
    assert oc.load(path).recording.complete and [item.name for item in tmp_path.iterdir()] == ["run.npz"]


def test_a_new_run_takes_the_place_of_an_old_file_at_once(tmp_path, plan):
    """A run that was killed must not pass for the one before it."""
    path = tmp_path / "run.npz"
    path.write_bytes(b"old")
    broken_off(plan, path, 2, overwrite=True)
    assert oc.load(path).recording.time[-1] == pytest.approx(0.1)


def test_a_folder_belongs_to_one_process(tmp_path):
    with parts.Parts(tmp_path / "run.npz") as held:
        for options in ({"overwrite": True}, {}):
            with pytest.raises(OctoctrlError, match=r"run.npz is being written by another process; wait for it, or give another path"):
                parts.Parts(tmp_path / "run.npz", **options)
        assert held.folder.is_dir()
    assert not held.folder.exists()
    parts.Parts(tmp_path / "run.npz").close()


def test_a_plant_or_feedback_of_ones_own_is_given_again(tmp_path, plan):
    path = tmp_path / "run.npz"
    whole = execute(plan, plant=oc.Plant(plan.arm, gains={"LM1": 0.5}))
    broken_off(plan, path, 5, plant=oc.Plant(plan.arm, gains={"LM1": 0.5}))
    with pytest.raises(OctoctrlError, match=r"state has gain of LM1=0\.5, this plant gain of LM1=none; make the plant as it was"):
        resume(path)
    assert same(resume(path, plant=oc.Plant(plan.arm, gains={"LM1": 0.5})), whole)

    def still(time, observation):
        return np.zeros(11)

    other = tmp_path / "other.npz"
    broken_off(plan, other, 2, feedback=still)
    with pytest.raises(OctoctrlError, match=r"the run had a feedback of its own; give one that is made as that was, feedback=\.\.\."):
        resume(other)
    assert resume(other, feedback=still).status is ExecutionStatus.FINISHED


class Forgetful:
    """Cannot say what it remembers."""

    name, patience = "forgetful", 0.0

    def __init__(self, plan):
        self._inner = oc.controllers.open_loop(plan)

    def levels(self, observation, reading):
        return self._inner.levels(observation, reading)

    def report(self):
        return self._inner.report()


def test_what_cannot_go_on_says_so_and_is_kept(tmp_path, plan):
    path = tmp_path / "run.npz"
    broken_off(plan, path, 2, feedback=Forgetful(plan))
    with pytest.raises(
        OctoctrlError, match=r"the feedback has no state\(\) and restore\(\), so that the run cannot go on; run the plan anew"
    ):
        resume(path, feedback=Forgetful(plan))
    assert oc.load(path).recording.time[-1] == pytest.approx(0.1)


def test_damaged_parts_are_said_to_be(tmp_path, plan):
    path = tmp_path / "run.npz"
    broken_off(plan, path, 3)
    folder = parts.folder_of(path)
    whole = (folder / "000002.npz").read_bytes()
    (folder / "000002.npz").write_bytes(whole[:2000])
    for read in (oc.load, resume):
        with pytest.raises(OctoctrlError, match=r"000002.npz is not a file of octoctrl, or is damaged"):
            read(path)
    store.save(folder / "000002.npz", plan.task, overwrite=True)
    for read in (oc.load, resume):
        with pytest.raises(OctoctrlError, match=r"damaged"):
            read(path)
    (folder / "000002.npz").unlink()
    (folder / "000000.npz").unlink()
    with pytest.raises(OctoctrlError, match=r"run.npz.parts holds no run, or is damaged"):
        oc.load(path)


ALL_PARTS = """
import os, signal, sys, threading
from octoctrl.carrying import run
from octoctrl.cli.application import main
from octoctrl.files.parts import Parts

def append(parts, item, known=Parts.append):
    known(parts, item)
    if parts._next == until:
        threading.Timer(0.003, os.kill, (os.getpid(), signal.SIGKILL)).start()

run.KEPT_EVERY = run.WRITING = 0.0
until, Parts.append = int(sys.argv.pop()), append
sys.exit(main())
"""
"""A part after each period, and a kill 3 ms after so many, wherever that is; another process that waits for them may come too late."""


def test_kill_9_at_any_moment(tmp_path, coil_plan):
    """In earnest, on the command line; `benchmarks/kills.py` does it often."""
    store.save(tmp_path / "plan.npz", coil_plan)
    # The unbroken run is of a process of its own too: all take their compiled code from one cache.
    command = [sys.executable, "-m", "octoctrl", "run", "plan.npz", "-o", "whole.npz", "--anyway", "-q"]
    unbroken = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert unbroken.returncode == 0, unbroken.stderr
    whole, path = oc.load(tmp_path / "whole.npz"), tmp_path / "run.npz"
    for arguments, until in ((["plan.npz", "-o", "run.npz", "--anyway"], 27), (["--resume", "run.npz"], 0)):
        command = [sys.executable, "-c", ALL_PARTS, "run", *arguments, "-q", str(until)]
        ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert ended.returncode == (-signal.SIGKILL if until else 0), ended.stderr
        found = oc.load(path).recording
        assert np.array_equal(found.points, whole.recording.points[: len(found.time)])
    assert same(oc.load(path), whole) and sorted(os.listdir(tmp_path)) == ["plan.npz", "run.npz", "whole.npz"]


def test_the_command_says_what_to_give(tmp_path, monkeypatch, capsys):
    from octoctrl.cli.application import main

    monkeypatch.chdir(tmp_path)
    cases = {
        "give a plan and where to write: octoctrl run plan.npz -o run.npz": ["run"],
        "--resume goes on with a run as it was begun; give the run and nothing else": ["run", "plan.npz", "--resume", "run.npz"],
        "run.npz.parts holds no parts to go on with, and run.npz does not exist; run the plan anew": ["run", "--resume", "run.npz"],
    }
    for message, arguments in cases.items():
        assert main(arguments) == 2
        said = capsys.readouterr().err
        assert re.fullmatch(rf"octoctrl: {re.escape(message)}.*\n", said), said
