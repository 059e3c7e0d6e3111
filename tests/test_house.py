"""The house's rules, held by reading the source: imports in one direction, small modules, documented functions, a whole wheel."""

import ast
import importlib
import inspect
import re
import subprocess
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FOLDERS = {"octoctrl": "octoctrl", "octoctrl.sim": "sim", "octoctrl.planners": "planners"}
MODULES = sorted(path for folder in FOLDERS.values() for path in (ROOT / folder).rglob("*.py") if not path.parent.is_symlink())

SIM_GROUND = {"errors", "findings", "compiler", "records", "rotations", "contracts", "writing", "archives", "registries", "annotations"}
VOCABULARY = {
    "errors",
    "compiler",
    "annotations",
    "records",
    "registries",
    "rotations",
    "contracts",
    "body",
    "scene",
    "templates",
    "activation",
    "sources",
    "topology",
    "running.recording",
    "running.observation",
    "contact.hold",
    "contact.measures",
}
"""What the planners know of `sim`: never a plant."""
ROOMS = {
    # Room or module of a folder, and what it may import of that folder.
    "sim": {
        "errors": {"findings"},
        "findings": set(),
        "compiler": set(),
        "writing": {"errors"},
        "archives": {"errors", "writing"},
        "registries": {"errors"},
        "annotations": {"errors"},
        "records": {"errors"},
        "rotations": set(),
        # Names types of the rooms that it is a contract between.
        "contracts": {"findings", "body", "scene", "running.clock", "running.observation", "running.recording"},
        "body": SIM_GROUND,
        "scene": SIM_GROUND,
        "topology": SIM_GROUND,
        "physics": SIM_GROUND | {"body"},
        "templates": SIM_GROUND | {"body"},
        "activation": SIM_GROUND | {"body", "templates"},
        "sources": SIM_GROUND | {"body", "templates"},
        "running": SIM_GROUND | {"body", "scene", "activation", "sources", "topology"},
        "contact": SIM_GROUND | {"scene", "physics"},
        "rod": SIM_GROUND | {"body", "scene", "activation", "sources", "topology", "physics", "running", "contact"},
        "assembly": SIM_GROUND | {"body", "scene", "activation", "sources", "topology", "physics", "running", "contact"},
        "plants": SIM_GROUND | {"body", "scene", "activation", "sources", "running", "rod", "assembly"},
    },
    "planners": {
        "contracts": set(),
        "asking": {"contracts"},
        "model": {"contracts"},
        "fitting": {"contracts", "model"},
        "solving": {"contracts", "asking", "model", "fitting"},
        "following": {"contracts", "asking", "model", "solving.plan", "solving.grasping"},
    },
    "octoctrl": {
        "progress": set(),
        "tables": set(),
        "extras": set(),
        "citation": set(),
        "files": {"progress", "tables", "extras"},
        "tasks": {"files"},
        "carrying": {"progress", "tables", "files", "tasks"},
        "judging": {"progress", "tables", "files", "carrying"},
        "pictures": {"progress", "tables", "extras", "citation", "files", "carrying", "judging"},
        "connect": {"progress", "tables", "extras", "files", "tasks", "carrying", "judging"},
        "doctor": {"progress", "tables", "files", "tasks", "carrying"},
        "bench": {"progress", "tables", "files", "tasks", "carrying", "judging"},
        "laboratory": {"progress", "tables", "files", "tasks", "carrying", "judging"},
        "__main__": {"cli"},
        "cli": {
            "progress",
            "tables",
            "citation",
            "files",
            "tasks",
            "carrying",
            "judging",
            "pictures",
            "connect",
            "doctor",
            "bench",
            "laboratory",
        },
    },
}

HEAVY = {"numba", "casadi", "control", "scipy", "matplotlib", "xarray", "h5netcdf", "gymnasium", "distributed"}


def identity(path):
    return str(path.relative_to(ROOT))


def module_name(path):
    inside = path.relative_to(ROOT).with_suffix("").parts
    parts = inside if inside[0] == "octoctrl" else ("octoctrl", *inside)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


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


def folder_of(path):
    return path.relative_to(ROOT).parts[0]


def place(name):
    """Folder and place inside it of an absolute name: octoctrl.sim.rod.stepping.x -> sim, rod.stepping.x."""
    parts = name.split(".")
    return (parts[1], ".".join(parts[2:])) if parts[1:2] in (["sim"], ["planners"]) else ("octoctrl", ".".join(parts[1:]))


def within(inner, rooms):
    return any(inner == room or inner.startswith(f"{room}.") for room in rooms)


@pytest.mark.parametrize("path", [path for path in MODULES if path.relative_to(ROOT).parts[1] != "__init__.py"], ids=identity)
def test_rooms_import_what_the_table_allows(path):
    folder, (_, own) = folder_of(path), place(module_name(path))
    room = own.partition(".")[0]
    for name in ours(imports(path)):
        other, inner = place(name)
        if not inner or (other == "octoctrl" and inner == "__version__"):
            continue
        if other == folder:
            # A package on the way to what is imported carries nothing.
            known = within(inner, {room} | ROOMS[folder][room]) or any(allowed.startswith(f"{inner}.") for allowed in ROOMS[folder][room])
            assert known, f"{room} imports {inner}"
        elif folder == "sim":
            raise AssertionError(f"sim imports {name}")
        elif folder == "planners":
            assert other == "sim", name
            assert within(inner, VOCABULARY) or any(word.startswith(f"{inner}.") for word in VOCABULARY), name


def test_table_of_rooms_is_the_folders():
    for folder, rooms in ROOMS.items():
        found = {path.relative_to(ROOT / folder).parts[0].removesuffix(".py") for path in MODULES if folder_of(path) == folder}
        assert found - {"__init__"} == set(rooms)


@pytest.mark.parametrize(
    "path", [path for path in MODULES if path.stem == "__init__" and len(path.relative_to(ROOT).parts) > 2], ids=identity
)
def test_doors_of_rooms_only_say_what_lives_there(path):
    body = ast.parse(path.read_text()).body
    assert len(body) == 1 and ast.get_docstring(ast.parse(path.read_text()))


@pytest.mark.parametrize("path", [path for path in MODULES if folder_of(path) == "octoctrl"], ids=identity)
def test_front_door_imports_heavy_packages_only_where_used(path):
    top = imports(path, ast.parse(path.read_text()).body)
    assert not {name.partition(".")[0] for name in top} & HEAVY


@pytest.mark.parametrize("path", [path for path in MODULES if folder_of(path) == "octoctrl"], ids=identity)
def test_front_door_asks_by_public_names(path):
    """Of an object that is not its own it takes no attribute with an underscore, and no rows of a compiled buffer."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Attribute) and not (isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")):
            private = node.attr.startswith("_") and not node.attr.startswith("__")
            assert not private and not (node.attr == "rows" and ast.unparse(node.value).endswith("core")), ast.unparse(node)


def test_package_list_is_the_folders():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert settings["packages"] == sorted({module_name(path / "__init__.py") for path in {path.parent for path in MODULES}})
    assert settings["package-dir"] == FOLDERS


@pytest.mark.parametrize("path", MODULES, ids=identity)
def test_modules_are_small_and_named_for_what_they_do(path):
    assert len(path.read_text().splitlines()) <= 500
    assert path.stem not in {"utils", "util", "helpers", "common", "misc"}
    assert ast.get_docstring(ast.parse(path.read_text())), "a module says what it is for"


def public_functions(path):
    """Public functions and methods as (name, node); those of private classes, nested ones and overloads are left out."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and "overload" not in map(ast.unparse, node.decorator_list):
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


@pytest.mark.parametrize("path", [path for path in MODULES if folder_of(path) == "octoctrl" and path.parent.name != "cli"], ids=identity)
def test_front_door_names_every_parameter(path):
    for name, node in public_functions(path):
        said = ast.get_docstring(node)
        arguments = [argument.arg for argument in (*node.args.args, *node.args.kwonlyargs) if argument.arg != "self"]
        missing = [word for word in arguments if not re.search(rf"\b{word}\b", said)]
        assert not missing or "Show nothing" in said, f"{name}: {missing}"


def test_public_names_exist():
    package = importlib.import_module("octoctrl")
    for name, module in package._HOME_OF.items():
        folder, inside = place(module)
        path = (ROOT / folder / inside.replace(".", "/")).with_suffix(".py")
        assert re.search(rf"^(?:def|class) {name}\b", path.read_text(), re.MULTILINE), f"{module} has no {name}"
    assert package.__all__ == sorted(package.__all__) and set(package._HOME_OF) <= set(package.__all__)
    assert inspect.getdoc(package)


def test_registry_of_the_store_is_complete():
    """Every dataclass and enum of the vocabulary can be stored."""
    from octoctrl.files import store

    for module, names in store._HOMES.items():
        found = {
            name
            for name, kind in vars(importlib.import_module(module)).items()
            if inspect.isclass(kind)
            and kind.__module__ == module
            and (hasattr(kind, "__dataclass_fields__") or hasattr(kind, "__members__"))
        }
        assert set(names) == {name for name in found if not name.startswith("_")} - {"Section"}, module


def test_the_page_of_the_house_names_every_room_and_what_it_links_exists():
    text = (ROOT / "docs" / "house.md").read_text()
    for rooms in ROOMS.values():
        assert not [room for room in rooms if room != "__main__" and f"`{room}`" not in text]
    for page in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("docs/*.md")]:
        for link in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_no_path_of_this_machine():
    for path in [*MODULES, *ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), ROOT / ".ci" / "run", *(ROOT / "octoctrl").rglob("*.toml")]:
        assert not re.search(r"/(?:home|root|work|Users)/", path.read_text()), path


def test_types_agree():
    """mypy on all rooms."""
    done = subprocess.run([ROOT / ".ci" / "types"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_nothing_does_without_types():
    """Only packages of others may; mypy would otherwise let pass what it does not look at."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mypy"]
    assert settings["disallow_untyped_defs"] and settings["check_untyped_defs"]
    for entry in settings["overrides"]:
        assert set(entry) == {"module", "ignore_missing_imports"} and not any(name.startswith("octoctrl") for name in entry["module"])


def test_wheel_holds_every_module_and_data_file(wheel):
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    wanted = set()
    for package, folder in FOLDERS.items():
        for path in (ROOT / folder).rglob("*"):
            inside = path.relative_to(ROOT / folder)
            if path.is_file() and "__pycache__" not in inside.parts and not any(part in ("sim", "planners") for part in inside.parts[:1]):
                wanted.add(f"{package.replace('.', '/')}/{inside.as_posix()}")
    assert packed == wanted
