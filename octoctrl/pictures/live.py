"""The arm while it moves, in a browser: paced, paused, stepped; objects that one can move, goals that one can change, and a new plan.

The loop of a run hands over each period (`View.see`) and is held there to the chosen pace; a thread of its own draws, so that drawing never
delays the plant. The server is viser's, on this machine alone unless another host is given.
"""

import io
import threading
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import replace
from functools import partial
from time import monotonic, sleep
from typing import Any

import numpy as np

from octoctrl.planners.asking.goals.measured import ScalarGoal
from octoctrl.planners.asking.task import Task
from octoctrl.planners.solving.plan import Plan
from octoctrl.sim.contact.columns import Body
from octoctrl.sim.errors import OctoctrlError, check_number
from octoctrl.sim.scene.objects import frame_of

from ..extras import extra
from ..judging.comparison import planned_points
from .motion import Floats, outer_radius
from .solids import mesh, tube_triangles

SIDES, PER_SECOND = 20, 30
"""Corners of a section, and pictures per second at most."""
SLOWEST, FASTEST = 0.05, 8.0
SKIN, STRIPE, GHOST, SOLID = (120, 165, 205), (214, 94, 0), (20, 20, 20), (110, 125, 145)


class View:
    """A live view, to be handed to `octoctrl.execute` as ``watch``.

    Parameters
    ----------
    port : int
        Where the page is served; 0 takes a free one.
    host : str
    speed : float
        Of the arm over real time, at first.

    Attributes
    ----------
    url : str
        What to open in a browser.
    server : viser.ViserServer
        To add what you like.

    Raises
    ------
    OctoctrlError
        If viser is not installed, or an argument is out of range.
    """

    def __init__(self, *, port: int = 8080, host: str = "127.0.0.1", speed: float = 1.0) -> None:
        check_number("speed", speed, at_least=SLOWEST, at_most=FASTEST)
        viser = extra("viewer", "viser")
        with redirect_stdout(io.StringIO()):  # it greets on standard output, which is for results
            self.server = viser.ViserServer(host=host, port=port, label="octoctrl", verbose=False)
        self.url = f"http://{host}:{self.server.get_port()}"
        self.replanned: Plan | None = None
        self._goals: list[tuple[str, int, Any]] = []
        self._plan: Plan | None = None
        self._latest: tuple[Any, float, Any] | None = None
        self.objects: dict[str, Any] = {}
        self._before, self._steps, self._closed = 0.0, 0, False
        self._moved: dict[int, Floats] = {}
        self._lock, self._news = threading.Lock(), threading.Event()
        self._build(speed)
        self._thread = threading.Thread(target=self._draw_on, daemon=True)
        self._thread.start()

    # What the page holds

    def _build(self, speed: float) -> None:
        gui, scene = self.server.gui, self.server.scene
        scene.set_up_direction("+y")
        self.speed = gui.add_slider("speed", SLOWEST, FASTEST, 0.05, speed)
        self.paused = gui.add_checkbox("pause", False)
        self.step = gui.add_button("one period")
        self.step.on_click(self._step)
        self.said = gui.add_markdown("waiting for a run")
        self.replan = gui.add_button("plan again", disabled=True)
        self.replan.on_click(self._asked)

    def _step(self, _: Any = None) -> None:
        self._steps += 1

    def _asked(self, _: Any) -> None:
        self.plan_again()

    def _drag(self, number: int, held: Any, _: Any) -> None:
        self._moved[number] = np.array(held.position)

    def begin(self, plan: Plan, plant: Any) -> None:
        """Show the arm of a `plant` that is about to carry out a `plan`."""
        scene, gui = self.server.scene, self.server.gui
        self._plan, self._plant, self._clock = plan, plant, 0.0
        camera, length = self.server.initial_camera, plan.arm.length
        camera.look_at, camera.position = (0.0, 0.4 * length, 0.0), (0.5 * length, 0.7 * length, 1.1 * length)
        camera.up = (0.0, 1.0, 0.0)
        self._before, self.replanned, self.replan.disabled = monotonic(), None, False
        points, faces = self._tube(plant.observe())
        self.arm = scene.add_mesh_simple("/arm", points, faces, color=SKIN, side="double")
        stripe, ribbon = self._stripe(plant.observe())
        self.line = scene.add_mesh_simple("/stripe", stripe, ribbon, color=STRIPE, side="double")
        self.ghost = None
        planned = planned_points(plan, np.zeros(1))
        if planned is not None:
            self.ghost = scene.add_line_segments("/planned", _pairs(planned[0]), GHOST, thickness=8e-4)
        self.objects, self._moved = {}, {}
        for number, item in enumerate(plan.scene.objects):
            vertices, _, triangles = mesh(item, plan.arm.length)
            held = scene.add_transform_controls(
                f"/objects/{number}", scale=0.03, disable_rotations=True, position=item.position, wxyz=_quaternion(frame_of(item))
            )
            scene.add_mesh_simple(f"/objects/{number}/{item.name}", vertices, triangles, color=SOLID, opacity=0.5, side="double")
            held.on_update(partial(self._drag, number, held))
            self.objects[item.name] = held
        for _, _, slider in self._goals:
            slider.remove()
        self._goals = []
        for phase in plan.task.phases:
            for index, goal in enumerate(phase.goals):
                if isinstance(goal, ScalarGoal) and goal.value is not None:
                    value = float(goal.value)  # of a plan, whose task is of its arm: lengths are metres
                    wide = max(1.0, abs(value))
                    label = f"{phase.name}: {goal.quantity} [{goal.unit}]"
                    slider = gui.add_slider(label, value - wide, value + wide, 0.05, value)
                    self._goals.append((phase.name, index, slider))

    # What a run tells

    def see(self, plant: Any, clock: float) -> None:
        """Take over the state of a `plant` at the plan's `clock` (s), and wait until it is time to go on.

        Raises
        ------
        KeyboardInterrupt
            If a new plan is there, which ends the run that goes on.
        """
        self._push_objects(plant)
        observation, bodies = plant.observe(), plant.state().get("bodies") if self.objects else None
        with self._lock:
            self._latest = (observation, clock, bodies)
        self._news.set()
        due = self._before + (clock - self._clock) / self.speed.value
        self._clock = clock
        while not self._closed and self.replanned is None:
            if self.paused.value:
                if self._steps:
                    self._steps -= 1
                    break
                sleep(0.02)
                due = 0.0
            elif (left := due - monotonic()) > 0:
                sleep(min(left, 0.02))
            else:
                break
        self._before = monotonic()
        if self.replanned is not None:
            raise KeyboardInterrupt

    def _push_objects(self, plant: Any) -> None:
        """Objects that were moved by hand since the last period stand there from now on."""
        moved, self._moved = self._moved, {}
        if not moved:
            return
        state = dict(plant.state())
        if "bodies" not in state:
            return
        for number, place in moved.items():
            state["bodies"][number, Body.POSITION : Body.POSITION + 3] = place
            state["bodies"][number, Body.HOME : Body.HOME + 3] = place
        plant.restore(state)

    def plan_again(self, then: Callable[[Plan], None] | None = None) -> threading.Thread:
        """Plan for the goals as they stand on the page, in a thread; a run that goes on ends when the plan is there.

        Parameters
        ----------
        then : callable, optional
            Called with the plan, solved or not.

        Returns
        -------
        threading.Thread
        """
        plan = self._plan
        if plan is None:
            raise OctoctrlError("nothing is shown yet; plan again when a run has begun")
        self.replan.disabled = True
        self.said.content = "planning ..."
        thread = threading.Thread(target=self._work, args=(plan, then), daemon=True)
        thread.start()
        return thread

    def _work(self, plan: Plan, then: Callable[[Plan], None] | None) -> None:
        from ..carrying.planning import plan as make

        try:
            found = make(self.task(plan.task), arm=plan.arm, scene=plan.scene, plant=plan.plant, model=plan.identified, guess=plan)
            self.said.content = found.status.value
            if found.status.solved:
                self.replanned = replace(found, feedback=plan.feedback, period=plan.period)
            if then is not None:
                then(found)
        except OctoctrlError as error:
            self.said.content = str(error)
        finally:
            self.replan.disabled = False

    def task(self, task: Task) -> Task:
        """The `task` with the goals as they stand on the page."""
        phases = {phase.name: phase for phase in task.phases}
        for name, index, slider in self._goals:
            goals = list(phases[name].goals)
            goals[index] = replace(goals[index], value=float(slider.value))  # type: ignore[type-var]
            phases[name] = replace(phases[name], goals=tuple(goals))
        return replace(task, phases=tuple(phases.values()))

    def next_plan(self) -> Plan | None:
        """Wait until there is a new plan, which is returned, or the view is closed or interrupted; None then."""
        try:
            while not self._closed and self.replanned is None:
                sleep(0.05)
        except KeyboardInterrupt:
            return None
        return self.replanned

    def close(self) -> None:
        """Let go of the run and stop the server."""
        self._closed = True
        self._news.set()
        self._thread.join(timeout=2.0)
        with redirect_stdout(io.StringIO()):
            self.server.stop()

    # Drawing

    def _draw_on(self) -> None:
        while not self._closed:
            self._news.wait()
            self._news.clear()
            with self._lock:
                latest, self._latest = self._latest, None
            if latest is not None:
                self.draw(*latest)
                sleep(1 / PER_SECOND)

    def draw(self, observation: Any, clock: float, bodies: Floats | None = None) -> None:
        """Show an `observation` at the plan's `clock` (s), and objects where the rows of their `bodies` say."""
        assert self._plan is not None
        planned = None if self.ghost is None else planned_points(self._plan, np.array([min(clock, self._plan.time[-1])]))
        with self.server.atomic():
            tube: Any = self._tube(observation)[0]
            stripe: Any = self._stripe(observation)[0]
            self.arm.vertices, self.line.vertices = tube, stripe
            if self.ghost is not None and planned is not None:
                self.ghost.points = _pairs(planned[0])
            for held, row in zip(self.objects.values(), () if bodies is None else bodies, strict=False):
                place, frame = row[Body.POSITION : Body.POSITION + 3], row[Body.FRAME : Body.FRAME + 9].reshape(3, 3)
                if np.abs(held.position - place).max() > 1e-6:
                    held.position, held.wxyz = place, _quaternion(frame)
        self.said.content = f"t = {observation.time:.2f} s, {self._phase(clock)}"

    def _phase(self, clock: float) -> str:
        assert self._plan is not None
        begun = [name for name, begin in self._plan.phase_begins.items() if begin <= clock + 1e-9]
        return f"phase {begun[-1]}" if begun else ""

    def _sections(self, observation: Any) -> tuple[Floats, Floats, Floats]:
        """Points (n + 1, 3), directors (n + 1, 2, 3) across the arm and radii (n + 1,) at the nodes."""
        points, frames = observation.points, observation.frames
        across = np.concatenate([frames[:1, :2], (frames[1:-2, :2] + frames[2:-1, :2]) / 2, frames[-1:, :2]])
        across = across / np.linalg.norm(across, axis=2, keepdims=True)
        assert self._plan is not None
        arm = self._plan.arm
        return points, across, outer_radius(arm, np.linspace(0.0, arm.length, len(points)) if len(points) != len(arm.edges) else arm.edges)

    def _tube(self, observation: Any) -> tuple[Floats, Any]:
        points, across, radius = self._sections(observation)
        angle = 2 * np.pi * np.arange(SIDES) / SIDES
        ring = np.cos(angle)[:, None] * across[:, None, 0] + np.sin(angle)[:, None] * across[:, None, 1]
        vertices = (points[:, None] + radius[:, None, None] * ring).reshape(-1, 3)
        return vertices.astype(np.float32), tube_triangles(len(points), SIDES)

    def _stripe(self, observation: Any) -> tuple[Floats, Any]:
        """A ribbon just above the skin along LM3, which shows the twist."""
        points, across, radius = self._sections(observation)
        middle, aside = points + 1.02 * radius[:, None] * across[:, 0], 0.16 * radius[:, None] * across[:, 1]
        vertices = np.stack([middle - aside, middle + aside], axis=1).reshape(-1, 3)
        low = 2 * np.arange(len(points) - 1)[:, None]
        return vertices.astype(np.float32), np.concatenate([low + np.array([0, 1, 2]), low + np.array([1, 3, 2])])


def _pairs(points: Floats) -> Any:
    """Line segments (n, 2, 3) of a line (n + 1, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)


def _quaternion(frame: Floats) -> Floats:
    """Directors (3, 3), rows, as w, x, y, z."""
    from scipy.spatial.transform import Rotation

    return np.roll(Rotation.from_matrix(frame.T).as_quat(), 1)
