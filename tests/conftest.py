"""Shared objects: the built wheel, a coil plan made by hand, and an execution that follows it with small errors."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).parent.parent

# How long an example takes says nothing on a machine that others use.
settings.register_profile("octoctrl", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("octoctrl")


def pytest_configure(config):
    # Programs that tests start take the octoctrl that is tested, not the one of the folder that they happen to start in.
    os.environ["PYTHONSAFEPATH"] = "1"
    # Workers and programs, each on a core of its own: threads of linear algebra that wait for each other take ten times as long.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        import octoctrl.sim
    except ImportError:
        pytest.exit("octoctrl is not installed; run: pip install '.[test]'", returncode=4)
    assert octoctrl.sim


FULL_ARM = ("assembly", "copying", "laboratory", "plants", "precision", "self_contact", "squid", "state", "strands", "threads", "volume")
"""Files that move full arms, by the begin of their names. What moves one is compiled in half a minute."""


def pytest_collection_modifyitems(items):
    """Keep a file on one worker, and where there are two all that move full arms, which would otherwise both compile the same."""
    few = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")) < 4
    for item in items:
        name = item.path.stem.removeprefix("test_")
        item.add_marker(pytest.mark.xdist_group("full arm" if few and name.startswith(FULL_ARM) else name))
    items.sort(key=lambda item: item.path.stem != "test_precision")  # it compiles anew, and keeps that for the others


def pytest_report_header(config):
    import octoctrl

    return f"octoctrl: {Path(octoctrl.__file__).parent}"


@pytest.fixture(scope="session")
def source(tmp_path_factory):
    """A copy of what the wheel is made of: building leaves files behind, and takes in those that earlier builds left."""
    copy = tmp_path_factory.mktemp("source")
    for folder in ("octoctrl", "sim", "planners"):
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"), symlinks=True)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    return copy


@pytest.fixture(scope="session")
def wheel(source, tmp_path_factory):
    """Path of the wheel."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--wheel-dir",
        str(folder),
        str(source),
    ]
    subprocess.run(command, check=True, capture_output=True, text=True)
    (path,) = folder.glob("octoctrl-*.whl")
    return path


DURATION, SECTIONS = 3.0, 8
BEGINS = {"store": 0.0, "open": 0.6, "spiral": 1.2, "cross": 1.8, "telescope": 2.4}


def coil_strains(time, bend=1.0, twist=1.0):
    """Strains that store twist, curl, and let the twist go: (T, S, 4)."""
    rise = np.clip(time / 0.6, 0.0, 1.0) - np.clip((time - 1.2) / 1.0, 0.0, 1.0)
    curl = np.clip((time - 0.6) / 1.2, 0.0, 1.0)
    strains = np.zeros((len(time), SECTIONS, 4))
    strains[..., 0] = -60.0 * bend * curl[:, None]
    strains[..., 2] = -2 * np.pi / 0.2 * twist * rise[:, None]
    strains[..., 3] = 1.0 - 0.05 * curl[:, None]
    return strains


def coil_motion(arm, strains):
    from octoctrl.planners.model.kinematics import element_points, element_stations, integrate_frames, section_bounds

    stations, bounds = element_stations(arm.edges), section_bounds(arm, strains.shape[-2])
    frames = integrate_frames(strains, stations, bounds)
    return stations, frames, element_points(strains, frames, arm.edges, bounds)


@pytest.fixture(scope="session")
def coil_plan():
    from octoctrl import tasks
    from octoctrl.planners.asking.schedule import Schedule
    from octoctrl.planners.model.reduced import ReducedModel
    from octoctrl.planners.solving.plan import Plan, PlanReport, PlanStatus
    from octoctrl.sim.topology.measures import measure

    configuration = tasks.load("coil")
    task, arm = configuration.task.on(configuration.arm), configuration.arm
    time = np.linspace(0.0, DURATION, 61)
    strains = coil_strains(time)
    _, frames, points = coil_motion(arm, strains)
    return Plan(
        task=task,
        model=ReducedModel(arm=arm, scene=configuration.scene, sections=SECTIONS),
        schedule=Schedule(primitives=tuple(drive.at(BEGINS, {}) for drive in task.drives), duration=DURATION),
        phase_begins=dict(BEGINS),
        time=time,
        strains=strains,
        trace=measure(time, points, frames, task.convention),
        status=PlanStatus.SOLVED,
        report=PlanReport(stages={"search": 0.25}, iterations=12, numbers={"store.duration": 1.5}, reason="none", headroom=np.inf),
    )


def coil_execution(plan, *, bend=1.0, twist=1.0, until=DURATION, **changes):
    from octoctrl.carrying.results import Event, Execution, ExecutionReport
    from octoctrl.sim.running.recording import Recording
    from octoctrl.sim.topology.measures import measure

    time = np.linspace(0.0, until, round(until / 0.025) + 1)
    strains = coil_strains(time, bend, twist)
    stations, frames, points = coil_motion(plan.arm, strains)
    edges = plan.arm.edges
    recording = Recording(
        time=time,
        points=points,
        frames=frames,
        stations=stations,
        stretch=np.repeat(strains[:, :1, 3], plan.arm.elements, axis=1),
        levels=plan.schedule.activation().levels(time, edges),
        series={"volume": np.ones(len(time))},
        complete=until == DURATION,
    )
    ends = [*list(BEGINS.values())[1:], DURATION]
    events = tuple(Event(phase=name, planned=end, actual=end, met=True) for name, end in zip(BEGINS, ends, strict=True) if end <= until)
    trace = measure(time, points, frames, plan.task.convention)
    made = {"plan": plan, "recording": recording, "trace": trace, "clock": time, "feedback": "tvlqr", "events": events}
    report = ExecutionReport(wall_time=1.5, time_step=2.5e-4, step_limit="shear")
    return Execution(**(made | {"report": report} | changes))


@pytest.fixture(scope="session")
def coil_run(coil_plan):
    return coil_execution(coil_plan, bend=1.005, twist=0.99)
