"""Variants whose learners rarely stick, with one setting for any layout, scheme and horizon.

What each piece is for, and how near to the optimum they come, is told in docs/results.md.
"""

from dataclasses import dataclass

from hyuav._support.parameters import choice, count, number, parameter, switch
from hyuav.learning.algorithm import AlgorithmParameters, learning_rate
from hyuav.learning.ddpg import DDPG
from hyuav.learning.sac import SAC
from hyuav.learning.td3 import TD3


@dataclass(frozen=True)
class Robust(AlgorithmParameters):
    """What the variants have in common."""

    actor_learning_rate: float = parameter(learning_rate, 3e-4)
    critic_learning_rate: float = parameter(learning_rate, 3e-4)
    target_rate: float = parameter(number(0.0, 1.0), 0.01, symbol="tau")
    clock: bool = parameter(switch, True)
    geofence: bool = parameter(switch, True)
    reward_scale: float = parameter(number(above=0.0), 0.05)
    layer_norm: bool = parameter(switch, True)
    afterstate: bool = parameter(switch, True)
    warm_up_episodes: int = parameter(count(0), 100)
    repeat_every: int = parameter(count(0), 4)
    control_variate: bool = parameter(switch, True)
    imagined_flights: int = parameter(count(0, 100_000), 64)
    action_stretch: float = parameter(number(1.0, 2.0), 1.04)
    alternatives_weight: float = parameter(number(0.0, 1e6), 0.1)


@dataclass(frozen=True)
class RobustDDPG(Robust, DDPG):
    """DDPG that looks for the best flight within the horizon, and does not forget a good one."""

    noise_variance: float = parameter(number(0.0, 1e6), 0.16)
    noise_decay: float = parameter(number(0.0, 1.0), 0.985)
    noise_decay_per: str = parameter(choice("slot", "episode"), "episode")


@dataclass(frozen=True)
class RobustTD3(RobustDDPG, TD3):
    """TD3 with the same pieces."""


@dataclass(frozen=True)
class RobustSAC(Robust, SAC):
    """SAC with the same pieces; its noise-free actor is stretched, what it explores with is not."""

    temperature_init: float = parameter(number(1e-6, 1e6), 0.01)
    target_entropy: float = parameter(number(-100.0, 100.0), -4.0)
