"""A finished training that goes on for more episodes."""

import io
import shutil
from pathlib import Path

import pytest
from rich.console import Console

from hyuav import InputError
from hyuav.experiments import train as module
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.train import resume, train
from killed_training import OFF, differences, outcome, small

SILENT = Console(file=io.StringIO())


def asked_for(num_episodes: int) -> RunConfiguration:
    """Evaluated after every third episode, with a warm-up and repeated flights."""
    return small("never", num_episodes)


@pytest.fixture(scope="module")
def at_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return train(tmp_path_factory.mktemp("whole") / "run", asked_for(9), OFF, SILENT).path


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    request = {"threads": 1, "training": {"num_episodes": 6}}
    directory = tmp_path_factory.mktemp("part") / "run"
    return train(directory, asked_for(6), OFF, SILENT, request=request).path


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> RunDirectory:
    return RunDirectory(shutil.copytree(finished, tmp_path / "run"))


def test_six_episodes_and_three_more_are_nine_bit_for_bit(run: RunDirectory, at_once: Path) -> None:
    resume(run.path, OFF, SILENT, num_episodes=9)
    assert differences(outcome(run.path), outcome(at_once)) == []
    assert run.configuration() == asked_for(9)
    assert run.request()["threads"] == 1  # what else was asked for stays
    resume(run.path, OFF, SILENT)  # which has nothing left to do
    assert differences(outcome(run.path), outcome(at_once)) == []


def test_an_extension_that_is_killed_at_once_goes_on_as_extended(
    run: RunDirectory, at_once: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def kill(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(module, "_train", kill)
        with pytest.raises(KeyboardInterrupt):
            resume(run.path, OFF, SILENT, num_episodes=9)
    assert not list(run.path.rglob("*.partial"))
    resume(run.path, OFF, SILENT)
    assert differences(outcome(run.path), outcome(at_once)) == []


@pytest.mark.parametrize(
    ("episodes", "line"),
    [
        (5, r"^num_episodes = 5: expected at least the 6 episodes that are trained already$"),
        (0, r"^num_episodes = 0: expected a whole number >= 1$"),
        ("many", r"^num_episodes = 'many': expected a whole number >= 1$"),
    ],
)
def test_what_is_trained_stays_trained(run: RunDirectory, episodes: int, line: str) -> None:
    before = {path: path.read_bytes() for path in run.path.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=line):
        resume(run.path, OFF, SILENT, num_episodes=episodes)
    assert {path: path.read_bytes() for path in run.path.rglob("*") if path.is_file()} == before


def test_the_number_that_is_trained_already_is_taken_and_nothing_is_done(
    run: RunDirectory, finished: Path
) -> None:
    resume(run.path, OFF, SILENT, num_episodes=6)
    assert differences(outcome(run.path), outcome(finished)) == []
