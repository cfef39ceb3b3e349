"""A job's run of the logger that was asked for, whose failures stop nothing."""

from collections.abc import Callable
from types import TracebackType
from typing import Self

from rich.console import Console

from hyuav._support.terminal import print_line
from hyuav.experiments.tracking.logged_run import Job, LoggedRun, reason, say
from hyuav.experiments.tracking.parameters import TENSORBOARD, WANDB, LoggerParameters

TITLES = {WANDB: "W&B", TENSORBOARD: "TensorBoard"}


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
