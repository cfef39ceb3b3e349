"""The checkpoints of a run: what a training needs to go on as if it had never stopped."""

import dataclasses
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from hyuav.errors import InputError, harmless
from hyuav.learning.checkpoint import load_checkpoint, save_checkpoint
from hyuav.learning.training import Training
from hyuav.metrics_file import MetricsPosition, undamaged_metrics
from hyuav.runs import RunDirectory


@dataclass(frozen=True)
class Reported:
    """How much of a training had been reported when a checkpoint was written."""

    metrics: MetricsPosition = dataclasses.field(default_factory=MetricsPosition)
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


def restore(run: RunDirectory, training: Training) -> Reported:
    """Put a training where its last checkpoint left it, and say what stands in the way.

    A checkpoint counts if it is whole and the metrics that it knows of are, too. If the last one
    does not, the one before does; if the metrics of both are damaged, their whole rows are kept.

    Args:
        run: of the training.
        training: made with the run's configuration.

    Returns:
        how much of it has been reported.

    Raises:
        InputError: there is no whole checkpoint of such a training.
        OSError: the run cannot be written to.
    """
    whole: list[_Found] = []
    reasons: list[str] = []
    for file in (run.last_checkpoint, run.previous_checkpoint):
        try:
            found = _read(file)
        except InputError as error:
            reasons.append(f"{file.name}: {error}")
            continue
        whole.append(found)
        if found.reported.metrics.is_in(run.metrics_file):
            return _take(found, run, training, reasons)
        reasons.append(f"{run.metrics_file}: not what it was at the time of {file.name}")
    if not whole:
        raise InputError(reasons[0])
    reasons.append(f"{run.metrics_file}: its damaged rows are lost")
    reported = _take(whole[0], run, training, reasons)
    metrics = undamaged_metrics(run.metrics_file, training.episode)
    return dataclasses.replace(reported, metrics=metrics)


class _Found(NamedTuple):
    file: Path
    state: dict[str, Any]
    reported: Reported


def _read(file: Path) -> _Found:
    content = load_checkpoint(file, "training")
    try:
        values = content["reported"]
        metrics = MetricsPosition(**values["metrics"])
        return _Found(file, content["training"], Reported(**{**values, "metrics": metrics}))
    except (KeyError, TypeError) as error:
        raise InputError(f"checkpoint: not of a training like this one ({error})") from None


def _take(found: _Found, run: RunDirectory, training: Training, reasons: list[str]) -> Reported:
    """Go on from a checkpoint; what makes it another one than the last is told."""
    training.load_state_dict(found.state)
    if found.file != run.last_checkpoint:
        found.file.replace(run.last_checkpoint)  # or the next one would replace it, not the bad one
    if reasons:
        reasons.append(f"going on after episode {training.episode}")
    for reason in reasons:
        print(harmless(reason), file=sys.stderr)
    return found.reported
