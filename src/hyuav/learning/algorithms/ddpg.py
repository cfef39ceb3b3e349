"""DDPG as in the paper's Algorithm 1 (Lillicrap et al., ICLR 2016)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictParams, TensorDictSequential
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
    hovering_weight: float = parameter(number(0.0), 0.0)
    """How strongly the actor is drawn to hover where that is worth more than what it does; with
    any weight, the critics' target counts whichever is worth more."""

    critic_name: ClassVar[str] = "value_network"
    """What the loss calls its critic."""

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
        self.estimate_values(loss, learners, self.alternative(loss))
        critic_optimizer = adam(loss.value_network_params, self.critic_learning_rate)
        actor_optimizer = adam(loss.actor_network_params, self.actor_learning_rate)
        return Algorithm(
            parameters=self,
            actor=actor,
            explorer=self.warmed_up(TensorDictSequential(actor, self.noise(learners)), learners),
            loss=loss,
            steps=(
                GradientStep("critic", lambda batch: loss.loss_value(batch)[0], critic_optimizer),
                GradientStep(
                    "actor",
                    lambda batch: loss.loss_actor(batch)[0] + self.held_back(loss, batch),
                    actor_optimizer,
                ),
            ),
            target=SoftUpdate(loss, tau=self.target_rate),
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

    def alternative(self, loss: LossModule) -> Callable[[Tensor], Tensor] | None:
        """What the target critics hold of hovering; None where that is not considered."""
        if not self.hovering_weight:
            return None

        def value(observation: Tensor) -> Tensor:
            weights = getattr(loss, f"target_{self.critic_name}_params")
            return self.rate(loss, weights, observation, torch.zeros_like(observation[..., :2]))

        return value

    @torch.no_grad()
    def rate(
        self, loss: LossModule, weights: TensorDictParams, observation: Tensor, action: Tensor
    ) -> Tensor:
        """What the critics, with these weights, hold of an action: the least of them, (N, K, 1)."""
        network = getattr(loss, self.critic_name)
        values = []
        for own in weights.unbind(0) if weights.batch_dims else (weights,):
            with own.to_module(network, preserve_module_state=False):
                values.append(network.module(observation, action))
        return torch.stack(values).amin(dim=0)

    def held_back(self, loss: LossModule, batch: TensorDictBase) -> Tensor | float:
        """What is added to the actor's loss against flying too fast: (N, K)."""
        added: Tensor | float = 0.0
        if self.saturation_penalty:
            added = added + self.saturation_penalty * saturation(loss, batch)
        if self.hovering_weight:
            added = added + self.hovering_weight * self.needless_speed(loss, batch)
        return added

    def needless_speed(self, loss: LossModule, batch: TensorDictBase) -> Tensor:
        """The square of the actor's speed where hovering is worth more, elsewhere 0: (N, K)."""
        observation = batch["observation"]
        with loss.actor_network_params.to_module(loss.actor_network):
            action: Tensor = loss.actor_network.module(observation)
        weights = getattr(loss, f"{self.critic_name}_params").data
        chosen = self.rate(loss, weights, observation, action)
        hovering = self.rate(loss, weights, observation, torch.zeros_like(action))
        return ((hovering > chosen) * action.square()).sum(dim=-1)


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
