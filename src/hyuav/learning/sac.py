"""SAC: a stochastic actor with a learned temperature (Haarnoja et al., 2018)."""

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass
from tensordict import TensorDictBase
from tensordict.nn import NormalParamExtractor, TensorDictModule, TensorDictSequential
from torch import Tensor, nn
from torchrl.envs.utils import ExplorationType
from torchrl.modules import ProbabilisticActor, TanhNormal
from torchrl.objectives import SoftUpdate

from hyuav._support.parameters import Fraction, parameter
from hyuav.envs.observation import ObservationLayout
from hyuav.learning.algorithm import (
    Algorithm,
    AlgorithmParameters,
    GradientStep,
    adam,
)
from hyuav.learning.networks import LearnerMLP, ScaledTanh
from hyuav.learning.torchrl_internals import LearnerSACLoss
from hyuav.physics.scenario import Scenario

Temperature = Annotated[float, Field(ge=1e-6, le=1e6)]
Entropy = Annotated[float, Field(ge=-100.0, le=100.0)]


@dataclass(frozen=True)
class SAC(AlgorithmParameters):
    """SAC's hyperparameters beside the common ones."""

    temperature_learning_rate: Fraction = parameter(3e-4)
    temperature_init: Temperature = parameter(0.2)
    target_entropy: Entropy | None = parameter(None)
    """Minus the size of the action where it is None."""

    def build(self, learners: int, scenario: Scenario) -> Algorithm:
        """See :meth:`AlgorithmParameters.build`."""
        observation_size = self.observation_size(scenario)
        actions = ObservationLayout(scenario, clock=self.clock).action_size
        network = LearnerMLP(
            learners, observation_size, self.hidden_sizes, 2 * actions, self.activation
        )
        distribution = TensorDictModule(
            nn.Sequential(network, NormalParamExtractor()),
            in_keys=["observation"],
            out_keys=["loc", "scale"],
        )
        mean = TensorDictModule(ScaledTanh(self.action_scale), in_keys=["loc"], out_keys=["action"])
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
            num_qvalue_nets=2,
            target_entropy=-float(actions) if self.target_entropy is None else self.target_entropy,
            loss_function="l2",
            reduction="none",
            scalar_output_mode="exclude",
        )
        self.estimate_values(loss)

        def mean_action(batch: TensorDictBase) -> Tensor:
            mode: Tensor = explorer.get_dist(batch.select("observation")).deterministic_sample
            return (self.action_scale * mode).clamp(-1.0, 1.0)

        actor_optimizer = adam(loss.actor_network_params, self.actor_learning_rate)
        actor_optimizer.add_param_group(
            {"params": [loss.log_alpha], "lr": self.temperature_learning_rate}
        )
        return Algorithm(
            actor=TensorDictSequential(distribution, mean),
            explorer=explorer,
            loss=loss,
            steps=(
                GradientStep(
                    "critic",
                    lambda batch: loss.qvalue_v2_loss(batch)[0],
                    adam(loss.qvalue_network_params, self.critic_learning_rate),
                    normals=1,
                ),
                GradientStep("actor", loss.actor_and_temperature_loss, actor_optimizer, normals=1),
            ),
            target=SoftUpdate(loss, tau=self.target_rate),
            mean_action=mean_action,
        )
