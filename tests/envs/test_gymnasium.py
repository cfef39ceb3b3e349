"""The Gymnasium environment of one helper, and what a batch of helpers answers alike."""

import copy
import dataclasses
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
import stable_baselines3
import torch
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st
from stable_baselines3.common import env_checker

from hyuav import InputError, Scenario, make_env
from reference import place, random_actions, torchrl_flight

Build = Callable[..., Any]

SCENARIO = Scenario.preset("two_clusters")
SHORT = dataclasses.replace(SCENARIO, num_slots=3)
CORNER_TO_CORNER = dataclasses.replace(
    SCENARIO,
    map_side=150.1,
    helper_starts=((75.05, -75.05),),
    eavesdropper_positions=((-75.05, 75.05),),
)
"""The eavesdropper is as far away as can be, and float32 rounds the distance up."""


@pytest.mark.parametrize("scheme", ["hybrid", "relay", "jamming"])
@pytest.mark.parametrize("clock", [False, True])
def test_gymnasium_s_checker_has_nothing_to_say(make: Build, scheme: str, clock: bool) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make("two_clusters", scheme=scheme, clock=clock).unwrapped)


def test_stable_baselines_checker_has_nothing_to_say(make: Build) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env_checker.check_env(make().unwrapped)


def test_gymnasium_s_passive_checker_is_silent_over_an_episode_with_pictures(make: Build) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = make(SHORT, render_mode="rgb_array")
        env.reset(seed=0)
        for action in random_actions(SHORT.num_slots):
            env.step(action)
            env.render()
        env.close()


@pytest.mark.parametrize("clock", [False, True])
@pytest.mark.parametrize("scheme", ["hybrid", "relay", "jamming"])
def test_a_flight_is_that_of_the_torchrl_environment_with_the_same_seed(
    make: Build, scheme: str, clock: bool
) -> None:
    actions = random_actions(SCENARIO.num_slots)
    env = make(scheme=scheme, clock=clock)
    env.reset(seed=7)
    expected = torchrl_flight(make_env(SCENARIO, scheme, seed=7, clock=clock), actions)
    for action, slot in zip(actions, expected, strict=True):
        observation, reward, terminated, truncated, info = env.step(action)
        np.testing.assert_array_equal(observation, slot["observation"])
        assert reward == slot["reward"].item()
        assert terminated is False
        assert truncated is slot["truncated"].item()
        np.testing.assert_array_equal(info["position"], place(slot))
        assert info["mode"] == slot["mode"].item()
        assert info["off_map"] is slot["off_map"].item()


def test_an_episode_is_truncated_after_its_slots_and_never_terminated(make: Build) -> None:
    env = make()
    env.reset(seed=0)
    ends = [env.step(action)[2:4] for action in random_actions(SCENARIO.num_slots)]
    assert ends == [(False, False)] * (SCENARIO.num_slots - 1) + [(False, True)]


def test_the_off_map_penalty_lowers_the_reward_but_not_the_secrecy_sum_rate(make: Build) -> None:
    env = make("random_disk", scheme="jamming")
    env.reset(seed=0, options={"position": (100.0, 100.0)})
    _, reward, _, _, info = env.step(np.ones(2, np.float32))
    assert info["off_map"]
    np.testing.assert_array_equal(info["position"], (100.0, 100.0))
    assert info["secrecy_sum_rate"] > 1.0
    assert info["secrecy_sum_rate"] - reward == pytest.approx(0.2, abs=1e-6)


def test_on_the_map_the_reward_is_the_secrecy_sum_rate(make: Build) -> None:
    env = make("random_disk", scheme="jamming")
    env.reset(seed=0, options={"position": (80.0, 80.0)})
    _, reward, _, _, info = env.step(np.zeros(2, np.float32))
    assert reward == info["secrecy_sum_rate"] > 0.0


def test_nothing_is_earned_before_the_first_slot(make: Build) -> None:
    assert make().reset(seed=0)[1]["secrecy_sum_rate"] == 0.0


def test_a_reset_starts_at_helper_start_or_where_it_is_told(make: Build) -> None:
    env = make()
    assert tuple(env.reset(seed=0)[1]["position"]) == SCENARIO.helper_starts[0]
    observation, info = env.reset(options={"position": (25, -50.0)})
    assert tuple(info["position"]) == (25.0, -50.0)
    np.testing.assert_allclose(observation[:2], (0.25, -0.5))
    assert tuple(env.reset()[1]["position"]) == SCENARIO.helper_starts[0]


def test_without_a_seed_the_random_numbers_go_on(make: Build) -> None:
    env = make()

    def first_reward() -> float:
        return env.step(np.zeros(2, np.float32))[1]

    options = {"position": (80.0, 80.0)}
    env.reset(seed=3, options=options)
    first = first_reward()
    env.reset(options=options)
    second = first_reward()
    env.reset(seed=3, options=options)
    assert (first_reward(), second != first) == (first, True)


def test_two_environments_that_were_never_seeded_differ(make: Build) -> None:
    rewards = set()
    for _ in range(2):
        torch.manual_seed(0)
        env = make()
        env.reset(options={"position": (80.0, 80.0)})
        rewards.add(env.step(np.zeros(2, np.float32))[1])
    assert len(rewards) == 2


@settings(deadline=None, max_examples=25)
@given(
    start=st.tuples(*[st.floats(-75.05, 75.05)] * 2),
    corner=st.tuples(*[st.sampled_from([-1.0, 1.0])] * 2),
)
def test_every_observation_lies_in_its_space_up_to_the_map_s_corners(
    make: Build, start: tuple[float, float], corner: tuple[float, float]
) -> None:
    env = make(CORNER_TO_CORNER, clock=True).unwrapped
    observation, _ = env.reset(seed=0, options={"position": start})
    assert observation in env.observation_space
    for _ in range(8):
        observation, *_ = env.step(np.array(corner, np.float32))
        assert observation in env.observation_space


def test_the_bound_on_distances_is_reached_across_the_map(make: Build) -> None:
    env = make(CORNER_TO_CORNER).unwrapped
    observation, _ = env.reset(seed=0)
    assert observation in env.observation_space
    assert observation[-1] == pytest.approx(env.observation_space.high[-1], abs=2e-5)


def test_writing_to_what_was_returned_does_not_move_the_helper(make: Build) -> None:
    calm, rude = make(), make()
    calm.reset(seed=0)
    for array in (rude.reset(seed=0)[0], rude.reset(seed=0)[1]["position"]):
        array[:] = 9.0
    action = np.array([0.5, 0.5], np.float32)
    np.testing.assert_array_equal(calm.step(action)[0], rude.step(action)[0])


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_flies_on_with_the_same_random_numbers(
    build: Build, duplicate: Callable[[Any], Any]
) -> None:
    env = build(diagnostics=True, render_mode="rgb_array")
    env.reset(seed=0)
    action = np.zeros(env.action_space.shape, np.float32)
    env.step(action)
    twin = duplicate(env)
    np.testing.assert_array_equal(env.step(action)[0], twin.step(action)[0])
    np.testing.assert_array_equal(env.render(), twin.render())
    assert twin.spec.max_episode_steps == SCENARIO.num_slots


def test_a_spec_makes_the_same_environment_again(make: Build, make_vec: Build) -> None:
    env = make("random_disk", scheme="relay", clock=True)
    again = gymnasium.make(gymnasium.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    np.testing.assert_array_equal(env.reset(seed=1)[0], again.reset(seed=1)[0])
    vector = make_vec(2, "random_disk", scheme="relay")
    np.testing.assert_array_equal(
        vector.reset(seed=1)[0], gymnasium.make_vec(vector.spec).reset(seed=1)[0]
    )


BAD_ARGUMENTS: list[tuple[dict[str, Any], str]] = [
    ({"scenario": "two_cluster"}, "did you mean 'two_clusters'"),
    ({"scenario": 3}, "scenario = 3"),
    ({"scheme": "relays"}, "did you mean 'relay'"),
    ({"device": "gpu"}, "device = 'gpu'"),
    ({"clok": True}, "option = 'clok': expected one of .*did you mean 'clock'"),
    ({"batch_size": 3}, "option = 'batch_size'"),
    ({"geofence": 1}, "geofence = 1"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD_ARGUMENTS)
def test_bad_arguments_are_refused_in_one_line(
    build: Build, arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message) as refusal:
        build(**arguments)
    assert "\n" not in str(refusal.value)


@pytest.mark.filterwarnings("ignore:.*render_mode.*:UserWarning")
def test_an_unknown_render_mode_is_refused(make: Build) -> None:
    with pytest.raises(InputError, match="render_mode = 'ascii'"):
        make(render_mode="ascii")


BAD_RESETS: list[tuple[dict[str, Any], str]] = [
    ({"seed": -1}, "seed = -1"),
    ({"seed": 1.5}, "seed = 1.5"),
    ({"options": ["position"]}, "options ="),
    ({"options": {"positon": (0, 0)}}, "did you mean 'position'"),
    ({"options": {"position": "here"}}, "position = 'here'"),
    ({"options": {"position": 1.0}}, "position = 1.0"),
    ({"options": {"position": (0.0, float("nan"))}}, "position ="),
    ({"options": {"position": (0.0, 100.5)}}, "on the map"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD_RESETS)
def test_a_bad_reset_is_refused_in_one_line(
    build: Build, arguments: dict[str, Any], message: str
) -> None:
    env = build().unwrapped
    env.reset(seed=0)
    with pytest.raises(InputError, match=message) as refusal:
        env.reset(**arguments)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("action", [[0.0], [[0.0, 0.0]] * 4, [0.0, np.nan], "up", None])
def test_a_bad_action_is_refused_in_one_line(build: Build, action: Any) -> None:
    env = build().unwrapped
    env.reset(seed=0)
    with pytest.raises(InputError, match="action") as refusal:
        env.step(action)
    assert "\n" not in str(refusal.value)


def test_nothing_can_be_flown_before_a_reset(build: Build) -> None:
    env = build().unwrapped
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(env.action_space.shape, np.float32))


def test_nothing_can_be_flown_after_the_end_until_the_next_reset(make: Build) -> None:
    env = make(SHORT)
    env.reset(seed=0)
    for action in random_actions(SHORT.num_slots):
        env.step(action)
    with pytest.raises(ResetNeeded, match=r"^the episode has ended: call reset\(\) before step"):
        env.step(action)
    env.reset()
    assert not env.step(action)[3]


def test_the_diagnostics_of_each_slot_are_told_where_asked_for(make: Build) -> None:
    env = make(SHORT, diagnostics=True, fading=True)
    native = make_env(SHORT, diagnostics=True, fading=True, seed=3)
    actions = random_actions(SHORT.num_slots)
    info = env.reset(seed=3)[1]
    assert not info["diagnostics"]["ue_energy"].any()
    for action, slot in zip(actions, torchrl_flight(native, actions), strict=True):
        info["diagnostics"]["edge_load"][:] = -1.0  # of no effect on what follows
        info = env.step(action)[4]
        assert info["diagnostics"].keys() == slot["diagnostics"].keys()
        for name, entry in slot["diagnostics"].items():
            np.testing.assert_array_equal(info["diagnostics"][name], entry)
        np.testing.assert_array_equal(info["fading"], slot["fading"])
    assert "diagnostics" not in make(SHORT).reset(seed=3)[1]


def test_an_environment_can_be_closed_twice(build: Build) -> None:
    env = build()
    env.reset(seed=0)
    env.close()
    env.close()


def test_an_action_beyond_the_speed_limit_is_clipped(make: Build) -> None:
    positions = []
    for action in ([5.0, -5.0], [1.0, -1.0]):
        env = make().unwrapped
        env.reset(seed=0, options={"position": (0.0, 0.0)})
        positions.append(tuple(env.step(np.array(action, np.float32))[4]["position"]))
    assert positions == [(20.0, -20.0)] * 2


def test_ddpg_of_stable_baselines_trains_on_it(make: Build) -> None:
    model = stable_baselines3.DDPG(
        "MlpPolicy", make(SHORT), learning_starts=20, batch_size=16, seed=0, device="cpu"
    )
    before = [weights.clone() for weights in model.actor.parameters()]
    model.learn(60)
    assert model.num_timesteps == 60
    after = list(model.actor.parameters())
    assert any(not torch.equal(old, new) for old, new in zip(before, after, strict=True))
    action, _ = model.predict(make(SHORT).reset(seed=0)[0])
    assert np.isfinite(action).all()


def test_a_picture_is_drawn_of_every_slot_and_changes_with_it(make: Build) -> None:
    env = make(SHORT, render_mode="rgb_array")
    env.reset(seed=0)
    first = env.render()
    env.step(np.ones(2, np.float32))
    assert first.dtype == np.uint8
    assert first.ndim == 3
    assert (env.render() != first).any()


def test_without_a_render_mode_there_is_no_picture(make: Build, make_vec: Build) -> None:
    for env in (make().unwrapped, make_vec()):
        env.reset(seed=0)
        assert env.render() is None
