"""Traced fibres: families of a made-up arm whose pitch, hand and number are known, along a curved axis and through both file formats."""

import json
import shutil

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import octoctrl as oc
from octoctrl.cli.application import main
from octoctrl.sim.body.fibres import FibreKind, winding_of
from octoctrl.sim.errors import OctoctrlError

LENGTH, BASE, TAPER, PITCH = 0.2, 12e-3, 4.0, 0.2 / 9


def arm(curved, noise=0.15e-3):
    """Fibres (m) of an arm: eight longitudinal bundles of three, eight helices of either hand, ten rings; and the axis."""
    s = np.linspace(0, LENGTH, 801)
    axis = np.stack([0.02 * np.sin(s / 0.09), s, 0.012 * np.cos(s / 0.07)], axis=1) if curved else np.stack([0 * s, s, 0 * s], axis=1)
    tangents = np.gradient(axis, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    first = np.empty_like(axis)
    normal = np.array([0.0, 0.0, 1.0])
    for k, tangent in enumerate(tangents):
        normal = normal - (normal @ tangent) * tangent
        normal /= np.linalg.norm(normal)
        first[k] = normal
    second = np.cross(tangents, first)
    arclength = np.concatenate([[0.0], np.linalg.norm(np.diff(axis, axis=0), axis=1).cumsum()])
    radius = BASE * (1 - (1 - 1 / TAPER) * arclength / arclength[-1])
    draw = np.random.default_rng(1)

    def fibre(azimuth, share, inside=slice(None)):
        aside = np.cos(azimuth)[:, None] * first + np.sin(azimuth)[:, None] * second
        line = (axis + share * radius[:, None] * aside)[inside]
        return line + noise * draw.standard_normal(line.shape)

    lines = [fibre(0 * s + k * np.pi / 4 + shift, 0.6) for k in range(8) for shift in (-0.1, 0.0, 0.1)]
    for hand in (1, -1):
        for phase in range(4):
            for begin in (0, 300):
                lines.append(fibre(hand * 2 * np.pi * arclength / PITCH + phase * np.pi / 2, 0.95, slice(begin, begin + 480)))
    around = np.linspace(0, 1.9 * np.pi, 40)
    for k in range(40, 800, 80):
        ring = axis[k] + 0.8 * radius[k] * (np.cos(around)[:, None] * first[k] + np.sin(around)[:, None] * second[k])
        lines.append(ring + noise * draw.standard_normal(ring.shape))
    return lines, axis


@pytest.mark.parametrize("curved", [False, True])
def test_families_pitch_hand_and_outline_are_found(curved):
    lines, axis = arm(curved)
    found = winding_of(lines, axis)
    assert [len(found.of(kind)) for kind in FibreKind] == [24, 8, 8, 10]
    assert list(found.of(FibreKind.RIGHT)) == list(range(24, 32)), "hand"
    assert found.pitch == pytest.approx(PITCH, rel=0.01) and found.muscles == 8
    np.testing.assert_allclose(found.turns[found.of(FibreKind.LEFT)], -1 / PITCH, rtol=0.03)
    assert found.length == pytest.approx(np.linalg.norm(np.diff(axis, axis=0), axis=1).sum(), rel=1e-3)
    assert found.base_radius == pytest.approx(0.95 * BASE, rel=0.1) and found.taper == pytest.approx(TAPER, rel=0.25)
    np.testing.assert_allclose(found.radius_share[:24], 0.63, atol=0.07)
    steep = np.degrees(found.angle[found.of(FibreKind.RIGHT)])
    assert 40 < steep.min() < steep.max() < 75


def test_without_an_axis_the_middle_of_the_fibres_is_taken_base_first():
    lines, _ = arm(False)
    for turned in (lines, [line @ np.diag([1.0, -1.0, -1.0]) for line in lines]):
        found = winding_of(turned)
        assert found.pitch == pytest.approx(PITCH, rel=0.02) and found.base_radius > 2 * found.base_radius / found.taper
        assert list(found.of(FibreKind.RIGHT)) == list(range(24, 32)), "a rotation keeps the hand"
    mirrored = winding_of([line * [-1, 1, 1] for line in lines])
    assert list(mirrored.of(FibreKind.LEFT)) == list(range(24, 32)), "a mirror changes it"


def test_an_arm_is_made_of_them():
    lines, axis = arm(False)
    found = winding_of(lines, axis)
    made = found.arm()
    assert (made.length, made.taper, made.oblique_pitch) == (found.length, found.taper, found.pitch)
    assert found.layout == made.layout and oc.make_plant("rod", made).arm is made


@pytest.mark.parametrize("ending", [".trk", ".tck"])
def test_files_say_the_same(ending, tmp_path, capsys):
    nibabel = pytest.importorskip("nibabel", reason="needs nibabel: pip install 'octoctrl[fibres]'")
    lines, _ = arm(False)
    path = tmp_path / f"arm{ending}"
    tracts = nibabel.streamlines.Tractogram([(1e3 * line).astype(np.float32) for line in lines], affine_to_rasmm=np.eye(4))
    nibabel.streamlines.save(tracts, str(path))
    found = oc.read_fibres(path)
    assert found.kinds == winding_of(lines).kinds and found.pitch == pytest.approx(winding_of(lines).pitch, rel=1e-3)
    assert main(["fibres", str(path)]) == 0 and "right-handed oblique" in capsys.readouterr().out
    assert main(["fibres", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["muscles"] == 8
    damaged = tmp_path / f"damaged{ending}"
    shutil.copy(path, damaged)
    damaged.write_bytes(damaged.read_bytes()[:700])
    for name, said in ((damaged.name, "damaged"), ("none.trk", "does not exist"), ("arm.csv", "unknown format")):
        assert main(["fibres", str(tmp_path / name)]) == 2
        assert said in (message := capsys.readouterr().err) and message.count("\n") == 1


@given(st.binary(max_size=1500), st.sampled_from([".trk", ".tck"]))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_files_are_refused_in_one_sentence(tmp_path, content, ending):
    pytest.importorskip("nibabel", reason="needs nibabel: pip install 'octoctrl[fibres]'")
    path = tmp_path / f"x{ending}"
    path.write_bytes((b"TRACK\0" if ending == ".trk" else b"mrtrix tracks\n") + content)
    with pytest.raises(OctoctrlError):
        oc.read_fibres(path)


def test_wrong_fibres_are_refused():
    for lines, axis, said in (
        ([], None, "no fibres"),
        ([np.zeros((2, 3))], None, "at least 3|3 points"),
        ([np.full((5, 3), np.nan)], None, "finite"),
        ([np.random.default_rng(0).normal(size=(9, 3))], np.zeros((9, 3)), "axis is no line"),
    ):
        with pytest.raises(OctoctrlError, match=said):
            winding_of(lines, axis)
