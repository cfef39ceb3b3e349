"""A comparison's pieces of work, each kept in a directory of its own once it is done."""

import dataclasses
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console

from hyuav._support.durable import rename_durably, write_durably
from hyuav._support.errors import BusyError, Halted, InputError, rejection
from hyuav._support.files import read_parquet
from hyuav.experiments.comparison.optima import Optima
from hyuav.experiments.comparison.plan import training_episodes
from hyuav.experiments.evaluation import OPTIMA, EvaluationParameters, fly
from hyuav.experiments.experiment import LEARNED, learned_policies, resume, train
from hyuav.experiments.run_directory import METRIC_NUMBERS, RunConfiguration, RunDirectory
from hyuav.experiments.tracking import LoggerParameters, in_group
from hyuav.learning.registry import PEER, file_name

TABLES = RESULTS_FILE, CURVES_FILE = "results.parquet", "curves.parquet"

_IDENTITY = {"algorithm", "scenario", "scheme", "num_slots", "seed"}
_RESULTS = _IDENTITY | {
    *("sum_rate", "optimum", "fraction", "seconds"),
    *("episodes_to_threshold", "seconds_to_threshold"),
}
_CURVES = _IDENTITY | {"episode", "slots", "seconds", "best_sum_rate", "fraction"}


@dataclass(frozen=True)
class Shard:
    """Learners of one algorithm, scenario and horizon, which one worker trains side by side.

    Its directory is a run directory with two tables more, :func:`tables`; that of
    Stable-Baselines3 holds the tables alone. It is there once all of it is written.
    """

    entry: str
    """What is compared, as in :func:`hyuav.experiments.comparison.plan.parameters_of`."""
    configuration: RunConfiguration
    evaluation: EvaluationParameters
    threshold: float
    """Share of the optimum that counts as solved."""
    logger: LoggerParameters
    optima: Optima
    parent: Path
    """Of the shard's directory."""
    part: str = ""
    """Behind its name, where the learners of the same are in several shards."""

    @property
    def name(self) -> str:
        """Entry, scenario, horizon and part."""
        scenario, horizon = self.configuration.scenario_name, self.configuration.scenario.num_slots
        return f"{file_name(self.entry)}_{scenario}_T{horizon}{self.part}"

    @property
    def path(self) -> Path:
        """Of the directory."""
        return self.parent / self.name

    @property
    def is_finished(self) -> bool:
        """Whether nothing is left to do."""
        return self.kept() is not None

    def kept(self) -> tuple[pd.DataFrame, pd.DataFrame] | None:
        """Both tables, as :func:`tables` gave them; None where one is missing or damaged."""
        try:
            results, curves = (read_parquet(self.path / name, "a table") for name in TABLES)
        except InputError:
            return None
        learners = len(self.configuration.learners)
        whole = len(results) == learners and set(results) >= _RESULTS and set(curves) >= _CURVES
        return (results, curves) if whole else None

    def run(self) -> None:
        """Train, evaluate and keep everything; a broken attempt goes on from its checkpoint.

        Where all was kept and the tables are damaged, only they are made anew if the best weights
        and the metrics are whole.

        Raises:
            InputError: a scheme's optimum earns nothing, or another process trains there.
            OSError: something cannot be written, for want of space perhaps.
        """
        for scheme in dict.fromkeys(own.scheme for own in self.configuration.learners):
            _optimum(self, scheme, self.evaluation)
        if _has_ended(self, RunDirectory(self.path)):
            self._keep(self.path, *_reached(self, RunDirectory(self.path)))
            return
        partial = self.path.with_name(f"{self.name}.partial")
        if self.path.exists():  # and is damaged, but may hold a checkpoint
            _clear(partial)
            self.path.rename(partial)
        if self.entry == PEER:
            from hyuav.experiments.comparison import (
                stable_baselines,  # needs a library that is optional
            )

            _clear(partial)
            partial.mkdir(parents=True)
            metrics, sum_rates = stable_baselines.train(self.configuration, self.evaluation)
        else:
            _train(self, partial)
            metrics, sum_rates = _reached(self, RunDirectory(partial))
        self._keep(partial, metrics, sum_rates)
        rename_durably(partial, self.path)
        finished = RunDirectory(self.path)
        for checkpoint in (finished.previous_checkpoint, finished.last_checkpoint):
            checkpoint.unlink(missing_ok=True)  # nothing goes on from them any more

    def _keep(self, directory: Path, metrics: pd.DataFrame, sum_rates: list[float]) -> None:
        for name, table in zip(TABLES, tables(self, metrics, sum_rates), strict=True):
            write_durably(directory / name, table.to_parquet())


def _clear(directory: Path) -> None:
    if directory.exists():
        shutil.rmtree(directory)


def _train(shard: Shard, directory: Path) -> None:
    """To the end of all learners, be it that all have stopped; their best weights are kept."""
    try:
        if not _go_on(shard, directory):
            _clear(directory)
            train(directory, shard.configuration, *_reporting(shard), logs=_logs(shard))
    except Halted as halted:
        if halted.resumable:
            raise


def _go_on(shard: Shard, directory: Path) -> bool:
    """Bring the training that a broken attempt left to its end; False where it is of no use."""
    run = RunDirectory(directory)
    try:
        if _comparable(run.configuration()) != _comparable(shard.configuration):
            return False
        resume(directory, *_reporting(shard), logs=_logs(shard))
    except BusyError:  # whose files must not be taken away
        raise
    except InputError:  # no checkpoint yet, or one that cannot be read
        return False
    return True


def _has_ended(shard: Shard, run: RunDirectory) -> bool:
    """Whether a run holds the shard's training to its end, with weights that can be flown.

    A learner that stopped cannot be told from one whose last rows were cut off: that is no end.
    """
    configuration, training = shard.configuration, shard.configuration.training
    try:
        if _comparable(run.configuration()) != _comparable(configuration):
            return False
        learned_policies([run], configuration.scenario)
        rows = run.metrics()
    except (OSError, ValueError):  # a refusal among them
        return False
    last = rows["episode"] == training.num_episodes
    evaluated = rows[last | (rows["episode"] % training.evaluation_every == 0)]
    flown = rows.drop_duplicates(["learner", "episode"])
    return (
        len(rows) == len(flown) == len(configuration.learners) * training.num_episodes
        and not evaluated[[*METRIC_NUMBERS]].isna().to_numpy().any()
    )


def _comparable(configuration: RunConfiguration) -> RunConfiguration:
    """The same whatever the number of cohorts, which changes speed alone."""
    training = dataclasses.replace(configuration.training, cohorts=1)
    return dataclasses.replace(configuration, training=training)


def _reporting(shard: Shard) -> tuple[LoggerParameters, Console]:
    logger = dataclasses.replace(in_group(shard.logger, _logs(shard)), name=shard.name, id=None)
    return logger, Console(quiet=True)


def _logs(shard: Shard) -> Path:
    """The comparison's directory, which does not change its name as the shard's does."""
    return shard.parent.parent


def _reached(shard: Shard, run: RunDirectory) -> tuple[pd.DataFrame, list[float]]:
    """A training's metrics, and the best actors' sum-rates in bps/Hz."""
    configuration, scenario = shard.configuration, shard.configuration.scenario
    metrics = run.metrics()
    metrics["seconds"] /= len(configuration.learners)
    earned: dict[str, list[float]] = {
        scheme: fly(scenario, scheme, policy, shard.evaluation)
        .totals["secrecy_sum_rate"]
        .mean(dim=1)
        .tolist()
        for scheme, (policy,) in learned_policies([run], scenario).items()
    }
    return metrics, [earned[LEARNED[own.scheme]].pop(0) for own in configuration.learners]


def tables(
    shard: Shard, metrics: pd.DataFrame, sum_rates: list[float]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """What the learners reached, and how.

    Args:
        shard: whose learners they are.
        metrics: a row for each evaluation in training and learner, or for each episode, of which
            some are evaluated: ``learner``, ``episode``, ``slots``, ``evaluation`` and its
            ``sum_rate`` in bps/Hz, and ``seconds``, those that passed since training began, with
            compiling and evaluating, divided by the learners that trained side by side. A learner
            has rows until it stops.
        sum_rates: in bps/Hz, what each learner's best weights earn in the evaluation's episodes.

    Returns:
        ``results``, a row for each learner: ``sum_rate``, the ``optimum`` of its scheme in the
        same episodes, and their ratio ``fraction``; ``episodes_to_threshold`` and
        ``seconds_to_threshold`` at the first evaluation at which the best weights so far earned
        the threshold's share of what the optimum earns in that evaluation's episodes, NaN where
        none did; ``seconds`` in all; and ``stopped``, the episode in which the learner stopped for
        want of finite numbers, NaN for those that did not.
        ``curves``, a row for each evaluation, with ``best_sum_rate``, what the best weights so far
        earned, and its ``fraction`` of the optimum in the same episodes.
    """
    configuration, learners = shard.configuration, shard.configuration.learners
    schemes = dict.fromkeys(own.scheme for own in learners)
    evaluated = training_episodes(configuration.training)
    in_training = {scheme: _optimum(shard, scheme, evaluated) for scheme in schemes}
    in_evaluation = {scheme: _optimum(shard, scheme, shard.evaluation) for scheme in schemes}
    results, curves = [], []
    for index, (learner, sum_rate) in enumerate(zip(learners, sum_rates, strict=True)):
        identity: dict[str, Any] = {
            "algorithm": shard.entry,
            "scenario": configuration.scenario_name,
            "scheme": learner.scheme,
            "num_slots": configuration.scenario.num_slots,
            "seed": learner.seed,
        }
        columns = ["episode", "slots", "seconds", "evaluation", "sum_rate"]
        own = metrics[metrics["learner"] == index]
        last = int(own["episode"].iloc[-1]) if len(own) else 0
        curve = own[columns].dropna(subset="evaluation").reset_index(drop=True)
        is_best = curve["evaluation"] > curve["evaluation"].cummax().shift(fill_value=-np.inf)
        curve["best_sum_rate"] = curve["sum_rate"].where(is_best).ffill()
        curve["fraction"] = curve["best_sum_rate"] / in_training[learner.scheme]
        solved = curve[curve["fraction"] >= shard.threshold]
        optimum = in_evaluation[learner.scheme]
        results.append(
            {
                **identity,
                "sum_rate": sum_rate,
                "optimum": optimum,
                "fraction": sum_rate / optimum,
                "episodes_to_threshold": solved["episode"].iloc[0] if len(solved) else np.nan,
                "seconds_to_threshold": solved["seconds"].iloc[0] if len(solved) else np.nan,
                "seconds": own["seconds"].iloc[-1] if len(own) else 0.0,
                "stopped": last + 1.0 if last < configuration.training.num_episodes else np.nan,
            }
        )
        curves.append(curve.assign(**identity)[[*identity, *curve.columns]])
    return pd.DataFrame(results), pd.concat(curves, ignore_index=True)


def _optimum(shard: Shard, scheme: str, episodes: EvaluationParameters) -> float:
    """What the best flight earns in these episodes, in bps/Hz; it must be something."""
    scenario = shard.configuration.scenario
    policy = shard.optima.policy(scheme, scenario.num_slots)
    flights = fly(scenario, OPTIMA[scheme], policy, episodes)
    earned = float(flights.totals["secrecy_sum_rate"].mean())
    if not earned:
        accepted = f"one whose optimum earns something (T = {scenario.num_slots})"
        raise InputError(rejection("scheme", scheme, accepted))
    return earned
