"""Benchmarks: tables, files, closed forms, and that failures stay in the table."""

import json
from dataclasses import replace

import numpy as np
import pytest

from octoctrl.bench import benchmark as benchmarking
from octoctrl.bench import precision as benchmark_precision
from octoctrl.bench.benchmark import PARTS, timed_motion
from octoctrl.bench.closed_forms import CASES, circle
from octoctrl.bench.speed import arm_step, elastic_rod
from octoctrl.bench.startup import child
from octoctrl.cli.application import main
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import Plant
from octoctrl.sim.templates import Plateau
from octoctrl.tables import Table, fastest

BEND = Activation(templates=(Plateau(groups=("LM1",), level=0.1, rise=0.1),))


def small(**changes):
    fields = {
        "columns": ("case", "error, %", "ms"),
        "formats": ("", ".2f", ".1f"),
        "rows": (("a", 1.0, 2.0), ("a", 0.5, None), ("b", 0.1, 9.0)),
    }
    return Table(name="rod", title="Title", note="Note.", **(fields | {"curve": ("error, %", "ms", "case")} | changes))


def test_a_table_is_text_markdown_and_data():
    table = small()
    assert str(table).splitlines()[0] == "Title" and "0.50" in str(table)
    assert "| a | 0.50 |  |" in table.markdown()
    assert table.content()["rows"][1] == {"case": "a", "error, %": 0.5, "ms": None}


def test_bench_writes_json_page_and_picture(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(benchmarking, "run", lambda parts, **settings: [small()])
    files = [tmp_path / "out.json", tmp_path / "page.md", tmp_path / "plot.png"]
    arguments = ["bench", "rod", "-q", "--json", str(files[0]), "--page", str(files[1]), "--plot", str(files[2])]
    assert main(arguments) == 0
    assert "Title" in capsys.readouterr().out
    content = json.loads(files[0].read_text())
    assert content["tables"]["rod"]["rows"][0]["ms"] == 2.0 and content["machine"]["cores"].isdigit()
    assert "host" not in content["machine"] and "octoctrl bench rod" in files[1].read_text()
    assert files[2].stat().st_size > 1000
    assert main(arguments) == 2 and "use -f to replace" in capsys.readouterr().err


def test_an_unknown_part_is_refused(capsys):
    assert main(["bench", "rods", "-q"]) == 2
    assert "did you mean 'rod'?" in capsys.readouterr().err


def test_a_plot_needs_a_curve(tmp_path):
    with pytest.raises(OctoctrlError, match="nothing to plot"):
        benchmarking.draw([small(curve=None)], tmp_path / "plot.png")


def test_every_part_exists():
    from importlib import import_module

    for module, function in PARTS.values():
        assert callable(getattr(import_module(module), function))


def test_failures_stay_in_the_table():
    reference = Plant(Arm.octopus(elements=24), record_every=4).advance(BEND, 0.5)

    def forced():
        plant = Plant(record_every=4)
        plant.set_steps(2)
        return plant

    choices = {"well": Plant, "refused": lambda: Plant(dt=1e-3), "stopped": forced}
    ends = {}
    for label, make in choices.items():
        made = (lambda: Plant(record_every=4)) if label == "well" else make
        row = benchmark_precision._row("case", label, made, BEND, 0.5, reference, 1)
        assert len(row) == len(benchmark_precision.COLUMNS) == len(benchmark_precision.COLUMN_FORMATS)
        ends[label] = row[3]
    assert ends["well"] == "well"
    assert ends["refused"].startswith("refused: dt=0.001 s exceeds the stability bound")
    assert ends["stopped"].startswith("stopped at")


def test_errors_vanish_against_oneself_and_fall_with_the_elements():
    runs = [Plant(Arm.octopus(elements=n), dt=2e-4, record_every=4).advance(BEND, 1.0) for n in (16, 32, 96)]
    assert max(filter(None, benchmark_precision.errors(runs[2], runs[2], Arm.octopus())), default=0.0) < 1e-12
    coarse, finer = (benchmark_precision.errors(run, runs[2], Arm.octopus()) for run in runs[:2])
    assert all(one > two > 0 for one, two in zip(coarse[:3], finer[:3], strict=True))


def test_link_and_writhe_count_only_out_of_the_plane():
    flat = np.zeros((2, 5, 3))
    flat[:, :, 0] = np.arange(5)
    flat[1, :, 1] = np.arange(5) ** 2
    spatial = flat.copy()
    spatial[1, :, 2] = 0.1 * np.arange(5) ** 3
    assert benchmark_precision.apart([0.0, 2.01], [0.0, 0.0], flat) is None
    assert benchmark_precision.apart([0.0, 2.01], [0.0, 0.0], None) == pytest.approx(2.01)
    assert benchmark_precision.apart([0.0, 2.01], [0.0, 0.0], spatial) == pytest.approx(2.01)


def test_pieces_of_a_timed_motion_are_the_motion():
    recording, spent, wall = timed_motion(Plant(), BEND, 1.0, 2, piece=0.25)
    whole = Plant().advance(BEND, 1.0)
    assert np.array_equal(recording.points, whole.points) and np.array_equal(recording.time, whole.time)
    assert 0 < spent < 10 and wall > 0


def test_fastest_is_the_fastest():
    waits = iter([0.02, 0.001, 0.02])

    def work():
        import time

        time.sleep(next(waits))

    assert fastest(work, 3)[1] < 0.02


@pytest.mark.parametrize("case", CASES)
def test_elastic_rod_meets_the_closed_form_with_second_order(case):
    errors = []
    for elements in (10, 20):
        sim, error, duration = CASES[case](elements, 0.25)
        sim.advance(duration)
        errors.append(float(error()))
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] > 3.5


def test_circle_is_a_circle():
    sim, error, duration = circle(40, 1.0)
    sim.advance(duration)
    assert np.linalg.norm(sim.velocities) < 1e-6 and error() < 1e-4


def test_speeds_are_positive_and_more_groups_take_longer():
    assert 0 < elastic_rod(50) < 1e-6
    assert arm_step(48, (), 3)[0] < arm_step(48, ("LM1", "LM2", "LM3", "LM4", "R-OM", "L-OM", "TM"), 3)[0]


def test_a_child_process_reports_time_and_memory():
    wall, spent, memory = child("x = bytearray(50_000_000)")
    assert wall > 0 and spent > 0 and 50 < memory < 500
    with pytest.raises(OctoctrlError, match="start-up failed: ZeroDivisionError"):
        child("1 / 0")


@pytest.mark.parametrize("part", [benchmark_precision.rod_precision, benchmark_precision.reduced_precision])
def test_parts_run_and_errors_fall_with_the_step(monkeypatch, part):
    monkeypatch.setattr(benchmark_precision, "programmes", lambda full: {"bend": (BEND, 0.4)})
    table = part()
    tip = table.columns.index("tip max, %L")
    found = [row[tip] for row in table.rows if row[tip] is not None]
    assert len(found) >= 4 and all(error >= 0 for error in found) and str(table).count("bend") == len(table.rows)
    if part is benchmark_precision.reduced_precision:
        assert found == sorted(found, reverse=True) and found[0] > 4 * found[-1]


def test_leaving_out_changes_no_bit_and_saves_time():
    plants = [Plant(complete=complete) for complete in (False, True)]
    runs = [plant.advance(BEND, 0.3) for plant in plants]
    assert np.array_equal(runs[0].points, runs[1].points) and np.array_equal(plants[0].state()["state"], plants[1].state()["state"])
    spent = [min(fastest(lambda plant=plant: plant.advance(Activation(), 0.2), 5)[0] for _ in range(3)) for plant in plants]
    assert spent[0] < spent[1]


def test_displacing_moves_the_free_nodes_only():
    plant = Plant(Arm.octopus(elements=16))
    before = plant.observe()
    plant.core.displace(np.full((17, 3), 1e-3), np.full((17, 3), 0.5))
    after = plant.observe()
    np.testing.assert_allclose(after.points - before.points, np.r_[np.zeros((1, 3)), np.full((16, 3), 1e-3)], atol=1e-15)
    np.testing.assert_array_equal(after.velocities, np.r_[np.zeros((1, 3)), np.full((16, 3), 0.5)])
    assert plant.core.energy()["kinetic"] == pytest.approx(0.5 * plant.core.node_mass[1:].sum() * 0.75)


def test_new_kinds_ask_for_what_the_model_has_been_seen_to_do():
    """But for places that no arm can reach, which are refused."""
    from octoctrl.bench.goals import NEW_KINDS
    from octoctrl.planners.fitting.identified import load_identified
    from octoctrl.planners.solving import planner
    from octoctrl.planners.solving.plan import PlanStatus

    identified, draw = load_identified(Arm.octopus()), np.random.default_rng(5)
    length = identified.model.arm.length
    for kind in NEW_KINDS:
        task = kind(draw, identified.model)
        goals = task.phases[0].goals
        beyond = any(goal.quantity == "tip" and np.linalg.norm(goal.value) > length for goal in goals)
        found = planner.plan(task, identified, time_limit=600.0)
        assert found.status is PlanStatus.UNREACHABLE if beyond else found.status.solved, (kind.__name__, found.report.reason)


def test_a_refusal_is_wrong_if_another_search_meets_the_goals(monkeypatch):
    from octoctrl.bench import planning
    from octoctrl.bench.goals import twist_only
    from octoctrl.planners.asking.registry import goal
    from octoctrl.planners.fitting.identified import load_identified
    from octoctrl.planners.solving import planner
    from octoctrl.planners.solving.search import Search

    identified = load_identified(Arm.octopus())
    task = twist_only(np.random.default_rng(2), identified.model)
    made = planner.plan(task, identified, time_limit=600.0)
    assert made.status.solved and not planning.withstands(made)
    beyond = replace(task.phases[0], goals=(goal("twist", value=3.0),))
    monkeypatch.setattr(Search, "programmes", lambda _search: [])
    assert planning.withstands(replace(made, task=replace(task, phases=(beyond, task.phases[1]))))


def test_random_goals_are_those_of_their_seed():
    from octoctrl.bench.goals import OLD_KINDS
    from octoctrl.bench.mending import KINDS
    from octoctrl.planners.fitting.identified import load_identified

    model = load_identified(Arm.octopus()).model
    for kind in (*OLD_KINDS, *(what.kind for what in KINDS)):
        one, same, other = (kind(np.random.default_rng(seed), model) for seed in (3, 3, 4))
        assert one == same != other


def test_parts_on_random_goals_go_together_and_take_their_size(monkeypatch):
    asked = []

    def part(**settings):
        asked.append(settings)
        return small()

    for name in (*benchmarking.DRAWN, *benchmarking.MOVED):
        monkeypatch.setitem(PARTS, name, (__name__, "_part"))
    monkeypatch.setitem(globals(), "_part", part)
    benchmarking.run(["tasks"], count=3, seed=5, plants=["rod"])
    drawn, moved = len(benchmarking.DRAWN), len(benchmarking.MOVED)
    assert asked == [{"full": False, "count": 3, "seed": 5}] * drawn + [{"full": False, "plants": ("rod",)}] * moved
    with pytest.raises(OctoctrlError, match="count"):
        benchmarking.run(["plans"], count=0)


def test_tracking_tells_how_far_the_plant_is_from_the_plan():
    from octoctrl.bench.tracking import tracking
    from octoctrl.carrying.execution import execute
    from octoctrl.carrying.planning import plan

    table = tracking(plants=["rod"], names=["twist"])
    rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    assert [row["feedback"] for row in rows] == ["open-loop", "tvlqr", "mpc"] and {row["plan"] for row in rows} == {"solved"}
    run = execute(plan("twist"), feedback="open-loop")
    error = np.sqrt(np.mean((run.trace.twist - run.planned.twist) ** 2))
    assert rows[0]["twist rms"] == pytest.approx(error) and 0 < error < 0.05 and rows[0]["within"] == "yes"


def test_what_feedback_mends_is_told_on_rods_as_planned_and_on_others(monkeypatch):
    """In the unit of the goal, and as a share of what open loop misses of the same goals."""
    from octoctrl.bench import mending

    monkeypatch.setattr(mending, "RODS", 1)
    monkeypatch.setattr(mending, "KINDS", mending.KINDS[1:2])
    table = mending.mending(count=1, seed=5)
    rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    labels = [(rod, feedback) for rod in ("as planned", "not as planned") for feedback in mending.CONTROLLERS]
    assert [(row["rod"], row["feedback"]) for row in rows] == labels
    for three in (rows[:3], rows[3:]):
        assert [row["of open loop"] for row in three] == pytest.approx([row["rms"] / three[0]["rms"] for row in three])
    assert all(row["rms"] == row["largest"] and row["within"] == (row["rms"] <= 0.1) for row in rows)


def test_what_a_correction_costs_is_timed_without_changing_it():
    from octoctrl.bench.correcting import Timed, correcting
    from octoctrl.carrying.execution import controller, execute
    from octoctrl.carrying.planning import plan

    table = correcting(names=["twist"])
    rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    assert [row["feedback"] for row in rows] == ["tvlqr", "mpc"] and rows[0]["fallbacks"] is None
    made = plan("twist")
    timed = Timed(controller("tvlqr", made))
    run, usual = execute(made, feedback=timed), execute(made, feedback="tvlqr")
    np.testing.assert_array_equal(run.recording.points, usual.recording.points)
    assert len(timed.seconds) == rows[0]["periods"] + 1
    for row in rows:
        assert 0 < row["median [ms]"] <= row["P90 [ms]"] <= row["max [ms]"]
