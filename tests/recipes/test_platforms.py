"""The command works where the system lacks what only Unix has."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

POSIX = """
import os, signal, sys

# Ray is for Linux' sake here: as a part of it, it asks for more than Windows would have it do.
for module in ("fcntl", "grp", "pty", "pwd", "ray", "resource", "syslog", "termios", "tty"):
    sys.modules[module] = None
for owner, names in (
    (os, "O_CLOEXEC O_NONBLOCK fork forkpty killpg nice sched_getaffinity setsid sysconf"),
    (signal, "SIGHUP SIGKILL SIGQUIT SIGUSR1 SIGUSR2"),
):
    for name in names.split():
        if hasattr(owner, name):
            delattr(owner, name)
"""
"""What Python runs first: it takes away what Windows has not."""


def called(directory: Path, *words: str) -> str:
    (directory / "sitecustomize.py").write_text(POSIX, "utf-8")
    path = os.pathsep.join([str(directory), *sys.path])
    ended = subprocess.run(
        [sys.executable, "-c", "from hyuav.cli import main; main()", *words],
        cwd=directory,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_help_is_given(tmp_path: Path) -> None:
    assert "hyuav COMMAND" in called(tmp_path, "--help")
    assert "NAME=VALUE" in called(tmp_path, "train", "--help")


@pytest.mark.slow
def test_a_run_is_trained_and_flown(tmp_path: Path) -> None:
    few = ("training.num_episodes=2", "training.evaluation_episodes=2", "logger.mode=disabled")
    called(tmp_path, "train", "hydra.run.dir=run", "algorithm.hidden_sizes=[4]", *few)
    assert (tmp_path / "run" / "metrics.csv").read_text("utf-8").count("\n") == 3
    called(tmp_path, "evaluate", "run=run", "evaluation.episodes=2", "evaluation.resolution=20")
    assert (tmp_path / "run" / "evaluation.json").is_file()


def test_the_benchmarks_worker_loads(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(POSIX, "utf-8")
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2]), *sys.path])
    environment = os.environ | {"PYTHONPATH": path}
    code = "from benchmarks.worker import peak_memory; print(peak_memory())"
    subprocess.run([sys.executable, "-c", code], env=environment, check=True)
