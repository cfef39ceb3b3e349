"""Learning across scenarios: to tell places apart as dynamic programming does."""

import math
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

import torch
import torch.nn.functional as F  # noqa: N812
from pydantic.dataclasses import dataclass
from tensordict import TensorDict
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn
from torchrl.data import ReplayBuffer, TensorStorage

from hyuav._support.parameters import (
    Count,
    CountOrZero,
    OneOf,
    Parameters,
    PositiveNumber,
    parameter,
)
from hyuav.learning.generalist.decide import Helpers, choices, flights
from hyuav.learning.generalist.lessons import Lessons
from hyuav.learning.generalist.network import GeneralistNetwork
from hyuav.learning.generalist.reinforcement import TEMPERATURE, bellman_error
from hyuav.learning.generalist.scene import TURNS

WARM_UP = 100
"""Steps in which the learning rate rises to its largest."""

LAST_RATE = 0.01
"""What is left of the learning rate at the end."""

LONGEST_GRADIENT = 1.0
"""Longer ones are shortened."""

WEIGHTS = {"regret": 10.0, "divergence": 0.2, "error": 5.0}
"""Of the parts of the imitation's loss; the last one is that of the Bellman error too."""

WAYS = ("imitation", "reinforcement", "both")

KEPT = 0.99
"""Of the delayed weights, in each step."""


@dataclass(frozen=True)
class GeneralistParameters(Parameters):
    """How a generalist learns."""

    way: Annotated[str, OneOf(*WAYS)] = parameter("imitation")
    """From the exact values of solved scenarios, from what its own decisions bring, or both."""
    steps: Count = parameter(8000)
    """Of gradient descent."""
    batch_size: Count = parameter(512)
    """Helpers that decide in a step, half of them where its own flights lead."""
    learning_rate: PositiveNumber = parameter(1e-3)
    """The largest; it falls by a cosine."""
    weight_decay: PositiveNumber = parameter(1e-4)
    evaluation_every: Count = parameter(400)
    """Steps between two evaluations, at which it flies some scenarios anew."""
    flights: Count = parameter(1000)
    """That many of them, to learn from where they lead."""
    seed: CountOrZero = parameter(0)


class Loss(NamedTuple):
    """How far decisions are from the best ones, in the mean over helpers."""

    regret: Tensor
    """What a helper loses that chooses by the softmax, in units of what the best place brings."""
    divergence: Tensor
    """Of its softmax from that of the exact worths (Kullback-Leibler)."""
    error: Tensor
    """Of the values to go, each less their mean (Huber)."""

    @property
    def total(self) -> Tensor:
        """The weighted sum that is minimized."""
        parts = self._asdict().items()
        return torch.stack([WEIGHTS[name] * part for name, part in parts]).sum()


def imitation_loss(
    network: GeneralistNetwork, lessons: Lessons, helpers: Helpers, turn: Tensor
) -> Loss:
    """Compare decisions with the exact ones.

    Args:
        network: that decides.
        lessons: the solved scenarios.
        helpers: that are to decide.
        turn: as for :func:`hyuav.learning.generalist.decide.choices`.
    """
    choice = choices(network, lessons.world, helpers, turn)
    exact = lessons.values(helpers, choice.cell)
    allowed = choice.worth > -torch.inf
    best = (choice.rewards + exact).where(allowed, -torch.inf)
    regrets = best.amax(dim=-1, keepdim=True) - best
    told = (choice.worth / TEMPERATURE).log_softmax(dim=-1)
    wanted = (-regrets / TEMPERATURE).softmax(dim=-1)
    share = allowed / allowed.sum(dim=-1, keepdim=True)
    error = ((choice.worth - choice.rewards) - exact).where(allowed, 0.0)
    centered = (error - (error * share).sum(dim=-1, keepdim=True)) * allowed
    regret = told.exp() * regrets.where(allowed, 0.0)
    divergence = wanted * (wanted.clamp(min=1e-12).log() - told.where(allowed, 0.0))
    huber = F.smooth_l1_loss(centered, torch.zeros_like(centered), reduction="none", beta=0.1)
    return Loss(
        regret.sum(dim=-1).mean(),
        divergence.sum(dim=-1).mean(),
        (huber * share).sum(dim=-1).mean(),
    )


class Progress(NamedTuple):
    """How far a generalist has come."""

    step: int
    loss: float
    mean: float
    """Of what it earns in the scenarios for validation, in units of the optimum; so below."""
    fifth_percentile: float
    worst: float


class GeneralistTraining:
    """A generalist that learns across scenarios.

    Half of each mini-batch is anywhere; the other half is where its own flights led when it last
    flew (Ross, Gordon, Bagnell, AISTATS 2011), kept in TorchRL's replay buffer.

    Args:
        lessons: from which it learns.
        validation: by which it is judged.
        parameters: how it learns.
    """

    def __init__(
        self, lessons: Lessons, validation: Lessons, parameters: GeneralistParameters
    ) -> None:
        self._lessons, self._validation, self.parameters = lessons, validation, parameters
        with torch.random.fork_rng():
            torch.manual_seed(parameters.seed)
            self.network = GeneralistNetwork()
        self.network.to(lessons.optimum.device)
        self._delayed = AveragedModel(self.network, multi_avg_fn=get_ema_multi_avg_fn(KEPT))
        self._optimizer = torch.optim.AdamW(
            self.network.parameters(),
            parameters.learning_rate,
            weight_decay=parameters.weight_decay,
        )
        self.step = 0
        self._visited: ReplayBuffer | None = None

    def run(self) -> Iterator[Progress]:
        """Learn to the end, telling how far it is after every evaluation."""
        every, total = self.parameters.evaluation_every, self.parameters.steps
        while self.step < total:
            if self.step % every == 0:
                self._visited = self._flown()
            loss = self._learn()
            if self.step % every == 0 or self.step == total:
                yield self._progress(loss)

    def state_dict(self) -> dict[str, Any]:
        """All that going on needs, between two evaluations."""
        return {
            "step": self.step,
            "network": self.network.state_dict(),
            "delayed": self._delayed.state_dict(),
            "optimizer": self._optimizer.state_dict(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on where :meth:`state_dict` was taken."""
        self.step = state["step"]
        self.network.load_state_dict(state["network"])
        self._delayed.load_state_dict(state["delayed"])
        self._optimizer.load_state_dict(state["optimizer"])

    def _flown(self) -> ReplayBuffer:
        """Where its own flights lead now."""
        generator = torch.Generator().manual_seed(self.parameters.seed * 2**32 + self.step)
        world = self._lessons.world
        some = torch.randperm(world.scenes.count, generator=generator)[: self.parameters.flights]
        _, flown = flights(self.network, world, some.to(world.scenes.start.device))
        states = Helpers(*(torch.cat(parts) for parts in zip(*flown, strict=True)))
        visited = TensorDict(states._asdict(), batch_size=[len(states.scene)])
        return ReplayBuffer(storage=TensorStorage(visited))

    def _learn(self) -> Tensor:
        parameters, total = self.parameters, self.parameters.steps
        # A step's random numbers are its own, so that a training can go on at any of them.
        generator = torch.Generator().manual_seed(parameters.seed * 2**32 + self.step)
        half = parameters.batch_size // 2
        helpers = self._lessons.anywhere(parameters.batch_size - half, generator)
        assert self._visited is not None
        picked = torch.randint(len(self._visited), (half,), generator=generator)
        own = self._visited[picked]
        both = [torch.cat([part, own[name]]) for name, part in helpers._asdict().items()]
        turn = torch.stack(TURNS)[
            torch.randint(len(TURNS), (parameters.batch_size,), generator=generator)
        ]
        loss = self._loss(Helpers(*both), turn, generator)
        falling = 0.5 * (1.0 + math.cos(math.pi * self.step / total))
        rate = min(1.0, (self.step + 1) / WARM_UP) * (LAST_RATE + (1.0 - LAST_RATE) * falling)
        for group in self._optimizer.param_groups:
            group["lr"] = parameters.learning_rate * rate
        self._optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), LONGEST_GRADIENT)
        self._optimizer.step()
        if parameters.way != "imitation":
            self._delayed.update_parameters(self.network)
        self.step += 1
        return loss.detach()

    def _loss(self, helpers: Helpers, turn: Tensor, generator: torch.Generator) -> Tensor:
        parts, way = [], self.parameters.way
        if way != "reinforcement":
            parts.append(imitation_loss(self.network, self._lessons, helpers, turn).total)
        if way != "imitation":
            error = bellman_error(
                self.network, self._delayed, self._lessons.world, helpers, turn, generator
            )
            parts.append(WEIGHTS["error"] * error)
        return torch.stack(parts).sum()

    def _progress(self, loss: Tensor) -> Progress:
        world = self._validation.world
        scene = torch.arange(world.scenes.count, device=world.scenes.start.device)
        earned, _ = flights(self.network, world, scene)
        fraction = earned / self._validation.optimum
        return Progress(
            self.step,
            float(loss),
            float(fraction.mean()),
            float(fraction.quantile(0.05)),
            float(fraction.min()),
        )
