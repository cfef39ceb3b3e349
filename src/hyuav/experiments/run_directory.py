"""The run directory: configuration, metrics, checkpoints, evaluation and figures of a training."""

import dataclasses
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
from filelock import FileLock, Timeout
from omegaconf import OmegaConf
from pydantic import Field
from torch import Tensor

from hyuav._support.errors import BusyError, InputError, rejection
from hyuav._support.files import create_durably, require_writable, write_durably
from hyuav._support.parameters import checked, mapping
from hyuav._support.yaml_files import read_yaml
from hyuav.envs.reward import Reward
from hyuav.envs.rewards import DEFAULT, REWARDS, SUM_RATE
from hyuav.experiments.metrics import read_metrics
from hyuav.experiments.scenarios import named_scenario
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.checkpoint import load_weights_file, save_checkpoint
from hyuav.learning.learners import Learner
from hyuav.learning.policy import Policy, learned_policy
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.training import Training, TrainingParameters
from hyuav.learning.weights import count_learners
from hyuav.physics.scenario import Scenario

REPORT_FILE = "report.html"

LOCK_FILE = ".lock"
"""There while a process trains."""


@dataclass(frozen=True)
class RunConfiguration:
    """What a training was asked to do: enough to build it again."""

    scenario_name: str
    scenario: Scenario
    learners: tuple[Learner, ...]
    algorithm_name: str
    algorithm: AlgorithmParameters
    training: TrainingParameters
    reward: Reward = DEFAULT
    """What a slot earns, one that its name finds again."""

    def __post_init__(self) -> None:
        if REWARDS.get(self.reward.name) != self.reward:
            accepted = "one of the package, of a package's entry point or of a file that is named"
            raise InputError(rejection("reward", self.reward.name, accepted))

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "RunConfiguration":
        """Read what :meth:`to_dict` gives.

        Raises:
            InputError: a missing or unacceptable entry.
        """
        for name in ("scenario", "learners", "algorithm", "training"):
            if name not in values:
                raise InputError(f"configuration: {name} is missing")
        scenario_name, scenario = named_scenario(values["scenario"])
        algorithm_name, algorithm = named_algorithm(values["algorithm"])
        return cls(
            scenario_name,
            scenario,
            _learners(values["learners"], scenario),
            algorithm_name,
            algorithm,
            TrainingParameters.from_dict(mapping("training", values["training"])),
            REWARDS.find(values.get("reward", SUM_RATE)),  # which older runs do not name
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as they stand in ``config.yaml``."""
        return {
            "scenario": {"name": self.scenario_name, **self.scenario.to_dict()},
            "learners": [learner.to_dict() for learner in self.learners],
            "algorithm": {"name": self.algorithm_name, **self.algorithm.to_dict()},
            "training": self.training.to_dict(),
            "reward": self.reward.name,
        }

    @property
    def trained_scenario(self) -> Scenario:
        """The scenario, over its learners' longest horizon where none of them has its own."""
        if self.scenario.num_slots in self.horizons:
            return self.scenario
        return dataclasses.replace(self.scenario, num_slots=max(self.horizons))

    def with_episodes(self, num_episodes: int) -> "RunConfiguration":
        """The same for another number of episodes.

        Raises:
            InputError: an unacceptable number.
        """
        training = dataclasses.replace(self.training, num_episodes=num_episodes)
        return dataclasses.replace(self, training=training)

    def new_training(self, device: str | None = None) -> Training:
        """The training that is configured, of which nothing is done yet.

        Raises:
            InputError: as :class:`hyuav.learning.training.Training`.
        """
        parameters = self.algorithm, self.training
        return Training(self.scenario, self.learners, *parameters, device, self.reward)

    @property
    def horizons(self) -> tuple[int, ...]:
        """Of the learners, in slots."""
        return tuple(learner.horizon(self.scenario) for learner in self.learners)

    def policy(self, weights: dict[str, Tensor], learners: Sequence[int]) -> Policy:
        """The noise-free actors of learners that share a scheme and a horizon.

        Args:
            weights: of all learners.
            learners: which of them.

        Raises:
            InputError: the weights do not fit.
        """
        scenario = dataclasses.replace(self.scenario, num_slots=self.horizons[learners[0]])
        scheme = self.learners[learners[0]].scheme
        return learned_policy(scenario, self.algorithm, weights, learners, scheme, self.reward)


Learners = Annotated[tuple[Learner, ...], Field(min_length=1, description="a list of learners")]


def _learners(values: object, scenario: Scenario) -> tuple[Learner, ...]:
    """Learners that differ, where those without a horizon of their own have the scenario's."""
    learners: tuple[Learner, ...] = checked(Learners, "learners", values)
    resolved = [
        dataclasses.replace(learner, num_slots=learner.horizon(scenario)) for learner in learners
    ]
    twice = [learner for learner, times in Counter(resolved).items() if times > 1]
    if twice:
        accepted = "learners that differ in scheme, seed or num_slots"
        raise InputError(rejection("learners", twice[0].to_dict(), accepted))
    return learners


def named_algorithm(values: object) -> tuple[str, AlgorithmParameters]:
    """An algorithm and its name, from its hyperparameters with a ``name``."""
    fields = mapping("algorithm", values)
    name = fields.pop("name", None)
    return str(name), ALGORITHMS.find(name).from_dict(fields)


class RunDirectory:
    """The files of one training.

    ``config.yaml``, ``metrics.csv`` (a row per episode and learner), ``checkpoints/last.pt`` (all
    that evolves), ``checkpoints/previous.pt`` (the same a little earlier),
    ``checkpoints/best.pt`` (the best weights so far), ``evaluation.json``, ``flights.parquet``
    and ``figures/``.

    Args:
        path: of the directory.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.config_file = self.path / "config.yaml"
        self.metrics_file = self.path / "metrics.csv"
        self.last_checkpoint = self.path / "checkpoints" / "last.pt"
        self.previous_checkpoint = self.path / "checkpoints" / "previous.pt"
        self.best_checkpoint = self.path / "checkpoints" / "best.pt"
        self.figures = self.path / "figures"

    @classmethod
    def create(
        cls,
        path: str | Path,
        configuration: RunConfiguration,
        request: Mapping[str, Any] | None = None,
        first_checkpoint: dict[str, Any] | None = None,
    ) -> "RunDirectory":
        """Begin a run directory; it is one as soon as there is a ``config.yaml``.

        Args:
            path: of the directory.
            configuration: of the training.
            request: all that was asked for beside it, kept in ``config.yaml`` too.
            first_checkpoint: that a training can begin with.

        Raises:
            InputError: another training's files are there, or the place cannot be written to.
        """
        run = cls(path)
        require_writable("run directory", run.figures)
        content = OmegaConf.to_yaml({**(request or {}), **configuration.to_dict()})
        try:
            if first_checkpoint is not None and not run.exists:
                save_checkpoint(run.last_checkpoint, "training", first_checkpoint)
            create_durably(run.config_file, content.encode())
        except FileExistsError:
            accepted = "one without a run in it (train resume=DIRECTORY goes on with one)"
            raise InputError(rejection("run directory", str(path), accepted)) from None
        except OSError as error:
            accepted = f"a writable place ({error.strerror})"
            raise InputError(rejection("run directory", str(path), accepted)) from None
        return run

    @property
    def exists(self) -> bool:
        """Whether a training has begun here."""
        return self.config_file.exists()

    @contextmanager
    def reserved(self) -> Iterator[None]:
        """Let no other process train here meanwhile; a process that is killed reserves nothing.

        Where the file system cannot lock a file, nobody is kept away.

        Raises:
            BusyError: another process trains here.
            InputError: it cannot be written to.
        """
        require_writable("run directory", self.path)
        file = self.path / LOCK_FILE
        lock = FileLock(file, timeout=0, fallback_to_soft=False)
        try:
            lock.acquire()
        except Timeout:
            accepted = "one in which no other process trains"
            raise BusyError(rejection("run directory", str(self.path), accepted)) from None
        except OSError:
            pass
        try:
            yield
        finally:
            if lock.is_locked:
                with suppress(OSError):  # Windows removes it with the lock
                    file.unlink()
                lock.release()

    def configuration(self) -> RunConfiguration:
        """What the training was asked to do.

        Raises:
            InputError: there is no run here, or its ``config.yaml`` is not one.
        """
        return RunConfiguration.from_dict(self.request())

    def request(self) -> dict[str, Any]:
        """All that was asked for, in plain values.

        Raises:
            InputError: there is no run here.
        """
        try:
            return read_yaml(self.config_file)
        except InputError as error:
            accepted = f"a run directory with a config.yaml ({error})"
            raise InputError(rejection("run", str(self.path), accepted)) from None

    def change(self, configuration: RunConfiguration) -> None:
        """Replace the configuration in ``config.yaml``; all else that was asked for stays.

        Raises:
            OSError: it cannot be written; then the former one is still there.
        """
        content = OmegaConf.to_yaml({**self.request(), **configuration.to_dict()})
        write_durably(self.config_file, content.encode())

    def best_weights(self) -> dict[str, Tensor]:
        """The best weights so far of all learners.

        Raises:
            InputError: there is no such checkpoint, or it is truncated or foreign.
        """
        return load_weights_file(self.best_checkpoint)

    def trained(self) -> tuple[RunConfiguration, dict[str, Tensor]]:
        """What the training was asked to do, and the best weights so far of its learners.

        Raises:
            InputError: one of them cannot be read, or they are of different numbers of learners.
        """
        configuration, weights = self.configuration(), self.best_weights()
        if count_learners(weights) != len(configuration.learners):
            accepted = f"weights of {len(configuration.learners)} learners"
            raise InputError(rejection("checkpoint", str(self.best_checkpoint), accepted))
        return configuration, weights

    def metrics(self) -> pd.DataFrame:
        """What training brought, as :func:`hyuav.experiments.metrics.read_metrics` reads it."""
        return read_metrics(self.metrics_file)
