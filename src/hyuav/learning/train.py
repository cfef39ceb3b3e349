"""Algorithm 1 of the paper, for learners of one horizon side by side."""

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.collectors import Collector

from hyuav._support.errors import InputError
from hyuav._support.randomness import (
    RowStream,
    derived_seed,
    given_normals,
    standard_normal,
    uniform,
)
from hyuav.envs.reward import Reward
from hyuav.envs.rewards import DEFAULT
from hyuav.envs.transforms import make_env
from hyuav.learning.algorithm import Algorithm, AlgorithmParameters, made_on
from hyuav.learning.checkpoint import (
    begins_episode,
    below_infinity,
    copied,
    counted,
    counted_to,
    draws_like,
    finite_like,
    optimizer_like,
    require_like,
)
from hyuav.learning.compile import CompiledSlots, FlownEpisode, all_finite
from hyuav.learning.exploration import as_planned
from hyuav.learning.learners import Learner
from hyuav.learning.policy import NoiseFreeReturn, fly_noise_free
from hyuav.learning.replay import latest, make_replay
from hyuav.learning.torchrl_internals import cursor_of, next_observation, set_filled
from hyuav.learning.weights import (
    begin_moments,
    copy_weights,
    draw_weights,
    finite_learners,
    forget_moments,
    load_weights,
    replace_learners,
)
from hyuav.physics.generators import LayoutGenerator
from hyuav.physics.scenario import Scenario


class Cohort:
    """N learners that share a horizon and nothing else.

    Args:
        scenario: node positions and parameters, with the learners' horizon; or what draws layouts
            anew in each episode.
        learners: their schemes and seeds.
        parameters: which algorithm, with its hyperparameters.
        replay_size: transitions kept of each learner.
        batch_size: K.
        device: of all tensors.
        reward: what a slot earns.
    """

    def __init__(
        self,
        scenario: Scenario | LayoutGenerator,
        learners: Sequence[Learner],
        parameters: AlgorithmParameters,
        replay_size: int,
        batch_size: int,
        device: torch.device | str | None,
        reward: Reward = DEFAULT,
    ) -> None:
        self._flown, self.learners = scenario, tuple(learners)
        self._parameters, self._transitions = parameters, parameters.transitions
        seeds = [learner.seed for learner in learners]
        schemes = [learner.scheme for learner in learners]
        self._options: dict[str, Any] = {"reward": reward, **parameters.environment}
        self.env = make_env(scenario, schemes, (len(seeds),), device, seeds, **self._options)
        self.scenario: Scenario = self.env.base_env.scenario
        parameters.require_suited(self.env.base_env.reward)
        # Line 1: actor mu, critic Q, their targets and the replay buffer B.
        with made_on(self.env.device):
            algorithm = parameters.build(len(seeds), self.scenario)
            draw_weights(algorithm.loss, seeds, "weights")
            self.algorithm = parameters.guided(algorithm, self.env, seeds)
        for step in self.algorithm.steps:
            begin_moments(step.optimizer)
        self._streams = self._random_streams(seeds, batch_size)
        self.stored = self._transitions.allocate(self.env, replay_size)
        self.replay = make_replay(self.stored, batch_size, self._streams["sampling"])
        self._plan: Tensor | None = None
        # Lines 4 to 11 are the environment's: the collector brings a slot each time it is asked.
        self.collector = Collector(
            self.env,
            self._explore,
            frames_per_batch=len(seeds),
            total_frames=-1,
            trust_policy=True,
            track_traj_ids=False,
            auto_register_policy_transforms=False,
        )
        self._collected = iter(self.collector)
        self._compiled: CompiledSlots | None = None
        self.episode = self.updates = 0
        self.best_evaluation = torch.full(
            (len(seeds),), -torch.inf, dtype=torch.float32, device=self.env.device
        )
        self.best_weights = copy_weights(self.algorithm.loss)
        self.stopped = torch.zeros(len(seeds), dtype=torch.int64, device=self.env.device)

    def _random_streams(self, seeds: Sequence[int], batch_size: int) -> dict[str, RowStream]:
        actions = self.env.action_spec.shape[-1]
        laws = {
            "exploration": (standard_normal, (self.algorithm.explorer_normals, actions)),
            "sampling": (uniform, (batch_size,)),
            "losses": (standard_normal, (self.algorithm.loss_normals, batch_size, actions)),
        }
        return {
            name: RowStream(law, shape, seeds, name, self.env.device)
            for name, (law, shape) in laws.items()
            if math.prod(shape)
        }

    def fly(self) -> FlownEpisode:
        """Fly and learn for one episode.

        A learner whose losses, reward or weights are no longer finite stops: ``stopped`` (N,) is
        the slot, counted from the first of training, 0 for those that go on. Its numbers do not
        count any more.
        """
        guide, slots = self.algorithm.guide, self.scenario.num_slots
        self.episode += 1
        self._plan = guide.plan(self.episode)
        flown = self._fly_compiled() if self.is_compiled else self._fly_slots()
        last = self.stored[latest(self.replay, slots)]
        guide.end_episode(self.episode, last, self.stored[: len(self.replay)])
        self._stop_where_not_finite(flown)
        return flown

    def _fly_slots(self) -> FlownEpisode:
        """Lines 2 to 16, slot by slot."""
        reward = torch.zeros_like(self.best_evaluation)
        unbroken = torch.ones_like(self.stopped, dtype=torch.bool)
        finite = torch.zeros_like(self.stopped)
        losses: list[dict[str, Tensor]] = []
        for _ in range(self.scenario.num_slots):
            slot = next(self._collected)[:, 0]  # lines 3 to 11
            self.replay.extend(self._transitions.transition(slot).unsqueeze(0))  # line 12
            losses.append({})
            if len(self.replay) >= self.replay.batch_size:
                batch = self.replay.sample()  # line 13
                self.updates += 1
                with self._given("losses"):
                    losses[-1] = update_networks(self.algorithm, batch, self.updates)  # line 14
                update_targets(self.algorithm, self.updates)  # line 15
            reward += slot["next", "reward"].squeeze(-1)
            unbroken &= all_finite((reward, *losses[-1].values()))
            finite += unbroken
        return FlownEpisode(reward, _mean(losses), finite)

    def _explore(self, observed: TensorDictBase) -> TensorDictBase:
        """Line 5: the action of the actor, and noise; or what a guide has planned."""
        with self._given("exploration"):
            acted = self.algorithm.explorer(observed)
        if self._plan is None:
            return acted
        return as_planned(acted, self._plan[int(acted["step_count"][0])])

    def _given(self, name: str) -> AbstractContextManager[None]:
        """Inside it, normal numbers are drawn from the next of a stream, where there is one."""
        if name not in self._streams:
            return nullcontext()
        return given_normals(iter(next(self._streams[name]).unbind(dim=1)))

    @property
    def learns(self) -> bool:
        """Whether every slot of the next episode is followed by an update."""
        return len(self.replay) + 1 >= self.replay.batch_size

    @property
    def is_compiled(self) -> bool:
        """Whether the next episode is flown by compiled programs."""
        return self._compiled is not None

    def compile(self) -> None:
        """Fly from the next episode on by compiled programs; see :class:`CompiledSlots`.

        Raises:
            Exception: one of :data:`hyuav._support.recording.COMPILATION_ERRORS`.
        """
        if self._compiled is None:
            self._compiled = CompiledSlots(
                self.env,
                self.algorithm,
                self._transitions,
                self.replay,
                self.stored,
                self._streams,
                self._observed(),
            )

    def _fly_compiled(self) -> FlownEpisode:
        assert self._compiled is not None
        slots = self.scenario.num_slots
        flown = self._compiled.fly(self._observed(), self._plan, slots, self.updates)
        self.updates += slots
        next_observation(self.collector).update(self.env.reset())
        return flown

    def _observed(self) -> TensorDictBase:
        """What the helpers observe before the next slot, (N,)."""
        names = (*self.env.observation_spec.keys(), *self.env.done_keys)
        return next_observation(self.collector).select(*names)

    def _stop_where_not_finite(self, flown: FlownEpisode) -> None:
        slots = self.scenario.num_slots
        finite = finite_learners(self.algorithm.loss) & (flown.finite == slots)
        slot = (self.episode - 1) * slots + (flown.finite + 1).clamp(max=slots)
        self.stopped = torch.where((self.stopped == 0) & ~finite, slot, self.stopped)
        where = self.stopped > 0
        if where.any():  # they take part in every product, so they are kept finite
            own = copy_weights(self.algorithm.loss)
            replace_learners(own, self.best_weights, where)
            load_weights(self.algorithm.loss, own)
            for step in self.algorithm.steps:
                forget_moments(step.optimizer, where)
            self.stored[:, where] = 0

    def evaluate(
        self, episodes: int, seed: int, scheme: str | None = None
    ) -> tuple[NoiseFreeReturn, Tensor]:
        """Fly the current actors without noise, all of them through the same fading.

        Args:
            episodes: flown by each learner.
            seed: of the fading.
            scheme: that all learners fly; None for each learner's own.

        Returns:
            as :func:`hyuav.learning.policy.fly_noise_free`.
        """
        env = make_env(
            self._flown,
            self.env.base_env.schemes if scheme is None else scheme,
            (len(self.learners), episodes),
            self.env.device,
            [derived_seed(seed, "evaluation")] * len(self.learners),
            **self._options,
        )
        return fly_noise_free(env, self.algorithm, self._parameters.reward_scale)

    def keep_best(self, episodes: int, seed: int, *, noted: bool = True) -> NoiseFreeReturn:
        """Evaluate; where a learner never earned more, its weights are the best.

        Args:
            episodes: flown by each learner.
            seed: of the fading.
            noted: whether a guide takes note of where the actors fly.
        """
        earned, trajectory = self.evaluate(episodes, seed)
        better = (earned.reward > self.best_evaluation) & (self.stopped == 0)
        self.best_evaluation = torch.where(better, earned.reward, self.best_evaluation)
        replace_learners(self.best_weights, copy_weights(self.algorithm.loss), better)
        if noted:
            self.algorithm.guide.end_evaluation(trajectory)
        return earned

    def state_dict(self) -> dict[str, Any]:
        """Everything that evolves; the tensors are the cohort's own."""
        guide = self.algorithm.guide
        return {
            "modules": self.algorithm.modules.state_dict(),
            "optimizers": [step.optimizer.state_dict() for step in self.algorithm.steps],
            "replay": self.stored.flatten_keys(".").to_dict(),
            "replay_length": len(self.replay),
            "replay_cursor": cursor_of(self.replay),
            "slot": self._observed().to_dict(),  # where the flight stands
            "environment": self.env.base_env.draws.state(),
            "random": {
                name: stream.state() for name, stream in {**self._streams, **guide.streams}.items()
            },
            "episode": self.episode,
            "updates": self.updates,
            "best_evaluation": self.best_evaluation,
            "best_weights": self.best_weights,
            "stopped": self.stopped,
        }

    def require_state(self, name: str, state: Any) -> None:
        """Accept what :meth:`state_dict` gave of a cohort made with the same arguments.

        Args:
            name: of the state, for errors.
            state: to be taken up by :meth:`load_state_dict`.

        Raises:
            InputError: it differs from this cohort's own; the line names the entry.
        """
        own, capacity = self.state_dict(), len(self.stored)
        example = {
            **own,
            "optimizers": [optimizer_like(optimizer) for optimizer in own["optimizers"]],
            "replay_length": counted_to(capacity),
            "replay_cursor": counted_to(capacity - 1),
            "slot": begins_episode(own["slot"]),
            "environment": draws_like(own["environment"]),
            "random": {key: draws_like(stream) for key, stream in own["random"].items()},
            "episode": counted,
            "updates": counted,
            "best_evaluation": below_infinity(own["best_evaluation"]),
            "best_weights": {key: finite_like(own) for key, own in self.best_weights.items()},
        }
        require_like(name, state, example)
        flown = state["episode"] * self.scenario.num_slots
        if not ((state["stopped"] >= 0) & (state["stopped"] <= flown)).all():
            raise InputError(f"{name}.stopped: expected slots up to {flown}")

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue where :meth:`state_dict` was taken, in a cohort made with the same arguments.

        Args:
            state: that :meth:`require_state` accepts.
        """
        self._compiled = None  # its programs hold the optimizers' former tensors
        self.algorithm.modules.load_state_dict(state["modules"])
        for step, optimizer in zip(self.algorithm.steps, state["optimizers"], strict=True):
            step.optimizer.load_state_dict(copied(optimizer))
        for name, values in self.stored.flatten_keys(".").items():
            values.copy_(state["replay"][name])
        set_filled(self.replay, state["replay_length"], state["replay_cursor"])
        next_observation(self.collector).update(state["slot"])
        self.env.base_env.draws.set_state(state["environment"])
        for name, stream in {**self._streams, **self.algorithm.guide.streams}.items():
            stream.set_state(state["random"][name])
        self.episode, self.updates = state["episode"], state["updates"]
        self.best_evaluation = state["best_evaluation"].to(self.env.device)
        self.stopped = state["stopped"].to(self.env.device)
        self.best_weights = {
            name: values.to(self.env.device)
            for name, values in copied(state["best_weights"]).items()
        }


def update_networks(algorithm: Algorithm, batch: TensorDictBase, index: int) -> dict[str, Tensor]:
    """Line 14: take the gradient steps, eq. 9 and 10 for DDPG, on a mini-batch of each learner.

    Args:
        algorithm: of N learners.
        batch: (N, K) transitions.
        index: of this update, from 1, for the parts that are not taken every time.

    Returns:
        the mean loss (N,) of each step that was taken, by the step's name.
    """
    losses = {}
    batch = algorithm.guide.prepare(batch)
    for step, due in zip(algorithm.steps, algorithm.due(index), strict=False):
        if not due:
            continue
        loss = step.loss(batch).mean(dim=-1)
        step.optimizer.zero_grad()
        loss.sum().backward()  # learners share no weight, so the sum keeps them apart
        step.optimizer.step()
        losses[step.name] = loss.detach()
    return losses


def update_targets(algorithm: Algorithm, index: int) -> None:
    """Line 15: let the targets follow, in every ``target_every``-th update."""
    if algorithm.due(index)[-1]:
        algorithm.target.step()


def _mean(losses: list[dict[str, Tensor]]) -> dict[str, Tensor]:
    """Mean over an episode's updates of each gradient step's losses."""
    names = {name for loss in losses for name in loss}
    return {
        name: torch.stack([loss[name] for loss in losses if name in loss]).mean(dim=0)
        for name in sorted(names)
    }
