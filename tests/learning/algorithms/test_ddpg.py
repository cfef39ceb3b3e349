"""DDPG's update against the paper's equations 9 and 10, written out in plain PyTorch."""

import copy
import math

import pytest
import torch
from torch import Tensor, nn

from batches import TEN_UES, mini_batch
from hyuav.learning.algorithms import DDPG, TD3, Algorithm
from hyuav.learning.algorithms.ddpg import CLEARLY
from hyuav.learning.repetition import BestFlights
from hyuav.randomness import given_normals

SIZES = (15, 12, 8, 8, 2)


def plain(weights: dict[str, Tensor], prefix: str, learner: int, *, squash: bool) -> nn.Sequential:
    """One learner's network as ordinary layers."""
    layers: list[nn.Module] = []
    for index in range(0, 7, 2):
        weight = weights[f"{prefix}.module.layers.{index}.weight"][learner]
        layer = nn.Linear(*weight.shape)
        layer.weight.data = weight.T.clone()
        layer.bias.data = weights[f"{prefix}.module.layers.{index}.bias"][learner, 0].clone()
        layers += [layer, nn.Tanh()]
    return nn.Sequential(*(layers if squash else layers[:-1]))


def test_an_update_is_the_papers_for_every_learner() -> None:
    torch.manual_seed(0)
    hyperparameters = DDPG(hidden_sizes=(12, 8, 8), actor_learning_rate=1e-3)
    algorithm = hyperparameters.build(2, TEN_UES)
    start = copy.deepcopy(algorithm.loss.state_dict())
    batch = mini_batch(2, 70)
    algorithm.update_networks(batch.clone(), 1)
    algorithm.update_targets(1)
    after = algorithm.loss.state_dict()

    for learner in range(2):
        actor = plain(start, "actor_network_params", learner, squash=True)
        critic = plain(start, "value_network_params", learner, squash=False)
        target_actor, target_critic = copy.deepcopy(actor), copy.deepcopy(critic)
        data = batch[learner]
        observation, following = data["observation"], data["next", "observation"]
        with torch.no_grad():
            bootstrap = target_critic(torch.cat([following, target_actor(following)], -1))
            target = data["next", "reward"] + 0.95 * bootstrap
        critic_optimizer = torch.optim.Adam(critic.parameters(), 1e-4)
        value = critic(torch.cat([observation, data["action"]], -1))
        (value - target).square().mean().backward()
        critic_optimizer.step()
        actor_optimizer = torch.optim.Adam(actor.parameters(), 1e-3)
        (-critic(torch.cat([observation, actor(observation)], -1)).mean()).backward()
        actor_optimizer.step()

        for prefix, network, target_network, squash in (
            ("actor_network_params", actor, target_actor, True),
            ("value_network_params", critic, target_critic, False),
        ):
            ours = plain(after, prefix, learner, squash=squash)
            followed = plain(after, f"target_{prefix}", learner, squash=squash)
            for mine, theirs, old, target_mine in zip(
                ours.parameters(),
                network.parameters(),
                target_network.parameters(),
                followed.parameters(),
                strict=True,
            ):
                torch.testing.assert_close(mine, theirs, rtol=1e-4, atol=1e-6)
                torch.testing.assert_close(
                    target_mine, 0.005 * theirs + 0.995 * old, rtol=1e-4, atol=1e-6
                )


def test_targets_begin_as_copies_of_the_networks() -> None:
    state = DDPG(hidden_sizes=(4,)).build(2, TEN_UES).loss.state_dict()
    for name in ("actor_network_params", "value_network_params"):
        for key in [key for key in state if key.startswith(name)]:
            assert torch.equal(state[key], state[f"target_{key}"])


def test_the_defaults_are_the_papers() -> None:
    assert DDPG().to_dict() == {
        "hidden_sizes": [300, 100, 100],
        "activation": "tanh",
        "actor_learning_rate": 1e-4,
        "critic_learning_rate": 1e-4,
        "discount": 0.95,
        "target_rate": 0.005,
        "noise_variance": 0.6,
        "noise_decay": 0.999,
        "noise_decay_per": "slot",
        # What the paper does not have:
        "clock": False,
        "geofence": False,
        "finite_horizon": False,
        "reward_scale": 1.0,
        "layer_norm": False,
        "warm_up_episodes": 0,
        "repeat_every": 0,
        "action_stretch": 1.0,
        "alternatives_weight": 0.0,
        "control_variate": False,
        "imagined_flights": 0,
        "afterstate": False,
    }


def flying_along_x(kind: type[DDPG], weight: float, slope: float) -> Algorithm:
    """One learner that flies at half speed along x, and critics for which speed has this slope.

    Of their hidden units all but the first are cut off, so that they hold that flying at the
    speed v along x is worth slope * v.
    """
    algorithm = kind(clock=False, hidden_sizes=(8,), alternatives_weight=weight).build(1, TEN_UES)
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
    return algorithm


@pytest.mark.parametrize("clock", [False, True])
def test_the_alternatives_are_to_hover_and_with_a_clock_to_join_the_best_flight(
    clock: bool,
) -> None:
    flights, observation = BestFlights(1, TEN_UES), torch.zeros(1, 1, 15 + clock)
    flights.way[10, 0] = torch.tensor([0.1, -0.9])  # after the slot that the clock tells
    found = DDPG(clock=clock).alternatives(flights, observation)
    expected = [[0.0, 0.0], [0.5, -1.0]]
    torch.testing.assert_close(found, torch.tensor(expected[: 1 + clock])[None, :, None])


LITTLE = 1.8 * CLEARLY
"""A slope at which hovering, from half speed, gains less than what counts."""


@pytest.mark.parametrize("kind", [DDPG, TD3])
@pytest.mark.parametrize(("slope", "expected"), [(-1.0, 0.25), (-LITTLE, 0.0), (1.0, 0.0)])
def test_an_actor_is_drawn_to_an_alternative_only_where_it_is_clearly_better(
    kind: type[DDPG], slope: float, expected: float
) -> None:
    batch, weight = mini_batch(1, 5), 2.0
    algorithm = flying_along_x(kind, weight, slope)
    plain = flying_along_x(kind, 0.0, slope).steps[1].loss(batch.clone())
    added = algorithm.steps[1].loss(batch.clone()) - plain
    # To hover is a distance of 0.5.
    torch.testing.assert_close(added, torch.full((1, 5), weight * expected))


@pytest.mark.parametrize("kind", [DDPG, TD3])
@pytest.mark.parametrize("slope", [-4.0, 4.0, -LITTLE])
def test_the_target_counts_the_best_alternative_where_it_is_clearly_better(
    kind: type[DDPG], slope: float
) -> None:
    batch = mini_batch(1, 5)
    batch["action"].zero_()  # which the critics hold to be worth nothing
    batch["next", "reward"].fill_(2.0)
    batch["next", "terminated"][:, 0] = True
    algorithm = flying_along_x(kind, 1.0, slope)
    with given_normals(iter([torch.zeros(1, 5, 2)])):
        loss = algorithm.steps[0].loss(batch.clone())
    following = max(0.5 * slope, -CLEARLY)
    critics = 1 + (kind is TD3)
    expected = torch.full((1, 5), critics * (2.0 + 0.95 * following) ** 2)
    expected[:, 0] = critics * 2.0**2
    torch.testing.assert_close(loss, expected, rtol=1e-3, atol=0.0)


@pytest.mark.parametrize("kind", [DDPG, TD3])
def test_weighing_alternatives_leaves_the_targets_without_gradients(kind: type[DDPG]) -> None:
    torch.manual_seed(0)
    algorithm = kind(clock=False, hidden_sizes=(8,), alternatives_weight=1.0).build(2, TEN_UES)
    for index in range(1, 5):
        batch = mini_batch(2, 20)
        algorithm.update_networks(batch, index)
        algorithm.update_targets(index)
    for name, values in algorithm.loss.named_buffers():
        assert not values.requires_grad, name


@pytest.mark.parametrize("kind", [DDPG, TD3])
def test_an_actor_that_is_behind_joins_the_best_flight_whatever_its_critics_hold(
    kind: type[DDPG],
) -> None:
    torch.manual_seed(0)
    algorithm = kind(clock=True, hidden_sizes=(8,), alternatives_weight=1.0).build(2, TEN_UES)
    flights = algorithm.best_flights
    assert flights is not None
    flights.way.fill_(0.3)
    batch = mini_batch(2, 5, observation_size=16)
    action = algorithm.actor(batch.clone())["action"]
    parameters = algorithm.parameters
    assert isinstance(parameters, DDPG)
    before = parameters.missed(algorithm.loss, flights, batch)
    flights.behind[1] = True
    missed = parameters.missed(algorithm.loss, flights, batch)
    assert isinstance(before, torch.Tensor)
    assert isinstance(missed, torch.Tensor)
    away = (action - flights.towards(batch["observation"])).square().sum(dim=-1)
    torch.testing.assert_close(missed[1], away[1])
    torch.testing.assert_close(missed[0], before[0])
    assert not torch.allclose(missed[1], before[1])
