"""The DDPG of Stable-Baselines3 and of SBX, set to do the work of Algorithm 1.

It is their libraries' own DDPG class with one critic. Nothing else of this project is imported
here: a peer's start-up time and memory are its own.
"""

import importlib
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import flatdim
from numpy.typing import NDArray
from stable_baselines3.common.noise import ActionNoise
from stable_baselines3.common.vec_env import DummyVecEnv


class DecayingNoise(ActionNoise):
    """Zero-mean Gaussian noise whose standard deviation decays after every slot.

    Args:
        variance: in the first slot, in units of v_max squared.
        decay: factor of the standard deviation.
        seed: of the noise.
        size: of an action.
    """

    def __init__(self, variance: float, decay: float, seed: int, size: int = 2) -> None:
        super().__init__()
        self._size = size
        self._std, self._decay = variance**0.5, decay
        self._rng = np.random.default_rng(seed)

    def __call__(self) -> NDArray[np.float32]:
        """The noise of one slot (size,), in units of v_max."""
        noise = self._std * self._rng.standard_normal(self._size, dtype=np.float32)
        self._std *= self._decay
        return noise


def ddpg_model(
    library: str,
    env: gymnasium.Env[NDArray[np.float32], NDArray[np.float32]],
    activation: Any,
    *,
    batch_size: int,
    replay_size: int,
    seed: int,
    hidden_sizes: Sequence[int] = (300, 100, 100),
    learning_rate: float = 1e-4,
    discount: float = 0.95,
    target_rate: float = 0.005,
    noise_variance: float = 0.6,
    noise_decay: float = 0.999,
    **options: Any,
) -> Any:
    """The library's DDPG, set to do the work of Algorithm 1 with one update after every slot.

    The hyperparameters are the paper's by default.

    Args:
        library: "stable_baselines3", or "sbx" with the same interface.
        env: to train in.
        activation: of the hidden layers, of the library's framework.
        batch_size: K.
        replay_size: transitions kept.
        seed: of weights, noise and sampling.
        hidden_sizes: of actor and critic.
        learning_rate: of both.
        discount: gamma.
        target_rate: tau.
        noise_variance: of the exploration in the first slot, in units of v_max squared.
        noise_decay: factor of the noise's standard deviation after every slot.
        options: what else the library's class is given.
    """
    return importlib.import_module(library).DDPG(
        "MlpPolicy",
        DummyVecEnv([lambda: env]),
        learning_rate=learning_rate,
        buffer_size=replay_size,
        learning_starts=batch_size - 1,  # trains once more than these are stored
        batch_size=batch_size,
        tau=target_rate,
        gamma=discount,
        train_freq=1,
        gradient_steps=1,
        action_noise=DecayingNoise(noise_variance, noise_decay, seed, flatdim(env.action_space)),
        policy_kwargs={"net_arch": [*hidden_sizes], "activation_fn": activation},
        seed=seed,
        **options,
    )
