"""Plants by name: one factory, one option of every command, and tasks planned for and carried out on the full arm."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import octoctrl as oc
from octoctrl import tasks
from octoctrl.carrying import identifying
from octoctrl.carrying.execution import execute
from octoctrl.carrying.identifying import identify, load_model
from octoctrl.carrying.results import ExecutionStatus
from octoctrl.cli.application import main
from octoctrl.files import store
from octoctrl.files.configuration import parse
from octoctrl.files.toml_writing import toml_of
from octoctrl.judging.verification import verify
from octoctrl.planners.fitting import experiments, fit, identified
from octoctrl.planners.model.parameters import ReducedParameters
from octoctrl.planners.model.statics import CONSTANTS, section_constants
from octoctrl.sim.assembly.layout import AssemblyRow
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS, LumpedSection
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.plants import PLANTS, Plant
from octoctrl.sim.topology.measures import measure

ARM = oc.Arm.octopus()


@pytest.fixture(scope="module")
def plan():
    found = oc.plan("coil", plant="assembly")
    assert found.status.solved
    return found


def shortened(plan, duration):
    """The plan's first stretch as a plan of its own."""
    phases = (replace(plan.task.phases[0], shortest=duration, duration=duration, goals=()),)
    drives = tuple(replace(drive, ends="") for drive in plan.task.drives if drive.begins == "store")
    schedule = replace(plan.schedule, duration=duration)
    return replace(plan, task=replace(plan.task, phases=phases, drives=drives), schedule=schedule, phase_begins={"store": 0.0})


# By name


def test_factory_makes_each_plant_for_arm_and_scene():
    scene = oc.Scene.free(factor=2.0)
    for name in PLANTS:
        made = oc.make_plant(name, ARM, scene, record_every=4)
        assert made.model == name and made.arm is ARM and made.scene is scene and made.record_every == 4
    assert type(oc.make_plant()) is Plant is oc.Plant


@pytest.mark.parametrize(
    "call",
    [
        lambda: oc.make_plant("asembly"),
        lambda: oc.plan("coil", plant="asembly"),
        lambda: oc.execute(oc.plan("coil"), plant="asembly"),
        lambda: identify(plant="asembly"),
        lambda: tasks.load("coil", overrides=["run.plant=asembly"]),
    ],
)
def test_unknown_plant_is_refused_with_the_nearest(call):
    known = "rod, assembly, assembly-coarse, assembly-mixed, assembly-coarse-mixed"
    with pytest.raises(OctoctrlError, match=rf"unknown plant 'asembly'; did you mean 'assembly'\? \({known}\)"):
        call()


@pytest.mark.parametrize("command", [["plan", "coil", "-o", "p.npz"], ["identify"], ["demo", "coil"], ["warmup"]])
def test_every_command_refuses_an_unknown_plant(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([*command, "--plant", "asembly"]) == 2
    assert "unknown plant 'asembly'; did you mean 'assembly'?" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


# Reduced models belong to a plant


def test_models_of_the_full_arm_come_with_octoctrl():
    for laws in ("known", "generic"):
        found = identified.load_identified(ARM, laws=laws, plant="assembly")
        assert found.plant == "assembly" and "ring_torsion" in found.names and "squeeze" not in found.names and found.residual_rms < 0.05
        assert found.model.parameters.tone == identified.RESTING_TONE and "tone" not in found.names
    rod = identified.load_identified(ARM)
    assert rod.plant == "rod" and rod.model.parameters.ring_torsion == rod.model.parameters.squeeze == rod.model.parameters.tone == 0.0


def test_model_of_another_plant_is_refused(tmp_path):
    path = tmp_path / "model.json"
    identified.load_identified(ARM, plant="assembly").save(path)
    assert load_model(path, ARM, oc.Scene(), "assembly").plant == "assembly"
    with pytest.raises(OctoctrlError, match="identified on the plant 'assembly', the plan is for 'rod'"):
        load_model(path, ARM, oc.Scene(), "rod")


def test_squeeze_and_ring_torsion_act_as_said():
    """Squeeze narrows the section in proportion to the oblique level; the tube of rings counts for more and more towards the tip."""
    constants = dict(zip(CONSTANTS, section_constants(ARM, 8), strict=True))
    assert (np.diff(constants["ring_twisting"] / constants["twisting"]) > 0).all()
    assert (np.diff(constants["narrowing"]) < 0).all() and 0.9 < constants["narrowing"][0] < 1.0
    levels = np.zeros((11, 8))
    levels[9] = 0.3
    rest = identified.load_identified(ARM).model
    twists = []
    for change in ({}, {"squeeze": 0.5}, {"ring_torsion": 0.5}):
        model = replace(rest, parameters=replace(rest.parameters, **change))
        twists.append(model.equilibrium(levels)[:, 2])
    assert (twists[1] > 0).all() and (twists[2] < twists[0]).all()
    assert (np.diff(twists[2] / twists[0]) < 0).all()


def test_oblique_fibres_stiffen_the_bend_most_at_the_tip():
    """They wind from side to side: whichever way the arm bends, half of them are stretched, at the tip almost as much as straight ones."""
    rest = identified.load_identified(ARM, plant="assembly").model
    bends = {}
    for share in (0.0, 1.0):
        model = replace(rest, parameters=replace(rest.parameters, oblique_bending=share))
        for side in (("LM1", "LM2", "LM8"), ("LM1", "LM2"), ("LM4", "LM5", "LM6")):
            levels = np.zeros((11, 8))
            levels[[MUSCLE_GROUPS.index(group) for group in side]] = 0.02
            levels[MUSCLE_GROUPS.index("R-OM")] = 0.15
            bends[share, side] = np.linalg.norm(model.equilibrium(levels)[:, :2], axis=1)
    first, between, opposite = (bends[1.0, side] for side in (("LM1", "LM2", "LM8"), ("LM1", "LM2"), ("LM4", "LM5", "LM6")))
    eased = first / bends[0.0, ("LM1", "LM2", "LM8")]
    assert (np.diff(eased[3:]) < 0).all() and eased[:3].min() > 0.8 and eased[3:].max() < 0.6
    np.testing.assert_allclose(first, opposite, rtol=1e-6)
    # Half way between two muscles the same two feel less of the bend than three around one, by the cosines alone.
    softer = between / bends[0.0, ("LM1", "LM2")]
    np.testing.assert_allclose(softer, eased, rtol=0.2)


def test_tone_takes_up_the_slack():
    """Without tone nothing acts within the slack of 2.5 %; with it the arm rests at its short end, its tip at the long one."""
    rest = identified.load_identified(ARM).model
    toned = replace(rest, parameters=replace(rest.parameters, tone=1e-3))
    assert np.abs(rest.equilibrium(np.zeros((11, 8)))[:, 3] - 1).max() < 1e-9
    stretch = toned.equilibrium(np.zeros((11, 8)))[:, 3]
    assert (np.abs(stretch[:-1] - 0.975) < 5e-3).all() and stretch[-1] == pytest.approx(1.025, abs=5e-3)


def test_first_guess_takes_back_what_one_rod_lumps():
    for lumped in (LumpedSection(), LumpedSection.published()):
        arm = oc.Arm.octopus(lumped=lumped)
        guess = identified.first_guess(arm, "assembly")
        assert guess.torsion * lumped.torsion == pytest.approx(1.0)
        assert guess.oblique_passive * lumped.oblique_passive == guess.oblique_stress * lumped.oblique_stress == pytest.approx(1.0)
        assert identified.first_guess(arm) == ReducedParameters()
    assert {"torsion", "ring_torsion"} <= set(fit.free_factors("known", "assembly")) and "ring_torsion" not in fit.free_factors("known")


@pytest.mark.parametrize(("groups", "what"), [(LONGITUDINAL_GROUPS, "length"), (("R-OM",), "twist")])
def test_rod_is_twice_as_near_to_the_full_arm_as_the_published_one(groups, what):
    """In what each group is for, against the full arm with coarse rings, over 0.8 s."""
    activation = oc.Activation(templates=(oc.Plateau(groups=groups, level=0.3, rise=0.3),))
    arms = oc.Arm.octopus(lumped=LumpedSection.published()), ARM
    runs = [
        oc.make_plant("assembly-coarse").advance(activation, 0.8),
        *(oc.make_plant("rod", arm).advance(activation, 0.8) for arm in arms),
    ]
    values = [run.length if what == "length" else measure(run.time, run.points, run.frames).twist for run in runs]
    published, present = (np.sqrt(np.mean(np.square(mine - values[0]))) for mine in values[1:])
    assert present < 0.5 * published


@pytest.mark.slow
def test_rod_twists_as_far_as_the_full_arm_at_the_smallest_levels_too():
    """Turns of its inner half after a second, within 0.02 of those of the full arm with coarse rings; the published rod misses by more."""
    levels, arms = (0.02, 0.04, 0.12), (ARM, oc.Arm.octopus(lumped=LumpedSection.published()))

    def turns(plant, arm, level):
        activation = oc.Activation(templates=(oc.Plateau(groups=("L-OM",), level=level, rise=0.4, window=(0.0, 0.1)),))
        run = oc.make_plant(plant, arm).advance(activation, 1.0)
        return measure(run.time, run.points, run.frames).twist[-1]

    wanted = np.array([turns("assembly-coarse-mixed", ARM, level) for level in levels])
    present, published = (np.array([turns("rod", arm, level) for level in levels]) for arm in arms)
    assert np.abs(present - wanted).max() < 0.02 < 0.1 < np.abs(published - wanted).max()


# The models that come along


def test_models_that_come_along_are_those_of_the_arm():
    folder = Path(identified.__file__).parent / "models"
    names = {f"{ARM.fingerprint}-{plant}-{laws}.json" for plant in ("rod", "assembly") for laws in ("known", "generic")}
    assert {path.name for path in folder.iterdir()} == names
    for plant, recorded in (("rod", "rod"), ("assembly", "assembly-coarse")):
        for laws in ("known", "generic"):
            found = identified.load_identified(ARM, laws=laws, plant=plant)
            assert found.fingerprint == ARM.fingerprint and found.names == fit.free_factors(laws, plant) and found.model.laws == laws
            said = found.statistics
            assert said["recorded"] == recorded and said["cut_short"] == {} and said["converged"]
            assert said["runs"] == len(experiments.experiments(ARM))
            assert set(found.validity.levels.values()) == {0.75}


@pytest.mark.parametrize(("plant", "what"), [("rod", "bend, then twist"), ("assembly-coarse-mixed", "twist, bend, untwist")])
def test_models_that_come_along_are_what_identification_finds(plant, what):
    """One of the experiments again: its residual is as small as that of all, and a fit to it alone finds the same stresses."""
    (activation, duration) = next(run[1:] for run in experiments.experiments(ARM) if run[0] == what)
    recording = oc.make_plant(plant).advance(activation, duration)
    shipped = identified.load_identified(ARM, plant="assembly" if plant != "rod" else plant)
    residual = fit.ComparedRun(shipped.model, activation, recording).residual(shipped.model)
    assert np.sqrt(np.mean(residual**2)) < 1.5 * shipped.residual_rms
    names = ("longitudinal_stress", "oblique_stress")
    again = fit.identify([(activation, recording)], ARM, plant=shipped.plant, start=shipped.model.parameters, free=names)
    for name in names:
        assert getattr(again.model.parameters, name) == pytest.approx(getattr(shipped.model.parameters, name), rel=0.1)


# Identification when a run ends early


class Brittle(Plant):
    """A rod that breaks at 1 s."""

    def advance(self, activation, duration, **options):
        recording = super().advance(activation, min(duration, 1.0), **options)
        if duration > 1.0:
            raise PlantUnstableError("broken at t=1.000 s", time=1.0, element=3, mechanism="stretch", recording=recording)
        return recording


def test_run_that_diverges_is_cut_short_and_said(monkeypatch):
    runs = [run for run in experiments.experiments(ARM) if run[0] in ("twist, bend, untwist", "bend, then twist")]
    monkeypatch.setattr(experiments, "experiments", lambda arm: runs)
    monkeypatch.setattr(identifying, "make_plant", lambda *_: Brittle(ARM))
    taken = {}
    whole = fit.identify
    monkeypatch.setattr(
        fit, "identify", lambda recordings, *a, **k: taken.setdefault("found", whole(recordings, *a, **k, max_evaluations=1))
    )
    found = identify(ARM)
    assert found.statistics["cut_short"] == {name: "broken at t=1.000 s" for name, _, _ in runs}
    assert found.statistics["seconds"] == pytest.approx(2 * 0.78)
    assert "cut short: 'twist, bend, untwist', broken at t=1.000 s" in identifying.identification_text(found)
    monkeypatch.setattr(identifying, "LEAST_RUN", 2.0)
    with pytest.raises(PlantUnstableError, match="broken"):
        identify(ARM)


# Planning and running


def test_plan_knows_its_plant(plan, tmp_path):
    assert plan.plant == "assembly" and "plant assembly" in str(plan)
    store.save(tmp_path / "plan.npz", plan)
    assert store.load(tmp_path / "plan.npz").plant == "assembly"
    other = oc.plan("coil")
    assert other.plant == "rod" and other.report.numbers != plan.report.numbers


def test_task_file_names_the_plant(plan):
    configuration = parse(toml_of(tasks.load("coil", overrides=["run.plant=assembly"])))
    assert configuration.run.plant == "assembly"
    made = oc.plan(configuration)
    assert made.plant == "assembly" and made.report.numbers == plan.report.numbers


def test_coil_for_the_full_arm_stays_within_what_was_identified_and_says_if_not(plan):
    known = load_model(None, plan.arm, plan.scene, plan.plant).validity
    assert plan.report.extrapolates == () and plan.report.headroom > 0.5
    times = np.linspace(0.0, plan.schedule.duration, 100)
    levels = plan.schedule.activation().levels(times, plan.model.edges)
    assert (levels.max(axis=(0, 2)) < 0.5 * np.array([known.levels[group] for group in MUSCLE_GROUPS])).all()
    narrow = replace(known, levels=known.levels | {"LM1": 0.1, "L-OM": 0.1})
    assert [said.split()[0] for said in narrow.outside(plan.arm, plan.strains, levels)] == ["LM1", "L-OM"]


def test_short_stretch_in_closed_loop_on_the_full_arm(plan, tmp_path, monkeypatch, capsys):
    """The same through the command line and the library: plant chosen by the plan, named in file and text, followed closely."""
    monkeypatch.chdir(tmp_path)
    short = replace(shortened(plan, 0.15), plant="assembly-coarse")
    store.save("plan.npz", short)
    assert main(["run", "plan.npz", "-o", "run.npz", "--json", "-q"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["plant"] == "assembly-coarse" and answer["status"] == "finished"
    run = store.load("run.npz")
    assert run.plant == "assembly-coarse" and "plant assembly-coarse " in str(run) and run.recording.stretch.shape[1] == 180
    assert run.recording.time[-1] == pytest.approx(0.15) and run.trace.twist[-1] < -0.05
    assert np.abs(run.trace.twist - run.planned.twist).max() < 0.05
    again = execute(short, plant="assembly-coarse", period=0.025)
    np.testing.assert_array_equal(again.recording.points, run.recording.points)
    assert verify(run).checks


def test_plan_for_one_plant_runs_on_another_and_says_so(plan):
    run = execute(shortened(plan, 0.15), plant="rod", feedback="open-loop")
    assert run.plant == "rod" and "plant rod (planned for assembly)" in str(run)
    assert oc.Execution(**{name: getattr(run, name) for name in run.__slots__} | {"plant": "mine"}).plant == "mine"


def test_divergence_on_the_full_arm_names_the_rod_and_keeps_the_motion(plan):
    class Kicked(type(oc.make_plant("assembly"))):
        def advance(self, activation, duration, **options):
            if self.time > 0.04:
                self.core.rods.oblique(AssemblyRow.V2, nodes=True)[6, 200] = 5000.0  # m/s, which no step survives
            return super().advance(activation, duration, **options)

    run = execute(shortened(plan, 0.3), plant=Kicked(ARM, model="assembly"), feedback="open-loop")
    assert run.status is ExecutionStatus.UNSTABLE and re.search(r"element \d+ of (R-OM helix 3|ring \d+)", run.recording.note)
    assert 0.04 <= run.recording.time[-1] < 0.3 and np.isfinite(run.recording.points).all()


@pytest.mark.slow
def test_whole_coil_on_the_full_arm(plan):
    """Store one turn, spiral of two, two passages of two turns each, link constant while telescoping; planned as simulated."""
    run = execute(plan)
    assert run.status is ExecutionStatus.FINISHED and all(event.met for event in run.events)
    verify(run, strict=True)
    trace, ends = run.trace, {event.phase: event.actual for event in run.events}

    def at(name, phase):
        return np.interp(ends[phase], trace.time, getattr(trace, name))

    assert abs(at("twist", "store")) == pytest.approx(1.0, abs=0.1)
    assert abs(at("lifted_writhe", "cross")) == pytest.approx(2.0, abs=0.15) and abs(at("lifted_link", "cross")) == pytest.approx(
        2.0, abs=0.15
    )
    jumps = np.diff(trace.writhe - trace.lifted_writhe)
    assert jumps[np.abs(jumps) > 1].tolist() == pytest.approx([2.0, 2.0], abs=1e-3)
    link = trace.lifted_link[trace.time >= ends["cross"]]
    assert np.abs(link - link.mean()).max() <= 0.15
