"""Where a training reports to: its run directory, Weights & Biases and the terminal."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import wandb
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from torchrl.record.loggers.wandb import WandbLogger

from hyuav.learning.checkpoint import save_checkpoint
from hyuav.learning.cohort import Learner
from hyuav.learning.training import Episode, Training
from hyuav.parameters import Parameters, choice, parameter, text
from hyuav.runs import METRIC_COLUMNS, MetricsFile, RunConfiguration, RunDirectory

_IDENTITY = ("episode", "slots", "learner", "scheme", "seed", "num_slots", "seconds")
"""Columns that say which learner's episode a row is, not what it brought."""

SECONDS_BETWEEN_CHECKPOINTS = 20.0
"""At least; a checkpoint holds all replays, of tens of megabytes."""


@dataclass(frozen=True)
class LoggerParameters(Parameters):
    """Where the metrics go besides the run directory."""

    mode: str = parameter(choice("offline", "online", "disabled"), "offline")
    project: str = parameter(text, "hyuav")


def learner_names(learners: Sequence[Learner], horizons: Sequence[int]) -> list[str]:
    """The scheme of each learner, with its horizon and seed where they tell learners apart."""
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

    Metrics go to ``metrics.csv`` and, under the same names, to Weights & Biases through
    TorchRL's logger. Checkpoints are written with evaluations, and at the end. A progress bar with
    the current return and the time left is shown on terminals only.

    Args:
        run: the training's directory.
        configuration: of the training.
        training: whose state the checkpoints hold.
        logger: what Weights & Biases gets.
        console: to show progress on.
    """

    def __init__(
        self,
        run: RunDirectory,
        configuration: RunConfiguration,
        training: Training,
        logger: LoggerParameters,
        console: Console,
    ) -> None:
        self.run, self.training = run, training
        self.names = learner_names(training.learners, training.horizons)
        steps = tuple(f"loss_{name}" for name in training.steps)
        self._metrics = MetricsFile(run.metrics_file, (*METRIC_COLUMNS, *steps))
        self._wandb = _wandb_logger(run, configuration, logger)
        self._progress = Progress(
            TextColumn("training"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("episodes, return {task.fields[returns]} bps/Hz"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            disable=not console.is_terminal,
        )
        self._task = self._progress.add_task(
            "training", total=training.parameters.num_episodes, returns="-"
        )
        self._started = time.perf_counter()
        self._saved = -math.inf

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._progress.stop()
        self._metrics.close()
        if self._wandb is not None:
            self._wandb.experiment.finish(exit_code=0 if kind is None else 1)

    def log(self, episode: Episode) -> None:
        """Report one episode of all learners."""
        rows = self._rows(episode)
        self._metrics.append(rows)
        if self._wandb is not None:
            self._wandb.log_metrics(_by_learner(self.names, rows), step=episode.number)
        last = episode.number == self.training.parameters.num_episodes
        waited = time.perf_counter() - self._saved >= SECONDS_BETWEEN_CHECKPOINTS
        if episode.evaluation is not None and (waited or last):
            self.save()
        returns = " ".join(f"{value:.1f}" for value in episode.accumulated_reward.tolist()[:5])
        self._progress.update(self._task, completed=episode.number, returns=returns)

    def save(self) -> None:
        """Write the checkpoints."""
        save_checkpoint(self.run.last_checkpoint, "training", self.training.state_dict())
        save_checkpoint(self.run.best_checkpoint, "weights", self.training.best_weights)
        self._saved = time.perf_counter()

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
        ]


def _by_learner(names: Sequence[str], rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The rows' measurements as one flat record: ``hybrid/accumulated_reward`` and so on."""
    record: dict[str, Any] = {
        "slots": max(row["slots"] for row in rows),
        "seconds": rows[0]["seconds"],
    }
    for name, row in zip(names, rows, strict=True):
        record |= {
            f"{name}/{column}": value for column, value in row.items() if column not in _IDENTITY
        }
    return record


def _wandb_logger(
    run: RunDirectory, configuration: RunConfiguration, logger: LoggerParameters
) -> WandbLogger | None:
    if logger.mode == "disabled":
        return None
    return WandbLogger(
        exp_name=run.path.name,
        offline=logger.mode == "offline",
        save_dir=run.path,
        project=logger.project,
        log_env_packages=False,
        config=configuration.to_dict(),
        settings=wandb.Settings(
            silent=True, console="off", x_disable_meta=True, x_disable_machine_info=True
        ),
    )
