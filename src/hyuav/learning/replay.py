"""Replay along the learner axis: one buffer, in which each learner samples only its own past."""

from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import LazyTensorStorage, ReplayBuffer
from torchrl.data.replay_buffers import RandomSampler, Storage

TRANSITION = (
    "observation",
    "action",
    ("next", "observation"),
    ("next", "reward"),
    ("next", "done"),
    ("next", "terminated"),
)
"""What a mini-batch consists of: (s_t, a_t, r_t, s_{t+1}) and whether the episode ended."""


class LearnerSampler(RandomSampler):
    """Draw K slots for each learner, uniformly and with replacement, each learner its own.

    Args:
        learners: N.
    """

    def __init__(self, learners: int) -> None:
        super().__init__()
        self._learners = torch.arange(learners).unsqueeze(-1)

    def sample(
        self, storage: Storage, batch_size: int
    ) -> tuple[tuple[Tensor, Tensor], dict[str, Any]]:
        """The (slots, learners) index, each (N, K), into a storage of (capacity, N)."""
        shape = (len(self._learners), batch_size)
        slots = torch.randint(len(storage), shape, device=storage.device)
        return (slots, self._learners.to(slots.device).expand(shape)), {}


def make_replay(
    learners: int, capacity: int, batch_size: int, device: torch.device
) -> ReplayBuffer:
    """The buffer B of Algorithm 1 for N learners.

    Add one slot of all learners, a tensordict (N,) with the entries of :data:`TRANSITION`;
    a sample is (N, K).

    Args:
        learners: N.
        capacity: transitions kept of each learner; then the oldest are overwritten.
        batch_size: K.
        device: of the storage.
    """
    return ReplayBuffer(
        storage=LazyTensorStorage(capacity, device=device),
        sampler=LearnerSampler(learners),
        batch_size=batch_size,
    )


def as_transition(slot: TensorDictBase) -> TensorDictBase:
    """Keep of a collected slot (N,) what a mini-batch needs."""
    return slot.select(*TRANSITION)
