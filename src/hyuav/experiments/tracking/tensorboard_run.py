"""A run of TensorBoard, through TorchRL's logger."""

import contextlib
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib.image
import pandas as pd
import yaml
from torch.utils.tensorboard import SummaryWriter
from torchrl.record.loggers.tensorboard import TensorboardLogger

from hyuav.experiments.tracking.logged_run import Job
from hyuav.experiments.tracking.parameters import TENSORBOARD, LoggerParameters

SECONDS_TO_WRITE = 10
"""After which a number that was logged can be looked at."""


class _Logger(TensorboardLogger):
    """TorchRL's, in whose files what was logged from a step on is replaced."""

    def __init__(self, exp_name: str, log_dir: str, first_step: int) -> None:
        self._first_step = first_step
        super().__init__(exp_name=exp_name, log_dir=log_dir)

    def _create_experiment(self) -> SummaryWriter:
        return SummaryWriter(
            Path(self.log_dir, self.exp_name),
            purge_step=self._first_step,
            flush_secs=SECONDS_TO_WRITE,
        )


class TensorBoardRun:
    """A run in ``tensorboard/`` of the job's directory, called as the kind of job.

    Every number is drawn against the step of the history. The configuration is a text, and the
    figures are images; tables and checkpoints lie beside them as files, and are not copied.

    Args:
        job: what is logged.
        logger: a name in it stands behind the kind of job.
    """

    id: str | None = None

    def __init__(self, job: Job, logger: LoggerParameters) -> None:
        self._directory, self._step = job.directory / TENSORBOARD, job.first_step
        called = [logger.job_type or job.job_type, *filter(None, [logger.name])]
        name = re.sub(r"[^\w.-]+", "_", "_".join(called))
        self._torchrl = _Logger(name, str(self._directory), self._step)
        text = yaml.safe_dump(dict(job.config), sort_keys=False)
        self._torchrl.experiment.add_text("configuration", f"```yaml\n{text}```", self._step)

    @property
    def kept(self) -> str:
        """The command that shows it."""
        return f"tensorboard --logdir {os.path.relpath(self._directory)}"

    def scalars(self, values: Mapping[str, float], step: int) -> None:
        """Add one point to the curve of each number."""
        self._torchrl.log_metrics(dict(values), step=step)

    def results(
        self, scalars: Mapping[str, float], tables: Mapping[str, pd.DataFrame], directory: Path
    ) -> None:
        """Log the numbers as curves of one point, and the figures."""
        del tables
        self._torchrl.log_metrics(dict(scalars), step=self._step)
        for file in sorted((directory / "figures").glob("*.png")):
            pixels = matplotlib.image.imread(file)
            name = f"figures/{file.stem}"
            self._torchrl.experiment.add_image(name, pixels, self._step, dataformats="HWC")

    def model(self, files: Mapping[str, Path], metadata: Mapping[str, Any]) -> None:
        """Copy nothing."""

    def close(self, failed: bool) -> str:
        """Write what is left, and say how to look."""
        del failed
        self._torchrl.experiment.close()
        return f": {self.kept}"

    def abandon(self) -> None:
        """Write what can still be written."""
        with contextlib.suppress(Exception):
            self._torchrl.experiment.close()
