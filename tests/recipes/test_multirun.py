"""Multiruns of a recipe: on this machine, and by submitit."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import psutil
import pytest

from hyuav.experiments.metrics import readable_metrics
from hyuav.experiments.run_directory import RunDirectory
from recipe_calls import TINY, Call

RECIPES = Path(__file__).parents[2] / "recipes"

SHORT = [*TINY, "training.compile=never", "scenario.num_slots=6"]
NAMES = [
    "0_two_clusters_ddpg_0",
    "1_two_clusters_td3_0",
    "2_two_clusters_ddpg_1",
    "3_two_clusters_td3_1",
]


def runs(directory: Path) -> list[Path]:
    (sweep,) = (directory / "runs").iterdir()
    assert sweep.name.endswith("_sweep")
    return sorted(path.parent for path in sweep.glob("*/config.yaml"))


def test_a_multirun_keeps_a_run_for_every_job(call: Call, tmp_path: Path) -> None:
    call("train", "-m", "seed=0,1", "algorithm=ddpg,td3", *SHORT)
    found = runs(tmp_path)
    assert [run.name for run in found] == NAMES
    configurations = [RunDirectory(run).configuration() for run in found]
    assert [own.algorithm_name for own in configurations] == ["ddpg", "td3"] * 2
    assert [own.learners[0].seed for own in configurations] == [0, 0, 1, 1]


def test_a_job_with_a_mistake_is_named_and_stops_no_other(
    call: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        call("train", "-m", "scheme=both,hybrid", *SHORT)
    assert stopped.value.code == 2
    job, line = capsys.readouterr().err.splitlines()
    assert "scheme=both" in job
    assert line == "error: scheme = 'both': expected one of hybrid, relay, jamming"
    assert [run.name for run in runs(tmp_path)] == ["1_two_clusters_ddpg_0"]


@pytest.mark.slow
def test_submitit_trains_the_same(tmp_path: Path) -> None:
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    for name, arguments in {"here": [], "there": ["hydra/launcher=submitit_local"]}.items():
        (tmp_path / name).mkdir()
        command = [sys.executable, str(RECIPES / "train.py"), "-m", "seed=0,1"]
        command += ["algorithm=ddpg,td3", *SHORT, *arguments]
        subprocess.run(command, cwd=tmp_path / name, check=True, timeout=1200)
    here, there = runs(tmp_path / "here"), runs(tmp_path / "there")
    assert [run.name for run in there] == [run.name for run in here] == NAMES
    for one, other in zip(here, there, strict=True):
        expected, found = (RunDirectory(run).metrics() for run in (one, other))
        pd.testing.assert_frame_equal(
            found.drop(columns="seconds"), expected.drop(columns="seconds"), check_exact=True
        )


EPISODES = 400
LONG = ("seed=0,1", f"training.num_episodes={EPISODES}", "training.checkpoint_every=0")


def begin(directory: Path, *launcher: str) -> psutil.Popen:
    """A sweep of two jobs in ``sweep/``, long enough to be disturbed."""
    command = [sys.executable, str(RECIPES / "train.py"), "-m", *SHORT, *LONG, *launcher]
    return psutil.Popen(
        [*command, "hydra.sweep.dir=sweep"], cwd=directory, stderr=subprocess.PIPE, text=True
    )


def episodes(run: Path) -> list[int]:
    return [int(number) for number in readable_metrics(run / "metrics.csv")["episode"]]


def wait_for_episode(number: int, run: Path, sweep: psutil.Popen) -> None:
    while len(episodes(run)) < number:
        assert sweep.poll() is None
        time.sleep(0.05)


def worker(run: Path, sweep: psutil.Popen) -> psutil.Process:
    """The process that trains a job of a sweep."""
    metrics = str(run / "metrics.csv")
    (found,) = (
        process
        for process in sweep.children(recursive=True)
        if metrics in {file.path for file in process.open_files()}
    )
    return found


@pytest.mark.slow
def test_a_job_that_is_taken_away_and_put_back_into_the_queue_goes_on(tmp_path: Path) -> None:
    """By the signals that SLURM sends: SIGTERM, and then the one at which submitit puts it back."""
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    run = tmp_path / "sweep" / NAMES[0]
    sweep = begin(tmp_path, "hydra/launcher=submitit_local")
    wait_for_episode(20, run, sweep)
    trains = worker(run, sweep)
    trains.send_signal(signal.SIGTERM)
    wait_for_episode(len(episodes(run)) + 20, run, sweep)
    trains.send_signal(signal.SIGUSR2)
    _, said = sweep.communicate(timeout=600)
    assert sweep.returncode == 0, said
    for run in (tmp_path / "sweep").glob("*_*"):
        assert episodes(run) == list(range(1, EPISODES + 1))
    logs = [file.read_text() for file in (tmp_path / "sweep" / ".submitit").rglob("*.out")]
    assert sum("this training goes on after episode " in log for log in logs) == 1
