"""Stable-Baselines3's DDPG (PyTorch) and SBX's (JAX), doing the work of Algorithm 1.

Both are their libraries' own DDPG classes with one critic. They differ from Algorithm 1 in
nothing that takes time: the first actions are drawn uniformly, SBX halves the critic's loss and
lets the targets follow before the actor's step. Both draw a target noise that they then clip to
zero. Truncated episodes bootstrap. The environment is handed over without a monitor.
"""

import importlib
from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.numpy_environment import NumpyEnv
from benchmarks.work import SLOTS_AT_A_TIME, Work
from hyuav.experiments.comparison.peer import ddpg_model


class StableBaselines3:
    """Stable-Baselines3: ``stable_baselines3.DDPG``.

    Args:
        work: to do.
        env: to do it in; None for the NumPy environment.
    """

    width = 1

    def __init__(
        self,
        work: Work,
        env: gymnasium.Env[NDArray[np.float32], NDArray[np.float32]] | None = None,
    ) -> None:
        self.warm_up_slots = work.batch_size + SLOTS_AT_A_TIME
        self.model: Any = ddpg_model(
            self._library,
            env or NumpyEnv(work.scenario, seed=work.seed),
            self._tanh(),
            batch_size=work.batch_size,
            replay_size=work.replay_size,
            seed=work.seed,
            hidden_sizes=work.hidden_sizes,
            learning_rate=work.actor_learning_rate,
            discount=work.discount,
            target_rate=work.target_rate,
            noise_variance=work.noise_variance,
            noise_decay=work.noise_decay,
            device=work.device,
            **self._critic(work),
        )

    _library = "stable_baselines3"

    def _tanh(self) -> Any:
        return torch.nn.Tanh

    def _critic(self, work: Work) -> dict[str, Any]:
        if work.critic_learning_rate != work.actor_learning_rate:
            raise ValueError("Stable-Baselines3 has one learning rate for actor and critic")
        return {}

    @property
    def updates(self) -> int:
        """Made so far."""
        return int(self.model._n_updates)

    def advance(self) -> int:
        """Train for some slots."""
        self.model.learn(SLOTS_AT_A_TIME, reset_num_timesteps=False, log_interval=None)
        return SLOTS_AT_A_TIME


class SBX(StableBaselines3):
    """SBX: ``sbx.DDPG``, which compiles each update with JAX.

    Args:
        work: to do.
    """

    _library = "sbx"

    def _tanh(self) -> Any:
        return importlib.import_module("jax").numpy.tanh

    def _critic(self, work: Work) -> dict[str, Any]:
        return {"qf_learning_rate": work.critic_learning_rate}
