"""Goals about objects, each against a scene made by hand whose answer is known."""

from types import SimpleNamespace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.planners.asking.registry import goal, goal_kinds
from octoctrl.sim.contact.bodies import notes_of, rows_of
from octoctrl.sim.contact.columns import Body
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene.objects import Capsule, frame_of

ARM = oc.Arm.octopus()
LEFT = Capsule(name="left", radius=0.01, length=0.08, position=(-0.03, 0.1, 0.0))
RIGHT = Capsule(name="right", radius=0.01, length=0.08, position=(0.03, 0.1, 0.0))
BAR = Capsule(name="bar", radius=0.005, length=0.04, position=(0.0, 0.15, 0.02), axis=(0, 0, 1))
MIDDLE = (ARM.edges[1:] + ARM.edges[:-1]) / 2


def outputs(points, *, moved=None, frames=None):
    """One instant of an arm whose nodes (n + 1, 3) are given, with the three objects, of which one may be elsewhere."""
    rows = rows_of([LEFT, RIGHT, BAR])
    for column, values in (moved or {}).items():
        rows[2, column : column + np.size(values)] = np.ravel(values)
    rows, count = notes_of(rows), len(points) - 1
    recording = SimpleNamespace(
        time=np.zeros(1),
        meshes={},
        points=np.asarray(points, dtype=float)[None],
        stations=np.concatenate([[0.0], MIDDLE, [0.2]]),
        frames=np.tile(np.eye(3), (1, count + 2, 1, 1)) if frames is None else frames[None],
        series={f"touch {item.name}": row[None] for item, row in zip((LEFT, RIGHT, BAR), rows, strict=True)},
    )
    return RecordedOutputs(recording, None, ARM)


def straight(x=0.0, z=0.0):
    return np.stack([np.full_like(ARM.edges, x), ARM.edges, np.full_like(ARM.edges, z)], axis=1)


def path(*corners):
    """Nodes evenly along a broken line."""
    corners = np.array(corners)
    steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    where = ARM.edges / ARM.edges[-1] * steps[-1]
    return np.stack([np.interp(where, steps, corners[:, axis]) for axis in range(3)], axis=1)


def read(quantity, seen, **numbers):
    return float(goal(quantity, **{"object": "bar", "value": 0.0, **numbers}).read(seen)[0])


def test_threading_counts_passes_between_less_those_beside():
    def passes(points):
        return read("threading", outputs(points), object="left", other="right")

    assert passes(straight()) == 1
    assert passes(straight(x=0.05)) == -1
    assert passes(path((0, 0, 0), (0, 0.13, 0), (0.06, 0.13, 0), (0.06, 0.02, 0))) == 0, "through and back beside"
    assert passes(path((0, 0, 0), (0, 0.13, 0), (0.01, 0.13, 0), (0.01, 0.02, 0))) == 2, "through and back again"
    assert passes(path((0, 0, 0), (0, 0.05, 0), (0.1, 0.05, 0))) == 0


def test_gap_is_that_of_the_surfaces():
    x = 0.04
    nearest = np.hypot(x, 0.15 - MIDDLE) - 0.005 - np.asarray(ARM.section(MIDDLE).outer_radius)
    assert read("gap", outputs(straight(x=x))) == pytest.approx(nearest.min(), abs=1e-9)
    assert read("gap", outputs(straight())) < 0


def test_free_turns_are_what_is_left_of_the_arm():
    distance = np.hypot(0.04, 0.15 - MIDDLE) - np.asarray(ARM.section(MIDDLE).outer_radius)
    k = int(distance.argmin())
    expected = (0.2 - MIDDLE[k]) / (2 * np.pi * (0.005 + np.asarray(ARM.section(MIDDLE[k:]).outer_radius).mean()))
    assert read("free_turns", outputs(straight(x=0.04))) == pytest.approx(expected)


@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi])
def test_facing_is_the_cosine_to_the_object(angle):
    """An arm beside the bar, at +x of it: the bar lies at -x."""
    d1 = np.array([-np.cos(angle), 0.0, np.sin(angle)])
    frame = np.array([d1, np.cross([0.0, 1.0, 0.0], d1), [0.0, 1.0, 0.0]])
    frames = np.tile(frame, (len(ARM.edges) + 1, 1, 1))
    near = np.abs(MIDDLE - 0.15) < 0.01
    aside = np.stack([np.full(near.sum(), -0.03), 0.15 - MIDDLE[near]], axis=1)
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    found = read("facing", outputs(straight(x=0.03, z=0.02), frames=frames), azimuth=np.pi / 2)
    assert found == pytest.approx(np.cos(angle), abs=0.12)
    assert read("facing", outputs(straight(x=0.03, z=0.02), frames=frames), azimuth=-np.pi / 2) == pytest.approx(-found)


@pytest.mark.parametrize("degrees", [0, 40, 90, 170, 190])
def test_an_object_has_turned_from_where_it_was_at_the_begin(degrees):
    angle = np.radians(degrees)
    frame = frame_of(Capsule(name="b", radius=1.0, length=1.0, axis=(0.0, np.sin(angle), np.cos(angle))))
    found = read("object_turn", outputs(straight(), moved={Body.FRAME: frame}))
    assert found == pytest.approx(np.radians(min(degrees, 360 - degrees)), abs=1e-6)


def test_position_is_a_coordinate_along_a_direction():
    seen = outputs(straight(), moved={Body.POSITION: (0.03, 0.12, -0.01)})
    assert read("object_position", seen) == pytest.approx(0.03)
    assert read("object_position", seen, direction=[0, 2, 0]) == pytest.approx(0.12)
    assert read("object_position", seen, direction=(1, 0, -1)) == pytest.approx(0.04 / np.sqrt(2))
    with pytest.raises(OctoctrlError, match="direction is \\(0, 0, 0\\)"):
        goal("object_position", object="bar", value=0.0, direction=(0, 0, 0))


def test_clearance_is_that_of_two_objects():
    near = {Body.POSITION: (0.0, 0.1, 0.0)}
    assert read("object_clearance", outputs(straight(), moved=near), other="left") == pytest.approx(0.03 - 0.01 - 0.005)
    assert read("object_clearance", outputs(straight(), moved={Body.POSITION: (-0.02, 0.1, 0.0)}), other="left") == pytest.approx(-0.005)
    lying = frame_of(Capsule(name="b", radius=1.0, length=1.0, axis=(1, 0, 0)))
    tip_first = read("object_clearance", outputs(straight(), moved=near | {Body.FRAME: lying}), other="left")
    assert tip_first == pytest.approx(0.03 - 0.02 - 0.01 - 0.005)


def test_winding_price_falls_towards_the_object_and_beyond_the_goal():
    wanted = goal("covered_winding", object="bar", at_least=0.95)
    far, near = (wanted.price(outputs(path((0, 0, 0), (x, 0.14, 0.02), (x, 0.2, 0.02)))) for x in (0.08, 0.03))
    assert near < far


def test_every_goal_about_objects_says_that_it_needs_a_recording():
    kinds = {name: kind for name, kind in goal_kinds().items() if getattr(kind, "simulated", False)}
    assert len(kinds) == 9
    for name, kind in kinds.items():
        more = {"other": "left"} if "other" in kind.__dataclass_fields__ else {}
        asked = goal(name, object="bar", at_least=1.0, **more)
        assert "of 'bar'" in str(asked)
        with pytest.raises(OctoctrlError, match="read on recordings only"):
            asked.read(SimpleNamespace())
