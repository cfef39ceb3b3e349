import pytest
import torch
from tensordict import TensorDict, TensorDictBase

from hyuav.learning.exploration import GaussianNoise


def slot(learners: int, step_count: int = 0) -> TensorDictBase:
    return TensorDict(
        action=torch.zeros(learners, 2),
        step_count=torch.full((learners, 1), step_count),
        batch_size=[learners],
    )


def test_noise_begins_with_the_given_variance() -> None:
    torch.manual_seed(0)
    noise = GaussianNoise(20_000, variance=0.01, decay=1.0, decay_per="slot")
    assert noise(slot(20_000))["action"].var().item() == pytest.approx(0.01, rel=0.03)


def test_noise_decays_after_every_slot() -> None:
    noise = GaussianNoise(1, variance=0.6, decay=0.999, decay_per="slot")
    for count in range(10):
        noise(slot(1, count))
    assert noise.std.item() == pytest.approx(0.6**0.5 * 0.999**9)


def test_noise_decays_after_every_episode_where_told_so() -> None:
    noise = GaussianNoise(1, variance=0.6, decay=0.9, decay_per="episode")
    for _ in range(3):
        for count in range(5):
            noise(slot(1, count))
    assert noise.std.item() == pytest.approx(0.6**0.5 * 0.9**2)


def test_noisy_actions_are_clipped() -> None:
    noise = GaussianNoise(1000, variance=25.0, decay=1.0, decay_per="slot")
    action = noise(slot(1000))["action"]
    assert action.abs().max() == 1.0


def test_learners_are_disturbed_independently() -> None:
    torch.manual_seed(0)
    noise = GaussianNoise(2, variance=0.01, decay=1.0, decay_per="slot")
    draws = torch.stack([noise(slot(2))["action"] for _ in range(4000)])
    correlation = torch.corrcoef(draws.reshape(4000, 4).T)
    assert (correlation - torch.eye(4)).abs().max() < 0.06
