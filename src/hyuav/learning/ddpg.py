"""DDPG as in the paper's Algorithm 1 (Lillicrap et al., ICLR 2016)."""

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import Tensor
from torchrl.objectives import DDPGLoss, LossModule, SoftUpdate

from hyuav._support.parameters import Fraction, OneOf, parameter
from hyuav.learning.algorithm import Algorithm, AlgorithmParameters, GradientStep, adam
from hyuav.learning.exploration import GaussianNoise
from hyuav.learning.guide.demonstrations import BestFlights
from hyuav.learning.networks import make_actor
from hyuav.physics.scenario import Scenario


def act(loss: LossModule, batch: TensorDictBase) -> Tensor:
    """The actors' own actions (N, K, 2) of a mini-batch, with gradients."""
    with loss.actor_network_params.to_module(loss.actor_network, preserve_module_state=False):
        action: Tensor = loss.actor_network.module(batch["observation"])
    return action


@dataclass(frozen=True)
class DDPG(AlgorithmParameters):
    """The paper's hyperparameters; the noise is in units of v_max."""

    noise_variance: Annotated[float, Field(ge=0.0, le=1e6)] = parameter(0.6)
    noise_decay: Fraction = parameter(0.999)
    noise_decay_per: Annotated[str, OneOf("slot", "episode")] = parameter("slot")

    def build(self, learners: int, scenario: Scenario) -> Algorithm:
        """See :meth:`AlgorithmParameters.build`."""
        actor = self.make_actor(learners, scenario)
        critic = self.make_critic(learners, scenario)
        loss = DDPGLoss(
            actor,
            critic,
            loss_function="l2",
            delay_actor=True,
            delay_value=True,
            reduction="none",
        )
        flights = BestFlights(learners, scenario)
        missed = self.weigh(loss, "value_network", lambda batch: act(loss, batch), flights)
        critic_optimizer = adam(loss.value_network_params, self.critic_learning_rate)
        actor_optimizer = adam(loss.actor_network_params, self.actor_learning_rate)
        return Algorithm(
            parameters=self,
            actor=actor,
            explorer=TensorDictSequential(actor, self.noise(learners)),
            loss=loss,
            best_flights=flights if self.keeps_flights else None,
            steps=(
                GradientStep("critic", lambda batch: loss.loss_value(batch)[0], critic_optimizer),
                GradientStep(
                    "actor",
                    lambda batch: loss.loss_actor(batch)[0] + missed(batch),
                    actor_optimizer,
                ),
            ),
            target=SoftUpdate(loss, tau=self.target_rate),
        )

    def make_actor(self, learners: int, scenario: Scenario) -> TensorDictModule:
        """mu(s) of N learners, as :func:`hyuav.learning.networks.make_actor` describes it."""
        return make_actor(
            learners,
            self.observation_size(scenario),
            self.hidden_sizes,
            self.activation,
            stretch=self.action_stretch,
        )

    def noise(self, learners: int) -> GaussianNoise:
        """What is added to the actions of N learners."""
        return GaussianNoise(learners, self.noise_variance, self.noise_decay, self.noise_decay_per)
