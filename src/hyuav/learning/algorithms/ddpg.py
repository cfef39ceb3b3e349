"""DDPG as in the paper's Algorithm 1 (Lillicrap et al., ICLR 2016)."""

from dataclasses import dataclass

from tensordict.nn import TensorDictSequential
from torchrl.objectives import DDPGLoss, SoftUpdate, ValueEstimators

from hyuav.learning.algorithms.base import Algorithm, AlgorithmParameters, GradientStep, adam
from hyuav.learning.exploration import GaussianNoise
from hyuav.learning.networks import make_actor, make_critic
from hyuav.parameters import choice, number, parameter


@dataclass(frozen=True)
class DDPG(AlgorithmParameters):
    """The paper's hyperparameters; the noise is in units of v_max."""

    noise_variance: float = parameter(number(0.0, 1e6), 0.6)
    noise_decay: float = parameter(number(0.0, 1.0), 0.999)
    noise_decay_per: str = parameter(choice("slot", "episode"), "slot")

    def build(self, learners: int, observation_size: int) -> Algorithm:
        """See :meth:`AlgorithmParameters.build`."""
        sizes = (learners, observation_size, self.hidden_sizes, self.activation)
        actor, critic = make_actor(*sizes), make_critic(*sizes)
        loss = DDPGLoss(
            actor,
            critic,
            loss_function="l2",
            delay_actor=True,
            delay_value=True,
            reduction="none",
        )
        loss.make_value_estimator(ValueEstimators.TD0, gamma=self.discount)
        noise = GaussianNoise(learners, self.noise_variance, self.noise_decay, self.noise_decay_per)
        critic_optimizer = adam(loss.value_network_params, self.critic_learning_rate)
        actor_optimizer = adam(loss.actor_network_params, self.actor_learning_rate)
        return Algorithm(
            actor=actor,
            explorer=TensorDictSequential(actor, noise),
            loss=loss,
            steps=(
                GradientStep("critic", lambda batch: loss.loss_value(batch)[0], critic_optimizer),
                GradientStep("actor", lambda batch: loss.loss_actor(batch)[0], actor_optimizer),
            ),
            target=SoftUpdate(loss, tau=self.target_rate),
        )
