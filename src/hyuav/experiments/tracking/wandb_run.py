"""A run of Weights & Biases that keeps to itself, through TorchRL's logger."""

import contextlib
import logging
import os
import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
import wandb
from torchrl.record.loggers.wandb import WandbLogger

from hyuav.experiments.run_directory import REPORT_FILE
from hyuav.experiments.tracking.logged_run import Job, reason, say
from hyuav.experiments.tracking.memory import model_name, remember, remembered
from hyuav.experiments.tracking.parameters import LoggerParameters

SECONDS_TO_BEGIN, SECONDS_TO_FINISH = 30.0, 300.0
"""For which a server is waited for; what is not sent by then stays in the directory."""

NO_HOST = "not-recorded"
"""Instead of the machine's name, which W&B writes down where it is given none."""


class WandbRun:
    """A run beside those that the process has already, which go on by themselves.

    Where the server of an online run cannot be reached, it becomes an offline one. Nothing of the
    machine, its users, their home or their keys is written down. The files lie in ``wandb/`` of
    the job's directory, or of that which ``WANDB_DIR`` names.

    Args:
        job: what is logged.
        logger: which run, and in which mode.
    """

    def __init__(self, job: Job, logger: LoggerParameters) -> None:
        self._job, self._logger = job, logger
        self._directory = Path(os.environ.get("WANDB_DIR") or job.directory)
        known = {} if job.memory is None else remembered(job.memory)
        # Or W&B would take the environment's, which is that of the whole main job.
        self.id: str = logger.id or known.get("id") or _new_id()
        self._torchrl = self._reached()
        self.run: wandb.Run = self._torchrl.experiment
        _keep_artifacts(self.run)
        self._remember()
        for axis in dict.fromkeys(metric.axis for metric in job.metrics):
            self.run.define_metric(axis, hidden=True)
        for name, axis, summary in job.metrics:
            self.run.define_metric(name, step_metric=axis, summary=summary)
        for model in job.models if not self.run.offline else ():  # where the library refuses it
            try:
                self.run.use_artifact(model, type="model")
            except (wandb.Error, ValueError) as error:
                say(f"W&B: no lineage from {model} ({reason(error)})")

    @property
    def kept(self) -> str:
        """The command that sends what there is."""
        return f"wandb sync {self._path}"

    def scalars(self, values: Mapping[str, float], step: int) -> None:
        """Add one record to the history."""
        self._torchrl.log_metrics(dict(values), step=step, override_global_step=True)

    def results(
        self, scalars: Mapping[str, float], tables: Mapping[str, pd.DataFrame], directory: Path
    ) -> None:
        """Make the numbers the run's summary; tables, figures and the report are its media."""
        self.run.summary.update(dict(scalars))
        media: dict[str, Any] = {
            name: wandb.Table(dataframe=table.astype(object)) for name, table in tables.items()
        }
        for file in sorted((directory / "figures").glob("*.png")):
            media[f"figures/{file.stem}"] = wandb.Image(str(file))
        report = directory / REPORT_FILE
        if report.is_file():
            media["report"] = wandb.Html(report.read_text(encoding="utf-8"), inject=False)
        self.run.log(media)

    def model(self, files: Mapping[str, Path], metadata: Mapping[str, Any]) -> None:
        """Keep checkpoints as versions of the artifact ``model-ID``, the last also "latest"."""
        for alias, file in files.items():
            kept = _place(self.run, f"{alias}-{self.run.step}{file.suffix}")
            _link(file, kept)
            artifact = wandb.Artifact(model_name(self.id), "model", metadata=dict(metadata))
            artifact.add_file(os.path.relpath(kept), file.name, policy="immutable")
            self.run.log_artifact(artifact, aliases=[alias, "latest"])

    def close(self, failed: bool) -> str:
        """End the run, and say how it is sent or where it is."""
        self.run.finish(exit_code=1 if failed else 0)
        if self.run.offline:
            return f", offline: {self.kept} (in the terminal: wandb leet {self._path})"
        return f": {self.run.url}"

    def abandon(self) -> None:
        """End the run as a failed one; where W&B's service has died, all runs have with it."""
        try:
            self.run.finish(exit_code=1)
        except Exception:
            with contextlib.suppress(Exception):
                wandb.teardown(exit_code=1)

    @property
    def _path(self) -> str:
        return os.path.relpath(self._directory / "wandb")

    def _reached(self) -> WandbLogger:
        """TorchRL's logger of the run, offline where the server does not answer."""
        if self._logger.mode == "online":
            try:
                return self._begin("online")
            except Exception as error:  # from a missing key to a server that does not answer
                say(f"W&B: not online ({reason(error)}); going on offline")
                self._free_id()
        return self._begin("offline")

    def _free_id(self) -> None:
        """W&B's service keeps the id of a run that did not begin for as long as it lives."""
        if wandb.setup().most_recent_active_run is None:
            with contextlib.suppress(Exception):
                wandb.teardown(exit_code=1)
        else:  # of the caller, which goes on
            self.id = _new_id()

    def _begin(self, mode: str) -> WandbLogger:
        try:
            with _without_log_file():
                return WandbLogger(
                    self._logger.name or self._job.directory.resolve().name,
                    save_dir=self._directory,
                    project=self._logger.project,
                    id=self.id,
                    log_env_packages=False,
                    mode=mode,  # its own way would be to set WANDB_MODE for the whole process
                    entity=self._logger.entity,
                    group=self._logger.group,
                    job_type=self._logger.job_type or self._job.job_type,
                    tags=self._logger.tags or None,
                    config=dict(self._job.config),
                    settings=_settings(mode),
                )
        finally:
            _unlink_service_logs(self._directory, self.id)

    def _remember(self) -> None:
        if self._job.memory is not None:
            identity = {
                "id": self.id,
                "mode": "offline" if self.run.offline else "online",
                "project": self._logger.project,
                "entity": self._logger.entity,
                "group": self.run.group or None,
            }
            remember(self._job.memory, identity)


def _new_id() -> str:
    return uuid.uuid4().hex[:8]


def _settings(mode: str) -> wandb.Settings:
    return wandb.Settings(
        silent=True,
        console="off",
        reinit="create_new",  # a run of the caller's stays open, and stays wandb.run
        x_disable_meta=True,  # host, user, command line and paths
        x_disable_machine_info=True,
        host=NO_HOST,
        disable_git=True,
        disable_code=True,
        init_timeout=SECONDS_TO_BEGIN,
        finish_timeout=SECONDS_TO_FINISH if mode == "online" else 0.0,
        finish_timeout_raises=True,
    )


@contextmanager
def _without_log_file() -> Iterator[None]:
    """Let the run that is begun inside log nothing to its ``debug.log``.

    It would name the working directory and the interpreter's. Other runs' logs go on.
    """
    wandb.setup()  # which configures the logger
    logger = logging.getLogger("wandb")
    level, others = logger.level, list(logger.handlers)
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(level)
        for handler in logger.handlers:
            if handler not in others:
                handler.setLevel(logging.CRITICAL + 1)


def _unlink_service_logs(directory: Path, run_id: str) -> None:
    """Remove W&B's links from a run to logs in the user's home."""
    for link in directory.glob(f"wandb/*run-*-{run_id}/logs/debug-core*.log"):
        link.unlink(missing_ok=True)


def _keep_artifacts(run: wandb.Run) -> None:
    """Keep what artifacts hold beside the run, named from the working directory.

    W&B would copy it, tables included, to the user's home and write that path down.
    """
    log_artifact = run.log_artifact

    def log(artifact: Any, *arguments: Any, **options: Any) -> Any:
        for entry in artifact.manifest.entries.values():
            if entry.local_path is not None and Path(entry.local_path).is_absolute():
                kept = _place(run, f"{artifact.name}-{run.step}")
                shutil.move(entry.local_path, kept)
                entry.local_path = os.path.relpath(kept)
        return log_artifact(artifact, *arguments, **options)

    run.log_artifact = log  # type: ignore[assignment]


def _place(run: wandb.Run, name: str) -> Path:
    """A path beside the run's files that is free."""
    directory = Path(run.settings.sync_dir) / "artifacts"
    directory.mkdir(exist_ok=True)
    taken = len(list(directory.iterdir()))
    return directory / f"{taken}-{name}"


def _link(file: Path, target: Path) -> None:
    """Keep the content of a file, which is later replaced by another and not written to."""
    try:
        target.hardlink_to(file)
    except OSError:
        shutil.copyfile(file, target)
