"""The clock of what travels: what it moves, what a goal asks of it, and that fronts never go back."""

from dataclasses import replace

import numpy as np
import pytest

import octoctrl as oc
from octoctrl import tasks
from octoctrl.judging.packet import packet_of
from octoctrl.planners.contracts import ClockReading
from octoctrl.planners.following.channels import Channels
from octoctrl.planners.following.design import Course
from octoctrl.planners.following.pace import ANSWER, RATE, Pace, Paced
from octoctrl.sim.activation import Activation
from octoctrl.sim.templates import Plateau, Pulse, Wave

EDGES = np.linspace(0.0, 0.2, 41)
STANDS = Plateau(groups=("LM1", "TM"), level=0.2, onset=0.1)
WAVE = Wave(groups=("LM1",), level=0.5, speed=0.1, width=5e-3, onset=0.2, offset=0.7)
PULSE = Pulse(groups=("LM5",), level=0.3, stretch=0.04, speed=0.3, width=5e-3, window=(0.02, 0.18), offset=1.0)
BOTH = Activation(templates=(STANDS, WAVE, PULSE), composition="handover")


@pytest.fixture(scope="module")
def packet():
    return oc.plan("packet")


def earlier(ahead):
    """The same with waves that were sent earlier."""
    waves = (replace(wave, onset=wave.onset - ahead, offset=wave.offset - ahead) for wave in (WAVE, PULSE))
    return replace(BOTH, templates=(STANDS, *waves))


def test_a_clock_that_is_ahead_moves_what_travels_alone():
    times = np.linspace(0.0, 2.0, 21)
    found = BOTH.levels(times, EDGES, np.full(21, 0.08))
    np.testing.assert_allclose(found, earlier(0.08).levels(times, EDGES), atol=1e-12)
    assert np.abs(found - BOTH.levels(times, EDGES)).max() > 0.1


def test_between_two_readings_it_goes_over_linearly_and_takes_corrections_along():
    channels, times = Channels(BOTH), np.array([1.0, 1.025, 1.05])
    paced = Paced(BOTH, channels, (1.0, 1.05), (0.0, 0.04))
    for index, ahead in enumerate((0.0, 0.02, 0.04)):
        one = times[index : index + 1]
        np.testing.assert_allclose(paced.levels(times, EDGES)[index], earlier(ahead).levels(one, EDGES)[0], atol=1e-12)
        np.testing.assert_allclose(paced.shares(times, EDGES)[index], Channels(earlier(ahead)).shares(one, EDGES)[0], atol=1e-12)
    still = Paced(BOTH, channels, (1.0, 1.05), (0.0, 0.0))
    assert np.array_equal(still.levels(times, EDGES), BOTH.levels(times, EDGES))


class Seen:
    """One instant of a recording."""

    def __init__(self, recording, index):
        self.time, self.points, self.frames = float(recording.time[index]), recording.points[index], recording.frames[index]
        self.stations, self.stretch = recording.stations, recording.stretch[index]


def test_what_a_goal_asks_of_the_clock(packet):
    """By the wave's own speed: between its fronts the middle goes as fast as they do."""
    recording = packet.model.recording(packet.time, packet.strains)
    wave, goal = packet.schedule.primitives[0], packet.task.phases[2].goals[0]
    begin, end = packet.phase_begins["far"], packet.schedule.duration
    places = np.array([packet_of(recording, packet.arm).position[np.abs(packet.time - time).argmin()] for time in (begin, end)])
    share = np.diff(places)[0] / (wave.speed * (end - begin))
    now = round(begin + 0.25, 2)
    index = int(np.abs(packet.time - now).argmin())
    seen = float(packet_of(recording, packet.arm).position[index])
    arrives = seen + share * wave.speed * (end - now)
    pace = Pace(packet)
    asked = (goal.value - arrives) / (share * wave.speed) * 0.05 / (end - ANSWER - now)
    found = pace.decide(Seen(recording, index), ClockReading(now, now, now + 0.05, 0.05))
    assert found == pytest.approx(asked, abs=1e-3) and pace.ahead == found
    waiting = pace.decide(Seen(recording, index), ClockReading(now + 0.05, now + 0.05, now + 0.05, 0.05))
    assert waiting == found


def test_fronts_never_go_back(packet):
    """Seen far beyond its goal, the packet is slowed as far as that goes; before a goal is due nothing is asked."""
    recording = packet.model.recording(packet.time, packet.strains)
    last, now = Seen(recording, len(packet.time) - 1), round(packet.phase_begins["middle"] + 0.3, 2)
    pace = Pace(packet)
    assert pace.decide(last, ClockReading(0.1, 0.1, 0.15, 0.05)) == 0
    last.time = now
    assert pace.decide(last, ClockReading(now, now, now + 0.05, 0.05)) == pytest.approx(-RATE * 0.05)
    other = Pace(packet)
    other.restore(pace.state())
    reading = ClockReading(now + 0.05, now + 0.05, now + 0.1, 0.05)
    assert other.decide(last, reading) == pace.decide(last, reading)


def test_what_a_clock_does_is_that_of_the_model(packet):
    course, model, ahead = Course(packet, packet.model), packet.model, 2e-3
    period = course.periods[18]
    ends = [course.predicted(period, np.zeros(len(course.channels)), period.strains, sign * ahead).strains for sign in (1, -1)]
    shifted = model.levels(Paced(packet.schedule.activation(), course.channels, (0.0, 0.0), (ahead, ahead)), np.array([19 * course.period]))
    there = model.simulate(shifted, [course.period], start=period.strains.reshape(-1, 4)).strains[-1].ravel()
    scale = abs(ends[0] - ends[1]).max()
    np.testing.assert_allclose((ends[0] - ends[1]) / scale, 2 * ahead * period.linear.timing / scale, atol=0.02)
    np.testing.assert_allclose(ends[0] / scale, there / scale, atol=0.05)


def test_a_packet_on_heavy_water_and_stiff_tissue_comes_nearer_its_place():
    strong = ["task.drives.pulse.settings.level=0.4", "task.drives.pulse.free=['speed']"]
    plan = oc.plan(tasks.load("packet", overrides=strong))
    arm = replace(plan.arm, youngs_modulus=1.3 * plan.arm.youngs_modulus, shear_modulus=1.3 * plan.arm.shear_modulus)
    plant, missed = oc.make_plant("rod", arm, oc.Scene.free(factor=2.0)), {}
    for name in ("open-loop", "tvlqr"):
        checks = oc.verify(oc.execute(plan, feedback=name, plant=plant)).checks
        missed[name] = next(check.value for check in checks if check.name == "far.packet")
    assert missed["tvlqr"] < 0.6 * missed["open-loop"]


def test_noise_and_delay_do_not_lead_it_astray(packet):
    """Read off nodes that are 0.5 mm off, the packet would be sent away by three tolerances."""
    sensors = oc.Sensors(delay=0.05, position_noise=5e-4, angle_noise=np.radians(1.0), seed=7)
    checks = oc.verify(oc.execute(packet, feedback="tvlqr", sensors=sensors)).checks
    assert max(check.value / check.limit for check in checks if check.name.endswith(".packet")) < 0.6
