"""The environments under the names by which Gymnasium makes them; importing this module enters them.

>>> import gymnasium as gym
>>> env = gym.make("octoctrl.connect.gym:octoctrl/Reach-v0")  # doctest: +SKIP
>>> envs = gym.make_vec("octoctrl.connect.gym:octoctrl/Reach-v0", num_envs=8)  # doctest: +SKIP
"""

from functools import partial

from ..extras import extra
from .environments import ENVIRONMENTS
from .vector import ThreadedEnv

gymnasium = extra("gym", "gymnasium")

for _kind in ENVIRONMENTS:
    gymnasium.register(f"octoctrl/{_kind.__name__}-v0", entry_point=_kind, vector_entry_point=partial(ThreadedEnv, _kind))
