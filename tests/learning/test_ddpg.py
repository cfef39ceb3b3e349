"""DDPG's update against the paper's equations 9 and 10, written out in plain PyTorch."""

import copy

import torch
from torch import Tensor, nn

from batches import TEN_UES, mini_batch
from hyuav.learning.ddpg import DDPG
from hyuav.learning.train import update_networks, update_targets

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
    update_networks(algorithm, batch.clone(), 1)
    update_targets(algorithm, 1)
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
        "reward_scale": 1.0,
        "layer_norm": False,
        "action_scale": 1.0,
        "afterstate": False,
        "coverage_blur": 0.02,
    }
