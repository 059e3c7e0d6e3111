"""Sweeps: rows that survive a kill, workers that die, shares, and the same table on any executor."""

import contextlib
import csv
import json
import logging
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace

import pytest
from sweep_work import held_back, square

import octoctrl as oc
from octoctrl.cli.application import main
from octoctrl.connect import sweep as sweeping
from octoctrl.connect.rows import Rows, read_rows, write_table
from octoctrl.connect.sweep_file import read_sweep
from octoctrl.files import store
from octoctrl.files.toml_writing import toml_of
from octoctrl.sim.errors import OctoctrlError


def jobs(count, **changes):
    return [{"index": i, "key": f"k{i}", "changes": changes.get(f"k{i}", {})} for i in range(count)]


def driven(todo, make, waiting=4):
    rows = []
    sweeping.drive(todo, make, rows.append, work=square, waiting=waiting)
    return sorted(rows, key=lambda row: row["index"])


def spawned():
    return ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn"))


WHOLE = [{"index": i, "key": f"k{i}", "status": "finished", "square": i**2} for i in range(40)]


def test_a_worker_that_dies_loses_nobodys_run_and_who_always_kills_is_lost(tmp_path):
    todo = jobs(40, k7={"kill": str(tmp_path / "once")}, k20={"kill": "always"}, k30={"fail": True})
    rows = driven(todo, spawned)
    assert (tmp_path / "once").exists()
    assert [row for row in rows if row["index"] not in (20, 30)] == [row for row in WHOLE if row["index"] not in (20, 30)]
    assert rows[20] == {"index": 20, "key": "k20", "kill": "always", "status": "lost", "note": "its worker died"}
    assert rows[30] == {"index": 30, "key": "k30", "fail": True, "status": "lost", "note": "ValueError: odd number"}


def test_the_same_on_dask(tmp_path):
    distributed = pytest.importorskip("distributed")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "local_directory": str(tmp_path)}
    with distributed.LocalCluster(**settings) as cluster, distributed.Client(cluster) as client:
        client.run(lambda path: __import__("sys").path.insert(0, path), str(__file__).rpartition("/")[0])
        todo = jobs(40, k7={"kill": str(tmp_path / "once")})
        with contextlib.suppress(FileNotFoundError):
            (tmp_path / "once").unlink()
        assert driven(todo, lambda: contextlib.nullcontext(client.get_executor(pure=False))) == WHOLE


def test_an_executor_that_breaks_has_to_be_made_again():
    broken = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"))
    with pytest.raises(OctoctrlError, match="the executor broke when a worker died; give a callable that makes one"):
        driven(jobs(3, k1={"kill": "always"}), sweeping._maker(broken))


# The file of rows


def test_torn_lines_are_run_again_and_whole_ones_kept(tmp_path):
    path = tmp_path / "rows.jsonl"
    path.write_bytes(b'{"key": "a", "index": 0}\n[1]\n{"key": "b", "ind')
    with Rows(path) as rows:
        assert set(rows.known) == {"a"}
        with pytest.raises(OctoctrlError, match="is being written by another process"):
            Rows(path)
        rows.add({"key": "b", "index": 1})
    assert path.read_bytes() == b'{"key": "a", "index": 0}\n[1]\n{"key": "b", "index": 1}\n'


def test_tables_are_in_order(tmp_path):
    rows = [
        {"index": 1, "key": "b", "x": 2.5, "status": "lost", "note": 'a, "b"'},
        {"index": 0, "key": "a", "y": None, "x": 1, "status": "f"},
    ]
    assert write_table(tmp_path / "t.csv", rows).read_text() == 'index,status,y,x,note,key\n0,f,,1,,a\n1,lost,,2.5,"a, ""b""",b\n'


# From file to table


@pytest.fixture
def file(tmp_path, coil_plan):
    phases = (replace(coil_plan.task.phases[0], duration=0.3),)
    drives = tuple(replace(drive, ends="") for drive in coil_plan.task.drives if drive.begins == "store")
    task, schedule = replace(coil_plan.task, phases=phases, drives=drives), replace(coil_plan.schedule, duration=0.3)
    short = replace(coil_plan, task=task, schedule=schedule, phase_begins={"store": 0.0})
    store.save(tmp_path / "plan.npz", short, origin={"configuration": toml_of(oc.tasks.load("coil"))})
    path = tmp_path / "sweep.toml"
    path.write_text(
        'plan = "plan.npz"\nseed = 3\nruns = 2\n[set]\n"run.feedback" = "open-loop"\n"sensors.angle_noise" = 0.01\n'
        '[grid]\n"scene.water.factor" = { from = 0.5, to = 2.0, count = 2 }\n"gains.R-OM" = [1.0, 0.5]\n'
        '[random]\n"arm.oblique.maximum_stress" = [6e4, 9e4]\n'
    )
    return path


def bare(rows):
    return [{name: value for name, value in row.items() if name != "seconds"} for row in rows]


def test_a_sweep_goes_on_and_is_the_same_however_it_is_run(file, tmp_path):
    rows = oc.sweep(file)
    assert [row["index"] for row in rows] == list(range(8)) and {row["status"] for row in rows} == {"finished"}
    assert len({row["hash"] for row in rows}) == 8 and [row["gains.R-OM"] for row in rows] == [1.0, 1.0, 0.5, 0.5] * 2
    assert [row["scene.water.factor"] for row in rows] == [0.5] * 4 + [2.0] * 4 and all(row["verdict"] == "fail" for row in rows)
    table = list(csv.DictReader((tmp_path / "sweep.csv").open()))
    assert [line["hash"] for line in table] == [row["hash"] for row in rows] and float(table[0]["twist_rms"]) == rows[0]["twist_rms"]
    lines = (tmp_path / "sweep.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "sweep.jsonl").write_text("".join(lines[:3]) + lines[3][:40])
    assert bare(oc.sweep(file, executor=ThreadPoolExecutor(2))) == bare(rows)
    assert len((tmp_path / "sweep.jsonl").read_text().splitlines()) == 8


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals cannot be held back here")
def test_ctrl_c_reaches_no_worker(capfd):
    with pytest.raises(KeyboardInterrupt), sweeping.Workers(1) as workers:
        assert signal.SIGINT in workers.submit(held_back).result() and signal.SIGINT not in held_back()
        waiting, begin = [workers.submit(time.sleep, 20) for _ in range(4)], time.perf_counter()
        waiting[-1].cancel()
        while not waiting[0].running():
            time.sleep(0.01)
        raise KeyboardInterrupt
    assert capfd.readouterr().err == "" and time.perf_counter() - begin < 15


@pytest.mark.skipif(shutil.which("pgrep") is None, reason="needs pgrep")
def test_ctrl_c_while_workers_start_is_one_sentence_and_keeps_what_is_done(file, tmp_path):
    keys = [job["key"] for job in read_sweep(file).jobs()]
    (tmp_path / "sweep.jsonl").write_text("".join(json.dumps({"index": i, "key": keys[i]}) + "\n" for i in range(3)))
    command = [sys.executable, "-m", "octoctrl", "sweep", str(file), "-j", "2", "-q"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    while process.poll() is None and subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True).stdout.count(b"\n") < 3:
        time.sleep(0.02)  # two workers, and what looks after what they share
    os.killpg(process.pid, signal.SIGINT)
    out, said = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "") and len(read_rows(tmp_path / "sweep.jsonl")) == 3
    assert said == f"3 of 8 runs are done and kept in {tmp_path / 'sweep.jsonl'}; start it again to go on\ninterrupted\n"


def test_shares_come_to_the_whole(file, tmp_path, capsys):
    for share in ("2/2", "1/2"):
        assert main(["sweep", str(file), "--share", share, "-q"]) == 0
    assert main(["sweep", str(file), "--gather"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == " 8 runs: 8 finished fail"
    found = bare(json.loads(line) for line in (tmp_path / "sweep.jsonl").read_text().splitlines())
    assert sorted(row["index"] for row in found) == list(range(8))
    assert len(read_rows(tmp_path / "sweep.1-of-2.jsonl")) == 4
    assert len(oc.sweep(file)) == 8, "which has nothing left to do"


def test_what_a_run_draws_depends_on_seed_and_index_alone(file):
    first = read_sweep(file).jobs()
    assert first == read_sweep(file).jobs() and len({job["key"] for job in first}) == 8
    drawn = [job["changes"]["arm.oblique.maximum_stress"] for job in first]
    assert len(set(drawn)) == 8 and all(6e4 <= value <= 9e4 for value in drawn)
    file.write_text(file.read_text().replace("runs = 2", "runs = 3"))
    assert [job["changes"]["arm.oblique.maximum_stress"] for job in read_sweep(file).jobs()][:8] == drawn


BASE = 'task = "coil"\n'
MISTAKES = {
    "": 'give either task = "coil" (or a task file), or plan = "plan.npz"',
    'task = "coil"\nplan = "p.npz"': 'give either task = "coil"',
    'task = "coi"': "unknown task 'coi'",
    BASE + "grd = 1": "unknown key 'grd'; did you mean 'grid'? (known: task, plan, seed, runs, set, grid, random)",
    BASE + "grid = 1": "'grid' is not a table; write [grid] and under it lines such as",
    BASE + "[grid]\n'scene.water.factor' = 1": "'scene.water.factor' of the grid: give a list of values, or {",
    BASE + "[random]\n'scene.water.factor' = [1]": "is drawn at random: give the ends of its range, [lowest, highest]",
    BASE + "[random]\n'scene.water.factor' = [1, 'b']": "'scene.water.factor': the ends of a range are numbers, found 'b'",
    BASE + "[random]\n'scene.water.factor' = [1, inf]": "the ends of a range are numbers, found inf",
    BASE + "[set]\n'scene.watr.factor' = 1": "unknown key",
    BASE + "[grid]\n'scene.water.factor' = [1, -1]": "factor",
    BASE + "[set]\n'sensors.noise' = 1": "unknown key 'sensors.noise'; did you mean 'spin_noise'? (known: position_noise, ",
    BASE + "[set]\n'gains.LM9' = 1": "unknown key 'gains.LM9'",
    BASE + "[set]\n'colour' = 1": "unknown key 'colour' (keys begin with task, arm, scene, plan, run, gains, sensors)",
    BASE + "[set]\n'arm.length' = 0.2\n[grid]\n'arm.length' = [0.2]": "'arm.length' is changed twice; give it in one of",
    'task = "grasp"\n[grid]\n"scene.objects.post.name" = ["post", "pole"]': "about object 'post', which the scene does not have (pole)",
    BASE + "runs = 0": "runs",
    BASE + "[set]\n'arm.length' = 1979-05-27": "'arm.length' is date 1979-05-27; give a number, a text, true or false, or a list of these",
    "a = [": "not valid TOML",
}


@pytest.mark.parametrize("text", MISTAKES, ids=range(len(MISTAKES)))
def test_mistakes_are_said_before_anything_is_run(tmp_path, capsys, monkeypatch, text):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(text)
    assert main(["sweep", "s.toml"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("octoctrl: ") and MISTAKES[text] in said and said.count("\n") == 1, said
    assert [item.name for item in tmp_path.iterdir()] == ["s.toml"]


def test_a_made_plan_cannot_be_planned_anew(file, capsys):
    file.write_text('plan = "plan.npz"\n[set]\n"task.duration" = 1.0\n')
    assert main(["sweep", str(file)]) == 2
    assert "'task.duration' cannot be changed, for the plan is made; give task = ... to plan each run" in capsys.readouterr().err


def test_files_of_others_are_left_alone(file, tmp_path):
    table, rows = tmp_path / "sweep.csv", tmp_path / "sweep.jsonl"
    table.write_text("time,x\n0,1\n")
    with pytest.raises(OctoctrlError, match=r"sweep\.csv exists and is no table of a sweep"):
        oc.sweep(file)
    assert table.read_text() == "time,x\n0,1\n" and not rows.exists()
    for text in ('{"note": "mine"}', "mine", '{"note": "mine"}\n'):
        rows.write_text(text)
        with pytest.raises(OctoctrlError, match=r"sweep\.jsonl holds something else than rows of a sweep"):
            Rows(rows)
        assert rows.read_text() == text
    rows.write_text('{"index": 0, "ke')
    with Rows(rows) as torn:
        assert not torn.known
