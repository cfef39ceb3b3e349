"""The algorithms, one small builder each; a name on the command line chooses among them."""

from hyuav.learning.algorithms.base import Algorithm, AlgorithmParameters, GradientStep, adam
from hyuav.learning.algorithms.ddpg import DDPG
from hyuav.learning.algorithms.registry import ALGORITHMS, register
from hyuav.learning.algorithms.robust import RobustDDPG, RobustSAC, RobustTD3
from hyuav.learning.algorithms.sac import SAC
from hyuav.learning.algorithms.td3 import TD3

__all__ = [
    "ALGORITHMS",
    "DDPG",
    "SAC",
    "TD3",
    "Algorithm",
    "AlgorithmParameters",
    "GradientStep",
    "RobustDDPG",
    "RobustSAC",
    "RobustTD3",
    "adam",
    "register",
]
