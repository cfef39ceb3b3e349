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
from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.common.vec_env import DummyVecEnv

from hyuav.benchmark.numpy_environment import NumpyEnv
from hyuav.benchmark.work import SLOTS_AT_A_TIME, Work


class DecayingNoise(ActionNoise):
    """Zero-mean Gaussian noise whose standard deviation decays after every slot.

    Args:
        variance: in the first slot, in units of v_max squared.
        decay: factor of the standard deviation.
        seed: of the noise.
    """

    def __init__(self, variance: float, decay: float, seed: int) -> None:
        super().__init__()
        self._std, self._decay = variance**0.5, decay
        self._rng = np.random.default_rng(seed)

    def __call__(self) -> NDArray[np.float32]:
        """The noise of one slot (2,), in units of v_max."""
        noise = self._std * self._rng.standard_normal(2, dtype=np.float32)
        self._std *= self._decay
        return noise


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
        library = importlib.import_module(self._library)
        self.model: Any = library.DDPG(
            "MlpPolicy",
            DummyVecEnv([lambda: env or NumpyEnv(work.scenario, seed=work.seed)]),
            learning_rate=work.actor_learning_rate,
            buffer_size=work.replay_size,
            learning_starts=work.batch_size - 1,  # trains once more than these are stored
            batch_size=work.batch_size,
            tau=work.target_rate,
            gamma=work.discount,
            train_freq=1,
            gradient_steps=1,
            action_noise=DecayingNoise(work.noise_variance, work.noise_decay, work.seed),
            policy_kwargs={"net_arch": [*work.hidden_sizes], "activation_fn": self._tanh()},
            seed=work.seed,
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
