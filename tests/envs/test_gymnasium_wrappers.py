"""Every wrapper of Gymnasium's around the environment, of one helper and of a batch."""

import dataclasses
import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import wrappers
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode

from hyuav import Scenario

Build = Callable[..., Any]

SHORT = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=3)

FOLDED = Box(-np.inf, np.inf, (3, 5), np.float32)

OF_BOTH: dict[str, dict[str, Any]] = {
    "ClipAction": {},
    "ClipReward": {"min_reward": 0.0, "max_reward": 0.5},
    "DtypeObservation": {"dtype": np.float64},
    "FlattenObservation": {},
    "NormalizeObservation": {},
    "NormalizeReward": {},
    "RecordEpisodeStatistics": {},
    "RescaleAction": {"min_action": np.float32(-20.0), "max_action": np.float32(20.0)},
    "RescaleObservation": {"min_obs": np.float32(0.0), "max_obs": np.float32(1.0)},
    "ReshapeObservation": {"shape": (3, 5)},
    "TransformAction": {"func": lambda action: -action, "action_space": None},
    "TransformReward": {"func": lambda reward: reward / 60.0},
}
OF_ONE: dict[str, dict[str, Any]] = OF_BOTH | {
    "Autoreset": {},
    "DelayObservation": {"delay": 2},
    "DiscretizeAction": {"bins": 3},
    "DiscretizeObservation": {"bins": 2},
    "FrameStackObservation": {"stack_size": 2},
    "MaxAndSkipObservation": {"skip": 2},
    "OrderEnforcing": {},
    "PassiveEnvChecker": {},
    "RepeatAction": {"num_repeats": 2},
    "StickyAction": {"repeat_action_probability": 0.5},
    "TimeAwareObservation": {},
    "TimeLimit": {"max_episode_steps": 2},
    "TransformObservation": {
        "func": lambda observation: observation.reshape(3, 5),
        "observation_space": FOLDED,
    },
}
OF_A_BATCH: dict[str, dict[str, Any]] = OF_BOTH | {
    "DictInfoToList": {},
    "TransformObservation": {
        "func": lambda observation: observation.reshape(-1, 3, 5),
        "single_observation_space": FOLDED,
    },
    "VectorizeTransformAction": {
        "wrapper": wrappers.TransformAction,
        "func": lambda action: -action,
        "action_space": None,
    },
    "VectorizeTransformObservation": {
        "wrapper": wrappers.TransformObservation,
        "func": lambda observation: observation.reshape(3, 5),
        "observation_space": FOLDED,
    },
    "VectorizeTransformReward": {
        "wrapper": wrappers.TransformReward,
        "func": lambda reward: reward / 60.0,
    },
}
WITH_PICTURES: dict[str, dict[str, Any]] = {
    "AddRenderObservation": {},
    "AddWhiteNoise": {"probability_of_noise_per_pixel": 0.1},
    "ObstructView": {"obstructed_pixels_ratio": 0.1, "obstruction_width": 8},
    "RenderCollection": {},
}
CONVERSIONS = {"ArrayConversion", "JaxToNumpy", "JaxToTorch", "NumpyToTorch"}
ELSEWHERE = {"RecordVideo", "HumanRendering"} | CONVERSIONS
OF_PICTURES_OR_DICTIONARIES = {"FilterObservation", "GrayscaleObservation", "ResizeObservation"}
"""Observations are none of both."""


def test_no_wrapper_is_left_out() -> None:
    not_here = ELSEWHERE | OF_PICTURES_OR_DICTIONARIES
    assert set(wrappers.vector.__all__) == OF_A_BATCH.keys() | not_here
    one = {*OF_ONE, *WITH_PICTURES, *not_here, "AtariPreprocessing", "vector"}
    assert set(wrappers.__all__) == one


def fly(env: Any, slots: int) -> None:
    """Fly at random; every observation lies in its space."""
    assert env.reset(seed=0)[0] in env.observation_space
    for _ in range(slots):
        observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
        assert observation in env.observation_space
        assert not np.any(terminated)
        if truncated is True and not isinstance(env, wrappers.Autoreset):
            env.reset()
    env.close()
    env.close()


@pytest.mark.parametrize("name", OF_ONE)
def test_one_helper_flies_under_every_wrapper(make: Build, name: str) -> None:
    fly(getattr(wrappers, name)(make(SHORT), **OF_ONE[name]), 8)


@pytest.mark.parametrize("name", OF_A_BATCH)
def test_a_batch_flies_under_every_wrapper(make_vec: Build, name: str) -> None:
    fly(getattr(wrappers.vector, name)(make_vec(2, SHORT), **OF_A_BATCH[name]), 8)


@pytest.mark.parametrize("name", WITH_PICTURES)
def test_pictures_pass_every_wrapper(make: Build, name: str) -> None:
    env = getattr(wrappers, name)(make(SHORT, render_mode="rgb_array"), **WITH_PICTURES[name])
    fly(env, 4)
    pictures = np.asarray(env.render())
    assert pictures.shape[-3:] == (520, 760, 3)
    assert pictures.dtype == np.uint8


def test_a_list_of_pictures_is_collected(make: Build) -> None:
    env = make(SHORT, render_mode="rgb_array_list")
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    assert np.shape(env.render()) == (2, 520, 760, 3)


def test_the_normalization_of_observations_is_that_of_gymnasium_s_own_batch(
    make: Build, make_vec: Build
) -> None:
    several = gymnasium.vector.SyncVectorEnv([lambda: make(SHORT)] * 3)
    pair: list[Any] = [
        wrappers.vector.NormalizeObservation(env) for env in (make_vec(3, SHORT), several)
    ]
    seen = [[env.reset(seed=[1, 2, 3])[0]] for env in pair]
    for _ in range(10):
        action = pair[0].action_space.sample()
        for own, env in zip(seen, pair, strict=True):
            own.append(env.step(action)[0])
    np.testing.assert_array_equal(seen[0], seen[1])


def test_a_wrapper_that_writes_to_observations_leaves_rows_that_fly_on_alone(
    make_vec: Build,
) -> None:
    env = make_vec(2, SHORT, autoreset_mode=AutoresetMode.DISABLED)
    halved = wrappers.vector.VectorizeTransformObservation(
        env,
        wrapper=wrappers.TransformObservation,
        func=lambda observation: observation / 2,
        observation_space=None,
    )
    before = halved.reset(seed=0)[0].copy()
    after = halved.reset(options={"reset_mask": np.array([True, False])})[0]
    np.testing.assert_array_equal(after[1], before[1])


@pytest.mark.skipif(
    importlib.util.find_spec("array_api_compat") is None, reason="needs array-api-compat"
)
def test_tensors_are_taken_and_given(build: Build) -> None:
    env = build(scenario=SHORT)
    kind = wrappers.vector if hasattr(env, "num_envs") else wrappers
    tensors = kind.NumpyToTorch(env)
    observation = tensors.reset(seed=0)[0]
    flown = tensors.step(torch.zeros(env.action_space.shape))
    assert all(isinstance(own, torch.Tensor) for own in (observation, flown[0], flown[4]["mode"]))


def test_videos_are_recorded(build: Build, tmp_path: Path) -> None:
    pytest.importorskip("moviepy.video.io.ImageSequenceClip", exc_type=ImportError)
    env = build(scenario=SHORT, render_mode="rgb_array")
    kind = wrappers.vector if hasattr(env, "num_envs") else wrappers
    recorded = kind.RecordVideo(env, str(tmp_path / "videos"), episode_trigger=lambda _: True)
    fly(recorded, 8)
    films = sorted((tmp_path / "videos").glob("*.mp4"))
    assert len(films) >= 2
    assert all(film.stat().st_size > 1000 for film in films)
