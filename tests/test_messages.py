"""Bad inputs and what is said about them: a table that is also documentation."""

import json
import re
from dataclasses import fields, replace

import numpy as np
import pytest
from conftest import coil_execution

import octoctrl as oc
from octoctrl import tasks
from octoctrl.carrying.results import ExecutionStatus
from octoctrl.cli.application import main
from octoctrl.files import store
from octoctrl.planners.asking.registry import primitive
from octoctrl.planners.asking.shares import Share
from octoctrl.planners.model.readings import residual_function
from octoctrl.planners.model.reduced import ReducedModel
from octoctrl.sim.body.fibres import winding_of
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import make_plant
from octoctrl.sim.scene.objects import Capsule, Plane

TEMPLATE = """[task]
name = "reach"

[[task.phases]]
name = "store"
duration = 1.0
goals = [{ quantity = "twist", value = -1.0 }]

[[task.drives]]
name = "twist"
primitive = "Twist"
begins = "store"
settings = { hand = "R-OM", level = 0.3 }

[arm]
length = 0.2
"""

TASK_KEYS, ARM_KEYS = (", ".join(item.name for item in fields(kind)) for kind in (oc.Task, oc.Arm))


class Mine:
    """A primitive of a user's own."""

    level, onset = 0.2, 0.0

    def __init__(self, templates, bounds=None):
        self._given, self._bounds = templates, {} if bounds is None else bounds

    def templates(self):
        return self._given

    def bounds(self):
        return self._bounds

    def effort(self, seconds):
        return 0.0 * seconds


class Odd:
    """A goal of a user's own."""

    def __init__(self, residual):
        self._residual = residual

    def __str__(self):
        return "odd"

    def residuals(self, outputs):
        return [self._residual(outputs)]


POST = Capsule(name="post", radius=0.008, length=0.08, position=(-0.022, 0.06, -0.01))


def threaded(other):
    """A task about the post and another object."""
    goals = (oc.goal("threading", object="post", other=other, value=1),)
    return oc.Task(name="through", phases=(oc.Phase(name="pass", duration=1.0, goals=goals),), drives="choose")


def turned():
    """A task that turns the post."""
    goals = (oc.goal("object_turn", object="post", value=1.5),)
    return oc.Task(name="turned", phases=(oc.Phase(name="turn", duration=1.0, goals=goals),), drives="choose")


OBJECTS = [
    (lambda: oc.goal("facing", object="bar", at_least=1.7), "goal facing=1.7 is outside -1…1"),
    (lambda: oc.goal("object_turn", object="bar", value=31.4), "goal object_turn=31.4 rad is outside 0…3.14159 rad"),
    (lambda: oc.goal("threading", object="post", other="post", value=1), "goal threading: object and other are both 'post'; name two objects"),
    (lambda: oc.plan("grasp", scene=oc.Scene()), "task 'grasp': a goal is about object 'post', which the scene does not have (none)"),
    (
        lambda: oc.plan(turned(), scene=oc.Scene(objects=(POST,))),
        "task 'turned': goal object turn 1.5 ± 0.2 rad of 'post': the object is fixed and stays at 0 rad; give it a support that lets it move, such as Free()",
    ),
    (
        lambda: oc.plan("grasp", scene=oc.Scene(objects=(Plane(name="post", position=(0.0, 0.0, -0.03)),))),
        "task 'grasp': goal covered winding at least 0.95 ± 0.05 turns for 1 s of 'post': the object is a plane, of which there is no such number; gap can be asked for",
    ),
    (lambda: oc.plan(threaded("bar"), scene=oc.Scene(objects=(POST,))), "task 'through': a goal is about object 'bar', which the scene does not have (post)"),
    (lambda: oc.plan("grasp", time_limit=-1), "time_limit=-1 s is outside > 0 s"),
    (lambda: oc.plan("grasp", executor=4), "executor is 4; give one of concurrent.futures, such as ThreadPoolExecutor(4)"),
    (lambda: oc.plan("grasp", start=oc.Plant().observe()), "task 'grasp' is planned by simulating, from rest; leave start out"),
    (lambda: oc.Task(name="two", phases=(oc.Phase(name="a", duration=1.0, with_next=True),), drives="choose"), "phase 'a' is the last and is to be searched with the next; leave its with_next out"),
    (lambda: oc.make_plant("assembly", paper_compatible=True, energy=True).core.energies(), "the published laws have no potential, so that there is no account of their energy; leave paper_compatible or energy out"),
    (lambda: oc.make_plant("assembly-coarse", precision="mixed", energy=True).core.energies(), "energy is accounted for in double precision only; leave precision or energy out"),
    (lambda: oc.Arm(length=20), "length=20 m is outside 0.001…5 m; lengths are SI - did you mean 0.20 (20 cm)?"),
    (lambda: oc.Arm(length=10**400), f"length is 1{'0' * 59} … {'0' * 17}; a finite number is needed"),
    (lambda: ReducedModel(laws="x" * 3000), f"unknown laws '{'x' * 60} … {'x' * 17}' (known, generic)"),
    (lambda: oc.Arm(elements=2), "elements=2: at least 8 are needed to carry a curvature packet (10 per packet width advised)"),
    (lambda: oc.Arm(base_radius=0.08), "radius 0.08 m for a 0.20 m arm: rod theory wants radius/length < 0.25, found 0.40"),
    (lambda: oc.Arm.octopus(lenght=0.2), f"Arm has no field 'lenght'; did you mean 'length'? ({', '.join(item.name for item in fields(oc.Arm))})"),
    (lambda: make_plant("assembly", precision="half"), "unknown precision 'half' (double, mixed)"),
    (lambda: make_plant("assembly", precision="mixed", paper_compatible=True), "paper_compatible is in double precision, to the bit; leave precision='mixed' out"),
    (lambda: make_plant("assembly", threads=3), "threads=3 is outside 1…2; one half of the arm for each"),
    (lambda: make_plant("assembly", threads=1.5), "threads: expected a whole number, found float 1.5"),
    (lambda: make_plant("assembly", threads=2, paper_compatible=True), "paper_compatible runs in one thread; leave threads=2 out"),
    (
        lambda: make_plant("assembly", taut=True, paper_compatible=True),
        "paper_compatible has the study's fibres, which are not taut; leave taut out",
    ),
    (lambda: make_plant("rod", precision="mixed"), "the plant 'rod' has no option 'precision' (complete)"),
    (lambda: make_plant("rod", threads=2), "the plant 'rod' has no option 'threads' (complete)"),
    (lambda: oc.Phase(name="store", duration=0), "phase 'store': duration=0 s is outside 0.3…4 s"),
    (lambda: oc.goal("twist", value=float("nan")), "goal twist is nan; a finite number is needed"),
    (lambda: primitive("bendwave"), "unknown primitive 'bendwave'; did you mean 'BendWave'? (Bend, BendWave, CarriedBend, Curl, Elongate, Shorten, StoreTwist, Swing, Twist, TwistWave)"),
    (lambda: oc.Schedule(primitives=(), duration=1.0), "no primitives given; pass at least one or leave it out for the task's default (Bend, BendWave, CarriedBend, Curl, Elongate, Shorten, StoreTwist, Swing, Twist, TwistWave)"),
    (lambda: oc.goal("twits", value=1.0), "unknown quantity 'twits'; did you mean 'twist'? (covered_winding, curvature, facing, free_turns, gap, keep_out, length, lifted_link, lifted_writhe, object_clearance, object_position, object_turn, packet, shape, sucker_side, threading, tip, tip_tangent, twist, winding)"),
    (lambda: oc.goal("tip", value=(0.0, 0.1, float("inf"))), "goal tip is inf; a finite number is needed"),
    (lambda: oc.goal("tip_tangent", direction=(0, 0, 0)), "goal tip_tangent: direction is (0, 0, 0); three numbers are needed, not all zero, for example (0, 1, 0)"),
    (lambda: oc.goal("twist", value=0.1, window=(0.1, 0.05)), "goal twist: window (0.1, 0.05) m: the begin must lie before the end"),
    (lambda: oc.goal("sucker_side", at_least=1.2), "goal sucker_side=1.2 is outside -1…1"),
    (lambda: task(goals=(oc.goal("tip", value=(0.0, 0.1, 0.0)), oc.goal("tip", value=(0.0, 0.2, 0.0)))), "phase 'a' asks for tip (0, 0.1, 0) ± 0.01 m and for tip (0, 0.2, 0) ± 0.01 m; no shape has both, give one of them"),
    (lambda: oc.Plateau(groups=("LM1",), level=0.2, offset=float("nan")), "offset is nan; a finite number is needed"),
    (lambda: oc.Plateau(groups=("LM1",), level=0.2, offset="never"), "offset: expected a number in s, found the string 'never'"),
    (lambda: oc.Plateau(groups=("LM1",), level=0.2, window=(float("nan"), 0.1)), "Plateau: window is nan; a finite number is needed"),
    (lambda: oc.Bend(window=0.1), "Plateau: window is 0.1; two arclengths in metres are needed"),
    (lambda: oc.goal("twist", value=Share(percent=10.0)), "goal twist 10 % ± 0.05 turns: only lengths can be shares of the arm"),
    (lambda: oc.Bend(window=(0.0, Share(percent=50.0))).templates(), "Plateau: window: expected a number in m, found Share 50 % of the arm"),
    (lambda: float(Share(percent=50.0)), "50 % of the arm is no length before the arm is known; take task.on(arm)"),
    (lambda: task(window=(0.3, 0.4)).on(oc.Arm()), "drive 'bend': the window begins at 0.3 m, beyond the arm of 0.2 m; give arclengths on the arm, or shares of it such as '40 %'"),
    (lambda: task(window=(Share(percent=50.0), 0.05)).on(oc.Arm()), "drive 'bend' on an arm of 0.2 m: Plateau: window (0.1, 0.05) m: the begin must lie before the end"),
    (lambda: oc.goal("tip", value=0.1), "goal tip: value is 0.1; three numbers are needed, such as (0, 0.1, 0)"),
    (lambda: oc.goal("twist", between=0.1), "goal twist: between is 0.1; two numbers are needed, the lower first"),
    (lambda: oc.Phase(name="a", duration=1.0, goals=3), "phase 'a': goals is 3; several are needed, in brackets: (3,) for one"),
    (lambda: oc.Drive(name="bend", primitive=oc.Bend(), begins="a", free="level"), "drive 'bend': free is 'level'; several are needed, in brackets: ('level',) for one"),
    (lambda: oc.goal("twist"), "goal twist: none is given; one of value, at_least, at_most, between is needed"),
    (lambda: oc.goal("twist", value=1.0, at_least=0.5), "goal twist: value and at_least are given; one of value, at_least, at_most, between is needed"),
    (lambda: oc.goal("twist", between=(0.5, -0.5)), "goal twist: between (0.5, -0.5): the first must not be above the second"),
    (lambda: oc.goal("twist", value=1.0, hold=-1.0), "hold=-1 s is outside >= 0 s"),
    (lambda: task(goals=(oc.goal("twist", value=-1.0), oc.goal("twist", at_least=0.0))), "phase 'a' asks for twist -1 ± 0.05 turns and for twist at least 0 ± 0.05 turns; no shape has both, give one of them"),
    (lambda: task(goals=(oc.goal("twist", value=-1.0, hold=5.0),)), "phase 'a' lasts 4 s at most and is asked to hold twist -1 ± 0.05 turns for 5 s; hold it for less or allow a longer phase"),
    (lambda: task(goals=("twist",)), "phase 'a': 'twist' is no goal, it has no quantity and no when and no tolerance and no unit and no miss and no residuals and no beyond"),
    (lambda: task(names=("a", "b", "a")), "two phases are called 'a'; give each a name of its own (a, b, a)"),
    (lambda: task(drives=2), "two drives are called 'bend'; give each a name of its own (bend, bend)"),
    (lambda: task(begins="b", ends="a"), "drive 'bend' begins with 'b' and ends with 'a'; ends must be nothing, for it begins with the last phase"),
    (lambda: task(begins="a", ends="a"), "drive 'bend' begins with 'a' and ends with 'a'; ends must be a later phase (b), or nothing"),
    (lambda: task(level=0.9), "drive 'bend': level=0.9 is outside 0…0.75; the planner chooses within these bounds; take it out of free to fix it"),
    (lambda: task(pole=(0, -1, 0)), "task 'task': pole (0.0, -1.0, 0.0) is opposite to the arm's base (0.0, 1.0, 0.0), where lifted writhe has no value; give the axis of the expected coil, for example (0, 0, 1)"),
    (lambda: oc.Drive(name="bend", primitive="Bend", begins="a"), "drive 'bend': 'Bend' is no primitive, it has no templates and no bounds and no effort (Bend, BendWave, CarriedBend, Curl, Elongate, Shorten, StoreTwist, Swing, Twist, TwistWave)"),
    (lambda: oc.Drive(name="bend", primitive=oc.Bend(onset=1.0), begins="a"), "drive 'bend': onset follows from the phases; use begins and ends"),
    (lambda: oc.Schedule(primitives=(oc.Bend(),), duration=-1.0), "duration=-1 s is outside > 0 s"),
    (lambda: oc.TopologyConvention(pole=(0, 0)), "pole is (0, 0); three finite numbers are needed, not all zero, for example (0, 0, 1)"),
    (lambda: saturated().levels([0.62], np.linspace(0, 0.2, 21)), "activation of LM1 reaches 1.34 at t=0.62 s, s=0.01 m (Plateau 0.80 + Plateau 0.54); scale, shift, or pass on_saturation='clip'"),
    (lambda: oc.Activation(composition="sum"), "unknown composition 'sum' (override, handover, max, add)"),
    (lambda: tasks.load("coli"), "unknown task 'coli'; did you mean 'coil'? (coil, coil-outward, copy, corkscrew, grasp, lm-helix, packet, reach, tip, twist, or the path of a .toml file)"),
    (lambda: tasks.programme("fig2f"), "unknown programme 'fig2f'; did you mean 'fig4f'? (fig2c, fig2e, fig3a, fig3b, fig3c, fig4a, fig4e, fig4f, fig4g, fig4i, si10b, si11a, si9)"),
    (lambda: oc.report([]), "a report needs at least one run; the list is empty"),
    (lambda: oc.Centreline(time=np.zeros(1), points=np.arange(9.0).reshape(1, 3, 3)), "points has shape (1, 3, 3); (T, n, 3) with at least 4 points along the arm is needed"),
    (lambda: oc.Centreline(time=np.zeros(2), points=np.arange(24.0).reshape(2, 4, 3)), "time has shape (2,) for 2 instants, or does not increase; one later value per instant is needed"),
    (lambda: oc.Centreline(time=np.zeros(1), points=np.arange(12.0).reshape(1, 4, 3), markers=np.zeros((1, 3, 3))), "markers has shape (1, 3, 3), points (1, 4, 3); one marker beside each point is needed"),
    (lambda: winding_of([]), "there are no fibres; give at least one"),
    (lambda: winding_of([np.zeros((2, 3))]), "fibre 0 has shape (2, 3) or a number that is not finite; (k, 3) with 3 points or more is needed"),
    (lambda: oc.read_centreline("arm.csv", unit="mn"), "unknown unit 'mn'; did you mean 'm'? (m, cm, mm, um, µm)"),
    (lambda: oc.read_fibres("arm.csv"), "unknown format '.csv'; use .trk or .tck"),
    (lambda: oc.Plateau(groups="LM1", level=0.2), "Plateau: groups is 'LM1'; several texts are needed, in brackets: ('LM1',) for one"),
    (lambda: oc.Scene(water=5), "Scene: water is 5; a Water or None is needed"),
    (lambda: oc.PointLoad(follower="no"), "PointLoad: follower is 'no'; True or False is needed"),
    (lambda: oc.Arm(lumped=3), "Arm: lumped is 3; a LumpedSection is needed"),
    (lambda: oc.Task(name="a", phases=(1,)), "Task: phases is (1,); several Phases are needed"),
    (lambda: oc.goal("keep_out", shape="ball"), "KeepOutGoal: shape is 'ball'; a SphereZone or a CapsuleZone or a HalfSpaceZone is needed"),
    (lambda: oc.goal("winding", value=1.0), "winding needs object as well (tolerance, when, hold, value, at_least, at_most, between, object)"),
    (lambda: oc.SpreadLoad(window=3), "load: window is 3; two arclengths in metres are needed"),
    (lambda: oc.Wave(groups=("LM1",), level=0.2, speed=0.1, width=0.01, apex=float("nan")), "apex is nan; a finite number is needed"),
    (lambda: oc.make_plant("rod", oc.Scene()), "arm is a Scene; an Arm is needed"),
    (lambda: oc.make_plant(gains=0.5), 'gains is 0.5; a Mapping is needed: for example {"LM2": 0.5}'),
    (lambda: oc.plan(3), "task is 3; a Task or a Configuration is needed: the name of a task, the path of a file, or what oc.tasks.load gives"),
    (lambda: oc.plan("twist", arm=oc.Scene()), "arm is a Scene; an Arm is needed"),
    (lambda: oc.plan("twist", guess="plan.npz"), "guess is 'plan.npz'; a Plan is needed: what oc.plan gives, or oc.load of its file"),
    (lambda: oc.plan("twist", model=3), "model is 3; an IdentifiedModel is needed: the path of a file that octoctrl identify wrote, or IdentifiedModel.load of it"),
    (lambda: oc.execute("plan.npz"), "plan is 'plan.npz'; a Plan is needed: what oc.plan gives, or oc.load of its file"),
    (lambda: oc.verify("run.npz"), "execution is 'run.npz'; an Execution is needed: what oc.execute gives, or oc.load of its file"),
    (lambda: oc.compare(None), "execution is None; an Execution is needed: what oc.execute gives, or oc.load of its file"),
    (lambda: oc.report("run.npz"), "run is 'run.npz'; an Execution is needed: what oc.execute gives, or oc.load of its file"),
    (lambda: oc.export(3, "a.csv"), "run is 3; an Execution is needed: what oc.execute gives, or oc.load of its file"),
    (lambda: oc.Water(factor=1e300), "factor=1e+300 is outside 0…1e+06"),
    (lambda: oc.Water(density=-1.0), "density=-1 kg/m^3 is outside 0…100000 kg/m^3"),
    (lambda: oc.Drive(name="a", primitive=Mine(oc.Plateau(groups=("LM1",), level=0.2)), begins="b"), "drive 'a': Mine gives the templates Plateau(groups=('LM1',), level=0.2, onset=0.0, rise=0.5, off … indow=(0.0, inf)); several of Plateau, Wave and Pulse are needed"),
    (lambda: oc.Drive(name="a", primitive=Mine((), bounds=3), begins="b"), "drive 'a': Mine gives the bounds 3; ranges by name are needed, such as {\"level\": (0, 0.6)}"),
    (lambda: oc.Drive(name="a", primitive=Mine((), bounds={"level": (0.0, float("inf"))}), begins="b"), "drive 'a': Mine: range of level is (0.0, inf); two finite numbers are needed, such as (0, 0.6)"),
    (lambda: residual_function([Odd(lambda outputs: outputs.tip)], oc.Arm(), 8), "goal odd: its formula must serve arrays and CasADi expressions alike, with `outputs.math` and without branches; it gives 3 numbers for an instant where one is needed: take a column by row[:, index]"),
    (lambda: residual_function([Odd(lambda outputs: abs(outputs.colour))], oc.Arm(), 8), "goal odd: its formula must serve arrays and CasADi expressions alike, with `outputs.math` and without branches; it ended with: 'ModelOutputs' object has no attribute 'colour'"),
    (lambda: oc.topology_of([[0.0, 0.0, 0.0]]), "centreline is [[0.0, 0.0, 0.0]]; a Centreline is needed: time and points of the line, or what oc.read_centreline gives"),
    (lambda: oc.Centreline(time=[0.0], points=[[[0.0, 0.0, 0.0]] * 3]), "nodes 0 and 1 of frame 0 coincide; every segment needs a length"),
]  # fmt: skip


def task(names=("a", "b"), goals=(), begins="a", ends="", drives=1, level=0.3, pole=(0, 0, 1), window=(0.0, 0.1)):
    phases = tuple(oc.Phase(name=name, duration=1.0, goals=goals) for name in names)
    drive = oc.Drive(name="bend", primitive=oc.Bend(level=level, window=window), begins=begins, ends=ends)
    return oc.Task(name="task", phases=phases, drives=(drive,) * drives, convention=oc.TopologyConvention(pole=pole))


def saturated():
    parts = tuple(oc.Plateau(groups=("LM1",), level=level, rise=0.1) for level in (0.80, 0.54))
    return oc.Activation(templates=parts, composition="add")


@pytest.mark.parametrize(("call", "message"), OBJECTS, ids=range(len(OBJECTS)))
def test_objects(call, message):
    with pytest.raises(OctoctrlError) as caught:
        call()
    assert str(caught.value) == message


FILES = [
    ('name = "reach"', 'nme = "reach"', f"reach.toml:2 task.nme: unknown key; did you mean 'name'? (known: {TASK_KEYS})"),
    ("duration = 1.0", "duration = 'fast'", "reach.toml:6 task.phases[0].duration: expected a number in seconds, found the string 'fast'"),
    ("duration = 1.0", "duration = true", "reach.toml:6 task.phases[0].duration: expected a number in seconds, found true"),
    ("duration = 1.0", "duration = -1", "reach.toml:6 task.phases[0].duration: phase 'store': duration=-1 s is outside 0.3…4 s"),
    ("duration = 1.0", "", "reach.toml:4 task.phases[0]: 'duration' is missing"),
    ('"twist", value', '"twits", value', "reach.toml:7 task.phases[0].goals[0].quantity: unknown quantity 'twits'; did you mean 'twist'? (covered_winding, curvature, facing, free_turns, gap, keep_out, length, lifted_link, lifted_writhe, object_clearance, object_position, object_turn, packet, shape, sucker_side, threading, tip, tip_tangent, twist, winding)"),
    ("length = 0.2", "length = '8 inch'", "reach.toml:16 arm.length: unit 'inch' not known; use m, cm, mm"),
    ("length = 0.2", "length = 20", "reach.toml:16 arm.length: length=20 m is outside 0.001…5 m; lengths are SI - did you mean 0.20 (20 cm)?"),
    ("length = 0.2", "elements = 9.5", "reach.toml:16 arm.elements: expected a whole number, found the number 9.5"),
    ("length = 0.2", "densities = [1, 2]", "reach.toml:16 arm.densities: expected 4 values, found 2"),
    ('primitive = "Twist"', 'primitive = "bendwave"', "reach.toml:11 task.drives[0].primitive: unknown primitive 'bendwave'; did you mean 'BendWave'? (Bend, BendWave, CarriedBend, Curl, Elongate, Shorten, StoreTwist, Swing, Twist, TwistWave)"),
    ("level = 0.3", "levle = 0.3", "reach.toml:13 task.drives[0].settings.levle: unknown key; did you mean 'level'? (known: level, onset, rise, offset, fall, window, hand)"),
    ("level = 0.3", "level = 3", "reach.toml:13 task.drives[0].settings: level=3 is outside 0…1"),
    ('begins = "store"', 'begins = "stor"', "reach.toml:1 task: drive 'twist': unknown phase 'stor'; did you mean 'store'? (store)"),
    ("[arm]", "[arm", "reach.toml:15: not valid TOML: expected ']' at the end of a table declaration"),
    ('value = -1.0', 'valeu = -1.0', "reach.toml:7 task.phases[0].goals[0].valeu: unknown key; did you mean 'value'? (known: tolerance, when, hold, value, at_least, at_most, between, window)"),
    ('"twist", value = -1.0', '"twist", when = "always", value = -1.0', "reach.toml:7 task.phases[0].goals[0].when: expected end or throughout, found the string 'always'"),
    ('{ quantity = "twist", value = -1.0 }', '{ value = -1.0 }', "reach.toml:7 task.phases[0].goals[0]: 'quantity' is missing"),
    ('{ quantity = "twist", value = -1.0 }', '{ quantity = "keep_out", shape = { kind = "SpereZone", radius = "1 cm" } }', "reach.toml:7 task.phases[0].goals[0].shape.kind: unknown kind 'SpereZone'; did you mean 'SphereZone'? (SphereZone, CapsuleZone, HalfSpaceZone)"),
    ('{ quantity = "twist", value = -1.0 }', '{ quantity = "tip", value = ["1 cm", 0.1] }', "reach.toml:7 task.phases[0].goals[0].value: expected 3 values, found 2"),
    ("length = 0.2", "length = 1" + 400 * "0", "reach.toml:16 arm.length: the number is beyond 1e308"),
    ("[arm]", "a = " + 3000 * "[" + "\n[arm]", "reach.toml: not valid TOML: brackets are nested too deeply"),
    ('"Twist"\nbegins = "store"\nsettings = { hand = "R-OM", level = 0.3 }', '"Swing"\nbegins = "store"\nsettings = { start = "5 cm", stop = 0.04 }', "reach.toml:13 task.drives[0].settings: start=0.05 m is not before stop=0.04 m; give the end that is nearer to the base first"),
    ("[arm]", "[run]\nfeedback = 'tvlq'\n[arm]", "reach.toml:16 run.feedback: unknown feedback 'tvlq'; did you mean 'tvlqr'? (tvlqr, mpc, grip, open-loop)"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), FILES, ids=range(len(FILES)))
def test_task_files(tmp_path, monkeypatch, capsys, old, new, message):
    monkeypatch.chdir(tmp_path)
    assert TEMPLATE.count(old) == 1
    (tmp_path / "reach.toml").write_text(TEMPLATE.replace(old, new))
    assert main(["plan", "reach.toml", "-o", "plan.npz"]) == 2
    captured = capsys.readouterr()
    assert captured.err == f"octoctrl: {message}\n"
    assert captured.out == "" and not (tmp_path / "plan.npz").exists()


COMMANDS = [
    (["plan", "coil", "-o", "plan.npz", "--set", "task.taget=1"], f"--set task.taget: unknown key (known: {TASK_KEYS})"),
    (["plan", "coil", "-o", "plan.npz", "--set", "task.phases.stor.duration=1"], "--set task.phases: no element 'stor'; did you mean 'store'? (store, open, spiral, cross, telescope)"),
    (["plan", "coil", "-o", "plan.npz", "--set", "arm.length"], "--set arm.length: expected key=value, for example --set task.phases.store.duration=1.2"),
    (["plan", "coil", "-o", "plan.npz", "--set", "...=1"], "--set ...=1: expected key=value, for example --set task.phases.store.duration=1.2"),
    (["plan", "coil", "-o", "plan.npz", "--set", "plan.time_limit=0"], "--set plan.time_limit: time_limit=0 s is outside > 0 s"),
    (["plan", "none.toml", "-o", "plan.npz"], "none.toml does not exist; print a template with: octoctrl tasks coil --show > none.toml"),
    (["plan", "coil", "-o", "plan.mat"], "unknown format '.mat'; use .npz"),
    (["plan", "coil", "-o", "there.npz"], "there.npz exists; use -f to replace"),
    (["plan", "coil", "-o", "no/plan.npz"], "folder no does not exist; make it first"),
    (["plan", "coil", "-o", "plan.npz", "--model", "m.json"], "m.json does not exist; make one with: octoctrl identify -o m.json"),
    (["identify", "-o", "model.npz"], "unknown format '.npz'; use .json"),
    (["run", "plan.npz", "-o", "run.npz"], "plan.npz does not exist"),
    (["run", "coil.npz", "-o", "there.npz"], "there.npz exists; use -f to replace"),
    (["run", "coil.npz", "-o", "run.npz", "--feedback", "lqg"], "unknown feedback 'lqg' (tvlqr, mpc, grip, open-loop)"),
    (["run", "coil.npz", "-o", "run.npz", "--open-loop", "--feedback", "tvlqr"], "--open-loop and --feedback tvlqr contradict each other; give one of them"),
    (["verify", "there.npz"], "there.npz is not a file of octoctrl, or is damaged"),
    (["verify", "new.npz"], "new.npz has schema 3, this octoctrl reads 2: pip install -U octoctrl"),
    (["verify", "old.npz"], "old.npz has schema 1, this octoctrl reads 2: make the file again"),
    (["compare", "cut.npz"], "planned trace covers 0–3.0 s, simulated 0–1.2 s (run stopped early: unstable); comparing 0–1.2 s needs overlap=True"),  # noqa: RUF001
    (["compare", "coil.npz", "--plot", "a.bmp"], "coil.npz holds a plan, not a run; make one with: octoctrl run"),
    (["compare", "cut.npz", "--overlap", "--plot", "a.bmp"], "unknown format '.bmp'; use .png or .pdf or .svg"),
    (["report", "coil.npz", "-o", "a.html"], "coil.npz holds a plan, not a run; make one with: octoctrl run"),
    (["export", "there.npz", "a.obj"], "unknown format '.obj'; use .csv or .glb or .gif or .webp or .mp4"),
    (["topology", "none.csv"], "none.csv does not exist"),
    *[([*words, "folder.npz"], "folder.npz is a folder; give the path of a file") for words in (["verify"], ["compare"], ["run", "-o", "run.npz"], ["topology"], ["sweep"], ["plan", "coil", "-o", "plan.npz", "--model"])],
    (["tasks", "folder.toml"], "folder.toml is a folder; give the path of a file"),
    (["verify", ""], ". does not say its format; use .npz or .nc"),
    (["compare", "/"], "/ does not say its format; use .npz or .nc"),
    (["plan", "coil", "-o", "folder"], "folder does not say its format; use .npz"),
    (["sweep", ""], ". is a folder; give the path of a file"),
    (["run", "--resume", "there.npz"], "there.npz.parts holds no parts to go on with, and there.npz exists: nothing was broken off; run the plan anew"),
    (["run", "coil.npz", "-o", "run.npz", "--threads", "2"], "the plant 'rod' has no option 'threads' (complete)"),
    (["doctor", "--plant", "assembly"], "--set and --plant are of a task; name one, for example: octoctrl doctor coil --plant assembly"),
    (["bench", "rod", "--count", "2"], "count is for plans, choice, following, mending alone, not for rod; leave it out"),
    (["bench", "steps", "skips", "--plant", "rod"], "plants is for tracking alone, not for steps, skips; leave it out"),
    (["bench", "plans", "--seed", "-1"], "seed=-1 is outside >= 0"),
    (["plan", "coil", "-o", "plan.npz", "--set", "arm.x.y=1"], f"--set arm.x: unknown key (known: {ARM_KEYS})"),
    (["plan", "coil", "-o", "plan.npz", "--set", "arm.length=-1"], "--set arm.length: length=-1 m is outside 0.001…5 m"),
    (["plan", "coil", "-o", "plan.npz", "--set", "scene.objects=[{name='post'}]"], "--set scene.objects[0]: 'kind' is missing (Sphere, Capsule, Cylinder, Box, Plane, Mesh)"),
    (["plan", "coil", "-o", "plan.npz", "--set", "scene.objects=[{kind='RigidObject'}]"], "--set scene.objects[0].kind: unknown kind 'RigidObject' (Sphere, Capsule, Cylinder, Box, Plane, Mesh)"),
    (["plan", "coil", "-o", "plan.npz", "--set", "scene.objects=[{kind='Capsule', name='post', radius=0, length=0.1}]"], "--set scene.objects[0]: object 'post': radius=0 m is outside > 0 m"),
    (["topology", "there.npz"], "there.npz has no column time, point, x, y, z (found: not ours); time, point, x, y, z are needed"),
    (["topology", "none.csv", "--plot", "a.bmp"], "unknown format '.bmp'; use .png or .pdf or .svg"),
    (["tasks", "coli"], "unknown task 'coli'; did you mean 'coil'? (coil, coil-outward, copy, corkscrew, grasp, lm-helix, packet, reach, tip, twist, or the path of a .toml file)"),
    (["demo", "coli"], "unknown task 'coli'; did you mean 'coil'? (coil, coil-outward, copy, corkscrew, grasp, lm-helix, packet, reach, tip, twist, or the path of a .toml file)"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "message"), COMMANDS, ids=range(len(COMMANDS)))
def test_commands(tmp_path, monkeypatch, capsys, coil_plan, arguments, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.npz").write_text("not ours")
    for name in ("folder", "folder.npz", "folder.toml"):
        (tmp_path / name).mkdir()
    store.save("coil.npz", coil_plan)
    store.save("cut.npz", coil_execution(coil_plan, until=1.2, status=ExecutionStatus.UNSTABLE))
    for name, schema in (("new", 3), ("old", 1)):
        np.savez(f"{name}.npz", header=np.frombuffer(json.dumps({"schema": schema}).encode(), dtype=np.uint8))
    before = sorted(item.name for item in tmp_path.iterdir())
    assert main(arguments) == 2
    assert capsys.readouterr().err == f"octoctrl: {message}\n"
    assert sorted(item.name for item in tmp_path.iterdir()) == before


def test_plan_from_another_arm(coil_plan):
    other = replace(coil_plan.arm, name="octopus-15cm", length=0.15)
    pattern = r"plan was made for arm 'octopus-20cm' \(hash \w{4}\), scene has 'octopus-15cm' \(\w{4}\); re-plan or pass arm=plan.arm"
    with pytest.raises(OctoctrlError, match=pattern):
        coil_plan.check_arm(other)


def test_no_message_is_longer_than_a_sentence():
    for *_, message in [*OBJECTS, *FILES, *COMMANDS]:
        assert "\n" not in message and not re.search(r"Error|Traceback|\$\.", message)
