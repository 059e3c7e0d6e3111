"""Runs for other programs: tables that read back, a mesh whose skinned vertices are the tube, films that Pillow and ffmpeg can open."""

import csv
import json
import struct
import sys
from dataclasses import replace

import numpy as np
import pytest
from conftest import coil_execution

import octoctrl as oc
from octoctrl.cli.application import main
from octoctrl.pictures.film import pictures
from octoctrl.pictures.gltf import SIDES, frames_of, glb
from octoctrl.pictures.motion import motion_of
from octoctrl.sim.errors import OctoctrlError


def test_the_shape_reads_back_with_its_topology(coil_run, tmp_path):
    """Through the skin's line alone: its twist, its link and its writhe are those of the run."""
    run = coil_run
    found = oc.read_centreline(oc.export(run, tmp_path / "arm.csv"))
    np.testing.assert_allclose(found.points, run.recording.points, atol=1e-9)
    thin = replace(found, time=found.time[::12], points=found.points[::12], markers=found.markers[::12])
    measured = oc.topology_of(thin, pole=run.plan.task.convention.pole, noise=0.0).trace
    np.testing.assert_allclose(measured.lifted_writhe, run.trace.lifted_writhe[::12], atol=0.03)
    np.testing.assert_allclose(measured.twist, run.trace.twist[::12], atol=0.03)


def test_the_traces_are_those_of_the_run(coil_run, tmp_path):
    path = oc.export(coil_run, tmp_path / "traces.csv", table="traces")
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(coil_run.recording.time)
    np.testing.assert_allclose([float(row["lifted_writhe [turns]"]) for row in rows], coil_run.trace.lifted_writhe, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose([float(row["planned twist [turns]"]) for row in rows], coil_run.planned.twist, rtol=1e-8, atol=1e-12)
    assert {"R-OM", "LM1", "TM"} <= set(rows[0])


# The mesh


def read(content):
    """Header and accessors of a .glb file, by the specification of glTF 2.0."""
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    size, kind = struct.unpack_from("<I4s", content, 12)
    assert kind == b"JSON" and size % 4 == 0
    head = json.loads(content[20 : 20 + size])
    body_size, kind = struct.unpack_from("<I4s", content, 20 + size)
    assert kind == b"BIN\0" and body_size % 4 == 0 and 28 + size + body_size == length
    body = content[28 + size :]

    def array(number):
        entry = head["accessors"][number]
        view = head["bufferViews"][entry["bufferView"]]
        kind = {5126: "<f4", 5121: "u1", 5123: "<u2"}[entry["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[entry["type"]]
        assert view["byteOffset"] % 4 == 0 and view["byteLength"] == entry["count"] * width * np.dtype(kind).itemsize
        values = np.frombuffer(body, kind, entry["count"] * width, view["byteOffset"]).reshape(-1, width)
        if "min" in entry:
            np.testing.assert_array_equal(values.min(axis=0), np.float32(entry["min"]))
            np.testing.assert_array_equal(values.max(axis=0), np.float32(entry["max"]))
        return values

    return head, array


def turned(q):
    """Rotation matrices of quaternions (n, 4), x y z w."""
    x, y, z, w = q.T.astype(float)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)


def test_skinned_vertices_are_the_tube_of_the_run(coil_run):
    content = glb(coil_run)
    assert content == glb(coil_run) and len(content) < 0.6e6
    head, array = read(content)
    motion = motion_of(coil_run)
    frames = frames_of(motion)
    attributes = head["meshes"][0]["primitives"][0]["attributes"]
    rest, joints = array(attributes["POSITION"]), array(attributes["JOINTS_0"])[:, 0]
    bind = array(head["skins"][0]["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
    animation = head["animations"][0]
    np.testing.assert_allclose(array(animation["samplers"][0]["input"])[:, 0], motion.time, atol=1e-6)
    moves = {
        (c["target"]["node"], c["target"]["path"]): array(animation["samplers"][c["sampler"]]["output"]) for c in animation["channels"]
    }
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    for instant in (0, 40, len(motion.time) - 1):
        joint = np.zeros((len(bind), 4, 4))
        for k in range(len(bind)):
            joint[k, :3, :3] = turned(moves[k, "rotation"][[instant]])[0] * moves[k, "scale"][instant]
            joint[k, :3, 3], joint[k, 3, 3] = moves[k, "translation"][instant], 1
        skinned = np.einsum("vij,vj->vi", (joint @ bind)[joints], np.c_[rest, np.ones(len(rest))])[:, :3]
        outward = np.cos(angle)[:, None] * frames[instant, :, None, :, 0] + np.sin(angle)[:, None] * frames[instant, :, None, :, 1]
        tube = motion.points[instant, :, None] + motion.radius[instant, :, None, None] * outward
        np.testing.assert_allclose(skinned, tube.reshape(-1, 3), atol=2e-7)
    quaternion = np.stack([moves[k, "rotation"] for k in range(len(bind))])
    np.testing.assert_allclose(np.linalg.norm(quaternion, axis=2), 1.0, atol=1e-6)
    assert np.sum(quaternion[:, 1:] * quaternion[:, :-1], axis=2).min() > 0, "no joint turns the long way round"


def test_the_mesh_is_closed_around_and_looks_outwards(coil_run):
    head, array = read(glb(coil_run))
    primitive = head["meshes"][0]["primitives"][0]
    places, normals = (array(primitive["attributes"][name]).astype(float) for name in ("POSITION", "NORMAL"))
    corners = array(primitive["indices"]).reshape(-1, 3).astype(int)
    assert set(corners.ravel()) == set(range(len(places)))
    across = np.cross(places[corners[:, 1]] - places[corners[:, 0]], places[corners[:, 2]] - places[corners[:, 0]])
    assert np.einsum("kc,kc->k", across, normals[corners].mean(axis=1)).min() > 0
    edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    counts = np.unique(edges, axis=0, return_counts=True)[1]
    assert sorted(set(counts)) == [1, 2] and np.sum(counts == 1) == 2 * SIDES, "open at base and tip only"


# Films


def test_films_open_and_last_as_long_as_the_run(coil_plan, tmp_path):
    from PIL import Image

    run = coil_execution(coil_plan, until=0.4)
    for ending, rate in ((".gif", 12.5), (".webp", 25.0)):
        path = oc.export(run, tmp_path / f"film{ending}", speed=2.0)
        with Image.open(path) as film:
            assert film.size == (480, 480) and film.n_frames == round(0.4 * rate / 2) + 1
            film.seek(film.n_frames - 1)
            last = np.asarray(film.convert("RGB"), dtype=float)
        assert np.ptp(last) > 100 and last.mean() > 150, "an arm on white"


def test_the_arm_stays_in_the_picture_and_moves(coil_run):
    first, *_, last = list(pictures(coil_run, 2.0))
    for picture in (first, last):
        border = np.concatenate([picture[:4].ravel(), picture[-4:].ravel(), picture[:, :4].ravel(), picture[:, -4:].ravel()])
        assert border.min() == 255
    assert np.mean(np.any(first != last, axis=2)) > 0.02


def test_mp4_by_ffmpeg_or_one_sentence(coil_plan, tmp_path, monkeypatch):
    run = coil_execution(coil_plan, until=0.2)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(OctoctrlError, match=r"pip install 'octoctrl\[video\]'"):
        oc.export(run, tmp_path / "film.mp4")
    assert list(tmp_path.iterdir()) == []
    monkeypatch.undo()
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="needs imageio-ffmpeg: pip install 'octoctrl[video]'")
    path = oc.export(run, tmp_path / "film.mp4")
    assert ffmpeg.count_frames_and_secs(str(path))[0] == 6


def test_the_command_writes_what_the_suffix_says(coil_run, tmp_path, capsys):
    oc.save(tmp_path / "run.npz", coil_run)
    source = str(tmp_path / "run.npz")
    for name in ("arm.csv", "arm.glb"):
        assert main(["export", source, str(tmp_path / name)]) == 0
        assert capsys.readouterr().err == f"wrote {tmp_path / name}\n"
    assert (tmp_path / "arm.glb").read_bytes() == glb(coil_run)
    for arguments, said in (
        (["arm.csv"], "exists"),
        (["arm.obj"], "unknown format '.obj'; use .csv"),
        (["arm2.csv", "--table", "trace"], "did you mean 'traces'"),
        (["arm2.gif", "--speed", "0"], "speed"),
    ):
        assert main(["export", source, str(tmp_path / arguments[0]), *arguments[1:]]) == 2
        assert said in capsys.readouterr().err
    assert not (tmp_path / "arm2.csv").exists()
