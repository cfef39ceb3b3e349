"""The checkpoints of a run: what a training needs to go on as if it had never stopped."""

import dataclasses
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from hyuav._support.errors import InputError, harmless, rejection
from hyuav._support.parameters import CountOrZero, NonNegativeNumber, checked
from hyuav.experiments.metrics import MetricsPosition, remove_damaged_rows
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.tracking.parameters import Identifier
from hyuav.learning.checkpoint import (
    load_checkpoint,
    require_entries,
    require_like,
    save_checkpoint,
)
from hyuav.learning.training import Training

Checksum = Annotated[int, Field(ge=0, le=2**32 - 1)]


@dataclass(frozen=True)
class Reported:
    """How much of a training had been reported when a checkpoint was written."""

    metrics: MetricsPosition = MetricsPosition()
    seconds: float = 0.0
    """Of training."""
    wandb_id: str | None = None
    """Of the W&B run."""


def first_checkpoint(training: Training) -> dict[str, Any]:
    """What a run begins with: a training of which nothing has been reported."""
    return _content(training, Reported())


def save_checkpoints(run: RunDirectory, training: Training, reported: Reported) -> None:
    """Write the best weights and all that evolves; the checkpoint before is kept too.

    Raises:
        OSError: they cannot be written; the last ones are still there.
    """
    save_checkpoint(run.best_checkpoint, "weights", training.best_weights)
    content = _content(training, reported)
    save_checkpoint(run.last_checkpoint, "training", content, keep=run.previous_checkpoint)


def _content(training: Training, reported: Reported) -> dict[str, Any]:
    return {"training": training.state_dict(), "reported": dataclasses.asdict(reported)}


def restore(run: RunDirectory, begin: Callable[[], Training]) -> tuple[Training, Reported]:
    """Put a training where its last checkpoint left it, and say what stands in the way.

    A checkpoint counts if it is whole, the training can go on from it, and the metrics that it
    knows of are whole, too. If the last one does not, the one before does; if the metrics of both
    are damaged, their whole rows are kept. The best weights are written anew where their file is
    not what the checkpoint knows of.

    Args:
        run: of the training.
        begin: makes the training with the run's configuration, as often as it is called.

    Returns:
        the training, and how much of it has been reported.

    Raises:
        InputError: there is no checkpoint from which such a training can go on, or there is
            something else in the place of a file; then nothing has been written.
        OSError: the run cannot be written to.
    """
    _require_files(run)
    reasons: list[str] = []
    for found, has_metrics in _readable(run, reasons):
        training = begin()
        try:
            training.load_state_dict(found.state)
        except InputError as error:
            reasons.append(f"{found.file.name}: {error}")
            continue
        if has_metrics:
            _adopt(found, run, training, reasons)
            return training, found.reported
        reasons.append(f"{run.metrics_file}: its damaged rows are lost")
        _adopt(found, run, training, reasons)
        metrics = remove_damaged_rows(run.metrics_file, training.episode)
        return training, dataclasses.replace(found.reported, metrics=metrics)
    raise InputError(reasons[0])


def _require_files(run: RunDirectory) -> None:
    """Accept a run in which nothing else lies where files are replaced or appended to."""
    checkpoints = run.last_checkpoint, run.previous_checkpoint, run.best_checkpoint
    in_the_way = [path for path in checkpoints if path.is_dir()]
    if run.metrics_file.exists() and not run.metrics_file.is_file():
        in_the_way.append(run.metrics_file)
    for path in in_the_way:
        raise InputError(rejection(path.name, str(path), "a file"))


class _Found(NamedTuple):
    file: Path
    state: dict[str, Any]
    reported: Reported


def _readable(run: RunDirectory, reasons: list[str]) -> Iterator[tuple[_Found, bool]]:
    """The checkpoints that can be read and whether their metrics are whole; those come first."""
    without_metrics = []
    for file in (run.last_checkpoint, run.previous_checkpoint):
        try:
            found = _read(file)
        except InputError as error:
            reasons.append(f"{file.name}: {error}")
            continue
        if found.reported.metrics.is_in(run.metrics_file):
            yield found, True
        else:
            reasons.append(f"{run.metrics_file}: not what it was at the time of {file.name}")
            without_metrics.append((found, False))
    yield from without_metrics


def _read(file: Path) -> _Found:
    content = load_checkpoint(file, "training")
    require_entries("checkpoint", content, ("training", "reported"))
    values = content["reported"]
    require_entries("reported", values, [field.name for field in dataclasses.fields(Reported)])
    metrics = values["metrics"]
    require_entries("reported.metrics", metrics, ("size", "checksum"))
    reported = Reported(
        MetricsPosition(
            checked(CountOrZero, "reported.metrics.size", metrics["size"]),
            checked(Checksum, "reported.metrics.checksum", metrics["checksum"]),
        ),
        checked(NonNegativeNumber, "reported.seconds", values["seconds"]),
        checked(Identifier | None, "reported.wandb_id", values["wandb_id"]),
    )
    return _Found(file, content["training"], reported)


def _adopt(found: _Found, run: RunDirectory, training: Training, reasons: list[str]) -> None:
    """Go on from a checkpoint; what makes it another one than the last is told."""
    if found.file != run.last_checkpoint:
        found.file.replace(run.last_checkpoint)  # or the next one would replace it, not the bad one
    if reasons:
        reasons.append(f"going on after episode {training.episode}")
    reasons += _mended_best(run, training)
    for reason in reasons:
        print(harmless(reason), file=sys.stderr)


def _mended_best(run: RunDirectory, training: Training) -> list[str]:
    """Write the best weights where their file does not hold such weights, and tell why."""
    if training.episode == 0:  # they are written with the next checkpoint
        return []
    weights = training.best_weights
    try:
        require_like("weights", run.best_weights(), weights)
    except InputError as error:
        save_checkpoint(run.best_checkpoint, "weights", weights)
        return [f"{run.best_checkpoint.name}: {error}; written anew from the last checkpoint"]
    return []
