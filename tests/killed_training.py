"""A small training in a process of its own, which can be killed, and what came of it."""

import dataclasses
import io
import multiprocessing
from collections.abc import Iterator
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import torch
from rich.console import Console

from hyuav import Scenario
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import LoggerParameters
from hyuav.experiments.train import resume, train
from hyuav.learning.checkpoint import load_checkpoint
from hyuav.learning.guide.parameters import Guide
from hyuav.learning.guide.robust import RobustDDPG
from hyuav.learning.learners import Learner
from hyuav.learning.training import Training, TrainingParameters

OFF = LoggerParameters(mode="disabled")

PROCESSES = multiprocessing.get_context("forkserver")
PROCESSES.set_forkserver_preload(["killed_training"])


def small(compile_slots: str, num_episodes: int = 12) -> RunConfiguration:
    """With a warm-up, two horizons on two threads, repeated flights and checkpoints."""
    return RunConfiguration(
        "two_clusters",
        dataclasses.replace(Scenario.preset("two_clusters"), num_slots=6),
        (Learner("hybrid", 3), Learner("relay", 3, 8), Learner("jamming", 4)),
        "ddpg_robust",
        RobustDDPG(hidden_sizes=(16,), guide=Guide(warm_up_episodes=3), actor_learning_rate=3e-3),
        TrainingParameters(
            num_episodes=num_episodes,
            replay_size=40,
            batch_size=16,
            evaluation_every=3,
            evaluation_episodes=3,
            compile=compile_slots,
            cohorts=2,
            checkpoint_every=0.1,
        ),
    )


def begin_or_resume(directory: Path, configuration: RunConfiguration) -> None:
    """What a user does after a kill: resume the run, or begin it anew where there is none."""
    torch.set_num_threads(1)
    console = Console(file=io.StringIO())
    if RunDirectory(directory).exists:
        resume(directory, OFF, console)
    else:
        weights = Training(
            configuration.scenario,
            [Learner(seed=8)],
            configuration.algorithm,
            configuration.training,
        ).best_weights
        train(directory, configuration, OFF, console, initial_weights=weights)


def process(directory: Path, configuration: RunConfiguration) -> BaseProcess:
    """One that does this."""
    return PROCESSES.Process(target=begin_or_resume, args=(directory, configuration))


def outcome(directory: Path) -> dict[str, Any]:
    """All numbers that a training ends with, by name; of metrics the text without the time."""
    run = RunDirectory(directory)
    state = load_checkpoint(run.last_checkpoint, "training")["training"]
    metrics = run.metrics_file.read_text().splitlines()
    seconds = metrics[0].split(",").index("seconds")
    rows = [line.split(",") for line in metrics]
    return {
        **dict(_leaves("last", state)),
        **dict(_leaves("best", run.best_weights())),
        **{f"metrics/{i}": (*row[:seconds], *row[seconds + 1 :]) for i, row in enumerate(rows)},
    }


def _leaves(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, own in value.items():
            yield from _leaves(f"{name}/{key}", own)
    elif isinstance(value, list | tuple):
        for index, own in enumerate(value):
            yield from _leaves(f"{name}/{index}", own)
    else:
        yield name, value


def differences(one: dict[str, Any], other: dict[str, Any]) -> list[str]:
    """Names of what is not equal, bit for bit."""
    return [name for name in one.keys() | other.keys() if not _equal(one, other, name)]


def _equal(one: dict[str, Any], other: dict[str, Any], name: str) -> bool:
    if name not in one or name not in other:
        return False
    if isinstance(one[name], torch.Tensor):
        same = one[name].reshape(-1).view(torch.uint8), other[name].reshape(-1).view(torch.uint8)
        return torch.equal(*same)
    return bool(one[name] == other[name])
