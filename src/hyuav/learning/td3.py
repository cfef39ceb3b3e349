"""TD3: DDPG with twin critics, smoothed targets and a slower actor (Fujimoto et al., ICML 2018)."""

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass
from tensordict.nn import TensorDictSequential
from torchrl.objectives import SoftUpdate, TD3Loss

from hyuav._support.parameters import Count, parameter
from hyuav.learning.algorithm import Algorithm, GradientStep, adam
from hyuav.learning.ddpg import DDPG, act
from hyuav.learning.guide.demonstrations import BestFlights
from hyuav.physics.scenario import Scenario


@dataclass(frozen=True)
class TD3(DDPG):
    """DDPG's hyperparameters and TD3's own three."""

    target_noise_std: Annotated[float, Field(ge=0.0, le=2.0)] = parameter(0.2)
    target_noise_clip: Annotated[float, Field(ge=0.0, le=2.0)] = parameter(0.5)
    actor_every: Count = parameter(2)

    def build(self, learners: int, scenario: Scenario) -> Algorithm:
        """See :meth:`AlgorithmParameters.build`."""
        actor = self.make_actor(learners, scenario)
        critic = self.make_critic(learners, scenario)
        loss = TD3Loss(
            actor,
            critic,
            bounds=(-1.0, 1.0),
            num_qvalue_nets=2,
            policy_noise=self.target_noise_std,
            noise_clip=self.target_noise_clip,
            loss_function="l2",
            reduction="none",
        )
        flights = BestFlights(learners, scenario)
        missed = self.weigh(loss, "qvalue_network", lambda batch: act(loss, batch), flights)
        critic_optimizer = adam(loss.qvalue_network_params, self.critic_learning_rate)
        actor_optimizer = adam(loss.actor_network_params, self.actor_learning_rate)
        return Algorithm(
            parameters=self,
            actor=actor,
            explorer=TensorDictSequential(actor, self.noise(learners)),
            loss=loss,
            best_flights=flights if self.keeps_flights else None,
            steps=(
                GradientStep(
                    "critic",
                    lambda batch: loss.value_loss(batch)[0],
                    critic_optimizer,
                    normals=1,
                ),
                GradientStep(
                    "actor",
                    lambda batch: loss.actor_loss(batch)[0] + missed(batch),
                    actor_optimizer,
                    every=self.actor_every,
                ),
            ),
            target=SoftUpdate(loss, tau=self.target_rate),
            target_every=self.actor_every,
        )
