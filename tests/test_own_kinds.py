"""A primitive and a goal from outside the package, written with public names only, from the task file to the verdict and back."""

import subprocess
import sys
from dataclasses import dataclass, replace
from math import inf
from typing import ClassVar

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.planners.asking import registry
from octoctrl.sim.errors import OctoctrlError


@dataclass(frozen=True, slots=True, kw_only=True)
class Lean:
    """One longitudinal muscle alone."""

    muscle: str = "LM1"
    level: float = 0.2
    onset: float = 0.0
    rise: float = 0.4
    offset: float = inf

    def templates(self):
        timing = {"onset": self.onset, "rise": self.rise, "offset": self.offset}
        return (oc.Plateau(groups=(self.muscle,), level=self.level, **timing),)

    def bounds(self):
        return {"level": (0.0, 0.6)}

    def effort(self, seconds):
        return self.level**2 * seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class SidewaysGoal(oc.ScalarGoal):
    """Distance of the tip from the plane through the base that holds the arm's axis and z."""

    quantity: ClassVar[str] = "sideways"
    unit: ClassVar[str] = "m"
    tolerance: float = 0.01

    def read(self, outputs):
        return outputs.tip[:, 0]


@pytest.fixture(scope="module", autouse=True)
def registered():
    """What a decorator does, for as long as these tests run."""
    oc.register_primitive(Lean)
    oc.register_goal(SidewaysGoal)
    yield
    del registry._PRIMITIVES["Lean"], registry._GOALS["sideways"]


FILE = """
[task]
name = "lean"
[[task.phases]]
name = "lean"
duration = 1.0
goals = [{ quantity = "sideways", value = "6 cm" }]
[[task.drives]]
name = "pull"
primitive = "Lean"
begins = "lean"
settings = { muscle = "LM1", level = 0.1 }
"""


@pytest.fixture(scope="module")
def task(tmp_path_factory):
    path = tmp_path_factory.mktemp("own") / "lean.toml"
    path.write_text(FILE)
    return oc.tasks.load(path)


def test_task_files_name_them(task):
    (drive,), (phase,) = task.task.drives, task.task.phases
    assert drive.primitive == Lean(level=0.1) and phase.goals == (SidewaysGoal(value=0.06),)
    assert oc.goal("sideways", value=0.06) == phase.goals[0] and str(phase.goals[0]) == "sideways 0.06 ± 0.01 m"


def test_plan_run_verdict_and_file(task, tmp_path):
    plan = oc.plan(task, time_limit=600.0)  # room for compiling, once per machine
    assert plan.status.solved, plan
    assert plan.report.goals[0].miss <= 0.01 and 0.0 <= plan.schedule.primitives[0].level <= 0.6
    run = oc.execute(plan, settle=0.1)
    (check,) = [check for check in oc.verify(run).checks if check.name == "lean.sideways"]
    # A plain reading of the recording at the phase's end.
    found = np.interp(run.events[0].actual, run.recording.time, run.recording.points[:, -1, 0])
    assert check.value == pytest.approx(abs(found - 0.06), abs=1e-6) and check.unit == "m" and check.limit == 0.01
    assert check.passed, found
    back = oc.load(oc.save(tmp_path / "run.npz", run))
    assert back.plan.task == plan.task and back.plan.schedule == plan.schedule
    assert [check.value for check in oc.verify(back).checks] == [check.value for check in oc.verify(run).checks]


def test_another_arm_has_another_plan_of_the_same_task(task):
    """Tasks are compared by what they say, so that plans of equal tasks share what was built for them."""
    again = replace(task.task, drives=(replace(task.task.drives[0], primitive=Lean(level=0.1)),))
    assert again == task.task and hash(again) == hash(task.task)
    assert replace(again, drives=(replace(again.drives[0], primitive=Lean(level=0.11)),)) != again


def test_lists_and_arrays_are_taken_for_tuples():
    def lean(several, vector):
        goals = several((oc.goal("tip", value=vector), oc.goal("twist", between=several((0.0, 1.0)), window=several((0.0, 0.1)))))
        drive = oc.Drive(name="bend", primitive=oc.Bend(window=several((0.0, 0.1))), begins="a", free=several(("level",)))
        return oc.Task(name="lean", phases=several((oc.Phase(name="a", duration=1.0, goals=goals),)), drives=several((drive,)))

    assert lean(list, np.array([0.0, 0.1, 0.0])) == lean(tuple, (0.0, 0.1, 0.0)) and hash(lean(list, [0.0, 0.1, 0.0]))


TAKEN = """
from dataclasses import dataclass
from typing import ClassVar
import octoctrl as oc
from octoctrl.sim.errors import OctoctrlError

def refused(register, name, quantity):
    try:
        register(dataclass(frozen=True)(type(name, (), {"quantity": quantity, "__module__": "__main__"})))
    except OctoctrlError as error:
        return str(error)

print(refused(oc.WAY, *NAMED))
"""


@pytest.mark.parametrize(
    ("way", "named", "said"),
    [
        ("register_primitive", ("Twist", "x"), "a class called 'Twist' exists already"),
        ("register_primitive", ("TwistGoal", "x"), "a class called 'TwistGoal' exists already"),
        ("register_primitive", ("Share", "x"), "a class called 'Share' exists already"),
        ("register_goal", ("Screw", "twist"), "a goal called 'twist' exists already"),
    ],
)
def test_a_name_is_taken_whatever_was_imported_before(way, named, said):
    """In a process that has looked up nothing yet, by a class that stands at the top of a script."""
    program = TAKEN.replace("WAY", way).replace("NAMED", repr(named))
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert found == f"{said}; choose another name\n"


def test_names_that_are_taken_are_refused():
    with pytest.raises(OctoctrlError, match="a class called 'Twist' exists already; choose another name"):

        @oc.register_primitive
        @dataclass(frozen=True)
        class Twist:
            level: float = 0.1

    with pytest.raises(OctoctrlError, match="a goal called 'twist' exists already; choose another name"):

        @oc.register_goal
        @dataclass(frozen=True)
        class Screw:
            quantity: ClassVar[str] = "twist"

    with pytest.raises(OctoctrlError, match="Bare is not a dataclass; write @dataclass"):

        @oc.register_goal
        class Bare:
            quantity = "bare"

    with pytest.raises(OctoctrlError, match=r"Nameless has no quantity; write quantity: ClassVar\[str\]"):

        @oc.register_goal
        @dataclass(frozen=True)
        class Nameless:
            level: float = 0.1
