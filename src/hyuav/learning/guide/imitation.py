"""Demonstrated actions, weighed beside the actor's own so that it does not stick."""

from dataclasses import replace

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictParams
from torch import Tensor

from hyuav.learning.algorithm import Algorithm
from hyuav.learning.guide.demonstrations import Demonstrations
from hyuav.learning.guide.parameters import Guide
from hyuav.learning.guide.targets import raise_target


class Imitation:
    """To hover and, with a clock, to join the best flight.

    An actor climbs to the nearest summit of what its critic holds of actions. Where the best one
    lies across a valley, one of these is likely to be beyond it.

    Args:
        algorithm: of N learners.
        flights: the best so far.
        guide: its parameters.
        clock: whether the slots flown are observed.
    """

    def __init__(
        self,
        algorithm: Algorithm,
        flights: Demonstrations,
        guide: Guide,
        *,
        clock: bool,
    ) -> None:
        self._algorithm, self._loss, self._flights = algorithm, algorithm.loss, flights
        self._weight, self._q_margin = guide.imitation_weight, guide.q_margin
        self._clock = clock
        several = hasattr(self._loss, "qvalue_network")
        self._critic = "qvalue_network" if several else "value_network"  # TorchRL's names

    def attach(self, discount: float) -> Algorithm:
        """The algorithm with :meth:`missed` in its actor's loss and :meth:`worth` in its target."""
        raise_target(self._loss, discount, self.worth)
        steps = {step.name: step for step in self._algorithm.steps}
        plain = steps["actor"].loss
        steps["actor"] = replace(
            steps["actor"], loss=lambda batch: plain(batch) + self.missed(batch)
        )
        return replace(self._algorithm, steps=tuple(steps.values()))

    def actions(self, observation: Tensor) -> Tensor:
        """The A demonstrated actions (N, A, K, actions) for observations (N, K, observed).

        Helpers hover at the power of the best flight; without a clock, half way down in dB.
        """
        flights = self._flights
        if not self._clock:
            size = flights.actions.shape[-1]
            return observation.new_zeros(*observation.shape[:-1], size).unsqueeze(1)
        return torch.stack([flights.hover(observation), flights.demonstrate(observation)], dim=1)

    def worth(self, observation: Tensor) -> Tensor:
        """What the target critics hold of the best one, less the margin: (N, K, 1)."""
        critics = getattr(self._loss, f"target_{self._critic}_params")
        values = self._rate(critics, observation, self.actions(observation))
        return values.amax(dim=1) - self._q_margin

    def missed(self, batch: TensorDictBase) -> Tensor:
        """The imitation loss, which is added to the actor's: (N, K), of a mini-batch.

        It is the weighed squared distance from the best demonstrated action, 0 where none is
        clearly better. An actor whose whole flight is behind the best one is to join that,
        whatever its critics hold of a single action.
        """
        observation = batch["observation"]
        action = self._algorithm.act(batch)
        others = self.actions(observation)
        weights = getattr(self._loss, f"{self._critic}_params").data
        worth, best = self._rate(weights, observation, others).squeeze(-1).max(dim=1)
        own = self._rate(weights, observation, action.detach()).squeeze(-1)
        chosen = torch.take_along_dim(others, best[:, None, :, None], dim=1).squeeze(1)
        better = worth > own + self._q_margin
        if self._clock:
            behind = self._flights.behind.unsqueeze(-1)
            chosen = torch.where(behind.unsqueeze(-1), others[:, 1], chosen)
            better = better | behind
        distance = (action - chosen).square().sum(dim=-1)
        return self._weight * better.to(distance.dtype) * distance

    @torch.no_grad()
    def _rate(self, weights: TensorDictParams, observation: Tensor, actions: Tensor) -> Tensor:
        """What the critics, with these weights, hold of actions (N, ..., K, ...): (N, ..., K, 1).

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
