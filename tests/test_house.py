"""The house's rules, held by reading the source: imports in one direction, small modules, documented functions, a whole wheel."""

import ast
import importlib
import inspect
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FOLDERS = {"octoctrl": "octoctrl", "octoctrl.sim": "sim", "octoctrl.planners": "planners"}
MODULES = sorted(path for folder in FOLDERS.values() for path in (ROOT / folder).glob("*.py"))
HEAVY = {"numba", "casadi", "control", "scipy", "matplotlib"}


def identity(path):
    return str(path.relative_to(ROOT))


def module_name(path):
    package = next(name for name, folder in FOLDERS.items() if path.parent == ROOT / folder)
    return package if path.stem == "__init__" else f"{package}.{path.stem}"


def imports(path, nodes=None):
    """Absolute names of all that a module imports; `from a import b` gives a and a.b."""
    package = module_name(path) if path.stem == "__init__" else module_name(path).rpartition(".")[0]
    found = set()
    for node in ast.walk(ast.parse(path.read_text())) if nodes is None else nodes:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package.split(".")[: len(package.split(".")) - node.level + 1]) if node.level else ""
            source = ".".join(filter(None, (base, node.module)))
            found |= {source, *(f"{source}.{alias.name}" for alias in node.names)}
    return {name for name in found if name}


def ours(names):
    return {name for name in names if name == "octoctrl" or name.startswith("octoctrl.")}


@pytest.mark.parametrize("path", [path for path in MODULES if path.parent.name == "sim"], ids=identity)
def test_sim_imports_nothing_of_ours_outside_sim(path):
    assert not {name for name in ours(imports(path)) if name.split(".")[1:2] != ["sim"]}


@pytest.mark.parametrize("path", [path for path in MODULES if path.parent.name == "planners"], ids=identity)
def test_planners_know_the_vocabulary_and_never_a_plant(path):
    own = {name for name in ours(imports(path)) if name.split(".")[1:2] == ["planners"]}
    others = ours(imports(path)) - own
    assert all(name.startswith("octoctrl.sim.") for name in others), others
    used = {name.split(".")[2] for name in others}
    vocabulary = {"activation", "arm", "errors", "muscles", "recording", "scene", "topology", "trace"}
    assert used <= vocabulary, used - vocabulary


@pytest.mark.parametrize("path", [path for path in MODULES if path.parent.name == "octoctrl"], ids=identity)
def test_front_door_imports_heavy_packages_only_where_used(path):
    top = imports(path, ast.parse(path.read_text()).body)
    assert not {name.partition(".")[0] for name in top} & HEAVY


def test_package_list_is_the_folders():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert settings["packages"] == list(FOLDERS) and settings["package-dir"] == FOLDERS
    for folder in FOLDERS.values():
        inside = [path for path in (ROOT / folder).rglob("*.py") if path.parent != ROOT / folder and not path.parent.is_symlink()]
        assert not [path for path in inside if path.relative_to(ROOT).parts[:2] not in {("octoctrl", "sim"), ("octoctrl", "planners")}]


@pytest.mark.parametrize("path", MODULES, ids=identity)
def test_modules_are_small_and_named_for_what_they_do(path):
    assert len(path.read_text().splitlines()) <= 500
    assert path.stem not in {"utils", "util", "helpers", "common", "misc"}
    assert ast.get_docstring(ast.parse(path.read_text())), "a module says what it is for"


def public_functions(path):
    """Public functions and methods as (name, node); those of private classes and nested ones are left out."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield node.name, node
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for inner in node.body:
                if isinstance(inner, ast.FunctionDef) and not inner.name.startswith("_"):
                    yield f"{node.name}.{inner.name}", inner


@pytest.mark.parametrize("path", [path for path in MODULES if not path.stem.endswith("_kernels")], ids=identity)
def test_public_functions_say_what_they_do_and_take(path):
    silent, undocumented = [], []
    for name, node in public_functions(path):
        said = ast.get_docstring(node)
        if not said:
            silent.append(name)
            continue
        arguments = [argument.arg for argument in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
        undocumented += [f"{name}({word})" for word in arguments if word not in ("self", "cls") and not documented(word, said)]
    assert not silent and not undocumented


def documented(word, said):
    """By name in the Parameters section; a short docstring without one explains itself."""
    if "Parameters\n----------" in said:
        return re.search(rf"^(?:[\w*]+, )*\*{{0,2}}{word}(?:, [\w*]+)*(?: :|$)", said, re.MULTILINE) is not None
    return len(said.splitlines()) <= 12


@pytest.mark.parametrize("path", [path for path in MODULES if path.parent.name == "octoctrl" and path.stem != "cli"], ids=identity)
def test_front_door_names_every_parameter(path):
    for name, node in public_functions(path):
        said = ast.get_docstring(node)
        arguments = [argument.arg for argument in (*node.args.args, *node.args.kwonlyargs) if argument.arg != "self"]
        missing = [word for word in arguments if not re.search(rf"\b{word}\b", said)]
        assert not missing or "Show nothing" in said, f"{name}: {missing}"


def test_public_names_exist():
    package = importlib.import_module("octoctrl")
    for name, module in package._HOME_OF.items():
        path = ROOT / FOLDERS[module.rpartition(".")[0]] / f"{module.rpartition('.')[2]}.py"
        if path.is_file():
            assert re.search(rf"^(?:def|class) {name}\b", path.read_text(), re.MULTILINE), f"{module} has no {name}"
    assert package.__all__ == sorted(package.__all__) and set(package._HOME_OF) <= set(package.__all__)
    assert inspect.getdoc(package)


def test_registry_of_the_store_is_complete():
    """Every dataclass and enum of the vocabulary can be stored."""
    from octoctrl import store

    for module, names in store._HOMES.items():
        found = {
            name
            for name, kind in vars(importlib.import_module(module)).items()
            if inspect.isclass(kind)
            and kind.__module__ == module
            and (hasattr(kind, "__dataclass_fields__") or hasattr(kind, "__members__"))
        }
        assert set(names) == {name for name in found if not name.startswith("_")} - {"Section"}, module


def test_no_path_of_this_machine():
    for path in [*MODULES, *ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), ROOT / ".ci" / "run", *(ROOT / "octoctrl").rglob("*.toml")]:
        assert not re.search(r"/(?:home|root|work|Users)/", path.read_text()), path


def test_wheel_holds_every_module_and_data_file(tmp_path):
    source = tmp_path / "source"
    for folder in FOLDERS.values():
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns("__pycache__"), symlinks=True)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--wheel-dir",
        str(tmp_path),
        str(source),
    ]
    subprocess.run(command, check=True, capture_output=True, text=True)
    (wheel,) = tmp_path.glob("octoctrl-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    wanted = set()
    for package, folder in FOLDERS.items():
        for path in (ROOT / folder).rglob("*"):
            inside = path.relative_to(ROOT / folder)
            if path.is_file() and "__pycache__" not in inside.parts and not any(part in ("sim", "planners") for part in inside.parts[:1]):
                wanted.add(f"{package.replace('.', '/')}/{inside.as_posix()}")
    assert packed == wanted
