"""Directories of runs: one that was trained, and any that are written at will."""

import shutil
from functools import partial
from pathlib import Path

import pytest
from rich.console import Console

from dashboard_runs import SCENARIO, WriteRun, configuration, write_run
from hyuav.experiments.evaluation import EvaluationParameters, evaluate
from hyuav.experiments.policies import learned_policies, references
from hyuav.experiments.tracking import LoggerParameters
from hyuav.experiments.train import train


@pytest.fixture(scope="session")
def trained_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with one run, ``tiny``: trained for four episodes and evaluated."""
    root, quiet = tmp_path_factory.mktemp("trained"), Console(quiet=True)
    asked = configuration(("hybrid", "relay"), 4)
    run = train(root / "tiny", asked, LoggerParameters(mode="disabled"), quiet)
    policies = {
        **learned_policies([run], SCENARIO),
        **references(SCENARIO, 5.0, quiet).policies,
    }
    parameters = EvaluationParameters(episodes=4, flights=2)
    evaluate(SCENARIO, "two_clusters", policies, parameters).save(run.path)
    return root


@pytest.fixture
def runs(trained_runs: Path, tmp_path: Path) -> Path:
    """The same in a directory of the test's own."""
    return Path(shutil.copytree(trained_runs, tmp_path / "runs"))


@pytest.fixture
def write(tmp_path: Path) -> WriteRun:
    """Write runs below ``runs`` in the test's directory."""
    return partial(write_run, tmp_path / "runs")
