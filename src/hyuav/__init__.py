"""Reinforcement learning for UAV-enabled secure offloading with a hybrid relay and jammer."""

import os

import gymnasium

from hyuav._support.errors import InputError, InputTypeError
from hyuav.envs.secure_offloading import SecureOffloadingEnv
from hyuav.envs.transforms import make_env
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.parameters import Guide
from hyuav.learning.guide.robust import RobustDDPG, RobustSAC, RobustTD3
from hyuav.learning.registry import OWN_FILES, register, run_own_files
from hyuav.learning.sac import SAC
from hyuav.learning.td3 import TD3
from hyuav.learning.train import Learner
from hyuav.learning.training import Training, TrainingParameters
from hyuav.physics.scenario import Scenario

__all__ = [
    "DDPG",
    "SAC",
    "TD3",
    "Guide",
    "InputError",
    "InputTypeError",
    "Learner",
    "RobustDDPG",
    "RobustSAC",
    "RobustTD3",
    "Scenario",
    "SecureOffloadingEnv",
    "Training",
    "TrainingParameters",
    "make_env",
    "register",
]

gymnasium.register(
    "hyuav/SecureOffloading-v0",
    entry_point="hyuav.envs.gymnasium:SecureOffloadingGymEnv",
    vector_entry_point="hyuav.envs.gymnasium:SecureOffloadingVectorEnv",
)

run_own_files(os.environ.get(OWN_FILES, ""))  # last: they import from above
