"""Variants whose learners rarely stick, with one setting for any layout, scheme and horizon.

What each piece is for, and how near to the optimum they come, is told in docs/results.md.
"""

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from hyuav._support.parameters import CountOrZero, Fraction, OneOf, PositiveNumber, parameter
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.ddpg import DDPG
from hyuav.learning.sac import SAC
from hyuav.learning.td3 import TD3


@dataclass(frozen=True)
class Robust(AlgorithmParameters):
    """What the variants have in common."""

    actor_learning_rate: Fraction = parameter(3e-4)
    critic_learning_rate: Fraction = parameter(3e-4)
    target_rate: Fraction = parameter(0.01, symbol="tau")
    clock: bool = parameter(True)
    geofence: bool = parameter(True)
    reward_scale: PositiveNumber = parameter(0.05)
    layer_norm: bool = parameter(True)
    afterstate: bool = parameter(True)
    warm_up_episodes: CountOrZero = parameter(100)
    repeat_every: CountOrZero = parameter(4)
    control_variate: bool = parameter(True)
    imagined_flights: Annotated[int, Field(ge=0, le=100_000)] = parameter(64)
    action_stretch: Annotated[float, Field(ge=1.0, le=2.0)] = parameter(1.04)
    alternatives_weight: Annotated[float, Field(ge=0.0, le=1e6)] = parameter(0.1)


@dataclass(frozen=True)
class RobustDDPG(Robust, DDPG):
    """DDPG that looks for the best flight within the horizon, and does not forget a good one."""

    noise_variance: Annotated[float, Field(ge=0.0, le=1e6)] = parameter(0.16)
    noise_decay: Fraction = parameter(0.985)
    noise_decay_per: Annotated[str, OneOf("slot", "episode")] = parameter("episode")


@dataclass(frozen=True)
class RobustTD3(RobustDDPG, TD3):
    """TD3 with the same pieces."""


@dataclass(frozen=True)
class RobustSAC(Robust, SAC):
    """SAC with the same pieces; its noise-free actor is stretched, what it explores with is not."""

    temperature_init: Annotated[float, Field(ge=1e-6, le=1e6)] = parameter(0.01)
    target_entropy: Annotated[float, Field(ge=-100.0, le=100.0)] = parameter(-4.0)
