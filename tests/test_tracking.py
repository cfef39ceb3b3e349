import io
from pathlib import Path

import pytest
import torch
from rich.console import Console

from hyuav import InputError, Scenario
from hyuav.learning.algorithms import DDPG
from hyuav.learning.checkpoint import load_checkpoint
from hyuav.learning.cohort import Learner
from hyuav.learning.training import Training, TrainingParameters
from hyuav.runs import RunConfiguration, RunDirectory
from hyuav.tracking import LoggerParameters, Tracker, learner_names
from offline_wandb import logged_history

CONFIGURATION = RunConfiguration(
    "two_clusters",
    Scenario.preset("two_clusters"),
    (Learner("hybrid"), Learner("relay")),
    "ddpg",
    DDPG(hidden_sizes=(8,)),
    TrainingParameters(num_episodes=5, batch_size=8, evaluation_every=2, evaluation_episodes=3),
)


def track(directory: Path, mode: str, console: Console | None = None) -> Training:
    training = Training(
        CONFIGURATION.scenario,
        CONFIGURATION.learners,
        CONFIGURATION.algorithm,
        CONFIGURATION.training,
    )
    run = RunDirectory.create(directory, CONFIGURATION)
    logger, console = LoggerParameters(mode=mode), console or Console(file=io.StringIO())
    with Tracker(run, CONFIGURATION, training, logger, console) as tracker:
        for episode in training.episodes():
            tracker.log(episode)
    return training


def test_metrics_are_kept_as_columns_a_row_per_episode_and_learner(tmp_path: Path) -> None:
    training = track(tmp_path, "disabled")
    metrics = RunDirectory(tmp_path).metrics()
    assert metrics[["episode", "learner", "scheme"]].to_numpy().tolist() == [
        [episode, learner, scheme]
        for episode in range(1, 6)
        for learner, scheme in enumerate(("hybrid", "relay"))
    ]
    assert metrics["slots"].max() == 100
    assert set(metrics["num_slots"]) == {20}
    assert metrics["accumulated_reward"].notna().all()
    evaluated = metrics[metrics["evaluation"].notna()]
    assert evaluated["episode"].unique().tolist() == [2, 4, 5]
    assert evaluated["best_evaluation"].tail(2).tolist() == pytest.approx(
        training.best_evaluation.tolist()
    )
    assert metrics["loss_critic"].tail(2).notna().all()


def test_checkpoints_are_written(tmp_path: Path) -> None:
    training = track(tmp_path, "disabled")
    run = RunDirectory(tmp_path)
    state = load_checkpoint(run.last_checkpoint, "training")
    assert [cohort["episode"] for cohort in state["cohorts"]] == [5] * len(training.cohorts)
    best = run.best_weights()
    assert all(torch.equal(best[name], training.best_weights[name]) for name in best)


def test_the_same_metrics_reach_weights_and_biases_offline(tmp_path: Path) -> None:
    track(tmp_path, "offline")
    history = [row for row in logged_history(tmp_path) if "hybrid/accumulated_reward" in row]
    metrics = RunDirectory(tmp_path).metrics()
    for scheme in ("hybrid", "relay"):
        for column in ("accumulated_reward", "evaluation", "loss_critic"):
            logged = [row[f"{scheme}/{column}"] for row in history if f"{scheme}/{column}" in row]
            kept = metrics.loc[metrics["scheme"] == scheme, column].dropna()
            assert logged == pytest.approx(kept.tolist())


def test_nothing_is_logged_where_it_is_disabled(tmp_path: Path) -> None:
    track(tmp_path, "disabled")
    assert not (tmp_path / "wandb").exists()


def test_progress_is_quiet_when_piped_and_shows_the_return_on_a_terminal(tmp_path: Path) -> None:
    piped, terminal = io.StringIO(), io.StringIO()
    track(tmp_path / "piped", "disabled", Console(file=piped))
    track(tmp_path / "shown", "disabled", Console(file=terminal, force_terminal=True, width=120))
    assert piped.getvalue() == ""
    assert "5/5" in terminal.getvalue()
    assert "bps/Hz" in terminal.getvalue()


def test_learners_are_named_by_what_tells_them_apart() -> None:
    schemes = [Learner("hybrid"), Learner("relay")]
    seeds = [Learner("hybrid", 3), Learner("hybrid", 4)]
    horizons = [Learner("relay", 3, 10), Learner("relay", 4)]
    assert learner_names(schemes, [20, 20]) == ["hybrid", "relay"]
    assert learner_names(seeds, [20, 20]) == ["hybrid_seed3", "hybrid_seed4"]
    assert learner_names(horizons, [10, 20]) == ["relay_T10_seed3", "relay_T20_seed4"]


def test_an_unknown_logger_mode_is_refused() -> None:
    with pytest.raises(InputError, match="mode = 'on': expected one of offline, online, disabled"):
        LoggerParameters(mode="on")
