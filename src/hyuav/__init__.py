"""Reinforcement learning for UAV-enabled secure offloading with a hybrid relay and jammer."""

import gymnasium

from hyuav.envs.secure_offloading import SecureOffloadingEnv
from hyuav.envs.transforms import make_env
from hyuav.errors import InputError, InputTypeError
from hyuav.scenario import Scenario

__all__ = ["InputError", "InputTypeError", "Scenario", "SecureOffloadingEnv", "make_env"]

gymnasium.register(
    "hyuav/SecureOffloading-v0",
    entry_point="hyuav.envs.gymnasium:SecureOffloadingGymEnv",
    vector_entry_point="hyuav.envs.gymnasium:SecureOffloadingVectorEnv",
)
