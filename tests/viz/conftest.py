"""Directories of runs: one that was trained, and any that are written at will."""

import dataclasses
import shutil
from functools import partial
from pathlib import Path

import pandas as pd
import pytest
import torch
from rich.console import Console

from dashboard_runs import SCENARIO, WriteRun, configuration, write_run
from hyuav import Scenario
from hyuav.experiments.evaluation import Evaluation, EvaluationParameters, evaluate
from hyuav.experiments.policies import learned_policies, references
from hyuav.experiments.tracking import LoggerParameters
from hyuav.experiments.train import train
from hyuav.references.flight import FlightPolicy


@pytest.fixture(scope="session")
def relaying_and_jamming() -> tuple[Scenario, Evaluation]:
    """Two helpers that hover, of which the first jams and UEs 3, 4, 6 and 7 use the second.

    Two eavesdroppers at one place are as one.
    """
    places = ((93.0, 42.0), (-57.0, 9.0))
    scenario = dataclasses.replace(
        Scenario.preset("two_clusters"),
        helper_starts=places,
        eavesdropper_positions=((80.0, 80.0), (80.0, 80.0)),
        num_slots=3,
        fading=False,
    )
    policy = FlightPolicy(torch.tensor(places).expand(4, 2, 2), scenario)
    parameters = EvaluationParameters(episodes=2, flights=1)
    flown = {"proposed": policy, "optimum": policy, "ja_lt": policy}
    return scenario, evaluate(scenario, "two", flown, parameters)


@pytest.fixture
def with_power(relaying_and_jamming: tuple[Scenario, Evaluation]) -> pd.DataFrame:
    """Their flights, in which Proposed flies with -10, -20 and -30 dB, and with -1, -2 and -3."""
    flights = relaying_and_jamming[1].flights.copy()
    own = flights["scheme"] == "proposed"
    for number, step in ((1, -10.0), (2, -1.0)):
        flights[f"power_level_{number}"] = (step * flights["slot"]).where(own)
    return flights


@pytest.fixture(scope="session")
def trained_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with one run, ``tiny``: trained for four episodes and evaluated."""
    root, quiet = tmp_path_factory.mktemp("trained"), Console(quiet=True)
    asked = configuration(("hybrid", "relay"), 4)
    run = train(root / "tiny", asked, LoggerParameters(mode="disabled"), quiet)
    policies = {
        **learned_policies([run], SCENARIO),
        **references(SCENARIO, 5.0, quiet),
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
