"""Learners of one horizon side by side: Algorithm 1, one episode at a time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.collectors import Collector

from hyuav._support.parameters import Parameters, choice, count, optional, parameter
from hyuav._support.randomness import (
    RowStream,
    derived_seed,
    given_normals,
    standard_normal,
    uniform,
)
from hyuav.envs.transforms import make_env
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.compile import CompiledSlots, Flown, all_finite
from hyuav.learning.guide.demonstrations import as_planned
from hyuav.learning.guide.planner import FlightSearch
from hyuav.learning.guide.proposals import Imagination
from hyuav.learning.replay import clear_unused, forget, latest, make_replay
from hyuav.learning.state import with_own_memory
from hyuav.learning.weights import (
    copy_weights,
    draw_weights,
    finite_learners,
    forget_moments,
    load_weights,
    replace_learners,
)
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import SCHEMES


@dataclass(frozen=True)
class Learner(Parameters):
    """What distinguishes one learner from another.

    All its random numbers come from its seed: initial weights, exploration, fading, sampling. So
    it learns the same alone and among others, and learners of equal seeds that differ in scheme
    or horizon begin with the same weights and meet the same luck.
    """

    scheme: str = parameter(choice(*SCHEMES), "hybrid")
    seed: int = parameter(count(0), 0)
    num_slots: int | None = parameter(optional(count()), None, symbol="T")
    """The horizon; the scenario's where it is None."""


class Earned(NamedTuple):
    """What actors earn without noise, on average over the same episodes."""

    reward: Tensor
    """(N,) bps/Hz, accumulated, with penalties; less the luck of these episodes, where the learner
    has a control variate, so that flights are told apart that differ by less."""
    sum_rate: Tensor
    """(N,) bps/Hz, the accumulated secrecy sum-rate alone."""
    way: Tensor
    """(T, N, 2), where the actors flew in the first of the episodes, in units of half the map's
    side."""


class Cohort:
    """N learners that share a horizon and nothing else.

    Args:
        scenario: node positions and parameters, with the learners' horizon.
        learners: their schemes and seeds.
        algorithm: which one, with its hyperparameters.
        replay_size: transitions kept of each learner.
        batch_size: K.
        device: of all tensors.
    """

    def __init__(
        self,
        scenario: Scenario,
        learners: Sequence[Learner],
        algorithm: AlgorithmParameters,
        replay_size: int,
        batch_size: int,
        device: torch.device | str | None,
    ) -> None:
        self.scenario, self.learners = scenario, tuple(learners)
        self._options = {"clock": algorithm.clock, "geofence": algorithm.geofence}
        learning = {**self._options, "fading": algorithm.control_variate}
        self.batch_size = batch_size
        seeds = [learner.seed for learner in learners]
        schemes = [learner.scheme for learner in learners]
        self.env = make_env(scenario, schemes, (len(seeds),), device, seeds, **learning)
        with self.env.device:
            self.algorithm = algorithm.assemble(len(seeds), scenario)
        draw_weights(self.algorithm.loss, seeds, "weights")
        if self.algorithm.expectation is not None:
            draw_weights(self.algorithm.expectation, seeds, "control variate")
        self._streams = self._random_streams(seeds)
        self._search = self._flight_search(schemes, seeds)
        self.replay = make_replay(
            replay_size,
            batch_size,
            self._streams["sampling"],
            self.env.device,
        )
        self.episode = self.updates = 0
        self.collector = Collector(
            self.env,
            self._explore,
            frames_per_batch=len(seeds),
            total_frames=-1,
            trust_policy=True,
            track_traj_ids=False,
            auto_register_policy_transforms=False,
        )
        self._transitions = iter(self.collector)
        self._compiled: CompiledSlots | None = None
        self.best_evaluation = torch.full((len(seeds),), -torch.inf, device=self.env.device)
        self.best_weights = copy_weights(self.algorithm.loss)
        self.stopped = torch.zeros(len(seeds), dtype=torch.int64, device=self.env.device)

    def _random_streams(self, seeds: Sequence[int]) -> dict[str, RowStream]:
        size, normals = self.batch_size, sum(step.normals for step in self.algorithm.steps)
        laws = {
            "exploration": (standard_normal, (self.algorithm.parameters.explorer_normals, 2)),
            "sampling": (uniform, (size,)),
            "losses": (standard_normal, (normals, size, 2)),
        }
        return {
            name: RowStream(law, shape, seeds, name, self.env.device)
            for name, (law, shape) in laws.items()
            if math.prod(shape)
        }

    @property
    def _all_streams(self) -> dict[str, RowStream]:
        """Those that slots draw from, and those that the search draws from after an episode."""
        return self._streams | (self._search.streams if self._search else {})

    def _flight_search(self, schemes: Sequence[str], seeds: Sequence[int]) -> FlightSearch | None:
        flights, expectation = self.algorithm.best_flights, self.algorithm.expectation
        if flights is None or expectation is None:
            return None
        imagined = self.algorithm.parameters.imagined_flights
        system = self.env.base_env.system
        imagination = Imagination(imagined, system, schemes) if imagined else None
        return FlightSearch(flights, expectation, imagination, seeds)

    def _explore(self, tensordict: TensorDictBase) -> TensorDictBase:
        with given_normals(iter(next(self._streams["exploration"]).unbind(dim=1))):
            tensordict = self.algorithm.explorer(tensordict)
        if not self.algorithm.parameters.repeat_every:
            return tensordict
        return as_planned(tensordict, self._plan()[int(tensordict["step_count"][0])])

    def _plan(self) -> Tensor:
        """Actions (T, N, 2) that are taken whatever the explorer says, NaN where there are none."""
        flights = self.algorithm.best_flights
        assert flights is not None
        planned = flights.tried_actions
        return planned if self.algorithm.repeats(self.episode) else planned * torch.nan

    @property
    def learns(self) -> bool:
        """Whether every slot of the next episode is followed by an update."""
        return len(self.replay) + 1 >= self.batch_size

    def compile(self) -> None:
        """Fly from the next episode on by compiled programs; see :class:`CompiledSlots`.

        Raises:
            Exception: one of :data:`hyuav._support.recording.COMPILATION_ERRORS`.
        """
        if self._compiled is None:
            self._compiled = CompiledSlots(
                self.env,
                self.algorithm,
                self.replay,
                self.batch_size,
                self.collector._carrier,
            )

    @property
    def is_compiled(self) -> bool:
        """Whether the next episode is flown by compiled programs."""
        return self._compiled is not None

    def fly(self) -> Flown:
        """Fly and learn for one episode.

        A learner whose losses, reward or weights are no longer finite stops: ``stopped`` (N,) is
        the slot, counted from the first of training, 0 for those that go on. Its numbers do not
        count any more.
        """
        self.episode += 1
        flown = self._fly_slots() if self._compiled is None else self._fly_compiled(self._compiled)
        self._keep_flight()
        self._stop_where_not_finite(flown)
        return flown

    def _keep_flight(self) -> None:
        """Keep the episode's flight where it is the best so far, or one that is better still.

        It counts what it earned; or where it is known, what is to be expected of it.
        """
        flights = self.algorithm.best_flights
        if flights is None:
            return
        storage = self.replay.storage._storage
        flown = storage[latest(self.replay, self.scenario.num_slots)]
        if self._search is not None:
            imagines = self.episode >= self.algorithm.parameters.warm_up_episodes
            self._search.go_on(flown, storage[: len(self.replay)], self.episode, imagines=imagines)
            return
        way = flown["next", "observation"][..., :2]
        flights.keep(flown["action"], way, flown["next", "reward"].sum(dim=(0, 2)))
        flights.try_best()

    def _stop_where_not_finite(self, flown: Flown) -> None:
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
            forget(self.replay, where)

    def _fly_compiled(self, compiled: CompiledSlots) -> Flown:
        slots, draws = self.scenario.num_slots, self.env.base_env.draws
        blocks = {name: stream.take(slots) for name, stream in self._streams.items()}
        if self.algorithm.parameters.repeat_every:
            blocks["plan"] = self._plan()
        if self.scenario.fading:
            blocks["fading"] = draws.take_fading(slots).contiguous()  # where rows are shared
        if self.env.base_env.system.edge_can_saturate:
            blocks["tasks"] = draws.take_tasks(slots).contiguous()
        carrier = self.collector._carrier
        flown = compiled.fly(carrier, blocks, self.updates)
        self.updates += slots
        carrier.update(self.env.reset())
        return flown

    def _fly_slots(self) -> Flown:
        reward = torch.zeros(len(self.learners), device=self.env.device)
        unbroken = torch.ones_like(self.stopped, dtype=torch.bool)
        finite = torch.zeros_like(self.stopped)
        losses: list[dict[str, Tensor]] = []
        for _ in range(self.scenario.num_slots):
            transition = next(self._transitions)[:, 0]
            reward += transition["next", "reward"].squeeze(-1)
            self.replay.extend(self.algorithm.parameters.memory.transition(transition).unsqueeze(0))
            losses.append(self._learn() if len(self.replay) >= self.batch_size else {})
            unbroken &= all_finite((reward, *losses[-1].values()))
            finite += unbroken
        return Flown(reward, _mean(losses), finite)

    def _learn(self) -> dict[str, Tensor]:
        """Lines 13 to 15 of Algorithm 1; the collector has gone through lines 3 to 11."""
        batch = self.replay.sample()
        self.updates += 1
        if "losses" in self._streams:
            normals = next(self._streams["losses"]).unbind(dim=1)
            with given_normals(iter(normals)):
                losses = self.algorithm.update_networks(batch, self.updates)
        else:
            losses = self.algorithm.update_networks(batch, self.updates)
        self.algorithm.update_targets(self.updates)
        return losses

    @torch.no_grad()
    def evaluate(self, episodes: int, seed: int, scheme: str | None = None) -> Earned:
        """Fly the current actors without noise, all of them through the same fading.

        Args:
            episodes: flown by each learner.
            seed: of the fading.
            scheme: that all learners fly; None for each learner's own.
        """
        expectation = self.algorithm.expectation
        env = make_env(
            self.scenario,
            self.env.base_env.schemes if scheme is None else scheme,
            (len(self.learners), episodes),
            self.env.device,
            [derived_seed(seed, "evaluation")] * len(self.learners),
            fading=expectation is not None,
            **self._options,
        )
        off_map, luck = torch.zeros(2, len(self.learners), device=env.device)
        state, way = env.reset(), []
        for _ in range(self.scenario.num_slots):
            slot = env.step(self.algorithm.actor(state))
            if expectation is not None:
                luck += expectation.variate.luck(slot).mean(dim=(1, 2))
            state = env.step_mdp(slot)
            off_map += state["off_map"].squeeze(-1).float().mean(dim=-1)
            way.append(state["observation"][:, 0, :2])
        reward: Tensor = state["episode_reward"].squeeze(-1).mean(dim=-1)
        sum_rate = reward + self.scenario.off_map_penalty * off_map
        fair = reward - luck / self.algorithm.parameters.reward_scale
        return Earned(fair, sum_rate, torch.stack(way))

    def keep_best(self, earned: Earned) -> None:
        """Where a learner never earned more than ``earned``, its weights are the best."""
        flights = self.algorithm.best_flights
        better = (earned.reward > self.best_evaluation) & (self.stopped == 0)
        self.best_evaluation = torch.where(better, earned.reward, self.best_evaluation)
        replace_learners(self.best_weights, copy_weights(self.algorithm.loss), better)
        if flights is not None:
            flights.own_way.copy_(earned.way)

    def state_dict(self) -> dict[str, Any]:
        """Everything that evolves; the tensors are the cohort's own."""
        clear_unused(self.replay)
        return {
            "modules": self.algorithm.modules.state_dict(),
            "optimizers": [step.optimizer.state_dict() for step in self.algorithm.steps],
            "replay": self.replay.state_dict(),
            "slot": self.collector._carrier.to_dict(),  # where the flight stands
            "environment": self.env.base_env.draws.state(),
            "random": {name: stream.state() for name, stream in self._all_streams.items()},
            "episode": self.episode,
            "updates": self.updates,
            "best_evaluation": self.best_evaluation,
            "best_weights": self.best_weights,
            "stopped": self.stopped,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue where :meth:`state_dict` was taken, in a cohort made with the same arguments.

        Args:
            state: that :func:`hyuav.learning.state.require_state` accepts.
        """
        self._compiled = None  # its programs hold the optimizers' former tensors
        self.algorithm.modules.load_state_dict(state["modules"])
        for step, optimizer in zip(self.algorithm.steps, state["optimizers"], strict=True):
            step.optimizer.load_state_dict(with_own_memory(optimizer))
        self.replay.load_state_dict(state["replay"])
        self.collector._carrier.update(state["slot"])
        self.env.base_env.draws.set_state(state["environment"])
        for name, stream in self._all_streams.items():
            stream.set_state(state["random"][name])
        self.episode, self.updates = state["episode"], state["updates"]
        self.best_evaluation = state["best_evaluation"].to(self.env.device)
        self.stopped = state["stopped"].to(self.env.device)
        self.best_weights = {
            name: values.to(self.env.device)
            for name, values in with_own_memory(state["best_weights"]).items()
        }


def _mean(losses: list[dict[str, Tensor]]) -> dict[str, Tensor]:
    """Mean over an episode's updates of each gradient step's losses."""
    names = {name for loss in losses for name in loss}
    return {
        name: torch.stack([loss[name] for loss in losses if name in loss]).mean(dim=0)
        for name in sorted(names)
    }
