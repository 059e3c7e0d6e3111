"""Every example runs with --quick, saves its figure, and prints what it promises."""

import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"
NUMBER = r"[+-]?\d+\.\d+"


@pytest.fixture
def printed(tmp_path, monkeypatch, capsys):
    """Run an example in a folder of its own, take back what it registers, and return what it prints."""
    from matplotlib import pyplot

    from octoctrl.files import store
    from octoctrl.planners.asking import registry

    pyplot.switch_backend("Agg")
    monkeypatch.chdir(tmp_path)
    primitives, registered = dict(registry._PRIMITIVES), dict(store._REGISTERED)

    def run(name):
        monkeypatch.setattr(sys, "argv", [name, "--quick"])
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
        picture = tmp_path / f"{name}.png"
        assert [path.name for path in tmp_path.iterdir()] == [picture.name] and picture.stat().st_size > 5000
        return capsys.readouterr().out

    yield run
    for kept, before in ((registry._PRIMITIVES, primitives), (store._REGISTERED, registered)):
        for added in set(kept) - set(before):
            del kept[added]
    pyplot.close("all")


def rows(text, columns):
    """Numbers of the lines that end in `columns` numbers."""
    found = [re.findall(NUMBER, line) for line in text.splitlines()]
    return [[float(word) for word in words] for words in found if len(words) == columns]


def test_there_are_no_other_examples_and_none_is_long():
    names = sorted(path.stem for path in EXAMPLES.glob("*.py"))
    tested = set(re.findall(r'printed\("(\w+)"\)', Path(__file__).read_text()))
    assert set(names) == tested
    assert all(len((EXAMPLES / f"{name}.py").read_text().splitlines()) <= 60 for name in names)


def test_coil_passes_its_verdict(printed):
    text = printed("01_coil")
    assert "Solved:" in text and re.search(r"VERDICT pass \((\d+)/\1\)", text)


def test_composed_primitives_twist_writhe_and_shorten_the_arm(printed):
    table = rows(printed("02_compose_primitives"), 4)
    assert [row[0] for row in table] == [0.5, 1.0, 1.5, 2.0, 2.5]
    first, last = table[0], table[-1]
    assert first[1] > 0.5 and abs(first[2]) < 0.05, "L-OM stores positive twist before the arm bends"
    assert max(abs(row[2]) for row in table) > 0.2 and last[3] < 0.9 * first[3]


def test_feedback_halves_the_error_of_a_wrong_model(printed):
    text = printed("03_open_and_closed_loop")
    opened, closed = rows(text, 2)
    assert closed[0] < 0.5 * opened[0] and closed[1] < 0.5 * opened[1]


def test_own_primitive_is_planned_and_meets_its_goals(printed):
    text = printed("04_own_primitive")
    assert "Solved:" in text and re.search(r"screw\s+Corkscrew", text)
    assert re.search(r"wind\.twist .* pass", text) and re.search(r"wind\.lifted_writhe .* pass", text)


def test_own_controller_reaches_the_lengths(printed):
    table = rows(printed("05_own_controller"), 3)
    assert [row[0] for row in table] == [180.0, 210.0, 200.0]
    assert all(abs(row[2]) < 2.0 and row[2] == pytest.approx(row[1] - row[0], abs=0.11) for row in table)


def test_wrapped_feedback_sees_late_and_twists_all_the_same(printed):
    ((twist, error, moved),) = rows(printed("10_wrapped_feedback"), 3)
    assert twist == pytest.approx(-0.5, abs=0.1) and 0 < error < 0.05 and moved > 0.5


def test_batch_bends_every_arm_further_at_a_higher_level(printed):
    text = printed("07_batch")
    angles = np.array(rows(text, 4))[:, 1:]
    assert angles.shape == (2, 3) and np.all(np.diff(angles, axis=1) > 0) and "6 arms, 12 s of arm motion" in text


def test_linear_model_lies_between_the_plants_two_directions(printed):
    text = printed("06_reduced_model_to_control")
    gain = float(re.search(rf"dc gain ({NUMBER})", text)[1])
    table = {row[0]: row[1:] for row in rows(text, 4)}
    linear, up, down = table[0.4]
    assert up < linear < down < 0 and gain < linear
    assert table[1.0][1] == pytest.approx(gain, rel=0.15), "the plant settles at the linear model's gain"


def test_stepping_by_hand_shows_tip_strains_and_topology(printed):
    text = printed("08_step_by_hand")
    table = np.array(rows(text, 8))
    assert table[:, 0] == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.9])
    assert table[:, 5] == pytest.approx(table[:, 6] + table[:, 7], abs=2e-3) and table[-1, 7] < -0.5
    assert np.ptp(table[:, 3]) > 1.0 and re.search(r"\d+ x real time", text)


def test_a_twisted_rod_leaves_its_axis_beyond_the_critical_twist_only(printed):
    text = printed("09_twisted_rod")
    (*_, below), (*_, beyond) = rows(text, 3)
    assert below < 0.1 and beyond > 100
    assert re.search(r"pulled straight by 5 N: \d+\.\d+ mm; and back at 30 s", text)


def test_the_family_of_helices_keeps_its_link(printed):
    table = np.array(rows(printed("11_helix_family"), 6))
    assert len(table) == 7 and table[:, 1] == pytest.approx(2.0, abs=2e-3)
    assert table[:, 2:4] == pytest.approx(table[:, 4:6], abs=3e-3), "closed forms"


def test_a_filmed_arm_shows_twist_only_with_markers_and_hangs_under_a_pole_of_its_own(printed):
    without, with_markers = printed("12_measured_arm").split("'with-markers'")
    last = [float(re.search(rf" twist +{NUMBER} +({NUMBER})", text)[1]) for text in (without, with_markers)]
    assert last[0] == pytest.approx(0.0, abs=1e-3) and last[1] == pytest.approx(-1.68, abs=0.1)
    assert "No markers" in without and "No markers" not in with_markers
    assert all("is taken instead" in text and re.search(r"noise: 0\.[23]\d* mm", text) for text in (without, with_markers))
