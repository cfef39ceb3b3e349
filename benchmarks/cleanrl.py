"""DDPG from top to bottom in one file and in plain, eager PyTorch, in the manner of CleanRL."""

import copy
import itertools

import numpy as np
import torch
from torch import Tensor, nn

from benchmarks.numpy_environment import NumpyEnv
from benchmarks.work import SLOTS_AT_A_TIME, Work


def mlp(*sizes: int, output: nn.Module | None = None) -> nn.Sequential:
    """Fully connected layers with tanh between them."""
    layers: list[nn.Module] = []
    for before, after in itertools.pairwise(sizes):
        layers += [nn.Linear(before, after), nn.Tanh()]
    return nn.Sequential(*layers[:-1], *([] if output is None else [output]))


class SingleFile:
    """A loop as a researcher would write it down.

    Args:
        work: to do.
    """

    width = 1

    def __init__(self, work: Work) -> None:
        torch.manual_seed(work.seed)
        self.work, self.warm_up_slots = work, work.batch_size + SLOTS_AT_A_TIME
        self.env = NumpyEnv(work.scenario, seed=work.seed)
        self.rng = np.random.default_rng(work.seed)
        size = work.observation_size
        self.actor = mlp(size, *work.hidden_sizes, 2, output=nn.Tanh())
        self.critic = mlp(size + 2, *work.hidden_sizes, 1)
        self.actor_target, self.critic_target = copy.deepcopy((self.actor, self.critic))
        self.actor_optimizer = torch.optim.Adam(
            self.actor.parameters(), lr=work.actor_learning_rate
        )
        self.critic_optimizer = torch.optim.Adam(
            self.critic.parameters(), lr=work.critic_learning_rate
        )
        # The truncation flag is not stored: no episode terminates, so every target bootstraps.
        self.observations = np.empty((work.replay_size, size), np.float32)
        self.actions = np.empty((work.replay_size, 2), np.float32)
        self.rewards = np.empty((work.replay_size, 1), np.float32)
        self.next_observations = np.empty((work.replay_size, size), np.float32)
        self.noise_std = work.noise_variance**0.5
        self.slots = self.updates = 0
        self.observation, _ = self.env.reset()

    def advance(self) -> int:
        """Train for some slots."""
        for _ in range(SLOTS_AT_A_TIME):
            self.fly()
            if self.slots >= self.work.batch_size:
                self.update()
        return SLOTS_AT_A_TIME

    def fly(self) -> None:
        """One slot with exploration noise, and into the replay buffer with it."""
        with torch.no_grad():
            action = self.actor(torch.from_numpy(self.observation)).numpy()
        action += self.noise_std * self.rng.standard_normal(2, dtype=np.float32)
        action = action.clip(-1.0, 1.0)
        self.noise_std *= self.work.noise_decay
        observation, reward, _, truncated, _ = self.env.step(action)
        row = self.slots % self.work.replay_size
        self.observations[row], self.actions[row] = self.observation, action
        self.rewards[row], self.next_observations[row] = reward, observation
        self.slots += 1
        self.observation = self.env.reset()[0] if truncated else observation

    def update(self) -> None:
        """One gradient step of the critic, one of the actor, and the targets follow."""
        stored = min(self.slots, self.work.replay_size)
        rows = self.rng.integers(stored, size=self.work.batch_size)
        observation, action, reward, following = (
            torch.from_numpy(array[rows])
            for array in (self.observations, self.actions, self.rewards, self.next_observations)
        )
        with torch.no_grad():
            next_value = self.value(self.critic_target, following, self.actor_target(following))
            target = reward + self.work.discount * next_value
        critic_loss = nn.functional.mse_loss(self.value(self.critic, observation, action), target)
        self.critic_optimizer.zero_grad()
        critic_loss.backward()
        self.critic_optimizer.step()

        actor_loss = -self.value(self.critic, observation, self.actor(observation)).mean()
        self.actor_optimizer.zero_grad()
        actor_loss.backward()
        self.actor_optimizer.step()

        self.follow(self.actor_target, self.actor)
        self.follow(self.critic_target, self.critic)
        self.updates += 1

    def value(self, critic: nn.Module, observation: Tensor, action: Tensor) -> Tensor:
        """Q(s, a): (K, 1)."""
        value: Tensor = critic(torch.cat([observation, action], dim=1))
        return value

    def follow(self, target: nn.Module, network: nn.Module) -> None:
        """The soft update: theta' <- tau theta + (1 - tau) theta'."""
        with torch.no_grad():
            for slow, fast in zip(target.parameters(), network.parameters(), strict=True):
                slow.lerp_(fast, self.work.target_rate)
