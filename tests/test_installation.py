"""Installed from the wheel, in place, or not at all: which octoctrl the tests run, and what can be imported."""

import json
import os
import re
import subprocess
import sys
import zipfile
from importlib import import_module, metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def test_tests_run_what_is_installed():
    """The wheel's modules if it is installed, the checkout's if it is installed in place or only on the path."""
    try:
        installed = metadata.distribution("octoctrl")
    except metadata.PackageNotFoundError:
        expected = ROOT / "octoctrl"
    else:
        in_place = json.loads(installed.read_text("direct_url.json") or "{}").get("dir_info", {}).get("editable", False)
        expected = ROOT / "octoctrl" if in_place else Path(str(installed.locate_file("octoctrl")))
    advice = "run `pytest` and not `python -m pytest`, which takes the octoctrl of the folder it is started in"
    assert Path(import_module("octoctrl").__file__).parent.resolve() == expected.resolve(), advice
    for name in ("sim", "planners"):
        inside = Path(import_module(f"octoctrl.{name}").__file__).parent.resolve()
        assert inside in ((expected / name).resolve(), (ROOT / name).resolve()) and (expected == ROOT / "octoctrl") == (
            inside.parent == ROOT
        )


def test_programs_that_tests_start_take_the_same(tmp_path):
    program = [sys.executable, "-c", "import octoctrl; print(octoctrl.__file__)"]
    places = {subprocess.run(program, cwd=folder, capture_output=True, text=True, check=True).stdout for folder in (tmp_path, ROOT)}
    assert places == {import_module("octoctrl").__file__ + "\n"}


def test_the_gate_runs_the_command_of_the_readme():
    (command,) = re.findall(r"^ .*'\.\[test\]' && (pytest.*)$", (ROOT / "README.md").read_text(), re.MULTILINE)
    assert f"step {command} " in (ROOT / ".ci" / "run").read_text()


# The door: `sim` and `planners` stand beside `octoctrl` in a checkout, and nothing else of the checkout can be imported.

IMPORTS = """
import importlib, sys, octoctrl
for name in ("sim.body.arm", "planners.asking.task", "files.store"):
    importlib.import_module("octoctrl." + name)
found = []
for name in sys.argv[1:]:
    try:
        importlib.import_module("octoctrl." + name)
        found.append(name)
    except ModuleNotFoundError:
        pass
print(octoctrl.__file__, *found)
"""


def interpreter(folder):
    """Python of an environment of its own that sees the packages of this one, and not its octoctrl."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    for place in map(Path, sys.path):
        for item in place.iterdir() if place.name == "site-packages" else ():
            if not item.name.startswith(("octoctrl", "__editable__")) and not (packages / item.name).exists():
                (packages / item.name).symlink_to(item)
    return folder / "bin" / "python", packages


@pytest.mark.parametrize("kind", ["checkout", "in place", "wheel"])
def test_only_the_packages_can_be_imported(kind, source, wheel, tmp_path):
    python, packages = interpreter(tmp_path / "environment")
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    for folder in ("tests", "docs"):
        (source / folder).mkdir(exist_ok=True)
    (source / "tests" / "__init__.py").touch()
    if kind == "checkout":
        environment["PYTHONPATH"], home = str(source), source
    elif kind == "in place":
        command = [python, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--editable", str(source)]
        subprocess.run(command, check=True, capture_output=True, env=environment)
        home = source
    else:
        zipfile.ZipFile(wheel).extractall(packages)
        home = packages
    beside = sorted(path.name for path in ROOT.iterdir() if path.is_dir() and path.name not in ("sim", "planners"))
    command = [python, "-c", IMPORTS, *beside, "tests.conftest", "frob"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment, check=True)
    assert {"octoctrl", "tests", "docs"} <= set(beside)
    assert done.stdout.split() == [str(home / "octoctrl" / "__init__.py")]
