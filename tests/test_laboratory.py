"""The stability laboratory: trials can be repeated, checks can fail, studies go on where they stopped, what it found stays mended."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octoctrl.cli.application import main
from octoctrl.laboratory import checks as laboratory_checks
from octoctrl.laboratory import endings as laboratory_endings
from octoctrl.laboratory import page as laboratory_page
from octoctrl.laboratory import studies as laboratory
from octoctrl.laboratory.endings import Ending, Outcome, perform
from octoctrl.laboratory.endurance import long_run
from octoctrl.laboratory.trials import ASSEMBLY_KINDS, KINDS, draw
from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import Plant
from octoctrl.sim.rod.layout import Row
from octoctrl.sim.templates import Plateau
from octoctrl.sim.topology.measures import measure

PULL = Activation(templates=(Plateau(groups=("LM1", "R-OM"), level=0.3, rise=0.1),))


@pytest.fixture(scope="module")
def moved():
    plant = Plant(Arm.octopus(elements=24))
    return plant, plant.advance(PULL, 0.5)


# Trials


def test_trials_of_the_full_arm_are_of_any_of_its_plants():
    one, other = draw("full arm, all groups", 0, 3), draw("full arm, all groups", 0, 3, "assembly-coarse")
    assert (one.plant, other.plant, draw("gentle", 0, 3, "assembly-coarse").plant) == ("assembly", "assembly-coarse", "rod")
    assert replace(other, plant="assembly") == one
    short = replace(other, duration=0.02)
    outcome = perform(short)
    assert outcome.ending is Ending.FINISHED and outcome.volume is not None and outcome.simulated == pytest.approx(0.02)


@settings(max_examples=60, deadline=None)
@given(kind=st.sampled_from([*KINDS, *ASSEMBLY_KINDS]), number=st.integers(0, 10**6), seed=st.integers(0, 99))
def test_a_trial_is_drawn_alike_again_and_differs_from_the_next(kind, number, seed):
    # Compared as texts: an absurd value may be no number, which equals nothing.
    assert str(draw(kind, seed, number)) == str(draw(kind, seed, number))
    if kind != "full arm, full step":
        assert str(replace(draw(kind, seed, number), number=0)) != str(replace(draw(kind, seed, number + 1), number=0))


@settings(max_examples=12, deadline=None)
@given(kind=st.sampled_from([name for name in KINDS if name not in ("tiny tip", "settling")]), number=st.integers(0, 10**6))
def test_no_trial_fails_undetected(kind, number):
    outcome = perform(draw(kind, 1, number))
    assert not outcome.undetected, outcome
    assert (outcome.stop is not None) == (outcome.ending in (Ending.LIMIT, Ending.UNSTABLE))
    assert bool(outcome.reason) == (outcome.ending not in (Ending.ACCURATE, Ending.FINISHED))
    if outcome.stop:
        assert set(outcome.stop) == {"time", "rod", "element", "mechanism"} and 0 < outcome.stop["time"] <= 1.0


@pytest.mark.parametrize(
    ("kind", "number"),
    [("gentle", 66), ("gentle", 247), ("stretched", 13), ("waves", 21), ("all groups", 163)],
    ids=["flutter of a slender tip", "another", "trembling after release", "fast spin", "faster spin"],
)
def test_what_was_found_stays_mended(kind, number):
    outcome = perform(draw(kind, 0, number))
    assert outcome.ending not in (Ending.UNDETECTED, Ending.UNSTABLE), outcome


def test_huge_steps_are_refused_beforehand_with_the_limit():
    for number in range(4):
        outcome = perform(draw("huge step", 0, number))
        assert outcome.ending is Ending.REFUSED and "exceeds the" in outcome.reason and not outcome.automatic


def test_tips_of_a_fifth_of_a_millimetre_are_what_they_say():
    for number in range(6):
        assert np.diff(Arm(**draw("tiny tip", 0, number).arm).edges)[-1] == pytest.approx(2e-4, rel=0.06)


# Checks: each passes on a sensible run and fails on a doctored one


def test_sensible_motion_passes_all_checks(moved):
    plant, recording = moved
    for check in (laboratory_checks.finite, laboratory_checks.orthonormal, laboratory_checks.held, laboratory_checks.linked):
        assert check(recording) is None
    assert laboratory_checks.powered(recording, plant.arm, plant.core.node_mass) is None


def test_checks_find_what_is_wrong(moved, monkeypatch):
    plant, recording = moved
    long = Plant(Arm.octopus(elements=24)).advance(PULL, 4.0)

    def doctored(name, change):
        value = getattr(recording, name).copy()
        change(value)
        return replace(recording, **{name: value})

    def spoil(value):
        value[3, 2] = np.nan

    def tilt(value):
        value[7, 5, 0] += 1e-8

    def shift(value):
        value[9] += 1e-6

    def tear(value):
        value[9:, -1] *= 1.5

    assert "points holds" in laboratory_checks.finite(doctored("points", spoil))
    assert "orthonormal only to" in laboratory_checks.orthonormal(doctored("frames", tilt))
    kept = {"volume": np.full(len(recording.time), 0.99), "slab_volume": np.full((len(recording.time), 3), 0.96)}
    assert laboratory_checks.voluminous(replace(recording, series=kept)) is None and laboratory_checks.voluminous(recording) is None
    for name, said in (("volume", "of the arm changes by 6.0%"), ("slab_volume", "of a slab changes by 6.0%")):
        lost = kept | {name: np.where(np.arange(len(recording.time)) == 1, 0.94, kept[name].T).T}
        assert said in laboratory_checks.voluminous(replace(recording, series=lost))
    assert "base has moved" in laboratory_checks.held(doctored("points", shift))
    assert "kinetic energy" in laboratory_checks.powered(doctored("points", tear), plant.arm, 1e3 * plant.core.node_mass)
    assert "does not slow down" in laboratory_checks.settled(replace(long, points=np.sin(30 * long.time)[:, None, None] * long.points))
    assert laboratory_checks.settled(long) is None
    trace = measure(recording.time, recording.points, recording.frames)
    for lost, complains in ((0.4, True), (1.0, False), (0.1, False)):
        monkeypatch.setattr(laboratory_checks, "measure", lambda *_, lost=lost: replace(trace, residual=trace.residual + lost))
        assert (laboratory_checks.linked(recording) is not None) == complains
    assert laboratory_checks.growth(np.array([2.0, 1.0, 0.5, 0.7, 0.1])) == pytest.approx(0.1)


def test_passive_energy_is_the_work_of_stretching():
    """Pulled along by hand, the arm stores the integral of its force; the section's law has no exact potential, the fibres have."""
    plant = Plant(Arm.octopus(elements=16))
    rest = laboratory_checks.passive_energy(plant)
    assert rest == pytest.approx(0.0, abs=1e-15)
    energies, forces, stretches = [], [], np.linspace(1.0, 1.2, 81)
    for stretch in stretches:
        plant.reset()
        plant.core.rows[Row.X2, 1 : plant.elements + 2] = plant.edges * stretch
        energies.append(laboratory_checks.passive_energy(plant))
        plant.core._move(np.zeros((2, len(MUSCLE_GROUPS), plant.elements)), None, 1)
        forces.append(plant.core.rows[Row.TENSION, 1 : plant.elements + 1] @ np.diff(plant.edges))
    work = np.sum((np.array(forces[1:]) + forces[:-1]) / 2 * np.diff(stretches))
    assert energies[-1] == pytest.approx(work, rel=2e-3)


# Endings


def test_motion_that_depends_on_the_step_is_not_called_accurate(monkeypatch):
    run = laboratory_endings._Run
    trial = replace(draw("gentle", 0, 0), arm={"elements": 24}, activation=PULL)
    assert perform(trial).ending is Ending.ACCURATE
    monkeypatch.setattr(run, "_apart", lambda self, recording, plant: 0.5 if plant.h < self.plant.h else 1e-6)
    assert perform(trial).ending is Ending.INACCURATE
    monkeypatch.setattr(run, "_apart", lambda self, recording, plant: 0.5)
    assert perform(trial).ending is Ending.SENSITIVE


@pytest.mark.parametrize(("kind", "broken"), [("restart", "_restarted"), ("threads", "_threaded")])
def test_other_bits_are_an_undetected_failure(monkeypatch, kind, broken):
    trial = replace(draw(kind, 0, 0), arm={"elements": 16}, activation=PULL, number=1)
    assert perform(trial).ending is Ending.FINISHED
    monkeypatch.setattr(laboratory_endings._Run, broken, lambda *_: False)
    outcome = perform(trial)
    assert outcome.undetected and "the same bits" in outcome.reason


def test_an_accepted_huge_step_and_a_crash_are_undetected_failures(monkeypatch):
    assert perform(replace(draw("huge step", 0, 0), arm={"elements": 16}, step=0.5)).undetected
    monkeypatch.setattr(laboratory_endings._Run, "judged", lambda self: 1 / 0)
    assert "ZeroDivisionError" in perform(draw("gentle", 0, 0)).reason


# Studies


def test_a_study_goes_on_where_it_was_cut_off(tmp_path):
    whole, part = tmp_path / "whole.jsonl", tmp_path / "part.jsonl"
    outcomes = laboratory.study(whole, 14, threads=2)
    assert {outcome.kind for outcome in outcomes} == set(KINDS)
    lines = whole.read_text().splitlines()
    part.write_text("\n".join(lines[:6]) + "\n" + lines[6][:30])  # killed while it wrote
    again = laboratory.study(part, 14, threads=1)
    assert [replace(item, spent=0.0) for item in again] == [replace(item, spent=0.0) for item in outcomes]
    assert len(laboratory.read(part)[1]) == len(outcomes)
    with pytest.raises(OctoctrlError, match="holds a study of plant rod with seed 0, not of rod with 3"):
        laboratory.study(part, 14, seed=3)
    (tmp_path / "other.jsonl").write_text("not ours")
    with pytest.raises(OctoctrlError, match="does not hold outcomes"):
        laboratory.study(tmp_path / "other.jsonl", 14)


def test_every_kind_has_its_share_and_any_beginning_is_mixed():
    planned = laboratory.schedule("rod", 1000)
    assert len(planned) >= 1000 and len(set(planned)) == len(planned)
    assert {kind for kind, _ in planned[:150]} == set(KINDS)


def test_matrix_summary_and_page(tmp_path):
    stop = {"time": 0.2, "rod": "arm", "element": 3, "mechanism": "is bent by more than 1.5 rad against its neighbour"}
    outcomes = [
        Outcome(kind="gentle", number=0, ending=Ending.ACCURATE, error=0.002, simulated=1.0),
        Outcome(kind="gentle", number=1, ending=Ending.UNSTABLE, reason="stopped", again=False, stop=stop),
        Outcome(kind="water", number=0, ending=Ending.LIMIT, reason="stopped", again=True, stop=stop | {"rod": None}),
        Outcome(kind="huge step", number=0, ending=Ending.REFUSED, reason="too large", automatic=False),
        Outcome(kind="waves", number=0, ending=Ending.UNDETECTED, reason="why"),
        Outcome(kind="full arm, all groups", number=0, ending=Ending.FINISHED, volume=0.991, slab_volume=1.004, retried=3),
        Outcome(kind="full arm, all groups", number=1, ending=Ending.FINISHED, volume=1.002, slab_volume=0.981),
    ]
    counts = laboratory.matrix(outcomes)
    assert list(counts) == ["gentle", "waves", "huge step", "water", "full arm, all groups"] and counts["gentle"][Ending.UNSTABLE] == 1
    numbers = laboratory.summary(outcomes)
    assert numbers["undetected"] == 1 and numbers["automatic_unstable"] == 1 and numbers["automatic_steps"] == 6
    assert (numbers["volume"], numbers["slab_volume"], numbers["retried"]) == (0.991, 0.981, 3)
    assert numbers["stopped"] == 2 and numbers["stopped_at_quarter_step_too"] == 1 and numbers["stops_without_a_place"] == 1
    said = laboratory_page.text(outcomes)
    assert "undetected failures: 1" in said and "6 runs, 1 of them unstable" in said
    assert "whole arm 99.10%, worst slab 98.10%; 3 samples" in said
    endurance = {"moving": 2e-6, "rest": 2e-6, "never": 2e-6, "smallest": 1e-7}
    page = laboratory_page.page({"assembly": outcomes[-2:]}, (long_run(20_000), endurance), ["octoctrl stability"], "stability.png")
    assert "full arm, all groups 1, 0.00 s, volume 100.20%, slab 98.10%: finished" in page
    page = laboratory_page.page({"rod": outcomes}, (long_run(20_000), endurance), ["octoctrl stability"], "stability.png")
    assert all(ending.value in page for ending in Ending) and "2 times an element is bent" in page and "20,000 steps" in page
    laboratory_page.draw(outcomes, tmp_path / "matrix.png")
    assert (tmp_path / "matrix.png").stat().st_size > 5000


def test_command_repeats_and_refuses(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["stability", "--repeat", "gentle:1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["kind"] == "gentle"
    assert main(["stability", "-n", "14", "-q", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["summary"]["undetected"] == 0
    assert (tmp_path / "stability-rod-0.jsonl").is_file()
    for arguments, message in (
        (["--repeat", "gentel:1"], "unknown kind 'gentel'; did you mean 'gentle'?"),
        (["--repeat", "gentle"], "--repeat gentle: expected KIND:NUMBER, for example 'all groups:7'"),
        (["--plant", "wood"], "unknown plant 'wood' (rod, assembly, assembly-mixed, assembly-coarse, assembly-coarse-mixed)"),
    ):
        assert main(["stability", *arguments]) == 2
        assert message in capsys.readouterr().err


# Long runs


def test_a_million_steps_leave_energy_momentum_and_frames():
    found = long_run(1_000_000)
    assert found["energy"] < 0.02 and found["orthonormality"] < 1e-11
    assert found["momentum"] < 1e-11 and found["angular_momentum"] < 1e-9
