"""DDPG from TorchRL's parts, laid out as TorchRL's own published DDPG script is."""

from typing import Any

import torch
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import nn
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import DoubleToFloat, GymWrapper, RewardSum, StepCounter, TransformedEnv
from torchrl.envs.transforms import Compose
from torchrl.modules import MLP, AdditiveGaussianModule, TanhModule, ValueOperator
from torchrl.objectives import DDPGLoss, SoftUpdate

from benchmarks.numpy_environment import NumpyEnv
from benchmarks.work import SLOTS_AT_A_TIME, Work


class TorchRLLoop:
    """Collector, replay buffer, loss, optimizers and target updater; one slot per collection.

    Args:
        work: to do.
    """

    width = 1

    def __init__(self, work: Work) -> None:
        torch.manual_seed(work.seed)
        self.work, self.warm_up_slots = work, work.batch_size + SLOTS_AT_A_TIME
        env = TransformedEnv(
            GymWrapper(NumpyEnv(work.scenario, seed=work.seed)),
            Compose(RewardSum(), StepCounter(), DoubleToFloat()),
        )
        actor, critic = _networks(work, env)
        self.noise = AdditiveGaussianModule(
            spec=env.action_spec,
            sigma_init=work.noise_variance**0.5,
            sigma_end=0.0,
            annealing_num_steps=1,  # not used: Algorithm 1's noise decays by a factor
        )
        self.collector = Collector(
            env,
            TensorDictSequential(actor, self.noise),
            frames_per_batch=1,
            total_frames=-1,
            auto_register_policy_transforms=False,
        )
        self.transitions = iter(self.collector)
        self.replay = TensorDictReplayBuffer(
            storage=LazyTensorStorage(work.replay_size), batch_size=work.batch_size
        )
        self.loss = DDPGLoss(actor, critic, loss_function="l2", delay_actor=True, delay_value=True)
        self.loss.make_value_estimator(gamma=work.discount)
        self.target = SoftUpdate(self.loss, tau=work.target_rate)
        self.critic_optimizer = torch.optim.Adam(
            self.loss.value_network_params.parameters(), lr=work.critic_learning_rate
        )
        self.actor_optimizer = torch.optim.Adam(
            self.loss.actor_network_params.parameters(), lr=work.actor_learning_rate
        )
        self.updates = 0

    def advance(self) -> int:
        """Train for some slots."""
        for _ in range(SLOTS_AT_A_TIME):
            self.replay.extend(next(self.transitions).reshape(-1))
            self.noise.sigma.mul_(self.work.noise_decay)
            if len(self.replay) >= self.work.batch_size:
                self.update()
        return SLOTS_AT_A_TIME

    def update(self) -> None:
        """One gradient step of the critic, one of the actor, and the targets follow."""
        batch = self.replay.sample()
        critic_loss, *_ = self.loss.loss_value(batch)
        self.critic_optimizer.zero_grad()
        critic_loss.backward()
        self.critic_optimizer.step()
        actor_loss, *_ = self.loss.loss_actor(batch)
        self.actor_optimizer.zero_grad()
        actor_loss.backward()
        self.actor_optimizer.step()
        self.target.step()
        self.updates += 1


def _networks(work: Work, env: Any) -> tuple[Any, Any]:
    """The actor and the critic of the paper's sizes."""
    sizes = {"num_cells": [*work.hidden_sizes], "activation_class": nn.Tanh}
    size = work.observation_size
    actor = TensorDictSequential(
        TensorDictModule(
            MLP(in_features=size, out_features=2, **sizes),
            in_keys=["observation"],
            out_keys=["param"],
        ),
        TanhModule(in_keys=["param"], out_keys=["action"], spec=env.action_spec),
    )
    critic = ValueOperator(
        MLP(in_features=size + 2, out_features=1, **sizes), in_keys=["observation", "action"]
    )
    return actor, critic
