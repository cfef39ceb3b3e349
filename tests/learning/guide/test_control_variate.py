"""Rewards without the luck of the fading."""

import dataclasses

import pytest
import torch
from tensordict import TensorDict, TensorDictBase

from hyuav import Scenario
from hyuav.learning.algorithm import adam
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.control_variate import LUCK, ControlVariate
from hyuav.learning.replay import FADING
from hyuav.learning.train import Cohort, Learner
from hyuav.physics.slot import SecureOffloadingSystem

SCENARIO = Scenario.preset("random_disk")
SYSTEM = SecureOffloadingSystem(SCENARIO)


def slots(size: int, seed: int, spread: float = 30.0) -> TensorDictBase:
    """Slots (1, size) of relaying somewhere about the middle of the map."""
    generator = torch.Generator().manual_seed(seed)
    position = spread * torch.randn(1, size, 2, generator=generator) - 10.0
    fading = SYSTEM.draw_fading((1, size), generator)
    assert fading is not None
    mode = torch.randint(0, 2, (1, size, 1), generator=generator) * 2.0 - 1.0
    distances = SYSTEM.distances(position) / 100.0 - 1.0
    reward, _ = SYSTEM.sum_rates(position, fading)
    after = TensorDict(
        observation=torch.cat([position / 100.0, mode, distances], dim=-1),
        reward=reward.unsqueeze(-1),
        fading=fading,
        batch_size=[1, size],
    )
    return TensorDict(next=after, batch_size=[1, size])


def test_whatever_its_weights_it_leaves_the_mean_reward_as_it_is() -> None:
    torch.manual_seed(0)
    variate = ControlVariate(1, SCENARIO, 1.0, clock=False)
    batch = slots(200_000, 1)
    fair = variate.fair(batch)
    luck = batch["next", "reward"] - fair["next", "reward"]
    error = luck.std() / len(luck.flatten()) ** 0.5
    assert luck.std() > 0.1
    assert abs(luck.mean()) < 4.0 * error
    torch.testing.assert_close(fair[LUCK], luck)


def test_it_learns_to_take_most_of_the_variance_off() -> None:
    torch.manual_seed(0)
    variate = ControlVariate(1, SCENARIO, 1.0, clock=False)
    optimizer = adam(variate, 3e-3)
    for step in range(600):
        optimizer.zero_grad()
        variate.loss(variate.fair(slots(200, step))).mean().backward()
        optimizer.step()
    batch = slots(20_000, 9999, spread=0.0)  # all at one place
    before, after = batch["next", "reward"], variate.fair(batch)["next", "reward"]
    assert after.var() < 0.15 * before.var()
    assert after.mean().item() == pytest.approx(before.mean().item(), abs=0.02)


def test_the_mode_which_depends_on_the_fading_is_not_looked_at() -> None:
    torch.manual_seed(0)
    variate = ControlVariate(1, SCENARIO, 1.0, clock=False)
    batch = slots(5, 0)
    other = batch.clone()
    other["next", "observation"][..., 2] *= -1.0
    assert torch.equal(variate.luck(batch), variate.luck(other))


def test_scaled_rewards_have_scaled_luck() -> None:
    variates = []
    for scale in (1.0, 0.1):
        torch.manual_seed(0)
        variates.append(ControlVariate(1, SCENARIO, scale, clock=False))
    batch = slots(5, 0)
    torch.testing.assert_close(variates[1].luck(batch), 0.1 * variates[0].luck(batch))


def test_without_fading_there_is_no_luck() -> None:
    scenario = dataclasses.replace(SCENARIO, num_slots=4, fading=False)
    algorithm = DDPG(hidden_sizes=(8,), control_variate=True, repeat_every=2)
    trained = Cohort(scenario, [Learner("relay", 0)], algorithm, 40, 8, None)
    for _ in range(6):
        trained.fly()
    batch = trained.replay.sample()
    assert torch.equal(batch[FADING], torch.ones_like(batch[FADING]))
    fair = trained.algorithm.fair(batch)
    assert torch.equal(fair["next", "reward"], batch["next", "reward"])


def test_each_learner_has_a_control_variate_of_its_own_that_learns() -> None:
    scenario = dataclasses.replace(SCENARIO, num_slots=4)
    algorithm = DDPG(hidden_sizes=(8,), control_variate=True)

    def weights(seeds: list[int], episodes: int) -> torch.Tensor:
        learners = [Learner("relay", seed) for seed in seeds]
        trained = Cohort(scenario, learners, algorithm, 40, 8, None)
        for _ in range(episodes):
            trained.fly()
        expectation = trained.algorithm.expectation
        assert expectation is not None
        return torch.cat([each.detach().flatten(1) for each in expectation.parameters()], dim=1)

    begun, later = weights([3, 4], 1), weights([3, 4], 4)
    assert not torch.equal(begun[0], begun[1])
    assert not torch.equal(begun, later)
    torch.testing.assert_close(weights([4], 4)[0], later[1])


def test_evaluations_are_told_without_their_luck_and_with_the_same_mean() -> None:
    scenario = dataclasses.replace(SCENARIO, num_slots=4)
    algorithm = DDPG(hidden_sizes=(8,), control_variate=True, reward_scale=0.1)
    trained = Cohort(scenario, [Learner("relay", 0)], algorithm, 400, 50, None)
    for _ in range(60):
        trained.fly()
    earned = [trained.evaluate(20, seed) for seed in range(60)]
    fair = torch.cat([own.reward for own in earned])
    lucky = torch.cat([own.sum_rate for own in earned])
    assert fair.std() < 0.7 * lucky.std()
    assert abs((fair - lucky).mean()) < 4.0 * (fair - lucky).std() / 60**0.5
    assert earned[0].way.shape == (4, 1, 2)
