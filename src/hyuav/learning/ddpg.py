"""DDPG as in the paper's Algorithm 1 (Lillicrap et al., ICLR 2016)."""

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass
from tensordict.nn import TensorDictSequential
from torchrl.objectives import DDPGLoss, SoftUpdate

from hyuav._support.parameters import Fraction, OneOf, parameter
from hyuav.learning.algorithm import Algorithm, AlgorithmParameters, GradientStep, adam
from hyuav.learning.exploration import GaussianNoise
from hyuav.physics.scenario import Scenario

NoiseVariance = Annotated[float, Field(ge=0.0, le=1e6)]
SlotOrEpisode = Annotated[str, OneOf("slot", "episode")]


@dataclass(frozen=True)
class DDPG(AlgorithmParameters):
    """The paper's hyperparameters; the noise is in units of v_max."""

    noise_variance: NoiseVariance = parameter(0.6)
    noise_decay: Fraction = parameter(0.999)
    noise_decay_per: SlotOrEpisode = parameter("slot")

    def build(self, learners: int, scenario: Scenario) -> Algorithm:
        """See :meth:`AlgorithmParameters.build`."""
        actor = self.make_actor(learners, scenario)
        loss = DDPGLoss(
            actor,
            self.make_critic(learners, scenario),
            loss_function="l2",
            delay_actor=True,
            delay_value=True,
            reduction="none",
        )
        self.estimate_values(loss)
        return Algorithm(
            actor=actor,
            explorer=TensorDictSequential(actor, self.make_noise(learners)),
            loss=loss,
            steps=(
                GradientStep(  # eq. 9
                    "critic",
                    lambda batch: loss.loss_value(batch)[0],
                    adam(loss.value_network_params, self.critic_learning_rate),
                ),
                GradientStep(  # eq. 10
                    "actor",
                    lambda batch: loss.loss_actor(batch)[0],
                    adam(loss.actor_network_params, self.actor_learning_rate),
                ),
            ),
            target=SoftUpdate(loss, tau=self.target_rate),
        )

    def make_noise(self, learners: int) -> GaussianNoise:
        """What is added to the actions of N learners."""
        return GaussianNoise(learners, self.noise_variance, self.noise_decay, self.noise_decay_per)
