import json
import os
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import pytest
from conftest import coil_execution

from octoctrl import tasks
from octoctrl.carrying.results import ExecutionStatus
from octoctrl.cli.application import main
from octoctrl.files import store
from octoctrl.files.configuration import parse
from octoctrl.judging.verification import Limits, verify
from octoctrl.planners.solving.plan import PlanStatus
from octoctrl.progress import NullProgress, Progress, RichProgress
from octoctrl.sim.errors import OctoctrlWarning

HEAVY = ("numba", "casadi", "control", "scipy", "matplotlib")


@pytest.mark.parametrize(
    "arguments", [["--help"], ["tasks"], ["tasks", "coil", "--show"], ["--version"], ["plan", "--help"], ["plan", "frob"]]
)
def test_quick_answers_import_nothing_heavy(arguments):
    program = f"import sys\nfrom octoctrl.cli.application import main\nmain({arguments!r})\n"
    program += f"print([m for m in {HEAVY!r} if m in sys.modules], file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "[]"


def test_public_names_resolve_lazily():
    program = "import sys, octoctrl as oc\nassert not hasattr(oc, 'frob')\noc.Arm, oc.Task, oc.tasks, oc.load, oc.verify, oc.Bend\n"
    program += f"assert set(oc.__all__) <= set(dir(oc))\nprint([m for m in {HEAVY!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_tasks_lists_and_shows(capsys):
    assert main(["tasks"]) == 0
    assert capsys.readouterr().out.startswith(" coil ")
    assert main(["tasks", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == set(tasks.names())
    assert main(["tasks", "coil", "--show"]) == 0
    assert parse(capsys.readouterr().out) == tasks.load("coil")


@pytest.fixture
def files(tmp_path, coil_plan, coil_run, monkeypatch):
    monkeypatch.chdir(tmp_path)
    store.save("plan.npz", coil_plan)
    store.save("run.npz", coil_run)
    return tmp_path


def test_verify(files, capsys, coil_run):
    code = main(["verify", "run.npz", "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert code == 1 and answer["status"] == "fail"
    by_name = {check["name"]: check for check in answer["checks"]}
    assert {"name", "value", "limit", "margin", "pass"} <= set(by_name["writhe_rms"])
    assert {"writhe_rms", "writhe_max", "twist_rms", "crossings", "level_time", "link_residual", "activation", "tip_rms"} <= set(by_name)
    assert by_name["twist_rms"]["pass"] and by_name["crossings"]["value"] == 0
    assert not by_name["telescope.twist"]["pass"]
    assert by_name["telescope.twist"]["value"] == pytest.approx(1.0, abs=0.01)
    assert main(["verify", "run.npz"]) == 1
    out = capsys.readouterr().out
    assert "VERDICT fail" in out and out.count("FAIL") == sum(not check["pass"] for check in answer["checks"])


def test_verdict_depends_on_limits(coil_run):
    strict = {check.name: check for check in verify(coil_run, limits=Limits(twist_rms=1e-6)).checks}
    assert not strict["twist_rms"].passed and strict["twist_rms"].margin < 0


def test_late_passage_and_unfinished_phases_are_seen(coil_plan):
    early = {check.name: check for check in verify(coil_execution(coil_plan, until=1.3, status=ExecutionStatus.UNSTABLE)).checks}
    assert early["unfinished_phases"].value == 3 and not early["unfinished_phases"].passed
    assert early["telescope.twist"].value == float("inf")
    half = {check.name: check for check in verify(coil_execution(coil_plan, twist=0.4)).checks}
    assert half["level_time"].value == float("inf")


def test_compare_writes_a_picture(files, capsys):
    assert main(["compare", "run.npz", "--plot", "traces.png", "--json"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["errors"]["twist_rms"] < 0.02
    assert (files / "traces.png").read_bytes().startswith(b"\x89PNG") and "traces.png" in captured.err
    assert main(["compare", "run.npz", "--plot", "traces.png"]) == 2
    assert capsys.readouterr().err == "octoctrl: traces.png exists; use -f to replace\n"
    assert main(["compare", "run.npz", "--plot", "traces.png", "-f"]) == 0


def test_compare_of_a_cut_run_needs_overlap(files, capsys, coil_plan):
    store.save("cut.npz", coil_execution(coil_plan, until=1.2, status=ExecutionStatus.UNSTABLE))
    assert main(["compare", "cut.npz"]) == 2
    assert main(["compare", "cut.npz", "--overlap", "--plot", "cut.svg"]) == 0


def test_files_are_refused_for_what_they_hold(files, capsys):
    assert main(["verify", "plan.npz"]) == 2
    assert capsys.readouterr().err == "octoctrl: plan.npz holds a plan, not a run; make one with: octoctrl run\n"
    assert main(["run", "run.npz", "-o", "new.npz"]) == 2


def test_debug_shows_the_traceback(capsys):
    assert main(["tasks", "coli", "--debug"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("Traceback") and err.splitlines()[-1].startswith("octoctrl: unknown task 'coli'")


def test_a_fault_of_ours_has_a_code_of_its_own(capsys, monkeypatch):
    monkeypatch.setattr(tasks, "descriptions", lambda: {}["gone\naway"])
    assert main(["tasks"]) == 70
    (line,) = capsys.readouterr().err.splitlines()
    assert line == ("octoctrl: a fault of octoctrl, KeyError: 'gone\\naway'; the same command with --debug shows where, please report it")
    assert main(["--debug", "tasks"]) == 70
    assert "Traceback" in capsys.readouterr().err


def test_warnings_are_sentences_and_counted(capsys, monkeypatch):
    def warned():
        for degrees in (0.1, 2.0, 0.7):
            warnings.warn(f"the arm starts within {degrees} degrees of the opposite of the pole", OctoctrlWarning, stacklevel=2)
        warnings.warn("this once", OctoctrlWarning, stacklevel=2)
        warnings.warn("overflow", RuntimeWarning, stacklevel=2)
        return {"coil": "a coil"}

    monkeypatch.setattr(tasks, "descriptions", warned)
    assert main(["tasks"]) == 0
    said = "the arm starts within 0.1 degrees of the opposite of the pole"
    lines = [f"octoctrl: {said}", "octoctrl: this once", f"octoctrl: so it was 3 times, with numbers of its own each: {said}"]
    assert capsys.readouterr().err.splitlines() == lines


@pytest.mark.parametrize(
    ("place", "code", "said"), [("/dev/full", 2, "the output cannot be read or written: No space left on device"), (None, 0, "")]
)
def test_output_that_nobody_takes(place, code, said):
    """A full disk is said in one sentence; a reader that has seen enough is no fault."""
    command = [sys.executable, "-m", "octoctrl", "tasks", "coil", "--show"]
    if place is None:
        read, write = os.pipe()
        os.close(read)
    else:
        write = os.open(place, os.O_WRONLY)
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True)
    os.close(write)
    assert done.returncode == code and done.stderr == (f"octoctrl: {said}\n" if said else "")


def test_every_command_stands_in_a_family_and_says_what_it_does(capsys):
    from octoctrl.cli.application import FAMILIES

    names = [command.__name__ for commands in FAMILIES.values() for command in commands]
    page = (Path(__file__).parent.parent / "docs" / "commands.md").read_text()
    assert len(names) == len(set(names)) and all(f"`{name}`" in page for name in names)
    assert main(["--help"]) == 0
    out = capsys.readouterr().out
    assert all(family in out for family in FAMILIES) and all(f" {name} " in out for name in names)


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("octoctrl plan c", {"coil"}),
        ("octoctrl run plan.npz --plant a", {"assembly", "assembly-coarse", "assembly-mixed", "assembly-coarse-mixed"}),
        ("octoctrl bench st", {"steps", "startup"}),
    ],
    ids=["task", "plant", "part"],
)
def test_a_shell_completes_tasks_plants_and_parts(words, offered):
    environment = os.environ | {"_OCTOCTRL_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(len(words.split()) - 1)}
    done = subprocess.run([sys.executable, "-m", "octoctrl"], env=environment, capture_output=True, text=True)
    assert offered <= set(done.stdout.split()), done.stderr


def test_texts_are_worth_reading(coil_plan, coil_run):
    text = str(coil_plan)
    assert "counter_twist" in text and PlanStatus.SOLVED.value in text and max(map(len, text.splitlines())) < 120
    assert "telescope" in str(coil_run) and str(coil_run).splitlines()[-1].endswith("verify it.")


def test_termination_is_treated_as_interrupt(tmp_path):
    program = "import time\nfrom octoctrl.cli import application as cli\n"
    program += (
        "cli.planning.registry.descriptions = lambda: (print('up', flush=True), time.sleep(30))\nraise SystemExit(cli.main(['tasks']))"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "up\n"
        os.kill(process.pid, signal.SIGTERM)
        _, err = process.communicate(timeout=20)
    assert process.returncode == 130 and err == "interrupted\n"


def test_progress_is_a_line_where_there_is_no_terminal(capsys):
    for display in (RichProgress(), NullProgress()):
        assert isinstance(display, Progress)
        display.start("compiling", 3)
        display.advance(1, "rod")
        display.stop()
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err == "compiling\n"
