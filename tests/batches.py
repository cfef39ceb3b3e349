"""Random mini-batches, for tests of the algorithms."""

import torch
from tensordict import TensorDict, TensorDictBase

from hyuav import Scenario

TEN_UES = Scenario.preset("two_clusters")
"""Its observations have 15 entries."""


def mini_batch(learners: int, size: int, observation_size: int = 15) -> TensorDictBase:
    """Transitions (learners, size) with the entries that the losses read."""
    shape = (learners, size)
    flag, reward = torch.zeros(*shape, 1, dtype=torch.bool), torch.randn(*shape, 1)
    return TensorDict(
        observation=torch.randn(*shape, observation_size),
        action=torch.rand(*shape, 2) * 2 - 1,
        next=TensorDict(
            observation=torch.randn(*shape, observation_size),
            reward=reward,
            done=flag,
            terminated=flag,
            batch_size=shape,
        ),
        batch_size=shape,
    )
