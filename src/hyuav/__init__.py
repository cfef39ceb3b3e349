"""Reinforcement learning for UAV-enabled secure offloading with a hybrid relay and jammer."""

from hyuav.envs.secure_offloading import SecureOffloadingEnv
from hyuav.envs.transforms import make_env
from hyuav.errors import InputError, InputTypeError
from hyuav.scenario import Scenario

__all__ = ["InputError", "InputTypeError", "Scenario", "SecureOffloadingEnv", "make_env"]
