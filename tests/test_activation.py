"""Activation: exact cell averages, composition, bounds, and what is said about saturation."""

from collections import Counter
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.errors import OctoctrlError
from octoctrl.sim.templates import PEAK, WRITE_THRESHOLD, Plateau, Pulse, Wave, least_jerk, timing

LENGTH = 0.2
WAVE = Wave(groups=("LM1",), level=0.2, speed=0.1, width=3e-3, apex=0.22)
PULSE = Pulse(groups=("LM1",), level=0.2, stretch=0.04, speed=0.3, width=5e-3, window=(0.02, 0.18))


def reals(low, high):
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


def windows():
    return st.tuples(reals(0, 0.15), reals(0.01, 0.2)).map(lambda pair: (pair[0], pair[0] + pair[1]))


@st.composite
def plateaus(draw, groups=("LM1",)):
    onset = draw(reals(0, 2))
    return Plateau(
        groups=groups, level=draw(reals(0, 1)), onset=onset, rise=draw(reals(0.01, 2)), offset=onset + draw(reals(0, 3)),
        fall=draw(reals(0.01, 2)), window=draw(windows()),
    )  # fmt: skip


@st.composite
def waves(draw, groups=("LM1",)):
    onset = draw(reals(0, 2))
    return Wave(
        groups=groups, level=draw(reals(0, 1)), speed=draw(reals(0.02, 0.5)), width=draw(reals(2e-3, 0.05)), onset=onset,
        offset=onset + draw(reals(0, 3)), end_level=draw(reals(0, 1)), window=draw(windows()),
    )  # fmt: skip


def templates():
    return plateaus() | waves()


def pointwise(template, time, s):
    """Value of a template at points, written once more from its definition."""
    inside = (s >= template.window[0]) & (s < template.window[1])
    if isinstance(template, Plateau):
        up = 0.5 * (1 - np.cos(np.pi * np.clip((time - template.onset) / template.rise, 0, 1)))
        down = 0.5 * (1 - np.cos(np.pi * np.clip((time - template.offset) / template.fall, 0, 1)))
        return inside * template.level * up * (1 - down)

    def front(begin):
        return 0.5 * (1 + np.tanh((template.window[0] + template.speed * (time - begin) - s) / template.width))

    return inside * (template.level * front(template.onset) - (template.level - template.end_level) * front(template.offset))


def quadrature(function, lower, upper, panels=4000):
    edges = np.linspace(lower, upper, panels + 1)
    return np.mean(function((edges[1:] + edges[:-1]) / 2))


@settings(deadline=None)
@given(template=templates(), time=reals(0, 6), lower=reals(0, 0.19), width=reals(1e-4, 0.1))
def test_value_is_the_mean_over_the_cell_where_the_window_does_not_end(template, time, lower, width):
    upper = lower + width
    value = float(template.values(np, time, lower, upper) + 0.0 * lower)
    whole = Plateau if isinstance(template, Plateau) else Wave
    open_end = {name: getattr(template, name) for name in template.__slots__}
    if whole is Plateau:
        open_end["window"] = (-1.0, 10.0)
        expected = quadrature(lambda s: pointwise(whole(**open_end), time, s), lower, upper)
    else:
        begin = template.window[0]  # a front starts at its window's begin
        expected = quadrature(lambda s: pointwise(template, time, s), max(lower, begin), upper) if upper > begin else None
        if lower < begin or upper > template.window[1]:
            return
    assert value == pytest.approx(expected, abs=2e-6)


@settings(deadline=None)
@given(template=plateaus(), time=reals(0, 6))
def test_levels_of_a_window_are_the_shares_of_the_cells(template, time):
    edges = Arm.octopus(elements=16).edges
    levels = Activation(templates=(template,)).levels([time], edges)[0, 0]
    expected = [quadrature(lambda s: pointwise(template, time, s), low, high) for low, high in pairwise(edges)]
    assert levels == pytest.approx(expected, abs=2e-3 * template.level + 1e-12)


@settings(deadline=None)
@given(template=templates(), time=reals(0, 6), cuts=st.lists(reals(0.001, 0.199), min_size=1, max_size=30, unique=True))
def test_mean_over_a_union_is_the_mean_of_the_parts(template, time, cuts):
    edges = np.array([0.0, *sorted(cuts), LENGTH])
    if np.diff(edges).min() < 1e-6:
        return
    fine = np.asarray(template.values(np, time, edges[:-1], edges[1:]) + 0 * edges[1:])
    whole = float(template.values(np, time, 0.0, LENGTH) + 0.0)
    assert np.sum(fine * np.diff(edges)) / LENGTH == pytest.approx(whole, abs=1e-8)
    shares = template.coverage(edges[:-1], edges[1:])
    assert np.sum(shares * np.diff(edges)) == pytest.approx(min(template.window[1], LENGTH) - template.window[0], abs=1e-12)


@settings(deadline=None)
@given(listed=st.lists(templates(), max_size=5), composition=st.sampled_from(["override", "max"]))
def test_levels_stay_within_bounds(listed, composition):
    levels = Activation(templates=tuple(listed), composition=composition).levels(np.linspace(0, 6, 13), Arm.octopus(elements=12).edges)
    assert levels.shape == (13, len(MUSCLE_GROUPS), 12)
    assert levels.min() >= 0.0 and levels.max() <= 1.0 and not levels[:, 1:].any()


@settings(deadline=None)
@given(one=plateaus(), other=waves(), time=reals(0, 6))
def test_composition_rules(one, other, time):
    edges = Arm.octopus(elements=12).edges
    lower, upper = edges[:-1], edges[1:]
    values = [np.asarray(t.values(np, time, lower, upper) + 0 * lower) for t in (one, other)]
    shares = [t.coverage(lower, upper) for t in (one, other)]
    added = Activation(templates=(one, other), composition="add", on_saturation="clip").levels([time], edges)[0, 0]
    assert added == pytest.approx(np.clip(values[0] * shares[0] + values[1] * shares[1], 0, 1), abs=1e-12)
    largest = Activation(templates=(one, other), composition="max").levels([time], edges)[0, 0]
    assert largest == pytest.approx(np.clip(np.maximum(values[0] * shares[0], values[1] * shares[1]), 0, 1), abs=1e-12)
    last = Activation(templates=(one, other)).levels([time], edges)[0, 0]
    wrote = values[1] > WRITE_THRESHOLD
    under = values[0] * shares[0]
    assert last == pytest.approx(np.clip(np.where(wrote, shares[1] * values[1] + (1 - shares[1]) * under, under), 0, 1), abs=1e-12)
    swapped = Activation(templates=(other, one), composition="max").levels([time], edges)[0, 0]
    assert np.array_equal(largest, swapped)


def test_each_group_has_its_own_level():
    activation = Activation(templates=(Plateau(groups=("TM", "LM3"), level=0.5, rise=0.1), Plateau(groups=("R-OM",), level=0.2, rise=0.1)))
    levels = activation.levels([1.0], Arm.octopus().edges)[0]
    assert activation.groups == ("LM3", "R-OM", "TM")
    expected = {"LM3": 0.5, "TM": 0.5, "R-OM": 0.2}
    for index, group in enumerate(MUSCLE_GROUPS):
        assert levels[index] == pytest.approx(expected.get(group, 0.0), abs=1e-15)


def test_sections_see_the_mean_of_the_elements():
    wave = (Wave(groups=("LM1",), level=0.8, speed=0.1, width=0.01, onset=0.0),)
    fine, coarse = np.linspace(0, LENGTH, 65), np.linspace(0, LENGTH, 9)
    times = np.linspace(0, 3, 7)
    # A wave that overrides is not written where its mean is below the threshold, which depends on the cell.
    for composition, tolerance in (("max", 1e-12), ("override", WRITE_THRESHOLD)):
        activation = Activation(templates=wave, composition=composition)
        means = activation.levels(times, fine)[:, 0].reshape(7, 8, 8).mean(axis=2)
        assert means == pytest.approx(activation.levels(times, coarse)[:, 0], abs=tolerance)


def test_saturation_names_the_place_the_time_and_the_parts():
    crowded = (Plateau(groups=("LM2",), level=0.7, rise=0.1), Wave(groups=("LM2",), level=0.6, speed=0.1, width=0.01, onset=-5.0))
    edges = Arm.octopus().edges
    message = (
        r"activation of LM2 reaches 1.30 at t=1.00 s, s=0.\d\d m \(Plateau 0.70 \+ Wave 0.60\); scale, shift, or pass on_saturation='clip'"
    )
    with pytest.raises(OctoctrlError, match=message):
        Activation(templates=crowded, composition="add").levels([1.0], edges)
    clipped = Activation(templates=crowded, composition="add", on_saturation="clip").levels([1.0], edges)
    assert clipped.max() == 1.0


@pytest.mark.parametrize("make, message", [
    (lambda: Activation(templates=(Plateau(groups=("LM9",), level=0.1),)), "unknown muscle group 'LM9'; did you mean"),
    (lambda: Plateau(groups=(), level=0.1), "no muscle groups given"),
    (lambda: Plateau(groups=("LM1",), level=1.2), "level=1.2 is outside 0…1"),
    (lambda: Plateau(groups=("LM1",), level=0.2, rise=0.0), "rise=0 s is outside > 0 s"),
    (lambda: Plateau(groups=("LM1",), level=0.2, window=(0.1, 0.05)), "the begin must lie before the end"),
    (lambda: Wave(groups=("LM1",), level=0.2, speed=0.0, width=0.1), "speed=0 m/s is outside"),
    (lambda: Wave(groups=("LM1",), level=0.2, speed=0.1, width=float("nan")), "width is nan"),
    (lambda: Activation(composition="sum"), "unknown composition 'sum'"),
    (lambda: Activation(on_saturation="cut"), "unknown on_saturation 'cut'"),
])  # fmt: skip
def test_bad_templates_are_refused_in_one_sentence(make, message):
    with pytest.raises(OctoctrlError, match=message):
        make()


def test_the_planner_differentiates_the_same_formulas():
    casadi = pytest.importorskip("casadi")
    level, time = casadi.MX.sym("level"), casadi.MX.sym("time")
    edges = np.linspace(0, LENGTH, 9)
    for template in (
        Plateau(groups=("LM1",), level=level, onset=0.3, rise=0.7, offset=2.0, window=(0.0, 0.11)),
        Wave(groups=("LM1",), level=level, speed=0.07, width=0.012, onset=0.2, offset=1.0, window=(0.0, 0.11)),
    ):
        symbolic = Activation(templates=(template,)).compose(casadi, "LM1", time, edges[:-1], edges[1:])
        values = casadi.Function("levels", [level, time], [symbolic])
        kind, fields = type(template), {name: getattr(template, name) for name in template.__slots__}
        for instant in (0.5, 0.9, 1.7, 2.2):
            twin = Activation(templates=(kind(**(fields | {"level": 0.4})),)).levels([instant], edges)[0, 0]
            assert np.asarray(values(0.4, instant)).ravel() == pytest.approx(twin, abs=1e-12)


def test_a_way_of_least_jerk_is_a_bell():
    """Its speed is 16 x^2 (1 - x)^2 of the greatest, which is 15/8 of the mean; it stands still before and after."""
    time, step = np.linspace(-0.5, 2.5, 3001), 1e-6
    speed = (least_jerk(np, time + step, 0.0, 2.0) - least_jerk(np, time - step, 0.0, 2.0)) / (2 * step)
    share = np.clip(time / 2.0, 0.0, 1.0)
    np.testing.assert_allclose(speed, PEAK / 2.0 * 16 * share**2 * (1 - share) ** 2, atol=1e-6)
    assert least_jerk(np, 5.0, 0.0, 2.0) == 1.0 and least_jerk(np, -1.0, 0.0, 2.0) == 0.0


def test_a_pulse_stands_and_then_travels_as_fast_as_it_was_told():
    """A stretch of 30 mm from 20 mm on: whole at first, then its middle goes with the way of least jerk; in the end nothing is left."""
    pulse = Pulse(groups=("LM1",), level=0.4, stretch=0.03, speed=0.2, width=2e-3, rise=0.5, offset=1.0, window=(0.02, 0.18))
    edges, time = np.linspace(0.0, 0.3, 601), np.linspace(0.0, 3.0, 601)
    lower, upper = edges[:-1], edges[1:]
    level = Activation(templates=(pulse,), composition="handover").levels(time, edges)[:, MUSCLE_GROUPS.index("LM1")]
    lengths, middles = level.sum(axis=1) * (upper - lower)[0], (upper + lower) / 2
    held, lasts = np.abs(time - 0.9).argmin(), PEAK * (0.16 + 3 * 2e-3) / 0.2
    assert lengths[held] == pytest.approx(0.4 * 0.03, rel=0.02)
    assert lengths[np.abs(time - 0.25).argmin()] == pytest.approx(0.2 * 0.03, rel=0.02)  # halfway up
    centre = (level @ middles) / np.maximum(level.sum(axis=1), 1e-12)
    assert centre[held] == pytest.approx(0.035, abs=5e-4)
    middle = np.abs(time - 1.0 - lasts / 2).argmin()
    assert lengths[middle] == pytest.approx(0.4 * 0.036, rel=0.02)
    assert np.gradient(centre, time)[middle] == pytest.approx(0.2, rel=0.02)
    inside = Activation(templates=(pulse,)).levels([1.0 + lasts, 5.0], edges)[:, MUSCLE_GROUPS.index("LM1")]
    assert inside.max() < 0.4 * 0.55 and inside[:, upper < 0.175].max() < 0.01  # what is left lies at the window's end
    # It acts, and takes over from what lies beneath, where it is.
    np.testing.assert_allclose(0.4 * pulse.weight(np, time[:, None], lower, upper), pulse.values(np, time[:, None], lower, upper))
    assert pulse.place(np, np.array([[0.0]]), lower, upper)[0, np.abs(middles - 0.035).argmin()] == pytest.approx(1.0, abs=1e-3)


def test_a_pulse_that_shrinks_arrives_with_its_share_and_its_middle_is_as_fast_as_it_was_told():
    numbers = {"groups": ("LM1",), "level": 0.4, "stretch": 0.03, "speed": 0.2, "width": 1e-3, "rise": 0.5, "window": (0.02, 0.18)}
    pulse, edges, time = Pulse(**numbers, offset=1.0, shrinks_to=0.4), np.linspace(0.0, 0.3, 1201), np.linspace(1.0, 2.5, 601)
    shares = pulse.weight(np, time[:, None], edges[:-1], edges[1:])
    lengths, lasts = shares.sum(axis=1) * (edges[1] - edges[0]), PEAK * (0.16 + 3e-3 - 0.018 / 2) / 0.2
    assert lengths[-1] == pytest.approx(0.4 * 0.03 + 3e-3, rel=1e-3)  # and the three widths that it is longer on its way
    centre = shares @ ((edges[1:] + edges[:-1]) / 2) / shares.sum(axis=1)
    assert np.gradient(centre, time)[np.abs(time - 1.0 - lasts / 2).argmin()] == pytest.approx(0.2, rel=5e-3)
    whole = [Pulse(**numbers, offset=9.0, shrinks_to=share).weight(np, 0.7, edges[:-1], edges[1:]) for share in (0.4, 1.0)]
    np.testing.assert_array_equal(*whole)  # before it sets out
    with pytest.raises(OctoctrlError, match=r"^shrinks_to=0 is outside > 0$"):
        Pulse(**numbers, shrinks_to=0.0)


def test_a_pulse_needs_an_end():
    with pytest.raises(OctoctrlError) as caught:
        Pulse(groups=("LM1",), level=0.4, stretch=0.03, speed=0.2, width=2e-3, window=(0.02, float("inf")))
    assert str(caught.value) == "Pulse: window (0.02, inf) m has no end; give the arclength at which the stretch arrives"
    with pytest.raises(OctoctrlError, match=r"^speed=0 m/s is outside > 0 m/s$"):
        Pulse(groups=("LM1",), level=0.4, stretch=0.03, speed=0.0, width=2e-3, window=(0.02, 0.1))


class Counted:
    """NumPy, counting how often each function is asked for."""

    def __init__(self):
        self.asked = Counter()

    def __getattr__(self, name):
        self.asked[name] += 1
        return getattr(np, name)


@pytest.mark.parametrize("composition", ["add", "handover", "max"])
def test_muscles_that_differ_by_their_levels_share_their_fronts(composition):
    time, edges, levels = np.linspace(0.0, 3.0, 31)[:, None], np.linspace(0.0, 0.2, 21), {"LM1": 0.3, "LM2": 0.2, "LM8": 0.1}
    front = {"speed": 0.1, "width": 3e-3, "offset": 1.0, "profile": 0.5, "apex": 0.22}
    each = tuple(Wave(groups=(group,), level=level, **front) for group, level in levels.items())
    counted, known = Counted(), {}
    together = Activation(templates=each, composition=composition)
    found = [together.compose(counted, group, time, edges[:-1], edges[1:], known) for group in levels]
    assert counted.asked["log1p"] == 4, "two ends of a cell, two fronts"
    for wave, level in zip(each, found, strict=True):
        alone = Activation(templates=(wave,), composition=composition)
        assert np.array_equal(level, alone.compose(np, wave.groups[0], time, edges[:-1], edges[1:]))


@pytest.mark.parametrize("template", [Plateau(groups=("LM1",), level=0.2), WAVE, PULSE], ids=lambda one: type(one).__name__)
def test_what_decides_a_shape_is_all_but_muscles_and_levels(template):
    other = {"groups": ("LM2",), "level": 0.1, "end_level": 0.05, "window": (0.01, 0.19)}
    for item in fields(template):
        changed = replace(template, **{item.name: other.get(item.name, 0.123)})
        assert (timing(changed) == timing(template)) == (item.name in ("groups", "level", "end_level")), item.name


def test_a_wave_does_nothing_until_it_may():
    """Its front reaches ahead by the width; when it may act, it is the one that was always there."""
    early, late = (Activation(templates=(replace(WAVE, onset=1.0, since=since),)) for since in (0.0, 1.0))
    times, edges = np.array([0.99, 1.0, 1.005, 1.2]), np.linspace(0.0, 0.2, 21)
    before, after = early.levels(times, edges), late.levels(times, edges)
    assert before[:2, :, 0].any(axis=1).all() and not after[:2].any()
    np.testing.assert_array_equal(after[2:], before[2:])
