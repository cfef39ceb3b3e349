import torch

from batches import TEN_UES, mini_batch
from hyuav.learning.td3 import TD3
from hyuav.learning.train import update_networks, update_targets
from hyuav.learning.weights import copy_weights


def test_actor_and_targets_follow_in_every_second_update() -> None:
    algorithm = TD3(hidden_sizes=(8,)).build(1, TEN_UES)
    kept = ("actor_network_params", "target_actor_network_params", "target_qvalue_network_params")
    for index, moves in ((1, False), (2, True), (3, False), (4, True)):
        before = copy_weights(algorithm.loss)
        losses = update_networks(algorithm, mini_batch(1, 20), index)
        update_targets(algorithm, index)
        after = copy_weights(algorithm.loss)
        changed = {
            prefix: any(
                not torch.equal(before[name], after[name])
                for name in before
                if name.startswith(prefix)
            )
            for prefix in (*kept, "qvalue_network_params")
        }
        assert changed == {**dict.fromkeys(kept, moves), "qvalue_network_params": True}
        assert ("actor" in losses) == moves


def test_the_twin_critics_begin_apart() -> None:
    weights = copy_weights(TD3(hidden_sizes=(8,)).build(2, TEN_UES).loss)
    critic = weights["qvalue_network_params.module.layers.0.weight"]
    assert critic.shape == (2, 2, 17, 8)
    assert not torch.equal(critic[0], critic[1])
