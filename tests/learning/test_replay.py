import torch
from tensordict import TensorDict, TensorDictBase

from hyuav.learning.replay import TRANSITION, as_transition, make_replay


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


def test_each_learner_samples_only_its_own_transitions() -> None:
    replay = make_replay(3, 50, 200, torch.device("cpu"))
    for slot in range(30):
        replay.extend(as_transition(transition(3, slot)).unsqueeze(0))
    rewards = replay.sample()["next", "reward"][..., 0]
    assert rewards.shape == (3, 200)
    assert torch.equal(rewards // 1000, torch.arange(3.0).unsqueeze(-1).expand(3, 200))


def test_learners_sample_different_slots() -> None:
    replay = make_replay(2, 50, 200, torch.device("cpu"))
    for slot in range(50):
        replay.extend(as_transition(transition(2, slot)).unsqueeze(0))
    slots = replay.sample()["next", "reward"][..., 0] % 1000
    assert not torch.equal(slots[0], slots[1])


def test_the_oldest_transitions_are_overwritten() -> None:
    replay = make_replay(1, 20, 500, torch.device("cpu"))
    for slot in range(35):
        replay.extend(as_transition(transition(1, slot)).unsqueeze(0))
    sampled = set(replay.sample()["next", "reward"].flatten().tolist())
    assert sampled == set(map(float, range(15, 35)))


def test_a_transition_holds_what_the_losses_read_and_nothing_else() -> None:
    kept = as_transition(transition(1, 0))
    assert set(kept.keys(include_nested=True, leaves_only=True)) == set(TRANSITION)
