"""What every algorithm consists of; the training loop knows nothing else of it."""

import functools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Annotated

import torch
from pydantic import Field
from pydantic.dataclasses import dataclass as pydantic_dataclass
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictModuleBase, TensorDictParams
from torch import Tensor, nn
from torchrl.envs import TransformedEnv
from torchrl.objectives import LossModule, SoftUpdate, ValueEstimators

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import Count, Fraction, OneOf, Parameters, PositiveNumber, parameter
from hyuav._support.randomness import RowStream
from hyuav.envs.observation import ObservationLayout
from hyuav.envs.reward import VELOCITY, Reward
from hyuav.learning.afterstate import Afterstate
from hyuav.learning.memory import Need, needed_for_networks
from hyuav.learning.networks import ACTIVATIONS, AfterstateCritic, LearnerMLP, ScaledTanh
from hyuav.learning.replay import FADING, TransitionOptions
from hyuav.physics.scenario import Scenario

Sizes = Annotated[
    tuple[Count, ...],
    Field(min_length=1, description="the sizes of at least one hidden layer"),
]
ActionScale = Annotated[float, Field(ge=1.0, le=2.0)]


@contextmanager
def made_on(device: torch.device) -> Iterator[None]:
    """Inside it, tensors that do not say otherwise are made on a device, in float32.

    So are those of TorchRL and of networks of your own, whatever PyTorch's defaults are.
    """
    default = torch.get_default_dtype()
    torch.set_default_dtype(torch.float32)
    try:
        with device:
            yield
    finally:
        torch.set_default_dtype(default)


@pydantic_dataclass(frozen=True)
class AlgorithmParameters(Parameters, ABC):
    """What all algorithms have in common; the defaults are the paper's.

    ``clock``, ``geofence`` and ``reward_scale`` change the environment; ``layer_norm``,
    ``afterstate``, ``coverage_blur`` and ``action_scale`` the networks.
    """

    hidden_sizes: Sizes = parameter((300, 100, 100))
    activation: Annotated[str, OneOf(*ACTIVATIONS)] = parameter("tanh")
    actor_learning_rate: Fraction = parameter(1e-4)
    critic_learning_rate: Fraction = parameter(1e-4)
    discount: Fraction = parameter(0.95, symbol="gamma")
    target_rate: Fraction = parameter(0.005, symbol="tau")
    clock: bool = parameter(False)
    """Observe the slots flown. The last slot then ends the return: what is observed after it is
    never the beginning of a slot, so that a value there would not be learned."""
    geofence: bool = parameter(False)
    """Slow flights so that they end on the map."""
    reward_scale: PositiveNumber = parameter(1.0)
    """Factor of the rewards that are stored."""
    layer_norm: bool = parameter(False)
    """In the critics."""
    afterstate: bool = parameter(False)
    """Let the critics see where an action leads; see
    :class:`hyuav.learning.afterstate.Afterstate`."""
    coverage_blur: PositiveNumber = parameter(0.02)
    """How wide an afterstate shows the edge of a UE's coverage, as a share of the map's side; so
    that a gradient is felt beside it."""
    action_scale: ActionScale = parameter(1.0)
    """Of the tanh that ends the actor; see :class:`hyuav.learning.networks.ScaledTanh`."""

    @property
    def knows_layout(self) -> bool:
        """Whether a part of it must know where nodes are before it flies."""
        return self.afterstate

    @abstractmethod
    def build(self, learners: int, scenario: Scenario) -> "Algorithm":
        """Make the networks, their targets, the loss, the optimizers and the exploration.

        Args:
            learners: N.
            scenario: that they fly.
        """

    def guided(
        self,
        algorithm: "Algorithm",
        env: TransformedEnv,  # noqa: ARG002
        seeds: Sequence[int],  # noqa: ARG002
    ) -> "Algorithm":
        """An algorithm with what guides its learners; here as it is.

        Args:
            algorithm: that :meth:`build` has made, with the learners' initial weights.
            env: that the N learners fly.
            seeds: of their random numbers.
        """
        return algorithm

    def require_suited(self, reward: Reward) -> None:
        """Accept a reward of which these parameters assume nothing that does not hold.

        Raises:
            InputError: critics would see where actions lead alone, and it depends on the velocity.
        """
        if self.afterstate and reward.depends_on == VELOCITY:
            accepted = f"false, because reward = {reward.name} depends on the velocity"
            raise InputError(rejection("algorithm.afterstate", self.afterstate, accepted))

    def least_replay(self, num_slots: int) -> int:  # noqa: ARG002
        """How many slots a replay buffer must hold at least, with episodes of so many."""
        return 1

    def needed_memory(
        self, scenario: Scenario, horizons: Sequence[int], sizes: Mapping[str, int]
    ) -> list[Need]:
        """What a training keeps in memory; see :func:`hyuav.learning.memory.require_memory`."""
        layout = ObservationLayout(scenario, clock=True)
        inputs = 2 * layout.size if self.afterstate else layout.size + layout.action_size
        layers = (inputs, *self.hidden_sizes, layout.action_size)
        return needed_for_networks(layout.size, horizons, layers, sizes)

    @property
    def transitions(self) -> TransitionOptions:
        """What is kept of each slot."""
        return TransitionOptions(self.reward_scale, finite_horizon=self.clock)

    @property
    def environment(self) -> dict[str, bool]:
        """The options of :func:`hyuav.make_env` with which learners fly."""
        tells_fading = FADING in self.transitions.names
        return {"clock": self.clock, "geofence": self.geofence, "fading": tells_fading}

    def observation_size(self, scenario: Scenario) -> int:
        """Numbers of an observation."""
        return ObservationLayout(scenario, clock=self.clock).size

    def make_actor(self, learners: int, scenario: Scenario) -> TensorDictModule:
        """mu(s) of N learners.

        Reads ``observation`` (N, ..., observed), writes ``action`` (N, ..., 2) in [-1, 1].
        """
        layout, output = ObservationLayout(scenario, clock=self.clock), self.make_actor_output()
        sizes = layout.size, self.hidden_sizes, layout.action_size
        network = LearnerMLP(learners, *sizes, self.activation, output)
        return TensorDictModule(network, in_keys=["observation"], out_keys=["action"])

    def make_actor_output(self) -> nn.Module:
        """What ends an actor: its numbers (...) become actions (...) in [-1, 1]."""
        return ScaledTanh(self.action_scale) if self.action_scale > 1.0 else nn.Tanh()

    def make_critic(self, learners: int, scenario: Scenario) -> TensorDictModule:
        """Q(s, a) of N learners.

        Reads ``observation`` (N, ..., observed) and ``action`` (N, ..., 2), writes
        ``state_action_value`` (N, ..., 1).
        """
        afterstate = self.make_afterstate(scenario, self.geofence) if self.afterstate else None
        if afterstate is None:
            layout = ObservationLayout(scenario, clock=self.clock)
            inputs, outputs = layout.size + layout.action_size, 1
        else:
            inputs = afterstate.size
            outputs = 1 + scenario.num_helpers * scenario.num_ues
        network = LearnerMLP(
            learners,
            inputs,
            self.hidden_sizes,
            outputs,
            self.activation,
            layer_norm=self.layer_norm,
        )
        return TensorDictModule(
            network if afterstate is None else AfterstateCritic(afterstate, network),
            in_keys=["observation", "action"],
            out_keys=["state_action_value"],
        )

    def make_afterstate(self, scenario: Scenario, geofence: bool) -> Afterstate:
        """Where actions lead; see :class:`hyuav.learning.afterstate.Afterstate`."""
        return Afterstate(scenario, self.coverage_blur, clock=self.clock, geofence=geofence)

    def estimate_values(self, loss: LossModule) -> None:
        """Give a loss the target of eq. 9, with the discount."""
        loss.make_value_estimator(ValueEstimators.TD0, gamma=self.discount)


@dataclass(frozen=True)
class GradientStep:
    """One of the gradient steps that make up an update."""

    name: str
    loss: Callable[[TensorDictBase], Tensor]
    """Maps a mini-batch (N, K) to losses (N, K): learners in rows, transitions in columns."""
    optimizer: torch.optim.Optimizer
    """Of :func:`adam`."""
    every: int = 1
    """Taken in every n-th update."""
    normals: int = 0
    """Standard normal tensors (N, K, 2) that the loss draws."""


class Guidance(nn.Module):
    """What may guide learners while they train; this one leaves them alone.

    The loop and its compiled form call what stands here and know nothing else of it. Gradient
    steps, losses and modules of its own a guide adds to the algorithm, in
    :meth:`AlgorithmParameters.guided`. Its weights and buffers are part of a checkpoint.
    """

    streams: Mapping[str, RowStream] = {}
    """Of the random numbers that it draws, by name."""

    def plan(self, episode: int) -> Tensor | None:  # noqa: ARG002
        """Actions (T, N, 2) to execute in an episode, from 1, whatever the explorer says.

        NaN where it is the explorer that acts; None where there never is a plan.
        """
        return None

    def prepare(self, batch: TensorDictBase) -> TensorDictBase:
        """A mini-batch (N, K) as the losses are to see it."""
        return batch

    def end_episode(self, episode: int, flown: TensorDictBase, stored: TensorDictBase) -> None:
        """Take note of an episode.

        Args:
            episode: which one it was, from 1.
            flown: (T, N), its transitions.
            stored: (n, N), all that are in the replay buffer.
        """

    def control_term(self, slot: TensorDictBase) -> Tensor:
        """What of a slot's reward, scaled as those that are stored, is known to be chance.

        Args:
            slot: (N, ...), with what follows it.

        Returns:
            (N, ..., 1).
        """
        return torch.zeros_like(slot["next", "reward"])

    def end_evaluation(self, trajectory: Tensor) -> None:
        """Take note of where the actors fly and at which power: (T, N, actions)."""


@dataclass(frozen=True)
class Algorithm:
    """The parts of an algorithm for N learners, ready to train."""

    actor: TensorDictModuleBase
    """mu: writes the noise-free ``action`` (N, ..., 2) from ``observation``."""
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
    explorer_normals: int = 1
    """Standard normal tensors (N, 2) that the explorer draws for each slot."""
    mean_action: Callable[[TensorDictBase], Tensor] | None = None
    """The actor's noise-free actions (N, K, 2) of a mini-batch, with gradients, where the actor
    explores by a distribution of its own; None where they are what :attr:`actor` writes."""
    guide: Guidance = field(default_factory=Guidance)

    def act(self, batch: TensorDictBase) -> Tensor:
        """The actor's noise-free actions (N, K, 2) of a mini-batch, with gradients."""
        if self.mean_action is not None:
            return self.mean_action(batch)
        action: Tensor = self.actor(batch.select("observation"))["action"]
        return action

    def due(self, index: int) -> tuple[bool, ...]:
        """Which gradient steps the update of this index takes, and last whether targets follow."""
        return tuple(index % period == 0 for period in self._periods)

    @functools.cached_property
    def _periods(self) -> tuple[int, ...]:
        return (*(step.every for step in self.steps), self.target_every)

    @property
    def all_due(self) -> set[tuple[bool, ...]]:
        """Every combination of steps that an update takes."""
        return {self.due(index) for index in range(1, math.lcm(*self._periods) + 1)}

    @property
    def loss_normals(self) -> int:
        """Standard normal tensors (N, K, 2) that the losses draw in an update."""
        return sum(step.normals for step in self.steps)

    @property
    def modules(self) -> nn.ModuleDict:
        """All weights and buffers that training changes."""
        return nn.ModuleDict({"loss": self.loss, "explorer": self.explorer, "guide": self.guide})


def adam(weights: TensorDictParams | nn.Module, learning_rate: float) -> torch.optim.Adam:
    """Adam as the paper uses it, in PyTorch's fused form."""
    return torch.optim.Adam(list(weights.parameters()), lr=learning_rate, fused=True)
