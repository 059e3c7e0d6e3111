"""Solids within closed surfaces of triangles: against the shapes whose distance and mass have closed forms."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import octoctrl as oc
from octoctrl.pictures.solids import mesh as picture
from octoctrl.planners.asking.wrapping import Curl
from octoctrl.sim.contact.bodies import rows_of, still_row
from octoctrl.sim.contact.columns import Body
from octoctrl.sim.contact.hold import Hold, girth
from octoctrl.sim.contact.markers import markers_of
from octoctrl.sim.contact.measures import gaps
from octoctrl.sim.contact.shape_kernels import distance
from octoctrl.sim.scene import mesh as meshes
from octoctrl.sim.scene.mesh import Mesh
from octoctrl.sim.scene.objects import Box, Capsule, Sphere
from octoctrl.sim.scene.supports import Free
from octoctrl.sim.scene.triangles import spread_over

SIZE = (0.02, 0.01, 0.03)
TETRAHEDRON = {"vertices": ((0, 0, 0), (0.01, 0, 0), (0, 0.01, 0), (0, 0, 0.01)), "triangles": ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))}


def of(surface, **settings):
    return Mesh(**{"name": "stone"} | settings, vertices=surface.vertices.tolist(), triangles=surface.faces.tolist())


def distances(item, points):
    return gaps(points[None], item, np.zeros((1, 3)), np.eye(3)[None])[0]


def box(**settings):
    return of(trimesh.creation.box(extents=SIZE), **settings)


def test_distances_of_a_block_are_those_of_the_box_but_for_rounded_edges():
    points = np.random.default_rng(0).uniform(-0.03, 0.03, (4000, 3))
    exact = distances(Box(name="box", size=SIZE), points)
    off = {cells: np.abs(distances(box(cells=cells), points) - exact) for cells in (16, 32, 64)}
    for cells, values in off.items():
        assert values.max() < 0.4 * 0.03 / cells, "edges are as round as a cell is wide"
    assert off[16].max() > 3 * off[64].max()
    # Over the middle of a face the surface is flat, and nothing is lost, in the grid and beyond it.
    over = np.array([[0.001, 0.002, z] for z in (0.0152, 0.016, 0.02, 0.05, 0.3)])
    assert distances(box(cells=16), over) == pytest.approx(over[:, 2] - 0.015, abs=1e-12)


def test_distances_of_a_ring_are_those_of_a_torus():
    """Not convex, and with a hole: inside is told from outside by what is seen all around."""
    ring = of(trimesh.creation.torus(0.02, 0.006, major_sections=64, minor_sections=32), cells=48)
    points = np.random.default_rng(1).uniform(-0.028, 0.028, (4000, 3)) * [1, 1, 0.3]
    exact = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 0.02, points[:, 2]) - 0.006
    found = distances(ring, points)
    assert (found[np.abs(exact) > 1e-4] > 0).tolist() == (exact[np.abs(exact) > 1e-4] > 0).tolist()
    near = exact > -0.004  # of its core every direction is as near
    assert np.abs(found - exact)[near].max() < 4e-4
    assert found[np.hypot(points[:, 0], points[:, 1]) < 0.01].min() > 0, "the hole is outside"


def test_far_from_its_grid_the_nearest_point_is_found():
    directions = np.random.default_rng(2).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ball = of(trimesh.creation.icosphere(subdivisions=4, radius=0.01), cells=24)
    for far in (0.013, 0.02, 0.05, 0.2):
        assert distances(ball, far * directions) == pytest.approx(np.full(500, far - 0.01), abs=2e-4 + 1e-3 * far)


def test_a_gap_grows_along_its_normal():
    stone = of(trimesh.creation.icosphere(subdivisions=3, radius=0.01), cells=48)
    row = rows_of([replace(stone, position=(0.3, -0.1, 0.2), axis=(1.0, 2.0, -1.0))])[0]
    for point in np.array([0.3, -0.1, 0.2]) + np.random.default_rng(3).normal(scale=0.008, size=(50, 3)):
        if not 0.006 < np.linalg.norm(point - [0.3, -0.1, 0.2]) < 0.03:
            continue
        gap, *normal = distance(row, *point)
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
        assert np.array(normal) @ (point - [0.3, -0.1, 0.2]) / np.linalg.norm(point - [0.3, -0.1, 0.2]) > 0.99
        further, *_ = distance(row, *(point + 1e-6 * np.array(normal)))
        assert (further - gap) / 1e-6 == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("turned", [False, True], ids=["anticlockwise", "clockwise"])
def test_mass_and_moments_are_those_of_the_box_wherever_its_origin_is(turned):
    surface = trimesh.creation.box(extents=SIZE)
    surface.apply_translation([3.0, -2.0, 5.0])
    if turned:
        surface.invert()
    stone, block = of(surface, density=1000.0, support=Free()), Box(name="box", size=SIZE, density=1000.0, support=Free())
    assert stone.volume == pytest.approx(block.volume, rel=1e-9)
    assert stone.gyration == pytest.approx(block.gyration, rel=1e-9)
    assert stone.sizes == pytest.approx(block.sizes, rel=1e-9) and stone.bound == pytest.approx(block.bound, rel=1e-9)
    mass = slice(Body.INVERSE_MASS, Body.INVERSE_INERTIA + 3)
    assert rows_of([stone])[0, mass] == pytest.approx(rows_of([block])[0, mass], rel=1e-9)
    assert distances(stone, np.zeros((1, 3)))[0] == pytest.approx(-0.005, rel=1e-6), "the middle is inside either way round"


def test_one_that_is_turned_is_laid_along_its_principal_axes():
    surface = trimesh.creation.box(extents=SIZE)
    surface.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1.0, 2.0, 0.5]))
    with pytest.raises(
        oc.OctoctrlError, match=r"'stone' can move, and its products of inertia are \d+ % of its moments; .* principal = true"
    ):
        of(surface, density=1000.0, support=Free())
    stone = of(surface, density=1000.0, support=Free(), principal=True)
    assert (
        sorted(stone.gyration, reverse=True) == list(stone.gyration) == pytest.approx([(900 + 400) / 12e6, (900 + 100) / 12e6, 500 / 12e6])
    )
    assert stone.sizes == pytest.approx((0.005, 0.01, 0.015), rel=1e-9), "the longest along the axis"
    assert np.linalg.det(stone.corners).sum() / 6 == pytest.approx(stone.volume, rel=1e-9), "turned, not mirrored"


def test_the_way_round_it_is_that_round_its_outline():
    post = of(trimesh.creation.cylinder(radius=0.008, height=0.05, sections=96))
    assert girth(post) == pytest.approx(0.008, rel=1e-3) and girth(box()) == pytest.approx(0.03 / np.pi, rel=1e-9)


def test_its_points_lie_on_it_and_are_near_to_every_place_of_it():
    stone = of(trimesh.creation.icosphere(subdivisions=3, radius=0.01))
    rows = markers_of(stone)
    assert np.linalg.norm(rows[:, :3], axis=1) == pytest.approx(np.full(len(rows), 0.01), rel=0.01) and not rows[:, 3].any()
    away = np.linalg.norm(stone.corners.reshape(-1, 1, 3) - rows[:, :3], axis=2).min(axis=1)
    assert away.max() < np.sqrt(3) * 0.01 / 4
    coarse = spread_over(box().corners, 0.004)
    assert len(coarse) > 100 and np.abs(coarse / np.array(SIZE)).max(axis=1) == pytest.approx(np.full(len(coarse), 0.5))
    corners = np.unique(np.abs(coarse), axis=0)
    assert (np.abs(corners - np.array(SIZE) / 2).max(axis=1) < 1e-12).any(), "the outermost are the corners"


def test_what_overlaps_it_is_refused():
    scene = oc.Scene(objects=(box(position=(0.012, 0.1, 0.0)),))
    with pytest.raises(oc.OctoctrlError, match="object 'stone' overlaps the arm at rest by"):
        oc.make_plant("rod", oc.Arm(), scene)
    one, other = Sphere(name="ball", radius=0.01, position=(0.1, 0.1, 0.0), mass=1e-3, support=Free()), box(position=(0.115, 0.1, 0.0))
    with pytest.raises(oc.OctoctrlError, match="object 'ball' overlaps object 'stone' by 5 mm"):
        oc.make_plant("rod", oc.Arm(), oc.Scene(objects=(one, other)))


POST = Capsule(name="post", position=(-0.022, 0.06, -0.01), axis=(0.0, 0.5, 1.0), radius=0.008, length=0.08)
CURL = Curl(azimuth=np.pi, level=0.6, profile=0.4, start=0.05, stop=0.196, apex=0.218, speed=0.1)
BEND = oc.Activation(templates=CURL.templates())


@pytest.fixture(scope="module")
def stone(tmp_path_factory):
    surface = trimesh.creation.capsule(height=POST.length, radius=POST.radius, count=[32, 32])
    surface.export(path := tmp_path_factory.mktemp("stone") / "post.stl")
    return oc.read_mesh(path, unit="m", position=POST.position, axis=POST.axis, cells=48)


def plant(item):
    return oc.make_plant("rod", oc.Arm(), oc.Scene(objects=(item,)))


def test_an_arm_winds_round_it_as_round_the_same_post(stone):
    exact, found = plant(POST).advance(BEND, 1.6), plant(stone).advance(BEND, 1.6)
    radius = np.asarray(oc.Arm().section(exact.stations[1:-1]).outer_radius)
    held, lain = Hold.of(exact, radius, "post"), Hold.of(found, radius, "post")
    assert held.covered[-1] > 0.4 and held.touch.normal_force[-1] > 0.02
    assert lain.covered[-1] == pytest.approx(held.covered[-1], abs=0.03)
    assert lain.touch.normal_force[-1] == pytest.approx(held.touch.normal_force[-1], rel=0.1)
    assert np.abs(found.points - exact.points).max() < 1e-3
    assert lain.touch.deepest.max() < 1.4e-4


def test_a_run_goes_on_bit_by_bit_with_it(stone, tmp_path):
    arm = plant(stone)
    arm.advance(BEND, 1.2)
    state = arm.state()
    assert state["bodies"].shape == (1, Body.WIDTH), "its distances are no state"
    rest = arm.advance(BEND, 0.1)
    again = plant(stone)
    again.restore(state)
    assert np.array_equal(again.advance(BEND, 0.1).points, rest.points)
    oc.save(tmp_path / "run.npz", rest)
    loaded = oc.load(tmp_path / "run.npz")
    assert loaded == rest and loaded.meshes == {"post": stone}


def test_a_recording_without_the_surface_is_refused(stone):
    recording = replace(plant(stone).advance(BEND, 0.01), meshes={})
    with pytest.raises(oc.OctoctrlError, match=r"'post' is a mesh, of which the recording holds no surface \(it holds: none\); run the"):
        Hold.of(recording, np.asarray(oc.Arm().section(recording.stations[1:-1]).outer_radius), "post")


def test_what_is_asked_of_it_again_is_neither_hashed_nor_copied(stone):
    row, moved = still_row(stone), replace(stone, position=(0.1, 0.1, 0.0))
    known = meshes._solid.cache_info()
    assert stone.corners is stone.corners and still_row(stone) is row and meshes._solid.cache_info() == known
    assert moved.corners is stone.corners and still_row(moved) is row, "those of one surface share it"
    other = replace(stone, vertices=tuple((2 * x, y, z) for x, y, z in stone.vertices))
    assert still_row(other) is not row and other.volume == pytest.approx(2 * stone.volume)
    assert not row[Body.POSITION : Body.FRAME].any(), "nobody has written into it"


def test_a_state_belongs_to_one_surface(tmp_path):
    near, far = (
        box(name="stone", position=(0.1, 0.1, 0.0)),
        of(trimesh.creation.icosphere(subdivisions=1, radius=0.01), position=(0.1, 0.1, 0.0)),
    )
    assert "12 triangles" in repr(near) and len(repr(near)) < 400
    plant(near).save(tmp_path / "state.npz")
    with pytest.raises(oc.OctoctrlError, match="objects"):
        plant(far).load(tmp_path / "state.npz")
    plant(near).load(tmp_path / "state.npz")


def test_its_picture_has_flat_faces_that_look_outwards():
    vertices, normals, triangles = picture(box(), 0.2)
    assert vertices.shape == normals.shape == (36, 3) and triangles.shape == (12, 3)
    assert (np.einsum("vi,vi->v", vertices, normals) > 0.004).all()


def test_it_is_read_from_a_file(tmp_path):
    surface = trimesh.creation.box(extents=[1e3 * edge for edge in SIZE])
    for ending in ("stl", "obj", "ply"):
        surface.export(tmp_path / f"stone.{ending}")
        found = oc.read_mesh(tmp_path / f"stone.{ending}", unit="mm", position=(0.1, 0.1, 0.0))
        assert found.name == "stone" and found.sizes == pytest.approx([edge / 2 for edge in SIZE], rel=1e-6)
    (tmp_path / "task.toml").write_text(
        '[task]\nname = "bend"\ndrives = "choose"\n[[task.phases]]\nname = "bend"\nduration = 1.0\n'
        'goals = [{ quantity = "lifted_writhe", value = 0.1, tolerance = 0.1 }]\n'
        '[[scene.objects]]\nkind = "mesh"\nname = "stone"\nfile = "stone.stl"\nunit = "mm"\nposition = ["100 mm", "100 mm", 0]\n'
    )
    (item,) = oc.tasks.load(tmp_path / "task.toml").scene.objects
    assert isinstance(item, Mesh) and item.volume == pytest.approx(6e-6, rel=1e-6) and item.position == (0.1, 0.1, 0.0)


@pytest.mark.parametrize(
    "old, new, message",
    [
        ('"stone.stl"', '"rock.stl"', r"task.toml:5 scene.objects\[0\].file: .*rock.stl does not exist"),
        ('unit = "mm"', "", r"task.toml:3 scene.objects\[0\]: 'unit' is missing"),
        ('"mm"', '"inch"', r"task.toml:5 scene.objects\[0\].file: unknown unit 'inch'"),
        ('"stone.stl"', '"task.toml"', r"unknown format '.toml'; use .stl or .obj or .ply or .off"),
        ('"stone.stl"', '"broken.stl"', r"broken.stl holds no triangle"),
        ('"mm"', '"mm"\nvertices = []', r"scene.objects\[0\].vertices: vertices follow from the file; leave one of them out"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path, old, new, message):
    trimesh.creation.box(extents=[10, 10, 10]).export(tmp_path / "stone.stl")
    (tmp_path / "broken.stl").write_bytes(b"solid\nfacet normal nonsense\n")
    text = '[task]\nname = "bend"\n[[scene.objects]]\nkind = "Mesh"\nfile = "stone.stl"\nname = "stone"\nunit = "mm"\n'
    (tmp_path / "task.toml").write_text(text.replace(old, new))
    with pytest.raises(oc.OctoctrlError, match=message):
        oc.tasks.load(tmp_path / "task.toml")


@pytest.mark.parametrize(
    "changed, message",
    [
        ({"triangles": TETRAHEDRON["triangles"][:3] + TETRAHEDRON["triangles"][:1]}, "its surface is not closed: of 6 edges 5 do not lie"),
        ({"triangles": (*TETRAHEDRON["triangles"][:3], (1, 3, 2))}, "its surface is not closed: of 6 edges 3 do not lie"),
        ({"triangles": (*TETRAHEDRON["triangles"][:3], (1, 2, 4))}, "triangles count their corners from 0 to 4; there are 4, from 0 on"),
        ({"vertices": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0))}, "its surface encloses nothing; give a solid"),
        (
            {"vertices": ((0, 0), (1, 0), (0, 1), (1, 1))},
            r"vertices has the shape \(4, 2\) or a number that does not fit; give rows of three finite",
        ),
        ({"vertices": ((0, 0, float("nan")), *TETRAHEDRON["vertices"][1:])}, "vertices .* give rows of three finite numbers, m"),
        ({"vertices": "stone"}, "vertices is stone; give rows of three finite numbers, m"),
        ({"triangles": ((0, 1, 2.5),) * 4}, "triangles .* give rows of three whole numbers"),
        ({"triangles": ()}, "triangles"),
        ({"cells": 4}, "cells"),
    ],
)
def test_what_is_no_solid_is_refused(changed, message):
    with pytest.raises(oc.OctoctrlError, match=message):
        Mesh(**{"name": "stone"} | TETRAHEDRON | changed)
