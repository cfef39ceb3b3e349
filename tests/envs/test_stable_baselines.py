"""Stable-Baselines3 trains on the native batch."""

import dataclasses
import functools
import pickle
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from stable_baselines3 import DDPG, PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    SubprocVecEnv,
    VecCheckNan,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
)

from hyuav import InputError, Scenario
from hyuav.envs import stable_baselines
from reference import random_actions

NativeVecEnv: Any = stable_baselines.NativeVecEnv

SHORT = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=3)
REACHED = dataclasses.replace(
    Scenario.preset("two_clusters"), helper_starts=((40.0, 40.0),), num_slots=5
)
"""From where jamming pays the more, the nearer the helper flies to the eavesdropper."""


def test_it_flies_as_a_list_of_single_environments_does() -> None:
    native = NativeVecEnv(3, SHORT, diagnostics=True)
    several: Any = DummyVecEnv(
        [lambda: gymnasium.make("hyuav/SecureOffloading-v0", scenario=SHORT, diagnostics=True)] * 3
    )
    first = []
    for env in (native, several):
        env.seed(4)
        first.append(env.reset())
    np.testing.assert_array_equal(first[0], first[1])
    for action in random_actions(2 * SHORT.num_slots + 1, 3):
        own, other = native.step(action), several.step(action)
        for mine, theirs in zip(own[:3], other[:3], strict=True):
            np.testing.assert_array_equal(mine, theirs)
            assert mine.dtype == theirs.dtype
        for mine, theirs in zip(own[3], other[3], strict=True):
            assert_alike(mine, theirs)
        for mine, theirs in zip(native.reset_infos, several.reset_infos, strict=True):
            assert_alike(mine, theirs)


def assert_alike(own: dict[str, Any], other: dict[str, Any]) -> None:
    """Two infos hold the same entries."""
    assert own.keys() == other.keys()
    for name, entry in own.items():
        if isinstance(entry, dict):
            assert_alike(entry, other[name])
        else:
            np.testing.assert_allclose(entry, other[name], rtol=1e-6, err_msg=name)


def test_an_end_is_told_as_stable_baselines_wants_it() -> None:
    env = NativeVecEnv(2, SHORT)
    env.reset()
    for slot in range(1, 7):
        observation, _, done, infos = env.step(np.full((2, 2), 0.5, np.float32))
        ends = slot % 3 == 0
        assert done.tolist() == [info["TimeLimit.truncated"] for info in infos] == [ends] * 2
        assert all(("terminal_observation" in info) is ends for info in infos)
        if ends:
            for row in range(2):
                final = infos[row]["terminal_observation"]
                np.testing.assert_allclose(final[:2], -0.3, atol=1e-6)
                np.testing.assert_allclose(infos[row]["position"], -30.0, atol=1e-4)
                np.testing.assert_allclose(env.reset_infos[row]["position"], -60.0)
            np.testing.assert_allclose(observation[:, :2], -0.6)


@pytest.mark.parametrize(
    ("algorithm", "slots", "options"),
    [
        (PPO, 800, {"n_steps": 50, "batch_size": 50}),
        (DDPG, 600, {"learning_starts": 100, "batch_size": 64, "gamma": 0.9}),
    ],
)
def test_it_learns_within_hundreds_of_slots(
    algorithm: Any, slots: int, options: dict[str, Any]
) -> None:
    small = {"policy_kwargs": {"net_arch": [32]}, "learning_rate": 1e-2, "device": "cpu", "seed": 0}
    model = algorithm("MlpPolicy", NativeVecEnv(4, REACHED, "jamming"), **small, **options)

    def earned() -> float:
        counted: Any = evaluate_policy(model, VecMonitor(NativeVecEnv(4, REACHED, "jamming")), 20)
        return float(counted[0])

    before = earned()
    assert model.learn(slots).num_timesteps == slots
    assert earned() > before + 5.0


def test_its_wrappers_count_and_normalize() -> None:
    env: Any = VecNormalize(VecMonitor(NativeVecEnv(4, SHORT)), gamma=0.95)
    checked: Any = VecCheckNan(VecFrameStack(env, 2), raise_exception=True)
    assert checked.reset().shape == (4, 30)
    episodes = []
    for action in random_actions(9, 4):
        _, _, _, infos = checked.step(action)
        episodes += [info["episode"] for info in infos if "episode" in info]
    assert [episode["l"] for episode in episodes] == [3] * 12
    assert env.obs_rms.mean.shape == (15,)


def test_a_model_goes_on_with_it_after_being_saved(tmp_path: Any) -> None:
    model = PPO("MlpPolicy", NativeVecEnv(2, SHORT), n_steps=6, batch_size=12, device="cpu")
    model.learn(12).save(tmp_path / "model")
    again = PPO.load(tmp_path / "model", NativeVecEnv(2, SHORT), device="cpu")
    again.learn(12, reset_num_timesteps=False)
    assert again.num_timesteps == 24


def test_a_reset_takes_positions() -> None:
    env = NativeVecEnv(2, SHORT)
    env.set_options({"position": (10.0, 20.0)})
    np.testing.assert_allclose(env.reset()[:, :2], [[0.1, 0.2]] * 2)
    np.testing.assert_allclose(env.reset()[:, :2], -0.6)
    env.set_options([{"position": (10.0, 20.0)}, {}])
    with pytest.raises(InputError, match="position ="):
        env.reset()
    env.set_options({"positon": 0})
    with pytest.raises(InputError, match="did you mean 'position'"):
        env.reset()


def test_a_picture_shows_all_rows() -> None:
    env = NativeVecEnv(2, SHORT, render_mode="rgb_array")
    env.reset()
    picture = env.render()
    assert picture is not None
    assert picture.shape == (2 * 520, 760, 3)
    assert NativeVecEnv(2, SHORT).get_images() == [None, None]


def test_attributes_are_those_of_the_batch() -> None:
    env = NativeVecEnv(3, SHORT)
    assert env.get_attr("num_envs", [0, 2]) == [3, 3]
    assert env.has_attr("metadata")
    assert not env.has_attr("ale")
    assert env.env_is_wrapped(gymnasium.wrappers.TimeLimit) == [False] * 3
    assert env.env_method("render") == [None] * 3
    env.set_attr("render_mode", None)
    with pytest.raises(InputError, match="indices = 0: expected all rows"):
        env.set_attr("render_mode", None, 0)


def test_it_can_be_closed_twice_and_copied() -> None:
    env = NativeVecEnv(2, SHORT)
    env.seed(3)
    env.reset()
    action = np.zeros((2, 2), np.float32)
    twin = pickle.loads(pickle.dumps(env))
    np.testing.assert_array_equal(env.step(action)[1], twin.step(action)[1])
    env.close()
    env.close()


@pytest.mark.slow
def test_single_environments_fly_in_processes_of_their_own() -> None:
    one = functools.partial(gymnasium.make, "hyuav:hyuav/SecureOffloading-v0", scenario=SHORT)
    env: Any = SubprocVecEnv([one] * 2)
    env.seed(1)
    assert env.reset().shape == (2, 15)
    assert env.step(np.zeros((2, 2), np.float32))[0].shape == (2, 15)
    env.close()


def test_the_same_seed_trains_the_same_model() -> None:
    weights = []
    for _ in range(2):
        env = NativeVecEnv(2, SHORT)
        model = PPO("MlpPolicy", env, n_steps=6, batch_size=12, seed=3, device="cpu").learn(12)
        weights.append(torch.nn.utils.parameters_to_vector(model.policy.parameters()))
    assert torch.equal(*weights)
