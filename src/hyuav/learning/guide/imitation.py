"""Other ways to act than the actor's, weighed beside it so that it does not stick."""

from collections.abc import Callable

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictParams
from torch import Tensor
from torchrl.objectives import LossModule

from hyuav.learning.guide.demonstrations import BestFlights

CLEARLY = 0.025
"""Scaled reward by which an alternative must be worth more; where hovering just so is all that
matters, the best actions are near, and gradients find them."""


class Alternatives:
    """To hover and, with a clock, to join the best flight.

    An actor climbs to the nearest summit of what its critic holds of actions. Where the best one
    lies across a valley, one of these is likely to be beyond it.

    Args:
        loss: of N learners, with the networks.
        critic: what the loss calls its critics.
        act: maps a mini-batch (N, K) to the actors' noise-free actions (N, K, 2), with gradients.
        flights: the best so far.
        weight: how strongly the actor is drawn to an alternative that is worth more.
        clock: whether the slots flown are observed.
    """

    def __init__(
        self,
        loss: LossModule,
        critic: str,
        act: Callable[[TensorDictBase], Tensor],
        flights: BestFlights,
        weight: float,
        *,
        clock: bool,
    ) -> None:
        self._loss, self._critic, self._act = loss, critic, act
        self._flights, self._weight, self._clock = flights, weight, clock

    def actions(self, observation: Tensor) -> Tensor:
        """The A alternatives (N, A, K, 2) of observations (N, K, U + 5)."""
        hovering = observation.new_zeros(*observation.shape[:-1], 2)
        if not self._clock:
            return hovering.unsqueeze(1)
        return torch.stack([hovering, self._flights.towards(observation)], dim=1)

    def worth(self, observation: Tensor) -> Tensor:
        """What the target critics hold of the best alternative, less :data:`CLEARLY`: (N, K, 1)."""
        critics = getattr(self._loss, f"target_{self._critic}_params")
        return self._rate(critics, observation, self.actions(observation)).amax(dim=1) - CLEARLY

    def missed(self, batch: TensorDictBase) -> Tensor:
        """What is added to the actor's loss: (N, K), of a mini-batch.

        It is the weighed squared distance from the best alternative, 0 where none is clearly
        better. An actor whose whole flight is behind the best one is to join that, whatever its
        critics hold of a single action.
        """
        observation = batch["observation"]
        action = self._act(batch)
        others = self.actions(observation)
        weights = getattr(self._loss, f"{self._critic}_params").data
        worth, best = self._rate(weights, observation, others).squeeze(-1).max(dim=1)
        own = self._rate(weights, observation, action.detach()).squeeze(-1)
        chosen = torch.take_along_dim(others, best[:, None, :, None], dim=1).squeeze(1)
        better = worth > own + CLEARLY
        if self._clock:
            behind = self._flights.behind.unsqueeze(-1)
            chosen = torch.where(behind.unsqueeze(-1), others[:, 1], chosen)
            better = better | behind
        return self._weight * better * (action - chosen).square().sum(dim=-1)

    @torch.no_grad()
    def _rate(self, weights: TensorDictParams, observation: Tensor, actions: Tensor) -> Tensor:
        """What the critics, with these weights, hold of actions (N, ..., K, 2): (N, ..., K, 1).

        Of several critics it is the least.
        """
        network = getattr(self._loss, self._critic)
        observed = observation
        if actions.ndim > observation.ndim:
            observed = observation.unsqueeze(1).expand(*actions.shape[:-1], -1)
        values = []
        for own in weights.unbind(0) if weights.batch_dims else (weights,):
            with own.to_module(network, preserve_module_state=False):
                values.append(network.module(observed, actions))
        return torch.stack(values).amin(dim=0)
