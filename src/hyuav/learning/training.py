"""The training loop: Algorithm 1, for any algorithm and for many learners side by side."""

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.collectors import Collector

from hyuav.envs.transforms import make_env
from hyuav.errors import InputError, InputTypeError, rejection
from hyuav.learning.algorithms import AlgorithmParameters
from hyuav.learning.compiled import COMPILATION_ERRORS, CompiledUpdate, pays
from hyuav.learning.randomness import RandomStream
from hyuav.learning.replay import as_transition, make_replay
from hyuav.learning.weights import copy_weights, load_weights, replace_learners
from hyuav.parameters import Parameters, choice, count, parameter, switch
from hyuav.scenario import Scenario


@dataclass(frozen=True)
class TrainingParameters(Parameters):
    """How long and on what to learn; the defaults are the paper's where it gives one."""

    num_episodes: int = parameter(count(), 1000)
    replay_size: int = parameter(count(), 8000)
    batch_size: int = parameter(count(), 70, symbol="K")
    evaluation_every: int = parameter(count(), 10, unit="episode")
    evaluation_episodes: int = parameter(count(), 100)
    clock: bool = parameter(switch, False)
    compile: str = parameter(choice("auto", "always", "never"), "auto")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.batch_size > self.replay_size:
            accepted = f"at most replay_size = {self.replay_size}"
            raise InputError(rejection("batch_size", self.batch_size, accepted))


@dataclass(frozen=True)
class Episode:
    """What one episode of training brought to each of the N learners."""

    number: int
    """Of the episode, from 1."""
    slots: int
    """Flown by each learner since training began."""
    accumulated_reward: Tensor
    """(N,) bps/Hz, with exploration and penalties, undiscounted."""
    losses: dict[str, Tensor]
    """(N,) mean loss of the episode's updates, by gradient step."""
    evaluation: Tensor | None
    """(N,) bps/Hz, noise-free accumulated reward, in the episodes that end with an evaluation."""


class Training:
    """N independent learners in one process, each with its own weights, replay and noise.

    The learners differ in their random numbers and, where ``schemes`` says so, in their scheme.
    All that evolves is in :meth:`state_dict`. The random numbers are the training's own, so that
    it gives the same numbers whatever else the process does.

    Args:
        scenario: node positions and parameters.
        schemes: one of "hybrid", "relay" and "jamming" for each learner; N is their number.
        algorithm: which one, with its hyperparameters.
        parameters: how long and on what to learn.
        seed: of all random numbers.
        device: of all tensors.

    Raises:
        InputError: an unknown scheme or device, or a negative seed.
        InputTypeError: an argument of the wrong type.
    """

    def __init__(
        self,
        scenario: Scenario,
        schemes: Sequence[str],
        algorithm: AlgorithmParameters,
        parameters: TrainingParameters,
        seed: int = 0,
        device: torch.device | str | None = None,
    ) -> None:
        if isinstance(schemes, str) or not schemes:
            raise InputTypeError(rejection("schemes", schemes, "a list with one for each learner"))
        if not isinstance(algorithm, AlgorithmParameters):
            raise InputTypeError(rejection("algorithm", algorithm, "DDPG(), TD3() or SAC()"))
        learners, clock = len(schemes), parameters.clock
        self.scenario, self.schemes, self.parameters = scenario, tuple(schemes), parameters
        env = make_env(scenario, schemes, (learners,), device, seed, clock=clock)
        self._evaluation_seed = (seed + 1) % 2**63
        observation_size = env.observation_spec["observation"].shape[-1]
        self._random = RandomStream(seed, env.device)
        with env.device, self._random.active():
            self.algorithm = algorithm.build(learners, observation_size)
        self.replay = make_replay(
            learners, parameters.replay_size, parameters.batch_size, env.device
        )
        self.collector = Collector(
            env,
            self.algorithm.explorer,
            frames_per_batch=learners,
            total_frames=-1,
            trust_policy=True,
            track_traj_ids=False,
            auto_register_policy_transforms=False,
        )
        self._transitions = iter(self.collector)
        self._compiled: CompiledUpdate | None = None
        self.slots = self.updates = 0
        self.best_evaluation = torch.full((learners,), -torch.inf, device=env.device)
        self.best_weights = copy_weights(self.algorithm.loss)

    @property
    def episode(self) -> int:
        """How many episodes have been flown."""
        return self.slots // self.scenario.num_slots

    def episodes(self) -> Iterator[Episode]:
        """Train until ``num_episodes`` are flown; report each episode as it ends."""
        self._compiled = CompiledUpdate(self.algorithm) if self._compiling_pays() else None
        while self.episode < self.parameters.num_episodes:
            with self._random.active():
                episode = self._train_episode()
            yield episode

    def _train_episode(self) -> Episode:
        rewards, losses = [], []
        for _ in range(self.scenario.num_slots):
            transition = next(self._transitions)[:, 0]
            rewards.append(transition["next", "reward"].squeeze(-1))
            losses.append(self._learn(as_transition(transition)))
            self.slots += 1
        return Episode(
            number=self.episode,
            slots=self.slots,
            accumulated_reward=torch.stack(rewards).sum(dim=0),
            losses=_mean(losses),
            evaluation=self._keep_best() if self._evaluation_is_due() else None,
        )

    def _compiling_pays(self) -> bool:
        if self.parameters.compile != "auto":
            return self.parameters.compile == "always"
        slots = self.parameters.num_episodes * self.scenario.num_slots
        return pays(slots - self.slots, len(self.schemes))

    def _learn(self, transition: TensorDictBase) -> dict[str, Tensor]:
        """Lines 12 to 15 of Algorithm 1; the collector has gone through lines 3 to 11."""
        self.replay.extend(transition.unsqueeze(0))
        if len(self.replay) < self.parameters.batch_size:
            return {}
        batch = self.replay.sample()
        self.updates += 1
        return self._update(batch)

    def _update(self, batch: TensorDictBase) -> dict[str, Tensor]:
        """Lines 14 and 15, as one graph where it is compiled and can be."""
        if self._compiled is not None:
            try:
                return self._compiled(batch, self.updates)
            except COMPILATION_ERRORS as error:  # before any weight has changed
                if self.parameters.compile == "always":
                    raise
                reason = " ".join(str(error).split())[:200]
                warnings.warn(f"training goes on without compiling ({reason})", stacklevel=2)
                self._compiled = None
        losses = self.algorithm.update_networks(batch, self.updates)
        self.algorithm.update_targets(self.updates)
        return losses

    def _evaluation_is_due(self) -> bool:
        last = self.episode == self.parameters.num_episodes
        return last or self.episode % self.parameters.evaluation_every == 0

    def evaluate(self, scheme: str | None = None) -> Tensor:
        """Fly the current actors without noise, on the same fading draws every time.

        Args:
            scheme: that all learners fly; None for each learner's own.

        Returns:
            (N,) mean accumulated reward in bps/Hz.
        """
        env = make_env(
            self.scenario,
            self.schemes if scheme is None else scheme,
            (len(self.schemes), self.parameters.evaluation_episodes),
            self.collector.env.device,
            self._evaluation_seed,
            clock=self.parameters.clock,
        )
        with torch.no_grad():
            flown = env.rollout(self.scenario.num_slots, self.algorithm.actor)
        evaluation: Tensor = flown["next", "episode_reward"][..., -1, 0].mean(dim=-1)
        return evaluation

    def _keep_best(self) -> Tensor:
        """Evaluate; where a learner has never been better, its weights are the best so far."""
        evaluation = self.evaluate()
        better = evaluation > self.best_evaluation
        self.best_evaluation = torch.where(better, evaluation, self.best_evaluation)
        replace_learners(self.best_weights, copy_weights(self.algorithm.loss), better)
        return evaluation

    def warm_start(self, weights: dict[str, Tensor]) -> None:
        """Begin with the networks of an earlier training, the best so far until beaten.

        Args:
            weights: of N learners, or of one, with which all then begin.

        Raises:
            InputError: the weights are of another algorithm, of other sizes or of another number
                of learners.
        """
        load_weights(self.algorithm.loss, weights)
        self._keep_best()

    def state_dict(self) -> dict[str, Any]:
        """Everything that evolves: continuing from it gives the numbers of an unbroken run.

        The tensors are the training's own; save them before it goes on.
        """
        return {
            "modules": self.algorithm.modules.state_dict(),
            "optimizers": [step.optimizer.state_dict() for step in self.algorithm.steps],
            "replay": self.replay.state_dict(),
            "slot": self.collector._carrier.to_dict(),  # where the flight stands
            "environment": self.collector.env.base_env.draws.state(),
            "random": self._random.state,
            "slots": self.slots,
            "updates": self.updates,
            "best_evaluation": self.best_evaluation,
            "best_weights": self.best_weights,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue where :meth:`state_dict` was taken, in a training made with the same arguments.

        Raises:
            InputError: the state is of another algorithm, learner axis or scenario.
        """
        try:
            self.algorithm.modules.load_state_dict(state["modules"])
            for step, optimizer in zip(self.algorithm.steps, state["optimizers"], strict=True):
                step.optimizer.load_state_dict(optimizer)
            self.replay.load_state_dict(state["replay"])
            self.collector._carrier.update(state["slot"])
            self.collector.env.base_env.draws.set_state(state["environment"])
            self._random.state = state["random"]
            self.slots, self.updates = state["slots"], state["updates"]
            self.best_evaluation = state["best_evaluation"]
            self.best_weights = state["best_weights"]
        except (KeyError, RuntimeError, ValueError, TypeError, AttributeError) as error:
            reason = " ".join(str(error).split())
            raise InputError(f"checkpoint: not of a training like this one ({reason})") from None


def _mean(losses: list[dict[str, Tensor]]) -> dict[str, Tensor]:
    """Mean over an episode's updates of each gradient step's losses."""
    names = {name for loss in losses for name in loss}
    return {
        name: torch.stack([loss[name] for loss in losses if name in loss]).mean(dim=0)
        for name in sorted(names)
    }
