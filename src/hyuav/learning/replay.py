"""Replay along the learner axis: one buffer, in which each learner samples only its own past."""

from collections.abc import Iterator
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


def sampled_slots(uniform: Tensor, length: int | Tensor) -> Tensor:
    """Which of the ``length`` slots stored are drawn, from numbers in [0, 1): (N, K) int64."""
    return (uniform * length).long().clamp(max=length - 1)  # rounding may reach the length


class LearnerSampler(RandomSampler):
    """Draw K slots for each learner, uniformly and with replacement, each learner its own.

    Args:
        uniforms: gives numbers in [0, 1) for each mini-batch, (N, K).
    """

    def __init__(self, uniforms: Iterator[Tensor]) -> None:
        super().__init__()
        self._uniforms = uniforms

    def sample(
        self, storage: Storage, batch_size: int
    ) -> tuple[tuple[Tensor, Tensor], dict[str, Any]]:
        """The (slots, learners) index, each (N, K), into a storage of (capacity, N)."""
        slots = sampled_slots(next(self._uniforms)[:, :batch_size], len(storage))
        learners = torch.arange(len(slots), device=slots.device).unsqueeze(-1)
        return (slots, learners.expand(slots.shape)), {}


def make_replay(
    capacity: int, batch_size: int, uniforms: Iterator[Tensor], device: torch.device
) -> ReplayBuffer:
    """The buffer B of Algorithm 1 for N learners.

    Add one slot of all learners, a tensordict (N,) with the entries of :data:`TRANSITION`;
    a sample is (N, K).

    Args:
        capacity: transitions kept of each learner; then the oldest are overwritten.
        batch_size: K.
        uniforms: gives numbers in [0, 1) for each mini-batch, (N, K).
        device: of the storage.
    """
    return ReplayBuffer(
        storage=LazyTensorStorage(capacity, device=device),
        sampler=LearnerSampler(uniforms),
        batch_size=batch_size,
    )


def as_transition(slot: TensorDictBase) -> TensorDictBase:
    """Keep of a collected slot (N,) what a mini-batch needs."""
    return slot.select(*TRANSITION)
