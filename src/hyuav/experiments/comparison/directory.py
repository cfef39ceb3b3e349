"""A comparison's directory: what was asked for, what is done, and what came of it."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from hyuav._support.errors import InputError, rejection
from hyuav.envs.rewards import REWARDS, SUM_RATE
from hyuav.experiments.comparison.optima import Optima
from hyuav.experiments.comparison.plan import PLAIN, Compare, parameters_of, training_episodes
from hyuav.experiments.comparison.shards import Shard
from hyuav.experiments.comparison.summary import Summary
from hyuav.experiments.configuration import Config
from hyuav.experiments.evaluation import EvaluationParameters
from hyuav.experiments.requests import keep_request
from hyuav.experiments.run_directory import RunConfiguration
from hyuav.experiments.tracking import LoggerParameters
from hyuav.learning.registry import ALGORITHMS, BESIDE
from hyuav.learning.training import TrainingParameters
from hyuav.references.objectives import why_no_optimum
from hyuav.references.optimum import usable_resolution

WORKING = ("workers", "engine", "address", "retries", "output", "logger", "training.cohorts")
"""Entries of the configuration that change how the work is done and not what comes of it."""


class ComparisonDirectory:
    """The files of one comparison.

    ``config.yaml``; ``optima/``, the best flights of each scenario; ``shards/``, the trainings;
    ``results.parquet``, ``curves.parquet``, ``cells.parquet`` and ``summary.json``, what came of
    them; and ``figures/``.

    Args:
        path: of the directory, which may hold part of the same comparison.
        config: all that was asked for.
        options: what is compared.

    Raises:
        InputError: an unacceptable parameter, another comparison in the directory, or a place
            that cannot be written to.
        OSError: what was asked for cannot be kept, for want of space perhaps.
    """

    def __init__(self, path: Path, config: Config, options: Compare) -> None:
        self.path, self.options = path, options
        self._training = TrainingParameters.from_dict(config["training"])
        self._evaluation = EvaluationParameters.from_dict(config["evaluation"])
        self._logger = LoggerParameters.from_dict(config["logger"])
        training_episodes(self._training)
        scenarios = options.scenarios()
        reward, longest = REWARDS.find(options.reward), max(options.num_slots)
        for scenario in scenarios.values():
            if (reason := why_no_optimum(reward, scenario)) is not None:
                accepted = f"one with an optimum to compare with ({reason})"
                raise InputError(rejection("reward", reward.name, accepted))
            usable_resolution(self._evaluation.resolution, scenario, longest, reward)
        if options.workers > 1 or options.engine == "ray":
            self._training = dataclasses.replace(self._training, cohorts=1)
        self._begin(config)
        self.optima = {
            name: Optima(
                scenario,
                options.num_slots,
                self._evaluation.resolution,
                path / "optima" / f"{name}.parquet",
                reward,
            )
            for name, scenario in scenarios.items()
        }
        self.shards = [
            self._shard(entry, name, num_slots, part)
            for entry in options.entries
            for name in self.optima
            for num_slots in options.num_slots
            for part in options.parts()
        ]

    def _begin(self, config: Config) -> None:
        """Keep what was asked for, or find the same kept."""
        hyperparameters = {name: parameters_of(name).to_dict() for name in self.options.entries}
        request = {**config, "hyperparameters": hyperparameters}
        keep_request(self.path, request, WORKING, "a comparison", self._unsaid)

    @property
    def _unsaid(self) -> dict[str, Any]:
        """Entries that older comparisons may not name; what they did not know was off."""
        plain = {
            f"hyperparameters.{entry}": ALGORITHMS[PLAIN.get(name, name)]().to_dict()
            for entry in self.options.entries
            if (name := entry.partition("-")[0]) not in BESIDE
        }
        return {"shard_learners": Compare.shard_learners, "reward": SUM_RATE, **plain}

    def _shard(self, entry: str, name: str, num_slots: int, part: range) -> Shard:
        learners = self.options.members
        configuration = RunConfiguration(
            name,
            dataclasses.replace(self.optima[name].scenario, num_slots=num_slots),
            learners[part.start : part.stop],
            entry.partition("-")[0],
            parameters_of(entry),
            self._training,
            self.optima[name].reward,
        )
        return Shard(
            entry,
            configuration,
            self._evaluation,
            self.options.threshold,
            self._logger,
            self.optima[name],
            self.path / "shards",
            "" if len(part) == len(learners) else f"_{part.start}-{part.stop - 1}",
        )

    def summary(self) -> Summary | None:
        """Of the shards that are finished; None where none is."""
        finished = [kept for shard in self.shards if (kept := shard.kept()) is not None]
        if not finished:
            return None
        results, curves = map(_joined, zip(*finished, strict=True))
        return Summary.of(results, curves, self.options.threshold)


def _joined(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """The rows of all tables; one without rows tells nothing of its columns' types."""
    return pd.concat([own for own in tables if len(own)] or tables, ignore_index=True)
