"""Actors are drawn to what is clearly better than what they do, whichever the algorithm."""

import math
from typing import Any

import pytest
import torch
from tensordict import TensorDictBase
from torch import Tensor

from batches import TEN_UES, mini_batch
from hyuav import Guide
from hyuav._support.randomness import given_normals
from hyuav.learning.algorithm import Algorithm, AlgorithmParameters
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.demonstrations import Demonstrations
from hyuav.learning.guide.imitation import Imitation
from hyuav.learning.sac import SAC
from hyuav.learning.td3 import TD3
from hyuav.learning.train import update_networks, update_targets

KINDS: list[Any] = [DDPG, TD3, SAC]

MARGIN = Guide().q_margin

LITTLE = 1.8 * MARGIN
"""A slope at which hovering, from half speed, gains less than what counts."""


def imitating(
    algorithm: Algorithm, weight: float, *, clock: bool = False
) -> tuple[Algorithm, Demonstrations]:
    """An algorithm whose learners are drawn to what is demonstrated, and their best flights."""
    learners = next(iter(algorithm.actor.parameters())).shape[0]
    flights = Demonstrations(learners, TEN_UES, 0.005)
    imitation = Imitation(algorithm, flights, Guide(imitation_weight=weight), clock=clock)
    return imitation.attach(0.95), flights


def flying_along_x(kind: Any, weight: float, slope: float) -> Algorithm:
    """One learner that flies at half speed along x, and critics for which speed has this slope.

    Of their hidden units all but the first are cut off, so that they hold that flying at the
    speed v along x is worth slope * v.
    """
    parameters: AlgorithmParameters = kind(hidden_sizes=(8,))
    algorithm = parameters.build(1, TEN_UES)
    with torch.no_grad():
        for name, values in algorithm.loss.state_dict().items():
            if values.ndim:
                values.zero_()
                if "actor" in name and name.endswith("2.bias"):
                    values[..., 0] = math.atanh(0.5)
                elif "value" in name and name.endswith("0.weight"):
                    values[..., 15, 0] = 1e-3  # behind the observation
                elif "value" in name and name.endswith("2.weight"):
                    values[..., 0, 0] = 1e3 * slope
    return imitating(algorithm, weight)[0] if weight else algorithm


def actor_loss(algorithm: Algorithm, batch: TensorDictBase) -> Tensor:
    """With the same draws, where there are any, in every call."""
    with given_normals(iter([torch.zeros(*batch.shape, 2)])):
        return algorithm.steps[1].loss(batch.clone())


@pytest.mark.parametrize("clock", [False, True])
def test_they_are_to_hover_and_with_a_clock_to_join_the_best_flight(clock: bool) -> None:
    flights, observation = Demonstrations(1, TEN_UES, 0.005), torch.zeros(1, 1, 15 + clock)
    flights.trajectory[10, 0] = torch.tensor([0.1, -0.9])  # after the slot that the clock tells
    algorithm = DDPG(hidden_sizes=(8,), clock=clock).build(1, TEN_UES)
    imitation = Imitation(algorithm, flights, Guide(), clock=clock)
    expected = [[0.0, 0.0], [0.5, -1.0]]
    torch.testing.assert_close(
        imitation.actions(observation), torch.tensor(expected[: 1 + clock])[None, :, None]
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("slope", "expected"), [(-1.0, 0.25), (-LITTLE, 0.0), (1.0, 0.0)])
def test_an_actor_is_drawn_to_one_only_where_it_is_clearly_better(
    kind: Any, slope: float, expected: float
) -> None:
    batch, weight = mini_batch(1, 5), 2.0
    plain = actor_loss(flying_along_x(kind, 0.0, slope), batch)
    added = actor_loss(flying_along_x(kind, weight, slope), batch) - plain
    # To hover is a distance of 0.5.
    torch.testing.assert_close(added, torch.full((1, 5), weight * expected))


@pytest.mark.parametrize("kind", [DDPG, TD3])
@pytest.mark.parametrize("slope", [-4.0, 4.0, -LITTLE])
def test_the_target_counts_the_best_one_where_it_is_clearly_better(kind: Any, slope: float) -> None:
    batch = mini_batch(1, 5)
    batch["action"].zero_()  # which the critics hold to be worth nothing
    batch["next", "reward"].fill_(2.0)
    batch["next", "terminated"][:, 0] = True
    algorithm = flying_along_x(kind, 1.0, slope)
    with given_normals(iter([torch.zeros(1, 5, 2)])):
        loss = algorithm.steps[0].loss(batch.clone())
    following = max(0.5 * slope, -MARGIN)
    critics = 1 + (kind is TD3)
    expected = torch.full((1, 5), critics * (2.0 + 0.95 * following) ** 2)
    expected[:, 0] = critics * 2.0**2
    torch.testing.assert_close(loss, expected, rtol=1e-3, atol=0.0)


def test_the_target_of_a_stochastic_actor_counts_it_too() -> None:
    batch = mini_batch(1, 5)
    batch["action"].zero_()
    batch["next", "reward"].fill_(2.0)
    algorithm = flying_along_x(SAC, 1.0, -400.0)  # for which any speed is worth far less
    with given_normals(iter([torch.zeros(1, 5, 2)])):
        loss = algorithm.steps[0].loss(batch.clone())
    expected = torch.full((1, 5), 2 * (2.0 - 0.95 * MARGIN) ** 2)
    torch.testing.assert_close(loss, expected, rtol=1e-3, atol=0.0)


@pytest.mark.parametrize("kind", KINDS)
def test_weighing_them_leaves_the_targets_without_gradients(kind: Any) -> None:
    torch.manual_seed(0)
    algorithm, _ = imitating(kind(hidden_sizes=(8,)).build(2, TEN_UES), 1.0)
    for index in range(1, 5):
        batch = mini_batch(2, 20)
        update_networks(algorithm, batch, index)
        update_targets(algorithm, index)
    for name, values in algorithm.loss.named_buffers():
        assert not values.requires_grad, name


@pytest.mark.parametrize("kind", KINDS)
def test_an_actor_that_is_behind_joins_the_best_flight_whatever_its_critics_hold(kind: Any) -> None:
    torch.manual_seed(0)
    unweighed = kind(clock=True, hidden_sizes=(8,)).build(2, TEN_UES)
    built = kind(clock=True, hidden_sizes=(8,)).build(2, TEN_UES)
    built.loss.load_state_dict(unweighed.loss.state_dict())
    algorithm, flights = imitating(built, 1.0, clock=True)
    flights.trajectory.fill_(0.3)
    batch = mini_batch(2, 5, observation_size=16)
    plain, before = actor_loss(unweighed, batch), actor_loss(algorithm, batch)
    flights.behind[1] = True
    after = actor_loss(algorithm, batch)
    action = algorithm.actor(batch.clone())["action"]
    away = (action - flights.demonstrate(batch["observation"])).square().sum(dim=-1)
    torch.testing.assert_close(after[1] - plain[1], away[1])
    torch.testing.assert_close(after[0], before[0])
    assert not torch.allclose(after[1], before[1])
