"""What becomes of the crevice's bar in each scenario of the search: as shipped, and searched anew where gap or bar are others.

Run `python benchmarks/crevice.py`, or `python benchmarks/crevice.py examples/crevice.toml --varied nearer radius` for some variations. Each
is planned on the rod; then the plan is carried out from rest in each of the four scenarios, and the table goes to standard output.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

import octoctrl as oc
from octoctrl.carrying.phase_search import Work
from octoctrl.carrying.searching import SEARCHED_ON, scenarios_of
from octoctrl.carrying.trials import plant_for, schedule_of
from octoctrl.carrying.worth import since
from octoctrl.planners.asking.goals.recorded import RecordedOutputs
from octoctrl.planners.asking.goals.touching import hold_in
from octoctrl.planners.solving.grasping import objects_held
from octoctrl.planners.solving.plan import PlanStatus
from octoctrl.planners.solving.scenarios import ERRORS, Scenario
from octoctrl.progress import NullProgress
from octoctrl.sim.contact.surroundings import Touch
from octoctrl.sim.errors import PlantUnstableError

ROOT = Path(__file__).parents[1]

GONE = 0.2
"""Time after it is let go from which on the bar must be held, s."""


def moved(name: str, dx: float = 0.0, dy: float = 0.0) -> Callable[[oc.Scene], oc.Scene]:
    """A scene whose object of this name stands elsewhere, m."""

    def scene(planned: oc.Scene) -> oc.Scene:
        def other(item):
            x, y, z = item.position
            return replace(item, position=(x + dx, y + dy, z)) if item.name == name else item

        return replace(planned, objects=tuple(map(other, planned.objects)))

    return scene


def thick(radius: float) -> Callable[[oc.Scene], oc.Scene]:
    """A scene whose bar is as thick, and as heavy for its volume."""

    def scene(planned: oc.Scene) -> oc.Scene:
        def other(item):
            return replace(item, radius=radius, mass=item.mass * (radius / item.radius) ** 2) if item.name == "bar" else item

        return replace(planned, objects=tuple(map(other, planned.objects)))

    return scene


VARIED: dict[str, Callable[[oc.Scene], oc.Scene]] = {
    "aside (+6, -4) mm": moved("bar", 6e-3, -4e-3),
    "nearer (-5, +5) mm": moved("bar", -5e-3, 5e-3),
    "gap 53.5 mm": moved("post 1", dy=6e-3),
    "gap 44 mm": moved("post 1", dy=-3.5e-3),
    "radius 3.5 mm": thick(3.5e-3),
    "radius 7 mm": thick(7e-3),
}
"""Variations of the scene, by name."""


def became(plan: oc.Plan, scenario: Scenario) -> str:
    """One row: what became of the bar in a scenario."""
    plant = plant_for(SEARCHED_ON, scenario.arm(plan.arm), scenario.scene(plan.scene, objects_held(plan.task)))
    plant.reset()
    schedule = schedule_of(tuple(map(scenario.primitive, plan.schedule.primitives)), plan.schedule.duration)
    try:
        recording = plant.advance(schedule.activation(), plan.schedule.duration)
    except PlantUnstableError as error:
        return f"diverged: {error}"
    (bar,) = (item for item in plan.scene.objects if item.name == "bar")
    after = since(recording, bar.support.since + GONE)
    hold = hold_in(RecordedOutputs(after, None, plan.arm), "bar")
    depth = max(float(Touch.of(recording.series, item.name).deepest.max()) for item in plan.scene.objects)
    covered, turn = np.abs(hold.covered), np.degrees(hold.spun)
    return f"{covered.min():10.2f} {covered[-1]:10.2f} {turn[-1]:10.0f} {1e3 * hold.touch.position[-1, 0]:10.0f} {1e3 * depth:10.3f}"


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", nargs="?", type=Path, default=ROOT / "examples" / "crevice.toml")
    parser.add_argument("--varied", nargs="*", default=[], help="variations by the begin of their names, or 'all'")
    parser.add_argument("--unsearched", action="store_true", help="carry out the numbers of the task file as they are")
    chosen = parser.parse_args()
    configuration = oc.tasks.load(chosen.task)
    if chosen.unsearched:
        configuration = replace(configuration, plan=replace(configuration.plan, time_limit=1e-3))
    names = [name for name in VARIED if any(name.startswith(word) or word == "all" for word in chosen.varied)]
    scenes = {name: VARIED[name](configuration.scene) for name in names} or {"as shipped": configuration.scene}
    for name, scene in scenes.items():
        begin = process_time()
        plan = oc.plan(replace(configuration, scene=scene))
        print(f"{name}: {plan.status.name.lower()}, {process_time() - begin:.0f} s of processor {plan.report.reason}", flush=True)
        if plan.status is PlanStatus.REFUSED:
            continue
        print("  scenario  least C      end C  turn, deg  end x, mm  depth, mm")
        errors = {word: getattr(configuration.plan, f"{word}_error") for word in ERRORS}
        work = Work(plan.arm, scene, None, NullProgress(), 0.0, configuration.plan.seed, errors=errors)
        for number, scenario in enumerate(scenarios_of(plan.task, work)):
            print(f"  {number:8d} {became(plan, scenario)}", flush=True)


if __name__ == "__main__":
    main()
