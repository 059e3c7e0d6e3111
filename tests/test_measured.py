"""Measured arms: lines and ribbons whose link, writhe and twist are known, noise that is found again, files that say what is wrong."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import octoctrl as oc
from octoctrl.cli.application import main
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.topology.centreline import Centreline, transported
from octoctrl.sim.topology.measured import noise_of, topology_of
from octoctrl.sim.topology.measures import link, twist, writhe

LENGTH = 0.2


def helix(count, turns=2.0, steepness=30.0, hand=1):
    """Points (count, 3) of a helix about +z of that many turns, whose tangent stands `steepness` degrees above the plane."""
    psi = np.radians(steepness)
    angle = hand * 2 * np.pi * turns * np.linspace(0, 1, count)
    radius = LENGTH * np.cos(psi) / (2 * np.pi * turns)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), LENGTH * np.sin(psi) * np.linspace(0, 1, count)], axis=1)


def measured(points, noise=0.0, markers=None, **more):
    time = 0.1 * np.arange(len(points))
    return topology_of(Centreline(time=time, points=points, markers=markers), noise=noise, **more)


@pytest.mark.parametrize(("steepness", "hand"), [(60.0, 1), (30.0, 1), (30.0, -1)])
def test_writhe_of_few_points_of_a_helix_is_the_closed_form(steepness, hand):
    found = measured(helix(25, steepness=steepness, hand=hand)[None])
    expected = hand * 2.0 * (1 - np.sin(np.radians(steepness)))
    assert found.trace.lifted_writhe[0] == pytest.approx(expected, abs=0.01)
    assert found.trace.twist[0] == pytest.approx(0.0, abs=1e-9) and "No markers" in found.notes[-1]
    assert abs(found.trace.residual[0]) < 0.01


def test_chords_of_few_points_would_have_cut_corners():
    assert abs(writhe(helix(9, turns=1.0)) - 0.5) > 4 * abs(measured(helix(9, turns=1.0)[None]).trace.writhe[0] - 0.5)


@pytest.mark.parametrize("turns", [-1.5, 0.4, 2.0])
def test_markers_on_the_skin_give_twist(turns):
    """Carried without twist along a helix and turned by hand; and on a straight line, where nothing but the markers can tell."""
    for line in (helix(40, turns=1.0), np.linspace([0.0, 0, 0], [0.0, LENGTH, 0], 40)):
        edges = np.gradient(line, axis=0)
        tangents = edges / np.linalg.norm(edges, axis=1, keepdims=True)
        first = np.cross(tangents[:1], [[0.3, -0.2, 0.9]])
        normals = transported(tangents[None], first / np.linalg.norm(first))[0]
        angle = 2 * np.pi * turns * np.linspace(0, 1, 40)[:, None]
        skin = line + 0.01 * (np.cos(angle) * normals + np.sin(angle) * np.cross(tangents, normals))
        found = measured(line[None], markers=skin[None])
        assert found.trace.twist[0] == pytest.approx(turns, abs=0.02)
        fine, frames = found.centreline.ribbon()
        assert found.trace.link[0] == pytest.approx(link(fine[0], frames[0, 1:-1, 0], 1e-3), abs=0.01), "the double sum of both curves"


@given(st.integers(0, 2**31))
@settings(max_examples=20, deadline=None)
def test_transported_normals_stay_across_and_have_no_twist(seed):
    draw = np.random.default_rng(seed)
    line = np.cumsum(draw.normal(size=(30, 3)) * 0.3 + [0, 1, 0], axis=0)
    tangents = np.diff(line, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    first = np.cross(tangents[0], draw.normal(size=3))
    normals = transported(tangents[None], first[None] / np.linalg.norm(first))[0]
    np.testing.assert_allclose(np.sum(normals * tangents, axis=1), 0.0, atol=1e-12)
    assert twist(line, normals) == pytest.approx(0.0, abs=1e-9)


def swing(count=21, instants=15):
    """An arm that hangs along -z and swings in a plane."""
    s = np.linspace(0, LENGTH, count)
    bends = 0.6 * np.sin(np.linspace(0, 2 * np.pi, instants))
    slopes = bends[:, None] * s / LENGTH
    step = LENGTH / (count - 1)
    x, z = np.cumsum(np.sin(slopes) * step, axis=1), -np.cumsum(np.cos(slopes) * step, axis=1)
    return np.stack([x, np.zeros_like(x), z], axis=2)


def test_a_hanging_arm_gets_a_pole_that_suits_it_and_is_told_so():
    still = measured(swing())
    assert still.trace.convention.pole != (0.0, 0.0, 1.0) and any("is taken instead" in note for note in still.notes)
    assert np.abs(still.trace.lifted_writhe).max() < 1e-3 and not still.trace.crossings.any()
    noisy = measured(swing() + 1e-4 * np.random.default_rng(3).standard_normal(swing().shape))
    assert np.abs(noisy.trace.lifted_writhe).max() < 0.1 and not noisy.trace.net_crossings().any()
    asked = measured(swing(), pole=(0, 0, 1))
    assert any("uncertain by whole turns" in note for note in asked.notes)


@pytest.mark.parametrize("noise", [1e-4, 1e-3])
def test_noise_is_found_again_and_its_effect_has_the_right_size(noise):
    """The scatter of writhe over truly independent noisy copies of a still arm is what one series of them predicts."""
    line = np.repeat(helix(20)[None], 24, axis=0)
    noisy = line + noise * np.random.default_rng(5).standard_normal(line.shape)
    centreline = Centreline(time=np.arange(24.0), points=noisy)
    assert noise_of(centreline) == pytest.approx(noise, rel=0.15)
    found = topology_of(centreline)
    scatter = found.trace.lifted_writhe.std()
    assert 0.5 < found.spread["lifted_writhe"] / scatter < 2.0
    assert found.spread["twist"] < 1e-6, "without markers there is no twist to be wrong"


def test_few_points_of_one_instant_say_that_noise_cannot_be_told():
    found = topology_of(Centreline(time=np.zeros(1), points=helix(6)[None]))
    assert np.isnan(found.noise) and "cannot be told" in str(found) and not found.spread


def test_sections_are_straight_planar_and_helical():
    s = np.linspace(0, 1, 60)
    straight = np.stack([0 * s, s, 0 * s], axis=1)
    arc = straight[-1] + np.stack([1 - np.cos(2 * s), np.sin(2 * s), 0 * s], axis=1) / 2
    coil = helix(120, turns=1.5)
    for line, dimension in ((straight, 1), (arc, 2), (coil, 3)):
        assert set(measured(line[None], sections=1).sections.ravel()) == {dimension}
    assert "helical" in str(measured(coil[None], sections=1))


# Files


def written(path, points, heading="time [s],point,x [mm],y [mm],z [mm]", line=None, separator=","):
    rows = [heading]
    for instant, shape in enumerate(points):
        for index, place in enumerate(shape):
            cells = [f"{0.1 * instant:.2f}", str(index), *(f"{1e3 * value:.6f}" for value in place)]
            rows.append(separator.join(cells + ([line] if line else [])))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_a_file_is_read_in_its_units_and_in_any_order(tmp_path):
    points = np.stack([helix(7), helix(7) + np.array([0.001, 0, 0])])
    found = oc.read_centreline(written(tmp_path / "arm.csv", points))
    np.testing.assert_allclose(found.points, points, atol=1e-9)
    np.testing.assert_allclose(found.time, [0.0, 0.1])
    plain = written(tmp_path / "plain.csv", points, heading="TIME;Point;x;y;z", separator=";")
    lines = plain.read_text().splitlines()
    plain.write_text("\ufeff# by hand\n\n" + "\n".join([lines[0], *lines[:0:-1]]))
    assert oc.read_centreline(plain, unit="mm").points == pytest.approx(found.points)
    np.testing.assert_allclose(oc.read_centreline(plain, unit="cm").points, 10 * found.points)


def test_markers_are_a_second_line(tmp_path):
    heading = "time,point,x [mm],y [mm],z [mm],line"
    axis = helix(8, turns=0.4, steepness=10.0)[None]
    skin = axis + np.array([0.0, 0.0, 0.004])
    path = written(tmp_path / "arm.csv", axis, heading, "axis")
    path.write_text(path.read_text() + "\n".join(written(tmp_path / "skin.csv", skin, heading, "skin").read_text().splitlines()[1:]))
    found = oc.read_centreline(path)
    np.testing.assert_allclose(found.markers, skin, atol=1e-9)
    assert "No markers" not in str(topology_of(found))
    path.write_text("\n".join(path.read_text().splitlines()[:-1]))
    with pytest.raises(OctoctrlError, match="the skin has 1 instants of 7 markers, the axis 1 of 8 points"):
        oc.read_centreline(path)


GOOD = "time,point,x [mm],y [mm],z [mm]\n" + "".join(f"0,{k},0,{10 * k},{k * k}\n" for k in range(6))
BAD = {
    "is empty": "",
    "holds no point of the centreline": "time,point,x [mm],y,z\n".replace("y,z", "y [mm],z [mm]"),
    "does not say its unit of length": GOOD.replace(" [mm]", ""),
    "unknown unit 'mn' of x; did you mean": GOOD.replace("x [mm]", "x [mn]"),
    "has no column z": GOOD.replace("z [mm]", "height"),
    "two columns called 'x'": GOOD.replace("y [mm]", "x [mm]"),
    "arm.csv:3: y is 'ten'": GOOD.replace(",10,", ",ten,"),
    "arm.csv:3: y is 'nan'": GOOD.replace(",10,", ",nan,"),
    "arm.csv:4: point is 1.5": GOOD.replace("0,2,", "0,1.5,"),
    "point 1 of axis at time 0 is there already": GOOD.replace("0,2,", "0,1,"),
    "point 2 is missing": GOOD.replace("0,2,0,20,4\n", ""),
    "at least 4 points": "".join(GOOD.splitlines(keepends=True)[:4]),
    "coincide": GOOD.replace("0,20,4", "0,10,1"),
    "line is 'skim'": GOOD.replace("z [mm]", "z [mm],line").replace("0,0,0,0,0\n", "0,0,0,0,0,skim\n"),
}


@pytest.mark.parametrize("said", BAD)
def test_wrong_files_are_refused_in_one_sentence(said, tmp_path, capsys):
    path = tmp_path / "arm.csv"
    path.write_text(BAD[said])
    assert main(["topology", str(path)]) == 2
    message = capsys.readouterr().err
    assert said in message and message.count("\n") == 1 and "fault" not in message


@given(st.binary(max_size=300) | st.text(max_size=300).map(lambda text: (GOOD[: len(text)] + text).encode("utf-8", "ignore")))
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_a_file_holds_it_is_read_or_refused(tmp_path, content):
    path = tmp_path / "arm.csv"
    path.write_bytes(content)
    try:
        oc.read_centreline(path)
    except OctoctrlError as error:
        assert "\n" not in str(error) or "\n" in content.decode("utf-8", "ignore")


def test_the_command_prints_and_draws(tmp_path, capsys):
    path = written(tmp_path / "arm.csv", np.stack([helix(12, turns=0.5 + 0.05 * k) for k in range(10)]))
    assert main(["topology", str(path), "--plot", str(tmp_path / "arm.png"), "--pole", "0,0,1"]) == 0
    printed = capsys.readouterr()
    assert "lifted writhe" in printed.out and "noise:" in printed.out and (tmp_path / "arm.png").stat().st_size > 10_000
    assert main(["topology", str(path), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert len(answer["lifted_writhe"]) == 10 and len(answer["sections"][0]) == 8 and answer["pole"] == [0, 0, 1]
    assert main(["topology", str(path), "--pole", "up"]) == 2 and "0,0,1" in capsys.readouterr().err
