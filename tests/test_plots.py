"""Pictures: what is drawn, into which axes, with which letters."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import coil_execution
from matplotlib.figure import Figure

from octoctrl.judging.comparison import compare
from octoctrl.pictures.plots import LEAST_RANGE, OVER_TIME, PANELS, draw_over_time, plot
from octoctrl.planners.asking.wrapping import Curl, Swing
from octoctrl.sim.errors import OctoctrlError


def drawn(figure):
    """All texts of a figure, after it has been drawn."""
    figure.canvas.draw()
    return [text.get_text() for axes in figure.axes for text in [*axes.texts, *axes.get_yticklabels(), axes.yaxis.label]]


def test_letters_of_a_pdf_are_letters(tmp_path, coil_run):
    plot(coil_run, tmp_path / "traces.pdf", panels="twist")
    content = (tmp_path / "traces.pdf").read_bytes()
    assert b"/Type3" not in content and b"/CIDFontType2" in content


def test_labels_say_what_is_drawn(coil_run):
    figure = plot(coil_run)
    assert [axes.get_ylabel() for axes in figure.axes[1:4]] == ["lifted link\n[turns]", "lifted writhe\n[turns]", "twist\n[turns]"]
    for axes, values in zip(
        figure.axes[1:4], (coil_run.trace.lifted_link, coil_run.trace.lifted_writhe, coil_run.trace.twist), strict=True
    ):
        simulated = next(line for line in axes.lines if line.get_label() == "simulated")
        np.testing.assert_array_equal(simulated.get_ydata(), values)


def test_names_are_taken_as_they_are(coil_plan, tmp_path):
    """A dollar begins a formula for Matplotlib; an odd number of them, or a wrong formula, is an error when the picture is drawn."""
    named = {"store": r"$\frac{x$", "open": "5 $", "cross": "a_b^c"}
    task = replace(
        coil_plan.task,
        phases=tuple(replace(phase, name=named.get(phase.name, phase.name)) for phase in coil_plan.task.phases),
        drives=tuple(
            replace(drive, name=f"${drive.name}$^_{{", begins=named.get(drive.begins, drive.begins), ends=named.get(drive.ends, drive.ends))
            for drive in coil_plan.task.drives
        ),
    )
    plan = replace(coil_plan, task=task, phase_begins={named.get(name, name): begin for name, begin in coil_plan.phase_begins.items()})
    run = coil_execution(plan)
    run = replace(run, events=tuple(replace(event, phase=named.get(event.phase, event.phase)) for event in run.events))
    said = drawn(plot(run, tmp_path / "traces.png"))
    assert {r"$\frac{x$", "5 $", "a_b^c"} <= set(said) and any(text.startswith(r"after $\frac{x$") for text in said)
    assert sum(text.startswith("$") and "peak" in text for text in said) == len(task.drives)


@pytest.mark.parametrize("shift", [0.0, 2.0, -3.0])
def test_the_legend_covers_no_line(coil_run, shift):
    """Also where self-crossings add the dotted branch that jumps."""
    steps = np.where(coil_run.trace.time > 1.5, 1, 0)
    trace = replace(coil_run.trace, crossings=steps, link=coil_run.trace.lifted_link - 2 * steps + shift * (steps == 0))
    figure = plot(replace(coil_run, trace=trace))
    figure.canvas.draw()
    axes = figure.axes[1]
    assert [text.get_text() for text in axes.get_legend().get_texts()][-1].startswith("simulated, with its jumps")
    box = axes.get_legend().get_window_extent()
    for line in axes.lines[:3]:
        where = axes.transData.transform(line.get_xydata())
        where = where[np.isfinite(where).all(axis=1)]
        assert not np.any((where[:, 0] > box.x0) & (where[:, 0] < box.x1) & (where[:, 1] > box.y0) & (where[:, 1] < box.y1))
    assert box.y1 <= axes.get_window_extent().y1 + 1


def test_panels_sizes_and_axes_of_ones_own(coil_run):
    figure = plot(coil_run, panels=("twist", "activation"), size=(4.0, 3.0))
    assert tuple(figure.get_size_inches()) == (4.0, 3.0) and len(figure.axes) == 2
    assert figure.axes[-1].get_xlabel() == "time [s]" and figure.axes[0].get_xlabel() == ""
    own = Figure()
    above, below = own.subplots(2, 1)
    assert plot(coil_run, panels=("writhe", "arm"), ax=(above, below)) is own and len(own.axes) == 2
    assert above.get_ylabel().startswith("lifted writhe") and below.collections
    single = Figure().subplots()
    plot(coil_run, panels="twist", ax=single)
    assert len(single.lines) >= 3 and set(PANELS) == {"arm", *OVER_TIME}
    with pytest.raises(OctoctrlError, match=r"ax holds 1 axes for 5 panels; name the panels"):
        plot(coil_run, ax=single)
    with pytest.raises(OctoctrlError, match="unknown panel 'twits'; did you mean 'twist'"):
        plot(coil_run, panels=("twits",))


def test_a_picture_that_fails_leaves_no_file(coil_run, tmp_path, monkeypatch):
    def full(self, *_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", full)
    with pytest.raises(OctoctrlError, match="cannot be written: No space left on device"):
        plot(coil_run, tmp_path / "traces.png", panels="twist")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("factor", "least", "most"), [(1e-12, LEAST_RANGE, 1.5 * LEAST_RANGE), (1.0, 1.0, 2.5)])
def test_rounding_does_not_look_like_motion(coil_run, factor, least, most):
    """What a planar bend has of twist is drawn as nothing; what the coil has fills its panel."""
    made = compare(coil_run)
    small = {side: replace(getattr(made, side), twist=factor * getattr(made, side).twist) for side in ("planned", "simulated")}
    (axes,) = Figure().subplots(1, 1, squeeze=False)[0]
    draw_over_time([axes], coil_run, replace(made, **small), names=("twist",))
    low, high = axes.get_ylim()
    assert low < 0 < high and least <= high - low < most


def test_a_drive_at_level_zero_is_drawn_as_using_no_muscle(coil_plan):
    schedule = replace(coil_plan.schedule, primitives=(*coil_plan.schedule.primitives, Swing(level=0.0)))
    run = coil_execution(coil_plan)
    figure = plot(replace(run, plan=replace(coil_plan, schedule=schedule)), panels="activation")
    assert "Swing\nno muscle, peak 0.00" in drawn(figure)


def test_what_is_filled_is_what_the_plan_activates(coil_plan):
    """Of a wave the level behind its front, which has not set out yet, lies before its window."""
    curl = Curl(level=0.3, start=0.05, stop=0.19, speed=0.05, onset=1.0, apex=0.22)
    schedule = replace(coil_plan.schedule, primitives=(curl,))
    run = replace(coil_execution(coil_plan), plan=replace(coil_plan, schedule=schedule))
    axes = plot(run, panels="activation").axes[-1]
    heights = axes.collections[0].get_paths()[0].vertices
    assert heights[heights[:, 0] < 0.9, 1].max() < 0.01 < 0.8 < heights[:, 1].max()
