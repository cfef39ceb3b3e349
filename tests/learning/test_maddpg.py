"""An actor for each helper, and a critic of all of them."""

import dataclasses
from collections.abc import Iterator
from typing import Any

import pytest
import torch
from tensordict import TensorDict
from torch import Tensor

from hyuav import DDPG, MADDPG, Scenario, Training, TrainingParameters
from hyuav.envs.observation import ObservationLayout
from hyuav.learning.maddpg import actor_loss
from hyuav.references.optimum import solve_optimum

ONE = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=4)
THREE = dataclasses.replace(ONE, helper_starts=((-60.0, -60.0), (60.0, -60.0), (0.0, 20.0)))
LAYOUT = ObservationLayout(THREE, clock=False)
SMALL: dict[str, Any] = {"hidden_sizes": (12, 8)}
BOTH = pytest.mark.parametrize("shared", [False, True])


def trained(scenario: Scenario, algorithm: DDPG, learners: list[int]) -> Iterator[Tensor]:
    """All numbers of a short training, one after the other."""
    parameters = TrainingParameters(
        num_episodes=5,
        batch_size=6,
        replay_size=12,
        evaluation_every=5,
        evaluation_episodes=2,
        compile="never",
    )
    training = Training(scenario, learners, algorithm, parameters)
    for episode in training.episodes():
        yield episode.accumulated_reward
        yield from episode.losses.values()
    yield training.best_evaluation
    yield from training.best_weights.values()


@BOTH
def test_with_one_helper_it_is_ddpg_number_for_number(shared: bool) -> None:
    plain = trained(ONE, DDPG(**SMALL), [3, 4])
    own = trained(ONE, MADDPG(**SMALL, shared_actor=shared), [3, 4])
    for expected, values in zip(plain, own, strict=True):
        torch.testing.assert_close(values, expected, rtol=0.0, atol=0.0, equal_nan=True)


@BOTH
def test_a_learner_learns_the_same_alone_and_among_others(shared: bool) -> None:
    algorithm = MADDPG(**SMALL, shared_actor=shared)
    together, alone = (trained(THREE, algorithm, seeds) for seeds in ([3, 4], [4]))
    for several, single in zip(together, alone, strict=True):
        own = several.select(-min(several.ndim, 3), 1)
        torch.testing.assert_close(own, single.squeeze(-min(single.ndim, 3)), equal_nan=True)


def actions(algorithm: MADDPG, observation: Tensor) -> Tensor:
    """Of each helper, (..., H, 2), by the untrained actors of one learner."""
    torch.manual_seed(0)
    actor = algorithm.build(1, THREE).actor
    acted = actor(TensorDict(observation=observation.unsqueeze(0)))["action"]
    return acted.squeeze(0).unflatten(-1, (3, 2)).detach()


@BOTH
@pytest.mark.parametrize("helper", [0, 1, 2])
def test_an_actor_sees_no_distances_of_others(shared: bool, helper: int) -> None:
    before = torch.rand(5, LAYOUT.size)
    after = before.clone()
    LAYOUT.distances(after).unflatten(-1, (3, -1))[:, helper] += 1.0
    algorithm = MADDPG(**SMALL, shared_actor=shared)
    moved = (actions(algorithm, after) != actions(algorithm, before)).any(dim=-1).all(dim=0)
    assert moved.tolist() == [own == helper for own in range(3)]


@BOTH
def test_helpers_that_see_the_same_may_do_different_things(shared: bool) -> None:
    acted = actions(MADDPG(**SMALL, shared_actor=shared), torch.full((LAYOUT.size,), 0.5))
    assert len({tuple(action) for action in acted.tolist()}) == 3


def test_a_shared_actor_has_the_weights_of_one() -> None:
    own, shared = (
        MADDPG(**SMALL, shared_actor=shared).build(2, THREE).loss.actor_network_params
        for shared in (False, True)
    )
    seen = LAYOUT.size_of_each
    assert own["module", "layers", "0", "weight"].shape == (3, 2, seen, 12)
    assert shared["module", "layers", "0", "weight"].shape == (2, seen + 3, 12)


@BOTH
def test_the_actors_follow_the_policy_gradient_of_the_paper(shared: bool) -> None:
    """The gradient of each helper's value, while the others do what they did."""
    torch.manual_seed(0)
    algorithm = MADDPG(**SMALL, shared_actor=shared).build(2, THREE)
    batch = TensorDict(
        observation=torch.randn(2, 7, LAYOUT.size),
        action=torch.rand(2, 7, 6) * 2 - 1,
        batch_size=(2, 7),
    )
    weights = list(algorithm.loss.actor_network_params.parameters())
    loss = algorithm.steps[1].loss(batch.clone())
    assert torch.equal(loss, actor_loss(algorithm, batch.clone(), THREE))
    gradients = torch.autograd.grad(loss.sum(), weights)
    expected = torch.zeros(2, 7)
    for helper in range(3):
        joint = batch["action"].clone()
        own = slice(2 * helper, 2 * helper + 2)
        joint[..., own] = algorithm.act(batch)[..., own]
        entries = batch.select("observation").set("action", joint)
        with algorithm.loss.value_network_params.to_module(algorithm.loss.value_network):
            value = algorithm.loss.value_network(entries)["state_action_value"]
        expected = expected - value.squeeze(-1) / 3
    torch.testing.assert_close(loss, expected)
    torch.testing.assert_close(gradients, torch.autograd.grad(expected.sum(), weights))
    critic = algorithm.loss.value_network_params.parameters()
    assert all(weight.grad is None for weight in critic)


def test_two_actors_soon_earn_more_than_one_helper_can() -> None:
    torch.set_num_threads(1)
    left = ((-80, -40), (-70, -55), (-60, -70), (-85, -60), (-65, -45))
    right = ((70, 60), (60, 75), (80, 50), (75, 70), (55, 60))
    contested = dataclasses.replace(
        ONE,
        ue_positions=(*left, *right),
        helper_starts=((0, 0), (0, 0)),
        eavesdropper_positions=((-60, -50), (60, 55)),
        eavesdropper_altitude=100.0,
        coverage_radius=120.0,
        jamming_power=1e-4,
        num_slots=10,
        fading=False,
    )
    rates: dict[str, Any] = {"actor_learning_rate": 1e-3, "critic_learning_rate": 1e-3}
    algorithm = MADDPG(hidden_sizes=(64, 64), geofence=True, reward_scale=0.05, **rates)
    parameters = TrainingParameters(
        num_episodes=30, batch_size=64, evaluation_every=10, evaluation_episodes=1, compile="never"
    )
    training = Training(contested, 3, algorithm, parameters)
    list(training.episodes())
    alone = dataclasses.replace(contested, helper_starts=((0, 0),))
    best = solve_optimum(alone, ["hybrid"], resolution=10.0)["hybrid"].value
    assert training.best_evaluation.median().item() > 2.0 * best


def test_the_helpers_count_where_memory_is_estimated() -> None:
    sizes = {"replay_size": 1, "batch_size": 1, "evaluation_episodes": 1}
    plain, own = (each.needed_memory(THREE, [4], sizes) for each in (DDPG(), MADDPG()))
    factors = {
        need.name: need.numbers / before.numbers for need, before in zip(own, plain, strict=True)
    }
    assert factors.pop("hidden_sizes") == factors.pop("batch_size") == 3.0
    assert set(factors.values()) == {1.0}
