"""What every algorithm consists of; the training loop knows nothing else of it."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase, TensorDictParams
from torch import Tensor, nn
from torchrl.objectives import LossModule, SoftUpdate

from hyuav.learning.networks import ACTIVATIONS
from hyuav.parameters import Parameters, choice, count, number, parameter, sequence

learning_rate = number(0.0, 1.0)


@dataclass(frozen=True)
class AlgorithmParameters(Parameters, ABC):
    """What all algorithms have in common; the defaults are the paper's."""

    hidden_sizes: tuple[int, ...] = parameter(
        sequence(count(), "the sizes of at least one hidden layer"), (300, 100, 100)
    )
    activation: str = parameter(choice(*ACTIVATIONS), "tanh")
    actor_learning_rate: float = parameter(learning_rate, 1e-4)
    critic_learning_rate: float = parameter(learning_rate, 1e-4)
    discount: float = parameter(number(0.0, 1.0), 0.95, symbol="gamma")
    target_rate: float = parameter(number(0.0, 1.0), 0.005, symbol="tau")

    @abstractmethod
    def build(self, learners: int, observation_size: int) -> "Algorithm":
        """Make the networks, their targets, the loss, the optimizers and the exploration.

        Args:
            learners: N.
            observation_size: U + 5, or U + 6 with a clock.
        """


@dataclass(frozen=True)
class GradientStep:
    """One of the gradient steps that make up an update."""

    name: str
    loss: Callable[[TensorDictBase], Tensor]
    """Maps a mini-batch (N, K) to losses (N, K): learners in rows, transitions in columns."""
    optimizer: torch.optim.Optimizer
    every: int = 1
    """Taken in every n-th update."""
    normals: int = 0
    """Standard normal tensors (N, K, 2) that the loss draws."""


@dataclass(frozen=True)
class Algorithm:
    """The parts of an algorithm for N learners, ready to train."""

    actor: TensorDictModuleBase
    """mu: writes the noise-free ``action`` (N, ..., 2) from ``observation`` (N, ..., U + 5)."""
    explorer: TensorDictModuleBase
    """Writes the ``action`` to take in training."""
    loss: LossModule
    """TorchRL's loss, which holds the networks' and the target networks' weights."""
    steps: tuple[GradientStep, ...]
    """Taken in this order in every update."""
    target: SoftUpdate
    """theta' <- tau theta + (1 - tau) theta'."""
    target_every: int = 1
    """The targets follow in every n-th update."""

    def due(self, index: int) -> tuple[bool, ...]:
        """Which gradient steps the update of this index takes, and last whether targets follow."""
        return tuple(index % period == 0 for period in self._periods)

    @property
    def _periods(self) -> tuple[int, ...]:
        return (*(step.every for step in self.steps), self.target_every)

    @property
    def all_due(self) -> set[tuple[bool, ...]]:
        """Every combination of steps that an update takes."""
        return {self.due(index) for index in range(1, math.lcm(*self._periods) + 1)}

    def update_networks(self, batch: TensorDictBase, index: int) -> dict[str, Tensor]:
        """Take the gradient steps, eq. 9 and 10 for DDPG, on one mini-batch of each learner.

        Args:
            batch: (N, K) transitions.
            index: of this update, from 1, for the parts that are not taken every time.

        Returns:
            the mean loss (N,) of each step that was taken, by the step's name.
        """
        losses = {}
        for step, due in zip(self.steps, self.due(index), strict=False):
            if not due:
                continue
            loss = step.loss(batch).mean(dim=-1)
            step.optimizer.zero_grad()
            loss.sum().backward()  # learners share no weight, so the sum keeps them apart
            step.optimizer.step()
            losses[step.name] = loss.detach()
        return losses

    def update_targets(self, index: int) -> None:
        """Let the target networks follow, in every ``target_every``-th update."""
        if self.due(index)[-1]:
            self.target.step()

    @property
    def modules(self) -> nn.ModuleDict:
        """All weights and buffers that training changes."""
        return nn.ModuleDict({"loss": self.loss, "explorer": self.explorer})


def adam(weights: TensorDictParams, learning_rate: float) -> torch.optim.Adam:
    """Adam as the paper uses it, in PyTorch's fused form."""
    return torch.optim.Adam(weights.parameters(), lr=learning_rate, fused=True)
