"""TD3: DDPG with twin critics, smoothed targets and a slower actor (Fujimoto et al., ICML 2018)."""

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass
from tensordict.nn import TensorDictSequential
from torchrl.objectives import SoftUpdate, TD3Loss

from hyuav._support.parameters import Count, parameter
from hyuav.learning.algorithm import Algorithm, GradientStep, adam
from hyuav.learning.ddpg import DDPG
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
        loss = TD3Loss(
            actor,
            self.make_critic(learners, scenario),
            bounds=(-1.0, 1.0),
            num_qvalue_nets=2,
            policy_noise=self.target_noise_std,
            noise_clip=self.target_noise_clip,
            loss_function="l2",
            reduction="none",
        )
        self.estimate_values(loss)
        return Algorithm(
            actor=actor,
            explorer=TensorDictSequential(actor, self.make_noise(learners)),
            loss=loss,
            steps=(
                GradientStep(
                    "critic",
                    lambda batch: loss.value_loss(batch)[0],
                    adam(loss.qvalue_network_params, self.critic_learning_rate),
                    normals=1,
                ),
                GradientStep(
                    "actor",
                    lambda batch: loss.actor_loss(batch)[0],
                    adam(loss.actor_network_params, self.actor_learning_rate),
                    every=self.actor_every,
                ),
            ),
            target=SoftUpdate(loss, tau=self.target_rate),
            target_every=self.actor_every,
        )
