"""DDPG as in the paper's Algorithm 1 (Lillicrap et al., ICLR 2016)."""

from dataclasses import dataclass

from tensordict import TensorDictBase
from tensordict.nn import TensorDictSequential
from torch import Tensor
from torchrl.objectives import DDPGLoss, LossModule, SoftUpdate

from hyuav.learning.algorithms.base import Algorithm, AlgorithmParameters, GradientStep, adam
from hyuav.learning.exploration import GaussianNoise
from hyuav.learning.networks import make_actor, make_critic
from hyuav.parameters import choice, number, parameter

UNSATURATED = 2.0
"""An output before the tanh that still can be turned."""


@dataclass(frozen=True)
class DDPG(AlgorithmParameters):
    """The paper's hyperparameters; the noise is in units of v_max."""

    noise_variance: float = parameter(number(0.0, 1e6), 0.6)
    noise_decay: float = parameter(number(0.0, 1.0), 0.999)
    noise_decay_per: str = parameter(choice("slot", "episode"), "slot")
    noise_floor: float = parameter(number(0.0, 1.0), 0.0)
    """Of the standard deviation."""
    action_stretch: float = parameter(number(1.0, 2.0), 1.0)
    """Of the actor's tanh; see :class:`hyuav.learning.networks.StretchedTanh`."""
    saturation_penalty: float = parameter(number(0.0), 0.0)
    """Weight of :func:`saturation` in the actor's loss."""

    def build(self, learners: int, observation_size: int) -> Algorithm:
        """See :meth:`AlgorithmParameters.build`."""
        sizes = (learners, observation_size, self.hidden_sizes, self.activation)
        actor = make_actor(*sizes, stretch=self.action_stretch)
        critic = make_critic(*sizes, layer_norm=self.layer_norm)
        loss = DDPGLoss(
            actor,
            critic,
            loss_function="l2",
            delay_actor=True,
            delay_value=True,
            reduction="none",
        )
        self.estimate_values(loss, learners)
        critic_optimizer = adam(loss.value_network_params, self.critic_learning_rate)
        actor_optimizer = adam(loss.actor_network_params, self.actor_learning_rate)
        return Algorithm(
            actor=actor,
            explorer=self.warmed_up(TensorDictSequential(actor, self.noise(learners)), learners),
            loss=loss,
            steps=(
                GradientStep("critic", lambda batch: loss.loss_value(batch)[0], critic_optimizer),
                GradientStep(
                    "actor",
                    lambda batch: self.unsaturated(loss.loss_actor(batch)[0], loss, batch),
                    actor_optimizer,
                ),
            ),
            target=SoftUpdate(loss, tau=self.target_rate),
            memory=self.memory,
            explorer_normals=self.explorer_normals,
            learning_rate_decay=self.learning_rate_decay,
            restart_after=self.restart_after,
        )

    def noise(self, learners: int) -> GaussianNoise:
        """What is added to the actions of N learners."""
        return GaussianNoise(
            learners,
            self.noise_variance,
            self.noise_decay,
            self.noise_decay_per,
            self.noise_floor,
        )

    def unsaturated(self, actor_loss: Tensor, loss: LossModule, batch: TensorDictBase) -> Tensor:
        """The actor's loss (N, K), and what :func:`saturation` adds to it."""
        if not self.saturation_penalty:
            return actor_loss
        return actor_loss + self.saturation_penalty * saturation(loss, batch)


def saturation(loss: LossModule, batch: TensorDictBase) -> Tensor:
    """How far an actor's outputs before the tanh lie beyond :data:`UNSATURATED`.

    There the tanh is flat, and an actor that has gone far does not feel a better action elsewhere.

    Args:
        loss: with the actor.
        batch: (N, K) transitions.

    Returns:
        (N, K) sums of squares over both components.
    """
    with loss.actor_network_params.to_module(loss.actor_network):
        output: Tensor = loss.actor_network.module.before_output(batch["observation"])
    beyond = output.abs() - UNSATURATED
    return beyond.clamp(min=0.0).square().sum(dim=-1)
