"""The Gymnasium environment of a batch of helpers: rows, their resets and their pictures."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from hyuav import InputError, Scenario, make_env
from reference import place, random_actions, torchrl_flight

Build = Callable[..., Any]

SCENARIO = Scenario.preset("two_clusters")
SHORT = dataclasses.replace(SCENARIO, num_slots=3)


@pytest.mark.parametrize("num_envs", [0, True, 1.5])
def test_a_batch_of_no_helpers_is_refused(make_vec: Build, num_envs: Any) -> None:
    with pytest.raises(InputError, match="num_envs"):
        make_vec(num_envs)


@pytest.mark.parametrize("num_envs", [np.int64(2), np.uint8(2)])
def test_any_whole_number_of_helpers_is_accepted(make_vec: Build, num_envs: Any) -> None:
    env = make_vec(num_envs)
    assert (type(env.num_envs), env.reset(seed=0)[0].shape) == (int, (2, 15))


@pytest.mark.parametrize("mode", ["same", 3, None])
def test_an_unknown_autoreset_mode_is_refused_in_one_line(make_vec: Build, mode: Any) -> None:
    with pytest.raises(InputError, match=r"autoreset_mode = .*NextStep, SameStep, Disabled"):
        make_vec(autoreset_mode=mode)


BAD_VECTOR_RESETS: list[tuple[dict[str, Any], str]] = [
    ({"seed": [1, 2]}, r"seed = \[1, 2\]: expected one number, or one for each of 3 rows"),
    ({"seed": [1, 2, -3]}, "seed = -3"),
    ({"seed": [1, 2, "a"]}, "seed = 'a'"),
    ({"options": {"position": [(0.0, 0.0)] * 2}}, "position ="),
    ({"options": {"reset_mask": np.array([True])}}, "reset_mask ="),
    ({"options": {"reset_mask": np.array([1, 0, 0])}}, "reset_mask ="),
    ({"options": {"reset_mask": np.zeros(3, bool)}}, "reset_mask ="),
]


@pytest.mark.parametrize(("arguments", "message"), BAD_VECTOR_RESETS)
def test_a_bad_reset_of_rows_is_refused_in_one_line(
    make_vec: Build, arguments: dict[str, Any], message: str
) -> None:
    env = make_vec().unwrapped
    env.reset(seed=0)
    with pytest.raises(InputError, match=message) as refusal:
        env.reset(**arguments)
    assert "\n" not in str(refusal.value)


def test_a_batch_flies_as_the_torchrl_environment_of_that_batch_size(make_vec: Build) -> None:
    actions = random_actions(SCENARIO.num_slots, 3)
    env = make_vec(clock=True)
    env.reset(seed=7)
    expected = torchrl_flight(make_env(SCENARIO, "hybrid", 3, seed=7, clock=True), actions)
    for action, slot in zip(actions, expected, strict=True):
        observation, reward, terminated, truncated, info = env.step(action)
        np.testing.assert_array_equal(observation, slot["observation"])
        np.testing.assert_array_equal(reward, slot["reward"].squeeze(-1))
        np.testing.assert_array_equal(truncated, slot["truncated"].squeeze(-1))
        assert not terminated.any()
        np.testing.assert_array_equal(info["position"], place(slot))
        np.testing.assert_array_equal(info["mode"], slot["mode"].squeeze(-1))
        np.testing.assert_array_equal(info["off_map"], slot["off_map"].squeeze(-1))
    assert truncated.all()


def assert_alike(own: dict[str, Any], other: dict[str, Any]) -> None:
    """Two infos of vector environments hold the same entries and masks."""
    assert own.keys() == other.keys()
    for name, entry in own.items():
        if isinstance(entry, dict):
            assert_alike(entry, other[name])
        else:
            np.testing.assert_allclose(entry, np.stack(other[name]), rtol=1e-6, err_msg=name)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_rows_with_seeds_of_their_own_fly_as_gymnasium_s_vector_environment_does(
    make: Build, make_vec: Build, mode: AutoresetMode
) -> None:
    chosen = {"diagnostics": True, "fading": True, "clock": True}
    env = make_vec(3, SHORT, autoreset_mode=mode, **chosen)
    several = SyncVectorEnv([lambda: make(SHORT, **chosen)] * 3, autoreset_mode=mode)
    assert env.metadata["autoreset_mode"] is mode
    (first, info), (other, other_info) = (each.reset(seed=[5, 9, 5]) for each in (env, several))
    np.testing.assert_array_equal(first, other)
    assert_alike(info, other_info)
    for action in random_actions(3 * SHORT.num_slots, 3):
        own, theirs = env.step(action), several.step(action)
        for mine, their in zip(own[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(mine, their)
        assert_alike(own[4], theirs[4])
        if mode is AutoresetMode.DISABLED and own[3].all():
            for each in (env, several):  # Gymnasium's takes the mask out of the options
                each.reset(options={"reset_mask": np.ones(3, bool)})


def test_a_row_s_spaces_are_those_of_one_helper(make: Build, make_vec: Build) -> None:
    env, vector = make(clock=True), make_vec(clock=True)
    assert vector.single_observation_space == env.observation_space
    assert vector.single_action_space == env.action_space
    assert vector.observation_space.shape == (3, *env.observation_space.shape)
    assert vector.reset(seed=0)[0] in vector.observation_space
    assert vector.step(vector.action_space.sample())[0] in vector.observation_space


def test_a_row_earns_what_one_helper_earns_on_average(make: Build, make_vec: Build) -> None:
    hovering, long = {"position": (80.0, 80.0)}, dataclasses.replace(SCENARIO, num_slots=500)
    rows, env = make_vec(2000, scheme="jamming"), make(long, scheme="jamming")
    rows.reset(seed=0, options=hovering)
    batch = rows.step(np.zeros((2000, 2), np.float32))[1]
    env.reset(seed=1, options=hovering)
    single = np.array([env.step(np.zeros(2, np.float32))[1] for _ in range(500)])
    error = np.hypot(batch.std() / np.sqrt(batch.size), single.std() / np.sqrt(single.size))
    assert abs(batch.mean() - single.mean()) < 4.0 * error
    assert np.unique(batch).size > 1900


def test_a_row_that_has_flown_its_slots_starts_anew_in_the_same_step(make_vec: Build) -> None:
    env = make_vec(2, SHORT, autoreset_mode="SameStep")
    env.reset(seed=0)
    for slot in range(2 * SHORT.num_slots):
        observation, _, _, truncated, info = env.step(np.full((2, 2), 0.5, np.float32))
        ends = slot % SHORT.num_slots == SHORT.num_slots - 1
        flown = 10.0 * (slot % SHORT.num_slots + 1)
        assert truncated.tolist() == [ends] * 2
        assert ("final_obs" in info) is ends
        last = info["final_info"] if ends else info
        np.testing.assert_allclose(last["position"], -60.0 + flown)
        if ends:
            np.testing.assert_allclose(info["final_obs"][:, :2], (-60.0 + flown) / 100.0)
            np.testing.assert_allclose(observation[:, :2], -0.6)
            np.testing.assert_allclose(info["position"], -60.0)


def flown_apart(make_vec: Build, mode: AutoresetMode) -> Any:
    """Three rows, of which the second is one slot behind; the others end with the next slot."""
    env = make_vec(3, SHORT, clock=True, autoreset_mode=mode)
    action = np.full((3, 2), 0.5, np.float32)
    env.reset(seed=0)
    before = env.step(action)[0]
    mask = np.array([False, True, False])
    kept = before.copy()
    after, info = env.reset(options={"reset_mask": mask, "position": (0.0, 5.0)})
    np.testing.assert_array_equal(before, kept)
    np.testing.assert_array_equal(after[~mask], before[~mask])
    np.testing.assert_allclose(after[mask][:, :2], [[0.0, 0.05]])
    np.testing.assert_array_equal(after[mask][:, -1], -1.0)
    np.testing.assert_array_equal(info["_position"], mask)
    env.step(action)
    return env, action, mask


def test_rows_that_end_apart_start_anew_in_the_step_that_ends_them(make_vec: Build) -> None:
    env, action, mask = flown_apart(make_vec, AutoresetMode.SAME_STEP)
    observation, _, _, truncated, info = env.step(action)
    np.testing.assert_array_equal(truncated, ~mask)
    np.testing.assert_array_equal(info["_final_obs"], ~mask)
    np.testing.assert_allclose(info["position"], [[-60, -60], [20, 25], [-60, -60]])
    np.testing.assert_allclose(observation[:, :2] * 100.0, info["position"], rtol=1e-5)
    np.testing.assert_array_equal(env.step(action)[3], mask)


def test_rows_that_end_apart_start_anew_in_the_next_step(make_vec: Build) -> None:
    env, action, mask = flown_apart(make_vec, AutoresetMode.NEXT_STEP)
    _, _, _, truncated, info = env.step(action)
    np.testing.assert_array_equal(truncated, ~mask)
    np.testing.assert_allclose(info["position"], [[-30, -30], [20, 25], [-30, -30]])
    _, reward, _, truncated, info = env.step(action)
    np.testing.assert_array_equal(truncated, mask)
    np.testing.assert_allclose(info["position"], [[-60, -60], [30, 35], [-60, -60]])
    np.testing.assert_array_equal(reward[~mask], 0.0)
    np.testing.assert_array_equal(info["secrecy_sum_rate"][~mask], 0.0)
    _, _, _, truncated, info = env.step(action)
    assert not truncated.any()
    np.testing.assert_allclose(info["position"], [[-50, -50], [-60, -60], [-50, -50]])


def test_without_autoreset_a_row_that_has_ended_waits_for_its_reset(make_vec: Build) -> None:
    env, action, mask = flown_apart(make_vec, AutoresetMode.DISABLED)
    np.testing.assert_array_equal(env.step(action)[3], ~mask)
    with pytest.raises(ResetNeeded, match=r"^rows \[0, 2\] have ended: .*step\(\)$"):
        env.step(action)
    env.reset(options={"reset_mask": ~mask})
    info = env.step(action)[4]
    np.testing.assert_allclose(info["position"], [[-50, -50], [30, 35], [-50, -50]])


def test_a_row_s_seed_alone_decides_its_flight(make_vec: Build) -> None:
    env, hovering = make_vec(2, SHORT, autoreset_mode="Disabled"), {"position": (80.0, 80.0)}

    def rewards(**reset: Any) -> Any:
        options = hovering | reset.pop("options", {})
        env.reset(**reset, options=options)
        return np.stack([env.step(np.zeros((2, 2)))[1] for _ in range(SHORT.num_slots)], axis=-1)

    first = rewards(seed=[1, 2])
    np.testing.assert_array_equal(rewards(seed=np.array([2, 1])), first[::-1])
    again = rewards(seed=[None, 2])
    np.testing.assert_array_equal(again[1], first[1])
    assert (again[0] != first[0]).all()
    env.reset()
    again = rewards(seed=[1, 2], options={"reset_mask": np.array([True, False])})
    np.testing.assert_array_equal(again[0], first[0])
    assert (again[1] != first[1]).all()
    env.reset(seed=[1, 2])
    assert (rewards(seed=[None, None]) != first).all()


def test_each_row_may_fly_in_a_layout_of_its_own(make_vec: Build) -> None:
    moved = dataclasses.replace(SCENARIO, helper_starts=((0.0, 0.0),))
    positions = make_vec(2, [SCENARIO, moved]).reset(seed=0)[1]["position"]
    np.testing.assert_array_equal(positions, [(-60.0, -60.0), (0.0, 0.0)])


def test_each_row_may_fly_its_own_scheme(make_vec: Build) -> None:
    env = make_vec(2, scheme=("relay", "jamming"))
    env.reset(seed=0)
    modes = [env.step(action)[4]["mode"].tolist() for action in random_actions(5, 2)]
    assert modes == [[1, 0]] * 5


def test_each_row_s_picture_shows_its_own_flight(make_vec: Build) -> None:
    env = make_vec(2, SHORT, render_mode="rgb_array")
    env.reset(seed=0)
    at_the_start = env.render()
    env.step(np.full((2, 2), 0.5, np.float32))
    flown = env.render()
    env.reset(options={"reset_mask": np.array([True, False])})
    after = env.render()
    np.testing.assert_array_equal(after[0], at_the_start[0])
    np.testing.assert_array_equal(after[1], flown[1])
    assert (flown[1] != at_the_start[1]).any()
