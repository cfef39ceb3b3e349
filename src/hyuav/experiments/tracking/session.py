"""What a job logs through a library, whose failures stop nothing."""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Protocol, Self

import pandas as pd
from rich.console import Console

from hyuav._support.errors import harmless
from hyuav._support.terminal import print_line
from hyuav.experiments.tracking.parameters import TENSORBOARD, WANDB, LoggerParameters

TITLES = {WANDB: "W&B", TENSORBOARD: "TensorBoard"}


class Metric(NamedTuple):
    """How a library that can is to draw a metric, and what it is to keep of it."""

    name: str
    axis: str
    """The metric that it is drawn against."""
    summary: str | None = None
    """Such as "max,last"."""


@dataclass(frozen=True)
class Job:
    """What is logged: a training, an evaluation or a comparison."""

    directory: Path
    """That the library keeps its files in."""
    config: Mapping[str, Any]
    """What was asked for."""
    job_type: str
    memory: Path | None = None
    """Directory that remembers the run's identity, so that the next job goes on with it."""
    metrics: Sequence[Metric] = ()
    models: Sequence[str] = ()
    """Artifacts that the job builds on, with their aliases."""
    first_step: int = 0
    """Whatever was logged from this step on is replaced."""


class LoggedRun(Protocol):
    """One run of a library; it may raise whatever the library raises."""

    id: str | None
    """By which it can be continued, where there is such a thing."""

    @property
    def kept(self) -> str:
        """The command that shows or sends what has been logged."""

    def scalars(self, values: Mapping[str, float], step: int) -> None:
        """Add numbers to the history."""

    def results(
        self, scalars: Mapping[str, float], tables: Mapping[str, pd.DataFrame], directory: Path
    ) -> None:
        """Log what came of the whole job: numbers, tables, and a directory's figures and report."""

    def model(self, files: Mapping[str, Path], metadata: Mapping[str, Any]) -> None:
        """Keep checkpoints, by alias."""

    def close(self, failed: bool) -> str:
        """End the run, and say in one line where it is to be seen."""

    def abandon(self) -> None:
        """End a run in which something has failed."""


class Session:
    """A job's run of the logger that was asked for; use it as a context manager.

    Whatever fails in it is told in one line on the standard error, and what is reported on goes
    on. Runs of the process that are not its own are left alone.

    Args:
        job: what is logged.
        logger: by which library, in which run and mode.
        console: on which the end is told.
    """

    def __init__(self, job: Job, logger: LoggerParameters, console: Console) -> None:
        self._job, self._logger, self._console = job, logger, console
        self._title = TITLES[logger.library]
        self._run: LoggedRun | None = None
        self.id: str | None = logger.id
        """By which the run can be continued; None where there never was one."""

    def __enter__(self) -> Self:
        if self._logger.mode != "disabled":
            try:
                self._run = self._open()
                self.id = self._run.id
            except Exception as error:  # of whatever kind: it must not stop hours of training
                say(f"{self._title}: nothing is logged ({reason(error)})")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        ends: list[str] = []
        self.attempt(lambda run: ends.append(run.close(failed=kind is not None)))
        self._run = None
        for line in ends:
            print_line(f"{self._title}{line}", self._console)

    def attempt(self, action: Callable[[LoggedRun], object]) -> None:
        """Do something with the run; if that fails, say so and do nothing more with it.

        Args:
            action: takes the run. It is left out where nothing is logged.
        """
        run = self._run
        if run is None:
            return
        try:
            action(run)
        except Exception as error:
            self._run = None
            why = reason(error)
            say(f"{self._title}: nothing more is logged ({why}); so far: {run.kept}")
            run.abandon()

    def _open(self) -> LoggedRun:
        # Either library takes a while to load.
        if self._logger.library == TENSORBOARD:
            from hyuav.experiments.tracking.tensorboard_run import TensorBoardRun

            return TensorBoardRun(self._job, self._logger)
        from hyuav.experiments.tracking.wandb_run import WandbRun

        return WandbRun(self._job, self._logger)


def reason(error: Exception) -> str:
    """The first line of an error, which may be long."""
    first, *_ = str(error).strip().splitlines() or [type(error).__name__]
    return first[:200]


def say(line: str) -> None:
    """Print a line on the standard error."""
    print(harmless(line), file=sys.stderr)
