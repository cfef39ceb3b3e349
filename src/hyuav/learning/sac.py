"""SAC: a stochastic actor with a learned temperature (Haarnoja et al., 2018)."""

import math
from typing import Annotated, Any

import torch
from pydantic import Field
from pydantic.dataclasses import dataclass
from tensordict import TensorDictBase
from tensordict.nn import NormalParamExtractor, TensorDictModule, TensorDictSequential
from torch import Tensor, nn
from torchrl.envs.utils import ExplorationType
from torchrl.modules import ProbabilisticActor, TanhNormal
from torchrl.objectives import SACLoss, SoftUpdate
from torchrl.objectives.sac import compute_rsample_log_prob

from hyuav._support.parameters import Fraction, parameter
from hyuav.learning.algorithm import (
    Algorithm,
    AlgorithmParameters,
    GradientStep,
    adam,
)
from hyuav.learning.guide.demonstrations import BestFlights
from hyuav.learning.networks import LearnerMLP, StretchedTanh, stretched
from hyuav.physics.scenario import Scenario


class LearnerSACLoss(SACLoss):
    """TorchRL's SAC loss with a temperature of its own for each learner."""

    def __init__(
        self, *networks: Any, learners: int, alpha_init: float, stretch: float, **options: Any
    ) -> None:
        super().__init__(*networks, alpha_init=alpha_init, **options)
        self._stretch = stretch
        # (N, 1) broadcasts against the log-probabilities (N, K) of a mini-batch.
        self.log_alpha = nn.Parameter(torch.full((learners, 1), math.log(alpha_init)))

    def _compute_target_v2(self, tensordict: TensorDictBase) -> Tensor:
        """The target (N, K), as TorchRL's but for the temperatures, which multiply (N, K) here."""
        with torch.no_grad():
            following = tensordict["next"].select(*self.actor_network.in_keys)
            with self.actor_network_params.to_module(
                self.actor_network, preserve_module_state=False
            ):
                distribution = self.actor_network.get_dist(following)
            action, log_probability = compute_rsample_log_prob(distribution)
            following["action"] = action
            critics = self._vmap_qnetworkN0(following, self.target_qvalue_network_params)
            value = critics["state_action_value"].min(dim=0).values
            value = value - (self._alpha * log_probability).unsqueeze(-1)
            tensordict = tensordict.clone(False)
            tensordict["next", self.value_estimator.tensor_keys.value] = value
            return self.value_estimator.value_estimate(tensordict).squeeze(-1)

    def actor_and_temperature_loss(self, batch: TensorDictBase) -> Tensor:
        """Both losses (N, K) from one sample of actions; neither's gradient reaches the other."""
        actor_loss, metadata = self.actor_loss(batch)
        return actor_loss + self._alpha_loss(metadata["log_prob"])

    def mean_action(self, batch: TensorDictBase) -> Tensor:
        """The actors' noise-free actions (N, K, 2) of a mini-batch, with gradients."""
        observed = batch.select(*self.actor_network.in_keys)
        with self.actor_network_params.to_module(self.actor_network, preserve_module_state=False):
            action: Tensor = self.actor_network.get_dist(observed).deterministic_sample
        return stretched(action, self._stretch)


@dataclass(frozen=True)
class SAC(AlgorithmParameters):
    """SAC's hyperparameters beside the common ones; the target entropy is minus dim(a)."""

    temperature_learning_rate: Fraction = parameter(3e-4)
    temperature_init: Annotated[float, Field(ge=1e-6, le=1e6)] = parameter(0.2)
    target_entropy: Annotated[float, Field(ge=-100.0, le=100.0)] = parameter(-2.0)

    def build(self, learners: int, scenario: Scenario) -> Algorithm:
        """See :meth:`AlgorithmParameters.build`."""
        observation_size = self.observation_size(scenario)
        network = LearnerMLP(learners, observation_size, self.hidden_sizes, 4, self.activation)
        distribution = TensorDictModule(
            nn.Sequential(network, NormalParamExtractor()),
            in_keys=["observation"],
            out_keys=["loc", "scale"],
        )
        explorer = ProbabilisticActor(
            distribution,
            in_keys=["loc", "scale"],
            distribution_class=TanhNormal,
            distribution_kwargs={"tanh_loc": False},
            return_log_prob=True,
            default_interaction_type=ExplorationType.RANDOM,
        )
        loss = LearnerSACLoss(
            explorer,
            self.make_critic(learners, scenario),
            learners=learners,
            alpha_init=self.temperature_init,
            stretch=self.action_stretch,
            num_qvalue_nets=2,
            target_entropy=self.target_entropy,
            loss_function="l2",
            reduction="none",
            scalar_output_mode="exclude",
        )
        flights = BestFlights(learners, scenario)
        missed = self.weigh(loss, "qvalue_network", loss.mean_action, flights)
        critic_optimizer = adam(loss.qvalue_network_params, self.critic_learning_rate)
        actor_optimizer = adam(loss.actor_network_params, self.actor_learning_rate)
        actor_optimizer.add_param_group(
            {"params": [loss.log_alpha], "lr": self.temperature_learning_rate}
        )
        mean = TensorDictModule(
            StretchedTanh(self.action_stretch), in_keys=["loc"], out_keys=["action"]
        )
        return Algorithm(
            parameters=self,
            actor=TensorDictSequential(distribution, mean),
            explorer=explorer,
            loss=loss,
            best_flights=flights if self.keeps_flights else None,
            steps=(
                GradientStep(
                    "critic",
                    lambda batch: loss.qvalue_v2_loss(batch)[0],
                    critic_optimizer,
                    normals=1,
                ),
                GradientStep(
                    "actor",
                    lambda batch: loss.actor_and_temperature_loss(batch) + missed(batch),
                    actor_optimizer,
                    normals=1,
                ),
            ),
            target=SoftUpdate(loss, tau=self.target_rate),
        )
