import csv
import dataclasses
import io
import json
import os
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import pytest
import torch
from rich.console import Console

from hyuav import Scenario
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import LoggerParameters, Tracker, learner_names
from hyuav.experiments.tracking.checkpoints import restore
from hyuav.experiments.tracking.memory import remembered
from hyuav.learning.checkpoint import load_checkpoint
from hyuav.learning.ddpg import DDPG
from hyuav.learning.learners import Learner
from hyuav.learning.training import Training, TrainingParameters
from offline_wandb import (
    history,
    logged_history,
    offline_runs,
    recorded,
    records_of,
    summary,
)

CONFIGURATION = RunConfiguration(
    "two_clusters",
    Scenario.preset("two_clusters"),
    (Learner("hybrid"), Learner("relay")),
    "ddpg",
    DDPG(hidden_sizes=(8,)),
    TrainingParameters(num_episodes=5, batch_size=8, evaluation_every=2, evaluation_episodes=3),
)


def silent() -> Console:
    return Console(file=io.StringIO())


def track(
    directory: Path,
    mode: str,
    console: Console | None = None,
    learners: Sequence[Learner] = CONFIGURATION.learners,
) -> Training:
    training = Training(
        CONFIGURATION.scenario, learners, CONFIGURATION.algorithm, CONFIGURATION.training
    )
    run = RunDirectory.create(directory, CONFIGURATION)
    logger = LoggerParameters(mode=mode)
    with Tracker(run, CONFIGURATION, training, logger, console or silent()) as tracker:
        for episode in training.episodes():
            tracker.log(episode)
    return training


@pytest.fixture(scope="module")
def disabled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Training]:
    """What nobody changes."""
    directory = tmp_path_factory.mktemp("disabled")
    return directory, track(directory, "disabled")


@pytest.fixture(scope="module")
def offline(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Training]:
    """What nobody changes."""
    directory = tmp_path_factory.mktemp("offline")
    return directory, track(directory, "offline")


def test_metrics_are_kept_as_columns_a_row_per_episode_and_learner(
    disabled: tuple[Path, Training],
) -> None:
    directory, training = disabled
    metrics = RunDirectory(directory).metrics()
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


def test_checkpoints_are_written(disabled: tuple[Path, Training]) -> None:
    directory, training = disabled
    run = RunDirectory(directory)
    state = load_checkpoint(run.last_checkpoint, "training")["training"]
    assert [cohort["episode"] for cohort in state["cohorts"]] == [5] * len(training.cohorts)
    best = run.best_weights()
    assert all(torch.equal(best[name], training.best_weights[name]) for name in best)


def test_a_run_that_is_still_being_written_is_read_as_far_as_it_goes(
    offline: tuple[Path, Training],
) -> None:
    (file,) = offline_runs(offline[0])
    content = file.read_bytes()
    whole = list(records_of(content))
    for length in range(0, len(content), 37):
        part = list(records_of(content[:length]))
        assert part == whole[: len(part)]
        assert len(part) < len(whole)


def test_the_same_metrics_reach_weights_and_biases_offline(offline: tuple[Path, Training]) -> None:
    directory, _ = offline
    history = [row for row in logged_history(directory) if "hybrid/accumulated_reward" in row]
    metrics = RunDirectory(directory).metrics()
    for scheme in ("hybrid", "relay"):
        for column in ("accumulated_reward", "evaluation", "loss_critic"):
            logged = [row[f"{scheme}/{column}"] for row in history if f"{scheme}/{column}" in row]
            kept = metrics.loc[metrics["scheme"] == scheme, column].dropna()
            assert logged == pytest.approx(kept.tolist())


def test_nothing_is_logged_where_it_is_disabled(disabled: tuple[Path, Training]) -> None:
    assert not (disabled[0] / "wandb").exists()


def test_rewards_have_episodes_as_their_axis_and_losses_slots(
    offline: tuple[Path, Training],
) -> None:
    (file,) = offline_runs(offline[0])
    axes = {metric.name: metric.step_metric for metric in recorded(file, "metric")}
    assert axes["hybrid/evaluation"] == axes["relay/accumulated_reward"] == "episode"
    assert axes["hybrid/loss_critic"] == axes["relay/loss_actor"] == "slots"
    logged = history(file)
    assert [row["episode"] for row in logged] == [1, 2, 3, 4, 5]
    assert [row["slots"] for row in logged] == [20, 40, 60, 80, 100]


def test_learners_of_different_horizons_count_their_own_slots(tmp_path: Path) -> None:
    learners = (Learner("hybrid", 0, 4), Learner("hybrid", 0, 6))
    track(tmp_path, "offline", learners=learners)
    (file,) = offline_runs(tmp_path)
    axes = {metric.name: metric.step_metric for metric in recorded(file, "metric")}
    assert axes["hybrid_T4/loss_critic"] == "hybrid_T4/slots"
    assert [row["hybrid_T6/slots"] for row in history(file)] == [6, 12, 18, 24, 30]


def test_the_summary_keeps_what_a_metric_is_judged_by(offline: tuple[Path, Training]) -> None:
    directory, training = offline
    (file,) = offline_runs(directory)
    kept, metrics = summary(file), RunDirectory(directory).metrics()
    own = metrics[metrics["scheme"] == "hybrid"]
    assert kept["hybrid/evaluation"]["max"] == pytest.approx(own["evaluation"].max())
    assert kept["hybrid/loss_critic"]["min"] == pytest.approx(own["loss_critic"].min())
    assert kept["hybrid/loss_critic"]["last"] == pytest.approx(own["loss_critic"].iloc[-1])
    mean = training.best_evaluation.mean().item()
    assert kept["best_evaluation"] == pytest.approx(mean, rel=1e-5)  # which sweeps go by


def test_checkpoints_are_versions_of_one_artifact_that_can_be_uploaded(
    offline: tuple[Path, Training],
) -> None:
    directory, _ = offline
    (file,) = offline_runs(directory)
    (run,) = recorded(file, "run")
    last, best = recorded(file, "artifact")
    for artifact, alias in ((last, "last"), (best, "best")):
        assert artifact.name == f"model-{run.run_id}"
        assert artifact.type == "model"
        assert set(artifact.aliases) == {alias, "latest"}
        assert json.loads(artifact.metadata)["episodes"] == 5
        (entry,) = artifact.manifest.contents
        assert Path(entry.local_path).read_bytes() == (
            (directory / "checkpoints" / f"{alias}.pt").read_bytes()
        )


def test_a_training_that_goes_on_continues_the_same_run(tmp_path: Path) -> None:
    training = track(tmp_path, "offline")
    run = RunDirectory(tmp_path)
    begun = run.metrics()
    with run.metrics_file.open("a", newline="") as file:  # logged after the last checkpoint
        csv.writer(file).writerow([6, 120, 0, "hybrid", 0, 20, 1.0])
    longer = dataclasses.replace(CONFIGURATION.training, num_episodes=8)
    again, reported = restore(
        run,
        lambda: Training(
            CONFIGURATION.scenario, training.learners, CONFIGURATION.algorithm, longer
        ),
    )
    assert reported.wandb_id == remembered(run.path)["id"]
    (run.path / "wandb.json").unlink()  # it is in the checkpoint, too
    with Tracker(
        run, CONFIGURATION, again, LoggerParameters(), silent(), reported=reported
    ) as tracker:
        for episode in again.episodes():
            tracker.log(episode)
    metrics = run.metrics()
    assert metrics["episode"].tolist() == [number for number in range(1, 9) for _ in range(2)]
    pd.testing.assert_frame_equal(metrics.head(10), begun)
    assert metrics["seconds"].is_monotonic_increasing
    first, second = offline_runs(tmp_path)
    ids = {recorded(file, "run")[0].run_id for file in (first, second)}
    assert len(ids) == 1
    assert [row["episode"] for row in history(second)] == [6, 7, 8]
    assert [row["_step"] for row in history(second)] == [6, 7, 8]


def test_training_goes_on_where_weights_and_biases_dies(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    training = Training(
        CONFIGURATION.scenario,
        CONFIGURATION.learners,
        CONFIGURATION.algorithm,
        CONFIGURATION.training,
    )
    run = RunDirectory.create(tmp_path, CONFIGURATION)
    with Tracker(run, CONFIGURATION, training, LoggerParameters(), silent()) as tracker:
        for episode in training.episodes():
            if episode.number == 3:
                end_service()
            tracker.log(episode)
    assert run.metrics()["episode"].max() == 5
    assert run.best_weights()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("W&B: nothing more is logged (")


def end_service() -> None:
    """Kill the process of Weights & Biases that belongs to this one."""
    listed = subprocess.run(
        ["pgrep", "-P", str(os.getpid()), "wandb-core"], capture_output=True, text=True, check=True
    )
    for process in map(int, listed.stdout.split()):
        os.kill(process, signal.SIGKILL)


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
