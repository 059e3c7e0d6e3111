"""What README and docs say works: every command is understood, every one that is shown as a block runs, and so does the Python."""

import contextlib
import importlib
import re
import shlex
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

from octoctrl import tasks
from octoctrl.cli.application import app, main
from octoctrl.cli.planning import origin_of
from octoctrl.files import store
from octoctrl.files.store import save
from octoctrl.planners.asking import registry
from octoctrl.sim.errors import OctoctrlError

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
LONG = {"demo", "identify", "bench", "stability", "warmup", "sweep"}
"""Commands that take longer than all others together."""
LONG_PYTHON = {"README.md", "assembly.md", "hydrostats.md", "carrying.md", "feedback.md", "sweeps.md", "plants.md", "environments.md"}
"""Pages whose Python moves the full arm, or plans and runs more than once."""


def shown(page):
    """Commands that a page shows as lines of a block, without prompts and comments."""
    fenced, language, found = False, "", []
    for line in page.read_text(encoding="utf-8").splitlines():
        if fence := re.match(r"\s*```(\w*)", line):
            fenced, language = not fenced, fence[1]
        elif (fenced and language in ("console", "bash", "")) or (not fenced and line.startswith("    ")):
            command = re.sub(r"^\$ ", "", line.strip())
            if re.match(r"octoctrl \S", command) and not re.match(r"octoctrl \w+ +\{", command):
                words = shlex.split(command, comments=True)[1:]
                found.append(words[: words.index(">")] if ">" in words else words)
    return found


def told(page):
    """Commands that a page names within a sentence, as far as they are commands and no pattern of one."""
    inside = re.findall(r"`(?:python -m )?octoctrl ([^`]+)`", page.read_text(encoding="utf-8").replace("\n", " "))
    return [shlex.split(text) for text in inside if not re.search(r"\.\.\.|\bCOMMAND\b|\bPART\b", text)]


def python(page):
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def understood(words):
    """Whether there is such a command with such options; what is left out, a sentence leaves to its reader."""
    import typer

    group = typer.main.get_command(app)
    if words[0].startswith("-"):
        return words[0] in {"--help"} | {option for parameter in group.params for option in parameter.opts}
    known = {"--help", "--debug", "--json"} | {option for parameter in group.commands[words[0]].params for option in parameter.opts}
    return all(word in known for word in words[1:] if re.match(r"--?[a-z]", word))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_that_is_named_is_one(page):
    for words in shown(page) + told(page):
        assert understood(words), words


def test_commands_and_python_are_found():
    """The pages have not lost what this file looks for."""
    assert len([words for page in PAGES for words in shown(page)]) > 25
    assert {words[0] for page in PAGES for words in shown(page) + told(page)} >= {"plan", "run", "verify", "report", "export", "topology"}
    assert sum(len(python(page)) for page in PAGES) > 20


def shown_toml(page):
    """The first file of TOML on a page, by the name of the first such file that its commands take."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return [(re.search(r"(\w+\.toml)", text)[1], re.search(r"^```toml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)[1])]


@pytest.fixture(scope="module")
def files(tmp_path_factory, coil_plan, coil_run):
    """A folder with the files that the pages speak of."""
    from test_fibres import arm
    from test_measured import helix, written

    from octoctrl.files.toml_writing import toml_of

    folder = tmp_path_factory.mktemp("files")
    for name in ("run.npz", "a.npz", "b.npz"):
        save(folder / name, coil_run)
    save(folder / "plan.npz", coil_plan, origin=origin_of(tasks.load("coil")))
    with contextlib.suppress(OctoctrlError):  # without the extra there is no such file
        save(folder / "run.nc", coil_run)
    with contextlib.suppress(ImportError):
        from nibabel.streamlines import Tractogram
        from nibabel.streamlines import save as write

        lines = [(1e3 * line).astype(np.float32) for line in arm(curved=False)[0]]
        write(Tractogram(lines, affine_to_rasmm=np.eye(4)), str(folder / "arm.trk"))
    for name, said in shown_toml("sweeps.md"):
        (folder / name).write_text(said)
    (folder / "my.toml").write_text(toml_of(tasks.load("twist")))
    written(folder / "arm.csv", np.stack([helix(12, turns=0.5 + 0.05 * k) for k in range(9)]))
    return folder


@pytest.fixture
def desk(files, tmp_path, monkeypatch):
    """A folder of one's own with those files."""
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def runs(words, capsys):
    """A verdict that fails is an answer too: the run of these tests is made by hand."""
    code = main(["arm.glb" if word == "FILE" else word for word in words])
    said = capsys.readouterr()
    assert code in (0, 1), f"octoctrl {shlex.join(words)}: {said.err}"


def targets(words):
    """Files that a command line writes."""
    named = re.findall(r"(?:^| )(?:-o|--output|--plot) (\S+)", shlex.join(words))
    return [*named, *(words[2:3] if words[0] == "export" else [])]


def long(words):
    return bool({words[0]} & LONG or {"assembly", "--view", "--resume"} & set(words))


@pytest.mark.parametrize("page", [page for page in PAGES if shown(page)], ids=lambda page: page.name)
def test_commands_that_are_shown_run(page, desk, capsys):
    for words in shown(page):
        if long(words):
            continue
        for name in targets(words):
            Path(name).unlink(missing_ok=True)
        runs(words, capsys)
        if words[0] == "run":  # what follows speaks of a run that is there
            for name in targets(words):
                assert Path(name).exists()


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if any(map(long, shown(page)))], ids=lambda page: page.name)
def test_commands_that_take_long_run(page, desk, capsys):
    for words in shown(page):
        if long(words) and not {"--view", "--resume"} & set(words) and not {"$SLURM_ARRAY_TASK_ID/30", "--gather"} & set(words):
            for name in targets(words):
                Path(name).unlink(missing_ok=True)
            runs([*words, "-f"] if words[0] in ("plan", "run") else words, capsys)


@pytest.fixture(autouse=True)
def own_kinds():
    """What the pages register is gone after each, or others could not have its names."""
    tables = registry._PRIMITIVES, registry._GOALS, registry._PARTS, store._REGISTERED
    before = [dict(table) for table in tables]
    yield
    for table, known in zip(tables, before, strict=True):
        for name in set(table) - set(known):
            if getattr(table[name], "__module__", "") == "page":
                del table[name]


NEEDS = {"live.md": "viser"}
"""Packages of extras that the tests do without."""


def run_python(page):
    if page.name in NEEDS:
        pytest.importorskip(NEEDS[page.name])
    if page.name == "README.md":  # which writes it
        Path("run.npz").unlink()
    import octoctrl as oc

    plan = oc.load("plan.npz")
    # What a reader of one page has from another; ``py`` instead of ``python`` marks sketches with names of the reader's own.
    given = {"oc": oc, "np": np, "plan": plan, "arm": plan.arm, "scene": plan.scene, "model": plan.model}
    space = {"__name__": "page", **given, "activation": plan.schedule.activation()}
    for block in python(page):
        exec(compile(block, page.name, "exec"), space)


@pytest.mark.parametrize("page", [page for page in PAGES if python(page) and page.name not in LONG_PYTHON], ids=lambda page: page.name)
def test_python_runs(page, desk):
    run_python(page)


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if page.name in LONG_PYTHON and python(page)], ids=lambda page: page.name)
def test_python_that_takes_long_runs(page, desk):
    run_python(page)


def test_every_page_is_in_the_site():
    settings = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))["project"]

    def pages(entries):
        for entry in entries:
            for value in entry.values():
                yield from pages(value) if isinstance(value, list) else [value]

    assert sorted(pages(settings["nav"])) == sorted(page.name for page in (ROOT / "docs").glob("*.md"))
    assert settings["theme"]["font"] is False, "no page asks a network for letters"


def test_the_gallery_has_a_picture_and_a_film_of_every_task():
    said = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    for name in tasks.names():
        assert re.search(rf"^\| `octoctrl demo {name}`.*\.png\) \| !\[[^|]*{name}\.gif\) \|$", said, re.MULTILINE), name


def test_the_reference_names_what_is_there():
    import octoctrl

    said = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
    named = re.findall(r"^::: (\S+)", said, re.MULTILINE)
    for name in named:
        home, _, last = name.rpartition(".")
        try:
            importlib.import_module(name)
        except ModuleNotFoundError:
            assert hasattr(importlib.import_module(home), last), name
    for name, home in octoctrl._HOME_OF.items():
        assert f"{home}.{name}" in named or home in named, f"oc.{name} is not in docs/reference.md"


def test_cite_prints_bibtex(capsys):
    from octoctrl import __version__

    assert main(["cite"]) == 0
    said = capsys.readouterr().out
    assert re.findall(r"^@(\w+)\{(\w+),$", said, re.MULTILINE) == [
        ("software", "octoctrl"),
        ("article", "tekinalp2024topology"),
        ("article", "andersson2019casadi"),
        ("article", "arnstroem2022daqp"),
    ]
    assert f"version = {{{__version__}}}" in said and all(entry.count("{") == entry.count("}") for entry in said.split("\n@"))
