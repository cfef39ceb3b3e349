"""How long an episode is through Gymnasium: the scenario's horizon, or ``max_episode_steps``."""

import dataclasses
import json
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

from hyuav import InputError, Scenario
from hyuav.envs.gymnasium import SecureOffloadingGymEnv

Build = Callable[..., Any]

TEN = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=10)


def slots_of(env: Any) -> int:
    """Flown until an episode is truncated."""
    env.reset(seed=0)
    for slot in range(1, 100):
        if np.all(env.step(np.zeros(env.action_space.shape, np.float32))[3]):
            return slot
    raise AssertionError("the episode does not end")


@pytest.mark.parametrize("limit", [None, 3, 10, 20, 35])
@pytest.mark.parametrize("scenario", ["two_clusters", TEN])
def test_an_episode_ends_after_the_limit_and_the_spec_tells_it(
    build: Build, scenario: Scenario | str, limit: int | None
) -> None:
    env = build(scenario=scenario, clock=True, max_episode_steps=limit)
    horizon = limit or (10 if scenario is TEN else 20)
    assert slots_of(env) == env.spec.max_episode_steps == horizon
    np.testing.assert_allclose(env.reset()[0][..., -1], -1.0)
    observation = env.step(np.zeros(env.action_space.shape, np.float32))[0]
    np.testing.assert_allclose(observation[..., -1], 2.0 / horizon - 1.0, rtol=1e-6)


@pytest.mark.parametrize(
    ("mode", "limit"),
    [("sync", None), ("sync", 3), ("sync", 35), ("async", 35), ("vector_entry_point", 35)],
)
def test_the_limit_reaches_every_kind_of_batch(
    make_vec: Build, mode: str, limit: int | None
) -> None:
    given = {} if limit is None else {"max_episode_steps": limit}
    env = make_vec(2, TEN, vectorization_mode=mode, **given)
    assert slots_of(env) == (limit or 10)
    env.close()


@pytest.mark.parametrize("limit", [7, 35])
def test_a_spec_makes_episodes_of_the_same_length_again(build: Build, limit: int) -> None:
    env = build(max_episode_steps=limit)
    remake = gymnasium.make_vec if hasattr(env, "num_envs") else gymnasium.make
    spec = EnvSpec.from_json(json.dumps(json.loads(env.spec.to_json())))
    assert slots_of(remake(spec)) == limit


def test_the_spec_of_a_default_environment_makes_it_again(make: Build) -> None:
    again: Any = gymnasium.make(make(TEN).spec)
    assert slots_of(again) == again.spec.max_episode_steps == 10
    assert slots_of(gymnasium.make(again.spec, max_episode_steps=12)) == 12


def test_without_a_limit_of_gymnasium_s_the_horizon_is_the_scenario_s(make: Build) -> None:
    assert slots_of(make(TEN, max_episode_steps=-1)) == 10


@pytest.mark.parametrize("limit", [0, 2.5, True])
def test_a_limit_that_is_no_number_of_slots_is_refused_in_one_line(
    build: Build, limit: Any
) -> None:
    with pytest.raises(InputError, match=rf"^max_episode_steps = {limit}: expected a whole"):
        build(max_episode_steps=limit)


def test_the_limit_reaches_a_class_of_one_s_own_too() -> None:
    class Own(SecureOffloadingGymEnv):
        def __init__(self, **options: Any) -> None:
            super().__init__("random_disk", **options)

    gymnasium.register("Own-v0", entry_point=Own)
    try:
        assert slots_of(gymnasium.make("Own-v0", max_episode_steps=33)) == 33
    finally:
        del gymnasium.registry["Own-v0"]
    assert slots_of(Own(max_episode_steps=5)) == 5


def test_gymnasium_s_statistics_count_every_slot_of_one_helper(make: Build) -> None:
    env: Any = gymnasium.wrappers.RecordEpisodeStatistics(make(TEN))
    for _ in range(2):
        env.reset()
        rewards: list[float] = []
        info: dict[str, Any] = {}
        while "episode" not in info:
            _, reward, _, _, info = env.step(env.action_space.sample())
            rewards.append(reward)
        assert info["episode"]["l"] == len(rewards) == 10
        assert info["episode"]["r"] == pytest.approx(sum(rewards))


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_gymnasium_s_statistics_count_every_slot_of_a_batch(
    make_vec: Build, mode: AutoresetMode
) -> None:
    wrapper = gymnasium.wrappers.vector.RecordEpisodeStatistics
    env = wrapper(make_vec(3, TEN, autoreset_mode=mode))
    env.reset(seed=0)
    env.step(env.action_space.sample())
    apart = np.array([True, False, True])
    env.reset(options={"reset_mask": apart})
    earned, lengths = np.zeros((33, 3)), []
    for slot in range(33):
        _, earned[slot], _, truncated, info = env.step(env.action_space.sample())
        if truncated.any():
            lengths.extend(info["episode"]["l"][truncated])
            flown = info["episode"]["l"][truncated][0]
            expected = earned[max(slot + 1 - flown, 0) : slot + 1, truncated].sum(0)
            if slot > 10:
                np.testing.assert_allclose(info["episode"]["r"][truncated], expected, rtol=1e-5)
    assert lengths == [10] * 9
