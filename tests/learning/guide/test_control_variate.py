"""Rewards without what the fading brought by chance."""

import dataclasses

import pytest
import torch
from tensordict import TensorDict, TensorDictBase

from hyuav import Guide, RobustDDPG, Scenario
from hyuav.learning.afterstate import Afterstate
from hyuav.learning.algorithm import adam
from hyuav.learning.guide.control_variate import CONTROL_TERM, ControlVariate
from hyuav.learning.learners import Learner
from hyuav.learning.replay import FADING
from hyuav.learning.train import Cohort
from hyuav.physics.slot import Physics
from reference import hover

SCENARIO = Scenario.preset("random_disk")
PHYSICS = Physics(SCENARIO)


def variate_of(scale: float) -> ControlVariate:
    afterstate = Afterstate(SCENARIO, 0.02, clock=False, geofence=True)
    return ControlVariate(1, SCENARIO, afterstate, (64, 64), scale)


def guided(scenario: Scenario, seeds: list[int], replay_size: int, batch_size: int) -> Cohort:
    """Learners whose guide is a control variate and no more."""
    guide = Guide(warm_up_episodes=0, repeat_every=0, imagined_flights=0, imitation_weight=0.0)
    algorithm = RobustDDPG(hidden_sizes=(8,), clock=False, reward_scale=0.1, guide=guide)
    learners = [Learner("relay", seed) for seed in seeds]
    return Cohort(scenario, learners, algorithm, replay_size, batch_size, None)


def slots(size: int, seed: int, spread: float = 30.0) -> TensorDictBase:
    """Slots (1, size) of relaying somewhere about the middle of the map."""
    generator = torch.Generator().manual_seed(seed)
    position = spread * torch.randn(1, size, 2, generator=generator) - 10.0
    fading = PHYSICS.draw_fading((1, size), generator)
    assert fading is not None
    mode = torch.randint(0, 2, (1, size, 1), generator=generator) * 2.0 - 1.0
    slot = hover(PHYSICS, position, fading)
    distances, reward = slot.distances.flatten(-2) / 100.0 - 1.0, slot.relay.sum_rate
    after = TensorDict(
        observation=torch.cat([position / 100.0, mode, distances], dim=-1),
        reward=reward.unsqueeze(-1),
        fading=fading,
        batch_size=[1, size],
    )
    return TensorDict(next=after, batch_size=[1, size])


def test_whatever_its_weights_it_leaves_the_mean_reward_as_it_is() -> None:
    torch.manual_seed(0)
    variate = variate_of(1.0)
    batch = slots(200_000, 1)
    adjusted = variate.adjust(batch)
    control_term = batch["next", "reward"] - adjusted["next", "reward"]
    error = control_term.std() / len(control_term.flatten()) ** 0.5
    assert control_term.std() > 0.1
    assert abs(control_term.mean()) < 4.0 * error
    torch.testing.assert_close(adjusted[CONTROL_TERM], control_term)


def test_it_learns_to_take_most_of_the_variance_off() -> None:
    torch.manual_seed(0)
    variate = variate_of(1.0)
    optimizer = adam(variate, 3e-3)
    for step in range(600):
        optimizer.zero_grad()
        variate.loss(variate.adjust(slots(200, step))).mean().backward()
        optimizer.step()
    batch = slots(20_000, 9999, spread=0.0)  # all at one place
    before, after = batch["next", "reward"], variate.adjust(batch)["next", "reward"]
    assert after.var() < 0.15 * before.var()
    assert after.mean().item() == pytest.approx(before.mean().item(), abs=0.02)


def test_the_mode_which_depends_on_the_fading_is_not_looked_at() -> None:
    torch.manual_seed(0)
    variate = variate_of(1.0)
    batch = slots(5, 0)
    other = batch.clone()
    other["next", "observation"][..., 2] *= -1.0
    assert torch.equal(variate.control_term(batch), variate.control_term(other))


def test_scaled_rewards_have_a_scaled_control_term() -> None:
    variates = []
    for scale in (1.0, 0.1):
        torch.manual_seed(0)
        variates.append(variate_of(scale))
    batch = slots(5, 0)
    torch.testing.assert_close(
        variates[1].control_term(batch), 0.1 * variates[0].control_term(batch)
    )


def test_without_fading_nothing_is_taken_off() -> None:
    scenario = dataclasses.replace(SCENARIO, num_slots=4, fading=False)
    trained = guided(scenario, [0], 40, 8)
    for _ in range(6):
        trained.fly()
    batch = trained.replay.sample()
    assert torch.equal(batch[FADING], torch.ones_like(batch[FADING]))
    adjusted = trained.algorithm.guide.prepare(batch)
    assert torch.equal(adjusted["next", "reward"], batch["next", "reward"])


def test_each_learner_has_a_control_variate_of_its_own_that_learns() -> None:
    scenario = dataclasses.replace(SCENARIO, num_slots=4)

    def weights(seeds: list[int], episodes: int) -> torch.Tensor:
        trained = guided(scenario, seeds, 40, 8)
        for _ in range(episodes):
            trained.fly()
        own = trained.algorithm.guide.parameters()
        return torch.cat([each.detach().flatten(1) for each in own], dim=1)

    begun, later = weights([3, 4], 1), weights([3, 4], 4)
    assert not torch.equal(begun[0], begun[1])
    assert not torch.equal(begun, later)
    torch.testing.assert_close(weights([4], 4)[0], later[1])


def test_evaluations_are_told_without_chance_and_with_the_same_mean() -> None:
    scenario = dataclasses.replace(SCENARIO, num_slots=4)
    trained = guided(scenario, [0], 400, 50)
    for _ in range(60):
        trained.fly()
    earned = [trained.evaluate(20, seed)[0] for seed in range(60)]
    adjusted = torch.cat([own.reward for own in earned])
    raw = torch.cat([own.sum_rate for own in earned])
    assert adjusted.std() < 0.7 * raw.std()
    assert abs((adjusted - raw).mean()) < 4.0 * (adjusted - raw).std() / 60**0.5
