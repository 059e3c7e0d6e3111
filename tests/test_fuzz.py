"""Damaged and hostile files: one clear sentence and exit code 2, or what is said is well; never a traceback, nothing written, nothing run.

A few cases of each kind; thousands with ``pytest -m slow tests/test_fuzz.py``.
"""

import json
import os
import shutil
import struct

import numpy as np
import pytest
from conftest import coil_execution
from fuzzing import broken_bytes, odd_archive, odd_text, odd_tree

import octoctrl as oc
from octoctrl.cli.application import main
from octoctrl.connect.sweep_file import read_sweep
from octoctrl.files import netcdf, store
from octoctrl.files.toml_writing import toml_of
from octoctrl.planners.fitting.identified import IdentifiedModel, load_identified
from octoctrl.sim.errors import OctoctrlError

WELL = (0, 1, 2)
"""Well, a verdict that failed, and bad input."""

SWEEP = 'task = "coil"\nseed = 3\nruns = 2\n[set]\n"run.feedback" = "open-loop"\n"sensors.angle_noise" = 0.01\n'
SWEEP += (
    '[grid]\n"gains.R-OM" = [1.0, 0.5]\n"scene.water.factor" = { from = 0.5, to = 2.0, count = 2 }\n[random]\n"arm.length" = [0.1, 0.2]\n'
)


@pytest.fixture(scope="module")
def samples(tmp_path_factory, coil_plan):
    """One good file of each kind."""
    folder = tmp_path_factory.mktemp("good")
    run = coil_execution(coil_plan, until=0.1)
    store.save(folder / "plan.npz", coil_plan)
    store.save(folder / "run.npz", run)
    store.save(folder / "run.nc", run)
    oc.Plant().save(folder / "state.npz")
    load_identified(oc.Arm.octopus()).save(folder / "model.json")
    (folder / "task.toml").write_text(toml_of(oc.tasks.load("coil")))
    (folder / "sweep.toml").write_text(SWEEP)
    angle = np.linspace(0, 3, 12)
    rows = [f"{time},{point},{np.cos(a) * 30:.3f},{np.sin(a) * 30:.3f},{a * 5:.3f}" for time in (0.0, 0.1) for point, a in enumerate(angle)]
    (folder / "arm.csv").write_text("time,point,x [mm],y [mm],z [mm]\n" + "\n".join(rows) + "\n")
    return folder


def resealed(source, path, chance):
    """A run as NetCDF whose header is odd, with a digest that says that it is whole."""
    import h5netcdf

    shutil.copy(source, path)
    with h5netcdf.File(path, "a") as file:
        tree = odd_tree(json.loads(file["header"][()]), chance)
        file["header"][...] = json.dumps(tree)
    content = path.read_bytes()
    import hashlib

    path.write_bytes(content + netcdf.SEAL + hashlib.sha256(content).digest())


def case(kind, samples, chance):
    """Write an odd file of a kind here; returns what is done with it: arguments of the command line, or a function."""
    if kind == "task":
        open("task.toml", "wb").write(odd_text((samples / "task.toml").read_text(), chance))
        return ["plan", "task.toml", "-o", "nowhere/plan.npz"]
    if kind == "sweep":
        open("sweep.toml", "wb").write(odd_text((samples / "sweep.toml").read_text(), chance))
        return lambda: read_sweep("sweep.toml")
    if kind == "run":
        odd_archive((samples / "run.npz").read_bytes(), here("run.npz"), chance)
        return ["verify", "run.npz", *(["--json"] if chance.integers(2) else [])]
    if kind == "plan":
        odd_archive((samples / "plan.npz").read_bytes(), here("plan.npz"), chance)
        return ["run", "plan.npz", "-o", "nowhere/run.npz"]
    if kind == "state":
        odd_archive((samples / "state.npz").read_bytes(), here("state.npz"), chance)
        return lambda: oc.Plant().load("state.npz")
    if kind == "model":
        content = (samples / "model.json").read_text()
        odd = json.dumps(odd_tree(json.loads(content), chance)).encode() if chance.integers(4) else broken_bytes(content.encode(), chance)
        here("model.json").write_bytes(odd)
        return lambda: IdentifiedModel.load("model.json", oc.Arm.octopus())
    if kind == "netcdf":
        if chance.integers(2):
            here("run.nc").write_bytes(broken_bytes((samples / "run.nc").read_bytes(), chance))
        else:
            resealed(samples / "run.nc", here("run.nc"), chance)
        return ["verify", "run.nc"]
    if kind == "csv":
        open("arm.csv", "wb").write(odd_text((samples / "arm.csv").read_text(), chance))
        return ["topology", "arm.csv"]
    content = struct.pack("<6sh", b"TRACK\0", int(chance.integers(200))) + chance.bytes(int(chance.integers(3000)))
    here("arm.trk").write_bytes(content if chance.integers(2) else b"mrtrix tracks\n" + content)
    if chance.integers(2):
        os.rename("arm.trk", "arm.tck")
        return ["fibres", "arm.tck"]
    return ["fibres", "arm.trk"]


def here(name):
    from pathlib import Path

    return Path(name)


def tried(kind, samples, seed, capsys):
    """What becomes of a case: exit code and what is said."""
    chance = np.random.default_rng(seed)
    done = case(kind, samples, chance)
    before = sorted(os.listdir())
    if callable(done):
        try:
            done()
            code, said = 0, ""
        except OctoctrlError as error:
            code, said = 2, f"octoctrl: {error}\n"
    else:
        code = main(done)
        said = capsys.readouterr().err
    assert sorted(os.listdir()) == before, "nothing is left behind"
    return code, said


KINDS = ("task", "sweep", "run", "plan", "state", "model", "netcdf", "csv", "fibres")


def check(kind, samples, tmp_path, capsys, seeds):
    refused = 0
    for seed in seeds:
        code, said = tried(kind, samples, seed, capsys)
        assert code in WELL, (kind, seed, code, said[:600])
        if code == 2:
            refused += 1
            assert said.startswith("octoctrl: ") and said.count("\n") == 1 and len(said) < 900, (kind, seed, said[:900])
            assert "Traceback" not in said and "\x1b" not in said, (kind, seed, said)
        for name in os.listdir():
            os.remove(name)
    assert os.listdir(tmp_path.parent) and not (tmp_path / "spied").exists() and not (tmp_path.parent / "evil.npy").exists()
    return refused


@pytest.mark.parametrize("kind", KINDS)
def test_odd_files_are_refused_in_one_sentence(kind, samples, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert check(kind, samples, tmp_path, capsys, range(30)) > 10


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("laws", {"tuple": ["x" * 3000]}, "model.json is no reduced model, or is damaged; make one with: octoctrl identify -o model.json"),
        ("laws", "x" * 3000, f"unknown laws '{'x' * 60} … {'x' * 17}' (known, generic)"),
        ("sections", 10**400, "model.json is no reduced model, or is damaged; make one with: octoctrl identify -o model.json"),
    ],
)
def test_a_model_of_a_strange_kind_is_not_quoted_at_length(samples, tmp_path, monkeypatch, key, value, said):
    monkeypatch.chdir(tmp_path)
    here("model.json").write_text(json.dumps(json.loads((samples / "model.json").read_text()) | {key: value}))
    with pytest.raises(OctoctrlError) as refused:
        IdentifiedModel.load("model.json", oc.Arm.octopus())
    assert str(refused.value) == said


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_thousands_of_odd_files(kind, samples, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    check(kind, samples, tmp_path, capsys, range(1000, 2150))
