"""What learning needs of what TorchRL keeps to itself, its private attributes, all in one place."""

import math
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn
from torchrl.collectors import Collector
from torchrl.data import ReplayBuffer
from torchrl.objectives import SACLoss
from torchrl.objectives.sac import compute_rsample_log_prob


def next_observation(collector: Collector) -> TensorDictBase:
    """What the collector's next slot begins with, (N,); it may be changed in place."""
    carrier: TensorDictBase = collector._carrier
    return carrier


def cursor_of(replay: ReplayBuffer) -> int:
    """Where in its storage a buffer puts the next slot."""
    return int(replay.writer._cursor)


def set_filled(replay: ReplayBuffer, length: int, cursor: int) -> None:
    """Let a buffer know what was written to its storage by others.

    Args:
        replay: whose storage was allocated beforehand.
        length: how many slots are stored.
        cursor: where the next one goes.
    """
    replay.storage._len = length
    replay.writer._cursor = cursor


class LearnerSACLoss(SACLoss):
    """TorchRL's SAC loss with a temperature of its own for each learner."""

    def __init__(self, *networks: Any, learners: int, alpha_init: float, **options: Any) -> None:
        super().__init__(*networks, alpha_init=alpha_init, **options)
        # (N, 1) broadcasts against the log-probabilities (N, K) of a mini-batch.
        self.log_alpha = nn.Parameter(torch.full((learners, 1), math.log(alpha_init)))
        _ = self.target_entropy  # a buffer that is otherwise made when it is first asked for

    def _compute_target_v2(self, tensordict: TensorDictBase) -> Tensor:
        """The target (N, K), as TorchRL's but for the temperatures, which multiply (N, K) here."""
        with torch.no_grad():
            following = tensordict["next"].select(*self.actor_network.in_keys)
            with self.actor_network_params.to_module(
                self.actor_network, preserve_module_state=False
            ):
                distribution = self.actor_network.get_dist(following)
            action, log_probability = compute_rsample_log_prob(distribution)
            following["action"] = action
            critics = self._vmap_qnetworkN0(following, self.target_qvalue_network_params)
            value = critics["state_action_value"].min(dim=0).values
            value = value - (self._alpha * log_probability).unsqueeze(-1)
            tensordict = tensordict.clone(False)
            tensordict["next", self.value_estimator.tensor_keys.value] = value
            return self.value_estimator.value_estimate(tensordict).squeeze(-1)

    def actor_and_temperature_loss(self, batch: TensorDictBase) -> Tensor:
        """Both losses (N, K) from one sample of actions; neither's gradient reaches the other."""
        actor_loss, metadata = self.actor_loss(batch)
        return actor_loss + self.alpha_loss(metadata["log_prob"])
