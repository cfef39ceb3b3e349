"""Variants whose learners rarely stick, with one setting for any layout, scheme and horizon.

What each piece is for, and how near to the optimum they come, is told in docs/results.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from pydantic.dataclasses import dataclass
from torchrl.envs import TransformedEnv

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import Fraction, PositiveNumber, parameter
from hyuav.envs.reward import POSITION, Reward
from hyuav.learning.algorithm import ActionScale, Algorithm, AlgorithmParameters
from hyuav.learning.ddpg import DDPG, NoiseVariance, SlotOrEpisode
from hyuav.learning.guide.parameters import Guide
from hyuav.learning.guide.planner import Planner
from hyuav.learning.guide.reward_model import feature_count
from hyuav.learning.memory import Need
from hyuav.learning.replay import FADING, TransitionOptions
from hyuav.learning.sac import SAC, Entropy, Temperature
from hyuav.learning.td3 import TD3
from hyuav.physics.channel import LinkRow
from hyuav.physics.scenario import Scenario


@dataclass(frozen=True)
class Robust(AlgorithmParameters):
    """What the variants have in common; with any algorithm it makes a variant of that."""

    actor_learning_rate: Fraction = parameter(3e-4)
    critic_learning_rate: Fraction = parameter(3e-4)
    target_rate: Fraction = parameter(0.01, symbol="tau")
    clock: bool = parameter(True)
    geofence: bool = parameter(True)
    reward_scale: PositiveNumber = parameter(0.05)
    layer_norm: bool = parameter(True)
    afterstate: bool = parameter(True)
    action_scale: ActionScale = parameter(1.04)
    guide: Guide | None = parameter(Guide())
    """What guides the learners while they train; null for nothing."""

    @property
    def knows_layout(self) -> bool:
        """See :attr:`AlgorithmParameters.knows_layout`: a guide imagines flights."""
        return super().knows_layout or self.guide is not None

    def guided(self, algorithm: Algorithm, env: TransformedEnv, seeds: Sequence[int]) -> Algorithm:
        """See :meth:`AlgorithmParameters.guided`."""
        if self.guide is None:
            return algorithm
        return Planner(self.guide, self, env, seeds).attach(algorithm)

    def require_suited(self, reward: Reward) -> None:
        """See :meth:`AlgorithmParameters.require_suited`; flights are imagined by places alone."""
        super().require_suited(reward)
        imagined = 0 if self.guide is None else self.guide.imagined_flights
        if imagined and reward.depends_on != POSITION:
            accepted = f"0, because reward = {reward.name} depends on more than the place"
            raise InputError(rejection("algorithm.guide.imagined_flights", imagined, accepted))

    def least_replay(self, num_slots: int) -> int:
        """See :meth:`AlgorithmParameters.least_replay`: a flight, to keep the best."""
        return num_slots if self.guide is not None and self.guide.keeps_flights else 1

    @property
    def transitions(self) -> TransitionOptions:
        """See :attr:`AlgorithmParameters.transitions`: with the fading for a control variate."""
        beside = (FADING,) if self.guide is not None and self.guide.control_variate else ()
        return replace(super().transitions, beside=beside)

    def needed_memory(
        self, scenario: Scenario, horizons: Sequence[int], sizes: Mapping[str, int]
    ) -> list[Need]:
        """See :meth:`AlgorithmParameters.needed_memory`."""
        needs, guide = super().needed_memory(scenario, horizons, sizes), self.guide
        if guide is None or not guide.control_variate:
            return needs
        hidden_size, most = guide.variate_hidden_sizes[-1], guide.most_ue_features
        features = 3 * feature_count(scenario, hidden_size, most)
        stored, flights = sizes["replay_size"], guide.imagined_flights
        imagined = sum(horizons) * 2 * flights * features
        levels = guide.power_levels * scenario.power_control
        remembered = len(horizons) * stored * (LinkRow.of(scenario).size + features)
        return [
            *needs,
            Need("replay_size", stored, remembered),
            Need("imagined_flights", flights, imagined),
            Need("power_levels", guide.power_levels, imagined * levels),
        ]


@dataclass(frozen=True)
class RobustDDPG(Robust, DDPG):
    """DDPG that looks for the best flight within the horizon, and does not forget a good one."""

    noise_variance: NoiseVariance = parameter(0.16)
    noise_decay: Fraction = parameter(0.985)
    noise_decay_per: SlotOrEpisode = parameter("episode")


@dataclass(frozen=True)
class RobustTD3(RobustDDPG, TD3):
    """TD3 with the same pieces."""


@dataclass(frozen=True)
class RobustSAC(Robust, SAC):
    """SAC with the same pieces; its noise-free actor is scaled, what it explores with is not."""

    temperature_init: Temperature = parameter(0.01)
    target_entropy: Entropy = parameter(-4.0)
