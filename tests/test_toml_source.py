"""Where keys of a TOML file stand, and assignments from the command line."""

import copy
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoctrl.files.toml_source import Source, assign, dotted, found
from octoctrl.sim.errors import OctoctrlError

TEXT = '''# a comment
top = 1
"quoted key" = 2
text = """
inner = 3
[not.a.header]
"""
after = 4

[task]
name = "reach"
deep.er = 5

[[task.phases]]
name = "store"
goals = [
    { quantity = "twist" },
    # between

    { quantity = "length" },
]
last = 1

[[task.phases]]
name = "open"
list = [1, 2]
goals = [  # with a comment
    { quantity = "twist" },
]

[task.phases.inner]
x = 1

["arm"]
length = 0.2
length2 = 0.2
'a.b' . "c d" = 1
["x y".z]
k = 1
'''
LINES = {
    ("top",): 2,
    ("quoted key",): 3,
    ("text",): 4,
    ("after",): 8,
    ("task",): 10,
    ("task", "name"): 11,
    ("task", "deep", "er"): 12,
    ("task", "phases"): 14,
    ("task", "phases", 0): 14,
    ("task", "phases", 0, "name"): 15,
    ("task", "phases", 0, "goals"): 16,
    ("task", "phases", 0, "goals", 0): 17,
    ("task", "phases", 0, "goals", 1): 20,
    ("task", "phases", 0, "last"): 22,
    ("task", "phases", 1): 24,
    ("task", "phases", 1, "name"): 25,
    ("task", "phases", 1, "list"): 26,
    ("task", "phases", 1, "goals", 0): 28,
    ("task", "phases", 1, "inner"): 31,
    ("task", "phases", 1, "inner", "x"): 32,
    ("arm",): 34,
    ("arm", "length"): 35,
    ("arm", "length2"): 36,
    ("arm", "a.b", "c d"): 37,
    ("x y", "z", "k"): 39,
}


@pytest.mark.parametrize("path", LINES)
def test_a_value_is_found_where_it_was_written(path):
    assert Source("a.toml", TEXT).where(path) == f"a.toml:{LINES[path]} {dotted(path)}"


def test_the_nearest_place_above_is_named_for_what_has_no_line():
    source = Source("a.toml", TEXT)
    assert source.where(()) == "a.toml"
    assert source.where(("task", "phases", 0, "goals", 1, "quantity")) == "a.toml:20 task.phases[0].goals[1].quantity"
    assert source.where(("task", "missing")) == "a.toml:10 task.missing"
    assert source.where(("nowhere", "at all")) == "a.toml nowhere.at all"
    assert source.where(("inner",)) == "a.toml inner"  # it stands in a text


def test_what_was_set_on_the_command_line_is_named_as_such():
    source = Source("a.toml", TEXT)
    source.overridden.append(("task", "phases", 1))
    assert source.where(("task", "phases", 1, "name")) == "--set task.phases[1].name"
    assert source.where(("task", "phases", 0, "name")) == "a.toml:15 task.phases[0].name"
    assert source.where(("task",)) == "a.toml:10 task"


def test_a_complaint_about_a_table_is_put_to_the_key_that_it_names():
    source = Source("a.toml", TEXT)
    assert source.culprit(("arm",), "length=20 m is outside 0.001…5 m") == ("arm", "length")
    assert source.culprit(("arm",), "radius of length2 is odd, length too") == ("arm", "length2")
    assert source.culprit(("arm",), "something else") == ("arm",)
    source.overridden += [("task", "name"), ("arm", "taper"), ("arm", "length")]
    assert source.culprit(("arm",), "something else") == ("arm", "taper")
    assert source.culprit(("arm",), "length is odd") == ("arm", "length")


def test_paths_are_written_with_dots_and_brackets():
    assert dotted(("a", "b", 0, "c")) == "a.b[0].c"
    assert dotted((0, "a")) == "[0].a"
    assert dotted(()) == ""


DATA = {"a": {"b": [{"name": "one", "x": 1}, {"name": "two"}, 5]}, "n": 3, "bare": [{}, {}], "mixed": [5, {"name": "one"}]}


@pytest.mark.parametrize(
    ("assignment", "path", "value"),
    [
        ("a.c=1.5", ("a", "c"), 1.5),
        (" a.c = [1, 2] ", ("a", "c"), [1, 2]),
        ("a.c=plain words", ("a", "c"), "plain words"),
        ("a.c=12 mm", ("a", "c"), "12 mm"),
        ("a.c=x=y", ("a", "c"), "x=y"),
        ("a.c=", ("a", "c"), ""),
        ("new.deep.key=true", ("new", "deep", "key"), True),
        ("a.b.two.x='text'", ("a", "b", 1, "x"), "text"),
        ("a.b[0].x=2", ("a", "b", 0, "x"), 2),
        ("a.b[2]=7", ("a", "b", 2), 7),
        ("mixed.one.x=1", ("mixed", 1, "x"), 1),
        ("bare[1].x=1", ("bare", 1, "x"), 1),
    ],
)
def test_assignments(assignment, path, value):
    data = copy.deepcopy(DATA)
    assert assign(data, assignment) == path
    for step in path[:-1]:
        data = data[step]
    assert data[path[-1]] == value and type(data[path[-1]]) is type(value)


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("a.c", "--set a.c: expected key=value, for example --set task.phases.store.duration=1.2"),
        (" =1", "--set  =1: expected key=value, for example --set task.phases.store.duration=1.2"),
        (".=1", "--set .=1: expected key=value, for example --set task.phases.store.duration=1.2"),
        ("n.x=1", "--set n: is the number 3, not a table"),
        ("a.b.ones.x=1", "--set a.b: no element 'ones'; did you mean 'one'? (one, two)"),
        ("a.b[3].x=1", "--set a.b: no element '3' (one, two)"),
        ("bare.x.y=1", "--set bare: no element 'x' (0 to 1)"),
        ("bare[2].y=1", "--set bare: no element '2' (0 to 1)"),
        ("a.b[2].y=1", "--set a.b[2]: is the number 5, not a table"),
    ],
)
def test_assignments_that_cannot_be_are_refused(assignment, message):
    data = copy.deepcopy(DATA)
    with pytest.raises(OctoctrlError) as caught:
        assign(data, assignment)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("5 mm", "the string '5 mm'"),
        (True, "true"),
        (False, "false"),
        (3, "the number 3"),
        (0.25, "the number 0.25"),
        (1e301, "the number 1e+301"),
        (10**299, "the number 1e+299"),
        (10**301, "a number beyond 1e300"),
        ({}, "a table"),
        ([], "a list"),
        (None, "NoneType None"),
    ],
)
def test_what_was_found_is_said(value, words):
    assert found(value) == words


KEYS = st.text("abcxyz_", min_size=1, max_size=4)


@given(st.dictionaries(KEYS, st.dictionaries(KEYS, st.integers(0, 99), min_size=1, max_size=4), max_size=4))
def test_every_key_of_a_plain_file_has_its_line(tables):
    lines = [f"[{table}]\n" + "".join(f"{key} = {value}\n" for key, value in values.items()) for table, values in tables.items()]
    text = "\n".join(lines)
    assert tomllib.loads(text) == tables
    source = Source("t.toml", text)
    for table, values in tables.items():
        for key, value in values.items():
            line = int(source.where((table, key)).partition(":")[2].split()[0])
            assert text.splitlines()[line - 1] == f"{key} = {value}"
