"""A training that is asked to stop says how to go on, and goes on by exactly that."""

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hyuav.experiments.metrics import readable_metrics
from hyuav.experiments.run_directory import RunDirectory

RECIPES = Path(__file__).parents[2] / "recipes"

LONG = [
    "training.num_episodes=100000",
    "training.batch_size=8",
    "training.evaluation_every=50",
    "training.evaluation_episodes=3",
    "training.compile=never",
    "algorithm.hidden_sizes=[8]",
    "scenario.num_slots=5",
    "logger.mode=disabled",
    'hydra.run.dir="a, run"',
]


def stop(
    command: list[str], directory: Path, number: signal.Signals, run: str = "a, run"
) -> tuple[int, str, int]:
    """Its exit status, what it said, and which episode was the last when it was asked."""
    metrics = directory / run / "metrics.csv"
    before = readable_metrics(metrics)["episode"].max()
    running = subprocess.Popen(command, cwd=directory, stderr=subprocess.PIPE, text=True)
    while True:
        reached = readable_metrics(metrics)["episode"].max()
        if reached > (before if before == before else 0):
            break
        assert running.poll() is None
        time.sleep(0.05)
    os.kill(running.pid, number)
    _, said = running.communicate()
    return running.returncode, said, int(reached)


@pytest.mark.slow
def test_it_stops_after_the_episode_and_goes_on_by_the_command_that_it_names(
    tmp_path: Path,
) -> None:
    command = [sys.executable, str(RECIPES / "train.py"), *LONG]
    run, former = RunDirectory(tmp_path / "a, run"), 0
    for number, status in ((signal.SIGTERM, 143), (signal.SIGINT, 130)):
        code, said, reached = stop(command, tmp_path, number)
        assert code == status
        (line,) = said.splitlines()
        told, _, again = line.partition("; go on with: ")
        last = run.metrics()["episode"].max()
        assert told == f"interrupted after episode {last} of 100000"
        assert last >= reached > former
        command, former = shlex.split(again), last
        assert command[1:] == [str(RECIPES / "train.py"), 'resume="a, run"']
    assert run.metrics()["episode"].tolist() == list(range(1, former + 1))


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_a_comparison_too_goes_on_by_the_command_that_it_names(
    tmp_path: Path, workers: int
) -> None:
    options = [each for each in LONG if each.startswith("training")]
    asked = [
        *("algorithm=ddpg", "scenario=two_clusters", "scheme=relay", "num_slots=[5,6]"),
        *("learners=1", "evaluation.episodes=4", "evaluation.resolution=10", f"workers={workers}"),
        *options,
    ]
    command = [sys.executable, str(RECIPES / "compare.py"), *asked, 'output="it"']
    run = "it/shards/ddpg_two_clusters_T5.partial"
    for number, status in ((signal.SIGTERM, 143), (signal.SIGINT, 130)):
        code, said, _ = stop(command, tmp_path, number, run)
        assert code == status
        line = said.splitlines()[-1]
        assert line.startswith("interrupted")
        command = shlex.split(line.partition("; go on with: ")[2])
        assert command[1:] == [str(RECIPES / "compare.py"), *asked, 'output="it"']
    episodes = RunDirectory(tmp_path / run).metrics()["episode"]
    assert episodes.tolist() == list(range(1, len(episodes) + 1))  # not begun again
