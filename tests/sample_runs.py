"""A small run, trained and evaluated once for all tests that look at it."""

import dataclasses
import io
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console

from hyuav import Scenario
from hyuav.experiments.evaluation import EvaluationParameters, evaluate
from hyuav.experiments.policies import learned_policies, references
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import LoggerParameters
from hyuav.experiments.train import train
from hyuav.learning.ddpg import DDPG
from hyuav.learning.learners import Learner
from hyuav.learning.training import TrainingParameters

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=12)
SILENT, UNLOGGED = Console(file=io.StringIO()), LoggerParameters(mode="disabled")

ONE_OF_EACH = RunConfiguration(
    "two_clusters",
    dataclasses.replace(SCENARIO, num_slots=10),
    (Learner("hybrid", 3), Learner("relay", 3), Learner("jamming", 3)),
    "ddpg",
    DDPG(hidden_sizes=(16,)),
    TrainingParameters(num_episodes=4, batch_size=8, evaluation_every=2, evaluation_episodes=300),
)
"""A learner for each mode rule."""


@pytest.fixture(scope="session")
def trained(tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    """A training that nobody has evaluated."""
    configuration = RunConfiguration(
        "two_clusters",
        SCENARIO,
        (Learner("hybrid", 3), Learner("hybrid", 4), Learner("relay", 3)),
        "ddpg",
        DDPG(hidden_sizes=(16,)),
        TrainingParameters(
            num_episodes=4,
            batch_size=8,
            evaluation_every=2,
            evaluation_episodes=3,
            compile="never",
        ),
    )
    directory = tmp_path_factory.mktemp("trained") / "small run"
    return train(directory, configuration, UNLOGGED, SILENT)


@pytest.fixture(scope="session")
def evaluated(trained: RunDirectory, tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    """The same, evaluated beside the references."""
    directory = tmp_path_factory.mktemp("evaluated") / "run"
    shutil.copytree(trained.path, directory)
    beside = references(SCENARIO, 10.0, SILENT)
    policies = learned_policies([trained], SCENARIO) | beside
    parameters = EvaluationParameters(episodes=4, flights=2)
    evaluate(SCENARIO, "two_clusters", policies, parameters).save(directory)
    return RunDirectory(directory)


@pytest.fixture
def copied(tmp_path: Path) -> Callable[[RunDirectory], RunDirectory]:
    """A copy of a run, to be damaged."""

    def copy(run: RunDirectory) -> RunDirectory:
        return RunDirectory(shutil.copytree(run.path, tmp_path / "run"))

    return copy
