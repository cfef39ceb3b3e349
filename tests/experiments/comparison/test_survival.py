"""Real workers that are killed: the comparison ends with the numbers of an undisturbed one."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pandas as pd
import psutil
import pytest

pytestmark = pytest.mark.slow

RECIPE = Path(__file__).parents[3] / "recipes" / "compare.py"
ASKED = [
    "algorithm=[ddpg,sac]",
    "scenario=two_clusters",
    "scheme=[hybrid,relay]",
    "num_slots=8",
    "learners=2",
    "shard_learners=2",
    "training.num_episodes=60",
    "training.batch_size=8",
    "training.evaluation_every=2",
    "training.evaluation_episodes=3",
    "training.compile=never",
    "training.cohorts=1",
    "evaluation.episodes=4",
    "evaluation.resolution=10",
]
MINUTES = 60.0


@pytest.fixture(scope="module")
def start() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Begin a comparison in a process of its own, which ends with the tests."""
    begun: list[subprocess.Popen[str]] = []

    def start(directory: Path, *arguments: str) -> subprocess.Popen[str]:
        command = [sys.executable, str(RECIPE), *ASKED, f"output={directory}", *arguments]
        pipe = subprocess.PIPE
        begun.append(subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True))
        return begun[-1]

    yield start
    for process in begun:
        process.kill()


@pytest.fixture(scope="module")
def undisturbed(
    start: Callable[..., subprocess.Popen[str]], tmp_path_factory: pytest.TempPathFactory
) -> list[pd.DataFrame]:
    """The tables of one process that nobody disturbs."""
    directory = tmp_path_factory.mktemp("undisturbed")
    finish(start(directory, "workers=1"))
    return tables(directory)


def finish(process: subprocess.Popen[str]) -> str:
    printed, errors = process.communicate(timeout=20 * MINUTES)
    assert process.returncode == 0, printed + errors
    return errors


def tables(directory: Path) -> list[pd.DataFrame]:
    """What does not depend on the clock."""
    read = [pd.read_parquet(directory / f"{name}.parquet") for name in ("results", "curves")]
    clock = ("seconds", "seconds_to_threshold")
    return [table.drop(columns=[name for name in clock if name in table]) for table in read]


def assert_equal(directory: Path, expected: list[pd.DataFrame]) -> None:
    for table, other in zip(tables(directory), expected, strict=True):
        pd.testing.assert_frame_equal(table, other, check_exact=True)


def wait_for_checkpoint(directory: Path) -> Path:
    """The first shard under way that has one and has begun to report."""
    limit = time.monotonic() + 10 * MINUTES
    while time.monotonic() < limit:
        for metrics in directory.glob("shards/*.partial/metrics.csv"):
            begun = (metrics.parent / "checkpoints/last.pt").exists()
            if begun and metrics.read_bytes().count(b"\n") > 1:
                return metrics.parent
        time.sleep(0.05)
    raise AssertionError("no shard was under way")


def worker_on(shard: Path, driver: subprocess.Popen[str]) -> psutil.Process:
    """The process that has the shard's metrics open."""
    for process in psutil.Process(driver.pid).children(recursive=True):
        try:
            opened = {Path(file.path) for file in process.open_files()}
        except psutil.Error:
            continue
        if shard / "metrics.csv" in opened:
            return process
    raise AssertionError("nobody writes it")


@pytest.mark.parametrize("engine", ["processes", "ray"])
def test_a_killed_worker_changes_no_number(
    start: Callable[..., subprocess.Popen[str]],
    undisturbed: list[pd.DataFrame],
    tmp_path: Path,
    engine: str,
) -> None:
    if engine == "ray":
        pytest.importorskip("ray")
    driver = start(tmp_path, f"engine={engine}", "workers=2")
    shard = wait_for_checkpoint(tmp_path)
    begun = (shard / "config.yaml").stat().st_mtime_ns
    worker_on(shard, driver).kill()
    assert finish(driver) == ""
    assert_equal(tmp_path, undisturbed)
    finished = shard.with_suffix("")
    assert (finished / "config.yaml").stat().st_mtime_ns == begun  # it went on from its checkpoint
    written = {file: file.stat().st_mtime_ns for file in (tmp_path / "shards").rglob("*")}
    finish(start(tmp_path, "workers=1"))
    assert {file: file.stat().st_mtime_ns for file in (tmp_path / "shards").rglob("*")} == written


def test_a_shard_that_loses_every_worker_is_reported_and_the_rest_completed(
    start: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    driver = start(tmp_path, "workers=2", "retries=0")
    shard = wait_for_checkpoint(tmp_path)
    worker_on(shard, driver).kill()
    printed, errors = driver.communicate(timeout=20 * MINUTES)
    assert driver.returncode == 1
    assert errors == f"failed: {shard.stem}: its process was killed\n"
    assert len(pd.read_parquet(tmp_path / "results.parquet")) == 6
    assert "All cells" in printed


def test_a_killed_comparison_leaves_no_orphan_and_goes_on_when_called_again(
    start: Callable[..., subprocess.Popen[str]], undisturbed: list[pd.DataFrame], tmp_path: Path
) -> None:
    driver = start(tmp_path, "workers=2")
    wait_for_checkpoint(tmp_path)
    workers = psutil.Process(driver.pid).children(recursive=True)
    os.kill(driver.pid, signal.SIGKILL)
    gone, alive = psutil.wait_procs(workers, timeout=5 * MINUTES)
    assert gone
    assert not alive
    finish(start(tmp_path, "workers=2"))
    assert_equal(tmp_path, undisturbed)
