"""Doing what is left of a comparison, and telling how far it is."""

import dataclasses
import sys
from functools import partial
from pathlib import Path

from rich.console import Console

from hyuav._support.errors import Halted
from hyuav._support.terminal import make_progress
from hyuav.experiments.comparison.directory import ComparisonDirectory
from hyuav.experiments.comparison.optima import Optima
from hyuav.experiments.comparison.plan import Compare, require_libraries
from hyuav.experiments.comparison.processes import Workers
from hyuav.experiments.comparison.ray import ray_workers
from hyuav.experiments.comparison.shards import Shard
from hyuav.experiments.comparison.summary import Summary
from hyuav.experiments.evaluation import EvaluationParameters
from hyuav.experiments.tracking import LoggerParameters
from hyuav.learning.training import TrainingParameters

TRAINING = TrainingParameters(num_episodes=600, evaluation_every=5)
"""How learners that are compared are trained by default."""


def compare(
    directory: str | Path,
    options: Compare,
    training: TrainingParameters = TRAINING,
    evaluation: EvaluationParameters | None = None,
) -> Summary:
    """Compare algorithms; the same call for the same directory does what is missing.

    With several workers, call it below ``if __name__ == "__main__":``, since they import the
    program that calls.

    Args:
        directory: in which all is kept.
        options: what is compared, and by how many workers.
        training: how long and on what all learners learn.
        evaluation: how they are evaluated; None for the defaults.

    Returns:
        The tables: a row per learner, cell, algorithm.

    Raises:
        InputError: an unacceptable parameter, a library that is missing, another comparison in
            the directory, or a place that cannot be written to.
        Halted: part of the work failed; what is finished is kept.

    Example:
        >>> compare("runs/sac", Compare(algorithm=("ddpg", "sac"), learners=5)).algorithms
    """
    options = dataclasses.replace(options, output=str(directory))
    require_libraries(options)
    config = {
        **options.to_dict(),
        "training": training.to_dict(),
        "evaluation": (evaluation or EvaluationParameters()).to_dict(),
        "logger": LoggerParameters(mode="disabled").to_dict(),
    }
    comparison = ComparisonDirectory(Path(directory), config, options)
    failures = work_off(comparison, Console(quiet=True))
    summary = comparison.summary()
    if failures or summary is None:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in failures.items())
        raise Halted(f"failed: {reasons}; what is finished is kept")
    summary.save(comparison.path)
    return summary


def work_off(comparison: ComparisonDirectory, console: Console) -> dict[str, str]:
    """Find the optima that are missing, then train the shards that are not finished.

    Of both, what is there but damaged is told in one line and made anew.

    Args:
        comparison: to complete.
        console: on which a terminal shows the progress.

    Returns:
        the reason for each failure, by what failed.
    """
    failures: dict[str, str] = {}
    options = comparison.options
    begin = Workers if options.engine == "processes" else partial(ray_workers, options.address)
    unsolved = [own for own in comparison.optima.values() if not own.is_solved]
    pending = [shard for shard in comparison.shards if not shard.is_finished]
    for file in (*(own.file for own in unsolved), *(shard.path for shard in pending)):
        if file.exists():
            print(f"{file}: damaged or incomplete, and made anew", file=sys.stderr)
    progress = make_progress(console, "{task.description}")
    with progress, begin(options.workers, options.retries) as workers:
        task = progress.add_task("optima", total=len(unsolved))
        for optima, reason in workers.attempt_all(Optima.solve, unsolved):
            progress.advance(task)
            if reason is not None:
                failures[f"optima of {optima.file.stem}"] = reason
        lacking = {own.file for own in unsolved if not own.is_solved}
        solved = [shard for shard in pending if shard.optima.file not in lacking]
        finished = len(comparison.shards) - len(pending)
        task = progress.add_task("shards", total=len(comparison.shards), completed=finished)
        for shard, reason in workers.attempt_all(Shard.run, solved):
            progress.advance(task)
            if reason is not None:
                failures[shard.name] = reason
            elif not shard.is_finished:
                failures[shard.name] = "its worker wrote it where it cannot be seen from here"
    return failures
