"""What a user's type checker says of octoctrl as it is installed from the wheel."""

import os
import subprocess
import sys
import zipfile

import pytest
from test_installation import interpreter

SCRIPT = """
from collections.abc import Mapping
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import octoctrl as oc


def weaker(plan: oc.Plan, share: float) -> oc.Plan:
    print(plan.task.name, plan.schedule.duration, plan.status.value)
    return plan if share > 1 else oc.plan(plan.task)


task = oc.Task(
    name="bend",
    phases=(oc.Phase(name="hold", duration=1.0),),
    drives=(oc.Drive(name="pull", primitive=oc.Bend(), begins="hold"),),
)
plan = oc.plan(task, time_limit=10.0)
assert_type(plan, oc.Plan)
run = oc.execute(weaker(plan, 0.5), feedback="open-loop")
assert_type(run, oc.Execution)
tip: NDArray[np.float64] = run.recording.points[:, -1]
settled = [event.phase for event in run.events if event.met]
verdict = oc.verify(run)
assert_type(verdict, oc.Verdict)
assert_type(verdict.passed, bool)
failed: Mapping[str, float] = {check.name: check.value for check in verdict.checks if not check.passed}
oc.plot(run, "traces.png", panels=("twist",), size=(4.0, 3.0))
oc.save("run.npz", run, overwrite=True)
pull = oc.Activation(templates=(oc.Plateau(groups=("LM1",), level=0.3, rise=0.1),))
plant = oc.Plant(oc.Arm.octopus(elements=24), oc.Scene.free(factor=2.0))
print(tip.shape, settled, failed, plant.advance(pull, 0.5).time[-1])
"""
"""Some thirty lines that anyone could write."""

WRONG = {
    "oc.frob": 'Module has no attribute "frob"',
    "oc.plan('coil').frob": '"Plan" has no attribute "frob"',
    "oc.execute(3)": 'Argument 1 to "execute" has incompatible type "int"',
    "oc.plan('coil', time_limit='long')": 'Argument "time_limit" to "plan" has incompatible type "str"',
    "oc.verify(oc.plan('coil'))": 'Argument 1 to "verify" has incompatible type "Plan"',
    "oc.Bend(side=3)": "incompatible type",
    "oc.plot(oc.plan('coil'))": 'Argument 1 to "plot" has incompatible type "Plan"',
    "oc.Arm(elements='many')": 'Argument "elements" to "Arm" has incompatible type "str"',
}


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """Python of an environment in which the wheel is installed."""
    python, packages = interpreter(tmp_path_factory.mktemp("environment"))
    zipfile.ZipFile(wheel).extractall(packages)
    return python


def checked(python, folder, text):
    """What mypy says of a script, line by line."""
    (folder / "script.py").write_text(text)
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "MYPYPATH")}
    command = [sys.executable, "-m", "mypy", "--strict", "--python-executable", str(python), "--cache-dir", str(python.parent), "script.py"]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True).stdout


def test_a_script_is_understood(python, tmp_path):
    assert checked(python, tmp_path, SCRIPT) == "Success: no issues found in 1 source file\n"


def test_mistakes_are_found(python, tmp_path):
    said = checked(python, tmp_path, "import octoctrl as oc\n\n" + "\n".join(WRONG) + "\n")
    for line, (code, complaint) in enumerate(WRONG.items(), start=3):
        assert any(text.startswith(f"script.py:{line}: error:") and complaint in text for text in said.splitlines()), (code, said)


def test_every_public_name_has_a_type(python, tmp_path):
    """Not one of them is `Any`, which would let everything pass."""
    import octoctrl

    names = sorted(octoctrl.__all__)
    said = checked(python, tmp_path, "import octoctrl as oc\n\n" + "\n".join(f"reveal_type(oc.{name})" for name in names) + "\n")
    revealed = [line.split('Revealed type is "')[1].rstrip('"') for line in said.splitlines() if "Revealed type" in line]
    assert len(revealed) == len(names), said
    for name, kind in zip(names, revealed, strict=True):
        # What a file holds is known when it is read.
        assert kind != "Any" and (name == "load" or not kind.endswith("-> Any")), (name, kind)
