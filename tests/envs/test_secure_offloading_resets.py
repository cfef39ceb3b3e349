"""How episodes start: where, which rows, and with which random numbers."""

from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tensordict import TensorDict

from hyuav import InputError, Scenario, SecureOffloadingEnv
from hyuav.physics.modes import MODE_RULES
from reference import assert_same, changed, fly, place, start_at

TWO_CLUSTERS = Scenario.preset("two_clusters")
RANDOM_DISK = Scenario.preset("random_disk")
SEEDS = st.integers(0, 2**31)


def test_the_mode_after_a_reset_follows_that_resets_fading() -> None:
    # At a point where the better mode depends on the fading, resets start in both.
    env = SecureOffloadingEnv(RANDOM_DISK, batch_size=512, seed=0)
    modes = start_at(env, torch.tensor([30.0, 30.0]).expand(512, 2))["mode"].float()
    assert 0.01 < float(modes.mean()) < 0.99


def test_an_episode_starts_at_the_helpers_start() -> None:
    env = SecureOffloadingEnv(changed(TWO_CLUSTERS, helper_starts=(12.0, -34.0)), batch_size=(2, 3))
    state = env.reset()
    assert place(state).tolist() == [[[12.0, -34.0]] * 3] * 2
    assert not state["off_map"].any()


@pytest.mark.parametrize("beyond", [[100.1, 0.0], [0.0, -100.1], [1e9, 1e9], [float("nan"), 0.0]])
def test_a_reset_off_the_map_is_refused(beyond: list[float]) -> None:
    env = SecureOffloadingEnv(TWO_CLUSTERS, batch_size=2)
    with pytest.raises(InputError, match=r"^position = .*on the map"):
        start_at(env, [[0.0, 0.0], beyond])


def test_a_reset_does_not_keep_hold_of_the_given_position() -> None:
    env = SecureOffloadingEnv(TWO_CLUSTERS, batch_size=2)
    position = torch.zeros(2, 1, 2)
    state = env.reset(TensorDict({"position": position}, batch_size=(2,)))
    position += 50.0
    assert not place(state).any()


def test_a_partial_reset_restarts_only_the_rows_asked_for() -> None:
    env = SecureOffloadingEnv(RANDOM_DISK, batch_size=4, seed=0, diagnostics=True)
    state = fly(env, start_at(env, [[80.0, 80.0]] * 4), [0.1, 0.2])
    chosen = torch.tensor([[True], [False], [False], [True]])
    after = env.reset(state.clone().exclude("position", "reward").set("_reset", chosen))
    kept = env.reset(TensorDict({"_reset": chosen, "position": torch.zeros(4, 1, 2)}, batch_size=4))
    assert place(after)[chosen[:, 0]].tolist() == [[-60.0, -60.0]] * 2
    assert place(kept)[chosen[:, 0]].tolist() == [[0.0, 0.0]] * 2


@pytest.mark.parametrize("diagnostics", [False, True])
def test_an_automatic_reset_leaves_the_other_rows_in_flight(diagnostics: bool) -> None:
    env = SecureOffloadingEnv(RANDOM_DISK, batch_size=4, seed=0, diagnostics=diagnostics)
    flown = start_at(env, [[70.0, 70.0]] * 4).set("action", torch.full((4, 1, 2), 0.5))
    flown = env.step(flown)
    ended = torch.tensor([[False], [True], [False], [True]])
    flown["next", "done"] = ended
    flown["next", "terminated"] = ended
    state = env.maybe_reset(env.step_mdp(flown))
    over, going = ended[:, 0], ~ended[:, 0]
    assert place(state)[over].tolist() == [[-60.0, -60.0]] * 2
    assert_same(state[going].exclude("_reset", "action"), flown["next"][going].exclude("reward"))
    if diagnostics:
        assert bool((state["diagnostics", "edge_load"][going] > 0).all())
        assert not state["diagnostics", "edge_load"][over].any()
        after = fly(env, state, [0.0, 0.0])
        assert bool((after["diagnostics", "edge_energy"][going] > 0).all())
        assert not after["diagnostics", "edge_energy"][over].any()


@given(SEEDS, st.sampled_from(MODE_RULES))
def test_the_same_seed_gives_the_same_episode_with_and_without_diagnostics(
    seed: int, scheme: str
) -> None:
    # With an edge budget that binds, tasks decide who offloads.
    scenario = changed(RANDOM_DISK, edge_energy_budget=5.0, helper_starts=(70.0, 70.0))
    episodes = []
    for diagnostics in (False, True, False):
        torch.manual_seed(99)  # of the random actions
        env = SecureOffloadingEnv(scenario, scheme, 2, seed=seed, diagnostics=diagnostics)
        episodes.append(env.rollout(5).exclude("diagnostics", ("next", "diagnostics")))
    assert_same(episodes[0], episodes[1])
    assert_same(episodes[0], episodes[2])


def test_different_seeds_give_different_episodes() -> None:
    rewards = set()
    for seed in range(20):
        env = SecureOffloadingEnv(RANDOM_DISK, "jamming", seed=seed)
        rewards.add(float(fly(env, start_at(env, [80.0, 80.0]), [0.0, 0.0])["reward"]))
    assert len(rewards) == 20


def test_set_seed_repeats_an_episode_and_needs_no_new_environment() -> None:
    env = SecureOffloadingEnv(RANDOM_DISK, "jamming", seed=5)
    first = fly(env, start_at(env, [80.0, 80.0]), [0.0, 0.0])
    other = fly(env, start_at(env, [80.0, 80.0]), [0.0, 0.0])
    env.set_seed(5)
    again = fly(env, start_at(env, [80.0, 80.0]), [0.0, 0.0])
    assert_same(first, again)
    assert not torch.equal(first["reward"], other["reward"])


def test_without_a_seed_the_global_seed_decides() -> None:
    episodes = []
    for seed in (7, 7, 8):
        torch.manual_seed(seed)
        env = SecureOffloadingEnv(RANDOM_DISK, "jamming")
        episodes.append(float(fly(env, start_at(env, [80.0, 80.0]), [0.0, 0.0])["reward"]))
    assert episodes[0] == episodes[1] != episodes[2]


def test_the_random_numbers_continue_from_a_saved_state() -> None:
    env = SecureOffloadingEnv(RANDOM_DISK, "jamming", seed=0, diagnostics=True)
    state = fly(env, start_at(env, [80.0, 80.0]), [0.0, 0.0])
    saved = env.draws.state()
    expected = fly(env, state, [0.1, 0.1])
    other = SecureOffloadingEnv(RANDOM_DISK, "jamming", seed=123, diagnostics=True)
    other.draws.set_state(saved)
    assert_same(fly(other, state, [0.1, 0.1]), expected)


def test_a_reset_position_of_another_shape_is_refused() -> None:
    env = SecureOffloadingEnv(TWO_CLUSTERS, batch_size=2)
    with pytest.raises(InputError, match=r"^position"):
        start_at(env, torch.zeros(2, 3))


@pytest.mark.parametrize("seed", [0, 2**63 - 1, np.int64(7), torch.tensor(7)])
def test_any_whole_number_is_a_seed(seed: Any) -> None:
    env = SecureOffloadingEnv(TWO_CLUSTERS, seed=seed)
    assert place(env.reset()).tolist() == [-60.0, -60.0]


@given(SEEDS)
def test_the_tasks_do_not_follow_the_fading(seed: int) -> None:
    fading_seed, task_seed = SecureOffloadingEnv(TWO_CLUSTERS, seed=seed).draws.state()["keys"]
    assert fading_seed != task_seed
