"""What every algorithm consists of; the training loop knows nothing else of it."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from tensordict import TensorDictBase
from tensordict.nn import (
    TensorDictModule,
    TensorDictModuleBase,
    TensorDictParams,
    TensorDictSequential,
)
from torch import Tensor, nn
from torchrl.objectives import LossModule, SoftUpdate, ValueEstimators

from hyuav._support.parameters import Parameters, choice, count, number, parameter, sequence, switch
from hyuav.learning.afterstate import Afterstate
from hyuav.learning.exploration import WarmUp
from hyuav.learning.guide.control_variate import ControlVariate
from hyuav.learning.guide.demonstrations import BestFlights
from hyuav.learning.guide.imitation import Alternatives
from hyuav.learning.guide.reward_model import Expectation
from hyuav.learning.guide.targets import raise_target
from hyuav.learning.networks import ACTIVATIONS, make_critic
from hyuav.learning.replay import Memory
from hyuav.physics.scenario import Scenario

learning_rate = number(0.0, 1.0)

VARIATE_LEARNING_RATE = 1e-3


@dataclass(frozen=True)
class AlgorithmParameters(Parameters, ABC):
    """What all algorithms have in common; the defaults are the paper's."""

    hidden_sizes: tuple[int, ...] = parameter(
        sequence(count(), "the sizes of at least one hidden layer"), (300, 100, 100)
    )
    activation: str = parameter(choice(*ACTIVATIONS), "tanh")
    actor_learning_rate: float = parameter(learning_rate, 1e-4)
    critic_learning_rate: float = parameter(learning_rate, 1e-4)
    discount: float = parameter(number(0.0, 1.0), 0.95, symbol="gamma")
    target_rate: float = parameter(number(0.0, 1.0), 0.005, symbol="tau")
    clock: bool = parameter(switch, False)
    """Observe the slots flown. The last slot then ends the return: what is observed after it is
    never the beginning of a slot, so that a value there would not be learned."""
    geofence: bool = parameter(switch, False)
    """Slow flights so that they end on the map."""
    reward_scale: float = parameter(number(above=0.0), 1.0)
    layer_norm: bool = parameter(switch, False)
    """In the critics."""
    afterstate: bool = parameter(switch, False)
    """Let the critics see where an action leads; see
    :class:`hyuav.learning.afterstate.Afterstate`."""
    warm_up_episodes: int = parameter(count(0), 0)
    """Flown to places all over the map; see :class:`hyuav.learning.exploration.WarmUp`."""
    repeat_every: int = parameter(count(0), 0)
    """After the warm-up, every n-th episode takes the actions of the best flight so far, or of one
    that may be better; 0 for never. See :class:`hyuav.learning.guide.planner.FlightSearch`."""
    control_variate: bool = parameter(switch, False)
    """Take off each reward what its slot's fading brought; see
    :class:`hyuav.learning.guide.control_variate.ControlVariate`."""
    imagined_flights: int = parameter(count(0, 100_000), 0)
    """After each episode from the end of the warm-up on, where flights are kept and there is a
    control variate: how many straight flights are judged, and as many variations of the best; see
    :class:`hyuav.learning.guide.proposals.Imagination`."""
    action_stretch: float = parameter(number(1.0, 2.0), 1.0)
    """Of the tanh that ends the actor; see :class:`hyuav.learning.networks.StretchedTanh`."""
    alternatives_weight: float = parameter(number(0.0, 1e6), 0.0)
    """How strongly the actor is drawn to an alternative that is worth more than what it does; with
    any weight, the critics' target counts whichever is worth more. See
    :class:`hyuav.learning.guide.imitation.Alternatives`."""

    @abstractmethod
    def build(self, learners: int, scenario: Scenario) -> "Algorithm":
        """Make the networks, their targets, the loss, the optimizers and the exploration.

        Args:
            learners: N.
            scenario: that they fly.
        """

    def assemble(self, learners: int, scenario: Scenario) -> "Algorithm":
        """What :meth:`build` makes, and around it what works with any algorithm.

        Args:
            learners: N.
            scenario: that they fly.
        """
        algorithm = self.build(learners, scenario)
        if self.warm_up_episodes:
            warm_up = WarmUp(learners, self.warm_up_episodes, scenario)
            explorer = TensorDictSequential(algorithm.explorer, warm_up)
            algorithm = replace(algorithm, explorer=explorer)
        if self.keeps_flights and algorithm.best_flights is None:
            flights = BestFlights(learners, scenario)
            algorithm = replace(algorithm, best_flights=flights)
        if self.control_variate:
            variate = ControlVariate(learners, scenario, self.reward_scale, clock=self.clock)
            optimizer = adam(variate, VARIATE_LEARNING_RATE)
            step = GradientStep("control variate", variate.loss, optimizer)
            expectation = Expectation(learners, variate, self.reward_scale)
            steps = (step, *algorithm.steps)
            algorithm = replace(algorithm, steps=steps, expectation=expectation)
        return algorithm

    def observation_size(self, scenario: Scenario) -> int:
        """U + 5, or U + 6 with a clock."""
        return scenario.num_ues + 5 + self.clock

    def make_critic(self, learners: int, scenario: Scenario) -> TensorDictModule:
        """Q(s, a) of N learners, as :func:`hyuav.learning.networks.make_critic` describes it."""
        afterstate = None
        if self.afterstate:
            afterstate = Afterstate(scenario, clock=self.clock, geofence=self.geofence)
        return make_critic(
            learners,
            self.observation_size(scenario),
            self.hidden_sizes,
            self.activation,
            layer_norm=self.layer_norm,
            afterstate=afterstate,
        )

    @property
    def keeps_flights(self) -> bool:
        """Whether best flights are of use."""
        return self.repeat_every > 0 or self.alternatives_weight > 0

    @property
    def memory(self) -> Memory:
        """What is kept of each slot."""
        return Memory(self.reward_scale, finite_horizon=self.clock, fading=self.control_variate)

    def estimate_values(self, loss: LossModule) -> None:
        """Give a loss the target of eq. 9, with the discount."""
        loss.make_value_estimator(ValueEstimators.TD0, gamma=self.discount)

    def weigh(
        self,
        loss: LossModule,
        critic: str,
        act: Callable[[TensorDictBase], Tensor],
        flights: BestFlights,
    ) -> Callable[[TensorDictBase], Tensor | float]:
        """Give a loss its target, and say what is to be added to the actor's loss.

        Args:
            loss: of N learners.
            critic: what the loss calls its critics.
            act: maps a mini-batch (N, K) to the actors' noise-free actions.
            flights: the best so far.

        Returns:
            :meth:`hyuav.learning.guide.imitation.Alternatives.missed`, or 0 where alternatives are
            not weighed.
        """
        self.estimate_values(loss)
        if not self.alternatives_weight:
            return lambda _: 0.0
        weight = self.alternatives_weight
        alternatives = Alternatives(loss, critic, act, flights, weight, clock=self.clock)
        raise_target(loss, self.discount, alternatives.worth)
        return alternatives.missed

    @property
    def explorer_normals(self) -> int:
        """Standard normal tensors (N, 2) that the explorer draws for each slot."""
        return 1 + (self.warm_up_episodes > 0)


@dataclass(frozen=True)
class GradientStep:
    """One of the gradient steps that make up an update."""

    name: str
    loss: Callable[[TensorDictBase], Tensor]
    """Maps a mini-batch (N, K) to losses (N, K): learners in rows, transitions in columns."""
    optimizer: torch.optim.Optimizer
    every: int = 1
    """Taken in every n-th update."""
    normals: int = 0
    """Standard normal tensors (N, K, 2) that the loss draws."""


@dataclass(frozen=True)
class Algorithm:
    """The parts of an algorithm for N learners, ready to train."""

    parameters: AlgorithmParameters
    actor: TensorDictModuleBase
    """mu: writes the noise-free ``action`` (N, ..., 2) from ``observation`` (N, ..., U + 5)."""
    explorer: TensorDictModuleBase
    """Writes the ``action`` to take in training."""
    loss: LossModule
    """TorchRL's loss, which holds the networks' and the target networks' weights."""
    steps: tuple[GradientStep, ...]
    """Taken in this order in every update."""
    target: SoftUpdate
    """theta' <- tau theta + (1 - tau) theta'."""
    target_every: int = 1
    """The targets follow in every n-th update."""
    best_flights: BestFlights | None = None
    """Of each learner, where they are of use."""
    expectation: Expectation | None = None
    """What flights are expected to earn, if it is learned, and with it the control variate, which
    takes the luck of the fading off the rewards of a mini-batch."""

    def repeats(self, episode: int) -> bool:
        """Whether an episode, from 1, takes the actions of the flight that is to be tried."""
        every = self.parameters.repeat_every
        return every > 0 and episode % every == 0 and episode > self.parameters.warm_up_episodes

    def due(self, index: int) -> tuple[bool, ...]:
        """Which gradient steps the update of this index takes, and last whether targets follow."""
        return tuple(index % period == 0 for period in self._periods)

    @property
    def _periods(self) -> tuple[int, ...]:
        return (*(step.every for step in self.steps), self.target_every)

    @property
    def all_due(self) -> set[tuple[bool, ...]]:
        """Every combination of steps that an update takes."""
        return {self.due(index) for index in range(1, math.lcm(*self._periods) + 1)}

    def fair(self, batch: TensorDictBase) -> TensorDictBase:
        """A mini-batch (N, K) as the losses want to see it."""
        return batch if self.expectation is None else self.expectation.variate.fair(batch)

    def update_networks(self, batch: TensorDictBase, index: int) -> dict[str, Tensor]:
        """Take the gradient steps, eq. 9 and 10 for DDPG, on one mini-batch of each learner.

        Args:
            batch: (N, K) transitions.
            index: of this update, from 1, for the parts that are not taken every time.

        Returns:
            the mean loss (N,) of each step that was taken, by the step's name.
        """
        losses = {}
        batch = self.fair(batch)
        for step, due in zip(self.steps, self.due(index), strict=False):
            if not due:
                continue
            loss = step.loss(batch).mean(dim=-1)
            step.optimizer.zero_grad()
            loss.sum().backward()  # learners share no weight, so the sum keeps them apart
            step.optimizer.step()
            losses[step.name] = loss.detach()
        return losses

    def update_targets(self, index: int) -> None:
        """Let the target networks follow, in every ``target_every``-th update."""
        if self.due(index)[-1]:
            self.target.step()

    @property
    def modules(self) -> nn.ModuleDict:
        """All weights and buffers that training changes."""
        modules = {"loss": self.loss, "explorer": self.explorer}
        if self.best_flights is not None:
            modules["best_flights"] = self.best_flights
        if self.expectation is not None:
            modules["expectation"] = self.expectation
        return nn.ModuleDict(modules)


def adam(weights: TensorDictParams | nn.Module, learning_rate: float) -> torch.optim.Adam:
    """Adam as the paper uses it, in PyTorch's fused form."""
    return torch.optim.Adam(list(weights.parameters()), lr=learning_rate, fused=True)
