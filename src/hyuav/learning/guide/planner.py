"""The guide of the robust variants: which flight of each learner is its best, and which is next."""

import math
from collections.abc import Sequence
from dataclasses import replace

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictSequential
from torch import Tensor
from torchrl.envs import TransformedEnv

from hyuav._support.randomness import RowStream, standard_normal
from hyuav.envs.observation import ObservationLayout
from hyuav.envs.reward import POSITION
from hyuav.learning.algorithm import (
    Algorithm,
    AlgorithmParameters,
    GradientStep,
    Guidance,
    adam,
)
from hyuav.learning.guide.control_variate import ControlVariate
from hyuav.learning.guide.demonstrations import Demonstrations
from hyuav.learning.guide.imitation import Imitation
from hyuav.learning.guide.parameters import Guide
from hyuav.learning.guide.proposals import TrajectoryProposals
from hyuav.learning.guide.reward_model import RewardModel
from hyuav.learning.guide.warm_up import WarmUp
from hyuav.learning.weights import draw_weights

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
"""Its multiples fill the unit interval evenly."""

_Flights = tuple[Tensor, Tensor]
"""Actions (T, N, D, actions), and the trajectories that they lead along."""

_Judged = tuple[_Flights, Tensor]
"""Flights, and what they are held to bring, (N, D) bps/Hz."""


class Planner(Guidance):
    """Keep the flights of which most is to be expected, among those flown and those imagined.

    After an episode all flights are judged anew by the reward model, where there is a control
    variate and the reward of a slot depends on where the helper is alone. Otherwise a flight counts
    what it earned, less what is known to be chance.

    Args:
        guide: its parameters.
        algorithm: the hyperparameters of the algorithm that is guided.
        env: that the N learners fly.
        seeds: of their random numbers.
    """

    def __init__(
        self,
        guide: Guide,
        algorithm: AlgorithmParameters,
        env: TransformedEnv,
        seeds: Sequence[int],
    ) -> None:
        super().__init__()
        self.guide, self._algorithm = guide, algorithm
        self._env, self._seeds = env, seeds
        learners, self._scenario = len(seeds), env.base_env.scenario
        self._layout = ObservationLayout(self._scenario, clock=algorithm.clock)
        self.flights = Demonstrations(learners, self._scenario, guide.return_margin)
        self.reward_model = self._make_reward_model() if guide.control_variate else None
        by_place = env.base_env.reward.depends_on == POSITION
        self._judging = self.reward_model if by_place else None
        if self.reward_model is not None:
            draw_weights(self.reward_model, seeds, "control variate")
        physics, schemes = env.base_env.physics, env.base_env.schemes
        self._proposals = TrajectoryProposals(guide, physics, schemes)
        self.streams = self._random_streams()

    def _make_reward_model(self) -> RewardModel:
        learners, scale = len(self._seeds), self._algorithm.reward_scale
        variate = ControlVariate(
            learners,
            self._scenario,
            self._algorithm.make_afterstate(self._scenario, geofence=True),
            self.guide.variate_hidden_sizes,
            scale,
        )
        return RewardModel(learners, variate, scale, self.guide)

    def _random_streams(self) -> dict[str, RowStream]:
        """``guesses`` (N, F) and ``variations`` (N, D, ...), as far as they are needed."""
        shapes: dict[str, tuple[int, ...]] = {}
        if self._judging is not None and self.guide.keeps_flights:
            shapes["guesses"] = (self._judging.size,)
        if self.guide.imagined_flights:
            shapes["variations"] = self._proposals.normals
        return {
            name: RowStream(standard_normal, shape, self._seeds, name, self._env.device)
            for name, shape in shapes.items()
        }

    def attach(self, algorithm: Algorithm) -> Algorithm:
        """An algorithm for the same learners that is guided by this."""
        guide, explorers = self.guide, [algorithm.explorer]
        if guide.warm_up_episodes:
            explorers.append(WarmUp(len(self._seeds), guide, self._scenario))
        if guide.imitation_weight:
            clock, discount = self._algorithm.clock, self._algorithm.discount
            imitation = Imitation(algorithm, self.flights, guide, clock=clock)
            algorithm = imitation.attach(discount)
        steps = algorithm.steps
        if self.reward_model is not None:
            variate = self.reward_model.variate
            optimizer = adam(variate, guide.variate_learning_rate)
            steps = (GradientStep("control variate", variate.loss, optimizer), *steps)
        return replace(
            algorithm,
            explorer=TensorDictSequential(*explorers),
            explorer_normals=algorithm.explorer_normals + (guide.warm_up_episodes > 0),
            steps=steps,
            guide=self,
        )

    def plan(self, episode: int) -> Tensor | None:
        """The planned flight, in the episodes that take one."""
        if not self.guide.repeat_every:
            return None
        planned = self.flights.planned_actions
        return planned if self.guide.repeats(episode) else planned * torch.nan

    def prepare(self, batch: TensorDictBase) -> TensorDictBase:
        """Take off the rewards what is known to be chance."""
        return batch if self.reward_model is None else self.reward_model.variate.adjust(batch)

    def control_term(self, slot: TensorDictBase) -> Tensor:
        """See :meth:`Guidance.control_term`."""
        if self.reward_model is None:
            return super().control_term(slot)
        return self.reward_model.variate.control_term(slot)

    def end_evaluation(self, trajectory: Tensor) -> None:
        """Remember where the actors fly, to be judged beside the best flights."""
        self.flights.own_trajectory.copy_(trajectory)

    def end_episode(self, episode: int, flown: TensorDictBase, stored: TensorDictBase) -> None:
        """Keep the flight where it is the best so far, or one that is better still; plan the next.

        See :meth:`Guidance.end_episode`.
        """
        if not self.guide.keeps_flights:
            return
        if self._judging is not None:
            self._judge(self._judging, episode, flown, stored)
            return
        trajectory = self._layout.place(flown)
        earned = flown["next", "reward"] - self._control_terms(flown)
        self.flights.keep(flown["action"], trajectory, earned.sum(dim=(0, 2)))
        self.flights.plan_best()

    def _control_terms(self, flown: TensorDictBase) -> Tensor:
        """What of each slot's reward is known to be chance: (T, N, 1), of slots (T, N)."""
        return self.control_term(flown.transpose(0, 1)).transpose(0, 1)

    def _judge(
        self, model: RewardModel, episode: int, flown: TensorDictBase, stored: TensorDictBase
    ) -> None:
        """The same by what is to be expected of flights: those kept, flown and imagined."""
        flights, updates = self.flights, self.guide.updates(episode)
        if updates:
            model.update(stored, next(self.streams["guesses"]))
        trajectory = self._layout.place(flown)
        known = model.judge(flights.trajectory)[0].nan_to_num(-torch.inf)
        flights.best_return.copy_(known)
        flights.keep(flown["action"], trajectory, model.judge(trajectory)[0])
        if self.guide.imagined_flights and episode >= self.guide.warm_up_episodes:
            normals = next(self.streams["variations"])
            imagined = self._proposals.fly(episode, flights, normals)
            (expecting, expected), (guessing, guessed) = self._judged(model, episode, imagined)
            flights.keep(*_highest(expecting, expected), expected.amax(dim=1))
            if updates:
                flights.plan(*_highest(guessing, guessed))
        elif updates:
            flights.plan_best()
        flights.compare(model.judge(flights.own_trajectory)[0])

    def _judged(
        self, model: RewardModel, episode: int, imagined: _Flights
    ) -> tuple[_Judged, _Judged]:
        """Flights with what is to be expected of them, and with what the last guess holds.

        Where power is controlled they are flown at those powers of which most is to be expected, or
        by the guess: beside its own, each slot may have one of some levels, others in every
        episode. Helpers take turns.
        """
        if not self._scenario.power_control:
            expected, guessed = model.judge(imagined[1])
            return (imagined, expected), (imagined, guessed)
        column = 3 * (episode % self._scenario.num_helpers) + 2
        count, (actions, trajectory) = self.guide.power_levels, imagined
        levels = torch.arange(count, dtype=actions.dtype, device=actions.device)
        levels = (levels + math.modf(episode * GOLDEN)[0]) * (2.0 / count) - 1.0
        own = trajectory[..., column : column + 1]
        powers = torch.cat([own, levels.expand(*own.shape[:-1], -1)], dim=-1)
        candidates = trajectory.unsqueeze(-2).repeat_interleave(powers.shape[-1], dim=-2)
        candidates[..., column] = powers
        judged = []
        for values, index in model.choose(candidates):
            power = torch.take_along_dim(powers, index.unsqueeze(-1), dim=-1)
            judged.append((_at(imagined, column, power), values))
        expecting, guessing = judged
        return expecting, guessing


def _at(flights: _Flights, column: int, power: Tensor) -> _Flights:
    """Flights at another power (T, N, D, 1), which stands in this column."""
    actions, trajectory = (
        torch.cat([each[..., :column], power, each[..., column + 1 :]], dim=-1) for each in flights
    )
    return actions, trajectory


def _highest(flights: _Flights, values: Tensor) -> _Flights:
    """Each learner's flight of the highest value (N, D)."""
    shape = len(flights[0]), -1, 1, flights[0].shape[-1]
    index = values.argmax(dim=1)[None, :, None, None].expand(shape)
    actions, trajectory = (torch.take_along_dim(each, index, dim=2).squeeze(2) for each in flights)
    return actions, trajectory
