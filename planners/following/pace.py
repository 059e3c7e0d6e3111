"""When what travels arrives: the clock of a plan's waves, which feedback puts ahead or behind so that the packet is where a goal wants it.

The level of a muscle between the fronts of a wave says how strongly the arm bends there, not where: that is a matter of time. The packet
goes as far as the wave that drives it, w(t), the centroid of where its templates act, some time later. With the packet seen at p now,
behind a wave whose clock was ahead by a, a goal for the place g at the time T asks for the clock to be ahead by b in the end,

    p + c [w(T - L + b) - w(t - L + a(t - L))]  =  g,

c the share of the wave's way that the packet goes in that phase as the plan has it, L the time in which the arm answers, and the clock is
brought there evenly over the time that is left. It runs at half to one and a half times its usual rate, so that fronts never go back,
and stays so near the plan's that they are not far from their places.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.rotations import rotation_vector
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.templates import Template

from ..asking.goals.measured import ScalarGoal
from ..asking.goals.recorded import RecordedOutputs
from ..contracts import ClockReading, Floats, Observation, When
from ..solving.plan import Plan
from .channels import Channels

ANSWER = 0.08
"""Time in which the arm answers to its muscles, s."""

RATE = 0.5
"""By how much the clock may run faster or slower, as a share of its usual rate."""

MOST = 0.075
"""How far a wave may be from its planned place by its clock, as a share of the arm."""

FASTEST = 0.9
"""Quantile of a wave's speeds that counts as its greatest."""

SMOOTH = 1 / 16
"""Share of the arm over which the bends that are seen are averaged, against noise."""

CELLS, INSTANTS = 200, 0.005
"""Cells of the arm on which the place of a wave is found, and how often, s."""


SHARES = 0.5, 1.5
"""Range of the share of the wave's way that a packet goes."""


class _Due(NamedTuple):
    """A goal that is due at the time `full`, in a phase that begins at `begin`, s, and the share of the wave's way that the packet goes."""

    begin: float
    full: float
    goal: ScalarGoal
    share: float


@dataclass(frozen=True, slots=True)
class Paced:
    """An activation, and its channels, whose travelling templates are ahead of its clock, linearly between two `readings` of that, s."""

    activation: Activation
    channels: Channels
    readings: tuple[float, float]
    ahead: tuple[float, float]

    def levels(self, times: Floats, edges: Floats) -> Floats:
        """Levels (T, groups, n) at readings `times`, s, in the cells between `edges`, m."""
        if self.ahead == (0.0, 0.0):
            return self.activation.levels(times, edges)
        return replace(self.activation, on_saturation="clip").levels(times, edges, self._at(times))

    def shares(self, times: Floats, edges: Floats) -> Floats:
        """Shares (T, channels, n) in which corrections reach those cells."""
        late = np.asarray(times, dtype=float) + self._at(times)
        here = self.channels.shares(times, edges)
        travels = [channel.template.travels for channel in self.channels.each]
        if any(travels):
            here = np.where(np.array(travels)[:, None], self.channels.shares(late, edges), here)
        return here

    def _at(self, times: Floats) -> Floats:
        """By how much they are ahead at readings `times`."""
        begin, end = self.readings
        share = np.clip((np.asarray(times, dtype=float) - begin) / max(end - begin, 1e-9), 0.0, 1.0)
        return self.ahead[0] + share * (self.ahead[1] - self.ahead[0])


class Pace:
    """Decides how far the clock of what travels is ahead.

    Parameters
    ----------
    plan : Plan

    Attributes
    ----------
    ahead : float, s
        At the end of the present period.
    """

    def __init__(self, plan: Plan) -> None:
        activation = plan.schedule.activation()
        travelling = [template for template in activation.templates if template.travels]
        edges = (*plan.phase_begins.values(), plan.schedule.duration)
        found = [
            (begin, end - goal.hold, goal)
            for phase, (begin, end) in zip(plan.task.phases, pairwise(edges), strict=True)
            for goal in phase.goals
            if travelling and isinstance(goal, ScalarGoal) and goal.timed and goal.when is not When.THROUGHOUT
        ]
        self._arm, self.ahead = plan.arm, 0.0
        self._since, self._shifts = [-np.inf], [0.0]
        self._goals: list[_Due] = []
        if found:
            self._times, self._places = _way(travelling, plan.arm.length, plan.schedule.duration)
            self._most = MOST * plan.arm.length * INSTANTS / np.quantile(np.diff(self._places), FASTEST)
            self._goals = [_Due(begin, full, goal, self._share(plan, begin, full, goal)) for begin, full, goal in found]

    def decide(self, observation: Observation, reading: ClockReading) -> float:
        """How far ahead it is to be at the end of the period that begins with a `reading`, for what the `observation` shows."""
        due = [goal for goal in self._goals if goal.begin <= reading.begin < goal.full - 1e-9]
        if reading.end > reading.begin and due:
            _, full, goal, share = min(due, key=lambda one: one.full)
            seen = float(np.asarray(goal.read(_outputs(observation, self._arm)))[0])
            then = reading.begin - (reading.now - observation.time) - ANSWER
            offset = seen - share * self._place(then + self._shift(then))
            low, high = goal.band
            asked = np.clip(offset + share * self._place(full - ANSWER + self.ahead), low, high)
            wanted = float(np.interp((asked - offset) / share, self._places, self._times)) - (full - ANSWER)
            left, span = max(full - ANSWER - reading.begin, reading.period), reading.end - reading.begin
            step = np.clip((wanted - self.ahead) * span / left, -RATE * span, RATE * span)
            self.ahead = float(np.clip(self.ahead + step, -self._most, self._most))
        self._since.append(reading.end)
        self._shifts.append(self.ahead)
        return self.ahead

    def _share(self, plan: Plan, begin: float, full: float, goal: ScalarGoal) -> float:
        """How far the packet goes from `begin` to `full`, s, as a share of the wave's way, as the plan has it."""
        instants = np.searchsorted(plan.time, [begin, full]).clip(max=len(plan.time) - 1)
        planned = RecordedOutputs(plan.model.recording(plan.time[instants], plan.strains[instants]), None, plan.arm)
        (first, last), way = goal.read(planned), self._place(full) - self._place(begin)
        return float(np.clip((last - first) / max(way, 1e-9), *SHARES))

    def _shift(self, clock: float) -> float:
        return float(np.interp(clock, self._since, self._shifts))

    def _place(self, clock: float) -> float:
        return float(np.interp(clock, self._times, self._places))

    def state(self) -> dict[str, Any]:
        """How far ahead the clock was, and since when."""
        return {"since": list(self._since), "shifts": list(self._shifts)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go to a `state` of a pace of the same plan."""
        self._since, self._shifts = list(state["since"]), list(state["shifts"])
        self.ahead = self._shifts[-1]


def _way(templates: list[Template], length: float, duration: float) -> tuple[Floats, Floats]:
    """Times, s, and where the templates then act on average, m, which never goes back."""
    times, edges = np.arange(0.0, 1.5 * duration, INSTANTS), np.linspace(0.0, length, CELLS + 1)
    shares = sum(template.level * template.place(np, times[:, None], edges[:-1], edges[1:]) for template in templates)
    whole = shares.sum(axis=1)
    on = whole > 1e-3 * whole.max()
    places = shares[on] @ ((edges[1:] + edges[:-1]) / 2) / whole[on]
    return times[on], np.maximum.accumulate(places)


class _Smoothed(RecordedOutputs):
    """One instant with curvatures over `SMOOTH` of the arm, of the frames, whose noise is less than that of the nodes between them."""

    @cached_property
    def curvatures(self) -> tuple[Floats, Floats, Floats]:
        """k1, k2, k3, each (1, n + 1), 1/m."""
        frames, stations = self.recording.frames, self.stations
        turns = rotation_vector(frames[:, 1:] @ np.swapaxes(frames[:, :-1], -1, -2))[0]
        ways = np.vstack([np.zeros(3), np.cumsum(turns, axis=0)])
        middles = (stations[1:] + stations[:-1]) / 2
        ends = [np.clip(middles + sign * SMOOTH * stations[-1] / 2, stations[0], stations[-1]) for sign in (-1, 1)]
        before, after = (np.stack([np.interp(end, stations, way) for way in ways.T]) for end in ends)
        first, second, third = ((after - before) / (ends[1] - ends[0]))[:, None]
        return first, second, third


def _outputs(observation: Observation, arm: Arm) -> RecordedOutputs:
    """What goals read of one instant."""
    seen = Recording(
        time=np.array([observation.time]), points=observation.points[None], frames=observation.frames[None],
        stations=np.asarray(observation.stations), stretch=observation.stretch[None], levels=np.zeros((1, 0, len(observation.stretch))),
    )  # fmt: skip
    return _Smoothed(seen, None, arm)
