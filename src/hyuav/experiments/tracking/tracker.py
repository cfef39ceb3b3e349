"""Reporting a training: metrics and checkpoints in its directory, a logger, progress shown."""

import dataclasses
import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rich.console import Console

from hyuav._support.terminal import TrainingProgress
from hyuav.experiments.metrics import METRIC_COLUMNS, MetricsFile
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking.checkpoints import Reported, save_checkpoints
from hyuav.experiments.tracking.logged_run import Job, Metric
from hyuav.experiments.tracking.parameters import LoggerParameters
from hyuav.experiments.tracking.session import Session
from hyuav.learning.learners import Learner
from hyuav.learning.training import Episode, Training

_IDENTITY = ("episode", "slots", "learner", "scheme", "seed", "num_slots", "seconds")
"""Columns that say which learner's episode a row is, not what it brought."""

SUMMARIES = {
    "accumulated_reward": "max,last",
    "evaluation": "max,last",
    "sum_rate": "max,last",
    "best_evaluation": "max",
}
"""What a run's summary keeps of each learner's metrics; of its losses, the least and the last."""


def learner_names(learners: Sequence[Learner], horizons: Sequence[int]) -> list[str]:
    """The mode rule of each learner, with its horizon and seed where they tell learners apart."""
    several_horizons = len(set(horizons)) > 1
    several_seeds = len({learner.seed for learner in learners}) > 1
    return [
        learner.scheme
        + (f"_T{horizon}" if several_horizons else "")
        + (f"_seed{learner.seed}" if several_seeds else "")
        for learner, horizon in zip(learners, horizons, strict=True)
    ]


class Tracker:
    """Report every episode of a training; use it as a context manager.

    Metrics go to ``metrics.csv`` and, under the same names, to a logger. Checkpoints are
    written every ``checkpoint_every`` seconds, and at the end. A progress bar with the current
    return and the time left is shown on terminals only. A learner that stops is told of on the
    standard error, and has no rows any more.

    Args:
        run: the training's directory.
        configuration: of the training.
        training: whose state the checkpoints hold.
        logger: where the metrics go besides.
        console: to show progress on.
        logs: directory for the logger's files; the run's where it is None.
        reported: what was before the training was interrupted: later metrics are dropped, and the
            same W&B run goes on.

    Raises:
        OSError: the metrics cannot be written.
    """

    def __init__(
        self,
        run: RunDirectory,
        configuration: RunConfiguration,
        training: Training,
        logger: LoggerParameters,
        console: Console,
        logs: Path | None = None,
        reported: Reported | None = None,
    ) -> None:
        self.run, self.training = run, training
        self.names = learner_names(training.learners, training.horizons)
        self._axes = _slot_axes(self.names, training.horizons)
        self._configuration = configuration
        reported = reported or Reported()
        steps = tuple(f"loss_{name}" for name in training.steps)
        columns = (*METRIC_COLUMNS, *steps)
        self._metrics = MetricsFile(run.metrics_file, columns, reported.metrics)
        self._session = Session(
            Job(
                run.path if logs is None else logs,
                configuration.to_dict(),
                "train",
                memory=run.path,
                metrics=self._metrics_logged(),
                first_step=training.episode + 1,
            ),
            dataclasses.replace(logger, id=logger.id or reported.wandb_id),
            console,
        )
        self._progress = TrainingProgress(
            console,
            training.parameters.num_episodes,
            training.episode,
            configuration.reward.unit,
        )
        self._started = time.perf_counter() - reported.seconds
        self._saved = time.perf_counter()
        self._stopped = {index for index, slot in enumerate(training.stopped) if slot}

    def __enter__(self) -> Self:
        self._session.__enter__()
        self._progress.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._progress.__exit__(kind, error, traceback)
        self._metrics.close()
        self._session.attempt(lambda logged: logged.model(*self._model()))
        self._session.__exit__(kind, error, traceback)

    def log(self, episode: Episode) -> None:
        """Report one episode of all learners."""
        self._tell_who_stopped(episode)
        rows = self._rows(episode)
        if rows:
            self._metrics.append(rows)
            record = _by_learner(self.names, self._axes, rows)
            self._session.attempt(lambda logged: logged.scalars(record, episode.number))
        waited = time.perf_counter() - self._saved
        if waited >= self.training.parameters.checkpoint_every or self.training.is_finished:
            self.save()
        self._progress.update(episode.number, [row["accumulated_reward"] for row in rows])

    def save(self) -> None:
        """Write the checkpoints.

        Raises:
            OSError: they cannot be written; the last ones are still there.
        """
        self._metrics.sync()  # a checkpoint may count on all rows before it
        self._saved = time.perf_counter()
        seconds = self._saved - self._started
        reported = Reported(self._metrics.position, seconds, self._session.id)
        save_checkpoints(self.run, self.training, reported)

    def _tell_who_stopped(self, episode: Episode) -> None:
        for index, slot in enumerate(self.training.stopped):
            if slot and index not in self._stopped:
                self._stopped.add(index)
                print(
                    f"learner {index} ({self.names[index]}) stops in episode {episode.number}, "
                    f"slot {slot}: its losses or weights are not finite; "
                    "its best weights before that are kept",
                    file=sys.stderr,
                )

    def _metrics_logged(self) -> list[Metric]:
        """Rewards against episodes; losses against slots, in each of which there is an update."""
        metrics = [Metric(name, "episode") for name in ("seconds", "best_evaluation")]
        for name, axis in zip(self.names, self._axes, strict=True):
            metrics += [
                Metric(f"{name}/{column}", "episode", summary)
                for column, summary in SUMMARIES.items()
            ]
            metrics += [
                Metric(f"{name}/loss_{step}", axis, "min,last") for step in self.training.steps
            ]
        return metrics

    def _model(self) -> tuple[dict[str, Path], dict[str, Any]]:
        """The checkpoints that there are, by alias, and what is told of them."""
        files = {"last": self.run.last_checkpoint, "best": self.run.best_checkpoint}
        best = zip(self.names, self.training.best_evaluation.tolist(), strict=True)
        metadata = {
            "scenario": self._configuration.scenario_name,
            "algorithm": self._configuration.algorithm_name,
            "episodes": self.training.episode,
            "best_evaluation": {name: value for name, value in best if math.isfinite(value)},
        }
        return {alias: file for alias, file in files.items() if file.is_file()}, metadata

    def _rows(self, episode: Episode) -> list[dict[str, Any]]:
        seconds = round(time.perf_counter() - self._started, 3)
        columns: dict[str, list[float]] = {
            "accumulated_reward": episode.accumulated_reward.tolist(),
            **{f"loss_{name}": loss.tolist() for name, loss in episode.losses.items()},
        }
        if episode.evaluation is not None:
            columns["evaluation"] = episode.evaluation.reward.tolist()
            columns["sum_rate"] = episode.evaluation.sum_rate.tolist()
            columns["best_evaluation"] = self.training.best_evaluation.tolist()
        return [
            {
                "episode": episode.number,
                "slots": episode.slots[index],
                "learner": index,
                "scheme": learner.scheme,
                "seed": learner.seed,
                "num_slots": self.training.horizons[index],
                "seconds": seconds,
            }
            | {
                name: values[index]
                for name, values in columns.items()
                if not math.isnan(values[index])  # before the first update there is no loss
            }
            for index, learner in enumerate(self.training.learners)
            if episode.learning[index]
        ]


def _slot_axes(names: Sequence[str], horizons: Sequence[int]) -> list[str]:
    """The metric that counts each learner's slots: one for all where they fly equally many."""
    if len(set(horizons)) == 1:
        return ["slots"] * len(names)
    return [f"{name}/slots" for name in names]


def _by_learner(
    names: Sequence[str], axes: Sequence[str], rows: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """The rows' measurements as one flat record: ``hybrid/accumulated_reward`` and so on.

    ``best_evaluation`` is the mean over the learners that have not stopped.
    """
    record: dict[str, Any] = {"episode": rows[0]["episode"], "seconds": rows[0]["seconds"]}
    for row in rows:
        name, axis = names[row["learner"]], axes[row["learner"]]
        record[axis] = row["slots"]
        record |= {
            f"{name}/{column}": value for column, value in row.items() if column not in _IDENTITY
        }
    best = [row["best_evaluation"] for row in rows if "best_evaluation" in row]
    return record | ({"best_evaluation": sum(best) / len(best)} if best else {})
