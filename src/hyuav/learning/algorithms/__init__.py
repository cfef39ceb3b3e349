"""The algorithms, one small builder each; a name on the command line chooses among them."""

from hyuav.learning.algorithms.base import Algorithm, AlgorithmParameters, GradientStep
from hyuav.learning.algorithms.ddpg import DDPG
from hyuav.learning.algorithms.robust import RobustDDPG, RobustTD3
from hyuav.learning.algorithms.sac import SAC
from hyuav.learning.algorithms.td3 import TD3

ALGORITHMS: dict[str, type[DDPG | TD3 | SAC]] = {
    "ddpg": DDPG,
    "td3": TD3,
    "sac": SAC,
    "ddpg_robust": RobustDDPG,
    "td3_robust": RobustTD3,
}

__all__ = [
    "ALGORITHMS",
    "DDPG",
    "SAC",
    "TD3",
    "Algorithm",
    "AlgorithmParameters",
    "GradientStep",
    "RobustDDPG",
    "RobustTD3",
]
