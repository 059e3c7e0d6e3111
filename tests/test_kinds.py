"""Fields of what a user makes, given quite another kind of thing: a sentence, never a traceback, and nothing is taken in silently."""

import math
import typing
from dataclasses import fields, is_dataclass, replace
from enum import Enum

import numpy as np
import pytest

import octoctrl as oc
from octoctrl.files.configuration import PlanSettings, RunSettings
from octoctrl.judging.verification import Limits
from octoctrl.planners.asking.choice import Choice
from octoctrl.planners.asking.goals.keep_out import CapsuleZone, HalfSpaceZone, SphereZone
from octoctrl.planners.asking.registry import goal_kinds, primitive_kinds
from octoctrl.planners.asking.wrapping import Curl, StoreTwist, Swing, TwistCurve
from octoctrl.planners.model.reduced import ReducedModel
from octoctrl.sim.body.squid import SquidTentacle
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene.mesh import Mesh
from octoctrl.sim.scene.objects import Box, Capsule, Cylinder, Plane, Sphere
from octoctrl.sim.scene.supports import Free, Moved, Push, Springs
from octoctrl.sim.sources import Strike

CORNERS = ((0, 0, 0), (0.02, 0, 0), (0, 0.02, 0), (0, 0, 0.02))
ZONE = SphereZone(centre=(0.0, 0.1, 0.1), radius=0.01)
GOALS = (
    *(oc.goal(name, value=0.1) for name in ("twist", "lifted_writhe", "lifted_link", "length", "packet", "curvature", "sucker_side")),
    *(oc.goal(name, object="post", at_least=0.1) for name in ("covered_winding", "winding", "free_turns", "gap", "facing")),
    *(oc.goal(name, object="post", value=0.1) for name in ("object_position", "object_turn")),
    *(oc.goal(name, object="post", other="bar", at_least=0.1) for name in ("object_clearance", "threading")),
    oc.goal("touching", object="post", at_least=0.1) if "touching" in goal_kinds() else oc.goal("tip", value=(0, 0.1, 0.1)),
    oc.goal("tip_tangent", direction=(0, 1, 0)), oc.goal("keep_out", shape=ZONE),
    oc.goal("shape", value=((0, 0, 0), (0, 0.1, 0), (0, 0.2, 0))),
)  # fmt: skip
PHASE = oc.Phase(name="bend", duration=1.0, goals=(oc.goal("twist", value=0.5),))
DRIVE = oc.Drive(name="drive", primitive=oc.Bend(), begins="bend")
PRIMITIVES = [kind for kind in primitive_kinds().values() if kind.__module__.startswith("octoctrl")]
EXAMPLES = (
    oc.Plateau(groups=("LM1",), level=0.2),
    oc.Wave(groups=("LM1",), level=0.2, speed=0.1, width=0.01),
    oc.Pulse(groups=("LM1",), level=0.2, stretch=0.04, speed=0.3, width=5e-3, window=(0.02, 0.18)),
    oc.Activation(), oc.Arm(), oc.Arm().lumped, oc.Arm().longitudinal, oc.Arm().layout, oc.Arm().layout.groups[0], SquidTentacle(),
    oc.Scene(), oc.Water(), oc.PointLoad(), oc.SpreadLoad(), oc.Sensors(), Strike(),
    Sphere(name="ball", radius=0.01), Capsule(name="post", radius=0.01, length=0.1), Cylinder(name="post", radius=0.01, length=0.1),
    Box(name="box", size=(0.01, 0.01, 0.01)), Plane(name="floor"),
    Mesh(name="stone", vertices=CORNERS, triangles=((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))),
    Moved(), Free(), Springs(), Push(force=(0.0, 0.0, 1.0)),
    *GOALS, ZONE, CapsuleZone(start=(0, 0, 0.1), stop=(0, 0.1, 0.1), radius=0.01), HalfSpaceZone(point=(0, 0, 0), normal=(0, 0, 1)),
    *(kind(hand="L-OM") if "hand" in kind.__dataclass_fields__ else kind() for kind in PRIMITIVES),
    Curl(level=0.2, stop=0.1, apex=0.22), Swing(start=0.02), StoreTwist(curve=TwistCurve(levels=(0.0, 0.3), turns=(0.0, 9.0))),
    TwistCurve(levels=(0.0, 0.3), turns=(0.0, 0.5)), PHASE, DRIVE, oc.Task(name="task", phases=(PHASE,), drives=(DRIVE,)), Choice(),
    oc.Schedule(primitives=(oc.Bend(),), duration=1.0), oc.TopologyConvention(), PlanSettings(), RunSettings(), Limits(),
    ReducedModel(arm=oc.Arm()),
    oc.Centreline(time=np.arange(2.0), points=np.linspace(0, 0.2, 11)[None, :, None] * np.ones((2, 1, 3))),
)  # fmt: skip
OTHERS = (
    None, 3, -1, math.nan, math.inf, -math.inf, 1e300, True, 1j, "x", "", "12 mm", b"x", [], (), {}, {"LM1"}, object(), int, len,
    (1,), (math.nan, math.nan), (2, 1), ("a", "b"), (None,) * 3, np.zeros(3), np.array(0.3), 10**400,
)  # fmt: skip


def fits_by_eye(hint, value):
    """Whether a value may stand in a field of texts, truths, members or objects, written down anew; None where that holds numbers."""
    kinds = [kind for kind in (typing.get_args(hint) if not isinstance(hint, type) else (hint,)) if kind is not Ellipsis]
    if typing.get_origin(hint) is tuple:
        plain = len(kinds) == 1 and isinstance(kinds[0], type) and (kinds[0] is str or is_dataclass(kinds[0]))
        return (isinstance(value, tuple | list) and all(isinstance(item, kinds[0]) for item in value)) if plain else None
    if all(isinstance(kind, type) and (kind in (str, bool, type(None)) or is_dataclass(kind) or issubclass(kind, Enum)) for kind in kinds):
        return isinstance(value, tuple(kinds))
    return None


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: type(example).__name__)
def test_another_kind_of_thing_is_refused_with_a_sentence(example):
    hints = typing.get_type_hints(type(example))
    for item in fields(example):
        for value in OTHERS:
            try:
                replace(example, **{item.name: value})
            except OctoctrlError as error:
                assert "\n" not in str(error), item.name
            else:
                assert fits_by_eye(hints[item.name], value) is not False, f"{item.name} = {value!r}"


def test_lists_become_tuples():
    assert oc.Plateau(groups=["LM1"], level=0.2, window=[0.0, 0.1]) == oc.Plateau(groups=("LM1",), level=0.2, window=(0.0, 0.1))
    assert hash(oc.Activation(templates=[oc.Plateau(groups=["LM1"], level=0.2)])) == hash(
        oc.Activation(templates=(oc.Plateau(groups=("LM1",), level=0.2),))
    )
