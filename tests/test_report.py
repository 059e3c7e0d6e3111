"""The page of a run: what it holds against the recording, and what it does when it is used, in a real browser."""

import json
import re
import shutil
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from conftest import coil_execution
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from octoctrl.pictures.motion import curvature, motion_of, rest_arclength, twist_density
from octoctrl.pictures.packing import pack, unpack
from octoctrl.pictures.report import page, report
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.plants import make_plant
from octoctrl.sim.running.recording import StrandMotion
from octoctrl.sim.scene.objects import Capsule

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


WITHOUT_WEBGL = """
const get = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { return kind === "webgl2" ? null : get.call(this, kind, ...rest); };
"""


INK = """
() => {
  const canvas = document.querySelector("canvas.arm"), gl = canvas.getContext("webgl2");
  const data = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, data);
  return data.filter((value, index) => index % 4 === 3 && value > 0).length;
}
"""


# Numbers


@given(arrays(np.float64, array_shapes(min_dims=1, max_dims=3, max_side=9), elements=st.floats(-1e6, 1e6)))
def test_packed_numbers_come_back_within_half_a_step(values):
    contents, text = pack({"values": values})
    step = np.ptp(values) / 65535
    np.testing.assert_allclose(unpack(contents, text)["values"], values, rtol=0, atol=0.5001 * step + 1e-9)


def test_several_arrays_do_not_disturb_each_other():
    draw = np.random.default_rng(1)
    given_arrays = {"a": draw.normal(size=(7, 3)), "b": np.ones((2, 2)), "c": draw.normal(size=(7, 5, 3)).cumsum(axis=0)}
    found = unpack(*pack(given_arrays))
    for name, values in given_arrays.items():
        np.testing.assert_allclose(found[name], values, atol=max(np.ptp(values), 1e-12) / 65535)


def test_curvature_of_a_circle_and_of_a_helix():
    arclength = np.linspace(0.0, 0.2, 61)
    radius = np.linspace(12e-3, 2e-3, 61)
    for r, pitch in ((0.05, 0.0), (0.02, 0.01)):
        speed = np.hypot(r, pitch)
        angle = arclength / speed
        points = np.stack([r * np.cos(angle), r * np.sin(angle), pitch * angle], axis=1)[None]
        np.testing.assert_allclose(curvature(points, arclength, radius), r / speed**2, rtol=0.03)


def test_curvature_does_not_see_wiggles_shorter_than_the_radius():
    arclength = np.linspace(0.0, 0.2, 61)
    straight = np.stack([1e-5 * (-1.0) ** np.arange(61), arclength, np.zeros(61)], axis=1)[None]
    assert curvature(straight, arclength, np.full(61, 10e-3)).max() < 2.0
    assert curvature(straight, arclength, np.full(61, 1e-3)).max() > 3.0


def test_twist_density_is_the_turn_about_the_arm(coil_run):
    recording = coil_run.recording
    stations, rate = recording.stations, 17.0
    angle = rate * stations
    frames = np.zeros((1, len(stations), 3, 3))
    # d3 = +y; d1 turns from +z towards +x, which is right-handed about +y.
    frames[0, :, 0, 2], frames[0, :, 0, 0] = np.cos(angle), np.sin(angle)
    frames[0, :, 1, 2], frames[0, :, 1, 0] = -np.sin(angle), np.cos(angle)
    frames[0, :, 2, 1] = 1.0
    twisted = replace(
        recording, **{name: getattr(recording, name)[:1] for name in ("time", "points", "stretch", "levels")}, frames=frames, series={}
    )
    np.testing.assert_allclose(twist_density(twisted, np.array([0]), np.linspace(0.0, 0.2, 11)), rate, rtol=1e-9)


def test_motion_is_that_of_the_recording(coil_run):
    recording, motion = coil_run.recording, motion_of(coil_run, instants=len(coil_run.recording.time), places=201)
    np.testing.assert_array_equal(motion.time, recording.time)
    assert rest_arclength(recording)[-1] == pytest.approx(coil_run.plan.arm.length, rel=1e-3)
    np.testing.assert_allclose(motion.points[:, -1], recording.tip, atol=2e-5)
    turns = motion.twist.mean(axis=1) * coil_run.plan.arm.length / (2 * np.pi)
    np.testing.assert_allclose(turns, coil_run.trace.twist, atol=0.02)
    np.testing.assert_allclose(np.linalg.norm(motion.normals, axis=2), 1.0)
    assert set(motion.levels) == {"R-OM", "LM1", "LM2", "LM8", "L-OM"}
    np.testing.assert_allclose(motion.distance, np.linalg.norm(motion.points - motion.planned_points, axis=2))


# The file


def test_same_run_gives_the_same_bytes_and_a_small_file(coil_run, tmp_path):
    path = report(coil_run, tmp_path / "run.html")
    assert path.read_text(encoding="utf-8") == page([coil_run])
    assert path.stat().st_size < 0.5e6
    assert not re.search(r"(?:src|href)=[\"']?https?:", path.read_text(encoding="utf-8"))


def test_existing_files_and_other_suffixes_are_refused(coil_run, tmp_path):
    (tmp_path / "run.html").write_text("mine")
    for name, message in (("run.html", "exists"), ("run.pdf", r"\.html")):
        with pytest.raises(OctoctrlError, match=message):
            report(coil_run, tmp_path / name)
    assert (tmp_path / "run.html").read_text() == "mine" and not list(tmp_path.glob(".*"))


def test_names_cannot_write_into_the_page(coil_plan):
    evil = "</script><script>alert(1)</script>"
    plan = replace(coil_plan, task=replace(coil_plan.task, name=evil))
    text = page([coil_execution(plan, feedback=evil)])
    assert evil not in text
    (head,) = re.findall(r'<script type="application/json" id="head">(.*?)</script>', text)
    assert json.loads(head)["runs"][0]["series"].keys() == {"Lk", "Wr", "Tw"}


def test_a_run_cut_short_has_a_page(coil_plan):
    from octoctrl.carrying.results import ExecutionStatus

    assert "Interrupted" in page([coil_execution(coil_plan, until=1.0, status=ExecutionStatus.INTERRUPTED)])


# In a browser


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        pytest.skip("needs Chromium: apt-get install chromium")
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install 'octoctrl[test]'")
    with sync_api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="module")
def opened(browser, coil_run, tmp_path_factory):
    path = report([coil_run, coil_run], tmp_path_factory.mktemp("page") / "two.html")
    tab = browser.new_page(viewport={"width": 1300, "height": 900})
    complaints, requests = [], []
    tab.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    tab.on("request", lambda request: requests.append(request.url))
    tab.goto(path.as_uri())
    tab.wait_for_selector("body[data-ready]", state="attached", timeout=30000)
    yield tab
    assert complaints == [] and requests == [path.as_uri()]


def clock(tab):
    return tab.evaluate("() => report.state.time")


def test_slider_moves_cursors_numbers_and_arm(opened, coil_run):
    def picture():
        opened.wait_for_timeout(150)
        return opened.evaluate("() => document.querySelector('canvas.arm').toDataURL()")

    opened.evaluate("() => report.set(0)")
    before = picture()
    opened.evaluate("() => { const s = document.getElementById('time'); s.value = 1.5; s.dispatchEvent(new Event('input')); }")
    assert clock(opened) == pytest.approx(1.5, abs=2e-3)
    assert picture() != before
    index = int(np.searchsorted(coil_run.trace.time, 1.5))
    said = opened.inner_text("#run-0 .reading").replace("\u2212", "-")
    assert float(re.search(r"Tw ([-.\d]+)", said)[1]) == pytest.approx(coil_run.trace.twist[index], abs=0.011)
    cursors = "#run-0 figure:not(.small) .panel > i"
    places = opened.evaluate("cursors => [...document.querySelectorAll(cursors)].map(i => parseFloat(i.style.left))", cursors)
    np.testing.assert_allclose(places, 50.0, atol=0.1)


def test_a_press_in_a_kymograph_sets_time_and_place(opened):
    kymograph = opened.locator("#run-1 canvas.kymograph").first
    box = kymograph.bounding_box()
    kymograph.click(position={"x": 0.25 * box["width"], "y": 0.4 * box["height"]})
    assert clock(opened) == pytest.approx(0.75, abs=0.02)
    assert opened.evaluate("() => report.parts[1].view.mark") == pytest.approx(0.6, abs=0.03)
    assert opened.evaluate("() => report.parts[0].view.mark") == -1


def test_keys_layers_and_colours(opened):
    opened.evaluate("() => report.set(1)")
    opened.locator("h1").first.click()
    for key, expected in (("ArrowRight", 1.02), ("PageUp", 1.22), ("Home", 0.0), ("End", 3.0)):
        opened.keyboard.press(key)
        assert clock(opened) == pytest.approx(expected, abs=1e-9)
    opened.evaluate("() => report.set(1)")
    opened.keyboard.press("Space")
    opened.wait_for_timeout(300)
    opened.keyboard.press("Space")
    assert 1.0 < clock(opened) < 3.0
    opened.locator('#run-0 input[data-layer="planned"]').uncheck()
    shown = opened.evaluate("() => report.parts.map(part => part.view.layers.map(layer => layer.visible))")
    assert shown == [[True, False], [True, True]]
    opened.select_option("#run-0 select.field", "distance from the plan")
    assert opened.inner_text("#run-0 .high").endswith("mm")


def test_rods_and_objects_can_be_shown_and_hidden(browser, coil_run, tmp_path):
    plan = coil_run.plan
    post = Capsule(name="post", radius=8e-3, length=0.08, position=(0.0, 0.1, 0.03), axis=(1, 0, 0))
    plan = replace(plan, model=replace(plan.model, scene=replace(plan.scene, objects=(post,))))
    strands = make_plant("assembly-coarse").strands()
    points = {name: places[None].astype(np.float32) for name, (places, _) in strands.items()}
    radius = {name: radius.astype(np.float32) for name, (_, radius) in strands.items()}
    run = replace(coil_run, plan=plan, strands=StrandMotion(time=np.zeros(1), points=points, radius=radius))
    tab = browser.new_page(viewport={"width": 1300, "height": 900})
    complaints = []
    tab.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    tab.goto(report(run, tmp_path / "full.html").as_uri())
    tab.wait_for_selector("body[data-ready]", state="attached", timeout=30000)
    assert not tab.locator(".tools.colour").is_visible(), "without the skin there is nothing to colour"

    def ink():
        tab.wait_for_timeout(200)
        return tab.evaluate(INK)

    shown = [ink()]
    for name in ("longitudinal", "nerve cord", "oblique", "transverse", "planned", "objects"):
        tab.locator(f'input[data-layer="{name}"]').uncheck()
        shown.append(ink())
    assert all(after <= before for before, after in pairwise(shown)) and shown[-2] > 100 and shown[-1] == 0
    assert shown[2] > shown[3] > shown[4], "helices and rings are seen from outside"
    tab.locator('input[data-layer="arm"]').check()
    assert ink() > 1000 and tab.locator(".tools.colour").is_visible() and complaints == []


def test_without_webgl_a_still_picture_is_shown(browser, coil_run, tmp_path):
    tab = browser.new_page()
    tab.add_init_script(WITHOUT_WEBGL)
    tab.goto(report(coil_run, tmp_path / "run.html").as_uri())
    tab.wait_for_selector("body[data-ready]", state="attached", timeout=30000)
    assert tab.locator(".view img").is_visible() and not tab.locator("canvas.arm").is_visible()
    assert tab.evaluate("() => document.querySelector('.view img').naturalWidth") > 500


def test_the_command_writes_one_page_of_several_runs(coil_run, tmp_path, capsys):
    from octoctrl.cli.application import main
    from octoctrl.files.store import save

    save(tmp_path / "run.npz", coil_run)
    target = tmp_path / "both.html"
    assert main(["report", str(tmp_path / "run.npz"), str(tmp_path / "run.npz"), "-o", str(target)]) == 0
    assert capsys.readouterr().err == f"wrote {target}\n"
    assert target.read_text(encoding="utf-8") == page([coil_run, coil_run])
    assert main(["report", str(tmp_path / "run.npz"), "-o", str(target)]) == 2
    assert "exists" in capsys.readouterr().err
