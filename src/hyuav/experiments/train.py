"""Training into a run directory, and going on with what was interrupted."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from torch import Tensor

from hyuav._support.errors import Halted, InputError, cause, rejection
from hyuav._support.interruption import Interruption
from hyuav._support.terminal import print_line
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import LoggerParameters, Tracker
from hyuav.experiments.tracking.checkpoints import Reported, first_checkpoint, restore
from hyuav.learning.training import Training


def train(
    directory: str | Path,
    configuration: RunConfiguration,
    logger: LoggerParameters,
    console: Console,
    *,
    device: str | None = None,
    initial_weights: dict[str, Tensor] | None = None,
    request: Mapping[str, Any] | None = None,
    logs: Path | None = None,
) -> RunDirectory:
    """Train as configured, reporting to a new run directory.

    Args:
        directory: of the run.
        configuration: of the training.
        logger: where the metrics go besides.
        console: to show progress on.
        device: to train on.
        initial_weights: to begin with, instead of fresh ones.
        request: all that was asked for, to be kept with the run.
        logs: directory for the logger's files; the run's where it is None.

    Raises:
        InputError: the directory is taken, or the checkpoint does not fit.
        Interrupted: a signal asked to stop; :func:`resume` goes on.
        Halted: the training cannot go on.
    """
    training = configuration.new_training(device)
    if initial_weights is not None:
        training.warm_start(initial_weights)
    run = RunDirectory(directory)
    with run.reserved():
        RunDirectory.create(directory, configuration, request, first_checkpoint(training))
        _train(run, configuration, training, logger, console, logs)
    return run


def resume(
    directory: str | Path,
    logger: LoggerParameters,
    console: Console,
    *,
    device: str | None = None,
    logs: Path | None = None,
    num_episodes: int | None = None,
) -> RunDirectory:
    """Go on with a training from its last checkpoint, in its directory and its W&B run.

    What comes of it is what would have come of the training without a break.

    Args:
        directory: of the run.
        logger: where the metrics go besides.
        console: to show progress on.
        device: to train on.
        logs: directory for the logger's files; the run's where it is None.
        num_episodes: after which it ends, from now on; as configured where it is None.

    Raises:
        InputError: there is no such run, or no checkpoint of it, or it cannot be written to, or
            more episodes are trained already.
        Interrupted: a signal asked to stop.
        Halted: the training cannot go on.
    """
    run = RunDirectory(directory)
    configuration = run.configuration()
    if num_episodes is not None:
        configuration = configuration.with_episodes(num_episodes)
    with run.reserved():
        try:
            training, reported = restore(run, lambda: configuration.new_training(device))
            if num_episodes is not None:
                _require_none_trained_beyond(num_episodes, training)
                run.change(configuration)
        except OSError as error:
            raise Halted(f"nothing is done: {cause(error)}") from error
        rest = f"goes on after episode {training.episode} of {training.parameters.num_episodes}"
        told = "is finished" if training.is_finished else rest
        print_line(f"{run.path}: this training {told}", console)
        _train(run, configuration, training, logger, console, logs, reported)
    return run


def _require_none_trained_beyond(num_episodes: int, training: Training) -> None:
    if training.episode > num_episodes:
        accepted = f"at least the {training.episode} episodes that are trained already"
        raise InputError(rejection("num_episodes", num_episodes, accepted))


def _train(
    run: RunDirectory,
    configuration: RunConfiguration,
    training: Training,
    logger: LoggerParameters,
    console: Console,
    logs: Path | None,
    reported: Reported | None = None,
) -> None:
    """Train to the end, or stop after an episode where that is asked for."""
    episodes = training.parameters.num_episodes
    with Interruption() as interruption:
        try:
            with Tracker(run, configuration, training, logger, console, logs, reported) as tracker:
                if training.is_finished:
                    tracker.save()  # the best weights may be damaged
                for episode in training.episodes():
                    tracker.log(episode)
                    if interruption.requested:
                        tracker.save()
                        break
                interruption.raise_if_requested(
                    f"interrupted after episode {training.episode} of {episodes}"
                )
        except OSError as error:
            line = f"halted after episode {training.episode} of {episodes}: {cause(error)}"
            raise Halted(f"{line}; the last checkpoint is kept") from error
        interruption.raise_if_requested("interrupted after the last episode")
    if all(training.stopped):
        line = f"halted after episode {training.episode} of {episodes}: every learner has stopped"
        raise Halted(line, resumable=False)


def train_or_resume(
    directory: str | Path,
    configuration: RunConfiguration,
    logger: LoggerParameters,
    console: Console,
    *,
    device: str | None = None,
    initial_weights: Callable[[], dict[str, Tensor] | None] = lambda: None,
    request: Mapping[str, Any] | None = None,
) -> RunDirectory:
    """Train as configured, or go on with that training where it has begun in the directory.

    It is that training if it was configured in the same way and began with the same weights.

    Args:
        directory: of the run.
        configuration: of the training.
        logger: where the metrics go besides.
        console: to show progress on.
        device: to train on.
        initial_weights: finds what a new training begins with; None for fresh weights.
        request: all that was asked for, to be kept with a new run. Its ``warm_start`` names what
            the training begins with.

    Raises:
        InputError: another training is there, or as :func:`train` and :func:`resume`.
        Interrupted: a signal asked to stop.
        Halted: the training cannot go on.
    """
    run = RunDirectory(directory)
    if run.exists and _is_of(run, configuration, request or {}):
        return resume(directory, logger, console, device=device)
    return train(
        directory,
        configuration,
        logger,
        console,
        device=device,
        initial_weights=None if run.exists else initial_weights(),
        request=request,
    )


def _is_of(run: RunDirectory, configuration: RunConfiguration, request: Mapping[str, Any]) -> bool:
    """Whether that training was begun in a run's directory."""
    try:
        same_start = run.request().get("warm_start") == request.get("warm_start")
        return same_start and run.configuration() == configuration
    except InputError:  # of a comparison, perhaps
        return False
