"""A training that was kept, to be looked at and flown."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
from torchrl.envs import TransformedEnv

from hyuav._support.errors import InputError, rejection
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.learning.learners import Learner
from hyuav.learning.policy import Policy
from hyuav.learning.registry import ALGORITHMS
from hyuav.physics.scenario import Scenario


@dataclass(frozen=True)
class Run:
    """A training that was kept: what was asked for, what came of it, and how its learners fly.

    The files of a training that goes on are read where they are first needed; :func:`load` it
    again to see more.
    """

    directory: RunDirectory
    """Its files."""
    configuration: RunConfiguration
    """All that was asked of the training."""

    def __repr__(self) -> str:
        told = self.configuration
        learners = f"{len(told.learners)} learner{'s' * (len(told.learners) > 1)}"
        return (
            f"Run({self.directory.path}: {told.algorithm_name}, {told.scenario_name}, {learners})"
        )

    @property
    def scenario(self) -> Scenario:
        """What was flown; learners may have had another horizon."""
        return self.configuration.scenario

    @property
    def learners(self) -> tuple[Learner, ...]:
        """Scheme, seed and horizon of each."""
        return tuple(
            replace(learner, num_slots=learner.horizon(self.scenario))
            for learner in self.configuration.learners
        )

    @cached_property
    def metrics(self) -> pd.DataFrame:
        """A row for each episode and learner; see :data:`hyuav.experiments.metrics.METRIC_COLUMNS`.

        Raises:
            InputError: the file is missing or damaged.
        """
        return self.directory.metrics()

    @cached_property
    def policies(self) -> tuple[Policy, ...]:
        """How each learner flies with its best weights, in the order of :attr:`learners`.

        Raises:
            InputError: the weights cannot be read, or do not fit the configuration.
        """
        configuration, weights = self.directory.trained()
        indices = range(len(configuration.learners))
        return tuple(configuration.policy(weights, [index]) for index in indices)

    @property
    def policy(self) -> Policy:
        """That of the learner with the highest noise-free return; see :meth:`best_policy`."""
        return self.best_policy()

    def best_policy(
        self, scheme: str | None = None, seed: int | None = None, num_slots: int | None = None
    ) -> Policy:
        """That of the learner which earned most without noise, among those that are asked for.

        Learners of a longer horizon, and those that may relay and jam, earn more in any case.

        Args:
            scheme: of the learner; None for any.
            seed: of the learner.
            num_slots: its horizon.

        Raises:
            InputError: there is no such learner, or the weights or the metrics cannot be read.
        """
        asked = {"scheme": scheme, "seed": seed, "num_slots": num_slots}
        indices = list(range(len(self.learners)))
        for name, value in asked.items():
            own = {index: getattr(self.learners[index], name) for index in indices}
            indices = [index for index in indices if value in (None, own[index])]
            if not indices:
                accepted = ", ".join(map(str, dict.fromkeys(own.values())))
                raise InputError(rejection(name, value, f"that of a learner: {accepted}"))
        if len(indices) > 1:
            earned = self.metrics.groupby("learner")["best_evaluation"].max().reindex(indices)
            indices.sort(key=earned.fillna(float("-inf")).__getitem__, reverse=True)
        return self.policies[indices[0]]

    def make_env(self, **options: Any) -> TransformedEnv:
        """An environment as :attr:`policy` was trained in; see :meth:`hyuav.Policy.make_env`."""
        return self.policy.make_env(**options)


def load(path: str | Path, algorithm: str | None = None) -> Run:
    """A run that was kept: its configuration, its metrics and its learners' policies.

    Args:
        path: of the run's directory.
        algorithm: ``FILE.py:CLASS`` of a run whose algorithm is the user's own; the file is run.

    Raises:
        InputError: there is no run here, its ``config.yaml`` is not one, or there is no such
            algorithm.

    Example:
        >>> run = load("runs/NAME")
        >>> flights = run.make_env(batch_size=64, seed=0).rollout(20, run.policy)
        >>> run.policy.export("policy.onnx")
    """
    if algorithm is not None:
        ALGORITHMS.run_own(algorithm)
    directory = RunDirectory(path)
    return Run(directory, directory.configuration())
