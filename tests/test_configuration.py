import itertools
import re
import tomllib
from dataclasses import dataclass, fields, is_dataclass, replace
from math import inf, pi
from pathlib import Path
from typing import get_args, get_type_hints

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from octoctrl import tasks
from octoctrl.files.configuration import Configuration, PlanSettings, RunSettings, parse
from octoctrl.files.conversion import UNITS, build, unit_of
from octoctrl.files.toml_source import Source
from octoctrl.files.toml_writing import toml_of
from octoctrl.planners.asking.goals.keep_out import CapsuleZone, HalfSpaceZone, SphereZone
from octoctrl.planners.asking.primitives import Shorten, Twist
from octoctrl.planners.asking.registry import goal, goal_kinds, primitive_kinds
from octoctrl.planners.asking.task import Drive, Phase, Task
from octoctrl.planners.contracts import When
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm, LumpedSection
from octoctrl.sim.body.squid import SquidTentacle
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene.objects import Sphere
from octoctrl.sim.scene.scene import Scene, Water
from octoctrl.sim.scene.supports import Push, Springs
from octoctrl.sim.templates import WRITE_THRESHOLD

ROOT = Path(__file__).parent.parent

words = st.text(st.characters(codec="utf-8", exclude_categories=("Cs",)), max_size=12)
names = st.text("abdefghij_", min_size=1, max_size=8)
positive = st.floats(1e-3, 1e3)


finite = st.floats(-5, 5)
vectors = st.tuples(finite, finite, st.floats(0.1, 5))
bodies = st.one_of(
    st.builds(SphereZone, centre=vectors, radius=positive),
    st.builds(CapsuleZone, start=vectors, stop=vectors.map(lambda vector: (*vector[:2], vector[2] + 6)), radius=positive),
    st.builds(HalfSpaceZone, point=vectors, normal=st.permutations((0.0, 1.0, 0.0)).map(tuple)),
)
targets = st.one_of(
    *(st.fixed_dictionaries({name: finite}) for name in ("value", "at_least", "at_most")),
    st.fixed_dictionaries({"between": st.tuples(st.floats(-5, 0), st.floats(0, 5))}),
)
common = {"tolerance": positive, "hold": st.floats(0, 0.3), "when": st.sampled_from(list(When))}


def named(kind):
    """Names of objects that a kind of goal needs, two of them different."""
    given = {"object": names, "other": names.map("another {}".format)}
    return {item.name: given[item.name] for item in fields(kind) if item.name in given}


def wanted(kind):
    """Targets that such a goal can have."""
    return targets if kind.limits[1] == inf else st.fixed_dictionaries({"at_least": st.floats(*kind.limits)})


special = {
    "tip": st.fixed_dictionaries(common | {"value": vectors}),
    "shape": st.fixed_dictionaries(common | {"value": st.lists(vectors, min_size=1, max_size=3).map(tuple)}),
    "tip_tangent": st.fixed_dictionaries(common | {"direction": st.permutations((0.0, 1.0, 0.0)).map(tuple)}),
    "keep_out": st.fixed_dictionaries(common | {"shape": bodies, "margin": positive}),
    **{
        name: st.builds(lambda some, target: some | target, st.fixed_dictionaries(common | named(kind)), wanted(kind))
        for name, kind in goal_kinds().items()
        if named(kind)
    },
    "sucker_side": st.fixed_dictionaries(common | {"at_most": st.floats(-1, 1), "azimuth": finite}),
}
asked = {
    quantity: special.get(quantity, st.builds(lambda some, target: some | target, st.fixed_dictionaries(common), targets)).map(
        lambda numbers, quantity=quantity: goal(quantity, **numbers)
    )
    for quantity in goal_kinds()
}


@st.composite
def configurations(draw):
    labels = draw(st.lists(names, min_size=1, max_size=4, unique=True))
    goals = st.sampled_from(sorted(asked)).flatmap(asked.get)
    phases = tuple(
        Phase(name=label, duration=draw(st.floats(0.3, 4.0)), goals=tuple(draw(st.lists(goals, max_size=1)))) for label in labels
    )
    windows = st.tuples(st.floats(0, 0.1), st.one_of(st.just(inf), st.floats(0.11, 0.2)))
    fibre = {"level": draw(st.floats(0.02, 0.75)), "window": draw(windows), "rise": draw(st.floats(0.1, 4.0))}
    drives = (
        Drive(name="screw", primitive=Twist(hand="L-OM", **fibre), begins=labels[0], free=("level", "rise")),
        Drive(name=draw(names), primitive=Shorten(**fibre), begins=labels[0], ends=draw(st.sampled_from(["", *labels[1:]]))),
    )
    axis = draw(st.permutations([0.0, 0.0, 1.0]))
    task = Task(name=draw(words), description=draw(words), phases=phases, drives=drives, effort_weight=draw(positive))
    task = parse(toml_of(Configuration(task=task)), overrides=[f"task.convention.pole=[{', '.join(map(str, axis))}]"]).task
    arm = Arm(lumped=LumpedSection(torsion=draw(positive)), oblique=replace(Arm().oblique, slack=draw(positive)))
    water = draw(st.one_of(st.none(), st.builds(Water, density=positive, factor=st.floats(0, 10))))
    return Configuration(
        task=task,
        arm=draw(st.sampled_from([arm, Arm(length=draw(st.floats(0.1, 4.0)), elements=draw(st.integers(8, 300)))])),
        scene=Scene(water=water),
        plan=PlanSettings(time_limit=draw(positive), sections=draw(st.none() | st.integers(2, 40))),
        run=RunSettings(feedback=draw(st.sampled_from(["tvlqr", "open-loop"])), period=draw(st.none() | positive)),
    )


DRIVE = "drives=[{name='a',primitive='Shorten',begins='a'}]\n"
SMALL = "[task]\nname = 'a'\nphases = [{ name = 'a', duration = 1.0 }]\n" + DRIVE


@given(configurations())
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_template_parses_back_to_the_same_object(configuration):
    assert parse(toml_of(configuration)) == configuration


def test_every_task_parses_back():
    for name in tasks.names():
        configuration = tasks.load(name)
        assert parse(toml_of(configuration)) == configuration


def test_coil_is_the_programme_of_the_source_study():
    task = tasks.load("coil").task.on(Arm())
    assert [phase.name for phase in task.phases] == ["store", "open", "spiral", "cross", "telescope"]
    assert [(goal.quantity, goal.value) for goal in task.phases[3].goals] == [("twist", 0.0), ("lifted_writhe", -2.0)]
    assert task.convention.pole == (0.0, 0.0, 1.0)
    assert task.drives[0].primitive.window == pytest.approx((0.0, 0.1978), rel=1e-12)


@pytest.mark.parametrize(
    ("written", "value"),
    [("'900 ms'", 0.9), ("'1.5 s'", 1.5), ("2", 2.0), ("'2.5e3 ms'", 2.5), ("'.5s'", 0.5)],
)
def test_units_of_time(written, value):
    assert tasks.load("coil", overrides=[f"task.phases.store.duration={written}"]).task.phases[0].duration == value


def test_byte_order_mark_is_passed_over(tmp_path):
    (tmp_path / "small.toml").write_text(SMALL, encoding="utf-8-sig")
    assert tasks.load(tmp_path / "small.toml") == parse(SMALL)


def test_other_units():
    changed = parse(
        SMALL
        + "sucker_azimuth = '45 deg'\n[arm]\nlength = '30 cm'\nbase_radius = '12 mm'\nyoungs_modulus = '10 kPa'\n"
        + "[arm.transverse]\nmaximum_stress = '0.1 MPa'\n"
    )
    assert (changed.arm.length, changed.arm.base_radius, changed.arm.youngs_modulus) == (0.3, 0.012, 1e4)
    assert changed.arm.transverse.maximum_stress == 1e5
    assert changed.arm.transverse.active == Arm().transverse.active
    assert changed.task.sucker_azimuth == pi / 4


def test_lines_inside_long_texts_are_not_keys():
    text = '[task]\nname = "a"\ndescription = """\nphases = 3\n[arm]\n"""\nphases = [{ name = "a", duration = "x" }]\n' + DRIVE
    with pytest.raises(OctoctrlError, match=r"^task.toml:7 task.phases\[0\].duration: expected a number in seconds"):
        parse(text)


def test_goal_of_length_takes_a_unit_of_length():
    written = "task.phases[0].goals=[{quantity='length', value='180 mm', tolerance='4 mm'}]"
    assert parse(SMALL, overrides=[written]).task.phases[0].goals == (goal("length", value=0.18, tolerance=0.004),)


def test_goals_take_units_and_bodies():
    written = """task.phases[0].goals=[
        { quantity = "tip", value = ["70 mm", "11 cm", 0.02], tolerance = "10 mm", hold = "400 ms" },
        { quantity = "sucker_side", azimuth = "45 deg", at_least = 0.8 },
        { quantity = "twist", window = ["0 mm", "80 mm"], between = [-0.2, 0.2] },
      { quantity = "keep_out", shape = { kind = "CapsuleZone", start = [0.01, 0, 0], stop = [0, 0, 1], radius = "1 cm" }, margin = "6 mm" },
    ]"""
    assert parse(SMALL, overrides=[written]).task.phases[0].goals == (
        goal("tip", value=(0.07, 0.11, 0.02), tolerance=0.01, hold=0.4),
        goal("sucker_side", azimuth=pi / 4, at_least=0.8),
        goal("twist", window=(0.0, 0.08), between=(-0.2, 0.2)),
        goal("keep_out", shape=CapsuleZone(start=(0.01, 0.0, 0.0), stop=(0.0, 0.0, 1.0), radius=0.01), margin=0.006),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Thing:
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _Ball(_Thing):
    radius: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sheet:
    size: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Shelf:
    things: tuple[_Thing, ...] = ()
    other: _Ball | _Sheet | None = None
    either: float | _Sheet = 0.5


def test_lists_and_fields_hold_objects_of_several_classes():
    def shelf(text):
        return build(_Shelf, tomllib.loads(text), Source("shelf.toml", text))

    text = "[[things]]\nname = 'a'\n[[things]]\nkind = '_ball'\nname = 'b'\nradius = '2 cm'\n[other]\nkind = '_Sheet'\nsize = [1, 2]\n"
    found = shelf(text + "[either]\n")
    assert found == _Shelf(things=(_Thing(name="a"), _Ball(name="b", radius=0.02)), other=_Sheet(size=(1.0, 2.0)), either=_Sheet())
    assert shelf("other = { name = 'c' }\neither = 2") == _Shelf(other=_Ball(name="c"), either=2.0)
    assert shelf("other = 'none'").other is None
    for wrong, complaint in {
        "[[things]]\nkind = 'Bal'": "shelf.toml:2 things[0].kind: unknown kind 'Bal'; did you mean '_Ball'? (_Thing, _Ball)",
        "other = { kind = '_Sheet', radius = 1 }": "shelf.toml:1 other.radius: unknown key (known: size)",
        "other = 3": "shelf.toml:1 other: expected a table, found the number 3",
        "either = 'x'": "shelf.toml:1 either: expected a number, found the string 'x'",
    }.items():
        with pytest.raises(OctoctrlError) as caught:
            shelf(wrong)
        assert str(caught.value) == complaint


def test_arms_of_other_classes_are_named_by_kind():
    from octoctrl.sim.body.squid import SquidTentacle

    configuration = parse(SMALL, overrides=["arm.kind='SquidTentacle'", "arm.length='9 cm'"])
    assert configuration.arm == SquidTentacle(length=0.09)
    assert parse(toml_of(configuration)) == configuration and type(parse(toml_of(configuration)).arm) is SquidTentacle


def test_shares_of_the_arm_become_lengths_on_it():
    """Written, read back, and on two arms."""
    written = [
        "task.drives[0].settings.window=['10 %', '98.9 %']",
        "task.phases[0].goals=[{ quantity='length', value='90 %' }, { quantity='tip', value=[0, '4e1 %', '1 cm'] }, "
        "{ quantity='twist', value=0.1, window=[0, '25%'] }]",
    ]
    configuration = parse(SMALL, overrides=written)
    assert (
        parse(toml_of(configuration)) == configuration and "'10 %'" not in toml_of(configuration) and '"10.0 %"' in toml_of(configuration)
    )
    for length in (0.2, 0.3):
        task = configuration.task.on(Arm(length=length, base_radius=0.012))
        assert task.drives[0].primitive.window == pytest.approx((0.1 * length, 0.989 * length))
        stretch, tip, twist = task.phases[0].goals
        assert stretch.value == pytest.approx(0.9 * length) and tip.value == pytest.approx((0.0, 0.4 * length, 0.01))
        assert twist.window == pytest.approx((0.0, 0.25 * length))
        assert task.on(Arm()) is task
    assert str(configuration.task.phases[0].goals[2]) == "twist 0.1 ± 0.05 turns from 0 mm to 25 %"


def test_a_share_is_taken_of_lengths_on_the_arm_only():
    for setting, complaint in {
        "arm.length='40 %'": "unit '%' not known; use m, cm, mm",
        "task.drives[0].settings.rise='40 %'": "unit '%' not known; use s, ms",
        "task.phases[0].goals=[{ quantity='twist', value='40 %' }]": "expected a number, found the string '40 %'",
    }.items():
        with pytest.raises(OctoctrlError, match=complaint):
            parse(SMALL, overrides=[setting])


def test_overrides_address_elements_by_name_and_number():
    by_name = tasks.load("coil", overrides=["task.drives.curl.settings.level=0.2"])
    by_number = tasks.load("coil", overrides=["task.drives[1].settings.level=0.2"])
    assert by_name == by_number
    assert by_name.task.drives[1].primitive.level == 0.2


@given(st.text(max_size=60))
@settings(max_examples=200, deadline=None)
def test_any_text_is_read_or_refused_in_one_sentence(text):
    try:
        parse(text)
    except OctoctrlError as error:
        assert str(error) and "\n" not in str(error).strip()


@given(
    st.sampled_from(sorted(tomllib.loads(toml_of(tasks.load("coil")))["task"])),
    st.sampled_from(["1", "'x'", "[]", "{}", "true", "[1]", "[{}]"]),
)
@settings(max_examples=60, deadline=None)
def test_wrong_types_are_refused_in_one_sentence(key, value):
    try:
        tasks.load("coil", overrides=[f"task.{key}={value}"])
    except OctoctrlError as error:
        assert str(error).startswith(("--set task.", "coil.toml:")), str(error)


# ---------------------------------------------------------------- programmes

LM, OM = 0.2 / 180, 0.2 / 360
UP, DOWN, ALL_LM = ("LM1", "LM2", "LM8"), ("LM4", "LM5", "LM6"), tuple(f"LM{number}" for number in range(1, 9))


def base(groups, level, delay):
    return groups, 0, 10**6, lambda t, j: (level * min(1.0, t / delay), 0.0)


def local(groups, level, first, last, up, down, ramp):
    def law(t, j):
        if t <= up:
            return 0.0, 0.0
        if t <= down:
            return (level * (1 + np.sin(np.pi * (t - up) / ramp - np.pi / 2)) / 2 if t - up <= ramp else level), 0.0
        if t - down >= ramp:
            return 0.0, 0.0
        return level * (1 - (1 + np.sin(np.pi * (t - down) / ramp - np.pi / 2)) / 2), 0.0

    return groups, first, last, law


def wave(groups, level, end, first, last, begin, finish, tau, beta, ring=False):
    def law(t, j):
        if t <= begin - (0.0 if ring else 4 * tau / beta):
            return 0.0, WRITE_THRESHOLD
        place = j + first if ring else j
        front, back = (np.tanh(beta * ((t - start) / tau - place)) for start in (begin, finish))
        return level / 2 * (1 + front) - (level - end) / 2 * (1 + back), WRITE_THRESHOLD

    return groups, first, last, law


TONE = base((*ALL_LM, "TM"), 0.001, 0.01)
R, L, TM = ("R-OM",), ("L-OM",), ("TM",)
GRASP = [TONE, local(R, 0.2, 0, 150, 0, 8.0, 0.5), wave(DOWN, 0.3, 0.3, 0, 170, 1.0, 15, 0.02, 1)]


def coil(side):
    return [TONE, local(R, 0.3, 0, 356, 0, 3.0, 0.5), local(side, 0.3, 0, 178, 1.5, 220, 4.0), local(L, 0.3, 0, 356, 4.1, 120.5, 1.0)]


RINGS = [(0.1, 0, 150, 3.1), (0.05, 150, 171, 3.1), (0.025, 171, 180, 3.05)]
PUBLISHED = {
    "fig2c": coil(UP),
    "fig2e": coil(DOWN),
    "fig3a": [
        TONE,
        local(UP, 0.8, 0, 90, 0, 3.1, 1.0),
        wave(ALL_LM, 0.1, 0, 0, 170, 3.1, 13.32, 0.0055, 0.6),
        *(wave(TM, level, 0, first, last, begin, 15, 0.0055, 0.6, ring=True) for level, first, last, begin in RINGS),
    ],
    "fig4a": GRASP,
    "fig4e": GRASP,
    "fig4f": [
        TONE,
        local(R, 0.2, 0, 150, 0, 4.5, 0.5),
        local(L, 0.2, 0, 150, 6.1, 14.0, 0.5),
        wave(DOWN, 0.3, 0.3, 0, 170, 1.0, 15, 0.02, 1),
    ],
    "fig4g": [TONE, local(R, 0.2, 0, 150, 0, 4.5, 0.5), wave(DOWN, 0.3, 0, 0, 170, 1.0, 6.0, 0.02, 1)],
    "fig4i": [
        TONE,
        base((*R, *L), 0.001, 0.1),
        wave(UP, 0.2, 0.2, 10, 50, 0, 1.2, 0.03, 1),
        wave(UP, 1.0, 0, 0, 170, 0, 0.42, 0.006, 1),
        wave(UP, 0.3, 0.3, 115, 177, 2.6, 15, 0.02, 1),
        wave(ALL_LM, 0.25, 0, 0, 100, 4.9, 9.0, 0.01, 1),
        local(L, 0.2, 100, 359, 0.5, 4.5, 1.0),
    ],
    "si9": [TONE, *(local((f"LM{m}",), 1.0, 20 * (m - 1), 20 * (m - 1) + 40, 0.8 * (m - 1), 150, 1.0) for m in range(1, 9))],
    "si10b": [TONE, local(R, 0.2, 0, 150, 0, 8.0, 0.5), local(DOWN, 0.3, 0, 170, 1.0, 15, 2.0)],
    "si11a": GRASP,
}
INJECTED = {
    "fig3b": ([TONE, local(UP, 0.8, 0, 80, 0, 4.0, 1.0)], [TONE, wave(UP, 0.5, 0, 0, 170, 2.2, 3.0, 0.01, 1)]),
    "fig3c": (
        [TONE, local(UP, 0.8, 0, 80, 0, 3.0, 1.0), local(L, 0.3, 0, 160, 0, 5.0, 2.0)],
        [TONE, wave(UP, 0.8, 0, 0, 170, 2.2, 3.0, 0.01, 1), wave(L, 0.3, 0, 0, 341, 2.2, 3.0, 0.005, 1)],
    ),
}


def written(laws, group, time, element):
    """What the laws of a rod leave in one element when they run in their order; nothing written is zero."""
    value = 0.0
    for groups, first, last, law in laws:
        if group in groups and first <= element < last:
            level, threshold = law(time, element - first)
            value = level if level > threshold else value
    return value


def laws_at(name, time):
    return PUBLISHED[name] if name in PUBLISHED else INJECTED[name][int(time > 3.0)]


@pytest.mark.parametrize("name", [*PUBLISHED, *INJECTED])
def test_programmes_are_the_published_laws(name):
    programme = tasks.programme(name)
    activation, duration = programme.activation, programme.duration
    # Times at which no ramp of a tone is under way, and the rings of figure 3a, whose front appears at once, have formed theirs.
    times = np.array([t for t in np.linspace(0.137, duration - 1e-3, 23) if name not in INJECTED or not 2.95 < t < 3.0])
    elements = {group: np.arange(360 if group.endswith("OM") else 180) for group in activation.groups}
    for (t, time), group in itertools.product(enumerate(times), activation.groups):
        spacing = OM if group.endswith("OM") else LM
        centres = (elements[group] + 0.5) * spacing
        values = activation.compose(np, group, time, centres - 1e-3 * spacing, centres + 1e-3 * spacing)
        expected = [written(laws_at(name, time), group, time, element) for element in elements[group]]
        np.testing.assert_allclose(values, expected, atol=2e-6, err_msg=f"{group} at {times[t]} s")


RATES = {
    # Linear drag rates of rings and oblique fibres, 1/s: 250 over the figure's divisors.
    ("fig2c", "fig2e", "si9"): (12, 2),
    ("fig3a", "fig3b", "fig3c"): (48, 300),
    ("fig4a", "fig4e", "fig4f", "fig4g", "fig4i", "si10b", "si11a"): (12, 12),
}


def test_programmes_bring_the_water_of_their_figure():
    assert {name for names in RATES for name in names} == set(tasks.programmes())
    for names, (ring, oblique) in RATES.items():
        for name in names:
            water = tasks.programme(name).scene.water
            assert (water.ring_rate, water.oblique_rate) == pytest.approx((250 / ring, 250 / oblique), rel=1e-7), name
            # Figure 3a moves against 1.387 times the quadratic drag, on three of the eight longitudinal muscles.
            share = 1.387 * 3 / 8 if name == "fig3a" else 1.0
            assert (water.normal_coefficient, water.tangential_coefficient) == pytest.approx((1.013 * share, 0.0256 * share), rel=1e-5), (
                name
            )
            assert (water.density, water.factor) == (1050.0, 1.0)


def test_all_programmes_are_tested_and_stay_in_bounds():
    assert set(tasks.programmes()) == {*PUBLISHED, *INJECTED}
    for name in tasks.programmes():
        programme = tasks.programme(name)
        activation, duration = programme.activation, programme.duration
        levels = activation.levels(np.linspace(0, duration, 50), np.linspace(0, 0.2, 61))
        assert levels.shape == (50, len(MUSCLE_GROUPS), 60)


def reachable(kind, found):
    """All dataclasses of which a task file can speak, by their annotations."""
    if not isinstance(kind, type) or not is_dataclass(kind):
        for inner in get_args(kind):
            reachable(inner, found)
    elif kind not in found:
        found.add(kind)
        for other in (*get_type_hints(kind).values(), *kind.__subclasses__()):
            reachable(other, found)
    return found


def test_what_objects_weigh_and_how_they_are_held_takes_units():
    told = """[[scene.objects]]
    kind = "Sphere"
    name = "bob"
    radius = "1 cm"
    mass = "20 g"
    stiffness = "4 MPa"
    support = { kind = "Springs", stiffness = "0.1 N/mm", turning = "160 mN m" }
    pushes = [{ force = [0, 0, "10 mN"], until = "200 ms" }]
    """
    (bob,) = parse(toml_of(tasks.load("coil")) + told).scene.objects
    pushes = (Push(force=(0.0, 0.0, 0.01), until=0.2),)
    assert bob == Sphere(name="bob", radius=0.01, mass=0.02, support=Springs(stiffness=100.0, turning=0.16), pushes=pushes)


def test_units_of_fields_are_those_of_their_docstrings():
    """Those of a goal are its own."""
    others = {"tolerance", "value", "smoothness_weight"}
    found = reachable(Configuration, set())
    for kind in (*goal_kinds().values(), *primitive_kinds().values()):
        reachable(kind, found)
    seen, missed = set(), set()
    for kind in (kind for kind in found if kind.__module__.startswith("octoctrl")):
        for names, said in re.findall(r"^ *(\w+(?:, \w+)*) : ([^\n]*)$", kind.__doc__ or "", re.M):
            unit = next((word for word in reversed(said.split(", ")) if word in UNITS), None)
            for name in (set(names.split(", ")) & {item.name for item in fields(kind)}) - others if unit else ():
                seen.add(name)
                missed |= {f"{kind.__name__}.{name} {unit}"} if unit_of(kind, name) != unit else set()
    assert SquidTentacle in found and {"apex", "delay", "length", "speed", "azimuth", "sarcomere"} <= seen and not missed


@pytest.mark.parametrize("path", sorted(ROOT.glob("examples/*.toml")), ids=lambda path: path.stem)
def test_examples_are_the_same_after_they_were_written_out(path):
    read = tasks.load(path)
    assert parse(toml_of(read), folder=path.parent) == read


def test_the_kind_of_an_object_is_a_word():
    for odd in ("[]", "{}", "[1]"):
        with pytest.raises(OctoctrlError, match="unknown kind"):
            tasks.load("grasp", overrides=[f"scene.objects[0].kind={odd}"])


def test_numbers_beside_a_share_of_the_arm_are_checked_where_they_stand():
    with pytest.raises(OctoctrlError, match=r"--set task.drives\[0\].settings.rise: rise=0 s is outside > 0 s"):
        tasks.load("coil", overrides=["task.drives.twist.settings.window=['0 %', '90 %']", "task.drives.twist.settings.rise=0"])
