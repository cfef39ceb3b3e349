import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import ReplayBuffer

from hyuav.learning.replay import (
    FADING,
    TRANSITION,
    TransitionOptions,
    latest,
    make_replay,
    sampled_slots,
)


def transition(learners: int, slot: int) -> TensorDictBase:
    """A transition whose reward tells the learner (thousands) and the slot (ones)."""
    reward = 1000.0 * torch.arange(learners).unsqueeze(-1) + slot
    flag = torch.zeros(learners, 1, dtype=torch.bool)
    observation, action = torch.randn(learners, 15), torch.randn(learners, 2)
    after = TensorDict(
        observation=observation, reward=reward, done=flag, terminated=flag, position=action
    )
    return TensorDict(
        observation=observation, action=action, next=after, position=action, batch_size=[learners]
    )


def replay_of(learners: int, capacity: int, batch_size: int) -> ReplayBuffer:
    uniforms = iter(lambda: torch.rand(learners, batch_size), None)
    kept = TransitionOptions().transition(transition(learners, 0))
    slots = torch.zeros_like(kept.expand(capacity, learners)).to("cpu")
    return make_replay(slots, batch_size, uniforms)


@pytest.mark.parametrize("length", [1, 7, 8000])
def test_every_stored_slot_is_drawn_as_often_and_no_other(length: int) -> None:
    grid = (torch.arange(10 * length) + 0.5) / (10 * length)
    drawn = sampled_slots(grid, length)
    assert drawn.bincount(minlength=length).sub(10).abs().max() <= 1  # rounding of the grid
    edges = torch.tensor([0.0, 1.0 - 2**-24, 1.0])
    assert sampled_slots(edges, length).tolist() == [0, length - 1, length - 1]
    assert torch.equal(sampled_slots(grid, torch.tensor([length])), drawn)


def test_each_learner_samples_only_its_own_transitions() -> None:
    replay = replay_of(3, 50, 200)
    for slot in range(30):
        replay.extend(TransitionOptions().transition(transition(3, slot)).unsqueeze(0))
    rewards = replay.sample()["next", "reward"][..., 0]
    assert rewards.shape == (3, 200)
    assert torch.equal(rewards // 1000, torch.arange(3.0).unsqueeze(-1).expand(3, 200))


def test_learners_sample_different_slots() -> None:
    replay = replay_of(2, 50, 200)
    for slot in range(50):
        replay.extend(TransitionOptions().transition(transition(2, slot)).unsqueeze(0))
    slots = replay.sample()["next", "reward"][..., 0] % 1000
    assert not torch.equal(slots[0], slots[1])


def test_the_oldest_transitions_are_overwritten() -> None:
    replay = replay_of(1, 20, 500)
    for slot in range(35):
        replay.extend(TransitionOptions().transition(transition(1, slot)).unsqueeze(0))
    sampled = set(replay.sample()["next", "reward"].flatten().tolist())
    assert sampled == set(map(float, range(15, 35)))


def test_a_transition_holds_what_the_losses_read_and_nothing_else() -> None:
    kept = TransitionOptions().transition(transition(1, 0))
    assert set(kept.keys(include_nested=True, leaves_only=True)) == set(TRANSITION)


def test_where_the_horizon_is_finite_an_episode_ends_the_return() -> None:
    slot = transition(2, 1)
    slot["next", "done"] = torch.tensor([[True], [False]])
    kept = TransitionOptions(finite_horizon=True).transition(slot)
    assert kept["next", "terminated"].tolist() == [[True], [False]]
    assert not slot["next", "terminated"].any()  # what was collected is left as it is
    assert not TransitionOptions().transition(slot)["next", "terminated"].any()


def test_rewards_are_kept_in_the_scale_asked_for() -> None:
    kept = TransitionOptions(reward_scale=0.1).transition(transition(2, 5))
    torch.testing.assert_close(kept["next", "reward"], torch.tensor([[0.5], [100.5]]))


def test_the_fading_is_kept_where_a_learner_wants_it() -> None:
    slot = transition(2, 5)
    slot[FADING] = torch.rand(2, 32)
    assert torch.equal(TransitionOptions(beside=(FADING,)).transition(slot)[FADING], slot[FADING])
    assert FADING not in TransitionOptions().transition(slot).keys(include_nested=True)


@pytest.mark.parametrize("stored", [3, 7, 11])  # of 5 that are kept
def test_the_latest_slots_are_found_also_where_the_replay_begins_anew(stored: int) -> None:
    replay = replay_of(1, 5, 4)
    for slot in range(stored):
        replay.extend(TransitionOptions().transition(transition(1, slot)).unsqueeze(0))
    found = replay[:]["next", "reward"][latest(replay, 3)].flatten()
    assert found.tolist() == [stored - 3.0, stored - 2.0, stored - 1.0]
    assert len(latest(replay, 9)) == 5
