"""Trainings that are killed at random moments and resumed end as one that was not."""

import json
import random
import statistics
import time
from collections import Counter
from collections.abc import Mapping
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import pytest

from hyuav import RobustDDPG, Scenario
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking.checkpoints import Reported, save_checkpoints
from hyuav.learning.checkpoint import load_checkpoint
from hyuav.learning.ddpg import DDPG
from hyuav.learning.learners import Learner
from hyuav.learning.training import Training, TrainingParameters
from killed_training import differences, outcome, process, small

MEASURED = Path("runs/reliability")
"""Where the figures of docs/reliability.md are written."""


def begun(directory: Path, configuration: RunConfiguration) -> BaseProcess:
    """A training that has its run directory by now, whose life begins."""
    running = process(directory, configuration)
    running.start()
    while running.is_alive() and not RunDirectory(directory).exists:
        time.sleep(0.001)
    return running


def run_to_the_end(directory: Path, configuration: RunConfiguration) -> float:
    """Seconds that it took from the run directory on."""
    running = begun(directory, configuration)
    started = time.monotonic()
    running.join()
    assert running.exitcode == 0
    return time.monotonic() - started


def kill_after(seconds: float, directory: Path, configuration: RunConfiguration) -> bool:
    """Whether it was still alive to be killed."""
    running = begun(directory, configuration)
    running.join(seconds)
    running.kill()
    running.join()
    return running.exitcode != 0


def killed_after(seconds: float, directory: Path, configuration: RunConfiguration) -> Path:
    """The directory of one that was killed then, or earlier where it had ended by then."""
    while not kill_after(seconds, directory, configuration):
        seconds, directory = 0.6 * seconds, directory.with_name(f"{directory.name}-again")
    return directory


def write_figures(name: str, figures: Mapping[str, Any]) -> None:
    """Keep what docs/reliability.md tells."""
    MEASURED.mkdir(parents=True, exist_ok=True)
    (MEASURED / f"{name}.json").write_text(f"{json.dumps(figures, indent=2)}\n")


def stage(directory: Path) -> str:
    """What was found after a kill."""
    run = RunDirectory(directory)
    if not run.last_checkpoint.exists():
        return "between two checkpoints' names"
    (first, *_) = load_checkpoint(run.last_checkpoint, "training")["training"]["cohorts"]
    episodes = run.configuration().training.num_episodes
    if first["episode"] == 0:
        return "before the first later checkpoint"
    algorithm = run.configuration().algorithm
    assert isinstance(algorithm, RobustDDPG)
    assert algorithm.guide is not None
    if first["episode"] <= algorithm.guide.warm_up_episodes:
        return "in the warm-up"
    return "after the last episode" if first["episode"] == episodes else "later"


@pytest.mark.slow
@pytest.mark.parametrize(("compiled", "kills"), [("never", 50), ("always", 12)])
def test_a_killed_training_ends_with_the_numbers_of_an_unbroken_one(
    compiled: str, kills: int, tmp_path: Path
) -> None:
    configuration = small(compiled)
    run_to_the_end(tmp_path / "warm", configuration)  # what is compiled is kept on the disk
    lifetime = run_to_the_end(tmp_path / "unbroken", configuration)
    expected = outcome(tmp_path / "unbroken")
    luck, stages, torn = random.Random(0), Counter[str](), 0
    for number in range(kills):
        moment = (number + luck.random()) / kills * lifetime
        directory = killed_after(moment, tmp_path / f"killed-{number}", configuration)
        stages[stage(directory)] += 1
        torn += any(directory.rglob("*.partial"))
        run_to_the_end(directory, configuration)
        assert differences(outcome(directory), expected) == []
    figures = {
        "kills": kills,
        "seconds of life": round(lifetime, 2),
        "ended as the unbroken training": kills,
        "while a file was being written": torn,
        "numbers and rows compared each time": len(expected),
        "stages": dict(stages),
    }
    write_figures(f"kills_compile_{compiled}", figures)


@pytest.mark.slow
def test_a_training_that_is_killed_while_it_is_loading_ends_so_too(tmp_path: Path) -> None:
    configuration = small("never")
    run_to_the_end(tmp_path / "unbroken", configuration)
    expected, kills = outcome(tmp_path / "unbroken"), 10
    for number in range(kills):
        directory = tmp_path / f"killed-{number}"
        running = process(directory, configuration)
        running.start()
        running.join(0.1 * number)
        running.kill()
        running.join()
        run_to_the_end(directory, configuration)
        assert differences(outcome(directory), expected) == []
    write_figures("kills_while_loading", {"kills": kills, "numbers compared": len(expected)})


@pytest.mark.slow
def test_a_training_that_is_killed_again_and_again_ends_so_too(tmp_path: Path) -> None:
    configuration, started = small("never"), time.monotonic()
    lifetime = run_to_the_end(tmp_path / "unbroken", configuration)
    whole = time.monotonic() - started  # with the loading, with which those begin that go on
    directory = killed_after(0.5 * lifetime, tmp_path / "killed", configuration)
    luck, killed = random.Random(1), 1
    while kill_after(luck.uniform(0.5, 0.9) * whole, directory, configuration):
        killed += 1
    assert differences(outcome(directory), outcome(tmp_path / "unbroken")) == []
    write_figures("kills_one_after_another", {"kills": killed})


@pytest.mark.slow
def test_a_checkpoint_takes_some_megabytes_for_each_learner(tmp_path: Path) -> None:
    """At the paper's sizes; how long it takes is written down, too."""
    learners = 10
    training = Training(
        Scenario.preset("two_clusters"),
        [Learner(seed=seed) for seed in range(learners)],
        DDPG(),
        TrainingParameters(num_episodes=1, batch_size=8, evaluation_episodes=1, compile="never"),
    )
    list(training.episodes())
    run, seconds = RunDirectory(tmp_path), []
    for _ in range(9):
        started = time.perf_counter()
        save_checkpoints(run, training, Reported())
        seconds.append(time.perf_counter() - started)
    megabytes = {
        file.name: round(file.stat().st_size / 1e6, 1)
        for file in (run.last_checkpoint, run.best_checkpoint)
    }
    write_figures(
        "checkpoint",
        {"learners": learners, "megabytes": megabytes, "seconds": statistics.median(seconds)},
    )
    assert megabytes["last.pt"] < 6 * learners
