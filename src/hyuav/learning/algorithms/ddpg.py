"""DDPG as in the paper's Algorithm 1 (Lillicrap et al., ICLR 2016)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictParams, TensorDictSequential
from torch import Tensor
from torchrl.objectives import DDPGLoss, LossModule, SoftUpdate

from hyuav.learning.algorithms.base import Algorithm, AlgorithmParameters, GradientStep, adam
from hyuav.learning.exploration import GaussianNoise
from hyuav.learning.networks import make_actor
from hyuav.learning.repetition import BestFlights
from hyuav.parameters import choice, number, parameter
from hyuav.scenario import Scenario

CLEARLY = 0.025
"""Scaled reward by which an alternative must be worth more; where hovering just so is all that
matters, the best actions are near, and gradients find them."""


@dataclass(frozen=True)
class DDPG(AlgorithmParameters):
    """The paper's hyperparameters; the noise is in units of v_max."""

    noise_variance: float = parameter(number(0.0, 1e6), 0.6)
    noise_decay: float = parameter(number(0.0, 1.0), 0.999)
    noise_decay_per: str = parameter(choice("slot", "episode"), "slot")
    action_stretch: float = parameter(number(1.0, 2.0), 1.0)
    """Of the actor's tanh; see :class:`hyuav.learning.networks.StretchedTanh`."""
    alternatives_weight: float = parameter(number(0.0, 1e6), 0.0)
    """How strongly the actor is drawn to the better of :meth:`alternatives` where that is worth
    more than what it does; with any weight, the critics' target counts whichever is worth more."""

    critic_name: ClassVar[str] = "value_network"
    """What the loss calls its critic."""

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
        self.estimate_values(loss, self.best_alternative(loss, flights))
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
                    lambda batch: loss.loss_actor(batch)[0] + self.missed(loss, flights, batch),
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

    @property
    def keeps_flights(self) -> bool:
        """See :attr:`AlgorithmParameters.keeps_flights`."""
        return super().keeps_flights or self.alternatives_weight > 0

    def noise(self, learners: int) -> GaussianNoise:
        """What is added to the actions of N learners."""
        return GaussianNoise(learners, self.noise_variance, self.noise_decay, self.noise_decay_per)

    def best_alternative(
        self, loss: LossModule, flights: BestFlights
    ) -> Callable[[Tensor], Tensor] | None:
        """What the target critics hold of the best alternative, less :data:`CLEARLY`.

        None where alternatives are not weighed.
        """
        if not self.alternatives_weight:
            return None

        def value(observation: Tensor) -> Tensor:
            critics = getattr(loss, f"target_{self.critic_name}_params")
            others = self.alternatives(flights, observation)
            values = self.rate(loss, critics, observation, others)
            return values.amax(dim=1) - CLEARLY

        return value

    @torch.no_grad()
    def rate(
        self, loss: LossModule, weights: TensorDictParams, observation: Tensor, actions: Tensor
    ) -> Tensor:
        """What the critics, with these weights, hold of actions (N, ..., K, 2): (N, ..., K, 1).

        Of several critics it is the least.
        """
        network = getattr(loss, self.critic_name)
        observed = observation
        if actions.ndim > observation.ndim:
            observed = observation.unsqueeze(1).expand(*actions.shape[:-1], -1)
        values = []
        for own in weights.unbind(0) if weights.batch_dims else (weights,):
            with own.to_module(network, preserve_module_state=False):
                values.append(network.module(observed, actions))
        return torch.stack(values).amin(dim=0)

    def alternatives(self, flights: BestFlights, observation: Tensor) -> Tensor:
        """Other ways to act than the actor's: to hover and, with a clock, to join the best flight.

        An actor climbs to the nearest summit of what its critic holds of actions. Where the best
        one lies across a valley, one of these is likely to be beyond it.

        Args:
            flights: the best so far.
            observation: (N, K, U + 5).

        Returns:
            (N, A, K, 2).
        """
        hovering = observation.new_zeros(*observation.shape[:-1], 2)
        if not self.clock:
            return hovering.unsqueeze(1)
        return torch.stack([hovering, flights.towards(observation)], dim=1)

    def missed(
        self, loss: LossModule, flights: BestFlights, batch: TensorDictBase
    ) -> Tensor | float:
        """What is added to the actor's loss, so that it does not stick.

        It is the weighed squared distance from the best alternative, 0 where none is clearly
        better. An actor whose whole flight is behind the best one is to join that, whatever its
        critics hold of a single action.

        Args:
            loss: with the networks.
            flights: the best so far.
            batch: (N, K) transitions.

        Returns:
            (N, K), or 0 where alternatives are not weighed.
        """
        if not self.alternatives_weight:
            return 0.0
        observation = batch["observation"]
        with loss.actor_network_params.to_module(loss.actor_network, preserve_module_state=False):
            action = loss.actor_network.module(observation)
        others = self.alternatives(flights, observation)
        weights = getattr(loss, f"{self.critic_name}_params").data
        worth, best = self.rate(loss, weights, observation, others).squeeze(-1).max(dim=1)
        own = self.rate(loss, weights, observation, action.detach()).squeeze(-1)
        chosen = torch.take_along_dim(others, best[:, None, :, None], dim=1).squeeze(1)
        better = worth > own + CLEARLY
        if self.clock:
            behind = flights.behind.unsqueeze(-1)
            chosen = torch.where(behind.unsqueeze(-1), others[:, 1], chosen)
            better = better | behind
        return self.alternatives_weight * better * (action - chosen).square().sum(dim=-1)
