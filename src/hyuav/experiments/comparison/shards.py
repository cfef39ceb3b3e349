"""A comparison's pieces of work, each kept in a directory of its own once it is done."""

import dataclasses
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console

from hyuav._support.errors import BusyError, Halted, InputError, rejection
from hyuav._support.files import read_parquet, rename_durably, write_durably
from hyuav._support.registry import file_name
from hyuav.envs.rewards import DEFAULT
from hyuav.experiments.comparison import generalist
from hyuav.experiments.comparison.optima import Optima
from hyuav.experiments.comparison.plan import training_episodes
from hyuav.experiments.evaluation import EvaluationParameters, fly
from hyuav.experiments.metrics import METRIC_NUMBERS
from hyuav.experiments.policies import learned_policies
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.schemes import LEARNED, NO_HELPER, OPTIMA
from hyuav.experiments.tracking import LoggerParameters, in_group
from hyuav.experiments.train import resume, train
from hyuav.learning.registry import BESIDE, GENERALIST
from hyuav.references.straight import no_helper

TABLES = RESULTS_FILE, CURVES_FILE = "results.parquet", "curves.parquet"

_IDENTITY = {"algorithm", "scenario", "scheme", "num_slots", "seed"}
_RESULTS = _IDENTITY | {
    *("sum_rate", "optimum", "no_helper", "fraction", "seconds"),
    *("episodes_to_threshold", "seconds_to_threshold"),
}
_CURVES = _IDENTITY | {"episode", "slots", "seconds", "best_sum_rate", "fraction"}


@dataclass(frozen=True)
class Shard:
    """Learners of one algorithm, scenario and horizon, which one worker trains side by side.

    Its directory is a run directory with two tables more, :meth:`tables`; that of
    Stable-Baselines3 or of the generalist holds the tables alone. It is there once all of it is
    written.
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
        """Both tables, as :meth:`tables` gave them; None where one is missing or damaged."""
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
            InputError: a mode rule's optimum earns nothing, or another process trains there.
            OSError: something cannot be written, for want of space perhaps.
        """
        self._optima(self.evaluation)
        finished = RunDirectory(self.path)
        if self._is_trained(finished):
            self._keep(self.path, *self._reached(finished))
            return
        partial = self.path.with_name(f"{self.name}.partial")
        if self.path.exists():  # and is damaged, but may hold a checkpoint
            _clear(partial)
            self.path.rename(partial)
        if self.entry in BESIDE:
            _clear(partial)
            partial.mkdir(parents=True)
            self._keep(partial, *self._beside())
        else:
            self._train(partial)
            self._keep(partial, *self._reached(RunDirectory(partial)))
        rename_durably(partial, self.path)
        for checkpoint in (finished.previous_checkpoint, finished.last_checkpoint):
            checkpoint.unlink(missing_ok=True)  # nothing goes on from them any more

    def _beside(self) -> tuple[pd.DataFrame, list[float], list[float]]:
        """What :meth:`_reached` tells, of what is no algorithm of this project."""
        if self.entry == GENERALIST:
            return generalist.fly_all(self.configuration, self.evaluation)
        from hyuav.experiments.comparison import stable_baselines  # an optional library

        return stable_baselines.train(self.configuration, self.evaluation)

    def _keep(
        self, directory: Path, metrics: pd.DataFrame, sum_rates: list[float], earned: list[float]
    ) -> None:
        for name, table in zip(TABLES, self.tables(metrics, sum_rates, earned), strict=True):
            write_durably(directory / name, table.to_parquet())

    def _train(self, directory: Path) -> None:
        """To the end of all learners, be it that all have stopped; their best weights are kept."""
        logs = self.parent.parent  # which does not change its name as the shard's directory does
        logger = dataclasses.replace(in_group(self.logger, logs), name=self.name, id=None)
        try:
            if not self._resume(directory, logger, logs):
                _clear(directory)
                train(directory, self.configuration, logger, Console(quiet=True), logs=logs)
        except Halted as halted:
            if halted.resumable:
                raise

    def _resume(self, directory: Path, logger: LoggerParameters, logs: Path) -> bool:
        """Bring the training that a broken attempt left to its end; False if it is of no use."""
        try:
            if not self._is_same(RunDirectory(directory)):
                return False
            resume(directory, logger, Console(quiet=True), logs=logs)
        except BusyError:  # whose files must not be taken away
            raise
        except InputError:  # no checkpoint yet, or one that cannot be read
            return False
        return True

    def _is_same(self, run: RunDirectory) -> bool:
        """Whether a run trains the same; the number of cohorts changes speed alone.

        Raises:
            InputError: there is no such run.
        """
        asked, begun = (
            dataclasses.replace(own, training=dataclasses.replace(own.training, cohorts=1))
            for own in (self.configuration, run.configuration())
        )
        return asked == begun

    def _is_trained(self, run: RunDirectory) -> bool:
        """Whether a run holds the shard's training to its end, with weights that can be flown.

        A learner that stopped cannot be told from one whose last rows were cut off: that is no end.
        """
        learners, training = self.configuration.learners, self.configuration.training
        try:
            if not self._is_same(run):
                return False
            learned_policies([run], self.configuration.scenario)
            rows = run.metrics()
        except (OSError, ValueError):  # a refusal among them
            return False
        last = rows["episode"] == training.num_episodes
        evaluated = rows[last | (rows["episode"] % training.evaluation_every == 0)]
        flown = rows.drop_duplicates(["learner", "episode"])
        return (
            len(rows) == len(flown) == len(learners) * training.num_episodes
            and not evaluated[[*METRIC_NUMBERS]].isna().to_numpy().any()
        )

    def _reached(self, run: RunDirectory) -> tuple[pd.DataFrame, list[float], list[float]]:
        """A training's metrics, the best actors' sum-rates in bps/Hz, and what they earn."""
        learners, scenario = self.configuration.learners, self.configuration.scenario
        metrics = run.metrics()
        metrics["seconds"] /= len(learners)
        reward = self.configuration.reward
        sum_rates: dict[str, list[float]] = {}
        earned: dict[str, list[float]] = {}
        for scheme, (policy,) in learned_policies([run], scenario).items():
            flights = fly(scenario, scheme, policy, self.evaluation, reward=reward)
            sum_rates[scheme] = flights.totals["secrecy_sum_rate"].mean(dim=1).tolist()
            earned[scheme] = flights.earned.mean(dim=1).tolist()
        order = [LEARNED[own.scheme] for own in learners]
        return (
            metrics,
            [sum_rates[scheme].pop(0) for scheme in order],
            [earned[scheme].pop(0) for scheme in order],
        )

    def tables(
        self, metrics: pd.DataFrame, sum_rates: list[float], earned: list[float]
    ) -> tuple[pd.DataFrame, pd.DataFrame]:
        """What the learners reached, and how.

        Args:
            metrics: a row for each evaluation in training and learner, or for each episode, of
                which some are evaluated: ``learner``, ``episode``, ``slots``, ``evaluation`` and
                its ``sum_rate`` in bps/Hz, and ``seconds``, those that passed since training
                began, with compiling and evaluating, divided by the learners that trained side by
                side. A learner has rows until it stops.
            sum_rates: in bps/Hz, what each learner's best weights bring in the evaluation's
                episodes.
            earned: and what they earn there by the reward.

        Returns:
            ``results``, a row for each learner: ``sum_rate``, what it ``earned``, the ``optimum``
            of its mode rule in the same episodes, and the ratio of both, ``fraction``; where the
            optimum is only the best flight that was found, ``upper_bound``, what no flight earns;
            what comes with ``no_helper`` there;
            ``episodes_to_threshold`` and ``seconds_to_threshold`` at the first evaluation at which
            the best weights so far earned the threshold's share of what the optimum earns in that
            evaluation's episodes, NaN where none did; ``seconds`` in all; and ``stopped``, the
            episode in which the learner stopped for want of finite numbers, NaN for those that did
            not.
            ``curves``, a row for each evaluation, with ``best_sum_rate``, what the best weights so
            far earned, and its ``fraction`` of the optimum in the same episodes.
        """
        episodes = self.configuration.training.num_episodes
        in_training = self._optima(training_episodes(self.configuration.training))
        in_evaluation = self._optima(self.evaluation)
        alone = self._without_helper()
        results, curves = [], []
        for index, learner in enumerate(self.configuration.learners):
            identity: dict[str, Any] = {
                "algorithm": self.entry,
                "scenario": self.configuration.scenario_name,
                "scheme": learner.scheme,
                "num_slots": self.configuration.scenario.num_slots,
                "seed": learner.seed,
            }
            own = metrics[metrics["learner"] == index]
            last = int(own["episode"].iloc[-1]) if len(own) else 0
            by = "sum_rate" if self.configuration.reward == DEFAULT else "evaluation"
            curve = _curve(own, in_training[learner.scheme], by)
            optimum = in_evaluation[learner.scheme]
            bound = self.optima.upper_bound(learner.scheme, identity["num_slots"])
            results.append(
                {
                    **identity,
                    "sum_rate": sum_rates[index],
                    "earned": earned[index],
                    "optimum": optimum,
                    **({} if bound is None else {"upper_bound": bound}),
                    "no_helper": alone,
                    "fraction": earned[index] / optimum,
                    **_first_solved(curve, self.threshold),
                    "seconds": own["seconds"].iloc[-1] if len(own) else 0.0,
                    "stopped": last + 1.0 if last < episodes else np.nan,
                }
            )
            curves.append(curve.assign(**identity)[[*identity, *curve.columns]])
        return pd.DataFrame(results), pd.concat(curves, ignore_index=True)

    def _without_helper(self) -> float:
        """What comes without a helper in the evaluation's episodes, by the reward."""
        scenario, reward = self.configuration.scenario, self.configuration.reward
        flights = fly(scenario, NO_HELPER, no_helper(scenario), self.evaluation, reward=reward)
        return float(flights.earned.mean())

    def _optima(self, episodes: EvaluationParameters) -> Mapping[str, float]:
        """What the best flight of each learner's mode rule earns in these episodes.

        Raises:
            InputError: one earns nothing, so that no fraction of it can be told.
        """
        scenario, optima = self.configuration.scenario, {}
        for rule in dict.fromkeys(own.scheme for own in self.configuration.learners):
            policy = self.optima.policy(rule, scenario.num_slots)
            reward = self.configuration.reward
            flights = fly(scenario, OPTIMA[rule], policy, episodes, reward=reward)
            optima[rule] = float(flights.earned.mean())
            if not optima[rule]:
                accepted = f"one whose optimum earns something (T = {scenario.num_slots})"
                raise InputError(rejection("scheme", rule, accepted))
        return optima


def _curve(metrics: pd.DataFrame, optimum: float, by: str) -> pd.DataFrame:
    """The evaluations of one learner, with what the best weights so far brought.

    Args:
        metrics: of the learner.
        optimum: what the best flight earns.
        by: the column that is set beside it.
    """
    columns = ["episode", "slots", "seconds", "evaluation", "sum_rate"]
    curve = metrics[columns].dropna(subset="evaluation").reset_index(drop=True)
    is_best = curve["evaluation"] > curve["evaluation"].cummax().shift(fill_value=-np.inf)
    curve["best_sum_rate"] = curve["sum_rate"].where(is_best).ffill()
    curve["fraction"] = curve[by].where(is_best).ffill() / optimum
    return curve


def _first_solved(curve: pd.DataFrame, threshold: float) -> dict[str, float]:
    """When a learner reached the threshold's share of the optimum first; NaN if it never did."""
    solved = curve[curve["fraction"] >= threshold]
    return {
        "episodes_to_threshold": solved["episode"].iloc[0] if len(solved) else np.nan,
        "seconds_to_threshold": solved["seconds"].iloc[0] if len(solved) else np.nan,
    }


def _clear(directory: Path) -> None:
    if directory.exists():
        shutil.rmtree(directory)
