"""Runs for the dashboard's tests that are written at will, without training."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

from hyuav import Scenario
from hyuav.experiments.metrics import METRIC_COLUMNS
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.learning.ddpg import DDPG
from hyuav.learning.learners import Learner
from hyuav.learning.training import TrainingParameters

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=10)

WriteRun = Callable[..., Path]
"""Takes what :func:`write_run` does after the directory."""


def configuration(
    schemes: tuple[str, ...], num_episodes: int, name: str = "two_clusters"
) -> RunConfiguration:
    """Of a training so small that it takes seconds, with a learner for each scheme."""
    return RunConfiguration(
        name,
        SCENARIO,
        tuple(Learner(scheme, 0) for scheme in schemes),
        "ddpg",
        DDPG(hidden_sizes=(8,)),
        TrainingParameters(
            num_episodes=num_episodes, batch_size=8, evaluation_every=2, evaluation_episodes=3
        ),
    )


def write_run(
    directory: Path,
    name: str,
    episodes: int,
    *,
    num_episodes: int = 100,
    schemes: tuple[str, ...] = ("hybrid",),
    scenario: str = "two_clusters",
) -> Path:
    """A run's configuration and rows; it needs no checkpoint to be listed and drawn."""
    run = RunDirectory.create(directory / name, configuration(schemes, num_episodes, scenario))
    rows = [metrics_row(e, i, s) for e in range(1, episodes + 1) for i, s in enumerate(schemes)]
    run.metrics_file.write_text("\n".join([",".join(METRIC_COLUMNS), *rows, ""]))
    return run.path


def metrics_row(episode: int, learner: int = 0, scheme: str = "hybrid") -> str:
    """A line of ``metrics.csv``: each reward is a tenth of the episode's number."""
    evaluated = f"{episode / 10},{episode / 10},{episode / 10}" if episode % 2 == 0 else ",,"
    columns = [
        episode,
        10 * episode,
        learner,
        scheme,
        0,
        10,
        episode / 10,
        evaluated,
        episode / 100,
    ]
    return ",".join(str(column) for column in columns)
