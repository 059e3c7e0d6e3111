"""Environments for learning: the interface of Gymnasium, the plant's own bits, goals that are measured, and many at once."""

import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import octoctrl.connect.gym
from octoctrl.connect.environments import ENVIRONMENTS, POLE, ArmEnv, Coil, Grasp, Ramp, Reach, Twist
from octoctrl.connect.rendering import ARM, GOAL, SIZE, drawn
from octoctrl.connect.vector import ThreadedEnv
from octoctrl.sim.body.arm import MUSCLE_GROUPS
from octoctrl.sim.errors import OctoctrlError, PlantUnstableError
from octoctrl.sim.plants import make_plant
from octoctrl.sim.topology.meter import Meter
from octoctrl.sim.topology.trace import TopologyConvention

kinds = pytest.mark.parametrize("kind", ENVIRONMENTS, ids=lambda kind: kind.__name__)


def action(**levels):
    found = np.zeros(len(MUSCLE_GROUPS), dtype=np.float32)
    for group, level in levels.items():
        found[MUSCLE_GROUPS.index(group.replace("_", "-"))] = level
    return found


def episode(env, seed, steps=12):
    """What an episode of random actions gives."""
    seen, _ = env.reset(seed=seed)
    found, chance = [(seen, 0.0)], np.random.default_rng(seed)
    for _ in range(steps):
        seen, reward, ended, cut, info = env.step(chance.uniform(0, 1, 11).astype(np.float32))
        assert env.observation_space.contains(seen) and np.isfinite(reward) and not info["unstable"]
        found.append((seen, reward))
        if ended or cut:
            break
    return found


@kinds
def test_the_checker_has_nothing_to_say(kind):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(f"octoctrl/{kind.__name__}-v0", render_mode="rgb_array").unwrapped)


@kinds
def test_same_seed_same_bits_and_another_seed_another_goal(kind):
    one, other, third = (episode(kind(), seed) for seed in (3, 3, 4))
    assert len(one) == len(other) and all(np.array_equal(a[0], b[0]) and a[1] == b[1] for a, b in zip(one, other, strict=True))
    assert not np.array_equal(one[0][0][-kind.goal_size :], third[0][0][-kind.goal_size :])


def test_an_environment_is_the_plant_and_nothing_else():
    env, plant, before = Reach(), make_plant("rod"), np.zeros(11)
    env.reset(seed=1)
    for number in range(4):
        level = np.random.default_rng(number).uniform(0, 1, 11)
        env.step(level)
        recording = plant.advance(Ramp(before, level, plant.time, 0.05), 0.05)
        before = level
    assert env.plant.observe() == plant.observe()
    assert recording.levels[0, :, 0] != pytest.approx(level) and recording.levels[-1, :, 5] == pytest.approx(level, abs=1e-15)


def test_reach_counts_arm_lengths():
    env = Reach()
    _, info = env.reset(options={"goal": (0.0, 1.0, 0.3)})
    assert info["distance"] == pytest.approx(0.3, abs=1e-6)
    _, reward, ended, _, info = env.step(action())
    assert reward == pytest.approx(-0.3, abs=1e-4) and not ended and not info["is_success"]
    env.reset(options={"goal": (0.0, 1.0, 0.049)})
    _, reward, ended, cut, info = env.step(action(TM=0.0))
    assert ended and info["is_success"] and not cut and reward == pytest.approx(1 - 0.049, abs=1e-4)
    env.reset(options={"goal": (0.0, 0.0, 0.9)})
    _, reward, *_ = env.step(action(LM1=0.5))
    assert reward == pytest.approx(-env.distance(env.plant.observe(), 0, 0) - 0.01 * 0.25 / 11)


@pytest.mark.parametrize(("group", "sign"), [("R_OM", -1), ("L_OM", 1)])
def test_twist_is_that_of_the_arm(group, sign):
    env = Twist()
    env.reset(options={"goal": 1.2 * sign})
    distances = [env.step(action(**{group: 0.3}))[4]["distance"] for _ in range(16)]
    assert distances[-1] < 0.3 < 0.8 < distances[0]


def test_writhe_goes_on_where_it_would_jump():
    env, meter = Coil(), Meter(TopologyConvention(pole=POLE))
    env.reset(options={"goal": 5.0})
    for number in range(40):
        level = action(R_OM=0.23 if number < 25 else 0.0, LM1=0.3 * (number > 8), LM2=0.3 * (number > 8), LM8=0.3 * (number > 8))
        seen = env.step(level)[0]
        now = env.plant.observe()
        meter.extend([now.time], now.points[None], now.frames[None])
    assert seen[-2] == pytest.approx(meter.trace.lifted_writhe[-1], abs=0.02) and abs(seen[-2]) > 0.5
    assert seen[-3] == pytest.approx(meter.trace.twist[-1], abs=0.02)


def test_grasp_asks_for_what_lies_on_the_post():
    env = Grasp(horizon=4.0)
    seen, info = env.reset(options={"goal": (0.16, 0.45)})
    assert tuple(seen[-2:]) == pytest.approx((0.16, 0.45)) and info["distance"] > env.WOUND
    wound = []
    for _ in range(60):
        *_, ended, cut, info = env.step(action(LM1=0.3, LM2=0.3, LM8=0.3))
        wound.append(env.wound(env.plant.observe()))
        assert info["distance"] == pytest.approx(max(env.WOUND - wound[-1], 0.0), abs=0.2)
        if ended or cut:
            break
    assert max(wound) > 0.1 and not info["unstable"]
    env.reset(options={"goal": (-0.2, 0.5)})
    assert env.wound(env.plant.observe()) == 0.0


class Fragile(Reach):
    """Comes apart at once."""

    def prepare(self):
        plant = self.plant

        class Broken:
            def __getattr__(self, name):
                return getattr(plant, name)

            def step(self, levels, duration):
                raise PlantUnstableError("stopped", time=0.0, rod="arm", element=0, mechanism="of a test", recording=None)

        if type(plant).__name__ == "Plant":
            self.plant = Broken()


def test_an_arm_that_comes_apart_ends_the_episode():
    env = Fragile()
    env.reset(seed=0)
    _, reward, ended, cut, info = env.step(action())
    assert ended and not cut and info["unstable"] and not info["is_success"] and -12 < reward < -10


def test_the_horizon_cuts_off():
    env = Twist(horizon=0.15)
    env.reset(seed=0)
    assert [env.step(action())[2:4] for _ in range(3)] == [(False, False), (False, False), (False, True)]
    with pytest.raises(OctoctrlError, match=r"horizon=0\.01 s is outside >= 0\.05 s"):
        Twist(horizon=0.01)


# Many at once


@pytest.mark.parametrize("threads", [1, 3])
def test_each_of_many_has_the_bits_that_it_has_alone(threads):
    envs, alone = ThreadedEnv(Reach, 3, threads=threads, horizon=0.2), [Reach(horizon=0.2) for _ in range(3)]
    seen, infos = envs.reset(seed=7)
    assert np.array_equal(seen, np.stack([env.reset(seed=7 + i)[0] for i, env in enumerate(alone)]))
    assert infos["distance"].shape == (3,)
    chance = np.random.default_rng(0)
    for number in range(7):
        actions = chance.uniform(0, 1, (3, 11)).astype(np.float32)
        seen, rewards, ended, cut, infos = envs.step(actions)
        if number == 4:  # after the horizon they begin anew
            expected = [(env.reset()[0], 0.0, False, False) for env in alone]
        else:
            expected = [env.step(one)[:4] for env, one in zip(alone, actions, strict=True)]
        assert np.array_equal(seen, np.stack([item[0] for item in expected])) and list(rewards) == [item[1] for item in expected]
        assert list(cut) == [number == 3] * 3 and not ended.any()
    envs.close()


def test_made_by_name():
    envs = gymnasium.make_vec("octoctrl.connect.gym:octoctrl/Twist-v0", num_envs=2, period=0.1)
    assert isinstance(envs, ThreadedEnv) and envs.envs[0].period == 0.1
    assert envs.observation_space.shape == (2, *envs.single_observation_space.shape)
    envs.close()
    assert {f"octoctrl/{kind.__name__}-v0" for kind in ENVIRONMENTS} <= set(gymnasium.registry)


# Pictures


def test_a_picture_shows_the_arm_and_its_goal():
    env = Reach(render_mode="rgb_array")
    env.reset(options={"goal": (0.5, 0.5, 0.0)})
    picture = env.render()
    assert picture.shape == (SIZE, 2 * SIZE, 3) and picture.dtype == np.uint8
    hue = picture.astype(int)
    brown, blue = hue[..., 0] - hue[..., 2] > 40, hue[..., 2] - hue[..., 0] > 60
    rows, columns = np.nonzero(brown[:, :SIZE])
    assert abs(columns.mean() - SIZE / 2) < 2 and np.ptp(rows) == pytest.approx(SIZE / 2.4, abs=12)
    rows, columns = np.nonzero(blue[:, :SIZE])
    assert columns.mean() == pytest.approx(SIZE / 2 + 0.5 * SIZE / 2.4, abs=2) and rows.mean() == pytest.approx(
        0.75 * SIZE - 0.5 * SIZE / 2.4, abs=2
    )
    assert Reach().render() is None and ARM != GOAL
    assert (drawn(np.full((3, 3), 9.0), np.full(2, 0.01), 0.2) == picture[0, 0]).all(), "nothing is drawn outside"


def test_a_missing_extra_says_its_command():
    program = "import sys; sys.modules['gymnasium'] = None; import octoctrl.connect.gym"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "this needs gymnasium, which is not installed: pip install 'octoctrl[gym]'" in done.stderr
    assert octoctrl.connect.gym and issubclass(Reach, ArmEnv)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda: Reach(render_mode="human"), "unknown render_mode 'human' (rgb_array)"),
        (lambda: Reach().step(np.zeros(3)), "action is [0. 0. 0.]; 11 finite numbers are needed"),
        (
            lambda: Twist().step([np.nan] * 11),
            "action is [nan, nan, nan, nan, nan, nan, nan, nan, nan, nan, nan]; 11 finite numbers are needed",
        ),
        (lambda: Twist().step("left"), "action is left; 11 finite numbers are needed"),
        (lambda: Twist().reset(options={"goal": np.nan}), "goal is nan; 1 finite number is needed"),
        (lambda: ThreadedEnv(Twist, 0), "num_envs=0 is outside >= 1"),
        (lambda: ThreadedEnv(Twist, 1, threads=0), "threads=0 is outside >= 1"),
        (lambda: ThreadedEnv(Twist, 2).step(np.zeros((1, 11))), "actions has 1 entries for 2 environments; one for each is needed"),
        (lambda: ThreadedEnv(Twist, 2).reset(seed=[1, 2, 3]), "seed has 3 entries for 2 environments; one for each is needed"),
    ],
    ids=range(9),
)
def test_what_does_not_fit_is_refused(ask, message):
    with pytest.raises(OctoctrlError) as caught:
        ask()
    assert str(caught.value) == message
