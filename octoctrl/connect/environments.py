"""Environments for reinforcement learning: an arm as one rod, which is told levels of its muscle groups twenty times a second.

The interface is Gymnasium's; importing this module needs the extra ``gym``. All environments share the arm, the action and the form of the
reward; a task is a class that says what the goal of an episode is, and how far the arm is from it.
"""

from typing import Any, ClassVar

import numpy as np

from octoctrl.sim.body.arm import MUSCLE_GROUPS, Arm
from octoctrl.sim.contact.measures import covered_winding
from octoctrl.sim.contracts import Floats
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError, brief, check_choice, check_number
from octoctrl.sim.plants import make_plant
from octoctrl.sim.running.observation import Observation
from octoctrl.sim.scene.objects import Capsule, RigidObject, frame_of
from octoctrl.sim.scene.scene import Scene
from octoctrl.sim.topology.measures import present_of_frames

from ..extras import extra
from .rendering import drawn

gymnasium = extra("gym", "gymnasium")
_Env: Any = gymnasium.Env

POLE = (1.0, 0.0, 0.0)
"""From which lifted writhe is measured."""

SEEN = 8
"""Nodes that are observed, evenly from base to tip."""

FARTHEST, FASTEST, MOST_TURNS = 4.0, 50.0, 20.0
"""Bounds of what is observed: places in arm lengths, velocities in arm lengths per second, twist and lifted writhe in turns."""


MODES = ("rgb_array",)
"""Ways in which an environment can be shown."""


class Ramp:
    """Levels that go from one action to the next over a period: what moves the plant of an environment.

    Parameters
    ----------
    before, after : (groups,) float64
    begin, period : float, s
    """

    def __init__(self, before: Floats, after: Floats, begin: float, period: float) -> None:
        self._before, self._change, self._begin, self._period = before, after - before, begin, period

    def levels(self, times: Floats, edges: Floats) -> Floats:
        """Levels (T, groups, n) at `times`, the same in all cells between `edges`."""
        share = np.clip((times - self._begin) / self._period, 0.0, 1.0)[:, None]
        return np.repeat((self._before + share * self._change)[:, :, None], len(edges) - 1, axis=2)


class ArmEnv(_Env):
    """What all environments share.

    The action is a level in [0, 1] for each of the 11 muscle groups, towards which the levels go over the coming period. Observed are
    places and velocities of 8 nodes in arm lengths, the last action, twist and lifted writhe in turns, and the goal. The reward is minus
    the distance from the goal, minus 0.01 times the mean squared level, plus 1 where the goal is reached, which ends the episode; minus 10
    if the arm comes apart, which ends it too. At the horizon the episode is cut off.

    Parameters
    ----------
    render_mode : {"rgb_array"}, optional
    period : float, s
        Between actions.
    horizon : float, s
    arm : Arm, optional
        The octopus arm if omitted.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(MODES), "render_fps": 20}
    goal_size: ClassVar[int] = 1
    tolerance: ClassVar[float]
    """Distance at which the goal counts as reached."""

    def __init__(self, render_mode: str | None = None, *, period: float = 0.05, horizon: float = 2.0, arm: Arm | None = None) -> None:
        if render_mode is not None:
            check_choice("render_mode", render_mode, MODES)
        check_number("period", period, above=0.0, unit="s")
        check_number("horizon", horizon, at_least=period, unit="s")
        self.render_mode, self.period, self.horizon, self.arm = render_mode, period, horizon, arm or Arm.octopus()
        self.plant = make_plant("rod", self.arm, self.scene())
        self._seen = np.linspace(0, self.plant.elements, SEEN + 1).round().astype(int)[1:]
        groups = len(MUSCLE_GROUPS)
        high = np.concatenate(
            [np.full(3 * SEEN, FARTHEST), np.full(3 * SEEN, FASTEST), np.ones(groups), np.full(2, MOST_TURNS), self.goal_bound()]
        )
        low = np.concatenate([-high[: 6 * SEEN], np.zeros(groups), -high[6 * SEEN + groups :]])
        self.action_space = gymnasium.spaces.Box(0.0, 1.0, (groups,), np.float32)
        self.observation_space = gymnasium.spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)
        self._low, self._high = self.observation_space.low, self.observation_space.high
        self.goal, self._action, self._writhe = np.zeros(self.goal_size), np.zeros(groups), 0.0

    def scene(self) -> Scene:
        """What is around the arm in the coming episode."""
        return Scene()

    def goal_bound(self) -> Floats:
        """Largest size of each of the goal's numbers."""
        return np.full(self.goal_size, 10.0)

    def new_goal(self) -> Floats:
        """The goal of an episode, drawn with ``self.np_random``."""
        raise NotImplementedError

    def distance(self, seen: Observation, twist: float, writhe: float) -> float:
        """How far the arm is from the goal, as it is `seen`, with its `twist` and lifted `writhe` in turns."""
        raise NotImplementedError

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode: the arm at rest, and a new goal, drawn from `seed` if there is one; `options` may hold a ``goal``."""
        super().reset(seed=seed)
        self.goal = _numbers("goal", (options or {}).get("goal", self.new_goal()), self.goal_size)
        self.prepare()
        self._action, self._writhe = np.zeros(len(MUSCLE_GROUPS)), 0.0
        found, distance = self._look(self.plant.reset())
        return found, {"distance": distance, "is_success": False, "unstable": False}

    def prepare(self) -> None:
        """Make the scene of the episode, where it is another each time."""

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Go on by a period, towards the levels `action`."""
        level = np.clip(_numbers("action", action, len(MUSCLE_GROUPS)), 0.0, 1.0)
        unstable = False
        try:
            seen = self.plant.step(Ramp(self._action, level, self.plant.time, self.period), self.period)
        except PlantUnstableError:
            unstable, seen = True, self.plant.observe()
        self._action = level
        found, distance = self._look(seen)
        reached = not unstable and distance <= self.tolerance
        reward = -distance - 0.01 * float(np.mean(level**2)) + 1.0 * reached - 10.0 * unstable
        cut = not (reached or unstable) and self.plant.time >= self.horizon - 1e-9
        return found, reward, reached or unstable, cut, {"distance": distance, "is_success": reached, "unstable": unstable}

    def render(self) -> Any:
        """A picture (256, 512, 3) of the arm from the side and from the front; nothing without a render mode."""
        return None if self.render_mode is None else drawn(self.plant.observe().points, self._radii(), self.arm.length, self.shown())

    def shown(self) -> list[tuple[Floats, float]]:
        """Balls of places (3,), m, and radius, m, that belong into the picture."""
        return []

    def _look(self, seen: Observation) -> tuple[Any, float]:
        """What is observed, and the distance from the goal."""
        twist, writhe = present_of_frames(seen.frames, POLE)
        # Writhe is known modulo 2; from one look to the next it changes by less than 1.
        self._writhe = writhe = writhe - 2 * round((writhe - self._writhe) / 2)
        length = self.arm.length
        parts = (
            seen.points[self._seen].ravel() / length,
            seen.velocities[self._seen].ravel() / length,
            self._action,
            (twist, writhe),
            self.goal,
        )
        return np.clip(np.concatenate(parts).astype(np.float32), self._low, self._high), float(self.distance(seen, twist, writhe))

    def _radii(self) -> Floats:
        edges = self.plant.edges
        radii: Floats = np.asarray(self.arm.section((edges[1:] + edges[:-1]) / 2).outer_radius)
        return radii


def _numbers(name: str, values: Any, count: int) -> Floats:
    """Finite numbers (count,).

    Raises
    ------
    OctoctrlError
        If they are something else.
    """
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        found = np.full(0, np.nan)
    if found.size != count or not np.isfinite(found).all():
        raise OctoctrlError(f"{name} is {brief(values)}; {count} finite number{'s are' if count > 1 else ' is'} needed")
    return found.reshape(count)


class Reach(ArmEnv):
    """Bring the tip to a point (3,), in arm lengths from the base; the distance is in arm lengths."""

    goal_size: ClassVar[int] = 3
    tolerance: ClassVar[float] = 0.05

    def new_goal(self) -> Floats:
        """A point that the tip can come to: within a cone, at half to 85 % of the arm's length."""
        around, aside, far = self.np_random.uniform(0.0, 2 * np.pi), self.np_random.uniform(0.2, 1.2), self.np_random.uniform(0.5, 0.85)
        return far * np.array([np.sin(aside) * np.cos(around), np.cos(aside), np.sin(aside) * np.sin(around)])

    def distance(self, seen: Observation, twist: float, writhe: float) -> float:
        """Of the tip as it is `seen`, arm lengths, whatever `twist` and `writhe`."""
        return float(np.linalg.norm(seen.points[-1] / self.arm.length - self.goal))

    def shown(self) -> list[tuple[Floats, float]]:
        """The point."""
        return [(self.goal * self.arm.length, self.tolerance * self.arm.length)]


class Twist(ArmEnv):
    """Twist the arm by so many turns."""

    tolerance: ClassVar[float] = 0.05

    def new_goal(self) -> Floats:
        """Between half a turn and a turn and a half, of either hand."""
        return np.array([self.np_random.choice((-1.0, 1.0)) * self.np_random.uniform(0.5, 1.5)])

    def distance(self, seen: Observation, twist: float, writhe: float) -> float:
        """Of the `twist` from the goal, turns; the rest that is `seen`, and `writhe`, do not count."""
        return float(abs(twist - self.goal[0]))


class Coil(ArmEnv):
    """Coil the arm to so much lifted writhe, in turns."""

    tolerance: ClassVar[float] = 0.1

    def new_goal(self) -> Floats:
        """Between one and two turns, of either hand."""
        return np.array([self.np_random.choice((-1.0, 1.0)) * self.np_random.uniform(1.0, 2.0)])

    def distance(self, seen: Observation, twist: float, writhe: float) -> float:
        """Of the `writhe` from the goal, turns; the rest that is `seen`, and `twist`, do not count."""
        return float(abs(writhe - self.goal[0]))


class Grasp(ArmEnv):
    """Wind the arm round a post and lie on it: three quarters of a turn of those elements that touch; the goal is where the post stands."""

    goal_size: ClassVar[int] = 2
    tolerance: ClassVar[float] = 0.0
    WOUND = 0.75
    RADIUS, HIGH = 0.008, 0.2

    def new_goal(self) -> Floats:
        """Beside the arm, at 30 to 60 % of its length: x and y in arm lengths."""
        return np.array([self.np_random.choice((-1.0, 1.0)) * self.np_random.uniform(0.15, 0.25), self.np_random.uniform(0.3, 0.6)])

    def prepare(self) -> None:
        """Put the post where it is to stand."""
        self.plant = make_plant("rod", self.arm, Scene(objects=(self.post(),)))

    def post(self) -> RigidObject:
        """The post of this episode, along z."""
        x, y = self.goal * self.arm.length
        return Capsule(name="post", radius=self.RADIUS, length=self.HIGH, position=(float(x), float(y), 0.0), axis=(0.0, 0.0, 1.0))

    def wound(self, seen: Observation) -> float:
        """Turns of the elements that lie on the post, as `seen`."""
        post = self.post()
        place, frame = np.array([post.position]), frame_of(post)[None]
        return float(abs(covered_winding(seen.points[None], self._radii(), post, place, frame)[0]))

    def distance(self, seen: Observation, twist: float, writhe: float) -> float:
        """Turns that are missing as `seen`, and a tenth of the way to the post while nothing touches; not of `twist` and `writhe`."""
        missing = max(self.WOUND - self.wound(seen), 0.0)
        near = np.linalg.norm(seen.points[:, :2] - np.array(self.post().position[:2]), axis=1).min() / self.arm.length
        return missing + 0.1 * float(near) * (missing == self.WOUND)

    def shown(self) -> list[tuple[Floats, float]]:
        """The post, as balls along it."""
        return [(np.array([*self.post().position[:2], z]), self.RADIUS) for z in np.linspace(-self.HIGH / 2, self.HIGH / 2, 40)]


ENVIRONMENTS = (Reach, Twist, Coil, Grasp)
"""All of them; each is registered by the name of its class."""
