"""A recipe ends in one line even while it is still loading."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from hyuav._support.loading import SELDOM

RECIPES = sorted((Path(__file__).parents[2] / "recipes").glob("*.py"))
SOURCE = Path(__file__).parents[2] / "src"

COMPARISON = (
    *("algorithm=[ddpg,sac]", "scenario=two_clusters", "num_slots=8", "learners=1", "workers=2"),
    *("training.num_episodes=100000", "evaluation.resolution=10", "output=here"),
)


COMMAND = "import sys; from hyuav.cli import main; sys.exit(main())"


def start(directory: Path, recipe: str, *arguments: str) -> subprocess.Popen[str]:
    """A recipe in a process of its own, and in a group of its own as on a terminal.

    Args:
        directory: in which it works.
        recipe: its name, or "hyuav" with its name among the arguments.
    """
    by_path = {path.stem: [str(path)] for path in RECIPES}
    program = by_path.get(recipe, ["-c", COMMAND])
    return subprocess.Popen(
        [sys.executable, *program, *arguments],
        cwd=directory,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_for(process: psutil.Process, library: str) -> None:
    """Return when a process has a library in its memory."""
    while not any(library in region.path for region in process.memory_maps()):
        assert process.status() != psutil.STATUS_ZOMBIE
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("call", "library"),
    [
        *(([path.stem], "libtorch") for path in RECIPES),
        (["train"], "pandas"),
        (["hyuav", "train"], "libtorch"),
    ],
)
def test_an_interruption_while_it_is_loading_is_told_in_one_line(
    tmp_path: Path, call: list[str], library: str
) -> None:
    running = start(tmp_path, *call)
    wait_for(psutil.Process(running.pid), library)
    os.killpg(running.pid, signal.SIGINT)
    assert running.communicate() == ("", "interrupted\n")
    assert running.returncode == 130
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_workers_that_are_still_loading_say_nothing(tmp_path: Path) -> None:
    running = start(tmp_path, "compare", *COMPARISON)
    process = psutil.Process(running.pid)
    workers: list[psutil.Process] = []
    while not workers:
        assert running.poll() is None
        workers = [own for own in process.children() if "spawn_main" in " ".join(own.cmdline())]
        time.sleep(0.01)
    wait_for(workers[0], "libtorch")
    os.killpg(running.pid, signal.SIGINT)
    _, said = running.communicate()
    assert said.startswith("interrupted; go on with: ")
    assert said.count("\n") == 1
    assert running.returncode == 130
    assert not psutil.wait_procs(workers, timeout=60)[1]


def test_an_algorithm_of_ones_own_that_is_missing_is_told_in_one_line(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(RECIPES[0].with_name("train.py")), "algorithm=own.py:Own"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == "error: algorithm = 'own.py': expected a Python file\n"
    assert done.returncode == 2


def said_by(statements: str) -> list[str]:
    """What is left on the standard error by a program that begins as a recipe does."""
    return subprocess.run(
        [sys.executable, "-c", f"import signal; {statements}"],
        env={**os.environ, "PYTHONPATH": str(SOURCE)},
        capture_output=True,
        text=True,
        check=False,
    ).stderr.splitlines()


@pytest.mark.parametrize(
    ("statements", "last"),
    [
        ("raise ValueError('no')", "ValueError: no"),
        ("program.loaded(); signal.raise_signal(signal.SIGINT)", "KeyboardInterrupt"),
    ],
)
def test_what_is_no_mistake_of_the_user_keeps_its_traceback(statements: str, last: str) -> None:
    heed = "signal.signal(signal.SIGINT, signal.default_int_handler)"  # a shell may have it ignored
    first, *_, told = said_by(f"{heed}; from hyuav._support import program, start; {statements}")
    assert first == "Traceback (most recent call last):"
    assert told == last


def test_a_signal_that_is_ignored_stays_so() -> None:
    ignore = "signal.signal(signal.SIGINT, signal.SIG_IGN)"
    assert (
        said_by(f"{ignore}; from hyuav._support import start; signal.raise_signal(signal.SIGINT)")
        == []
    )


def test_garbage_is_collected_as_ever_once_all_is_loaded() -> None:
    ask = "print(gc.get_threshold(), gc.get_freeze_count() > 0, file=sys.stderr)"
    begin = "from hyuav._support import program, start"
    said = said_by(f"import gc, sys; {ask}; {begin}; {ask}; program.loaded(); {ask}")
    before, loading, after = said
    assert before.endswith("False")
    assert loading == f"{SELDOM} False"
    assert after == before.replace("False", "True")
