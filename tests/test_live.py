"""The live view: what it draws against the plant, how it holds a run, what can be moved and planned from it, and its page in a browser."""

import shutil
import threading
import urllib.request
from dataclasses import replace
from time import monotonic, sleep

import numpy as np
import pytest
from conftest import coil_motion, coil_strains

import octoctrl as oc
from octoctrl.carrying.execution import execute
from octoctrl.carrying.results import ExecutionStatus
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.scene.objects import Capsule

pytest.importorskip("viser", reason="needs viser: pip install 'octoctrl[viewer]'")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.fixture
def view():
    made = oc.View(port=0, speed=8.0)
    yield made
    made.close()


@pytest.fixture(scope="module")
def short(coil_plan):
    """The first 0.4 s of a plan, beside a post."""
    post = Capsule(name="post", radius=8e-3, length=0.08, position=(0.0, 0.1, 0.05), axis=(1, 0, 0))
    schedule = replace(coil_plan.schedule, duration=0.4)
    model = replace(coil_plan.model, scene=oc.Scene(objects=(post,)))
    task = replace(coil_plan.task, phases=coil_plan.task.phases[:1], drives=(replace(coil_plan.task.drives[0], ends=""),))
    return replace(coil_plan, schedule=schedule, model=model, phase_begins={"store": 0.0}, task=task)


def settled(condition, seconds=5.0):
    end = monotonic() + seconds
    while not condition() and monotonic() < end:
        sleep(0.01)
    return condition()


def test_a_run_is_the_same_whether_watched_or_not_and_is_drawn_where_it_is(view, short):
    watched = execute(short, feedback="open-loop", watch=view)
    alone = execute(short, feedback="open-loop")
    assert watched.recording == alone.recording
    plant_tip = watched.recording.points[-1, -1]
    drawn = lambda: view.arm.vertices.reshape(len(watched.recording.points[-1]), -1, 3).mean(axis=1)  # noqa: E731
    assert settled(lambda: np.abs(drawn()[-1] - plant_tip).max() < 1e-6)
    np.testing.assert_allclose(drawn(), watched.recording.points[-1], atol=1e-6)
    first = view.line.vertices.reshape(-1, 2, 3).mean(axis=1) - watched.recording.points[-1]
    np.testing.assert_allclose(first[0] / np.linalg.norm(first[0]), watched.recording.frames[-1, 0, 0], atol=1e-5)
    planned = coil_motion(short.arm, coil_strains(np.array([0.4])))[2][0]
    assert settled(lambda: np.abs(view.ghost.points[-1, 1] - planned[-1]).max() < 2e-3), "the plan's shape at the clock"


def test_the_page_is_served(view):
    with urllib.request.urlopen(view.url, timeout=10) as answer:
        assert answer.status == 200 and b"<html" in answer.read()


def test_pause_and_step_hold_a_run_and_let_it_go(view, short):
    view.paused.value = True
    done = []
    thread = threading.Thread(target=lambda: done.append(execute(short, feedback="open-loop", watch=view)), daemon=True)
    thread.start()
    assert settled(lambda: view._plan is not None and view._clock > 0)
    sleep(0.2)
    held = view._clock
    view._step()
    assert settled(lambda: view._clock == pytest.approx(held + 0.05))
    sleep(0.1)
    assert view._clock == pytest.approx(held + 0.05) and not done
    view.paused.value = False
    thread.join(timeout=20)
    assert done and done[0].status is ExecutionStatus.FINISHED


def test_the_pace_is_that_of_the_slider(view, short):
    taken = []
    for speed in (8.0, 1.0):
        view.speed.value = speed
        begin = monotonic()
        execute(short, feedback="open-loop", watch=view)
        taken.append(monotonic() - begin)
    assert taken[1] >= 0.35 and taken[1] > taken[0], "0.4 s of arm take as long in real time"


def test_an_object_that_is_moved_by_hand_stands_there(view, short):
    plant = oc.make_plant("rod", short.arm, short.scene)
    plant.reset()
    view.begin(short, plant)
    view._moved[0] = np.array([0.01, 0.12, 0.06])
    view.see(plant, 0.05)
    from octoctrl.sim.contact.columns import Body

    np.testing.assert_allclose(plant.state()["bodies"][0, Body.POSITION : Body.POSITION + 3], [0.01, 0.12, 0.06])
    assert settled(lambda: np.allclose(view.objects["post"].position, [0.01, 0.12, 0.06], atol=1e-5))


def test_goals_of_the_page_make_a_new_plan_and_end_the_run(view):
    plan = oc.plan("twist")
    plant = oc.make_plant("rod", plan.arm, plan.scene)
    plant.reset()
    view.begin(plan, plant)
    ((_, _, slider),) = view._goals
    slider.value = slider.value + 0.1
    asked = view.task(plan.task).phases[0].goals[0].value
    assert asked == pytest.approx(plan.task.phases[0].goals[0].value + 0.1)
    view.plan_again().join(timeout=120)
    assert view.replanned is not None and view.replanned.trace.twist[-1] == pytest.approx(asked, abs=0.1)
    with pytest.raises(KeyboardInterrupt):
        view.see(plant, 0.05)
    assert view.next_plan() is view.replanned


def test_without_viser_one_sentence(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(OctoctrlError, match=r"pip install 'octoctrl\[viewer\]'"):
        oc.View()


@pytest.mark.slow
def test_the_page_opens_in_a_browser_with_its_controls(view, short):
    if CHROMIUM is None:
        pytest.skip("needs Chromium: apt-get install chromium")
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install 'octoctrl[test]'")
    plant = oc.make_plant("rod", short.arm, short.scene)
    plant.reset()
    view.begin(short, plant)
    view.see(plant, 0.05)
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": 900, "height": 600})
        tab.goto(view.url)
        for text in ("speed", "pause", "one period", "plan again", "store: twist"):
            tab.get_by_text(text).first.wait_for(timeout=30000)
        tab.get_by_text("pause").first.click()
        assert settled(lambda: view.paused.value) or tab.locator("input[type=checkbox]").first.click() is None
        browser.close()
