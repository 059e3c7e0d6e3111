"""Many environments at once on threads: an arm's step is compiled and holds no lock of Python, so that they run side by side."""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, ClassVar

import numpy as np

from octoctrl.sim.errors import OctoctrlError, check_count

from ..extras import extra
from .environments import ArmEnv

gymnasium = extra("gym", "gymnasium")
_VectorEnv: Any = gymnasium.vector.VectorEnv


class ThreadedEnv(_VectorEnv):
    """Environments of one kind, each with the bits that it has alone; one that ended begins anew with the next step.

    Parameters
    ----------
    make : class or callable
        Of the environments.
    num_envs : int
    threads : int, optional
        As many as there are cores if omitted; results do not depend on it.
    **options
        For each environment.
    """

    metadata: ClassVar[dict[str, Any]] = {**ArmEnv.metadata, "autoreset_mode": gymnasium.vector.AutoresetMode.NEXT_STEP}

    def __init__(self, make: Any, num_envs: int = 1, *, threads: int | None = None, **options: Any) -> None:
        check_count("num_envs", num_envs)
        if threads is not None:
            check_count("threads", threads)
        self.num_envs, self.envs = num_envs, [make(**options) for _ in range(num_envs)]
        self.render_mode = self.envs[0].render_mode
        self.single_action_space, self.single_observation_space = self.envs[0].action_space, self.envs[0].observation_space
        batch = gymnasium.vector.utils.batch_space
        self.action_space, self.observation_space = (
            batch(self.single_action_space, num_envs),
            batch(self.single_observation_space, num_envs),
        )
        self._pool = ThreadPoolExecutor(threads or os.cpu_count())
        self._ended = np.zeros(num_envs, dtype=bool)

    def reset(self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in each; a single `seed` stands for itself, its successor and so on, and `options` are for all."""
        if seed is None or isinstance(seed, int):
            seed = [None if seed is None else seed + index for index in range(self.num_envs)]
        self._check_each("seed", seed)
        found = list(self._pool.map(lambda env, one: env.reset(seed=one, options=options), self.envs, seed))
        self._ended[:] = False
        return np.stack([seen for seen, _ in found]), self._infos([info for _, info in found])

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Go on by a period in each, towards its row of `actions`."""
        self._check_each("actions", actions)
        found = list(self._pool.map(self._step, range(self.num_envs), actions))
        seen, rewards, ended, cut, infos = zip(*found, strict=True)
        self._ended = np.array(ended) | np.array(cut)
        return np.stack(seen), np.array(rewards), np.array(ended), np.array(cut), self._infos(infos)

    def render(self) -> Any:
        """A picture of each."""
        return tuple(env.render() for env in self.envs)

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads; takes no `kwargs`."""
        self._pool.shutdown()

    def _check_each(self, name: str, values: Any) -> None:
        if len(values) != self.num_envs:
            raise OctoctrlError(f"{name} has {len(values)} entries for {self.num_envs} environments; one for each is needed")

    def _step(self, index: int, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        if self._ended[index]:
            seen, info = self.envs[index].reset()
            return seen, 0.0, False, False, info
        found: tuple[Any, float, bool, bool, dict[str, Any]] = self.envs[index].step(action)
        return found

    def _infos(self, infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for index, info in enumerate(infos):
            found = self._add_info(found, info, index)
        return found
