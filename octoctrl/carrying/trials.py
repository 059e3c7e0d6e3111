"""Trials: numbers of the drives of a phase, carried out on a plant from where the phase before ended, and what they come to.

A trial is judged in several scenarios, each with a plant and a state of its own, by half the mean of the prices and half the worst of
them; a bad scenario ends it. One that meets all goals may have to meet them also by numbers that are hardly others: what slides or is wound
round by chance does not. Plants are kept by the process or the thread that judges, for a search makes hundreds of trials.
"""

import threading
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any

import numpy as np

from octoctrl.planners.asking.schedule import Schedule
from octoctrl.planners.asking.task import DELAY_BOUNDS, Drive, Phase, Task
from octoctrl.planners.asking.wrapping import TwistCurve, carried_out
from octoctrl.planners.contracts import Floats, Primitive
from octoctrl.planners.solving.cross_entropy import Judgement, Unknowns
from octoctrl.planners.solving.scenarios import Scenario
from octoctrl.sim.body.arm import Arm
from octoctrl.sim.contracts import State
from octoctrl.sim.errors import PlantUnstableError
from octoctrl.sim.plants import Plant, make_plant
from octoctrl.sim.running.clock import SAFETY
from octoctrl.sim.running.recording import Recording
from octoctrl.sim.scene.scene import Scene

from .worth import enough_of, misses, price_of, since

RECORD = 4
"""Samples between recorded instants of a trial: 20 ms."""

QUICK = 0.02
"""Interval between samples of trials that are quick, s: levels change slowly, and the steps in between are as small as ever."""

ROUGH_ELEMENTS, ROUGH_STEP = 24, 1e-3
"""Elements at most, and step, s, where it is stable, of trials that are rough besides: they take less than half of the time. Longer
elements lie on an object more easily: prices are the same within 0.02 in the middle, but too low by 0.2 and more in one of fourteen."""

HOPELESS, LOST = 1.4, 9.0
"""Price of a goal beyond which a trial is not tried in further scenarios, and price of a plant that diverged."""

SPREADS = {"level": 0.15, "start": 0.02, "stop": 0.02, "speed": 0.04, "delay": 0.2, "lasts": 0.1, "rise": 0.3, "fall": 0.3}
"""How far a search looks at first where a primitive has no `spreads` of its own, by the name of the number; of others a quarter of their
range."""

FARTHEST = {"start": 0.8, "stop": 1.0}
"""Share of the arm up to which the ends of a window may be chosen."""

HARDLY = 0.02
"""How far neighbours of a trial lie from it, in first spreads."""

ELSEWHERE = 0.6
"""How far from numbers that led nowhere others must lie, in first spreads, root of the sum of squares."""

_LOCAL = threading.local()


def plant_for(plant: str, arm: Arm, scene: Scene, record_every: int = RECORD, *, quick: bool = False, rough: bool = False) -> Plant:
    """The `plant` of this name for `arm` and `scene` that keeps every so many samples, `record_every`: the same one each time.

    One that is `quick` takes the samples of `QUICK` and keeps each, one that is `rough` has the elements and steps of `ROUGH_ELEMENTS` and
    `ROUGH_STEP` besides. Each thread has its own.
    """
    plants: dict[Any, Plant] = _LOCAL.__dict__.setdefault("plants", {})
    key = plant, arm, scene, record_every, quick, rough
    if key not in plants:
        if len(plants) > 64:  # of searches that are over
            plants.clear()
        if rough:
            arm = replace(arm, elements=min(arm.elements, ROUGH_ELEMENTS))
        if quick or rough:
            plants[key] = moved = make_plant(plant, arm, scene, sample_interval=QUICK, record_every=1)
        else:
            plants[key] = moved = make_plant(plant, arm, scene, record_every=record_every)
        if rough:
            moved.set_steps(ceil(QUICK / max(min(ROUGH_STEP, SAFETY * moved.limit.step), moved.h)))
    return plants[key]


def schedule_of(primitives: tuple[Primitive, ...], duration: float) -> Schedule:
    """A schedule of `primitives` that add up for a `duration`, s, kept below 1: how searched drives combine."""
    return Schedule(primitives=primitives, duration=duration, composition="add", on_saturation="clip")


def at_once(task: Task) -> list[tuple[Phase, ...]]:
    """The phases of a `task`, those that are searched together side by side."""
    found: list[tuple[Phase, ...]] = []
    for number, phase in enumerate(task.phases):
        if number and task.phases[number - 1].with_next:
            found[-1] += (phase,)
        else:
            found.append((phase,))
    return found


@dataclass(frozen=True, slots=True)
class Ended:
    """What became of a run: its recording, misses of the goals in tolerances, and the plant's state."""

    recording: Recording
    misses: tuple[float, ...]
    state: State


@dataclass(frozen=True, slots=True)
class Begun:
    """Where a stage goes on from: the primitives of the phases before, and the state in each scenario; from rest where there is none."""

    settled: tuple[Primitive, ...]
    states: tuple[State | None, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """What is searched at once: a phase, or several that are judged together.

    Attributes
    ----------
    task : Task
    phases : tuple of Phase
    begins : mapping of str to float, s
        Of all phases.
    drives : tuple of Drive
        Those that set in with these phases.
    begun : Begun
    arm : Arm
    scene : Scene
    held : frozenset of str
        Names of the objects that the scenarios move.
    scenarios : tuple of Scenario
    plant : str
    curve : TwistCurve
        Of that plant.
    hopeless : float
        Price beyond which a trial is not tried in further scenarios.
    spread : float
        How far a search looks at first, over the usual.
    quick : bool
        Whether trials are; how they `ended` is told with the usual samples.
    rough : bool
        Whether trials are; they meet a goal only where no tolerance is used up.
    wary : bool
        Whether usual trials do so too, as where nothing but the scenario as planned is tried.
    neighbours : tuple of Begun
        What must meet the goals too: numbers that are hardly others, each after those that were hardly others in the phases before.
    record_every : int
        Of so many samples of a usual trial one is recorded.
    spent : tuple of (n,) float64
        Numbers after which the next phase could not be met: what is not `ELSEWHERE` is not looked for any more.
    """

    task: Task
    phases: tuple[Phase, ...]
    begins: Mapping[str, float]
    drives: tuple[Drive, ...]
    begun: Begun
    arm: Arm
    scene: Scene
    held: frozenset[str]
    scenarios: tuple[Scenario, ...]
    plant: str
    curve: TwistCurve
    hopeless: float = HOPELESS
    spread: float = 1.0
    quick: bool = False
    rough: bool = False
    wary: bool = False
    neighbours: tuple[Begun, ...] = ()
    record_every: int = RECORD
    spent: tuple[Floats, ...] = ()
    names: tuple[tuple[int, str], ...] = field(init=False, default=())

    def __post_init__(self) -> None:
        free = tuple((index, name) for index, drive in enumerate(self.drives) for name in drive.free)
        object.__setattr__(self, "names", free)

    @property
    def unknowns(self) -> Unknowns:
        """What is searched: the free numbers of the drives."""
        rows = []
        for index, name in self.names:
            drive = self.drives[index]
            spreads = SPREADS | getattr(drive.primitive, "spreads", {})
            low, high = (drive.primitive.bounds() | {"delay": DELAY_BOUNDS})[name]
            if name in FARTHEST:
                high = min(high, FARTHEST[name] * self.arm.length)
            rows.append((drive.number(name), self.spread * spreads.get(name, (high - low) / 4), low, high))
        mean, spread, low_, high_ = np.array(rows).T if rows else np.zeros((4, 0))
        labels = tuple(f"{self.drives[index].name}.{name}" for index, name in self.names)
        return Unknowns(names=labels, mean=mean, spread=spread, low=low_, high=high_)

    @property
    def name(self) -> str:
        """Of all its phases."""
        return "' and '".join(phase.name for phase in self.phases)

    @property
    def enough(self) -> float:
        """Price that needs no bettering; where neighbours are looked at, whether the goals are met decides alone."""
        return -np.inf if self.neighbours else enough_of(self.phases)

    @property
    def duration(self) -> float:
        """Of all its phases, s."""
        return sum(phase.duration for phase in self.phases)

    def primitives(self, x: Floats) -> tuple[Primitive, ...]:
        """Those of its drives for numbers `x` (n,); until their phase begins they do nothing, so that the phase before ends as it did."""
        numbers: list[dict[str, float]] = [{} for _ in self.drives]
        for (index, name), value in zip(self.names, x, strict=True):
            numbers[index][name] = float(value)
        return tuple(
            carried_out(drive.at(self.begins, given), self.curve, self.begins[drive.begins])
            for drive, given in zip(self.drives, numbers, strict=True)
        )

    def scene_in(self, scenario: Scenario) -> Scene:
        """The scene of a `scenario`."""
        return scenario.scene(self.scene, set(self.held))

    def run(
        self, x: Floats, number: int, begun: Begun | None = None, *, quick: bool = False, rough: bool = False
    ) -> tuple[Recording, Plant]:
        """What numbers `x` come to in scenario `number`, by a trial that may be `quick` and `rough`, and the plant at its end.

        It goes on from where another has `begun`, if that is given.
        """
        begun = begun or self.begun
        scenario, state = self.scenarios[number], begun.states[number]
        plant = plant_for(self.plant, scenario.arm(self.arm), self.scene_in(scenario), self.record_every, quick=quick, rough=rough)
        plant.reset()
        if state is not None:
            plant.restore(state)
        acting = tuple(scenario.primitive(item) for item in (*begun.settled, *self.primitives(x)))
        activation = schedule_of(acting, self.begins[self.phases[0].name] + self.duration).activation()
        return plant.advance(activation, self.duration), plant

    def parts(self, recording: Recording) -> list[tuple[Phase, Recording]]:
        """Each phase, and what of a `recording` of all is of it."""
        begins = [self.begins[phase.name] for phase in self.phases]
        return [(phase, since(recording, begin).until(begin + phase.duration)) for phase, begin in zip(self.phases, begins, strict=True)]

    def misses(self, recording: Recording) -> tuple[float, ...]:
        """By how many tolerances each goal of the phases is missed on a `recording` of them."""
        return tuple(share for phase, part in self.parts(recording) for share in misses(phase, part, self.arm, self.task))

    def price(self, recording: Recording) -> float:
        """What the goals of the phases cost on a `recording` of them, and what sinks in too deep."""
        return price_of(self.parts(recording), self.arm, self.task)

    def __call__(self, x: Floats, worth: float = np.inf) -> Judgement:
        """Judge numbers `x` (n,) in all scenarios, as long as there is hope that they cost at most what is `worth` knowing.

        The first scenario is always tried; where nothing is worth knowing, it alone. None of the others is taken to be better than the
        best that was seen.
        """
        prices: list[float] = []
        recordings: list[Recording] = []
        for number in range(len(self.scenarios)):
            try:
                recording, _ = self.run(x, number, quick=self.quick, rough=self.rough)
                prices.append(self.price(recording))
                recordings.append(recording)
            except PlantUnstableError:
                prices.append(LOST)
            if prices[-1] > self.hopeless or self.together(prices, min(prices)) > worth:
                break
        tried = len(prices)
        price = self.together(prices, max(prices) + 0.2)
        most = 0.0 if self.rough or self.wary else 1.0  # what is met with nothing to spare may be missed elsewhere
        whole = len(recordings) == len(self.scenarios)
        met = whole and all(max(self.misses(recordings[number]), default=0.0) <= most for number in np.argsort(prices)[::-1])
        met = met and all(np.linalg.norm((x - other) / self.unknowns.spread) > ELSEWHERE for other in self.spent)
        if met and self.neighbours:
            met, again = self._sure(x, prices)
            price, tried = self.together(prices, 0.0), tried + again
        return Judgement(price=price, simulated=tried * self.duration, runs=tried, met=met, notes=tuple(prices))

    def _sure(self, x: Floats, prices: list[float]) -> tuple[bool, int]:
        """Whether neighbours of numbers `x` (n,) meet the goals, and after how many runs that is known.

        The `prices`, by scenario, become the highest that are seen.
        """
        runs = 0
        for numbers, begun in self._lines(x)[1:]:
            for number in range(len(self.scenarios)):
                runs += 1
                try:
                    recording, _ = self.run(numbers, number, begun)
                except PlantUnstableError:
                    prices[number] = LOST
                    return False, runs
                prices[number] = max(prices[number], self.price(recording))
                if max(self.misses(recording), default=0.0) > 1:
                    return False, runs
        return True, runs

    def _lines(self, x: Floats) -> list[tuple[Floats, Begun]]:
        """Numbers `x` (n,) and those of its neighbours, and where each goes on from."""
        draw, unknowns = np.random.default_rng(len(x)), self.unknowns
        hardly = [unknowns.within(x + HARDLY * unknowns.spread * draw.normal(size=len(x))) for _ in self.neighbours]
        return list(zip([x, *hardly], [self.begun, *self.neighbours], strict=True))

    def as_planned(self) -> "Stage":
        """The same without other scenarios than the first, and without neighbours; it is wary."""
        begun = replace(self.begun, states=self.begun.states[:1])
        return replace(self, scenarios=self.scenarios[:1], begun=begun, neighbours=(), wary=True)

    def together(self, prices: list[float], other: float) -> float:
        """Half the mean of the `prices` of all scenarios, and half the worst; of those that were not tried it is the `other`."""
        filled = prices + [other] * (len(self.scenarios) - len(prices))
        return 0.5 * float(np.mean(filled)) + 0.5 * max(filled)

    def ended(self, x: Floats) -> list[Ended]:
        """What numbers `x` come to in every scenario, with states at the end; one that diverges stays where it began."""
        return [self.ended_in(number, x) for number in range(len(self.scenarios))]

    def ended_in(self, number: int, x: Floats, begun: Begun | None = None) -> Ended:
        """What numbers `x` come to in scenario `number`, from where another has `begun` if that is given."""
        begun = begun or self.begun
        try:
            recording, plant = self.run(x, number, begun)
            return Ended(recording, self.misses(recording), plant.state())
        except PlantUnstableError as error:
            goals = sum(len(phase.goals) for phase in self.phases)
            return Ended(error.recording, (np.inf,) * max(goals, 1), begun.states[number] or {})

    def handed_on(self, x: Floats, executor: Executor) -> tuple[list[Ended], list[Begun]]:
        """What numbers `x` come to in every scenario, by the `executor`, and where the next phase goes on after them and each neighbour."""
        lines, numbers = self._lines(x), range(len(self.scenarios))
        running = [[executor.submit(self.ended_in, number, near, begun) for number in numbers] for near, begun in lines]
        ended = [[future.result() for future in row] for row in running]
        found = [
            Begun((*begun.settled, *self.primitives(near)), tuple(item.state or None for item in row))
            for (near, begun), row in zip(lines, ended, strict=True)
        ]
        return ended[0], found

    def run_through(self, primitives: tuple[Primitive, ...]) -> "Stage":
        """All phases of its task at once, from rest, by `primitives` that are settled."""
        return replace(self, phases=self.task.phases, drives=(), begun=from_rest(len(self.scenarios), primitives))


def from_rest(scenarios: int, settled: tuple[Primitive, ...] = ()) -> Begun:
    """Where so many `scenarios` begin, with primitives that are `settled`."""
    return Begun(settled, (None,) * scenarios)
