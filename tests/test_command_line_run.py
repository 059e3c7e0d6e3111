"""The main job as a user does it: plan, run, verify and compare in processes of their own; runs that are killed; plans that cannot be."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from octoctrl.carrying.results import ExecutionStatus
from octoctrl.files import store
from octoctrl.files.parts import folder_of, parts_in

PROGRAM = [sys.executable, "-m", "octoctrl"]


def octoctrl(*arguments, cwd):
    return subprocess.run([*PROGRAM, *arguments], cwd=cwd, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder in which the coil has been planned and carried out, with feedback and without."""
    path = tmp_path_factory.mktemp("coil")
    done = {
        "plan": octoctrl("plan", "coil", "-o", "plan.npz", "--json", cwd=path),
        "run": octoctrl("run", "plan.npz", "-o", "run.npz", cwd=path),
        "open": octoctrl("run", "plan.npz", "-o", "open.npz", "--open-loop", "--json", "-q", cwd=path),
    }
    for name, process in done.items():
        assert process.returncode == 0, (name, process.stderr)
    return path, done


def test_plan_says_what_it_found(folder):
    path, done = folder
    answer = json.loads(done["plan"].stdout)
    assert answer["status"] == "solved" and answer["message"].startswith("Solved: ")
    assert list(answer["phase_begins"]) == ["store", "open", "spiral", "cross", "telescope"]
    assert answer["report"]["wall_time"] < 60 and len(answer["report"]["goals"]) == 6
    assert done["plan"].stderr.splitlines() == ["preparing the planner (compiled the first time)", "planning"]
    header = store.read_header(path / "plan.npz")
    assert header["content"] == "Plan" and "[task]" in header["origin"]["configuration"]


def test_run_with_and_without_feedback(folder):
    path, done = folder
    assert "feedback tvlqr" in done["run"].stdout and "Finished: all phases" in done["run"].stdout
    assert done["run"].stdout.count(" met") == 5 and "not met" not in done["run"].stdout
    answer = json.loads(done["open"].stdout)
    assert answer["feedback"] == "open-loop" and answer["status"] == "finished" and len(answer["events"]) == 5
    assert done["open"].stderr == ""
    closed = store.load(path / "run.npz", expect="Execution")
    assert closed.status is ExecutionStatus.FINISHED and closed.recording.complete


def test_verify_answers_in_the_agreed_form(folder):
    path, _ = folder
    process = octoctrl("verify", "run.npz", "--json", cwd=path)
    answer = json.loads(process.stdout)
    assert process.returncode == 0 and answer["status"] == "pass"
    for check in answer["checks"]:
        assert {"name", "value", "limit", "margin", "pass"} <= set(check)
        assert check["margin"] == pytest.approx(check["limit"] - check["value"]) and check["pass"] == (check["margin"] >= 0)
    checks = {check["name"]: check for check in answer["checks"]}
    assert checks["writhe_rms"]["value"] <= 0.05 and checks["twist_rms"]["value"] <= 0.05 and checks["crossings"]["value"] == 0


def test_compare_draws_and_tells(folder):
    path, _ = folder
    process = octoctrl("compare", "run.npz", "--plot", "traces.png", "--json", cwd=path)
    assert process.returncode == 0
    answer = json.loads(process.stdout)
    assert answer["errors"]["twist_rms"] < 0.05 and answer["errors"]["lifted_writhe_rms"] < 0.05 and answer["level_times"]
    assert (path / "traces.png").read_bytes().startswith(b"\x89PNG")


def test_a_task_can_be_printed_edited_and_fed_back(folder):
    path, _ = folder
    text = octoctrl("tasks", "coil", "--show", cwd=path).stdout
    head, tail = text.split('name = "telescope"', 1)
    assert tail.count("value = 1.0") == 1
    (path / "my.toml").write_text(head + 'name = "telescope"' + tail.replace("value = 1.0", "value = 0.9"))
    process = octoctrl("plan", "my.toml", "-o", "my.npz", "-q", "--json", cwd=path)
    assert process.returncode == 0, process.stderr
    goals = json.loads(process.stdout)["report"]["goals"]
    assert goals[-1].pop("miss") <= 0.1
    assert goals[-1] == {
        "phase": "telescope", "quantity": "twist", "goal": "twist 0.9 ± 0.1 turns", "tolerance": 0.1, "unit": "turns",
    }  # fmt: skip
    (path / "far.toml").write_text(head + 'name = "telescope"' + tail.replace("value = 1.0", "value = 3.0"))
    process = octoctrl("plan", "far.toml", "-o", "far.npz", "-q", cwd=path)
    assert process.returncode == 3 and process.stderr == ""
    assert "Unreachable: " in process.stdout
    assert "phase 'telescope' asks for twist 3 ± 0.1 turns, but L-OM stores at most " in process.stdout
    assert store.load(path / "far.npz").status.name == "UNREACHABLE"


def test_a_plan_that_ran_out_of_time_is_kept_and_says_so(folder):
    path, _ = folder
    process = octoctrl("plan", "coil", "-o", "early.npz", "-q", "--time-limit", "0.01", cwd=path)
    assert process.returncode == 3 and "Stopped at the time limit" in process.stdout and "Traceback" not in process.stderr
    assert store.load(path / "early.npz").status.name == "TIME_LIMIT"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["plan", "coil", "-o", "plan.npz"], "plan.npz exists; use -f to replace"),
        (
            ["plan", "coli", "-o", "new.npz"],
            "unknown task 'coli'; did you mean 'coil'? (coil, coil-outward, copy, corkscrew, grasp, lm-helix, packet, reach, tip, twist, "
            "or the path of a .toml file)",
        ),
        (["plan", "coil", "-o", "new.npz", "--set", "arm.length=20"], "--set arm.length: length=20 m is outside 0.001…5 m"),
        (["plan", "coil", "-o", "new.npz", "--time-limit", "-1"], "time_limit=-1 s is outside > 0 s"),
        (["run", "run.npz", "-o", "new.npz"], "run.npz holds a run, not a plan; make one with: octoctrl plan"),
        (["run", "plan.npz", "-o", "new.npz", "--feedback", "pid"], "unknown feedback 'pid' (tvlqr, mpc, grip, open-loop)"),
        (["run", "plan.npz", "-o", "new.npz", "--threads", "2"], "the plant 'rod' has no option 'threads' (complete)"),
        (["run", "plan.npz"], "give a plan and where to write: octoctrl run plan.npz -o run.npz"),
        (["verify", "nothing.npz"], "nothing.npz does not exist"),
        (["compare", "run.npz", "--plot", "no/traces.png"], "folder no does not exist; make it first"),
    ],
    ids=["exists", "unknown task", "wrong value", "time limit", "not a plan", "feedback", "threads", "no output", "no file", "no folder"],
)
def test_bad_input_is_one_sentence_and_exit_code_2(folder, arguments, message):
    path, _ = folder
    before = {item.name: item.stat().st_mtime_ns for item in path.iterdir()}
    process = octoctrl(*arguments, cwd=path)
    assert process.returncode == 2, process.stderr
    assert message in process.stderr and "Traceback" not in process.stderr and process.stdout == ""
    assert len(process.stderr.strip().splitlines()) == 1
    assert {item.name: item.stat().st_mtime_ns for item in path.iterdir()} == before


# Killed


@pytest.fixture(scope="module")
def endless(folder):
    """The coil's plan with a last phase that nobody waits for."""
    path, _ = folder
    plan = store.load(path / "plan.npz")
    store.save(path / "endless.npz", replace(plan, schedule=replace(plan.schedule, duration=3600.0)))
    return path


def recorded(path):
    """Simulated seconds in the parts of a run that goes on; zero where there are none yet. Each part is whole at any moment."""
    return float(store.load(path).recording.time[-1]) if len(parts_in(folder_of(path))) > 1 else 0.0


def killed(path, signum, name):
    """Carry out the endless plan in a process of its own, kill it; its code, what it said, and the seconds that were recorded by then."""
    command = [*PROGRAM, "run", "endless.npz", "-o", name, "--open-loop", "-q"]
    with subprocess.Popen(command, cwd=path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 240
        try:
            while recorded(path / name) < 2.0:
                assert process.poll() is None and time.monotonic() < deadline
                time.sleep(0.1)
            known = recorded(path / name)
            os.kill(process.pid, signum)
            _, err = process.communicate(timeout=60)
        finally:
            process.kill()  # or what failed here would be waited for without end
    return process.returncode, err, known


@pytest.mark.parametrize(
    ("signum", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 130), (signal.SIGKILL, -9)], ids=["SIGINT", "SIGTERM", "SIGKILL"]
)
def test_a_killed_run_leaves_a_file_up_to_its_last_chunk(endless, signum, code):
    name = f"killed-{signum.name}.npz"
    returned, err, known = killed(endless, signum, name)
    assert returned == code, err
    assert "Traceback" not in err
    execution = store.load(endless / name)
    assert execution.status is ExecutionStatus.INTERRUPTED and not execution.recording.complete
    end = execution.recording.time[-1]
    assert end >= known and np.isfinite(execution.recording.points).all()
    np.testing.assert_allclose(np.diff(execution.recording.time), 0.01, atol=1e-9)
    if code == 130:
        assert f"stopped at {end:.2f} s, and {name} holds that; go on with: octoctrl run --resume {name}" in err
    cut = octoctrl("verify", name, cwd=endless)
    assert cut.returncode == 1 and "VERDICT fail" in cut.stdout and "unfinished_phases" in cut.stdout


def test_a_run_that_was_cut_is_compared_as_far_as_it_goes(endless):
    killed(endless, signal.SIGINT, "cut.npz")
    process = octoctrl("compare", "cut.npz", cwd=endless)
    assert process.returncode == 2 and "run stopped early: interrupted" in process.stderr and "Traceback" not in process.stderr
    assert octoctrl("compare", "cut.npz", "--overlap", cwd=endless).returncode == 0
