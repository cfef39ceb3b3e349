"""One run of Weights & Biases, whose failures stop nothing and which keeps to itself.

It is used directly and not through TorchRL's logger, which gives every metric a step axis of its
own, knows no summaries, tables or artifacts, and changes the process's environment.
"""

import contextlib
import json
import logging
import os
import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

import wandb
from rich.console import Console

from hyuav._support.errors import harmless
from hyuav._support.files import read_regular, write_durably
from hyuav._support.parameters import checked
from hyuav._support.terminal import print_line
from hyuav.experiments.tracking.parameters import Identifier, LoggerParameters

MEMORY_FILE = "wandb.json"
"""In a run directory, which W&B run it belongs to."""

IDENTITY = ("id", "mode", "project", "entity", "group")
"""What it says of that run."""

LARGEST_MEMORY = 2**16
"""Bytes of it that are read."""

SECONDS_TO_BEGIN, SECONDS_TO_FINISH = 30.0, 300.0
"""For which a server is waited for; what is not sent by then stays in the directory."""

NO_HOST = "not-recorded"
"""Instead of the machine's name, which W&B writes down where it is given none."""


class Session:
    """A run of Weights & Biases; use it as a context manager.

    Whatever fails in it is told in one line on the standard error, and what is reported on goes
    on. Where the server of an online run cannot be reached, it becomes an offline one. Nothing of
    the machine, its users, their home or their keys is written down.

    Args:
        directory: that ``wandb/`` is made in.
        logger: which run, and in which mode.
        config: what the run was asked to do.
        job_type: where the logger names none.
        console: on which the end is told.
        memory: directory that remembers the run's identity, so that the next session with the
            same one goes on with it; None for a new run every time.
    """

    def __init__(
        self,
        directory: Path,
        logger: LoggerParameters,
        config: Mapping[str, Any],
        job_type: str,
        *,
        console: Console,
        memory: Path | None = None,
    ) -> None:
        self._directory, self._logger, self._config = directory, logger, config
        self._job_type, self._console = job_type, console
        self._memory = memory
        self._run: wandb.Run | None = None
        self.id: str | None = logger.id
        """Of the W&B run; None where there never was one."""
        if memory is not None and self.id is None and logger.mode != "disabled":
            self.id = remembered(memory).get("id")

    def __enter__(self) -> Self:
        if self._logger.mode != "disabled":
            self._begin(self._logger.mode)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        run = self._run
        self.attempt(lambda own: own.finish(exit_code=0 if kind is None else 1))
        if run is None or self._run is None:
            return
        self._run = None
        if run.offline:
            path = os.path.relpath(self._directory / "wandb")
            hint = f"W&B, offline: wandb sync {path} (in the terminal: wandb leet {path})"
        else:
            hint = f"W&B: {run.url}"
        print_line(hint, self._console)

    def attempt(self, action: Callable[[wandb.Run], object]) -> None:
        """Do something with the run; if that fails, say so and do nothing more with it.

        Args:
            action: takes the run. It is left out where nothing is logged.
        """
        if self._run is None:
            return
        try:
            action(self._run)
        except Exception as error:  # of whatever kind: it must not stop hours of training
            self._run = None
            kept = os.path.relpath(self._directory / "wandb")
            _say(f"nothing more is logged ({_reason(error)}); so far: wandb sync {kept}")
            with contextlib.suppress(Exception):
                wandb.teardown(exit_code=1)

    def log(self, values: Mapping[str, Any], step: int | None = None) -> None:
        """Add one record to the history.

        Args:
            values: numbers and media by name.
            step: of the history; the next one where it is None.
        """
        self.attempt(lambda run: run.log(dict(values), step=step))

    def log_model(self, files: Mapping[str, Path], metadata: Mapping[str, Any]) -> None:
        """Keep checkpoints as versions of the artifact ``model-ID``, the last one also "latest".

        Args:
            files: by alias; those that do not exist are left out.
            metadata: of all of them.
        """

        def log(run: wandb.Run) -> None:
            for alias, file in files.items():
                if file.is_file():
                    kept = _place(run, f"{alias}-{run.step}{file.suffix}")
                    _link(file, kept)
                    artifact = wandb.Artifact(model_name(run.id), "model", metadata=dict(metadata))
                    artifact.add_file(os.path.relpath(kept), file.name, policy="immutable")
                    run.log_artifact(artifact, aliases=[alias, "latest"])

        self.attempt(log)

    def use_model(self, name: str) -> None:
        """Say that the run builds on an artifact; offline that is left to its configuration.

        Args:
            name: with its alias. One that the server does not know is told of, and left out.
        """

        def use(run: wandb.Run) -> None:
            if run.offline:  # where the library refuses it
                return
            try:
                run.use_artifact(name, type="model")
            except (wandb.Error, ValueError) as error:
                _say(f"no lineage from {name} ({_reason(error)})")

        self.attempt(use)

    def _begin(self, mode: str) -> None:
        try:
            wandb.setup()
            # These logs would name the working directory and the interpreter's.
            logging.getLogger("wandb").setLevel(logging.CRITICAL + 1)
            self._run = wandb.init(
                dir=self._directory,
                mode="offline" if mode == "offline" else "online",
                project=self._logger.project,
                entity=self._logger.entity,
                group=self._logger.group,
                job_type=self._logger.job_type or self._job_type,
                name=self._logger.name or self._directory.resolve().name,
                tags=self._logger.tags or None,
                id=self.id,
                resume=None if self.id is None else "allow",
                config=dict(self._config),
                settings=_settings(mode),
            )
        except Exception as error:  # from a missing key to a server that does not answer
            with contextlib.suppress(Exception):
                wandb.teardown(exit_code=1)
            _unlink_service_logs(self._directory)
            if mode == "online":
                _say(f"not online ({_reason(error)}); going on offline")
                self._begin("offline")
            else:
                _say(f"nothing is logged ({_reason(error)})")
            return
        _unlink_service_logs(self._directory)
        self.attempt(_keep_artifacts)
        self.attempt(self._remember)

    def _remember(self, run: wandb.Run) -> None:
        self.id = run.id
        if self._memory is None:
            return
        identity = {
            "id": run.id,
            "mode": "offline" if run.offline else "online",
            "project": self._logger.project,
            "entity": self._logger.entity,
            "group": run.group or None,
        }
        file = self._memory / MEMORY_FILE
        write_durably(file, f"{json.dumps(identity, indent=2)}\n".encode())


def _settings(mode: str) -> wandb.Settings:
    return wandb.Settings(
        silent=True,
        console="off",
        x_disable_meta=True,  # host, user, command line and paths
        x_disable_machine_info=True,
        host=NO_HOST,
        disable_git=True,
        disable_code=True,
        init_timeout=SECONDS_TO_BEGIN,
        finish_timeout=SECONDS_TO_FINISH if mode == "online" else 0.0,
        finish_timeout_raises=True,
    )


def remembered(directory: Path) -> dict[str, Any]:
    """Which W&B run a directory belongs to: id, mode, project, entity and group; empty if none.

    Where the file is not one that a session wrote, that is told on the standard error, and none is
    known.
    """
    file = directory / MEMORY_FILE
    try:
        content = json.loads(read_regular(file, LARGEST_MEMORY).decode())
        identity = {name: content[name] for name in IDENTITY}
        checked(Identifier, "id", identity["id"])
        LoggerParameters.from_dict(identity)
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        _say(f"{file} is damaged: the run that it was for is not known, and cannot be continued")
        return {}
    return identity


def model_name(run_id: str) -> str:
    """The artifact that holds a run's checkpoints."""
    return f"model-{run_id}"


def _unlink_service_logs(directory: Path) -> None:
    """Remove W&B's links to logs in the user's home."""
    for link in directory.glob("wandb/*run-*/logs/debug-core*.log"):
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


def _reason(error: Exception) -> str:
    first, *_ = str(error).strip().splitlines() or [type(error).__name__]
    return first[:200]


def _say(line: str) -> None:
    print(f"W&B: {harmless(line)}", file=sys.stderr)
