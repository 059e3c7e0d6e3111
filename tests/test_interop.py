"""The reduced model's step for other programs: as a CasADi file that needs no octoctrl, and as C that a compiler takes."""

import ctypes
import shutil
import subprocess
import sys

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.planners.model.reduced import ReducedModel


@pytest.fixture(scope="module")
def model():
    return ReducedModel(arm=oc.Arm.octopus(), sections=4)


def state(model):
    strains, levels = np.zeros((4, model.sections)), np.full((11, model.sections), 0.1)
    strains[3] = 1.0
    return strains, levels, 0.05


def test_the_step_as_a_file(model, tmp_path):
    step = model.step_function()
    step.save(str(tmp_path / "step.casadi"))
    program = (
        "import casadi, numpy as np, sys; s = np.zeros((4, 4)); s[3] = 1; f = casadi.Function.load('step.casadi');"
        "np.save('next.npy', np.array(f(s, np.full((11, 4), 0.1), 0.05))); assert 'octoctrl' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=True)
    assert np.array_equal(np.load(tmp_path / "next.npy"), np.array(step(*state(model))))


def test_the_step_in_c(model, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model.step_function().generate("step.c")
    text = (tmp_path / "step.c").read_text()
    assert "#error" not in text and "step_n_in" in text


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")
def test_the_step_in_c_is_the_step(model, tmp_path, monkeypatch):
    import casadi

    monkeypatch.chdir(tmp_path)
    step = model.step_function()
    step.generate("step.c")
    subprocess.run(["gcc", "-O0", "-shared", "-fPIC", "step.c", "-o", "step.so", "-lm"], check=True)
    compiled = casadi.external("step", "./step.so")
    assert np.array(compiled(*state(model))) == pytest.approx(np.array(step(*state(model))), rel=1e-12, abs=1e-12)
    assert ctypes.CDLL("./step.so").step_n_in() == 3
