"""The training of many learners: Algorithm 1 for any algorithm, its progress and its state."""

import dataclasses
import math
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from typing import Annotated, Any

import torch
from pydantic.dataclasses import dataclass as pydantic_dataclass
from torch import Tensor

from hyuav._support.errors import InputError, InputTypeError, one_line, rejection
from hyuav._support.machine import cores
from hyuav._support.parameters import (
    Count,
    CountOrZero,
    NonNegativeNumber,
    OneOf,
    Parameters,
    Threads,
    checked,
    parameter,
    require_record,
)
from hyuav._support.recording import COMPILATION_ERRORS, has_compiler
from hyuav.envs.arguments import as_device
from hyuav.envs.reward import Reward, Source
from hyuav.envs.rewards import SUM_RATE, as_reward
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.checkpoint import require_entries, require_like
from hyuav.learning.compile import FlownEpisode
from hyuav.learning.learners import Learner, as_learners
from hyuav.learning.memory import require_memory
from hyuav.learning.policy import NoiseFreeReturn, Policy, learned_policy
from hyuav.learning.train import Cohort
from hyuav.learning.weights import count_learners, join_learners, load_weights, select_learners
from hyuav.physics.generators import LayoutGenerator, over_horizon
from hyuav.physics.scenario import ScenarioLike, as_scenario

COMPILE_SECONDS = 20.0
"""What compiling one program takes."""

LARGEST_COHORT = 5
"""Learners whose weights, moments and targets still fit a core's cache together."""

SECONDS_SAVED = (0.003, 0.0007)
"""Saved per slot, and besides that per learner and slot."""


@pydantic_dataclass(frozen=True)
class TrainingParameters(Parameters):
    """How long and on what to learn; the defaults are the paper's where it gives one."""

    num_episodes: Count = parameter(1000)
    replay_size: Count = parameter(8000)
    batch_size: Count = parameter(70, symbol="K")
    evaluation_every: Count = parameter(10, unit="episode")
    evaluation_episodes: Count = parameter(100)
    evaluation_seed: CountOrZero = parameter(20_000)
    compile: Annotated[str, OneOf("auto", "always", "never")] = parameter("auto")
    cohorts: Threads = parameter(cores())
    """Groups of learners that are trained at the same time, each on a thread of its own; by default
    one for each core."""
    checkpoint_every: NonNegativeNumber = parameter(20.0, unit="s")
    """What is lost at most when a training is killed; 0 for a checkpoint after every episode."""

    def __post_init__(self) -> None:
        if self.batch_size > self.replay_size:
            accepted = f"at most replay_size = {self.replay_size}"
            raise InputError(rejection("batch_size", self.batch_size, accepted))

    @property
    def sizes(self) -> dict[str, int]:
        """What decides how much memory a learner takes."""
        names = ("replay_size", "batch_size", "evaluation_episodes")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True)
class Episode:
    """What one episode of training brought to each of the N learners."""

    number: int
    """Of the episode, from 1."""
    slots: tuple[int, ...]
    """Flown by each learner since training began."""
    accumulated_reward: Tensor
    """(N,) bps/Hz, with exploration and penalties, undiscounted."""
    losses: dict[str, Tensor]
    """(N,) mean loss of the episode's updates, by gradient step; NaN where there was none."""
    evaluation: NoiseFreeReturn | None
    """Without noise, in the episodes that end with an evaluation."""
    learning: tuple[bool, ...]
    """Whether each learner's numbers count: those of one that has stopped do not."""


class Training:
    """N independent learners in one process, each with its own weights, replay and noise.

    The learners may differ in seed, scheme and horizon. All that evolves is in
    :meth:`state_dict`. The random numbers are each learner's own, so that it learns the same
    whatever the process does besides, up to the rounding of differently arranged sums.

    Args:
        scenario: node positions and parameters, or the name of a preset; or what draws layouts
            anew in each episode, such as a :class:`hyuav.LayoutFamily`, for algorithms that need
            not know them beforehand.
        learners: one or more; or their seeds, or how many, with seeds from 0 on.
        algorithm: which one, with its hyperparameters.
        parameters: how long and on what to learn.
        device: of all tensors.
        reward: what a slot earns, as for :func:`hyuav.make_env`.

    Raises:
        InputError: an unknown device, an algorithm that knows one layout where layouts are drawn, a
            reward that is none or does not suit the algorithm;
            later, where it must be compiled, no working compiler.
        InputTypeError: an argument of the wrong type.
    """

    def __init__(
        self,
        scenario: ScenarioLike | LayoutGenerator,
        learners: int | Learner | Sequence[int | Learner],
        algorithm: AlgorithmParameters,
        parameters: TrainingParameters,
        device: torch.device | str | None = None,
        reward: Reward | Source | str = SUM_RATE,
    ) -> None:
        if not isinstance(algorithm, AlgorithmParameters):
            raise InputTypeError(rejection("algorithm", algorithm, "DDPG(), TD3() or SAC()"))
        require_record("parameters", parameters, TrainingParameters)
        if isinstance(scenario, LayoutGenerator):
            if algorithm.knows_layout:
                accepted = "one without afterstate and guide, which know one layout, such as DDPG()"
                raise InputError(rejection("algorithm", type(algorithm).__name__, accepted))
            self.scenario = scenario.scenario
        else:
            self.scenario = scenario = as_scenario(scenario)
        self.parameters = parameters
        self._algorithm = algorithm
        self.learners, self.reward = as_learners(learners), as_reward(reward)
        device = as_device(device)
        on_cpu = device.type == "cpu"
        size = LARGEST_COHORT if on_cpu else math.inf
        longest = max(self.horizons)
        if parameters.replay_size < algorithm.least_replay(longest):
            accepted = f"at least the {longest} slots of a flight, to keep the best"
            raise InputError(rejection("replay_size", parameters.replay_size, accepted))
        needs = algorithm.needed_memory(self.scenario, self.horizons, parameters.sizes)
        require_memory(needs, len(self.learners), device)
        self._members = _partition(self.horizons, parameters.cohorts if on_cpu else 1, size)
        order = [index for members in self._members for index in members]
        self._order = sorted(range(len(order)), key=order.__getitem__)
        self.cohorts = [
            Cohort(
                over_horizon(scenario, self.horizons[members[0]]),
                [self.learners[index] for index in members],
                algorithm,
                parameters.replay_size,
                parameters.batch_size,
                device,
                self.reward,
            )
            for members in self._members
        ]
        self._can_compile, self._compiles = True, False

    @property
    def horizons(self) -> tuple[int, ...]:
        """T of each learner."""
        return tuple(learner.horizon(self.scenario) for learner in self.learners)

    @property
    def episode(self) -> int:
        """How many episodes have been flown."""
        return self.cohorts[0].episode

    @property
    def stopped(self) -> tuple[int, ...]:
        """In which slot each learner stopped, for want of finite numbers; 0 for none.

        Slots are counted since training began.
        """
        return tuple(self._in_order([cohort.stopped for cohort in self.cohorts]).tolist())

    @property
    def is_finished(self) -> bool:
        """Whether no episode follows."""
        return self.episode >= self.parameters.num_episodes or all(self.stopped)

    @property
    def steps(self) -> tuple[str, ...]:
        """Names of the algorithm's gradient steps."""
        return tuple(step.name for step in self.cohorts[0].algorithm.steps)

    @property
    def best_evaluation(self) -> Tensor:
        """(N,) bps/Hz, the best noise-free accumulated reward so far."""
        return self._in_order([cohort.best_evaluation for cohort in self.cohorts])

    @property
    def best_weights(self) -> dict[str, Tensor]:
        """The weights that reached it, of all learners."""
        weights = join_learners([cohort.best_weights for cohort in self.cohorts])
        return select_learners(weights, self._order)

    @property
    def policies(self) -> tuple[Policy, ...]:
        """How each learner flies with these weights."""
        weights = self.best_weights
        own = [dataclasses.replace(self.scenario, num_slots=horizon) for horizon in self.horizons]
        return tuple(
            learned_policy(
                own[index], self._algorithm, weights, [index], learner.scheme, self.reward
            )
            for index, learner in enumerate(self.learners)
        )

    def _in_order(self, values: Sequence[Tensor]) -> Tensor:
        """Values (n,) of each cohort as those of all learners (N,)."""
        return torch.cat(list(values)).cpu()[self._order]

    def episodes(self) -> Iterator[Episode]:
        """Train until ``num_episodes`` are flown; report each episode as it ends.

        A learner whose losses or weights are no longer finite stops, the others go on.
        """
        self._compiles = self._can_compile and self._compiling_pays()
        threads = min(len(self.cohorts), self.parameters.cohorts)
        with ThreadPoolExecutor(threads) as pool:
            while not self.is_finished:
                yield self._train_episode(pool)

    def _train_episode(self, pool: ThreadPoolExecutor) -> Episode:
        if self._compiles and all(cohort.learns for cohort in self.cohorts):
            self._compile()
        on_cpu = self.cohorts[0].env.device.type == "cpu"
        if on_cpu and len(self.cohorts) > 1 and all(c.is_compiled for c in self.cohorts):
            with _one_thread_each():
                flown = list(pool.map(Cohort.fly, self.cohorts))
        else:
            flown = [cohort.fly() for cohort in self.cohorts]
        rewards = [own.reward for own in flown]
        return Episode(
            number=self.episode,
            slots=tuple(self.episode * horizon for horizon in self.horizons),
            accumulated_reward=self._in_order(rewards),
            losses={name: self._in_order(_mean_loss(flown, name)) for name in self.steps},
            evaluation=self._end_evaluation(),
            learning=tuple(not slot for slot in self.stopped),
        )

    def _compiling_pays(self) -> bool:
        """Whether to compile; a training that is continued decides as it did when it began."""
        if self.parameters.compile != "auto":
            return self.parameters.compile == "always"
        if not has_compiler(self.cohorts[0].env.device):
            return False
        episodes = self.parameters.num_episodes
        per_slot, per_learner = SECONDS_SAVED
        saved = sum(
            episodes * cohort.scenario.num_slots * (per_slot + per_learner * len(cohort.learners))
            for cohort in self.cohorts
        )
        kinds = {(len(cohort.learners), cohort.scenario.num_slots) for cohort in self.cohorts}
        return saved > COMPILE_SECONDS * len(kinds) * len(self.cohorts[0].algorithm.all_due)

    def _compile(self) -> None:
        try:
            with _one_thread_each() if len(self.cohorts) > 1 else nullcontext():
                for cohort in self.cohorts:
                    cohort.compile()
        except COMPILATION_ERRORS as error:
            reason = " ".join(str(error).split())[:200]
            if self.parameters.compile == "always":
                accepted = f"a working C++ compiler ({reason})"
                raise InputError(rejection("compile", "always", accepted)) from None
            warnings.warn(f"training goes on without compiling ({reason})", stacklevel=2)
            self._can_compile = self._compiles = False

    def _end_evaluation(self) -> NoiseFreeReturn | None:
        """Evaluate where that is due: every so often, and after the last episode.

        If it is due for being the last alone, learning takes no note of it, so that a training that
        goes on longer learns as if it had been meant to.
        """
        regular = self.episode % self.parameters.evaluation_every == 0
        last = self.episode == self.parameters.num_episodes
        return self._keep_best(noted=regular) if regular or last else None

    def evaluate(self, scheme: str | None = None) -> NoiseFreeReturn:
        """Fly the current actors without noise, all through the same fading every time.

        Args:
            scheme: that all learners fly; None for each learner's own.
        """
        evaluated = self.parameters.evaluation_episodes, self.parameters.evaluation_seed
        return self._together([cohort.evaluate(*evaluated, scheme)[0] for cohort in self.cohorts])

    def _keep_best(self, *, noted: bool = True) -> NoiseFreeReturn:
        """Evaluate; where a learner has never been better, its weights are the best so far."""
        evaluated = self.parameters.evaluation_episodes, self.parameters.evaluation_seed
        earned = [cohort.keep_best(*evaluated, noted=noted) for cohort in self.cohorts]
        return self._together(earned)

    def _together(self, earned: Sequence[NoiseFreeReturn]) -> NoiseFreeReturn:
        rewards, sum_rates = zip(*earned, strict=True)
        return NoiseFreeReturn(self._in_order(rewards), self._in_order(sum_rates))

    def load_weights(self, weights: dict[str, Tensor]) -> None:
        """Put weights into all learners' networks and targets.

        Args:
            weights: of N learners, or of one, which serve all.

        Raises:
            InputError: the weights are of another algorithm, of other sizes or of another number
                of learners.
        """
        several = count_learners(weights)
        if several not in (1, len(self.learners)):
            accepted = f"expected {len(self.learners)} learners, or one"
            raise InputError(f"checkpoint: it holds {several} learners: {accepted}")
        for cohort, members in zip(self.cohorts, self._members, strict=True):
            own = weights if several == 1 else select_learners(weights, members)
            load_weights(cohort.algorithm.loss, own)

    def warm_start(self, weights: dict[str, Tensor]) -> None:
        """Begin with the networks of an earlier training, the best so far until beaten.

        Args:
            weights: as for :meth:`load_weights`.

        Raises:
            InputError: as :meth:`load_weights`.
        """
        self.load_weights(weights)
        self._keep_best()

    def state_dict(self) -> dict[str, Any]:
        """Everything that evolves: continuing from it gives the numbers of an unbroken run.

        The tensors are the training's own; save them before it goes on.
        """
        return {
            "cohorts": [cohort.state_dict() for cohort in self.cohorts],
            "can_compile": self._can_compile,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue where :meth:`state_dict` was taken, in a training made with the same arguments.

        ``num_episodes`` may be another: a finished training goes on for longer.

        Raises:
            InputError: the state is of another algorithm, learner axis or scenario, or damaged; the
                line names the entry. The training may then have taken some of it.
        """
        try:
            require_entries("training", state, ("cohorts", "can_compile"))
            can_compile = checked(bool, "can_compile", state["can_compile"])
            cohorts = list(zip(self.cohorts, state["cohorts"], strict=True))
            for index, (cohort, own) in enumerate(cohorts):
                cohort.require_state(f"cohorts[{index}]", own)
                require_like(f"cohorts[{index}].episode", own["episode"], cohorts[0][1]["episode"])
            for cohort, own in cohorts:
                cohort.load_state_dict(own)
            self._can_compile = can_compile
        except (
            *(LookupError, RuntimeError, ValueError, TypeError, AttributeError),
            *(ArithmeticError, AssertionError),
        ) as error:
            reason = one_line(str(error))[:200]
            raise InputError(f"checkpoint: not of a training like this one ({reason})") from None


def _partition(horizons: Sequence[int], threads: int, largest: float) -> list[list[int]]:
    """Group learners of equal horizon, and divide each group into near-equal parts.

    There are as many parts as threads, or several times as many where they would be too large.
    """
    parts = []
    for horizon in dict.fromkeys(horizons):
        members = [index for index, own in enumerate(horizons) if own == horizon]
        rounds = max(math.ceil(len(members) / (threads * largest)), 1)
        size = math.ceil(len(members) / (threads * rounds))
        parts += [members[start : start + size] for start in range(0, len(members), size)]
    return parts


def _mean_loss(flown: Sequence[FlownEpisode], name: str) -> list[Tensor]:
    """One gradient step's mean loss in each cohort, NaN in those that did not take it."""
    return [own.losses.get(name, torch.full_like(own.reward, torch.nan)) for own in flown]


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """While cohorts share the cores, none of them takes more than one."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
