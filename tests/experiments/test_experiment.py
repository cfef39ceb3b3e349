import dataclasses
import io
from pathlib import Path

import pandas as pd
import pytest
from rich.console import Console

from hyuav import InputError, Scenario
from hyuav.experiments.evaluation import EvaluationParameters, evaluate
from hyuav.experiments.experiment import (
    learned_policies,
    reference_policies,
    resume,
    saved_weights,
    select_initial_weights,
    train,
)
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import LoggerParameters
from hyuav.learning.ddpg import DDPG
from hyuav.learning.train import Learner
from hyuav.learning.training import Training, TrainingParameters

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=10)
CONFIGURATION = RunConfiguration(
    "two_clusters",
    SCENARIO,
    (Learner("hybrid", 3), Learner("relay", 3), Learner("jamming", 3)),
    "ddpg",
    DDPG(hidden_sizes=(16,)),
    TrainingParameters(num_episodes=4, batch_size=8, evaluation_every=2, evaluation_episodes=300),
)
OFF, SILENT = LoggerParameters(mode="disabled"), Console(file=io.StringIO())


def test_training_begins_with_the_candidates_that_earn_most_under_each_scheme() -> None:
    weights, earned = select_initial_weights(CONFIGURATION, candidates=3, episodes=2)
    alone = Training(
        SCENARIO,
        CONFIGURATION.learners,
        CONFIGURATION.algorithm,
        CONFIGURATION.training,
    )
    alone.warm_start(weights)
    assert alone.best_evaluation.tolist() == pytest.approx(earned, abs=0.3)  # other draws
    assert earned[0] >= max(earned[1:]) - 0.3  # hybrid may always do as the others do


def test_the_best_weights_are_never_worse_than_the_initial_ones(tmp_path: Path) -> None:
    weights, earned = select_initial_weights(CONFIGURATION, candidates=2, episodes=2)
    run = train(tmp_path / "run", CONFIGURATION, OFF, SILENT, initial_weights=weights)
    best = run.metrics()["best_evaluation"].dropna().tail(3)
    assert all(after >= before - 0.3 for after, before in zip(best, earned, strict=True))


def test_a_resumed_training_brings_what_an_unbroken_one_does(tmp_path: Path) -> None:
    longer = dataclasses.replace(CONFIGURATION.training, num_episodes=6)
    unbroken = dataclasses.replace(CONFIGURATION, training=longer)
    expected = train(tmp_path / "unbroken", unbroken, OFF, SILENT).metrics()
    run = train(tmp_path / "run", CONFIGURATION, OFF, SILENT)
    config = run.config_file.read_text()
    run.config_file.write_text(config.replace("num_episodes: 4", "num_episodes: 6"))
    metrics = resume(run.path, OFF, SILENT).metrics()
    pd.testing.assert_frame_equal(
        metrics.drop(columns="seconds"), expected.drop(columns="seconds"), check_exact=True
    )


def test_a_run_without_a_checkpoint_cannot_be_resumed(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path / "run", CONFIGURATION)
    with pytest.raises(InputError, match=r"checkpoint = .*: expected a checkpoint of kind"):
        resume(run.path, OFF, SILENT)


def test_a_runs_actors_become_the_papers_schemes(tmp_path: Path) -> None:
    run = train(tmp_path / "run", CONFIGURATION, OFF, SILENT)
    policies = learned_policies([run, RunDirectory(tmp_path / "run")], SCENARIO)
    assert {
        scheme: sum(each.learners for each in several) for scheme, several in policies.items()
    } == {
        "proposed": 2,
        "re_ot": 2,
        "ja_ot": 2,
    }


def test_an_actor_earns_in_the_evaluation_what_it_earned_in_training(tmp_path: Path) -> None:
    run = train(tmp_path / "run", CONFIGURATION, OFF, SILENT)
    summary = evaluate(
        SCENARIO,
        "two_clusters",
        learned_policies([run], SCENARIO),
        EvaluationParameters(episodes=2000),
    ).summary["schemes"]
    best = run.metrics().dropna(subset="best_evaluation").tail(3).set_index("scheme")
    for name, scheme in (("proposed", "hybrid"), ("re_ot", "relay"), ("ja_ot", "jamming")):
        penalty = SCENARIO.off_map_penalty * summary[name]["off_map"]
        expected = summary[name]["secrecy_sum_rate"]["mean"] - penalty
        assert best.loc[scheme, "best_evaluation"] == pytest.approx(expected, rel=0.1, abs=0.3)


def test_the_references_of_a_scenario_are_two_straight_flights_and_three_optima() -> None:
    assert set(reference_policies(SCENARIO, 5.0, SILENT)) == {
        *("re_lt", "ja_lt", "optimum", "re_optimum", "ja_optimum")
    }


def test_weights_come_from_a_checkpoint_or_from_a_run(tmp_path: Path) -> None:
    run = train(tmp_path / "run", CONFIGURATION, OFF, SILENT)
    from_run, from_file = saved_weights(run.path), saved_weights(run.best_checkpoint)
    assert from_run.keys() == from_file.keys()
    with pytest.raises(InputError, match=r"checkpoint = .*: expected a checkpoint of kind"):
        saved_weights(run.last_checkpoint)
