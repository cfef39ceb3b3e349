"""Where a training reports to: its run directory, Weights & Biases and the terminal."""

import time
from collections import Counter
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
from hyuav.learning.training import Episode, Training
from hyuav.parameters import Parameters, choice, parameter, text
from hyuav.runs import METRIC_COLUMNS, MetricsFile, RunConfiguration, RunDirectory


@dataclass(frozen=True)
class LoggerParameters(Parameters):
    """Where the metrics go besides the run directory."""

    mode: str = parameter(choice("offline", "online", "disabled"), "offline")
    project: str = parameter(text, "hyuav")


def learner_names(schemes: Sequence[str]) -> list[str]:
    """The scheme of each learner, numbered from 0 where several fly the same one."""
    totals, seen = Counter(schemes), Counter[str]()
    names = []
    for scheme in schemes:
        names.append(scheme if totals[scheme] == 1 else f"{scheme}_{seen[scheme]}")
        seen[scheme] += 1
    return names


class Tracker:
    """Report every episode of a training; use it as a context manager.

    Metrics go to ``metrics.csv`` and, under the same names, to Weights & Biases through
    TorchRL's logger. Checkpoints are written with every evaluation. A progress bar with the
    current return and the time left is shown on terminals only.

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
        self.names = learner_names(training.schemes)
        steps = tuple(f"loss_{step.name}" for step in training.algorithm.steps)
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
        if episode.evaluation is not None:
            self.save()
        returns = " ".join(f"{value:.1f}" for value in episode.accumulated_reward.tolist()[:5])
        self._progress.update(self._task, completed=episode.number, returns=returns)

    def save(self) -> None:
        """Write the checkpoints."""
        save_checkpoint(self.run.last_checkpoint, "training", self.training.state_dict())
        save_checkpoint(self.run.best_checkpoint, "weights", self.training.best_weights)

    def _rows(self, episode: Episode) -> list[dict[str, Any]]:
        seconds = round(time.perf_counter() - self._started, 3)
        columns: dict[str, list[float]] = {
            "accumulated_reward": episode.accumulated_reward.tolist(),
            **{f"loss_{name}": loss.tolist() for name, loss in episode.losses.items()},
        }
        if episode.evaluation is not None:
            columns["evaluation"] = episode.evaluation.tolist()
            columns["best_evaluation"] = self.training.best_evaluation.tolist()
        shared = {"episode": episode.number, "slots": episode.slots, "seconds": seconds}
        return [
            shared
            | {"learner": learner, "scheme": scheme}
            | {name: values[learner] for name, values in columns.items()}
            for learner, scheme in enumerate(self.training.schemes)
        ]


def _by_learner(names: Sequence[str], rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The rows' measurements as one flat record: ``hybrid/accumulated_reward`` and so on."""
    record: dict[str, Any] = {name: rows[0][name] for name in ("slots", "seconds")}
    for name, row in zip(names, rows, strict=True):
        for column, value in row.items():
            if column not in ("episode", "slots", "seconds", "learner", "scheme"):
                record[f"{name}/{column}"] = value
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
