"""Replay along the learner axis: one buffer, in which each learner samples only its own past."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import torch
from tensordict import NestedKey, TensorDictBase
from torch import Tensor
from torchrl.data import ReplayBuffer, TensorStorage
from torchrl.data.replay_buffers import RandomSampler, RoundRobinWriter, Storage
from torchrl.envs import EnvBase

from hyuav.learning.torchrl_internals import cursor_of

TRANSITION: tuple[NestedKey, ...] = (
    "observation",
    "action",
    ("next", "observation"),
    ("next", "reward"),
    ("next", "done"),
    ("next", "terminated"),
)
"""What a mini-batch consists of: (s_t, a_t, r_t, s_{t+1}) and whether the episode ended."""

FADING: NestedKey = ("next", "fading")


def sampled_slots(uniform: Tensor, length: int | Tensor) -> Tensor:
    """Which of the ``length`` slots stored are drawn, from numbers in [0, 1): (N, K) int64."""
    return (uniform * length).long().clamp(max=length - 1)  # rounding may reach the length


class LearnerSampler(RandomSampler):
    """Draw K slots for each learner, with replacement, each learner its own.

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


def make_replay(slots: TensorDictBase, batch_size: int, uniforms: Iterator[Tensor]) -> ReplayBuffer:
    """The buffer B of Algorithm 1 for N learners, empty.

    Add one slot of all learners, a tensordict (N,) as :meth:`TransitionOptions.transition` makes
    it; a sample is (N, K). When the buffer is full, the oldest slots are overwritten.

    Args:
        slots: (capacity, N), in which transitions are stored.
        batch_size: K.
        uniforms: gives numbers in [0, 1) for each mini-batch, (N, K).
    """
    replay = ReplayBuffer(
        storage=TensorStorage(slots, device=slots.device),
        sampler=LearnerSampler(uniforms),
        writer=RoundRobinWriter(),
        batch_size=batch_size,
    )
    replay.empty()
    return replay


def latest(replay: ReplayBuffer, count: int) -> Tensor:
    """Where in the storage the slots are that were stored last, the oldest first: (count,) int64.

    They are fewer where the storage is smaller.
    """
    capacity = replay.storage.max_size
    ages = torch.arange(min(count, capacity), 0, -1, device=replay.storage.device)
    return (cursor_of(replay) - ages) % capacity


@dataclass(frozen=True)
class TransitionOptions:
    """What a learner keeps of a slot."""

    reward_scale: float = 1.0
    """Factor of all rewards."""
    finite_horizon: bool = False
    """The last slot of an episode ends the return, which otherwise goes on past it."""
    beside: tuple[NestedKey, ...] = ()
    """Entries of the slot that are kept beside the transition."""

    @property
    def names(self) -> tuple[NestedKey, ...]:
        """All entries that are kept."""
        return (*TRANSITION, *self.beside)

    def transition(self, slot: TensorDictBase) -> TensorDictBase:
        """What is kept of a collected slot (N,)."""
        kept = slot.select(*self.names)
        if self.reward_scale != 1.0:
            kept["next", "reward"] = kept["next", "reward"] * self.reward_scale
        if self.finite_horizon:
            kept["next", "terminated"] = kept["next", "done"].clone()
        return kept

    def allocate(self, env: EnvBase, capacity: int) -> TensorDictBase:
        """Room for the transitions (capacity, N) of what flies in an environment (N,)."""
        slot = env.fake_tensordict().select(*self.names)
        return torch.zeros_like(slot.expand(capacity, *slot.batch_size))
